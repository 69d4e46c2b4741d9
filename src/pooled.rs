//! A suite's scenes taken together, by estimator, renderer and rays: a pure function
//! of a record's scenes and cases.
//!
//! Contrast errors and errors under occluders are pooled over the scenes that are no
//! controls, over-darkening over the controls. Errors against Q are not pooled: over
//! the flanks they measure the direction of light.
//!
//! Scenes draw the same random numbers, so their estimates depend on each other in a
//! way that is not known. The standard error of a pooled value f(x_1, x_2, ...) is
//! therefore the bound that holds for any dependence, sum |df/dx_i| se_i (Cauchy and
//! Schwarz; reached where all move together), to first order, with the fewest degrees
//! of freedom of any x_i: intervals are too wide rather than too narrow.

use crate::{
    metrics::{Absent, Metric, MetricName, Quantity, regions::Region},
    record::{CaseRecord, SceneRecord, SuiteInfo},
    stats::Estimate,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A method on one renderer with one ray count, over the scenes of a suite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pooled {
    /// The estimator.
    pub estimator: String,
    /// The renderer.
    pub renderer: String,
    /// Rays a pixel.
    pub rays: u32,
    /// Mean K over the same scenes; null in records made before it was pooled.
    #[serde(default)]
    pub contrast: Pool,
    /// Mean dK over scenes. 0 is right on average; errors of two signs cancel.
    pub contrast_error: Pool,
    /// Mean |dK| over scenes, those included whose dK may be 0: leaving these out
    /// would punish a method for every scene that it gets nearly right. Lower is
    /// better. Noise of a standard error se adds at most sqrt(2/pi) se to it.
    pub contrast_error_size: Pool,
    /// 1 - sum max(0, dK) / sum dK(classic), over scenes where classic clearly shows
    /// a false highlight: its 95 % interval lies above 0. 1 takes all away, 0 leaves
    /// it. Null for classic itself.
    pub removed: Pool,
    /// Mean of O less the converged image, over all pixels of footprints.
    pub bias: Pool,
    /// Mean absolute difference from it, likewise. Lower is better.
    pub mae: Pool,
    /// Root mean square difference from it, likewise; squares are pooled. Lower is
    /// better.
    pub rmse: Pool,
    /// Mean over control scenes, each with the same weight, of the mean of
    /// O(classic) - O. 0 is right. Null for classic itself.
    pub over_darkening: Pool,
}

/// A pooled value and where it comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pool {
    /// The value with its uncertainty.
    pub pooled: Quantity,
    /// The scenes that are in it.
    pub scenes: Vec<String>,
    /// The scenes that could not be, with the reason.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub left_out: Vec<LeftOut>,
}

/// A scene without the value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// The scene.
    pub scene: String,
    /// Why.
    pub why: String,
}

/// What a scene adds to a pool: each value with its weight; f is their sum or made of
/// it.
#[derive(Default)]
struct Terms {
    scenes: Vec<String>,
    left_out: Vec<LeftOut>,
    values: Vec<Estimate>,
    /// Beside the values: pixels, or dK(classic) as far as it is needed.
    weights: Vec<f64>,
    classic: Vec<Estimate>,
}

/// One row of the table, with the cases that belong to it.
struct Row<'a> {
    suite: &'a SuiteInfo,
    scenes: &'a [SceneRecord],
    cases: &'a [CaseRecord],
    key: (&'a str, &'a str, u32),
}

/// Pools the cases of a record, in the order in which their keys first appear.
pub fn pooled(suite: &SuiteInfo, scenes: &[SceneRecord], cases: &[CaseRecord]) -> Vec<Pooled> {
    let mut keys: Vec<(&str, &str, u32)> = Vec::new();
    for CaseRecord { case, .. } in cases {
        let key = (case.estimator.as_str(), case.renderer.as_str(), case.rays);
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    keys.into_iter().map(|key| Row { suite, scenes, cases, key }.pooled()).collect()
}

impl Row<'_> {
    fn pooled(&self) -> Pooled {
        let (estimator, renderer, rays) = self.key;
        let under = |name| self.terms(false, |s, c| self.under_occluder(s, c, name));
        let error = self.terms(false, |_, c| Ok((value(c, MetricName::ContrastError, None)?, 1.0)));
        Pooled {
            estimator: estimator.to_owned(),
            renderer: renderer.to_owned(),
            rays,
            contrast: self.terms(false, |_, c| Ok((value(c, MetricName::Contrast, None)?, 1.0))).mean(),
            contrast_error_size: error.map(|e| Estimate { value: e.value.abs(), ..e }).mean(),
            contrast_error: error.mean(),
            removed: self.removed(),
            bias: under(MetricName::Bias).mean(),
            mae: under(MetricName::Mae).mean(),
            rmse: under(MetricName::Rmse).root_mean_square(),
            over_darkening: self.over_darkening(),
        }
    }

    /// The case of this row in a scene, if it is in the plan.
    fn case(&self, scene: &SceneRecord, (estimator, renderer, rays): (&str, &str, u32)) -> Option<&CaseRecord> {
        self.cases.iter().find(|c| {
            let case = &c.case;
            case.scene == scene.name && case.estimator == estimator && case.renderer == renderer && case.rays == rays
        })
    }

    /// The terms of all scenes, controls or not, that the row has a case of.
    fn terms(&self, control: bool, of: impl Fn(&SceneRecord, &CaseRecord) -> Result<(Estimate, f64), Absent>) -> Terms {
        let mut terms = Terms::default();
        for scene in self.scenes.iter().filter(|s| s.control == control) {
            let Some(case) = self.case(scene, self.key) else { continue };
            match of(scene, case) {
                Ok((value, weight)) => {
                    terms.scenes.push(scene.name.clone());
                    terms.values.push(value);
                    terms.weights.push(weight);
                }
                Err(Absent(why)) => terms.left_out.push(LeftOut { scene: scene.name.clone(), why }),
            }
        }
        terms
    }

    /// An error over the footprint, weighted by the pixels it is taken over.
    fn under_occluder(
        &self,
        scene: &SceneRecord,
        case: &CaseRecord,
        name: MetricName,
    ) -> Result<(Estimate, f64), Absent> {
        let region = Region::Footprint;
        let method = self.suite.methods.get(&case.case.estimator);
        let screen = scene.screen.as_ref().filter(|_| method.is_some_and(crate::suite::EstimatorFile::is_screen_space));
        let pixels = screen.map_or(&scene.regions, |s| &s.regions).get(&region).copied().unwrap_or_default();
        Ok((value(case, name, Some(region))?, pixels as f64))
    }

    /// The case of classic AO beside one of this row: of as many rays, else of the
    /// most.
    fn classic(&self, scene: &SceneRecord) -> Option<&CaseRecord> {
        let (_, renderer, rays) = self.key;
        let classic = self.suite.classic.as_str();
        self.case(scene, (classic, renderer, rays)).or_else(|| {
            let all = self
                .cases
                .iter()
                .filter(|c| c.case.scene == scene.name && c.case.estimator == classic && c.case.renderer == renderer);
            all.max_by_key(|c| c.case.rays)
        })
    }

    /// For classic itself: nothing is compared with it.
    fn of_classic(&self) -> Option<Pool> {
        let why = || Absent("classic is what the others are compared with".into());
        let is = self.key.0 == self.suite.classic;
        is.then(|| Pool { pooled: Quantity::new(Err(why())), scenes: vec![], left_out: vec![] })
    }

    fn over_darkening(&self) -> Pool {
        let of = |_: &SceneRecord, c: &CaseRecord| Ok((value(c, MetricName::OverDarkening, None)?, 1.0));
        self.of_classic().unwrap_or_else(|| self.terms(true, of).mean())
    }

    fn removed(&self) -> Pool {
        if let Some(none) = self.of_classic() {
            return none;
        }
        let mut classic = Vec::new();
        let mut terms = self.terms(false, |_, c| Ok((value(c, MetricName::ContrastError, None)?, 1.0)));
        let mut kept = Terms { left_out: std::mem::take(&mut terms.left_out), ..Terms::default() };
        for (name, own) in terms.scenes.into_iter().zip(terms.values) {
            let beside = self.scenes.iter().find(|s| s.name == name).and_then(|s| self.classic(s));
            let error = beside.ok_or_else(|| Absent("classic was not run there".into()));
            match error.and_then(|c| value(c, MetricName::ContrastError, None)) {
                Ok(e) if e.interval(0.95)[0] > 0.0 => {
                    kept.scenes.push(name);
                    kept.values.push(own);
                    classic.push(e);
                }
                Ok(_) => {
                    let why = "classic shows no false highlight there".to_owned();
                    kept.left_out.push(LeftOut { scene: name, why });
                }
                Err(Absent(why)) => kept.left_out.push(LeftOut { scene: name, why }),
            }
        }
        kept.classic = classic;
        kept.removed()
    }
}

/// A metric's estimate, or why there is none.
fn value(case: &CaseRecord, name: MetricName, region: Option<Region>) -> Result<Estimate, Absent> {
    if let Some(why) = &case.error {
        return Err(Absent(format!("the case ended with an error: {why}")));
    }
    let metric = case.metric(name, region).ok_or_else(|| Absent(format!("there is no {} there", name.label())))?;
    let why = || metric.note.clone().unwrap_or_else(|| "its standard error is not known".to_owned());
    Metric::estimate(metric).ok_or_else(|| Absent(why()))
}

/// A value with the bound of its standard error: each estimate with the absolute
/// value of its partial derivative.
fn bounded(value: f64, parts: impl Iterator<Item = (f64, Estimate)>) -> Estimate {
    let (mut se, mut df) = (0.0, f64::INFINITY);
    for (partial, part) in parts.filter(|(partial, e)| *partial != 0.0 && e.se != 0.0) {
        se += partial.abs() * part.se;
        df = df.min(part.df);
    }
    Estimate { value, se, df: if df.is_finite() { df } else { 1.0 } }
}

impl Terms {
    fn map(&self, f: impl Fn(Estimate) -> Estimate) -> Terms {
        Terms {
            scenes: self.scenes.clone(),
            left_out: self.left_out.clone(),
            values: self.values.iter().copied().map(f).collect(),
            weights: self.weights.clone(),
            classic: vec![],
        }
    }

    /// Shares of the weights, with their values.
    fn shares(&self) -> impl Iterator<Item = (f64, Estimate)> {
        let all: f64 = self.weights.iter().sum();
        self.weights.iter().map(move |w| w / all).zip(self.values.iter().copied())
    }

    fn finish(self, estimate: Estimate) -> Pool {
        let found = if self.scenes.is_empty() { Err(Absent("no scene has this".into())) } else { Ok(estimate) };
        Pool { pooled: Quantity::new(found), scenes: self.scenes, left_out: self.left_out }
    }

    /// The weighted mean.
    fn mean(self) -> Pool {
        let value = self.shares().map(|(w, e)| w * e.value).sum();
        let estimate = bounded(value, self.shares());
        self.finish(estimate)
    }

    /// The root of the weighted mean of squares: d/dx_i = w_i x_i / root.
    fn root_mean_square(self) -> Pool {
        let root = self.shares().map(|(w, e)| w * e.value * e.value).sum::<f64>().sqrt();
        // Where all are 0 they move it by at most the root of their weight.
        let partial = |w: f64, e: Estimate| if root > 0.0 { w * e.value / root } else { w.sqrt() };
        let estimate = bounded(root, self.shares().map(|(w, e)| (partial(w, e), e)));
        self.finish(estimate)
    }

    /// 1 - sum max(0, x) / sum c. A value that may lie above 0 counts as one that
    /// does in the standard error.
    fn removed(self) -> Pool {
        let left: f64 = self.values.iter().map(|e| e.value.max(0.0)).sum();
        let all: f64 = self.classic.iter().map(|e| e.value).sum();
        let own = self.values.iter().map(|e| (if e.interval(0.95)[1] > 0.0 { 1.0 / all } else { 0.0 }, *e));
        let classic = self.classic.iter().map(|e| (left / (all * all), *e));
        let estimate = bounded(1.0 - left / all, own.chain(classic));
        self.finish(estimate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn terms(values: &[(f64, f64, f64)], weights: &[f64]) -> Terms {
        Terms {
            scenes: values.iter().map(|_| "s".to_owned()).collect(),
            values: values.iter().map(|&(value, se, df)| Estimate { value, se, df }).collect(),
            weights: weights.to_vec(),
            ..Terms::default()
        }
    }

    fn is(pool: &Pool, value: f64, se: f64, df: f64) {
        let e = pool.pooled.estimate().unwrap();
        assert!((e.value - value).abs() < 1e-12 && (e.se - se).abs() < 1e-12 && e.df == df, "{e:?}");
    }

    /// By hand: (1 x 0.1 + 3 x 0.3) / 4 and so on.
    #[test]
    fn means_and_roots_are_weighted_by_pixels() {
        let two = || terms(&[(0.1, 0.01, 15.0), (0.3, 0.02, 7.0)], &[100.0, 300.0]);
        is(&two().mean(), 0.25, 0.25 * 0.01 + 0.75 * 0.02, 7.0);
        let root = (0.25 * 0.01 + 0.75 * 0.09f64).sqrt();
        is(&two().root_mean_square(), root, (0.25 * 0.1 * 0.01 + 0.75 * 0.3 * 0.02) / root, 7.0);
        is(&terms(&[(0.0, 0.0, 3.0)], &[1.0]).root_mean_square(), 0.0, 0.0, 1.0);
        let none = terms(&[], &[]).mean();
        assert_eq!((none.pooled.value, none.pooled.note.as_deref()), (None, Some("no scene has this")));
    }

    /// A ratio of sums, not a mean of ratios; what is clearly below 0 adds nothing.
    #[test]
    fn removed_is_one_less_a_ratio_of_sums() {
        let mut three = terms(&[(0.1, 0.01, 15.0), (-0.2, 0.01, 3.0), (0.0, 0.01, 9.0)], &[1.0; 3]);
        three.classic = [0.2, 0.5, 0.3].map(|value| Estimate { value, se: 0.02, df: 12.0 }).to_vec();
        is(&three.removed(), 0.9, 2.0 * 0.01 + 3.0 * 0.1 * 0.02, 9.0);
    }

    /// Scenes that share their noise move together: the bound is then exact, and an
    /// interval that took them for independent would be too narrow.
    #[test]
    fn the_bound_holds_where_scenes_move_together() {
        let pool = terms(&[(0.1, 0.01, 15.0); 4], &[1.0; 4]).mean();
        is(&pool, 0.1, 0.01, 15.0);
    }
}
