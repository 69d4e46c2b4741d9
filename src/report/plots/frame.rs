//! A frame with two axes, in which points have places.

use super::sheet::{Anchor, GRID, INK, Sheet, Stroke};

/// Numbers further from 0 are not drawn: no metric comes near, and differences of them
/// must not overflow. Nor are smaller ones on a logarithmic axis.
const LARGEST: f64 = 1e15;

/// Whether a number can be drawn on a linear axis.
pub(super) fn is_drawn(v: f64) -> bool {
    v.abs() <= LARGEST
}

/// Whether a number can be drawn on a logarithmic axis.
pub(super) fn is_drawn_log(v: f64) -> bool {
    (1.0 / LARGEST..=LARGEST).contains(&v)
}

/// An axis with its ticks.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    from: f64,
    to: f64,
    is_log: bool,
    ticks: Vec<(f64, String)>,
}

/// The smallest of 1, 2, 5 times a power of ten that is not below this.
fn step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].map(|m| m * power).into_iter().find(|s| *s >= least * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

fn decimal(v: f64, step: f64) -> String {
    if v != 0.0 && (v.abs() >= 1e6 || step < 1e-5) {
        return format!("{v:.1e}").replace('-', "\u{2212}");
    }
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let v = if v.abs() < step / 2.0 { 0.0 } else { v };
    format!("{v:.digits$}").replace('-', "\u{2212}")
}

/// A number as it stands at a tick of a logarithmic axis.
fn short(v: f64) -> String {
    if !(1e-4..1e6).contains(&v) {
        return format!("{v:.0e}").replace('-', "\u{2212}");
    }
    let digits = (-v.log10().floor()).max(0.0) as usize;
    format!("{v:.digits$}")
}

impl Axis {
    /// A linear axis over these numbers, and a little more where `margin` is above 0,
    /// with about so many ticks. Numbers that are not drawn are passed over.
    pub(super) fn linear(values: impl Iterator<Item = f64>, margin: f64, ticks: f64) -> Self {
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.filter(|v| is_drawn(*v)) {
            (from, to) = (from.min(v), to.max(v));
        }
        if from > to {
            (from, to) = (0.0, 1.0);
        }
        // Not so narrow that neighbouring ticks are one number.
        let least = 1e-9f64.max(from.abs().max(to.abs()) * 1e-6);
        if to - from < least {
            (from, to) = (from - least / 2.0, to + least / 2.0);
        }
        let more = (to - from) * margin;
        (from, to) = (from - more, to + more);
        let step = step((to - from) / ticks);
        let first = (from / step - 1e-9).ceil();
        let count = ((to / step + 1e-9).floor() - first).clamp(0.0, 40.0) as u32;
        let at = |i: u32| (first + f64::from(i)) * step;
        let ticks = (0..=count).map(|i| (at(i), decimal(at(i), step))).collect();
        Axis { from, to, is_log: false, ticks }
    }

    /// A logarithmic axis over these numbers, with ticks at these, or at 1, 2 and 5 times
    /// powers of ten, as far as they find room.
    pub(super) fn log(values: impl Iterator<Item = f64>, at: Option<&[u32]>) -> Self {
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.filter(|v| is_drawn_log(*v)) {
            (from, to) = (from.min(v), to.max(v));
        }
        if from > to {
            (from, to) = (0.1, 1.0);
        }
        let more = (to / from).powf(0.06).max(1.25);
        (from, to) = (from / more, to * more);
        let ticks = match at {
            Some(at) => {
                let mut kept: Vec<u32> = Vec::new();
                for &v in at {
                    // Numbers nearer to each other than this would overlap.
                    let room = (to / from).powf(0.05);
                    if kept.last().is_none_or(|last| f64::from(v) / f64::from(*last) >= room) {
                        kept.push(v);
                    }
                }
                kept.into_iter().map(|v| (f64::from(v), v.to_string())).collect()
            }
            None => decades(from, to),
        };
        Axis { from, to, is_log: true, ticks }
    }

    /// Where a number lies, 0 to 1 within the axis.
    fn share(&self, v: f64) -> f64 {
        if self.is_log {
            (v.max(f64::MIN_POSITIVE) / self.from).ln() / (self.to / self.from).ln()
        } else {
            (v - self.from) / (self.to - self.from)
        }
    }

    pub(super) fn ends(&self) -> [f64; 2] {
        [self.from, self.to]
    }
}

fn decades(from: f64, to: f64) -> Vec<(f64, String)> {
    let decades = (to / from).log10();
    let (factors, every): (&[f64], i32) = match decades {
        ..=2.5 => (&[1.0, 2.0, 5.0], 1),
        ..=8.0 => (&[1.0], 1),
        _ => (&[1.0], 4),
    };
    let first = from.log10().floor() as i32;
    let last = to.log10().ceil() as i32;
    let powers = (first..=last).filter(|p| p % every == 0);
    let all = powers.flat_map(|p| factors.iter().map(move |f| f * 10f64.powi(p)));
    all.filter(|v| (from..=to).contains(v)).map(|v| (v, short(v))).collect()
}

/// Where a frame is, and what its axes say.
pub(super) struct Frame {
    /// Left, top, width and height within the axes, pixels.
    pub(super) place: [f64; 4],
    pub(super) x: Axis,
    pub(super) y: Axis,
}

impl Frame {
    /// The place of a point; beyond the frame's ends it is moved to these.
    pub(super) fn at(&self, x: f64, y: f64) -> [f64; 2] {
        [self.across(x), self.down(y)]
    }

    pub(super) fn across(&self, x: f64) -> f64 {
        self.place[0] + self.place[2] * self.x.share(x).clamp(0.0, 1.0)
    }

    pub(super) fn down(&self, y: f64) -> f64 {
        self.place[1] + self.place[3] * (1.0 - self.y.share(y).clamp(0.0, 1.0))
    }

    /// Where the ticks of x are, and what stands at them.
    pub(super) fn x_ticks(&self) -> impl Iterator<Item = (f64, &str)> {
        self.x.ticks.iter().map(|(v, label)| (self.across(*v), label.as_str()))
    }

    /// The lines of the grid, and what stands at them.
    pub(super) fn grid(&self, sheet: &mut Sheet) {
        let [left, top, width, height] = self.place;
        for (x, label) in self.x_ticks() {
            sheet.line([x, top], [x, top + height], Stroke::new(GRID, 1.0));
            sheet.text([x, top + height + 18.0], label, 13.0, Anchor::Middle, INK);
        }
        for (v, label) in &self.y.ticks {
            let y = self.down(*v);
            sheet.line([left, y], [left + width, y], Stroke::new(GRID, 1.0));
            sheet.text([left - 8.0, y + 4.5], label, 13.0, Anchor::End, INK);
        }
    }

    /// The axes themselves and what they measure, over what is drawn.
    pub(super) fn axes(&self, sheet: &mut Sheet, x_label: &str, y_label: &str) {
        let [left, top, width, height] = self.place;
        let ink = Stroke::new(INK, 1.2);
        sheet.line([left, top + height], [left + width, top + height], ink);
        sheet.line([left, top], [left, top + height], ink);
        sheet.text([left + width / 2.0, top + height + 40.0], x_label, 14.0, Anchor::Middle, INK);
        sheet.turned([left - 52.0, top + height / 2.0], y_label, 14.0);
    }

    /// An interval that stands up, with feet; an end beyond the frame has none.
    pub(super) fn interval(&self, sheet: &mut Sheet, x: f64, [lo, hi]: [f64; 2], colour: &str) {
        let ends = [self.at(x, lo), self.at(x, hi)];
        sheet.line(ends[0], ends[1], Stroke::new(colour, 1.4));
        let [from, to] = self.y.ends();
        for ([x, y], v) in ends.into_iter().zip([lo, hi]) {
            if (from..=to).contains(&v) {
                sheet.line([x - 3.0, y], [x + 3.0, y], Stroke::new(colour, 1.4));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|t| t.1.as_str()).collect()
    }

    #[test]
    fn ticks_are_round() {
        let axis = Axis::linear([-0.3, 0.35].into_iter(), 0.0, 7.0);
        assert_eq!(labels(&axis), ["\u{2212}0.3", "\u{2212}0.2", "\u{2212}0.1", "0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(&Axis::log([0.002, 0.05].into_iter(), None)), ["0.002", "0.005", "0.01", "0.02", "0.05"]);
        assert_eq!(labels(&Axis::log([4.0, 32.0].into_iter(), Some(&[4, 32]))), ["4", "32"]);
    }

    /// Records are anybody's: no number may hang, overflow or fall out of the frame.
    #[test]
    fn any_numbers_make_axes() {
        for values in [
            vec![],
            vec![0.0],
            vec![1e300, -1e300],
            vec![f64::NAN, f64::INFINITY],
            vec![1e15, -1e15],
            vec![1e-320, 1e-300],
            vec![1e15, 1e15 - 1.0],
            vec![3.0; 4],
        ] {
            for axis in [Axis::linear(values.iter().copied(), 0.05, 6.0), Axis::log(values.iter().copied(), None)] {
                assert!(axis.from < axis.to && axis.ticks.len() <= 42, "{values:?} {axis:?}");
                for v in &values {
                    let frame = Frame { place: [0.0, 0.0, 10.0, 10.0], x: axis.clone(), y: axis.clone() };
                    let [x, y] = frame.at(*v, *v);
                    assert!(v.is_nan() || (0.0..=10.0).contains(&x) && (0.0..=10.0).contains(&y), "{values:?}");
                }
            }
        }
        let many: Vec<u32> = (1..5000).collect();
        assert!(Axis::log([1.0, 5000.0].into_iter(), Some(&many)).ticks.len() < 25);
    }
}
