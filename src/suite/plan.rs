//! The cases of a suite on a machine.

use super::{OwnRenderer, Suite};
use crate::{record::Record, scenes::Scene};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What there is to render on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
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
    /// `cpu`, `gpu`, or that of an external renderer by name.
    pub renderer: String,
    /// Primary rays a pixel.
    pub rays: u32,
}

/// Whether a renderer of this name is one of ours.
pub(crate) fn is_own(renderer: &str) -> bool {
    matches!(renderer, "cpu" | "gpu")
}

impl Case {
    /// `scene/estimator/renderer/rays`, unique in a run.
    pub fn id(&self) -> String {
        format!("{}/{}/{}/{}", self.scene, self.estimator, self.renderer, self.rays)
    }

    /// Whether a program of somebody else renders it.
    pub fn is_external(&self) -> bool {
        !is_own(&self.renderer)
    }
}

/// Everything a run will do.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// The suite.
    pub suite: &'a Suite,
    /// The cases, scene by scene, the CPU's before the GPU's, and those before the others'.
    pub cases: Vec<Case>,
    /// Seed of all randomness.
    pub seed: u32,
    /// What there is to render on.
    pub platform: Platform,
    /// Whether external renderers take part.
    pub external: bool,
    /// What the names of cases had to contain, where only some were asked for. The
    /// cases that those are compared with are in the plan, too.
    pub filter: Option<String>,
    /// The most replicates of a case, where they are added until its verdicts are
    /// decided; None where each case has the suite's.
    pub until_sure: Option<u32>,
    /// The record that gates `against = "base"` are held against; None leaves them idle.
    pub base: Option<Record>,
    /// Whether there is none on purpose. Else such gates make a run without one inconclusive.
    pub no_base: bool,
}

impl<'a> Plan<'a> {
    /// Lists the cases of a suite on a platform, and those of its external renderers. Methods
    /// that the GPU does not compute are rendered by the CPU alone.
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
            cases.extend(suite.renderers.iter().flat_map(|r| r.cases(suite, &scene.name)));
        }
        Plan {
            suite,
            cases,
            seed: seed.unwrap_or(suite.file.seed),
            platform,
            external: true,
            filter: None,
            until_sure: None,
            base: None,
            no_base: false,
        }
    }

    /// Leaves out the cases of external renderers.
    #[must_use]
    pub fn without_external(mut self) -> Self {
        self.cases.retain(|c| !c.is_external());
        self.external = false;
        self
    }

    /// Keeps the cases whose `scene/estimator/renderer/rays` contains a text, and those
    /// that they are compared with: classic AO beside them, the CPU's image beside that of
    /// the GPU or of an external renderer, and what gates hold them against.
    pub fn only(mut self, filter: &str) -> Self {
        let mut wanted: Vec<Case> = self.cases.iter().filter(|c| c.id().contains(filter)).cloned().collect();
        for case in wanted.clone() {
            let on_cpu = Case { renderer: "cpu".into(), ..case.clone() };
            wanted.extend([self.suite.classic_beside(&case), self.suite.classic_beside(&on_cpu), on_cpu]);
            let against = self.suite.gates.iter().filter(|g| g.applies_to(&case)).filter_map(|g| g.against.as_deref());
            wanted.extend(against.filter_map(|other| self.beside(&case, other)).cloned());
        }
        self.cases.retain(|c| wanted.contains(c));
        self.filter = Some(filter.to_owned());
        self
    }

    /// The case of another estimator that gates hold a case against: in the same scene on
    /// the same renderer, of as many rays, else of the most.
    pub(crate) fn beside(&self, case: &Case, other: &str) -> Option<&Case> {
        let theirs =
            self.cases.iter().filter(|c| c.estimator == other && c.scene == case.scene && c.renderer == case.renderer);
        theirs.max_by_key(|c| (c.rays == case.rays, c.rays))
    }

    /// The external renderers that have a case.
    pub fn external(&self) -> impl Iterator<Item = &'a OwnRenderer> {
        let suite = self.suite;
        suite.renderers.iter().filter(|r| self.cases.iter().any(|c| c.renderer == r.file.name))
    }

    /// The scenes that have a case, in the suite's order.
    pub fn scenes(&self) -> impl Iterator<Item = &'a Scene> {
        let suite = self.suite;
        suite.scenes.iter().filter(|s| self.cases.iter().any(|c| c.scene == s.name))
    }

    /// The methods that have a case, by their index in the suite.
    pub fn methods(&self) -> Vec<usize> {
        let of = |name: &str| self.cases.iter().any(|c| c.estimator == name);
        (0..self.suite.methods.len()).filter(|&m| of(&self.suite.methods[m].name)).collect()
    }
}
