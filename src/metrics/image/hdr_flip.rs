//! HDR-FLIP: the largest FLIP error over the exposures in which an HDR image may
//! be shown.

use super::{
    ImageError, Pair,
    flip::{Filters, Light, flip_of},
};
use pulp::Arch;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// ACES as fitted by Narkowicz, with its pre-exposure of 0.6 cancelled:
/// (k0 x^2 + k1 x + k2) / (k3 x^2 + k4 x + k5).
const ACES: [f64; 6] = [0.36 * 2.51, 0.6 * 0.03, 0.0, 0.36 * 2.43, 0.6 * 0.59, 0.14];

/// Tone-mapped value at which the darkest and brightest exposure put the brightest
/// and the median pixel.
const SHOWN_AT: f64 = 0.85;

/// What a median below is taken for, as in FLIP 1.7: half of a reference may be
/// black.
const LEAST_MEDIAN: f32 = f32::EPSILON;

/// More exposures than this would show nothing new: 2^32 is beyond any renderer.
const MAX_EXPOSURES: u32 = 64;

/// The exposures of an HDR-FLIP, in stops.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Exposures {
    /// The first, at which the reference's brightest pixel is shown at 0.85.
    pub start: f64,
    /// The last, at which its median pixel is; of an even number of pixels, the
    /// brighter one in the middle.
    pub stop: f64,
    /// How many, evenly apart, 2 to 64.
    pub count: u32,
}

/// What HDR-FLIP found.
#[derive(Clone, Debug, PartialEq)]
pub struct HdrFlip {
    /// The largest error of each pixel, 0 to 1.
    pub map: Vec<f32>,
    /// Over which exposures.
    pub exposures: Exposures,
}

impl Exposures {
    /// The exposures that the paper derives from a linear reference, of the pixels
    /// that have weight; None where it
    /// is black (a maximum of zero). A median below 2^-23 counts as 2^-23.
    pub fn of(pair: &Pair<'_>) -> Option<Exposures> {
        let image = pair.reference();
        let planes = image.planes();
        let mut luminances: Vec<f32> = (0..image.pixels())
            .filter(|&i| pair.weight(i) > 0.0)
            .map(|i| match planes {
                [red, green, blue] => 0.2126 * red[i] + 0.7152 * green[i] + 0.0722 * blue[i],
                _ => planes[0][i],
            })
            .collect();
        let brightest = luminances.iter().copied().fold(f32::MIN, f32::max);
        let middle = luminances.len() / 2;
        let median = *luminances.select_nth_unstable_by(middle, f32::total_cmp).1;
        // The x that the curve maps to 0.85.
        let [a, b, c] = [0, 1, 2].map(|i| ACES[i] - SHOWN_AT * ACES[i + 3]);
        let half = -0.5 * b / a;
        let shown = half + (half * half - c / a).sqrt();
        let [start, stop] = [brightest, median.max(LEAST_MEDIAN)].map(|v| (shown / f64::from(v)).log2());
        let count = (stop - start).ceil().clamp(2.0, f64::from(MAX_EXPOSURES)) as u32;
        (start.is_finite() && stop.is_finite()).then_some(Exposures { start, stop, count })
    }

    fn stops(self) -> impl Iterator<Item = f64> {
        let step = (self.stop - self.start) / f64::from(self.count.max(2) - 1);
        (0..self.count).map(move |i| self.start + f64::from(i) * step)
    }
}

/// ACES of one value of an exposed plane, before the clamp to [0, 1].
#[inline(always)]
pub(super) fn tone_mapped(x: f32) -> f32 {
    const K: [f32; 6] =
        [ACES[0] as f32, ACES[1] as f32, ACES[2] as f32, ACES[3] as f32, ACES[4] as f32, ACES[5] as f32];
    let x = if x < 0.0 { 0.0 } else { x };
    // Beyond it the square overflows, and the curve is flat.
    let x = if x > 1e9 { 1e9 } else { x };
    (x * (K[0] * x + K[1]) + K[2]) / (x * (K[3] * x + K[4]) + K[5])
}

/// HDR-FLIP of two linear images: for each pixel the largest [FLIP](super::flip())
/// error over exposures.
///
/// Andersson, Nilsson, Shirley, Akenine-Möller: Visualizing Errors in Rendered
/// High Dynamic Range Images, Eurographics 2021. Exposures go from where the
/// reference's brightest pixel is just not white to where its median is; each is
/// tone-mapped by ACES. Range 0 to 1, lower is better. It costs as many FLIPs as
/// there are exposures.
///
/// # Errors
/// [`ImageError::Range`] for a `ppd` outside 1 to 1000, and for `exposures` that
/// are not finite, not in order, or not 2 to 64.
pub fn hdr_flip(pair: &Pair<'_>, ppd: f64, exposures: Exposures) -> Result<HdrFlip, ImageError> {
    let Exposures { start, stop, count } = exposures;
    if !(start.is_finite() && stop.is_finite() && start <= stop) {
        return Err(ImageError::Range {
            what: "the first exposure",
            value: start,
            range: "finite, and not above the last",
        });
    }
    if !(2..=MAX_EXPOSURES).contains(&count) {
        return Err(ImageError::Range { what: "the number of exposures", value: f64::from(count), range: "2 to 64" });
    }
    let filters = Filters::new(ppd)?;
    let mut map = vec![0.0f32; pair.reference().pixels()];
    for stop in exposures.stops() {
        let errors = flip_of(pair, &filters, Light::ToneMapped(stop.exp2() as f32), Arch::new())?;
        map.iter_mut().zip(errors).for_each(|(most, e)| *most = most.max(e));
    }
    Ok(HdrFlip { map, exposures })
}
