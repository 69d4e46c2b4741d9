//! Pictures on surfaces, and what a triangle sees of them on the average.

use glam::{DVec3, Vec2, Vec3};
use std::sync::LazyLock;

/// How a texture goes on beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// It begins again.
    #[default]
    Repeat,
    /// Its last texels go on for ever.
    Clamp,
    /// It begins again, turned round every second time.
    Mirror,
}

impl Wrap {
    /// The texel, of `n`, that stands at a place on the endless row of texels.
    fn texel(self, at: f64, n: u32) -> u32 {
        let n = f64::from(n);
        let at = at.floor();
        let inside = match self {
            Wrap::Repeat => at.rem_euclid(n),
            Wrap::Clamp => at,
            Wrap::Mirror => {
                let at = at.rem_euclid(2.0 * n);
                if at < n { at } else { 2.0 * n - 1.0 - at }
            }
        };
        inside.clamp(0.0, n - 1.0) as u32
    }
}

/// An 8-bit picture and how it goes on beyond its edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width and height in texels, above zero.
    pub size: [u32; 2],
    /// Along u and along v.
    pub wrap: [Wrap; 2],
    /// Red, green, blue and alpha a texel, row by row from the top. Colours are
    /// sRGB encoded; alpha, metallic and roughness are linear.
    pub texels: Vec<[u8; 4]>,
}

impl Texture {
    /// The texel at texture coordinates; black and opaque where there is none.
    pub fn at(&self, uv: Vec2) -> [u8; 4] {
        let [w, h] = self.size;
        let column = self.wrap[0].texel(f64::from(uv.x) * f64::from(w), w);
        let row = self.wrap[1].texel(f64::from(uv.y) * f64::from(h), h);
        self.texels.get(row as usize * w as usize + column as usize).copied().unwrap_or([0, 0, 0, 255])
    }

    /// The colour at texture coordinates, a channel 0 to 1: bilinear between the
    /// centres of texels, in linear light.
    pub fn color(&self, uv: Vec2) -> Vec3 {
        self.between(uv, srgb)
    }

    /// The same of a picture that holds shares and no colours (roughness,
    /// metallic): its bytes are linear.
    pub fn shares(&self, uv: Vec2) -> Vec3 {
        self.between(uv, linear)
    }

    /// Twin: `between` of `gpu/shaders/materials.wgsl`, in single precision.
    fn between(&self, uv: Vec2, decode: fn(u8) -> f64) -> Vec3 {
        let [w, h] = self.size;
        let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
        let (x, y) = (f64::from(uv.x) * f64::from(w) - 0.5, f64::from(uv.y) * f64::from(h) - 0.5);
        let texel = |dx: f64, dy: f64| {
            let (column, row) = (self.wrap[0].texel(x + dx, w), self.wrap[1].texel(y + dy, h));
            let texel = self.texels.get(row as usize * w as usize + column as usize).copied().unwrap_or_default();
            DVec3::from_array([texel[0], texel[1], texel[2]].map(decode))
        };
        let (s, t) = (x - x.floor(), y - y.floor());
        let (upper, lower) = (texel(0.0, 0.0).lerp(texel(1.0, 0.0), s), texel(0.0, 1.0).lerp(texel(1.0, 1.0), s));
        upper.lerp(lower, t).as_vec3()
    }

    /// Mean over the whole picture: red, green and blue, decoded by `decode`.
    pub(crate) fn mean(&self, decode: fn(u8) -> f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for texel in &self.texels {
            for (sum, t) in sum.iter_mut().zip(texel) {
                *sum += decode(*t);
            }
        }
        sum.map(|s| s / self.texels.len().max(1) as f64)
    }
}

/// Linear light of an sRGB byte, 0 to 1.
pub fn srgb(byte: u8) -> f64 {
    static TABLE: LazyLock<[f64; 256]> = LazyLock::new(|| {
        std::array::from_fn(|i| {
            let v = i as f64 / 255.0;
            if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        })
    });
    TABLE[byte as usize]
}

/// Share of one that a byte means.
pub(crate) fn linear(byte: u8) -> f64 {
    f64::from(byte) / 255.0
}

/// Most parts of an edge that a triangle is read in: 1024 points.
const MOST_PARTS: f64 = 32.0;

/// Texture coordinates spread evenly over a triangle, about sixteen a texel of a
/// texture of `size`: one in each of the small triangles that its edges, cut into
/// equal parts, divide it into.
///
/// Where in its small triangle a point lies goes by the two-dimensional golden
/// ratio sequence: on a regular grid, a picture that repeats as often as the grid
/// would always be met in the same place.
pub(crate) fn points(uvs: [Vec2; 3], size: [u32; 2]) -> impl Iterator<Item = Vec2> {
    const STEP: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
    let [a, b, c] = uvs.map(Vec2::as_dvec2);
    let texels = glam::DVec2::new(size[0].into(), size[1].into());
    let (ab, ac) = ((b - a) * texels, (c - a) * texels);
    // A sliver covers few texels but may pass through many.
    let longest = ab.length().max(ac.length()).max((ac - ab).length());
    let covered = (ab.perp_dot(ac).abs() / 2.0).max(longest);
    let parts = (16.0 * covered).sqrt().ceil().clamp(1.0, MOST_PARTS);
    let k = parts as u32;
    // Of a row's small triangles every second one is turned over.
    let small = (0..k).flat_map(move |i| (0..2 * (k - i) - 1).map(move |s| (i, s / 2, s % 2 == 1)));
    small.enumerate().map(move |(n, (i, j, turned))| {
        let [u, v] = STEP.map(|step| (1.0 / 3.0 + n as f64 * step).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let (u, v) = if turned { (1.0 - u, 1.0 - v) } else { (u, v) };
        let (u, v) = ((f64::from(i) + u) / parts, (f64::from(j) + v) / parts);
        (a + (b - a) * u + (c - a) * v).as_vec2()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wrap_goes_on_as_it_says() {
        let row = |wrap: Wrap| (-4..7).map(|x| wrap.texel(f64::from(x) + 0.5, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
        assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            for far in [f64::NAN, f64::INFINITY, -1e30, 1e30] {
                assert!(wrap.texel(far, 3) < 3);
            }
        }
    }

    #[test]
    fn between_texels_light_is_linear_and_wraps() {
        let texels = vec![[0, 0, 0, 255], [255, 188, 51, 255]];
        let texture = |wrap| Texture { size: [2, 1], wrap: [wrap; 2], texels: texels.clone() };
        let near = |a: Vec3, b: [f32; 3]| assert!((a - Vec3::from_array(b)).abs().max_element() < 1e-3, "{a} {b:?}");
        let repeat = texture(Wrap::Repeat);
        near(repeat.color(Vec2::new(0.75, 0.5)), [1.0, 0.5029, 0.0331]);
        near(repeat.color(Vec2::new(0.5, 0.9)), [0.5, 0.2514, 0.0166]);
        near(repeat.shares(Vec2::new(0.5, 0.5)), [0.5, 188.0 / 510.0, 0.1]);
        near(repeat.color(Vec2::new(1.0, 0.5)), [0.5, 0.2514, 0.0166]);
        near(texture(Wrap::Clamp).color(Vec2::new(1.0, 0.5)), [1.0, 0.5029, 0.0331]);
        near(texture(Wrap::Clamp).color(Vec2::NAN), [0.0; 3]);
    }

    #[test]
    fn srgb_is_decoded() {
        assert_eq!((srgb(0), srgb(255)), (0.0, 1.0));
        // IEC 61966-2-1 puts 18 % grey at 118.
        assert!((srgb(118) - 0.18).abs() < 2e-3, "{}", srgb(118));
    }
}
