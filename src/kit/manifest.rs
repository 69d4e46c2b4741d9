//! `kit.json`: what the page of a kit says, for programs.

use crate::{
    run::Facts,
    scenes::Scene,
    suite::{EstimatorFile, Suite},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the format, as it is written.
pub const VERSION: u32 = 1;

/// What to render, and how images are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of this format.
    pub version: u32,
    /// Version of the tool that wrote it.
    pub tool: String,
    /// The suite.
    pub suite: String,
    /// What the kit is called by: another kit of the same suite, of another seed or version, has another one. Scoring
    /// names it, and `kit` in `score.toml` asks for it.
    pub id: String,
    /// Primary rays a pixel that the suite asks for.
    pub rays: Vec<u32>,
    /// Independent images a case that the suite asks for, each with its seed.
    pub replicates: u32,
    /// What the suite's estimators compute, by name.
    pub estimators: BTreeMap<String, EstimatorFile>,
    /// How images must be, where nothing else is declared.
    pub images: Conventions,
    /// The scene to begin with, whose image is known.
    pub self_check: ManifestSelfCheck,
    /// The scenes.
    pub scenes: Vec<ManifestScene>,
}

/// The self-check of a kit. Paths are relative to the kit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ManifestSelfCheck {
    /// Its name.
    pub name: String,
    /// The scene, in metres.
    pub glb: String,
    /// Views, light, R and R' in numbers.
    pub views: String,
    /// What its image looks like, as sRGB codes, to be looked at.
    pub expected: String,
    /// Width and height of the image, pixels.
    pub resolution: [u32; 2],
    /// R, the length of a primary ray, metres.
    pub radius: f64,
}

/// How images are read where nothing else is declared.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Conventions {
    /// What a pixel holds.
    pub value: String,
    /// Colour space.
    pub encoding: String,
    /// The first row of a file.
    pub rows: String,
    /// Where a pixel is sampled.
    pub sample: String,
    /// The unit of `radius`, `secondary_radius` and of the scenes.
    pub length: String,
    /// How files are called.
    pub names: String,
}

/// A scene of a kit. Paths are relative to the kit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ManifestScene {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub description: String,
    /// Whether it is a control, in which AO must change little.
    pub control: bool,
    /// The scene, in metres.
    pub glb: String,
    /// The same without the occluder that is judged; absent where there is none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub twin: Option<String>,
    /// Views, light, R and R' in numbers.
    pub views: String,
    /// Points and normals behind the pixels.
    pub gbuffer: String,
    /// Width and height of the images, pixels.
    pub resolution: [u32; 2],
    /// R, the length of a primary ray, metres.
    pub radius: f64,
    /// R', half the length of a secondary ray, metres.
    pub secondary_radius: f64,
}

impl Manifest {
    /// That of a suite's kit.
    pub(super) fn new(suite: &Suite, id: &str, self_check: ManifestSelfCheck, scenes: Vec<ManifestScene>) -> Self {
        Manifest {
            version: VERSION,
            tool: env!("CARGO_PKG_VERSION").to_owned(),
            suite: suite.name.clone(),
            id: id.to_owned(),
            rays: suite.file.rays.iter().map(|r| r.get()).collect(),
            replicates: suite.file.replicates.get(),
            estimators: suite.methods.iter().map(|m| (m.name.clone(), EstimatorFile::of(&m.estimator))).collect(),
            images: Conventions {
                value: "openness: 1 fully open, 0 closed".into(),
                encoding: "linear".into(),
                rows: "top first".into(),
                sample: "pixel centre".into(),
                length: "metre".into(),
                names: "SCENE.ESTIMATOR.RAYS.REPLICATE.exr".into(),
            },
            self_check,
            scenes,
        }
    }
}

impl ManifestScene {
    pub(super) fn new(folder: &str, facts: Facts) -> Self {
        let at = |file: String| format!("{folder}/{}/{file}", facts.name);
        ManifestScene {
            glb: at(format!("{}.glb", facts.name)),
            twin: facts.has_occluder.then(|| at(format!("{}.twin.glb", facts.name))),
            views: at("views.json".into()),
            gbuffer: at("gbuffer.exr".into()),
            description: facts.description,
            control: facts.control,
            resolution: facts.resolution,
            radius: facts.radius,
            secondary_radius: facts.secondary_radius,
            name: facts.name,
        }
    }
}

impl ManifestSelfCheck {
    pub(super) fn new(folder: &str, scene: &Scene) -> Self {
        let at = |file: &str| format!("{folder}/{}/{file}", scene.name);
        ManifestSelfCheck {
            glb: at(&format!("{}.glb", scene.name)),
            views: at("views.json"),
            expected: at("expected.png"),
            resolution: scene.measure.resolution,
            radius: f64::from(scene.ao.radius),
            name: scene.name.clone(),
        }
    }
}
