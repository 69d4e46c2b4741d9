//! Numbers that know their range. Each checks itself while it is read, so that
//! the TOML reader reports a bad value with its line and column.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
use std::{borrow::Cow, fmt::Display};

/// Writes a number as the shortest decimal that reads back as it, also where the
/// format has 64-bit numbers only: 0.03, not 0.029999999329447746.
fn shortest<S: Serializer>(value: &f32, s: S) -> Result<S::Ok, S::Error> {
    let short = value.to_string().parse().ok().filter(|&short: &f64| short as f32 == *value);
    s.serialize_f64(short.unwrap_or(f64::from(*value)))
}

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
        pub struct $name<const MIN: $bound, const MAX: $bound>(#[serde(serialize_with = "shortest")] pub f32);

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
    1e3f32,
    " m"
);
ranged!(
    /// A length in metres that may be very small; its bounds are in micrometres.
    Fine,
    u32,
    1e6f32,
    " m"
);
ranged!(
    /// Radiance, up to the environment's factor; its bounds are in thousandths.
    Radiance,
    u32,
    1e3f32,
    ""
);
ranged!(
    /// A part of a vector whose length means nothing.
    Component,
    i32,
    1.0f32,
    ""
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(transparent)]
pub struct Count<const MIN: u32, const MAX: u32>(pub u32);

impl<const MIN: u32, const MAX: u32> Count<MIN, MAX> {
    /// The number.
    pub fn get(self) -> u32 {
        self.0
    }
}

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
/// thicker is a closed solid. Bounds are in micrometres. Unless told otherwise,
/// 0.0001 m, below which the two faces fall together in 32-bit coordinates, to
/// 100 m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Thickness<const MIN: u32 = 100, const MAX: u32 = 100_000_000>(#[serde(serialize_with = "shortest")] pub f32);

impl<'de, const MIN: u32, const MAX: u32> Deserialize<'de> for Thickness<MIN, MAX> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let given = f64::deserialize(d)?;
        let value = given as f32;
        let (min, max) = (MIN as f32 / 1e6, MAX as f32 / 1e6);
        if value == 0.0 || (min..=max).contains(&value) {
            return Ok(Self(value));
        }
        let kind = if given.is_finite() { "" } else { "a finite number: " };
        Err(out_of_range(given, format_args!("{kind}0, for a single sheet, or from {min} to {max} m")))
    }
}

impl<const MIN: u32, const MAX: u32> JsonSchema for Thickness<MIN, MAX> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Thickness".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let (min, max) = (f64::from(MIN) / 1e6, f64::from(MAX) / 1e6);
        json_schema!({ "type": "number", "anyOf": [{ "const": 0 }, { "minimum": min, "maximum": max }] })
    }
}

/// A diffuse albedo: 0 reflects nothing, 1 would reflect everything.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Albedo(#[serde(serialize_with = "shortest")] pub f32);

impl<'de> Deserialize<'de> for Albedo {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let given = f64::deserialize(d)?;
        let value = given as f32;
        if (0.0..1.0).contains(&value) {
            return Ok(Self(value));
        }
        Err(out_of_range(given, "a finite number from 0 up to, but not including, 1"))
    }
}

impl JsonSchema for Albedo {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Albedo".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "minimum": 0, "exclusiveMaximum": 1 })
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

/// A point, or the way from one point to another, metres.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub struct Triple(pub [Offset<-100_000, 100_000>; 3]);

impl Triple {
    /// As a glam vector.
    pub fn vec(self) -> glam::Vec3 {
        glam::Vec3::from_array(self.0.map(|c| c.0))
    }
}

impl From<glam::Vec3> for Triple {
    fn from(v: glam::Vec3) -> Self {
        Triple(v.to_array().map(Offset))
    }
}

/// A vector whose length means nothing.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub struct Direction(pub [Component<-1_000, 1_000>; 3]);

impl Direction {
    /// As a glam vector.
    pub fn vec(self) -> glam::Vec3 {
        glam::Vec3::from_array(self.0.map(|c| c.0))
    }
}

impl From<glam::Vec3> for Direction {
    fn from(v: glam::Vec3) -> Self {
        Direction(v.to_array().map(Component))
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
            "'{}' is not a legal name: use 1 to 64 letters, digits, '-', '_' and '.', not beginning with '.'",
            name.escape_debug()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_short() {
        for (value, text) in [(0.03, "0.03"), (0.1, "0.1"), (1e-6, "1e-6"), (16_777_216.0, "16777216.0"), (0.0, "0.0")]
        {
            let value = Offset::<0, 1>(value);
            assert_eq!(serde_json::to_value(value).unwrap().to_string(), text);
            assert_eq!(serde_json::to_string(&value).unwrap(), text);
        }
    }

    #[test]
    fn numbers_read_back_to_the_last_bit() {
        for bits in (0..=u32::MAX).step_by(65_537) {
            let value = Offset::<0, 1>(f32::from_bits(bits));
            if value.0.is_finite() {
                let written = serde_json::to_value(value).unwrap().as_f64().unwrap();
                assert_eq!((written as f32).to_bits(), bits);
                let toml = toml::Value::try_from(value).unwrap().to_string();
                assert_eq!((toml.parse::<f64>().unwrap() as f32).to_bits(), bits, "{toml}");
            }
        }
    }
}
