//! Text that others wrote: names of gates and occluders, reasons, notes. Suites, models
//! and records come from anybody, and what is made of them must read as text, whatever
//! it holds.

use std::{borrow::Cow, fmt::Write as _};

/// On one line, without what is not seen: control characters become spaces; marks that
/// turn the direction of text, by which a name reads as another, are left out, and so are
/// the code points that are no characters, which XML does not take.
pub(crate) fn line(text: &str) -> String {
    text.chars().filter_map(shown).collect()
}

fn shown(c: char) -> Option<char> {
    match c {
        '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{fdd0}'..='\u{fdef}' => None,
        c if u32::from(c) & 0xfffe == 0xfffe => None,
        '\u{2028}' | '\u{2029}' => Some(' '),
        c if c.is_control() => Some(' '),
        c => Some(c),
    }
}

/// One line of a log. GitHub's runner reads commands from all that a program prints, those
/// that begin a line with `::` and those with `##[` anywhere: neither is left.
pub(crate) fn logged(text: &str) -> String {
    let text = line(text).replace("##[", "## [");
    match text.trim_start().strip_prefix("::") {
        Some(rest) => format!(": :{rest}"),
        None => text,
    }
}

/// Several lines of a log, each [`logged`]. Breaks of lines stay: where one text of others may hold them, [`logged`]
/// comes first.
pub(crate) fn logged_lines(text: &str) -> String {
    text.split('\n').map(logged).collect::<Vec<_>>().join("\n")
}

/// At most so many characters, the last of them an ellipsis where more are cut off.
pub(crate) fn cut(text: &str, characters: usize) -> Cow<'_, str> {
    match text.char_indices().nth(characters) {
        None => Cow::Borrowed(text),
        Some((end, _)) => Cow::Owned(format!("{}…", &text[..end])),
    }
}

/// Text as it reads in Markdown (GitHub's), in any place: a heading, a cell, a list, the
/// text of a link or of an image, or within `<code>`. No markup, no HTML, no end of a
/// cell, no mention of a person and no link comes of it. Not for use within backticks,
/// where entities are not read.
pub(crate) fn markdown(text: &str) -> String {
    let line = line(text);
    let line = line.trim();
    let mut safe = String::new();
    let mut rest = line;
    // What begins a list, a rule, or underlines a heading.
    let mark = rest.starts_with(['-', '+', '=']) && !rest[1..].starts_with(|c: char| c.is_ascii_digit() || c == '.');
    if mark {
        let _ = write!(safe, "&#{};", u32::from(rest.as_bytes()[0]));
        rest = &rest[1..];
    }
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    if digits > 0 && rest[digits..].starts_with(['.', ')']) && !rest[digits + 1..].starts_with(|c: char| c != ' ') {
        let _ = write!(safe, "{}&#{};", &rest[..digits], u32::from(rest.as_bytes()[digits]));
        rest = &rest[digits + 1..];
    }
    for (i, c) in rest.char_indices() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            '|' | '`' | '*' | '_' | '[' | ']' | '\\' | '~' | '$' | '!' => {
                let _ = write!(safe, "&#{};", u32::from(c));
            }
            // A space without width keeps what follows from becoming a mention or a link.
            '@' | '#' => {
                let _ = write!(safe, "&#{};\u{200b}", u32::from(c));
            }
            ':' if rest[i + 1..].starts_with('/') => safe += ":\u{200b}",
            // GitHub links what begins so without a scheme.
            '.' if rest.as_bytes()[i.saturating_sub(3)..i].eq_ignore_ascii_case(b"www") => safe += "\u{200b}.",
            c => safe.push(c),
        }
    }
    safe
}

/// A path relative to the page, for the target of a link: all but letters, digits and
/// `-._~/` as `%XX`.
pub(crate) fn path(path: &str) -> String {
    let mut safe = String::new();
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte) {
            safe.push(char::from(byte));
        } else {
            let _ = write!(safe, "%{byte:02X}");
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_one_line_of_what_is_seen() {
        assert_eq!(line("a\nb\r\tc\u{1b}[31m\u{0}\u{85}\u{2028}d"), "a b  c [31m   d");
        assert_eq!(line("a\u{202e}b\u{fffe}\u{ffff}\u{fdd0}\u{1ffff}"), "ab");
        assert_eq!(line("K(Q) é 深 🙂"), "K(Q) é 深 🙂");
    }

    #[test]
    fn a_log_holds_no_commands() {
        for (text, expected) in [
            ("::error::x", ": :error::x"),
            ("\n  ::add-mask::x", ": :add-mask::x"),
            ("a ##[add-mask]x", "a ## [add-mask]x"),
            ("std::mem", "std::mem"),
        ] {
            assert_eq!(logged(text), expected);
        }
    }

    #[test]
    fn lines_of_a_log_hold_no_commands_either() {
        assert_eq!(logged_lines("a: x\n ::error::y\u{1b}[31m\n\n"), "a: x\n: :error::y [31m\n\n");
    }

    #[test]
    fn what_is_cut_says_so() {
        assert_eq!((cut("äöü", 3), cut("äöü", 2)), ("äöü".into(), "äö…".into()));
    }

    #[test]
    fn markdown_holds_no_markup() {
        for (text, expected) in [
            ("K(Q) is above 0: yes", "K(Q) is above 0: yes"),
            ("a|b\nc", "a&#124;b c"),
            ("<img src=x>&amp;", "&lt;img src=x&gt;&amp;amp;"),
            ("[x](http://y)", "&#91;x&#93;(http:\u{200b}//y)"),
            ("www.y.z", "www\u{200b}.y.z"),
            ("**_`~\\", "&#42;&#42;&#95;&#96;&#126;&#92;"),
            ("@me #1", "&#64;\u{200b}me &#35;\u{200b}1"),
            ("- item", "&#45; item"),
            ("---", "&#45;--"),
            ("   code", "code"),
            ("1. item", "1&#46; item"),
            ("12)", "12&#41;"),
            ("-0.25 ± 0.01", "-0.25 ± 0.01"),
            ("1.5", "1.5"),
            ("é-ü", "é-ü"),
        ] {
            assert_eq!(markdown(text), expected, "{text}");
        }
    }

    #[test]
    fn paths_keep_their_folders() {
        assert_eq!(path("pictures/curtain-arcade/q.png"), "pictures/curtain-arcade/q.png");
        assert_eq!(path("ä\\\"<>'#?%"), "%C3%A4%5C%22%3C%3E%27%23%3F%25");
    }
}
