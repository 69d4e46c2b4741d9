//! Changes of a store that are whole or not there at all, one at a time.
//!
//! All of it lies in the store's folder `.approval`, which git does not see:
//! - `lock`: locked by who changes the store, shared by who reads it. The system lets
//!   go of it when its holder ends, however that ends.
//! - `staged/0.exr`...: new files, on the same disk, synced.
//! - `journal.json`: what is to be put in place and removed. Its rename into place is the
//!   decision: before it the store is the old one, from then on the new one. Who reads
//!   a store with a journal sees the change as made; who changes it makes it first.
//!
//! Staged files are copied into place and stay until the journal is gone. So a change
//! that was cut short can be made again from its beginning, whatever was done to the
//! files in the store meanwhile: `git checkout` of them, above all.

use super::Slot;
use crate::disk::{DiskError, is_part, read_text, write_whole};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeSet,
    fs::{self, File, TryLockError},
    io::{self, Write},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// The folder of everything that is no golden.
const FOLDER: &str = ".approval";
/// How long a change waits before it says so.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often it looks meanwhile.
const STEP: Duration = Duration::from_millis(10);
/// A golden on its way from `staged`, so that no part of one is ever seen in its place.
const PLACING: &str = ".aogauge-placing.part";
/// A journal larger than this is none of ours.
const LARGEST_JOURNAL: u64 = 64 << 20;

/// What who changes a store is told meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notice {
    /// Another command reads or changes the goldens, and this one waits for it.
    Waiting,
    /// A change that was decided and then cut short was finished first.
    Finished {
        /// Goldens put in their places.
        written: usize,
        /// Goldens removed.
        removed: usize,
    },
    /// How many bytes all goldens hold, told before anything is changed.
    Size {
        /// Now.
        before: u64,
        /// Once the change is made.
        after: u64,
    },
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Journal {
    /// Names in `staged`, and files in the store.
    moves: Vec<(String, PathBuf)>,
    /// Files in the store.
    removals: Vec<PathBuf>,
}

/// What a journal changes of what lies in the store.
#[derive(Debug, Default)]
pub(super) struct Overlay {
    /// Files in the store and where their content lies.
    pub moved: Vec<(PathBuf, PathBuf)>,
    /// Files in the store that count as removed.
    pub removed: Vec<PathBuf>,
    /// Whether there is a journal.
    pub interrupted: bool,
}

/// New goldens and removals, made at once by [`Change::commit`]. Dropped before, it
/// changes nothing.
#[derive(Debug)]
pub struct Change {
    store: PathBuf,
    journal: Journal,
    /// Held until the end.
    _lock: File,
}

fn lock_path(store: &Path) -> PathBuf {
    store.join(FOLDER).join("lock")
}

fn staged(store: &Path) -> PathBuf {
    store.join(FOLDER).join("staged")
}

fn journal_path(store: &Path) -> PathBuf {
    store.join(FOLDER).join("journal.json")
}

/// Whether any change was ever made or begun here.
pub(super) fn has_lock(store: &Path) -> bool {
    lock_path(store).exists()
}

/// The lock shared with other readers; None where there was no change here ever.
pub(super) fn lock_to_read(store: &Path) -> Result<Option<File>, DiskError> {
    let path = lock_path(store);
    let file = match File::open(&path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        file => file.map_err(DiskError::io(&path, "open the store's lock"))?,
    };
    match file.lock_shared() {
        // Where files cannot be locked, no approval can be under way.
        Err(e) if e.kind() == io::ErrorKind::Unsupported => {}
        locked => locked.map_err(DiskError::io(&path, "lock the store"))?,
    }
    Ok(Some(file))
}

impl Journal {
    /// None where there is none.
    fn read(store: &Path) -> Result<Option<Self>, DiskError> {
        let path = journal_path(store);
        match fs::metadata(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            meta => {
                if meta.map_err(DiskError::io(&path, "read the journal"))?.len() > LARGEST_JOURNAL {
                    return Err(DiskError::content(&path, "this is no journal of aogauge: it is too large"));
                }
            }
        }
        let journal: Journal = serde_json::from_str(&read_text(&path)?)
            .map_err(|e| DiskError::content(&path, format!("this is no journal of aogauge: {e}")))?;
        // A store may come from anybody: nothing it says leads out of it.
        let is_golden = |p: &Path| Slot::of_path(p).is_some();
        let is_staged = |n: &str| n.strip_suffix(".exr").is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()));
        let fits = journal.moves.iter().all(|(from, to)| is_staged(from) && is_golden(to))
            && journal.removals.iter().all(|r| is_golden(r));
        if !fits {
            return Err(DiskError::content(&path, "the journal names files that are no goldens of this store"));
        }
        Ok(Some(journal))
    }

    /// Whether every staged file is there.
    ///
    /// # Errors
    /// Where one is not: what the change was decided to be cannot be known any more.
    fn check_staged(&self, store: &Path) -> Result<(), DiskError> {
        let folder = staged(store);
        // Nor is a link one: it would bring a file of somewhere else into the store.
        let is_there = |name: &String| fs::symlink_metadata(folder.join(name)).is_ok_and(|meta| meta.is_file());
        let Some((gone, _)) = self.moves.iter().find(|(from, _)| !is_there(from)) else {
            return Ok(());
        };
        Err(DiskError::content(
            &folder.join(gone),
            format!(
                "a change of the goldens was interrupted, and this file of it is gone or none: remove {} to give the change up, \
                 and restore the goldens from version control",
                store.join(FOLDER).display()
            ),
        ))
    }

    /// Makes all moves and removals, then forgets them. May be cut short anywhere and
    /// begun again, whatever lies in the places of the goldens meanwhile.
    fn apply(&self, store: &Path) -> Result<(), DiskError> {
        self.check_staged(store)?;
        let changed = self.moves.iter().map(|(_, to)| to).chain(&self.removals);
        changed
            .filter_map(|file| store.join(file).parent().map(Path::to_owned))
            .try_for_each(|scene| refuse_link(&scene))?;
        let mut scenes = BTreeSet::new();
        for (from, to) in &self.moves {
            let to = store.join(to);
            if let Some(scene) = to.parent() {
                place(store, &staged(store).join(from), &to, scene)?;
                scenes.insert(scene.to_owned());
            }
        }
        scenes.iter().try_for_each(|scene| sync(scene))?;
        for file in &self.removals {
            let file = store.join(file);
            match fs::remove_file(&file) {
                Err(e) if e.kind() == io::ErrorKind::NotFound => {}
                removed => removed.map_err(DiskError::io(&file, "remove the golden"))?,
            }
            if let Some(scene) = file.parent() {
                // Refused where others are left.
                let _ = fs::remove_dir(scene);
            }
        }
        sync(store)?;
        let path = journal_path(store);
        fs::remove_file(&path).map_err(DiskError::io(&path, "remove the journal"))?;
        // Not before: a journal without its files is a change that nobody can finish.
        sync(&store.join(FOLDER))?;
        clear(store)
    }
}

impl Overlay {
    pub(super) fn read(store: &Path) -> Result<Self, DiskError> {
        let Some(journal) = Journal::read(store)? else {
            return Ok(Overlay::default());
        };
        journal.check_staged(store)?;
        let moved = journal.moves.into_iter().map(|(from, to)| (to, staged(store).join(from)));
        Ok(Overlay { moved: moved.collect(), removed: journal.removals, interrupted: true })
    }
}

impl Change {
    pub(super) fn begin(store: &Path, told: &dyn Fn(Notice)) -> Result<Self, DiskError> {
        let folder = store.join(FOLDER);
        let path = lock_path(store);
        for ours in [&folder, &path, &staged(store)] {
            refuse_link(ours)?;
        }
        fs::create_dir_all(&folder).map_err(DiskError::io(&folder, "create the folder"))?;
        let mut open = File::options();
        let file = open.create(true).truncate(false).write(true).open(&path);
        let lock = file.map_err(DiskError::io(&path, "open the store's lock"))?;
        wait(&lock, told).map_err(DiskError::io(&path, "lock the store"))?;
        // Whoever wrote such a file is gone: this one alone has the lock.
        sweep(&folder)?;
        let ignore = folder.join(".gitignore");
        if !ignore.exists() {
            write_whole(&ignore, |b| b.write_all(b"*\n"))?;
        }
        match Journal::read(store)? {
            Some(journal) => {
                journal.apply(store)?;
                told(Notice::Finished { written: journal.moves.len(), removed: journal.removals.len() });
            }
            None => clear(store)?,
        }
        Ok(Change { store: store.to_owned(), journal: Journal::default(), _lock: lock })
    }

    /// Writes the bytes of a golden, to be put at `to`, `SCENE/FILE` in the store.
    ///
    /// # Errors
    /// Where they cannot be written.
    pub fn put(&mut self, to: &Path, bytes: &[u8]) -> Result<(), DiskError> {
        let name = format!("{}.exr", self.journal.moves.len());
        write_whole(&staged(&self.store).join(&name), |b| b.write_all(bytes))?;
        self.journal.moves.push((name, to.to_owned()));
        Ok(())
    }

    /// Removes a golden, `SCENE/FILE` in the store.
    pub fn remove(&mut self, file: &Path) {
        self.journal.removals.push(file.to_owned());
    }

    /// Makes the change.
    ///
    /// # Errors
    /// Where the journal cannot be written: then nothing is changed; or a file not
    /// put in its place: then the next change makes this one first.
    pub fn commit(self) -> Result<(), DiskError> {
        self.decide()?;
        self.journal.apply(&self.store)
    }

    fn decide(&self) -> Result<(), DiskError> {
        let path = journal_path(&self.store);
        if !self.journal.moves.is_empty() {
            sync(&staged(&self.store))?;
        }
        let text = serde_json::json!(self.journal).to_string();
        write_whole(&path, |b| b.write_all(text.as_bytes()))?;
        sync(&self.store.join(FOLDER))
    }
}

/// Locks for this process alone.
fn wait(lock: &File, told: &dyn Fn(Notice)) -> io::Result<()> {
    let began = Instant::now();
    loop {
        match lock.try_lock() {
            Ok(()) => return Ok(()),
            Err(TryLockError::WouldBlock) if began.elapsed() < PATIENCE => std::thread::sleep(STEP),
            Err(TryLockError::WouldBlock) => {
                told(Notice::Waiting);
                return lock.lock();
            }
            Err(TryLockError::Error(e)) => return Err(e),
        }
    }
}

/// Copies a staged file into its place, whole or not at all.
fn place(store: &Path, from: &Path, to: &Path, scene: &Path) -> Result<(), DiskError> {
    let part = store.join(FOLDER).join(PLACING);
    let action = "put the golden in its place";
    fs::create_dir_all(scene).map_err(DiskError::io(scene, "create the folder"))?;
    // The bytes alone: a golden is no program, whatever its staged file says.
    let copied = File::create(&part).and_then(|mut golden| {
        io::copy(&mut File::open(from)?, &mut golden)?;
        golden.sync_all()
    });
    copied.map_err(DiskError::io(&part, action))?;
    fs::rename(&part, to).map_err(DiskError::io(to, action))
}

/// Refuses a link where the store has a folder or file of its own: a store may come from anybody, and what
/// is written through a link lies somewhere else.
fn refuse_link(path: &Path) -> Result<(), DiskError> {
    match fs::symlink_metadata(path) {
        Ok(meta) if meta.is_symlink() => Err(DiskError::content(
            path,
            "this is a link, and a store of goldens is changed in its own folders alone: put the folder in its place",
        )),
        _ => Ok(()),
    }
}

/// Removes what was being written when its writer was killed.
fn sweep(folder: &Path) -> Result<(), DiskError> {
    let list = |e| DiskError::io(folder, "list the folder")(e);
    for entry in fs::read_dir(folder).map_err(list)? {
        let entry = entry.map_err(list)?;
        if is_part(&entry.file_name().to_string_lossy()) {
            let path = entry.path();
            fs::remove_file(&path).map_err(DiskError::io(&path, "remove what a killed command left"))?;
        }
    }
    Ok(())
}

/// Removes what was staged.
fn clear(store: &Path) -> Result<(), DiskError> {
    let folder = staged(store);
    match fs::remove_dir_all(&folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed.map_err(DiskError::io(&folder, "remove what was staged")),
    }
}

/// Makes names in a folder last through a power cut, where the system can.
fn sync(folder: &Path) -> Result<(), DiskError> {
    if cfg!(unix) {
        File::open(folder).and_then(|f| f.sync_all()).map_err(DiskError::io(folder, "sync the folder"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::Store;
    use super::*;
    use crate::layers::Layers;

    fn image(value: f32) -> Vec<u8> {
        Layers::new([1, 1]).with("mean", vec![value]).to_bytes().unwrap()
    }

    fn seen(store: &Store) -> Vec<(String, f32)> {
        store
            .reading(|s| {
                let read = |path: &PathBuf| Layers::read(path).unwrap().layers["mean"][0];
                s.files.iter().map(|(slot, path)| (slot.path().display().to_string(), read(path))).collect()
            })
            .unwrap()
    }

    fn two(store: &Store, value: f32) -> Change {
        let mut change = store.change(&|_| ()).unwrap();
        for name in ["a.4.exr", "b.4.exr", "c.4.exr"] {
            change.put(&Path::new("s").join(name), &image(value)).unwrap();
        }
        change
    }

    /// Every state that a kill can leave, one by one: before the decision readers see
    /// the old store, after it the new one, and the next change makes it so. Meanwhile
    /// somebody may restore the old files.
    #[test]
    fn a_change_cut_short_anywhere_is_the_old_store_or_the_new_one() {
        let names = |value: f32| ["s/a.4.exr", "s/b.4.exr", "s/c.4.exr"].map(|n| (n.to_owned(), value)).to_vec();
        for (decided, restored) in [(false, false), (true, false), (true, true)] {
            for moved in 0..=3 {
                let dir = tempfile::tempdir().unwrap();
                let store = Store::new(dir.path());
                two(&store, 1.0).commit().unwrap();
                assert_eq!(seen(&store), names(1.0));
                let mut change = two(&store, 2.0);
                change.remove(Path::new("s/c.4.exr"));
                change.journal.moves.pop();
                if decided {
                    change.decide().unwrap();
                    let staged = staged(dir.path());
                    for (from, to) in &change.journal.moves[..moved.min(2)] {
                        fs::copy(staged.join(from), dir.path().join(to)).unwrap();
                    }
                    if moved == 3 {
                        fs::remove_file(dir.path().join("s/c.4.exr")).unwrap();
                    }
                }
                if restored {
                    for name in ["s/a.4.exr", "s/b.4.exr", "s/c.4.exr"] {
                        fs::write(dir.path().join(name), image(1.0)).unwrap();
                    }
                }
                let stale = [".aogauge-x.part", PLACING].map(|n| dir.path().join(FOLDER).join(n));
                stale.iter().for_each(|part| fs::write(part, "half").unwrap());
                drop(change);
                let expected = if decided { names(2.0)[..2].to_vec() } else { names(1.0) };
                assert_eq!(seen(&store), expected, "decided {decided}, moved {moved}");
                assert_eq!(store.reading(|s| s.interrupted).unwrap(), decided);
                let told = std::cell::Cell::new(None);
                drop(store.change(&|notice| told.set(Some(notice))).unwrap());
                let finished = decided.then_some(Notice::Finished { written: 2, removed: 1 });
                assert_eq!(told.get(), finished, "restored {restored}");
                assert_eq!(seen(&store), expected, "finished");
                assert!(stale.iter().all(|part| !part.exists()), "what a kill left is swept");
                assert!(!journal_path(dir.path()).exists() && !staged(dir.path()).exists());
            }
        }
    }

    #[test]
    fn a_journal_leads_nowhere_else() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::new(&dir.path().join("store"));
        two(&store, 1.0).commit().unwrap();
        for journal in [
            r#"{"moves":[["../../x.exr","s/a.4.exr"]],"removals":[]}"#,
            r#"{"moves":[["0.exr","../a.4.exr"]],"removals":[]}"#,
            r#"{"moves":[["0.exr","/etc/a.4.exr"]],"removals":[]}"#,
            r#"{"moves":[["0.exr","s/post-checkout"]],"removals":[]}"#,
            r#"{"moves":[],"removals":["s/notes.txt"]}"#,
            r#"{"moves":[],"removals":["../victim"]}"#,
            r#"{"moves":[],"removals":[".approval/lock"]}"#,
            "no journal",
        ] {
            fs::write(dir.path().join("victim"), "alive").unwrap();
            fs::write(journal_path(store.folder()), journal).unwrap();
            assert!(store.reading(|_| ()).unwrap_err().to_string().contains("journal"), "{journal}");
            assert!(store.change(&|_| ()).is_err(), "{journal}");
            assert!(dir.path().join("victim").exists());
        }
    }

    /// Version control carries links and modes, so a store may hold any.
    #[cfg(unix)]
    #[test]
    fn nothing_is_written_through_links_and_no_golden_is_a_program() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let begun = |scene: Option<&Path>| {
            let dir = tempfile::tempdir().unwrap();
            let store = Store::new(&dir.path().join("store"));
            two(&store, 1.0).decide().unwrap();
            if let Some(place) = scene {
                fs::create_dir(dir.path().join("elsewhere")).unwrap();
                symlink(dir.path().join("elsewhere"), store.folder().join(place)).unwrap();
            }
            (dir, store)
        };
        let (dir, store) = begun(Some(Path::new("s")));
        let error = store.change(&|_| ()).unwrap_err().to_string();
        assert!(error.contains("this is a link"), "{error}");
        assert_eq!(fs::read_dir(dir.path().join("elsewhere")).unwrap().count(), 0);
        // What is staged is a link to a file of somebody else.
        let (dir, store) = begun(None);
        fs::write(dir.path().join("secret"), image(7.0)).unwrap();
        let first = staged(store.folder()).join("0.exr");
        fs::remove_file(&first).unwrap();
        symlink(dir.path().join("secret"), &first).unwrap();
        assert!(store.change(&|_| ()).unwrap_err().to_string().contains("0.exr"));
        assert!(store.reading(|_| ()).is_err());
        // The folder of the change itself.
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("elsewhere/staged")).unwrap();
        fs::create_dir(dir.path().join("store")).unwrap();
        symlink(dir.path().join("elsewhere"), dir.path().join("store").join(FOLDER)).unwrap();
        assert!(Store::new(&dir.path().join("store")).change(&|_| ()).is_err());
        assert!(dir.path().join("elsewhere/staged").exists(), "nothing was cleared there");
        let (_dir, store) = begun(None);
        let first = staged(store.folder()).join("0.exr");
        fs::set_permissions(&first, fs::Permissions::from_mode(0o755)).unwrap();
        drop(store.change(&|_| ()).unwrap());
        let mode = fs::metadata(store.folder().join("s/a.4.exr")).unwrap().permissions().mode();
        assert_eq!(mode & 0o111, 0, "{mode:o}");
    }

    #[test]
    fn a_change_whose_files_are_gone_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::new(dir.path());
        two(&store, 1.0).commit().unwrap();
        let change = two(&store, 2.0);
        change.decide().unwrap();
        drop(change);
        fs::remove_file(staged(dir.path()).join("1.exr")).unwrap();
        for error in [store.reading(|_| ()).unwrap_err(), store.change(&|_| ()).unwrap_err()] {
            let error = error.to_string();
            assert!(error.contains("1.exr") && error.contains("to give the change up"), "{error}");
        }
        fs::remove_dir_all(dir.path().join(FOLDER)).unwrap();
        assert_eq!(seen(&store)[0].1, 1.0);
    }

    #[test]
    fn a_second_change_waits_and_says_so_after_a_second() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::new(dir.path());
        let first = two(&store, 1.0);
        let said = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            let second = scope.spawn(|| {
                let told = |notice| said.store(notice == Notice::Waiting, std::sync::atomic::Ordering::SeqCst);
                let change = store.change(&told).unwrap();
                drop(change);
                Instant::now()
            });
            std::thread::sleep(PATIENCE + Duration::from_millis(300));
            assert!(said.load(std::sync::atomic::Ordering::SeqCst));
            let let_go = Instant::now();
            first.commit().unwrap();
            assert!(second.join().unwrap() >= let_go);
        });
        assert_eq!(seen(&store).len(), 3);
    }
}
