//! Comparisons in words.

use super::{
    Comparison, Method, Moved,
    compare::{MUST_SEE, RegionShift},
};
use crate::{
    counted::counted,
    stats::{Difference, Scale},
};

impl Comparison {
    /// One line for people.
    pub fn line(&self) -> String {
        let seeds = match (self.method, self.same_seeds) {
            (Method::Limits, _) => "no noise",
            (_, true) => "same seeds",
            (Method::Replicates, _) => "fresh seeds, by replicates",
            _ => "fresh seeds",
        };
        if !self.passes() {
            let what: Vec<String> = self.moved.iter().map(|m| self.words(m)).collect();
            return format!("DIFFERENT  {seeds}; {}", what.join("; "));
        }
        let sees = format!("would see a bias of {:.4} in a tile", self.detectable);
        match self.method {
            Method::Identical => "identical  to the last bit".to_owned(),
            Method::Limits => {
                let numbers: Vec<String> =
                    self.measured.iter().map(|m| format!("{} {:.5}", m.metric, m.value)).collect();
                format!("alike      {seeds}; {}", numbers.join(", "))
            }
            Method::SameSeeds => format!("equal      {seeds}; mean bias {:+.5}", self.bias),
            _ if self.is_blind() => format!("BLIND      {seeds}; {sees}, {MUST_SEE} is wanted"),
            _ => format!("equal      {seeds}; mean bias {:+.5}; {sees}", self.bias),
        }
    }

    fn words(&self, moved: &Moved) -> String {
        match moved {
            Moved::NotANumber { pixels, first: [x, y] } => {
                format!(
                    "NaN: {}, the first at {x},{y}",
                    counted(*pixels, "pixel is no number", "pixels are no numbers")
                )
            }
            Moved::Structure { pixels, first: [x, y] } => {
                let hold = counted(*pixels, "pixel holds", "pixels hold");
                format!("structure: {hold} a number where the golden has none, the first at {x},{y}")
            }
            Moved::Rays { scale, share, limit, worst: [left, top, ..], pixels, place: [x, y, w, h] } => {
                let of = match scale {
                    Scale::Image => "of all".to_owned(),
                    Scale::Tile => format!("of the tile at {left},{top}"),
                    Scale::Pixel => format!("of the pixel {left},{top}"),
                };
                format!(
                    "rays: {:.3} % {of} or more are decided differently, rounding may move {:.3} %; \
                     {}, in {x},{y} ({w}x{h}); mean bias {:+.5}",
                    share * 100.0,
                    limit * 100.0,
                    counted(*pixels, "pixel differs", "pixels differ"),
                    self.bias
                )
            }
            Moved::Shift { places, rejected, regions } => {
                let brighter = places.first().map_or(self.bias, |d| d.bias) > 0.0;
                let kind = if brighter { "brighter" } else { "darker" };
                let region = regions.first().map_or_else(String::new, of_region);
                format!(
                    "shift: {kind}, {rejected} of {} reject{}{region}; mean bias {:+.5}",
                    counted(self.tests, "test", "tests"),
                    place(places),
                    self.bias
                )
            }
            Moved::Pattern { places, rejected, p } => {
                let p = p.map_or_else(String::new, |p| format!("; chance that noise explains all pixels: {p:.1e}"));
                format!(
                    "structure: pixels moved, no tile did; {rejected} of {} reject{}{p}",
                    counted(self.tests, "test", "tests"),
                    place(places)
                )
            }
            Moved::Noise(noise) => {
                let kind = if noise.ratio > 1.0 { "noisier" } else { "less noisy" };
                format!("noise: {kind}, {:.3} times the golden's variance, p = {:.1e}", noise.ratio, noise.p)
            }
            Moved::Beyond(measured) => measured.to_string(),
        }
    }
}

fn place(places: &[Difference]) -> String {
    places.first().map_or_else(String::new, |d| {
        let [x, y, w, h] = d.place;
        format!(", surest at {x},{y} ({w}x{h}): {:+.4}, p = {:.1e}", d.bias, d.p)
    })
}

fn of_region(shift: &RegionShift) -> String {
    let p = shift.p.map_or_else(String::new, |p| format!(", p = {p:.1e}"));
    let pixels = counted(shift.pixels, "pixel", "pixels");
    format!(", most in region {} ({pixels}): {:+.4}{p}", shift.region.label(), shift.bias)
}
