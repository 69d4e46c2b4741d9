//! A toy renderer: a ball on a floor, and the floor's openness by random rays.
//! `tests/goldens.rs` holds its images against goldens.

/// Pixels on a side.
pub const SIDE: usize = 64;

/// The ball's radius; it hovers a radius over the floor's middle.
const RADIUS: f64 = 0.3;

/// The floor from above, shaded: 8-bit sRGB colours, row by row.
pub fn shaded() -> Vec<[u8; 3]> {
    (0..SIDE * SIDE)
        .map(|i| {
            let [x, y] = place(i);
            let d2 = x * x + y * y;
            if d2 < RADIUS * RADIUS {
                // Lit from the upper left.
                let z = (RADIUS * RADIUS - d2).sqrt();
                let light = ((-x - y + 2.0 * z) / (6f64.sqrt() * RADIUS)).max(0.05);
                [light * 230.0, light * 120.0, light * 60.0].map(|v| v as u8)
            } else {
                let dark = 1.0 - 0.6 * RADIUS.powi(2) / d2;
                [dark * 200.0; 3].map(|v| v as u8)
            }
        })
        .collect()
}

/// Openness of the floor from `rays` random rays a pixel; another seed, other rays.
pub fn openness(seed: u64, rays: u32) -> Vec<f32> {
    (0..SIDE * SIDE)
        .map(|i| {
            let mut random = Random(seed.wrapping_mul(0x9e37_79b9).wrapping_add(i as u64) << 20);
            let open = (0..rays).filter(|_| !is_closed(place(i), [random.next(), random.next()])).count();
            open as f32 / rays as f32
        })
        .collect()
}

/// The middle of a pixel, -1 to 1.
fn place(pixel: usize) -> [f64; 2] {
    [pixel % SIDE, pixel / SIDE].map(|v| (v as f64 + 0.5) / SIDE as f64 * 2.0 - 1.0)
}

/// Whether a cosine-distributed ray from the floor meets the ball.
fn is_closed([x, y]: [f64; 2], [u, v]: [f64; 2]) -> bool {
    let (sin, turn) = (u.sqrt(), v * std::f64::consts::TAU);
    let ray = [sin * turn.cos(), sin * turn.sin(), (1.0 - u).sqrt()];
    let to = [-x, -y, 2.0 * RADIUS];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let along = dot(ray, to);
    along > 0.0 && dot(to, to) - along * along < RADIUS * RADIUS
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}
