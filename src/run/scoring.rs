//! Images that were handed in become a record: measured and judged as those of a run are,
//! against the references of a kit.

use super::{
    RunError,
    case_metrics::{Others, metrics},
    faults,
    journal::{case_image, look_image},
    judging::{Judged, Unjudged},
    measuring::Counts,
    references::{References, SUITE, SceneReferences},
    rendering::{Images, Rendered, case_layers},
    set::measured,
    subject::Subject,
};
use crate::{
    counted::counted,
    gate::Gate,
    layers::pixel_hash,
    metrics::{
        Absent, Metric, MetricName,
        artifact::{Converged, Method as Measured},
        judge::{JudgedRegions, vague},
        profile::{self, Curve},
        regions::{Region, Regions},
        tiles,
    },
    record::{CaseRecord, HandedIn, Intervals, Machine, Record, RecordFolder, Shows, Source, Timing},
    render::Estimator,
    suite::{Case, Method, Plan, Platform, Suite, SuiteError},
};
use std::{borrow::Cow, time::Instant};

/// Where more of a region than this share is left out of a ratio, what remains does not stand for it: what is
/// dark or white is so because of how it is lit.
const MOST_LEFT_OUT: f64 = 0.1;

/// The images of one case, as they were handed in.
#[derive(Clone, Debug)]
pub struct CaseImages {
    /// What they are images of.
    pub case: Case,
    /// Openness, an image a replicate, of the size of the measure view; or why there is none.
    pub images: Result<Vec<Vec<f32>>, String>,
    /// Where they come from; None where there are no files.
    pub source: Option<Source>,
}

impl CaseImages {
    /// What they show; openness where there are no files.
    pub fn shows(&self) -> Shows {
        self.source.as_ref().map_or(Shows::Openness, |s| s.shows)
    }

    /// Whether they show openness alone.
    pub fn is_openness(&self) -> bool {
        self.shows() == Shows::Openness
    }
}

/// Images with what they are scored against: all is checked, nothing is measured yet.
pub struct Ready<'a> {
    references: &'a References,
    handed: &'a [CaseImages],
    /// With the estimators that the kit does not have.
    suite: Suite,
    foreign: Vec<String>,
}

impl References {
    /// Makes images ready to be scored. `gates`, a TOML text of `[[gate]]` tables and what errors call
    /// it, take the place of the suite's.
    ///
    /// # Errors
    /// Where the gates are malformed, name what is not there, or can be held against nothing in the kit.
    pub fn ready<'a>(&'a self, handed: &'a [CaseImages], gates: Option<(&str, &str)>) -> Result<Ready<'a>, SuiteError> {
        let mut suite = self.suite().clone();
        let foreign = add_foreign(&mut suite, handed);
        if let Some((label, text)) = gates {
            let scenes: Vec<&str> = self.file().scenes.iter().map(|s| s.facts.name.as_str()).collect();
            let mut renderers: Vec<&str> = handed.iter().map(|h| h.case.renderer.as_str()).collect();
            // Gates of a run may be taken as they are: those on our own renderers are idle.
            renderers.extend(["cpu", "gpu"]);
            renderers.sort_unstable();
            renderers.dedup();
            suite.replace_gates(label, text, &scenes, &renderers)?;
        }
        if let Some(message) = self.idle(&suite.gates) {
            let own = self.folder().join(SUITE).display().to_string();
            let file = gates.map_or(own, |(label, _)| label.to_owned());
            return Err(SuiteError::Invalid { file, message });
        }
        Ok(Ready { references: self, handed, suite, foreign })
    }
}

impl References {
    /// Names a gate that is taken under an occluder where none of its scenes has one: whatever is handed in, it
    /// would never be held against anything.
    fn idle(&self, gates: &[Gate]) -> Option<String> {
        let scenes = |gate: &Gate| {
            let all = self.file().scenes.iter().map(|s| &s.facts);
            all.filter(|s| gate.scenes.is_empty() || gate.scenes.contains(&s.name)).collect::<Vec<_>>()
        };
        let is_idle = |gate: &&Gate| gate.needs_occluder() && !scenes(gate).iter().any(|s| s.has_occluder);
        let gate = gates.iter().find(is_idle)?;
        let names: Vec<&str> = scenes(gate).iter().map(|s| s.name.as_str()).collect();
        let region = gate.region.map_or(String::new(), |r| format!(" of {}", r.label()));
        Some(format!(
            "gate '{}': {}{region} is taken under an occluder, and none of its scenes has one: {}",
            gate.name,
            gate.metric.label(),
            names.join(", ")
        ))
    }
}

impl Ready<'_> {
    /// Measures what was handed in and commits its record.
    ///
    /// # Errors
    /// Where references cannot be read, or a file cannot be written. What is wrong with the images of a case ends that case
    /// alone.
    pub fn score(&self, by: HandedIn, folder: &RecordFolder) -> Result<Record, RunError> {
        let start = Instant::now();
        let Ready { references, handed, suite, foreign } = self;
        let in_order = |scene: &SceneReferences| {
            let own = handed.iter().filter(|h| h.case.scene == scene.facts.name);
            own.map(|h| h.case.clone()).collect::<Vec<_>>()
        };
        let plan = Plan {
            suite,
            cases: references.file().scenes.iter().flat_map(in_order).collect(),
            seed: references.file().seed,
            platform: Platform::Cpu,
            external: false,
            filter: None,
            until_sure: None,
            base: None,
            no_base: true,
        };
        let (mut scenes, mut cases) = (Vec::new(), Vec::new());
        for scene in &references.file().scenes {
            let own: Vec<&CaseImages> = handed.iter().filter(|h| h.case.scene == scene.facts.name).collect();
            if own.is_empty() {
                continue;
            }
            let loaded = references.load(&plan, scene).map_err(RunError::Kit)?;
            let mut rendered = loaded.rendered;
            let (regions, occluders, on_screen) = (loaded.regions, loaded.occluders, loaded.on_screen);
            let subject = Subject { plan: &plan, facts: scene.facts.clone(), regions, occluders, on_screen };
            let judged = subject.judge(folder, &rendered)?;
            let scored = Scored { subject: &subject, judged: &judged, handed: &own };
            for handed in &own {
                let mut record = scored.case(handed, &rendered);
                if let (None, Ok(images)) = (&record.error, &handed.images) {
                    let layers = case_layers(subject.facts.resolution, &handed.case, images, None);
                    record.hash = layers.get("mean").map(pixel_hash);
                    layers.write(&folder.path().join(case_image(&handed.case)))?;
                }
                cases.push(record);
            }
            scored.note(&mut rendered);
            references.look(scene).map_err(RunError::Kit)?.write(&folder.path().join(look_image(&scene.facts.name)))?;
            let counts = Counts::all(u32::MAX);
            scenes.push(subject.scene_record(folder, &rendered, &judged, &counts, scored.profiles())?);
        }
        let gpu = format!("none was used: the images were handed in, of the renderer '{}'", by.renderer);
        let mut info = super::suite_info(&plan);
        info.methods.retain(|name, _| !foreign.contains(name));
        let timing = Timing { seconds: start.elapsed().as_secs_f64(), ..super::timing() };
        let record = super::record(super::Found {
            plan: &plan,
            suite: info,
            machine: Machine::here(gpu, None),
            timing,
            end: super::End { incomplete: None, until_sure: None },
            scenes,
            cases,
            handed_in: Some(by),
        });
        folder.commit(&record)?;
        Ok(record)
    }
}

/// Takes back what was measured on too small a part of its regions.
fn withhold(metrics: &mut [Metric], all: &Regions, known: &Regions) {
    let left_out = |region: Region| {
        let [all, known] = [all, known].map(|r| r.pixels(region).len());
        (all - known) as f64 / all.max(1) as f64
    };
    for metric in metrics {
        let most = metric.regions().iter().map(|&r| (left_out(r), r)).max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((share, region)) = most.filter(|(share, _)| *share > MOST_LEFT_OUT && metric.value.is_some()) {
            let why = format!(
                "{:.0} % of the pixels of {} are left out, since they are too dark, too roughly rounded or cut off at \
                 white; what remains does not stand for them",
                100.0 * share,
                region.label()
            );
            *metric = Metric::new(metric.name, metric.region, Err(Absent(why)));
        }
    }
}

/// Adds estimators that the suite does not have: they have no converged image of ours, and
/// their options are not known.
fn add_foreign(suite: &mut Suite, handed: &[CaseImages]) -> Vec<String> {
    let mut foreign: Vec<String> = Vec::new();
    for CaseImages { case, .. } in handed {
        if !suite.methods.iter().any(|m| m.name == case.estimator) {
            foreign.push(case.estimator.clone());
            // With rays of its own, so that it is not taken for the classic one.
            let rays = Some(aogauge_scenes::Count(case.rays));
            suite.methods.push(Method { name: case.estimator.clone(), estimator: Estimator::CLASSIC, rays });
        }
    }
    foreign
}

/// What a case is measured against.
struct Against<'a> {
    judge: Result<&'a Cow<'a, JudgedRegions>, Absent>,
    converged: &'a Converged,
    rendered: &'a Rendered,
}

/// One scene with what was handed in of it.
struct Scored<'a> {
    subject: &'a Subject<'a>,
    judged: &'a Result<Judged, Unjudged>,
    handed: &'a [&'a CaseImages],
}

impl Scored<'_> {
    /// What is found in a case; the hash of its image is not.
    fn case(&self, handed: &CaseImages, rendered: &Rendered) -> CaseRecord {
        let failed =
            |why: String| CaseRecord { source: handed.source.clone(), ..CaseRecord::failed(&handed.case, why) };
        let images = match &handed.images {
            Ok(images) => images,
            Err(why) => return failed(why.clone()),
        };
        let index = self.subject.method(&handed.case);
        let shows = handed.shows();
        let all = self.subject.regions(index);
        let known = match self.known(all, images, shows) {
            Ok(known) => known,
            Err(why) => return failed(why),
        };
        let foreign;
        let converged = match rendered.truths.get(&index) {
            Some(truth) => &truth.converged,
            None => {
                foreign = Converged::new(images.clone());
                &foreign
            }
        };
        let judge = self.judge_on(index, &known, all, rendered);
        let measure = |images: &[Vec<f32>], regions: &Regions| {
            let against = Against { judge: judge.as_ref().map_err(Clone::clone), converged, rendered };
            self.metrics(handed, shows, images, regions, &against)
        };
        let is_one = handed.source.as_ref().is_some_and(|s| s.intervals == Intervals::Tiles);
        let mut metrics = match images.as_slice() {
            [one] if is_one => {
                let center = rendered.truths.get(&index).filter(|_| shows != Shows::Frame);
                let center = center.map(|t| t.converged.mean.as_slice());
                tiles::of_one_frame(one, center, &known, self.subject.facts.resolution, measure)
            }
            _ => measure(images, &known),
        };
        withhold(&mut metrics, all, &known);
        let occluders = if shows == Shows::Openness && !is_one {
            let classic = |regions| self.classic_on(&handed.case, images.len(), regions, rendered);
            self.subject.by_occluder(index, &measured(images, converged, &known), &classic, self.judged)
        } else {
            Vec::new()
        };
        CaseRecord {
            case: handed.case.clone(),
            error: None,
            image: Some(case_image(&handed.case)),
            hash: None,
            metrics,
            looks: None,
            replicates: Some(images.len() as u32),
            log: None,
            warnings: Vec::new(),
            source: handed.source.clone(),
            occluders,
        }
    }

    /// Where images are measured: where a whole frame without AO is black, the ratio is not known.
    fn known(&self, all: &Regions, images: &[Vec<f32>], shows: Shows) -> Result<Regions, String> {
        let known = all.only(|i| shows == Shows::Openness || images.iter().all(|r| r[i as usize].is_finite()));
        if known.pixels(Region::All).is_empty() {
            return Err("no pixel that sees a surface holds a number in all of its images".to_owned());
        }
        let width = self.subject.facts.resolution[0];
        for (replicate, image) in (0..).zip(images) {
            faults::check(image, |_| true, &known, replicate, width).map_err(|e| e.to_string())?;
        }
        Ok(known)
    }

    /// The judge over the pixels that a case is measured on: where a ratio is not known in some, over
    /// the others alone, as the case is.
    fn judge_on(
        &self,
        index: usize,
        known: &Regions,
        all: &Regions,
        rendered: &Rendered,
    ) -> Result<Cow<'_, JudgedRegions>, Absent> {
        let own = self.subject.judge_of(index, self.judged)?;
        if Region::ALL.iter().all(|&r| known.pixels(r).len() == all.pixels(r).len()) {
            return Ok(Cow::Borrowed(own));
        }
        let Some(Ok(pairs)) = &rendered.judge else { return Ok(Cow::Borrowed(own)) };
        let judge = JudgedRegions::new(pairs, known)?;
        let (found, wanted) = (judge.widest(), self.subject.plan.suite.file.judge.precision);
        if found <= wanted { Ok(Cow::Owned(judge)) } else { Err(vague(found, pairs.len(), wanted)) }
    }

    /// Every metric over some regions.
    fn metrics(
        &self,
        handed: &CaseImages,
        shows: Shows,
        images: &[Vec<f32>],
        regions: &Regions,
        against: &Against<'_>,
    ) -> Vec<Metric> {
        let case = &handed.case;
        let &Against { ref judge, converged, rendered } = against;
        let method = measured(images, converged, regions);
        if shows == Shows::Frame {
            return method.contrasts().to_vec();
        }
        let index = self.subject.method(case);
        let is_classic = self.subject.plan.suite.is_classic(&case.estimator);
        let beside = if is_classic { None } else { self.classic_on(case, images.len(), regions, rendered) };
        let lacks_classic = beside.is_none() && !is_classic;
        let others = Others {
            classic: beside,
            cpu: None,
            judge: judge.clone().map(|j| &**j),
            image: self.judged.as_ref().map_err(Unjudged::absent).and_then(Judged::image),
            occluder: self.subject.facts.has_occluder,
        };
        let mut metrics = metrics(&method, &others);
        if lacks_classic && self.subject.facts.has_occluder {
            let why = self.no_classic(images.len());
            metrics.push(Metric::new(MetricName::Removed, None, Err(Absent(why))));
        }
        if !rendered.truths.contains_key(&index) {
            let why = format!("the suite has no estimator '{}', so there is no converged image of it", case.estimator);
            for m in &mut metrics {
                if m.name.is_against_converged() {
                    *m = Metric::new(m.name, m.region, Err(Absent(why.clone())));
                }
            }
        }
        metrics
    }

    /// The images of classic AO that a case is compared with: as many, of the same renderer;
    /// of as many rays, else of the most.
    fn classic_on<'r>(
        &'r self,
        case: &Case,
        replicates: usize,
        regions: &'r Regions,
        rendered: &'r Rendered,
    ) -> Option<Measured<'r>> {
        let suite = self.subject.plan.suite;
        let index = suite.classic();
        let theirs = self.handed.iter().filter(|h| h.case.estimator == suite.methods[index].name && h.is_openness());
        let as_many = theirs.filter_map(|h| Some((&h.case, h.images.as_ref().ok().filter(|i| i.len() == replicates)?)));
        let (_, images) = as_many.max_by_key(|(own, _)| (own.rays == case.rays, own.rays))?;
        Some(measured(images, &rendered.truths.get(&index)?.converged, regions))
    }

    /// Why a case of so many images has no classic AO to be compared with.
    fn no_classic(&self, replicates: usize) -> String {
        let suite = self.subject.plan.suite;
        let name = &suite.methods[suite.classic()].name;
        let theirs: Vec<&&CaseImages> = self.handed.iter().filter(|h| h.case.estimator == *name).collect();
        let images = |n: usize| counted(n, "image", "images");
        let counts: Vec<String> = theirs
            .iter()
            .filter(|h| h.is_openness())
            .filter_map(|h| Some(images(h.images.as_ref().ok()?.len())))
            .collect();
        match (theirs.is_empty(), counts.is_empty()) {
            (true, _) => format!("no image of classic AO ('{name}') of this renderer was handed in for this scene"),
            (false, true) => format!("the images of classic AO ('{name}') cannot be used, or are whole frames"),
            _ => format!(
                "there are {} of this case and {} of classic AO ('{name}'): as many are needed",
                images(replicates),
                counts.join(" or ")
            ),
        }
    }

    /// What was handed in along the transect, of each estimator the case of the most rays.
    fn profiles(&self) -> Vec<Curve> {
        let usable = || self.handed.iter().filter(|h| h.images.is_ok());
        let has_most = |h: &CaseImages| {
            usable().filter(|o| o.case.estimator == h.case.estimator).all(|o| o.case.rays <= h.case.rays)
        };
        let width = self.subject.facts.resolution[0] as usize;
        let of = |h: &&CaseImages| {
            let (images, label) = (h.images.as_ref().ok()?, &h.case.estimator);
            if h.shows() != Shows::Frame {
                return Some(profile::of_method(label, images, width));
            }
            let regions = self.subject.regions(self.subject.method(&h.case));
            let flank = |side| {
                let means: Vec<f64> = images.iter().filter_map(|i| regions.mean(side, i).ok()).collect();
                means.iter().sum::<f64>() / means.len() as f64
            };
            let flank = flank(Region::Left).max(flank(Region::Right));
            (flank > 0.0).then(|| profile::of_frames(label, images, width, flank))
        };
        usable().filter(|h| has_most(h)).filter_map(of).collect()
    }

    /// Puts images of openness where convergence is taken from.
    fn note(&self, rendered: &mut Rendered) {
        for handed in self.handed {
            if let (Ok(replicates), true) = (&handed.images, handed.is_openness()) {
                let images = Images { replicates: replicates.clone(), hash: String::new(), seconds: 0.0, retries: 0 };
                rendered.images.insert(handed.case.id(), Ok(images));
            }
        }
        // For methods that nobody handed in, nothing is told.
        let methods = self.subject.plan.methods();
        rendered.truths.retain(|m, _| methods.contains(m));
    }
}
