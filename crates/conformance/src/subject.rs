use std::path::Path;

use tagalong_config::{ConfigError, Context, PluginInfo, Registry, Value};
use tagalong_core::{Associator, Controller, Detector, DiffDrive, Filter, TrackManager, Verifier};
use toml::de::{DeTable, DeValue};

/// The drive that is used in checks of controllers.
pub(crate) const WHEELS: DiffDrive = DiffDrive { half_separation_m: 0.167, slip: 0.02 };

/// The plugin under test, with everything that is needed to build it.
pub(crate) struct Subject<'a> {
    pub(crate) registry: &'a Registry,
    pub(crate) info: &'a PluginInfo,
    pub(crate) base_dir: &'a Path,
    pub(crate) must_discover: bool,
    pub(crate) must_follow: bool,
}

/// Source of the settings for building the plugin.
#[derive(Clone, Copy)]
pub(crate) enum From<'t> {
    /// No `config` table at all.
    Nothing,
    /// A `config` table with this text.
    Text(&'t str),
}

impl Subject<'_> {
    pub(crate) fn detector(&self, from: From<'_>) -> Result<Box<dyn Detector>, String> {
        self.build(from, |value, context| {
            self.registry.build_detector(self.info.name, value, context)
        })
    }

    pub(crate) fn verifier(&self, from: From<'_>) -> Result<Box<dyn Verifier>, String> {
        self.build(from, |value, context| {
            self.registry.build_verifier(self.info.name, value, context)
        })
    }

    pub(crate) fn associator(&self, from: From<'_>) -> Result<Box<dyn Associator>, String> {
        self.build(from, |value, context| {
            self.registry.build_associator(self.info.name, value, context)
        })
    }

    pub(crate) fn manager(&self, from: From<'_>) -> Result<Box<dyn TrackManager>, String> {
        self.build(from, |value, context| {
            self.registry.build_manager(self.info.name, value, context)
        })
    }

    pub(crate) fn filter(&self, from: From<'_>) -> Result<Box<dyn Filter>, String> {
        self.build(from, |value, context| {
            self.registry.build_filter(self.info.name, value, context)
        })
    }

    pub(crate) fn controller(&self, from: From<'_>) -> Result<Box<dyn Controller>, String> {
        self.build(from, |value, context| {
            self.registry.build_controller(self.info.name, value, context)
        })
    }

    /// Builds the plugin and drops it.
    pub(crate) fn try_build(&self, from: From<'_>) -> Result<(), String> {
        use tagalong_config::Kind::{Associator, Controller, Detector, Filter, Manager, Verifier};
        match self.info.kind {
            Detector => self.detector(from).map(drop),
            Verifier => self.verifier(from).map(drop),
            Associator => self.associator(from).map(drop),
            Filter => self.filter(from).map(drop),
            Manager => self.manager(from).map(drop),
            Controller => self.controller(from).map(drop),
        }
    }

    fn build<P>(
        &self,
        from: From<'_>,
        build: impl Fn(Option<Value<'_>>, &Context) -> Result<P, ConfigError>,
    ) -> Result<P, String> {
        let context = Context::new(7, self.base_dir.to_owned(), WHEELS);
        let value = match from {
            From::Nothing => None,
            From::Text(text) => Some(table(text)?),
        };
        build(value, &context).map_err(|error| error.to_string())
    }
}

fn table(text: &str) -> Result<Value<'_>, String> {
    let table = DeTable::parse(text).map_err(|error| error.to_string())?;
    Ok(toml::Spanned::new(table.span(), DeValue::Table(table.into_inner())))
}
