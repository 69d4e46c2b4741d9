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
use crate::untrusted::{cut, line};
use serde::{Deserialize, Deserializer};
use serde_json::{Value, json};
use std::fmt::Display;

/// Reads the text of a `record.json` of any version since [`OLDEST`].
pub(super) fn parse(text: &str) -> Result<Record, String> {
    #[derive(Deserialize)]
    struct Versioned {
        version: u32,
        #[serde(default)]
        tool: Option<String>,
    }
    // The error may name a field as the file has it.
    let malformed = |e: serde_json::Error| format!("not a record: {}", cut(&line(&e.to_string()), 500));
    let Versioned { version, tool } = serde_json::from_str(text).map_err(malformed)?;
    let by = tool.map_or_else(String::new, |t| format!(" {}", cut(&line(&t), 40)));
    match version {
        VERSION => {
            let mut json = serde_json::Deserializer::from_str(text);
            let record = by_field(&mut json)?;
            json.end().map_err(malformed)?;
            Ok(record)
        }
        OLDEST => {
            let mut record: Value = serde_json::from_str(text).map_err(malformed)?;
            from_3(&mut record);
            by_field(record)
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

/// Errors name the field that they are of, as the file has it.
fn by_field<'de, D: Deserializer<'de>>(json: D) -> Result<Record, String>
where
    D::Error: Display,
{
    serde_path_to_error::deserialize(json).map_err(|e| {
        let field = e.path().to_string();
        // Of the record itself, such as a field that is missing.
        let at = if field == "." { String::new() } else { format!("{field}: ") };
        format!("not a record: {}", cut(&line(&format!("{at}{}", e.into_inner())), 500))
    })
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
