//! The interactive page: cases one by one, each with pairs of images to look at side
//! by side, under a slider, in turns and as maps of their difference. One HTML file
//! with all its data, which asks no network for anything.
//!
//! Who makes a page says what is on it ([`Page`]); nothing here knows of records or
//! goldens. Images are shown from their numbers, so exposure, the value under the
//! cursor and every map are exact. Text from outside reaches the page as JSON and is
//! put there as text, never as markup.

mod html;
mod map;
mod plane;

pub use plane::{Detail, Plane, PlaneId, Planes};

use serde::Serialize;

/// All that a page shows.
#[derive(Debug, Serialize)]
pub struct Page {
    /// The name of it all.
    pub title: String,
    /// What it came to: see [`Item::outcome`].
    pub outcome: &'static str,
    /// What kind of images they are, where they are not our own; beside the outcome.
    pub label: Option<String>,
    /// One sentence under the title.
    pub summary: String,
    /// What must be known before anything is read: an incomplete run, a filter.
    pub notes: Vec<String>,
    /// A row a gate.
    pub gates: Vec<GateRow>,
    /// What is shown one at a time, worst first.
    pub items: Vec<Item>,
    /// What is known of each scene.
    pub scenes: Vec<SceneNote>,
    /// Plots over all cases.
    pub plots: Vec<Plot>,
    /// Words and what they mean.
    pub words: Vec<[String; 2]>,
    /// Where it comes from: name and value.
    pub facts: Vec<[String; 2]>,
    /// Set where goldens are approved and rejected on the page.
    pub review: Option<Review>,
}

/// What is shown one at a time: a case.
#[derive(Debug, Serialize)]
pub struct Item {
    /// Its name, unique on the page.
    pub id: String,
    /// Its scene.
    pub scene: String,
    /// Its estimator.
    pub estimator: String,
    /// Its renderer.
    pub renderer: String,
    /// Where its images come from, where they are not our own.
    pub origin: Option<&'static str>,
    /// Rays a pixel in each replicate.
    pub rays: u32,
    /// `fail`, `error`, `inconclusive`, `warn`, `known`, `pass` or `none`.
    pub outcome: &'static str,
    /// What it came to, in a sentence; empty where the verdicts say it all.
    pub words: String,
    /// Its verdicts, worst first.
    pub verdicts: Vec<VerdictRow>,
    /// Its numbers: name, and value as text.
    pub facts: Vec<[String; 2]>,
    /// What is held against what, the pair shown first being the first.
    pub pairs: Vec<Pair>,
    /// Whether a reviewer decides on it, and what was decided before.
    pub decision: Option<Decision>,
}

/// A verdict as text.
#[derive(Debug, Serialize)]
pub struct VerdictRow {
    /// See [`Item::outcome`].
    pub outcome: &'static str,
    /// The gate.
    pub gate: String,
    /// The metric, with its region.
    pub metric: String,
    /// Value and interval.
    pub value: String,
    /// The limit.
    pub limit: String,
    /// The smallest detectable effect.
    pub detectable: String,
    /// Why it came out so.
    pub reason: String,
}

/// A gate as text.
#[derive(Debug, Serialize)]
pub struct GateRow {
    /// See [`Item::outcome`].
    pub outcome: &'static str,
    /// The gate.
    pub gate: String,
    /// How many verdicts it gave.
    pub cases: usize,
    /// The item nearest to its limit; empty for a judge's.
    pub nearest: String,
    /// Value and interval there.
    pub value: String,
    /// The limit.
    pub limit: String,
    /// Why, for what did not pass.
    pub reason: String,
}

/// A test image and the reference that it is held against, of one size.
#[derive(Clone, Debug, Serialize)]
pub struct Pair {
    /// What is compared, as it stands in a list. Example: `measure view, against Q`.
    pub label: String,
    /// What the test image is.
    pub test: Named,
    /// What the reference is.
    pub reference: Named,
    /// The FLIP error, where it was computed.
    pub flip: Option<PlaneId>,
    /// p-values a pixel, where both images know their noise.
    pub p: Option<PlaneId>,
    /// How far the scale of signed differences reaches to both sides of 0.
    pub limit: f64,
    /// Pixels by region.
    pub regions: Option<PlaneId>,
    /// Place of each column along the transect, in R; empty where there is none.
    pub transect: Vec<f64>,
    /// How to read it, in a sentence.
    pub note: String,
}

/// An image and what it is called.
#[derive(Clone, Debug, Serialize)]
pub struct Named {
    /// What it is.
    pub name: String,
    /// Its numbers.
    pub plane: PlaneId,
}

/// A scene in words, with its plots.
#[derive(Debug, Serialize)]
pub struct SceneNote {
    /// Its name.
    pub name: String,
    /// What it is for, and what its judge says.
    pub lines: Vec<String>,
    /// Plots of the scene.
    pub plots: Vec<Plot>,
}

/// A plot.
#[derive(Debug, Serialize)]
pub struct Plot {
    /// Its heading.
    pub title: String,
    /// What it shows, for who cannot see it.
    pub alt: String,
    /// The picture, as SVG. It is shown as an image, so nothing in it runs.
    pub svg: String,
}

/// How the page reaches who keeps the goldens.
#[derive(Debug, Serialize)]
pub struct Review {
    /// Sent with every decision.
    pub token: String,
    /// The folder of goldens.
    pub store: String,
}

/// What a reviewer can do with an item.
#[derive(Debug, Serialize)]
pub struct Decision {
    /// What approval does, in words. Example: `replaces plane/classic.32.exr`.
    pub approve: String,
    /// An earlier decision on this very image, in words.
    pub before: Option<String>,
    /// Whether there is an image to approve.
    pub possible: bool,
}

impl Page {
    /// The page as one HTML file.
    ///
    /// # Errors
    /// Where the built-in template fails.
    pub fn html(&self, planes: &Planes) -> Result<String, minijinja::Error> {
        html::page(self, planes)
    }
}
