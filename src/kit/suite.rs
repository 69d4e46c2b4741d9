//! The scenes of a suite, and what images of them are scored against.

use super::{
    KitError,
    manifest::{Manifest, ManifestScene, ManifestSelfCheck},
    scene, self_check,
};
use crate::{
    disk::{DiskError, write_json, write_whole},
    record::RecordFolder,
    run::{Means, Observer, Prepared},
    suite::Suite,
};
use minijinja::{Environment, Error, syntax::SyntaxConfig, value::Serde};
use std::{fs, io::Write, path::Path};

/// The folder of the scenes.
pub const SCENES: &str = "scenes";

/// The folder of what images are scored against.
pub const SCORING: &str = "scoring";

/// Where images are worked on until the kit is whole.
const WORK: &str = ".aogauge-kit";

/// Refuses a folder that holds anything but what an unfinished export left: a kit that changes
/// under images that were rendered for it would judge them wrongly.
///
/// # Errors
/// Where it holds something else or cannot be read.
fn check_empty(folder: &Path) -> Result<(), DiskError> {
    let mut entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(DiskError::io(folder, "use this as the folder of the kit")(e)),
    };
    if folder.join(WORK).exists() || entries.next().is_none() {
        return Ok(());
    }
    Err(DiskError::content(folder, "the folder is not empty: name another one for the kit, or remove it"))
}

/// Writes a kit: `scenes/NAME/` for what to render, `scoring/` for what images are scored
/// against, `kit.json` and `README.md`. What an unfinished export of the same suite left is
/// not rendered again.
///
/// # Errors
/// Where the folder holds something else, a file cannot be written, or something cannot be rendered.
pub fn write_suite(
    prepared: &Prepared<'_>,
    suite: &Suite,
    means: &Means<'_>,
    folder: &Path,
    observer: &dyn Observer,
) -> Result<(), KitError> {
    check_empty(folder)?;
    let plan =
        format!("{}\n{}\n", prepared.identity(&means.machine), crate::judge_cache::program().unwrap_or_default());
    let work = RecordFolder::resume(&folder.join(WORK), &plan)?;
    let scoring = folder.join(SCORING);
    let check = self_check::write(prepared.seed(), &folder.join(SCENES), &scoring)?;
    let references = prepared.write_references(means, &work, (&scoring, &[self_check::FILE]), observer)?;
    for scene in &suite.scenes {
        scene::write(scene, &folder.join(SCENES).join(&scene.name))?;
    }
    let id = references.id().to_owned();
    let scenes = references.scenes.into_iter();
    let manifest = Manifest::new(
        suite,
        &id,
        ManifestSelfCheck::new(SCENES, &check),
        scenes.map(|s| ManifestScene::new(SCENES, s.facts)).collect(),
    );
    let path = folder.join("README.md");
    let page = page(&manifest).map_err(|e| DiskError::content(&path, format!("the page cannot be made: {e}")))?;
    write_whole(&path, |out| out.write_all(page.as_bytes()))?;
    write_json(&folder.join("kit.json"), &manifest, "it")?;
    drop(work);
    let work = folder.join(WORK);
    Ok(fs::remove_dir_all(&work).map_err(DiskError::io(&work, "remove what the export alone needed"))?)
}

fn page(manifest: &Manifest) -> Result<String, Error> {
    let mut environment = Environment::new();
    environment.set_syntax(SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build()?);
    environment.add_filter("text", |text: String| crate::untrusted::markdown(&text));
    environment.render_str(include_str!("README.md.j2"), Serde(manifest))
}

#[cfg(test)]
mod tests {
    use crate::{intake::SELF_CHECK, scenes::Scene};

    /// The page says them outright.
    #[test]
    fn the_self_check_is_as_the_page_says() {
        let scene = Scene::from_toml("self-check", "self-check.toml", SELF_CHECK, None).unwrap();
        assert_eq!((scene.measure.resolution, scene.ao.radius), ([160, 120], 0.5));
        assert!(include_str!("README.md.j2").contains("160 x 120 pixels, R = 0.5 m"));
    }
}
