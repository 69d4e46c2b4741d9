//! Arguments with placeholders. Each stays one argument, whatever is filled in: no shell
//! reads it.

use std::ffi::{OsStr, OsString};

/// What can be filled in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    Scene,
    SceneToml,
    View,
    Output,
    Rays,
    Seed,
    Radius,
    SecondaryRadius,
    Estimator,
    Width,
    Height,
    Replicate,
    SuiteFolder,
}

impl Slot {
    const ALL: [(Slot, &str); 13] = [
        (Slot::Scene, "scene"),
        (Slot::SceneToml, "scene_toml"),
        (Slot::View, "view"),
        (Slot::Output, "output"),
        (Slot::Rays, "rays"),
        (Slot::Seed, "seed"),
        (Slot::Radius, "radius"),
        (Slot::SecondaryRadius, "secondary_radius"),
        (Slot::Estimator, "estimator"),
        (Slot::Width, "width"),
        (Slot::Height, "height"),
        (Slot::Replicate, "replicate"),
        (Slot::SuiteFolder, "suite_folder"),
    ];

    /// Whether it is filled in with a path that aogauge chose.
    fn is_path(self) -> bool {
        matches!(self, Slot::Scene | Slot::SceneToml | Slot::View | Slot::Output)
    }

    fn name(self) -> &'static str {
        Self::ALL.iter().find(|(slot, _)| *slot == self).map_or("", |(_, name)| name)
    }

    fn named(name: &str) -> Option<Slot> {
        Self::ALL.iter().find(|(_, n)| *n == name).map(|(slot, _)| *slot)
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Piece {
    Text(String),
    Slot(Slot),
}

/// One argument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Template(Vec<Piece>);

impl Template {
    /// Reads `text{slot}text`; `{{` and `}}` are braces.
    ///
    /// # Errors
    /// One sentence that names an unknown placeholder, a brace that is not closed, or a
    /// zero byte.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text.contains('\0') {
            return Err(format!("'{}' holds a zero byte, which no program can be given", text.escape_debug()));
        }
        let (mut pieces, mut plain, mut rest) = (Vec::new(), String::new(), text);
        while let Some(at) = rest.find(['{', '}']) {
            plain.push_str(&rest[..at]);
            let brace = &rest[at..=at];
            rest = &rest[at + 1..];
            if let Some(after) = rest.strip_prefix(brace) {
                plain.push_str(brace);
                rest = after;
                continue;
            }
            let end = rest.find(['{', '}']).filter(|&end| brace == "{" && rest[end..].starts_with('}'));
            let Some(end) = end else {
                return Err(format!(
                    "'{}' has a single '{brace}': write {brace}{brace} for a brace",
                    text.escape_debug()
                ));
            };
            let name = &rest[..end];
            let slot = Slot::named(name).ok_or_else(|| {
                let known = Slot::ALL.map(|(_, n)| format!("{{{n}}}")).join(", ");
                let name = name.escape_debug();
                format!("'{{{name}}}' is no placeholder: there are {known}; {{{{ is a brace")
            })?;
            if !plain.is_empty() {
                pieces.push(Piece::Text(std::mem::take(&mut plain)));
            }
            pieces.push(Piece::Slot(slot));
            rest = &rest[end + 1..];
        }
        plain.push_str(rest);
        if !plain.is_empty() {
            pieces.push(Piece::Text(plain));
        }
        let template = Template(pieces);
        match template.climbs() {
            Some(slot) => Err(format!(
                "'{}' leads out of {{{}}} by '..': a command may be told the path, and no other one from there",
                text.escape_debug(),
                slot.name()
            )),
            None => Ok(template),
        }
    }

    /// The path of ours that a component `..` follows, if one does: it leads to folders of the run, which are
    /// removed with all that is in them.
    fn climbs(&self) -> Option<Slot> {
        let mut path = None;
        for piece in &self.0 {
            match piece {
                Piece::Slot(slot) => path = if slot.is_path() { Some(*slot) } else { path },
                Piece::Text(text) if path.is_some() && text.split(['/', '\\']).any(|part| part == "..") => return path,
                Piece::Text(_) => {}
            }
        }
        None
    }

    /// Whether a slot is in it.
    pub fn has(&self, slot: Slot) -> bool {
        self.0.contains(&Piece::Slot(slot))
    }

    /// The text, where no slot is in it.
    pub fn plain(&self) -> Option<String> {
        fn text(piece: &Piece) -> Option<&str> {
            match piece {
                Piece::Text(text) => Some(text),
                Piece::Slot(_) => None,
            }
        }
        self.0.iter().map(text).collect()
    }

    /// The argument, filled in. What is filled in is not read again.
    pub fn fill(&self, value: &dyn Fn(Slot) -> OsString) -> OsString {
        let mut filled = OsString::new();
        for piece in &self.0 {
            match piece {
                Piece::Text(text) => filled.push(OsStr::new(text)),
                Piece::Slot(slot) => filled.push(value(*slot)),
            }
        }
        filled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(text: &str) -> OsString {
        Template::parse(text).unwrap().fill(&|slot| format!("<{slot:?} {{rays}}>").into())
    }

    #[test]
    fn what_is_filled_in_is_taken_as_it_is() {
        for (text, becomes) in [
            ("", ""),
            ("-b", "-b"),
            ("{rays}", "<Rays {rays}>"),
            ("--o={output}.exr", "--o=<Output {rays}>.exr"),
            ("{width}x{height}", "<Width {rays}>x<Height {rays}>"),
            ("{{\"rays\": {rays}}}", "{\"rays\": <Rays {rays}>}"),
            ("{{rays}}", "{rays}"),
            ("../a/{rays}..", "../a/<Rays {rays}>.."),
            ("{suite_folder}/../x", "<SuiteFolder {rays}>/../x"),
            ("{output}..png", "<Output {rays}>..png"),
            ("ü{{", "ü{"),
            ("$(x) ; 'y' \"z\"", "$(x) ; 'y' \"z\""),
        ] {
            assert_eq!(filled(text), OsString::from(becomes), "{text}");
        }
        assert_eq!(Template::parse("a{{b").unwrap().plain().as_deref(), Some("a{b"));
        assert_eq!(Template::parse("{rays}").unwrap().plain(), None);
        assert!(Template::parse("x{output}").unwrap().has(Slot::Output));
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, says) in [
            ("{ray}", "'{ray}' is no placeholder: there are {scene}, {scene_toml}, {view}, {output}"),
            ("{}", "'{}' is no placeholder"),
            ("{Rays}", "'{Rays}' is no placeholder"),
            ("{rays", "has a single '{'"),
            ("rays}", "has a single '}'"),
            ("{ra{{ys}", "has a single '{'"),
            ("a\0b", "zero byte"),
            ("{output}/../..", "leads out of {output} by '..'"),
            ("--o={scene}\\..\\x", "leads out of {scene} by '..'"),
        ] {
            let why = Template::parse(text).unwrap_err();
            assert!(why.contains(says), "{text}: {why}");
        }
    }
}
