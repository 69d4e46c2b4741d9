//! An atrium: two storeys of arcades round an open courtyard, with curtains in
//! the arches. It plays the part of the Crytek Sponza, made from numbers alone.
//!
//! The house is 30 m long (x), 18 m wide (z) and 12 m high, centred on
//! x = z = 0 with its floor at y = 0. Only the courtyard, 22 m by 10 m between
//! the centre lines of its colonnades, is open to the sky.

mod arches;
mod cloth;
mod columns;
mod plan;
mod shell;
mod sink;
#[cfg(test)]
mod tests;
mod vaults;

use super::Part;
use crate::{
    Material,
    bounded::{Count, Length, Thickness},
};
use plan::{Plan, STOREYS};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sink::Sink;

/// Two storeys of arcades round an open courtyard, with pleated curtains in the
/// lower arches and banners before the upper ones. Curtains and banners are
/// occluders of their own.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Atrium {
    /// How many triangles to aim at, to within a tenth: 10 000 to 10 000 000,
    /// from 16 000 with more bays than the defaults; 250 000 unless given.
    pub triangles: Count<10_000, 10_000_000>,
    /// From the floor to the hem of the curtains, metres; 0.03 unless given.
    pub hem_gap: Length<2, 500>,
    /// From the crest of a pleat to its trough, at the hem, metres; 0.12 unless given.
    pub pleat_depth: Length<0, 300>,
    /// Thickness of curtains and banners, metres; 0, a single sheet, unless
    /// given.
    pub cloth_thickness: Thickness<1_000, 20_000>,
    /// Arches along each long side of the courtyard; 7 unless given.
    pub bays_long: Count<5, 10>,
    /// Arches along each short side of the courtyard; 3 unless given.
    pub bays_short: Count<3, 4>,
}

impl Default for Atrium {
    fn default() -> Self {
        Atrium {
            triangles: Count(250_000),
            hem_gap: Length(0.03),
            pleat_depth: Length(0.12),
            cloth_thickness: Thickness(0.0),
            bays_long: Count(7),
            bays_short: Count(3),
        }
    }
}

/// Name, linear colour and maker of each part of stone, wood and iron.
type Maker = fn(&Plan, &mut Sink);
const HOUSE: [(&str, [f32; 3], Maker); 13] = [
    ("shell", [0.58, 0.52, 0.43], shell::shell),
    ("paving", [0.44, 0.40, 0.35], shell::paving),
    ("slab", [0.56, 0.50, 0.41], shell::slab),
    ("columns", [0.60, 0.54, 0.45], columns::columns),
    ("piers", [0.53, 0.46, 0.37], columns::piers),
    ("pilasters", [0.53, 0.46, 0.37], columns::pilasters),
    ("balustrade", [0.60, 0.54, 0.45], |plan, sink| columns::balustrade(plan, STOREYS[1], sink)),
    ("door-frames", [0.53, 0.46, 0.37], |plan, sink| columns::doors(plan, sink, true)),
    ("doors", [0.13, 0.07, 0.035], |plan, sink| columns::doors(plan, sink, false)),
    ("arches", [0.55, 0.47, 0.37], arches::walls),
    ("bands", [0.60, 0.54, 0.45], arches::bands),
    ("vaults", [0.62, 0.58, 0.50], vaults::vaults),
    ("ribs", [0.53, 0.46, 0.37], vaults::ribs),
];

/// Name and linear colour of the cloths.
const DYES: [(&str, [f32; 3]); 4] = [
    ("red", [0.42, 0.045, 0.035]),
    ("green", [0.06, 0.24, 0.07]),
    ("blue", [0.05, 0.10, 0.36]),
    ("ochre", [0.50, 0.28, 0.06]),
];

fn dye(number: u32) -> (&'static str, [f32; 3]) {
    DYES[number as usize % DYES.len()]
}

impl Atrium {
    pub(crate) fn parts(&self) -> Result<Vec<Part>, String> {
        let mut parts = vec![];
        self.make(&self.fit()?, |name, color, occluder, make| {
            let mut sink = Sink::new(true);
            make(&mut sink);
            let mesh = sink.into_mesh();
            if !mesh.triangles.is_empty() {
                parts.push(Part { name, occluder, material: Some(Material::colored(color)), mesh });
            }
        });
        Ok(parts)
    }

    /// Calls `take` with name, colour, whether it is an occluder, and maker of
    /// every part.
    fn make(&self, plan: &Plan, mut take: impl FnMut(String, [f32; 3], bool, &dyn Fn(&mut Sink))) {
        for (name, color, maker) in HOUSE {
            take(name.into(), color, false, &|sink| maker(plan, sink));
        }
        take("rods".into(), [0.05, 0.045, 0.04], false, &|sink| cloth::rods(plan, sink));
        for h in cloth::curtains(plan) {
            let (dye, color) = dye(h.number());
            let name = format!("curtain-{dye}-{}", h.number());
            take(name, color, true, &|sink| cloth::curtain(plan, self, &h, sink));
        }
        for h in cloth::banners(plan) {
            let name = format!("banner-{}", h.number());
            take(name, dye(h.number() + 1).1, true, &|sink| cloth::banner(plan, self, &h, sink));
        }
    }

    fn count(&self, plan: &Plan) -> usize {
        let mut sink = Sink::new(false);
        self.make(plan, |_, _, _, make| make(&mut sink));
        sink.count()
    }

    /// The plan whose triangles come nearest to the number asked for.
    fn fit(&self) -> Result<Plan, String> {
        let target = self.triangles.0;
        let mut plan = Plan::new([self.bays_long.0, self.bays_short.0]);
        // First everything together, then cloth alone for what rounding left.
        self.bisect(&mut plan, [0.05, 20.0], |plan, x| (plan.detail, plan.cloth) = (x, x));
        let detail = plan.detail;
        self.bisect(&mut plan, [detail / 4.0, detail * 4.0], |plan, x| plan.cloth = x);
        let count = self.count(&plan);
        if count.abs_diff(target as usize) * 10 > target as usize {
            return Err(format!(
                "atrium: triangles is {target}, but with bays_long {} and bays_short {} the nearest there is are {count}",
                self.bays_long.0, self.bays_short.0
            ));
        }
        Ok(plan)
    }

    /// Sets the best `x` of a range that bisection meets.
    fn bisect(&self, plan: &mut Plan, [mut low, mut high]: [f64; 2], set: impl Fn(&mut Plan, f64)) {
        let target = self.triangles.0 as usize;
        let mut best = (usize::MAX, low);
        for _ in 0..24 {
            let x = (low + high) / 2.0;
            set(plan, x);
            let count = self.count(plan);
            if count.abs_diff(target) < best.0 {
                best = (count.abs_diff(target), x);
            }
            if count > target { high = x } else { low = x }
        }
        set(plan, best.1);
    }
}
