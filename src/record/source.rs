//! Where the images of a case come from that was not rendered here.

use crate::untrusted;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Images of a renderer of somebody's own, as they were handed in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandedIn {
    /// The renderer's name.
    pub renderer: String,
    /// The kit that it was scored against: what it is called by, and the version of aogauge that wrote it, suite and seed.
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

/// Names in one sentence.
const NAMED: usize = 3;
/// Characters of one of them.
const LONG: usize = 120;

/// Remarks with what they are of, such as (file, sentence): each sentence once, with how many of
/// `all` it is of and the first names. Sentences that differ in their numbers alone are told once, the
/// first of them. `what` they are of is "files" or "cases".
pub fn told_once(remarks: &[(String, String)], what: &str, all: usize) -> Vec<String> {
    // Of one pixel a sentence has other endings than of several.
    let word = |word: &str| {
        if word == "are" { "i".to_owned() } else { word.trim_end_matches(['s', ',', ';', ':']).to_owned() }
    };
    let plain = |text: &str| text.chars().filter(|c| !c.is_ascii_digit() && !"-.".contains(*c)).collect::<String>();
    let key = |text: &str| plain(text).split_whitespace().map(word).collect::<Vec<_>>().join(" ");
    let mut groups: Vec<(String, Vec<&(String, String)>)> = Vec::new();
    for remark in remarks {
        let key = key(&remark.1);
        match groups.iter_mut().find(|(k, _)| *k == key) {
            Some((_, group)) => group.push(remark),
            None => groups.push((key, vec![remark])),
        }
    }
    let shown = |name: &String| untrusted::cut(&untrusted::line(name), LONG).into_owned();
    let told = |group: &[&(String, String)]| {
        let (name, text) = group[0];
        let mut names: Vec<&String> = group.iter().map(|(name, _)| name).collect();
        names.dedup();
        let n = names.len();
        let is_same = group.iter().all(|(_, t)| t == text);
        let list = |names: &[&String]| {
            let first: Vec<String> = names.iter().take(NAMED).map(|n| shown(n)).collect();
            let more = names.len().saturating_sub(NAMED);
            first.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
        };
        match (n, is_same) {
            (1, _) if all == 1 => text.clone(),
            (1, _) => format!("{}: {text}", shown(name)),
            (_, true) if n == all => format!("{text} (all {n} {what})"),
            (_, true) => format!("{text} ({n} {what}: {})", list(&names)),
            (_, false) => format!("{}: {text}; alike in {} more {what}: {}", shown(name), n - 1, list(&names[1..])),
        }
    };
    groups.iter().map(|(_, group)| told(group)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_is_told_once() {
        let of =
            |names: &[(&str, &str)]| names.iter().map(|(n, t)| ((*n).to_owned(), (*t).to_owned())).collect::<Vec<_>>();
        let told = |names: &[(&str, &str)], all| told_once(&of(names), "files", all);
        assert_eq!(told(&[("a", "dark")], 1), ["dark"]);
        assert_eq!(told(&[("a", "dark"), ("b", "odd"), ("b", "dark")], 4), ["dark (2 files: a, b)", "b: odd"]);
        assert_eq!(told(&[("a", "dark"), ("b", "dark")], 2), ["dark (all 2 files)"]);
        let five = ["a", "b", "c", "d", "e"].map(|n| (n, "dark"));
        assert_eq!(told(&five, 9), ["dark (5 files: a, b, c and 2 more)"]);
        let numbers = [("a", "7 pixels, -0.5"), ("b", "123 pixels, 1"), ("c\nd", "1 pixel, 0.25")];
        assert_eq!(told(&numbers, 3), ["a: 7 pixels, -0.5; alike in 2 more files: b, c d"]);
        assert_eq!(told(&[], 3), [""; 0]);
    }
}
