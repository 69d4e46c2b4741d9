//! The test report that CI systems read: JUnit XML as Jenkins takes it, GitLab's test
//! report and the reporters on GitHub alike.
//!
//! A suite is a scene, not a gate: errors and times belong to scenes, and a gate's name,
//! which is a sentence, is what these tools show as the name of a test. A test is a
//! verdict; besides, that a case was rendered and a scene judged are tests of their own,
//! with the time that took, so that one that ends with an error has a name that passes in
//! the next run. What belongs to no scene is in the first suite: whether the run is
//! complete, and gates that nothing was held against.
//!
//! | in the record | in the report |
//! |---|---|
//! | pass, warn | passed; a warning's reason is its output |
//! | fail | failure of type `fail` |
//! | inconclusive, a gate idle without excuse, gates of which none speaks of what was handed in | failure of type `inconclusive` |
//! | known failure, an excused idle gate | skipped, with the reason |
//! | a case or judge that ended with an error, a run that ended early | error |
//!
//! Exactly where the run does not pass is there a failure or an error.

use super::{ReportError, in_a_line};
use crate::{
    gate::{Outcome, Verdict, words},
    record::{End, IdleGate, Record},
    untrusted::line,
};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use std::time::Duration;

/// The name of the test report in its folder.
pub const FILE: &str = "junit.xml";

/// The test report of a record, as XML.
///
/// # Errors
/// Where it cannot be written as XML.
pub fn xml(record: &Record) -> Result<String, ReportError> {
    let mut report = Report::new(line(&record.suite.name));
    if let Some(time) = seconds(record.timing.seconds) {
        report.set_time(time);
    }
    report.add_test_suite(of_run(record));
    let mut scenes: Vec<&str> = Vec::new();
    let named = record.scenes.iter().map(|s| &s.name).chain(record.cases.iter().map(|c| &c.case.scene));
    for scene in named.chain(record.verdicts.iter().map(|v| &v.scene)) {
        if !scenes.contains(&scene.as_str()) {
            scenes.push(scene);
        }
    }
    report.add_test_suites(scenes.into_iter().map(|scene| of_scene(record, scene)));
    // Jenkins checks against a schema that has the number of skipped tests in a suite, but not of all suites.
    let skipped = format!(" skipped=\"{}\"", report.skipped);
    Ok(report.to_string()?.replacen(&skipped, "", 1))
}

/// Whether the run is complete, and gates that nothing was held against.
fn of_run(record: &Record) -> TestSuite {
    let mut suite = suite(record, &record.suite.name);
    let complete = record.incomplete.as_ref().map(|why| error("incomplete", why));
    let mut tests = vec![TestCase::new("the run is complete", complete.unwrap_or_else(TestCaseStatus::success))];
    let excuse = record.end() != End::Nothing;
    if record.judges_no_image() {
        let nothing = failure("inconclusive", "no gate speaks of the images that were handed in", &[]);
        tests.push(TestCase::new("gates are held against the images", nothing));
    }
    tests.extend(record.idle_gates.iter().map(|g| TestCase::new(line(&g.gate), of_idle(g, excuse))));
    for mut test in tests {
        test.set_classname(line(&record.suite.name)).set_time(Duration::ZERO);
        suite.add_test_case(test);
    }
    suite
}

fn of_scene(record: &Record, scene: &str) -> TestSuite {
    let mut suite = suite(record, scene);
    let mut whole = Duration::ZERO;
    for mut test in judge(record, scene).into_iter().chain(rendered(record, scene)).chain(judged(record, scene)) {
        // Jenkins takes what stands before the last dot for a package.
        test.set_classname(line(&format!("{}.{scene}", record.suite.name)));
        whole = whole.saturating_add(test.time.unwrap_or_default());
        suite.add_test_case(test);
    }
    suite.set_time(whole);
    suite
}

/// A suite that says what ran where.
fn suite(record: &Record, name: &str) -> TestSuite {
    let mut suite = TestSuite::new(line(name));
    let (machine, timing) = (&record.machine, &record.timing);
    for (name, value) in [
        ("tool", format!("aogauge {}", record.tool)),
        ("suite", record.suite.name.clone()),
        ("seed", record.seed.to_string()),
        ("replicates", record.suite.replicates.to_string()),
        ("os", format!("{} {}", machine.os, machine.arch)),
        ("cpu", machine.cpu.clone()),
        ("gpu", machine.gpu.clone()),
        ("threads", timing.threads.to_string()),
    ] {
        suite.add_property((name, line(&value).as_str()));
    }
    if let Ok(began) = timing.began.parse::<jiff::Timestamp>() {
        suite.extra.insert("timestamp".into(), began.strftime("%Y-%m-%dT%H:%M:%SZ").to_string().into());
    }
    suite
}

/// That the scene was judged.
fn judge(record: &Record, scene: &str) -> Option<TestCase> {
    let of = record.scenes.iter().find(|s| s.name == scene)?;
    let status = match &of.judge_error {
        Some(why) => error("judge-error", why),
        None if of.judge.is_some() => TestCaseStatus::success(),
        None => return None,
    };
    let time = record.timing.judges.get(scene);
    Some(timed(TestCase::new("the scene is judged [judge]", status), time))
}

/// That cases were rendered.
fn rendered(record: &Record, scene: &str) -> impl Iterator<Item = TestCase> {
    record.cases.iter().filter(move |c| c.case.scene == scene).map(|c| {
        let status = c.error.as_ref().map_or_else(TestCaseStatus::success, |why| error("case-error", why));
        let name = format!("the case is rendered [{}/{}/{}]", c.case.estimator, c.case.renderer, c.case.rays);
        timed(TestCase::new(line(&name), status), record.timing.cases.get(&c.case.id()))
    })
}

/// What gates came to.
fn judged(record: &Record, scene: &str) -> impl Iterator<Item = TestCase> {
    let family = record.verdicts.iter().filter(|v| v.p_holds.is_some()).count();
    record.verdicts.iter().filter(move |v| v.scene == scene).map(move |v| {
        let of = v.case.as_ref().map(|c| format!("{}/{}/{}", c.estimator, c.renderer, c.rays));
        let name = format!("{} [{}]", v.gate, of.as_deref().unwrap_or("judge"));
        let mut test = timed(TestCase::new(line(&name), of_verdict(v, family)), None);
        if v.outcome == Outcome::Warn {
            test.set_system_out(in_a_line(v));
        }
        test
    })
}

fn of_verdict(verdict: &Verdict, family: usize) -> TestCaseStatus {
    match verdict.outcome {
        Outcome::Pass | Outcome::Warn => TestCaseStatus::success(),
        Outcome::Fail => failure("fail", &in_a_line(verdict), &words::explain(verdict, family)),
        Outcome::Inconclusive => failure("inconclusive", &in_a_line(verdict), &words::explain(verdict, family)),
        Outcome::KnownFailure => skipped("known-failure", &format!("known to fail: {}", in_a_line(verdict))),
    }
}

/// Excuses do not help where nothing at all was judged.
fn of_idle(gate: &IdleGate, excuse: bool) -> TestCaseStatus {
    let why = format!("nothing was held against it: {}", gate.reason);
    if gate.excused && excuse { skipped("not-run", &why) } else { failure("inconclusive", &why, &[]) }
}

fn failure(kind: &str, message: &str, explanation: &[String]) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    // Some tools show the message alone, others the text alone.
    let text = std::iter::once(message).chain(explanation.iter().map(String::as_str)).map(line);
    status.set_type(kind).set_message(line(message)).set_description(text.collect::<Vec<_>>().join("\n"));
    status
}

fn error(kind: &str, why: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
    status.set_type(kind).set_message(line(why)).set_description(line(why));
    status
}

fn skipped(kind: &str, why: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::skipped();
    status.set_type(kind).set_message(line(why));
    status
}

/// A test with its time; none where that is not known.
fn timed(mut test: TestCase, time: Option<&f64>) -> TestCase {
    test.set_time(time.and_then(|s| seconds(*s)).unwrap_or_default());
    test
}

/// At most a year: Jenkins' schema has room for no more than it can count.
fn seconds(s: f64) -> Option<Duration> {
    (0.0..=31_536_000.0).contains(&s).then(|| Duration::from_secs_f64(s))
}
