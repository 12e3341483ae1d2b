//! Settings of each test of the funnel: those of the pipeline, and those that plugins register.

use serde::{Deserialize, Serialize};
use tagalong_config::{Kind, Registry};
use toml::{Table, Value};

use crate::outcome::Failure;
use crate::serialize::to_toml;

/// Table of the tests that are no plugin's.
const TABLE: &str = include_str!("remedies.toml");

/// Settings that a sentence names at most: a reader tries one or two.
const MOST_SETTINGS: usize = 2;

/// Remedy for the candidates that a test drops.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Remedy {
    /// Name of the test; one that ends in `*` is a prefix.
    pub test: String,
    /// Plugin that has the test and the settings; none for the pipeline's.
    #[serde(skip_serializing_if = "Option::is_none")]
    plugin: Option<String>,
    /// Keys of the settings.
    pub settings: Vec<String>,
    /// Advice on the test.
    pub look: String,
}

/// Setting that is worth a trial on any log.
#[derive(Clone, Debug)]
struct Offer {
    /// Plugin that has the setting; none for a section of the pipeline.
    plugin: Option<&'static str>,
    /// Key of the setting, or name of the section.
    setting: &'static str,
    /// Values to try.
    values: Vec<Value>,
}

/// Other value of a setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Dotted path in the resolved config.
    pub key: String,
    /// The value.
    pub value: Value,
    /// The line of a config that says so.
    pub line: String,
}

/// Remedies of the pipeline and of all plugins, and the settings that are worth a trial.
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
    /// Returns the remedies of the pipeline alone.
    fn default() -> Self {
        Self { drop: of_pipeline(), offers: Vec::new() }
    }
}

impl Remedies {
    /// Collects the remedies of the pipeline, and what the plugins offer.
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

    /// Returns the remedy for a test in a resolved config: that of a plugin that the config has, or else
    /// that of the pipeline.
    pub fn of_config(&self, test: &str, resolved: &Table) -> Option<&Remedy> {
        self.drop.get(self.place_of(test, resolved)?)
    }

    /// Returns the position of [`Remedies::of_config`] among all remedies.
    fn place_of(&self, test: &str, resolved: &Table) -> Option<usize> {
        let of_plugin = self.drop.iter().position(|remedy| {
            remedy.plugin.is_some()
                && remedy.is_for(test)
                && !remedy.settings_in(resolved).is_empty()
        });
        of_plugin.or_else(|| self.drop.iter().position(|remedy| remedy.is_for(test)))
    }

    /// Returns the sentence that says why a test dropped a person, and the settings that decide it, by
    /// which each page and `doctor` explain it. Settings are those of a resolved config, two at most.
    pub fn sentence(&self, test: &str, resolved: &Table) -> String {
        let decided = self.decided(test, resolved);
        format!("the test \"{test}\" dropped the candidate{decided}")
    }

    /// Returns the end of a sentence about a test: the settings that decide it, two at most, with the
    /// advice on it; empty for a test that nothing is known about.
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

    /// Returns the stage of a test in a resolved config: the candidates that it drops came nearer to a
    /// track than those of a lower stage. Tests of detectors come first, in the order of their tables;
    /// then those that no table has, those of the pipeline, and those of its other plugins.
    pub fn stage(&self, test: &str, resolved: &Table) -> usize {
        let all = self.drop.len();
        let Some(place) = self.place_of(test, resolved) else { return all };
        let plugin = self.drop[place].plugin.as_deref();
        let mut detectors = sections(resolved).filter(|section| section.name == "detectors");
        let is_detectors = plugin.is_some() && detectors.any(|one| one.plugin() == plugin);
        if is_detectors { place } else { all + 1 + place }
    }

    /// Returns the changes of a resolved config that are offered for its plugins; none of them has
    /// the present value.
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

/// Returns the section of a config that names the one plugin of a kind; `None` for kinds of which
/// there are several.
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
    /// Position in the list; none for a table that is no entry.
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
    /// Returns the name of its plugin, if it has one.
    pub(crate) fn plugin(&self) -> Option<&'a str> {
        self.table.get("plugin").and_then(Value::as_str)
    }

    /// Returns the value of a setting of its plugin.
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

    /// Returns the header that leads to the section; an entry of a list has its path instead.
    fn header(&self) -> String {
        match self.at {
            Some(_) => self.path(),
            None => format!("[{}]", self.name),
        }
    }
}

/// Returns a value as a number, if it is one.
pub fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// Returns true if a value, or each part of it that is given, is the present one.
pub fn is_present(value: &Value, now: &Value) -> bool {
    match (value, now) {
        (Value::Table(value), Value::Table(now)) => {
            value.iter().all(|(key, value)| now.get(key).is_some_and(|now| is_present(value, now)))
        }
        (value, now) => match (number(value), number(now)) {
            // Equal to more digits than a config is written with.
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
        // As in a config that extends this one.
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

/// Setting with its place in a config.
struct Setting {
    /// Header of the section, or the path of an entry.
    section: String,
    /// True where the section is an entry of a list.
    is_entry: bool,
    /// Plugin that has the setting; none for the pipeline's.
    plugin: Option<String>,
    /// Key and value.
    assignment: String,
}

impl Setting {
    /// Returns settings in the syntax of a config; those of one section and plugin are one line.
    fn in_words(settings: &[Self]) -> String {
        let lines = settings.chunk_by(|a, b| a.section == b.section && a.plugin == b.plugin);
        lines.map(Self::line).collect::<Vec<_>>().join(" and ")
    }

    /// Returns the line of settings of one section and plugin; those of an entry of a list as a config
    /// that extends this one changes them.
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
mod tests {
    use std::collections::BTreeSet;

    use tagalong_config::commented_defaults;
    use tagalong_core::TRACKER_TESTS;
    use tagalong_pipeline::PipelineSettings;

    use super::*;
    use crate::config_file::OuterSettings;

    fn keys(text: &str) -> impl Iterator<Item = String> {
        text.lines()
            .filter_map(|line| Some(line.trim_start_matches("# ").split_once(" =")?.0.to_owned()))
    }

    #[test]
    fn every_setting_of_a_remedy_exists() {
        let registry = tagalong_catalog::registry();
        let mut known: BTreeSet<String> = BTreeSet::new();
        registry.plugins().for_each(|plugin| known.extend(keys(&plugin.defaults())));
        known.extend(keys(&commented_defaults::<PipelineSettings>()));
        known.extend(keys(&commented_defaults::<OuterSettings>()));
        for remedy in Remedies::new(&registry).all() {
            let of_plugin = remedy.plugin.as_ref().map(|plugin| registry.find(plugin).unwrap());
            let own: BTreeSet<String> =
                of_plugin.map_or_else(BTreeSet::new, |plugin| keys(&plugin.defaults()).collect());
            for setting in &remedy.settings {
                let (_, key) = setting.split_once('.').unwrap_or(("", setting));
                assert!(known.contains(key), "{}: there is no `{setting}`", remedy.test);
            }
            // A test of a plugin may depend on a section of the config, too.
            let is_own = remedy.settings.iter().any(|setting| own.contains(setting));
            assert!(remedy.plugin.is_none() || is_own, "{}", remedy.test);
        }
    }

    #[test]
    fn every_offer_fits_its_plugin() {
        let registry = tagalong_catalog::registry();
        let remedies = Remedies::new(&registry);
        assert!(remedies.offers.len() > 2);
        for offer in &remedies.offers {
            let Some(plugin) = offer.plugin else { continue };
            let defaults: BTreeSet<String> =
                keys(&registry.find(plugin).unwrap().defaults()).collect();
            assert!(defaults.contains(offer.setting), "{offer:?}");
        }
    }

    #[test]
    fn a_plugin_from_outside_brings_its_remedies() {
        let mut registry = Registry::default();
        registry.remedies(
            "own",
            &[tagalong_config::Remedy { test: "too blue", settings: &["hue"], look: "the sky" }],
        );
        let remedies = Remedies::new(&registry);
        let resolved: Table =
            toml::from_str("[[detectors]]\nplugin = 'own'\nconfig = { hue = 3 }\n").unwrap();
        let lines = remedies.of("too blue").unwrap().lines(&resolved);
        assert_eq!(lines, ["detectors.0.config.hue = 3 (own)"]);
        assert!(Remedies::default().of("too blue").is_none());
    }

    #[test]
    fn a_sentence_names_the_test_its_meaning_and_two_settings_at_most() {
        let mut registry = Registry::default();
        registry.remedies(
            "own",
            &[tagalong_config::Remedy {
                test: "too blue",
                settings: &["a", "b", "c"],
                look: "the sky",
            }],
        );
        let remedies = Remedies::new(&registry);
        let config = "[[detectors]]\nplugin = 'own'\nconfig = { a = 1, b = 2, c = 3 }\n";
        let resolved: Table = toml::from_str(config).unwrap();
        assert_eq!(
            remedies.sentence("too blue", &resolved),
            "the test \"too blue\" dropped the candidate; decided by detectors.0.config = \
             { a = 1, b = 2 } (own) and 1 more: the sky"
        );
        let without = remedies.sentence("too blue", &Table::new());
        assert!(without.ends_with("; no setting decides it: the sky"), "{without}");
        assert_eq!(
            remedies.sentence("unknown", &resolved),
            "the test \"unknown\" dropped the candidate"
        );
    }

    #[test]
    fn each_manager_names_its_settings_for_a_track_that_is_not_confirmed() {
        let remedies = Remedies::new(&tagalong_catalog::registry());
        let sprt: Table = toml::from_str(
            "[manager]\nplugin = 'manage-sprt'\n[manager.config]\ntentative_misses = 2\n\
             confirm_log_odds = 4.6\n",
        )
        .unwrap();
        let told = remedies.sentence("track: not confirmed", &sprt);
        assert!(told.contains("{ tentative_misses = 2, confirm_log_odds = 4.6 }"), "{told}");
        let m_of_n: Table = toml::from_str(
            "[manager]\nplugin = 'manage-m-of-n'\n[manager.config]\ntentative_misses = 2\n\
             confirm_hits = 3\n",
        )
        .unwrap();
        let told = remedies.sentence("track: not confirmed", &m_of_n);
        assert!(told.contains("{ tentative_misses = 2, confirm_hits = 3 }"), "{told}");
    }

    #[test]
    fn stages_are_in_the_order_in_which_a_candidate_passes_the_tests() {
        let remedies = Remedies::new(&tagalong_catalog::registry());
        let config: Table = toml::from_str(
            "[[detectors]]\nplugin = 'depth-template'\n[detectors.config]\nmin_body = 0.5\n\
             discover_cost = 0.2\nfollow_radius_m = 1.0\n[manager]\nplugin = 'manage-sprt'\n\
             [manager.config]\nmax_clutter = 1.0\nstart_score = 0.5\n",
        )
        .expect("a config");
        let order =
            ["body below", "search window", "template cost", "unknown", "gate", "score", "clutter"];
        let stages = order.map(|test| remedies.stage(test, &config));
        assert!(stages.is_sorted_by(|a, b| a < b), "{stages:?}");
    }

    #[test]
    fn no_change_is_to_the_present_value() {
        let resolved: Table = toml::from_str(
            "[manager]\nplugin = 'manage-sprt'\n[manager.config]\nend_log_odds = -2.0\n\
             [[detectors]]\nplugin = 'depth-template'\n[detectors.config]\nmin_head_height_m = 1\ndiscover_cost = 0.2\n",
        )
        .unwrap();
        let offered = Remedies::new(&tagalong_catalog::registry()).offered(&resolved);
        let lines: Vec<String> = offered.into_iter().map(|change| change.line).collect();
        assert!(!lines.iter().any(|line| line.contains("manage-sprt")), "{lines:?}");
        assert!(!lines.iter().any(|line| line.contains("min_head_height_m")), "{lines:?}");
        let costs: Vec<&String> =
            lines.iter().filter(|line| line.contains("discover_cost")).collect();
        assert!(!costs.is_empty(), "{lines:?}");
        assert!(!costs.iter().any(|line| line.contains("= 0.2 ")), "{costs:?}");
        let other: Table = toml::from_str("[manager]\nplugin = 'm'\n").unwrap();
        let offered = Remedies::new(&tagalong_catalog::registry()).offered(&other);
        assert_eq!(offered[0].line, "[manager] plugin = \"manage-sprt\"");
    }

    #[test]
    fn changes_are_lines_of_a_config() {
        let resolved: Table =
            toml::from_str("[manager]\nplugin = 'm'\n[[detectors]]\nplugin = 'd'\n").unwrap();
        let sprt = Value::Table(toml::from_str("plugin = 'manage-sprt'").unwrap());
        for (key, value, line) in [
            ("manager.config.hits", 3.into(), "[manager.config] hits = 3"),
            ("detectors.0.config.cost", 0.2.into(), "detectors.0.config.cost = 0.2 # d"),
            ("manager", sprt, "[manager] plugin = \"manage-sprt\""),
        ] {
            assert_eq!(Change::of(&resolved, key, &value).line, line);
        }
    }

    /// A detector with such a test would get the advice for the tracker's.
    #[test]
    fn detectors_must_not_take_the_names_of_tests_of_the_tracker() {
        for remedy in Remedies::default().all() {
            // Two parts are of one stage, which the first names; `occupied` is a test of detectors.
            let is_of_tracker = !remedy.test.contains(':') && remedy.test != "occupied";
            let is_known = TRACKER_TESTS.contains(&remedy.test.as_str());
            assert_eq!(is_known, is_of_tracker, "{}", remedy.test);
        }
    }

    #[test]
    fn settings_are_shown_where_they_stand() {
        let resolved: Table = toml::from_str(
            "seed = 1\n[manager]\nplugin = 'm'\n[manager.config]\nstart_score = 0.5\n[[verifiers]]\nplugin = 'a'\n\
             [verifiers.config]\nweight = 2.0\n",
        )
        .unwrap();
        let remedies = Remedies::default();
        let lines = remedies.of("verifier").unwrap().lines(&resolved);
        assert_eq!(
            lines,
            [
                "[manager] plugin = \"m\", config = { start_score = 0.5 }",
                "verifiers.0.config.weight = 2.0 (a)"
            ]
        );
        assert_eq!(remedies.of("stereo pixels: speckle").unwrap().test, "stereo pixels: *");
        assert!(remedies.of("something new").is_none());
    }
}
