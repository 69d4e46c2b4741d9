//! The scenes that come with aogauge, as TOML built into the program.

use crate::{Scene, SceneError};

/// Name and TOML text of every built-in scene, in the order they are shown.
pub const SCENES: [(&str, &str); 7] = [
    ("curtain-open", include_str!("../library/curtain-open.toml")),
    ("curtain-arcade", include_str!("../library/curtain-arcade.toml")),
    ("curtain-room", include_str!("../library/curtain-room.toml")),
    ("pillar", include_str!("../library/pillar.toml")),
    ("plane", include_str!("../library/plane.toml")),
    ("corner", include_str!("../library/corner.toml")),
    ("thick-box", include_str!("../library/thick-box.toml")),
];

/// The built-in scene of this name.
///
/// # Errors
/// [`SceneError::Unknown`] with the names there are.
pub fn scene(name: &str) -> Result<Scene, SceneError> {
    let (_, text) = SCENES
        .iter()
        .find(|(n, _)| *n == name)
        .ok_or_else(|| SceneError::Unknown { name: name.to_owned(), known: SCENES.map(|(n, _)| n).join(", ") })?;
    Scene::from_toml(name, &format!("{name}.toml (built in)"), text, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_scene_loads_and_has_a_twin() {
        for (name, _) in SCENES {
            let s = scene(name).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(s.has_occluder(), s.twin() != s, "{name}");
            assert!(!s.twin().has_occluder());
            assert_eq!(s.hash(), scene(name).unwrap().hash());
        }
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let message = scene("curtian").unwrap_err().to_string();
        assert!(message.contains("curtain-room"), "{message}");
    }
}
