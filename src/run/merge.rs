//! Shards of one run become its record: their images are gathered, and measured as if
//! they had been rendered here.

use super::{
    BUILD, Means, Observer, Prepared, RunError,
    journal::{self, Done, Journal},
    shard::ShardRecord,
    unit::Unit,
};
use crate::{
    counted::counted,
    disk::DiskError,
    record::{BEGUN, FILE, Machine, Record, RecordFolder, SHARD, aside, is_aside},
    render::{Geometry, Loaded, RenderError, Renderer},
};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    time::Duration,
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
                ("time to go on until sure", shard.max_time != one.max_time),
                ("base record", shard.base != one.base),
                ("platform", shard.platform != one.platform),
                ("use of external renderers", shard.without_external != one.without_external),
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
            return Err(MergeError::Missing(format!(
                "of {of} shards {} missing: {}",
                counted(gone.len(), "is", "are"),
                gone.join(", ")
            )));
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

    /// Gathers the images in a folder for the record, measures them and commits it.
    /// `prepared` is the plan that [`Shards::first`] tells of. The folder is not touched before all
    /// images are found to be what the shards say.
    ///
    /// # Errors
    /// Where `prepared` is of another program, suite, scene or setting, an image is missing or
    /// damaged, the folder is one of the shards, in one or around one, or a file cannot be
    /// written.
    pub fn merge(
        &self,
        prepared: &Prepared<'_>,
        out: &Path,
        observer: &dyn Observer,
    ) -> Result<(RecordFolder, Record), MergeError> {
        let machine = self.machine();
        self.check(prepared, &machine)?;
        self.keep_apart(out)?;
        let parts = self.parts(prepared)?;
        for part in &parts {
            part.check()?;
        }
        let folder = RecordFolder::create(out)?;
        let journal = Journal { folder: &folder };
        for part in &parts {
            part.copy(folder.path())?;
            part.copy_log(folder.path())?;
            journal.note(part.done)?;
        }
        let means = Means {
            is_merge: true,
            ended: self.all.iter().flat_map(|(_, s)| s.ended.clone()).collect(),
            max_time: self.first().max_time.and_then(|s| Duration::try_from_secs_f64(s).ok()),
            ..Means::new(&Nobody, machine)
        };
        let mut record = prepared.found(&means, &folder, observer).map_err(|e| match e {
            RunError::Disk(e) => MergeError::Disk(e),
            e => MergeError::Unfit(e.to_string()),
        })?;
        let shards = || self.all.iter().map(|(_, s)| s);
        record.timing.began = shards().map(|s| s.began.clone()).min().unwrap_or_default();
        record.timing.seconds = shards().map(|s| s.seconds).sum();
        record.timing.threads = shards().map(|s| s.threads).max().unwrap_or(0);
        folder.commit(&record)?;
        Ok((folder, record))
    }

    /// Whether the shards are of this program and this plan.
    fn check(&self, prepared: &Prepared<'_>, machine: &Machine) -> Result<(), MergeError> {
        let first = self.first();
        let why = match (first.base.is_some(), prepared.base().is_some()) {
            _ if first.build != BUILD => {
                "the shards were rendered by another build of aogauge than this one".to_owned()
            }
            (true, false) => {
                "what decided how many replicates the shards have was a base record: give it here, too (--base)"
                    .to_owned()
            }
            (false, true) => "the shards were rendered without a base record, which would have decided how many \
                              replicates they have: leave out --base"
                .to_owned(),
            _ if first.base != prepared.base() => "the base record is not that of the shards".to_owned(),
            _ if first.identity != prepared.identity(machine) => {
                format!("the suite '{}' or one of its scenes is not what the shards were rendered from", first.suite)
            }
            _ => return Ok(()),
        };
        Err(MergeError::Unfit(why))
    }

    /// The folder for the record is emptied, or moved aside in place of the record before.
    fn keep_apart(&self, out: &Path) -> Result<(), MergeError> {
        let outs = [whole(out), whole(&aside(out))];
        for (folder, _) in &self.all {
            let shard = whole(folder);
            if outs.iter().any(|out| shard.starts_with(out)) || outs[0].starts_with(&shard) {
                return Err(MergeError::Unfit(format!(
                    "the shard in {} would be lost, or the record would lie in it: name another folder than {} for the \
                     record",
                    folder.display(),
                    out.display()
                )));
            }
        }
        Ok(())
    }

    /// Every unit of the plan, and who has it.
    fn parts(&self, prepared: &Prepared<'_>) -> Result<Vec<Part<'_>>, MergeError> {
        let mut parts = Vec::new();
        for set in &prepared.sets {
            for unit in set.units() {
                let id = unit.id(set.subject.plan, &set.scene.name);
                let found = self.all.iter().find_map(|(from, s)| Some((from, s.units.iter().find(|d| d.unit == id)?)));
                let Some((from, done)) = found else {
                    return Err(MergeError::Missing(format!("no shard has rendered {id}")));
                };
                let log = match &unit {
                    Unit::Case(case) if case.is_external() => Some(journal::case_log(case)),
                    _ => None,
                };
                parts.push(Part { from, file: journal::file(set.subject.plan, &set.scene.name, &unit), log, done });
            }
        }
        Ok(parts)
    }
}

/// A unit in a shard.
struct Part<'a> {
    from: &'a Path,
    file: PathBuf,
    /// What the commands of an external renderer said.
    log: Option<String>,
    done: &'a Done,
}

impl Part<'_> {
    /// Makes sure that its image is what the shard says.
    fn check(&self) -> Result<(), DiskError> {
        let Some(hash) = &self.done.sha256 else { return Ok(()) };
        let source = self.from.join(&self.file);
        if !source.exists() && self.file.starts_with(BEGUN) && !self.from.join(BEGUN).exists() {
            let why = format!(
                "the hidden folder {BEGUN} of the shard is not in it: copy or upload it too (for \
                 actions/upload-artifact: include-hidden-files)"
            );
            return Err(DiskError::content(self.from, why));
        }
        if journal::sha256(&source)? != *hash {
            let why = "the image is not what the shard's list says: it was damaged or replaced";
            return Err(DiskError::content(&source, why));
        }
        Ok(())
    }

    /// Copies its image. Who reads it makes sure again that it is the right one.
    fn copy(&self, to: &Path) -> Result<(), DiskError> {
        if self.done.sha256.is_none() {
            return Ok(());
        }
        let (source, target) = (self.from.join(&self.file), to.join(&self.file));
        let parent = target.parent().unwrap_or(to);
        fs::create_dir_all(parent).map_err(DiskError::io(parent, "create the folder"))?;
        fs::copy(&source, &target).map(|_| ()).map_err(DiskError::io(&source, "copy the image"))
    }
}

impl Part<'_> {
    /// Copies its log. That it was lost costs no image.
    fn copy_log(&self, to: &Path) -> Result<(), DiskError> {
        let Some(log) = &self.log else { return Ok(()) };
        let (source, target) = (self.from.join(log), to.join(log));
        if !fs::symlink_metadata(&source).is_ok_and(|found| found.is_file()) {
            return Ok(());
        }
        let parent = target.parent().unwrap_or(to);
        fs::create_dir_all(parent).map_err(DiskError::io(parent, "create the folder"))?;
        fs::copy(&source, &target).map(|_| ()).map_err(DiskError::io(&source, "copy the log"))
    }
}

/// A path without links, as far as it exists.
fn whole(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let there = absolute.ancestors().find_map(|a| Some((a, fs::canonicalize(a).ok()?)));
    there.and_then(|(a, real)| Some(real.join(absolute.strip_prefix(a).ok()?))).unwrap_or(absolute)
}

/// The folders among some that hold a shard, and those one floor below them: a download
/// of artifacts is a folder of folders. What was moved aside, `NAME.previous`, is found by its
/// own name only.
///
/// # Errors
/// Where a folder holds none: [`MergeError::Missing`] where one was begun in it, or it is empty.
pub fn find(given: &[PathBuf]) -> Result<Vec<PathBuf>, MergeError> {
    let mut found = Vec::new();
    for folder in given {
        if folder.join(SHARD).exists() {
            found.push(folder.clone());
            continue;
        }
        let entries = fs::read_dir(folder).map_err(DiskError::io(folder, "list the shards"))?;
        let all: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
        let is_begun = |p: &Path| p.join(BEGUN).exists() && !p.join(FILE).exists();
        let mut inside: Vec<PathBuf> = all.iter().filter(|p| p.join(SHARD).exists() && !is_aside(p)).cloned().collect();
        if inside.is_empty() {
            let name = folder.display();
            if is_begun(folder) || all.iter().any(|p| is_begun(p)) {
                return Err(MergeError::Missing(format!("{name}: the run of this shard did not finish")));
            }
            if all.is_empty() {
                return Err(MergeError::Missing(format!("{name}: there is no shard in it")));
            }
            let why = format!("neither it nor a folder in it holds a {SHARD}");
            return Err(DiskError::content(folder, why).into());
        }
        inside.sort();
        found.append(&mut inside);
    }
    Ok(found)
}

/// Who renders in a merge.
struct Nobody;

impl Renderer for Nobody {
    fn load<'a>(&'a self, _geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Err(RenderError::NoAdapter("a merge renders nothing".into()))
    }
}
