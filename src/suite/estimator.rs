//! `[[estimator]]`: a method with its options, or a preset.

use super::Rays;
use crate::render::{
    Estimator, Extension, Faces, Falloff, Kind, LocalIndirect, Openness, ReceiverPlane, Scale, SecondaryOrigin, Sides,
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
    #[serde(default)]
    pub name: String,
    /// The method.
    pub kind: Option<Kind>,
    /// Methods as engines and the paper set them: `unity-low`, `unity-medium`,
    /// `unity-high`, `unreal-default`, `microsoft-sample`, `paper-4`, `paper-32`.
    pub preset: Option<String>,
    /// Primary rays a pixel, in place of the suite's.
    pub rays: Option<Rays>,
    /// How much an occluder at a distance closes a ray, for `obscurance`,
    /// `extended-obscurance` and `local-indirect`.
    pub falloff: Option<Falloff>,
    /// Which side of a triangle closes a ray; both unless given.
    pub faces: Option<Faces>,
    /// Openness is taken to this power: above 0, at most 16; 1 unless given.
    pub intensity: Option<f32>,
    /// R in metres, in place of the scene's.
    pub radius: Option<f32>,
    /// R' in metres, in place of the scene's; a quarter of `radius` where that is
    /// given alone.
    pub secondary_radius: Option<f32>,
    /// For extended methods: whether the receiver closes secondary rays.
    pub receiver_plane: Option<ReceiverPlane>,
    /// For extended methods: secondary rays a primary ray, 1 to 8; 2 unless given.
    pub secondary_rays: Option<u32>,
    /// For extended methods: whether secondary rays go both ways from their
    /// origin; they do unless told otherwise.
    pub secondary_sides: Option<Sides>,
    /// For extended methods: where on the primary ray secondary rays start; in
    /// the middle unless given.
    pub secondary_origin: Option<SecondaryOrigin>,
}

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
        })
    }

    fn estimator(&self) -> Result<Estimator, String> {
        let kind = self.kind.ok_or("give kind or preset")?;
        let label = label(kind);
        let openness = !matches!(kind, Kind::LocalIndirect | Kind::PathTraced);
        let extended = matches!(kind, Kind::Extended | Kind::ExtendedObscurance);
        let falls = matches!(kind, Kind::Obscurance | Kind::ExtendedObscurance | Kind::LocalIndirect);
        for (field, given, allowed) in [
            ("falloff", self.falloff.is_some(), falls),
            ("faces", self.faces.is_some(), openness),
            ("intensity", self.intensity.is_some(), openness),
            ("radius", self.radius.is_some(), kind != Kind::PathTraced),
            ("secondary_radius", self.secondary_radius.is_some(), extended),
            ("receiver_plane", self.receiver_plane.is_some(), extended),
            ("secondary_rays", self.secondary_rays.is_some(), extended),
            ("secondary_sides", self.secondary_sides.is_some(), extended),
            ("secondary_origin", self.secondary_origin.is_some(), extended),
        ] {
            if given && !allowed {
                return Err(format!("{field} means nothing for kind '{label}'"));
            }
        }
        let scale = Scale { radius: self.radius, secondary_radius: self.secondary_radius };
        between("radius", self.radius, 0.0, 1e6, " m")?;
        between("secondary_radius", self.secondary_radius, 0.0, 1e6, " m")?;
        let falloff = match (self.falloff, kind) {
            (Some(Falloff::Step), Kind::Obscurance | Kind::ExtendedObscurance) => {
                return Err(format!("kind '{label}' with falloff 'step' is kind '{}'", label_of_step(kind)));
            }
            (Some(falloff), _) => legal(falloff)?,
            (None, Kind::Obscurance | Kind::ExtendedObscurance) => {
                return Err(format!(
                    "kind '{label}' needs falloff: {{ exponential = {{ extinction }} }}, {{ linear-tail = {{ tail }} }} \
                     or {{ gaussian = {{ lambda, floor, reflectance }} }}"
                ));
            }
            (None, _) => Falloff::Step,
        };
        Ok(match kind {
            Kind::PathTraced => Estimator::PathTraced,
            Kind::LocalIndirect => Estimator::LocalIndirect(LocalIndirect { falloff, scale }),
            _ => Estimator::Openness(Openness {
                falloff,
                faces: self.faces.unwrap_or_default(),
                extension: if extended { Some(self.extension(&label)?) } else { None },
                intensity: between("intensity", self.intensity, 0.0, 16.0, "")?.unwrap_or(1.0),
                scale,
            }),
        })
    }

    fn extension(&self, label: &str) -> Result<Extension, String> {
        let receiver_plane =
            self.receiver_plane.ok_or_else(|| format!("kind '{label}' needs receiver_plane, 'counts' or 'clipped'"))?;
        let secondary_rays = self.secondary_rays.unwrap_or(2);
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

/// What a kind is called in files.
fn label(kind: Kind) -> String {
    use clap::ValueEnum;
    kind.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned())
}

fn label_of_step(kind: Kind) -> String {
    label(if kind == Kind::Obscurance { Kind::Classic } else { Kind::Extended })
}

fn legal(falloff: Falloff) -> Result<Falloff, String> {
    match falloff {
        Falloff::Step => {}
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
            ["microsoft-sample", "paper-32", "paper-4", "unity-high", "unity-low", "unity-medium", "unreal-default"]
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
            ("kind = 'clasic'", "classic"),
            ("kind = 'classic'\ncolour = 1", "colour"),
        ] {
            let message = build(text).unwrap_err();
            assert!(message.contains(says), "{text}: {message}");
        }
    }
}
