//! The measures of the house, and how finely it is cut.

use glam::Vec3;

/// Half the footprint along x and z, metres.
pub(super) const HALF: [f32; 2] = [15.0, 9.0];
/// The highest point.
pub(super) const TOP: f32 = 12.0;
/// The lowest point: the underside of the foundation.
pub(super) const BOTTOM: f32 = -0.3;
/// From the middle of the courtyard to the centre line of the colonnade.
pub(super) const COURT: [f32; 2] = [11.0, 5.0];
/// Half the thickness of the wall over the arches.
pub(super) const WALL: f32 = 0.3;
/// From the centre line of the colonnade to the back wall of the walk.
pub(super) const BACK: f32 = 3.5;
/// Half the width of an impost: what of a bay is no arch.
const IMPOST: f32 = 0.31;
/// How far a vault rises above the arches before it.
const OVER_ARCH: f32 = 0.12;

/// One storey of the colonnade.
#[derive(Clone, Copy)]
pub(super) struct Storey {
    /// Height of its floor.
    pub(super) floor: f32,
    /// Where its arches and vaults spring.
    pub(super) spring: f32,
    /// Where the wall over its arches ends, inside the slab above.
    pub(super) top: f32,
    /// Its columns' girth, against that of the lower ones.
    pub(super) girth: f32,
}

/// Lower and upper storey.
pub(super) const STOREYS: [Storey; 2] = [
    Storey { floor: 0.0, spring: 3.6, top: 5.9, girth: 1.0 },
    Storey { floor: 6.2, spring: 8.9, top: 11.3, girth: 0.86 },
];

/// One of the four sides. Its own coordinates are s along the colonnade, y up,
/// and d from the centre line of the colonnade outward.
#[derive(Clone, Copy)]
pub(super) struct Side {
    along: Vec3,
    out: Vec3,
    away: f32,
    /// Half the length of the colonnade, between its corner piers.
    pub(super) reach: f32,
    /// Openings between columns.
    pub(super) bays: u32,
}

impl Side {
    /// A point of the world.
    pub(super) fn at(&self, s: f32, y: f32, d: f32) -> Vec3 {
        self.along * s + Vec3::Y * y + self.out * (self.away + d)
    }

    /// From one column to the next.
    pub(super) fn pitch(&self) -> f32 {
        2.0 * self.reach / self.bays as f32
    }

    /// Radius of an arch.
    pub(super) fn arch(&self) -> f32 {
        self.pitch() / 2.0 - IMPOST
    }

    /// How high a vault rises.
    pub(super) fn vault(&self) -> f32 {
        self.arch() + OVER_ARCH
    }

    /// s of the column before bay `k`.
    pub(super) fn column(&self, k: u32) -> f32 {
        self.reach * (2.0 * k as f32 / self.bays as f32 - 1.0)
    }

    /// s of the middle of bay `k`.
    pub(super) fn bay(&self, k: u32) -> f32 {
        self.reach * ((2 * k + 1) as f32 / self.bays as f32 - 1.0)
    }

    /// Whether this is one of the long sides.
    pub(super) fn is_long(&self) -> bool {
        self.reach == COURT[0]
    }
}

/// All that the parts are made from.
pub(super) struct Plan {
    /// +z, +x, -z, -x: each a quarter turn on.
    pub(super) sides: [Side; 4],
    /// Cuts on a length: 1 is about 250 000 triangles.
    pub(super) detail: f64,
    /// The same for cloth.
    pub(super) cloth: f64,
}

impl Plan {
    /// A house with so many bays.
    pub(super) fn new([long, short]: [u32; 2]) -> Self {
        let side = |along: Vec3, out: Vec3, reach: f32, away: f32, bays| Side { along, out, away, reach, bays };
        let [x, z] = COURT;
        Plan {
            sides: [
                side(Vec3::X, Vec3::Z, x, z, long),
                side(Vec3::NEG_Z, Vec3::X, z, x, short),
                side(Vec3::NEG_X, Vec3::NEG_Z, x, z, long),
                side(Vec3::Z, Vec3::NEG_X, z, x, short),
            ],
            detail: 1.0,
            cloth: 1.0,
        }
    }

    /// How many cuts a thing gets that has `at_one` at detail 1.
    pub(super) fn cuts(&self, at_one: f64, least: u32) -> u32 {
        ((at_one * self.detail).round() as u32).max(least)
    }

    /// The same, even.
    pub(super) fn even(&self, at_one: f64, least: u32) -> u32 {
        2 * self.cuts(at_one / 2.0, least / 2)
    }

    /// Both storeys of every side.
    pub(super) fn arcades(&self) -> impl Iterator<Item = (Side, Storey)> + '_ {
        self.sides.iter().flat_map(|side| STOREYS.map(|storey| (*side, storey)))
    }
}

/// A number from 0 to 1 for a place, always the same one (Wang's hash).
pub(super) fn hash(a: u32, b: u32) -> f32 {
    let mut h = a.wrapping_mul(0x9E37_79B9) ^ b.wrapping_mul(0x85EB_CA6B);
    h = (h ^ 61) ^ (h >> 16);
    h = h.wrapping_mul(9);
    h ^= h >> 4;
    h = h.wrapping_mul(0x27D4_EB2D);
    h ^= h >> 15;
    (h >> 8) as f32 / (1 << 24) as f32
}
