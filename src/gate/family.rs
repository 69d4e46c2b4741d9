//! All verdicts of a run, taken together.

use super::{
    Gate, Other, Outcome, PValue, Verdict,
    against::{Parts, estimate},
    floor, place, words,
};
use crate::{
    metrics::{Absent, Metric, MetricName},
    record::{CaseRecord, IdleGate, Intervals, Record, SceneRecord, SuiteInfo},
    stats::{Estimate, holm, spending},
    suite::Case,
};

/// What gates are held against: what a record holds, and the record of another run.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// The suite with its gates.
    pub suite: &'a SuiteInfo,
    /// The GPU, or why there is none, for gates that wait for one.
    pub gpu: &'a str,
    /// What the names of cases had to contain, where only some were asked for. Then a
    /// gate that lacks cases is no fault of the run.
    pub filter: Option<&'a str>,
    /// The scenes.
    pub scenes: &'a [SceneRecord],
    /// The cases.
    pub cases: &'a [CaseRecord],
    /// The record that gates `against` [`BASE`](super::BASE) need.
    pub base: Option<&'a Record>,
    /// Whether there is none on purpose: then such gates are idle with an excuse.
    pub no_base: bool,
    /// Whether images were handed in: then a gate on cases that were not is no fault.
    pub handed_in: bool,
}

impl<'a> From<&'a Record> for Evidence<'a> {
    /// To judge a record anew, without a base.
    fn from(record: &'a Record) -> Self {
        Evidence {
            suite: &record.suite,
            gpu: &record.machine.gpu,
            filter: record.filter.as_deref(),
            scenes: &record.scenes,
            cases: &record.cases,
            base: None,
            no_base: record.no_base,
            handed_in: record.handed_in.is_some(),
        }
    }
}

/// Holds every gate of a suite against every case it applies to. Failures come first.
///
/// A pure function of what a record holds, so that records whose parts were rendered
/// apart are judged as one.
///
/// Three families are corrected by Holm's method, which needs no independence: what
/// would be red (limits that are broken, known failures that hold), what would be green
/// (the reverse), and what would warn. So for each level alpha the chance that any
/// gate of that alpha or a smaller one is wrongly red is at most alpha, in the whole
/// run; and so for green. A p-value from look k of several is first divided by
/// [`spending`](crate::stats::spending)(k); a difference from a case at another look, or from a
/// base record with looks of its own, by both, since either may have been looked at with any
/// look of the other.
pub fn judge(evidence: &Evidence<'_>) -> (Vec<Verdict>, Vec<IdleGate>) {
    let Evidence { suite, gpu, filter, scenes, cases, base, no_base, handed_in } = *evidence;
    let run =
        Run { parts: Parts { suite, scenes, cases }, base: base.map(Parts::from), no_base, gpu, filter, handed_in };
    let (mut drafts, mut idle) = (Vec::new(), Vec::new());
    for gate in &suite.gates {
        match run.drafts(gate) {
            Ok(of_gate) => drafts.extend(of_gate),
            Err(gate) => idle.push(gate),
        }
    }
    let families = Families::new(&drafts);
    let mut verdicts: Vec<Verdict> = drafts.iter().enumerate().map(|(i, d)| run.settle(d, &families, i)).collect();
    verdicts.sort_by_key(|v| v.outcome);
    (verdicts, idle)
}

/// How many tests the verdicts of a run can be at most: what to correct for before all
/// of them are there (see [`decided`](crate::stats::decided)).
pub fn family_at_most(gates: &[Gate], scenes: &[&str], cases: &[Case]) -> usize {
    let of = |gate: &Gate| {
        let judges = scenes.iter().filter(|s| gate.applies_to_judge(s)).count();
        judges + cases.iter().filter(|c| gate.applies_to(c)).count()
    };
    gates.iter().map(of).sum()
}

/// A verdict before its family is known.
struct Draft<'a> {
    gate: &'a Gate,
    scene: &'a str,
    case: Option<&'a CaseRecord>,
    metric: Metric,
    other: Option<Other>,
    /// The estimator that the gate names and no case of which has the metric.
    lacking: Option<&'a str>,
    spent: f64,
}

impl Draft<'_> {
    /// What is held against the limit, or why there is nothing.
    fn held(&self) -> Result<Estimate, String> {
        let (held, note) = match &self.other {
            None => (estimate(&self.metric), &self.metric.note),
            Some(other) => (other.difference.estimate(), &other.difference.note),
        };
        held.ok_or_else(|| note.clone().unwrap_or_else(|| "the metric has no interval".to_owned()))
    }
}

struct Run<'a> {
    parts: Parts<'a>,
    base: Option<Parts<'a>>,
    no_base: bool,
    gpu: &'a str,
    filter: Option<&'a str>,
    handed_in: bool,
}

impl<'a> Run<'a> {
    /// What a gate is held against in this run, or why it is idle.
    fn drafts(&self, gate: &'a Gate) -> Result<Vec<Draft<'a>>, IdleGate> {
        let idle = |reason: String, excused| IdleGate { gate: gate.name.clone(), reason, excused };
        let no_gpu = !self.parts.cases.iter().any(|c| c.case.renderer == "gpu");
        if no_gpu && !gate.renderers.is_empty() && gate.renderers.iter().all(|r| r == "gpu") {
            return Err(idle(format!("this run used no GPU: {}", self.gpu), true));
        }
        let is_there = |name: &String| name == "cpu" || self.parts.cases.iter().any(|c| c.case.renderer == *name);
        if !gate.renderers.is_empty() && !gate.renderers.iter().any(is_there) {
            let names = gate.renderers.join(", ");
            return Err(idle(format!("this run used none of the renderers it is for: {names}"), true));
        }
        let mut drafts = Vec::new();
        for scene in self.parts.scenes.iter().filter(|s| gate.applies_to_judge(&s.name)) {
            let metric = match &scene.judge {
                Some(judge) => judge.contrast.clone(),
                None => {
                    let why = scene.no_judge.clone().or_else(|| scene.judge_error.clone());
                    absent(gate, &why.unwrap_or_else(|| "the scene has no judge".to_owned()))
                }
            };
            drafts.push(self.draft(gate, &scene.name, None, metric));
        }
        let mut unknown = None;
        for record in self.parts.cases.iter().filter(|c| gate.applies_to(&c.case)) {
            if let Some(metric) = record.metric(gate.metric, gate.region) {
                if self.cannot_be_known(gate.metric, record) {
                    unknown = metric.note.clone();
                    continue;
                }
                drafts.push(self.draft(gate, &record.case.scene, Some(record), metric.clone()));
            }
        }
        if drafts.is_empty() {
            return Err(match self.filter {
                Some(filter) => idle(format!("no case that was asked for (--filter {filter}) has this metric"), true),
                None if self.handed_in => {
                    idle(unknown.unwrap_or_else(|| "nothing that was handed in has this metric".to_owned()), true)
                }
                None => idle("no case of this run has this metric".to_owned(), false),
            });
        }
        if gate.is_against_base() && self.base.is_none() {
            return Err(match self.no_base {
                true => idle("there is no base record to hold it against (--no-base)".to_owned(), true),
                false => {
                    let why = "no base record was given to hold it against: give --base DIR, or --no-base where there is \
                               none yet";
                    idle(why.to_owned(), false)
                }
            });
        }
        if self.filter.is_none() && !self.handed_in {
            drafts.extend(missing(gate, &drafts));
        }
        Ok(drafts)
    }

    /// Whether what was handed in can never have a metric: one image has no other to differ from, an estimator that the
    /// suite does not have no converged image. No gate waits for it.
    fn cannot_be_known(&self, metric: MetricName, record: &CaseRecord) -> bool {
        let Some(source) = record.source.as_ref().filter(|_| self.handed_in) else { return false };
        let is_foreign = !self.parts.suite.methods.contains_key(&record.case.estimator);
        metric == MetricName::DistinctReplicates && source.intervals == Intervals::Tiles
            || metric.is_against_converged() && is_foreign
    }

    fn draft(&self, gate: &'a Gate, scene: &'a str, case: Option<&'a CaseRecord>, metric: Metric) -> Draft<'a> {
        let share = |looks: Option<u32>| looks.map_or(1.0, spending);
        let mut spent = share(case.and_then(|c| c.looks));
        let other = self.parts.other(self.base.as_ref(), gate, scene, case.map(|c| &c.case), &metric);
        let other = other.map(|(other, looks)| {
            // Two cases of one run are looked at together, the k-th time both.
            if gate.is_against_base() || looks != case.and_then(|c| c.looks) {
                spent *= share(looks);
            }
            other
        });
        Draft { gate, scene, case, metric, other, lacking: None, spent }
    }

    /// The verdict, when all p-values are there.
    fn settle(&self, draft: &Draft<'_>, families: &Families, i: usize) -> Verdict {
        let Draft { gate, scene, case, metric, other, lacking, spent } = draft;
        let held = draft.held();
        let mut verdict = Verdict {
            gate: gate.name.clone(),
            scene: (*scene).to_owned(),
            case: case.map(|c| c.case.clone()),
            lacking: lacking.map(str::to_owned),
            metric: metric.clone(),
            against: other.clone(),
            limit: gate.limit,
            warn: gate.warn,
            confidence: gate.confidence,
            interval: None,
            margin: None,
            detectable: None,
            floor: None,
            p_holds: families.p(Test::Holds, i),
            p_broken: families.p(Test::Broken, i),
            p_warn_broken: families.p(Test::WarnBroken, i),
            spent: *spent,
            place: None,
            picture: None,
            outcome: Outcome::Inconclusive,
            reason: String::new(),
        };
        let is_there = case.is_some() || gate.metric == MetricName::JudgeContrast;
        if let Some(record) = self.parts.scene(scene).filter(|_| is_there) {
            let on_screen = case.is_some_and(|c| self.parts.is_on_screen(&c.case.estimator));
            verdict.place = Some(place::place(metric, record, *case, on_screen));
            verdict.picture = place::picture(metric, record, *case);
        }
        match held {
            Ok(held) => {
                let interval = held.interval(gate.confidence);
                verdict.interval = Some(interval).filter(|i| i.iter().all(|v| v.is_finite()));
                verdict.margin = Some(gate.limit.margin(held.value));
                let level = gate.alpha() * spent / families.size.max(1) as f64;
                verdict.detectable = gate.limit.detectable(&held, level);
                let theirs = other.as_ref().and_then(|o| Some((o.name.as_str(), o.metric.as_ref()?)));
                verdict.floor = floor::of_held(metric, theirs);
                verdict.outcome = outcome(gate, &verdict);
                verdict.reason = words::reason(gate, &verdict, families.size);
            }
            Err(why) => verdict.reason = why,
        }
        verdict
    }
}

/// A scene or an estimator that the gate names must not drop out of it unseen.
fn missing<'a>(gate: &'a Gate, drafts: &[Draft<'a>]) -> Vec<Draft<'a>> {
    let none = |scene: &'a str, lacking: Option<&'a str>, why: &str| {
        let metric = absent(gate, why);
        Draft { gate, scene, case: None, metric, other: None, lacking, spent: 1.0 }
    };
    let has = |d: &Draft<'_>, name: &str| d.case.is_some_and(|c| c.case.estimator == name);
    let scenes = gate.scenes.iter().filter(|s| !drafts.iter().any(|d| d.scene == **s));
    let estimators = gate.estimators.iter().filter(|e| !drafts.iter().any(|d| has(d, e)));
    let first = drafts.first().map_or("", |d| d.scene);
    scenes
        .map(|scene| none(scene, None, "no case of this scene has this metric"))
        .chain(estimators.map(|name| {
            let why = format!("no case of the estimator '{name}' has this metric");
            none(first, Some(name.as_str()), &why)
        }))
        .collect()
}

fn absent(gate: &Gate, why: &str) -> Metric {
    Metric::new(gate.metric, gate.region, Err(Absent(why.to_owned())))
}

/// What the adjusted p-values come to.
fn outcome(gate: &Gate, verdict: &Verdict) -> Outcome {
    let shown = |p: Option<PValue>| p.is_some_and(|p| p.adjusted < gate.alpha());
    let (holds, broken) = (shown(verdict.p_holds), shown(verdict.p_broken));
    match (holds, broken, gate.known_failure.is_some()) {
        (true, _, true) | (_, true, false) => Outcome::Fail,
        (_, true, true) => Outcome::KnownFailure,
        (true, _, false) if shown(verdict.p_warn_broken) => Outcome::Warn,
        (true, _, false) => Outcome::Pass,
        _ => Outcome::Inconclusive,
    }
}

#[derive(Clone, Copy)]
enum Test {
    Holds,
    Broken,
    WarnBroken,
}

/// The p-values of all drafts, alone and adjusted.
struct Families {
    /// By [`Test`], then by draft; NaN where a test was not made.
    raw: [Vec<f64>; 3],
    adjusted: [Vec<f64>; 3],
    /// Verdicts that tests were made of.
    size: usize,
}

impl Families {
    fn new(drafts: &[Draft<'_>]) -> Self {
        let held: Vec<Option<Estimate>> = drafts.iter().map(|d| d.held().ok()).collect();
        let all = |p: &dyn Fn(&Gate, &Estimate) -> f64| -> Vec<f64> {
            drafts.iter().zip(&held).map(|(d, h)| h.as_ref().map_or(f64::NAN, |e| p(d.gate, e))).collect()
        };
        let holds = all(&|gate, e| gate.limit.p_holds(e));
        let broken = all(&|gate, e| gate.limit.p_broken(e));
        let warn = all(&|gate, e| gate.warn.map_or(f64::NAN, |w| w.p_broken(e)));
        let spent = |i: usize, p: f64| if p.is_nan() { p } else { (p / drafts[i].spent).min(1.0) };
        // A known failure is red where it holds: what is red is one family, what is
        // green another.
        let known = |i: usize| drafts[i].gate.known_failure.is_some();
        let side = |red: bool| -> Vec<f64> {
            let of = |i: usize| if known(i) == red { holds[i] } else { broken[i] };
            holm(&(0..drafts.len()).map(|i| spent(i, of(i))).collect::<Vec<_>>())
        };
        let (red, green) = (side(true), side(false));
        let pick = |holds: bool| -> Vec<f64> {
            (0..drafts.len()).map(|i| if known(i) == holds { red[i] } else { green[i] }).collect()
        };
        let adjusted_warn = holm(&warn.iter().enumerate().map(|(i, p)| spent(i, *p)).collect::<Vec<_>>());
        let adjusted = [pick(true), pick(false), adjusted_warn];
        let size = holds.iter().filter(|p| !p.is_nan()).count();
        Families { raw: [holds, broken, warn], adjusted, size }
    }

    fn p(&self, test: Test, i: usize) -> Option<PValue> {
        let (raw, adjusted) = (self.raw[test as usize][i], self.adjusted[test as usize][i]);
        (!raw.is_nan() && !adjusted.is_nan()).then_some(PValue { raw, adjusted })
    }
}
