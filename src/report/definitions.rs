//! Each word of a report in two sentences.

use crate::{counted::counted, record::Record};
use serde::Serialize;

/// A word and what it means.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Definition {
    /// The word.
    pub word: &'static str,
    /// Two sentences that go on from it.
    pub meaning: String,
    /// The page of the documentation that says more, and the place on it; empty where
    /// none does.
    pub page: &'static str,
    /// The place.
    pub at: &'static str,
}

fn define(word: &'static str, page: &'static str, at: &'static str, meaning: impl Into<String>) -> Definition {
    Definition { word, meaning: meaning.into(), page, at }
}

/// What the words of a record's report mean.
pub(super) fn of(record: &Record) -> Vec<Definition> {
    let (classic, rays) = (&record.suite.classic, record.suite.converged_rays);
    let smoothed = record.suite.methods.values().any(|m| m.temporal.is_some() || m.denoise.is_some());
    let unsmoothed = if smoothed { ", without its smoothing" } else { "" };
    vec![
        define(
            "Openness",
            "",
            "",
            "is what engines call AO: 1 is open, 0 is closed. Pictures show it as grey without a transfer curve.",
        ),
        define(
            "Q",
            "estimators.md",
            "the-judge",
            "is path-traced light with the occluder over light without it, at the same points: what the occluder really \
             does. It rises above 1 where the occluder reflects light.",
        ),
        define(
            "Footprint",
            "metrics.md",
            "the-artifact",
            "is what the occluder stands over, widened by 0.02 R. The left and right flanks lie 0.15 R to 0.45 R beside it, \
             far is where nothing is within R.",
        ),
        define(
            "K",
            "metrics.md",
            "highlight-contrast-k",
            "is the brightness under the occluder over that of its brighter flank, less 1. Above 0 there is a highlight.",
        ),
        define(
            "dK",
            "metrics.md",
            "contrast-error-dk",
            "= K - K(Q) is the error of that: 0 is right. Above 0 where Q has no highlight it is a false highlight, below 0 a \
             lost highlight where Q has one, and over-correction where it has none.",
        ),
        define(
            "Removed",
            "metrics.md",
            "removed",
            format!(
                "is the share of {classic}'s false highlight that a method takes away. 0 leaves it, 1 takes it all."
            ),
        ),
        define(
            "Bias",
            "metrics.md",
            "error-under-occluders",
            format!(
                "is the mean difference from the same estimator with {}{unsmoothed}, its converged image: 0 is \
                 right. It is free of noise, so it shows mistakes and not too few rays.",
                counted(rays, "ray", "rays")
            ),
        ),
        define(
            "MAE and RMSE",
            "metrics.md",
            "error-under-occluders",
            "are the size of one replicate's difference from the converged image, pixel by pixel. They fall as rays rise.",
        ),
        define(
            "Bias, MAE and RMSE against Q",
            "metrics.md",
            "error-under-occluders",
            "compare openness with what the light does. They hold the direction of light as well as AO, so they are \
             reported by region and never gated.",
        ),
        define(
            "Over-darkening",
            "metrics.md",
            "over-darkening",
            format!("is {classic} less the method, over the whole image. On a control scene 0 is right."),
        ),
        define(
            "FLIP",
            "metrics.md",
            "flip",
            "says how different two images look when they are shown in turns, from 0 to 1 (Andersson et al. 2020). It is \
             shown for orientation: what looks different may be right.",
        ),
        define(
            "Detectable",
            "gates.md",
            "what-a-verdict-tells",
            "is how far from its limit the truth must lie to be decided with a probability of 0.8. A pass says little where \
             that is more than what matters; – stands where no replicate differs from another.",
        ),
        define(
            "Margin",
            "",
            "",
            "is how far within its limit the value lies, in its own unit. Below 0 it lies outside.",
        ),
        define(
            "All scenes together",
            "metrics.md",
            "pooled",
            "holds means over the scenes that are no controls; over-darkening is over the controls. Intervals hold whatever \
             the scenes have in common, so they are too wide rather than too narrow.",
        ),
        define(
            "Convergence",
            "metrics.md",
            "convergence",
            "splits one replicate's square error into bias b² and variance. The slope of ln RMSE over ln rays is -1/2 for \
             independent rays and lower, which is faster, for Sobol samples.",
        ),
        define(
            "p-values",
            "gates.md",
            "verdicts",
            "of the verdicts gather at 0 and at 1 where the suite decides what it asks; in between lies what it cannot tell. \
             Verdicts are corrected over the whole run, which the plot of p-values is not.",
        ),
    ]
}
