//! What is estimated: openness in its variants, local indirect light, or the
//! whole of light transport.

use super::{
    screen_space::{Integral, ScreenSpace},
    smoothing::Smoothing,
};
pub use crate::trace::Faces;
use aogauge_scenes::AoScale;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How openness, or light, is computed at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimator {
    /// `classic`, `obscurance`, `extended`, `extended-obscurance`.
    Openness(Openness),
    /// Openness plus the light of nearby occluders, by luminance, for an ambient
    /// radiance of 1 (the paper's Eq. 3 and 4): O + I.
    LocalIndirect(LocalIndirect),
    /// `hbao`, `gtao`: openness from a camera's depth and normals.
    ScreenSpace(ScreenSpace),
    /// Irradiance over pi from the scene's light with diffuse interreflection:
    /// unbiased, and without R.
    PathTraced,
}

/// The name a method goes by, each with what it computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Share of rays with no hit within R.
    Classic,
    /// Mean of mu(d) over first hits d, with a falloff that is not the step.
    Obscurance,
    /// The paper's extension of `classic`.
    Extended,
    /// The same extension of `obscurance`.
    ExtendedObscurance,
    /// Openness plus the light that nearby occluders send back.
    LocalIndirect,
    /// Horizon-based, from depth and normals: uniform in solid angle.
    Hbao,
    /// Horizon-based, from depth and normals: cosine-weighted.
    Gtao,
    /// The whole of light transport.
    PathTraced,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        use clap::ValueEnum;
        self.to_possible_value().map_or(Ok(()), |v| f.write_str(v.get_name()))
    }
}

/// Options of openness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Openness {
    /// How much an occluder at a distance closes a ray.
    pub falloff: Falloff,
    /// Which side of a triangle closes a ray.
    pub faces: Faces,
    /// Secondary rays; None for methods without.
    pub extension: Option<Extension>,
    /// The image is the mean over rays to this power. Above 0; 1 leaves it alone.
    /// Any other makes the mean of images of few rays differ from the image of
    /// many, as it does in engines.
    pub intensity: f32,
    /// R and R' in place of the scene's.
    pub scale: Scale,
    /// What is done to the mean over rays before the power is taken.
    pub smoothing: Smoothing,
}

/// Lengths in place of the scene's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scale {
    /// R, metres.
    pub radius: Option<f32>,
    /// R', metres; a quarter of `radius` where that is given and this is not.
    pub secondary_radius: Option<f32>,
}

impl Scale {
    /// R and R' in a scene.
    pub fn on(self, scene: AoScale) -> AoScale {
        let own = self.radius.map_or(scene, |radius| AoScale { radius, secondary_radius: radius / 4.0 });
        AoScale { secondary_radius: self.secondary_radius.unwrap_or(own.secondary_radius), ..own }
    }
}

/// Options of [`Estimator::LocalIndirect`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalIndirect {
    /// How much of an occluder's own light a distance lets through: 1 - mu(d).
    pub falloff: Falloff,
    /// R in place of the scene's.
    pub scale: Scale,
}

/// mu(d): how open a ray is whose first hit lies at distance d; 1 without a hit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Falloff {
    /// 0 up to R, 1 beyond.
    Step,
    /// 1 - exp(-sigma d), whatever R is (the paper's Eq. 2).
    Exponential {
        /// sigma, 1/m.
        extinction: f32,
    },
    /// 0, then linear to 1 over the last part of R (XeGTAO).
    LinearTail {
        /// That part, in (0, 1]; XeGTAO's is 0.615.
        tail: f32,
    },
    /// (d/R)^2 up to R (HBAO).
    Quadratic,
    /// A = 1 - (1 - floor) exp(-lambda (d/R)^2) up to R, then brightened for
    /// interreflection to A / (1 - rho (1 - A)) (Microsoft's sample).
    Gaussian {
        /// lambda; the sample's is 2.
        lambda: f32,
        /// What a ray counts whose hit is at distance 0, in [0, 1); 0.07.
        floor: f32,
        /// rho in [0, 1): reflectance taken for all surfaces; 0 turns it off.
        reflectance: f32,
    },
}

impl Falloff {
    /// How far a ray must look, metres: beyond, mu is 1. For the exponential
    /// that is where 1 - mu falls below the rounding of mu.
    pub fn reach(self, radius: f32) -> f32 {
        match self {
            Falloff::Exponential { extinction } => 17.4 / extinction,
            _ => radius,
        }
    }

    /// mu of a hit at distance `d`, within [`Self::reach`].
    pub fn mu(self, d: f32, radius: f32) -> f32 {
        match self {
            Falloff::Step => 0.0,
            Falloff::Exponential { extinction } => -(-extinction * d).exp_m1(),
            Falloff::Quadratic => (d / radius) * (d / radius),
            Falloff::LinearTail { tail } => (1.0 - (1.0 - d / radius) / tail).clamp(0.0, 1.0),
            Falloff::Gaussian { lambda, floor, reflectance } => {
                let x = d / radius;
                let open = 1.0 - (1.0 - floor) * (-lambda * x * x).exp();
                open / (1.0 - reflectance * (1.0 - open))
            }
        }
    }
}

/// The secondary rays of the paper's section 5, and ways to vary them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extension {
    /// Whether the receiver closes secondary rays.
    pub receiver_plane: ReceiverPlane,
    /// How many an open primary ray casts, 1 to 8; the paper's 2.
    pub secondary_rays: u32,
    /// Where they go.
    pub sides: Sides,
    /// Where on the primary ray they start.
    pub origin: SecondaryOrigin,
}

impl Extension {
    /// The most secondary rays.
    pub const MOST: u32 = 8;

    /// The paper's: two, both ways, about the middle.
    pub const fn of_the_paper(receiver_plane: ReceiverPlane) -> Self {
        Extension { receiver_plane, secondary_rays: 2, sides: Sides::Two, origin: SecondaryOrigin::Middle }
    }

    /// Whether the fan of secondary rays is turned at random about its primary.
    /// Several segments both ways look all round as they stand: the paper's two
    /// are always w x n and w x (w x n). A single one, or rays one way, would
    /// prefer a side.
    pub fn is_turned(self) -> bool {
        self.sides == Sides::One || self.secondary_rays == 1
    }
}

/// What happens when a secondary ray meets the receiver's own plane; the paper
/// leaves it open, and it matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ReceiverPlane {
    /// The literal reading: all geometry closes a secondary ray, the receiver
    /// too. An empty plane then reads 1 - (k^2/2)/(1 + k^2) with k = 2R'/R.
    Counts,
    /// Secondary rays are cut at the receiver's tangent plane: an empty plane
    /// reads 1.
    Clipped,
}

/// Where a secondary ray goes from its origin on the primary ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sides {
    /// R' both ways: a segment of length 2 R', closed by any hit on it.
    #[default]
    Two,
    /// R' one way.
    One,
}

/// Where on the primary ray the secondary rays start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SecondaryOrigin {
    /// In the middle of its open part.
    #[default]
    Middle,
    /// Anywhere on its open part, at random, one place for all of them.
    Jittered,
}

impl Openness {
    /// Without extension, intensity, scale of its own or smoothing.
    pub const fn plain(falloff: Falloff) -> Self {
        Openness {
            falloff,
            faces: Faces::Both,
            extension: None,
            intensity: 1.0,
            scale: Scale { radius: None, secondary_radius: None },
            smoothing: Smoothing::NONE,
        }
    }

    /// How far a primary ray must look, metres: beyond, mu is 1, and what is cut
    /// for secondary rays ends at R.
    pub fn reach(&self, radius: f32) -> f32 {
        let reach = self.falloff.reach(radius);
        if self.extension.is_some() { reach.max(radius) } else { reach }
    }

    /// Openness from a sum over `rays` of [`Decided::units`](super::ao::Decided::units).
    pub fn mean(&self, sum: f64, rays: u32) -> f32 {
        self.finished(sum / (f64::from(rays) * f64::from(self.units())))
    }

    /// What an open ray counts in a sum.
    pub(super) fn units(&self) -> u32 {
        self.extension.map_or(1, |e| e.secondary_rays)
    }

    /// A mean over rays to the power `intensity`.
    pub(super) fn finished(&self, mean: f64) -> f32 {
        if self.intensity == 1.0 { mean as f32 } else { mean.powf(f64::from(self.intensity)) as f32 }
    }
}

impl Estimator {
    /// Classic ambient occlusion.
    pub const CLASSIC: Estimator = Estimator::Openness(Openness::plain(Falloff::Step));

    /// The paper's method.
    pub const fn extended(receiver_plane: ReceiverPlane) -> Self {
        Estimator::Openness(Openness {
            extension: Some(Extension::of_the_paper(receiver_plane)),
            ..Openness::plain(Falloff::Step)
        })
    }

    /// What it is called.
    pub fn kind(&self) -> Kind {
        match self {
            Estimator::Openness(o) => match (o.falloff, o.extension) {
                (Falloff::Step, None) => Kind::Classic,
                (_, None) => Kind::Obscurance,
                (Falloff::Step, Some(_)) => Kind::Extended,
                (_, Some(_)) => Kind::ExtendedObscurance,
            },
            Estimator::LocalIndirect(_) => Kind::LocalIndirect,
            Estimator::ScreenSpace(s) => match s.integral {
                Integral::Hbao { .. } => Kind::Hbao,
                Integral::Gtao { .. } => Kind::Gtao,
            },
            Estimator::PathTraced => Kind::PathTraced,
        }
    }

    /// The same method without smoothing: what a converged image is made by, as
    /// smoothing many rays would hide what smoothing does.
    #[must_use]
    pub fn unsmoothed(self) -> Self {
        match self {
            Estimator::Openness(o) => Estimator::Openness(Openness { smoothing: Smoothing::NONE, ..o }),
            other => other,
        }
    }

    /// Whether the GPU computes it.
    pub fn is_on_gpu(&self) -> bool {
        !matches!(self, Estimator::PathTraced)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falloffs_meet_their_known_points() {
        let r = 0.5;
        for (falloff, d, expected) in [
            (Falloff::Step, 0.499, 0.0),
            (Falloff::Exponential { extinction: 2.0 }, 0.5, 1.0 - (-1.0f32).exp()),
            (Falloff::Quadratic, 0.25, 0.25),
            (Falloff::LinearTail { tail: 0.615 }, 0.0, 0.0),
            (Falloff::LinearTail { tail: 0.615 }, 0.5 * (1.0 - 0.615), 0.0),
            (Falloff::LinearTail { tail: 0.615 }, 0.5 * (1.0 - 0.3075), 0.5),
            (Falloff::LinearTail { tail: 0.615 }, 0.5, 1.0),
            (Falloff::Gaussian { lambda: 2.0, floor: 0.07, reflectance: 0.0 }, 0.0, 0.07),
            (Falloff::Gaussian { lambda: 2.0, floor: 0.07, reflectance: 0.0 }, 0.5, 1.0 - 0.93 * (-2.0f32).exp()),
            (Falloff::Gaussian { lambda: 2.0, floor: 0.07, reflectance: 0.5 }, 0.0, 0.07 / (1.0 - 0.5 * 0.93)),
        ] {
            assert!((falloff.mu(d, r) - expected).abs() < 1e-6, "{falloff:?} at {d}: {}", falloff.mu(d, r));
        }
        let exponential = Falloff::Exponential { extinction: 2.0 };
        assert!(1.0 - exponential.mu(exponential.reach(r), r) < 1e-7);
    }

    #[test]
    fn a_radius_of_its_own_brings_a_quarter_of_it_along() {
        let scene = AoScale { radius: 1.0, secondary_radius: 0.3 };
        assert_eq!(Scale::default().on(scene), scene);
        let own = Scale { radius: Some(2.0), secondary_radius: None }.on(scene);
        assert_eq!(own, AoScale { radius: 2.0, secondary_radius: 0.5 });
        let both = Scale { radius: Some(2.0), secondary_radius: Some(0.1) }.on(scene);
        assert_eq!(both, AoScale { radius: 2.0, secondary_radius: 0.1 });
    }

    #[test]
    fn methods_know_their_names() {
        assert_eq!(Estimator::CLASSIC.kind(), Kind::Classic);
        assert_eq!(Estimator::extended(ReceiverPlane::Counts).kind(), Kind::Extended);
        let obscurance = Openness::plain(Falloff::Exponential { extinction: 1.0 });
        assert_eq!(Estimator::Openness(obscurance).kind(), Kind::Obscurance);
        let extension = Some(Extension::of_the_paper(ReceiverPlane::Counts));
        let both = Estimator::Openness(Openness { extension, ..obscurance });
        assert_eq!(both.kind(), Kind::ExtendedObscurance);
    }
}
