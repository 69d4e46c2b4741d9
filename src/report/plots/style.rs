//! How estimators and renderers are told apart: by colour, and beside it by shape and
//! dashes, for those who see no colours, and for print.

/// Colours of curves. The first six are Okabe and Ito's, which colour-blind people can
/// tell apart, without black, which is Q's, and yellow, which white paper drowns. The
/// rest are darker than these.
const COLOURS: [&str; 10] =
    ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#332288", "#882255", "#6b6b1a", "#777777"];

/// Dash patterns, in pixels: on, off.
const DASHES: [&str; 7] = ["", "9 4", "3 3", "10 3 2 3", "14 5", "6 2 2 2 2 2", "2 4"];

/// The shape of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Circle,
    Square,
    Diamond,
    TriangleUp,
    TriangleDown,
    Pentagon,
    TriangleLeft,
    TriangleRight,
}

const SHAPES: [Shape; 8] = [
    Shape::Circle,
    Shape::Square,
    Shape::TriangleUp,
    Shape::Diamond,
    Shape::TriangleDown,
    Shape::Pentagon,
    Shape::TriangleLeft,
    Shape::TriangleRight,
];

impl Shape {
    /// Its corners about 0, as far away as those of a circle of radius 1 that is as
    /// large; none of a circle.
    pub(super) fn corners(self) -> Vec<[f64; 2]> {
        let (n, first, size) = match self {
            Shape::Circle => return vec![],
            Shape::Square => (4, 0.125, 1.25),
            Shape::Diamond => (4, 0.25, 1.3),
            Shape::TriangleUp => (3, 0.25, 1.4),
            Shape::TriangleDown => (3, -0.25, 1.4),
            Shape::Pentagon => (5, 0.25, 1.15),
            Shape::TriangleLeft => (3, 0.5, 1.4),
            Shape::TriangleRight => (3, 0.0, 1.4),
        };
        let turn = |i: u32| std::f64::consts::TAU * (first + f64::from(i) / f64::from(n));
        (0..n).map(|i| [size * turn(i).cos(), -size * turn(i).sin()]).collect()
    }
}

/// How an estimator is drawn, the same in all plots of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Style {
    pub(super) colour: &'static str,
    /// Dashes of a curve, where they tell estimators apart.
    pub(super) dash: &'static str,
    pub(super) shape: Shape,
}

impl Style {
    /// That of the estimator at this place in its suite. No two of the first 40 share
    /// colour and shape, of the first 10 none share a colour.
    pub(super) fn nth(i: usize) -> Self {
        Style { colour: COLOURS[i % COLOURS.len()], dash: DASHES[i % DASHES.len()], shape: SHAPES[i % SHAPES.len()] }
    }

    /// That of an estimator of a suite; one that the suite does not name comes after
    /// those that it does.
    pub(super) fn of(estimators: &[String], name: &str) -> Self {
        Self::nth(estimators.iter().position(|e| e == name).unwrap_or(estimators.len()))
    }
}

/// How a marker is filled: by renderer, or by kind of scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fill {
    Full,
    Hollow,
    /// Hollow with a dot.
    Dotted,
}

impl Fill {
    /// The CPU's is full, the GPU's hollow, anybody else's hollow with a dot.
    pub(super) fn of_renderer(renderer: &str) -> Self {
        match renderer {
            "cpu" => Fill::Full,
            "gpu" => Fill::Hollow,
            _ => Fill::Dotted,
        }
    }

    /// Hollow markers are larger, so that one that hides behind a full one shows.
    pub(super) fn radius(self) -> f64 {
        match self {
            Fill::Full => 3.6,
            Fill::Hollow | Fill::Dotted => 5.2,
        }
    }

    /// Dashes of a line that joins such markers.
    pub(super) fn dash(self) -> &'static str {
        match self {
            Fill::Full => "",
            Fill::Hollow => "6 4",
            Fill::Dotted => "2 3",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimators_do_not_look_alike() {
        let styles: Vec<Style> = (0..40).map(Style::nth).collect();
        for (i, a) in styles.iter().enumerate() {
            for (j, b) in styles.iter().enumerate().skip(i + 1) {
                assert!((a.colour, a.shape) != (b.colour, b.shape), "{i} and {j}");
                assert!((a.colour, a.dash) != (b.colour, b.dash), "{i} and {j}");
                assert!(j >= 10 || a.colour != b.colour, "{i} and {j}");
            }
            assert!(a.colour != "#000000");
        }
    }
}
