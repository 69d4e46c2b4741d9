//! The files of a folder, as images of cases.

use super::{
    IntakeError,
    name::{Name, Shown, parse},
};
use crate::counted::counted;
use crate::{disk::DiskError, picture::read::has_image_extension, untrusted};
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// A folder may hold so many entries, its own folders' among them.
const MOST: usize = 100_000;
/// Names of files in one warning.
const NAMED: usize = 10;
/// Characters of one of them.
const LONG: usize = 120;

/// What images are whose names do not say it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Defaults {
    /// Their estimator; names may say it too, whether or not the kit knows it.
    pub estimator: Option<String>,
    /// Their rays a pixel.
    pub rays: Option<u32>,
    /// A scene whose images need neither.
    pub free: Option<String>,
}

/// What was handed in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Files {
    /// Images by case, in the order of scenes' names, estimators and rays.
    pub cases: Vec<Handed>,
    /// What whoever handed them in should know, one sentence each: files that are not
    /// taken, numbers that are missing.
    pub warnings: Vec<String>,
    /// Images that are not taken, because their names do not say what they are.
    pub not_taken: usize,
}

/// The images of one case: a scene, an estimator and a number of rays.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Handed {
    /// A scene of the kit.
    pub scene: String,
    /// Its estimator: one of the kit's or the default.
    pub estimator: String,
    /// Rays a pixel, above 0.
    pub rays: u32,
    /// Images, by replicate. One without a number is alone. All are alike in what they show:
    /// openness, pairs with and without AO, or frames alone.
    pub images: Vec<HandedImage>,
}

/// One image, or a pair of whole frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HandedImage {
    /// Its number, where its name has one.
    pub replicate: Option<u32>,
    /// What it shows; of a pair the first, [`Shown::With`].
    pub shown: Shown,
    /// The file.
    pub path: PathBuf,
    /// The frame without AO of a pair.
    pub without: Option<PathBuf>,
}

/// Finds the images of a folder by their names, and those of its folders that are called like
/// a scene. `scenes` and `estimators` are the kit's.
///
/// `SCENE.ESTIMATOR.RAYS.REPLICATE.EXT`, of which all but SCENE may be missing from the right; `SCENE/` may stand
/// for `SCENE.`; `.with`, `.without` or `.frame` may stand before the extension, in which upper
/// and lower case are the same. What names do not say is taken from `defaults`. Files that are no images are passed over; images whose
/// names cannot be read are named in a warning. Nothing is opened.
///
/// # Errors
/// [`IntakeError::Disk`] where a folder cannot be read; [`IntakeError::Files`] where two files
/// are the same image, one lacks its number beside others, a frame lacks its other half, or
/// the folder has more than 100,000 entries.
pub fn files(folder: &Path, scenes: &[&str], estimators: &[&str], defaults: &Defaults) -> Result<Files, IntakeError> {
    let known: Vec<&str> = estimators.iter().copied().chain(defaults.estimator.as_deref()).collect();
    let mut intake = Intake { folder, scenes, estimators: &known, defaults, ..Intake::new(folder) };
    let mut entries = 0;
    for path in listed(folder, &mut entries)? {
        if !path.is_dir() {
            intake.take(&path, None);
            continue;
        }
        match file_name(&path).and_then(|name| scenes.iter().find(|s| **s == name)) {
            Some(scene) => {
                for file in listed(&path, &mut entries)?.iter().filter(|p| !p.is_dir()) {
                    intake.take(file, Some(scene));
                }
            }
            None => intake.other_folders.push(path),
        }
    }
    intake.finish()
}

/// The entries of a folder, by name.
fn listed(folder: &Path, entries: &mut usize) -> Result<Vec<PathBuf>, IntakeError> {
    let action = "list the folder";
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(DiskError::io(folder, action))? {
        *entries += 1;
        if *entries > MOST {
            let what = format!("it has more than {MOST} entries");
            return Err(IntakeError::Files { folder: folder.to_owned(), what });
        }
        paths.push(entry.map_err(DiskError::io(folder, action))?.path());
    }
    paths.sort();
    Ok(paths)
}

fn file_name(path: &Path) -> Option<&str> {
    path.file_name().and_then(|n| n.to_str())
}

/// A path below the folder as it may be shown.
fn shown(path: &Path, folder: &Path) -> String {
    let name = path.strip_prefix(folder).unwrap_or(path).display().to_string();
    untrusted::cut(&untrusted::line(&name), LONG).into_owned()
}

type CaseKey = (String, String, u32);

/// Files by what they are.
struct Intake<'a> {
    folder: &'a Path,
    scenes: &'a [&'a str],
    estimators: &'a [&'a str],
    defaults: &'a Defaults,
    found: BTreeMap<CaseKey, BTreeMap<(Option<u32>, Shown), PathBuf>>,
    /// Images that are not taken, by why.
    unknown: BTreeMap<String, Vec<PathBuf>>,
    other_folders: Vec<PathBuf>,
    twice: Option<[PathBuf; 2]>,
}

impl<'a> Intake<'a> {
    fn new(folder: &'a Path) -> Self {
        const NOTHING: &Defaults = &Defaults { estimator: None, rays: None, free: None };
        Intake {
            folder,
            scenes: &[],
            estimators: &[],
            defaults: NOTHING,
            found: BTreeMap::new(),
            unknown: BTreeMap::new(),
            other_folders: Vec::new(),
            twice: None,
        }
    }

    fn take(&mut self, path: &Path, scene: Option<&str>) {
        if !has_image_extension(path) || file_name(path).is_some_and(|n| n.starts_with('.')) {
            return;
        }
        let name = match path.file_stem().and_then(|s| s.to_str()) {
            Some(stem) => parse(stem, scene, self.scenes, self.estimators),
            None => Err("has a name that is no Unicode".to_owned()),
        };
        match name.and_then(|name| self.key(name)) {
            Ok((case, image)) => {
                let before = self.found.entry(case).or_default().insert(image, path.to_owned());
                if let Some(before) = before {
                    self.twice.get_or_insert([before, path.to_owned()]);
                }
            }
            Err(why) => self.unknown.entry(why).or_default().push(path.to_owned()),
        }
    }

    fn key(&self, name: Name) -> Result<(CaseKey, (Option<u32>, Shown)), String> {
        let is_free = self.defaults.free.as_ref() == Some(&name.scene);
        let estimator = name.estimator.or_else(|| self.defaults.estimator.clone());
        let estimator = estimator.or_else(|| is_free.then(|| "any".to_owned()));
        let estimator = estimator.ok_or("names no estimator, and none is declared: `estimator`")?;
        let rays = name.rays.or(self.defaults.rays).or(is_free.then_some(1)).filter(|r| *r > 0);
        let rays = rays.ok_or("names no number of rays, and none is declared: `rays`")?;
        Ok(((name.scene, estimator, rays), (name.replicate, name.shown)))
    }

    fn finish(self) -> Result<Files, IntakeError> {
        let wrong = |what: String| IntakeError::Files { folder: self.folder.to_owned(), what };
        if let Some([a, b]) = &self.twice {
            let [a, b] = [a, b].map(|p| shown(p, self.folder));
            return Err(wrong(format!("'{a}' and '{b}' are the same image: keep one of them")));
        }
        let mut files = Files::default();
        let mut spans = Spans::default();
        for ((scene, estimator, rays), images) in self.found {
            let title = format!("{scene}, {estimator}, {}", counted(rays, "ray", "rays"));
            let images = paired(images).map_err(|what| wrong(format!("{title}: {what}")))?;
            let handed = Handed { scene, estimator, rays, images };
            spans.add(&handed);
            files.cases.push(handed);
        }
        let misnamed: Vec<&str> = self.unknown.values().flatten().filter_map(|p| file_name(p)).collect();
        for handed in &files.cases {
            let Handed { scene, estimator, rays, .. } = handed;
            let what = missing(handed, &spans, &misnamed);
            files
                .warnings
                .extend(what.map(|what| format!("{scene}, {estimator}, {}: {what}", counted(*rays, "ray", "rays"))));
        }
        let names = |paths: &[PathBuf]| {
            let mut names: Vec<String> =
                paths.iter().take(NAMED).map(|p| format!("'{}'", shown(p, self.folder))).collect();
            if paths.len() > NAMED {
                names.push(format!("and {} more", paths.len() - NAMED));
            }
            names.join(", ")
        };
        files.not_taken = self.unknown.values().map(Vec::len).sum();
        for (why, paths) in &self.unknown {
            let why = untrusted::line(why);
            files.warnings.push(format!(
                "not taken, because the name {}: {}",
                untrusted::cut(&why, LONG),
                names(paths)
            ));
        }
        if !self.other_folders.is_empty() {
            let names = names(&self.other_folders);
            files.warnings.push(format!("folders that are called like no scene are not looked into: {names}"));
        }
        Ok(files)
    }
}

/// Images of a case: frames with AO are paired with those without.
fn paired(mut files: BTreeMap<(Option<u32>, Shown), PathBuf>) -> Result<Vec<HandedImage>, String> {
    let number = |r: Option<u32>| r.map_or("the image without a number".to_owned(), |r| format!("replicate {r}"));
    let keys: Vec<(Option<u32>, Shown)> = files.keys().copied().collect();
    if let (Some((None, _)), Some((Some(r), _))) = (keys.first(), keys.last()) {
        return Err(format!("one image has no number of a replicate beside replicate {r}: give it one"));
    }
    let kind = |shown: Shown| if shown == Shown::Without { Shown::With } else { shown };
    if let Some(other) = keys.iter().map(|k| kind(k.1)).find(|k| *k != kind(keys[0].1)) {
        let first = kind(keys[0].1);
        return Err(format!("images that show {} and {} cannot be one case", first.label(), other.label()));
    }
    let mut images = Vec::new();
    for (replicate, shown) in keys {
        let Some(path) = files.remove(&(replicate, shown)) else { continue };
        let without = match shown {
            Shown::Without => return Err(format!("{} has a frame without AO but none with it", number(replicate))),
            Shown::With => Some(
                files
                    .remove(&(replicate, Shown::Without))
                    .ok_or_else(|| format!("{} has a frame with AO but none without it", number(replicate)))?,
            ),
            Shown::Openness | Shown::Frame => None,
        };
        images.push(HandedImage { replicate, shown, path, without });
    }
    Ok(images)
}

/// The least and the greatest number of a replicate that cases of an estimator and a ray count have.
#[derive(Default)]
struct Spans(BTreeMap<(String, u32), [u32; 2]>);

impl Spans {
    fn add(&mut self, handed: &Handed) {
        for number in handed.images.iter().filter_map(|i| i.replicate) {
            let key = (handed.estimator.clone(), handed.rays);
            let span = self.0.entry(key).or_insert([number; 2]);
            *span = [span[0].min(number), span[1].max(number)];
        }
    }
}

/// Which numbers of replicates are not there: between the first and the last, before the first where other scenes have
/// those, and where an image of the scene was not taken, so that its name may be wrong, as far as other scenes go and from 0.
fn missing(handed: &Handed, spans: &Spans, misnamed: &[&str]) -> Option<String> {
    let numbers: Vec<u32> = handed.images.iter().filter_map(|i| i.replicate).collect();
    let (mut first, mut last) = (*numbers.first()?, *numbers.last()?);
    if let Some([least, most]) = spans.0.get(&(handed.estimator.clone(), handed.rays)) {
        let is_misnamed = misnamed.iter().any(|name| is_nearly_of(name, &handed.scene));
        first = first.min(*least);
        if is_misnamed {
            (first, last) = (if first == 1 { 0 } else { first }, *most);
        }
    }
    let lacking = u64::from(last - first) + 1 - numbers.len() as u64;
    let gap = numbers.windows(2).find(|n| n[1] - n[0] > 1).map(|n| n[0] + 1);
    let gap = if numbers[0] > first { first } else { gap.or_else(|| numbers.last().map(|n| n + 1))? };
    (lacking > 0).then(|| format!("{lacking} of the replicates {first} to {last} are missing, the first is {gap}"))
}

/// Whether a name begins like a scene, whatever its case and the strokes in it.
fn is_nearly_of(name: &str, scene: &str) -> bool {
    let plain = |text: &str| text.replace(['_', ' '], "-").to_ascii_lowercase();
    plain(name).starts_with(&plain(scene))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    const SCENES: [&str; 2] = ["curtain", "curtain.open"];
    const ESTIMATORS: [&str; 2] = ["classic", "extended"];

    fn folder(names: &[&str]) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    fn found(names: &[&str], defaults: &Defaults) -> Result<Files, String> {
        let folder = folder(names);
        files(folder.path(), &SCENES, &ESTIMATORS, defaults).map_err(|e| e.to_string())
    }

    fn plain(names: &[&str]) -> Result<Files, String> {
        found(names, &Defaults::default())
    }

    #[test]
    fn names_become_cases() {
        let names = [
            "curtain.classic.4.0001.exr",
            "curtain.classic.4.0000.EXR",
            "curtain.open.extended.16.png",
            "curtain/extended.16.tiff",
            "curtain/curtain.classic.8.jpg",
            "score.toml",
            "README.md",
            ".curtain.classic.4.0002.exr",
        ];
        let files = plain(&names).unwrap();
        assert_eq!(files.warnings, [""; 0]);
        let cases: Vec<(&str, &str, u32, Vec<Option<u32>>)> = files
            .cases
            .iter()
            .map(|c| (c.scene.as_str(), c.estimator.as_str(), c.rays, c.images.iter().map(|i| i.replicate).collect()))
            .collect();
        let expected = [
            ("curtain", "classic", 4, vec![Some(0), Some(1)]),
            ("curtain", "classic", 8, vec![None]),
            ("curtain", "extended", 16, vec![None]),
            ("curtain.open", "extended", 16, vec![None]),
        ];
        assert_eq!(cases, expected);
        assert!(files.cases[0].images[0].path.ends_with("curtain.classic.4.0000.EXR"));
    }

    #[test]
    fn what_names_leave_out_is_declared() {
        let defaults = Defaults { estimator: Some("my.ao".into()), rays: Some(4), free: None };
        let names = ["curtain.exr", "curtain.open.my.ao.8.exr", "curtain.open.extended.exr"];
        let files = found(&names, &defaults).unwrap();
        let cases: Vec<(&str, u32)> = files.cases.iter().map(|c| (c.estimator.as_str(), c.rays)).collect();
        assert_eq!((cases, files.warnings.len()), (vec![("my.ao", 4), ("extended", 4), ("my.ao", 8)], 0));
        let free = Defaults { free: Some("curtain".into()), ..Defaults::default() };
        assert_eq!(found(&["curtain.exr"], &free).unwrap().cases[0].rays, 1);
        assert_eq!(found(&["curtain.open.exr"], &free).unwrap().not_taken, 1);
        let warnings = plain(&["curtain.exr", "curtain.classic.exr"]).unwrap().warnings;
        assert!(warnings.iter().any(|w| w.contains("`estimator`") && w.contains("'curtain.exr'")), "{warnings:?}");
        assert!(warnings.iter().any(|w| w.contains("`rays`") && w.contains("'curtain.classic.exr'")), "{warnings:?}");
    }

    #[test]
    fn frames_are_paired() {
        let names =
            ["curtain.classic.4.0.with.png", "curtain.classic.4.0.without.png", "curtain.open.classic.4.frame.png"];
        let files = plain(&names).unwrap();
        let [pair, frame] = [&files.cases[0].images[0], &files.cases[1].images[0]];
        assert_eq!((pair.shown, frame.shown, frame.without.is_none()), (Shown::With, Shown::Frame, true));
        assert!(pair.without.as_ref().unwrap().ends_with("curtain.classic.4.0.without.png"));
        assert!(plain(&names[..1]).unwrap_err().contains("replicate 0 has a frame with AO but none without it"));
        assert!(plain(&names[1..2]).unwrap_err().contains("without AO but none with it"));
        let mixed = ["curtain.classic.4.0.with.png", "curtain.classic.4.0.without.png", "curtain.classic.4.1.png"];
        assert!(plain(&mixed).unwrap_err().contains("show with and openness"));
    }

    #[test]
    fn contradictions_are_errors_and_gaps_warnings() {
        for twice in [
            ["curtain.classic.4.3.exr", "curtain.classic.4.0003.exr"],
            ["curtain.classic.4.3.exr", "curtain.classic.4.3.png"],
            ["curtain/classic.4.3.exr", "curtain.classic.4.3.exr"],
        ] {
            assert!(plain(&twice).unwrap_err().contains("are the same image"), "{twice:?}");
        }
        let error = plain(&["curtain.classic.4.exr", "curtain.classic.4.0003.exr"]).unwrap_err();
        assert!(error.contains("no number of a replicate beside replicate 3"), "{error}");
        let gaps = ["curtain.classic.4.1.exr", "curtain.classic.4.2.exr", "curtain.classic.4.4294967295.exr"];
        let warnings = plain(&gaps).unwrap().warnings;
        assert!(warnings[0].contains("4294967292 of the replicates 1 to 4294967295 are missing"), "{warnings:?}");
        assert!(warnings[0].ends_with("the first is 3"), "{warnings:?}");
    }

    /// A slip in the name of the first or last image leaves no gap between the others.
    #[test]
    fn replicates_that_are_missing_at_an_end_are_named() {
        let all = |scene: &str, numbers: std::ops::Range<u32>| {
            numbers.map(|n| format!("{scene}.classic.4.{n:04}.exr")).collect::<Vec<_>>()
        };
        let told = |names: &[Vec<String>]| {
            let names: Vec<&str> = names.iter().flatten().map(String::as_str).collect();
            plain(&names).unwrap().warnings.into_iter().filter(|w| w.contains("missing")).collect::<Vec<_>>()
        };
        let misnamed = |name: &str| vec![name.to_owned()];
        let says = "curtain, classic, 4 rays: 1 of the replicates 0 to 7 are missing, the first is 0";
        assert_eq!(told(&[all("curtain", 1..8), misnamed("Curtain.classic.4.0000.exr")]), [says]);
        assert_eq!(told(&[all("curtain", 1..8), misnamed("curtain.classic.four.0000.exr")]), [says]);
        assert_eq!(told(&[all("curtain", 1..8), all("curtain.open", 0..8)]), [says]);
        let says = "curtain.open, classic, 4 rays: 1 of the replicates 0 to 7 are missing, the first is 7";
        let last = misnamed("curtain.Open.classic.4.0007.exr");
        assert_eq!(told(&[all("curtain", 0..8), all("curtain.open", 0..7), last]), [says]);
        // Whoever counts from 1, or has fewer of some scene, has made no slip.
        assert_eq!(told(&[all("curtain", 1..9), all("curtain.open", 1..9)]), [""; 0]);
        assert_eq!(told(&[all("curtain", 0..8), all("curtain.open", 0..4)]), [""; 0]);
        assert_eq!(told(&[all("curtain", 1..9), misnamed("room.classic.4.0000.exr")]), [""; 0]);
    }

    #[test]
    fn what_is_not_taken_is_named() {
        let many: Vec<String> = (0..25).map(|i| format!("curtain.typo.{i}.exr")).collect();
        let mut names: Vec<&str> = many.iter().map(String::as_str).collect();
        names.extend(["room.classic.4.exr", "old/curtain.classic.4.exr", "a\u{202e}b\nc.exr"]);
        let warnings = plain(&names).unwrap().warnings;
        let has = |part: &str| warnings.iter().any(|w| w.contains(part));
        assert!(has("names no estimator where it says 'typo'") && has("and 15 more"), "{warnings:?}");
        assert!(has("'room.classic.4.exr'") && has("'old'") && has("'ab c.exr'"), "{warnings:?}");
        assert!(warnings.iter().all(|w| !w.contains('\n') && w.len() < 2000));
    }

    #[cfg(unix)]
    #[test]
    fn hostile_names_do_no_harm() {
        use std::{ffi::OsStr, os::unix::ffi::OsStrExt};
        let folder = folder(&["curtain..classic.4.exr", "..exr", "curtain.classic.4...exr"]);
        fs::write(folder.path().join(OsStr::from_bytes(b"curtain.\xff.4.exr")), "").unwrap();
        fs::write(folder.path().join("é".repeat(100) + ".exr"), "").unwrap();
        std::os::unix::fs::symlink(".", folder.path().join("curtain")).unwrap();
        let files = files(folder.path(), &SCENES, &ESTIMATORS, &Defaults::default()).unwrap();
        assert!(files.cases.is_empty());
        assert!(files.warnings.iter().any(|w| w.contains("no Unicode")), "{:?}", files.warnings);
        assert!(super::files(&folder.path().join("none"), &SCENES, &ESTIMATORS, &Defaults::default()).is_err());
    }
}
