//! What a run comes to.

use super::{Record, Summary};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a run comes to: the first of these that holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// A case or a judge ended with an error, or the run ended early.
    Incomplete,
    /// A gate failed.
    Fail,
    /// The data do not decide a gate.
    Inconclusive,
    /// The suite has gates, and none of them was held against anything; of images that were handed
    /// in: none against an image.
    Nothing,
    /// Every gate passes; those known to fail do.
    Pass,
}

impl End {
    /// `INCOMPLETE`, `FAIL`, `INCONCLUSIVE`, `NOTHING JUDGED` or `PASS`.
    pub fn text(self) -> &'static str {
        match self {
            End::Incomplete => "INCOMPLETE",
            End::Fail => "FAIL",
            End::Inconclusive => "INCONCLUSIVE",
            End::Nothing => "NOTHING JUDGED",
            End::Pass => "PASS",
        }
    }
}

impl Record {
    /// What the run comes to. It is counted anew: a record may have been edited.
    pub fn end(&self) -> End {
        let s = Summary::new(&self.verdicts, &self.idle_gates, &self.scenes, &self.cases);
        if s.failed_cases + s.failed_judges > 0 || self.incomplete.is_some() {
            End::Incomplete
        } else if self.handed_in.is_some() && self.has_judged_nothing() {
            // What the kit's own judge passes or fails says nothing of the images.
            End::Nothing
        } else if s.fail > 0 {
            End::Fail
        } else if s.inconclusive > 0 {
            End::Inconclusive
        } else if self.has_judged_nothing() {
            End::Nothing
        } else {
            End::Pass
        }
    }
}
