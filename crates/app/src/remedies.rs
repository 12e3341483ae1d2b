//! Settings of each test of the funnel: those of the pipeline, and those that plugins register.

use serde::{Deserialize, Serialize};
use tagalong_config::{Kind, Registry};
use toml::{Table, Value};

use crate::frame_notes::MeasuredValue;
use crate::outcome::Failure;
use crate::serialize::to_toml;

/// Table of the tests that do not belong to a plugin.
const TABLE: &str = include_str!("remedies.toml");

/// Maximum number of settings in a sentence, because a reader tries one or two.
const MOST_SETTINGS: usize = 2;

/// Largest rounding error of a noted value; a score has the largest.
const ROUNDING: f64 = 0.0005;

/// Remedy for the candidates that a test drops.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Remedy {
    /// Name of the test; one that ends in `*` is a prefix.
    pub test: String,
    /// Plugin that has the test and the settings; `None` for those of the pipeline.
    #[serde(skip_serializing_if = "Option::is_none")]
    plugin: Option<String>,
    /// Keys of the settings.
    pub settings: Vec<String>,
    /// Advice on the test.
    pub look: String,
}

/// Setting that is worth trying on any log.
#[derive(Clone, Debug)]
struct Offer {
    /// Plugin that has the setting; `None` for a section of the pipeline.
    plugin: Option<&'static str>,
    /// Key of the setting, or name of the section.
    setting: &'static str,
    /// Values to try.
    values: Vec<Value>,
}

/// Change of a setting to another value.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Dotted path in the resolved config.
    pub key: String,
    /// The value.
    pub value: Value,
    /// The corresponding line of a config.
    pub line: String,
}

/// Remedies of the pipeline and of all plugins, and the settings that are worth trying.
#[derive(Clone, Debug)]
pub struct Remedies {
    drop: Vec<Remedy>,
    offers: Vec<Offer>,
}

#[derive(Deserialize, Serialize)]
struct File {
    drop: Vec<Remedy>,
}

#[expect(clippy::expect_used, reason = "the table is part of the program, and a test reads it")]
fn of_pipeline() -> Vec<Remedy> {
    toml::from_str::<File>(TABLE).expect("the built-in table is right").drop
}

impl Default for Remedies {
    /// Returns only the remedies of the pipeline.
    fn default() -> Self {
        Self { drop: of_pipeline(), offers: Vec::new() }
    }
}

impl Remedies {
    /// Collects the remedies of the pipeline and those of the plugins.
    pub fn new(registry: &Registry) -> Self {
        let of_plugins = registry.all_remedies().map(|(plugin, remedy)| Remedy {
            test: remedy.test.to_owned(),
            plugin: Some(plugin.to_owned()),
            settings: remedy.settings.iter().map(ToString::to_string).collect(),
            look: remedy.look.to_owned(),
        });
        let sections = registry.alternatives().filter_map(|plugin| {
            let value = Table::from_iter([("plugin".to_owned(), Value::from(plugin.name))]);
            let setting = section_of(plugin.kind)?;
            Some(Offer { plugin: None, setting, values: vec![value.into()] })
        });
        let settings = registry.all_trial_values().map(|(plugin, trial)| Offer {
            plugin: Some(plugin),
            setting: trial.setting,
            values: trial.values.iter().map(|value| Value::from(*value)).collect(),
        });
        Self {
            drop: of_pipeline().into_iter().chain(of_plugins).collect(),
            offers: sections.chain(settings).collect(),
        }
    }

    /// Returns all remedies: those of the pipeline in the order of its stages, then those of each
    /// plugin.
    pub fn all(&self) -> &[Remedy] {
        &self.drop
    }

    /// Returns the remedy for a test, if there is one.
    pub fn of(&self, test: &str) -> Option<&Remedy> {
        self.drop.iter().find(|remedy| remedy.is_for(test))
    }

    /// Returns the remedy for a test in a resolved config: that of a plugin in the config, or
    /// otherwise that of the pipeline.
    pub fn of_config(&self, test: &str, resolved: &Table) -> Option<&Remedy> {
        self.drop.get(self.place_of(test, resolved)?)
    }

    /// Returns the index of the remedy of [`Remedies::of_config`] among all remedies.
    fn place_of(&self, test: &str, resolved: &Table) -> Option<usize> {
        let of_plugin = self.drop.iter().position(|remedy| {
            remedy.plugin.is_some()
                && remedy.is_for(test)
                && !remedy.settings_in(resolved).is_empty()
        });
        of_plugin.or_else(|| self.drop.iter().position(|remedy| remedy.is_for(test)))
    }

    /// Returns the sentence that explains why a test dropped a person, with the settings of the
    /// test; every page and `doctor` use it. The settings are those of a resolved config, at most
    /// two.
    pub fn sentence(&self, test: &str, resolved: &Table) -> String {
        let decided = self.decided(test, resolved);
        format!("the test \"{test}\" dropped the candidate{decided}")
    }

    /// Returns the sentence about a candidate whose value is known: the value compared with its
    /// limits, and the settings with which it would pass the test, at most two.
    pub fn sentence_measured(
        &self,
        test: &str,
        measured: &MeasuredValue,
        resolved: &Table,
    ) -> String {
        let Some(remedy) = self.of_config(test, resolved) else {
            return format!("{}, {}", self.sentence(test, resolved), measured.in_words());
        };
        let mut passing: Vec<Setting> = Vec::new();
        for (at, (key, limit)) in measured.limits.iter().enumerate() {
            let section = sections(resolved).find(|section| remedy.has_limit(section, key, *limit));
            let found = section.and_then(|section| {
                let now = section.setting(key)?;
                Some(Setting {
                    section: section.header(),
                    is_entry: section.at.is_some(),
                    plugin: section.plugin().map(ToOwned::to_owned),
                    assignment: format!("{key} = {}", passing_value(measured, at, now)),
                })
            });
            passing.extend(found);
        }
        passing.truncate(MOST_SETTINGS);
        let decided = if passing.is_empty() {
            self.decided(test, resolved)
        } else {
            format!("; it passes with {}: {}", Setting::in_words(&passing), remedy.look)
        };
        format!("the test \"{test}\" dropped the candidate, {}{decided}", measured.in_words())
    }

    /// Returns the end of a sentence about a test: its settings, at most two, with the advice on
    /// it; empty for a test about which nothing is known.
    pub fn decided(&self, test: &str, resolved: &Table) -> String {
        let Some(remedy) = self.of_config(test, resolved) else { return String::new() };
        let mut found = remedy.settings_in(resolved);
        let further = found.len().saturating_sub(MOST_SETTINGS);
        found.truncate(MOST_SETTINGS);
        let settings = if found.is_empty() {
            "no setting decides it".to_owned()
        } else {
            let further = match further {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            format!("decided by {}{further}", Setting::in_words(&found))
        };
        format!("; {settings}: {}", remedy.look)
    }

    /// Returns the stage of a test in a resolved config: candidates that are dropped in a later
    /// stage came closer to a track. Tests of detectors come first, in the order of their tables;
    /// then those that no table contains, those of the pipeline, and those of its other plugins.
    pub fn stage(&self, test: &str, resolved: &Table) -> usize {
        let all = self.drop.len();
        let Some(place) = self.place_of(test, resolved) else { return all };
        let plugin = self.drop[place].plugin.as_deref();
        let mut detectors = sections(resolved).filter(|section| section.name == "detectors");
        let is_detectors = plugin.is_some() && detectors.any(|one| one.plugin() == plugin);
        if is_detectors { place } else { all + 1 + place }
    }

    /// Returns the changes of a resolved config that its plugins offer; none of them has the
    /// present value.
    pub fn offered(&self, resolved: &Table) -> Vec<Change> {
        self.offers.iter().flat_map(|offer| offer.changes(resolved)).collect()
    }

    /// Returns the remedies as TOML.
    pub fn toml(&self) -> Result<String, Failure> {
        to_toml("the remedies", &File { drop: self.drop.clone() })
    }

    /// Returns the remedies as a table in Markdown.
    pub fn markdown(&self) -> String {
        let mut out = String::from("| test in the funnel | settings | look at |\n|---|---|---|\n");
        for remedy in &self.drop {
            let settings: Vec<String> =
                remedy.settings.iter().map(|key| format!("`{key}`")).collect();
            let test = remedy.test.replace('*', "...");
            let of = remedy.plugin.as_ref().map(|plugin| format!(" of `{plugin}`"));
            let of = of.unwrap_or_default();
            out += &format!("| {test} | {}{of} | {} |\n", settings.join(", "), remedy.look);
        }
        out
    }
}

/// Returns the section of a config for the plugin of a kind; `None` for kinds with several plugins.
fn section_of(kind: Kind) -> Option<&'static str> {
    match kind {
        Kind::Associator => Some("associator"),
        Kind::Filter => Some("filter"),
        Kind::Manager => Some("manager"),
        Kind::Controller => Some("controller"),
        Kind::Detector | Kind::Verifier => None,
    }
}

impl Offer {
    fn changes(&self, resolved: &Table) -> Vec<Change> {
        let keys = match self.plugin {
            Some(plugin) => keys_of(resolved, plugin, self.setting),
            None => vec![(self.setting.to_owned(), resolved.get(self.setting))],
        };
        let with_values = keys.iter().filter_map(|(key, now)| Some((key, (*now)?)));
        let pairs = with_values.flat_map(|(key, now)| {
            let others = self.values.iter().filter(move |value| !is_present(value, now));
            others.map(move |value| Change::of(resolved, key, value))
        });
        pairs.collect()
    }
}

/// Returns the dotted paths of a setting of a plugin, with the present values.
fn keys_of<'a>(
    resolved: &'a Table,
    plugin: &str,
    setting: &str,
) -> Vec<(String, Option<&'a Value>)> {
    let mut keys = Vec::new();
    for section in sections(resolved).filter(|section| section.plugin() == Some(plugin)) {
        keys.push((format!("{}.config.{setting}", section.path()), section.setting(setting)));
    }
    keys
}

/// Section of a resolved config: a table, or an entry of a list of tables.
pub(crate) struct Section<'a> {
    pub(crate) name: &'a str,
    /// Index in the list; `None` for a table that is not in a list.
    at: Option<usize>,
    table: &'a Table,
}

/// Returns the sections of a resolved config in its order.
pub(crate) fn sections(resolved: &Table) -> impl Iterator<Item = Section<'_>> {
    resolved.iter().flat_map(|(name, value)| {
        let entries = value.as_array().into_iter().flatten().enumerate();
        let entries = entries.map(|(at, entry)| (Some(at), entry));
        let all = std::iter::once((None, value)).chain(entries);
        all.filter_map(|(at, value)| Some(Section { name, at, table: value.as_table()? }))
    })
}

impl<'a> Section<'a> {
    /// Returns the name of the section's plugin, if it has one.
    pub(crate) fn plugin(&self) -> Option<&'a str> {
        self.table.get("plugin").and_then(Value::as_str)
    }

    /// Returns the value of a setting of the section's plugin.
    pub(crate) fn setting(&self, key: &str) -> Option<&'a Value> {
        self.table.get("config")?.get(key)
    }

    /// Returns the dotted path, for example `manager` or `detectors.0`.
    pub(crate) fn path(&self) -> String {
        match self.at {
            Some(at) => format!("{}.{at}", self.name),
            None => self.name.to_owned(),
        }
    }

    /// Returns the header of the section; for an entry of a list its path instead.
    fn header(&self) -> String {
        match self.at {
            Some(_) => self.path(),
            None => format!("[{}]", self.name),
        }
    }
}

/// Returns the largest depth at which the detectors of a resolved config look for people, m; `None`
/// if none has such a limit.
pub fn reach_m(resolved: &Table) -> Option<f64> {
    let detectors = sections(resolved).filter(|section| section.name == "detectors");
    let limits = detectors.filter_map(|section| section.setting("max_depth_m").and_then(number));
    limits.reduce(f64::max)
}

/// Returns the value of the setting of a limit with which a candidate would pass, to a hundredth.
/// Of several limits that the value is below, each is a hundredth lower than the one before it.
fn passing_value(measured: &MeasuredValue, at: usize, now: &Value) -> Value {
    let is_above = measured.is_above(measured.limits[at].1);
    if now.is_integer() {
        let passing = measured.value.floor() as i64;
        return Value::from(if is_above { passing + 1 } else { passing });
    }
    if is_above {
        return Value::from(((measured.value * 100.0).floor() + 1.0) / 100.0);
    }
    let below = ((measured.value - ROUNDING) * 100.0).floor() - at as f64;
    // The limit of a share or of a width is not negative.
    let least = if measured.value < 0.0 { f64::NEG_INFINITY } else { 0.0 };
    Value::from(below.max(least) / 100.0)
}

/// Returns a value as a number, if it is one.
pub fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// Returns true if a value, or each part of it that is given, equals the present one.
pub fn is_present(value: &Value, now: &Value) -> bool {
    match (value, now) {
        (Value::Table(value), Value::Table(now)) => {
            value.iter().all(|(key, value)| now.get(key).is_some_and(|now| is_present(value, now)))
        }
        (value, now) => match (number(value), number(now)) {
            // Equal to more digits than are written in a config.
            (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * a.abs().max(1.0),
            _ => value == now,
        },
    }
}

impl Change {
    /// Describes another value of a setting by its dotted path in a resolved config.
    pub fn of(resolved: &Table, key: &str, value: &Value) -> Self {
        let line = line(resolved, key, value);
        Self { key: key.to_owned(), value: value.clone(), line }
    }
}

/// Returns the line of a config for a setting.
fn line(resolved: &Table, key: &str, value: &Value) -> String {
    let parts: Vec<&str> = key.split('.').collect();
    match parts[..] {
        // Written as in a config that extends this one.
        [section, at, "config", ref rest @ ..] if at.parse::<usize>().is_ok() => {
            let item = at.parse::<usize>().ok().and_then(|at| resolved.get(section)?.get(at));
            let plugin = item.and_then(|item| item.get("plugin")).and_then(Value::as_str);
            let plugin = plugin.unwrap_or_default();
            let rest = rest.join(".");
            format!("{section}.{at}.config.{rest} = {value} # {plugin}")
        }
        [section] => match value.as_table() {
            Some(table) => {
                let settings: Vec<String> =
                    table.iter().map(|(key, value)| format!("{key} = {value}")).collect();
                format!("[{section}] {}", settings.join(", "))
            }
            None => format!("{section} = {value}"),
        },
        [ref sections @ .., setting] => format!("[{}] {setting} = {value}", sections.join(".")),
        [] => String::new(),
    }
}

impl Remedy {
    fn is_for(&self, test: &str) -> bool {
        self.test
            .strip_suffix('*')
            .map_or(self.test == test, |beginning| test.starts_with(beginning))
    }

    /// Returns true for a section that has a setting with this value and, if the remedy has a
    /// plugin, belongs to that plugin.
    fn has_limit(&self, section: &Section<'_>, key: &str, limit: f64) -> bool {
        let is_own = self.plugin.is_none() || self.plugin.as_deref() == section.plugin();
        let now = section.setting(key).filter(|_| is_own);
        now.is_some_and(|now| is_present(&Value::from(limit), now))
    }

    /// Returns the settings with their sections in a resolved config, and their values.
    pub fn lines(&self, resolved: &Table) -> Vec<String> {
        self.settings_in(resolved)
            .iter()
            .map(|one| Setting::line(std::slice::from_ref(one)))
            .collect()
    }

    /// Returns the settings in the order of the sections.
    fn settings_in(&self, resolved: &Table) -> Vec<Setting> {
        sections(resolved).flat_map(|section| self.settings_of(&section)).collect()
    }

    /// Returns the settings in one section: its own keys, or those of its plugin.
    fn settings_of(&self, section: &Section<'_>) -> Vec<Setting> {
        let plugin = section.plugin();
        if plugin.is_some() && self.plugin.is_some() && self.plugin.as_deref() != plugin {
            return Vec::new();
        }
        let mut found = Vec::new();
        for setting in &self.settings {
            let (place, key) = setting.split_once('.').unwrap_or(("", setting));
            if !place.is_empty() && (section.at.is_some() || section.name != place) {
                continue;
            }
            let value = match plugin {
                Some(_) => section.setting(key),
                None => section.table.get(key),
            };
            found.extend(value.map(|value| Setting {
                section: section.header(),
                is_entry: section.at.is_some(),
                plugin: plugin.map(ToOwned::to_owned),
                assignment: format!("{key} = {value}"),
            }));
        }
        found
    }
}

/// Setting with its position in a config.
struct Setting {
    /// Header of the section, or the path of an entry.
    section: String,
    /// True if the section is an entry of a list.
    is_entry: bool,
    /// Plugin that has the setting; `None` for a setting of the pipeline.
    plugin: Option<String>,
    /// Key and value.
    assignment: String,
}

impl Setting {
    /// Returns settings in the syntax of a config; those of the same section and plugin are on one
    /// line.
    fn in_words(settings: &[Self]) -> String {
        let lines = settings.chunk_by(|a, b| a.section == b.section && a.plugin == b.plugin);
        lines.map(Self::line).collect::<Vec<_>>().join(" and ")
    }

    /// Returns the line with settings of one section and plugin; for an entry of a list, written as
    /// in a config that extends this one.
    fn line(settings: &[Self]) -> String {
        let Some(Self { section, is_entry, plugin, .. }) = settings.first() else {
            return String::new();
        };
        let values: Vec<&str> = settings.iter().map(|one| one.assignment.as_str()).collect();
        match (plugin, is_entry) {
            (Some(plugin), true) => {
                let values = match values[..] {
                    [value] => format!(".{value}"),
                    _ => format!(" = {{ {} }}", values.join(", ")),
                };
                format!("{section}.config{values} ({plugin})")
            }
            (Some(plugin), false) => {
                format!("{section} plugin = \"{plugin}\", config = {{ {} }}", values.join(", "))
            }
            (None, _) => format!("{section} {}", values.join(" and ")),
        }
    }
}

#[cfg(test)]
mod tests;
