//! What to run: a suite file, checked as a whole, becomes a plan of cases.

mod estimator;
mod file;
mod gate;
mod plan;
mod renderer;

pub use estimator::EstimatorFile;
pub use file::{JudgeSettings, Rays, Replicates, SoftwareAdapter, SuiteFile};
pub use gate::{GateFile, LimitFile};
pub(crate) use plan::is_own;
pub use plan::{Case, Plan, Platform};
pub use renderer::{EnvironmentFile, OwnRenderer, RendererFile, is_taken};

use crate::{
    gate::Gate,
    render::Estimator,
    scenes::{Scene, SceneError},
};
use std::path::Path;

/// The built-in suites, by name.
pub const BUILT_IN: [(&str, &str); 5] = [
    ("smoke", include_str!("smoke.toml")),
    ("thin-occluders", include_str!("thin-occluders.toml")),
    ("library", include_str!("library.toml")),
    ("full", include_str!("full.toml")),
    ("paper", include_str!("paper.toml")),
];

/// A method under a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// Unique in its suite.
    pub name: String,
    /// What it computes.
    pub estimator: Estimator,
    /// Its own number of rays a pixel, in place of the suite's.
    pub rays: Option<Rays>,
}

impl Method {
    /// Whether the others are compared with this one: classic AO at the scene's
    /// own scale and the suite's rays.
    fn is_classic(&self) -> bool {
        self.estimator == Estimator::CLASSIC && self.rays.is_none()
    }
}

/// A suite with its scenes loaded and everything checked against everything.
#[derive(Clone, Debug)]
pub struct Suite {
    /// Name of the suite.
    pub name: String,
    /// Its settings as written.
    pub file: SuiteFile,
    /// Its scenes.
    pub scenes: Vec<Scene>,
    /// Its methods; one of them is `classic`.
    pub methods: Vec<Method>,
    /// Its external renderers.
    pub renderers: Vec<OwnRenderer>,
    /// Its gates.
    pub gates: Vec<Gate>,
}

/// Why a suite cannot be run. The message names the file and the line or field.
#[derive(Debug, thiserror::Error)]
pub enum SuiteError {
    /// The TOML is malformed, has an unknown key, or a value out of its range.
    #[error("{file}: {source}")]
    Toml {
        /// The suite file.
        file: String,
        /// What and where.
        source: Box<toml::de::Error>,
    },
    /// Each value is legal, but they do not go together.
    #[error("{file}: {message}")]
    Invalid {
        /// The suite file.
        file: String,
        /// What, by field.
        message: String,
    },
    /// The file cannot be read.
    #[error("{file}: cannot read the suite file: {source}")]
    Read {
        /// The suite file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// There is neither a built-in suite nor a file of this name.
    #[error("no built-in suite is called '{name}' and there is no such file; built in: {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl Suite {
    /// Loads a built-in suite by name or a suite file by path. Scenes that a file
    /// names by path are looked up beside it.
    ///
    /// # Errors
    /// [`SuiteError`], which names the file and the line or field.
    pub fn load(name: &str) -> Result<Self, SuiteError> {
        if let Some((_, text)) = BUILT_IN.iter().find(|(n, _)| *n == name) {
            return Self::from_toml(name, &format!("{name}.toml (built in)"), text, Path::new("."));
        }
        let path = Path::new(name);
        if !name.ends_with(".toml") && !path.exists() {
            let known = BUILT_IN.map(|(n, _)| n).join(", ");
            return Err(SuiteError::Unknown { name: name.to_owned(), known });
        }
        let text =
            std::fs::read_to_string(path).map_err(|source| SuiteError::Read { file: name.to_owned(), source })?;
        let stem = path.file_stem().map_or_else(|| name.to_owned(), |s| s.to_string_lossy().into_owned());
        Self::from_toml(&stem, name, &text, path.parent().unwrap_or(Path::new(".")))
    }

    /// Reads a suite from TOML. `name` is its name unless the TOML gives one; `file` is what errors call it; scene paths are
    /// relative to `folder`.
    ///
    /// # Errors
    /// See [`Suite::load`].
    pub fn from_toml(name: &str, file: &str, text: &str, folder: &Path) -> Result<Self, SuiteError> {
        let parsed: SuiteFile =
            toml::from_str(text).map_err(|e| SuiteError::Toml { file: file.to_owned(), source: Box::new(e) })?;
        let invalid = |message: String| SuiteError::Invalid { file: file.to_owned(), message };
        if let Some(name) = &parsed.name {
            aogauge_scenes::check_name(name).map_err(|e| invalid(format!("name: {e}")))?;
        }
        let name = parsed.name.as_deref().unwrap_or(name).to_owned();
        let mut scenes: Vec<Scene> = Vec::with_capacity(parsed.scenes.len());
        for scene in &parsed.scenes {
            let scene = if scene.ends_with(".toml") {
                Scene::from_file(&folder.join(scene))?
            } else {
                aogauge_scenes::library::scene(scene).map_err(|e| invalid(format!("scenes: {e}")))?
            };
            if scenes.iter().any(|s| s.name == scene.name) {
                return Err(invalid(format!("scenes: '{}' is named twice", scene.name)));
            }
            scenes.push(scene);
        }
        let names: Vec<&str> = scenes.iter().map(|s| s.name.as_str()).collect();
        let (methods, gates) = checked(&parsed, &names).map_err(invalid)?;
        let renderers = renderer::build(&parsed, &methods, folder).map_err(invalid)?;
        Ok(Suite { name, file: parsed, scenes, methods, renderers, gates })
    }

    /// A suite from TOML whose scenes are known by name only: enough to measure and to judge, not to
    /// render. `label` is what errors call the file.
    ///
    /// # Errors
    /// [`SuiteError`], which names the line or field.
    pub fn without_scenes(name: &str, label: &str, text: &str, scenes: &[&str]) -> Result<Self, SuiteError> {
        let toml = |e| SuiteError::Toml { file: label.to_owned(), source: Box::new(e) };
        let file: SuiteFile = toml::from_str(text).map_err(toml)?;
        let invalid = |message| SuiteError::Invalid { file: label.to_owned(), message };
        let (methods, gates) = checked(&file, scenes).map_err(invalid)?;
        Ok(Suite { name: name.to_owned(), file, scenes: Vec::new(), methods, renderers: Vec::new(), gates })
    }

    /// Puts other gates in place of the suite's: a TOML text of `[[gate]]` tables, `label` in
    /// errors. They may name these scenes and renderers, the suite's estimators, and any ray count.
    ///
    /// # Errors
    /// [`SuiteError`], which names the line or field.
    pub fn replace_gates(
        &mut self,
        label: &str,
        text: &str,
        scenes: &[&str],
        renderers: &[&str],
    ) -> Result<(), SuiteError> {
        #[derive(serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct GatesFile {
            gate: Vec<GateFile>,
        }
        let toml = |e| SuiteError::Toml { file: label.to_owned(), source: Box::new(e) };
        let file: GatesFile = toml::from_str(text).map_err(toml)?;
        let gates = gates(&file.gate, scenes, renderers, &self.methods);
        self.gates = gates.map_err(|message| SuiteError::Invalid { file: label.to_owned(), message })?;
        Ok(())
    }

    /// The case of classic AO that a case is compared with: the one of as many
    /// rays, else, for a method with its own number of rays, that of the most.
    pub fn classic_beside(&self, case: &Case) -> Case {
        let all = || self.file.rays.iter().map(|r| r.get());
        let rays = if all().any(|r| r == case.rays) { case.rays } else { all().max().unwrap_or(case.rays) };
        Case { estimator: self.methods[self.classic()].name.clone(), rays, ..case.clone() }
    }

    /// The index of the method that is classic AO.
    pub fn classic(&self) -> usize {
        self.methods.iter().position(Method::is_classic).unwrap_or(0)
    }

    /// Whether an estimator is that method, by its name.
    pub fn is_classic(&self, estimator: &str) -> bool {
        self.methods[self.classic()].name == estimator
    }
}

/// The methods and gates of a suite file, checked against each other and the names of its
/// scenes; errors name the field.
fn checked(file: &SuiteFile, scenes: &[&str]) -> Result<(Vec<Method>, Vec<Gate>), String> {
    for (list, empty) in [("scenes", scenes.is_empty()), ("rays", file.rays.is_empty())] {
        if empty {
            return Err(format!("{list} is empty: name at least one"));
        }
    }
    if let Some(i) = (1..file.rays.len()).find(|&i| file.rays[..i].contains(&file.rays[i])) {
        return Err(format!("rays: {} is given twice", file.rays[i].get()));
    }
    if let Some(rays) = file.golden_rays.filter(|r| !file.rays.contains(r)) {
        return Err(format!("golden_rays is {}, which is not among rays", rays.get()));
    }
    let methods = methods(file)?;
    let most = all_rays(file, &methods).map(Rays::get).max().unwrap_or(0);
    let converged = file.converged_rays.get();
    if converged < 4 * most || !converged.is_multiple_of(4) {
        return Err(format!(
            "converged_rays is {converged}: it must be a multiple of 4 and at least 4 times the most rays, {most}"
        ));
    }
    if file.judge.max_replicates.get() < file.judge.replicates.get() {
        return Err("judge.max_replicates must not be below judge.replicates".into());
    }
    if let Some(marked) = &file.software_adapter {
        gate::once("scenes", &marked.scenes).map_err(|e| format!("software_adapter: {e}"))?;
        known("software_adapter", &marked.scenes, scenes, "scenes")?;
        traced("software_adapter", &marked.rays, file, &methods)?;
    }
    let names: Vec<&str> = methods.iter().map(|m| m.name.as_str()).collect();
    for own in &file.renderers {
        let of = format!("renderer '{}'", own.name);
        known(&of, &own.scenes, scenes, "scenes")?;
        known(&of, &own.estimators, &names, "estimators")?;
        traced(&of, &own.rays, file, &methods)?;
    }
    for gate in &file.gates {
        traced(&format!("gate '{}'", gate.name), &gate.rays, file, &methods)?;
    }
    let renderers: Vec<&str> =
        ["cpu", "gpu"].into_iter().chain(file.renderers.iter().map(|r| r.name.as_str())).collect();
    let gates = gates(&file.gates, scenes, &renderers, &methods)?;
    Ok((methods, gates))
}

/// The gates of a suite, or others in place of them.
fn gates(entries: &[GateFile], scenes: &[&str], renderers: &[&str], methods: &[Method]) -> Result<Vec<Gate>, String> {
    let names: Vec<&str> = methods.iter().map(|m| m.name.as_str()).collect();
    let mut gates = Vec::with_capacity(entries.len());
    for gate in entries {
        let of = format!("gate '{}'", gate.name);
        known(&of, &gate.scenes, scenes, "scenes")?;
        known(&of, &gate.estimators, &names, "estimators")?;
        if entries.iter().filter(|g| g.name == gate.name).count() > 1 {
            return Err(format!("two gates are called '{}'", gate.name));
        }
        known(&of, &gate.renderers, renderers, "renderers")?;
        gates.push(gate.build(methods).map_err(|e| format!("{of}: {e}"))?);
    }
    Ok(gates)
}

fn all_rays(file: &SuiteFile, methods: &[Method]) -> impl Iterator<Item = Rays> {
    file.rays.iter().copied().chain(methods.iter().filter_map(|m| m.rays))
}

/// Whether a list names only what there is.
fn known(of: &str, list: &[String], known: &[&str], field: &str) -> Result<(), String> {
    match list.iter().find(|n| !known.contains(&n.as_str())) {
        Some(n) => {
            Err(format!("{of}: {field} names '{n}', which the suite does not have; it has {}", known.join(", ")))
        }
        None => Ok(()),
    }
}

fn traced(of: &str, rays: &[Rays], file: &SuiteFile, methods: &[Method]) -> Result<(), String> {
    match rays.iter().find(|r| !all_rays(file, methods).any(|own| own == **r)) {
        Some(r) => Err(format!("{of}: rays names {}, which the suite does not trace", r.get())),
        None => Ok(()),
    }
}

fn methods(file: &SuiteFile) -> Result<Vec<Method>, String> {
    let mut methods: Vec<Method> = Vec::new();
    for entry in &file.estimators {
        if methods.iter().any(|m| m.name == entry.name) {
            return Err(format!("estimator: '{}' is named twice", entry.name));
        }
        aogauge_scenes::check_name(&entry.name).map_err(|e| format!("estimator: {e}"))?;
        let (estimator, rays) = entry.build().map_err(|e| format!("estimator '{}': {e}", entry.name))?;
        methods.push(Method { name: entry.name.clone(), estimator, rays });
    }
    if !methods.iter().any(Method::is_classic) {
        return Err(
            "estimator: the suite needs one of kind 'classic' without options, which the others are compared with"
                .into(),
        );
    }
    Ok(methods)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::Limit;

    #[test]
    fn the_built_in_suites_load() {
        let scenes = |name: &str| -> Vec<String> {
            let suite = Suite::load(name).unwrap_or_else(|e| panic!("{e}"));
            assert!(!suite.gates.is_empty());
            suite.scenes.into_iter().map(|s| s.name).collect()
        };
        assert_eq!(scenes("smoke").len(), 3);
        assert!(scenes("paper").contains(&"curtain-arcade".to_owned()));
        // Between them every scene of the library, once; and in all.
        let mut parts = [scenes("thin-occluders"), scenes("library")].concat();
        let mut full = scenes("full");
        let mut all: Vec<&str> = aogauge_scenes::library::SCENES.iter().map(|(name, _)| *name).collect();
        parts.sort();
        full.sort();
        all.sort_unstable();
        assert_eq!((&parts[..], &full[..]), (&all.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>()[..], &parts[..]));
    }

    fn with(extra: &str) -> Result<Suite, SuiteError> {
        let text = format!(
            "description = 'x'\nscenes = ['plane']\nrays = [4]\nreplicates = 4\nconverged_rays = 64\n{extra}\n\
             [[estimator]]\nname = 'classic'\nkind = 'classic'\n"
        );
        Suite::from_toml("x", "x.toml", &text, Path::new("."))
    }

    #[test]
    fn a_file_may_name_its_suite() {
        assert_eq!(with("").unwrap().name, "x");
        assert_eq!(with("name = 'screen-space'").unwrap().name, "screen-space");
    }

    fn gate(options: &str) -> String {
        format!("[[gate]]\nname = 'g'\nmetric = 'contrast'\n{options}")
    }

    #[test]
    fn gates_are_read_whole() {
        let text = gate("max = 0.01\nwarn = { max = 0 }\nagainst = 'base'\nconfidence = 0.99\nrays = [4]");
        let built = with(&text).unwrap().gates.remove(0);
        assert_eq!((built.limit, built.warn), (Limit::AtMost(0.01), Some(Limit::AtMost(0.0))));
        assert!(built.is_against_base() && built.confidence == 0.99 && built.rays == [4]);
        assert_eq!(with(&gate("max = 1")).unwrap().gates[0].confidence, 0.95);
    }

    /// Of a scene that is not there the suite file and the field are named.
    #[test]
    fn an_unknown_scene_is_named_with_the_file_that_names_it() {
        let text = "description = 'x'\nscenes = ['plan']\nrays = [4]\nreplicates = 4\nconverged_rays = 64\n\
                    [[estimator]]\nname = 'classic'\nkind = 'classic'\n";
        let message = Suite::from_toml("x", "x.toml", text, Path::new(".")).unwrap_err().to_string();
        assert!(message.starts_with("x.toml: scenes: no built-in scene is called 'plan'; there are: "), "{message}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert_eq!(with("").unwrap().file.target_rmse, 0.01);
        assert_eq!(with("target_rmse = 0.05").unwrap().file.target_rmse, 0.05);
        for (extra, says) in [
            ("colour = 1", "colour"),
            ("name = ''", "name: '' is not a legal name"),
            ("name = '../x'", "name: '../x' is not a legal name"),
            ("name = 'a # b'", "legal name"),
            ("seed = -1", "seed is -1: it must be 0 to 4294967295"),
            ("seed = 4294967296", "seed is 4294967296: it must be 0 to"),
            ("seed = 1.5", "line 6"),
            ("golden_rays = 0", "line 6"),
            ("golden_rays = 5", "not among rays"),
            ("target_rmse = 0", "target_rmse is 0: it must be 1e-6 to 1"),
            ("target_rmse = nan", "1e-6 to 1"),
            ("judge = { precision = 0 }", "line 6"),
            ("judge = { replicates = 64, max_replicates = 32 }", "max_replicates"),
            ("[[estimator]]\nname = '../x'\nkind = 'classic'", "legal name"),
            ("[[gate]]\nname = 'g'\nmetric = 'removed'", "min"),
            ("[[gate]]\nname = 'g'\nmetric = 'removed'\nmin = 0.5\nscenes = ['plan']", "'plan'"),
            ("[[gate]]\nname = 'g'\nmetric = 'bias'\nmax = 0.5", "region"),
            ("[[gate]]\nname = 'g'\nmetric = 'judge-bias'\nregion = 'left'\nmax = 0.5", "never gated"),
            ("[[gate]]\nname = 'g'\nmetric = 'judge-mae'\nregion = 'left'\nmax = 0.5", "judge-mae is reported but"),
            ("[[gate]]\nname = 'g'\nmetric = 'judge-rmse'\nregion = 'left'\nmax = 0.5", "judge-rmse is reported but"),
            ("[[gate]]\nname = 'g'\nmetric = 'removed'\nmin = nan", "finite"),
            ("[[gate]]\nname = 'g'\nmetric = 'judge'\nmin = 1", "`rmse`, `over-darkening`, "),
            ("[[gate]]\nname = 'g'\nmetric = 3\nmin = 1", "invalid type: integer `3`"),
            (&gate("max = 0.5\nmin = 0.1"), "exactly one limit: min, max, or equals together with within; min and max"),
            (&gate(""), "none of them is given"),
            (&gate("equals = 0.5"), "equals alone is given"),
            (&gate("within = 0.5"), "within alone is given"),
            (&gate("max = 0.5\nequals = 0\nwithin = 1"), "max, equals and within are given"),
            (&gate("equals = 0\nwithin = -1"), "gate 'g': within is -1: it must be above 0"),
            (&gate("equals = 0\nwithin = 0"), "within is 0: it must be above 0"),
            (&gate("max = 0.5\nscenes = ['plane', 'plane']"), "gate 'g': scenes names plane twice"),
            (&gate("max = 0.5\nestimators = ['classic', 'classic']"), "estimators names classic twice"),
            (&gate("max = 0.5\nrenderers = ['cpu', 'gpu', 'cpu']"), "renderers names cpu twice"),
            (&gate("max = 0.5\nrays = [4, 4]"), "rays names 4 twice"),
            ("[[gate]]\nname = ' '\nmetric = 'contrast'\nmax = 1", "name is empty: it must say what"),
            ("software_adapter = { scenes = ['plane', 'plane'] }", "software_adapter: scenes names plane twice"),
            (&gate("max = 0.5\nconfidence = 1.0"), "confidence is 1: it must be 0.5 to 0.999999"),
            (&gate("max = 0.5\nconfidence = 0.4"), "0.5 to 0.999999"),
            (&gate("max = 0.5\nconfidence = nan"), "0.5 to 0.999999"),
            (&gate("max = 0.5\nwarn = { max = 0.6 }"), "warn is at most 0.6, which is not stricter than what fails"),
            (&gate("max = 0.5\nwarn = { max = 0.5 }"), "not stricter"),
            (&gate("max = 0.5\nwarn = { min = 0.1 }"), "not stricter"),
            (&gate("max = 0.5\nwarn = { max = 0.4, min = 0.1 }"), "warn: give exactly one limit"),
            (&gate("max = 0.5\nwarn = { most = 0.4 }"), "most"),
            (&gate("max = 0.5\nwarn = { max = 0.4 }\nknown_failure = 'x'"), "exclude each other"),
            (&gate("max = 0.5\nknown_failure = ' '"), "must say why"),
            (
                &gate("max = 0.5\nagainst = 'clasic'"),
                "'clasic', which the suite does not have; it has classic, and base",
            ),
            (&gate("max = 0.5\nagainst = 'classic'\nestimators = ['classic']"), "always equal"),
            ("[[gate]]\nname = 'g'\nmetric = 'removed'\nmin = 0.5\nagainst = 'classic'", "against classic already"),
            ("[[gate]]\nname = 'g'\nmetric = 'judge-contrast'\nmin = 0.5\nagainst = 'classic'", "against base only"),
            (
                &(gate("max = 0.5\nagainst = 'base'")
                    + "\n[[estimator]]\nname = 'base'\nkind = 'extended'\nreceiver_plane = 'clipped'"),
                "rename the estimator",
            ),
        ] {
            let message = with(extra).unwrap_err().to_string();
            assert!(message.contains(says) && message.contains("x.toml"), "{extra}: {message}");
        }
    }
}
