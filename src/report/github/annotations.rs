//! Annotations: lines by which GitHub's runner marks a run.

use crate::{
    counted::counted,
    gate::{Outcome, Verdict},
    record::Record,
    report::{errors, in_a_line, table::margin},
    untrusted::{cut, line},
};

/// So many annotations are printed at most: GitHub shows 10 of a kind a step, and says
/// nothing of the others.
pub const MOST_ANNOTATIONS: usize = 10;

/// Characters of a title, and of a message.
const TITLE: usize = 200;
const MESSAGE: usize = 1000;

/// The worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Error,
    Warning,
    Notice,
}

impl Level {
    fn command(self) -> &'static str {
        match self {
            Level::Error => "error",
            Level::Warning => "warning",
            Level::Notice => "notice",
        }
    }
}

struct Annotation {
    level: Level,
    title: String,
    message: String,
}

impl Annotation {
    fn new(level: Level, title: impl Into<String>, message: impl Into<String>) -> Self {
        Annotation { level, title: title.into(), message: message.into() }
    }

    fn text(&self) -> String {
        let message = data(&cut(&line(&self.message), MESSAGE));
        format!("::{} title={}::{message}", self.level.command(), property(&cut(&line(&self.title), TITLE)))
    }
}

/// What the runner reads as the text that follows a command.
fn data(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

/// What it reads as a command's property.
fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}

/// The lines to print, at most [`MOST_ANNOTATIONS`]: errors for what ended with an error
/// and for gates that fail, warnings for what is inconclusive or warns, notices for known
/// failures and for gates that could not be held against anything. A gate has one for all
/// cases of an outcome. The last one says how many more there are.
pub fn annotations(record: &Record) -> Vec<String> {
    let mut all = all(record);
    all.sort_by_key(|a| a.level);
    if all.len() > MOST_ANNOTATIONS {
        let more = all.split_off(MOST_ANNOTATIONS - 1);
        let count = |level, one, many| {
            let n = more.iter().filter(|a| a.level == level).count();
            (n > 0).then(|| counted(n, one, many))
        };
        let counts = [
            count(Level::Error, "error", "errors"),
            count(Level::Warning, "warning", "warnings"),
            count(Level::Notice, "notice", "notices"),
        ];
        let counts: Vec<String> = counts.into_iter().flatten().collect();
        let message = format!("{} are in the job's summary and in the report.", counts.join(", "));
        let level = more.first().map_or(Level::Notice, |a| a.level);
        all.push(Annotation::new(level, format!("And {} more", more.len()), message));
    }
    all.iter().map(Annotation::text).collect()
}

fn all(record: &Record) -> Vec<Annotation> {
    let early = record.incomplete.iter().map(|why| Annotation::new(Level::Error, "The run ended early", why.as_str()));
    let failed = errors(record).map(|(what, why)| Annotation::new(Level::Error, format!("Error: {what}"), why));
    let outcomes = [
        (Outcome::Fail, Level::Error, "Fail"),
        (Outcome::Inconclusive, Level::Warning, "Inconclusive"),
        (Outcome::Warn, Level::Warning, "Warning"),
        (Outcome::KnownFailure, Level::Notice, "Known failure"),
    ];
    let of_gates = outcomes.into_iter().flat_map(|(outcome, level, word)| {
        gates(record, outcome).into_iter().map(move |(gate, of)| of_gate(level, &format!("{word}: {gate}"), &of))
    });
    let idle = record.idle_gates.iter().map(|g| {
        let (level, word) = if g.excused { (Level::Notice, "Not run") } else { (Level::Warning, "Inconclusive") };
        Annotation::new(level, format!("{word}: {}", g.gate), format!("Nothing was held against it: {}", g.reason))
    });
    let nothing = record.judges_no_image().then(|| {
        Annotation::new(
            Level::Warning,
            "Inconclusive: nothing judged",
            "No gate speaks of the images that were handed in.",
        )
    });
    early.chain(nothing).chain(failed).chain(of_gates).chain(idle).collect()
}

/// The gates that came to this, with their verdicts of this outcome.
fn gates(record: &Record, outcome: Outcome) -> Vec<(&str, Vec<&Verdict>)> {
    let mut gates: Vec<(&str, Vec<&Verdict>)> = Vec::new();
    for v in record.verdicts.iter().filter(|v| v.outcome == outcome) {
        match gates.iter_mut().find(|(gate, _)| *gate == v.gate) {
            Some((_, of)) => of.push(v),
            None => gates.push((&v.gate, vec![v])),
        }
    }
    gates
}

/// The case furthest beyond the limit, or nearest to it, stands for all.
fn of_gate(level: Level, title: &str, of: &[&Verdict]) -> Annotation {
    let worst = of.iter().min_by(|a, b| margin(a).total_cmp(&margin(b)));
    let mut message = worst.map_or_else(String::new, |v| format!("{}: {}", v.subject(), in_a_line(v)));
    if of.len() > 1 {
        message += &format!(" (and {})", counted(of.len() - 1, "more case", "more cases"));
    }
    Annotation::new(level, title, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_hold_what_they_are_given_as_text() {
        let text = Annotation::new(Level::Error, "a: b, 50%::x\n", "50 %\r\n::add-mask::y: z, w").text();
        assert_eq!(text, "::error title=a%3A b%2C 50%25%3A%3Ax ::50 %25  ::add-mask::y: z, w");
        assert_eq!(data("%0A\r\n:,"), "%250A%0D%0A:,");
        assert_eq!(property("%0A\r\n:,"), "%250A%0D%0A%3A%2C");
        let long = Annotation::new(Level::Notice, "t".repeat(500), "m".repeat(5000)).text();
        assert_eq!(long.chars().count(), "::notice title=::".len() + TITLE + MESSAGE + 2);
    }
}
