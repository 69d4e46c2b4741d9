//! What a case's image is held against on the page.

use super::super::{ReportError, error_maps, layer};
use crate::{
    layers::Layers,
    metrics::{judge::too_noisy, regions::Region},
    record::{CaseRecord, Record, SceneRecord},
    stats::Estimate,
    viewer::{Detail, Named, Pair, PlaneId, Planes, flip_map, p_values},
};
use std::path::Path;

/// How far the scale of differences between two methods reaches.
const LIMIT_METHODS: f64 = 0.2;

/// An image whose noise is known: mean and standard error a pixel.
struct Measured {
    values: Vec<f32>,
    /// Variance of the mean a pixel, and its degrees of freedom.
    noise: Option<(Vec<f32>, f64)>,
}

impl Measured {
    fn at(&self, pixel: usize) -> Estimate {
        let (se, df) = match &self.noise {
            Some((variance, df)) => (f64::from(variance[pixel]).sqrt(), *df),
            None => (f64::NAN, 1.0),
        };
        Estimate { value: f64::from(self.values[pixel]), se, df }
    }
}

/// The images of a scene that cases are held against.
pub(crate) struct SceneImages<'a> {
    folder: &'a Path,
    record: &'a Record,
    scene: &'a SceneRecord,
    converged: Layers,
    look: Layers,
    /// Q, NaN where it is too noisy, and its relative standard error.
    q: Option<[Vec<f32>; 2]>,
}

/// How a pair is read, and the images it is of.
struct Terms<'a> {
    label: String,
    names: [String; 2],
    limit: f64,
    note: &'a str,
}

impl<'a> SceneImages<'a> {
    pub(crate) fn read(folder: &'a Path, record: &'a Record, scene: &'a SceneRecord) -> Result<Self, ReportError> {
        let read = |image: &str| Layers::read(&folder.join(image));
        let q = match &scene.judge {
            None => None,
            Some(judge) => {
                let layers = read(&judge.image)?;
                fits(&judge.image, layers.resolution, scene.resolution)?;
                let mut q = layer(&layers, &judge.image, "q")?;
                let se = layer(&layers, &judge.image, "q-relative-se")?;
                for (q, se) in q.iter_mut().zip(&se) {
                    if too_noisy(*se) {
                        *q = f32::NAN;
                    }
                }
                Some([q, se])
            }
        };
        let converged = read(&scene.image)?;
        fits(&scene.image, converged.resolution, scene.resolution)?;
        Ok(SceneImages { folder, record, scene, converged, look: read(&scene.look)?, q })
    }

    /// Regions and converged images.
    pub(crate) fn converged(&self) -> &Layers {
        &self.converged
    }

    /// The pairs of a case, that shown first being the first; none where it has no image.
    pub(crate) fn pairs(&self, case: &CaseRecord, planes: &mut Planes) -> Result<Vec<Pair>, ReportError> {
        let Some(own) = self.mean(case)? else { return Ok(Vec::new()) };
        let mut pairs = Vec::new();
        let name = format!("{}, {} rays x {}", case.case.estimator, case.case.rays, self.record.replicates(case));
        if let Some(q) = self.judged() {
            let terms = Terms {
                label: "against Q, what the occluder does to the light".into(),
                names: [name.clone(), "Q".into()],
                limit: error_maps::LIMIT_Q,
                note: "Red under the occluder is a false highlight. Flanks may differ by much: Q holds the direction of light. A checker \
                       is a pixel where Q is too noisy to show.",
            };
            pairs.push(self.measure(&terms, &own, &q, planes));
        }
        if let Some(values) = self.converged.get(&format!("converged-{}", case.case.estimator)) {
            let rays = self.record.suite.converged_rays;
            let converged = self.as_noisy_as(case, &own, values, rays);
            let terms = Terms {
                label: "against its converged image".into(),
                names: [name.clone(), format!("{}, {rays} rays, converged", case.case.estimator)],
                limit: error_maps::LIMIT_CONVERGED,
                note: "What is left of the noise, and what the renderer does to it. p-values take the converged image \
                       to be as noisy as that many rays of this case.",
            };
            pairs.push(self.measure(&terms, &own, &converged, planes));
        }
        for (other, label, note) in self.others(case) {
            let Some(theirs) = self.mean(other)? else { continue };
            let of = &other.case;
            let terms = Terms {
                label,
                names: [name.clone(), format!("{}, {}, {} rays", of.estimator, of.renderer, of.rays)],
                limit: if of.estimator == case.case.estimator { error_maps::LIMIT_CONVERGED } else { LIMIT_METHODS },
                note,
            };
            pairs.push(self.measure(&terms, &own, &theirs, planes));
        }
        pairs.extend(self.looked_at(&case.case.estimator, planes));
        Ok(pairs)
    }

    /// Q beside classic AO.
    pub(crate) fn of_judge(&self, planes: &mut Planes) -> Vec<Pair> {
        let classic = &self.record.suite.classic;
        let (Some(q), Some(values)) = (self.judged(), self.converged.get(&format!("converged-{classic}"))) else {
            return Vec::new();
        };
        let terms = Terms {
            label: format!("Q against {classic}"),
            names: ["Q".into(), format!("{classic}, converged")],
            limit: error_maps::LIMIT_Q,
            note: "Q is path-traced irradiance with the occluder over that without it; above 1 the occluder reflects light.",
        };
        let classic = Measured { values: values.to_vec(), noise: None };
        vec![self.measure(&terms, &q, &classic, planes)]
    }

    /// Other cases that this one is held against: the CPU's, and classic AO.
    fn others(&self, case: &CaseRecord) -> Vec<(&'a CaseRecord, String, &'static str)> {
        let own = &case.case;
        let find = |estimator: &str, renderer: &str| {
            let alike = |c: &&CaseRecord| {
                let c = &c.case;
                c.scene == own.scene && c.rays == own.rays && c.estimator == estimator && c.renderer == renderer
            };
            self.record.cases.iter().find(alike)
        };
        let mut others = Vec::new();
        if own.renderer != "cpu"
            && let Some(cpu) = find(&own.estimator, "cpu")
        {
            let note = "Both draw the same random numbers, so a renderer that does the same shows nothing here.";
            others.push((cpu, "against the CPU".to_owned(), note));
        }
        let classic = &self.record.suite.classic;
        if own.estimator != *classic
            && let Some(other) = find(classic, &own.renderer)
        {
            let note = "What the method changes. Both may share random numbers, so p-values are too large rather than too small.";
            others.push((other, format!("against {classic}"), note));
        }
        others
    }

    /// Mean of a case with its noise; None where it has no image.
    fn mean(&self, case: &CaseRecord) -> Result<Option<Measured>, ReportError> {
        let Some(image) = case.image.as_deref() else { return Ok(None) };
        let layers = Layers::read(&self.folder.join(image))?;
        fits(image, layers.resolution, self.scene.resolution)?;
        let replicates = self.record.replicates(case);
        let variance = layer(&layers, image, "variance")?;
        let of_mean = variance.iter().map(|v| v / replicates.max(1) as f32).collect();
        let noise = (replicates > 1).then(|| (of_mean, f64::from(replicates - 1)));
        Ok(Some(Measured { values: layer(&layers, image, "mean")?, noise }))
    }

    /// A converged image, of which the record keeps no variance, with the noise that as
    /// many rays of the case have: too much for Sobol samples, which converge faster.
    fn as_noisy_as(&self, case: &CaseRecord, own: &Measured, values: &[f32], rays: u32) -> Measured {
        let own_rays = f64::from(case.case.rays) * f64::from(self.record.replicates(case));
        let ratio = (own_rays / f64::from(rays.max(1))) as f32;
        let noise = own.noise.as_ref().map(|(v, df)| (v.iter().map(|v| v * ratio).collect(), *df));
        Measured { values: values.to_vec(), noise }
    }

    fn judged(&self) -> Option<Measured> {
        let [q, se] = self.q.as_ref()?;
        let variance = q.iter().zip(se).map(|(q, se)| (q * se).powi(2)).collect();
        let replicates = self.scene.judge.as_ref().map_or(2, |j| j.replicates.max(2));
        Some(Measured { values: q.clone(), noise: Some((variance, f64::from(replicates - 1))) })
    }

    fn measure(&self, terms: &Terms<'_>, test: &Measured, reference: &Measured, planes: &mut Planes) -> Pair {
        let resolution = self.scene.resolution;
        let p = (test.noise.is_some() && reference.noise.is_some())
            .then(|| p_values(test.values.len(), |i| test.at(i), |i| reference.at(i)));
        let mut pair = pair(terms, resolution, [&test.values, &reference.values], planes);
        pair.label = format!("measure view, {}", terms.label);
        pair.p = p.map(|p| planes.add(resolution, &p, Detail::Rounded));
        pair.regions = Some(self.regions(planes));
        pair.transect.clone_from(&self.scene.transect);
        pair
    }

    /// Which regions a pixel lies in, a bit each.
    fn regions(&self, planes: &mut Planes) -> PlaneId {
        let mut bits = vec![0u8; self.scene.resolution[0] as usize * self.scene.resolution[1] as usize];
        let regions = [Region::Footprint, Region::Left, Region::Right, Region::Far];
        for (i, region) in regions.into_iter().enumerate() {
            let mask = self.converged.get(&format!("region-{}", region.label())).unwrap_or_default();
            for (bits, inside) in bits.iter_mut().zip(mask) {
                *bits |= u8::from(*inside > 0.0) << i;
            }
        }
        let bits: Vec<f32> = bits.into_iter().map(f32::from).collect();
        planes.add(self.scene.resolution, &bits, Detail::Exact)
    }

    /// The picture from the look view beside that of classic AO; classic itself beside
    /// the next method.
    fn looked_at(&self, estimator: &str, planes: &mut Planes) -> Option<Pair> {
        let suite = &self.record.suite;
        let other = match estimator == suite.classic {
            true => suite.estimators.iter().find(|e| *e != estimator)?,
            false => &suite.classic,
        };
        let values = |name: &str| self.look.get(&format!("openness-{name}"));
        let (test, reference) = (values(estimator)?, values(other)?);
        let terms = Terms {
            label: format!("look view, against {other}"),
            names: [estimator.to_owned(), other.clone()],
            limit: LIMIT_METHODS,
            note: "As somebody in the scene sees it.",
        };
        Some(pair(&terms, self.look.resolution, [test, reference], planes))
    }
}

fn pair(terms: &Terms<'_>, resolution: [u32; 2], [test, reference]: [&[f32]; 2], planes: &mut Planes) -> Pair {
    let flip = flip_map(resolution, reference, test);
    let [test_name, reference_name] = terms.names.clone();
    Pair {
        label: terms.label.clone(),
        test: Named { name: test_name, plane: planes.add(resolution, test, Detail::Exact) },
        reference: Named { name: reference_name, plane: planes.add(resolution, reference, Detail::Exact) },
        flip: flip.map(|map| planes.add(resolution, &map, Detail::Rounded)),
        p: None,
        limit: terms.limit,
        regions: None,
        transect: Vec::new(),
        note: terms.note.to_owned(),
    }
}

fn fits(image: &str, found: [u32; 2], wanted: [u32; 2]) -> Result<(), ReportError> {
    if found == wanted {
        return Ok(());
    }
    Err(ReportError::Size { image: image.to_owned(), found, wanted })
}
