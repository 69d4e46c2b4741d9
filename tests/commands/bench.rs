//! `aogauge bench`, as a user meets it.

use aogauge::bench::{
    GpuBench,
    cpu::{CpuBench, Kind},
};
use std::process::{Command, Output};

fn aogauge(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).args(args).output().unwrap()
}

/// The curtain over open ground: every number follows from another.
#[test]
fn times_and_rays_add_up() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("a/b");
    let args = ["bench", "gpu", "--scene", "curtain-open", "--resolution", "48x32", "--rays", "4,8"];
    let more = ["--rounds", "3", "--warm-up", "0", "--format", "json", "--out", out.to_str().unwrap()];
    let output = aogauge(&[&args[..], &more[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bench: GpuBench = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(bench, serde_json::from_slice(&std::fs::read(out.join("bench.json")).unwrap()).unwrap());
    let page = std::fs::read(out.join("bench.md")).unwrap();
    std::fs::write(out.join("bench.md"), "# Notes").unwrap();
    let refused = aogauge(&[&args[..], &more[..]].concat());
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(
        refused.status.code() == Some(2) && told.contains("bench.md") && told.contains("nothing is written"),
        "{told}"
    );
    std::fs::write(out.join("bench.md"), page).unwrap();
    assert_eq!((bench.resolution, bench.rounds, bench.scenes.len()), ([48, 32], 3, 1));
    let scene = &bench.scenes[0];
    assert!(scene.pixels > 700 && scene.pixels <= 48 * 32, "{}", scene.pixels);
    assert!(scene.g_buffer_ms.least > 0.0);
    let methods: Vec<(&str, u32)> = scene.methods.iter().map(|m| (m.method.as_str(), m.rays)).collect();
    let names = ["classic", "extended, clipped", "extended, counts"];
    assert_eq!(methods, [4, 8].iter().flat_map(|&r| names.map(|n| (n, r))).collect::<Vec<_>>());
    for group in scene.methods.chunks(3) {
        let classic = &group[0];
        assert_eq!((classic.secondary_rays, classic.extra_ms), (0, None));
        for m in group {
            assert_eq!(m.primary_rays, scene.pixels * u64::from(m.rays));
            let rate = (m.primary_rays + m.secondary_rays) as f64 / m.ms.median / 1e3;
            assert!((m.million_rays_a_second.unwrap() / rate - 1.0).abs() < 1e-9);
            assert!(m.ms.least > 0.0 && m.ms.lower <= m.ms.median && m.ms.median <= m.ms.upper);
        }
        for m in &group[1..] {
            assert!(m.secondary_rays > m.primary_rays && m.secondary_rays < 2 * m.primary_rays);
            assert_eq!(m.secondary_rays % 2, 0);
            assert!(m.extra_ms.is_some());
        }
    }
    let page = std::fs::read_to_string(out.join("bench.md")).unwrap();
    assert!(page.contains("| extended, clipped | 8 |") && page.contains(&bench.adapter), "{page}");
}

#[test]
fn what_is_wrong_is_named() {
    if std::thread::available_parallelism().is_ok_and(|cores| cores.get() < 256) {
        let output = aogauge(&["bench", "cpu", "--threads", "1,256"]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains("--threads is 256"), "{message}");
    }
    for (args, says) in [
        (["--resolution", "1920"], "WIDTHxHEIGHT"),
        (["--resolution", "8x8"], "16 to 8192"),
        (["--rays", "64"], "1..=32"),
        (["--scene", "atrum"], "atrium"),
        (["--rounds", "0"], "1..="),
    ] {
        let output = aogauge(&[&["bench", "gpu"], &args[..]].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(message.contains(says), "{args:?}: {message}");
    }
}

/// Rays on the CPU: every kind, on one thread and two; all ways meet the same.
#[test]
fn cpu_rays_are_counted_by_kind_and_thread() {
    let dir = tempfile::tempdir().unwrap();
    let args = ["bench", "cpu", "--scene", "curtain-arcade", "--size", "24", "--rays", "8,16,32", "--radius", "0.25"];
    let more = ["--threads", "1,2", "--rounds", "3", "--format", "json", "--out", dir.path().to_str().unwrap()];
    let output = aogauge(&[&args[..], &more[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bench: CpuBench = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(bench, serde_json::from_slice(&std::fs::read(dir.path().join("bench.json")).unwrap()).unwrap());
    let scene = &bench.scenes[0];
    assert!(scene.points > 1500 && scene.points <= 6 * 24 * 24, "{}", scene.points);
    let of_one = [(Kind::AnyHit, 8), (Kind::AnyHit, 16), (Kind::AnyHit, 32), (Kind::Segments, 16), (Kind::Closest, 8)];
    let expected: Vec<_> = [1, 2].iter().flat_map(|&t| of_one.map(|(kind, rays)| (kind, rays, t))).collect();
    assert_eq!(scene.races.iter().map(|r| (r.kind, r.rays, r.threads)).collect::<Vec<_>>(), expected);
    for race in &scene.races {
        assert!(race.hit > 0.0 && race.hit < 1.0, "{race:?}");
        assert_eq!(race.radius.is_none(), race.kind == Kind::Closest);
        for way in &race.ways {
            assert!(way.million_rays_a_second > 0.0 && way.at_best >= way.million_rays_a_second, "{way:?}");
            assert!(way.more_hits == 0 || way.name.starts_with("Embree"), "{way:?}");
        }
        assert!(race.ways.iter().any(|w| w.name == "portable") && race.ways.iter().any(|w| w.name == "scalar"));
    }
    let page = std::fs::read_to_string(dir.path().join("bench.md")).unwrap();
    assert!(page.contains("| any hit, R = 0.25 m, 8 rays a point |") && page.contains("2 threads"), "{page}");
    for (args, says) in [(["--rays", "12"], "8, 16, 32"), (["--radius", "0"], "0.001"), (["--threads", "0"], "1..=256")]
    {
        let output = aogauge(&[&["bench", "cpu"], &args[..]].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(message.contains(says), "{args:?}: {message}");
    }
}
