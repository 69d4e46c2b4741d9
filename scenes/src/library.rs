//! The scenes that come with aogauge, as TOML built into the program.

use crate::{Scene, SceneError};

/// Name and TOML text of every built-in scene, in the order they are shown.
pub const SCENES: [(&str, &str); 20] = [
    ("curtain-open", include_str!("../library/curtain-open.toml")),
    ("curtain-arcade", include_str!("../library/curtain-arcade.toml")),
    ("curtain-room", include_str!("../library/curtain-room.toml")),
    ("pillar", include_str!("../library/pillar.toml")),
    ("plane", include_str!("../library/plane.toml")),
    ("corner", include_str!("../library/corner.toml")),
    ("thick-box", include_str!("../library/thick-box.toml")),
    ("atrium", include_str!("../library/atrium.toml")),
    ("pleated-curtain", include_str!("../library/pleated-curtain.toml")),
    ("banner", include_str!("../library/banner.toml")),
    ("fence", include_str!("../library/fence.toml")),
    ("blinds", include_str!("../library/blinds.toml")),
    ("shelf", include_str!("../library/shelf.toml")),
    ("table", include_str!("../library/table.toml")),
    ("leaves", include_str!("../library/leaves.toml")),
    ("cables", include_str!("../library/cables.toml")),
    ("ceiling-light", include_str!("../library/ceiling-light.toml")),
    ("crevice", include_str!("../library/crevice.toml")),
    ("sphere", include_str!("../library/sphere.toml")),
    ("ridge", include_str!("../library/ridge.toml")),
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
