//! The images of one scene: rendered, or taken from what an unfinished run left. The
//! CPU and a hardware GPU work side by side; a software GPU is the CPU, and waits.

use super::{
    Means, Progress,
    external::Handed,
    journal::{self, Done, Journal},
    measuring::Counts,
    set::Set,
    stop::{Clock, Halt},
    unit::{CONVERGED_REPLICATES, Unit},
};
use crate::{
    disk::DiskError,
    layers::{Layers, pixel_hash},
    metrics::{artifact::Converged, judge::Pair},
    record::Timing,
    render::{Loaded, RenderError},
    stats::mean_variance,
    suite::Case,
};
use std::{
    collections::BTreeMap,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Mutex, OnceLock, PoisonError},
    thread,
    time::Instant,
};

/// The images of one case.
#[derive(Clone, Debug)]
pub(super) struct Images {
    pub replicates: Vec<Vec<f32>>,
    /// Hash of their mean.
    pub hash: String,
    /// Seconds of tracing.
    pub seconds: f64,
    /// Images that an external renderer had to be asked for again.
    pub retries: u32,
}

/// What the images of a method are compared with.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    pub converged: Converged,
    /// Why it must not be used.
    pub fault: Option<String>,
}

/// The images of one scene, as far as they are rendered.
#[derive(Default)]
pub(super) struct Rendered {
    /// Absent also where there is nothing to judge.
    pub judge: Option<Result<Vec<Pair>, String>>,
    /// By the method's index in the suite.
    pub truths: BTreeMap<usize, Truth>,
    pub look: Option<Result<(), String>>,
    /// By the case's id.
    pub images: BTreeMap<String, Result<Images, String>>,
    /// What it took, a unit each.
    pub done: Vec<Done>,
    /// Why the judge's images could not be kept for other runs.
    pub cache_trouble: Option<String>,
    /// The failure that ended the run.
    pub ended: Option<String>,
}

/// Looks at what is rendered after each unit, and may say why the run is to end.
pub(super) type Watch<'a> = &'a (dyn Fn(&Rendered) -> Option<String> + Sync);

/// Images of a unit, as they were rendered.
enum Product {
    Judge(Vec<Pair>, usize),
    Converged(Truth),
    Look(Layers),
    Case(Images),
}

/// One scene with all that is needed to render it.
pub(super) struct Studio<'a> {
    pub set: &'a Set<'a>,
    pub means: &'a Means<'a>,
    pub journal: Journal<'a>,
    pub progress: &'a Progress<'a>,
    /// When no replicates are added any more.
    pub until: Option<Instant>,
    /// The scene as external renderers read it, once one of them needs it.
    pub handed: OnceLock<Result<Handed, String>>,
}

impl<'a> Studio<'a> {
    pub fn new(
        set: &'a Set<'a>,
        means: &'a Means<'a>,
        journal: Journal<'a>,
        progress: &'a Progress<'a>,
        until: Option<Instant>,
    ) -> Self {
        Studio { set, means, journal, progress, until, handed: OnceLock::new() }
    }
}

impl Studio<'_> {
    /// Renders units, cases up to so many replicates, unless they are there.
    ///
    /// # Errors
    /// Where a file cannot be written. What a renderer gets wrong costs its unit alone.
    pub fn render(&self, units: &[Unit<'_>], replicates: u32, rendered: &mut Rendered) -> Result<(), DiskError> {
        self.render_watched(units, replicates, rendered, &|_| None)
    }

    /// The same, watched.
    pub fn render_watched(
        &self,
        units: &[Unit<'_>],
        replicates: u32,
        rendered: &mut Rendered,
        watch: Watch<'_>,
    ) -> Result<(), DiskError> {
        let (on_gpu, on_cpu): (Vec<&Unit<'_>>, Vec<&Unit<'_>>) = units.iter().partition(|u| u.is_on_gpu());
        let shared = Mutex::new((rendered, Ok(())));
        // Of this thread; the GPU's is opened by the thread that uses it.
        let cpu_lane = || {
            let mut loaded = None;
            let open = || self.means.cpu.load(&self.set.geometry);
            self.lane(&on_cpu, replicates, &mut loaded, &open, watch, &shared);
        };
        let gpu = self.means.gpu;
        let gpu_lane = || {
            let mut loaded = None;
            let none = || RenderError::NoAdapter("the plan asks for one".into());
            let open = || gpu.ok_or_else(none).and_then(|g| g.load(&self.set.geometry));
            self.lane(&on_gpu, replicates, &mut loaded, &open, watch, &shared);
        };
        if self.means.machine.gpu_is_software == Some(false) && !on_gpu.is_empty() && !on_cpu.is_empty() {
            self.side_by_side(cpu_lane, gpu_lane);
        } else {
            cpu_lane();
            gpu_lane();
        }
        shared.into_inner().unwrap_or_else(PoisonError::into_inner).1
    }

    /// The GPU's units on a thread of their own: it waits for the device and needs no core.
    fn side_by_side(&self, cpu: impl FnOnce(), gpu: impl FnOnce() + Send) {
        thread::scope(|scope| {
            scope.spawn(gpu);
            cpu();
        });
    }

    fn lane<'l>(
        &self,
        units: &[&Unit<'_>],
        replicates: u32,
        loaded: &mut Option<Result<Box<dyn Loaded + 'l>, RenderError>>,
        open: &dyn Fn() -> Result<Box<dyn Loaded + 'l>, RenderError>,
        watch: Watch<'_>,
        shared: &Mutex<(&mut Rendered, Result<(), DiskError>)>,
    ) {
        for unit in units {
            if self.means.stop.is_asked() {
                return;
            }
            let id = unit.id(self.set.subject.plan, &self.set.scene.name);
            self.progress.begin(&id);
            let known = {
                let guard = shared.lock().unwrap_or_else(PoisonError::into_inner);
                match unit {
                    Unit::Case(case) => match guard.0.images.get(&case.id()) {
                        // What was taken from disk may be of a later look.
                        Some(Ok(images)) if images.replicates.len() >= replicates as usize => continue,
                        Some(Ok(images)) => Some(images.clone()),
                        Some(Err(_)) => continue,
                        None => None,
                    },
                    _ => None,
                }
            };
            let found = self.unit(unit, &id, replicates, known, loaded, open);
            let mut guard = shared.lock().unwrap_or_else(PoisonError::into_inner);
            match found {
                Ok(Some((product, done, trouble))) => {
                    guard.0.cache_trouble = guard.0.cache_trouble.take().or(trouble);
                    guard.0.take(unit, product, done, self.set.view.pixels());
                    let so_far: &Rendered = guard.0;
                    let failed = || self.failure(unit, &id, so_far).or_else(|| watch(so_far));
                    let failed = if self.means.fail_fast { failed() } else { None };
                    if let Some(why) = failed {
                        guard.0.ended.get_or_insert(why);
                        self.means.stop.ask();
                        return;
                    }
                }
                Ok(None) => return,
                Err(e) => {
                    guard.1 = Err(e);
                    self.means.stop.ask();
                    return;
                }
            }
            self.progress.end(unit.cost(self.set.subject.plan, self.set.pixels()));
        }
    }

    /// Why the images of a unit cannot be used.
    fn failure(&self, unit: &Unit<'_>, id: &str, rendered: &Rendered) -> Option<String> {
        let fault = match unit {
            Unit::Converged(method) => rendered.truths.get(method).and_then(|t| t.fault.clone()),
            _ => rendered.done.iter().find(|d| d.unit == id).and_then(|d| d.error.clone()),
        };
        fault.map(|why| format!("{id}: {why}"))
    }

    /// One unit, from the journal or rendered; None where the run ends before it is done.
    #[allow(clippy::type_complexity)]
    fn unit<'l>(
        &self,
        unit: &Unit<'_>,
        id: &str,
        replicates: u32,
        known: Option<Images>,
        loaded: &mut Option<Result<Box<dyn Loaded + 'l>, RenderError>>,
        open: &dyn Fn() -> Result<Box<dyn Loaded + 'l>, RenderError>,
    ) -> Result<Option<(Result<Product, String>, Done, Option<String>)>, DiskError> {
        let start = Instant::now();
        let file = journal::file(self.set.subject.plan, &self.set.scene.name, unit);
        let path = self.journal.folder.path().join(&file);
        let mut known = known;
        if let Some(done) = self.journal.find(id, &file) {
            if let Some(error) = done.error.clone().filter(|_| self.means.is_merge) {
                return Ok(Some((Err(error), done, None)));
            }
            if known.is_none()
                && let Some(product) = self.read(unit, &path, &done)
            {
                match product {
                    Product::Case(images) if images.replicates.len() < replicates as usize => known = Some(images),
                    product => return Ok(Some((Ok(product), done, None))),
                }
            }
        }
        let mut trouble = None;
        let mut retries = known.as_ref().map_or(0, |k| k.retries);
        let clock = Clock { stop: &self.means.stop, start, limit: self.means.case_timeout };
        let mut render = || -> Result<Product, Halt> {
            if self.means.is_merge {
                return Err(Halt::Failed("no shard holds its images".into()));
            }
            if *unit == Unit::Judge {
                return self.trace_judge(&clock, &mut trouble).map(|(pairs, cached)| Product::Judge(pairs, cached));
            }
            if let Unit::Case(case) = unit
                && case.is_external()
            {
                return self.external(case, replicates, known.take(), &clock, &mut retries).map(Product::Case);
            }
            let loaded = loaded.get_or_insert_with(open).as_mut().map_err(|e| Halt::Failed(e.to_string()))?;
            match unit {
                Unit::Converged(method) => self.converged(*method, loaded.as_mut(), &clock).map(Product::Converged),
                Unit::Case(case) => {
                    self.case(case, replicates, known.take(), loaded.as_mut(), &clock).map(Product::Case)
                }
                _ => self.look(loaded.as_mut(), &clock).map(Product::Look),
            }
        };
        let product = match catch_unwind(AssertUnwindSafe(&mut render)) {
            Ok(Ok(product)) => Ok(product),
            Ok(Err(Halt::Stopped)) => return Ok(None),
            Ok(Err(Halt::Failed(why))) => Err(why),
            Err(panic) => {
                // What it was in the middle of must not be used again.
                *loaded = None;
                Err(format!("the renderer panicked: {}", message(panic.as_ref())))
            }
        };
        let (seconds, cached) = match &product {
            Ok(Product::Case(images)) => (images.seconds, 0),
            Ok(Product::Judge(_, cached)) => (start.elapsed().as_secs_f64(), *cached),
            _ => (start.elapsed().as_secs_f64(), 0),
        };
        let error = product.as_ref().err().cloned();
        let mut done = Done { unit: id.to_owned(), seconds, sha256: None, error, cached, retries };
        if let Ok(product) = &product {
            self.layers(unit, product).write(&path)?;
            done.sha256 = Some(journal::sha256(&path)?);
        }
        self.journal.note(&done)?;
        Ok(Some((product, done, trouble)))
    }

    /// Leaves no more images of a case than it is measured from: what an unfinished run had
    /// rendered for a look that this one did not come to.
    pub fn trim(&self, case: &Case, replicates: u32, rendered: &mut Rendered) -> Result<(), DiskError> {
        let Some(Ok(images)) = rendered.images.get_mut(&case.id()) else { return Ok(()) };
        if images.replicates.len() <= replicates as usize {
            return Ok(());
        }
        images.replicates.truncate(replicates as usize);
        images.hash = pixel_hash(&moments(&images.replicates, self.set.view.pixels()).0);
        let (unit, images) = (Unit::Case(case), images.clone());
        let path = self.journal.folder.path().join(journal::file(self.set.subject.plan, &self.set.scene.name, &unit));
        self.layers(&unit, &Product::Case(images)).write(&path)?;
        for done in rendered.done.iter_mut().filter(|d| d.unit == case.id()) {
            done.sha256 = Some(journal::sha256(&path)?);
            self.journal.note(done)?;
        }
        Ok(())
    }

    /// The images of a unit as the file that they are kept in.
    fn layers(&self, unit: &Unit<'_>, product: &Product) -> Layers {
        let size = self.set.view.resolution;
        match (unit, product) {
            (_, Product::Judge(pairs, _)) => journal::of_pairs(size, pairs),
            (_, Product::Converged(truth)) => {
                let mut layers = with_replicates(Layers::new(size), &truth.converged.replicates);
                layers.attributes.extend(truth.fault.clone().map(|why| ("fault".to_owned(), why)));
                layers
            }
            (_, Product::Look(layers)) => layers.clone(),
            (Unit::Case(case), Product::Case(images)) => {
                case_layers(size, case, &images.replicates, Some(self.set.subject.plan.seed))
            }
            (_, Product::Case(images)) => with_replicates(Layers::new(size), &images.replicates),
        }
    }

    /// Reads what [`Studio::layers`] made; None where it is not what it should be.
    fn read(&self, unit: &Unit<'_>, path: &std::path::Path, done: &Done) -> Option<Product> {
        done.sha256.as_ref()?;
        let layers = Layers::read(path).ok()?;
        let fits = layers.resolution == self.set.view.resolution;
        Some(match unit {
            Unit::Judge => Product::Judge(Some(journal::pairs(&layers)).filter(|_| fits)?, done.cached),
            Unit::Converged(_) => {
                let replicates = journal::replicates(&layers);
                if !fits || replicates.len() != CONVERGED_REPLICATES as usize {
                    return None;
                }
                let fault = layers.attributes.get("fault").cloned();
                Product::Converged(Truth { converged: Converged::new(replicates), fault })
            }
            Unit::Look => Product::Look(layers),
            Unit::Case(_) => {
                let replicates = journal::replicates(&layers);
                let hash = layers.get("mean").map(pixel_hash).filter(|_| fits && replicates.len() > 1)?;
                Product::Case(Images { replicates, hash, seconds: done.seconds, retries: done.retries })
            }
        })
    }
}

impl Rendered {
    /// The first so many replicates of a case.
    pub fn replicates(&self, case: &Case, counts: &Counts) -> Option<&[Vec<f32>]> {
        let all = &self.images.get(&case.id())?.as_ref().ok()?.replicates;
        all.get(..(counts.replicates(case) as usize).min(all.len())).filter(|some| !some.is_empty())
    }

    /// Notes how long it took.
    pub fn note(&mut self, scene: &str, timing: &mut Timing) {
        for done in &self.done {
            if done.retries > 0 {
                timing.retries.insert(done.unit.clone(), done.retries);
            }
            let end = done.unit.strip_prefix(scene).unwrap_or_default();
            if end == "/judge" {
                timing.judges.insert(scene.to_owned(), done.seconds);
                timing.cached_replicates.insert(scene.to_owned(), done.cached);
            } else if self.images.get(&done.unit).is_some_and(Result::is_ok) {
                timing.cases.insert(done.unit.clone(), done.seconds);
            }
        }
        timing.cache_trouble = timing.cache_trouble.take().or(self.cache_trouble.take());
    }

    /// The log of an external renderer's case that was rendered, relative to the record.
    pub fn log(&self, case: &Case) -> Option<String> {
        let id = case.id();
        (case.is_external() && self.done.iter().any(|d| d.unit == id)).then(|| journal::case_log(case))
    }

    fn take(&mut self, unit: &Unit<'_>, product: Result<Product, String>, done: Done, pixels: usize) {
        self.done.retain(|d| d.unit != done.unit);
        self.done.push(done);
        match (unit, product) {
            (Unit::Judge, Ok(Product::Judge(pairs, _))) => self.judge = Some(Ok(pairs)),
            (Unit::Judge, Err(why)) => self.judge = Some(Err(why)),
            (Unit::Converged(m), Ok(Product::Converged(truth))) => drop(self.truths.insert(*m, truth)),
            (Unit::Converged(m), Err(why)) => {
                let nothing = vec![vec![f32::NAN; pixels]; CONVERGED_REPLICATES as usize];
                self.truths.insert(*m, Truth { converged: Converged::new(nothing), fault: Some(why) });
            }
            (Unit::Look, Ok(_)) => self.look = Some(Ok(())),
            (Unit::Look, Err(why)) => self.look = Some(Err(why)),
            (Unit::Case(case), Ok(Product::Case(images))) => drop(self.images.insert(case.id(), Ok(images))),
            (Unit::Case(case), Err(why)) => drop(self.images.insert(case.id(), Err(why))),
            // A unit gives its own kind of product.
            _ => {}
        }
    }
}

fn with_replicates(layers: Layers, replicates: &[Vec<f32>]) -> Layers {
    replicates.iter().enumerate().fold(layers, |l, (r, v)| l.with(&journal::replicate(r), v.clone()))
}

/// The images of a case as a record keeps them.
pub(super) fn case_layers(size: [u32; 2], case: &Case, replicates: &[Vec<f32>], seed: Option<u32>) -> Layers {
    let (mean, variance) = moments(replicates, size[0] as usize * size[1] as usize);
    let mut layers = with_replicates(Layers::new(size).with("mean", mean).with("variance", variance), replicates);
    // What whoever compares the file alone must know.
    let attributes = [
        ("scene", Some(case.scene.clone())),
        ("estimator", Some(case.estimator.clone())),
        ("renderer", Some(case.renderer.clone())),
        ("rays", Some(case.rays.to_string())),
        ("seed", seed.map(|s| s.to_string())),
    ];
    layers.attributes.extend(attributes.into_iter().filter_map(|(name, text)| Some((name.to_owned(), text?))));
    layers
}

/// Mean and variance of each pixel.
pub(super) fn moments(replicates: &[Vec<f32>], pixels: usize) -> (Vec<f32>, Vec<f32>) {
    let of = |pixel: usize| {
        let values: Vec<f64> = replicates.iter().map(|r| f64::from(r[pixel])).collect();
        let (mean, variance) = mean_variance(&values);
        (mean as f32, variance as f32)
    };
    (0..pixels).map(of).unzip()
}

/// What a panic said.
fn message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "without a message".to_owned())
}
