//! Names of objects, and which of them are occluders.

use super::{Imported, document::quoted};
use serde_json::Value;
use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};
use wildmatch::WildMatch;

/// Longest name an object gets, characters.
const LONGEST: usize = 120;

/// Gives every object a name of its own.
#[derive(Default)]
pub(super) struct Unique {
    taken: HashSet<String>,
    next: HashMap<String, u64>,
}

impl Unique {
    /// `wanted`, or `wanted-2`, `wanted-3`, ... where it is taken.
    pub(super) fn name(&mut self, wanted: &str) -> String {
        let base: String = wanted.chars().take(LONGEST).collect();
        let mut name = base.clone();
        let next = self.next.entry(base.clone()).or_insert(2);
        while self.taken.contains(&name) {
            name = format!("{base}-{next}");
            *next += 1;
        }
        self.taken.insert(name.clone());
        name
    }
}

/// What marks an occluder in a node's or mesh's extras.
pub(super) fn marked(extras: Option<&Value>) -> bool {
    extras.and_then(|e| e.pointer("/aogauge/occluder")) == Some(&Value::Bool(true))
}

/// A primitive that became no object.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Emptied {
    /// What it is called in messages.
    pub label: String,
    /// How many triangles it had.
    pub triangles: usize,
    /// The names it goes by.
    pub names: Vec<Arc<str>>,
}

impl Imported {
    /// Marks as occluders the objects whose node (or a node above it), mesh or
    /// material has a name that fits a pattern, where `*` stands for any text and
    /// `?` for one character.
    ///
    /// # Errors
    /// One sentence that names a pattern that fits nothing, and names that there are.
    ///
    /// # Example
    /// ```no_run
    /// let mut model = aogauge_scenes::gltf::import("atrium.glb".as_ref(), 1.0)?;
    /// model.mark_occluders(&["curtain_*"])?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn mark_occluders<S: AsRef<str>>(&mut self, patterns: &[S]) -> Result<(), String> {
        for pattern in patterns {
            let glob = WildMatch::new(pattern.as_ref());
            let mut found = false;
            for (object, names) in self.objects.iter_mut().zip(&self.names) {
                if names.iter().any(|n| glob.matches(n)) {
                    object.occluder = true;
                    found = true;
                }
            }
            if !found {
                return Err(format!(
                    "no node, mesh or material has a name like {}{}",
                    quoted(pattern.as_ref()),
                    match self.emptied(|n| glob.matches(n)) {
                        none if none.is_empty() => format!("; there are, for example: {}", self.some_names()),
                        emptied => format!(" and triangles{emptied}"),
                    }
                ));
            }
        }
        Ok(())
    }

    /// What has no triangles left, of that with a name that fits: a clause that
    /// goes on with a message, empty where there is nothing to tell.
    pub(crate) fn emptied(&self, fits: impl Fn(&str) -> bool) -> String {
        let found: Vec<&Emptied> = self.emptied.iter().filter(|e| e.names.iter().any(|n| fits(n))).collect();
        let each = found.iter().take(3).map(|e| match e.triangles {
            0 => format!("; {} has only points or lines", e.label),
            1 => format!("; {} has no triangles left (1 was cut away or degenerate)", e.label),
            n => format!("; {} has no triangles left ({n} were cut away or degenerate)", e.label),
        });
        let more = found.len().checked_sub(4).map(|n| format!("; so have {} more", n + 1));
        each.chain(more).collect()
    }

    fn some_names(&self) -> String {
        let mut seen = HashSet::new();
        let names = self.names.iter().flatten().filter(|n| seen.insert(*n));
        names.take(12).map(|n| quoted(n)).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_made_unique_and_short() {
        let mut unique = Unique::default();
        let names: Vec<String> = ["a", "a-2", "a", "a"].iter().map(|n| unique.name(n)).collect();
        assert_eq!(names, ["a", "a-2", "a-3", "a-4"]);
        assert_eq!(unique.name(&"x".repeat(1000)).len(), LONGEST);
    }
}
