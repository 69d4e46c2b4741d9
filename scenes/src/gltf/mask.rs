//! Alpha masks as cut-outs in the geometry, so that no renderer needs alpha.
//!
//! A triangle is laid over the texture's grid of texels and cut into the
//! rectangles that are opaque. Where it covers more than [`CELLS`] rows or
//! columns, blocks of texels are taken together by their mean alpha.

use super::accessor::Budget;
use crate::{Mesh, Texture, Wrap, mesh::has_area};
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::rc::Rc;

/// Most rows and most columns that one triangle is cut into.
const CELLS: f64 = 256.0;

/// Repeats of the texture over one triangle beyond which only its mean is asked.
const REPEATS: f64 = 1024.0;

/// What decides where a surface is.
pub(super) struct Mask {
    /// Alpha from which on it is.
    pub cutoff: f32,
    /// The material's own alpha; multiplies the texture's.
    pub alpha: f32,
    /// The texture's alpha, where there is a texture.
    pub texture: Option<Rc<AlphaSums>>,
}

/// Sums of a texture's alpha over all rectangles from its corner, so that the
/// mean over any rectangle of the endless texture takes a few look-ups.
pub(super) struct AlphaSums {
    size: [i64; 2],
    wrap: [Wrap; 2],
    sums: Vec<u64>,
}

impl AlphaSums {
    pub(super) fn new(texture: &Texture) -> Self {
        let [w, h] = texture.size.map(|n| n as usize);
        let mut sums = vec![0; (w + 1) * (h + 1)];
        for y in 0..h {
            let mut row = 0;
            for x in 0..w {
                row += u64::from(texture.texels[y * w + x][3]);
                sums[(y + 1) * (w + 1) + x + 1] = sums[y * (w + 1) + x + 1] + row;
            }
        }
        AlphaSums { size: [w as i64, h as i64], wrap: texture.wrap, sums }
    }

    /// Sum over the texels from the origin to (x, y) of the endless texture.
    fn sum(&self, x: i64, y: i64) -> i128 {
        let [w, h] = self.size;
        let rows = prefix(y, h, self.wrap[1]);
        let at = |x: i64, y: i64| i128::from(self.sums[(y * (w + 1) + x) as usize]);
        let column = |x: i64| rows.iter().map(|&(n, y)| i128::from(n) * at(x, y)).sum::<i128>();
        prefix(x, w, self.wrap[0]).iter().map(|&(n, x)| i128::from(n) * column(x)).sum()
    }

    /// Mean alpha, 0 to 1, of a block of texels.
    fn mean(&self, [x0, y0]: [i64; 2], [x1, y1]: [i64; 2]) -> f64 {
        let sum = self.sum(x1, y1) - self.sum(x0, y1) - self.sum(x1, y0) + self.sum(x0, y0);
        sum as f64 / ((x1 - x0) * (y1 - y0)) as f64 / 255.0
    }
}

/// The sum over the first `x` texels of an endless row as sums over the first so
/// many of the `n` there are: how often each is taken, and how many it is over.
fn prefix(x: i64, n: i64, wrap: Wrap) -> [(i64, i64); 2] {
    match wrap {
        Wrap::Repeat => [(x.div_euclid(n), n), (1, x.rem_euclid(n))],
        Wrap::Mirror => match (x.div_euclid(2 * n), x.rem_euclid(2 * n)) {
            (q, r) if r <= n => [(2 * q, n), (1, r)],
            // The way back takes away again what it has not yet come to.
            (q, r) => [(2 * q + 2, n), (-1, 2 * n - r)],
        },
        Wrap::Clamp if x < 0 => [(x, 1), (0, 0)],
        Wrap::Clamp if x > n => [(x - n + 1, n), (n - x, n - 1)],
        Wrap::Clamp => [(1, x), (0, 0)],
    }
}

/// A point of a triangle: where it is on the grid, and how much of each corner it is.
#[derive(Clone, Copy)]
struct Point {
    at: DVec2,
    weights: DVec3,
}

/// Cells `min` to `max`, the latter not included.
#[derive(Clone, Copy)]
struct Block {
    min: [i64; 2],
    max: [i64; 2],
}

impl Mask {
    /// The opaque part of a mesh.
    pub(super) fn cut(&self, mesh: &Mesh, budget: &Budget) -> Result<Mesh, String> {
        let Some(texture) = &self.texture else {
            return Ok(if self.opaque(1.0) { mesh.clone() } else { Mesh::default() });
        };
        let mut out = Mesh { positions: mesh.positions.clone(), uvs: mesh.uvs.clone(), ..Mesh::default() };
        for &triangle in &mesh.triangles {
            let corners = triangle.map(|i| mesh.positions[i as usize]);
            let uvs = triangle.map(|i| mesh.uvs[i as usize]);
            match self.opaque_part(texture, uvs) {
                Part::Whole => out.triangles.push(triangle),
                Part::Pieces(pieces) => {
                    for piece in pieces {
                        budget.take(4 * piece.len() as u64)?;
                        push_piece(&mut out, &piece, corners, uvs);
                    }
                }
            }
        }
        Ok(compacted(&out))
    }

    fn opaque(&self, alpha: f64) -> bool {
        alpha * f64::from(self.alpha) >= f64::from(self.cutoff)
    }

    /// Which part of a triangle with these texture coordinates is there.
    fn opaque_part(&self, texture: &AlphaSums, uvs: [Vec2; 3]) -> Part {
        let whole = |is: bool| if is { Part::Whole } else { Part::Pieces(Vec::new()) };
        let [w, h] = texture.size;
        let lowest = uvs.map(Vec2::as_dvec2).into_iter().fold(DVec2::INFINITY, DVec2::min);
        let high = uvs.map(Vec2::as_dvec2).into_iter().fold(DVec2::NEG_INFINITY, DVec2::max);
        // Whole repeats are taken off, so that what is far out loses no digits.
        let repeats = |k: usize| match texture.wrap[k] {
            Wrap::Repeat => lowest[k].floor(),
            Wrap::Mirror => 2.0 * (lowest[k] / 2.0).floor(),
            Wrap::Clamp => 0.0,
        };
        let low = DVec2::new(repeats(0), repeats(1));
        if (high - low).max_element() > REPEATS || (lowest - low).min_element() < -REPEATS {
            return whole(self.opaque(texture.mean([0, 0], [w, h])));
        }
        let texels = uvs.map(|uv| (uv.as_dvec2() - low) * DVec2::new(w as f64, h as f64));
        let (min, max) = (texels[0].min(texels[1]).min(texels[2]), texels[0].max(texels[1]).max(texels[2]));
        if (texels[1] - texels[0]).perp_dot(texels[2] - texels[0]) == 0.0 {
            let middle = ((min + max) / 2.0).floor().as_i64vec2().to_array();
            return whole(self.opaque(texture.mean(middle, [middle[0] + 1, middle[1] + 1])));
        }
        let step = ((max - min) / CELLS).ceil().max(DVec2::ONE);
        let from = (min / step).floor().as_i64vec2().to_array();
        let to = ((max / step).floor() + 1.0).as_i64vec2().to_array();
        let [sx, sy] = step.as_i64vec2().to_array();
        let cell = |x: i64, y: i64| self.opaque(texture.mean([x * sx, y * sy], [(x + 1) * sx, (y + 1) * sy]));
        let blocks = blocks(Block { min: from, max: to }, cell);
        if matches!(blocks.as_slice(), [b] if b.min == from && b.max == to) {
            return Part::Whole;
        }
        let corner = |k: usize| Point { at: texels[k] / step, weights: DVec3::AXES[k] };
        let triangle = [corner(0), corner(1), corner(2)];
        Part::Pieces(blocks.into_iter().map(|b| clip(&triangle, b)).filter(|p| p.len() > 2).collect())
    }
}

/// The mesh without the vertices that no triangle names any more, which would
/// make its bounds too large.
fn compacted(mesh: &Mesh) -> Mesh {
    let mut places = vec![None; mesh.positions.len()];
    let mut out = Mesh::default();
    for triangle in &mesh.triangles {
        let moved = triangle.map(|i| {
            *places[i as usize].get_or_insert_with(|| {
                out.uvs.push(mesh.uvs[i as usize]);
                out.push_vertex(mesh.positions[i as usize])
            })
        });
        out.triangles.push(moved);
    }
    out
}

/// What is left of a triangle.
enum Part {
    Whole,
    Pieces(Vec<Vec<Point>>),
}

/// The opaque cells as few rectangles: runs in a row, joined with the same run
/// in the rows above.
fn blocks(area: Block, opaque: impl Fn(i64, i64) -> bool) -> Vec<Block> {
    let (mut done, mut open): (Vec<Block>, Vec<Block>) = (Vec::new(), Vec::new());
    for y in area.min[1]..area.max[1] {
        let mut next = Vec::new();
        let mut x = area.min[0];
        while x < area.max[0] {
            if !opaque(x, y) {
                x += 1;
                continue;
            }
            let start = x;
            while x < area.max[0] && opaque(x, y) {
                x += 1;
            }
            let above = open.iter().position(|b| b.min[0] == start && b.max[0] == x);
            let top = above.map_or(y, |i| open.swap_remove(i).min[1]);
            next.push(Block { min: [start, top], max: [x, y + 1] });
        }
        done.append(&mut open);
        open = next;
    }
    done.append(&mut open);
    done
}

/// The part of a convex polygon within a block, in the same sense of rotation.
fn clip(polygon: &[Point], block: Block) -> Vec<Point> {
    let mut points = polygon.to_vec();
    for axis in 0..2 {
        for (limit, sign) in [(block.min[axis] as f64, 1.0), (block.max[axis] as f64, -1.0)] {
            let inside = |p: &Point| (p.at[axis] - limit) * sign;
            let mut kept = Vec::with_capacity(points.len() + 1);
            for (i, a) in points.iter().enumerate() {
                let b = &points[(i + 1) % points.len()];
                let (da, db) = (inside(a), inside(b));
                if da >= 0.0 {
                    kept.push(*a);
                }
                if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
                    let t = da / (da - db);
                    let mut at = a.at.lerp(b.at, t);
                    // To the last bit, as the neighbouring piece has it too.
                    at[axis] = limit;
                    kept.push(Point { at, weights: a.weights.lerp(b.weights, t) });
                }
            }
            points = kept;
        }
    }
    points
}

/// Adds a piece as a fan; what has no area is left out.
fn push_piece(out: &mut Mesh, piece: &[Point], corners: [Vec3; 3], uvs: [Vec2; 3]) {
    let base = out.positions.len() as u32;
    for p in piece {
        let [a, b, c] = p.weights.to_array();
        let [pa, pb, pc] = corners.map(Vec3::as_dvec3);
        let [ua, ub, uc] = uvs.map(Vec2::as_dvec2);
        out.positions.push((pa * a + pb * b + pc * c).as_vec3());
        out.uvs.push((ua * a + ub * b + uc * c).as_vec2());
    }
    for k in 1..piece.len() as u32 - 1 {
        let triangle = [base, base + k, base + k + 1];
        if has_area(triangle.map(|i| out.positions[i as usize])) {
            out.triangles.push(triangle);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &Mesh) -> f64 {
        mesh.corners().map(|[a, b, c]| f64::from((b - a).cross(c - a).length()) / 2.0).sum()
    }

    fn checker(n: u32) -> Texture {
        let texels =
            (0..n * n).map(|i| [255, 255, 255, if (i % n + i / n).is_multiple_of(2) { 255 } else { 0 }]).collect();
        Texture { size: [n, n], wrap: [Wrap::Repeat; 2], texels }
    }

    fn quad(uv: f32) -> Mesh {
        let mut mesh = Mesh::default();
        mesh.push_quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        mesh.uvs = vec![Vec2::ZERO, Vec2::new(uv, 0.0), Vec2::splat(uv), Vec2::new(0.0, uv)];
        mesh
    }

    fn cut(texture: &Texture, mesh: &Mesh, cutoff: f32) -> Mesh {
        let mask = Mask { cutoff, alpha: 1.0, texture: Some(Rc::new(AlphaSums::new(texture))) };
        mask.cut(mesh, &Budget::new()).unwrap()
    }

    #[test]
    fn half_of_a_checkerboard_is_left_and_lies_where_the_texels_are() {
        for (texels, repeats) in [(2, 1.0), (8, 1.0), (8, 3.0), (5, 0.7)] {
            let texture = checker(texels);
            let cut = cut(&texture, &quad(repeats), 0.5);
            cut.validate().unwrap();
            let mut covered = 0.0;
            let n = 400;
            for i in 0..n * n {
                let uv = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32 * repeats;
                let texel = (uv * texels as f32).floor().as_uvec2() % texels;
                covered += f64::from(u32::from((texel.x + texel.y).is_multiple_of(2))) / f64::from(n * n);
            }
            assert!((area(&cut) - covered).abs() < 5e-3, "{texels} {repeats}: {} {covered}", area(&cut));
            for [a, b, c] in cut.corners() {
                assert!((b - a).cross(c - a).z > 0.0, "the winding is kept");
                let at = ((a + b + c) / 3.0).truncate() * repeats * texels as f32;
                assert_eq!((at.x.floor() + at.y.floor()) as u32 % 2, 0);
            }
        }
    }

    #[test]
    fn many_texels_are_taken_together() {
        // A band of opaque rows over a texture of more rows than are cut apart.
        let (w, h) = (4, 4096);
        let texels = (0..w * h).map(|i| [0, 0, 0, if i / w >= h / 2 { 255 } else { 0 }]).collect();
        let cut = cut(&Texture { size: [w, h], wrap: [Wrap::Repeat; 2], texels }, &quad(100.0), 0.5);
        assert!(cut.triangles.len() < 3000, "{}", cut.triangles.len());
        assert!((area(&cut) - 0.5).abs() < 0.3);
    }

    #[test]
    fn opaque_textures_leave_the_mesh_alone_and_empty_ones_leave_nothing() {
        let texture = Texture { size: [2, 2], wrap: [Wrap::Repeat; 2], texels: vec![[0, 0, 0, 255]; 4] };
        assert_eq!(cut(&texture, &quad(1.0), 0.5), quad(1.0));
        assert!(cut(&texture, &quad(1.0), 1.5).triangles.is_empty());
        assert_eq!(cut(&texture, &quad(1e30), 0.5).triangles.len(), 2);
    }

    #[test]
    fn the_mean_over_a_block_is_that_of_its_texels_however_it_wraps() {
        let texels = (0..15).map(|i| [0, 0, 0, (i * 37 % 256) as u8]).collect();
        let mut texture = Texture { size: [5, 3], wrap: [Wrap::Repeat; 2], texels };
        for u in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            for v in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
                texture.wrap = [u, v];
                let sums = AlphaSums::new(&texture);
                for (from, to) in [([-17, -9], [-3, -1]), ([-2, -7], [4, 8]), ([3, 1], [19, 11]), ([6, 4], [7, 5])] {
                    let (mut sum, mut n) = (0.0, 0.0);
                    for (x, y) in (from[0]..to[0]).flat_map(|x| (from[1]..to[1]).map(move |y| (x, y))) {
                        let uv = Vec2::new((x as f32 + 0.5) / 5.0, (y as f32 + 0.5) / 3.0);
                        sum += f64::from(texture.at(uv)[3]) / 255.0;
                        n += 1.0;
                    }
                    let found = sums.mean(from, to);
                    assert!((found - sum / n).abs() < 1e-12, "{u:?} {v:?} {from:?}: {found} {}", sum / n);
                }
            }
        }
    }

    #[test]
    fn a_clamped_mask_goes_on_beyond_its_edge() {
        // Clear on the left, opaque on the right.
        let halves = |wrap| Texture { size: [2, 1], wrap, texels: vec![[0; 4], [0, 0, 0, 255]] };
        let mut mesh = quad(1.0);
        mesh.uvs = mesh.uvs.iter().map(|uv| Vec2::new(uv.x * 4.0 - 1.0, uv.y)).collect();
        for (wrap, wanted) in [(Wrap::Clamp, 0.625), (Wrap::Repeat, 0.5), (Wrap::Mirror, 0.5)] {
            let cut = cut(&halves([wrap; 2]), &mesh, 0.5);
            assert!((area(&cut) - wanted).abs() < 1e-6, "{wrap:?}: {}", area(&cut));
        }
        mesh.uvs.iter_mut().for_each(|uv| uv.x = uv.x * 1e30 + 1e30);
        assert!(cut(&halves([Wrap::Clamp; 2]), &mesh, 0.5).triangles.len() <= 2);
    }

    #[test]
    fn texture_coordinates_below_zero_repeat() {
        let sums = AlphaSums::new(&checker(4));
        assert_eq!(sums.mean([-4, -4], [-3, -3]), 1.0);
        assert_eq!(sums.mean([-3, -4], [-2, -3]), 0.0);
        assert_eq!(sums.mean([-6, -5], [2, 7]), 0.5);
    }
}
