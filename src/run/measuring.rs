//! The metrics of a scene's cases, from their images.

use super::{
    RunError,
    case_metrics::{Others, metrics},
    external,
    journal::case_image,
    judging::{Judged, Unjudged},
    occluders::Occluder,
    on_screen::is_on_screen,
    rendering::{Rendered, Truth},
    set::measured,
    subject::Subject,
};
use crate::{
    metrics::{Absent, Metric, artifact::Method as Measured, error::Pairing, judge::JudgedRegions, regions::Regions},
    record::{CaseRecord, OccluderMetrics, RecordFolder, SceneRecord, Undecided},
    suite::Case,
};

use std::collections::BTreeMap;

/// How many replicates each case is measured from.
#[derive(Clone, Debug, Default)]
pub(super) struct Counts {
    /// By the case's id: replicates, and the look that it was.
    of: BTreeMap<String, (u32, u32)>,
    /// For all others.
    every: Option<u32>,
    /// What a budget ended.
    pub undecided: Vec<Undecided>,
    /// Whether the run was asked to stop while verdicts were not decided.
    pub stopped: bool,
}

impl Counts {
    /// The same of all.
    pub fn all(replicates: u32) -> Self {
        Counts { every: Some(replicates), ..Counts::default() }
    }

    /// Replicates at a look.
    pub fn set(&mut self, case: &Case, replicates: u32, look: u32) {
        self.of.insert(case.id(), (replicates, look));
    }

    /// The replicates of a case; 0 where it is not rendered.
    pub fn replicates(&self, case: &Case) -> u32 {
        self.of.get(&case.id()).map(|(n, _)| *n).or(self.every).unwrap_or(0)
    }

    /// Which look it was, where there can be several.
    fn look(&self, case: &Case) -> Option<u32> {
        self.of.get(&case.id()).map(|(_, look)| *look)
    }
}

/// What is said of a case that the run did not come to.
pub(super) const NOT_RENDERED: &str = "the run ended before it was rendered";

impl Subject<'_> {
    /// What was found in the scene and its cases. Where the judge, a converged image or
    /// the pictures are missing, there is no scene, and its cases say so.
    pub(super) fn measure(
        &self,
        folder: &RecordFolder,
        rendered: &Rendered,
        counts: &Counts,
    ) -> Result<(Option<SceneRecord>, Vec<CaseRecord>), RunError> {
        let missing = match &rendered.look {
            Some(Err(why)) => Some(format!("the scene's pictures could not be rendered: {why}")),
            None => Some(NOT_RENDERED.to_owned()),
            Some(Ok(())) => None,
        };
        let short = !self.is_ready(rendered);
        if let Some(why) = missing.or_else(|| short.then(|| NOT_RENDERED.to_owned())) {
            return Ok((None, self.cases().map(|c| CaseRecord::failed(c, why.clone())).collect()));
        }
        let judged = self.judge(folder, rendered)?;
        let cases = self.case_records(rendered, &judged, counts);
        let scene = self.scene_record(folder, rendered, &judged, counts, self.profiles(rendered, counts))?;
        Ok((Some(scene), cases))
    }

    /// Whether everything is there that cases are measured with.
    pub(super) fn is_ready(&self, rendered: &Rendered) -> bool {
        self.plan.methods().iter().all(|m| rendered.truths.contains_key(m))
            && (!self.facts.has_occluder || rendered.judge.is_some())
    }

    /// The judge of the pixels that a method is measured on.
    pub(super) fn judge_of<'b>(
        &self,
        method: usize,
        judged: &'b Result<Judged, Unjudged>,
    ) -> Result<&'b JudgedRegions, Absent> {
        let judged = judged.as_ref().map_err(Unjudged::absent)?;
        if is_on_screen(&self.plan.suite.methods[method]) {
            return judged.on_screen.as_ref().map_err(Clone::clone);
        }
        judged.usable.clone().map(|()| &judged.judge.regions)
    }

    /// What was found in each case, from the first so many replicates of its images.
    pub(super) fn case_records(
        &self,
        rendered: &Rendered,
        judged: &Result<Judged, Unjudged>,
        counts: &Counts,
    ) -> Vec<CaseRecord> {
        let images = |case: &Case| rendered.replicates(case, counts);
        let truth = |case: &Case| rendered.truths.get(&self.method(case));
        let mut records = Vec::new();
        for case in self.cases() {
            let index = self.method(case);
            let own = match (rendered.images.get(&case.id()), truth(case)) {
                (Some(Ok(_)), _) if counts.replicates(case) == 0 => Err(NOT_RENDERED.to_owned()),
                (Some(Ok(own)), Some(Truth { converged, fault: None })) => Ok((own, converged)),
                (Some(Err(e)), _) => Err(e.clone()),
                (_, Some(Truth { fault: Some(e), .. })) => Err(format!("its converged image cannot be used: {e}")),
                (None, _) | (_, None) => Err(NOT_RENDERED.to_owned()),
            };
            let regions = self.regions(index);
            let looked_at = own.and_then(|(own, converged)| {
                let replicates = images(case).unwrap_or(&own.replicates);
                let warnings = self.of_commands(case, replicates, &converged.mean, regions)?;
                Ok((own, replicates, converged, warnings))
            });
            let (own, replicates, converged, warnings) = match looked_at {
                Ok(looked_at) => looked_at,
                Err(e) => {
                    records.push(CaseRecord::failed(case, e));
                    continue;
                }
            };
            let method = measured(replicates, converged, regions);
            let classic_on = |regions| self.classic_beside(case, rendered, counts, regions);
            let on_cpu = Case { renderer: "cpu".into(), ..case.clone() };
            let cpu = images(&on_cpu).filter(|_| case.renderer != "cpu");
            // Whoever draws random numbers of their own shares none with the CPU.
            let cpu = cpu.map(|images| (images, if case.is_external() { Pairing::None } else { Pairing::Seeds }));
            let others = Others {
                classic: classic_on(regions),
                cpu,
                judge: self.judge_of(index, judged),
                image: judged.as_ref().map_err(Unjudged::absent).and_then(Judged::image),
                occluder: self.facts.has_occluder,
            };
            records.push(CaseRecord {
                case: case.clone(),
                error: None,
                image: Some(case_image(case)),
                hash: Some(own.hash.clone()),
                metrics: metrics(&method, &others),
                replicates: Some(replicates.len() as u32),
                looks: counts.look(case),
                source: None,
                log: None,
                warnings,
                occluders: self.by_occluder(index, &method, &classic_on, judged),
            });
        }
        records
    }

    /// The images of classic AO that a case is compared with, measured on some regions.
    fn classic_beside<'b>(
        &self,
        case: &Case,
        rendered: &'b Rendered,
        counts: &Counts,
        regions: &'b Regions,
    ) -> Option<Measured<'b>> {
        let suite = &self.plan.suite;
        let classic = Some(suite.classic_beside(case)).filter(|_| !suite.is_classic(&case.estimator))?;
        let truth = rendered.truths.get(&self.method(&classic)).filter(|t| t.fault.is_none())?;
        Some(measured(rendered.replicates(&classic, counts)?, &truth.converged, regions))
    }

    /// dK of classic AO on the pixels of a case: what is removed has a value only where this is
    /// clearly above 0.
    pub(super) fn classic_error(
        &self,
        case: &Case,
        rendered: &Rendered,
        judged: &Result<Judged, Unjudged>,
        counts: &Counts,
    ) -> Option<Metric> {
        let method = self.method(case);
        let classic = self.classic_beside(case, rendered, counts, self.regions(method))?;
        Some(classic.contrast_error(self.judge_of(method, judged)))
    }

    /// What is doubtful in images that somebody else's program left, or what is wrong with them; nothing in
    /// ours.
    fn of_commands(
        &self,
        case: &Case,
        images: &[Vec<f32>],
        converged: &[f32],
        regions: &Regions,
    ) -> Result<Vec<String>, String> {
        let Some(by) = self.plan.suite.renderers.iter().find(|r| case.is_external() && r.file.name == case.renderer)
        else {
            return Ok(Vec::new());
        };
        let declared = &by.external.image;
        let [wrong, doubtful] = external::diagnosed(images, converged, regions, self.facts.resolution, declared);
        if wrong.is_empty() { Ok(doubtful) } else { Err(format!("its images are wrong: {}", wrong.join("; and: "))) }
    }

    /// The metrics of a case under each occluder of several.
    pub(super) fn by_occluder<'b>(
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
}
