//! What is computed of two images before a page is made.

use super::{Detail, Named, Pair, PlaneId, Planes};
use crate::metrics::{
    image::{self, DEFAULT_PPD, Encoding, Image, flip},
    regions::Region,
};
use std::collections::BTreeMap;

/// Regions in the order of their bits in a plane.
const REGIONS: [Region; 4] = [Region::Footprint, Region::Left, Region::Right, Region::Far];

/// FLIP a pixel, at [`DEFAULT_PPD`] pixels a degree; NaN where either image holds no
/// number. None where there is nothing to compare.
fn flip_map([width, height]: [u32; 2], reference: &[f32], test: &[f32]) -> Option<Vec<f32>> {
    let plane =
        |values: &[f32]| Image::new([width as usize, height as usize], vec![values.to_vec()], Encoding::Linear).ok();
    let (reference, test) = (plane(reference)?, plane(test)?);
    let pair = image::Pair::new(&reference, &test, None).ok()?;
    let map = flip(&pair, DEFAULT_PPD).ok()?;
    let known = |i: usize| [&reference, &test].iter().all(|m| m.planes()[0][i].is_finite());
    Some(map.into_iter().enumerate().map(|(i, v)| if known(i) { v } else { f32::NAN }).collect())
}

impl Pair {
    /// Two images of one size, row by row from the top left, each with its name, and their
    /// FLIP; without p-values, regions and transect.
    pub fn new(
        planes: &mut Planes,
        resolution: [u32; 2],
        [(test_name, test), (reference_name, reference)]: [(&str, &[f32]); 2],
        limit: f64,
    ) -> Self {
        let flip = flip_map(resolution, reference, test);
        let mut named = |name: &str, values: &[f32]| Named {
            name: name.to_owned(),
            plane: planes.add(resolution, values, Detail::Exact),
        };
        let (test, reference) = (named(test_name, test), named(reference_name, reference));
        Pair {
            label: String::new(),
            test,
            reference,
            flip: flip.map(|map| planes.add(resolution, &map, Detail::Rounded)),
            p: None,
            limit,
            regions: None,
            transect: Vec::new(),
            note: String::new(),
        }
    }
}

impl Planes {
    /// Keeps p-values a pixel; what 32 bits cannot hold becomes 0.
    pub fn add_p_values(&mut self, resolution: [u32; 2], p: &[f64]) -> PlaneId {
        let p: Vec<f32> = p.iter().map(|p| *p as f32).collect();
        self.add(resolution, &p, Detail::Rounded)
    }

    /// Keeps which regions each pixel lies in, by their lists of pixels.
    pub fn add_regions(&mut self, resolution: [u32; 2], regions: &BTreeMap<Region, Vec<usize>>) -> PlaneId {
        let mut bits = vec![0u8; resolution[0] as usize * resolution[1] as usize];
        for (i, region) in REGIONS.iter().enumerate() {
            for &pixel in regions.get(region).into_iter().flatten() {
                if let Some(bits) = bits.get_mut(pixel) {
                    *bits |= 1 << i;
                }
            }
        }
        let bits: Vec<f32> = bits.into_iter().map(f32::from).collect();
        self.add(resolution, &bits, Detail::Exact)
    }
}
