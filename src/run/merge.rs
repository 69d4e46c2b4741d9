//! Shards of one run become its record: their images are gathered, and measured as if
//! they had been rendered here.

use super::{
    BUILD, Means, Observer, Prepared, RunError,
    journal::{self, Journal},
    shard::ShardRecord,
};
use crate::{
    disk::DiskError,
    record::{BEGUN, Machine, Record, RecordFolder, SHARD},
    render::{Geometry, Loaded, RenderError, Renderer},
};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// Why shards cannot be merged.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// A shard cannot be read.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// They are not the parts of one run.
    #[error("{0}")]
    Unfit(String),
    /// Parts are missing.
    #[error("{0}")]
    Missing(String),
}

/// All the shards of one run.
#[derive(Clone, Debug)]
pub struct Shards {
    all: Vec<(PathBuf, ShardRecord)>,
}

impl Shards {
    /// Reads shards, in any order.
    ///
    /// # Errors
    /// Where one cannot be read or ended early, one is missing or there twice, or they
    /// are of different runs.
    pub fn read(folders: &[PathBuf]) -> Result<Self, MergeError> {
        let mut all = Vec::new();
        for folder in folders {
            all.push((folder.clone(), ShardRecord::read(folder)?));
        }
        all.sort_by_key(|(_, s)| s.shard);
        let Some((first, one)) = all.first().cloned() else {
            return Err(MergeError::Missing("no shard is given".into()));
        };
        for (folder, shard) in &all {
            let differs = [
                ("version of aogauge", shard.tool != one.tool),
                ("build of aogauge", shard.build != one.build),
                ("number of shards", shard.shard.of != one.shard.of),
                ("seed", shard.seed != one.seed),
                ("suite", shard.suite != one.suite && shard.identity != one.identity),
                ("filter", shard.filter != one.filter),
                ("way to go on until sure", shard.until_sure != one.until_sure),
                ("platform", shard.platform != one.platform),
                ("GPU", shard.machine.gpu != one.machine.gpu && shard.identity != one.identity),
                ("content of the suite or of a scene", shard.identity != one.identity),
            ];
            if let Some((what, _)) = differs.iter().find(|(_, differs)| *differs) {
                return Err(MergeError::Unfit(format!(
                    "{} and {} are not of one run: their {what} differs",
                    first.display(),
                    folder.display()
                )));
            }
        }
        if let Some(pair) = all.windows(2).find(|w| w[0].1.shard == w[1].1.shard) {
            let [(a, shard), (b, _)] = pair else { return Err(MergeError::Unfit("a shard is there twice".into())) };
            let which = shard.shard;
            return Err(MergeError::Unfit(format!("{} and {} are both shard {which}", a.display(), b.display())));
        }
        let there: BTreeSet<u32> = all.iter().map(|(_, s)| s.shard.index).collect();
        let gone: Vec<String> = (1..=one.shard.of).filter(|k| !there.contains(k)).map(|k| k.to_string()).collect();
        if !gone.is_empty() {
            let of = one.shard.of;
            return Err(MergeError::Missing(format!("of {of} shards {} are missing: {}", gone.len(), gone.join(", "))));
        }
        if let Some((folder, shard)) = all.iter().find(|(_, s)| s.incomplete.is_some()) {
            let why = shard.incomplete.clone().unwrap_or_default();
            return Err(MergeError::Missing(format!("{}: shard {}: {why}", folder.display(), shard.shard)));
        }
        Ok(Shards { all })
    }

    /// One of them: what they agree in holds for all.
    pub fn first(&self) -> &ShardRecord {
        &self.all[0].1
    }

    /// Machines of different processors, told as one.
    fn machine(&self) -> Machine {
        let cpus: BTreeSet<&str> = self.all.iter().map(|(_, s)| s.machine.cpu.as_str()).collect();
        Machine { cpu: cpus.into_iter().collect::<Vec<_>>().join("; "), ..self.first().machine.clone() }
    }

    /// Gathers the images in a folder, measures them and commits the record. `prepared`
    /// is the plan that [`Shards::first`] tells of.
    ///
    /// # Errors
    /// Where `prepared` is of another suite, scene or setting, an image is missing or
    /// damaged, or a file cannot be written.
    pub fn merge(
        &self,
        prepared: &Prepared<'_>,
        folder: &RecordFolder,
        observer: &dyn Observer,
    ) -> Result<Record, MergeError> {
        let machine = self.machine();
        if self.first().build != BUILD {
            let why = "the shards were rendered by another build of aogauge than this one";
            return Err(MergeError::Unfit(why.to_owned()));
        }
        if prepared.identity(&machine) != self.first().identity {
            return Err(MergeError::Unfit(format!(
                "the suite '{}' or one of its scenes is not what the shards were rendered from",
                self.first().suite
            )));
        }
        let journal = Journal { folder };
        for set in &prepared.sets {
            for unit in set.units() {
                let id = unit.id(set.plan, &set.scene.name);
                let of = |(_, s): &&(PathBuf, ShardRecord)| s.units.iter().any(|d| d.unit == id);
                let Some((from, shard)) = self.all.iter().find(of) else {
                    return Err(MergeError::Missing(format!("no shard has rendered {id}")));
                };
                let Some(done) = shard.units.iter().find(|d| d.unit == id) else { continue };
                let file = journal::file(set.plan, &set.scene.name, &unit);
                if let Some(hash) = &done.sha256 {
                    copy(from, folder.path(), &file, hash)?;
                }
                journal.note(done)?;
            }
        }
        let means = Means { is_merge: true, ..Means::new(&Nobody, machine) };
        let mut record = prepared.found(&means, folder, observer).map_err(|e| match e {
            RunError::Disk(e) => MergeError::Disk(e),
            e => MergeError::Unfit(e.to_string()),
        })?;
        let shards = || self.all.iter().map(|(_, s)| s);
        record.timing.began = shards().map(|s| s.began.clone()).min().unwrap_or_default();
        record.timing.seconds = shards().map(|s| s.seconds).sum();
        record.timing.threads = shards().map(|s| s.threads).max().unwrap_or(0);
        folder.commit(&record)?;
        Ok(record)
    }
}

/// The folders among some that hold a shard, and those one floor below them: a download
/// of artifacts is a folder of folders.
///
/// # Errors
/// Where a folder holds none.
pub fn find(given: &[PathBuf]) -> Result<Vec<PathBuf>, MergeError> {
    let mut found = Vec::new();
    for folder in given {
        if folder.join(SHARD).exists() {
            found.push(folder.clone());
            continue;
        }
        let entries = fs::read_dir(folder).map_err(DiskError::io(folder, "list the shards"))?;
        let mut inside: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(|p| p.join(SHARD).exists()).collect();
        if inside.is_empty() {
            let why = format!("neither it nor a folder in it holds a {SHARD}");
            return Err(DiskError::content(folder, why).into());
        }
        inside.sort();
        found.append(&mut inside);
    }
    Ok(found)
}

/// Copies an image whose hash is known.
fn copy(from: &Path, to: &Path, file: &Path, hash: &str) -> Result<(), DiskError> {
    let (source, target) = (from.join(file), to.join(file));
    let parent = target.parent().unwrap_or(to);
    fs::create_dir_all(parent).map_err(DiskError::io(parent, "create the folder"))?;
    if !source.exists() && file.starts_with(BEGUN) && !from.join(BEGUN).exists() {
        let why = format!(
            "the hidden folder {BEGUN} of the shard is not in it: copy or upload it too (for \
             actions/upload-artifact: include-hidden-files)"
        );
        return Err(DiskError::content(from, why));
    }
    if journal::sha256(&source)? != *hash {
        return Err(DiskError::content(
            &source,
            "the image is not what the shard's list says: it was damaged or replaced",
        ));
    }
    fs::copy(&source, &target).map(|_| ()).map_err(DiskError::io(&source, "copy the image"))
}

/// Who renders in a merge.
struct Nobody;

impl Renderer for Nobody {
    fn load<'a>(&'a self, _geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Err(RenderError::NoAdapter("a merge renders nothing".into()))
    }
}
