//! A scene on disk as other programs read it: the model, the scene file for it, and its views.

use crate::{
    disk::{DiskError, write_whole},
    scenes::{Scene, gltf, views_json},
};
use std::{
    io::{Error, Write},
    path::{Path, PathBuf},
};

/// Where they lie.
pub(crate) struct SceneFiles {
    /// `NAME.glb`, metres.
    pub glb: PathBuf,
    /// `NAME.toml`, a scene file for it.
    pub toml: PathBuf,
    /// `views.json`: views, light, R and R' in numbers.
    pub views: PathBuf,
}

/// Writes them into a folder.
///
/// # Errors
/// Where a file cannot be written, or the scene cannot be said in a file.
pub(crate) fn write(scene: &Scene, folder: &Path) -> Result<SceneFiles, DiskError> {
    let name = &scene.name;
    let [glb, toml, views] = [format!("{name}.glb"), format!("{name}.toml"), "views.json".to_owned()];
    let text = scene.model_toml(&glb).map_err(|e| DiskError::content(&folder.join(&toml), e.to_string()))?;
    let files = SceneFiles { glb: folder.join(glb), toml: folder.join(toml), views: folder.join(views) };
    write_glb(scene, &files.glb)?;
    write_whole(&files.toml, |out| out.write_all(text.as_bytes()))?;
    write_whole(&files.views, |out| out.write_all(views_json(scene).as_bytes()))?;
    Ok(files)
}

/// Writes the model alone.
///
/// # Errors
/// Where the file cannot be written.
pub(crate) fn write_glb(scene: &Scene, path: &Path) -> Result<(), DiskError> {
    write_whole(path, |out| gltf::write_glb(scene, out).map_err(Error::other))
}
