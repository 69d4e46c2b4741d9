//! The suite file.

use super::{EstimatorFile, GateFile, RendererFile};
use crate::scenes::Count;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// Rays or paths a pixel.
pub type Rays = Count<1, 65536>;

/// Independent renders.
pub type Replicates = Count<2, 1024>;

/// A suite file: what to render and what must hold.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SuiteFile {
    /// Its name in record and report: 1 to 64 letters, digits, `-`, `_` and `.`. The
    /// name of the file without its ending, unless given.
    pub name: Option<String>,
    /// What the suite is for.
    pub description: String,
    /// Built-in scenes by name, others by path (ending in `.toml`) from this file.
    pub scenes: Vec<String>,
    /// Primary rays a pixel; each is a case of its own.
    pub rays: Vec<Rays>,
    /// Independent renders of each case; intervals are taken over them.
    pub replicates: Replicates,
    /// Seed of all randomness; `--seed` overrides it.
    #[serde(default = "one", deserialize_with = "seed")]
    pub seed: u32,
    /// Rays of the converged images.
    pub converged_rays: Rays,
    /// Rays at which goldens are taken; none unless given.
    pub golden_rays: Option<Rays>,
    /// Rays and paths a pixel in pictures.
    #[serde(default = "look_rays")]
    pub look_rays: Rays,
    /// The RMSE whose rays and time are told of each method: 1e-6 to 1.
    #[serde(default = "target", deserialize_with = "rmse")]
    #[schemars(extend("minimum" = 1e-6, "maximum" = 1))]
    pub target_rmse: f64,
    /// How precise the judge must be.
    #[serde(default)]
    pub judge: JudgeSettings,
    /// What the GPU renders where the only adapter is a software one; nothing
    /// unless given.
    pub software_adapter: Option<SoftwareAdapter>,
    /// The methods.
    #[serde(rename = "estimator")]
    pub estimators: Vec<EstimatorFile>,
    /// Programs that render beside the CPU.
    #[serde(rename = "renderer", default)]
    pub renderers: Vec<RendererFile>,
    /// What must hold.
    #[serde(rename = "gate", default)]
    pub gates: Vec<GateFile>,
}

fn one() -> u32 {
    1
}

fn seed<'de, D: Deserializer<'de>>(d: D) -> Result<u32, D::Error> {
    let value = i64::deserialize(d)?;
    u32::try_from(value).map_err(|_| D::Error::custom(format!("seed is {value}: it must be 0 to {}", u32::MAX)))
}

fn target() -> f64 {
    crate::metrics::convergence::TARGET
}

fn rmse<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if (1e-6..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err(D::Error::custom(format!("target_rmse is {value}: it must be 1e-6 to 1")))
    }
}

fn look_rays() -> Rays {
    Count(64)
}

/// `[judge]`: the path tracer goes on until each region mean is precise.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JudgeSettings {
    /// Half width of the 95 % interval of each region mean, relative.
    #[serde(deserialize_with = "precision")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub precision: f64,
    /// Paths a pixel in one replicate.
    pub paths: Rays,
    /// Replicates to begin with, and to add each time.
    pub replicates: Replicates,
    /// Replicates at which it gives up.
    pub max_replicates: Replicates,
}

impl Default for JudgeSettings {
    fn default() -> Self {
        JudgeSettings { precision: 0.02, paths: Count(16), replicates: Count(16), max_replicates: Count(128) }
    }
}

fn precision<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if value > 0.0 && value <= 1.0 {
        Ok(value)
    } else {
        Err(D::Error::custom(format!("{value} is out of range: it must be above 0 and at most 1")))
    }
}

/// `[software_adapter]`: each list empty means all.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SoftwareAdapter {
    /// Scenes by name.
    pub scenes: Vec<String>,
    /// Rays a pixel.
    pub rays: Vec<Rays>,
}
