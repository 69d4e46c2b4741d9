//! Numbers that know their range. Each checks itself while it is read, so that
//! the TOML reader reports a bad value with its line and column.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::{borrow::Cow, fmt::Display};

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
                    Err(out_of_range(value, $range))
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

/// The complaint about a number outside its range.
fn out_of_range<E: Error>(value: impl Display, range: impl Display) -> E {
    E::custom(format!("{value} is out of range: it must be {range}"))
}

/// Ranges that a parameter carries in its type, so that the declaration is the
/// documentation. `$unit` is what one step of the bounds is worth.
macro_rules! ranged {
    ($(#[$doc:meta])* $name:ident, $bound:ty, $unit:literal, $suffix:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
        #[serde(transparent)]
        pub struct $name<const MIN: $bound, const MAX: $bound>(pub f32);

        impl<'de, const MIN: $bound, const MAX: $bound> Deserialize<'de> for $name<MIN, MAX> {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                // The range leaves out what is not finite, and its message says more
                // than that.
                let given = f64::deserialize(d)?;
                let value = given as f32;
                let (min, max) = (MIN as f32 / $unit, MAX as f32 / $unit);
                if (min..=max).contains(&value) {
                    Ok(Self(value))
                } else {
                    let kind = if given.is_finite() { "" } else { "a finite number " };
                    Err(out_of_range(given, format_args!("{kind}from {min} to {max}{}", $suffix)))
                }
            }
        }

        impl<const MIN: $bound, const MAX: $bound> JsonSchema for $name<MIN, MAX> {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({
                    "type": "number",
                    "minimum": f64::from(MIN) / f64::from($unit),
                    "maximum": f64::from(MAX) / f64::from($unit)
                })
            }
        }
    };
}

ranged!(
    /// A length in metres; its bounds are in millimetres.
    Length,
    u32,
    1000.0f32,
    " m"
);
ranged!(
    /// An angle in degrees.
    Angle,
    i32,
    1.0f32,
    " degrees"
);

/// A whole number between two bounds: what a shape makes so many of is always
/// capped, so that no parameter allocates without bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Count<const MIN: u32, const MAX: u32>(pub u32);

impl<'de, const MIN: u32, const MAX: u32> Deserialize<'de> for Count<MIN, MAX> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let value = i64::deserialize(d)?;
        u32::try_from(value)
            .ok()
            .filter(|v| (MIN..=MAX).contains(v))
            .map(Self)
            .ok_or_else(|| out_of_range(value, format_args!("a whole number from {MIN} to {MAX}")))
    }
}

impl<const MIN: u32, const MAX: u32> JsonSchema for Count<MIN, MAX> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Count".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": MIN, "maximum": MAX })
    }
}

/// How thick a sheet is, metres: 0 is a single, open layer of triangles; what is
/// thicker is a closed solid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Thickness(pub f32);

impl Thickness {
    /// The thinnest solid, metres: below it the two faces fall together in 32-bit
    /// coordinates.
    const MIN: f32 = 1e-4;
    /// The thickest, metres.
    const MAX: f32 = 100.0;
}

impl<'de> Deserialize<'de> for Thickness {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let value = finite(d)?;
        if value == 0.0 || (Self::MIN..=Self::MAX).contains(&value) {
            return Ok(Self(value));
        }
        Err(out_of_range(value, format_args!("0, for a single sheet, or from {} to {} m", Self::MIN, Self::MAX)))
    }
}

impl JsonSchema for Thickness {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Thickness".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "anyOf": [{ "const": 0 }, { "minimum": 1e-4, "maximum": Self::MAX }] })
    }
}

ranged!(
    /// A signed distance in metres; so are its bounds.
    Offset,
    i32,
    1.0f32,
    " m"
);

/// A coordinate of a place: near enough to the origin that a tenth of a
/// millimetre still counts in 32-bit numbers.
pub type Coordinate = Offset<-100, 100>;

impl Default for Coordinate {
    fn default() -> Self {
        Self(0.0)
    }
}

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
