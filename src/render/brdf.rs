//! How a surface scatters light: the BRDF of glTF 2.0's metallic-roughness model.
//! Twin: `gpu/shaders/brdf.wgsl`.
//!
//! Specification, appendix B (Khronos 2021): a dielectric is a Lambert base under
//! a GGX microfacet coat of reflectance 0.04, a metal a coat whose reflectance is
//! the base colour. Masking and shadowing are Smith's, height-correlated (Heitz,
//! "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT
//! 3(2), 2014), Fresnel's reflectance is Schlick's approximation.

use super::materials::Here;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

/// Reflectance of a dielectric that light meets head on: index 1.5.
const DIELECTRIC: f32 = 0.04;

/// Least alpha, the square of roughness. Below, a point light's highlight on a
/// mirror is an infinite value that no picture meets.
pub const LEAST_ALPHA: f32 = 1e-3;

/// The BRDF, 1/sr a channel, for unit vectors towards light and viewer, both on
/// the side of the unit normal; zero where one is not.
pub fn brdf(here: &Here, normal: Vec3, light: Vec3, viewer: Vec3) -> Vec3 {
    let (nl, nv) = (normal.dot(light), normal.dot(viewer));
    if nl <= 0.0 || nv <= 0.0 {
        return Vec3::ZERO;
    }
    let half = (light + viewer).normalize_or_zero();
    let nh = normal.dot(half).clamp(0.0, 1.0);
    let vh = viewer.dot(half).clamp(0.0, 1.0);
    let alpha = (here.roughness * here.roughness).max(LEAST_ALPHA);
    let head_on = Vec3::splat(DIELECTRIC).lerp(here.base_color, here.metallic);
    let grazing = (1.0 - vh) * (1.0 - vh) * (1.0 - vh) * (1.0 - vh) * (1.0 - vh);
    let fresnel = head_on + (Vec3::ONE - head_on) * grazing;
    let specular = fresnel * (distribution(nh, alpha) * visibility(nl, nv, alpha));
    (Vec3::ONE - fresnel) * here.albedo() * FRAC_1_PI + specular
}

/// GGX (Trowbridge and Reitz): density of microfacet normals, 1/sr.
fn distribution(nh: f32, alpha: f32) -> f32 {
    // 1 - (1 - alpha^2) nh^2, without the cancellation near nh = 1.
    let d = (1.0 - nh) * (1.0 + nh) + alpha * alpha * nh * nh;
    alpha * alpha / (PI * d * d)
}

/// Smith's G, height-correlated, over 4 nl nv.
fn visibility(nl: f32, nv: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let smith = |cosine: f32| (a2 + (1.0 - a2) * cosine * cosine).sqrt();
    0.5 / (nl * smith(nv) + nv * smith(nl))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made_of(base_color: f32, metallic: f32, roughness: f32) -> Here {
        Here { base_color: Vec3::splat(base_color), metallic, roughness, emission: Vec3::ZERO }
    }

    /// A unit vector about +Y.
    fn at(cosine: f32, azimuth: f32) -> Vec3 {
        let sine = (1.0 - cosine * cosine).sqrt();
        Vec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin())
    }

    const N: Vec3 = Vec3::Y;

    /// By hand from the formulas of the appendix: at normal incidence h = n, so D
    /// = 1/(pi alpha^2), G = 1, F = f0.
    #[test]
    fn head_on_it_is_as_the_formulas_say() {
        let rough = brdf(&made_of(0.5, 0.0, 1.0), N, N, N);
        // (1 - 0.04) 0.5 / pi + 0.04 / (4 pi)
        assert!((rough.x - 0.155_972).abs() < 1e-5, "{rough}");
        let glossy = brdf(&made_of(0.5, 0.0, 0.5), N, N, N);
        // alpha = 0.25: D = 16 / pi; (1 - 0.04) 0.5 / pi + 0.04 * 16 / (4 pi)
        assert!((glossy.x - 0.203_718).abs() < 1e-5, "{glossy}");
        let metal = brdf(&made_of(0.8, 1.0, 0.5), N, N, N);
        // 0.8 * 16 / (4 pi)
        assert!((metal.x - 1.018_592).abs() < 1e-5, "{metal}");
    }

    /// Off the mirror's direction, all terms at work, in Heitz's form of G.
    #[test]
    fn aslant_it_is_as_the_formulas_say() {
        let (light, viewer) = (at(0.5, 0.0), at(0.8, 2.0));
        let found = brdf(&made_of(0.6, 0.25, 0.6), N, light, viewer);
        let h = (light + viewer).normalize().as_dvec3();
        let (nl, nv, nh, vh) = (0.5f64, 0.8f64, h.y, h.dot(viewer.as_dvec3()));
        let a2 = 0.36f64.powi(2);
        let d = a2 / (std::f64::consts::PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
        // Heitz's G2 = 1 / (1 + Lambda(l) + Lambda(v)).
        let lambda = |c: f64| ((1.0 + a2 * (1.0 / (c * c) - 1.0)).sqrt() - 1.0) / 2.0;
        let g = 1.0 / (1.0 + lambda(nl) + lambda(nv));
        let f0 = 0.04 * 0.75 + 0.6 * 0.25;
        let f = f0 + (1.0 - f0) * (1.0 - vh).powi(5);
        let expected = (1.0 - f) * 0.6 * 0.75 / std::f64::consts::PI + f * d * g / (4.0 * nl * nv);
        assert!((f64::from(found.x) - expected).abs() < 1e-5 * expected, "{found} {expected}");
    }

    #[test]
    fn light_and_viewer_may_change_places() {
        for roughness in [0.05, 0.3, 0.7, 1.0] {
            for (i, j) in [(0.1, 0.9), (0.5, 0.4), (1.0, 0.05)] {
                let here = Here { base_color: Vec3::new(0.9, 0.5, 0.1), ..made_of(0.0, 0.3, roughness) };
                let (a, b) = (at(i, 0.3), at(j, 2.0));
                let (there, back) = (brdf(&here, N, a, b), brdf(&here, N, b, a));
                assert!((there - back).length() <= 1e-5 * there.length(), "{there} {back}");
            }
        }
    }

    #[test]
    fn from_behind_there_is_nothing() {
        let here = made_of(0.5, 0.5, 0.5);
        assert_eq!(brdf(&here, N, -N, N), Vec3::ZERO);
        assert_eq!(brdf(&here, N, N, at(0.0, 0.0)), Vec3::ZERO);
    }

    /// Share of light from one direction that is scattered, by quadrature over
    /// the cosine and the azimuth, fine near the mirror direction.
    fn scattered(here: &Here, cosine: f32) -> f32 {
        let (light, steps) = (at(cosine, 0.0), 600);
        let mut sum = 0.0f64;
        for i in 0..steps {
            // Elevation angle evenly, azimuth with t^3 about the mirror's.
            let theta = (i as f32 + 0.5) / steps as f32 * PI / 2.0;
            for j in 0..steps {
                let t = (j as f32 + 0.5) / steps as f32;
                let (azimuth, stretch) = (PI - PI * t * t * t, PI * 3.0 * t * t);
                let viewer = at(theta.cos(), azimuth);
                let value = brdf(here, N, light, viewer).x * theta.cos() * theta.sin();
                sum += 2.0 * f64::from(value * stretch) * f64::from(PI / 2.0) / f64::from(steps * steps);
            }
        }
        sum as f32
    }

    /// In a furnace of even light nothing shines brighter than the furnace: the
    /// specular lobe of a white metal gives back no more than it gets, a smooth one
    /// nearly all; nor does a grey dielectric.
    #[test]
    fn a_white_furnace_stays_white() {
        for roughness in [0.2f32, 0.35, 0.5, 0.75, 1.0] {
            for cosine in [0.1, 0.3, 0.6, 0.9, 1.0] {
                let metal = scattered(&made_of(1.0, 1.0, roughness), cosine);
                let grey = scattered(&made_of(0.5, 0.0, roughness), cosine);
                for share in [metal, grey] {
                    assert!(share <= 1.002 && share > 0.3, "roughness {roughness}, cosine {cosine}: {share}");
                }
            }
        }
        let smooth = scattered(&made_of(1.0, 1.0, 0.2), 0.9);
        assert!(smooth > 0.99, "{smooth}");
    }

    /// The specification's own limit: its base loses what the coat reflects
    /// towards one viewer, not what it reflects in all, so that a white dielectric
    /// in grazing light gives back more than it gets.
    #[test]
    fn a_white_dielectric_in_grazing_light_is_too_bright_as_specified() {
        let white = |cosine| scattered(&made_of(1.0, 0.0, 0.2), cosine);
        assert!((white(0.1) - 1.428).abs() < 0.01, "{}", white(0.1));
        assert!((white(1.0) - 1.0).abs() < 0.005, "{}", white(1.0));
    }

    /// Without its coat a rough dielectric is Lambert's: what the coat leaves of
    /// the base colour, the same from everywhere near the normal.
    #[test]
    fn a_rough_dielectric_is_nearly_lambertian() {
        let here = made_of(0.6, 0.0, 1.0);
        for cosine in [0.5, 0.7, 1.0] {
            let found = brdf(&here, N, at(cosine, 0.0), N).x;
            assert!((found * PI / 0.6 - 1.0).abs() < 0.06, "{cosine}: {}", found * PI / 0.6);
        }
    }
}
