//! The files of `examples/scale` say what aogauge understands, and rely on what it reads.

use aogauge::{cli::Cli, run::Shard};
use clap::Parser;
use std::{cell::RefCell, collections::BTreeSet, fs};

const FILES: [&str; 4] = ["slurm.sh", "kubernetes.yaml", "github.yml", "gitlab.yml"];

fn text(file: &str) -> String {
    fs::read_to_string(format!("{}/{file}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn example(file: &str) -> String {
    text(&format!("examples/scale/{file}"))
}

/// Every command line of aogauge in a file, each variable replaced by 1.
fn commands(text: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for line in text.lines().filter(|l| !l.trim_start().starts_with('#')) {
        // A list of YAML is a line of words, too.
        let line = match line.split_once("command: [") {
            Some((_, list)) => list.trim_end().trim_end_matches(']').replace(", ", " "),
            None => line.to_owned(),
        };
        let words: Vec<&str> = line.split_whitespace().take_while(|w| !["&", "#"].contains(w)).collect();
        let Some(at) = words.iter().position(|w| *w == "aogauge") else { continue };
        let is_verb = words.get(at + 1).is_some_and(|w| w.chars().all(|c| c.is_ascii_lowercase()));
        if is_verb {
            found.push(words[at..].iter().map(|w| known(&w.replace(['"', '\''], ""))).collect());
        }
    }
    found
}

/// A word whose variables, `$x`, `${x}` or `$(x)`, are 1.
fn known(word: &str) -> String {
    let Some((before, rest)) = word.split_once('$') else { return word.to_owned() };
    let end = match rest.chars().next() {
        Some('{') => rest.find('}').unwrap() + 1,
        Some('(') => rest.find(')').unwrap() + 1,
        _ => rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len()),
    };
    format!("{before}1{}", known(&rest[end..]))
}

#[test]
fn every_command_line_is_understood() {
    for file in FILES {
        let commands = commands(&example(file));
        let verbs: Vec<&str> = commands.iter().map(|c| c[1].as_str()).collect();
        let order = if file == "slurm.sh" { ["merge", "run"] } else { ["run", "merge"] };
        assert_eq!(verbs, order, "{file}");
        for command in commands {
            assert!(Cli::try_parse_from(&command).is_ok(), "{file}: {command:?}");
            assert!(command[1] != "run" || command.windows(2).any(|w| w == ["--shard", "auto"]), "{file}: {command:?}");
        }
    }
    assert!(Cli::try_parse_from(["aogauge", "run", "1", "--shards", "auto"]).is_err());
}

/// The variables that a shard can be named by.
fn read() -> BTreeSet<String> {
    let asked = RefCell::new(BTreeSet::new());
    // A Slurm array, so that its first index is asked for, too.
    let get = |name: &str| {
        asked.borrow_mut().insert(name.to_owned());
        name.starts_with("SLURM_").then(|| "1".to_owned())
    };
    assert_eq!(Shard::of_environment(&get).unwrap(), (Shard { index: 1, of: 1 }, "Slurm"));
    asked.into_inner()
}

#[test]
fn their_variables_are_those_that_are_read() {
    let read = read();
    let page = text("docs/scale.md");
    for name in &read {
        assert!(page.contains(&format!("`{name}`")), "docs/scale.md does not speak of {name}");
    }
    for (file, needed) in [
        ("slurm.sh", vec!["SLURM_ARRAY_TASK_ID"]),
        ("kubernetes.yaml", vec!["JOB_COMPLETION_INDEX", "JOB_COMPLETIONS"]),
        ("github.yml", vec!["MATRIX_INDEX", "MATRIX_TOTAL"]),
        ("gitlab.yml", vec!["CI_NODE_INDEX"]),
    ] {
        let text = example(file);
        let is_name = |c: char| c.is_ascii_uppercase() || c == '_';
        let of_shards = ["SLURM_ARRAY_TASK_", "JOB_COMPLETION", "MATRIX_", "CI_NODE_"];
        let named: BTreeSet<&str> =
            text.split(|c| !is_name(c)).filter(|w| of_shards.iter().any(|s| w.starts_with(s))).collect();
        assert_eq!(named, needed.into_iter().collect(), "{file}");
        assert!(named.iter().all(|n| read.contains(*n)), "{file}: {named:?}");
    }
}

#[test]
fn counts_that_are_given_twice_agree() {
    let kubernetes = example("kubernetes.yaml");
    let after = |what: &str| -> u32 {
        let rest = kubernetes.split_once(what).unwrap_or_else(|| panic!("no {what}")).1;
        let digits = rest.trim_start_matches(|c: char| !c.is_ascii_digit());
        digits.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
    };
    assert_eq!(after("completions: "), after("- name: JOB_COMPLETIONS"));
    // An image of the last shard is in the artifact only with the hidden files.
    let github = example("github.yml");
    assert!(github.contains("include-hidden-files: true"));
    assert!(github.contains("strategy.job-index") && github.contains("strategy.job-total"));
}

/// The workflow lies in the repository of whoever judges their own renderer, and the Job may fail.
#[test]
fn they_work_in_any_repository_and_after_any_end() {
    let github = example("github.yml");
    assert!(github.contains("cargo install --locked --root installed") && !github.contains("cargo build"));
    let kubernetes = example("kubernetes.yaml");
    assert!(kubernetes.contains("Complete|Failed") && !kubernetes.contains("--for=condition=complete"));
}
