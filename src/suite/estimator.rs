//! `[[estimator]]`: a method with its options, or a preset.

use super::Rays;
use crate::render::screen_space::{Integral, ScreenSpace};
use crate::render::{
    Estimator, Extension, Faces, Falloff, Kind, LocalIndirect, Openness, ReceiverPlane, Scale, SecondaryOrigin, Sides,
    smoothing::{Denoise, Smoothing, Temporal},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, fmt::Display};

/// `[[estimator]]`: `kind` or `preset`, and options. Options given beside a preset
/// replace its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EstimatorFile {
    /// Unique in the suite.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// The method.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<Kind>,
    /// Methods as engines and the paper set them: `unity-low`, `unity-medium`,
    /// `unity-high`, `unreal-default`, `microsoft-sample`, `paper-4`, `paper-32`,
    /// `xegtao-high`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// Primary rays a pixel, in place of the suite's; slices of `gtao`, directions
    /// of `hbao`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rays: Option<Rays>,
    /// How much an occluder at a distance closes a ray, for `obscurance`,
    /// `extended-obscurance`, `local-indirect`, `hbao` (`quadratic` unless given) and
    /// `gtao` (`step` unless given).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub falloff: Option<Falloff>,
    /// Which side of a triangle closes a ray; both unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<Faces>,
    /// Openness is taken to this power: above 0, at most 16; 1 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intensity: Option<f32>,
    /// R in metres, in place of the scene's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,
    /// R' in metres, in place of the scene's; a quarter of `radius` where that is
    /// given alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub secondary_radius: Option<f32>,
    /// For extended methods: whether the receiver closes secondary rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub receiver_plane: Option<ReceiverPlane>,
    /// For extended methods: secondary rays a primary ray, 1 to 8; 2 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub secondary_rays: Option<u32>,
    /// For extended methods: whether secondary rays go both ways from their
    /// origin; they do unless told otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub secondary_sides: Option<Sides>,
    /// For extended methods: where on the primary ray secondary rays start; in
    /// the middle unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub secondary_origin: Option<SecondaryOrigin>,
    /// For openness: accumulation over frames, before `denoise`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temporal: Option<Temporal>,
    /// For openness: the spatial filter, before `intensity`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub denoise: Option<Denoise>,
    /// For `hbao` and `gtao`: depth samples along a direction, 1 to 64; 8 unless
    /// given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<u32>,
    /// For `hbao` and `gtao`: samples lie at equal parts of R to this power, 1 to
    /// 4; 1 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_power: Option<u32>,
    /// For `hbao` and `gtao`: R is taken this many times, above 0, at most 16; 1
    /// unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_multiplier: Option<f32>,
    /// For `hbao`: horizons up to this angle over the tangent plane count for
    /// nothing; degrees, 0 to below 90, 10 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tangent_bias: Option<f32>,
    /// For `gtao` with falloff `step`: what the image shows is this thick along
    /// the line of sight, metres; endless unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f32>,
}

/// The paper's number.
const SECONDARY_RAYS: u32 = 2;

/// The presets there are, by name.
fn presets() -> Result<BTreeMap<String, EstimatorFile>, String> {
    toml::from_str(include_str!("presets.toml")).map_err(|e| format!("presets.toml (built in): {e}"))
}

impl EstimatorFile {
    /// The method, and its own number of rays where it has one.
    ///
    /// # Errors
    /// A sentence that names the option and what it may be.
    pub fn build(&self) -> Result<(Estimator, Option<Rays>), String> {
        let merged = self.merged()?;
        let estimator = merged.estimator()?;
        Ok((estimator, merged.rays))
    }

    /// Whether the method works in screen space. A preset is none until it is built;
    /// records hold methods as built.
    pub fn is_screen_space(&self) -> bool {
        matches!(self.kind, Some(Kind::Hbao | Kind::Gtao))
    }

    /// The options of a method, without those that are as they would be anyway:
    /// what records and goldens know it by.
    pub fn of(estimator: &Estimator) -> EstimatorFile {
        let mut file = EstimatorFile { kind: Some(estimator.kind()), ..EstimatorFile::default() };
        let (falloff, scale) = match estimator {
            Estimator::Openness(o) => {
                file.faces = Some(o.faces).filter(|f| *f != Faces::default());
                file.intensity = Some(o.intensity).filter(|i| *i != 1.0);
                if let Some(e) = o.extension {
                    file.receiver_plane = Some(e.receiver_plane);
                    file.secondary_rays = Some(e.secondary_rays).filter(|n| *n != SECONDARY_RAYS);
                    file.secondary_sides = Some(e.sides).filter(|s| *s != Sides::default());
                    file.secondary_origin = Some(e.origin).filter(|o| *o != SecondaryOrigin::default());
                }
                (file.temporal, file.denoise) = (o.smoothing.temporal, o.smoothing.denoise);
                (o.falloff, o.scale)
            }
            Estimator::LocalIndirect(l) => (l.falloff, l.scale),
            Estimator::ScreenSpace(s) => return file.with_screen_space(s),
            Estimator::PathTraced => return file,
        };
        file.falloff = Some(falloff).filter(|f| *f != Falloff::Step);
        file.radius = scale.radius;
        file.secondary_radius = scale.secondary_radius;
        file
    }

    /// These options over those of the preset.
    fn merged(&self) -> Result<EstimatorFile, String> {
        let Some(name) = &self.preset else {
            return Ok(self.clone());
        };
        if self.kind.is_some() {
            return Err("give kind or preset, not both".into());
        }
        let presets = presets()?;
        let base = presets.get(name).ok_or_else(|| {
            let known: Vec<&str> = presets.keys().map(String::as_str).collect();
            format!("no preset is called '{name}'; there are: {}", known.join(", "))
        })?;
        Ok(EstimatorFile {
            name: self.name.clone(),
            kind: base.kind,
            preset: None,
            rays: self.rays.or(base.rays),
            falloff: self.falloff.or(base.falloff),
            faces: self.faces.or(base.faces),
            intensity: self.intensity.or(base.intensity),
            radius: self.radius.or(base.radius),
            secondary_radius: self.secondary_radius.or(base.secondary_radius),
            receiver_plane: self.receiver_plane.or(base.receiver_plane),
            secondary_rays: self.secondary_rays.or(base.secondary_rays),
            secondary_sides: self.secondary_sides.or(base.secondary_sides),
            secondary_origin: self.secondary_origin.or(base.secondary_origin),
            temporal: self.temporal.or(base.temporal),
            denoise: self.denoise.or(base.denoise),
            steps: self.steps.or(base.steps),
            sample_power: self.sample_power.or(base.sample_power),
            radius_multiplier: self.radius_multiplier.or(base.radius_multiplier),
            tangent_bias: self.tangent_bias.or(base.tangent_bias),
            thickness: self.thickness.or(base.thickness),
        })
    }

    fn estimator(&self) -> Result<Estimator, String> {
        let kind = self.kind.ok_or("give kind or preset")?;
        let screen = matches!(kind, Kind::Hbao | Kind::Gtao);
        let openness = !screen && !matches!(kind, Kind::LocalIndirect | Kind::PathTraced);
        let extended = matches!(kind, Kind::Extended | Kind::ExtendedObscurance);
        let falls = matches!(kind, Kind::Obscurance | Kind::ExtendedObscurance | Kind::LocalIndirect);
        for (field, given, allowed) in [
            ("falloff", self.falloff.is_some(), falls || screen),
            ("faces", self.faces.is_some(), openness),
            ("intensity", self.intensity.is_some(), openness || screen),
            ("radius", self.radius.is_some(), kind != Kind::PathTraced),
            ("secondary_radius", self.secondary_radius.is_some(), extended),
            ("receiver_plane", self.receiver_plane.is_some(), extended),
            ("secondary_rays", self.secondary_rays.is_some(), extended),
            ("secondary_sides", self.secondary_sides.is_some(), extended),
            ("secondary_origin", self.secondary_origin.is_some(), extended),
            ("temporal", self.temporal.is_some(), openness),
            ("denoise", self.denoise.is_some(), openness),
            ("steps", self.steps.is_some(), screen),
            ("sample_power", self.sample_power.is_some(), screen),
            ("radius_multiplier", self.radius_multiplier.is_some(), screen),
            ("tangent_bias", self.tangent_bias.is_some(), kind == Kind::Hbao),
            ("thickness", self.thickness.is_some(), kind == Kind::Gtao),
        ] {
            if given && !allowed {
                return Err(format!("{field} means nothing for kind '{kind}'"));
            }
        }
        let scale = Scale { radius: self.radius, secondary_radius: self.secondary_radius };
        between("radius", self.radius, 0.0, 1e6, " m")?;
        between("secondary_radius", self.secondary_radius, 0.0, 1e6, " m")?;
        let smoothing = Smoothing { temporal: self.temporal, denoise: self.denoise };
        smoothing.check()?;
        let falloff = match (self.falloff, kind) {
            (Some(Falloff::Step), Kind::Obscurance | Kind::ExtendedObscurance) => {
                return Err(format!("kind '{kind}' with falloff 'step' is kind '{}'", of_step(kind)));
            }
            (Some(falloff), _) => legal(falloff)?,
            (None, Kind::Obscurance | Kind::ExtendedObscurance) => {
                return Err(format!(
                    "kind '{kind}' needs falloff: {{ exponential = {{ extinction }} }}, {{ linear-tail = {{ tail }} }}, \
                     'quadratic' or {{ gaussian = {{ lambda, floor, reflectance }} }}"
                ));
            }
            (None, _) => Falloff::Step,
        };
        Ok(match kind {
            Kind::PathTraced => Estimator::PathTraced,
            Kind::Hbao | Kind::Gtao => Estimator::ScreenSpace(self.screen_space(kind)?),
            Kind::LocalIndirect => Estimator::LocalIndirect(LocalIndirect { falloff, scale }),
            _ => Estimator::Openness(Openness {
                falloff,
                faces: self.faces.unwrap_or_default(),
                extension: if extended { Some(self.extension(kind)?) } else { None },
                intensity: between("intensity", self.intensity, 0.0, 16.0, "")?.unwrap_or(1.0),
                scale,
                smoothing,
            }),
        })
    }

    fn screen_space(&self, kind: Kind) -> Result<ScreenSpace, String> {
        let mut method = if kind == Kind::Gtao { ScreenSpace::GTAO } else { ScreenSpace::HBAO };
        method.radius = self.radius;
        method.falloff = self.falloff.unwrap_or(method.falloff);
        if !matches!(method.falloff, Falloff::Step | Falloff::Quadratic | Falloff::LinearTail { .. }) {
            return Err(format!("kind '{kind}' takes falloff 'step', 'quadratic' or {{ linear-tail = {{ tail }} }}"));
        }
        for (field, given, most, value) in [
            ("steps", self.steps, ScreenSpace::MOST_STEPS, &mut method.steps),
            ("sample_power", self.sample_power, 4, &mut method.sample_power),
        ] {
            *value = given.unwrap_or(*value);
            if !(1..=most).contains(value) {
                return Err(format!("{field} is {value}: it must be from 1 to {most}"));
            }
        }
        for (field, given, value) in [
            ("radius_multiplier", self.radius_multiplier, &mut method.radius_multiplier),
            ("intensity", self.intensity, &mut method.intensity),
        ] {
            *value = between(field, given, 0.0, 16.0, "")?.unwrap_or(*value);
        }
        match &mut method.integral {
            Integral::Hbao { tangent_bias } => {
                *tangent_bias = self.tangent_bias.unwrap_or(*tangent_bias);
                if !(0.0..90.0).contains(tangent_bias) {
                    return Err(format!("tangent_bias is {tangent_bias} degrees: it must be at least 0 and below 90"));
                }
            }
            Integral::Gtao { thickness } => {
                *thickness = between("thickness", self.thickness, 0.0, 1e6, " m")?;
                if thickness.is_some() && method.falloff != Falloff::Step {
                    return Err("thickness goes with falloff 'step' alone: a sector is open or closed".into());
                }
            }
        }
        Ok(method)
    }

    /// With the options of a method in screen space that are not as they would be
    /// anyway.
    fn with_screen_space(self, s: &ScreenSpace) -> EstimatorFile {
        let (usual, tangent_bias, thickness) = match s.integral {
            Integral::Gtao { thickness } => (ScreenSpace::GTAO, None, thickness),
            Integral::Hbao { tangent_bias } => (ScreenSpace::HBAO, Some(tangent_bias), None),
        };
        EstimatorFile {
            falloff: Some(s.falloff).filter(|f| *f != usual.falloff),
            intensity: Some(s.intensity).filter(|i| *i != usual.intensity),
            radius: s.radius,
            steps: Some(s.steps).filter(|n| *n != usual.steps),
            sample_power: Some(s.sample_power).filter(|p| *p != usual.sample_power),
            radius_multiplier: Some(s.radius_multiplier).filter(|m| *m != usual.radius_multiplier),
            tangent_bias: tangent_bias.filter(|_| s.integral != usual.integral),
            thickness,
            ..self
        }
    }

    fn extension(&self, kind: Kind) -> Result<Extension, String> {
        let receiver_plane =
            self.receiver_plane.ok_or_else(|| format!("kind '{kind}' needs receiver_plane, 'counts' or 'clipped'"))?;
        let secondary_rays = self.secondary_rays.unwrap_or(SECONDARY_RAYS);
        if !(1..=Extension::MOST).contains(&secondary_rays) {
            return Err(format!("secondary_rays is {secondary_rays}: it must be from 1 to {}", Extension::MOST));
        }
        Ok(Extension {
            receiver_plane,
            secondary_rays,
            sides: self.secondary_sides.unwrap_or_default(),
            origin: self.secondary_origin.unwrap_or_default(),
        })
    }
}

/// What a kind with falloff is called where that is the step.
fn of_step(kind: Kind) -> Kind {
    if kind == Kind::Obscurance { Kind::Classic } else { Kind::Extended }
}

fn legal(falloff: Falloff) -> Result<Falloff, String> {
    match falloff {
        Falloff::Step | Falloff::Quadratic => {}
        Falloff::Exponential { extinction } => {
            between("falloff.exponential.extinction", Some(extinction), 0.0, 1e6, " 1/m")?;
        }
        Falloff::LinearTail { tail } => {
            between("falloff.linear-tail.tail", Some(tail), 0.0, 1.0, "")?;
        }
        Falloff::Gaussian { lambda, floor, reflectance } => {
            between("falloff.gaussian.lambda", Some(lambda), 0.0, 100.0, "")?;
            for (field, value) in [("floor", floor), ("reflectance", reflectance)] {
                if !(0.0..1.0).contains(&value) {
                    return Err(format!("falloff.gaussian.{field} is {value}: it must be at least 0 and below 1"));
                }
            }
        }
    }
    Ok(falloff)
}

/// A number above `low` and at most `high`.
fn between(field: &str, value: Option<f32>, low: f32, high: f32, unit: impl Display) -> Result<Option<f32>, String> {
    match value {
        Some(v) if !(v > low && v <= high) => {
            Err(format!("{field} is {v}{unit}: it must be above {low} and at most {high}{unit}"))
        }
        _ => Ok(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn build(text: &str) -> Result<(Estimator, Option<Rays>), String> {
        toml::from_str::<EstimatorFile>(text).map_err(|e| e.to_string())?.build()
    }

    #[test]
    fn presets_are_what_they_are_documented_to_be() {
        let names: Vec<String> = presets().unwrap().into_keys().collect();
        assert_eq!(
            names,
            [
                "microsoft-sample",
                "paper-32",
                "paper-4",
                "unity-high",
                "unity-low",
                "unity-medium",
                "unreal-default",
                "xegtao-high"
            ]
        );
        for name in &names {
            build(&format!("preset = '{name}'")).unwrap();
        }
        let (unity, rays) = build("preset = 'unity-high'").unwrap();
        let Estimator::Openness(o) = unity else { panic!("{unity:?}") };
        assert_eq!((o.faces, o.scale.radius, rays.map(Rays::get)), (Faces::Front, Some(20.0), Some(8)));
        let (near, rays) = build("preset = 'unity-high'\nradius = 1.0\nrays = 4").unwrap();
        let Estimator::Openness(o) = near else { panic!("{near:?}") };
        assert_eq!((o.scale.radius, rays.map(Rays::get)), (Some(1.0), Some(4)));
        assert_eq!(build("preset = 'paper-4'").unwrap().0, Estimator::extended(ReceiverPlane::Counts));
        let (shipped, _) = build("preset = 'microsoft-sample'\ndenoise = {}").unwrap();
        let Estimator::Openness(o) = shipped else { panic!("{shipped:?}") };
        assert_eq!(o.smoothing, Smoothing { temporal: None, denoise: Some(Denoise::default()) });
    }

    /// A method is the same after its options have been to disk and back, and the
    /// paper's have no more words than they need.
    #[test]
    fn a_method_is_known_by_its_options() {
        for text in [
            "kind = 'classic'",
            "kind = 'classic'\nfaces = 'front'\nintensity = 2.0\nradius = 3.0",
            "kind = 'extended'\nreceiver_plane = 'clipped'\nsecondary_radius = 0.1\nsecondary_rays = 5",
            "kind = 'extended-obscurance'\nfalloff = { linear-tail = { tail = 0.5 } }\nreceiver_plane = 'counts'\n\
             secondary_sides = 'one'\nsecondary_origin = 'jittered'",
            "kind = 'classic'\ntemporal = { frames = 8, blend = 0.2, motion = [0.7, -0.3] }",
            "kind = 'extended'\nreceiver_plane = 'counts'\ntemporal = {}\n\
             denoise = { passes = 2, normal = 0.2, plane = 3.0, openness = 1.0 }",
            "kind = 'local-indirect'\nfalloff = { exponential = { extinction = 4.0 } }",
            "kind = 'path-traced'",
            "kind = 'hbao'",
            "kind = 'gtao'\nthickness = 0.02",
            "kind = 'hbao'\ntangent_bias = 30.0\nfalloff = 'step'\nsteps = 4",
            "kind = 'gtao'\nradius_multiplier = 1.457\nfalloff = { linear-tail = { tail = 0.615 } }\nsample_power = 2\n\
             intensity = 2.2\nradius = 0.5\nsteps = 3",
        ] {
            let (estimator, _) = build(text).unwrap();
            let file = EstimatorFile::of(&estimator);
            assert_eq!(file, toml::from_str(text).unwrap());
            let json = serde_json::to_string(&file).unwrap();
            assert_eq!(serde_json::from_str::<EstimatorFile>(&json).unwrap(), file);
        }
        let json = serde_json::to_string(&EstimatorFile::of(&Estimator::extended(ReceiverPlane::Counts))).unwrap();
        assert_eq!(json, r#"{"kind":"extended","receiver_plane":"counts"}"#);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, says) in [
            ("", "give kind or preset"),
            ("kind = 'classic'\npreset = 'paper-4'", "not both"),
            ("preset = 'unity'", "unity-low"),
            ("kind = 'classic'\nreceiver_plane = 'counts'", "receiver_plane means nothing for kind 'classic'"),
            ("kind = 'extended'", "needs receiver_plane"),
            ("kind = 'obscurance'", "needs falloff"),
            ("kind = 'obscurance'\nfalloff = 'step'", "'classic'"),
            ("kind = 'obscurance'\nfalloff = { exponential = { extinction = 0 } }", "extinction is 0 1/m"),
            ("kind = 'obscurance'\nfalloff = { linear-tail = { tail = 1.5 } }", "tail is 1.5"),
            ("kind = 'obscurance'\nfalloff = { gaussian = { lambda = 2, floor = 1, reflectance = 0 } }", "floor is 1"),
            ("kind = 'classic'\nintensity = -1", "intensity is -1"),
            ("kind = 'classic'\nradius = nan", "radius is NaN m"),
            ("kind = 'extended'\nreceiver_plane = 'counts'\nsecondary_rays = 9", "1 to 8"),
            ("kind = 'path-traced'\nradius = 1", "radius means nothing"),
            ("kind = 'classic'\ntemporal = { frames = 1 }", "temporal.frames is 1: it must be from 2 to 256"),
            ("kind = 'classic'\ntemporal = { blend = 0 }", "temporal.blend is 0: it must be above 0 and at most 1"),
            ("kind = 'classic'\ntemporal = { motion = [0, nan] }", "temporal.motion is NaN: it must be from -64 to 64"),
            ("kind = 'classic'\ntemporal = { motions = [0, 1] }", "motions"),
            ("kind = 'classic'\ndenoise = { passes = 9 }", "denoise.passes is 9: it must be from 1 to 8"),
            ("kind = 'classic'\ndenoise = { normal = 3 }", "denoise.normal is 3: it must be above 0 and at most 2"),
            ("kind = 'classic'\ndenoise = { plane = 0 }", "denoise.plane is 0"),
            ("kind = 'classic'\ndenoise = { openness = -1 }", "denoise.openness is -1"),
            ("kind = 'path-traced'\ndenoise = {}", "denoise means nothing for kind 'path-traced'"),
            ("kind = 'local-indirect'\ntemporal = {}", "temporal means nothing for kind 'local-indirect'"),
            ("kind = 'gtao'\nfaces = 'front'", "faces means nothing for kind 'gtao'"),
            ("kind = 'gtao'\ntangent_bias = 10", "tangent_bias means nothing for kind 'gtao'"),
            ("kind = 'hbao'\ntangent_bias = 90", "tangent_bias is 90 degrees"),
            ("kind = 'hbao'\nthickness = 1", "thickness means nothing for kind 'hbao'"),
            ("kind = 'gtao'\nthickness = 0", "thickness is 0 m"),
            ("kind = 'gtao'\nthickness = 1\nfalloff = 'quadratic'", "falloff 'step' alone"),
            ("kind = 'hbao'\nsteps = 65", "steps is 65: it must be from 1 to 64"),
            ("kind = 'hbao'\nsample_power = 0", "sample_power is 0"),
            ("kind = 'hbao'\nradius_multiplier = 0", "radius_multiplier is 0"),
            ("kind = 'hbao'\nreceiver_plane = 'counts'", "receiver_plane means nothing for kind 'hbao'"),
            ("kind = 'gtao'\nfalloff = { exponential = { extinction = 4.0 } }", "kind 'gtao' takes falloff 'step'"),
            ("kind = 'classic'\nsteps = 4", "steps means nothing for kind 'classic'"),
            ("kind = 'clasic'", "classic"),
            ("kind = 'classic'\ncolour = 1", "colour"),
        ] {
            let message = build(text).unwrap_err();
            assert!(message.contains(says), "{text}: {message}");
        }
    }
}
