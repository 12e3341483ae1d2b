/// Defines settings: a struct with the default of each field beside it.
///
/// A field without one has the default of its type. The struct implements `Clone`, `Debug`,
/// `Default`, `PartialEq`, and the traits of `serde` and `schemars` (on which the calling crate
/// depends) by which a config is read: keys that it leaves out have their defaults, keys that are
/// not known are refused.
///
/// ```
/// tagalong_core::settings! {
///     /// Settings of a laser scanner.
///     pub struct LaserSettings {
///         /// Height above the floor, m.
///         #[schemars(range(min = 0.0))]
///         pub height_m: f64 = 0.4,
///         /// Topic; the only scanner if left out.
///         pub topic: Option<String>,
///     }
/// }
///
/// assert_eq!(LaserSettings::default(), LaserSettings { height_m: 0.4, topic: None });
/// let higher: LaserSettings = serde_json::from_str(r#"{ "height_m": 0.9 }"#)?;
/// assert_eq!(higher, LaserSettings { height_m: 0.9, topic: None });
/// assert!(serde_json::from_str::<LaserSettings>(r#"{ "hight_m": 0.9 }"#).is_err());
/// # Ok::<(), serde_json::Error>(())
/// ```
#[macro_export]
macro_rules! settings {
    (
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident {
            $($(#[$of_field:meta])* $field_visibility:vis $field:ident: $type:ty $(= $default:expr)?),*
            $(,)?
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Debug, PartialEq, ::serde::Serialize, ::serde::Deserialize, ::schemars::JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        $visibility struct $name {
            $($(#[$of_field])* $field_visibility $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $crate::settings!(@$($default)?),)* }
            }
        }
    };
    (@$default:expr) => { $default };
    (@) => { Default::default() };
}
