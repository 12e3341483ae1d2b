//! A small healthy plugin of each kind, and copies of it with one fault each. The fault is chosen
//! by the name under which the plugin is registered.

use std::sync::atomic::{AtomicU32, Ordering};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub mod controller;
pub mod detector;
pub mod filter;
pub mod verifier;

/// Valid settings.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Healthy {
    /// Does nothing.
    gain: f64,
}

/// Settings that print a key that they do not read.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Renamed {
    /// Does nothing.
    #[serde(rename(serialize = "gains"))]
    gain: f64,
}

/// Settings that accept unknown keys.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Tolerant {
    /// Does nothing.
    gain: f64,
}

#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Undocumented {
    gain: f64,
}

/// Returns another number for every plugin built: the fault `moody` makes output depend on it.
pub fn mood() -> f64 {
    static BUILT: AtomicU32 = AtomicU32::new(1);
    f64::from(BUILT.fetch_add(1, Ordering::Relaxed))
}

/// Registers `plugin` under `name`, with the general fault of that name if there is one.
macro_rules! register_with_fault {
    ($registry:expr, $kind:ident, $name:expr, $plugin:expr) => {{
        use tagalong_core::Error;
        let registry: &mut Registry = $registry;
        let name = $name;
        let plugin = $plugin;
        let summary = if name == "no-summary" { "" } else { "a test double" };
        match name {
            "cannot-build" => registry.$kind(name, summary, move |_: super::Healthy, _| {
                Some(plugin()).filter(|_| false).ok_or(Error::Other("needs a model".into()))
            }),
            "default-out-of-range" => {
                registry.$kind(name, summary, move |_: super::Renamed, _| Ok(plugin()));
            }
            "unknown-accepted" => {
                registry.$kind(name, summary, move |_: super::Tolerant, _| Ok(plugin()));
            }
            "undocumented" => {
                registry.$kind(name, summary, move |_: super::Undocumented, _| Ok(plugin()));
            }
            _ => registry.$kind(name, summary, move |_: super::Healthy, _| Ok(plugin())),
        }
    }};
}
pub(crate) use register_with_fault;
