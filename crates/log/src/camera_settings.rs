use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::MountSettings;

/// `camera` under `[input]`: the name of one, or a table with its pose.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraSettings {
    /// Folder that the topics of the camera share.
    Named(String),
    /// Pose of the camera on the robot.
    Mounted(MountSettings),
}

impl Serialize for CameraSettings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Named(name) => serializer.serialize_str(name),
            Self::Mounted(mount) => mount.serialize(serializer),
        }
    }
}

/// Reader of either form, which keeps the messages about mistakes in the table.
struct EitherForm;

impl<'de> Visitor<'de> for EitherForm {
    type Value = CameraSettings;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a camera, or a table with its pose")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<CameraSettings, E> {
        Ok(CameraSettings::Named(name.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CameraSettings, A::Error> {
        MountSettings::deserialize(MapAccessDeserializer::new(map)).map(CameraSettings::Mounted)
    }
}

impl<'de> Deserialize<'de> for CameraSettings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(EitherForm)
    }
}

impl JsonSchema for CameraSettings {
    fn schema_name() -> Cow<'static, str> {
        "CameraSettings".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "anyOf": [generator.subschema_for::<MountSettings>(), { "type": "string" }],
        })
    }
}
