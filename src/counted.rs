//! Counts in sentences.

use std::fmt::Display;

/// `1 case`, `2 cases`.
pub(crate) fn counted<N: Copy + Display + PartialEq + From<u8>>(n: N, one: &str, many: &str) -> String {
    let word = if n == N::from(1) { one } else { many };
    format!("{n} {word}")
}
