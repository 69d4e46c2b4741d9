//! Text that others wrote: names of gates and occluders, reasons, notes. Suites, models
//! and records come from anybody, and what is made of them must read as text, whatever
//! it holds.

use std::borrow::Cow;

/// On one line, without what is not seen: control characters become spaces; marks that
/// turn the direction of text, by which a name reads as another, are left out, and so are
/// the code points that are no characters, which XML does not take.
pub(crate) fn line(text: &str) -> String {
    text.chars().filter_map(shown).collect()
}

fn shown(c: char) -> Option<char> {
    match c {
        '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => None,
        '\u{fdd0}'..='\u{fdef}' => None,
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

/// At most so many characters, the last of them an ellipsis where more are cut off.
pub(crate) fn cut(text: &str, characters: usize) -> Cow<'_, str> {
    match text.char_indices().nth(characters) {
        None => Cow::Borrowed(text),
        Some((end, _)) => Cow::Owned(format!("{}…", &text[..end])),
    }
}

/// Markdown that reads as the text: no markup, no HTML, no end of a table's cell, no
/// mention of a person and no link. Not for code spans, which show it as it is.
pub(crate) fn markdown(text: &str) -> String {
    escaped(text, |c, _| "&<>|`*_[]\\~$!@#:".contains(c))
}

/// The same for a file that people also read as it is: what does no harm by itself is
/// left. Names of scenes and estimators stay as they are, so that this may be put into
/// code spans and paths, too.
pub(crate) fn markdown_source(text: &str) -> String {
    escaped(text, |c, next| match c {
        // Only what follows makes it a link, a footnote or the place that one leads to.
        '[' => next == Some('^'),
        ']' => next.is_some_and(|n| "([:".contains(n)),
        '!' => next == Some('['),
        ':' => true,
        _ => "&<>|`*\\~$@#".contains(c),
    })
}

fn escaped(text: &str, is_special: impl Fn(char, Option<char>) -> bool) -> String {
    let text = line(text);
    let mut safe = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let next = rest.peek().copied();
        match c {
            c if !is_special(c, next) => safe.push(c),
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            // A space without width keeps what follows from becoming a link.
            '@' | '#' => safe += &format!("&#{};\u{200b}", u32::from(c)),
            ':' if next == Some('/') => safe += ":\u{200b}",
            ':' => safe.push(c),
            c => safe += &format!("&#{};", u32::from(c)),
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
            ("**_`~\\", "&#42;&#42;&#95;&#96;&#126;&#92;"),
            ("@me #1", "&#64;\u{200b}me &#35;\u{200b}1"),
            ("a\u{202e}b\u{7}", "ab "),
        ] {
            assert_eq!(markdown(text), expected, "{text}");
        }
    }

    #[test]
    fn a_source_stays_legible() {
        for text in ["0.27 [0.26, 0.28]", "a_scene.v2-x/classic_1/cpu/4", "K(Q) is 0: yes!", "0.1\u{a0}±\u{a0}0.2"] {
            assert_eq!(markdown_source(text), text);
        }
        for (text, expected) in [
            ("a|b\n`c`", "a&#124;b &#96;c&#96;"),
            ("![x](http://y)", "&#33;[x&#93;(http:\u{200b}//y)"),
            ("[x]: /y [^1]", "[x&#93;: /y &#91;^1]"),
            ("<b>~~~", "&lt;b&gt;&#126;&#126;&#126;"),
        ] {
            assert_eq!(markdown_source(text), expected, "{text}");
        }
    }
}
