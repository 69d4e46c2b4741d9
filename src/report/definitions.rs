//! Each word of a report in two sentences.

use crate::record::Record;

/// What the words of a record's report mean: word and meaning.
pub(super) fn of(record: &Record) -> Vec<[String; 2]> {
    let classic = &record.suite.classic;
    let mut words: Vec<[String; 2]> = [
        ("openness, O", "What engines call AO: the cosine-weighted share of the hemisphere that is open, 1 fully open, 0 closed. Images show it as grey without a transfer curve; a checker is a pixel without a value."),
        ("Q, the judge", "Path-traced irradiance with the occluder over that without it: what the occluder really does to the light. It rises above 1 where the occluder reflects light."),
        ("K, contrast", "Mean of the footprint over the brighter flank, less 1. Above 0 there is a highlight under the occluder."),
        ("dK, contrast error", "K less K(Q): 0 is right. A false highlight where the method is brighter and Q has none, a lost highlight where Q has one and the method less, over-correction where both are dark and the method more so."),
        ("bias, MAE, RMSE", "Errors against the converged image of the same estimator: what the implementation and its noise do. Bias is free of noise, the others are those of one replicate."),
        ("errors against Q", "The same against Q, region by region. They are never gated, because they measure the direction of light more than AO."),
        ("footprint, flanks, far", "Where the occluder stands over the receiver, widened by 0.02 R; 0.15 R to 0.45 R beside it; and where nothing is within R."),
        ("difference", "Test less reference. Blue is too dark, red too bright."),
        ("FLIP", "How different two images look when shown in turns (Andersson et al. 2020), 0 to 1, at 67 pixels a degree. Shown for orientation, not gated here."),
        ("p-value", "How likely a difference at least as large is where both pixels have one mean (Welch's test over replicates). Of 100 pixels that are alike, one is below 0.01 by chance."),
        ("detectable", "The smallest detectable effect: how far beyond its limit the truth must lie to be decided with a probability of 0.8. A pass says little where that is larger than what matters."),
        ("interval", "95 %, over replicates with seeds of their own."),
    ]
    .map(|(word, meaning)| [word.to_owned(), meaning.to_owned()])
    .to_vec();
    words.push([
        "removed".to_owned(),
        format!("1 less max(0, dK) over dK of {classic}. 0 leaves the artifact, 1 takes it away."),
    ]);
    words.push([
        "over-darkening".to_owned(),
        format!("{classic} less the estimator, over the whole image. On a control 0 is right."),
    ]);
    words
}
