//! Golden assertions in somebody's tests, under every environment they may meet.

use aogauge::golden::{GoldenError, Goldens, Held, Picture, Sampled, Tolerance};
use std::process::Command;

/// Not a test of its own: an assertion in somebody's test, run by the one below.
#[test]
#[ignore = "run by `assertions_obey_the_environment`"]
fn somebodys_assertion() {
    let red = std::env::var("RED").unwrap().parse().unwrap();
    let image = aogauge::golden::RgbImage::from_pixel(8, 8, [red, 0, 0].into());
    aogauge::golden::assert_golden("somebodys", image, Tolerance::Exact);
}

#[test]
fn assertions_obey_the_environment() {
    let dir = tempfile::tempdir().unwrap();
    let (goldens, failures) = (dir.path().join("goldens"), dir.path().join("failures"));
    let assertion = |red: &str, more: &[(&str, &str)]| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--ignored", "--exact", "golden_assert::somebodys_assertion", "--nocapture"]);
        for name in aogauge::golden::CI_VARIABLES.iter().chain(&["AOGAUGE_BLESS"]) {
            command.env_remove(name);
        }
        command.env("RED", red).env("AOGAUGE_GOLDENS", &goldens).env("AOGAUGE_FAILURES", &failures);
        let output = command.envs(more.iter().copied()).output().unwrap();
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let bless = ("AOGAUGE_BLESS", "1");
    for (more, says) in [
        (&[][..], "run the test with AOGAUGE_BLESS=1 and commit"),
        (&[("AOGAUGE_BLESS", "0")], "run the test with AOGAUGE_BLESS=1 and commit"),
        (&[("AOGAUGE_BLESS", "False")], "run the test with AOGAUGE_BLESS=1 and commit"),
        (&[("AOGAUGE_BLESS", "")], "run the test with AOGAUGE_BLESS=1 and commit"),
        (&[("AOGAUGE_BLESS", "on")], "AOGAUGE_BLESS is 'on': give 1, true or yes"),
        (&[("AOGAUGE_BLESS", "true"), ("CI", "true")], "AOGAUGE_BLESS is set, but so is CI"),
        (&[bless, ("CI", "true")], "AOGAUGE_BLESS is set, but so is CI"),
        (&[bless, ("GITLAB_CI", "1")], "so is GITLAB_CI"),
    ] {
        let (passed, stderr) = assertion("9", more);
        assert!(!passed && stderr.contains(says), "{more:?}: {stderr}");
        assert!(stderr.contains("tests/runs/golden_assert.rs"), "{more:?}: {stderr}");
        assert!(!goldens.exists(), "{more:?}");
    }
    assert!(assertion("9", &[bless, ("CI", "false")]).0);
    assert!(assertion("9", &[("CI", "true")]).0);
    for on in ["true", "YES"] {
        std::fs::write(goldens.join("somebodys.png"), "broken").unwrap();
        let (passed, stderr) = assertion("9", &[("AOGAUGE_BLESS", on)]);
        assert!(passed && stderr.contains("somebodys.png"), "{stderr}");
        assert!(stderr.contains("what could not be read is replaced"), "{stderr}");
    }
    assert!(assertion("9", &[]).0);
    std::fs::write(goldens.join("somebodys.png"), "version https://git-lfs.github.com/spec/v1\n").unwrap();
    let (passed, stderr) = assertion("9", &[bless]);
    assert!(!passed && stderr.contains("git lfs pull"), "{stderr}");
    std::fs::remove_file(goldens.join("somebodys.png")).unwrap();
    assert!(assertion("9", &[bless]).0);
    let (passed, stderr) = assertion("10", &[]);
    assert!(!passed && stderr.contains("64 of 64 pixels differ"), "{stderr}");
    assert!(failures.join("somebodys.difference.png").exists());
}

/// Replicates of 48 x 32 pixels, noise of a range around one half.
fn noisy(seed: u32, replicates: usize, range: f32) -> Picture {
    let mut x = seed;
    let mut value = || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.5 + range * ((x >> 8) as f32 / 16_777_216.0 - 0.5)
    };
    let images: Vec<Vec<f32>> = (0..replicates).map(|_| (0..48 * 32).map(|_| value()).collect()).collect();
    let images: Vec<&[f32]> = images.iter().map(Vec::as_slice).collect();
    Sampled::of_replicates([48, 32], &images).into()
}

/// An image that is too noisy to tell is not held: nothing was shown of it.
#[test]
fn a_sample_that_shows_nothing_is_no_pass() {
    let dir = tempfile::tempdir().unwrap();
    let plain = Goldens { folder: dir.path().join("g"), failures: dir.path().join("f"), bless: false, ci: None };
    let tolerance = Tolerance::Sampled { alpha: 0.01 };
    let bless = Goldens { bless: true, ..plain.clone() };
    bless.check("blind", &noisy(1, 2, 1.0), &tolerance).unwrap();
    bless.check("sees", &noisy(1, 8, 0.2), &tolerance).unwrap();
    let error = plain.check("blind", &noisy(2, 2, 1.0), &tolerance).unwrap_err();
    assert!(matches!(error, GoldenError::Differs { .. }), "{error}");
    let error = error.to_string();
    assert!(error.contains("BLIND") && error.contains("take more rays or replicates"), "{error}");
    assert_eq!(plain.check("sees", &noisy(2, 8, 0.2), &tolerance).unwrap(), Held::Held);
}
