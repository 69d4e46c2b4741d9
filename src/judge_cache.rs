//! The judge's images of earlier runs, by content: whatever could change a pixel
//! is part of the name, so what is found is what would be traced again. (All but the
//! system's mathematical library, which the tracer calls for the cones of spot
//! lights alone.)
//!
//! The name is a hash over the program itself (its own executable file: another
//! version, compiler or library makes another), the scene, paths, and seed. Each
//! file holds the replicates in order, with a hash of their pixels; a file that is
//! broken in any way counts as none. The oldest go when all together are larger
//! than a GiB.

use crate::{
    disk::DiskError,
    layers::{Layers, hex, pixel_hash},
    metrics::judge::Pair,
};
use sha2::{Digest, Sha256};
use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    time::SystemTime,
};

/// Bytes that all files may take together.
pub const MOST: u64 = 1 << 30;

/// Attribute with the hash of all pixels.
const PIXELS: &str = "pixels";

/// A folder of judge images.
#[derive(Clone, Debug)]
pub struct JudgeCache {
    folder: PathBuf,
    /// Hash of the program.
    code: String,
}

/// What judge images depend on, beside the program.
#[derive(Clone, Copy, Debug)]
pub struct Key<'a> {
    /// [`Scene::hash`](crate::scenes::Scene::hash).
    pub scene: &'a str,
    /// Paths a pixel in one replicate.
    pub paths: u32,
    /// The judge's seed.
    pub seed: u32,
}

impl JudgeCache {
    /// The cache in the user's cache folder (`$XDG_CACHE_HOME/aogauge/judge` or
    /// `~/.cache/aogauge/judge` on Linux). None where there is no such folder, or
    /// the program cannot read itself.
    pub fn of_user() -> Option<Self> {
        Some(Self::new(Self::folder_of_user()?, program()?))
    }

    /// Where [`Self::of_user`] keeps its files.
    pub fn folder_of_user() -> Option<PathBuf> {
        Some(dirs::cache_dir()?.join("aogauge").join("judge"))
    }

    /// A cache in a folder, for a program known by a hash.
    pub fn new(folder: PathBuf, code: String) -> Self {
        JudgeCache { folder, code }
    }

    /// Where the images of a key are.
    fn path(&self, key: &Key<'_>) -> PathBuf {
        let name = format!("judge 1\n{}\n{}\n{}\n{}\n", self.code, key.scene, key.paths, key.seed);
        self.folder.join(format!("{}.exr", hex(&Sha256::digest(name))))
    }

    /// The replicates that are there, from the first on, each of as many pixels;
    /// none where there is no sound file.
    pub fn load(&self, key: &Key<'_>, resolution: [u32; 2]) -> Vec<Pair> {
        let path = self.path(key);
        let Ok(layers) = Layers::read(&path) else {
            return Vec::new();
        };
        let mut pairs = Vec::new();
        while let (Some(with), Some(without)) = (layers.get(&name(0, pairs.len())), layers.get(&name(1, pairs.len()))) {
            pairs.push(Pair { with: with.to_vec(), without: without.to_vec() });
        }
        let sound = layers.resolution == resolution && layers.attributes.get(PIXELS) == Some(&pixels(&pairs));
        if !sound {
            return Vec::new();
        }
        // Used files live longer; where the clock cannot be set, they do not.
        let _ = fs::File::open(&path).and_then(|f| f.set_modified(SystemTime::now()));
        pairs
    }

    /// Keeps replicates, in place of what there was.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn store(&self, key: &Key<'_>, resolution: [u32; 2], pairs: &[Pair]) -> Result<(), DiskError> {
        let mut layers = Layers::new(resolution);
        for (r, pair) in pairs.iter().enumerate() {
            layers = layers.with(&name(0, r), pair.with.clone()).with(&name(1, r), pair.without.clone());
        }
        layers.attributes.insert(PIXELS.to_owned(), pixels(pairs));
        layers.write(&self.path(key))?;
        self.prune();
        Ok(())
    }

    /// Deletes the oldest files until the rest fits. Another process may do the
    /// same meanwhile, so that a file is gone is no error.
    fn prune(&self) {
        let mut files = files(&self.folder);
        files.sort();
        let mut total: u64 = files.iter().map(|(_, size, _)| size).sum();
        for (_, size, path) in files {
            if total <= MOST {
                return;
            }
            if fs::remove_file(path).is_ok() {
                total -= size;
            }
        }
    }

    /// Where the files are.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

/// The hash of this program's own file; None where it cannot be read.
pub fn program() -> Option<String> {
    let mut program = BufReader::new(fs::File::open(std::env::current_exe().ok()?).ok()?);
    let mut sha = Sha256::new();
    loop {
        let chunk = program.fill_buf().ok()?;
        if chunk.is_empty() {
            break;
        }
        sha.update(chunk);
        let read = chunk.len();
        program.consume(read);
    }
    Some(hex(&sha.finalize()))
}

/// The files of a cache folder: when each was used last, its bytes, its path.
fn files(folder: &Path) -> Vec<(SystemTime, u64, PathBuf)> {
    let exr = |e: &fs::DirEntry| e.path().extension().is_some_and(|x| x == "exr");
    let known = |e: fs::DirEntry| e.metadata().ok().and_then(|m| Some((m.modified().ok()?, m.len(), e.path())));
    fs::read_dir(folder).into_iter().flatten().flatten().filter(exr).filter_map(known).collect()
}

/// How many files a cache folder has, and their bytes.
pub fn usage(folder: &Path) -> (usize, u64) {
    let files = files(folder);
    (files.len(), files.iter().map(|(_, size, _)| size).sum())
}

fn name(side: usize, replicate: usize) -> String {
    format!("{}-{replicate:04}", ["with", "without"][side])
}

fn pixels(pairs: &[Pair]) -> String {
    let all: Vec<f32> = pairs.iter().flat_map(|p| p.with.iter().chain(&p.without)).copied().collect();
    pixel_hash(&all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(n: usize) -> Vec<Pair> {
        let image = |seed: usize| (0..6).map(|i| if i == 4 { f32::NAN } else { (seed * 6 + i) as f32 }).collect();
        (0..n).map(|r| Pair { with: image(2 * r), without: image(2 * r + 1) }).collect()
    }

    #[test]
    fn what_was_stored_is_found_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let cache = JudgeCache::new(folder.path().join("judge"), "code".into());
        let key = Key { scene: "abc", paths: 16, seed: 1 };
        assert!(cache.load(&key, [3, 2]).is_empty());
        assert_eq!(usage(cache.folder()), (0, 0));
        cache.store(&key, [3, 2], &pairs(3)).unwrap();
        let size = fs::metadata(cache.path(&key)).unwrap().len();
        assert_eq!(usage(cache.folder()), (1, size));
        let found = cache.load(&key, [3, 2]);
        assert_eq!(pixels(&found), pixels(&pairs(3)));
        assert!(found[0].with[4].is_nan());
        for other in [Key { scene: "abd", ..key }, Key { paths: 17, ..key }, Key { seed: 2, ..key }] {
            assert!(cache.load(&other, [3, 2]).is_empty(), "{other:?}");
        }
        assert!(JudgeCache::new(folder.path().join("judge"), "other code".into()).load(&key, [3, 2]).is_empty());
        assert!(cache.load(&key, [2, 3]).is_empty());
    }

    #[test]
    fn a_broken_file_counts_as_none() {
        let folder = tempfile::tempdir().unwrap();
        let cache = JudgeCache::new(folder.path().to_owned(), "code".into());
        let key = Key { scene: "abc", paths: 16, seed: 1 };
        cache.store(&key, [3, 2], &pairs(2)).unwrap();
        let path = cache.path(&key);
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        assert!(cache.load(&key, [3, 2]).is_empty());
        // Sound as a file, but other pixels than were stored.
        let mut layers = Layers::new([3, 2]);
        for (r, pair) in pairs(2).into_iter().enumerate() {
            layers = layers.with(&name(0, r), pair.without).with(&name(1, r), pair.with);
        }
        layers.attributes.insert(PIXELS.into(), pixels(&pairs(2)));
        layers.write(&path).unwrap();
        assert!(cache.load(&key, [3, 2]).is_empty());
    }
}
