//! Statistics against SciPy and statsmodels: the values of `.ci/against-python.py`,
//! which `tests/reference/python.json` holds. Agreement is 1e-6, relative, so that
//! p-values of 1e-60 are held to six digits too; the bootstrap agrees within its
//! Monte-Carlo error.

#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

use aogauge::stats::{
    Better, Estimate, Group, Moments, Spread, bca, benjamini_hochberg, chi_square, clopper_pearson, holm,
    mean_variance, non_inferior, quantile, regress, sidak, student, student_pooled, tost, uniformity, upper_tail,
    welch, wilson,
};
use serde_json::Value;

const TOLERANCE: f64 = 1e-6;

fn fixture() -> Value {
    let mut all: Value = serde_json::from_str(include_str!("reference/python.json")).unwrap();
    all["statistics"].take()
}

fn rows<'a>(all: &'a Value, of: &str) -> &'a [Value] {
    let rows = all[of].as_array().unwrap();
    assert!(!rows.is_empty());
    rows
}

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// The sample that a row names.
fn sample(all: &Value, name: &Value) -> Vec<f64> {
    numbers(&all["samples"][name.as_str().unwrap()])
}

/// Asserts six digits.
fn close(ours: f64, theirs: &Value, what: impl std::fmt::Display) {
    within(ours, theirs, TOLERANCE * theirs.as_f64().unwrap().abs(), what);
}

fn within(ours: f64, theirs: &Value, tolerance: f64, what: impl std::fmt::Display) {
    let theirs = theirs.as_f64().unwrap();
    // A whole ulp, so that a tolerance of nothing is not asked of rounding.
    let tolerance = tolerance.max(2.0 * f64::EPSILON * theirs.abs());
    if std::env::var("ALL").is_ok() {
        if !((ours - theirs).abs() <= tolerance) {
            eprintln!("MISS {what}: {ours:e}, theirs {theirs:e} rel {:.1e}", (ours / theirs - 1.0).abs());
        }
        return;
    }
    assert!((ours - theirs).abs() <= tolerance, "{what}: {ours:e}, theirs {theirs:e}");
}

/// Asserts that the ends of an interval agree, to six digits of its width.
fn same_interval([low, high]: [f64; 2], theirs: &Value, what: impl std::fmt::Display) {
    let ends = numbers(theirs);
    let tolerance = TOLERANCE * (ends[1] - ends[0]);
    within(low, &theirs[0], tolerance, format_args!("low end of {what}"));
    within(high, &theirs[1], tolerance, format_args!("high end of {what}"));
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
    for row in rows(&all, "moments") {
        let (values, name) = (sample(&all, &row["sample"]), &row["sample"]);
        let (mean, variance) = mean_variance(&values);
        close(mean, &row["mean"], name);
        close(variance, &row["variance"], name);
        // One by one, and merged in unequal parts.
        let (left, right) = values.split_at(values.len() / 3);
        let mut merged: Moments = left.iter().copied().collect();
        merged.merge(&right.iter().copied().collect());
        let streamed: Moments = values.iter().copied().collect();
        for m in [streamed, merged] {
            assert_eq!(m.count(), row["n"].as_u64().unwrap());
            close(m.mean(), &row["mean"], name);
            close(m.variance(), &row["variance"], name);
            close(m.estimate().se, &row["se"], name);
            assert_eq!([m.least(), m.greatest()], ["least", "greatest"].map(|k| row[k].as_f64()));
        }
    }
}

#[test]
fn t_tests() {
    let all = fixture();
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
        close(t, &row["t"], &what);
        close(difference.df, &row["df"], &what);
        close(p_two, &row["p_two"], &what);
        close(p_greater, &row["p_greater"], &what);
        close(p_less, &row["p_less"], &what);
        let [low, high] = difference.interval(0.95);
        same_interval([low + against, high + against], &row["ci95"], &what);
    }
}

#[test]
fn equivalence_and_non_inferiority() {
    let all = fixture();
    for row in rows(&all, "equivalence") {
        let what = format!("{} {} {}", row["kind"], row["a"], row["b"]);
        let (a, margin) = (sample(&all, &row["a"]), row["margin"].as_f64().unwrap());
        let (estimate, target) = match row["kind"].as_str().unwrap() {
            "one" => (Estimate::of_mean(&a), row["target"].as_f64().unwrap()),
            "welch" => (welch(&a, &sample(&all, &row["b"])).difference, 0.0),
            "pooled" => (student_pooled(&a, &sample(&all, &row["b"])).difference, 0.0),
            other => panic!("{other}"),
        };
        close(tost(&estimate, target, margin), &row["tost"], &what);
        close(non_inferior(&estimate, target, margin, Better::Higher), &row["non_inferior_higher_better"], &what);
        close(non_inferior(&estimate, target, margin, Better::Lower), &row["non_inferior_lower_better"], &what);
    }
}

#[test]
fn corrections_for_many_tests() {
    let all = fixture();
    for row in rows(&all, "corrections") {
        let p = numbers(&row["p"]);
        for (name, adjusted) in [("holm", holm(&p)), ("sidak", sidak(&p)), ("bh", benjamini_hochberg(&p))] {
            for (i, ours) in adjusted.into_iter().enumerate() {
                close(ours, &row[name][i], format_args!("{name} of {p:?}, {i}"));
            }
        }
    }
}

#[test]
fn intervals_of_shares() {
    let all = fixture();
    for row in rows(&all, "proportions") {
        let [k, n] = ["k", "n"].map(|name| row[name].as_u64().unwrap());
        let confidence = row["confidence"].as_f64().unwrap();
        for (name, ours) in [("wilson", wilson(k, n, confidence)), ("exact", clopper_pearson(k, n, confidence))] {
            same_interval(ours, &row[name], format_args!("{name} {k} of {n} at {confidence}"));
        }
    }
}

#[test]
fn regression() {
    let all = fixture();
    for row in rows(&all, "lines") {
        let name = &row["name"];
        let line = regress(&numbers(&row["x"]), &numbers(&row["y"]), None).unwrap();
        close(line.slope.value, &row["slope"], name);
        close(line.slope.se, &row["slope_se"], name);
        close(line.intercept.value, &row["intercept"], name);
        close(line.intercept.se, &row["intercept_se"], name);
        close(line.r, &row["r"], name);
        let t = (line.slope.value / line.slope.se).abs();
        close(2.0 * upper_tail(line.slope.df, t), &row["p"], name);
    }
}

#[test]
fn goodness_of_fit() {
    let all = fixture();
    for row in rows(&all, "chi_square") {
        let observed: Vec<u64> = row["observed"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect();
        let test = chi_square(&observed, &numbers(&row["shares"])).unwrap();
        let what = format!("{observed:?}");
        close(test.statistic, &row["statistic"], &what);
        close(test.df, &row["df"], &what);
        close(test.p, &row["p"], &what);
    }
    for row in rows(&all, "uniformity") {
        let test = uniformity(&numbers(&row["values"])).unwrap();
        close(test.statistic, &row["statistic"], &row["name"]);
        close(test.p, &row["p_exact"], &row["name"]);
    }
}

#[test]
fn quartiles() {
    let all = fixture();
    for row in rows(&all, "quantiles") {
        let spread = Spread::of(&sample(&all, &row["sample"])).unwrap();
        let levels = numbers(&row["levels"]);
        for (level, ours) in [(0.0, spread.least), (0.25, spread.lower), (0.5, spread.median), (0.75, spread.upper)] {
            let at = levels.iter().position(|l| *l == level).unwrap();
            // Samples far from zero must not hide an error: to the last digit.
            within(ours, &row["values"][at], 0.0, format_args!("{} at {level}", row["sample"]));
        }
    }
}

#[test]
fn students_distribution() {
    let all = fixture();
    for row in rows(&all, "student") {
        let df = row["df"].as_f64().unwrap();
        for (i, p) in numbers(&row["levels"]).into_iter().enumerate() {
            let theirs = &row["quantiles"][i];
            within(
                quantile(df, p),
                theirs,
                TOLERANCE * theirs.as_f64().unwrap().abs().max(1e-6),
                format_args!("t({p}, {df})"),
            );
        }
        for (i, t) in numbers(&row["t"]).into_iter().enumerate() {
            close(upper_tail(df, t), &row["upper_tails"][i], format_args!("tail of {t}, {df}"));
        }
    }
}

/// Ends lie within five standard errors of the Monte-Carlo draws of both sides: of
/// 10 ends, fixed by the seed, none would be off in 170,000 seeds.
#[test]
fn bca_bootstrap() {
    const RESAMPLES: u32 = 20_000;
    let all = fixture();
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
        close(ours.value, &row["value"], &what);
        close(ours.acceleration, &row["acceleration"], &what);
        for end in 0..2 {
            let noise = row["sd"][end].as_f64().unwrap() * (1.0 / f64::from(RESAMPLES) + 1.0 / 320_000.0).sqrt();
            within(ours.interval[end], &row["ci"][end], 5.0 * noise, format_args!("end {end} of {what}"));
        }
    }
}
