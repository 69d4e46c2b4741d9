//! Where a report beside a record puts its pictures, relative to the record's folder.

/// The folder of all pictures.
pub const PICTURES: &str = "pictures";
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
