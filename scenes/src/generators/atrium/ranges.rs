//! Numbers of the atrium that know their range, so that the TOML reader reports
//! a bad value with its line and column.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::borrow::Cow;

/// A whole number from `MIN` to `MAX`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Whole<const MIN: u32, const MAX: u32>(pub u32);

impl<'de, const MIN: u32, const MAX: u32> Deserialize<'de> for Whole<MIN, MAX> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let value = i64::deserialize(d)?;
        match u32::try_from(value) {
            Ok(v) if (MIN..=MAX).contains(&v) => Ok(Self(v)),
            _ => Err(D::Error::custom(format!("{value} is out of range: it must be from {MIN} to {MAX}"))),
        }
    }
}

impl<const MIN: u32, const MAX: u32> JsonSchema for Whole<MIN, MAX> {
    fn schema_name() -> Cow<'static, str> {
        format!("WholeFrom{MIN}To{MAX}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": MIN, "maximum": MAX })
    }
}

/// A length in metres, from `MIN` to `MAX` millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Span<const MIN: u32, const MAX: u32>(pub f32);

impl<'de, const MIN: u32, const MAX: u32> Deserialize<'de> for Span<MIN, MAX> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(d)?;
        let [min, max] = [MIN, MAX].map(|mm| f64::from(mm) / 1e3);
        if (min..=max).contains(&value) {
            return Ok(Self(value as f32));
        }
        Err(D::Error::custom(format!("{value} is out of range: it must be from {min} to {max} m")))
    }
}

impl<const MIN: u32, const MAX: u32> JsonSchema for Span<MIN, MAX> {
    fn schema_name() -> Cow<'static, str> {
        format!("SpanFrom{MIN}To{MAX}Millimetres").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "minimum": f64::from(MIN) / 1e3, "maximum": f64::from(MAX) / 1e3 })
    }
}
