//! Plots of a record, as SVG that needs nothing else: no script, no font, no network.
//!
//! Each returns the SVG, or in a sentence why there is nothing to draw, which is what a
//! report says in its place. Estimators look the same in all plots of a record; where a
//! pointer rests on a marker, a page that holds the SVG shows its numbers. The bytes
//! depend on the record alone.

mod contrast_error;
mod convergence;
mod cost;
mod frame;
mod legend;
mod p_values;
mod profile;
mod sheet;
mod style;

pub use contrast_error::contrast_error;
pub use convergence::convergence;
pub use cost::cost;
pub use p_values::p_values;
pub use profile::{Ranges, along, profile};

use crate::record::CaseRecord;
use legend::Sign;
use sheet::GUIDE;
use style::{Fill, Shape, Style};

/// Entries of a legend that tell the renderers apart, each once: sign, name, and text.
fn renderers<'a>(names: impl Iterator<Item = &'a str>) -> Vec<(Sign, &'a str, String)> {
    let mut found: Vec<&str> = Vec::new();
    for name in names {
        if !found.contains(&name) {
            found.push(name);
        }
    }
    let style = Style { colour: GUIDE, dash: "", shape: Shape::Circle };
    let text = |name: &str| match name {
        "cpu" => "CPU".to_owned(),
        "gpu" => "GPU".to_owned(),
        other => other.to_owned(),
    };
    found.into_iter().map(|name| (Sign::Marker(style, Fill::of_renderer(name)), name, text(name))).collect()
}

/// The case of an estimator that shows best what it is: on the CPU, where it ran there,
/// at the most rays.
fn best<'a>(cases: impl Iterator<Item = &'a CaseRecord>) -> Option<&'a CaseRecord> {
    cases.max_by_key(|c| (c.case.renderer == "cpu", c.case.rays))
}
