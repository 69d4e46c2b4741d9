//! A round pillar.

use super::{
    At,
    rings::{Ring, push_rings},
};
use crate::{
    Mesh,
    bounded::{Count, Length},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A cylinder on the floor, with a round base and a round capital where given.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pillar {
    /// Of the shaft, metres.
    pub radius: Length<20, 50_000>,
    /// From y = 0 to the top, metres.
    pub height: Length<20, 100_000>,
    /// Sides of the shaft.
    pub sides: Count<3, 256>,
    /// What it stands on.
    pub base: Option<Collar>,
    /// What it carries its load with.
    pub capital: Option<Collar>,
    /// x and z of its axis, metres; the origin unless given.
    pub at: At,
}

/// A disc round a pillar.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Collar {
    /// Metres; above the shaft's.
    pub radius: Length<20, 50_000>,
    /// Metres.
    pub height: Length<1, 50_000>,
}

impl Default for Collar {
    fn default() -> Self {
        Collar { radius: Length(0.28), height: Length(0.15) }
    }
}

impl Default for Pillar {
    fn default() -> Self {
        Pillar {
            radius: Length(0.2),
            height: Length(3.0),
            sides: Count(48),
            base: None,
            capital: None,
            at: At::default(),
        }
    }
}

/// The narrowest step and the shortest shaft, metres.
const LEAST: f32 = 1e-3;

impl Pillar {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        for (name, collar) in [("base", self.base), ("capital", self.capital)] {
            if collar.is_some_and(|c| c.radius.0 < self.radius.0 + LEAST) {
                return Err(format!(
                    "{name}.radius must be at least {LEAST} m above radius {} m: it goes round the shaft",
                    self.radius.0
                ));
            }
        }
        let foot = self.base.map_or(0.0, |b| b.height.0);
        let head = self.height.0 - self.capital.map_or(0.0, |c| c.height.0);
        if head < foot + LEAST {
            return Err(format!(
                "base.height and capital.height must leave {LEAST} m of shaft within height {} m",
                self.height.0
            ));
        }
        let mut outline = Vec::with_capacity(6);
        if let Some(base) = self.base {
            outline.extend([(base.radius.0, 0.0), (base.radius.0, foot)]);
        }
        outline.extend([(self.radius.0, foot), (self.radius.0, head)]);
        if let Some(capital) = self.capital {
            outline.extend([(capital.radius.0, head), (capital.radius.0, self.height.0)]);
        }
        let rings: Vec<Ring> = outline.iter().map(|&(r, y)| Ring::level(self.at.point(0.0, y, 0.0), r)).collect();
        let mut mesh = Mesh::default();
        push_rings(&mut mesh, &rings, self.sides.0);
        Ok(mesh)
    }
}
