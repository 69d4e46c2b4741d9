//! Goldens for anybody's `#[test]`.

use super::{Picture, Tolerance};
use crate::{
    disk::DiskError,
    layers::{is_pointer, write_png},
    scenes::check_name,
};
use std::{
    env, fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

/// Accepts images in place of comparing them, where it is `1`, `true` or `yes`.
const BLESS: &str = "AOGAUGE_BLESS";

/// What CI services set: where one of these is set, and neither `false` nor `0`, no
/// image is accepted. GitHub, GitLab, CircleCI, Travis, AppVeyor and others set the
/// first.
pub const CI_VARIABLES: [&str; 10] = [
    "CI",
    "GITHUB_ACTIONS",
    "GITLAB_CI",
    "JENKINS_URL",
    "TEAMCITY_VERSION",
    "TF_BUILD",
    "BUILDKITE",
    "CIRCLECI",
    "BITBUCKET_BUILD_NUMBER",
    "CODEBUILD_BUILD_ID",
];

/// Where goldens lie, where failures go, and whether images are accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Goldens {
    /// The folder of goldens.
    pub folder: PathBuf,
    /// Where a failure leaves its images.
    pub failures: PathBuf,
    /// Whether images are accepted in place of compared.
    pub bless: bool,
    /// The variable that tells that this is CI, where nothing is accepted.
    pub ci: Option<&'static str>,
}

/// What came of an image that may stand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Held {
    /// It keeps the tolerance.
    Held,
    /// It was accepted, and its golden written to this file.
    Blessed(PathBuf),
    /// It was accepted in place of a golden that could not be read.
    Replaced {
        /// The golden's file.
        file: PathBuf,
        /// Why the one before could not be read.
        why: String,
    },
}

/// Why an image may not stand.
#[derive(Debug, thiserror::Error)]
pub enum GoldenError {
    /// The name cannot be a file's.
    #[error("golden: {0}")]
    Name(String),
    /// The variable that accepts images has a value of no meaning.
    #[error("{BLESS} is '{0}': give 1, true or yes to accept images, or 0, false, no or nothing to compare them")]
    Bless(String),
    /// There is no golden, and none is written unasked.
    #[error(
        "golden '{name}': there is no {file}. Look at {test}; if it is right, run the test with {BLESS}=1 and commit the file", file = file.display(), test = test.display()
    )]
    Missing {
        /// The golden.
        name: String,
        /// Its file.
        file: PathBuf,
        /// The image, for looking at.
        test: PathBuf,
    },
    /// Acceptance on CI would make every image right.
    #[error(
        "golden '{name}': {BLESS} is set, but so is {ci}: on CI nothing is accepted. Accept where you can look at the image"
    )]
    Ci {
        /// The golden.
        name: String,
        /// What tells that this is CI.
        ci: &'static str,
    },
    /// The image is not its golden's.
    #[error(
        "golden '{name}': {difference}\n  golden      {golden}\n{files}if the image is right, run the test with {BLESS}=1 and commit the golden", golden = golden.display(), files = listed(files)
    )]
    Differs {
        /// The golden.
        name: String,
        /// How.
        difference: String,
        /// The golden's file.
        golden: PathBuf,
        /// The images that were left for looking at, by what they are.
        files: Vec<(&'static str, PathBuf)>,
    },
    /// A file cannot be read or written.
    #[error("golden '{name}': {source}")]
    Disk {
        /// The golden.
        name: String,
        /// Which and why.
        source: DiskError,
    },
}

fn listed(files: &[(&'static str, PathBuf)]) -> String {
    files.iter().map(|(what, path)| format!("  {what:<11} {}\n", path.display())).collect()
}

/// Panics where an image may not stand for its golden; otherwise as [`check_golden`].
///
/// ```no_run
/// # fn render() -> aogauge::golden::RgbImage { aogauge::golden::RgbImage::new(8, 8) }
/// use aogauge::golden::{Limits, assert_golden};
///
/// #[test]
/// fn the_teapot_looks_as_it_did() {
///     assert_golden("teapot", render(), Limits { flip: 0.001, ..Limits::default() });
/// }
/// ```
///
/// # Panics
/// Where [`check_golden`] is an error, with its message.
#[track_caller]
pub fn assert_golden(name: &str, picture: impl Into<Picture>, tolerance: impl Into<Tolerance>) {
    match check_golden(name, picture, tolerance) {
        Ok(Held::Held | Held::Blessed(_)) => {}
        // Not by `eprintln!`: of tests that pass, what that prints is not shown. Where
        // standard error is closed, nobody reads it.
        Ok(Held::Replaced { why, .. }) => {
            let _ = writeln!(io::stderr(), "golden '{name}': what could not be read is replaced: {why}");
        }
        // An assertion is there to panic.
        #[allow(clippy::panic)]
        Err(e) => panic!("{e}"),
    }
}

/// Holds an image against the golden of this name: `tests/goldens/NAME.png` of the
/// package under test, or `NAME.exr` for floats and samples.
///
/// With `AOGAUGE_BLESS=1` the image is accepted: its golden is written where the image
/// may not stand for the one there is, or that one cannot be read. On CI that is
/// refused, and so is it in place of a Git LFS pointer: whether the golden it stands for
/// still holds nobody knows. Nothing else writes a golden. A failure leaves the image, the golden and a picture of the difference in
/// the target folder, `golden-failures/NAME.*`.
///
/// `AOGAUGE_GOLDENS` names another folder of goldens, `AOGAUGE_FAILURES` another for
/// failures.
///
/// # Errors
/// [`GoldenError`], which says what differs and names the files.
pub fn check_golden(
    name: &str,
    picture: impl Into<Picture>,
    tolerance: impl Into<Tolerance>,
) -> Result<Held, GoldenError> {
    Goldens::of_package()?.check(name, &picture.into(), &tolerance.into())
}

impl Goldens {
    /// By the environment that `cargo test` gives.
    ///
    /// # Errors
    /// [`GoldenError::Bless`].
    pub fn of_package() -> Result<Self, GoldenError> {
        let set = |name: &str| env::var_os(name).filter(|v| !v.is_empty());
        let package = set("CARGO_MANIFEST_DIR").map_or_else(PathBuf::new, PathBuf::from);
        Ok(Goldens {
            folder: set("AOGAUGE_GOLDENS").map_or_else(|| package.join("tests").join("goldens"), PathBuf::from),
            failures: set("AOGAUGE_FAILURES").map_or_else(|| target().join("golden-failures"), PathBuf::from),
            bless: is_on(&set(BLESS).unwrap_or_default().to_string_lossy())?,
            ci: CI_VARIABLES.into_iter().find(|name| set(name).is_some_and(|v| v != "false" && v != "0")),
        })
    }

    /// As [`check_golden`], in these folders.
    ///
    /// # Errors
    /// See [`check_golden`].
    pub fn check(&self, name: &str, picture: &Picture, tolerance: &Tolerance) -> Result<Held, GoldenError> {
        check_name(name).map_err(GoldenError::Name)?;
        if let (true, Some(ci)) = (self.bless, self.ci) {
            return Err(GoldenError::Ci { name: name.to_owned(), ci });
        }
        let disk = |source| GoldenError::Disk { name: name.to_owned(), source };
        let file = picture.path(&self.folder, name);
        if !file.exists() {
            if self.bless {
                picture.write(&file).map_err(disk)?;
                return Ok(Held::Blessed(file));
            }
            let test = self.leave(name, "test", picture).map_err(disk)?;
            return Err(GoldenError::Missing { name: name.to_owned(), file, test });
        }
        let golden = match picture.read_alike(&file) {
            Ok(golden) => golden,
            // What is broken can be replaced, where that is asked for.
            Err(e) if self.bless && !is_pointer(&file) => {
                picture.write(&file).map_err(disk)?;
                return Ok(Held::Replaced { file, why: e.to_string() });
            }
            Err(e) => return Err(disk(e)),
        };
        let difference = match picture.differs(&golden, tolerance) {
            Ok(None) => return Ok(Held::Held),
            Ok(Some(difference)) | Err(difference) => difference,
        };
        if self.bless {
            picture.write(&file).map_err(disk)?;
            return Ok(Held::Blessed(file));
        }
        let mut files = vec![("test", self.leave(name, "test", picture).map_err(disk)?)];
        files.push(("golden", self.leave(name, "golden", &golden).map_err(disk)?));
        if let Ok(map) = picture.difference(&golden) {
            let path = self.failures.join(format!("{name}.difference.png"));
            write_png(&path, &map).map_err(disk)?;
            files.push(("difference", path));
        }
        Err(GoldenError::Differs { name: name.to_owned(), difference, golden: file, files })
    }

    /// Writes an image for looking at, and beside floats a PNG of them. Returns the
    /// image's file.
    fn leave(&self, name: &str, what: &str, picture: &Picture) -> Result<PathBuf, DiskError> {
        let path = picture.path(&self.failures, &format!("{name}.{what}"));
        picture.write(&path)?;
        if !matches!(picture, Picture::Rgb(_)) {
            picture.write_preview(&path.with_extension("png"))?;
        }
        Ok(path)
    }
}

/// Reads [`BLESS`].
fn is_on(value: &str) -> Result<bool, GoldenError> {
    match value.to_ascii_lowercase().as_str() {
        "1" | "true" | "yes" => Ok(true),
        "" | "0" | "false" | "no" => Ok(false),
        _ => Err(GoldenError::Bless(value.to_owned())),
    }
}

/// The folder that Cargo builds in: tests lie in its `deps`.
fn target() -> PathBuf {
    let exe = env::current_exe().unwrap_or_default();
    let deps = exe.ancestors().find(|a| a.file_name().is_some_and(|n| n == "deps"));
    let profile = deps.and_then(Path::parent).map(Path::to_owned);
    profile.filter(|p| fs::metadata(p).is_ok()).unwrap_or_else(env::temp_dir)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::{Limits, RgbImage, Sampled};
    use crate::metrics::image::{Encoding, Image};

    fn goldens(folder: &Path) -> Goldens {
        Goldens { folder: folder.join("goldens"), failures: folder.join("failures"), bless: false, ci: None }
    }

    fn picture(red: u8) -> Picture {
        RgbImage::from_fn(24, 16, |x, y| image::Rgb([if x == 5 && y == 3 { red } else { 90 }, x as u8 * 5, 0])).into()
    }

    #[test]
    fn nothing_is_written_unless_blessed_and_nothing_is_blessed_on_ci() {
        let dir = tempfile::tempdir().unwrap();
        let plain = goldens(dir.path());
        let error = plain.check("a", &picture(90), &Tolerance::Exact).unwrap_err().to_string();
        assert!(error.contains("AOGAUGE_BLESS=1") && error.contains("a.png"), "{error}");
        assert!(!plain.folder.exists(), "a missing golden is never created");

        let bless = Goldens { bless: true, ..plain.clone() };
        let ci = Goldens { ci: Some("GITHUB_ACTIONS"), ..bless.clone() };
        let error = ci.check("a", &picture(90), &Tolerance::Exact).unwrap_err().to_string();
        assert!(error.contains("GITHUB_ACTIONS") && !plain.folder.exists(), "{error}");

        let file = plain.folder.join("a.png");
        assert_eq!(bless.check("a", &picture(90), &Tolerance::Exact).unwrap(), Held::Blessed(file.clone()));
        assert_eq!(plain.check("a", &picture(90), &Tolerance::Exact).unwrap(), Held::Held);
        assert_eq!(bless.check("a", &picture(90), &Tolerance::Exact).unwrap(), Held::Held, "held is not rewritten");

        let error = plain.check("a", &picture(255), &Tolerance::Exact).unwrap_err();
        let GoldenError::Differs { files, difference, .. } = &error else { panic!("{error}") };
        assert!(difference.contains("1 of 384 pixels differ, the first at 5,3"), "{difference}");
        for (what, path) in files {
            assert!(path.exists() && error.to_string().contains(path.to_str().unwrap()), "{what}");
        }
        assert_eq!(files.len(), 3);
        assert_eq!(
            plain.check("a", &picture(255), &"flip=1,flip-max=1,ssim=-1".parse::<Limits>().unwrap().into()).unwrap(),
            Held::Held
        );
        assert!(plain.check("a", &picture(255), &Limits::default().into()).is_err());
        let small = RgbImage::new(2, 2).into();
        let error = plain.check("a", &small, &Tolerance::Exact).unwrap_err().to_string();
        assert!(error.contains("24 x 16") && error.contains("2 x 2"), "{error}");

        fs::write(&file, "version https://git-lfs.github.com/spec/v1\n").unwrap();
        let error = plain.check("a", &picture(90), &Tolerance::Exact).unwrap_err().to_string();
        assert!(error.contains("git lfs pull"), "{error}");
        let error = bless.check("a", &picture(90), &Tolerance::Exact).unwrap_err().to_string();
        assert!(error.contains("git lfs pull"), "{error}");
        assert!(fs::read(&file).unwrap().starts_with(b"version"), "the pointer stays");
        fs::write(&file, "broken").unwrap();
        assert!(plain.check("a", &picture(90), &Tolerance::Exact).is_err());
        let Held::Replaced { why, .. } = bless.check("a", &picture(90), &Tolerance::Exact).unwrap() else { panic!() };
        assert!(why.contains("a.png"), "{why}");
        assert_eq!(plain.check("a", &picture(90), &Tolerance::Exact).unwrap(), Held::Held);
        for bad in ["", "../a", "a/b"] {
            assert!(matches!(bless.check(bad, &picture(0), &Tolerance::Exact), Err(GoldenError::Name(_))));
        }
    }

    #[test]
    fn floats_are_kept_to_the_last_bit() {
        let dir = tempfile::tempdir().unwrap();
        let plain = goldens(dir.path());
        let bless = Goldens { bless: true, ..plain.clone() };
        for planes in [1, 3] {
            let plane: Vec<f32> = (0..16 * 16).map(|i| (i as f32).sqrt() / 20.0).collect();
            let image = |change: f32| -> Picture {
                let mut all = vec![plane.clone(); planes];
                all[planes - 1][7] += change;
                Image::new([16, 16], all, Encoding::Linear).unwrap().into()
            };
            let name = format!("planes-{planes}");
            bless.check(&name, &image(0.0), &Tolerance::Exact).unwrap();
            assert_eq!(plain.check(&name, &image(0.0), &Tolerance::Exact).unwrap(), Held::Held);
            let error = plain.check(&name, &image(1e-6), &Tolerance::Exact).unwrap_err().to_string();
            assert!(error.contains("1 of 256 pixels") && error.contains("difference"), "{error}");
            let largest = |max: f64| Limits { max: Some(max), ..Limits::default() }.into();
            assert_eq!(plain.check(&name, &image(1e-3), &largest(0.01)).unwrap(), Held::Held);
            assert!(plain.check(&name, &image(1e-3), &largest(1e-5)).is_err());
            assert!(plain.check(&name, &image(f32::NAN), &largest(1.0)).unwrap_err().to_string().contains("NaN"));
        }
    }

    /// Replicates of uniform noise of a mean.
    fn sample(seed: u32, mean: f32) -> Picture {
        let replicates: Vec<Vec<f32>> = (0..8)
            .map(|r| {
                let sampler = |i| crate::render::sampler::Sampler::new(seed, i, r);
                (0..48 * 32).map(|i| mean + 0.2 * (sampler(i).pair(0, 0)[0] - 0.5)).collect()
            })
            .collect();
        let images: Vec<&[f32]> = replicates.iter().map(Vec::as_slice).collect();
        Sampled::of_replicates([48, 32], &images).into()
    }

    #[test]
    fn samples_may_be_others_of_the_same_expectation() {
        let dir = tempfile::tempdir().unwrap();
        let plain = goldens(dir.path());
        let tolerance = Tolerance::Sampled { alpha: 0.01 };
        Goldens { bless: true, ..plain.clone() }.check("s", &sample(1, 0.5), &tolerance).unwrap();
        assert_eq!(plain.check("s", &sample(1, 0.5), &Tolerance::Exact).unwrap(), Held::Held);
        for seed in 2..6 {
            assert_eq!(plain.check("s", &sample(seed, 0.5), &tolerance).unwrap(), Held::Held);
        }
        let error = plain.check("s", &sample(9, 0.52), &tolerance).unwrap_err().to_string();
        assert!(error.contains("shift: brighter"), "{error}");
        assert!(plain.failures.join("s.difference.png").exists() && plain.failures.join("s.test.png").exists());
        let error = plain.check("s", &picture(1), &tolerance).unwrap_err().to_string();
        assert!(error.contains("there is no"), "colours have a golden of their own: {error}");
        let error = plain.check("s", &sample(2, 0.5), &Tolerance::Sampled { alpha: 2.0 }).unwrap_err().to_string();
        assert!(error.contains("alpha is 2"), "{error}");
    }
}
