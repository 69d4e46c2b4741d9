//! Text from files, made harmless where it is shown: names come from anybody's TOML and
//! from records of anybody's making.

use std::fmt::Write as _;

/// Text on one line, without what is not seen: control characters become spaces, marks
/// that turn the direction of text, and what XML forbids, go.
///
/// ```
/// assert_eq!(aogauge::escape::line("a\u{202e}b\u{7}\nc\u{ffff}"), "ab  c");
/// ```
pub fn line(text: &str) -> String {
    let seen = |c: char| match c {
        '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{fffe}' | '\u{ffff}' => None,
        // Separators of lines and paragraphs are no control characters to Unicode.
        '\u{2028}' | '\u{2029}' => Some(' '),
        c if c.is_control() => Some(' '),
        c => Some(c),
    };
    text.chars().filter_map(seen).collect()
}

/// Text as it reads in Markdown (GitHub's), in any place: a heading, a cell, a list, the
/// text of a link or of an image, or within `<code>`. No markup, no HTML, no end of a
/// cell, no mention of a person and no link comes of it. Not for use within backticks,
/// where entities are not read.
///
/// ```
/// assert_eq!(aogauge::escape::markdown("a|b\n<i>"), "a&#124;b &lt;i&gt;");
/// ```
pub fn markdown(text: &str) -> String {
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
///
/// ```
/// assert_eq!(aogauge::escape::path("pictures/a b](c.png"), "pictures/a%20b%5D%28c.png");
/// ```
pub fn path(path: &str) -> String {
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
