//! Rays of the CPU reference for the figures of reports/paper, as JSON on standard output:
//! a few shaded points under a curtain with every primary and secondary ray of theirs, and
//! Monte-Carlo profiles under boxes beside their closed forms.
//!
//! `cargo run --release --example paper_rays > rays.json`

use aogauge::{
    flatland::{self, Measure, Model, Slab, Space},
    render::{
        Extension, Falloff, Geometry, Openness, ReceiverPlane,
        ao::{Shading, Traced},
        sampler::Sampler,
    },
    scenes::Scene,
    stats::Estimate,
};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};
use std::error::Error;

const RADIUS: f32 = 0.25;
/// Of each Monte-Carlo point; intervals are taken over the replicates.
const RAYS: u32 = 256;
const REPLICATES: u32 = 16;

/// An endless box of this width and gap over open ground.
fn scene(width: f64, gap: f64) -> Result<Scene, Box<dyn Error>> {
    let text = format!(
        "description = \"box\"\n\
        ao = {{ radius = {RADIUS} }}\n\
        environment = {{ radiance = 1.0 }}\n\
        measure = {{ center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.01, resolution = [16, 16] }}\n\
        look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}\n\
        [[object]]\nname = \"ground\"\n\
        shape = {{ plane = {{ center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] }} }}\n\
        [[object]]\nname = \"box\"\noccluder = true\n\
        shape = {{ curtain = {{ thickness = {width}, gap = {gap}, height = 1.0, length = 6.0 }} }}\n"
    );
    Ok(Scene::from_toml("box", "box.toml", &text, None)?)
}

fn extended(receiver_plane: ReceiverPlane) -> Openness {
    Openness { extension: Some(Extension::of_the_paper(receiver_plane)), ..Openness::plain(Falloff::Step) }
}

/// The profiles of one box: closed form and Monte Carlo, classic and extended.
fn profiles(width: f64, gap: f64, salt: u32) -> Result<Value, Box<dyn Error>> {
    let scene = scene(width, gap)?;
    let geometry = Geometry::new(&scene)?;
    let slab = Slab { width, gap, height: 1.0 };
    let clipped = ReceiverPlane::Clipped;
    let methods = [
        ("classic", Openness::plain(Falloff::Step), flatland::Estimator::Classic),
        (
            "extended",
            extended(clipped),
            flatland::Estimator::Extended {
                secondary_radius: f64::from(scene.ao.secondary_radius),
                receiver_plane: clipped,
            },
        ),
    ];
    let curves = methods.map(|(name, by_rays, estimator)| {
        let radius = f64::from(RADIUS);
        let model = Model { radius, space: Space::Extruded, measure: Measure::Cosine, estimator };
        let closed: Vec<[f64; 2]> =
            (-110..=110).map(|i| f64::from(i) * 0.01).map(|t| [t, model.openness(&slab, t * radius, 1e-6)]).collect();
        let points: Vec<[f64; 3]> = (-10..=10)
            .map(|i| {
                let t = f64::from(i) * 0.1;
                let point = Vec3::new((t * radius) as f32, 0.0, 0.1);
                let shading = Shading::new(&geometry.tracer, point, Vec3::Y, scene.ao, by_rays);
                let pixel = salt * 100 + (i + 10) as u32;
                let values: Vec<f64> = (0..REPLICATES)
                    .map(|replicate| f64::from(shading.openness(RAYS, &Sampler::new(1, pixel, replicate)).0))
                    .collect();
                let mean = Estimate::of_mean(&values);
                [t, mean.value, mean.se]
            })
            .collect();
        json!({ "name": name, "closed": closed, "points": points })
    });
    Ok(json!({ "width": width, "gap": gap, "curves": curves }))
}

/// One point's rays in the cross-section of the box, x and y in metres.
fn point(geometry: &Geometry, scene: &Scene, x: f32, pixel: u32) -> Value {
    let shading =
        Shading::new(&geometry.tracer, Vec3::new(x, 0.0, 0.1), Vec3::Y, scene.ao, extended(ReceiverPlane::Clipped));
    let sampler = Sampler::new(3, pixel, 0);
    let flat = |p: Vec3| Vec2::new(p.x, p.y).to_array();
    let rays: Vec<Value> = (0..10)
        .map(|i| {
            let Traced { from, to, decided, secondary } = shading.traced(sampler.pair(i, 0), [0.0; 2]);
            let secondary: Vec<Value> = secondary
                .iter()
                .enumerate()
                .map(|(i, [a, b])| json!({ "from": flat(*a), "to": flat(*b), "closed": decided.closed >> i & 1 == 1 }))
                .collect();
            json!({ "from": flat(from), "to": flat(to), "hit": decided.hit, "weight": decided.weight(), "secondary": secondary })
        })
        .collect();
    json!({ "x": x, "rays": rays })
}

fn main() -> Result<(), Box<dyn Error>> {
    let boxes = [(0.02, 0.05), (0.02, 0.10), (0.10, 0.10), (0.20, 0.05)];
    let profiles: Vec<Value> =
        boxes.iter().zip(0..).map(|(&(w, m), salt)| profiles(w, m, salt)).collect::<Result<_, _>>()?;
    let scene = scene(0.02, 0.10)?;
    let geometry = Geometry::new(&scene)?;
    let points: Vec<Value> =
        [0.0, 0.22].iter().zip(0..).map(|(&x, pixel)| point(&geometry, &scene, x, pixel)).collect();
    let all = json!({
        "radius": RADIUS, "secondary_radius": scene.ao.secondary_radius,
        "rays": RAYS, "replicates": REPLICATES, "profiles": profiles, "points": points,
    });
    serde_json::to_writer(std::io::stdout().lock(), &all)?;
    Ok(())
}
