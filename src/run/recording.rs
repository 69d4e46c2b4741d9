//! What is recorded of a scene, whatever the estimator.

use super::{
    RunError,
    journal::look_image,
    judging::{Judged, Unjudged},
    measuring::Counts,
    rendering::Rendered,
    set::measured,
    subject::Subject,
};
use crate::{
    layers::Layers,
    metrics::{
        Absent,
        convergence::{Convergence, Level, convergence},
        judge::Judge,
        profile::{self, Curve},
        regions::Region,
    },
    record::{RecordFolder, SceneRecord},
    suite::{Case, Rays},
};
use std::collections::BTreeMap;

impl Subject<'_> {
    /// What is found of the scene, with its images, which are written, and the `profiles` of methods.
    pub(super) fn scene_record(
        &self,
        folder: &RecordFolder,
        rendered: &Rendered,
        judged: &Result<Judged, Unjudged>,
        counts: &Counts,
        profiles: Vec<Curve>,
    ) -> Result<SceneRecord, RunError> {
        let methods = &self.plan.suite.methods;
        let pixels = self.facts.pixels();
        let mut layers = Layers::new(self.facts.resolution);
        for region in Region::ALL {
            layers = layers.with(&format!("region-{}", region.label()), self.regions.mask(region, pixels));
        }
        for (&index, truth) in &rendered.truths {
            layers = layers.with(&format!("converged-{}", methods[index].name), truth.converged.mean.clone());
        }
        let mut scene = self.scene_facts(rendered, judged);
        layers.write(&folder.path().join(&scene.image))?;
        scene.profiles = profiles;
        scene.profiles.extend(judged.as_ref().ok().map(|j| j.curve.clone()));
        scene.convergence = self.convergence(rendered, counts);
        Ok(scene)
    }

    /// Openness along the transect of each method at the most rays, on the CPU where there are such cases.
    pub(super) fn profiles(&self, rendered: &Rendered, counts: &Counts) -> Vec<Curve> {
        let width = self.facts.resolution[0] as usize;
        let most = |method: usize| {
            let own = self.plan.suite.methods[method].rays;
            own.or_else(|| self.plan.suite.file.rays.iter().copied().max()).map_or(0, Rays::get)
        };
        let is_on_cpu = self.cases().any(|c| c.renderer == "cpu");
        let renderer = if is_on_cpu { "cpu" } else { self.cases().next().map_or("", |c| &c.renderer) };
        self.cases()
            .filter(|c| c.renderer == renderer && c.rays == most(self.method(c)))
            .filter_map(|c| Some(profile::of_method(&c.estimator, rendered.replicates(c, counts)?, width)))
            .collect()
    }

    /// What is known of the scene before its cases are: all but its profiles and how methods
    /// converge. Gates need no more.
    pub(super) fn scene_facts(&self, rendered: &Rendered, judged: &Result<Judged, Unjudged>) -> SceneRecord {
        let occluders = self.occluders.iter().enumerate();
        let occluders =
            occluders.map(|(i, o)| o.record(i, judged.as_ref().map_err(Unjudged::absent))).collect::<Vec<_>>();
        let mut brighter = BTreeMap::new();
        for (&index, truth) in &rendered.truths {
            if let Ok(side) = measured(&[], &truth.converged, self.regions(index)).brighter() {
                brighter.insert(self.plan.suite.methods[index].name.clone(), side);
            }
        }
        let (judge, no_judge, judge_error) = match judged {
            Ok(judged) => {
                brighter.insert(Judge::LABEL.to_owned(), judged.judge.regions.brighter);
                (Some(judged.record.clone()), None, None)
            }
            Err(Unjudged::Absent(Absent(why))) => (None, Some(why.clone()), None),
            Err(Unjudged::Failed(why)) => (None, None, Some(why.clone())),
        };
        let facts = self.facts.clone();
        let name = &self.facts.name;
        SceneRecord {
            image: format!("images/{name}/regions.exr"),
            look: look_image(name),
            name: facts.name,
            description: facts.description,
            control: facts.control,
            hash: facts.hash,
            radius: facts.radius,
            secondary_radius: facts.secondary_radius,
            triangles: facts.triangles,
            resolution: facts.resolution,
            transect: facts.transect,
            regions: self.counts().collect(),
            brighter,
            judge,
            screen: self.on_screen.as_ref().map(|s| s.record.clone()),
            no_judge,
            judge_error,
            occluders,
            convergence: Vec::new(),
            profiles: Vec::new(),
        }
    }

    /// How each method converges on each renderer: over all pixels, and over the
    /// footprint where there is one.
    fn convergence(&self, rendered: &Rendered, counts: &Counts) -> Vec<Convergence> {
        let mut keys: Vec<(&str, &str)> = Vec::new();
        for case in self.cases() {
            let key = (case.estimator.as_str(), case.renderer.as_str());
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        let (mut found, target) = (Vec::new(), self.plan.suite.file.target_rmse);
        for (estimator, renderer) in keys {
            let of_key = |c: &&Case| c.estimator == estimator && c.renderer == renderer;
            let Some(index) = self.cases().find(of_key).map(|c| self.method(c)) else { continue };
            let Some(truth) = rendered.truths.get(&index) else { continue };
            let level = |c: &Case| {
                let replicates = rendered.replicates(c, counts).filter(|r| r.len() > 1)?;
                Some(Level { rays: c.rays, replicates })
            };
            let levels: Vec<Level<'_>> = self.cases().filter(of_key).filter_map(level).collect();
            let regions = self.regions(index);
            for region in [Region::All, Region::Footprint] {
                if levels.is_empty() || (region == Region::Footprint && !self.facts.has_occluder) {
                    continue;
                }
                let (levels, pixels) = (levels.clone(), regions.measurable(region));
                found.push(convergence([estimator, renderer], region, levels, &truth.converged, pixels, target));
            }
        }
        found
    }
}
