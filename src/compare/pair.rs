//! Two files: read, cut, measured and judged.

use super::{
    CompareError, Difference, Drawn, Exact, Layer, Mask, Measured, Mode, PairReport, Rect, Settings, Weights, channels,
    check_alpha, check_origins,
    difference::Stored,
    exact, exact_channels, exact_images, left_out,
    sampled::{Sampled, WelchReport},
};
use crate::{
    claim::MAX_BYTES,
    disk::DiskError,
    layers::{Layers, linear, load},
    metrics::image::{Encoding, Image, ImageError, Pair, scores},
    picture::{
        channel::Group,
        read::{self, Claim, Found, LayerChoice},
    },
    stats::pixel_p_values,
};
use std::{borrow::Cow, collections::BTreeMap, path::Path};

/// Two files and what they are called.
pub(super) struct Files<'a> {
    pub(super) reference: &'a Path,
    pub(super) test: &'a Path,
    /// What reports call the pair, and limits match.
    pub(super) name: &'a str,
    /// The path of its mask within a folder of masks.
    pub(super) mask: Option<&'a str>,
}

/// The bytes of two files.
struct Bytes<'a> {
    reference: &'a [u8],
    test: &'a [u8],
    /// Whether they are equal, and the same is taken of both.
    same: bool,
}

/// A layer of both images, or why there is none.
type Layered<T> = (String, Result<(T, T), CompareError>);

/// Is given every pair that is drawn.
type Keep<'a> = dyn FnMut(&PairReport, &Drawn<'_>) -> Result<(), CompareError> + 'a;

impl Files<'_> {
    /// One report, or one a layer.
    pub(super) fn compare(&self, settings: &Settings, keep: &mut Keep<'_>) -> Result<Vec<PairReport>, CompareError> {
        let (reference, test) = rayon::join(|| load(self.reference), || load(self.test));
        let (reference, test) = (reference?, test?);
        let settings = &self.settled(settings, [&reference, &test])?;
        // Two layers of one file are no two of the same.
        let same = reference == test && settings.own[0].layer == settings.own[1].layer;
        let bytes = Bytes { same, reference: &reference, test: &test };
        let size = self.claimed(&bytes, settings).map_err(|e| self.between(e))?;
        let mask = self.mask(settings.mask.as_ref(), size).map_err(|e| self.between(e))?;
        if settings.mode == Mode::Exact {
            return self.exact(&bytes, settings, mask.as_ref(), keep);
        }
        let decode = |side: usize, path: &Path, bytes: &[u8]| {
            let encoding = settings.own[side].encoding.or(settings.encoding);
            read::decode(path, bytes, choice(settings, side), encoding)
        };
        let (ours, theirs) = rayon::join(|| decode(0, self.reference, &reference), || decode(1, self.test, &test));
        let (ours, theirs) = (ours?, theirs?);
        let sampled = self.sampled(&reference, &test, settings)?;
        drop((reference, test));
        let pairs = self.pairs(ours, theirs, settings, |found| &found.layer);
        self.each(pairs, settings, |layer, r, t| {
            let (r, t) = in_one_light(r, t, settings)?;
            self.layer(layer, &r, &t, settings, mask.as_ref(), sampled.as_ref(), keep)
        })
    }

    /// The settings for these two files, which say outright whether all layers are meant.
    fn settled<'s>(
        &self,
        settings: &'s Settings,
        [reference, test]: [&[u8]; 2],
    ) -> Result<Cow<'s, Settings>, CompareError> {
        if settings.layer != Layer::MainOrAll {
            return Ok(Cow::Borrowed(settings));
        }
        // Exactly are compared all channels of a file together.
        let layer = match settings.mode {
            Mode::Metrics if !(read::has_main(self.reference, reference)? && read::has_main(self.test, test)?) => {
                Layer::All
            }
            _ => Layer::Main,
        };
        Ok(Cow::Owned(Settings { layer, ..settings.clone() }))
    }

    /// The size of both by their headers, where it is one, before anything is decoded.
    fn claimed(&self, bytes: &Bytes<'_>, settings: &Settings) -> Result<Option<[usize; 2]>, CompareError> {
        let [ours, theirs] = [read::claim(self.reference, bytes.reference)?, read::claim(self.test, bytes.test)?];
        if let (Some(reference), Some(test)) = (ours.size, theirs.size)
            && reference != test
        {
            return Err(ImageError::Size { reference, test }.into());
        }
        let of = |claim: &Claim| if settings.mode == Mode::Exact { claim.stored } else { claim.floats };
        let both = of(&ours).saturating_add(of(&theirs));
        // Of two files of the same bytes the rows of one are decoded, one by one.
        let passes = bytes.same && settings.mode == Mode::Exact && !settings.draw_exact;
        if both > MAX_BYTES && !passes {
            return Err(CompareError::Together { bytes: both, most: MAX_BYTES });
        }
        Ok(ours.size)
    }

    /// A report of each pair of layers.
    fn each<T>(
        &self,
        pairs: Vec<Layered<T>>,
        settings: &Settings,
        mut report: impl FnMut(&str, T, T) -> Result<PairReport, CompareError>,
    ) -> Result<Vec<PairReport>, CompareError> {
        let one = |(layer, pair): Layered<T>| match pair.and_then(|(r, t)| report(&layer, r, t)) {
            // One layer that cannot be compared leaves the others.
            Err(e) if settings.layer == Layer::All && !matches!(e, CompareError::Disk(_)) => {
                Ok(PairReport::failed(self.name, Some(layer), &e))
            }
            found => found.map_err(|e| self.between(e)),
        };
        pairs.into_iter().map(one).collect()
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
    fn pairs<T>(&self, ours: Vec<T>, theirs: Vec<T>, settings: &Settings, name: fn(&T) -> &String) -> Vec<Layered<T>> {
        if settings.layer != Layer::All {
            return ours.into_iter().zip(theirs).map(|(r, t)| (name(&r).clone(), Ok((r, t)))).collect();
        }
        let mut theirs: BTreeMap<String, T> = theirs.into_iter().map(|t| (name(&t).clone(), t)).collect();
        let alone = |path: &Path| Err(CompareError::Layer { path: path.into() });
        let mut pairs: Vec<_> = ours
            .into_iter()
            .map(|r| {
                let name = name(&r).clone();
                let pair = theirs.remove(&name).map_or_else(|| alone(self.reference), |t| Ok((r, t)));
                (name, pair)
            })
            .collect();
        pairs.extend(theirs.into_keys().map(|name| (name, alone(self.test))));
        pairs
    }

    /// The pixel-exact metric on stored numbers.
    fn exact(
        &self,
        bytes: &Bytes<'_>,
        settings: &Settings,
        mask: Option<&Weights>,
        keep: &mut Keep<'_>,
    ) -> Result<Vec<PairReport>, CompareError> {
        if read::is_exr(self.reference, bytes.reference) || read::is_exr(self.test, bytes.test) {
            return self.exact_layers(bytes, settings, mask, keep);
        }
        self.exact_samples(bytes, settings, mask, keep).map(|report| vec![report]).map_err(|e| self.between(e))
    }

    fn exact_samples(
        &self,
        bytes: &Bytes<'_>,
        settings: &Settings,
        mask: Option<&Weights>,
        keep: &mut Keep<'_>,
    ) -> Result<PairReport, CompareError> {
        let region = &settings.region;
        let judged = |exact| PairReport::judged(self.name, None, exact, None, None, &settings.limits);
        if let Some(path) = self.with_layer(settings) {
            return Err(DiskError::content(path, "only OpenEXR images have layers").into());
        }
        if bytes.same && !settings.draw_exact {
            // Two files that are broken alike are no images that are equal.
            let size = read::check_whole(self.reference, bytes.reference)?;
            let weights = region.weights(size, mask)?;
            return Ok(judged(Exact::of_identical_files(size, region, weights.as_deref())));
        }
        let (ours, theirs) = rayon::join(
            || read::decode_samples(self.reference, bytes.reference),
            || read::decode_samples(self.test, bytes.test),
        );
        let (ours, theirs) = (ours?, theirs?);
        if ours.size != theirs.size {
            return Err(ImageError::Size { reference: ours.size, test: theirs.size }.into());
        }
        let weights = region.weights(ours.size, mask)?;
        let weights = weights.as_deref();
        let found = exact(&ours, &theirs, region, weights, settings.tolerance)?;
        let report = judged(Exact { identical_files: bytes.same, ..found }).with_note(self.further(bytes)?);
        let stored = [Stored::Samples(&ours), Stored::Samples(&theirs)];
        drawn(report, stored, ours.size, weights, settings, keep)
    }

    /// What files that differ hold beside the one image that was compared.
    fn further(&self, bytes: &Bytes<'_>) -> Result<Option<String>, DiskError> {
        if bytes.same {
            return Ok(None);
        }
        let sides = [
            ("the reference", read::further(self.reference, bytes.reference)?),
            ("the test image", read::further(self.test, bytes.test)?),
        ];
        let told: Vec<String> =
            sides.iter().filter_map(|(of, what)| what.map(|what| format!("{what} of {of}"))).collect();
        Ok((!told.is_empty()).then(|| format!("not compared: {}", told.join("; "))))
    }

    /// The same of OpenEXR: all channels of all parts together, unless layers are asked
    /// for.
    fn exact_layers(
        &self,
        bytes: &Bytes<'_>,
        settings: &Settings,
        mask: Option<&Weights>,
        keep: &mut Keep<'_>,
    ) -> Result<Vec<PairReport>, CompareError> {
        let groups = |side: usize, path: &Path, bytes: &[u8]| -> Result<Vec<Group>, CompareError> {
            let whole = settings.layer != Layer::All && self.with_layer(settings).is_none();
            let choice = (!whole).then(|| choice(settings, side));
            if read::is_exr(path, bytes) || matches!(choice, Some(LayerChoice::Named(_))) {
                return Ok(read::channels(path, bytes, choice)?);
            }
            let channels = channels::of_samples(&read::decode_samples(path, bytes)?)?;
            Ok(vec![Group { layer: String::new(), channels }])
        };
        let (ours, theirs) = rayon::join(
            || groups(0, self.reference, bytes.reference),
            || if bytes.same { Ok(Vec::new()) } else { groups(1, self.test, bytes.test) },
        );
        let ours = ours.map_err(|e| self.between(e))?;
        let theirs = if bytes.same { ours.clone() } else { theirs.map_err(|e| self.between(e))? };
        let pairs = self.pairs(ours, theirs, settings, |group| &group.layer);
        self.each(pairs, settings, |layer, ours, theirs| {
            let (ours, theirs) = (&ours.channels[..], &theirs.channels[..]);
            let (region, tolerance) = (&settings.region, settings.tolerance);
            let size = channels::shape(ours, theirs)?;
            let weights = region.weights(size, mask)?;
            let weights = weights.as_deref();
            let found = exact_channels(ours, theirs, region, weights, tolerance)?;
            let layer = Some(layer.to_owned()).filter(|l| !l.is_empty());
            let found = Exact { identical_files: bytes.same, ..found };
            let report = PairReport::judged(self.name, layer, found, None, None, &settings.limits);
            drawn(report, [Stored::Channels(ours), Stored::Channels(theirs)], size, weights, settings, keep)
        })
    }

    /// The first file of which a layer is named.
    fn with_layer(&self, settings: &Settings) -> Option<&Path> {
        let named = |side: usize| matches!(choice(settings, side), LayerChoice::Named(_));
        [self.reference, self.test].into_iter().enumerate().find(|(side, _)| named(*side)).map(|(_, path)| path)
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
        let notes = [check_alpha(reference, test)?, left_out(reference, test, sampled.is_some())];
        let notes: Vec<String> = notes.into_iter().flatten().collect();
        let note = (!notes.is_empty()).then(|| notes.join("; "));
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
        let pair = Pair::new(reference, test, weights.as_deref())?;
        let (mut scores, maps) = scores(&pair, &settings.options)?;
        // Places are those of the whole image, as those of the exact metric.
        for summary in scores.maps.values_mut() {
            for at in [&mut summary.min_at, &mut summary.max_at] {
                *at = [at[0] + corner[0], at[1] + corner[1]];
            }
        }
        let size = scores.size.map(|n| n as u32);
        let welch = sampled.map(|sampled| WelchReport::of(size, sampled));
        let p = sampled.map(|[reference, test]| move || pixel_p_values(size, &test.sample(), &reference.sample()));
        let report = PairReport::judged(self.name, layer, exact, Some(scores), welch, &settings.limits).with_note(note);
        let measured = Measured { reference, test, maps: &maps, p: p.as_ref().map(|p| p as &dyn Fn() -> Vec<f64>) };
        keep(&report, &Drawn { difference, measured: Some(measured) })?;
        Ok(report)
    }

    /// The mask's weights: linear, the mean of its channels. Of another size than the
    /// images it is not decoded.
    fn mask(&self, mask: Option<&Mask>, size: Option<[usize; 2]>) -> Result<Option<Weights>, CompareError> {
        let Some(mask) = mask else {
            return Ok(None);
        };
        let within = self.mask.filter(|_| mask.path.is_dir()).map(|name| mask.path.join(name));
        let path = match &within {
            Some(path) if !path.exists() => return Ok(None),
            Some(path) => path,
            None => &mask.path,
        };
        let bytes = load(path)?;
        if let (Some(mask), Some(image)) = (read::claim(path, &bytes)?.size, size)
            && mask != image
        {
            return Err(ImageError::MaskSize { mask, image }.into());
        }
        let layer = mask.layer.as_deref().map_or(LayerChoice::Main, LayerChoice::Named);
        let mut found = read::decode(path, &bytes, layer, Some(Encoding::Linear))?;
        let image = found.pop().ok_or_else(|| DiskError::content(path, "the mask has no layer"))?.image;
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
            Layer::All | Layer::MainOrAll => false,
        };
        let is_mean = is_mean && settings.own.iter().all(|own| own.layer.is_none());
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

/// Hands the difference of stored numbers over to be drawn, where that is wanted.
fn drawn(
    report: PairReport,
    [reference, test]: [Stored<'_>; 2],
    size: [usize; 2],
    weights: Option<&[f32]>,
    settings: &Settings,
    keep: &mut Keep<'_>,
) -> Result<PairReport, CompareError> {
    if settings.draw_exact {
        let part = settings.region.crop.unwrap_or(Rect::whole(size));
        let difference = Difference { reference, test, part, weights, tolerance: settings.tolerance };
        keep(&report, &Drawn { difference, measured: None })?;
    }
    Ok(report)
}

/// What of a file is taken, of the reference (0) or the test image (1).
fn choice(settings: &Settings, side: usize) -> LayerChoice<'_> {
    match (&settings.own[side].layer, &settings.layer) {
        (Some(name), _) | (None, Layer::Named(name)) => LayerChoice::Named(name),
        (None, Layer::Main | Layer::MainOrAll) => LayerChoice::Main,
        (None, Layer::All) => LayerChoice::All,
    }
}

/// Both as linear light, where they are not of one encoding and that was said.
fn in_one_light(reference: Found, test: Found, settings: &Settings) -> Result<(Found, Found), CompareError> {
    let (ours, theirs) = (reference.image.encoding(), test.image.encoding());
    if ours == theirs {
        return Ok((reference, test));
    }
    if settings.own.iter().all(|own| own.encoding.is_none()) {
        return Err(CompareError::Encodings { reference: ours, test: theirs });
    }
    let linear = |found: Found| -> Result<Found, CompareError> {
        let image = &found.image;
        if image.encoding() == Encoding::Linear {
            return Ok(found);
        }
        let planes = image.planes().iter().map(|p| p.iter().map(|&v| linear(v)).collect()).collect();
        let image = Image::new(image.size(), planes, Encoding::Linear)?;
        Ok(Found { image, ..found })
    };
    Ok((linear(reference)?, linear(test)?))
}
