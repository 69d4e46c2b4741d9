//! What screen-space methods of a scene are measured with: their camera, and the
//! measured pixels that it shows.

use super::{RunError, set::render_error};
use crate::{
    metrics::regions::{Region, Regions},
    record::ScreenRecord,
    render::{
        Estimator,
        gbuffer::GBuffer,
        screen_space::{Screen, UNSEEN},
    },
    scenes::{Scene, View},
    screen_camera::screen_camera,
    suite::{Method, Plan},
    trace::Tracer,
};

/// What the camera of screen-space methods shows.
#[derive(Clone, Debug)]
pub(super) struct Shown {
    /// Those of the measure view, less the pixels whose points it does not show.
    pub regions: Regions,
    pub record: ScreenRecord,
}

/// Whether a method works in screen space.
pub(super) fn is_on_screen(method: &Method) -> bool {
    matches!(method.estimator, Estimator::ScreenSpace(_))
}

impl Shown {
    /// The camera with what it shows; None for a suite without such methods.
    pub fn new(
        plan: &Plan<'_>,
        scene: &Scene,
        tracer: &Tracer,
        gbuffer: &GBuffer,
        regions: &Regions,
    ) -> Result<Option<(View, Self)>, RunError> {
        if !plan.suite.methods.iter().any(is_on_screen) {
            return Ok(None);
        }
        let camera = screen_camera(scene, tracer, gbuffer, regions);
        let screen = Screen::new(tracer, gbuffer, &scene.measure.view(), Some(&camera)).map_err(render_error(scene))?;
        let regions = regions.only(|pixel| screen.gathered[pixel as usize] != UNSEEN);
        let eye = camera.origin - scene.measure.center;
        let record = ScreenRecord {
            eye: eye.to_array().map(f64::from),
            resolution: camera.resolution,
            regions: Region::ALL.into_iter().map(|r| (r, regions.pixels(r).len())).collect(),
        };
        Ok(Some((camera, Shown { regions, record })))
    }
}
