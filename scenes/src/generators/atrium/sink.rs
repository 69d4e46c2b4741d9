//! Where triangles go, and the few patterns all of the atrium is made of.

use crate::Mesh;
use glam::{DVec3, Vec2, Vec3};

/// Takes triangles, or only counts them: the same code makes the atrium and
/// says beforehand how large it will be.
pub(super) struct Sink {
    keep: bool,
    mesh: Mesh,
    count: usize,
}

impl Sink {
    /// Keeps what it is given, or only counts it.
    pub(super) fn new(keep: bool) -> Self {
        Sink { keep, mesh: Mesh::default(), count: 0 }
    }

    /// Triangles so far.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// What was kept.
    pub(super) fn into_mesh(self) -> Mesh {
        self.mesh
    }

    fn vertex(&mut self, p: Vec3) -> u32 {
        self.mesh.push_vertex(p)
    }

    fn vertices(&mut self, [rows, columns]: [u32; 2], at: &impl Fn(u32, u32) -> Vec3) -> u32 {
        let base = self.mesh.positions.len() as u32;
        for i in 0..rows {
            self.mesh.positions.extend((0..columns).map(|j| at(i, j)));
        }
        base
    }

    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// A grid of `cells[0]` by `cells[1]` quadrilaterals between the points
    /// `at(i, j)`, facing di x dj.
    pub(super) fn grid(&mut self, cells: [u32; 2], at: impl Fn(u32, u32) -> Vec3) {
        self.count += 2 * cells[0] as usize * cells[1] as usize;
        if !self.keep {
            return;
        }
        let row = cells[1] + 1;
        let base = self.vertices([cells[0] + 1, row], &at);
        for i in 0..cells[0] {
            for j in 0..cells[1] {
                let a = base + i * row + j;
                self.quad([a, a + row, a + row + 1, a + 1]);
            }
        }
    }

    /// A closed body over a grid: what the grid is on one side, `back` on the
    /// other, joined all round.
    pub(super) fn plate(&mut self, cells: [u32; 2], front: impl Fn(u32, u32) -> Vec3, back: impl Fn(u32, u32) -> Vec3) {
        let [n, m] = cells;
        self.count += 4 * n as usize * m as usize + 4 * (n as usize + m as usize);
        if !self.keep {
            return;
        }
        let row = m + 1;
        let f = self.vertices([n + 1, row], &front);
        let b = self.vertices([n + 1, row], &back);
        for i in 0..n {
            for j in 0..m {
                let at = i * row + j;
                self.quad([f + at, f + at + row, f + at + row + 1, f + at + 1]);
                self.quad([b + at, b + at + 1, b + at + row + 1, b + at + row]);
            }
        }
        for i in 0..n {
            let (near, far) = (i * row, i * row + m);
            self.quad([f + near + row, f + near, b + near, b + near + row]);
            self.quad([f + far, f + far + row, b + far + row, b + far]);
        }
        for j in 0..m {
            let last = n * row + j;
            self.quad([f + j, f + j + 1, b + j + 1, b + j]);
            self.quad([f + last + 1, f + last, b + last, b + last + 1]);
        }
    }

    /// A closed body through `rings` rings of `points` points, facing di x dj,
    /// with a fan at each end.
    pub(super) fn loft(&mut self, rings: u32, points: u32, at: impl Fn(u32, u32) -> Vec3) {
        self.count += 2 * rings as usize * points as usize;
        if !self.keep {
            return;
        }
        let base = self.tube(rings - 1, rings, points, &at);
        let last = base + (rings - 1) * points;
        let centre = |i: u32| ((0..points).map(|j| at(i, j).as_dvec3()).sum::<DVec3>() / f64::from(points)).as_vec3();
        let (first, end) = (self.vertex(centre(0)), self.vertex(centre(rings - 1)));
        for j in 0..points {
            let next = (j + 1) % points;
            self.mesh.triangles.extend([[first, base + j, base + next], [end, last + next, last + j]]);
        }
    }

    /// The same, the last ring joined to the first: a ring-shaped body.
    pub(super) fn torus(&mut self, rings: u32, points: u32, at: impl Fn(u32, u32) -> Vec3) {
        self.count += 2 * rings as usize * points as usize;
        if self.keep {
            self.tube(rings, rings, points, &at);
        }
    }

    fn tube(&mut self, bands: u32, rings: u32, points: u32, at: &impl Fn(u32, u32) -> Vec3) -> u32 {
        let base = self.vertices([rings, points], at);
        for i in 0..bands {
            let (here, there) = (base + i * points, base + (i + 1) % rings * points);
            for j in 0..points {
                let next = (j + 1) % points;
                self.quad([here + j, there + j, there + next, here + next]);
            }
        }
        base
    }

    /// A grid whose first and last row are one point each.
    pub(super) fn leaf(&mut self, [rows, columns]: [u32; 2], at: impl Fn(u32, u32) -> Vec3) {
        self.count += 2 * columns as usize * (rows as usize - 1);
        if !self.keep {
            return;
        }
        let (first, end) = (self.vertex(at(0, 0)), self.vertex(at(rows, 0)));
        let row = columns + 1;
        let base = self.vertices([rows - 1, row], &|i, j| at(i + 1, j));
        let last = base + (rows - 2) * row;
        for j in 0..columns {
            self.mesh.triangles.extend([[first, base + j, base + j + 1], [end, last + j + 1, last + j]]);
            for i in 0..rows - 2 {
                let a = base + i * row + j;
                self.quad([a, a + row, a + row + 1, a + 1]);
            }
        }
    }

    /// A body of revolution about the axis through `foot` along +Y: `profile`
    /// holds radius and height over `foot`, from below.
    pub(super) fn revolve(&mut self, foot: Vec3, segments: u32, profile: &[Vec2]) {
        self.loft(profile.len() as u32, segments, |i, j| {
            let (cos, sin) = circle(f64::from(j) / f64::from(segments));
            let p = profile[i as usize];
            foot + Vec3::new(p.x * cos, p.y, p.x * sin)
        });
    }

    /// A closed box between two opposite corners.
    pub(super) fn block(&mut self, a: Vec3, b: Vec3) {
        self.count += 12;
        if self.keep {
            self.mesh.push_box(a.min(b), a.max(b));
        }
    }
}

/// Cosine and sine of a number of turns, from products and sums alone, so that
/// every platform makes the same bits; exact at quarter turns, and symmetric.
pub(super) fn circle(turns: f64) -> (f32, f32) {
    let turns = turns - turns.floor();
    let quarter = (turns * 4.0).round();
    let x = (turns - quarter / 4.0) * std::f64::consts::TAU;
    let y = x * x;
    let sin = x * (1.0 - y / 6.0 * (1.0 - y / 20.0 * (1.0 - y / 42.0 * (1.0 - y / 72.0 * (1.0 - y / 110.0)))));
    let cos = 1.0 - y / 2.0 * (1.0 - y / 12.0 * (1.0 - y / 30.0 * (1.0 - y / 56.0 * (1.0 - y / 90.0))));
    let (cos, sin) = match quarter as i64 % 4 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    };
    (cos as f32, sin as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_circle_is_round() {
        for k in -50..150 {
            let turns = f64::from(k) / 97.0;
            let (sin, cos) = (turns * std::f64::consts::TAU).sin_cos();
            let (c, s) = circle(turns);
            assert!((f64::from(c) - cos).abs() < 1e-7 && (f64::from(s) - sin).abs() < 1e-7, "{turns}");
        }
        assert_eq!(circle(0.25), (0.0, 1.0));
    }
}
