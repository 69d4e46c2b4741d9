//! Scene files: TOML in, [`Scene`] out, and errors that say where.

mod resolved;

pub use resolved::Parameters;

use crate::{
    AoScale, Material, Object, Scene,
    bounded::{Albedo, Fine, Radiance, check_name},
    derive,
    environment::EnvironmentFile,
    generators::Shape,
    gltf::{self, GltfTable},
    luminance,
    mesh::has_area,
    view_table::{LookTable, MeasureTable},
};
use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, MapAccess, Visitor, value::MapAccessDeserializer},
};
use std::{fmt::Formatter, path::Path};

/// Why a scene cannot be used. The message names the file and the line or field.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The TOML is malformed, has an unknown key, or a value out of its range.
    #[error("{file}: {source}")]
    Toml {
        /// The scene file.
        file: String,
        /// What and where.
        source: Box<toml::de::Error>,
    },
    /// Each value is legal, but they do not go together.
    #[error("{file}: {message}")]
    Invalid {
        /// The scene file.
        file: String,
        /// What, by field.
        message: String,
    },
    /// The file cannot be read.
    #[error("{file}: cannot read the scene file: {source}")]
    Read {
        /// The scene file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// No built-in scene has this name.
    #[error("no built-in scene is called '{name}'; there are: {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
}

/// A scene file.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneFile {
    /// What the scene is for, in a sentence or two.
    description: String,
    /// A control: a scene where the methods under test should agree.
    #[serde(default)]
    control: bool,
    /// The scale of ambient occlusion.
    ao: AoFile,
    /// The light; may be left out where objects with `emission` give it.
    #[serde(default)]
    environment: EnvironmentFile,
    /// Where metrics are taken; unless given, that of the model where it was
    /// exported from here, else found from the occluder and what it stands over.
    measure: Option<MeasureTable>,
    /// Where pictures are taken; unless given, that of the model where it was
    /// exported from here, else towards the middle of the measure view.
    look: Option<LookTable>,
    /// Geometry from a model.
    gltf: Option<GltfTable>,
    /// The geometry, or what is added to the model.
    #[serde(rename = "object", default, skip_serializing_if = "Vec::is_empty")]
    objects: Vec<ObjectFile>,
}

/// `[ao]`: the scale of ambient occlusion.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct AoFile {
    /// R, length of a primary ray, metres.
    radius: Fine<1_000, 1_000_000_000>,
    /// R', half length of a secondary ray, metres; R/4 unless given.
    secondary_radius: Option<Fine<100, 1_000_000_000>>,
}

/// `[[object]]`: one shape with its material.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ObjectFile {
    /// Unique in the scene.
    name: String,
    /// The occluder under judgement: taken away in the twin. True marks every part
    /// of the shape; banner, shelf, table and atrium mark their thin parts
    /// themselves.
    #[serde(default)]
    occluder: bool,
    /// Grey diffuse albedo; 0.6 unless given.
    albedo: Option<Albedo>,
    /// Linear colour in place of `albedo`: red, green and blue.
    color: Option<[Albedo; 3]>,
    /// Radiance it sends out: red, green and blue.
    emission: Option<[Radiance<0, 1_000_000_000>; 3]>,
    /// What it looks like.
    #[serde(deserialize_with = "one_shape")]
    shape: Shape,
}

/// Reads a shape, and says so where there are two.
fn one_shape<'de, D: Deserializer<'de>>(d: D) -> Result<Shape, D::Error> {
    struct One;
    impl<'de> Visitor<'de> for One {
        type Value = Shape;

        fn expecting(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
            f.write_str("a table of one family, such as { curtain = {} }")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Shape, A::Error> {
            let shape = Shape::deserialize(MapAccessDeserializer::new(&mut map))?;
            let Some(other) = map.next_key::<String>()? else {
                return Ok(shape);
            };
            let written = serde_json::to_value(&shape).map_err(A::Error::custom)?;
            let first = written.as_object().and_then(|s| s.keys().next()).map_or("", String::as_str);
            Err(A::Error::custom(format_args!(
                "a shape is of one family, not of '{first}' and '{other}': make each an object of its own"
            )))
        }
    }
    d.deserialize_map(One)
}

impl ObjectFile {
    fn material(&self) -> Result<Material, String> {
        let mut material = match (self.albedo, self.color) {
            (Some(_), Some(_)) => {
                return Err(format!("object '{}': give albedo or color, not both", self.name));
            }
            (Some(a), None) => Material::grey(a.0),
            (None, Some(c)) => Material::colored(c.map(|c| c.0)),
            (None, None) => Material::default(),
        };
        if let Some(e) = self.emission {
            material.emissive = e.map(|e| e.0);
        }
        Ok(material)
    }
}

impl SceneFile {
    fn parse(file: &str, text: &str) -> Result<Self, SceneError> {
        toml::from_str(text).map_err(|e| SceneError::Toml { file: file.to_owned(), source: Box::new(e) })
    }

    fn build(self, name: &str, folder: Option<&Path>) -> Result<Scene, String> {
        check_name(name).map_err(|e| format!("the scene's name, its file's without the ending: {e}"))?;
        let mut objects = Vec::with_capacity(self.objects.len());
        for o in self.objects {
            if objects.iter().any(|b: &Object| b.name == o.name) {
                return Err(format!("two objects are called '{}'", o.name));
            }
            let named = |e: &dyn std::fmt::Display| format!("object '{}': {e}", o.name);
            let material = o.material()?;
            for part in o.shape.parts().map_err(|e| named(&e))? {
                part.mesh.validate().map_err(|e| named(&e))?;
                // A model leaves such triangles out, so that the scene would not come back.
                if let Some(triangle) = part.mesh.corners().position(|t| !has_area(t)) {
                    let why = "its corners fall together or lie on one line, as far as 32-bit coordinates can tell";
                    return Err(named(&format_args!("triangle {triangle} has no area: {why}")));
                }
                objects.push(Object {
                    name: if part.name.is_empty() { o.name.clone() } else { format!("{}.{}", o.name, part.name) },
                    occluder: o.occluder || part.occluder,
                    material: part.material.unwrap_or_else(|| material.clone()),
                    mesh: part.mesh,
                });
            }
        }
        let mut model = self.gltf.map(|g| g.load(folder)).transpose()?.unwrap_or_default();
        if let Some(o) = objects.iter().find(|o| model.objects.iter().any(|m| m.name == o.name)) {
            return Err(format!("an object and a part of gltf.file are both called '{}'", o.name));
        }
        objects.append(&mut model.objects);
        if objects.iter().all(|o| o.occluder) {
            return Err(format!(
                "the scene has no receiver: give at least one object that is not an occluder{}",
                model.emptied(|_| true)
            ));
        }
        // A lamp that is an occluder would leave the twin in the dark.
        let lamps = objects.iter().any(|o| !o.occluder && o.emissions().any(|e| luminance(e) > 0.0))
            || model.lights.iter().any(|l| l.intensity * luminance(l.color) > 0.0);
        let radius = self.ao.radius.0;
        let measure = match (&self.measure, model.measure) {
            (Some(given), _) => given.build(&model.cameras, radius)?,
            (None, Some(view)) => {
                view.fine_enough(radius).map_err(|e| format!("gltf.file: {e}"))?;
                view
            }
            (None, None) => derive::measure(&objects, radius)?,
        };
        let look = match (&self.look, model.look) {
            (Some(given), _) => given.build(&model.cameras)?,
            (None, Some(view)) => view,
            (None, None) => derive::look(&measure, radius),
        };
        // The views are no cameras beside themselves.
        model.cameras.retain(|c| !gltf::VIEW_CAMERAS.contains(&c.name.as_str()));
        Ok(Scene {
            name: name.to_owned(),
            description: self.description,
            control: self.control,
            ao: AoScale { radius, secondary_radius: self.ao.secondary_radius.map_or(radius / 4.0, |r| r.0) },
            environment: self.environment.build(lamps)?,
            measure,
            look,
            objects,
            lights: model.lights,
            cameras: model.cameras,
        })
    }
}

impl Scene {
    /// Reads a scene from TOML. `file` is what errors call it; a model that it
    /// names is looked for in `folder`, and is an error without one.
    ///
    /// # Errors
    /// [`SceneError::Toml`] with line and column for anything one value gets
    /// wrong, [`SceneError::Invalid`] where values do not go together.
    ///
    /// # Example
    /// ```
    /// let toml = r#"
    /// description = "An open plane."
    /// ao = { radius = 0.25 }
    /// environment = { radiance = 1.0 }
    /// measure = { center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.1, resolution = [96, 64] }
    /// look = { eye = [1, 1, 1], target = [0, 0, 0], resolution = [96, 64] }
    /// [[object]]
    /// name = "floor"
    /// shape = { plane = { center = [0, 0, 0], u = [0, 0, 4], v = [4, 0, 0] } }
    /// "#;
    /// let scene = aogauge_scenes::Scene::from_toml("plane", "plane.toml", toml, None)?;
    /// assert_eq!(scene.ao.secondary_radius, 0.0625);
    /// # Ok::<(), aogauge_scenes::SceneError>(())
    /// ```
    pub fn from_toml(name: &str, file: &str, text: &str, folder: Option<&Path>) -> Result<Scene, SceneError> {
        SceneFile::parse(file, text)?
            .build(name, folder)
            .map_err(|message| SceneError::Invalid { file: file.to_owned(), message })
    }

    /// Reads a scene file; its name is the file's, without the ending.
    ///
    /// # Errors
    /// [`SceneError::Read`] where the file cannot be read, else as
    /// [`Scene::from_toml`].
    pub fn from_file(path: &Path) -> Result<Scene, SceneError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Read { file: file.clone(), source })?;
        let name = path.file_stem().map_or_else(|| file.clone(), |s| s.to_string_lossy().into_owned());
        Scene::from_toml(&name, &file, &text, Some(path.parent().unwrap_or(Path::new("."))))
    }

    /// The scene file that goes with a model written by
    /// [`write_glb`](crate::gltf::write_glb): it says what glTF cannot, and
    /// leaves the rest to `model`, a path relative to it. Read back under the
    /// scene's name, it gives the scene again.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] where TOML cannot hold it.
    ///
    /// # Example
    /// ```
    /// let toml = aogauge_scenes::library::scene("plane")?.model_toml("plane.glb")?;
    /// assert!(toml.contains("file = \"plane.glb\""));
    /// # Ok::<(), aogauge_scenes::SceneError>(())
    /// ```
    pub fn model_toml(&self, model: &str) -> Result<String, SceneError> {
        let file = SceneFile {
            description: self.description.clone(),
            control: self.control,
            ao: AoFile { radius: Fine(self.ao.radius), secondary_radius: Some(Fine(self.ao.secondary_radius)) },
            environment: EnvironmentFile::of(&self.environment),
            measure: None,
            look: None,
            gltf: Some(GltfTable::of(model)),
            objects: Vec::new(),
        };
        toml::to_string(&file)
            .map_err(|e| SceneError::Invalid { file: format!("{}.toml", self.name), message: e.to_string() })
    }

    /// The JSON Schema of scene files.
    pub fn file_schema() -> schemars::Schema {
        schemars::schema_for!(SceneFile)
    }
}
