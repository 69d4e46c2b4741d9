//! Two files: read, cut, measured and judged.

use super::{
    CompareError, Difference, Drawn, Exact, Layer, Mask, Measured, Mode, PairReport, Rect, Settings, Weights,
    check_alpha, check_encodings, check_origins,
    difference::Stored,
    exact, exact_images,
    sampled::{Sampled, WelchReport},
};
use crate::{
    layers::{Layers, load},
    metrics::image::{Encoding, Image, ImageError, Pair, scores},
    picture::read::{self, Found, LayerChoice},
    stats::pixel_p_values,
};
use std::{collections::BTreeMap, path::Path};

/// Two files and what they are called.
pub(super) struct Files<'a> {
    pub(super) reference: &'a Path,
    pub(super) test: &'a Path,
    /// What reports call the pair, and limits match.
    pub(super) name: &'a str,
    /// The path of its mask within a folder of masks.
    pub(super) mask: Option<&'a str>,
}

/// A layer of both images, or why there is none.
type NamedLayer = (String, Result<(Found, Found), CompareError>);

/// Is given every pair that is drawn.
type Keep<'a> = dyn FnMut(&PairReport, &Drawn<'_>) -> Result<(), CompareError> + 'a;

impl Files<'_> {
    /// One report, or one a layer.
    pub(super) fn compare(&self, settings: &Settings, keep: &mut Keep<'_>) -> Result<Vec<PairReport>, CompareError> {
        let (reference, test) = rayon::join(|| load(self.reference), || load(self.test));
        let (reference, test) = (reference?, test?);
        let mask = self.mask(settings.mask.as_ref())?;
        if settings.mode == Mode::Exact {
            let found = self.exact(&reference, &test, settings, mask.as_ref(), keep);
            if let Some(report) = found.map_err(|e| self.between(e))? {
                return Ok(vec![report]);
            }
        }
        let (ours, theirs) = rayon::join(
            || read::decode(self.reference, &reference, choice(&settings.layer), settings.encoding),
            || read::decode(self.test, &test, choice(&settings.layer), settings.encoding),
        );
        let (ours, theirs) = (ours?, theirs?);
        let sampled = self.sampled(&reference, &test, settings)?;
        let same = reference == test;
        drop((reference, test));
        self.layers(ours, theirs, settings.layer == Layer::All)
            .into_iter()
            .map(|(layer, pair)| {
                let report =
                    pair.and_then(|(r, t)| self.layer(&layer, &r, &t, settings, mask.as_ref(), sampled.as_ref(), keep));
                match report {
                    // One layer that cannot be compared leaves the others.
                    Err(e) if settings.layer == Layer::All && !matches!(e, CompareError::Disk(_)) => {
                        Ok(PairReport::failed(self.name, Some(layer), &e))
                    }
                    Err(e) => Err(self.between(e)),
                    Ok(mut report) => {
                        if let Some(exact) = report.exact.as_mut().filter(|_| settings.mode == Mode::Exact) {
                            exact.identical_files = same;
                        }
                        Ok(report)
                    }
                }
            })
            .collect()
    }

    /// Names both files, where an error does not name its own.
    fn between(&self, e: CompareError) -> CompareError {
        match e {
            e @ CompareError::Disk(_) => e,
            e => {
                CompareError::Between { reference: self.reference.into(), test: self.test.into(), source: Box::new(e) }
            }
        }
    }

    /// Both images layer by layer, by name where all are compared.
    fn layers(&self, ours: Vec<Found>, theirs: Vec<Found>, all: bool) -> Vec<NamedLayer> {
        if !all {
            return ours.into_iter().zip(theirs).map(|(r, t)| (r.layer.clone(), Ok((r, t)))).collect();
        }
        let mut theirs: BTreeMap<String, Found> = theirs.into_iter().map(|t| (t.layer.clone(), t)).collect();
        let alone = |path: &Path| Err(CompareError::Layer { path: path.into() });
        let mut pairs: Vec<_> = ours
            .into_iter()
            .map(|r| {
                let name = r.layer.clone();
                let pair = theirs.remove(&name).map_or_else(|| alone(self.reference), |t| Ok((r, t)));
                (name, pair)
            })
            .collect();
        pairs.extend(theirs.into_keys().map(|name| (name, alone(self.test))));
        pairs
    }

    /// The pixel-exact metric on stored numbers; None where layers must be told apart
    /// first, which [`Files::layer`] does.
    fn exact(
        &self,
        reference: &[u8],
        test: &[u8],
        settings: &Settings,
        mask: Option<&Weights>,
        keep: &mut Keep<'_>,
    ) -> Result<Option<PairReport>, CompareError> {
        let region = &settings.region;
        let judged = |exact| PairReport::judged(self.name, None, exact, None, None, &settings.limits);
        let same = reference == test;
        if same && !settings.draw_exact {
            // A header that can be read; what follows it is the same in both.
            let size = read::size(self.reference, reference)?;
            let weights = region.weights(size, mask)?;
            return Ok(Some(judged(Exact::of_identical_files(size, region, weights.as_deref()))));
        }
        if read::is_exr(self.reference, reference) || read::is_exr(self.test, test) {
            return Ok(None);
        }
        if matches!(settings.layer, Layer::Named(_)) {
            return Err(crate::disk::DiskError::content(self.reference, "only OpenEXR images have layers").into());
        }
        let (ours, theirs) =
            rayon::join(|| read::decode_samples(self.reference, reference), || read::decode_samples(self.test, test));
        let (ours, theirs) = (ours?, theirs?);
        if ours.size != theirs.size {
            return Err(ImageError::Size { reference: ours.size, test: theirs.size }.into());
        }
        let weights = region.weights(ours.size, mask)?;
        let weights = weights.as_deref();
        let found = exact(&ours, &theirs, region, weights, settings.tolerance)?;
        let report = judged(Exact { identical_files: same, ..found });
        if settings.draw_exact {
            let [reference, test] = [Stored::Samples(&ours), Stored::Samples(&theirs)];
            let part = region.crop.unwrap_or(Rect::whole(ours.size));
            let difference = Difference { reference, test, part, weights, tolerance: settings.tolerance };
            keep(&report, &Drawn { difference, measured: None })?;
        }
        Ok(Some(report))
    }

    /// One layer of both.
    #[allow(clippy::too_many_arguments)] // what a layer is, and what all layers share
    fn layer(
        &self,
        layer: &str,
        reference: &Found,
        test: &Found,
        settings: &Settings,
        mask: Option<&Weights>,
        sampled: Option<&[Sampled; 2]>,
        keep: &mut Keep<'_>,
    ) -> Result<PairReport, CompareError> {
        let whole = reference.image.size();
        if whole != test.image.size() {
            return Err(ImageError::Size { reference: whole, test: test.image.size() }.into());
        }
        check_encodings(reference.image.encoding(), test.image.encoding())?;
        let note = check_alpha(reference, test)?;
        check_origins(reference.origin, test.origin)?;
        let region = &settings.region;
        let weights = region.weights(whole, mask)?;
        let weights = weights.as_deref().map(|w| region.cut(whole, w));
        let cut = |image: &Image| {
            let planes = image.planes().iter().map(|p| region.cut(whole, p).into_owned()).collect();
            Image::new(region.size(whole), planes, image.encoding())
        };
        let cut_out = if region.crop.is_some() { Some((cut(&reference.image)?, cut(&test.image)?)) } else { None };
        let (reference, test) = cut_out.as_ref().map_or((&reference.image, &test.image), |(r, t)| (r, t));
        let corner = region.crop.map_or([0, 0], |c| [c.x, c.y]);
        let exact = exact_images(reference, test, corner, weights.as_deref(), settings.tolerance)?;
        let layer = Some(layer.to_owned()).filter(|l| !l.is_empty());
        let difference = Difference {
            reference: Stored::Image(reference),
            test: Stored::Image(test),
            part: Rect::whole(reference.size()),
            weights: weights.as_deref(),
            tolerance: settings.tolerance,
        };
        if settings.mode == Mode::Exact {
            let report = PairReport::judged(self.name, layer, exact, None, None, &settings.limits).with_note(note);
            if settings.draw_exact {
                keep(&report, &Drawn { difference, measured: None })?;
            }
            return Ok(report);
        }
        let pair = Pair::new(reference, test, weights.as_deref())?;
        let (scores, maps) = scores(&pair, &settings.options)?;
        let size = scores.size.map(|n| n as u32);
        let welch = sampled.map(|sampled| WelchReport::of(size, sampled));
        let p = sampled.map(|[reference, test]| move || pixel_p_values(size, &test.sample(), &reference.sample()));
        let report = PairReport::judged(self.name, layer, exact, Some(scores), welch, &settings.limits).with_note(note);
        let measured = Measured { reference, test, maps: &maps, p: p.as_ref().map(|p| p as &dyn Fn() -> Vec<f64>) };
        keep(&report, &Drawn { difference, measured: Some(measured) })?;
        Ok(report)
    }

    /// The mask's weights: linear, the mean of its channels.
    fn mask(&self, mask: Option<&Mask>) -> Result<Option<Weights>, CompareError> {
        let Some(mask) = mask else {
            return Ok(None);
        };
        let within = self.mask.filter(|_| mask.path.is_dir()).map(|name| mask.path.join(name));
        let path = match &within {
            Some(path) if !path.exists() => return Ok(None),
            Some(path) => path,
            None => &mask.path,
        };
        let image = read::read(path, mask.layer.as_deref(), Some(Encoding::Linear))?.image;
        let planes = image.planes();
        let weight = |i: usize| planes.iter().map(|p| p[i]).sum::<f32>() / planes.len() as f32;
        let weights: Vec<f32> = (0..image.pixels()).map(weight).collect();
        match weights.iter().position(|w| !(0.0..=1.0).contains(w)) {
            Some(pixel) => Err(ImageError::Weight { pixel, weight: weights[pixel] }.into()),
            None => Ok(Some(Weights { size: image.size(), weights })),
        }
    }

    /// The replicates of two images of records, where both have two or more and the
    /// whole image is compared.
    fn sampled(
        &self,
        reference: &[u8],
        test: &[u8],
        settings: &Settings,
    ) -> Result<Option<[Sampled; 2]>, CompareError> {
        let is_mean = match &settings.layer {
            Layer::Main => true,
            Layer::Named(name) => name == "mean",
            Layer::All => false,
        };
        if !is_mean || settings.mode == Mode::Exact || !settings.region.is_whole() || settings.mask.is_some() {
            return Ok(None);
        }
        let replicates = |path: &Path, bytes: &[u8]| -> Result<Option<Sampled>, CompareError> {
            let is_replicate = |name: &String| name.starts_with("replicate-");
            if read::layer_names(path, bytes)?.iter().filter(|n| is_replicate(n)).count() < 2 {
                return Ok(None);
            }
            let Layers { layers, attributes, .. } = Layers::decode(path, bytes)?;
            let images = layers.into_iter().filter(|(name, _)| is_replicate(name)).map(|(_, values)| values).collect();
            Ok(Some(Sampled::new(images, attributes.get("rays").and_then(|r| r.parse().ok()))))
        };
        let Some(reference) = replicates(self.reference, reference)? else {
            return Ok(None);
        };
        Ok(replicates(self.test, test)?.map(|test| [reference, test]))
    }
}

fn choice(layer: &Layer) -> LayerChoice<'_> {
    match layer {
        Layer::Main => LayerChoice::Main,
        Layer::Named(name) => LayerChoice::Named(name),
        Layer::All => LayerChoice::All,
    }
}
