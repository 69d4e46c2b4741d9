//! How the images of a unit are traced, and when that ends early.

use super::{
    rendering::{Images, Studio, Truth, moments},
    stop::{Clock, Halt},
    unit::CONVERGED_REPLICATES,
};
use crate::{
    judge_cache::{JudgeCache, Key},
    layers::{Layers, pixel_hash},
    metrics::{
        artifact::Converged,
        judge::{JudgedRegions, Pair},
    },
    render::{Frame, Geometry, Job, Loaded, gbuffer::GBuffer, path},
    suite::Case,
};

/// Added to the seed for images that must not share random numbers with the
/// replicates they are compared with.
const CONVERGED: u32 = 0x00c0_0000;
const LOOK: u32 = 0x0001_0000;

/// Added to the seed, so that the judge shares no random numbers with what it
/// judges.
const JUDGE: u32 = 0x0010_0000;

impl Studio<'_> {
    /// Traces the scene and its twin, adding replicates until every region mean
    /// is as precise as the suite asks or the budget is spent. Replicates that an
    /// earlier run traced are taken from the cache; the result is the same.
    pub(super) fn trace_judge(
        &self,
        clock: &Clock<'_>,
        trouble: &mut Option<String>,
    ) -> Result<(Vec<Pair>, usize), Halt> {
        let set = self.set;
        let Some(twin) = &set.twin else { return Ok((Vec::new(), 0)) };
        let settings = &set.subject.plan.suite.file.judge;
        let seed = set.subject.plan.seed.wrapping_add(JUDGE);
        let paths = settings.paths.get();
        let most = settings.max_replicates.get() as usize;
        let key = Key { scene: &set.subject.facts.hash, paths, seed };
        let load = |c: &JudgeCache| c.load(&key, set.view.resolution);
        let mut pairs = self.means.cache.map_or_else(Vec::new, load);
        let cached = pairs.len();
        let mut used = 0;
        let go_on = || clock.may_go_on();
        let of = |geometry: &Geometry, r: usize| {
            path::irradiance_while(geometry, &set.gbuffer, paths, seed, r as u32, &go_on)
        };
        let mut halt = None;
        'looks: loop {
            used = (used + settings.replicates.get() as usize).min(most);
            while pairs.len() < used {
                let r = pairs.len();
                let pair = of(&set.geometry, r).and_then(|with| Some(Pair { with, without: of(twin, r)? }));
                let Some(pair) = pair else {
                    halt = Some(clock.halt("replicates of the judge", r as u32, most as u32));
                    break 'looks;
                };
                pairs.push(pair);
            }
            super::faults::check_judge(&pairs[..used], &set.subject.regions, set.view.resolution[0])
                .map_err(Halt::Failed)?;
            // Where regions are too small for a judge, measuring says so.
            let Ok(judge) = JudgedRegions::new(&pairs[..used], &set.subject.regions) else { break };
            if judge.widest() <= settings.precision || used >= most {
                break;
            }
        }
        if let Some(cache) = self.means.cache.filter(|_| pairs.len() > cached)
            && let Err(e) = cache.store(&key, set.view.resolution, &pairs)
        {
            // That costs time, not the run.
            *trouble = Some(e.to_string());
        }
        if let Some(halt) = halt {
            return Err(halt);
        }
        pairs.truncate(used);
        Ok((pairs, cached.min(used)))
    }

    pub(super) fn converged(&self, method: usize, loaded: &mut dyn Loaded, clock: &Clock<'_>) -> Result<Truth, Halt> {
        let set = self.set;
        let (mut replicates, mut fault) = (Vec::new(), None);
        for replicate in 0..CONVERGED_REPLICATES {
            let job = Job {
                view: &set.view,
                camera: set.camera.as_ref(),
                estimator: set.subject.plan.suite.methods[method].estimator.unsmoothed(),
                ao: set.scene.ao,
                rays: set.subject.plan.suite.file.converged_rays.get() / CONVERGED_REPLICATES,
                seed: set.subject.plan.seed.wrapping_add(CONVERGED),
                replicate,
            };
            let frame = frame(loaded, &job, clock, "replicates", [replicate, CONVERGED_REPLICATES])?;
            let checked = super::faults::check_frame(&frame, set.subject.regions(method), replicate);
            fault = fault.or_else(|| checked.err().map(|e| e.to_string()));
            replicates.push(frame.values);
        }
        Ok(Truth { converged: Converged::new(replicates), fault })
    }

    pub(super) fn case(
        &self,
        case: &Case,
        replicates: u32,
        known: Option<Images>,
        loaded: &mut dyn Loaded,
        clock: &Clock<'_>,
    ) -> Result<Images, Halt> {
        let set = self.set;
        let method = set.subject.method(case);
        let (mut images, mut seconds) = known.map_or_else(|| (Vec::new(), 0.0), |i| (i.replicates, i.seconds));
        for replicate in images.len() as u32..replicates {
            let job = Job {
                view: &set.view,
                camera: set.camera.as_ref(),
                estimator: set.subject.plan.suite.methods[method].estimator,
                ao: set.scene.ao,
                rays: case.rays,
                seed: set.subject.plan.seed,
                replicate,
            };
            let frame = frame(loaded, &job, clock, "replicates", [replicate, replicates])?;
            super::faults::check_frame(&frame, set.subject.regions(method), replicate)?;
            images.push(frame.values);
            seconds += frame.seconds;
        }
        let hash = pixel_hash(&moments(&images, set.view.pixels()).0);
        Ok(Images { replicates: images, hash, seconds, retries: 0 })
    }

    /// Pictures from the look view: every method, and the path tracer.
    pub(super) fn look(&self, cpu: &mut dyn Loaded, clock: &Clock<'_>) -> Result<Layers, Halt> {
        let set = self.set;
        let view = set.scene.look.view();
        let rays = set.subject.plan.suite.file.look_rays.get();
        let seed = set.subject.plan.seed.wrapping_add(LOOK);
        let mut layers = Layers::new(view.resolution);
        let methods = set.subject.plan.methods();
        let all = methods.len() as u32 + 1;
        for (done, method) in (0..).zip(methods) {
            let method = &set.subject.plan.suite.methods[method];
            let job = Job {
                view: &view,
                camera: None,
                estimator: method.estimator,
                ao: set.scene.ao,
                rays,
                seed,
                replicate: 0,
            };
            let frame = frame(cpu, &job, clock, "pictures", [done, all])?;
            layers = layers.with(&format!("openness-{}", method.name), frame.values);
        }
        let gbuffer = GBuffer::new(&set.geometry.tracer, &view);
        let traced = path::irradiance_while(&set.geometry, &gbuffer, rays, seed, 0, &|| clock.may_go_on());
        let traced = traced.ok_or_else(|| clock.halt("pictures", all - 1, all))?;
        Ok(layers.with("path-traced", traced))
    }
}

/// One image, after so many of so many `what`.
fn frame(
    loaded: &mut dyn Loaded,
    job: &Job<'_>,
    clock: &Clock<'_>,
    what: &str,
    [done, of]: [u32; 2],
) -> Result<Frame, Halt> {
    // Also a renderer that cannot ask on the way is stopped between two images.
    let frame = if clock.may_go_on() { loaded.render_while(job, &|| clock.may_go_on())? } else { None };
    frame.ok_or_else(|| clock.halt(what, done, of))
}
