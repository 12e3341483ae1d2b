use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// `camera` under `[input]`: the name of a camera, or a table with its pose.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CameraSettings {
    /// Prefix that the topics of the camera share.
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

/// Visitor for either form, which keeps the messages about errors in the table.
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

/// Pose of a camera above the robot's origin that looks forward.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MountSettings {
    /// Camera whose images are used, if there are several: the prefix that its topics share.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Height above the floor, m.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 100))]
    pub height_m: f64,
    /// Angle of the optical axis below the horizon, degrees.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub pitch_down_deg: f64,
    /// Roll, degrees; positive if the camera's right side is raised.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub roll_deg: f64,
}

impl MountSettings {
    /// Returns the pose as that of the camera with this name.
    pub fn with_name(self, name: &str) -> Self {
        Self { name: Some(name.to_owned()), ..self }
    }
}
