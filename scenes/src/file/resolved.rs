//! A scene file with everything said that it left to defaults.

use super::{SceneError, SceneFile};
use crate::{
    Scene,
    bounded::{Albedo, Fine},
};
use serde::{Serialize, Serializer};

/// The parameters of a scene: its file with all defaults filled in, those of
/// shapes and those that follow from others. Serialises as the file does.
#[derive(Clone, Debug)]
pub struct Parameters {
    file: SceneFile,
    toml: String,
}

impl Parameters {
    /// The parameters of `scene`, which was read from `text`; `file` is what
    /// errors call it.
    ///
    /// # Errors
    /// [`SceneError`] where `text` is no scene file.
    pub fn new(scene: &Scene, file: &str, text: &str) -> Result<Self, SceneError> {
        let mut parsed = SceneFile::parse(file, text)?;
        parsed.ao.secondary_radius = Some(Fine(scene.ao.secondary_radius));
        parsed.measure = Some((&scene.measure).into());
        parsed.look = Some((&scene.look).into());
        if let Some(gltf) = &mut parsed.gltf {
            gltf.fill();
        }
        for object in parsed.objects.iter_mut().filter(|o| o.color.is_none()) {
            object.albedo.get_or_insert(Albedo(0.6));
        }
        let toml = toml::to_string(&parsed)
            .map_err(|e| SceneError::Invalid { file: file.to_owned(), message: e.to_string() })?;
        Ok(Parameters { file: parsed, toml })
    }

    /// As a scene file: reading it again gives the same scene.
    pub fn toml(&self) -> &str {
        &self.toml
    }
}

impl Serialize for Parameters {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.file.serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library;

    /// What is printed is the scene: read again it has the same hash.
    #[test]
    fn the_parameters_of_a_scene_make_it_again() {
        for (name, text) in library::SCENES {
            let scene = library::scene(name).unwrap();
            let parameters = Parameters::new(&scene, name, text).unwrap();
            let again = Scene::from_toml(name, name, parameters.toml(), None).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(again.hash(), scene.hash(), "{name}:\n{}", parameters.toml());
            assert_eq!(again.look, scene.look, "{name}");
        }
    }

    #[test]
    fn defaults_are_filled_in() {
        let text = "description = 'x'\nao = { radius = 0.2 }\nenvironment = { radiance = 1 }\n\
             [[object]]\nname = 'ground'\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 12], v = [12, 0, 0] } }\n\
             [[object]]\nname = 'sheet'\noccluder = true\nshape = { curtain = { gap = 0.05 } }\n";
        let scene = Scene::from_toml("x", "x", text, None).unwrap();
        let parameters = Parameters::new(&scene, "x", text).unwrap();
        for expected in [
            "secondary_radius = 0.05\n",
            "clearance = 0.04",
            "pixel = 0.004",
            "fov = 45.0\n",
            "albedo = 0.6\n",
            "thickness = 0.02\n",
            "folds = \"flat\"\n",
            "segments = 12\n",
        ] {
            assert!(parameters.toml().contains(expected), "no {expected} in\n{}", parameters.toml());
        }
        let json = serde_json::to_string(&parameters).unwrap();
        assert!(json.contains("\"pleat_width\":0.15") && json.contains("\"secondary_radius\":0.05"), "{json}");
    }
}
