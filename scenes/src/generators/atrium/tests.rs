//! Tests of the whole house.

use super::*;
use crate::{Mesh, Scene};
use glam::Vec3;
use std::collections::HashMap;

fn atrium(triangles: u32) -> Atrium {
    Atrium { triangles: Count(triangles), ..Atrium::default() }
}

fn total(parts: &[Part]) -> usize {
    parts.iter().map(|p| p.mesh.triangles.len()).sum()
}

fn area(corners: [Vec3; 3]) -> f32 {
    (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() / 2.0
}

/// How often each edge is walked one way less the other, and how often at all.
fn edges(mesh: &Mesh) -> HashMap<(u32, u32), (i32, u32)> {
    let mut edges: HashMap<(u32, u32), (i32, u32)> = HashMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let entry = edges.entry((a.min(b), a.max(b))).or_default();
            entry.0 += if a < b { 1 } else { -1 };
            entry.1 += 1;
        }
    }
    edges
}

/// Volume of each connected piece; positive where normals point outward.
fn volumes(mesh: &Mesh) -> Vec<f64> {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for t in &mesh.triangles {
        for k in 1..3 {
            let (a, b) = (root(&mut parent, t[0]), root(&mut parent, t[k]));
            parent[a as usize] = b;
        }
    }
    let mut volumes: HashMap<u32, f64> = HashMap::new();
    for t in &mesh.triangles {
        let piece = root(&mut parent, t[0]);
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
        *volumes.entry(piece).or_default() += a.dot(b.cross(c)) / 6.0;
    }
    volumes.into_values().collect()
}

#[test]
fn the_count_is_within_a_tenth_of_the_target() {
    for target in [10_000, 14_000, 20_000, 33_000, 50_000, 71_000, 100_000, 250_000, 1_000_000] {
        let count = total(&atrium(target).parts().unwrap());
        assert!(count.abs_diff(target as usize) * 10 <= target as usize, "{count} of {target}");
    }
    // Counting alone reaches the top of the range without making it.
    for step in 0..60 {
        let target = (1e4 * 1e3f64.powf(f64::from(step) / 59.0)) as u32;
        for thickness in [0.0, 0.004] {
            let atrium = Atrium { cloth_thickness: Thickness(thickness), ..atrium(target) };
            atrium.fit().unwrap_or_else(|e| panic!("{e}"));
        }
    }
    let most = Atrium { bays_long: Count(10), bays_short: Count(4), ..atrium(10_000) };
    assert!(most.parts().unwrap_err().contains("bays_long"));
    assert!(Atrium { triangles: Count(20_000), ..most }.parts().is_ok());
}

#[test]
fn counting_and_making_agree() {
    for thickness in [0.0, 0.004] {
        let atrium = Atrium { cloth_thickness: Thickness(thickness), ..atrium(40_000) };
        let plan = atrium.fit().unwrap();
        assert_eq!(atrium.count(&plan), total(&atrium.parts().unwrap()));
    }
}

#[test]
fn no_triangle_is_degenerate_and_none_leaves_the_bounds() {
    let (lo, hi) = (Vec3::new(-15.0, -0.3, -9.0), Vec3::new(15.0, 12.0, 9.0));
    for target in [10_000, 60_000, 1_000_000] {
        for part in atrium(target).parts().unwrap() {
            part.mesh.validate().unwrap();
            for corners in part.mesh.corners() {
                assert!(area(corners) > 0.0, "{target}: {} {corners:?}", part.name);
                assert!(corners.iter().all(|p| p.cmpge(lo).all() && p.cmple(hi).all()), "{} {corners:?}", part.name);
            }
        }
    }
}

#[test]
fn every_body_is_closed_and_faces_outward() {
    for target in [10_000, 120_000] {
        let thick = Atrium { cloth_thickness: Thickness(0.004), ..atrium(target) };
        for part in thick.parts().unwrap() {
            if ["paving", "vaults"].contains(&part.name.as_str()) {
                continue;
            }
            assert!(edges(&part.mesh).values().all(|&e| e == (0, 2)), "{target}: {} is open", part.name);
            assert!(volumes(&part.mesh).iter().all(|&v| v > 0.0), "{target}: {} is inside out", part.name);
        }
    }
}

#[test]
fn vaults_face_down_and_flags_face_up() {
    for part in atrium(50_000).parts().unwrap() {
        let up = match part.name.as_str() {
            "vaults" => -1.0,
            "paving" => 1.0,
            _ => continue,
        };
        for [a, b, c] in part.mesh.corners() {
            assert!(up * (b - a).cross(c - a).y > -1e-6, "{} {a} {b} {c}", part.name);
        }
    }
}

#[test]
fn the_same_parameters_make_the_same_house() {
    assert_eq!(atrium(30_000).parts().unwrap(), atrium(30_000).parts().unwrap());
}

#[test]
fn hems_hang_where_they_are_told() {
    for gap in [0.03, 0.1] {
        let atrium = Atrium { hem_gap: Length(gap), ..atrium(50_000) };
        let mut curtains = 0;
        for part in atrium.parts().unwrap() {
            assert_eq!(part.occluder, part.name.starts_with("curtain-") || part.name.starts_with("banner-"));
            let lowest = part.mesh.bounds().unwrap()[0].y;
            if part.name.starts_with("curtain-") {
                assert_eq!(lowest, gap, "{}", part.name);
                curtains += 1;
            } else if part.occluder {
                assert!(lowest > 3.0);
            }
        }
        assert!(curtains >= 14, "{curtains}");
    }
}

/// Whether the line straight up from x, z meets the triangle, and where.
fn above([a, b, c]: [Vec3; 3], x: f32, z: f32) -> Option<f32> {
    let cross = |p: Vec3, q: Vec3| f64::from(p.x - x) * f64::from(q.z - z) - f64::from(q.x - x) * f64::from(p.z - z);
    let (u, v, w) = (cross(b, c), cross(c, a), cross(a, b));
    let sum = u + v + w;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    (inside && sum != 0.0).then(|| ((u * f64::from(a.y) + v * f64::from(b.y) + w * f64::from(c.y)) / sum) as f32)
}

#[test]
fn the_courtyard_is_open_and_the_walks_are_covered() {
    let parts = atrium(50_000).parts().unwrap();
    let highest = |x: f32, z: f32| {
        parts.iter().flat_map(|p| p.mesh.corners()).filter_map(|t| above(t, x, z)).fold(f32::NEG_INFINITY, f32::max)
    };
    assert!(highest(0.013, 0.017).abs() < 1e-6, "nothing over the floor in the middle");
    assert!(highest(9.013, 3.017).abs() < 1e-6);
    for [x, z] in [[0.013, 7.017], [13.013, 0.017], [-13.013, -7.017], [3.013, -5.017]] {
        assert!(highest(x, z) > 11.0, "{x} {z}");
    }
}

fn scene(shape: &str) -> Result<Scene, String> {
    let text = format!(
        "description = \"test\"\nao = {{ radius = 0.5 }}\nenvironment = {{ radiance = 1.0 }}\n\
         measure = {{ center = [0, 0, 5], normal = [0, 1, 0], transect = [0, 0, 1], clearance = 0.02, resolution = [16, 16] }}\n\
         look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}\n\
         [[object]]\nname = \"atrium\"\nshape = {{ atrium = {{ {shape} }} }}\n"
    );
    Scene::from_toml("test", "test.toml", &text, None).map_err(|e| e.to_string())
}

#[test]
fn bad_parameters_are_named_with_their_range() {
    for (shape, expected) in [
        ("triangles = 9999", ["line 8", "from 10000 to 10000000"]),
        ("triangles = -1", ["line 8", "from 10000 to 10000000"]),
        ("hem_gap = 0.6", ["line 8", "from 0.002 to 0.5 m"]),
        ("pleat_depth = nan", ["line 8", "from 0 to 0.3 m"]),
        ("bays_long = 11", ["line 8", "from 5 to 10"]),
        ("cloth_thickness = -0.1", ["line 8", "from 0.001 to 0.02 m"]),
        ("cloth_thickness = 0.5", ["cloth_thickness", "from 0.001 to 0.02 m"]),
        ("hem = 0.1", ["line 8", "hem_gap"]),
    ] {
        let message = scene(shape).unwrap_err();
        assert!(expected.iter().all(|e| message.contains(e)), "{shape}: {message}");
    }
    let scene = scene("triangles = 20000").unwrap();
    assert!(scene.objects.iter().any(|o| o.name == "atrium.curtain-red-4" && o.occluder));
}
