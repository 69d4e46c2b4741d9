//! What is measured of a scene, whoever rendered its images: its facts and its regions. No
//! triangle is needed any more.

use super::{
    occluders::Occluder,
    on_screen::{Shown, is_on_screen},
};
use crate::{
    metrics::regions::{Region, Regions},
    scenes::Scene,
    suite::{Case, Plan},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A scene as it is measured.
pub(super) struct Subject<'a> {
    pub plan: &'a Plan<'a>,
    pub facts: Facts,
    pub regions: Regions,
    /// One by one, where the view shows two or more.
    pub occluders: Vec<Occluder>,
    /// For suites with methods of screen space.
    pub on_screen: Option<Shown>,
}

/// What a record tells of a scene beside what was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Facts {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub description: String,
    /// Whether it is a control.
    pub control: bool,
    /// Whether it has an occluder, and so a judge.
    pub has_occluder: bool,
    /// Content hash.
    pub hash: String,
    /// R, metres.
    pub radius: f64,
    /// R', metres.
    pub secondary_radius: f64,
    /// Triangles.
    pub triangles: usize,
    /// Width and height of the measure view, pixels.
    pub resolution: [u32; 2],
    /// Place of each column of the measure view along the transect, in R.
    pub transect: Vec<f64>,
}

impl Facts {
    /// Those of a scene with so many triangles. The hash is that of the scene as it was given.
    pub(super) fn new(scene: &Scene, hash: String, triangles: usize) -> Self {
        let radius = f64::from(scene.ao.radius);
        let resolution = scene.measure.view().resolution;
        let at = |x| f64::from(scene.measure.transect_at(x)) / radius;
        Facts {
            name: scene.name.clone(),
            description: scene.description.clone(),
            control: scene.control,
            has_occluder: scene.has_occluder(),
            hash,
            radius,
            secondary_radius: f64::from(scene.ao.secondary_radius),
            triangles,
            resolution,
            transect: (0..resolution[0]).map(at).collect(),
        }
    }

    /// Pixels of the measure view.
    pub fn pixels(&self) -> usize {
        self.resolution[0] as usize * self.resolution[1] as usize
    }
}

impl<'a> Subject<'a> {
    pub fn cases(&self) -> impl Iterator<Item = &'a Case> {
        let (plan, name) = (self.plan, &self.facts.name);
        plan.cases.iter().filter(move |c| c.scene == *name)
    }

    pub fn method(&self, case: &Case) -> usize {
        self.plan.suite.methods.iter().position(|m| m.name == case.estimator).unwrap_or(0)
    }

    /// Where a method is measured, and what is measured beside it.
    pub fn regions(&self, method: usize) -> &Regions {
        let shown = self.on_screen.as_ref().filter(|_| is_on_screen(&self.plan.suite.methods[method]));
        shown.map_or(&self.regions, |s| &s.regions)
    }

    /// Pixels of each region.
    pub fn counts(&self) -> impl Iterator<Item = (Region, usize)> {
        Region::ALL.into_iter().map(|r| (r, self.regions.pixels(r).len()))
    }
}
