//! Accepting images of a record as goldens, and removing goldens of cases that are no
//! more.

use super::{Golden, Identity, Limits, Provenance, Sampled, Slot, Store, file::regions, store::golden_cases};
use crate::{
    disk::DiskError,
    layers::{Layers, pixel_hash},
    record::{CaseRecord, Record},
};
use rayon::prelude::*;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// What is accepted, and why.
#[derive(Clone, Debug)]
pub struct Approval<'a> {
    /// Why these images are right.
    pub reason: &'a str,
    /// Only cases whose `scene/estimator/renderer/rays` contains this.
    pub only: &'a str,
    /// `cpu` or `gpu`.
    pub renderer: &'a str,
    /// The name of another golden beside the first, legal by
    /// [`check_golden_name`](super::check_golden_name).
    pub name: Option<&'a str>,
    /// What may differ where there is no noise.
    pub limits: Option<Limits>,
}

/// What an estimator computes, as text: part of a golden's identity.
pub(super) fn definition(record: &Record, estimator: &str) -> String {
    record.suite.methods.get(estimator).map_or_else(String::new, |m| serde_json::json!(m).to_string())
}

/// A case's image out of its record. Smoothing makes pixels depend on each other.
pub(super) fn sampled(folder: &Path, record: &Record, case: &CaseRecord) -> Result<Sampled, DiskError> {
    let path = folder.join(case.image.as_deref().unwrap_or_default());
    let method = record.suite.methods.get(&case.case.estimator);
    let depends = method.is_some_and(|m| m.temporal.is_some() || m.denoise.is_some());
    Sampled::of_layers(&path, record.suite.replicates, case.case.rays, record.seed, depends)
}

impl Store {
    /// Accepts images of a record as goldens. Returns the files written; none where the
    /// record has no such case. The store has all of them or none of them. `waiting` as
    /// in [`Store::change`].
    ///
    /// # Errors
    /// Where an image of the record cannot be read, limits are given for an image with
    /// noise, or the store cannot be written.
    pub fn approve(
        &self,
        folder: &Path,
        record: &Record,
        approval: &Approval<'_>,
        waiting: &dyn Fn(),
    ) -> Result<Vec<PathBuf>, DiskError> {
        let cases: Vec<&CaseRecord> = golden_cases(record)
            .filter(|c| {
                c.case.renderer == approval.renderer && c.error.is_none() && c.case.id().contains(approval.only)
            })
            .collect();
        let ready: Vec<(Slot, Layers)> = cases
            .par_iter()
            .map(|case| {
                let golden = golden_of(folder, record, case, approval)?;
                let slot = Slot { name: approval.name.map(str::to_owned), ..Slot::of(case) };
                Ok((slot, golden.to_layers()))
            })
            .collect::<Result<_, DiskError>>()?;
        if ready.is_empty() {
            return Ok(Vec::new());
        }
        let mut change = self.change(waiting)?;
        for (slot, layers) in &ready {
            change.put(&slot.path(), layers)?;
        }
        change.commit()?;
        Ok(ready.iter().map(|(slot, _)| self.path(slot)).collect())
    }

    /// The goldens of cases that `named` does not hold.
    ///
    /// # Errors
    /// Where the store cannot be listed.
    pub fn orphans(&self, named: &BTreeSet<Slot>) -> Result<Vec<Slot>, DiskError> {
        let is_named = |slot: &Slot| named.contains(&Slot { name: None, ..slot.clone() });
        self.reading(|snapshot| snapshot.files.keys().filter(|s| !is_named(s)).cloned().collect())
    }

    /// Removes goldens, all of them or none.
    ///
    /// # Errors
    /// Where the store cannot be written.
    pub fn remove(&self, slots: &[Slot], waiting: &dyn Fn()) -> Result<(), DiskError> {
        let mut change = self.change(waiting)?;
        for slot in slots {
            change.remove(&slot.path());
        }
        change.commit()
    }
}

/// The slots of a record's golden cases.
///
/// # Errors
/// One sentence, where the record may lack cases of its suite: one ended with an error,
/// or a scene lacks an estimator.
pub fn named_by_record(record: &Record) -> Result<BTreeSet<Slot>, String> {
    if let Some(lost) = record.cases.iter().find(|c| c.error.is_some()) {
        return Err(format!("the case {} ended with an error: run the suite again", lost.case.id()));
    }
    for scene in &record.scenes {
        for estimator in &record.suite.estimators {
            if !record.cases.iter().any(|c| c.case.scene == scene.name && c.case.estimator == *estimator) {
                return Err(format!(
                    "the record has no case of estimator '{estimator}' in scene '{}': give one of the whole suite",
                    scene.name
                ));
            }
        }
    }
    Ok(golden_cases(record).map(Slot::of).collect())
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
            replicates: record.suite.replicates,
            pixel_hash: pixel_hash(&image.mean),
            reason: approval.reason.to_owned(),
        },
        image,
        regions,
        limits: approval.limits,
    })
}
