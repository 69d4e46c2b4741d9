//! Verdicts in words.

use super::{Gate, Limit, Other, Outcome, POWER, PValue, Verdict, floor::Source};
use crate::{counted::counted, metrics::MetricName};

/// Why a verdict with p-values came out as it did, in a sentence.
pub(super) fn reason(gate: &Gate, verdict: &Verdict, family: usize) -> String {
    let numbers = |p: Option<PValue>| p.map_or_else(String::new, |p| format!(" ({})", p_words(p, family)));
    let (holds, broken) = (numbers(verdict.p_holds), numbers(verdict.p_broken));
    match (verdict.outcome, &gate.known_failure) {
        (Outcome::KnownFailure, Some(why)) => why.clone(),
        (Outcome::Fail, Some(_)) => {
            format!("marked as a known failure, but it passes: remove the mark{holds}")
        }
        (Outcome::Fail | Outcome::KnownFailure, _) => format!("the limit is broken{broken}"),
        (Outcome::Pass, _) => format!("the limit holds{holds}"),
        (Outcome::Warn, _) => {
            let warn = verdict.warn.map_or_else(String::new, |w| w.text());
            format!("the limit holds, but the one that warns, {warn}, is broken{}", numbers(verdict.p_warn_broken))
        }
        (Outcome::Inconclusive, _) => undecided(verdict, family),
    }
}

/// The p-value that is nearer to deciding, and what it is evidence of.
fn nearer(verdict: &Verdict) -> Option<(PValue, &'static str)> {
    let (holds, broken) = (verdict.p_holds?, verdict.p_broken?);
    Some(if broken.raw < holds.raw { (broken, "is broken") } else { (holds, "holds") })
}

fn undecided(verdict: &Verdict, family: usize) -> String {
    let Some((p, what)) = nearer(verdict) else {
        return "the metric has no interval".to_owned();
    };
    let alpha = 1.0 - verdict.confidence;
    let numbers = p_words(p, family);
    if p.raw >= alpha {
        format!("the interval holds the limit{} ({numbers})", prospect(verdict, family))
    } else if p.raw / verdict.spent >= alpha {
        format!(
            "the interval clears the limit alone, but not with the share of the error rate that this look at the case may \
             spend: that it {what} is not sure ({numbers})"
        )
    } else {
        format!(
            "the interval clears the limit alone, but not over {}: that it {what} is not sure ({numbers})",
            counted(family, "verdict", "verdicts")
        )
    }
}

/// Whether more replicates would decide.
fn prospect(verdict: &Verdict, family: usize) -> String {
    if verdict.replicates_needed(family).is_some() {
        ": more replicates would decide".to_owned()
    } else if verdict.is_kept_by_floor(family) {
        format!(", and more replicates of the case would not decide: the noise of {} is too large", listed(verdict))
    } else {
        ", on which the value lies as near as it can be told".to_owned()
    }
}

/// What a part of the standard error comes from besides the case's replicates.
fn listed(verdict: &Verdict) -> String {
    verdict.sources().iter().map(|s| s.name).collect::<Vec<_>>().join(" and of ")
}

fn p_words(p: PValue, family: usize) -> String {
    if p.raw == p.adjusted {
        return format!("p = {}", p_text(p.raw));
    }
    format!("p = {}, {} over {}", p_text(p.raw), p_text(p.adjusted), counted(family, "verdict", "verdicts"))
}

/// A p-value with two digits that count.
pub fn p_text(p: f64) -> String {
    if p == 0.0 || p == 1.0 {
        format!("{p}")
    } else if p < 1e-3 {
        format!("{p:.1e}")
    } else {
        number(p)
    }
}

/// Two digits that count, or three where the first is a 1.
fn number(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    let leading = v.abs().log10().floor();
    let more = if v.abs() / 10f64.powf(leading) < 2.0 { 2.0 } else { 1.0 };
    format!("{v:.0$}", (more - leading).clamp(0.0, 12.0) as usize)
}

/// The digits that stand out over an error.
fn value(v: f64, se: Option<f64>) -> String {
    let digits = se.filter(|se| *se > 0.0).map_or(4.0, |se| (1.0 - se.log10().floor()).clamp(2.0, 9.0));
    format!("{v:.0$}", digits as usize)
}

/// What a metric is.
fn meaning(name: MetricName) -> &'static str {
    match name {
        MetricName::Openness => "mean openness, 0 closed to 1 open",
        MetricName::Contrast => "K, the mean under the occluder over that of the brighter flank, less 1",
        MetricName::Michelson => "the difference of the means under the occluder and beside it over their sum",
        MetricName::JudgeContrast => "K(Q), the highlight that the path-traced judge sees: what K should be",
        MetricName::ContrastError => {
            "dK = K - K(Q): 0 is right, above it the highlight is too strong, below it too weak"
        }
        MetricName::Removed => "the share of classic AO's false highlight that is gone: 0 none, 1 all",
        MetricName::Bias => "the mean of openness less the converged image of the same estimator",
        MetricName::Mae => "the mean absolute difference from the converged image of the same estimator",
        MetricName::Rmse => "the root mean square difference from the converged image of the same estimator",
        MetricName::JudgeBias | MetricName::JudgeMae | MetricName::JudgeRmse => "the difference of openness from Q",
        MetricName::OverDarkening => "the mean of classic AO's openness less this one's",
        MetricName::RendererDifference => "the mean of openness less that on the CPU with the same seeds",
        MetricName::DistinctReplicates => "the share of replicates that are unlike all earlier ones",
    }
}

/// How a verdict came about: what was measured and where, against what, how sure it is,
/// what could have been seen, why this came of it, and what to do. One paragraph an entry.
///
/// `family` is how many verdicts of the record have p-values.
pub fn explain(verdict: &Verdict, family: usize) -> Vec<String> {
    let mut text = vec![measured(verdict)];
    text.extend(verdict.against.as_ref().map(|other| held_against(verdict, other)));
    text.extend(fixed(verdict));
    text.extend(distance(verdict));
    text.extend(evidence(verdict, family));
    text.extend(detectable(verdict));
    text.push(format!("{}: {}.", outcome(verdict.outcome), verdict.reason.trim_end_matches('.')));
    text.push(next(verdict, family));
    text.extend(verdict.picture.as_ref().map(|p| format!("See {p}.")));
    text
}

fn outcome(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Fail => "So it fails",
        Outcome::Inconclusive => "So it is inconclusive",
        Outcome::Warn => "So it warns",
        Outcome::KnownFailure => "So it fails as it is known to",
        Outcome::Pass => "So it passes",
    }
}

fn measured(verdict: &Verdict) -> String {
    let Verdict { metric, .. } = verdict;
    let of = match (&verdict.case, &verdict.lacking) {
        (Some(c), _) => format!(
            "of {} on the {} with {} a pixel in {}",
            c.estimator,
            c.renderer,
            counted(c.rays, "ray", "rays"),
            c.scene
        ),
        (None, Some(estimator)) => format!("of {estimator}"),
        (None, None) if verdict.is_on_judge() => format!("of the judge of {}", verdict.scene),
        (None, None) => format!("in {}", verdict.scene),
    };
    let place = verdict.place.as_ref().map_or_else(String::new, |p| format!(", over {p}"));
    let mut text = format!("Measured is {} {of}: {}{place}.", metric.name.label(), meaning(metric.name));
    text += &match (metric.value, metric.se) {
        (Some(v), Some(0.0)) => format!(" It is {}, the same in every replicate.", value(v, None)),
        (Some(v), Some(se)) => {
            let df = metric.df.map_or_else(String::new, |df| format!(", {df:.0} degrees of freedom"));
            let note = metric.note.as_ref().map_or_else(String::new, |n| format!(" ({n})"));
            format!(" It is {}{note}, with a standard error of {}{df}.", value(v, Some(se)), number(se))
        }
        (Some(v), None) => format!(" It is {}, of unknown error.", value(v, None)),
        (None, _) => " There is no value.".to_owned(),
    };
    text
}

fn held_against(verdict: &Verdict, other: &Other) -> String {
    let whose = match &other.case {
        Some(case) if other.name != super::BASE => case.id(),
        _ => format!("the {} record", other.name),
    };
    let theirs = other.metric.as_ref().and_then(|m| Some(value(m.value?, m.se)));
    match (theirs, verdict.value()) {
        (Some(theirs), Some(v)) => format!(
            "That of {whose} is {theirs}. The difference, {}, is held against the limit; its standard error, {}, takes \
             the two for independent, which is too large rather than too small where they share random numbers.",
            value(v, verdict.se()),
            verdict.se().map_or_else(|| "unknown".to_owned(), number),
        ),
        (Some(theirs), None) => format!("That of {whose} is {theirs}, but there is no difference to be had."),
        _ => format!("It cannot be held against {whose}."),
    }
}

/// What of the standard error more replicates leave as it is.
fn fixed(verdict: &Verdict) -> Option<String> {
    let (floor, se) = (verdict.floor?, verdict.se()?);
    let share = match floor.se {
        part if part < se => format!("Of the standard error {} is that", number(part)),
        _ => "The standard error is that".to_owned(),
    };
    let most = verdict.case.as_ref().map_or("", |_| ": more replicates of the case leave it as it is");
    Some(format!("{share} of {}{most}.", listed(verdict)))
}

fn distance(verdict: &Verdict) -> Option<String> {
    let (v, limit) = (verdict.value()?, verdict.limit);
    let margin = verdict.margin.unwrap_or_else(|| limit.margin(v));
    let side = if margin < 0.0 { "wrong" } else { "right" };
    let errors = match verdict.se() {
        Some(se) if se > 0.0 => format!(", {} standard errors", number(margin.abs() / se)),
        _ => String::new(),
    };
    let what = match limit {
        Limit::Equals { target, within } => format!("The limit is {target}, give or take {within}"),
        _ => format!("The limit is {}", limit.text()),
    };
    let warn = verdict.warn.map_or_else(String::new, |w| format!(" (it warns unless {})", w.text()));
    let interval = verdict.interval.map_or_else(String::new, |[lo, hi]| {
        let show = |v| value(v, verdict.se());
        format!(" Its {} % interval alone is {} to {}.", number_of_percent(verdict.confidence), show(lo), show(hi))
    });
    Some(format!("{what}{warn}. The value lies {} on the {side} side of it{errors}.{interval}", number(margin.abs())))
}

fn number_of_percent(confidence: f64) -> String {
    // 0.95 x 100 is not 95 in binary.
    format!("{}", (confidence * 1e8).round() / 1e6)
}

fn evidence(verdict: &Verdict, family: usize) -> Option<String> {
    let (holds, broken) = (verdict.p_holds?, verdict.p_broken?);
    let test = match verdict.limit {
        Limit::Equals { .. } => "two one-sided t tests",
        _ => "Student's t",
    };
    let alone = format!(
        "The evidence, by {test}, small is sure: p = {} that the limit holds, p = {} that it is broken.",
        p_text(holds.raw),
        p_text(broken.raw)
    );
    let looks = if verdict.spent < 1.0 {
        let share = number(verdict.spent);
        format!(" Looks at the case share the error rate: this one may spend {share} of it, and p counts so much more.")
    } else {
        String::new()
    };
    let corrected = match (family, verdict.spent < 1.0) {
        (..=1, false) => " The run has no other verdict.".to_owned(),
        _ => format!(
            " Over the {} of the run, Holm's correction makes that {} and {}.",
            counted(family, "verdict", "verdicts"),
            p_text(holds.adjusted),
            p_text(broken.adjusted)
        ),
    };
    let alpha = 1.0 - verdict.confidence;
    Some(format!(
        "{alone}{looks}{corrected} What is below {} decides: at most {} of runs show any false red, and as many any false \
         green.",
        (alpha * 1e9).round() / 1e9,
        percent(alpha),
    ))
}

fn percent(share: f64) -> String {
    format!("{} %", number_of_percent(share))
}

fn detectable(verdict: &Verdict) -> Option<String> {
    verdict.value()?;
    Some(match verdict.detectable {
        Some(d) => format!(
            "With this noise a truth {} from the limit is decided in {} of runs, whatever the other verdicts come to.",
            number(d),
            percent(POWER)
        ),
        None => "No replicate differs from another, or their scatter is not known: what could have been seen is not \
                 known either."
            .to_owned(),
    })
}

/// What would make smaller what the case's replicates do not.
fn remedy(verdict: &Verdict) -> String {
    let largest = verdict.sources().into_iter().next();
    largest.map_or_else(String::new, |Source { help, .. }| format!("{help}, or move the limit to what matters."))
}

fn next(verdict: &Verdict, family: usize) -> String {
    let at_limit = || {
        "The value lies on the limit as near as it can be told: replicates will not decide. Ask whether the limit is \
         where it should be."
            .to_owned()
    };
    match verdict.outcome {
        Outcome::Pass => "Nothing is to be done.".to_owned(),
        Outcome::KnownFailure => "Nothing is to be done. When it passes, the mark must go.".to_owned(),
        Outcome::Warn => "Nothing stops the merge. See whether it gets worse.".to_owned(),
        Outcome::Fail if verdict.p_holds.is_some_and(|p| p.raw < 0.5) => {
            "What was broken is mended: take known_failure out of the gate.".to_owned()
        }
        Outcome::Fail => {
            "If the change is not meant, undo it. If it is, move the limit in the suite file and say why, or \
                          mark the gate with known_failure and a reason."
                .to_owned()
        }
        Outcome::Inconclusive => match (verdict.margin, verdict.replicates_needed(family)) {
            (Some(_), Some(times)) => format!(
                "If the value stays where it is, about {} times the replicates decide; raise replicates in the suite \
                 file, or move the limit to what matters.",
                number(times)
            ),
            (Some(_), None) if verdict.is_kept_by_floor(family) => {
                format!("No number of replicates of the case decides where the value lies: {}", remedy(verdict))
            }
            (Some(_), None) => at_limit(),
            (None, _) => "Mend what the reason names: without a value nothing can be decided.".to_owned(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        gate::tests::{case, gate, judged, measured},
        record::CaseRecord,
    };

    #[test]
    fn numbers_have_two_digits_that_count() {
        for (v, text) in
            [(0.0123, "0.0123"), (0.0456, "0.046"), (12.3, "12.3"), (456.0, "456"), (0.0, "0"), (-0.25, "-0.25")]
        {
            assert_eq!(number(v), text);
        }
        for (p, text) in [(0.0, "0"), (1.0, "1"), (1e-7, "1.0e-7"), (0.04, "0.040"), (0.0031, "0.0031")] {
            assert_eq!(p_text(p), text);
        }
        assert_eq!((percent(0.05000000000000004), number_of_percent(0.999_999)), ("5 %".into(), "99.9999".into()));
    }
    /// The first look has a share, too, and may come to nothing by it.
    #[test]
    fn a_look_is_told_by_its_share_alone() {
        let at = |value, look| {
            let it = measured(case("s", "e", "cpu", 4), value, 0.01);
            judged(vec![gate(Limit::AtLeast(0.5))], &[CaseRecord { looks: Some(look), ..it }], None).0.remove(0)
        };
        let (sure, near, third) = (at(0.53, 1), at(0.523, 1), at(0.53, 3));
        assert!(sure.outcome == Outcome::Pass && near.p_holds.is_some_and(|p| p.raw < 0.05 && p.adjusted > 0.05));
        for (v, share) in [(&sure, "0.61"), (&near, "0.61"), (&third, "0.068")] {
            let text = explain(v, 1).join(" ");
            let says =
                format!("Looks at the case share the error rate: this one may spend {share} of it, and p counts");
            assert!(text.contains(&says), "{text}");
            assert!(!text.contains("not the first look") && !text.contains("so many looks"), "{text}");
            let open =
                "but not with the share of the error rate that this look at the case may spend: that it holds is";
            assert_eq!(v.reason.contains(open), v.outcome == Outcome::Inconclusive, "{}", v.reason);
        }
        assert!(third.outcome == Outcome::Inconclusive && near.outcome == Outcome::Inconclusive);
    }
}
