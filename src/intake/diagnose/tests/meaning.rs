//! What is done to openness, and what cannot be told from it.
use super::*;
use crate::intake::Curve;

/// Of 1 ray every pixel is 0 or 1, and no curve changes that.
#[test]
fn codes_for_display_are_told() {
    for bench in [&*SELF, &Bench::library("corner")] {
        for rays in [64, 4] {
            let image: Vec<f32> = bench.classic(rays).into_iter().map(encode).collect();
            let found = bench.diagnose(&image);
            let [first] = &found[..] else { panic!("{}, {rays} rays: {found:?}", bench.scene.name) };
            let all = explanations(first);
            assert_eq!(all[0], Finding::Encoded { gamma: None }, "{}, {rays} rays: {found:?}", bench.scene.name);
            // In the corner openness is 0.5 to 1, where half the strength is nearly the same.
            let or = |f: &Finding| matches!(f, Finding::Strength { strength } if (strength - 0.5).abs() < 0.05);
            assert_eq!(
                all.iter().any(or),
                bench.scene.name == "corner",
                "{}, {rays} rays: {found:?}",
                bench.scene.name
            );
        }
    }
    let image: Vec<f32> = SELF.classic(16).iter().map(|v| v.powf(1.0 / 1.8)).collect();
    let found = SELF.diagnose(&image);
    assert!(matches!(found[..], [Finding::Encoded { gamma: Some(g) }] if (g - 1.8).abs() < 0.1), "{found:?}");
    assert_eq!(SELF.diagnose(&SELF.classic(1).into_iter().map(encode).collect::<Vec<_>>()), []);
}

#[test]
fn intensity_is_told_as_a_curve() {
    for rays in [64, 4] {
        for (gain, exponent) in [(1.0, 2.0), (1.0, 1.5), (0.7, 1.0), (1.2, 0.8)] {
            let curve = Curve { gain, exponent, ..Curve::IDENTITY };
            let found = SELF.diagnose(&curve.apply(&SELF.classic(rays)));
            let is = |g: f64, e: f64| (g / gain - 1.0).abs() < 0.03 && (e / exponent - 1.0).abs() < 0.06;
            assert!(
                matches!(found[..], [Finding::Curve { gain, exponent }] if is(gain, exponent)),
                "{gain}, {exponent}, {rays} rays: {found:?}"
            );
        }
    }
}

/// Blended with white it is not gamma, as near as half of it comes to the sRGB curve.
#[test]
fn strength_is_told_from_codes() {
    for bench in [&*SELF, &Bench::library("corner"), &Bench::library("crevice")] {
        for rays in [64, 4] {
            for strength in [0.5, 0.7, 1.4] {
                let image: Vec<f32> = bench.classic(rays).iter().map(|v| 1.0 - strength * (1.0 - v)).collect();
                let found = bench.diagnose(&image);
                let near = |s: &f64| (s / f64::from(strength) - 1.0).abs() < 0.03;
                let is_strength = |f: &Finding| matches!(f, Finding::Strength { strength } if near(strength));
                let is = |f: &Finding| {
                    let all = explanations(f);
                    match bench.scene.name.as_str() {
                        "self-check" if rays == 64 => all.len() == 1 && is_strength(&all[0]),
                        // In the corner openness is 0.5 to 1, where the two are nearly the same, as they are in noise.
                        "corner" => all.iter().any(is_strength),
                        _ if rays == 4 => all.iter().any(is_strength),
                        _ => is_strength(&all[0]),
                    }
                };
                // Above 1 it leaves values below 0, too.
                let told = found.iter().filter(|f| !matches!(f, Finding::Negative { .. })).collect::<Vec<_>>();
                assert!(told.len() == 1 && is(told[0]), "{strength}, {rays} rays, {}: {found:?}", bench.scene.name);
            }
        }
    }
}

/// What is done to openness is told where it varies enough, by many images of a method too, and else named beside all
/// that comes as near.
#[test]
fn what_a_scene_cannot_tell_is_named_with_the_rest() {
    type Made = fn(f32) -> f32;
    type Is = fn(&Finding) -> bool;
    let made: [(&str, Made, Is); 5] = [
        ("O^2", |v| v * v, |f| matches!(f, Finding::Curve { exponent: e, .. } if (e - 2.0).abs() < 0.1)),
        ("O^.5", |v| v.max(0.0).sqrt(), |f| matches!(f, Finding::Encoded { gamma: Some(g) } if (g - 2.0).abs() < 0.1)),
        ("O - .2", |v| v - 0.2, |f| matches!(f, Finding::Offset { by } if (by + 0.2).abs() < 0.01)),
        (
            "strength",
            |v| 1.0 - 0.6 * (1.0 - v),
            |f| matches!(f, Finding::Strength { strength: s } if (s - 0.6).abs() < 0.03),
        ),
        ("gain", |v| 0.7 * v, |f| matches!(f, Finding::Curve { gain: g, .. } if (g - 0.7).abs() < 0.02)),
    ];
    let benches = [Bench::library("corner"), Bench::library("curtain-arcade")];
    for (name, make, is) in made {
        let through = |image: Vec<f32>| image.into_iter().map(make).collect::<Vec<f32>>();
        for rays in [64, 16] {
            let image = through(SELF.classic(rays));
            let found: Vec<Finding> = SELF.diagnose(&image).into_iter().filter(Finding::is_meaning).collect();
            assert!(found.len() == 1 && is(&found[0]), "{name}, {rays} rays: {found:?}");
            let smooth: Vec<Vec<f32>> = benches.iter().map(|b| through(b.classic(rays))).collect();
            for (bench, image) in benches.iter().zip(&smooth) {
                let found = bench.diagnose(image);
                let told = explanations(&found[0]);
                assert!(told.iter().any(is), "{name} of {}, {rays} rays: {found:?}", bench.scene.name);
            }
            let all: Vec<Held<'_>> = benches
                .iter()
                .zip(&smooth)
                .map(|(b, image)| Held { image, reference: &b.reference.openness, width: b.size[0] })
                .collect();
            let pooled = meaning_of(&all).unwrap();
            assert!(explanations(&pooled).iter().any(is), "{name}, {rays} rays: {pooled:?}");
            // What nothing can be said of alone is told by the rest.
            let own = Held { image: &image, reference: &SELF.reference.openness, width: SELF.size[0] };
            let pooled = meaning_of(&[all, vec![own]].concat()).unwrap();
            assert!(is(&pooled), "{name} with the self-check, {rays} rays: {pooled:?}");
        }
    }
    let of = |strength: f64| {
        Finding::Either(vec![Finding::Strength { strength }, Finding::Curve { gain: 1.0, exponent: 2.0 }])
    };
    let text = of(1.81).to_string();
    assert!(
        text.contains(
            "AO of strength 1.81: 1 - 1.81 times occlusion, or a curve: 1.00 times openness to the power 2.00"
        )
    );
    assert!(text.ends_with("these images cannot tell; hand in the image of the self-check, which can"), "{text}");
}
