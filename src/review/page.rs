//! What is on the page of a review.

use super::Review;
use crate::{
    counted::counted,
    golden::{Checked, Golden, Outcome, Sampled, Verdict, sampled},
    record::{CaseRecord, Record, SceneRecord},
    report::{ReportError, html::SceneImages},
    stats::pixel_p_values,
    viewer::{self, Item, Page, Pair, Planes},
};

/// How far the scale of differences reaches.
const LIMIT: f64 = 0.1;

pub(super) fn html(review: &Review, token: &str) -> Result<String, ReportError> {
    let record = review.record();
    let mut planes = Planes::default();
    let mut items = Vec::new();
    let mut images: Option<(&SceneRecord, SceneImages<'_>)> = None;
    for (checked, case) in review.shown() {
        let Some(scene) = record.scenes.iter().find(|s| s.name == case.case.scene) else { continue };
        // Cases stand scene by scene, so each scene is read once.
        let mut of_scene = match images.take() {
            Some((own, read)) if own.name == scene.name => read,
            _ => SceneImages::found(&review.folder, record, scene)?,
        };
        items.push(item(review, checked, case, &mut of_scene, &mut planes)?);
        images = Some((scene, of_scene));
    }
    let rank = |outcome| ["error", "fail", "warn", "inconclusive", "pass"].iter().position(|o| *o == outcome);
    items.sort_by_key(|i| rank(i.outcome));
    let found = review.verification();
    let [fail, blind, missing, lost] =
        [Outcome::Fail, Outcome::Blind, Outcome::Missing, Outcome::Lost].map(|o| found.count(o));
    let store = review.store.folder().display().to_string();
    let page = Page {
        title: format!("Goldens of {}", record.suite.name),
        outcome: match (lost, fail + missing, blind) {
            (1.., ..) => "error",
            (_, 1.., _) => "fail",
            _ if found.has_unreadable() => "fail",
            (_, _, 1..) => "inconclusive",
            _ => "pass",
        },
        label: None,
        summary: found.summary(),
        notes: found.stale.iter().map(crate::golden::Stale::line).chain(lacking(review)).collect(),
        gates: Vec::new(),
        items,
        scenes: Vec::new(),
        plots: Vec::new(),
        words: Vec::new(),
        facts: facts(record, &store),
        review: Some(viewer::Review { token: token.to_owned(), store }),
    };
    Ok(page.html(&planes)?)
}

/// Says that the record's folder is not whole.
fn lacking(review: &Review) -> Option<String> {
    let scenes = &review.record().scenes;
    let images = scenes.iter().flat_map(|s| s.judge.iter().map(|j| &j.image).chain([&s.look]));
    let lacking = images.filter(|image| !review.folder.join(image).exists()).count();
    (lacking > 0).then(|| {
        format!(
            "The record lacks {} of the judge or of look views: what is compared with them is not shown.",
            counted(lacking, "image", "images")
        )
    })
}

fn facts(record: &Record, store: &str) -> Vec<[String; 2]> {
    vec![
        ["goldens".to_owned(), store.to_owned()],
        ["tool".to_owned(), format!("aogauge {}", record.tool)],
        ["suite".to_owned(), format!("{}, seed {}", record.suite.name, record.seed)],
        ["machine".to_owned(), format!("{}, {} {}", record.machine.cpu, record.machine.os, record.machine.arch)],
        ["GPU".to_owned(), record.machine.gpu.clone()],
    ]
}

fn item(
    review: &Review,
    checked: &Checked,
    case: &CaseRecord,
    of_scene: &mut SceneImages<'_>,
    planes: &mut Planes,
) -> Result<Item, ReportError> {
    let of = &case.case;
    let golden = Golden::read_unchecked(&checked.golden).ok();
    let mut pairs = Vec::new();
    match (&golden, &checked.verdict) {
        (Some(golden), Verdict::Compared(_)) => {
            let image = sampled(&review.folder, review.record(), case)?;
            pairs.push(pair(golden, &image, planes));
        }
        (Some(golden), Verdict::Unusable(_)) => {
            let image = sampled(&review.folder, review.record(), case)?;
            pairs.push(unusable(golden, &image, planes));
        }
        _ => {}
    }
    pairs.extend(of_scene.pairs(case, planes)?);
    let mut facts = Vec::new();
    if let Verdict::Unusable(why) = &checked.verdict {
        facts.push(["unusable because".to_owned(), why.clone()]);
    }
    facts.extend(checked.unreadable_beside().map(|u| ["cannot be read".to_owned(), u.why.clone()]));
    if let Some(golden) = &golden {
        let from = &golden.provenance;
        facts.extend([
            ["golden".to_owned(), checked.golden.display().to_string()],
            ["accepted because".to_owned(), from.reason.clone()],
            ["accepted from".to_owned(), format!("{}, {}, aogauge {}", from.renderer, from.device, from.tool)],
            [
                "its sample".to_owned(),
                format!("{}, seed {}", counted(from.replicates, "replicate", "replicates"), from.seed),
            ],
        ]);
    }
    let possible = case.error.is_none() && case.hash.is_some();
    let decided = review.decisions.iter().find(|(id, _)| *id == checked.case);
    let before = match (decided, &checked.rejected) {
        (Some((_, super::Decision::Approve)), _) => Some("Approved in this review.".to_owned()),
        (_, Some(why)) => Some(format!("This very image was rejected: {why}")),
        _ => None,
    };
    let first = review.approved(case);
    let approve = if possible {
        format!("{} {}", if first.exists() { "replaces" } else { "makes" }, first.display())
    } else {
        "There is no image to decide on.".to_owned()
    };
    Ok(Item {
        id: checked.case.clone(),
        scene: of.scene.clone(),
        estimator: of.estimator.clone(),
        renderer: of.renderer.clone(),
        origin: None,
        rays: of.rays,
        outcome: review.outcome(&checked.case),
        words: checked.text(),
        verdicts: Vec::new(),
        facts,
        pairs,
        decision: Some(viewer::Decision { approve, before, possible }),
    })
}

/// The image beside its golden. p-values are taken pixel by pixel: what pixels of one
/// replicate have to do with each other does not matter to a test of one.
fn pair(golden: &Golden, image: &Sampled, planes: &mut Planes) -> Pair {
    let size = image.resolution;
    let noisy = |s: &Sampled| s.replicates > 1;
    let p =
        (noisy(image) && noisy(&golden.image)).then(|| pixel_p_values(size, &image.pixels(), &golden.image.pixels()));
    let images = [("this image", image.mean.as_slice()), ("golden", golden.image.mean.as_slice())];
    Pair {
        label: "against its golden".into(),
        p: p.map(|p| planes.add_p_values(size, &p)),
        regions: Some(planes.add_regions(size, &golden.regions)),
        note: "Of 100 pixels that are alike, one has a p-value below 0.01 by chance.".into(),
        ..Pair::new(planes, size, images, LIMIT)
    }
}

/// The image beside a golden that it cannot be held against, to be looked at; one of another size is brought to the
/// image's by the nearest of its pixels.
fn unusable(golden: &Golden, image: &Sampled, planes: &mut Planes) -> Pair {
    let size = image.resolution;
    let [width, height] = golden.image.resolution;
    let (mut name, mut mean) = ("golden, unusable".to_owned(), golden.image.mean.clone());
    if golden.image.resolution != size {
        name = format!("golden, unusable: {width} x {height} pixels");
        let at = |i: u32, own: u32, of: u32| (u64::from(2 * i + 1) * u64::from(of) / u64::from(2 * own)) as usize;
        let row = |y: u32| at(y, size[1], height) * width as usize;
        mean = (0..size[1])
            .flat_map(|y| (0..size[0]).map(move |x| [x, y]))
            .map(|[x, y]| mean[row(y) + at(x, size[0], width)])
            .collect();
    }
    Pair {
        label: "beside its golden, which is unusable".into(),
        note: "The golden is shown as its file has it; nothing was tested.".into(),
        ..Pair::new(planes, size, [("this image", &image.mean), (&name, &mean)], LIMIT)
    }
}
