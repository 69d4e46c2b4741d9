//! Against reference values, known answers and limits.

use super::{Estimator, Measure, Model, ReceiverPlane, Slab, Space, contrast};
use proptest::prelude::*;
use serde_json::Value;

fn reference(text: &str) -> (Value, Vec<Value>) {
    let all: Value = serde_json::from_str(text).unwrap();
    let rows = all["rows"].as_array().unwrap().clone();
    assert_eq!((all["R"].as_f64(), all["h"].as_f64()), (Some(25.0), Some(100.0)));
    (all, rows)
}

const READINGS: [(&str, ReceiverPlane); 2] = [("g0", ReceiverPlane::Clipped), ("g1", ReceiverPlane::Counts)];
const RATIOS: [(&str, f64); 2] = [("R8", 0.125), ("R4", 0.25)];

fn model(space: Space, measure: Measure, estimator: Estimator) -> Model {
    Model { radius: 25.0, space, measure, estimator }
}

fn extended(ratio: f64, receiver_plane: ReceiverPlane) -> Estimator {
    Estimator::Extended { secondary_radius: 25.0 * ratio, receiver_plane }
}

#[test]
fn extended_and_exponential_match_the_reference() {
    let (all, rows) = reference(include_str!("../../tests/reference/openness.json"));
    let sigma = all["sigma"].as_f64().unwrap();
    let (flat, extruded) = (Space::Flat, Space::Extruded);
    let mut columns: Vec<(String, Model)> = vec![];
    for (r, ratio) in RATIOS {
        for (g, plane) in READINGS {
            for (name, space, measure) in [
                ("flat2_u", flat, Measure::Uniform),
                ("flat2_c", flat, Measure::Cosine),
                ("ext2_c", extruded, Measure::Cosine),
            ] {
                columns.push((format!("{name}_{r}_{g}"), model(space, measure, extended(ratio, plane))));
            }
        }
    }
    for (name, space, measure, limited) in [
        ("flat_exp_u", flat, Measure::Uniform, false),
        ("flat_exp_u_cutR", flat, Measure::Uniform, true),
        ("flat_exp_c", flat, Measure::Cosine, false),
        ("ext_exp_c", extruded, Measure::Cosine, false),
        ("ext_exp_c_cutR", extruded, Measure::Cosine, true),
    ] {
        columns.push((name.to_owned(), model(space, measure, Estimator::Obscurance { sigma, limited })));
    }
    let mut worst = 0.0f64;
    for row in &rows {
        let get = |name: &str| row[name].as_f64().unwrap();
        let slab = Slab { width: get("w"), gap: get("m"), height: 100.0 };
        for (name, model) in &columns {
            let (value, expected) = (model.openness(&slab, get("t"), 1e-7), get(name));
            worst = worst.max((value - expected).abs());
            assert!((value - expected).abs() < 1e-6, "{name} of {row}: {value}, expected {expected}");
        }
    }
    println!("worst {worst:e}");
}
