//! What the name of a file says it is an image of.

use super::read::digits;

/// What an image shows, by the last word before its extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Shown {
    /// AO alone.
    Openness,
    /// A whole frame with AO: `.with`.
    With,
    /// The same frame without AO: `.without`.
    Without,
    /// A whole frame with AO, of which there is none without: `.frame`.
    Frame,
}

/// A name read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Name {
    pub scene: String,
    /// None where the name does not say.
    pub estimator: Option<String>,
    pub rays: Option<u32>,
    pub replicate: Option<u32>,
    pub shown: Shown,
}

impl Shown {
    /// The word in a name.
    pub fn label(self) -> &'static str {
        match self {
            Shown::Openness => "openness",
            Shown::With => "with",
            Shown::Without => "without",
            Shown::Frame => "frame",
        }
    }
}

/// Reads a name without its extension: SCENE, then, each after a dot and each where it is
/// there, ESTIMATOR, RAYS, REPLICATE, and `with`, `without` or `frame`. Scenes and estimators
/// may hold dots: the longest known name that fits is taken. `folder` is the scene of the
/// folder that the file lies in: then the name need not begin with it.
///
/// # Errors
/// Why it is no such name, as the end of a sentence.
pub(super) fn parse(stem: &str, folder: Option<&str>, scenes: &[&str], estimators: &[&str]) -> Result<Name, String> {
    let (scene, rest) = match (beginning(stem, scenes), folder) {
        (Some((scene, rest)), None) => (scene, rest),
        (Some((scene, rest)), Some(folder)) if scene == folder => (scene, rest),
        (Some((scene, _)), Some(folder)) if beginning(stem, estimators).is_none() => {
            return Err(format!("names the scene '{scene}' but lies in the folder of '{folder}'"));
        }
        (_, Some(folder)) => (folder, stem),
        (None, None) => {
            let close = scenes.iter().find(|s| starts_with_ignoring_case(stem, s));
            return Err(match close {
                Some(scene) => format!("names no scene; '{scene}' is written so"),
                None => "names no scene of the kit".to_owned(),
            });
        }
    };
    let mut name =
        Name { scene: scene.to_owned(), estimator: None, rays: None, replicate: None, shown: Shown::Openness };
    let mut rest = rest;
    for shown in [Shown::With, Shown::Without, Shown::Frame] {
        let before = rest.strip_suffix(shown.label());
        if let Some(before) = before.and_then(|b| if b.is_empty() { Some("") } else { b.strip_suffix('.') }) {
            (name.shown, rest) = (shown, before);
            break;
        }
    }
    if let Some((estimator, after)) = beginning(rest, estimators) {
        name.estimator = Some(estimator.to_owned());
        rest = after;
    }
    let mut numbers = rest.split('.').filter(|_| !rest.is_empty());
    let mut number = |what: &str| match numbers.next() {
        None => Ok(None),
        Some(text) => match digits(text).filter(|_| !text.is_empty()).and_then(|n| u32::try_from(n).ok()) {
            Some(n) => Ok(Some(n)),
            None if name.estimator.is_none() => Err(format!("names no estimator where it says '{text}'")),
            None => Err(format!("has '{text}' where {what} should be")),
        },
    };
    if name.estimator.is_some() {
        name.rays = number("the number of rays")?;
        name.replicate = number("the number of the replicate")?;
    } else {
        // Without an estimator a number is that of a replicate.
        name.replicate = number("the number of the replicate")?;
    }
    if let Some(more) = numbers.next() {
        return Err(format!("has '{more}' after all that a name may say"));
    }
    if name.rays == Some(0) {
        return Err("has 0 rays".to_owned());
    }
    Ok(name)
}

/// The longest of the names that a text begins with, up to a dot or the end, and what follows
/// the dot.
fn beginning<'a>(text: &'a str, names: &[&'a str]) -> Option<(&'a str, &'a str)> {
    let after = |name: &&'a str| {
        let rest = text.strip_prefix(*name).filter(|_| !name.is_empty())?;
        let rest = if rest.is_empty() { rest } else { rest.strip_prefix('.')? };
        Some((*name, rest))
    };
    names.iter().filter_map(after).max_by_key(|(name, _)| name.len())
}

fn starts_with_ignoring_case(text: &str, name: &str) -> bool {
    text.get(..name.len()).is_some_and(|t| t.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENES: [&str; 3] = ["curtain", "curtain.open", "classic"];
    const ESTIMATORS: [&str; 3] = ["classic", "extended", "extended.v2"];

    fn read(stem: &str, folder: Option<&str>) -> Result<Name, String> {
        parse(stem, folder, &SCENES, &ESTIMATORS)
    }

    fn name(scene: &str, estimator: &str, numbers: [Option<u32>; 2], shown: Shown) -> Name {
        let estimator = (!estimator.is_empty()).then(|| estimator.to_owned());
        Name { scene: scene.into(), estimator, rays: numbers[0], replicate: numbers[1], shown }
    }

    #[test]
    fn names_are_read_longest_first() {
        use Shown::{Frame, Openness, With, Without};
        for (stem, folder, expected) in [
            ("curtain.classic.4.0003", None, name("curtain", "classic", [Some(4), Some(3)], Openness)),
            ("curtain.open.extended.v2.16", None, name("curtain.open", "extended.v2", [Some(16), None], Openness)),
            ("curtain.open", None, name("curtain.open", "", [None; 2], Openness)),
            ("curtain.7", None, name("curtain", "", [None, Some(7)], Openness)),
            ("curtain.with", None, name("curtain", "", [None; 2], With)),
            ("curtain.classic.4.0.without", None, name("curtain", "classic", [Some(4), Some(0)], Without)),
            ("classic.classic.1.frame", None, name("classic", "classic", [Some(1), None], Frame)),
            ("classic.4.2", Some("curtain"), name("curtain", "classic", [Some(4), Some(2)], Openness)),
            ("curtain.extended", Some("curtain"), name("curtain", "extended", [None; 2], Openness)),
            ("0012", Some("curtain"), name("curtain", "", [None, Some(12)], Openness)),
            ("with", Some("curtain"), name("curtain", "", [None; 2], With)),
        ] {
            assert_eq!(read(stem, folder), Ok(expected), "{stem}");
        }
    }

    #[test]
    fn other_names_say_why_they_are_none() {
        for (stem, folder, why) in [
            ("room.classic.4", None, "names no scene"),
            ("Curtain.classic.4", None, "'curtain' is written so"),
            ("curtains.classic.4", None, "names no scene"),
            ("curtain.clasic.4", None, "names no estimator where it says 'clasic'"),
            ("curtain.classic.four", None, "has 'four' where the number of rays should be"),
            ("curtain.classic.4.x", None, "has 'x' where the number of the replicate should be"),
            ("curtain.classic.4.1.2", None, "has '2' after"),
            ("curtain.classic.0", None, "has 0 rays"),
            ("curtain.classic.99999999999", None, "has '99999999999'"),
            ("curtain.classic.-4", None, "has '-4'"),
            ("curtain.open.classic.4", Some("classic"), "lies in the folder of 'classic'"),
        ] {
            let error = read(stem, folder).unwrap_err();
            assert!(error.contains(why), "{stem}: {error}");
        }
    }
}
