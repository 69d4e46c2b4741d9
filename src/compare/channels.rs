//! The pixel-exact metric of OpenEXR files: every channel of every part, by its name, on
//! the numbers as they are stored.

use super::{
    CompareError, Exact, Rect, Region, check_origins,
    exact::{Count, Sample, and, within},
};
use crate::{
    metrics::image::ImageError,
    picture::{
        channel::{Channel, Numbers},
        read::{Samples, Values},
    },
};
use rayon::prelude::*;

/// Compares the channels of two images by their names. Floats of 16 bits are compared
/// with those of 32, integers with floats by the numbers they stand for; a tolerance is a
/// difference of numbers. Pixels of weight 0 do not count; `weights` are those of the
/// whole image. NaN equals NaN.
///
/// # Errors
/// Where names, sizes or the places of data windows differ, where the region reaches
/// beyond the image, and where no pixel is left.
pub fn exact_channels(
    reference: &[Channel],
    test: &[Channel],
    region: &Region,
    weights: Option<&[f32]>,
    tolerance: f64,
) -> Result<Exact, CompareError> {
    let size = shape(reference, test)?;
    region.check(size)?;
    let part = region.crop.unwrap_or(Rect::whole(size));
    let within = within(tolerance, None);
    let rows: Vec<Count<f64>> = (part.y..part.y + part.height)
        .into_par_iter()
        .map(|y| {
            let at = y * size[0] + part.x;
            let far = row(reference, test, at, part.width);
            let mut count = Count::<f64>::default();
            for (far, i) in far.into_iter().zip(at..) {
                if weights.is_some_and(|w| w[i] <= 0.0) {
                    continue;
                }
                count.add(far, within, i);
            }
            count
        })
        .collect();
    let all = rows.into_iter().fold(Count::default(), and);
    let found = all.found([part.width, part.height], |at| [at % size[0], at / size[0]]);
    found.ok_or_else(|| ImageError::Nothing { masked: size[0] * size[1], non_finite: 0 }.into())
}

/// The size of all channels of both.
pub(super) fn shape(reference: &[Channel], test: &[Channel]) -> Result<[usize; 2], CompareError> {
    let names = |channels: &[Channel]| channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
    if !reference.iter().map(|c| &c.name).eq(test.iter().map(|c| &c.name)) {
        return Err(CompareError::ChannelNames { reference: names(reference), test: names(test) });
    }
    for (r, t) in reference.iter().zip(test) {
        if r.size != t.size {
            return Err(ImageError::Size { reference: r.size, test: t.size }.into());
        }
        check_origins(r.origin, t.origin)?;
    }
    let size = reference.first().map_or([0, 0], |c| c.size);
    if reference.iter().any(|c| c.size != size || c.numbers.count() != size[0] * size[1]) {
        return Err(CompareError::Parts);
    }
    Ok(size)
}

/// How far pixels `at` and following are apart: the most of all channels.
fn row(reference: &[Channel], test: &[Channel], at: usize, width: usize) -> Vec<f64> {
    fn most<T: Copy>(far: &mut [f64], a: &[T], b: &[T], distance: impl Fn(T, T) -> f64) {
        for ((far, &a), &b) in far.iter_mut().zip(a).zip(b) {
            *far = far.max(distance(a, b));
        }
    }
    let mut far = vec![0.0; width];
    let place = at..at + width;
    for (r, t) in reference.iter().zip(test) {
        match (&r.numbers, &t.numbers) {
            (Numbers::Float(a), Numbers::Float(b)) => {
                most(&mut far, &a[place.clone()], &b[place.clone()], f32::distance);
            }
            (Numbers::Unsigned(a), Numbers::Unsigned(b)) => {
                most(&mut far, &a[place.clone()], &b[place.clone()], |a, b| f64::from(a.abs_diff(b)));
            }
            (a, b) => {
                for (far, i) in far.iter_mut().zip(place.clone()) {
                    let distance = (a.at(i) - b.at(i)).abs();
                    *far = far.max(if distance.is_finite() { distance } else { f64::INFINITY });
                }
            }
        }
    }
    far
}

/// The channels of another format as OpenEXR would name them; integers are none.
///
/// # Errors
/// [`CompareError::Kinds`] of integers.
pub(super) fn of_samples(samples: &Samples) -> Result<Vec<Channel>, CompareError> {
    let Values::F32(values) = &samples.values else { return Err(CompareError::Kinds) };
    let names: &[(usize, &str)] = match samples.channels {
        1 => &[(0, "Y")],
        2 => &[(1, "A"), (0, "Y")],
        3 => &[(2, "B"), (1, "G"), (0, "R")],
        _ => &[(3, "A"), (2, "B"), (1, "G"), (0, "R")],
    };
    let channel = |&(c, name): &(usize, &str)| Channel {
        name: name.to_owned(),
        size: samples.size,
        origin: [0, 0],
        numbers: Numbers::Float(values.iter().skip(c).step_by(samples.channels).copied().collect()),
    };
    Ok(names.iter().map(channel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str, numbers: Numbers) -> Channel {
        Channel { name: name.to_owned(), size: [2, 2], origin: [0, 0], numbers }
    }

    #[test]
    fn integers_and_floats_are_compared_by_their_numbers() {
        let most = 1u32 << 24;
        let ids = |last| channel("id", Numbers::Unsigned(vec![0, 7, most, last]));
        let found = |a: &Channel, b: &Channel, tolerance| {
            let [a, b] = [a, b].map(std::slice::from_ref);
            exact_channels(a, b, &Region::default(), None, tolerance).unwrap()
        };
        // As floats of 32 bits both are 2^24.
        let one = found(&ids(most), &ids(most + 1), 0.0);
        assert_eq!((one.differing, one.largest, one.first), (1, Some(1.0), Some([1, 1])));
        assert_eq!(found(&ids(most), &ids(most + 1), 1.0).differing, 0);
        let floats = channel("id", Numbers::Float(vec![0.0, 7.0, most as f32, most as f32]));
        assert_eq!(found(&ids(most), &floats, 0.0).differing, 0);
        assert_eq!(found(&ids(most + 1), &floats, 0.0).differing, 1);
        let nan = channel("id", Numbers::Float(vec![f32::NAN; 4]));
        assert_eq!(found(&ids(1), &nan, 1.0).largest, None);
        assert_eq!(found(&nan, &nan, 0.0).differing, 0);
    }
}
