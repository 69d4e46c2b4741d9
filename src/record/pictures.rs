//! Where a report beside a record puts its pictures, relative to the record's folder.

/// The folder of all pictures.
pub const PICTURES: &str = "pictures";
/// Within a scene's pictures, those of the look view.
pub const LOOK: &str = "look";
/// Within a scene's pictures, those of the measure view.
pub const MEASURE: &str = "measure";
/// Maps of O - Q within a scene's pictures, and the name of their bar.
pub const MINUS_Q: &str = "minus-q";
/// The same of the mean at the fewest rays less the converged image.
pub const MINUS_CONVERGED: &str = "minus-converged";

/// A scene's picture of one estimator in one of the folders above.
pub fn of_estimator(scene: &str, folder: &str, estimator: &str) -> String {
    format!("{PICTURES}/{scene}/{folder}/{estimator}.png")
}

/// The picture of Q.
pub fn q(scene: &str) -> String {
    format!("{PICTURES}/{scene}/q.png")
}

/// The profiles along the transect.
pub fn profile(scene: &str) -> String {
    format!("{PICTURES}/{scene}/profile.svg")
}

/// The path-traced picture of the look view.
pub fn path_traced(scene: &str) -> String {
    format!("{PICTURES}/{scene}/path-traced.png")
}

/// The error over rays.
pub fn convergence(scene: &str) -> String {
    format!("{PICTURES}/{scene}/convergence.svg")
}

/// The bar of the scale of maps: [`MINUS_Q`] or [`MINUS_CONVERGED`].
pub fn bar(maps: &str) -> String {
    format!("{PICTURES}/{maps}.png")
}

/// The contrast error of all methods in all scenes.
pub fn contrast_error() -> String {
    format!("{PICTURES}/contrast-error.svg")
}

/// Time against error.
pub fn cost() -> String {
    format!("{PICTURES}/cost.svg")
}

/// The p-values of the verdicts.
pub fn p_values() -> String {
    format!("{PICTURES}/p-values.svg")
}
