//! Accepting images of a record as goldens.

use super::{Golden, Identity, Limits, Provenance, Sampled, Slot, Store, file::regions, store::golden_cases};
use crate::{
    disk::DiskError,
    layers::{Layers, pixel_hash},
    record::{CaseRecord, Record},
};
use rayon::prelude::*;
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Which cases of a record, by their `scene/estimator/renderer/rays`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection<'a> {
    /// Those that contain this.
    Containing(&'a str),
    /// The one that is this.
    Case(&'a str),
}

impl Selection<'_> {
    /// Whether a case is one of them.
    pub fn selects(&self, id: &str) -> bool {
        match self {
            Selection::Containing(part) => id.contains(part),
            Selection::Case(case) => id == *case,
        }
    }
}

/// What is accepted, and why.
#[derive(Clone, Debug)]
pub struct Approval<'a> {
    /// Why these images are right.
    pub reason: &'a str,
    /// Which cases.
    pub only: Selection<'a>,
    /// `cpu` or `gpu`.
    pub renderer: &'a str,
    /// The name of another golden beside the first, legal by
    /// [`check_golden_name`](super::check_golden_name).
    pub name: Option<&'a str>,
    /// What may differ where there is no noise.
    pub limits: Option<Limits>,
}

/// What an approval did to the store.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Approved {
    /// The goldens written; none where the record has no such case.
    pub files: Vec<PathBuf>,
    /// Bytes of all goldens before.
    pub before: u64,
    /// Bytes of all goldens after.
    pub after: u64,
}

/// Why nothing was approved.
#[derive(Debug, thiserror::Error)]
pub enum ApproveError {
    /// Selected cases ended with an error: they have no image to accept.
    #[error("{} of {selected} selected cases were lost, so nothing is approved: {}", lost.len(), first(lost))]
    Lost {
        /// How many cases were selected.
        selected: usize,
        /// The lost ones, each with its error.
        lost: Vec<String>,
    },
    /// A file cannot be read or written, or is not what it should be.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

/// The first few of many.
fn first(all: &[String]) -> String {
    let more = if all.len() > 8 { "; ..." } else { "" };
    all.iter().take(8).map(String::as_str).collect::<Vec<_>>().join("; ") + more
}

/// What an estimator computes, as text: part of a golden's identity.
pub(super) fn definition(record: &Record, estimator: &str) -> String {
    record.suite.methods.get(estimator).map_or_else(String::new, |m| serde_json::json!(m).to_string())
}

/// A case's image out of its record. Smoothing makes pixels depend on each other.
///
/// # Errors
/// Where the image cannot be read or lacks a layer.
pub fn sampled(folder: &Path, record: &Record, case: &CaseRecord) -> Result<Sampled, DiskError> {
    let path = folder.join(case.image.as_deref().unwrap_or_default());
    let method = record.suite.methods.get(&case.case.estimator);
    let depends = method.is_some_and(|m| m.temporal.is_some() || m.denoise.is_some());
    Sampled::of_layers(&path, record.replicates(case), case.case.rays, record.seed, depends)
}

impl Store {
    /// Accepts images of a record as goldens: all that are selected, or none. `waiting`
    /// as in [`Store::change`].
    ///
    /// # Errors
    /// Where a selected case ended with an error, an image of the record cannot be read,
    /// limits are given for an image with noise, or the store cannot be written.
    pub fn approve(
        &self,
        folder: &Path,
        record: &Record,
        approval: &Approval<'_>,
        waiting: &dyn Fn(),
    ) -> Result<Approved, ApproveError> {
        let selected = |c: &&CaseRecord| c.case.renderer == approval.renderer && approval.only.selects(&c.case.id());
        let cases: Vec<&CaseRecord> = golden_cases(record).filter(selected).collect();
        let told = |c: &&CaseRecord| Some(format!("{} ({})", c.case.id(), c.error.as_deref()?));
        let lost: Vec<String> = cases.iter().filter_map(told).collect();
        if !lost.is_empty() {
            return Err(ApproveError::Lost { selected: cases.len(), lost });
        }
        let ready: Vec<(Slot, Layers)> = cases
            .par_iter()
            .map(|case| {
                let golden = golden_of(folder, record, case, approval)?;
                let slot = Slot { name: approval.name.map(str::to_owned), ..Slot::of(case) };
                Ok((slot, golden.to_layers()))
            })
            .collect::<Result<_, DiskError>>()?;
        if ready.is_empty() {
            return Ok(Approved::default());
        }
        let mut change = self.change(waiting)?;
        let size = |path: &Path| fs::metadata(path).map_or(0, |m| m.len());
        let before: u64 = self.snapshot()?.files.values().map(|path| size(path)).sum();
        let mut after = before;
        for (slot, layers) in &ready {
            after = (after + change.put(&slot.path(), layers)?).saturating_sub(size(&self.path(slot)));
        }
        change.commit()?;
        let approved: Vec<String> = cases.iter().map(|c| c.case.id()).collect();
        self.forget_rejections(&approved, waiting)?;
        Ok(Approved { files: ready.iter().map(|(slot, _)| self.path(slot)).collect(), before, after })
    }
}

fn golden_of(folder: &Path, record: &Record, case: &CaseRecord, approval: &Approval<'_>) -> Result<Golden, DiskError> {
    let of = &case.case;
    let Some(scene) = record.scenes.iter().find(|s| s.name == of.scene) else {
        return Err(DiskError::content(folder, format!("the record has no scene '{}'", of.scene)));
    };
    let image = sampled(folder, record, case)?;
    if approval.limits.is_some() && !image.is_deterministic() {
        let why = "the image has noise: tests decide, and a tolerance would never be read";
        return Err(DiskError::content(folder, format!("{}: {why}", of.id())));
    }
    let regions = regions(&Layers::read(&folder.join(&scene.image))?);
    if regions.values().flatten().any(|&i| i >= image.mean.len()) {
        return Err(DiskError::content(&folder.join(&scene.image), "the regions are larger than the image"));
    }
    let device = if of.renderer == "gpu" { &record.machine.gpu } else { &record.machine.cpu };
    Ok(Golden {
        identity: Identity {
            scene: scene.name.clone(),
            scene_hash: scene.hash.clone(),
            estimator: of.estimator.clone(),
            definition: definition(record, &of.estimator),
            rays: of.rays,
            resolution: image.resolution,
        },
        provenance: Provenance {
            renderer: of.renderer.clone(),
            device: device.clone(),
            tool: record.tool.clone(),
            seed: record.seed,
            replicates: record.replicates(case),
            pixel_hash: pixel_hash(&image.mean),
            reason: approval.reason.to_owned(),
        },
        image,
        regions,
        limits: approval.limits,
    })
}
