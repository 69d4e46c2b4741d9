//! The judge of one scene: traced until it is precise, written, recorded.

use super::{RunError, faults, occluders::JudgedOccluder, set::Set};
use crate::{
    judge_cache::{JudgeCache, Key},
    layers::Layers,
    metrics::{
        Absent, Metric, MetricName,
        judge::{Judge, JudgedRegions, Pair, QImage, vague},
        profile,
    },
    record::{JudgeRecord, RecordFolder, RegionQ, Stopped, Timing},
    render::{Geometry, path},
    stats::Estimate,
};
use std::time::Instant;

/// Added to the seed, so that the judge shares no random numbers with what it
/// judges.
const JUDGE: u32 = 0x0010_0000;

/// What the judge found, with its curve.
pub(super) struct Judged {
    pub judge: Judge,
    /// Why metrics must not use it.
    pub usable: Result<(), Absent>,
    /// The same over the pixels that screen-space methods are measured on; absent
    /// where metrics must not use it, and in suites without such methods.
    pub on_screen: Result<JudgedRegions, Absent>,
    /// Of each occluder of several: over its regions, and over what a screen shows.
    pub occluders: Vec<[Option<JudgedOccluder>; 2]>,
    pub record: JudgeRecord,
    pub curve: profile::Curve,
}

/// Why there is no judge.
pub(super) enum Unjudged {
    /// There is nothing to judge.
    Absent(Absent),
    /// The path tracer gave what is no number.
    Failed(String),
}

impl Unjudged {
    /// Why metrics are null.
    pub fn absent(&self) -> Absent {
        match self {
            Unjudged::Absent(absent) => absent.clone(),
            Unjudged::Failed(why) => Absent(why.clone()),
        }
    }
}

impl Judged {
    /// What it says of an occluder of several, on a screen or off it.
    pub fn occluder(&self, index: usize, on_screen: bool) -> Option<&JudgedOccluder> {
        self.occluders.get(index)?[usize::from(on_screen)].as_ref()
    }

    /// Q a pixel, where metrics may use it.
    pub fn image(&self) -> Result<&QImage, Absent> {
        self.usable.clone().map(|()| &self.judge.image)
    }
}

impl Set<'_> {
    /// Judges the scene by its twin, and writes Q. Absent where there is nothing to
    /// judge.
    pub(super) fn judge(
        &self,
        cache: Option<&JudgeCache>,
        folder: &RecordFolder,
        timing: &mut Timing,
    ) -> Result<Result<Judged, Unjudged>, RunError> {
        let Some(twin) = &self.twin else {
            return Ok(Err(Unjudged::Absent(Absent("the scene has no occluder to judge".into()))));
        };
        let start = Instant::now();
        let settings = &self.plan.suite.file.judge;
        let (regions, pairs) = match self.trace_judge(twin, cache, timing) {
            Ok(traced) => traced,
            Err(why) => return Ok(Err(why)),
        };
        let judge = Judge { regions, image: QImage::new(&pairs) };
        if !judge.regions.has_light() {
            return Err(RunError::NoLight { scene: self.scene.name.clone() });
        }
        let precision = judge.regions.widest();
        let sure = precision <= settings.precision;
        let vague = |precision: f64| vague(precision, pairs.len(), settings.precision);
        let contrast = if sure { Ok(judge.regions.contrast()) } else { Err(vague(precision)) };
        let record = JudgeRecord {
            contrast: Metric::new(MetricName::JudgeContrast, None, contrast),
            q: Judge::REGIONS.into_iter().filter_map(|r| Some((r, region_q(Ok(judge.regions.q_of(r)?))))).collect(),
            paths: settings.paths.get(),
            replicates: pairs.len() as u32,
            stopped: if sure { Stopped::Precise } else { Stopped::Budget },
            precision: precision.is_finite().then_some(precision),
            wanted: settings.precision,
            image: self.write_judge(folder, &judge)?,
        };
        let curve = profile::of_judge(&pairs, self.view.resolution[0] as usize);
        timing.judges.insert(self.scene.name.clone(), start.elapsed().as_secs_f64());
        let on_screen = match &self.on_screen {
            None => Err(Absent("the suite has no screen-space method".into())),
            Some(s) => JudgedRegions::new(&pairs, &s.regions).and_then(|j| match j.widest() {
                precision if precision <= settings.precision => Ok(j),
                precision => Err(vague(precision)),
            }),
        };
        let usable = if sure { Ok(()) } else { Err(vague(precision)) };
        let occluders = self.occluders.iter().map(|o| o.judge(&pairs, settings.precision)).collect();
        Ok(Ok(Judged { usable, on_screen, occluders, judge, record, curve }))
    }

    /// Traces the scene and its twin, adding replicates until every region mean
    /// is as precise as the suite asks or the budget is spent. Replicates that an
    /// earlier run traced are taken from the cache; the result is the same.
    fn trace_judge(
        &self,
        twin: &Geometry,
        cache: Option<&JudgeCache>,
        timing: &mut Timing,
    ) -> Result<(JudgedRegions, Vec<Pair>), Unjudged> {
        let settings = &self.plan.suite.file.judge;
        let seed = self.plan.seed.wrapping_add(JUDGE);
        let paths = settings.paths.get();
        let most = settings.max_replicates.get() as usize;
        let key = Key { scene: &self.hash, paths, seed };
        let mut pairs = cache.map_or_else(Vec::new, |c| c.load(&key, self.view.resolution));
        let cached = pairs.len();
        let mut used = 0;
        let judge = loop {
            used = (used + settings.replicates.get() as usize).min(most);
            pairs.extend((pairs.len()..used).map(|r| Pair {
                with: path::irradiance(&self.geometry, &self.gbuffer, paths, seed, r as u32),
                without: path::irradiance(twin, &self.gbuffer, paths, seed, r as u32),
            }));
            faults::check_judge(&pairs[..used], &self.regions, self.view.resolution[0]).map_err(Unjudged::Failed)?;
            let judge = JudgedRegions::new(&pairs[..used], &self.regions).map_err(Unjudged::Absent)?;
            if judge.widest() <= settings.precision || used >= most {
                break judge;
            }
        };
        if let Some(cache) = cache.filter(|_| pairs.len() > cached)
            && let Err(e) = cache.store(&key, self.view.resolution, &pairs)
        {
            // That costs time, not the run.
            timing.cache_trouble = Some(e.to_string());
        }
        timing.cached_replicates.insert(self.scene.name.clone(), cached.min(used));
        pairs.truncate(used);
        Ok((judge, pairs))
    }

    fn write_judge(&self, folder: &RecordFolder, judge: &Judge) -> Result<String, RunError> {
        let image = format!("images/{}/judge.exr", self.scene.name);
        let [with, without] = judge.image.irradiance.clone();
        Layers::new(self.view.resolution)
            .with("q", judge.image.q.clone())
            .with("q-relative-se", judge.image.relative_se.clone())
            .with("irradiance-with", with)
            .with("irradiance-without", without)
            .write(&folder.path().join(&image))?;
        Ok(image)
    }
}

/// A ratio with its interval, where that is known.
pub(super) fn region_q(estimate: Result<Estimate, Absent>) -> RegionQ {
    match estimate {
        Ok(e) => {
            let interval = Some(e.interval(0.95)).filter(|i| i.iter().all(|v| v.is_finite()));
            RegionQ { value: e.value.is_finite().then_some(e.value), interval, note: None }
        }
        Err(Absent(why)) => RegionQ { value: None, interval: None, note: Some(why) },
    }
}
