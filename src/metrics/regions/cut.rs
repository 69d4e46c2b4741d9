//! Flanks that a view cuts off.

use super::{OccluderRegions, Region, Regions};

/// The flank of a measured occluder that goes on beyond the view's first or last
/// column, or may; `width` is the view's, `each` what
/// [`Finder::by_occluder`](super::Finder::by_occluder) finds.
///
/// An occluder is measured where some of its footprint is in view; where the view
/// shows one alone, that is. Its left flank is cut where the flank or the footprint
/// itself reaches the first column, its right flank where they reach the last. A
/// left flank at the last column lies beside what hangs beyond it, a neighbour out
/// of view, and cuts nothing that is measured; so with a right flank at the first.
/// Flanks may reach the first and the last row: a view shows a length of a sheet.
pub fn cut_flank(regions: &Regions, each: &[OccluderRegions], width: u32) -> Option<Region> {
    let cut = |own: &Regions| {
        [(Region::Left, 0), (Region::Right, width.saturating_sub(1))].into_iter().find_map(|(flank, column)| {
            let reaches = |region| own.pixels(region).iter().any(|i| i % width == column);
            (reaches(flank) || reaches(Region::Footprint)).then_some(flank)
        })
    };
    if each.is_empty() {
        return cut(regions);
    }
    each.iter().map(|o| &o.regions).filter(|own| !own.pixels(Region::Footprint).is_empty()).find_map(cut)
}

#[cfg(test)]
mod tests {
    use super::{super::Finder, *};
    use crate::render::{Geometry, gbuffer::GBuffer};
    use aogauge_scenes::{Scene, library};
    use glam::Vec3;

    /// The open curtain, 2 cm thick, with R = 0.25 m, and copies of it moved along
    /// the transect, in a view of so many columns of 5 mm.
    fn cut(columns: u32, moved: &[Vec3], alter: impl Fn(&mut Scene)) -> Option<Region> {
        let mut scene = library::scene("curtain-open").unwrap();
        let curtain = scene.objects.iter().find(|o| o.occluder).unwrap().clone();
        for (i, by) in moved.iter().enumerate() {
            let mut copy = curtain.clone();
            copy.name = format!("copy-{i}");
            copy.mesh.positions.iter_mut().for_each(|v| *v += *by);
            scene.objects.push(copy);
        }
        scene.measure.resolution[0] = columns;
        alter(&mut scene);
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let finder = Finder::new(&scene, &geometry.tracer);
        let regions = finder.regions(&gbuffer);
        cut_flank(&regions, &finder.by_occluder(&gbuffer, &regions), columns)
    }

    /// The flanks end at 0.1225 m, column 24.5 from the middle.
    #[test]
    fn a_view_must_hold_both_flanks_of_what_it_measures() {
        let none = |_: &mut Scene| {};
        assert_eq!(cut(208, &[], none), None);
        assert_eq!(cut(52, &[], none), None);
        assert_eq!(cut(46, &[], none), Some(Region::Left));
        assert_eq!(cut(52, &[], |s| s.measure.center.x = -0.03), Some(Region::Right));
        assert_eq!(cut(52, &[], |s| s.measure.center.x = 0.03), Some(Region::Left));
        // Too narrow to reach the flanks: the footprint fills it.
        assert_eq!(cut(4, &[], none), Some(Region::Left));
        // Turned along the curtain.
        assert_eq!(cut(52, &[], |s| s.measure.transect = Vec3::Z), Some(Region::Left));
    }

    /// The view reaches 0.52 m to each side.
    #[test]
    fn the_flank_of_a_neighbour_out_of_view_may_be_cut() {
        for side in [1.0, -1.0] {
            let at = |x: f32| [Vec3::X * (side * x)];
            // Its flank next to us crosses the border.
            assert_eq!(cut(208, &at(0.6), |_| {}), None);
            // Its outer flank does: it stands in view.
            let outer = if side > 0.0 { Region::Right } else { Region::Left };
            assert_eq!(cut(208, &at(0.44), |_| {}), Some(outer));
            // It stands across the border.
            assert_eq!(cut(208, &at(0.52), |_| {}), Some(outer));
            // In view with both its flanks.
            assert_eq!(cut(208, &at(0.38), |_| {}), None);
        }
        // Both neighbours out of view, and our own flank cut.
        let both = [Vec3::X * 0.6, Vec3::X * -0.6];
        assert_eq!(cut(208, &both, |_| {}), None);
        assert_eq!(cut(46, &both, |_| {}), Some(Region::Left));
    }
}
