//! What must hold for every estimator, whatever it is called: limits, symmetry,
//! order, scale, noise.

use aogauge::{
    flatland::Slab,
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

/// A scene and its mirror image across the transect read the same, back faces
/// culled or not: five standard errors at each point, for each method.
#[test]
fn mirror_images_read_the_same() {
    let leaning = |z: f32| {
        let corners = [[-0.2, 0.05], [0.25, 0.12], [0.1, 0.4]];
        let sheet = corners.map(|[x, y]| format!("[{x}, {y}, {}]", z * (0.1 + 0.5 * y))).join(", ");
        // Mirrored, corners run the other way round unless their order is turned.
        let order = if z > 0.0 { "[0, 1, 2]" } else { "[0, 2, 1]" };
        let text = format!(
            "{GROUND}[[object]]\nname = 'sheet'\nshape = {{ polygons = {{ positions = [{sheet}], triangles = [{order}] }} }}\n"
        );
        Geometry::new(&scene(&text, 0.25)).unwrap()
    };
    let (plus, minus) = (leaning(1.0), leaning(-1.0));
    let mut all = methods();
    for falloff in [Falloff::Step, Falloff::Exponential { extinction: 8.0 }] {
        let extension = Some(Extension::of_the_paper(ReceiverPlane::Clipped));
        all.push(Openness { faces: Faces::Front, extension, ..Openness::plain(falloff) });
    }
    for method in all {
        for (x, z) in [(0.0, 0.0), (0.05, 0.1), (0.1, 0.2), (-0.1, 0.15)] {
            let side = |g: &Geometry, z: f32| {
                let shading = Shading::new(&g.tracer, Vec3::new(x, 0.0, z), Vec3::Y, AO, method);
                let values: Vec<f64> =
                    (0..32).map(|r| f64::from(shading.openness(512, &Sampler::new(21, 7, r)).0)).collect();
                mean_variance(&values)
            };
            let ((a, va), (b, vb)) = (side(&plus, z), side(&minus, -z));
            let se = ((va + vb) / 32.0).sqrt();
            assert!((a - b).abs() <= 5.0 * se + 1e-6, "{method:?} at {x}, {z}: {a} and {b} +- {se}");
        }
    }
}

/// What every falloff reads under a curtain follows from openness as a function
/// of the radius, P(d > r): mu(0) + the integral of mu'(r) P(d > r), and the jump
/// of mu at R. By Simpson's rule from the closed form; five standard errors.
#[test]
fn falloffs_agree_with_their_integrals() {
    let geometry = Geometry::new(&curtain(0.05)).unwrap();
    let slab = Slab { width: 0.02, gap: 0.05, height: 1.0 };
    let radius = 0.25;
    for falloff in [
        Falloff::LinearTail { tail: 0.615 },
        Falloff::LinearTail { tail: 1.0 },
        Falloff::Gaussian { lambda: 2.0, floor: 0.07, reflectance: 0.0 },
        Falloff::Gaussian { lambda: 2.0, floor: 0.07, reflectance: 0.5 },
    ] {
        let mu = |r: f64| f64::from(falloff.mu(r as f32, radius as f32));
        for t in [0.0f64, 0.03, 0.08, 0.15] {
            let beyond = |r: f64| slab.openness(t, r).extruded_cosine;
            let n = 4000;
            let step = radius / f64::from(n);
            // Stieltjes: the change of mu over each step times openness in its middle.
            let inside: f64 = (0..n)
                .map(|i| {
                    let (a, b) = (f64::from(i) * step, f64::from(i + 1) * step);
                    (mu(b) - mu(a)) * beyond(0.5 * (a + b))
                })
                .sum();
            let expected = mu(0.0) + inside + (1.0 - mu(radius)) * beyond(radius);
            let values: Vec<f64> =
                (0..32).map(|r| f64::from(read(&geometry, t as f32, Openness::plain(falloff), 1024, r))).collect();
            let (mean, variance) = mean_variance(&values);
            let se = (variance / 32.0).sqrt();
            assert!(
                (mean - expected).abs() < 5.0 * se + 2e-4,
                "{falloff:?} at {t}: {mean} +- {se}, expected {expected}"
            );
            assert!(se < 2e-3);
        }
    }
}

/// Where the plane counts, what any number of secondary rays, one- or two-sided,
/// from the middle or anywhere, reads on an empty plane is an integral over the
/// primary's angle, the fan's turn and the place on the primary: a secondary ray
/// is closed where it goes down by more than its origin's height.
#[test]
fn every_fan_reads_an_empty_plane_as_its_integral() {
    let geometry = Geometry::new(&scene(GROUND, 0.25)).unwrap();
    let (radius, reach) = (0.25f64, 0.0625f64);
    for secondary_rays in [1, 2, 3, 5, 8] {
        for (sides, origin) in [
            (Sides::Two, SecondaryOrigin::Middle),
            (Sides::Two, SecondaryOrigin::Jittered),
            (Sides::One, SecondaryOrigin::Middle),
            (Sides::One, SecondaryOrigin::Jittered),
        ] {
            let method = extended(ReceiverPlane::Counts, secondary_rays, sides, origin);
            let is_turned = method.extension.unwrap().is_turned();
            let n = 200;
            let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
            let period = if sides == Sides::Two { 0.5 } else { 1.0 };
            let mut closed = 0.0;
            for u in (0..n).map(at) {
                let (sin, cos) = (u.sqrt(), (1.0 - u).sqrt());
                for turned in (0..if is_turned { n } else { 1 }).map(|i| if is_turned { at(i) } else { 0.0 }) {
                    for k in 0..secondary_rays {
                        let angle =
                            std::f64::consts::TAU * (f64::from(k) + turned) * period / f64::from(secondary_rays);
                        let down = match sides {
                            Sides::Two => angle.sin().abs() * sin,
                            Sides::One => (angle.sin() * sin).max(0.0),
                        };
                        // The share of the primary on which the origin is too low.
                        let low = (reach * down / (radius * cos)).min(1.0);
                        let share = match origin {
                            SecondaryOrigin::Middle => f64::from(u8::from(low > 0.5)),
                            SecondaryOrigin::Jittered => low,
                        };
                        let turns = if is_turned { f64::from(n) } else { 1.0 };
                        closed += share / (f64::from(n) * turns * f64::from(secondary_rays));
                    }
                }
            }
            let values: Vec<f64> = (0..32).map(|r| f64::from(read(&geometry, 0.1, method, 1024, r))).collect();
            let (mean, variance) = mean_variance(&values);
            let se = (variance / 32.0).sqrt();
            let expected = 1.0 - closed;
            assert!((mean - expected).abs() < 5.0 * se + 2e-3, "{method:?}: {mean} +- {se}, expected {expected}");
        }
    }
}

/// Between a floor and a ceiling at height h, both endless, everything depends on
/// the primary's angle: d = h/cos, the middle at half of min(d, R), d2 closed where
/// it reaches floor or ceiling, d1 never. Extended obscurance against that
/// integral, short of the falloff's own reach and beyond it.
#[test]
fn extended_obscurance_between_two_planes_is_its_integral() {
    let height = 0.1f64;
    let ceiling = format!(
        "[[object]]\nname = 'floor'\nshape = {{ plane = {{ center = [0, 0, 0], u = [0, 0, 90], v = [90, 0, 0] }} }}\n\
         [[object]]\nname = 'ceiling'\nshape = {{ plane = {{ center = [0, {height}, 0], u = [90, 0, 0], v = [0, 0, 90] }} }}\n"
    );
    let geometry = Geometry::new(&scene(&ceiling, 0.25)).unwrap();
    let (radius, reach) = (0.25f64, 0.0625f64);
    for sigma in [2.0f64, 8.0, 40.0, 150.0, 1000.0] {
        let extension = Some(Extension::of_the_paper(ReceiverPlane::Counts));
        let method = Openness { extension, ..Openness::plain(Falloff::Exponential { extinction: sigma as f32 }) };
        let n = 20_000;
        let expected: f64 = (0..n)
            .map(|i| {
                let u = (f64::from(i) + 0.5) / f64::from(n);
                let (sin, cos) = (u.sqrt(), (1.0 - u).sqrt());
                let d = height / cos;
                let middle = 0.5 * d.min(radius) * cos;
                let up = reach * sin;
                let closed = up > middle || up > height - middle;
                (1.0 - (-sigma * d).exp()) * if closed { 0.5 } else { 1.0 }
            })
            .sum::<f64>()
            / f64::from(n);
        let values: Vec<f64> = (0..32).map(|r| f64::from(read(&geometry, 0.1, method, 1024, r))).collect();
        let (mean, variance) = mean_variance(&values);
        let se = (variance / 32.0).sqrt();
        assert!((mean - expected).abs() < 5.0 * se + 2e-3, "sigma {sigma}: {mean} +- {se}, expected {expected}");
    }
}

/// An R of a method's own that is too small for the scene's rounding is refused,
/// as the scene's would be.
#[test]
fn an_r_below_rounding_is_refused() {
    let scene = curtain(0.1);
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    for radius in [1e-3f32, 1e-9] {
        let scale = Scale { radius: Some(radius), secondary_radius: None };
        let estimator = Estimator::Openness(Openness { scale, ..Openness::plain(Falloff::Step) });
        let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 1, seed: 2, replicate: 0 };
        let message = Cpu.load(&geometry).unwrap().render(&job).unwrap_err().to_string();
        assert!(message.contains(&format!("R = {radius} m")), "{message}");
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
        scene.objects.extend(self::scene(&format!("{GROUND}{shelf}"), 0.25).objects.into_iter().skip(1));
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
                    let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays, seed: 2, replicate };
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
        let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 16, seed: 2, replicate: 0 };
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
            // Far off, corners are where their coordinates can say, up to 2e-4 R away.
            let most = if offset == 0.0 { expected.len() / 50 } else { expected.len() / 5 };
            assert!(differ < most, "{estimator:?} x{factor} +{offset} R: {differ} of {}", expected.len());
        }
    }
}

/// No light leaks and no self-shadow at any scale or place: a closed box reads 0
/// right up to its walls, a plane reads 1.
#[test]
fn boxes_stay_closed_and_planes_open_at_every_scale_and_place() {
    let closed =
        "[[object]]\nname = 'box'\nshape = { block = { min = [-0.07, 0, -0.07], max = [0.07, 0.12, 0.07] } }\n";
    for (objects, expected) in [(closed, 0.0), (GROUND, 1.0)] {
        let original = scene(objects, 0.25);
        for (factor, offset) in
            [(1.0f32, 0.0f32), (0.01, 0.0), (1000.0, 0.0), (1.0, 4000.0), (0.01, 4000.0), (1000.0, 4000.0)]
        {
            let by = Vec3::new(0.6, -0.48, 0.64) * (offset * 0.25 * factor);
            let mut moved = original.clone();
            moved.objects.iter_mut().flat_map(|o| &mut o.mesh.positions).for_each(|p| *p = *p * factor + by);
            moved.ao = AoScale { radius: 0.25 * factor, secondary_radius: 0.0625 * factor };
            moved.measure.center = moved.measure.center * factor + by;
            moved.measure.clearance *= factor;
            moved.measure.pixel *= factor;
            moved.measure.resolution = [26, 26];
            let near = moved.near_origin();
            let geometry = Geometry::new(&near).unwrap();
            let view = near.measure.view();
            for method in methods().into_iter().filter(|m| m.falloff == Falloff::Step && m.faces == Faces::Both) {
                let estimator = Estimator::Openness(method);
                let job = Job { view: &view, camera: None, estimator, ao: near.ao, rays: 64, seed: 2, replicate: 0 };
                let values = Cpu.load(&geometry).unwrap().render(&job).unwrap().values;
                assert!(values.iter().all(|&v| v == expected), "{expected} x{factor} +{offset} R: {method:?}");
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
    // As it is, flattened to slivers, and 100 m off.
    for (flat, by) in [(1.0, Vec3::ZERO), (0.02, Vec3::ZERO), (1.0, Vec3::new(100.0, -70.0, 90.0))] {
        let place = |p: Vec3| p * Vec3::new(1.0, flat, 1.0) + by;
        let triangles: Vec<[Vec3; 3]> = scene.objects[1].mesh.corners().map(|c| c.map(place)).collect();
        let tracer = aogauge::trace::Tracer::new(&triangles);
        for i in 0..340_000u32 {
            let sampler = Sampler::new(5, i, 0);
            let [a, b] = sampler.pair(0, 0);
            let [c, d] = sampler.pair(0, 1);
            let corners = triangles[(i as usize * 7919) % triangles.len()];
            let k = i as usize % 3;
            let share = if i % 4 == 0 { 0.0 } else { a };
            let target = corners[k].lerp(corners[(k + 1) % 3], share);
            let origin = place(Vec3::new(0.3, 0.7, -0.2) + (Vec3::new(b, c, d) - 0.5) * 0.6);
            let ray = Ray::new(origin, (target - origin).normalize(), 1e30);
            assert!(tracer.occluded(&ray), "ray {i} from {origin} at {target}");
            assert!(tracer.closest(&ray).is_some());
        }
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
    let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 64, seed: 2, replicate: 0 };
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
            let job = Job {
                view: &view,
                camera: None,
                estimator: Estimator::PathTraced,
                ao: scene.ao,
                rays: 64,
                seed: 5,
                replicate,
            };
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
    let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 256, seed: 2, replicate: 0 };
    let colors = Cpu.load(&geometry).unwrap().render(&job).unwrap().colors.unwrap();
    let near = colors[8 * 208 + 112];
    assert!(near[0] > near[1] + 0.1 && (near[1] - near[2]).abs() < 1e-6, "{near:?}");
}
