//! What is recorded of a scene, whatever the estimator.

use super::{
    RunError,
    judging::{Judged, Unjudged},
    set::{Images, Set, Truth, measured},
};
use crate::{
    layers::Layers,
    metrics::{
        Absent,
        convergence::{Convergence, Level, convergence},
        judge::Judge,
        profile,
        regions::Region,
    },
    record::{RecordFolder, SceneRecord},
    render::RenderError,
    suite::{Case, Rays},
};
use std::collections::BTreeMap;

impl Set<'_> {
    pub(super) fn scene_record(
        &self,
        folder: &RecordFolder,
        images: &BTreeMap<String, Result<Images, RenderError>>,
        truths: &[Truth],
        judged: Result<Judged, Unjudged>,
        look: String,
    ) -> Result<SceneRecord, RunError> {
        let methods = &self.plan.suite.methods;
        let pixels = self.view.pixels();
        let width = self.view.resolution[0];
        let occluders = self.occluders.iter().enumerate();
        let occluders =
            occluders.map(|(i, o)| o.record(i, judged.as_ref().map_err(Unjudged::absent))).collect::<Vec<_>>();
        let image = format!("images/{}/regions.exr", self.scene.name);
        let mut layers = Layers::new(self.view.resolution);
        for region in Region::ALL {
            layers = layers.with(&format!("region-{}", region.label()), self.regions.mask(region, pixels));
        }
        let mut brighter = BTreeMap::new();
        for (index, (method, truth)) in methods.iter().zip(truths).enumerate() {
            let converged = &truth.converged;
            if let Ok(side) = measured(&[], converged, self.regions(index)).brighter() {
                brighter.insert(method.name.clone(), side);
            }
            layers = layers.with(&format!("converged-{}", method.name), converged.mean.clone());
        }
        layers.write(&folder.path().join(&image))?;
        let most = |method: usize| {
            let own = methods[method].rays;
            own.or_else(|| self.plan.suite.file.rays.iter().copied().max()).map_or(0, Rays::get)
        };
        let mut profiles: Vec<profile::Curve> = self
            .cases()
            .filter(|c| c.renderer == "cpu" && c.rays == most(self.method(c)))
            .filter_map(|c| {
                let own = images.get(&c.id())?.as_ref().ok()?;
                Some(profile::of_method(&c.estimator, &own.replicates, width as usize))
            })
            .collect();
        let (judge, no_judge, judge_error) = match judged {
            Ok(judged) => {
                brighter.insert(Judge::LABEL.to_owned(), judged.judge.regions.brighter);
                profiles.push(judged.curve);
                (Some(judged.record), None, None)
            }
            Err(Unjudged::Absent(Absent(why))) => (None, Some(why), None),
            Err(Unjudged::Failed(why)) => (None, None, Some(why)),
        };
        let radius = f64::from(self.scene.ao.radius);
        Ok(SceneRecord {
            name: self.scene.name.clone(),
            description: self.scene.description.clone(),
            control: self.scene.control,
            hash: self.hash.clone(),
            radius,
            secondary_radius: f64::from(self.scene.ao.secondary_radius),
            triangles: self.geometry.tracer.triangles().len(),
            resolution: self.view.resolution,
            transect: (0..width).map(|x| f64::from(self.scene.measure.transect_at(x)) / radius).collect(),
            regions: Region::ALL.into_iter().map(|r| (r, self.regions.pixels(r).len())).collect(),
            brighter,
            judge,
            screen: self.on_screen.as_ref().map(|s| s.record.clone()),
            no_judge,
            judge_error,
            occluders,
            convergence: self.convergence(images, truths),
            profiles,
            image,
            look,
        })
    }

    /// How each method converges on each renderer: over all pixels, and over the
    /// footprint where there is one.
    fn convergence(
        &self,
        images: &BTreeMap<String, Result<Images, RenderError>>,
        truths: &[Truth],
    ) -> Vec<Convergence> {
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
            let rendered = self.cases().filter(of_key).filter_map(|c| Some((c.rays, images.get(&c.id())?)));
            let levels: Vec<Level<'_>> = rendered
                .filter_map(|(rays, i)| Some(Level { rays, replicates: &i.as_ref().ok()?.replicates }))
                .collect();
            let regions = self.regions(index);
            for region in [Region::All, Region::Footprint] {
                if levels.is_empty() || (region == Region::Footprint && !self.scene.has_occluder()) {
                    continue;
                }
                let (levels, pixels) = (levels.clone(), regions.measurable(region));
                let truth = &truths[index].converged;
                found.push(convergence([estimator, renderer], region, levels, truth, pixels, target));
            }
        }
        found
    }
}
