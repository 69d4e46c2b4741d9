//! Goldens: accepted images, and what may differ from them.
//!
//! There is one golden a scene, estimator and ray count, for every renderer. It
//! is an OpenEXR file with mean, variance over replicates and region masks; its
//! attributes say where it comes from and why it was accepted. Reading a record
//! is all that approving and verifying do: nothing here renders.

mod compare;

pub use compare::{Comparison, Finding, Seen, compare};

use crate::{
    disk::DiskError,
    layers::{Layers, pixel_hash},
    metrics::regions::Region,
    record::{CaseRecord, Record, SceneRecord},
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Family error of a verification: the chance that any golden of an unchanged
/// renderer is refused.
pub const ALPHA: f64 = 0.01;

/// An image with what statistics need to know of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Mean over replicates a pixel.
    pub mean: Vec<f32>,
    /// Variance over replicates a pixel.
    pub variance: Vec<f32>,
    /// Independent replicates.
    pub replicates: u32,
    /// Primary rays a pixel in each.
    pub rays: u32,
    /// Seed of the replicates.
    pub seed: u32,
}

/// An accepted image with its provenance.
#[derive(Clone, Debug, PartialEq)]
pub struct Golden {
    /// The image.
    pub image: Sampled,
    /// Content hash of the scene it was taken of.
    pub scene_hash: String,
    /// What its estimator computes.
    pub definition: String,
    /// Why it was accepted.
    pub reason: String,
}

/// A folder of goldens.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// What came of one case.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// There is no golden of this case.
    Missing,
    /// The golden cannot be used: it is broken, or of another scene or setting.
    Unusable(String),
    /// The case ended with an error, or the record's own image cannot be read.
    Lost(String),
    /// Golden and image were compared.
    Compared(Comparison),
}

/// A case and what came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Checked {
    /// The case.
    pub case: String,
    /// The golden's file.
    pub golden: PathBuf,
    /// What came of it.
    pub verdict: Verdict,
}

/// What kind of end a verification comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Every golden holds.
    Pass,
    /// An image differs from its golden.
    Fail,
    /// Nothing differs, but a difference that matters could not have been seen.
    Blind,
    /// A golden is missing or unusable.
    Missing,
    /// The record has no image to compare.
    Lost,
}

impl Checked {
    /// The kind of end.
    pub fn outcome(&self) -> Outcome {
        match &self.verdict {
            Verdict::Missing | Verdict::Unusable(_) => Outcome::Missing,
            Verdict::Lost(_) => Outcome::Lost,
            Verdict::Compared(c) if c.is_blind() => Outcome::Blind,
            Verdict::Compared(c) if c.passes() => Outcome::Pass,
            Verdict::Compared(_) => Outcome::Fail,
        }
    }

    /// One line for people.
    pub fn line(&self) -> String {
        let text = match &self.verdict {
            Verdict::Missing => format!("MISSING    there is no {}", self.golden.display()),
            Verdict::Unusable(why) => format!("UNUSABLE   {why}"),
            Verdict::Lost(why) => format!("LOST       {why}"),
            Verdict::Compared(c) => c.line(),
        };
        format!("{:<44} {text}", self.case)
    }
}

/// The cases of a record that goldens are kept of, lost ones included.
pub fn golden_cases(record: &Record) -> impl Iterator<Item = &CaseRecord> {
    record.cases.iter().filter(|c| record.suite.golden_rays == Some(c.case.rays))
}

/// What an estimator computes, as text: part of a golden's identity.
fn definition(record: &Record, estimator: &str) -> String {
    record.suite.methods.get(estimator).map_or_else(String::new, |m| serde_json::json!(m).to_string())
}

/// A case's image out of its record.
fn sampled(folder: &Path, record: &Record, case: &CaseRecord) -> Result<Sampled, DiskError> {
    let name = case.image.as_deref().unwrap_or_default();
    let path = folder.join(name);
    let layers = Layers::read(&path)?;
    Ok(Sampled {
        resolution: layers.resolution,
        mean: layer(&layers, &path, "mean")?,
        variance: layer(&layers, &path, "variance")?,
        replicates: record.suite.replicates,
        rays: case.case.rays,
        seed: record.seed,
    })
}

fn layer(layers: &Layers, path: &Path, name: &str) -> Result<Vec<f32>, DiskError> {
    layers
        .get(name)
        .map(<[f32]>::to_vec)
        .ok_or_else(|| DiskError::content(path, format!("there is no layer '{name}' in this image")))
}

impl Store {
    /// The goldens in a folder, which need not exist yet.
    pub fn new(folder: &Path) -> Self {
        Store { folder: folder.to_owned() }
    }

    /// The file of a golden.
    pub fn path(&self, scene: &str, estimator: &str, rays: u32) -> PathBuf {
        self.folder.join(scene).join(format!("{estimator}.{rays}.exr"))
    }

    fn path_of(&self, case: &CaseRecord) -> PathBuf {
        self.path(&case.case.scene, &case.case.estimator, case.case.rays)
    }

    /// Accepts the CPU's images of a record as goldens, those whose case contains
    /// `filter`. Returns the files written.
    ///
    /// # Errors
    /// Where an image of the record cannot be read or a golden not written; the
    /// goldens written until then are whole.
    pub fn approve(
        &self,
        folder: &Path,
        record: &Record,
        reason: &str,
        filter: &str,
    ) -> Result<Vec<PathBuf>, DiskError> {
        let mut ready = Vec::new();
        for case in golden_cases(record) {
            if case.case.renderer != "cpu" || case.error.is_some() || !case.case.id().contains(filter) {
                continue;
            }
            let Some(scene) = record.scenes.iter().find(|s| s.name == case.case.scene) else {
                return Err(DiskError::content(folder, format!("the record has no scene '{}'", case.case.scene)));
            };
            ready.push((self.path_of(case), golden_layers(folder, record, scene, case, reason)?));
        }
        for (path, layers) in &ready {
            layers.write(path)?;
        }
        Ok(ready.into_iter().map(|(path, _)| path).collect())
    }

    /// Reads a golden.
    ///
    /// # Errors
    /// Where it is missing, broken, or lacks a layer or attribute.
    pub fn read(path: &Path) -> Result<Golden, DiskError> {
        let layers = Layers::read(path)?;
        let attribute = |name: &str| {
            layers
                .attributes
                .get(name)
                .cloned()
                .ok_or_else(|| DiskError::content(path, format!("the golden lacks the attribute '{name}'")))
        };
        let number = |name: &str| {
            let text = attribute(name)?;
            text.parse::<u32>().map_err(|_| {
                DiskError::content(path, format!("the golden's attribute '{name}' is '{text}', no number"))
            })
        };
        let golden = Golden {
            image: Sampled {
                resolution: layers.resolution,
                mean: layer(&layers, path, "mean")?,
                variance: layer(&layers, path, "variance")?,
                replicates: number("replicates")?,
                rays: number("rays")?,
                seed: number("seed")?,
            },
            scene_hash: attribute("scene-hash")?,
            definition: attribute("definition")?,
            reason: attribute("reason")?,
        };
        let image = &golden.image;
        let finite = image.mean.iter().any(|v| v.is_finite());
        let sane = image.mean.iter().zip(&image.variance).all(|(m, v)| m.is_nan() || (v.is_finite() && *v >= 0.0));
        if image.replicates < 2 || image.rays < 1 || !finite || !sane {
            return Err(DiskError::content(
                path,
                "the golden's numbers make no sense: it needs 2 replicates or more, and finite means and variances",
            ));
        }
        Ok(golden)
    }

    /// Compares every golden case of a record with its golden. The family error
    /// over all tests of all cases is [`ALPHA`].
    pub fn verify(&self, folder: &Path, record: &Record) -> Vec<Checked> {
        let cases: Vec<&CaseRecord> = golden_cases(record).collect();
        cases
            .iter()
            .map(|case| {
                let golden = self.path_of(case);
                let verdict = self.check(folder, record, case, &golden, cases.len());
                Checked { case: case.case.id(), golden, verdict }
            })
            .collect()
    }

    fn check(&self, folder: &Path, record: &Record, case: &CaseRecord, path: &Path, family: usize) -> Verdict {
        if let Some(error) = &case.error {
            return Verdict::Lost(error.clone());
        }
        if !path.exists() {
            return Verdict::Missing;
        }
        let golden = match Self::read(path) {
            Ok(golden) => golden,
            Err(e) => return Verdict::Unusable(e.to_string()),
        };
        let image = match sampled(folder, record, case) {
            Ok(image) => image,
            Err(e) => return Verdict::Lost(e.to_string()),
        };
        let scene = record.scenes.iter().find(|s| s.name == case.case.scene);
        if scene.is_none_or(|s| s.hash != golden.scene_hash) {
            return Verdict::Unusable(format!(
                "{}: the golden is of another version of the scene; approve it anew",
                path.display()
            ));
        }
        if golden.definition != definition(record, &case.case.estimator) {
            return Verdict::Unusable(format!(
                "{}: the golden is of {}, the record's '{}' is {}",
                path.display(),
                golden.definition,
                case.case.estimator,
                definition(record, &case.case.estimator)
            ));
        }
        if golden.image.resolution != image.resolution {
            return Verdict::Unusable(format!(
                "{}: the golden is {:?} pixels, the image {:?}",
                path.display(),
                golden.image.resolution,
                image.resolution
            ));
        }
        Verdict::Compared(compare(&golden.image, &image, ALPHA, family))
    }
}

fn golden_layers(
    folder: &Path,
    record: &Record,
    scene: &SceneRecord,
    case: &CaseRecord,
    reason: &str,
) -> Result<Layers, DiskError> {
    let image = sampled(folder, record, case)?;
    let regions_path = folder.join(&scene.image);
    let regions = Layers::read(&regions_path)?;
    let hash = pixel_hash(&image.mean);
    let mut layers = Layers::new(image.resolution).with("mean", image.mean).with("variance", image.variance);
    for region in Region::ALL.into_iter().filter(|r| *r != Region::All) {
        let name = format!("region-{}", region.label());
        layers = layers.with(&name, layer(&regions, &regions_path, &name)?);
    }
    let attributes = [
        ("scene", scene.name.clone()),
        ("scene-hash", scene.hash.clone()),
        ("estimator", case.case.estimator.clone()),
        ("definition", definition(record, &case.case.estimator)),
        ("rays", case.case.rays.to_string()),
        ("replicates", record.suite.replicates.to_string()),
        ("seed", record.seed.to_string()),
        ("renderer", case.case.renderer.clone()),
        ("device", record.machine.cpu.clone()),
        ("tool", record.tool.clone()),
        ("pixel-hash", hash),
        ("reason", reason.to_owned()),
    ];
    layers.attributes.extend(attributes.map(|(k, v)| (k.to_owned(), v)));
    Ok(layers)
}
