//! A task's request as a body: its fields without those that name files, which the page may not choose.

use std::borrow::Cow;

use farnear_workflows::request::{self, Paths, Request};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, de::Error};
use serde_json::Map;

pub struct Options<R>(pub R);

impl<'de, R: Request> Deserialize<'de> for Options<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let fields = Map::deserialize(deserializer)?;
        request::parse(fields, Paths::Refused).map(Self).map_err(D::Error::custom)
    }
}

impl<R: Request> JsonSchema for Options<R> {
    fn schema_name() -> Cow<'static, str> {
        R::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        request::without_paths::<R>(R::json_schema(generator))
    }
}
