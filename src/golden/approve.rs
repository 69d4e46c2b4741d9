//! Accepting images of a record as goldens.

use super::{
    Golden, Identity, Limits, Notice, Provenance, Sampled, Slot, Store,
    file::regions,
    store::{Snapshot, golden_cases},
};
use crate::{
    disk::DiskError,
    layers::{Layers, is_pointer, pixel_hash},
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
    /// The most bytes that all goldens may hold after it.
    pub most: Option<u64>,
    /// Only tells what would be written.
    pub dry_run: bool,
}

/// What an approval did to the store.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Approved {
    /// The goldens written, or those that a dry run would write; none where the record
    /// has no such case.
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
    /// What stands for a golden cannot be looked at.
    #[error(
        "{}: this is a Git LFS pointer, not the golden: run `git lfs pull` to have it, or `aogauge golden remove` to \
         give it up; nothing is approved", file.display()
    )]
    Pointer {
        /// The golden's file.
        file: PathBuf,
    },
    /// The store would grow beyond a limit.
    #[error("the store holds {before} bytes and would hold {after}, more than {most}; nothing is approved")]
    Large {
        /// Bytes of all goldens now.
        before: u64,
        /// Bytes of all goldens after it.
        after: u64,
        /// The limit, bytes.
        most: u64,
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
/// Where the image cannot be read, is not the one that was measured, or lacks a layer.
pub fn sampled(folder: &Path, record: &Record, case: &CaseRecord) -> Result<Sampled, DiskError> {
    let path = folder.join(case.image.as_deref().unwrap_or_default());
    let method = record.suite.methods.get(&case.case.estimator);
    let depends = method.is_some_and(|m| m.temporal.is_some() || m.denoise.is_some());
    let layers = case.layers(folder)?;
    // Other programs draw numbers of their own, whatever seed they are given.
    let seed = (!case.case.is_external()).then_some(record.seed);
    Sampled::of_layers((&path, &layers), record.replicates(case), case.case.rays, seed, depends)
}

impl Store {
    /// Accepts images of a record as goldens: all that are selected, or none. `told` as in
    /// [`Store::change`], and of the size before anything is changed.
    ///
    /// # Errors
    /// Where a selected case ended with an error, an image of the record cannot be read,
    /// limits are given for an image with noise, a golden is a Git LFS pointer, the store
    /// would grow beyond the limit, or it cannot be written.
    pub fn approve(
        &self,
        folder: &Path,
        record: &Record,
        approval: &Approval<'_>,
        told: &dyn Fn(Notice),
    ) -> Result<Approved, ApproveError> {
        let selected = |c: &&CaseRecord| c.case.renderer == approval.renderer && approval.only.selects(&c.case.id());
        let cases: Vec<&CaseRecord> = golden_cases(record).filter(selected).collect();
        let why = |c: &&CaseRecord| Some(format!("{} ({})", c.case.id(), c.error.as_deref()?));
        let lost: Vec<String> = cases.iter().filter_map(why).collect();
        if !lost.is_empty() {
            return Err(ApproveError::Lost { selected: cases.len(), lost });
        }
        let ready: Vec<(Slot, Vec<u8>)> = cases
            .par_iter()
            .map(|case| {
                let golden = golden_of(folder, record, case, approval)?;
                let slot = Slot { name: approval.name.map(str::to_owned), ..Slot::of(case) };
                let bytes = golden.to_layers().to_bytes();
                Ok((slot, bytes.map_err(DiskError::io(folder, "encode a golden of the record"))?))
            })
            .collect::<Result<_, DiskError>>()?;
        if ready.is_empty() {
            return Ok(Approved::default());
        }
        if approval.dry_run {
            return self.reading(|snapshot| self.growth(snapshot, &ready, approval, told))?;
        }
        let mut change = self.change(told)?;
        let approved = self.growth(&self.snapshot()?, &ready, approval, told)?;
        for (slot, bytes) in &ready {
            change.put(&slot.path(), bytes)?;
        }
        change.commit()?;
        let approved_cases: Vec<String> = cases.iter().map(|c| c.case.id()).collect();
        self.forget_rejections(&approved_cases, told)?;
        Ok(approved)
    }

    /// What writing these goldens comes to, unless that may not be.
    fn growth(
        &self,
        snapshot: &Snapshot,
        ready: &[(Slot, Vec<u8>)],
        approval: &Approval<'_>,
        told: &dyn Fn(Notice),
    ) -> Result<Approved, ApproveError> {
        let size = |path: &PathBuf| fs::metadata(path).map_or(0, |m| m.len());
        let before: u64 = snapshot.files.values().map(size).sum();
        let mut after = before;
        for (slot, bytes) in ready {
            let replaced = snapshot.files.get(slot);
            if replaced.is_some_and(|path| is_pointer(path)) {
                return Err(ApproveError::Pointer { file: self.path(slot) });
            }
            after = (after + bytes.len() as u64).saturating_sub(replaced.map_or(0, size));
        }
        if let Some(most) = approval.most.filter(|most| after > *most) {
            return Err(ApproveError::Large { before, after, most });
        }
        told(Notice::Size { before, after });
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
