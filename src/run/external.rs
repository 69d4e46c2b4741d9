//! The images of an external renderer's case, one command an image.

use super::{
    faults, journal,
    rendering::{Images, Studio, moments},
    stop::{Clock, Halt},
};
use crate::{
    disk::{DiskError, write_whole},
    intake::{Declared, Finding, Held, Keys, Reference, agree, examine, meaning_of},
    layers::pixel_hash,
    metrics::regions::Regions,
    render::{
        Estimator,
        external::{Attempt, Capped, ExternalError, Ready, Shot},
    },
    scene_files::{self, SceneFiles},
    scenes::AoScale,
    suite::Case,
};
use std::{
    fs,
    io::{self, Read, Write},
    path::Path,
};

/// Of a case's log, so many bytes are kept of its beginning and of its end.
const MOST: usize = 1 << 20;

/// A scene on disk, as commands read it. It goes with this.
pub(super) struct Handed {
    folder: tempfile::TempDir,
    files: SceneFiles,
}

/// What is wrong with images that commands left, held against the converged image of their
/// method over the pixels that see a surface, and what is doubtful in the first of them. Codes are doubtful
/// alone where it is `declared` what numbers stand for.
pub(super) fn diagnosed(
    images: &[Vec<f32>],
    converged: &[f32],
    regions: &Regions,
    size: [u32; 2],
    declared: &Declared,
) -> [Vec<String>; 2] {
    let reference = Reference::over(converged, regions);
    let (mut wrong, mut doubtful) = (Vec::new(), Vec::new());
    let view = size.map(|side| side as usize);
    let mut findings: Vec<_> = images.iter().map(|image| examine(image, &reference, view, declared)).collect();
    // One command makes all of them in one way.
    let held: Vec<Held<'_>> =
        images.iter().map(|image| Held { image, reference: &reference.openness, width: view[0] }).collect();
    if findings.iter().flatten().any(Finding::is_meaning)
        && let Some(shared) = meaning_of(&held)
    {
        agree(&mut findings, &shared);
    }
    for (replicate, findings) in findings.into_iter().enumerate() {
        for finding in findings {
            let is_declared = declared.encoding.is_some() && finding.is_encoded();
            let told = finding.told(declared, Keys::Suite);
            if !finding.is_doubt() && !is_declared {
                wrong.push(format!("replicate {replicate}: {told}"));
            } else if replicate == 0 {
                doubtful.push(told);
            }
        }
        if !wrong.is_empty() {
            break;
        }
    }
    [wrong, doubtful]
}

/// One image and the seconds that its command took.
type Image = (Vec<f32>, f64);

impl Studio<'_> {
    /// Renders a case up to so many replicates. Retries are counted on the way.
    pub(super) fn external(
        &self,
        case: &Case,
        replicates: u32,
        known: Option<Images>,
        clock: &Clock<'_>,
        retries: &mut u32,
    ) -> Result<Images, Halt> {
        let ready = self.means.external.iter().find(|r| r.external.name == case.renderer);
        let ready = ready.ok_or_else(|| Halt::Failed(format!("nobody renders '{}' here", case.renderer)))?;
        let handed = self.handed.get_or_init(|| self.hand().map_err(|e| e.to_string()));
        let handed = handed.as_ref().map_err(|e| Halt::Failed(e.clone()))?;
        let path = self.journal.folder.path().join(journal::case_log(case));
        // What an earlier look at the case said stays.
        let mut log = if known.is_some() { earlier(&path) } else { Capped::new(MOST) };
        let ended = self.images(&Asked { case, ready, handed }, replicates, known, clock, retries, &mut log);
        if let Err(Halt::Failed(why)) = &ended {
            log.push(format!("=== {why}\n").as_bytes());
        }
        let written = write_whole(&path, |buffer| buffer.write_all(log.text().as_bytes()));
        let name = journal::case_log(case);
        match (ended, written) {
            (Err(Halt::Failed(why)), Ok(())) => Err(Halt::Failed(format!("{why}; its log is {name}"))),
            (Ok(_), Err(e)) => Err(Halt::Failed(e.to_string())),
            (ended, _) => ended,
        }
    }

    fn images(
        &self,
        of: &Asked<'_>,
        replicates: u32,
        known: Option<Images>,
        clock: &Clock<'_>,
        retries: &mut u32,
        log: &mut Capped,
    ) -> Result<Images, Halt> {
        let (mut images, mut seconds) = known.map_or_else(|| (Vec::new(), 0.0), |i| (i.replicates, i.seconds));
        for replicate in images.len() as u32..replicates {
            let image = self.image(of, replicate, clock, retries, log)?;
            let Some((values, took)) = image else { return Err(clock.halt("replicates", replicate, replicates)) };
            images.push(values);
            seconds += took;
        }
        let hash = pixel_hash(&moments(&images, self.set.view.pixels()).0);
        Ok(Images { replicates: images, hash, seconds, retries: *retries })
    }

    /// One image, tried as often as the suite says. None where the case may not go on.
    fn image(
        &self,
        of: &Asked<'_>,
        replicate: u32,
        clock: &Clock<'_>,
        retries: &mut u32,
        log: &mut Capped,
    ) -> Result<Option<Image>, Halt> {
        let tries = of.ready.external.retries + 1;
        let mut attempt = 1;
        loop {
            if !clock.may_go_on() {
                return Ok(None);
            }
            log.push(format!("=== replicate {replicate}, attempt {attempt} of {tries}\n").as_bytes());
            match self.attempt(of, replicate, clock, log) {
                Ok(image) => return Ok(image),
                Err(e) if attempt == tries => {
                    let times = if tries > 1 { format!(" (the last of {tries} attempts)") } else { String::new() };
                    return Err(Halt::Failed(format!("replicate {replicate}{times}: {e}")));
                }
                Err(e) => log.push(format!("--- {e}\n").as_bytes()),
            }
            attempt += 1;
            *retries += 1;
        }
    }

    fn attempt(
        &self,
        of: &Asked<'_>,
        replicate: u32,
        clock: &Clock<'_>,
        log: &mut Capped,
    ) -> Result<Option<Image>, ExternalError> {
        let set = self.set;
        let attempt = Attempt::new(of.handed.folder.path(), of.ready.external.format)?;
        let method = set.subject.method(of.case);
        let ao = scale(&set.subject.plan.suite.methods[method].estimator, set.scene.ao);
        let shot = Shot {
            scene: &of.handed.files.glb,
            scene_toml: &of.handed.files.toml,
            views: &of.handed.files.views,
            estimator: &of.case.estimator,
            rays: of.case.rays,
            radii: [ao.radius, ao.secondary_radius],
            resolution: set.view.resolution,
            seed: set.subject.plan.seed,
            replicate,
        };
        let image = of.ready.render(&shot, &attempt, &|| clock.may_go_on(), log)?;
        if let Some((values, _)) = &image {
            let regions = set.subject.regions(method);
            faults::check(values, |_| true, regions, replicate, set.view.resolution[0])
                .map_err(|e| ExternalError::Image(e.to_string()))?;
        }
        Ok(image)
    }

    /// Writes the scene for commands: where the run has it, near the origin.
    fn hand(&self) -> Result<Handed, DiskError> {
        let work = self.journal.folder.work().join("external");
        let work = std::path::absolute(&work).map_err(DiskError::io(&work, "find the folder"))?;
        // A killed run may have left its own.
        match fs::remove_dir_all(&work) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                return Err(DiskError::io(&work, "remove what an unfinished run left")(e));
            }
            _ => {}
        }
        fs::create_dir_all(&work).map_err(DiskError::io(&work, "create the folder"))?;
        let folder = tempfile::Builder::new().prefix("scene-").tempdir_in(&work);
        let folder = folder.map_err(DiskError::io(&work, "create a folder for the scene"))?;
        let files = scene_files::write(&self.set.scene, folder.path())?;
        Ok(Handed { folder, files })
    }
}

/// A case, who renders it, and where its scene lies.
struct Asked<'a> {
    case: &'a Case,
    ready: &'a Ready<'a>,
    handed: &'a Handed,
}

/// R and R' of a method, its own or the scene's.
fn scale(estimator: &Estimator, ao: AoScale) -> AoScale {
    match estimator {
        Estimator::Openness(o) => o.scale.on(ao),
        Estimator::LocalIndirect(l) => l.scale.on(ao),
        Estimator::ScreenSpace(s) => AoScale { radius: s.radius(ao), ..ao },
        Estimator::PathTraced => ao,
    }
}

/// The log that an earlier look left; what is beyond its own cap is no log of ours.
fn earlier(path: &Path) -> Capped {
    let mut log = Capped::new(MOST);
    let mut text = Vec::new();
    let plain = fs::symlink_metadata(path).is_ok_and(|found| found.is_file());
    let file = fs::File::open(path).ok().filter(|_| plain);
    if file.is_some_and(|f| f.take(3 * MOST as u64).read_to_end(&mut text).is_ok()) {
        log.push(&text);
    }
    log
}
