//! What images are scored against: of every scene its regions, its judge and the converged
//! images of the suite's methods, in a folder. Scoring needs nothing else: no geometry, no
//! suite file, and nothing is rendered for it.

use super::{
    Means, Observer, Prepared, RunError,
    journal::{self, Journal},
    occluders::Occluder,
    on_screen::Shown,
    progress::Progress,
    rendering::{Rendered, Studio, Truth},
    set::Set,
    subject::{Facts, Subject},
    unit::{CONVERGED_REPLICATES, Unit},
};
use crate::{
    counted::counted,
    disk::{DiskError, read_json, read_text, write_json, write_whole},
    layers::{Layers, hex, short_hash},
    metrics::{
        artifact::Converged,
        regions::{Region, Regions},
    },
    record::{RecordFolder, ScreenRecord},
    suite::{Plan, Suite, SuiteError, SuiteFile},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::{
    collections::BTreeMap,
    io::Write,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

/// Version of the format, as it is written and read.
pub const VERSION: u32 = 1;

/// The suite: its gates may be edited, nothing else.
pub const SUITE: &str = "suite.toml";

/// The file that makes a folder one of references. It is written last.
pub const FILE: &str = "scoring.json";

/// Its content.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferencesFile {
    /// Version of this format.
    pub version: u32,
    /// Version of the tool that wrote it.
    pub tool: String,
    /// Name of the suite.
    pub suite: String,
    /// Seed of the judge and the converged images.
    pub seed: u32,
    /// SHA-256 of the suite beside this, without its gates.
    pub suite_hash: String,
    /// SHA-256 of other files beside this.
    pub files: BTreeMap<String, String>,
    /// The scenes, in the suite's order.
    pub scenes: Vec<SceneReferences>,
    /// SHA-256 of all of this but this.
    pub sha256: String,
}

impl ReferencesFile {
    /// What a kit is called by, so that another is told from it: [`ReferencesFile::sha256`] in short.
    pub fn id(&self) -> &str {
        short_hash(&self.sha256)
    }

    /// What [`ReferencesFile::sha256`] must be.
    fn seal(&self) -> Result<String, serde_json::Error> {
        let plain = ReferencesFile { sha256: String::new(), ..self.clone() };
        Ok(hex(&Sha256::digest(serde_json::to_string(&plain)?)))
    }
}

/// What [`ReferencesFile::suite_hash`] must be.
fn suite_hash(file: &SuiteFile) -> Result<String, serde_json::Error> {
    let plain = SuiteFile { gates: Vec::new(), ..file.clone() };
    Ok(hex(&Sha256::digest(serde_json::to_string(&plain)?)))
}

/// What there is of a scene; its images lie in a folder of its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneReferences {
    /// The scene.
    pub facts: Facts,
    /// Its occluders, where the view shows two or more.
    pub occluders: Vec<String>,
    /// The camera of screen-space methods, in suites with such methods.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub screen: Option<ScreenRecord>,
    /// SHA-256 of each image.
    pub images: BTreeMap<String, String>,
}

const REGIONS: &str = "regions.exr";
const JUDGE: &str = "judge.exr";
const LOOK: &str = "look.exr";

fn converged(method: &str) -> String {
    format!("converged-{method}.exr")
}

/// The layer of a region: of all occluders or of one, of the view or of what a screen shows.
fn layer(occluder: Option<usize>, shown: bool, region: Region) -> String {
    let of = occluder.map_or_else(|| "region".to_owned(), |i| format!("occluder-{i:03}"));
    let shown = if shown { "-shown" } else { "" };
    format!("{of}{shown}-{}", region.label())
}

/// Why references cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ReferencesError {
    /// There are none, or they are malformed or of another version.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// Their suite is.
    #[error(transparent)]
    Suite(#[from] SuiteError),
}

/// References as they were read.
#[derive(Debug)]
pub struct References {
    folder: PathBuf,
    file: ReferencesFile,
    suite: Suite,
    /// Images of scenes that are not loaded yet: each is read once.
    read: Mutex<BTreeMap<PathBuf, Arc<Layers>>>,
}

/// The images of one scene's references.
pub(super) struct Loaded {
    pub regions: Regions,
    pub occluders: Vec<Occluder>,
    pub on_screen: Option<Shown>,
    pub rendered: Rendered,
}

impl Prepared<'_> {
    /// Renders the references of a plan and writes them into a folder. Returns the list of them. `work` holds what is
    /// done, so that an unfinished one can go on. What lies `beside` them in the folder already is listed, too.
    ///
    /// # Errors
    /// Where a file cannot be written, or something cannot be rendered; [`RunError::Stopped`] where it was asked to stop.
    pub fn write_references(
        &self,
        means: &Means<'_>,
        work: &RecordFolder,
        (folder, beside): (&Path, &[&str]),
        observer: &dyn Observer,
    ) -> Result<ReferencesFile, RunError> {
        let cost = self.sets.iter().flat_map(|s| all_but_cases(s).into_iter().map(|u| super::step(s, &u).rays)).sum();
        let progress = Progress::new(observer, cost);
        let mut scenes = Vec::new();
        for set in &self.sets {
            let studio = Studio::new(set, means, Journal { folder: work }, &progress, None);
            let mut rendered = Rendered::default();
            studio.render(&all_but_cases(set), 0, &mut rendered)?;
            if means.stop.is_asked() {
                return Err(RunError::Stopped);
            }
            let name = &set.scene.name;
            let mut files = vec![(REGIONS.to_owned(), set.subject.masks())];
            rendered.check(name)?;
            for unit in all_but_cases(set) {
                let file = match &unit {
                    Unit::Judge => JUDGE.to_owned(),
                    Unit::Converged(m) => converged(&self.plan.suite.methods[*m].name),
                    Unit::Look | Unit::Case(_) => LOOK.to_owned(),
                };
                files.push((file, Layers::read(&work.path().join(journal::file(self.plan, name, &unit)))?));
            }
            let mut images = BTreeMap::new();
            for (file, layers) in files {
                let path = folder.join(name).join(&file);
                layers.write(&path)?;
                images.insert(file, journal::sha256(&path)?);
            }
            scenes.push(SceneReferences {
                facts: set.subject.facts.clone(),
                occluders: set.subject.occluders.iter().map(|o| o.name.clone()).collect(),
                screen: set.subject.on_screen.as_ref().map(|s| s.record.clone()),
                images,
            });
        }
        self.write_list(folder, beside, scenes)
    }

    /// Writes the suite, and the list with all hashes last.
    fn write_list(
        &self,
        folder: &Path,
        beside: &[&str],
        scenes: Vec<SceneReferences>,
    ) -> Result<ReferencesFile, RunError> {
        let path = folder.join(SUITE);
        let unwritten = |e: &dyn std::fmt::Display| DiskError::content(&path, format!("it cannot be written: {e}"));
        let suite = toml::to_string_pretty(&without_programs(&self.plan.suite.file)).map_err(|e| unwritten(&e))?;
        write_whole(&path, |buffer| buffer.write_all(suite.as_bytes()))?;
        // As it will be read.
        let suite: SuiteFile = toml::from_str(&suite).map_err(|e| unwritten(&e))?;
        let mut files = BTreeMap::new();
        for name in beside {
            files.insert((*name).to_owned(), journal::sha256(&folder.join(name))?);
        }
        let mut file = ReferencesFile {
            version: VERSION,
            tool: env!("CARGO_PKG_VERSION").to_owned(),
            suite: self.plan.suite.name.clone(),
            seed: self.plan.seed,
            suite_hash: suite_hash(&suite).map_err(|e| unwritten(&e))?,
            files,
            scenes,
            sha256: String::new(),
        };
        file.sha256 = file.seal().map_err(|e| unwritten(&e))?;
        write_json(&folder.join(FILE), &file, "the references")?;
        Ok(file)
    }
}

/// A suite without the programs that render for it: a kit is given to others, and has no use
/// for their command lines and environments. Gates on them alone go with them.
fn without_programs(file: &SuiteFile) -> SuiteFile {
    let mut file = file.clone();
    file.renderers.clear();
    file.gates.retain_mut(|gate| {
        let named = gate.renderers.len();
        gate.renderers.retain(|r| r == "cpu" || r == "gpu");
        named == 0 || !gate.renderers.is_empty()
    });
    file
}

/// Judge, converged images and pictures.
fn all_but_cases<'a>(set: &Set<'a>) -> Vec<Unit<'a>> {
    set.units().into_iter().filter(|u| !matches!(u, Unit::Case(_))).collect()
}

impl Rendered {
    /// Whether references can be made of it.
    fn check(&self, scene: &str) -> Result<(), RunError> {
        let judge = self.judge.iter().find_map(|j| j.as_ref().err().cloned());
        let look = self.look.iter().find_map(|l| l.as_ref().err().cloned());
        let fault = judge.or(look).or_else(|| self.truths.values().find_map(|t| t.fault.clone()));
        fault.map_or(Ok(()), |why| Err(RunError::Reference { scene: scene.to_owned(), why }))
    }
}

impl Subject<'_> {
    /// Every region as a mask.
    fn masks(&self) -> Layers {
        let pixels = self.facts.pixels();
        let mut layers = Layers::new(self.facts.resolution);
        let mut add = |occluder: Option<usize>, shown: bool, regions: &Regions| {
            for region in Region::ALL {
                let mask = regions.mask(region, pixels);
                layers.layers.insert(layer(occluder, shown, region), mask);
            }
        };
        add(None, false, &self.regions);
        if let Some(shown) = &self.on_screen {
            add(None, true, &shown.regions);
        }
        for (i, occluder) in self.occluders.iter().enumerate() {
            add(Some(i), false, &occluder.regions);
            if let Some(shown) = &occluder.shown {
                add(Some(i), true, shown);
            }
        }
        layers
    }
}

impl References {
    /// Reads the references in a folder, or in the folder `scoring` of a kit. Images are
    /// read and held against their hashes when they are needed.
    ///
    /// # Errors
    /// Where there are none, or they are malformed or of another version.
    pub fn read(given: &Path) -> Result<Self, ReferencesError> {
        let inside = given.join("scoring");
        let folder = if given.join(FILE).exists() { given.to_owned() } else { inside };
        let path = folder.join(FILE);
        if !path.exists() {
            let why = format!(
                "neither it nor the folder 'scoring' in it holds a {FILE}: name the folder that `aogauge scene export \
                 --suite` wrote"
            );
            return Err(DiskError::content(given, why).into());
        }
        let file: ReferencesFile = read_json(&path, VERSION, "a list of references", "they are references")?;
        for scene in &file.scenes {
            scene.check().map_err(|why| DiskError::content(&path, why))?;
        }
        if file.seal().ok().as_ref() != Some(&file.sha256) {
            let why = "its content is not what it was written with: it was damaged or edited; export the kit anew";
            return Err(DiskError::content(&path, why).into());
        }
        let names: Vec<&str> = file.scenes.iter().map(|s| s.facts.name.as_str()).collect();
        let path = folder.join(SUITE);
        let suite = Suite::without_scenes(&file.suite, &path.display().to_string(), &read_text(&path)?, &names)?;
        if suite_hash(&suite.file).ok().as_ref() != Some(&file.suite_hash) {
            let why = "something else than its gates was changed: the kit's images are not those of such a suite; export the \
                       kit anew";
            return Err(DiskError::content(&path, why).into());
        }
        Ok(References { folder, file, suite, read: Mutex::default() })
    }

    /// Where they lie.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The suite, without its scenes' geometry.
    pub fn suite(&self) -> &Suite {
        &self.suite
    }

    /// What the list of references says.
    pub fn file(&self) -> &ReferencesFile {
        &self.file
    }

    /// A scene by name.
    pub fn scene(&self, name: &str) -> Option<&SceneReferences> {
        self.file.scenes.iter().find(|s| s.facts.name == name)
    }

    /// The converged image of a method in a scene; None where the suite lacks either.
    ///
    /// # Errors
    /// Where the image cannot be read or is not the one that the list tells of.
    pub fn converged(&self, scene: &str, method: &str) -> Result<Option<Converged>, DiskError> {
        let is_known = self.suite.methods.iter().any(|m| m.name == method);
        let Some(scene) = self.scene(scene).filter(|_| is_known) else { return Ok(None) };
        let file = converged(method);
        let replicates = journal::replicates(self.layers(scene, &file)?.as_ref());
        if replicates.len() != CONVERGED_REPLICATES as usize {
            let why = format!(
                "it holds {}, not {CONVERGED_REPLICATES}",
                counted(replicates.len(), "replicate", "replicates")
            );
            return Err(DiskError::content(&self.path(scene, &file), why));
        }
        Ok(Some(Converged::new(replicates)))
    }

    /// The pixels of each region of a scene's view.
    ///
    /// # Errors
    /// As [`References::converged`].
    pub fn regions(&self, scene: &SceneReferences) -> Result<Regions, DiskError> {
        let layers = self.layers(scene, REGIONS)?;
        self.masks(scene, &layers, None, false)
    }

    /// What the judge sees of a scene's receiver, with the occluder in place; None where there is no judge.
    ///
    /// # Errors
    /// As [`References::converged`].
    pub fn light(&self, scene: &SceneReferences) -> Result<Option<Vec<f32>>, DiskError> {
        if !scene.facts.has_occluder {
            return Ok(None);
        }
        let pairs = journal::pairs(self.layers(scene, JUDGE)?.as_ref());
        Ok(Some(Converged::new(pairs.into_iter().map(|p| p.with).collect()).mean))
    }

    /// An image beside the list of references, and where it lies.
    ///
    /// # Errors
    /// As [`References::converged`].
    pub fn beside(&self, name: &str) -> Result<(PathBuf, Layers), DiskError> {
        let path = self.folder.join(name);
        sound(&path, self.file.files.get(name))?;
        let layers = Layers::read(&path)?;
        Ok((path, layers))
    }

    /// All images of a scene that are measured with. They are not kept any longer.
    pub(super) fn load(&self, plan: &Plan<'_>, scene: &SceneReferences) -> Result<Loaded, DiskError> {
        let layers = self.layers(scene, REGIONS)?;
        let masks = |occluder, shown| self.masks(scene, &layers, occluder, shown);
        let on_screen = match &scene.screen {
            Some(record) => Some(Shown { regions: masks(None, true)?, record: record.clone() }),
            None => None,
        };
        let mut occluders = Vec::new();
        for (i, name) in scene.occluders.iter().enumerate() {
            let shown = if on_screen.is_some() { Some(masks(Some(i), true)?) } else { None };
            occluders.push(Occluder { name: name.clone(), regions: masks(Some(i), false)?, shown });
        }
        let mut rendered = Rendered { look: Some(Ok(())), ..Rendered::default() };
        if scene.facts.has_occluder {
            let pairs = journal::pairs(self.layers(scene, JUDGE)?.as_ref());
            if pairs.len() < 2 {
                return Err(DiskError::content(&self.path(scene, JUDGE), "it holds fewer than two replicates"));
            }
            rendered.judge = Some(Ok(pairs));
        }
        for (index, method) in plan.suite.methods.iter().enumerate() {
            if let Some(converged) = self.converged(&scene.facts.name, &method.name)? {
                rendered.truths.insert(index, Truth { converged, fault: None });
            }
        }
        let regions = masks(None, false)?;
        let folder = self.folder.join(&scene.facts.name);
        self.read.lock().unwrap_or_else(PoisonError::into_inner).retain(|path, _| !path.starts_with(&folder));
        Ok(Loaded { regions, occluders, on_screen, rendered })
    }

    /// The reference pictures from the look view.
    pub(super) fn look(&self, scene: &SceneReferences) -> Result<Layers, DiskError> {
        let path = self.path(scene, LOOK);
        sound(&path, scene.images.get(LOOK))?;
        Layers::read(&path)
    }

    fn path(&self, scene: &SceneReferences, file: &str) -> PathBuf {
        self.folder.join(&scene.facts.name).join(file)
    }

    /// A file of images of the size of the measure view.
    fn layers(&self, scene: &SceneReferences, file: &str) -> Result<Arc<Layers>, DiskError> {
        let path = self.path(scene, file);
        let known = || self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(layers) = known().get(&path) {
            return Ok(Arc::clone(layers));
        }
        sound(&path, scene.images.get(file))?;
        let layers = Layers::read(&path)?;
        let ([w, h], [vw, vh]) = (layers.resolution, scene.facts.resolution);
        if layers.resolution != scene.facts.resolution {
            return Err(DiskError::content(&path, format!("it is {w} x {h} pixels, the measure view {vw} x {vh}")));
        }
        let layers = Arc::new(layers);
        known().insert(path, Arc::clone(&layers));
        Ok(layers)
    }

    fn masks(
        &self,
        scene: &SceneReferences,
        layers: &Layers,
        occluder: Option<usize>,
        shown: bool,
    ) -> Result<Regions, DiskError> {
        let mask = |region| {
            let name = layer(occluder, shown, region);
            layers
                .get(&name)
                .ok_or_else(|| DiskError::content(&self.path(scene, REGIONS), format!("it lacks '{name}'")))
        };
        let mut masks = Vec::new();
        for region in Region::ALL {
            masks.push(mask(region)?);
        }
        Ok(Regions::of_masks(|region| masks[region as usize]))
    }
}

/// Refuses a file that is not the one the list tells of, by its hash.
fn sound(path: &Path, listed: Option<&String>) -> Result<(), DiskError> {
    let listed = listed.ok_or_else(|| DiskError::content(path, format!("{FILE} does not list it")))?;
    if journal::sha256(path)? != *listed {
        let why = format!("the image is not the one that {FILE} tells of: it was damaged or replaced");
        return Err(DiskError::content(path, why));
    }
    Ok(())
}

impl SceneReferences {
    /// Refuses what no tool of ours wrote: names that lead elsewhere, and sizes that do not
    /// go together.
    fn check(&self) -> Result<(), String> {
        let facts = &self.facts;
        aogauge_scenes::check_name(&facts.name).map_err(|e| format!("scenes: {e}"))?;
        if let Some(file) = self.images.keys().find(|f| aogauge_scenes::check_name(f).is_err()) {
            return Err(format!("scene '{}': '{file}' is no name of an image", facts.name));
        }
        let [w, h] = facts.resolution;
        if facts.transect.len() != w as usize || h == 0 || facts.radius.is_nan() || facts.radius <= 0.0 {
            return Err(format!("scene '{}': resolution, transect and radius do not go together", facts.name));
        }
        let missing = [Some(REGIONS), facts.has_occluder.then_some(JUDGE)];
        match missing.into_iter().flatten().find(|f| !self.images.contains_key(*f)) {
            Some(file) => Err(format!("scene '{}': images does not list {file}", facts.name)),
            None => Ok(()),
        }
    }
}
