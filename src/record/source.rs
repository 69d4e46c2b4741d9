//! Where the images of a case come from that was not rendered here.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Images of a renderer of somebody's own, as they were handed in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandedIn {
    /// The renderer's name.
    pub renderer: String,
    /// The kit that it was scored against: the version of aogauge that wrote it.
    pub kit: String,
    /// What was undone in all images: openness was seen as gain * O^exponent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub curve: Option<UndoneCurve>,
    /// What is doubtful in all of it.
    pub warnings: Vec<String>,
}

/// An intensity curve that was undone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UndoneCurve {
    /// Factor.
    pub gain: f64,
    /// Power.
    pub exponent: f64,
    /// RMSE against the reference before and after, over the scenes that it was fitted on; absent where it was declared.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub rmse: Option<[f64; 2]>,
    /// The scenes that it was fitted on; none where it was declared.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub scenes: Vec<String>,
}

/// What a case was read from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Files, relative to the folder that was handed in.
    pub files: Vec<String>,
    /// What they show.
    pub shows: Shows,
    /// How openness was read from them: encoding and what else was declared or detected.
    pub read_as: String,
    /// What its intervals are taken over.
    pub intervals: Intervals,
    /// What is doubtful in it.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub warnings: Vec<String>,
}

/// What handed in images show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shows {
    /// Openness alone.
    Openness,
    /// Whole frames with and without AO, whose ratio is openness.
    Ratio,
    /// Whole frames: light, colours and AO in one. Of these only the contrast is known.
    Frame,
}

/// What an interval is taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Intervals {
    /// Images that are independent of each other.
    Replicates,
    /// The tiles of one image, by block bootstrap: noise of one frame, of no other.
    Tiles,
}
