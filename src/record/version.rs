//! Records of other versions.
//!
//! | version | what it brought | |
//! |--:|---|---|
//! | 1, 2 | | no longer read |
//! | 3 | pooled metrics, convergence, occluders, detectable effects | read |
//! | 4 | gates in the record, p-values over the family, warnings, differences | written |
//!
//! Fields that a version added have defaults. What it renamed or took away is changed
//! in the JSON before it is read.

use super::{OLDEST, Record, VERSION};
use crate::{
    disk::parse_json,
    untrusted::{cut, line},
};
use serde::Deserialize;
use serde_json::{Value, json};

/// Reads the text of a `record.json` of any version since [`OLDEST`].
pub(super) fn parse(text: &str) -> Result<Record, String> {
    #[derive(Deserialize)]
    struct Versioned {
        version: u32,
        #[serde(default)]
        tool: Option<String>,
    }
    let malformed = |e: String| format!("not a record: {e}");
    let Versioned { version, tool } = parse_json(text).map_err(malformed)?;
    let by = tool.map_or_else(String::new, |t| format!(" {}", cut(&line(&t), 40)));
    match version {
        VERSION => parse_json(text).map_err(malformed),
        OLDEST => {
            let mut record: Value = parse_json(text).map_err(malformed)?;
            from_3(&mut record);
            parse_json(&record.to_string()).map_err(malformed)
        }
        v if v > VERSION => Err(format!(
            "written by a newer aogauge{by} (record version {v}); this one reads versions {OLDEST} to {VERSION}: update it"
        )),
        v => Err(format!(
            "written by an older aogauge{by} (record version {v}); this one reads versions {OLDEST} to {VERSION}: run the \
             suite again"
        )),
    }
}

/// Version 3 had the p-value of equivalence alone, each verdict a family of its own.
fn from_3(record: &mut Value) {
    // A list is no record either: reading it says so.
    let Some(record) = record.as_object_mut() else { return };
    record.insert("version".to_owned(), json!(VERSION));
    let verdicts = record.get_mut("verdicts").and_then(Value::as_array_mut);
    for verdict in verdicts.into_iter().flatten().filter_map(Value::as_object_mut) {
        if let Some(p) = verdict.remove("p").filter(|p| !p.is_null()) {
            verdict.insert("p_holds".to_owned(), json!({ "raw": p, "adjusted": p }));
        }
    }
}
