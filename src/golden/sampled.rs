//! An image with what statistics need to know of it.

use crate::{
    counted::counted,
    disk::DiskError,
    layers::Layers,
    stats::{IndependentPixels, Replicates, TILE},
};
use std::path::Path;

/// Mean and variance of an image over its replicates.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Mean over replicates a pixel; NaN where there is no number.
    pub mean: Vec<f32>,
    /// Variance over replicates a pixel.
    pub variance: Vec<f32>,
    /// Means of tiles in each replicate, of images whose pixels depend on each other.
    pub tiles: Option<TileMeans>,
    /// Independent replicates, 1 or more; an image of one is not a sample.
    pub replicates: u32,
    /// Primary rays a pixel in each; 0 where values are continuous.
    pub rays: u32,
    /// Seed of the replicates; None where it is not known, or where their random numbers are not ours.
    pub seed: Option<u32>,
}

/// The mean of every tile of 16 x 16 pixels in every replicate: what a comparison of
/// denoised or accumulated images needs, at 1/256 of the replicates' size.
#[derive(Clone, Debug, PartialEq)]
pub struct TileMeans {
    /// Tiles across and down.
    pub size: [u32; 2],
    /// A row of tiles a replicate, row by row from the top left; NaN where a tile holds
    /// no number.
    pub replicates: Vec<Vec<f32>>,
}

impl TileMeans {
    /// Takes the means over the pixels that are finite in all replicates.
    pub fn of([width, height]: [u32; 2], replicates: &[&[f32]]) -> Self {
        let size = [width.div_ceil(TILE), height.div_ceil(TILE)];
        let known = |i: usize| replicates.iter().all(|r| r.get(i).is_some_and(|v| v.is_finite()));
        let mut pixels: Vec<Vec<usize>> = vec![Vec::new(); size[0] as usize * size[1] as usize];
        for y in 0..height {
            for x in 0..width {
                let i = y as usize * width as usize + x as usize;
                if known(i) {
                    pixels[(y / TILE * size[0] + x / TILE) as usize].push(i);
                }
            }
        }
        let mean = |image: &[f32], tile: &[usize]| {
            (tile.iter().map(|&i| f64::from(image[i])).sum::<f64>() / tile.len() as f64) as f32
        };
        let of = |image: &&[f32]| pixels.iter().map(|tile| mean(image, tile)).collect();
        TileMeans { size, replicates: replicates.iter().map(of).collect() }
    }

    /// As text: an array a replicate, null where there is no number.
    pub(super) fn to_json(&self) -> String {
        serde_json::json!(self.replicates).to_string()
    }

    /// Reads [`TileMeans::to_json`] of an image of this resolution; None where it does
    /// not fit.
    pub(super) fn from_json([width, height]: [u32; 2], replicates: u32, text: &str) -> Option<Self> {
        let rows: Vec<Vec<Option<f32>>> = serde_json::from_str(text).ok()?;
        let size = [width.div_ceil(TILE), height.div_ceil(TILE)];
        let tiles = size[0] as usize * size[1] as usize;
        let fits = rows.len() == replicates as usize && rows.iter().all(|row| row.len() == tiles);
        let of = |row: Vec<Option<f32>>| row.into_iter().map(|v| v.unwrap_or(f32::NAN)).collect();
        fits.then(|| TileMeans { size, replicates: rows.into_iter().map(of).collect() })
    }
}

impl Sampled {
    /// An image by its replicates, one or more of `width` x `height` values, whose
    /// pixels may depend on each other.
    pub fn of_replicates(resolution: [u32; 2], replicates: &[&[f32]]) -> Self {
        let pixels = resolution[0] as usize * resolution[1] as usize;
        let (mut mean, mut variance) = (Vec::with_capacity(pixels), Vec::with_capacity(pixels));
        for i in 0..pixels {
            let values: Vec<f64> = replicates.iter().map(|r| r.get(i).map_or(f64::NAN, |v| f64::from(*v))).collect();
            let (m, v) = crate::stats::mean_variance(&values);
            mean.push(m as f32);
            variance.push(v as f32);
        }
        Sampled {
            resolution,
            mean,
            variance,
            tiles: Some(TileMeans::of(resolution, replicates)),
            replicates: replicates.len() as u32,
            rays: 0,
            seed: None,
        }
    }

    /// The image out of the layers of a record, which were read from `path`, by what the record
    /// says of it.
    pub(super) fn of_layers(
        (path, layers): (&Path, &Layers),
        replicates: u32,
        rays: u32,
        seed: Option<u32>,
        depends: bool,
    ) -> Result<Self, DiskError> {
        let tiles = if depends {
            let images: Vec<&[f32]> =
                layers.layers.iter().filter(|(n, _)| n.starts_with("replicate-")).map(|(_, v)| v.as_slice()).collect();
            if images.len() != replicates as usize {
                let why = format!("{} 'replicate-NNNN', {replicates} wanted", counted(images.len(), "layer", "layers"));
                return Err(DiskError::content(path, why));
            }
            Some(TileMeans::of(layers.resolution, &images))
        } else {
            None
        };
        Ok(Sampled {
            resolution: layers.resolution,
            mean: layer(layers, path, "mean")?,
            variance: layer(layers, path, "variance")?,
            tiles,
            replicates,
            rays,
            seed,
        })
    }

    /// Whether there is no noise to test with: one replicate, or no variance anywhere.
    pub fn is_deterministic(&self) -> bool {
        let still = |(m, v): (&f32, &f32)| !m.is_finite() || *v == 0.0;
        self.replicates < 2 || self.mean.iter().zip(&self.variance).all(still)
    }

    /// As independent pixels.
    pub fn pixels(&self) -> IndependentPixels<'_> {
        IndependentPixels {
            mean: &self.mean,
            variance: &self.variance,
            replicates: self.replicates,
            quantum: if self.rays > 0 { 1.0 / f64::from(self.rays) } else { 0.0 },
        }
    }
}

impl TileMeans {
    /// As an image of tiles. A ray moves the mean of a tile by a share of what it
    /// moves a pixel.
    pub(super) fn sample(&self, rays: u32) -> Replicates<'_> {
        let quantum = if rays > 0 { 1.0 / (f64::from(rays) * f64::from(TILE * TILE)) } else { 0.0 };
        Replicates { images: self.replicates.iter().map(Vec::as_slice).collect(), quantum }
    }
}

/// A layer that must be there.
pub(super) fn layer(layers: &Layers, path: &Path, name: &str) -> Result<Vec<f32>, DiskError> {
    layers
        .get(name)
        .map(<[f32]>::to_vec)
        .ok_or_else(|| DiskError::content(path, format!("there is no layer '{name}' in this image")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_means_and_survive_as_text() {
        let mut image: Vec<f32> = (0..20 * 17).map(|i| (i % 20) as f32).collect();
        image[16] = f32::NAN;
        let tiles = TileMeans::of([20, 17], &[&image, &[1.0; 20 * 17]]);
        assert_eq!(tiles.size, [2, 2]);
        // The first 16 columns have mean 7.5; the other 4 lack their 16 in one row.
        assert_eq!(tiles.replicates[0][0], 7.5);
        assert_eq!(tiles.replicates[0][1], (17.5 * 64.0 - 16.0) / 63.0);
        assert_eq!(tiles.replicates[1], [1.0; 4]);
        let text = tiles.to_json();
        assert_eq!(TileMeans::from_json([20, 17], 2, &text), Some(tiles));
        assert!(TileMeans::from_json([20, 17], 3, &text).is_none());
        assert!(TileMeans::from_json([40, 17], 2, &text).is_none());
        let nothing = TileMeans::of([4, 4], &[&[f32::NAN; 16]]);
        assert!(nothing.replicates[0][0].is_nan());
        assert!(TileMeans::from_json([4, 4], 1, &nothing.to_json()).unwrap().replicates[0][0].is_nan());
    }

    #[test]
    fn one_replicate_or_no_variance_is_deterministic() {
        let (a, b) = ([0.5f32, f32::NAN], [0.5f32, 0.25]);
        assert!(Sampled::of_replicates([2, 1], &[&a]).is_deterministic());
        assert!(Sampled::of_replicates([2, 1], &[&a, &b]).is_deterministic());
        assert!(!Sampled::of_replicates([2, 1], &[&[0.5, 0.5], &b]).is_deterministic());
    }
}
