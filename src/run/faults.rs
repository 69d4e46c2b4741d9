//! Values that are no numbers: a fault of whoever rendered them, never a reason to
//! leave a metric out.

use crate::{
    metrics::{
        judge::Pair,
        regions::{Region, Regions},
    },
    render::{Frame, RenderError},
};

/// Refuses NaN and infinity in the pixels of a view that see a surface.
pub(super) fn check(
    values: &[f32],
    sees: impl Fn(u32) -> bool,
    regions: &Regions,
    replicate: u32,
    width: u32,
) -> Result<(), RenderError> {
    let mut faulty = regions.pixels(Region::All).iter().filter(|&&i| sees(i) && !values[i as usize].is_finite());
    let Some(&first) = faulty.next() else { return Ok(()) };
    let (x, y) = (first % width, first / width);
    Err(RenderError::NotFinite { count: 1 + faulty.count(), replicate, x, y, value: values[first as usize] })
}

/// Refuses them in a frame. What it does not see itself may be NaN: at an edge, two
/// renderers may disagree by a pixel.
pub(super) fn check_frame(frame: &Frame, regions: &Regions, replicate: u32) -> Result<(), RenderError> {
    check(&frame.values, |i| frame.seen[i as usize] != u32::MAX, regions, replicate, frame.resolution[0])
}

/// Refuses them in replicates of the judge.
pub(super) fn check_judge(pairs: &[Pair], regions: &Regions, width: u32) -> Result<(), String> {
    for (replicate, pair) in (0..).zip(pairs) {
        for (image, which) in [(&pair.with, "in place"), (&pair.without, "taken away")] {
            check(image, |_| true, regions, replicate, width)
                .map_err(|e| format!("the judge failed, with the occluder {which}: {e}"))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Geometry, gbuffer::GBuffer};

    #[test]
    fn the_judge_is_checked_like_any_renderer() {
        let scene = crate::scenes::library::scene("plane").unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
        let (pixels, width) = (gbuffer.surfaces.len(), gbuffer.resolution[0]);
        let mut pairs = vec![Pair { with: vec![0.5; pixels], without: vec![0.5; pixels] }; 3];
        assert_eq!(check_judge(&pairs, &regions, width), Ok(()));
        pairs[2].without[width as usize + 5] = f32::INFINITY;
        pairs[2].without[width as usize + 7] = f32::NAN;
        let why = check_judge(&pairs, &regions, width).unwrap_err();
        assert!(why.contains("taken away: 2 values of replicate 2") && why.contains("pixel (5, 1): inf"), "{why}");
    }
}
