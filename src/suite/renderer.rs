//! `[[renderer]]`: a program that renders cases of the suite.

use super::{Case, Method, Rays, Suite, SuiteFile, gate::once};
use crate::{
    counted::counted,
    intake::Declared,
    render::external::{External, Slot, Template},
    scenes::{Count, check_name},
};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    time::Duration,
};

/// Names that mean something else on the command line.
const TAKEN: [&str; 3] = ["cpu", "gpu", "auto"];

/// Whether no renderer of somebody else's may have a name, in whatever case.
pub fn is_taken(name: &str) -> bool {
    TAKEN.iter().any(|taken| taken.eq_ignore_ascii_case(name))
}

/// Arguments of a command, at most.
const MOST: usize = 256;

/// Seconds that an image may take.
const SECONDS: std::ops::RangeInclusive<f64> = 0.001..=86_400.0;

/// `[[renderer]]`: a program that renders. In `command` and `environment`, `{scene}`,
/// `{scene_toml}`, `{view}`, `{output}`, `{rays}`, `{seed}`, `{radius}`, `{secondary_radius}`, `{estimator}`, `{width}`,
/// `{height}`, `{replicate}` and `{suite_folder}` are filled in; `{{` and `}}` are braces.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RendererFile {
    /// Unique in the suite: 1 to 64 letters, digits, `-`, `_` and `.`; not `cpu`, `gpu` or
    /// `auto`.
    pub name: String,
    /// The program and its arguments, 1 to 256, which no shell reads; `{output}` must be among
    /// them. A path is looked up beside the suite file, a bare name on `PATH`.
    pub command: Vec<String>,
    /// The estimators of the suite that it renders, by name.
    pub estimators: Vec<String>,
    /// The scenes that it renders; all unless given.
    #[serde(default)]
    pub scenes: Vec<String>,
    /// The rays a pixel that it renders, of those that the suite has; all unless given.
    #[serde(default)]
    pub rays: Vec<Rays>,
    /// Seconds that one image may take before the command is ended with all that it
    /// started: 0.001 to 86400.
    #[serde(default = "ten_minutes", deserialize_with = "seconds")]
    #[schemars(extend("minimum" = 0.001, "maximum" = 86_400))]
    pub timeout: f64,
    /// Its environment.
    #[serde(default)]
    pub environment: EnvironmentFile,
    /// Where it works, from the suite file; the folder of the suite file unless given.
    #[serde(default)]
    pub folder: Option<String>,
    /// How often an image is tried again after a failure: 0 to 5.
    #[serde(default = "never")]
    pub retries: Count<0, 5>,
    /// The file format it is asked for: the ending of `{output}`.
    #[serde(default)]
    pub format: Format,
    /// What its images are.
    #[serde(default)]
    pub image: Declared,
}

/// The format of an image that a command writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// OpenEXR.
    #[default]
    Exr,
    /// PNG, 8 or 16 bits.
    Png,
}

/// `environment`: what a command finds in its environment.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EnvironmentFile {
    /// Whether it has the environment of aogauge, too.
    pub inherit: bool,
    /// Variables by name.
    pub set: BTreeMap<String, String>,
}

impl Default for EnvironmentFile {
    fn default() -> Self {
        EnvironmentFile { inherit: true, set: BTreeMap::new() }
    }
}

fn ten_minutes() -> f64 {
    600.0
}

fn never() -> Count<0, 5> {
    Count(0)
}

fn seconds<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if SECONDS.contains(&value) {
        Ok(value)
    } else {
        Err(D::Error::custom(format!("timeout is {value}: it must be 0.001 to 86400 seconds")))
    }
}

/// A program that renders, and what it renders.
#[derive(Clone, Debug)]
pub struct OwnRenderer {
    /// The program.
    pub external: External,
    /// As written.
    pub file: RendererFile,
}

impl OwnRenderer {
    /// Its cases in a scene, in the order of the suite.
    pub(super) fn cases(&self, suite: &Suite, scene: &str) -> Vec<Case> {
        let file = &self.file;
        if !file.scenes.is_empty() && !file.scenes.iter().any(|s| s == scene) {
            return Vec::new();
        }
        let of = |method: &Method| {
            let rays = method.rays.as_ref().map_or(suite.file.rays.as_slice(), std::slice::from_ref);
            let rays = rays.iter().filter(|r| file.rays.is_empty() || file.rays.contains(r));
            let case = |rays: &Rays| Case {
                scene: scene.to_owned(),
                estimator: method.name.clone(),
                renderer: file.name.clone(),
                rays: rays.get(),
            };
            rays.map(case).collect::<Vec<_>>()
        };
        suite.methods.iter().filter(|m| file.estimators.contains(&m.name)).flat_map(of).collect()
    }
}

/// Checks the renderers of a suite that lies in `folder`.
pub(super) fn build(suite: &SuiteFile, methods: &[Method], folder: &Path) -> Result<Vec<OwnRenderer>, String> {
    let files = &suite.renderers;
    let mut built: Vec<OwnRenderer> = Vec::with_capacity(files.len());
    for file in files {
        check_name(&file.name).map_err(|e| format!("renderer: {e}"))?;
        let is = |name: &str| name.eq_ignore_ascii_case(&file.name);
        if is_taken(&file.name) {
            return Err(format!("renderer: '{}' is the name of our own: choose another", file.name));
        }
        if built.iter().any(|b| is(&b.file.name)) {
            return Err(format!("renderer: '{}' is named twice", file.name));
        }
        let external = file.build(suite, methods, folder).map_err(|e| format!("renderer '{}': {e}", file.name))?;
        built.push(OwnRenderer { external, file: file.clone() });
    }
    // Images are called ESTIMATOR.RENDERER.RAYS, and names may hold dots.
    let mut seen = BTreeSet::new();
    let ours = TAKEN[..2].iter().flat_map(|r| methods.iter().map(move |m| (m.name.as_str(), *r)));
    let theirs = files.iter().flat_map(|f| f.estimators.iter().map(|e| (e.as_str(), f.name.as_str())));
    for (estimator, renderer) in ours.chain(theirs) {
        if !seen.insert(format!("{estimator}.{renderer}").to_ascii_lowercase()) {
            return Err(format!(
                "renderer '{renderer}': its images of '{estimator}' would have the name of another's: rename one of them"
            ));
        }
    }
    Ok(built)
}

impl RendererFile {
    fn build(&self, suite: &SuiteFile, methods: &[Method], folder: &Path) -> Result<External, String> {
        if self.command.is_empty() || self.command.len() > MOST {
            return Err(format!(
                "command has {}: give the program and its arguments, 1 to {MOST}",
                counted(self.command.len(), "part", "parts")
            ));
        }
        if self.estimators.is_empty() {
            return Err("estimators is empty: name at least one of the suite".into());
        }
        once("estimators", &self.estimators)?;
        once("scenes", &self.scenes)?;
        let parse = |field: &str, text: &str| Template::parse(text).map_err(|e| format!("{field}: {e}"));
        let mut command = Vec::with_capacity(self.command.len());
        for text in &self.command {
            command.push(parse("command", text)?);
        }
        let arguments = command.split_off(1);
        let program = command[0].plain().filter(|p| !p.trim().is_empty());
        let program =
            program.ok_or("command: the first part is the program: it takes no placeholder, and is not empty")?;
        if !arguments.iter().any(|a| a.has(Slot::Output)) {
            return Err(
                "command: {output} is not in it, so that the program does not know where to leave the image".into()
            );
        }
        let mut environment = BTreeMap::new();
        for (name, text) in &self.environment.set {
            if name.is_empty() || name.contains(['=', '\0']) {
                return Err(format!("environment: '{}' is no name of a variable", name.escape_debug()));
            }
            environment.insert(name.clone(), parse(&format!("environment: {name}"), text)?);
        }
        self.check_rays(suite, methods)?;
        let suite_folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let absolute = std::path::absolute(suite_folder);
        let suite_folder = absolute.map_err(|e| format!("the folder of the suite file cannot be found: {e}"))?;
        Ok(External {
            name: self.name.clone(),
            program,
            arguments,
            inherit: self.environment.inherit,
            environment,
            folder: self.folder.as_ref().map_or_else(|| suite_folder.clone(), |f| suite_folder.join(f)),
            suite_folder,
            timeout: Duration::from_secs_f64(self.timeout),
            retries: self.retries.get(),
            format: match self.format {
                Format::Exr => "exr",
                Format::Png => "png",
            },
            image: self.image.clone(),
        })
    }

    /// No estimator may be named in vain.
    fn check_rays(&self, suite: &SuiteFile, methods: &[Method]) -> Result<(), String> {
        let has = |rays: &Rays| self.rays.is_empty() || self.rays.contains(rays);
        let all = |m: &&Method| m.rays.as_ref().map_or(suite.rays.as_slice(), std::slice::from_ref).iter().any(has);
        once("rays", &self.rays.iter().map(|r| r.get()).collect::<Vec<_>>())?;
        match methods.iter().filter(|m| self.estimators.contains(&m.name)).find(|m| !all(m)) {
            Some(method) => Err(format!("rays names none of those that estimator '{}' has", method.name)),
            None => Ok(()),
        }
    }
}
