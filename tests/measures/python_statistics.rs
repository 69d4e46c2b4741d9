//! Statistics against SciPy and statsmodels: the values of `.ci/against-python.py`,
//! which `tests/reference/python.json` holds. Agreement is 1e-6, relative, so that
//! p-values of 1e-60 are held to six digits too; the bootstrap agrees within its
//! Monte-Carlo error.

use aogauge::stats::{
    Better, Estimate, Group, Moments, Spread, bca, benjamini_hochberg, chi_square, clopper_pearson, holm,
    mean_variance, non_inferior, quantile, regress, sidak, student, student_pooled, tost, uniformity, upper_tail,
    welch, wilson,
};
use serde_json::Value;
use std::{cell::Cell, fmt::Display};

const TOLERANCE: f64 = 1e-6;

fn fixture() -> Value {
    let mut all: Value = serde_json::from_str(include_str!("../reference/python.json")).unwrap();
    all["statistics"].take()
}

fn rows<'a>(all: &'a Value, of: &str) -> &'a [Value] {
    let rows = all[of].as_array().unwrap();
    assert!(!rows.is_empty());
    rows
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("{v} is no number"))
}

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array().unwrap().iter().map(number).collect()
}

/// The sample that a row names.
fn sample(all: &Value, name: &Value) -> Vec<f64> {
    numbers(&all["samples"][name.as_str().unwrap()])
}

/// Asserts agreement and keeps the largest difference that it saw.
#[derive(Default)]
struct Held(Cell<f64>);

impl Held {
    /// Six digits.
    fn close(&self, ours: f64, theirs: &Value, what: impl Display) {
        self.within(ours, theirs, TOLERANCE * number(theirs).abs(), what);
    }

    fn within(&self, ours: f64, theirs: &Value, tolerance: f64, what: impl Display) {
        let theirs = number(theirs);
        // A whole ulp, so that a tolerance of nothing is not asked of rounding.
        let tolerance = tolerance.max(2.0 * f64::EPSILON * theirs.abs());
        let off = (ours - theirs).abs();
        assert!(off <= tolerance, "{what}: {ours:e}, theirs {theirs:e}");
        self.0.set(self.0.get().max(if off > 0.0 { off / tolerance } else { 0.0 }));
    }

    /// The ends of an interval, to six digits of its width.
    fn same_interval(&self, [low, high]: [f64; 2], theirs: &Value, what: impl Display) {
        let ends = numbers(theirs);
        let tolerance = TOLERANCE * (ends[1] - ends[0]);
        self.within(low, &theirs[0], tolerance, format_args!("low end of {what}"));
        self.within(high, &theirs[1], tolerance, format_args!("high end of {what}"));
    }

    /// For the report of the peers.
    fn tell(&self, what: &str) {
        println!("held: {what}, largest difference {:.1e} of the tolerance", self.0.get());
    }
}

fn negative(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| -v).collect()
}

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

#[test]
fn moments() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "moments") {
        let (values, name) = (sample(&all, &row["sample"]), &row["sample"]);
        let (mean, variance) = mean_variance(&values);
        held.close(mean, &row["mean"], name);
        held.close(variance, &row["variance"], name);
        // One by one, and merged in unequal parts.
        let (left, right) = values.split_at(values.len() / 3);
        let mut merged: Moments = left.iter().copied().collect();
        merged.merge(&right.iter().copied().collect());
        let streamed: Moments = values.iter().copied().collect();
        for m in [streamed, merged] {
            assert_eq!(m.count(), row["n"].as_u64().unwrap());
            held.close(m.mean(), &row["mean"], name);
            held.close(m.variance(), &row["variance"], name);
            held.close(m.estimate().se, &row["se"], name);
            assert_eq!([m.least(), m.greatest()], ["least", "greatest"].map(|k| row[k].as_f64()));
        }
    }
    held.tell("moments");
}

#[test]
fn t_tests() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "t_tests") {
        let what = format!("{} {} {}", row["kind"], row["a"], row["b"]);
        let a = sample(&all, &row["a"]);
        let b = || sample(&all, &row["b"]);
        let against = row["against"].as_f64().unwrap_or(0.0);
        // Estimate of what is tested, t, p two-sided, p of greater, and p of less by
        // turning the question round.
        let of_student =
            |test: aogauge::stats::Student, less: f64| (test.difference, test.t, test.p_two, test.p_greater, less);
        let (difference, t, p_two, p_greater, p_less) = match row["kind"].as_str().unwrap() {
            "one" => of_student(student(&a, against), student(&negative(&a), -against).p_greater),
            "paired" => of_student(student(&less(&a, &b()), 0.0), student(&less(&b(), &a), 0.0).p_greater),
            "pooled" => of_student(student_pooled(&a, &b()), student_pooled(&b(), &a).p_greater),
            "welch" => {
                let test = welch(&a, &b());
                (test.difference, test.t, test.p_two, test.p_greater, welch(&b(), &a).p_greater)
            }
            other => panic!("{other}"),
        };
        held.close(t, &row["t"], &what);
        held.close(difference.df, &row["df"], &what);
        held.close(p_two, &row["p_two"], &what);
        held.close(p_greater, &row["p_greater"], &what);
        held.close(p_less, &row["p_less"], &what);
        let [low, high] = difference.interval(0.95);
        held.same_interval([low + against, high + against], &row["ci95"], &what);
    }
    held.tell("t tests");
}

#[test]
fn equivalence_and_non_inferiority() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "equivalence") {
        let what = format!("{} {} {}", row["kind"], row["a"], row["b"]);
        let (a, margin) = (sample(&all, &row["a"]), row["margin"].as_f64().unwrap());
        let (estimate, target) = match row["kind"].as_str().unwrap() {
            "one" => (Estimate::of_mean(&a), row["target"].as_f64().unwrap()),
            "welch" => (welch(&a, &sample(&all, &row["b"])).difference, 0.0),
            "pooled" => (student_pooled(&a, &sample(&all, &row["b"])).difference, 0.0),
            other => panic!("{other}"),
        };
        held.close(tost(&estimate, target, margin), &row["tost"], &what);
        held.close(non_inferior(&estimate, target, margin, Better::Higher), &row["non_inferior_higher_better"], &what);
        held.close(non_inferior(&estimate, target, margin, Better::Lower), &row["non_inferior_lower_better"], &what);
    }
    held.tell("equivalence, non-inferiority");
}

#[test]
fn corrections_for_many_tests() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "corrections") {
        let p = numbers(&row["p"]);
        for (name, adjusted) in [("holm", holm(&p)), ("sidak", sidak(&p)), ("bh", benjamini_hochberg(&p))] {
            for (i, ours) in adjusted.into_iter().enumerate() {
                held.close(ours, &row[name][i], format_args!("{name} of {p:?}, {i}"));
            }
        }
    }
    held.tell("Holm, Sidak, Benjamini-Hochberg");
}

#[test]
fn intervals_of_shares() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "proportions") {
        let [k, n] = ["k", "n"].map(|name| row[name].as_u64().unwrap());
        let confidence = row["confidence"].as_f64().unwrap();
        for (name, ours) in [("wilson", wilson(k, n, confidence)), ("exact", clopper_pearson(k, n, confidence))] {
            held.same_interval(ours, &row[name], format_args!("{name} {k} of {n} at {confidence}"));
        }
    }
    held.tell("Wilson, Clopper-Pearson");
}

#[test]
fn regression() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "lines") {
        let name = &row["name"];
        let line = regress(&numbers(&row["x"]), &numbers(&row["y"]), None).unwrap();
        held.close(line.slope.value, &row["slope"], name);
        held.close(line.slope.se, &row["slope_se"], name);
        held.close(line.intercept.value, &row["intercept"], name);
        held.close(line.intercept.se, &row["intercept_se"], name);
        held.close(line.r, &row["r"], name);
        let t = (line.slope.value / line.slope.se).abs();
        held.close(2.0 * upper_tail(line.slope.df, t), &row["p"], name);
    }
    held.tell("regression");
}

#[test]
fn goodness_of_fit() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "chi_square") {
        let observed: Vec<u64> = row["observed"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect();
        let test = chi_square(&observed, &numbers(&row["shares"])).unwrap();
        let what = format!("{observed:?}");
        held.close(test.statistic, &row["statistic"], &what);
        held.close(test.df, &row["df"], &what);
        held.close(test.p, &row["p"], &what);
    }
    for row in rows(&all, "uniformity") {
        let test = uniformity(&numbers(&row["values"])).unwrap();
        held.close(test.statistic, &row["statistic"], &row["name"]);
        held.close(test.p, &row["p_exact"], &row["name"]);
    }
    held.tell("chi-square, Kolmogorov-Smirnov");
}

#[test]
fn quartiles() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "quantiles") {
        let spread = Spread::of(&sample(&all, &row["sample"])).unwrap();
        let levels = numbers(&row["levels"]);
        for (level, ours) in [(0.0, spread.least), (0.25, spread.lower), (0.5, spread.median), (0.75, spread.upper)] {
            let at = levels.iter().position(|l| *l == level).unwrap();
            // Samples far from zero must not hide an error: to the last digit.
            held.within(ours, &row["values"][at], 0.0, format_args!("{} at {level}", row["sample"]));
        }
    }
    held.tell("quartiles");
}

#[test]
fn students_distribution() {
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "student") {
        let df = row["df"].as_f64().unwrap();
        for (i, p) in numbers(&row["levels"]).into_iter().enumerate() {
            let theirs = &row["quantiles"][i];
            held.within(
                quantile(df, p),
                theirs,
                TOLERANCE * theirs.as_f64().unwrap().abs().max(1e-6),
                format_args!("t({p}, {df})"),
            );
        }
        for (i, t) in numbers(&row["t"]).into_iter().enumerate() {
            held.close(upper_tail(df, t), &row["upper_tails"][i], format_args!("tail of {t}, {df}"));
        }
    }
    held.tell("Student's t, quantiles and tails");
}

/// Ends lie within five standard errors of the Monte-Carlo draws of both sides: of
/// 10 ends, fixed by the seed, none would be off in 170,000 seeds.
#[test]
fn bca_bootstrap() {
    const RESAMPLES: u32 = 20_000;
    let all = fixture();
    let held = Held::default();
    for row in rows(&all, "bootstrap") {
        let columns: Vec<Vec<f64>> = row["samples"].as_array().unwrap().iter().map(|n| sample(&all, n)).collect();
        let single = |column: &Vec<f64>| -> Group { column.iter().map(|v| vec![*v]).collect() };
        let (groups, ratio): (Vec<Group>, bool) = match row["kind"].as_str().unwrap() {
            "mean" => (columns.iter().map(single).collect(), false),
            "ratio" => (columns.iter().map(single).collect(), true),
            "ratio_paired" => (vec![columns[0].iter().zip(&columns[1]).map(|(a, b)| vec![*a, *b]).collect()], true),
            other => panic!("{other}"),
        };
        let f = |means: &[Vec<f64>]| {
            let all: Vec<f64> = means.iter().flatten().copied().collect();
            if ratio { all[0] / all[1] } else { all[0] }
        };
        let what = format!("{} of {}", row["kind"], row["samples"]);
        let ours = bca(&groups, f, row["confidence"].as_f64().unwrap(), RESAMPLES, 7);
        held.close(ours.value, &row["value"], &what);
        held.close(ours.acceleration, &row["acceleration"], &what);
        for end in 0..2 {
            let noise = row["sd"][end].as_f64().unwrap() * (1.0 / f64::from(RESAMPLES) + 1.0 / 320_000.0).sqrt();
            held.within(ours.interval[end], &row["ci"][end], 5.0 * noise, format_args!("end {end} of {what}"));
        }
    }
    held.tell("BCa bootstrap (five Monte-Carlo errors)");
}
