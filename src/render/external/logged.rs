//! A command as its log has it: a line that a shell of Unix takes as it is meant.

use super::External;
use std::{ffi::OsStr, path::Path, process::Command};

/// What the log says of a command before it is run. Of the environment the names alone: values may be secrets.
pub(super) fn written(command: &Command, external: &External, program: &Path) -> String {
    let words = std::iter::once(program.as_os_str()).chain(command.get_args()).map(quoted);
    let line = words.collect::<Vec<_>>().join(" ");
    let mut text = format!("cd {} && {line}\n", quoted(external.folder.as_os_str()));
    let names: Vec<String> =
        external.environment.keys().map(|name| format!("{}=…", quoted(OsStr::new(name)))).collect();
    if !names.is_empty() {
        text.push_str(&format!("with {} (values are not logged)\n", names.join(" ")));
    }
    text
}

/// A word between single quotes, in which a shell reads nothing; plain words as they are.
fn quoted(word: &OsStr) -> String {
    let word = word.to_string_lossy();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,@%+=".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.into_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_nothing_in_a_word() {
        for (word, becomes) in [
            ("--rays=4", "--rays=4"),
            ("", "''"),
            ("a b", "'a b'"),
            ("$(touch x)`y`\"z\"\\", "'$(touch x)`y`\"z\"\\'"),
            ("it's", r"'it'\''s'"),
            ("~", "'~'"),
        ] {
            assert_eq!(quoted(OsStr::new(word)), becomes);
        }
    }
}
