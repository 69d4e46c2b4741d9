//! Numbers that know their range. Each checks itself while it is read, so that
//! the TOML reader reports a bad value with its line and column.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// A finite number, as f32.
fn finite<'de, D: Deserializer<'de>>(d: D) -> Result<f32, D::Error> {
    let value = f64::deserialize(d)?;
    if !value.is_finite() || value.abs() > 1e12 {
        return Err(D::Error::custom(format!("{value} is not allowed here: give a finite number of at most 1e12")));
    }
    Ok(value as f32)
}

macro_rules! bounded {
    ($(#[$doc:meta])* $name:ident, $holds:expr, $range:literal, $schema:literal = $bound:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
        #[serde(transparent)]
        pub struct $name(#[schemars(extend($schema = $bound))] pub f32);

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                let value = finite(d)?;
                let holds: fn(f32) -> bool = $holds;
                if holds(value) {
                    Ok(Self(value))
                } else {
                    Err(D::Error::custom(format!(
                        "{value} is out of range: it must be {}",
                        $range
                    )))
                }
            }
        }
    };
}

bounded!(
    /// A length, radius or radiance above zero.
    Positive,
    |v| v > 0.0,
    "above 0",
    "exclusiveMinimum" = 0
);
bounded!(
    /// A length of zero or more.
    NonNegative,
    |v| v >= 0.0,
    "0 or more",
    "minimum" = 0
);
bounded!(
    /// A diffuse albedo: 0 reflects nothing, 1 would reflect everything.
    Albedo,
    |v| (0.0..1.0).contains(&v),
    "from 0 up to, but not including, 1",
    "minimum" = 0
);

/// A point or vector of finite coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct Triple(pub [f32; 3]);

impl Triple {
    /// As a glam vector.
    pub fn vec(self) -> glam::Vec3 {
        glam::Vec3::from_array(self.0)
    }
}

struct Finite(f32);

impl<'de> Deserialize<'de> for Finite {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        finite(d).map(Self)
    }
}

impl<'de> Deserialize<'de> for Triple {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        <[Finite; 3]>::deserialize(d).map(|v| Self(v.map(|c| c.0)))
    }
}

/// A name that is safe as a file name on every system: letters, digits, `-`, `_`
/// and `.`, not beginning with a dot, at most 64 characters.
///
/// # Errors
/// One sentence that says what a name may hold.
pub fn check_name(name: &str) -> Result<(), String> {
    let legal = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if name.is_empty() || name.len() > 64 || name.starts_with('.') || !name.chars().all(legal) {
        return Err(format!(
            "'{name}' is not a legal name: use 1 to 64 letters, digits, '-', '_' and '.', not beginning with '.'"
        ));
    }
    Ok(())
}
