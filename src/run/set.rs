//! One scene of a plan, made ready.

use super::{
    MAX_GIB, RunError,
    occluders::Occluder,
    on_screen::Shown,
    subject::{Facts, Subject},
    unit::Unit,
};
use crate::{
    metrics::{
        artifact::{Converged, Method as Measured},
        regions::{Finder, Region, Regions, cut_flank},
    },
    render::{Geometry, RenderError, gbuffer::GBuffer, path},
    scenes::{Scene, View},
    suite::{Case, Plan},
};
use std::borrow::Cow;

/// Paths a pixel that look for any light at all.
const LIGHT_PATHS: u32 = 4;

/// One scene made ready: what is measured, and all that it takes to render it.
pub(super) struct Set<'a> {
    pub(super) subject: Subject<'a>,
    /// Near the origin.
    pub(super) scene: Cow<'a, Scene>,
    pub(super) geometry: Geometry,
    /// The scene without its occluder, traced from the same points; None where
    /// there is nothing to judge.
    pub(super) twin: Option<Geometry>,
    pub(super) view: View,
    pub(super) gbuffer: GBuffer,
    /// Where methods of screen space are computed.
    pub(super) camera: Option<View>,
}

impl<'a> Set<'a> {
    pub(super) fn new(plan: &'a Plan<'a>, given: &'a Scene) -> Result<Self, RunError> {
        let scene = given.near_origin();
        let name = || given.name.clone();
        let view = scene.measure.view();
        let cases = plan.cases.iter().filter(|c| c.scene == scene.name).count();
        let images = cases as f64 * f64::from(plan.suite.file.replicates.get());
        let gib = images * view.pixels() as f64 * 4.0 / f64::from(1 << 30);
        if gib > MAX_GIB {
            return Err(RunError::TooMuch { scene: name(), gib });
        }
        let geometry = Geometry::new(&scene).map_err(render_error(&scene))?;
        for method in plan.methods().into_iter().map(|m| &plan.suite.methods[m]) {
            geometry.suits(&method.estimator, scene.ao).map_err(render_error(&scene))?;
        }
        let gbuffer = GBuffer::new(&geometry.tracer, &view);
        let owner: Vec<usize> = scene.triangles().map(|(object, _)| object).collect();
        let mut seen = gbuffer.surfaces.iter().flatten().map(|s| &scene.objects[owner[s.triangle as usize]]);
        if let Some(object) = seen.find(|o| o.occluder) {
            return Err(RunError::SeesOccluder { scene: name(), object: object.name.clone() });
        }
        let finder = Finder::new(&scene, &geometry.tracer);
        let regions = finder.regions(&gbuffer);
        if regions.pixels(Region::All).is_empty() {
            return Err(RunError::SeesNothing { scene: name() });
        }
        let each = finder.by_occluder(&gbuffer, &regions);
        drop(finder);
        if let Some(flank) = cut_flank(&regions, &each, view.resolution[0]) {
            return Err(RunError::CutsFlank { scene: name(), flank: flank.label(), columns: view.resolution[0] });
        }
        let mut twin = None;
        if scene.has_occluder() {
            let mut bare = Geometry::new(&scene.twin()).map_err(render_error(&scene))?;
            bare.tracer.set_offset(geometry.tracer.offset());
            let lit = path::irradiance(&bare, &gbuffer, LIGHT_PATHS, plan.seed, 0).iter().any(|e| *e > 0.0);
            if !lit {
                return Err(RunError::NoLight { scene: name() });
            }
            twin = Some(bare);
        }
        let facts = Facts::new(&scene, given.hash(), geometry.tracer.triangles().len());
        let (camera, on_screen) = Shown::new(plan, &scene, &geometry.tracer, &gbuffer, &regions)?.unzip();
        let occluders = Occluder::all(each, view.pixels(), on_screen.as_ref());
        let subject = Subject { plan, facts, regions, occluders, on_screen };
        Ok(Set { subject, scene, geometry, twin, view, gbuffer, camera })
    }

    /// Pixels of the measure view, and of the look view.
    pub(super) fn pixels(&self) -> [usize; 2] {
        [self.view.pixels(), self.scene.look.view().pixels()]
    }

    /// What is rendered of the scene.
    pub(super) fn units(&self) -> Vec<Unit<'a>> {
        let cases: Vec<&'a Case> = self.subject.cases().collect();
        Unit::of_scene(self.subject.plan, &cases, self.twin.is_some())
    }
}

pub(super) fn measured<'a>(replicates: &'a [Vec<f32>], converged: &'a Converged, regions: &'a Regions) -> Measured<'a> {
    Measured { replicates, converged, regions }
}

pub(super) fn render_error(scene: &Scene) -> impl Fn(RenderError) -> RunError + use<> {
    let scene = scene.name.clone();
    move |source| RunError::Render { scene: scene.clone(), source }
}
