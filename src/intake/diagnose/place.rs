//! How an image lies: mirrored, turned, or upside down in its values.

use super::{
    Reference,
    samples::{Samples, VARIED, square},
};

/// How an image lies beside the view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// As it should.
    None,
    /// Its first row is the bottom of the view.
    FlippedY,
    /// Left and right are exchanged.
    FlippedX,
    /// Turned by 180 degrees.
    Half,
    /// Turned by 90 degrees clockwise; of square views only.
    Quarter,
    /// Turned by 270 degrees clockwise; of square views only.
    ThreeQuarters,
    /// Mirrored at the diagonal from the top left: rows are columns; of square views only.
    Transposed,
    /// Mirrored at the diagonal from the bottom left; of square views only.
    Antitransposed,
}

/// A turn must explain this much more of the image's variance than none, as a share of all of it...
const GAIN: f64 = 0.02;
/// ... and this many times as much, so that other estimators of a scene that is nearly the
/// same the other way round are not taken for turned.
const TIMES: f64 = 1.15;
/// An image whose correlation with the reference is below this, its noise taken away, is no
/// picture of the scene.
pub(super) const LEAST: f64 = 0.5;
/// Two turns of a scene are the same that share so much of the variance: noise of the reference leaves less.
const SAME: f64 = 0.97;
/// A reference must vary so much before likeness is asked for.
const CONTRAST: f64 = 0.03;
/// Standard errors of a correlation that tell its sign.
const SURE: f64 = 5.0;

/// How an image lies, by its best hypothesis.
pub(super) struct Placed {
    pub turn: Turn,
    /// Other turns that the scene cannot tell from it.
    pub or: Vec<Turn>,
    pub inverted: bool,
    /// With the best of all references, without the image's noise; 1 where it cannot be told.
    pub correlation: f64,
}

impl Turn {
    /// All of them; the last four are of square views.
    const ALL: &'static [Turn] = &[
        Turn::None,
        Turn::FlippedY,
        Turn::FlippedX,
        Turn::Half,
        Turn::Quarter,
        Turn::ThreeQuarters,
        Turn::Transposed,
        Turn::Antitransposed,
    ];

    fn possible(size: [usize; 2]) -> &'static [Turn] {
        if size[0] == size[1] { Turn::ALL } else { &Turn::ALL[..4] }
    }

    /// The pixel of the view that an image which lies so shows at one of its own.
    fn source(self, [x, y]: [usize; 2], [width, height]: [usize; 2]) -> usize {
        let (right, below) = (width - 1 - x, height - 1 - y);
        let [x, y] = match self {
            Turn::None => [x, y],
            Turn::FlippedY => [x, below],
            Turn::FlippedX => [right, y],
            Turn::Half => [right, below],
            Turn::Quarter => [y, right],
            Turn::ThreeQuarters => [below, x],
            Turn::Transposed => [y, x],
            Turn::Antitransposed => [below, right],
        };
        y * width + x
    }

    /// A picture as it would be handed in, lying so. Quarters are of square pictures.
    pub fn of(self, picture: &[f32], size: [usize; 2]) -> Vec<f32> {
        let at = |i: usize| picture[self.source([i % size[0], i / size[0]], size)];
        (0..picture.len()).map(at).collect()
    }

    /// The inverse of [`Turn::of`].
    pub fn undone(self, image: &[f32], size: [usize; 2]) -> Vec<f32> {
        let mut picture = image.to_vec();
        for (i, v) in image.iter().enumerate() {
            picture[self.source([i % size[0], i / size[0]], size)] = *v;
        }
        picture
    }

    /// In a few words.
    pub fn title(self) -> &'static str {
        match self {
            Turn::None => "lies as it should",
            Turn::FlippedY => "flipped in y: the first row is the bottom of the view",
            Turn::FlippedX => "flipped in x: left and right are exchanged",
            Turn::Half => "turned by 180 degrees",
            Turn::Quarter => "turned by 90 degrees clockwise",
            Turn::ThreeQuarters => "turned by 270 degrees clockwise",
            Turn::Transposed => "transposed: rows are columns",
            Turn::Antitransposed => "transposed and turned by 180 degrees",
        }
    }

    /// What to do about it.
    pub fn remedy(self) -> &'static str {
        match self {
            Turn::None => "nothing",
            Turn::FlippedY => "declare `rows = \"bottom\"`, or save the rows from the top",
            Turn::FlippedX => {
                "mirror the image; the camera's x axis is the transect, as views.json says: look for a left-handed \
                 coordinate system"
            }
            Turn::Half => "turn the camera about its axis: its up vector points down; or turn the image",
            Turn::Quarter | Turn::ThreeQuarters => {
                "turn the camera about its axis until x is the transect of views.json"
            }
            Turn::Transposed | Turn::Antitransposed => "save row by row: rows and columns are exchanged",
        }
    }
}

/// Turns that the scene itself cannot tell from none, since it looks nearly the same: those
/// that explain 80 % or more of the reference's variance, and all of a reference that hardly
/// varies.
pub fn alike(reference: &Reference, size: [usize; 2]) -> Vec<Turn> {
    let openness = &reference.openness;
    if size[0].checked_mul(size[1]) != Some(openness.len()) {
        return Vec::new();
    }
    let is_alike = |turn: &Turn| {
        let both = Samples::new(&turn.of(openness, size), openness);
        both.deviation() < VARIED || both.correlation().max(0.0).powi(2) >= 0.8
    };
    Turn::possible(size)[1..].iter().copied().filter(is_alike).collect()
}

pub(super) fn find(image: &[f32], reference: &Reference, size: [usize; 2]) -> Placed {
    let references = || std::iter::once(&reference.openness).chain(reference.scaled.iter().map(|s| &s.openness));
    let own = Samples::new(image, &reference.openness);
    if own.deviation() < VARIED {
        let inverted = is_inverted_level(image, reference);
        return Placed { turn: Turn::None, or: Vec::new(), inverted, correlation: 1.0 };
    }
    // Explained share of variance, the sign of the correlation, and which reference it was.
    let best = |turn: Turn| {
        let upright = turn.undone(image, size);
        let samples = references().filter(|r| r.len() == image.len()).map(|r| Samples::new(&upright, r));
        samples.max_by(|a, b| a.correlation().abs().total_cmp(&b.correlation().abs())).map(|s| (turn, s))
    };
    let share = |s: &Samples| s.correlation().powi(2);
    let turns = Turn::possible(size).iter().filter_map(|&turn| best(turn));
    let Some((turn, samples)) = turns.reduce(|a, b| {
        // The first is none; of the others the best, but of two alike the simpler, which comes first.
        let (least, times) = if a.0 == Turn::None { (GAIN, TIMES) } else { (GAIN / 4.0, 1.02) };
        let better = share(&b.1) > share(&a.1) + least && share(&b.1) > share(&a.1) * times;
        if better { b } else { a }
    }) else {
        return Placed { turn: Turn::None, or: Vec::new(), inverted: false, correlation: 1.0 };
    };
    let sure = samples.correlation().abs() * (samples.pairs() as f64).sqrt() > SURE;
    let inverted = sure && samples.correlation() < 0.0;
    let or = same_as(turn, &reference.openness, size);
    Placed { turn, or, inverted, correlation: likeness(image, &samples, own.mean(), size[0]) }
}

/// Turns after which the scene looks as it does after another one, which is no lying as it should.
fn same_as(turn: Turn, openness: &[f32], size: [usize; 2]) -> Vec<Turn> {
    if turn == Turn::None {
        return Vec::new();
    }
    let turned = turn.of(openness, size);
    let is_same =
        |other: &Turn| Samples::new(&other.of(openness, size), &turned).correlation().max(0.0).powi(2) >= SAME;
    Turn::possible(size)[1..].iter().copied().filter(|t| *t != turn && is_same(t)).collect()
}

/// The share of its variance that a frame which lies otherwise must have explained by a picture of
/// the scene, and how many times the share without.
const FRAME: f64 = 0.6;
const FRAME_TIMES: f64 = 2.0;

/// How a frame lies beside the best of several pictures, where that is plain.
pub(super) fn turn_of_frame(light: &[f32], like: &[&[f32]], size: [usize; 2]) -> Option<Turn> {
    let share = |turn: Turn| {
        let upright = turn.undone(light, size);
        let shares = like.iter().filter(|r| r.len() == light.len()).map(|r| Samples::new(&upright, r));
        let shares = shares.filter(|s| s.deviation() >= VARIED * s.reference_mean().abs());
        shares.map(|s| s.correlation().max(0.0).powi(2)).fold(0.0, f64::max)
    };
    let best = Turn::possible(size).iter().map(|&t| (t, share(t))).reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    (best.0 != Turn::None && best.1 > FRAME && best.1 > FRAME_TIMES * share(Turn::None)).then_some(best.0)
}

/// The correlation that an image would have without its noise, where that can be told.
fn likeness(image: &[f32], samples: &Samples, mean: f64, width: usize) -> f64 {
    if samples.deviation() < CONTRAST {
        return 1.0;
    }
    let difference: Vec<f32> = image.iter().map(|v| v - mean as f32).collect();
    let [signal, error] = square(&difference, width);
    let deviation = (signal + 2.0 * error).max(0.25 * VARIED * VARIED).sqrt();
    (samples.covariance().abs() / (deviation * samples.deviation())).min(1.0)
}

/// Where a scene is the same everywhere, only the level tells: nearer to the other end of the
/// range, and within 0.1 of what it would be there.
fn is_inverted_level(image: &[f32], reference: &Reference) -> bool {
    let own = Samples::new(image, &reference.openness).mean();
    let wanted = Samples::new(&reference.openness, &reference.openness).mean();
    (own - (1.0 - wanted)).abs() < 0.1 && (own - wanted).abs() > 0.4
}

impl Placed {
    /// The image as it should have been handed in.
    pub fn undone(&self, image: &[f32], size: [usize; 2]) -> Vec<f32> {
        let upright = self.turn.undone(image, size);
        if self.inverted { upright.iter().map(|v| 1.0 - v).collect() } else { upright }
    }
}
