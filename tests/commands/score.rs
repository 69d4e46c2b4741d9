//! Images of somebody else's renderer, from a kit to a verdict: what a user of `scene export
//! --suite` and `score` sees.
use aogauge::{
    layers::Layers,
    metrics::{Metric, MetricName, regions::Region},
    record::{CaseRecord, Intervals, Record, Shows},
};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::OnceLock,
};

mod frames;
mod measured;
mod self_check;
mod told;
mod wrong;

const SUITE: &str = r#"
name = "kit"
description = "A curtain in an arcade, and a control whose openness varies."
scenes = ["curtain-arcade", "corner"]
rays = [4]
replicates = 4
converged_rays = 512
look_rays = 2
judge = { precision = 0.3, paths = 4, replicates = 8, max_replicates = 32 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "artifact"
metric = "contrast-error"
scenes = ["curtain-arcade"]
max = 50.0
[[gate]]
name = "on the CPU"
metric = "bias"
region = "all"
renderers = ["cpu"]
equals = 0.0
within = 0.01
"#;

fn aogauge(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).args(args).env("NO_COLOR", "1").output().unwrap()
}

fn ok(args: &[&str]) {
    let output = aogauge(args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A kit, a run of the same suite, and an image of the self-check, made once.
fn world() -> &'static Path {
    static WORLD: OnceLock<PathBuf> = OnceLock::new();
    WORLD.get_or_init(|| {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("score");
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let at = |name: &str| folder.join(name).display().to_string();
        fs::write(at("kit.toml"), SUITE).unwrap();
        ok(&["scene", "export", "--suite", &at("kit.toml"), "--out", &at("kit"), "--no-cache"]);
        let page = fs::read_to_string(at("kit/README.md")).unwrap();
        assert!(page.contains("with seeds of their own**, 4 at least: intervals"), "{page}");
        ok(&["run", &at("kit.toml"), "--renderer", "cpu", "--no-cache", "--no-base", "--out", &at("run")]);
        let scene = at("kit/scenes/self-check/self-check.toml");
        ok(&["render", &scene, "--rays", "16", "--replicates", "2", "--out", &at("self-check.exr")]);
        folder
    })
}

/// A folder of images to hand in.
struct Images {
    folder: tempfile::TempDir,
}

impl Images {
    fn new() -> Self {
        Images { folder: tempfile::Builder::new().prefix("mine").tempdir().unwrap() }
    }

    /// The replicates of a case of the run.
    fn of(scene: &str, estimator: &str) -> (Vec<Vec<f32>>, [u32; 2]) {
        let layers = Layers::read(&world().join(format!("run/images/{scene}/{estimator}.cpu.4.exr"))).unwrap();
        let all = (0..4).map(|r| layers.get(&format!("replicate-{r:04}")).unwrap().to_vec()).collect();
        (all, layers.resolution)
    }

    fn exr(&self, name: &str, image: &[f32], size: [u32; 2]) {
        Layers::new(size).with("Y", image.to_vec()).write(&self.folder.path().join(name)).unwrap();
    }

    /// Every case of the run, an image a replicate, changed.
    fn all(&self, change: impl Fn(&str, &[f32], [u32; 2]) -> Vec<f32>) {
        for scene in ["curtain-arcade", "corner"] {
            for estimator in ["classic", "extended"] {
                let (replicates, size) = Self::of(scene, estimator);
                for (r, image) in replicates.iter().enumerate() {
                    self.exr(&format!("{scene}.{estimator}.4.{r:04}.exr"), &change(scene, image, size), size);
                }
            }
        }
    }

    fn self_check(&self, change: impl Fn(&[f32], usize) -> Vec<f32>) {
        let layers = Layers::read(&world().join("self-check.exr")).unwrap();
        let image = layers.get("replicate-0000").unwrap();
        self.exr("self-check.classic.16.exr", &change(image, layers.resolution[0] as usize), layers.resolution);
    }

    fn score(&self, options: &[&str]) -> (i32, String) {
        let kit = world().join("kit").display().to_string();
        let (folder, out) = (self.folder.path().display().to_string(), self.out().display().to_string());
        let output =
            aogauge(&[&["score", &folder, "--kit", &kit, "--out", &out, "--renderer", "mine"], options].concat());
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    }

    fn out(&self) -> PathBuf {
        self.folder.path().with_extension("record")
    }

    fn record(&self) -> Record {
        Record::read(&self.out()).unwrap()
    }
}

impl Drop for Images {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(self.out());
    }
}

fn case<'a>(record: &'a Record, scene: &str, estimator: &str) -> &'a CaseRecord {
    record.cases.iter().find(|c| c.case.scene == scene && c.case.estimator == estimator).unwrap()
}

fn rows_upside_down(image: &[f32], width: usize) -> Vec<f32> {
    image.chunks(width).rev().flatten().copied().collect()
}

fn mirrored(image: &[f32], width: u32) -> Vec<f32> {
    image.chunks(width as usize).flat_map(|row| row.iter().rev().copied()).collect()
}
