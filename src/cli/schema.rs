//! `aogauge schema`

use super::{Exit, Failure, explain::Explanations, golden, json, print};
use crate::{
    bench::{GpuBench, cpu::CpuBench},
    changes::Changes,
    compare::Comparison,
    flatland::Study,
    golden::Verification,
    kit::Manifest,
    record::Record,
    report::digest::Digest,
    run::{ReferencesFile, ShardRecord},
    scenes::Scene,
    score::Declaration,
    suite::SuiteFile,
};
use clap::ValueEnum;

/// Print the JSON Schema of a format.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  aogauge schema record > record.schema.json")]
pub struct Args {
    /// Which format.
    #[arg(value_enum, default_value_t)]
    of: Of,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Of {
    /// record.json, version 4; of version 3, which is read too, there is no schema.
    #[default]
    Record,
    /// shard.json
    Shard,
    /// Suite files.
    Suite,
    /// Scene files.
    Scene,
    /// kit.json, what `scene export --suite` says for programs.
    Kit,
    /// scoring.json, what images are scored against.
    Scoring,
    /// score.toml, what is declared of images.
    Score,
    /// flatland.json
    Flatland,
    /// bench.json of `bench gpu`.
    Bench,
    /// bench.json of `bench cpu`.
    BenchCpu,
    /// What `compare --format json` prints of images.
    Compare,
    /// What `explain --format json` prints.
    Explain,
    /// What `compare --format json` prints of two records.
    Changes,
    /// What `report --format json` prints.
    Report,
    /// What `golden verify --format json` prints.
    GoldenVerify,
    /// What `golden list --format json` prints.
    GoldenList,
    /// What `golden size --format json` prints.
    GoldenSize,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let schema = match args.of {
        Of::Record => schemars::schema_for!(Record),
        Of::Shard => schemars::schema_for!(ShardRecord),
        Of::Suite => schemars::schema_for!(SuiteFile),
        Of::Scene => Scene::file_schema(),
        Of::Kit => schemars::schema_for!(Manifest),
        Of::Scoring => schemars::schema_for!(ReferencesFile),
        Of::Score => schemars::schema_for!(Declaration),
        Of::Flatland => schemars::schema_for!(Study),
        Of::Compare => schemars::schema_for!(Comparison),
        Of::Explain => schemars::schema_for!(Explanations),
        Of::Changes => schemars::schema_for!(Changes),
        Of::Report => schemars::schema_for!(Digest),
        Of::GoldenVerify => schemars::schema_for!(Verification),
        Of::GoldenList => schemars::schema_for!(golden::Listing),
        Of::GoldenSize => schemars::schema_for!(golden::Sizes),
        Of::Bench => schemars::schema_for!(GpuBench),
        Of::BenchCpu => schemars::schema_for!(CpuBench),
    };
    print(&json(&schema)?)?;
    Ok(Exit::Pass)
}
