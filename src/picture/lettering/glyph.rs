//! The shapes of letters: strokes of a pen, each a line through points.

use glam::Vec2;

/// A letter: its width and its strokes; the baseline at 0, an x of height 1,
/// capitals and digits of height 1.5, descenders to -0.5.
pub(super) struct Glyph {
    pub width: f32,
    pub strokes: Vec<Vec<Vec2>>,
}

/// A stroke through points.
fn line(points: &[[f32; 2]]) -> Vec<Vec2> {
    points.iter().map(|&p| Vec2::from(p)).collect()
}

/// Part of an ellipse, degrees counter-clockwise from the right.
fn arc(center: [f32; 2], [rx, ry]: [f32; 2], from: f32, to: f32) -> Vec<Vec2> {
    let at = |i: u8| (from + (to - from) * f32::from(i) / 24.0).to_radians();
    (0..=24).map(|i| Vec2::from(center) + Vec2::new(rx * at(i).cos(), ry * at(i).sin())).collect()
}

/// Strokes without lifting the pen.
fn joined(parts: &[Vec<Vec2>]) -> Vec<Vec2> {
    parts.concat()
}

/// A dot, a little wider than the pen.
fn dot(x: f32, y: f32) -> Vec<Vec2> {
    arc([x, y], [0.04; 2], 0.0, 360.0)
}

/// The bowl of a, b, d, g, o, p and q.
fn bowl() -> Vec<Vec2> {
    arc([0.5, 0.5], [0.5; 2], 0.0, 360.0)
}

/// The arch of h, m and n: from the stem at `x` over to the baseline.
fn arch(x: f32, width: f32) -> Vec<Vec2> {
    let r = width / 2.0;
    joined(&[arc([x + r, 1.0 - r], [r; 2], 180.0, 0.0), line(&[[x + width, 0.0]])])
}

/// The bowl of B, P and R: from the top left, `width` wide, down to `foot`.
fn lobe(top: f32, foot: f32, width: f32) -> Vec<Vec2> {
    let r = (top - foot) / 2.0;
    joined(&[
        line(&[[0.0, top], [width - r, top]]),
        arc([width - r, top - r], [r; 2], 90.0, -90.0),
        line(&[[0.0, foot]]),
    ])
}

/// A letter, digit or sign. None for what there is no shape of.
pub(super) fn glyph(c: char) -> Option<Glyph> {
    let (width, strokes) = capital(c).or_else(|| small(c)).or_else(|| digit(c)).or_else(|| sign(c))?;
    Some(Glyph { width, strokes })
}

/// What stands for a letter that there is no shape of: a box.
pub(super) fn unknown() -> Glyph {
    Glyph { width: 0.9, strokes: vec![line(&[[0.0, 0.0], [0.9, 0.0], [0.9, 1.5], [0.0, 1.5], [0.0, 0.0]])] }
}

type Shape = Option<(f32, Vec<Vec<Vec2>>)>;

fn capital(c: char) -> Shape {
    let stem = || line(&[[0.0, 1.5], [0.0, 0.0]]);
    let round = |from, to| arc([0.73, 0.75], [0.73, 0.75], from, to);
    Some(match c {
        'A' => (1.2, vec![line(&[[0.0, 0.0], [0.6, 1.5], [1.2, 0.0]]), line(&[[0.2, 0.5], [1.0, 0.5]])]),
        'B' => (0.95, vec![stem(), lobe(1.5, 0.8, 0.86), lobe(0.8, 0.0, 0.95)]),
        'C' => (1.25, vec![round(45.0, 315.0)]),
        'D' => (
            1.15,
            vec![
                stem(),
                joined(&[
                    line(&[[0.0, 1.5], [0.45, 1.5]]),
                    arc([0.45, 0.75], [0.7, 0.75], 90.0, -90.0),
                    line(&[[0.0, 0.0]]),
                ]),
            ],
        ),
        'E' => {
            (0.85, vec![line(&[[0.85, 1.5], [0.0, 1.5], [0.0, 0.0], [0.85, 0.0]]), line(&[[0.0, 0.78], [0.75, 0.78]])])
        }
        'F' => (0.8, vec![line(&[[0.8, 1.5], [0.0, 1.5], [0.0, 0.0]]), line(&[[0.0, 0.75], [0.7, 0.75]])]),
        'G' => (1.4, vec![joined(&[round(45.0, 350.0), line(&[[1.42, 0.7], [0.85, 0.7]])])]),
        'H' => (1.1, vec![stem(), line(&[[1.1, 1.5], [1.1, 0.0]]), line(&[[0.0, 0.78], [1.1, 0.78]])]),
        'I' => (0.0, vec![stem()]),
        'J' => (0.65, vec![joined(&[line(&[[0.65, 1.5], [0.65, 0.4]]), arc([0.3, 0.4], [0.35, 0.4], 0.0, -150.0)])]),
        'K' => (1.0, vec![stem(), line(&[[0.95, 1.5], [0.0, 0.55]]), line(&[[0.32, 0.87], [1.0, 0.0]])]),
        'L' => (0.8, vec![line(&[[0.0, 1.5], [0.0, 0.0], [0.8, 0.0]])]),
        'M' => (1.4, vec![line(&[[0.0, 0.0], [0.0, 1.5], [0.7, 0.4], [1.4, 1.5], [1.4, 0.0]])]),
        'N' => (1.1, vec![line(&[[0.0, 0.0], [0.0, 1.5], [1.1, 0.0], [1.1, 1.5]])]),
        'O' => (1.46, vec![round(0.0, 360.0)]),
        'P' => (0.92, vec![stem(), lobe(1.5, 0.68, 0.92)]),
        'Q' => (1.46, vec![round(0.0, 360.0), line(&[[0.9, 0.42], [1.42, -0.1]])]),
        'R' => (1.0, vec![stem(), lobe(1.5, 0.68, 0.92), line(&[[0.48, 0.68], [1.0, 0.0]])]),
        'S' => (
            0.92,
            vec![joined(&[arc([0.46, 1.12], [0.4, 0.38], 35.0, 270.0), arc([0.46, 0.37], [0.45, 0.37], 90.0, -145.0)])],
        ),
        'T' => (1.1, vec![line(&[[0.0, 1.5], [1.1, 1.5]]), line(&[[0.55, 1.5], [0.55, 0.0]])]),
        'U' => (
            1.06,
            vec![joined(&[line(&[[0.0, 1.5]]), arc([0.53, 0.53], [0.53; 2], 180.0, 360.0), line(&[[1.06, 1.5]])])],
        ),
        'V' => (1.2, vec![line(&[[0.0, 1.5], [0.6, 0.0], [1.2, 1.5]])]),
        'W' => (1.7, vec![line(&[[0.0, 1.5], [0.42, 0.0], [0.85, 1.5], [1.28, 0.0], [1.7, 1.5]])]),
        'X' => (1.1, vec![line(&[[0.0, 1.5], [1.1, 0.0]]), line(&[[0.0, 0.0], [1.1, 1.5]])]),
        'Y' => (1.1, vec![line(&[[0.0, 1.5], [0.55, 0.7], [1.1, 1.5]]), line(&[[0.55, 0.7], [0.55, 0.0]])]),
        'Z' => (1.0, vec![line(&[[0.0, 1.5], [1.0, 1.5], [0.0, 0.0], [1.0, 0.0]])]),
        _ => return None,
    })
}

fn small(c: char) -> Shape {
    let ascender = || line(&[[0.0, 1.5], [0.0, 0.0]]);
    let stem = || line(&[[0.0, 1.0], [0.0, 0.0]]);
    Some(match c {
        'a' => (1.0, vec![bowl(), line(&[[1.0, 1.0], [1.0, 0.0]])]),
        'b' => (1.0, vec![bowl(), ascender()]),
        'c' => (0.86, vec![arc([0.5, 0.5], [0.5; 2], 45.0, 315.0)]),
        'd' => (1.0, vec![bowl(), line(&[[1.0, 1.5], [1.0, 0.0]])]),
        'e' => (1.0, vec![joined(&[line(&[[0.0, 0.5], [1.0, 0.5]]), arc([0.5, 0.5], [0.5; 2], 0.0, 315.0)])]),
        'f' => (
            0.56,
            vec![
                joined(&[arc([0.52, 1.16], [0.3, 0.34], 80.0, 180.0), line(&[[0.22, 0.0]])]),
                line(&[[0.0, 1.0], [0.52, 1.0]]),
            ],
        ),
        'g' => {
            (1.0, vec![bowl(), joined(&[line(&[[1.0, 1.0], [1.0, -0.1]]), arc([0.5, -0.1], [0.5, 0.4], 0.0, -145.0)])])
        }
        'h' => (0.8, vec![ascender(), arch(0.0, 0.8)]),
        'i' => (0.0, vec![stem(), dot(0.0, 1.42)]),
        'j' => (
            0.1,
            vec![
                joined(&[line(&[[0.1, 1.0], [0.1, -0.2]]), arc([-0.18, -0.2], [0.28, 0.3], 0.0, -90.0)]),
                dot(0.1, 1.42),
            ],
        ),
        'k' => (0.8, vec![ascender(), line(&[[0.74, 1.0], [0.0, 0.36]]), line(&[[0.26, 0.58], [0.8, 0.0]])]),
        'l' => (0.0, vec![ascender()]),
        'm' => (1.36, vec![stem(), arch(0.0, 0.68), arch(0.68, 0.68)]),
        'n' => (0.8, vec![stem(), arch(0.0, 0.8)]),
        'o' => (1.0, vec![bowl()]),
        'p' => (1.0, vec![bowl(), line(&[[0.0, 1.0], [0.0, -0.5]])]),
        'q' => (1.0, vec![bowl(), line(&[[1.0, 1.0], [1.0, -0.5]])]),
        'r' => (0.56, vec![stem(), arc([0.4, 0.6], [0.4; 2], 180.0, 66.0)]),
        's' => (
            0.62,
            vec![joined(&[
                arc([0.31, 0.75], [0.28, 0.25], 35.0, 270.0),
                arc([0.31, 0.25], [0.31, 0.25], 90.0, -145.0),
            ])],
        ),
        't' => (0.52, vec![line(&[[0.23, 1.4], [0.23, 0.0]]), line(&[[0.0, 1.0], [0.52, 1.0]])]),
        'u' => (
            0.8,
            vec![
                joined(&[line(&[[0.0, 1.0]]), arc([0.4, 0.4], [0.4; 2], 180.0, 360.0)]),
                line(&[[0.8, 1.0], [0.8, 0.0]]),
            ],
        ),
        'v' => (0.8, vec![line(&[[0.0, 1.0], [0.4, 0.0], [0.8, 1.0]])]),
        'w' => (1.24, vec![line(&[[0.0, 1.0], [0.31, 0.0], [0.62, 1.0], [0.93, 0.0], [1.24, 1.0]])]),
        'x' => (0.8, vec![line(&[[0.0, 0.0], [0.8, 1.0]]), line(&[[0.0, 1.0], [0.8, 0.0]])]),
        'y' => (0.84, vec![line(&[[0.0, 1.0], [0.42, 0.0]]), line(&[[0.84, 1.0], [0.2, -0.5]])]),
        'z' => (0.72, vec![line(&[[0.0, 1.0], [0.72, 1.0], [0.0, 0.0], [0.72, 0.0]])]),
        _ => return None,
    })
}

fn digit(c: char) -> Shape {
    let six = || vec![arc([0.45, 0.46], [0.45, 0.46], 0.0, 360.0), arc([0.72, 0.46], [0.72, 1.04], 180.0, 96.0)];
    Some(match c {
        '0' => (0.9, vec![arc([0.45, 0.75], [0.45, 0.75], 0.0, 360.0)]),
        '1' => (0.5, vec![line(&[[0.06, 1.2], [0.42, 1.5], [0.42, 0.0]])]),
        '2' => (0.9, vec![joined(&[arc([0.45, 1.06], [0.42, 0.44], 165.0, -38.0), line(&[[0.0, 0.0], [0.9, 0.0]])])]),
        '3' => (
            0.88,
            vec![joined(&[
                arc([0.42, 1.14], [0.38, 0.36], 150.0, -90.0),
                arc([0.42, 0.39], [0.46, 0.39], 90.0, -150.0),
            ])],
        ),
        '4' => (0.95, vec![line(&[[0.7, 0.0], [0.7, 1.5], [0.0, 0.42], [0.95, 0.42]])]),
        '5' => (
            0.88,
            vec![joined(&[
                line(&[[0.8, 1.5], [0.17, 1.5], [0.09, 0.82]]),
                arc([0.42, 0.48], [0.46, 0.48], 135.0, -145.0),
            ])],
        ),
        '6' => (0.9, six()),
        '7' => (0.88, vec![line(&[[0.0, 1.5], [0.88, 1.5], [0.28, 0.0]])]),
        '8' => (0.9, vec![arc([0.45, 1.13], [0.36, 0.37], 0.0, 360.0), arc([0.45, 0.38], [0.45, 0.38], 0.0, 360.0)]),
        '9' => {
            let turned = |s: Vec<Vec2>| s.into_iter().map(|p| Vec2::new(0.9, 1.5) - p).collect();
            (0.9, six().into_iter().map(turned).collect())
        }
        _ => return None,
    })
}

fn sign(c: char) -> Shape {
    let level = |y| line(&[[0.0, y], [0.8, y]]);
    Some(match c {
        ' ' | '\u{a0}' => (0.3, vec![]),
        '+' => (0.8, vec![level(0.7), line(&[[0.4, 0.3], [0.4, 1.1]])]),
        '-' => (0.5, vec![line(&[[0.0, 0.5], [0.5, 0.5]])]),
        // A minus is as wide as a plus.
        '\u{2212}' => (0.8, vec![level(0.7)]),
        '.' => (0.0, vec![dot(0.0, 0.0)]),
        ',' => (0.1, vec![line(&[[0.1, 0.03], [0.0, -0.28]])]),
        ':' => (0.0, vec![dot(0.0, 0.0), dot(0.0, 0.9)]),
        ';' => (0.1, vec![line(&[[0.1, 0.03], [0.0, -0.28]]), dot(0.1, 0.9)]),
        '/' => (0.65, vec![line(&[[0.0, -0.2], [0.65, 1.6]])]),
        '%' => (
            1.4,
            vec![
                arc([0.3, 1.17], [0.3, 0.33], 0.0, 360.0),
                arc([1.1, 0.33], [0.3, 0.33], 0.0, 360.0),
                line(&[[1.1, 1.5], [0.3, 0.0]]),
            ],
        ),
        '(' => (0.34, vec![arc([0.8, 0.65], [0.8, 1.2], 125.0, 235.0)]),
        ')' => (0.34, vec![arc([-0.46, 0.65], [0.8, 1.2], 55.0, -55.0)]),
        '[' => (0.3, vec![line(&[[0.3, 1.65], [0.0, 1.65], [0.0, -0.35], [0.3, -0.35]])]),
        ']' => (0.3, vec![line(&[[0.0, 1.65], [0.3, 1.65], [0.3, -0.35], [0.0, -0.35]])]),
        '=' => (0.8, vec![level(0.5), level(0.9)]),
        '<' => (0.8, vec![line(&[[0.8, 1.1], [0.0, 0.7], [0.8, 0.3]])]),
        '>' => (0.8, vec![line(&[[0.0, 1.1], [0.8, 0.7], [0.0, 0.3]])]),
        '|' => (0.0, vec![line(&[[0.0, 1.65], [0.0, -0.35]])]),
        '_' => (0.9, vec![line(&[[0.0, -0.25], [0.9, -0.25]])]),
        '*' => (
            0.6,
            vec![
                line(&[[0.3, 1.5], [0.3, 0.9]]),
                line(&[[0.04, 1.35], [0.56, 1.05]]),
                line(&[[0.04, 1.05], [0.56, 1.35]]),
            ],
        ),
        '\'' => (0.0, vec![line(&[[0.0, 1.5], [0.0, 1.1]])]),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_all_ascii_letters_digits_and_the_signs_of_scales() {
        let signs = " +-.,/%()=<>|_:\u{2212}[]*';";
        for c in ('a'..='z').chain('A'..='Z').chain('0'..='9').chain(signs.chars()) {
            assert!(glyph(c).is_some(), "{c}");
        }
        assert!(glyph('\u{1f642}').is_none());
    }

    /// No letter leaves its place but for the hooks of f and j.
    #[test]
    fn letters_keep_to_their_width_and_height() {
        for c in (' '..='~').filter(|c| !"fj".contains(*c)) {
            let Some(Glyph { width, strokes }) = glyph(c) else { continue };
            for p in strokes.concat() {
                assert!((-0.05..=width + 0.05).contains(&p.x) && (-0.51..=1.66).contains(&p.y), "{c}: {p}");
            }
        }
    }

    /// Letters that one could take for another have other shapes.
    #[test]
    fn no_two_letters_are_alike() {
        let all: Vec<(char, Vec<Vec<Vec2>>)> = (' '..='~').filter_map(|c| Some((c, glyph(c)?.strokes))).collect();
        for (i, (a, one)) in all.iter().enumerate() {
            for (b, other) in &all[i + 1..] {
                let alike = one == other;
                // A capital I is a small l, as in most faces without serifs.
                assert!(!alike || (*a == 'I' && *b == 'l'), "{a} {b}");
            }
        }
    }
}
