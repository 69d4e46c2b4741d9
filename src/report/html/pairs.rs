//! What a case's image is held against on the page.

use super::super::{ReportError, error_maps, layer, masked_q};
use crate::{
    counted::counted,
    golden::regions,
    layers::Layers,
    record::{CaseRecord, Record, SceneRecord},
    stats::{IndependentPixels, pixel_p_values},
    viewer::{Pair, PlaneId, Planes},
};
use std::{collections::BTreeMap, path::Path};

/// How far the scale of differences between two methods reaches.
const LIMIT_METHODS: f64 = 0.2;

/// An image, with its noise where that is known.
struct Measured {
    values: Vec<f32>,
    /// Variance over replicates a pixel, and how many there are.
    noise: Option<(Vec<f32>, u32)>,
}

impl Measured {
    fn sample(&self) -> Option<IndependentPixels<'_>> {
        let (variance, replicates) = self.noise.as_ref()?;
        Some(IndependentPixels { mean: &self.values, variance, replicates: *replicates, quantum: 0.0 })
    }
}

/// The images of a scene that cases are held against.
pub(crate) struct SceneImages<'a> {
    folder: &'a Path,
    record: &'a Record,
    scene: &'a SceneRecord,
    converged: Layers,
    /// None where it is not there, in what [`SceneImages::found`] reads.
    look: Option<Layers>,
    /// Q, NaN where it is too noisy, and its relative standard error.
    q: Option<[Vec<f32>; 2]>,
    /// Which regions a pixel of the measure view lies in; kept when it is first asked for.
    regions: Option<PlaneId>,
    /// Pairs from the look view by estimator, likewise: all cases of one have the same.
    looked_at: BTreeMap<String, Option<Pair>>,
}

/// How a pair is read, and the images it is of.
struct Terms<'a> {
    label: String,
    names: [String; 2],
    limit: f64,
    note: &'a str,
}

impl<'a> SceneImages<'a> {
    /// All of them.
    pub(crate) fn read(folder: &'a Path, record: &'a Record, scene: &'a SceneRecord) -> Result<Self, ReportError> {
        Self::wanted(folder, record, scene, &|_| true)
    }

    /// What there is of them, as in an archive that does not keep the judge's image or that of the look view: pairs
    /// with those are left out. The scene's own must be there.
    pub(crate) fn found(folder: &'a Path, record: &'a Record, scene: &'a SceneRecord) -> Result<Self, ReportError> {
        Self::wanted(folder, record, scene, &|image| folder.join(image).exists())
    }

    fn wanted(
        folder: &'a Path,
        record: &'a Record,
        scene: &'a SceneRecord,
        is_wanted: &dyn Fn(&str) -> bool,
    ) -> Result<Self, ReportError> {
        let read = |image: &str| Layers::read(&folder.join(image));
        let q = match scene.judge.as_ref().filter(|judge| is_wanted(&judge.image)) {
            None => None,
            Some(judge) => {
                let layers = read(&judge.image)?;
                fits(&judge.image, layers.resolution, scene.resolution)?;
                Some(masked_q(&layers, &judge.image)?)
            }
        };
        let converged = read(&scene.image)?;
        fits(&scene.image, converged.resolution, scene.resolution)?;
        let look = is_wanted(&scene.look).then(|| read(&scene.look)).transpose()?;
        Ok(SceneImages { folder, record, scene, converged, look, q, regions: None, looked_at: BTreeMap::new() })
    }

    /// Regions and converged images.
    pub(crate) fn converged(&self) -> &Layers {
        &self.converged
    }

    /// The pairs of a case, that shown first being the first; none where it has no image.
    pub(crate) fn pairs(&mut self, case: &CaseRecord, planes: &mut Planes) -> Result<Vec<Pair>, ReportError> {
        let Some(own) = self.mean(case)? else { return Ok(Vec::new()) };
        let mut pairs = Vec::new();
        let name = format!(
            "{}, {} x {}",
            case.case.estimator,
            counted(case.case.rays, "ray", "rays"),
            self.record.replicates(case)
        );
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
                names: [name.clone(), format!("{}, {}, converged", case.case.estimator, counted(rays, "ray", "rays"))],
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
                names: [
                    name.clone(),
                    format!("{}, {}, {}", of.estimator, of.renderer, counted(of.rays, "ray", "rays")),
                ],
                limit: if of.estimator == case.case.estimator { error_maps::LIMIT_CONVERGED } else { LIMIT_METHODS },
                note,
            };
            pairs.push(self.measure(&terms, &own, &theirs, planes));
        }
        let estimator = &case.case.estimator;
        if !self.looked_at.contains_key(estimator) {
            let pair = self.look_at(estimator, planes);
            self.looked_at.insert(estimator.clone(), pair);
        }
        pairs.extend(self.looked_at.get(estimator).cloned().flatten());
        Ok(pairs)
    }

    /// Q beside classic AO.
    pub(crate) fn of_judge(&mut self, planes: &mut Planes) -> Vec<Pair> {
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
            let note = if own.is_external() {
                "Each draws random numbers of its own: what is left of the noise shows, too."
            } else {
                "Both draw the same random numbers, so a renderer that does the same shows nothing here."
            };
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
        let layers = case.layers(self.folder)?;
        fits(image, layers.resolution, self.scene.resolution)?;
        let replicates = self.record.replicates(case);
        let variance = layer(&layers, image, "variance")?;
        let noise = (replicates > 1).then_some((variance, replicates));
        Ok(Some(Measured { values: layer(&layers, image, "mean")?, noise }))
    }

    /// A converged image, of which the record keeps no variance, with the noise that as
    /// many rays of the case have: too much for Sobol samples, which converge faster.
    fn as_noisy_as(&self, case: &CaseRecord, own: &Measured, values: &[f32], rays: u32) -> Measured {
        let own_rays = f64::from(case.case.rays) * f64::from(self.record.replicates(case));
        let ratio = (own_rays / f64::from(rays.max(1))) as f32;
        let noise = own.noise.as_ref().map(|(v, n)| (v.iter().map(|v| v * ratio).collect(), *n));
        Measured { values: values.to_vec(), noise }
    }

    fn judged(&self) -> Option<Measured> {
        let [q, se] = self.q.as_ref()?;
        let replicates = self.scene.judge.as_ref().map_or(2, |j| j.replicates.max(2));
        let variance = q.iter().zip(se).map(|(q, se)| (q * se).powi(2) * replicates as f32).collect();
        Some(Measured { values: q.clone(), noise: Some((variance, replicates)) })
    }

    fn measure(&mut self, terms: &Terms<'_>, test: &Measured, reference: &Measured, planes: &mut Planes) -> Pair {
        let resolution = self.scene.resolution;
        let p = test.sample().zip(reference.sample()).map(|(t, r)| pixel_p_values(resolution, &t, &r));
        let regions = *self.regions.get_or_insert_with(|| planes.add_regions(resolution, &regions(&self.converged)));
        Pair {
            label: format!("measure view, {}", terms.label),
            p: p.map(|p| planes.add_p_values(resolution, &p)),
            regions: Some(regions),
            transect: self.scene.transect.clone(),
            ..pair(terms, resolution, [&test.values, &reference.values], planes)
        }
    }

    /// The picture from the look view beside that of classic AO; classic itself beside
    /// the next method.
    fn look_at(&self, estimator: &str, planes: &mut Planes) -> Option<Pair> {
        let suite = &self.record.suite;
        let other = match estimator == suite.classic {
            true => suite.estimators.iter().find(|e| *e != estimator)?,
            false => &suite.classic,
        };
        let look = self.look.as_ref()?;
        let values = |name: &str| look.get(&format!("openness-{name}"));
        let (test, reference) = (values(estimator)?, values(other)?);
        let terms = Terms {
            label: format!("look view, against {other}"),
            names: [estimator.to_owned(), other.clone()],
            limit: LIMIT_METHODS,
            note: "As somebody in the scene sees it.",
        };
        Some(pair(&terms, look.resolution, [test, reference], planes))
    }
}

fn pair(terms: &Terms<'_>, resolution: [u32; 2], [test, reference]: [&[f32]; 2], planes: &mut Planes) -> Pair {
    let images = [(terms.names[0].as_str(), test), (terms.names[1].as_str(), reference)];
    let (label, note) = (terms.label.clone(), terms.note.to_owned());
    Pair { label, note, ..Pair::new(planes, resolution, images, terms.limit) }
}

fn fits(image: &str, found: [u32; 2], wanted: [u32; 2]) -> Result<(), ReportError> {
    if found == wanted {
        return Ok(());
    }
    Err(ReportError::Size { image: image.to_owned(), found, wanted })
}
