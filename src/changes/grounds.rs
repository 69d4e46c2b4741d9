//! What stands on the same ground in both records: the same scene, the same method.

use crate::{metrics::MetricName, record::Record, suite::Case};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;

/// What is another one under the same name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A scene whose content hash changed.
    Scene,
    /// A method whose definition changed.
    Estimator,
}

/// A scene or method that is another one under the same name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Incomparable {
    /// What it is.
    pub kind: Kind,
    /// Its name.
    pub name: String,
}

/// Scenes and methods that changed.
pub(super) struct Grounds {
    scenes: BTreeSet<String>,
    estimators: BTreeSet<String>,
    /// Whether classic AO, which others are held against, is another one.
    classic: bool,
}

impl Grounds {
    pub(super) fn of(base: &Record, new: &Record) -> Self {
        let hash = |name: &str| base.scenes.iter().find(|s| s.name == name).map(|s| &s.hash);
        let scenes = new.scenes.iter().filter(|s| hash(&s.name).is_some_and(|h| *h != s.hash));
        let estimators =
            new.suite.methods.iter().filter(|(name, m)| base.suite.methods.get(*name).is_some_and(|b| b != *m));
        let estimators: BTreeSet<String> = estimators.map(|(name, _)| name.clone()).collect();
        let classic = base.suite.classic != new.suite.classic || estimators.contains(&new.suite.classic);
        Grounds { scenes: scenes.map(|s| s.name.clone()).collect(), estimators, classic }
    }

    /// Whether a scene is the same.
    pub(super) fn has_scene(&self, scene: &str) -> bool {
        !self.scenes.contains(scene)
    }

    /// Whether a case's images and metrics mean the same.
    pub(super) fn has_case(&self, case: &Case) -> bool {
        self.has_scene(&case.scene) && !self.estimators.contains(&case.estimator)
    }

    /// Whether a metric means the same where its case does: some are held against
    /// classic AO.
    pub(super) fn has_metric(&self, name: MetricName) -> bool {
        !(self.classic && matches!(name, MetricName::Removed | MetricName::OverDarkening))
    }

    pub(super) fn into_list(self) -> Vec<Incomparable> {
        let scenes = self.scenes.into_iter().map(|name| Incomparable { kind: Kind::Scene, name });
        let estimators = self.estimators.into_iter().map(|name| Incomparable { kind: Kind::Estimator, name });
        scenes.chain(estimators).collect()
    }
}
