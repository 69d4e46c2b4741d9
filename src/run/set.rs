//! One scene of a plan: made ready, rendered, judged, written.

use super::{
    MAX_GIB, Progress, RunError,
    case_metrics::{Others, metrics},
    faults,
    judging::{Judged, Unjudged},
    occluders::Occluder,
    on_screen::{OnScreen, is_on_screen},
};
use crate::{
    judge_cache::JudgeCache,
    layers::{Layers, pixel_hash},
    metrics::{
        Absent,
        artifact::{Converged, Method as Measured},
        judge::JudgedRegions,
        regions::{Finder, Region, Regions, cut_flank},
    },
    record::{CaseRecord, OccluderMetrics, RecordFolder, SceneRecord, Timing},
    render::{Frame, Geometry, Job, Loaded, RenderError, Renderer, gbuffer::GBuffer, path},
    scenes::{Scene, View},
    stats::mean_variance,
    suite::{Case, Plan},
};
use std::{borrow::Cow, collections::BTreeMap};

/// Paths a pixel that look for any light at all.
const LIGHT_PATHS: u32 = 4;

/// Independent images that a converged image is the mean of.
const CONVERGED_REPLICATES: u32 = 4;

/// Added to the seed for images that must not share random numbers with the
/// replicates they are compared with.
const CONVERGED: u32 = 0x00c0_0000;
const LOOK: u32 = 0x0001_0000;

/// One scene made ready: geometry, twin, what the measure view sees.
pub(super) struct Set<'a> {
    pub(super) plan: &'a Plan<'a>,
    /// Near the origin.
    pub(super) scene: Cow<'a, Scene>,
    /// Of the scene as it was given.
    pub(super) hash: String,
    pub(super) geometry: Geometry,
    /// The scene without its occluder, traced from the same points; None where
    /// there is nothing to judge.
    pub(super) twin: Option<Geometry>,
    pub(super) view: View,
    pub(super) gbuffer: GBuffer,
    pub(super) regions: Regions,
    /// One by one, where the view shows two or more.
    pub(super) occluders: Vec<Occluder>,
    /// For suites with methods of screen space.
    pub(super) on_screen: Option<OnScreen>,
}

/// The images of one case.
pub(super) struct Images {
    pub(super) replicates: Vec<Vec<f32>>,
    seconds: f64,
}

/// What the images of a method are compared with.
pub(super) struct Truth {
    pub(super) converged: Converged,
    /// Why it must not be used.
    fault: Option<RenderError>,
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
        for method in &plan.suite.methods {
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
        let hash = given.hash();
        let on_screen = OnScreen::new(plan, &scene, &geometry.tracer, &gbuffer, &regions)?;
        let occluders = Occluder::all(each, &gbuffer, on_screen.as_ref());
        Ok(Set { plan, scene, hash, geometry, twin, view, gbuffer, regions, occluders, on_screen })
    }

    pub(super) fn run(
        &self,
        cpu: &dyn Renderer,
        gpu: Option<&dyn Renderer>,
        cache: Option<&JudgeCache>,
        folder: &RecordFolder,
        progress: &mut Progress<'_>,
        timing: &mut Timing,
    ) -> Result<(SceneRecord, Vec<CaseRecord>), RunError> {
        let methods = &self.plan.suite.methods;
        let fail = render_error(&self.scene);
        let mut loaded_cpu = cpu.load(&self.geometry).map_err(&fail)?;
        progress.begin(&format!("{}: judge", self.scene.name));
        let judged = self.judge(cache, folder, timing)?;
        progress.end();
        let mut truths = Vec::with_capacity(methods.len());
        for (index, method) in methods.iter().enumerate() {
            let mut fault = None;
            progress.begin(&format!("{}: converged {}", self.scene.name, method.name));
            let replicates = (0..CONVERGED_REPLICATES).map(|replicate| {
                let job = Job {
                    view: &self.view,
                    camera: self.camera(),
                    estimator: method.estimator.unsmoothed(),
                    ao: self.scene.ao,
                    rays: self.plan.suite.file.converged_rays.get() / CONVERGED_REPLICATES,
                    seed: self.plan.seed.wrapping_add(CONVERGED),
                    replicate,
                };
                let frame = loaded_cpu.render(&job).map_err(&fail)?;
                let checked = faults::check_frame(&frame, self.regions(index), replicate);
                fault = fault.take().or_else(|| checked.err());
                Ok(frame.values)
            });
            let converged = Converged::new(replicates.collect::<Result<_, RunError>>()?);
            truths.push(Truth { converged, fault });
            progress.end();
        }
        let mut loaded_gpu = gpu.map(|g| g.load(&self.geometry));
        let mut images: BTreeMap<String, Result<Images, RenderError>> = BTreeMap::new();
        for case in self.cases() {
            progress.begin(&case.id());
            let rendered = match (case.renderer.as_str(), &mut loaded_gpu) {
                ("cpu", _) => match self.replicates(case, loaded_cpu.as_mut()) {
                    Err(e) if !matches!(e, RenderError::NotFinite { .. }) => return Err(fail(e)),
                    rendered => rendered,
                },
                (_, Some(Ok(loaded))) => self.replicates(case, loaded.as_mut()),
                (_, Some(Err(e))) => Err(RenderError::Device(e.to_string())),
                (_, None) => Err(RenderError::NoAdapter("the plan asks for one".into())),
            };
            if let Ok(images) = &rendered {
                timing.cases.insert(case.id(), images.seconds);
            }
            images.insert(case.id(), rendered);
            progress.end();
        }
        let records = self.case_records(folder, &images, &truths, &judged)?;
        progress.begin(&format!("{}: pictures", self.scene.name));
        let look = self.look(folder, loaded_cpu.as_mut())?;
        progress.end();
        let record = self.scene_record(folder, &images, &truths, judged, look)?;
        Ok((record, records))
    }

    pub(super) fn cases(&self) -> impl Iterator<Item = &'a Case> {
        let (plan, name) = (self.plan, &self.scene.name);
        plan.cases.iter().filter(move |c| c.scene == *name)
    }

    pub(super) fn method(&self, case: &Case) -> usize {
        self.plan.suite.methods.iter().position(|m| m.name == case.estimator).unwrap_or(0)
    }

    fn replicates(&self, case: &Case, loaded: &mut dyn Loaded) -> Result<Images, RenderError> {
        let mut images = Images { replicates: Vec::new(), seconds: 0.0 };
        for replicate in 0..self.plan.suite.file.replicates.get() {
            let frame = loaded.render(&Job {
                view: &self.view,
                camera: self.camera(),
                estimator: self.plan.suite.methods[self.method(case)].estimator,
                ao: self.scene.ao,
                rays: case.rays,
                seed: self.plan.seed,
                replicate,
            })?;
            faults::check_frame(&frame, self.regions(self.method(case)), replicate)?;
            let Frame { values, seconds, .. } = frame;
            images.replicates.push(values);
            images.seconds += seconds;
        }
        Ok(images)
    }

    /// Where methods of screen space are computed.
    fn camera(&self) -> Option<&View> {
        self.on_screen.as_ref().map(|s| &s.camera)
    }

    /// Where a method is measured, and what is measured beside it.
    pub(super) fn regions(&self, method: usize) -> &Regions {
        let shown = self.on_screen.as_ref().filter(|_| is_on_screen(&self.plan.suite.methods[method]));
        shown.map_or(&self.regions, |s| &s.regions)
    }

    /// The judge of the pixels that a method is measured on.
    fn judge_of<'b>(&self, method: usize, judged: &'b Result<Judged, Unjudged>) -> Result<&'b JudgedRegions, Absent> {
        let judged = judged.as_ref().map_err(Unjudged::absent)?;
        if is_on_screen(&self.plan.suite.methods[method]) {
            return judged.on_screen.as_ref().map_err(Clone::clone);
        }
        judged.usable.clone().map(|()| &judged.judge.regions)
    }

    fn case_records(
        &self,
        folder: &RecordFolder,
        images: &BTreeMap<String, Result<Images, RenderError>>,
        truths: &[Truth],
        judged: &Result<Judged, Unjudged>,
    ) -> Result<Vec<CaseRecord>, RunError> {
        let classic = &self.plan.suite.methods[self.plan.suite.classic()].name;
        let of = |case: &Case| images.get(&case.id()).and_then(|i| i.as_ref().ok());
        let mut records = Vec::new();
        for case in self.cases() {
            let index = self.method(case);
            let own = match (&images[&case.id()], &truths[index].fault) {
                (Ok(own), None) => own,
                (Err(e), _) => {
                    records.push(CaseRecord::failed(case, e.to_string()));
                    continue;
                }
                (_, Some(e)) => {
                    records.push(CaseRecord::failed(case, format!("its converged image cannot be used: {e}")));
                    continue;
                }
            };
            let regions = self.regions(index);
            let method = measured(&own.replicates, &truths[index].converged, regions);
            let on_classic = self.classic_beside(case, classic);
            let truth = &truths[self.method(&on_classic)];
            let beside = of(&on_classic).filter(|_| case.estimator != *classic && truth.fault.is_none());
            let classic_on = |regions| beside.map(|own| measured(&own.replicates, &truth.converged, regions));
            let on_cpu = Case { renderer: "cpu".into(), ..case.clone() };
            let cpu = of(&on_cpu).filter(|_| case.renderer != "cpu").map(|i| i.replicates.as_slice());
            let others = Others {
                classic: classic_on(regions),
                cpu,
                judge: self.judge_of(index, judged),
                image: judged.as_ref().map_err(Unjudged::absent).and_then(Judged::image),
                occluder: self.scene.has_occluder(),
            };
            let (image, hash) = self.write_case(folder, case, &own.replicates)?;
            records.push(CaseRecord {
                case: case.clone(),
                error: None,
                image: Some(image),
                hash: Some(hash),
                metrics: metrics(&method, &others),
                occluders: self.by_occluder(index, &method, &classic_on, judged),
            });
        }
        Ok(records)
    }

    /// The metrics of a case under each occluder of several.
    fn by_occluder<'b>(
        &'b self,
        index: usize,
        method: &Measured<'b>,
        classic: &dyn Fn(&'b Regions) -> Option<Measured<'b>>,
        judged: &Result<Judged, Unjudged>,
    ) -> Vec<OccluderMetrics> {
        let on_screen = is_on_screen(&self.plan.suite.methods[index]);
        let judged = judged.as_ref().map_err(Unjudged::absent);
        let image = judged.clone().and_then(Judged::image);
        let of = |(i, occluder): (usize, &'b Occluder)| {
            let regions = occluder.shown.as_ref().filter(|_| on_screen).unwrap_or(&occluder.regions);
            let own = Measured { regions, ..*method };
            let judge = judged
                .clone()
                .and_then(|j| j.occluder(i, on_screen).ok_or_else(|| Absent("the occluder was not judged".into())));
            occluder.metrics(&own, classic(regions).as_ref(), &judge, &image)
        };
        self.occluders.iter().enumerate().map(of).collect()
    }

    /// The case of classic AO that a case is compared with: the one of as many
    /// rays, else, for a method with its own number of rays, that of the most.
    fn classic_beside(&self, case: &Case, classic: &str) -> Case {
        let suite = &self.plan.suite.file.rays;
        let same = suite.iter().any(|r| r.get() == case.rays);
        let rays = if same { case.rays } else { suite.iter().map(|r| r.get()).max().unwrap_or(case.rays) };
        Case { estimator: classic.to_owned(), rays, ..case.clone() }
    }

    /// Writes mean, variance and replicates of a case; returns the path and the
    /// hash of the mean.
    fn write_case(
        &self,
        folder: &RecordFolder,
        case: &Case,
        replicates: &[Vec<f32>],
    ) -> Result<(String, String), RunError> {
        let image = format!("images/{}/{}.{}.{}.exr", case.scene, case.estimator, case.renderer, case.rays);
        let mut mean = Vec::with_capacity(self.view.pixels());
        let mut variance = Vec::with_capacity(self.view.pixels());
        for pixel in 0..self.view.pixels() {
            let values: Vec<f64> = replicates.iter().map(|r| f64::from(r[pixel])).collect();
            let (m, v) = mean_variance(&values);
            mean.push(m as f32);
            variance.push(v as f32);
        }
        let hash = pixel_hash(&mean);
        let mut layers = Layers::new(self.view.resolution).with("mean", mean).with("variance", variance);
        for (r, values) in replicates.iter().enumerate() {
            layers = layers.with(&format!("replicate-{r:04}"), values.clone());
        }
        // What whoever compares the file alone must know.
        let attributes = [
            ("scene", case.scene.clone()),
            ("estimator", case.estimator.clone()),
            ("renderer", case.renderer.clone()),
            ("rays", case.rays.to_string()),
            ("seed", self.plan.seed.to_string()),
        ];
        layers.attributes.extend(attributes.map(|(name, text)| (name.to_owned(), text)));
        layers.write(&folder.path().join(&image))?;
        Ok((image, hash))
    }

    /// Pictures from the look view: every method, and the path tracer.
    fn look(&self, folder: &RecordFolder, cpu: &mut dyn Loaded) -> Result<String, RunError> {
        let view = self.scene.look.view();
        let rays = self.plan.suite.file.look_rays.get();
        let seed = self.plan.seed.wrapping_add(LOOK);
        let mut layers = Layers::new(view.resolution);
        for method in &self.plan.suite.methods {
            let job = Job {
                view: &view,
                camera: None,
                estimator: method.estimator,
                ao: self.scene.ao,
                rays,
                seed,
                replicate: 0,
            };
            let frame = cpu.render(&job).map_err(render_error(&self.scene))?;
            layers = layers.with(&format!("openness-{}", method.name), frame.values);
        }
        let gbuffer = GBuffer::new(&self.geometry.tracer, &view);
        let layers = layers.with("path-traced", path::irradiance(&self.geometry, &gbuffer, rays, seed, 0));
        let image = format!("images/{}/look.exr", self.scene.name);
        layers.write(&folder.path().join(&image))?;
        Ok(image)
    }
}

pub(super) fn measured<'a>(replicates: &'a [Vec<f32>], converged: &'a Converged, regions: &'a Regions) -> Measured<'a> {
    Measured { replicates, converged, regions }
}

pub(super) fn render_error(scene: &Scene) -> impl Fn(RenderError) -> RunError + use<> {
    let scene = scene.name.clone();
    move |source| RunError::Render { scene: scene.clone(), source }
}
