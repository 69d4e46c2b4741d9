//! What an unfinished run has finished: a line a unit, written after its file, with
//! the file's hash. A file that does not fit its line counts as none.

use super::unit::Unit;
use crate::{
    disk::{DiskError, write_whole},
    layers::{Layers, hex},
    metrics::judge::Pair,
    record::RecordFolder,
    suite::{Case, Plan},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

/// A unit that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Done {
    /// The unit.
    pub unit: String,
    /// Seconds it took.
    pub seconds: f64,
    /// SHA-256 of its file; null after an error.
    pub sha256: Option<String>,
    /// Why it has none.
    pub error: Option<String>,
    /// Replicates of a judge that an earlier run had traced.
    #[serde(default)]
    pub cached: usize,
    /// Images of an external renderer that had to be tried again, each time counted.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub retries: u32,
}

fn is_zero(n: &u32) -> bool {
    *n == 0
}

/// The journal of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Journal<'a> {
    pub folder: &'a RecordFolder,
}

impl Journal<'_> {
    fn line(&self, id: &str) -> PathBuf {
        // A legal name holds no plus, so no two units share a file.
        self.folder.work().join("units").join(format!("{}.json", id.replace('/', "+")))
    }

    /// What was noted of a unit whose file is as it was left.
    pub fn find(&self, id: &str, file: &Path) -> Option<Done> {
        let done: Done = serde_json::from_str(&fs::read_to_string(self.line(id)).ok()?).ok()?;
        let sound = match &done.sha256 {
            Some(hash) => sha256(&self.folder.path().join(file)).ok().as_ref() == Some(hash),
            None => done.error.is_some(),
        };
        (done.unit == id && sound).then_some(done)
    }

    /// Notes a unit.
    pub fn note(&self, done: &Done) -> Result<(), DiskError> {
        let text = serde_json::to_string(done).unwrap_or_default();
        write_whole(&self.line(&done.unit), |buffer| buffer.write_all(text.as_bytes()))
    }
}

/// Where a unit's images lie in the folder of the run. Those of judges and converged
/// images are working files: the record holds what came of them.
pub(super) fn file(plan: &Plan<'_>, scene: &str, unit: &Unit<'_>) -> PathBuf {
    match unit {
        Unit::Judge => RecordFolder::work_file(&format!("images/{scene}/judge.exr")),
        Unit::Converged(m) => {
            RecordFolder::work_file(&format!("images/{scene}/converged-{}.exr", plan.suite.methods[*m].name))
        }
        Unit::Look => PathBuf::from(look_image(scene)),
        Unit::Case(case) => PathBuf::from(case_image(case)),
    }
}

/// The image of a case, relative to the record.
pub(super) fn case_image(case: &Case) -> String {
    format!("images/{}/{}.{}.{}.exr", case.scene, case.estimator, case.renderer, case.rays)
}

/// What the commands of an external renderer's case said, relative to the record.
pub(super) fn case_log(case: &Case) -> String {
    format!("logs/{}/{}.{}.{}.log", case.scene, case.estimator, case.renderer, case.rays)
}

/// The pictures of a scene, relative to the record.
pub(super) fn look_image(scene: &str) -> String {
    format!("images/{scene}/look.exr")
}

/// The hash of a file.
pub(super) fn sha256(path: &Path) -> Result<String, DiskError> {
    Ok(hex(&Sha256::digest(fs::read(path).map_err(DiskError::io(path, "read the file"))?)))
}

/// Layers `replicate-NNNN`, in order.
pub(super) fn replicates(layers: &Layers) -> Vec<Vec<f32>> {
    (0..).map_while(|r| layers.get(&replicate(r)).map(<[f32]>::to_vec)).collect()
}

/// The layer of a replicate.
pub(super) fn replicate(r: usize) -> String {
    format!("replicate-{r:04}")
}

/// Images of a judge as layers.
pub(super) fn of_pairs(resolution: [u32; 2], pairs: &[Pair]) -> Layers {
    pairs.iter().enumerate().fold(Layers::new(resolution), |layers, (r, pair)| {
        layers.with(&format!("with-{r:04}"), pair.with.clone()).with(&format!("without-{r:04}"), pair.without.clone())
    })
}

/// Reads [`of_pairs`].
pub(super) fn pairs(layers: &Layers) -> Vec<Pair> {
    let pair = |r: usize| {
        let of = |name: &str| layers.get(&format!("{name}-{r:04}")).map(<[f32]>::to_vec);
        Some(Pair { with: of("with")?, without: of("without")? })
    };
    (0..).map_while(pair).collect()
}
