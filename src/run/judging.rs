//! The judge of one scene: traced until it is precise, written, recorded.

use super::{RunError, occluders::JudgedOccluder, rendering::Rendered, subject::Subject};
use crate::{
    layers::Layers,
    metrics::{
        Absent, Metric, MetricName,
        judge::{Judge, JudgedRegions, QImage, vague},
        profile,
    },
    record::{JudgeRecord, RecordFolder, RegionQ, Stopped},
    stats::Estimate,
};

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

impl Subject<'_> {
    /// Judges the scene by the images of its judge, and writes Q. Absent where there is
    /// nothing to judge.
    pub(super) fn judge(
        &self,
        folder: &RecordFolder,
        rendered: &Rendered,
    ) -> Result<Result<Judged, Unjudged>, RunError> {
        let pairs = match &rendered.judge {
            None => return Ok(Err(Unjudged::Absent(Absent("the scene has no occluder to judge".into())))),
            Some(Err(why)) => return Ok(Err(Unjudged::Failed(why.clone()))),
            Some(Ok(pairs)) => pairs,
        };
        let settings = &self.plan.suite.file.judge;
        let regions = match JudgedRegions::new(pairs, &self.regions) {
            Ok(regions) => regions,
            Err(absent) => return Ok(Err(Unjudged::Absent(absent))),
        };
        let judge = Judge { regions, image: QImage::new(pairs) };
        if !judge.regions.has_light() {
            return Err(RunError::NoLight { scene: self.facts.name.clone() });
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
        let curve = profile::of_judge(pairs, self.facts.resolution[0] as usize);
        let on_screen = match &self.on_screen {
            None => Err(Absent("the suite has no screen-space method".into())),
            Some(s) => JudgedRegions::new(pairs, &s.regions).and_then(|j| match j.widest() {
                precision if precision <= settings.precision => Ok(j),
                precision => Err(vague(precision)),
            }),
        };
        let usable = if sure { Ok(()) } else { Err(vague(precision)) };
        let occluders = self.occluders.iter().map(|o| o.judge(pairs, settings.precision)).collect();
        Ok(Ok(Judged { usable, on_screen, occluders, judge, record, curve }))
    }

    fn write_judge(&self, folder: &RecordFolder, judge: &Judge) -> Result<String, RunError> {
        let image = format!("images/{}/judge.exr", self.facts.name);
        let [with, without] = judge.image.irradiance.clone();
        Layers::new(self.facts.resolution)
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
