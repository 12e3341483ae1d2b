use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Error as _, IntoDeserializer, value};
use serde::{Deserialize, Serialize, Serializer};

/// Word for [`OrAuto::Auto`].
const AUTO: &str = "auto";

/// Setting that is one of the words of `T`, or `auto`.
///
/// ```
/// use serde::{Deserialize, Serialize};
/// use tagalong_config::OrAuto;
///
/// #[derive(Debug, PartialEq, Serialize, Deserialize)]
/// #[serde(rename_all = "kebab-case")]
/// enum Order {
///     Rgb,
///     Bgr,
/// }
///
/// #[derive(Deserialize)]
/// struct Settings {
///     order: OrAuto<Order>,
/// }
///
/// let order = |text| toml::from_str::<Settings>(text).map(|settings| settings.order.chosen());
/// assert_eq!(order("order = 'auto'").unwrap(), None);
/// assert_eq!(order("order = 'bgr'").unwrap(), Some(Order::Bgr));
/// assert!(order("order = 'grb'").unwrap_err().message().contains("`rgb` or `bgr`, or `auto`"));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OrAuto<T> {
    /// The value follows from something else.
    #[default]
    Auto,
    /// The value is set.
    Chosen(T),
}

impl<T> OrAuto<T> {
    /// Returns the value if it is set.
    pub fn chosen(self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::Chosen(value) => Some(value),
        }
    }
}

impl<T: Serialize> Serialize for OrAuto<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str(AUTO),
            Self::Chosen(value) => value.serialize(serializer),
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for OrAuto<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        if word == AUTO {
            return Ok(Self::Auto);
        }
        let chosen = T::deserialize(word.into_deserializer());
        chosen.map(Self::Chosen).map_err(|why: value::Error| {
            // The error lists the words of `T` only.
            D::Error::custom(format_args!("{why}, or `{AUTO}`"))
        })
    }
}

impl<T: JsonSchema> JsonSchema for OrAuto<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("OrAuto_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let auto = json_schema!({
            "const": AUTO,
            "description": "The value follows from something else.",
        });
        json_schema!({ "anyOf": [auto, generator.subschema_for::<T>()] })
    }
}
