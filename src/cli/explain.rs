//! `aogauge explain`

use super::{Exit, Failure, Format, json, print};
use crate::{
    gate::{Outcome, Verdict, words},
    record::Record,
    report::table::outcome_text,
    untrusted::logged,
};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;

/// Tell in words how a verdict came about, and what to do.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  aogauge explain reports/latest\n  aogauge explain reports/latest curtain-room/classic\n  \
aogauge explain reports/latest 'pillar (judge)' --format json\n\n\
Exit codes: 0 explained, 2 no readable record, 4 nothing of that name."
)]
pub struct Args {
    /// The record's folder.
    record: PathBuf,
    /// A case by its id, scene/estimator/renderer/rays, or by a part of it; a judge as
    /// scene/judge. Unless given, all that did not pass.
    case: Option<String>,
    /// How it is printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// What `explain --format json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Explanations {
    /// Version of this format.
    version: u32,
    /// In the order of the record.
    explanations: Vec<Explanation>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Explanation {
    /// The case's id, or `scene (judge)`; null for gates that nothing was held against.
    subject: Option<String>,
    /// The gate; null for what ended with an error before any was held against it.
    gate: Option<String>,
    /// An outcome of a verdict, `error`, or `not-run`.
    outcome: String,
    /// In words, a paragraph an entry.
    text: Vec<String>,
    /// A picture that shows it, relative to the record.
    picture: Option<String>,
    /// The numbers.
    verdict: Option<Verdict>,
    /// For people.
    #[serde(skip)]
    title: &'static str,
}

/// Version of [`Explanations`].
const VERSION: u32 = 1;

/// Columns that text is wrapped at.
const WIDTH: usize = 92;

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let record = Record::read(&args.record)?;
    let explanations = select(&record, args.case.as_deref());
    let quiet = args.case.is_none() && !record.verdicts.is_empty();
    if explanations.is_empty() && !quiet {
        let what = args.case.as_ref().map_or_else(
            || "its suite has no gates".to_owned(),
            |c| format!("no verdict is on a case or judge whose name holds '{c}'"),
        );
        return Err(Failure { exit: Exit::Nothing, message: format!("{}: {what}", args.record.display()) });
    }
    print(&match args.format {
        Format::Json => json(&Explanations { version: VERSION, explanations })?,
        Format::Text if explanations.is_empty() => match record.verdicts.len() {
            1 => "The one verdict passed.\n".to_owned(),
            n => format!("All {n} verdicts passed.\n"),
        },
        Format::Text => explanations.iter().map(Explanation::plain).collect::<Vec<_>>().join("\n"),
    })?;
    Ok(Exit::Pass)
}

/// What is to be explained: all under a name, or all that did not pass.
fn select(record: &Record, name: Option<&str>) -> Vec<Explanation> {
    let ids = record.verdicts.iter().map(Verdict::subject).chain(record.cases.iter().map(|c| c.case.id()));
    let exact = name.is_some_and(|n| ids.into_iter().any(|id| id == n));
    let named = |subject: &str| {
        name.is_none_or(|n| {
            let judge = subject.replace(" (judge)", "/judge");
            if exact { subject == n } else { subject.contains(n) || judge.contains(n) }
        })
    };
    let error = |subject: String, why: &str| Explanation {
        subject: Some(subject),
        gate: None,
        outcome: "error".into(),
        text: vec![format!("It ended with an error, so there is nothing to judge: {why}")],
        picture: None,
        verdict: None,
        title: "ERROR",
    };
    let cases = record.cases.iter().filter_map(|c| Some((c.case.id(), c.error.as_ref()?)));
    let judges = record.scenes.iter().filter_map(|s| Some((format!("{} (judge)", s.name), s.judge_error.as_ref()?)));
    let failed = cases.chain(judges).filter(|(subject, _)| named(subject)).map(|(subject, why)| error(subject, why));
    let family = record.verdicts.iter().filter(|v| v.p_holds.is_some()).count();
    let wanted = |v: &&Verdict| named(&v.subject()) && (name.is_some() || v.outcome != Outcome::Pass);
    let verdicts = record.verdicts.iter().filter(wanted).map(|v| of_verdict(v, family));
    let idle = record.idle_gates.iter().filter(|_| name.is_none()).map(|g| Explanation {
        subject: None,
        gate: Some(g.gate.clone()),
        outcome: "not-run".into(),
        text: vec![format!(
            "Nothing was held against it: {}. {}",
            g.reason,
            if g.excused { "That is no fault of the run." } else { "So the run is inconclusive." }
        )],
        picture: None,
        verdict: None,
        title: "NOT RUN",
    });
    failed.chain(verdicts).chain(idle).collect()
}

fn of_verdict(verdict: &Verdict, family: usize) -> Explanation {
    let outcome = serde_json::to_value(verdict.outcome).ok().and_then(|v| v.as_str().map(str::to_owned));
    Explanation {
        subject: Some(verdict.subject()),
        gate: Some(verdict.gate.clone()),
        outcome: outcome.unwrap_or_default(),
        text: words::explain(verdict, family),
        picture: verdict.picture.clone(),
        verdict: Some(verdict.clone()),
        title: outcome_text(verdict.outcome),
    }
}

impl Explanation {
    fn plain(&self) -> String {
        let mut text = self.title.to_owned();
        if let Some(subject) = &self.subject {
            text += &format!("  {}", logged(subject));
        }
        text.push('\n');
        let gate = self.gate.iter().map(|g| format!("Gate: {g}"));
        for paragraph in gate.chain(self.text.iter().cloned()) {
            text += &wrap(&logged(&paragraph));
        }
        text
    }
}

/// Lines of at most [`WIDTH`] characters, indented by two; a longer word has its own. None is a command to GitHub's
/// runner, though a word within the text may look like the beginning of one.
fn wrap(text: &str) -> String {
    let (mut lines, mut column) = (String::from("  "), 2);
    for word in text.split_whitespace().map(logged) {
        let length = word.chars().count();
        if column > 2 && column + 1 + length > WIDTH {
            lines += "\n    ";
            column = 4;
        } else if column > 2 {
            lines.push(' ');
            column += 1;
        }
        lines += &word;
        column += length;
    }
    lines + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_wrapped_and_loses_nothing() {
        let text = "word ".repeat(60) + &"x".repeat(200) + " end";
        let wrapped = wrap(&text);
        assert_eq!(wrapped.split_whitespace().collect::<Vec<_>>(), text.split_whitespace().collect::<Vec<_>>());
        assert!(wrapped.lines().all(|l| l.len() <= WIDTH || l.trim().len() == 200), "{wrapped}");
        assert!(wrapped.lines().count() < 10 && wrapped.starts_with("  word word"));
        assert_eq!(wrap(""), "  \n");
    }
}
