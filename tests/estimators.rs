//! What must hold for every estimator, whatever it is called: limits, symmetry,
//! order, scale, noise.

#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

use aogauge::{
    render::{
        Estimator, Extension, Faces, Falloff, Geometry, Job, LocalIndirect, Openness, ReceiverPlane, Renderer, Scale,
        SecondaryOrigin, Sides, ao::Shading, cpu::Cpu, sampler::Sampler,
    },
    scenes::{AoScale, Scene, library},
    stats::mean_variance,
    trace::Ray,
};
use glam::Vec3;

const AO: AoScale = AoScale { radius: 0.25, secondary_radius: 0.0625 };

fn extended(receiver_plane: ReceiverPlane, secondary_rays: u32, sides: Sides, origin: SecondaryOrigin) -> Openness {
    let extension = Some(Extension { receiver_plane, secondary_rays, sides, origin });
    Openness { extension, ..Openness::plain(Falloff::Step) }
}

/// Openness in all its variants; the plane clipped, so that an empty one reads 1.
fn methods() -> Vec<Openness> {
    let falloffs = [
        Falloff::Step,
        Falloff::Exponential { extinction: 8.0 },
        Falloff::LinearTail { tail: 0.615 },
        Falloff::Gaussian { lambda: 2.0, floor: 0.07, reflectance: 0.5 },
    ];
    let mut methods: Vec<Openness> = falloffs.into_iter().map(Openness::plain).collect();
    for falloff in falloffs {
        let extension = Some(Extension::of_the_paper(ReceiverPlane::Clipped));
        methods.push(Openness { extension, ..Openness::plain(falloff) });
    }
    let clipped = ReceiverPlane::Clipped;
    methods.push(extended(clipped, 1, Sides::Two, SecondaryOrigin::Middle));
    methods.push(extended(clipped, 8, Sides::Two, SecondaryOrigin::Jittered));
    methods.push(extended(clipped, 3, Sides::One, SecondaryOrigin::Middle));
    methods.push(Openness { faces: Faces::Front, ..Openness::plain(Falloff::Step) });
    methods.push(Openness { intensity: 2.0, ..Openness::plain(Falloff::Step) });
    methods
}

fn scene(objects: &str, radius: f32) -> Scene {
    let text = format!(
        r#"
description = "estimators"
ao = {{ radius = {radius} }}
environment = {{ radiance = 1.0 }}
measure = {{ center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = {}, resolution = [208, 16] }}
look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}
{objects}"#,
        0.08 * radius
    );
    Scene::from_toml("estimators", "estimators.toml", &text, None).unwrap()
}

const GROUND: &str =
    "[[object]]\nname = 'ground'\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] } }\n";

fn curtain(gap: f32) -> Scene {
    let hung = format!(
        "{GROUND}[[object]]\nname = 'curtain'\noccluder = true\n\
         shape = {{ curtain = {{ thickness = 0.02, gap = {gap}, height = 1.0, length = 3.0 }} }}\n"
    );
    scene(&hung, 0.25)
}

fn read(geometry: &Geometry, t: f32, method: Openness, rays: u32, replicate: u32) -> f32 {
    let shading = Shading::new(&geometry.tracer, Vec3::new(t, 0.0, 0.1), Vec3::Y, AO, method);
    shading.openness(rays, &Sampler::new(21, 7, replicate)).0
}

#[test]
fn a_closed_box_reads_0_and_a_plane_reads_1() {
    let closed =
        "[[object]]\nname = 'box'\nshape = { block = { min = [-0.08, -0.05, -0.08], max = [0.08, 0.03, 0.08] } }\n";
    let closed = Geometry::new(&scene(closed, 0.25)).unwrap();
    let plane = Geometry::new(&scene(GROUND, 0.25)).unwrap();
    for method in methods() {
        for i in 0..50 {
            let at = Vec3::new(0.07 * (i as f32 / 25.0 - 1.0), -0.05, 0.07);
            let point = |g: &Geometry, p: Vec3| {
                Shading::new(&g.tracer, p, Vec3::Y, AO, method).openness(256, &Sampler::new(3, i, 0)).0
            };
            assert_eq!(point(&plane, Vec3::new(at.x, 0.0, at.z)), 1.0, "{method:?}");
            // The inside of a block is its back.
            if method.falloff == Falloff::Step && method.faces == Faces::Both {
                assert_eq!(point(&closed, at), 0.0, "{method:?}");
            }
        }
    }
}

/// Culled back faces let rays out of a block and keep them from entering it.
#[test]
fn back_faces_are_culled() {
    let block = "[[object]]\nname = 'box'\nshape = { block = { min = [-0.1, 0.05, -0.1], max = [0.1, 0.2, 0.1] } }\n";
    let geometry = Geometry::new(&scene(&format!("{GROUND}{block}"), 0.25)).unwrap();
    let front = Openness { faces: Faces::Front, ..Openness::plain(Falloff::Step) };
    let read = |y: f32, method| {
        let at = Vec3::new(0.0, y, 0.0);
        Shading::new(&geometry.tracer, at, Vec3::Y, AO, method).openness(4096, &Sampler::new(3, 1, 0)).0
    };
    let both = Openness::plain(Falloff::Step);
    assert_eq!(read(0.0, front), read(0.0, both), "seen from outside nothing is culled");
    assert_eq!((read(0.1, both), read(0.1, front)), (0.0, 1.0), "from inside everything is");
}

/// As R' goes to 0 the extension goes away; and where the gap exceeds
/// sqrt(R^2/4 + R'^2) no secondary ray reaches the curtain.
#[test]
fn extended_is_classic_where_it_must_be() {
    let classic = Openness::plain(Falloff::Step);
    let near = Geometry::new(&curtain(0.1)).unwrap();
    let tiny = Scale { radius: None, secondary_radius: Some(1e-6) };
    let far = Geometry::new(&curtain((0.125f32.powi(2) + 0.0625f32.powi(2)).sqrt() + 1e-3)).unwrap();
    let reached = Geometry::new(&curtain((0.125f32.powi(2) + 0.0625f32.powi(2)).sqrt() - 5e-3)).unwrap();
    let mut darker = 0;
    for i in 0..40 {
        let t = (i as f32 / 20.0 - 1.0) * 0.3;
        for n in [1, 2, 8] {
            let method = extended(ReceiverPlane::Clipped, n, Sides::Two, SecondaryOrigin::Middle);
            let short = Openness { scale: tiny, ..method };
            assert_eq!(read(&near, t, short, 1024, i), read(&near, t, classic, 1024, i), "{t}");
            assert_eq!(read(&far, t, method, 1024, i), read(&far, t, classic, 1024, i), "{t}");
            darker += u32::from(read(&reached, t, method, 1024, i) < read(&reached, t, classic, 1024, i));
        }
    }
    assert!(darker > 0, "just below that gap some do");
}

/// The profile of a symmetric scene is symmetric: both sides are equal within
/// five standard errors at each of 30 points, for each method.
#[test]
fn profiles_are_symmetric() {
    let geometry = Geometry::new(&curtain(0.08)).unwrap();
    for method in methods() {
        for i in 1..=30 {
            let t = 0.01 * i as f32;
            let side = |t: f32| {
                let values: Vec<f64> = (0..16).map(|r| f64::from(read(&geometry, t, method, 256, r))).collect();
                mean_variance(&values)
            };
            let ((a, va), (b, vb)) = (side(t), side(-t));
            let se = ((va + vb) / 16.0).sqrt();
            assert!((a - b).abs() <= 5.0 * se + 1e-6, "{method:?} at {t}: {a} and {b} +- {se}");
        }
    }
}

/// Ray by ray, one more occluder never opens a point; only where a falloff lets
/// the extended methods move their middle nearer may a single ray gain.
#[test]
fn more_occluders_never_open_a_point() {
    let one = curtain(0.08);
    let shelf = "[[object]]\nname = 'more'\nshape = { block = { min = [0.05, 0.03, -0.2], max = [0.2, 0.06, 0.3] } }\n";
    let two = {
        let mut scene = one.clone();
        scene.objects.extend(crate::scene(&format!("{GROUND}{shelf}"), 0.25).objects.into_iter().skip(1));
        Geometry::new(&scene).unwrap()
    };
    let one = Geometry::new(&one).unwrap();
    let mut closed = 0;
    for method in methods() {
        if method.extension.is_some() && method.falloff != Falloff::Step {
            continue;
        }
        for i in 0..60 {
            let t = (i as f32 / 30.0 - 1.0) * 0.4;
            for replicate in 0..8 {
                let (a, b) = (read(&one, t, method, 64, replicate), read(&two, t, method, 64, replicate));
                assert!(b <= a, "{method:?} at {t}: {a} then {b}");
                closed += u32::from(b < a);
            }
        }
    }
    assert!(closed > 1000, "{closed}");
}

/// Variance over replicates falls with the number of rays at least as fast as for
/// independent rays: the slope of its logarithm is below -0.9.
#[test]
fn variance_falls_with_the_number_of_rays() {
    let geometry = Geometry::new(&curtain(0.08)).unwrap();
    let points = [-0.2, -0.09, -0.02, 0.0, 0.04, 0.13];
    let counts = [4u32, 16, 64, 256];
    let mut all = methods();
    all.push(extended(ReceiverPlane::Counts, 2, Sides::Two, SecondaryOrigin::Middle));
    for method in all {
        let slope = slope(&counts, |rays| {
            let variances = points.map(|t| {
                let values: Vec<f64> = (0..96).map(|r| f64::from(read(&geometry, t, method, rays, r))).collect();
                mean_variance(&values).1
            });
            variances.iter().sum()
        });
        assert!(slope < -0.9, "{method:?}: {slope}");
    }
}

/// The same for light: whole images of the arcade.
#[test]
fn variance_of_light_falls_with_the_number_of_paths() {
    let mut scene = library::scene("curtain-arcade").unwrap();
    scene.measure.resolution = [26, 4];
    scene.measure.pixel *= 8.0;
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let step = LocalIndirect { falloff: Falloff::Step, scale: Scale::default() };
    for estimator in [Estimator::PathTraced, Estimator::LocalIndirect(step)] {
        let slope = slope(&[4, 16, 64], |rays| {
            let mut loaded = Cpu.load(&geometry).unwrap();
            let frames: Vec<Vec<f32>> = (0..32)
                .map(|replicate| {
                    let job = Job { view: &view, estimator, ao: scene.ao, rays, seed: 2, replicate };
                    loaded.render(&job).unwrap().values
                })
                .collect();
            (0..view.pixels())
                .map(|i| mean_variance(&frames.iter().map(|f| f64::from(f[i])).collect::<Vec<_>>()).1)
                .sum()
        });
        assert!(slope < -0.9, "{estimator:?}: {slope}");
    }
}

/// Slope of log(variance) over log(rays), by least squares.
fn slope(counts: &[u32], mut variance: impl FnMut(u32) -> f64) -> f64 {
    let points: Vec<(f64, f64)> = counts.iter().map(|&n| (f64::from(n).ln(), variance(n).ln())).collect();
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let xy: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    xy / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>()
}

/// The arcade scaled from 0.01 to 1000 times, R too, and moved up to 4000 R away:
/// every image is the same but for a few rays.
#[test]
fn scale_and_place_do_not_matter() {
    let original = library::scene("curtain-arcade").unwrap();
    let changed = |factor: f32, by: Vec3| {
        let mut s = original.clone();
        let at = |p: Vec3| p * factor + by;
        s.objects.iter_mut().flat_map(|o| &mut o.mesh.positions).for_each(|p| *p = at(*p));
        s.environment.portals.iter_mut().for_each(|p| {
            (p.corner, p.u, p.v) = (at(p.corner), p.u * factor, p.v * factor);
        });
        s.ao = AoScale { radius: s.ao.radius * factor, secondary_radius: s.ao.secondary_radius * factor };
        s.measure.center = at(s.measure.center);
        s.measure.clearance *= factor;
        s.measure.pixel *= factor;
        (s.look.eye, s.look.target) = (at(s.look.eye), at(s.look.target));
        s
    };
    let image = |scene: &Scene, estimator: Estimator| {
        let scene = scene.near_origin();
        let geometry = Geometry::new(&scene).unwrap();
        let view = scene.measure.view();
        let job = Job { view: &view, estimator, ao: scene.ao, rays: 16, seed: 2, replicate: 0 };
        Cpu.load(&geometry).unwrap().render(&job).unwrap().values
    };
    for estimator in [
        Estimator::CLASSIC,
        Estimator::extended(ReceiverPlane::Clipped),
        Estimator::extended(ReceiverPlane::Counts),
        Estimator::PathTraced,
    ] {
        let expected = image(&original, estimator);
        let mean = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / v.len() as f64;
        for (factor, offset) in
            [(0.01, 0.0), (0.1, 0.0), (1000.0, 0.0), (1.0, 100.0), (1.0, 4000.0), (0.01, 4000.0), (1000.0, 4000.0)]
        {
            let by = Vec3::new(0.6, -0.48, 0.64) * (offset * original.ao.radius * factor);
            let found = image(&changed(factor, by), estimator);
            let differ = found.iter().zip(&expected).filter(|(a, b)| (**a - **b).abs() > 1e-4).count();
            let (a, b) = (mean(&found), mean(&expected));
            assert!((a - b).abs() < 2e-3 * b.abs(), "{estimator:?} x{factor} +{offset} R: mean {a}, {b}");
            if offset == 0.0 {
                assert!(differ * 50 < expected.len(), "{estimator:?} x{factor}: {differ} of {}", expected.len());
            }
        }
    }
}

/// A million rays from inside a closed mesh at its edges and corners: none gets
/// out.
#[test]
fn edges_and_corners_let_no_ray_through() {
    let ball = "[[object]]\nname = 'ball'\nshape = { sphere = { radius = 0.7, at = [0.3, -0.2] } }\n";
    let scene = scene(&format!("{GROUND}{ball}"), 0.25);
    let triangles: Vec<[Vec3; 3]> = scene.objects[1].mesh.corners().collect();
    let tracer = aogauge::trace::Tracer::new(&triangles);
    let (n, middle) = (1_000_000u32, Vec3::new(0.3, 0.7, -0.2));
    for i in 0..n {
        let sampler = Sampler::new(5, i, 0);
        let [a, b] = sampler.pair(0, 0);
        let [c, d] = sampler.pair(0, 1);
        let corners = triangles[(i as usize * 7919) % triangles.len()];
        let k = i as usize % 3;
        let share = if i % 4 == 0 { 0.0 } else { a };
        let target = corners[k].lerp(corners[(k + 1) % 3], share);
        let origin = middle + (Vec3::new(b, c, d) - 0.5) * 0.6;
        let direction = (target - origin).normalize();
        assert!(tracer.occluded(&Ray::new(origin, direction, 1e30)), "ray {i} from {origin} at {target}");
        assert!(tracer.closest(&Ray::new(origin, direction, 1e30)).is_some());
    }
}

/// Eq. 3 and 4 in a closed box within R: no ambient light comes in, so what glows
/// with e and reflects a everywhere sends e / (1 - a); with a falloff of
/// exp(-sigma d) in a large open room nothing but the ambient light is left.
#[test]
fn local_indirect_light_has_its_closed_forms() {
    let walls = "[[object]]\nname = 'a'\ncolor = [0.8, 0.4, 0.1]\nemission = [0.1, 0.2, 0.3]\n\
                 shape = { block = { min = [-1, 0, -1], max = [1, 2, 1] } }\n";
    let mut scene = scene(walls, 5.0);
    scene.measure.resolution = [64, 64];
    scene.measure.pixel = 0.02;
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let method = LocalIndirect { falloff: Falloff::Step, scale: Scale::default() };
    let estimator = Estimator::LocalIndirect(method);
    let job = Job { view: &view, estimator, ao: scene.ao, rays: 64, seed: 2, replicate: 0 };
    let colors = Cpu.load(&geometry).unwrap().render(&job).unwrap().colors.unwrap();
    for (c, (albedo, emission)) in [(0.8, 0.1), (0.4, 0.2), (0.1, 0.3)].into_iter().enumerate() {
        let values: Vec<f64> = colors.iter().map(|v| f64::from(v[c])).collect();
        let (mean, variance) = mean_variance(&values);
        let expected = emission / (1.0 - albedo);
        let se = (variance / values.len() as f64).sqrt();
        assert!((mean - expected).abs() < 5.0 * se + 1e-6, "channel {c}: {mean} +- {se}, expected {expected}");
    }
    let far = LocalIndirect { falloff: Falloff::Exponential { extinction: 1000.0 }, scale: Scale::default() };
    let job = Job { estimator: Estimator::LocalIndirect(far), ..job };
    let values = Cpu.load(&geometry).unwrap().render(&job).unwrap().values;
    // The floor's middle is a metre from any wall.
    assert!((values[32 * 64 + 32] - 1.0).abs() < 1e-3, "{}", values[32 * 64 + 32]);
}

/// Energy: in a white room under a sky of radiance 1, many bounces from the window,
/// the floor receives no more than the walls can keep. Five standard errors; no
/// pixel is NaN.
#[test]
fn no_light_is_made() {
    let mut scene = library::scene("curtain-room").unwrap();
    for o in &mut scene.objects {
        o.material.base_color = [0.98; 3];
    }
    scene.measure.resolution = [26, 8];
    scene.measure.pixel *= 8.0;
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let mut loaded = Cpu.load(&geometry).unwrap();
    let means: Vec<f64> = (0..24)
        .map(|replicate| {
            let job = Job { view: &view, estimator: Estimator::PathTraced, ao: scene.ao, rays: 64, seed: 5, replicate };
            let values = loaded.render(&job).unwrap().values;
            assert!(values.iter().all(|v| v.is_finite() && *v >= 0.0));
            values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
        })
        .collect();
    let (mean, variance) = mean_variance(&means);
    let se = (variance / means.len() as f64).sqrt();
    // An integrating sphere with a window of 2.2 % of its wall would read 0.53; the
    // floor under a curtain reads less.
    assert!(mean < 0.53 + 5.0 * se && mean > 0.3 && se < 0.02, "{mean} +- {se}");
}

/// A floor beside a red wall under ambient light turns red: colour bleeds.
#[test]
fn color_bleeds_from_a_wall() {
    let wall = "[[object]]\nname = 'wall'\ncolor = [0.9, 0.1, 0.1]\n\
                shape = { block = { min = [0.05, 0, -3], max = [0.2, 1, 3] } }\n";
    let scene = scene(&format!("{GROUND}{wall}"), 0.25);
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let method = LocalIndirect { falloff: Falloff::Step, scale: Scale::default() };
    let estimator = Estimator::LocalIndirect(method);
    let job = Job { view: &view, estimator, ao: scene.ao, rays: 256, seed: 2, replicate: 0 };
    let colors = Cpu.load(&geometry).unwrap().render(&job).unwrap().colors.unwrap();
    let near = colors[8 * 208 + 112];
    assert!(near[0] > near[1] + 0.1 && (near[1] - near[2]).abs() < 1e-6, "{near:?}");
}
