//! A golden's file: an OpenEXR image with its provenance.

use super::{Limits, Sampled, TileMeans, sampled::layer};
use crate::{
    disk::DiskError,
    layers::{Layers, pixel_hash},
    metrics::regions::Region,
    suite::is_own,
};
use schemars::JsonSchema;
use serde::Serialize;
use std::{collections::BTreeMap, path::Path};

/// What must be equal before a golden and an image can be compared at all.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Identity {
    /// The scene by name.
    pub scene: String,
    /// Its content hash.
    pub scene_hash: String,
    /// The estimator by name.
    pub estimator: String,
    /// What it computes: its options as JSON.
    pub definition: String,
    /// Primary rays a pixel in each replicate.
    pub rays: u32,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
}

/// Where a golden comes from. Nothing of this must be equal: it is what may differ
/// between an image and the golden it is held against.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Provenance {
    /// `cpu` or `gpu`.
    pub renderer: String,
    /// The processor, or the adapter with its driver.
    pub device: String,
    /// Version of the tool.
    pub tool: String,
    /// Seed of the replicates.
    pub seed: u32,
    /// Independent replicates.
    pub replicates: u32,
    /// Hash of the mean's pixels as they were approved; reading checks it.
    pub pixel_hash: String,
    /// Why it was accepted.
    pub reason: String,
}

/// An accepted image.
#[derive(Clone, Debug, PartialEq)]
pub struct Golden {
    /// What it is an image of.
    pub identity: Identity,
    /// Where it comes from.
    pub provenance: Provenance,
    /// The image.
    pub image: Sampled,
    /// Its regions, a list of pixels each.
    pub regions: BTreeMap<Region, Vec<usize>>,
    /// What may differ where there is no noise; the defaults unless given at approval.
    pub limits: Option<Limits>,
}

impl Golden {
    /// Reads a golden.
    ///
    /// # Errors
    /// Where it is missing, broken, a Git LFS pointer, lacks a layer or attribute, or its
    /// mean is not the one that was approved.
    pub fn read(path: &Path) -> Result<Golden, DiskError> {
        let golden = Golden::read_unchecked(path)?;
        golden.check(path)?;
        Ok(golden)
    }

    /// The same of whatever the file holds, to be looked at: its mean may be another than was approved, and its numbers
    /// may make no sense.
    ///
    /// # Errors
    /// Where it is missing, broken, a Git LFS pointer, or lacks a layer or attribute.
    pub fn read_unchecked(path: &Path) -> Result<Golden, DiskError> {
        let layers = Layers::read(path)?;
        let attribute = |name: &str| {
            layers
                .attributes
                .get(name)
                .cloned()
                .ok_or_else(|| DiskError::content(path, format!("the golden lacks the attribute '{name}'")))
        };
        let odd = |name: &str, text: &str, wanted: &str| {
            DiskError::content(path, format!("the golden's attribute '{name}' is '{text}', {wanted}"))
        };
        let number = |name: &str| {
            let text = attribute(name)?;
            text.parse::<u32>().map_err(|_| odd(name, &text, "no number"))
        };
        let (rays, seed, replicates) = (number("rays")?, number("seed")?, number("replicates")?);
        let tiles = match layers.attributes.get("tile-means") {
            None => None,
            Some(text) => Some(
                TileMeans::from_json(layers.resolution, replicates, text)
                    .ok_or_else(|| DiskError::content(path, "the golden's attribute 'tile-means' does not fit it"))?,
            ),
        };
        let limits = match layers.attributes.get("tolerance") {
            None => None,
            Some(text) => Some(text.parse().map_err(|e: String| odd("tolerance", text, &e))?),
        };
        let renderer = attribute("renderer")?;
        // Other programs draw numbers of their own, whatever seed they are given.
        let of_image = is_own(&renderer).then_some(seed);
        Ok(Golden {
            identity: Identity {
                scene: attribute("scene")?,
                scene_hash: attribute("scene-hash")?,
                estimator: attribute("estimator")?,
                definition: attribute("definition")?,
                rays,
                resolution: layers.resolution,
            },
            provenance: Provenance {
                renderer,
                device: attribute("device")?,
                tool: attribute("tool")?,
                seed,
                replicates,
                pixel_hash: attribute("pixel-hash")?,
                reason: attribute("reason")?,
            },
            image: Sampled {
                resolution: layers.resolution,
                mean: layer(&layers, path, "mean")?,
                variance: layer(&layers, path, "variance")?,
                tiles,
                replicates,
                rays,
                seed: of_image,
            },
            regions: regions(&layers),
            limits,
        })
    }

    fn check(&self, path: &Path) -> Result<(), DiskError> {
        let image = &self.image;
        let known = |v: f32| image.replicates < 2 || (v.is_finite() && v >= 0.0);
        let finite = image.mean.iter().any(|v| v.is_finite());
        let sane = image.mean.iter().zip(&image.variance).all(|(m, v)| m.is_nan() || known(*v));
        if image.replicates < 1 || image.rays < 1 || !finite || !sane {
            return Err(DiskError::content(
                path,
                "the golden's numbers make no sense: it needs a replicate or more, and finite means and variances",
            ));
        }
        let (approved, found) = (&self.provenance.pixel_hash, pixel_hash(&image.mean));
        if *approved != found {
            return Err(DiskError::content(
                path,
                format!(
                    "the golden's pixels are not those that were approved: their hash is {found}, its attribute \
                     'pixel-hash' is {approved}; restore the file, or approve it anew"
                ),
            ));
        }
        Ok(())
    }

    /// As layers with attributes.
    pub(super) fn to_layers(&self) -> Layers {
        let Golden { identity, provenance, image, .. } = self;
        let mut layers =
            Layers::new(image.resolution).with("mean", image.mean.clone()).with("variance", image.variance.clone());
        for (region, pixels) in &self.regions {
            let mut mask = vec![0.0; image.mean.len()];
            for &i in pixels {
                mask[i] = 1.0;
            }
            layers = layers.with(&format!("region-{}", region.label()), mask);
        }
        let mut attributes = vec![
            ("scene", identity.scene.clone()),
            ("scene-hash", identity.scene_hash.clone()),
            ("estimator", identity.estimator.clone()),
            ("definition", identity.definition.clone()),
            ("rays", identity.rays.to_string()),
            ("replicates", provenance.replicates.to_string()),
            ("seed", provenance.seed.to_string()),
            ("renderer", provenance.renderer.clone()),
            ("device", provenance.device.clone()),
            ("tool", provenance.tool.clone()),
            ("pixel-hash", pixel_hash(&image.mean)),
            ("reason", provenance.reason.clone()),
        ];
        attributes.extend(image.tiles.as_ref().map(|t| ("tile-means", t.to_json())));
        attributes.extend(self.limits.map(|l| ("tolerance", l.to_string())));
        layers.attributes.extend(attributes.into_iter().map(|(k, v)| (k.to_owned(), v)));
        layers
    }
}

/// The region masks among layers, a list of pixels each; not that of all pixels.
pub fn regions(layers: &Layers) -> BTreeMap<Region, Vec<usize>> {
    let kept = Region::ALL.into_iter().filter(|r| *r != Region::All);
    kept.filter_map(|region| {
        let mask = layers.get(&format!("region-{}", region.label()))?;
        Some((region, (0..mask.len()).filter(|&i| mask[i] > 0.0).collect()))
    })
    .collect()
}
