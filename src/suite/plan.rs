//! The cases of a suite on a machine.

use super::Suite;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What there is to render on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Platform {
    /// The CPU alone.
    Cpu,
    /// A software GPU adapter beside the CPU: it renders the cases marked for it.
    SoftwareGpu,
    /// A GPU beside the CPU: it renders every case.
    Gpu,
}

/// One scene x estimator x renderer x ray count.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Scene by name.
    pub scene: String,
    /// Estimator by name.
    pub estimator: String,
    /// `cpu` or `gpu`.
    pub renderer: String,
    /// Primary rays a pixel.
    pub rays: u32,
}

impl Case {
    /// `scene/estimator/renderer/rays`, unique in a run.
    pub fn id(&self) -> String {
        format!("{}/{}/{}/{}", self.scene, self.estimator, self.renderer, self.rays)
    }
}

/// Everything a run will do.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// The suite.
    pub suite: &'a Suite,
    /// The cases, scene by scene, the CPU's before the GPU's.
    pub cases: Vec<Case>,
    /// Seed of all randomness.
    pub seed: u32,
}

impl<'a> Plan<'a> {
    /// Lists the cases of a suite on a platform. Methods that the GPU does not
    /// compute are rendered by the CPU alone.
    pub fn new(suite: &'a Suite, platform: Platform, seed: Option<u32>) -> Self {
        let marked = &suite.file.software_adapter;
        let mut cases = Vec::new();
        for scene in &suite.scenes {
            for renderer in ["cpu", "gpu"] {
                if renderer == "gpu" && platform == Platform::Cpu {
                    continue;
                }
                for method in &suite.methods {
                    if renderer == "gpu" && !method.estimator.is_on_gpu() {
                        continue;
                    }
                    for rays in method.rays.as_ref().map_or(suite.file.rays.as_slice(), std::slice::from_ref) {
                        let on_software = marked.as_ref().is_some_and(|m| {
                            (m.scenes.is_empty() || m.scenes.contains(&scene.name))
                                && (m.rays.is_empty() || m.rays.contains(rays))
                        });
                        if renderer == "gpu" && platform == Platform::SoftwareGpu && !on_software {
                            continue;
                        }
                        cases.push(Case {
                            scene: scene.name.clone(),
                            estimator: method.name.clone(),
                            renderer: renderer.to_owned(),
                            rays: rays.get(),
                        });
                    }
                }
            }
        }
        Plan { suite, cases, seed: seed.unwrap_or(suite.file.seed) }
    }
}
