//! `[tune]`: the settings of a config that may be fitted, and the values to try for each.

use std::ops::Range;

use serde::Deserialize;
use tagalong_config::{ConfigError, Registry, Value, nearest};
use toml::de::{DeArray, DeValue};

use super::{BuildError, OWN, Options, PLUGINS};
use crate::Pipeline;

/// Name of the table.
pub(super) const TABLE: &str = "tune";

/// Most values of one setting.
const MAX_VALUES: usize = 64;

/// Setting that may be fitted, with the values to try.
#[derive(Clone, Debug, PartialEq)]
pub struct Tunable {
    /// Dotted path in the config: `manager.config.confirm_hits`, `detectors.0.config.min_cells`.
    pub key: String,
    /// Value in the config.
    pub now: toml::Value,
    /// Values to try, in the order of the config.
    pub values: Vec<toml::Value>,
    /// Span of each value in the text.
    pub places: Vec<Range<usize>>,
}

/// Equally spaced values, as a config writes them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Spread {
    between: [f64; 2],
    steps: usize,
}

/// Setting of the config, by its dotted path.
type Leaf<'a> = (String, &'a toml::Value);

/// Reads `[tune]`. `resolved` is the config with every default.
pub(super) fn read(
    table: Option<Value<'_>>,
    resolved: &toml::Table,
) -> Result<Vec<Tunable>, ConfigError> {
    let Some(table) = table else { return Ok(Vec::new()) };
    let mut named = Vec::new();
    flatten(String::new(), table, &mut named);
    let leaves = leaves_of(resolved);
    named.into_iter().map(|(key, value)| tunable(key, value, &leaves)).collect()
}

impl Pipeline {
    /// Builds the pipeline with each value of each setting of `[tune]` in turn, the others unchanged.
    ///
    /// # Errors
    /// A value that the setting does not allow, with its line in the config.
    pub fn check_tuning(&self, registry: &Registry) -> Result<(), BuildError> {
        let config = &self.config;
        self.check_values(registry)
            .map_err(|error| config.source.mistake(&config.document.locate(error)))
    }

    fn check_values(&self, registry: &Registry) -> Result<(), ConfigError> {
        let config = &self.config;
        let options = Options { foreign: config.foreign.clone(), ..Options::default() };
        for Tunable { key, values, places, .. } in &config.tune {
            for (value, place) in values.iter().zip(places) {
                let changed = config.source.with_text(config.with_values(&[(key, value)])?);
                if let Err(error) = Self::from_source(&changed, registry, &options) {
                    let message = format!("`{key}` = {value} is not allowed: {}", error.message);
                    return Err(ConfigError::new(message).or_at(Some(place.clone())));
                }
            }
        }
        Ok(())
    }
}

/// Returns the config with other values for some settings. `resolved` is the text of
/// [`Pipeline::resolved`], which contains every setting.
///
/// # Errors
/// A setting that the config does not have.
pub fn with_values(resolved: &str, values: &[(&str, &toml::Value)]) -> Result<String, ConfigError> {
    values_replaced(toml::from_str(resolved)?, values)
}

/// Returns the text of a table with other values at some dotted keys.
///
/// # Errors
/// A key that the table does not have.
pub(super) fn values_replaced(
    table: toml::Table,
    values: &[(&str, &toml::Value)],
) -> Result<String, ConfigError> {
    let mut root = toml::Value::Table(table);
    for (key, value) in values {
        let place = key.split('.').try_fold(&mut root, |inner, part| match inner {
            toml::Value::Array(items) => items.get_mut(part.parse::<usize>().ok()?),
            inner => inner.get_mut(part),
        });
        let Some(place) = place else {
            return Err(ConfigError::new(format!("the config has no setting `{key}`")));
        };
        *place = (*value).clone();
    }
    toml::to_string(&root).map_err(|error| ConfigError::new(error.to_string()))
}

/// Dotted key and its span.
struct Named {
    key: String,
    place: Range<usize>,
}

/// Collects the dotted keys. A table within the table is a dotted key, too: quotes around a key
/// change nothing.
fn flatten<'a>(path: String, value: Value<'a>, out: &mut Vec<(Named, Value<'a>)>) {
    let span = value.span();
    match value.into_inner() {
        // A table with `between` is a value, not a level of keys.
        DeValue::Table(table) if !table.contains_key("between") => {
            for (name, inner) in table {
                let place = name.span();
                let name = name.into_inner();
                let key = if path.is_empty() { name.into() } else { format!("{path}.{name}") };
                match inner.get_ref() {
                    DeValue::Table(_) => flatten(key, inner, out),
                    _ => out.push((Named { key, place }, inner)),
                }
            }
        }
        other => {
            out.push((Named { key: path, place: span.clone() }, toml::Spanned::new(span, other)));
        }
    }
}

/// Returns the settings that may be tuned: single settings of the pipeline and of its plugins.
fn leaves_of(resolved: &toml::Table) -> Vec<Leaf<'_>> {
    let mut leaves = Vec::new();
    for (name, value) in resolved {
        let is_setting = OWN.contains(&name.as_str()) || PLUGINS.contains(&name.as_str());
        // The seed is no quantity to fit, and a plugin's name is no value.
        if is_setting && name != "seed" {
            add_leaves(name.clone(), value, &mut leaves);
        }
    }
    leaves
}

fn add_leaves<'a>(path: String, value: &'a toml::Value, out: &mut Vec<Leaf<'a>>) {
    match value {
        toml::Value::Table(table) => {
            // Another plugin has other keys, so its name cannot be tuned alone.
            let inner = table.iter().filter(|(name, _)| *name != "plugin");
            inner.for_each(|(name, value)| add_leaves(format!("{path}.{name}"), value, out));
        }
        toml::Value::Array(items) if items.iter().any(toml::Value::is_table) => {
            let inner = items.iter().enumerate();
            inner.for_each(|(at, value)| add_leaves(format!("{path}.{at}"), value, out));
        }
        _ => out.push((path, value)),
    }
}

fn tunable(named: Named, value: Value<'_>, leaves: &[Leaf<'_>]) -> Result<Tunable, ConfigError> {
    let Named { key, place } = named;
    let Some((_, now)) = leaves.iter().find(|(name, _)| *name == key) else {
        let known = leaves.iter().map(|(name, _)| name.as_str());
        let hint = nearest(&key, known).map(|name| format!("; did you mean `{name}`?"));
        let remedy = "name a single setting that has a default or is in the config";
        let message =
            format!("nothing to tune is called `{key}`{}; {remedy}", hint.unwrap_or_default());
        return Err(ConfigError::new(message).or_at(Some(place)));
    };
    let whole = value.span();
    let (values, places): (Vec<_>, Vec<_>) = match value.into_inner() {
        DeValue::Array(items) => listed(&key, items, now)?,
        DeValue::Table(table) => spread(&key, toml::Spanned::new(whole.clone(), table), now)?,
        _ => (Vec::new(), Vec::new()),
    };
    let mistake = match values.len() {
        0 => "needs a list of values, or `{ between = [low, high], steps = n }`".to_owned(),
        count if count > MAX_VALUES => format!("has {count} values; at most {MAX_VALUES}"),
        _ => return Ok(Tunable { key, now: (*now).clone(), values, places }),
    };
    Err(ConfigError::new(format!("`{key}` {mistake}")).or_at(Some(whole)))
}

type Values = (Vec<toml::Value>, Vec<Range<usize>>);

fn listed(key: &str, items: DeArray<'_>, now: &toml::Value) -> Result<Values, ConfigError> {
    let mut values = Vec::new();
    let mut places = Vec::new();
    for item in items {
        let place = item.span();
        let value = toml::Value::deserialize(toml::de::ValueDeserializer::from(item))?;
        let value = as_now(key, value, now).map_err(|error| error.or_at(Some(place.clone())))?;
        if values.contains(&value) {
            let message = format!("`{key}` lists {value} twice");
            return Err(ConfigError::new(message).or_at(Some(place)));
        }
        values.push(value);
        places.push(place);
    }
    Ok((values, places))
}

fn spread(
    key: &str,
    table: toml::Spanned<toml::de::DeTable<'_>>,
    now: &toml::Value,
) -> Result<Values, ConfigError> {
    let span = table.span();
    let table = toml::Spanned::new(span.clone(), DeValue::Table(table.into_inner()));
    let Spread { between: [low, high], steps } =
        Spread::deserialize(toml::de::ValueDeserializer::from(table))?;
    if !(low.is_finite() && high.is_finite() && low < high) {
        let message = format!("`{key}` lies between {low} and {high}: the lower number first");
        return Err(ConfigError::new(message).or_at(Some(span)));
    }
    if !(2..=MAX_VALUES).contains(&steps) {
        let message = format!("`{key}`: `steps` must be from 2 to {MAX_VALUES}, not {steps}");
        return Err(ConfigError::new(message).or_at(Some(span)));
    }
    let mut values: Vec<toml::Value> = Vec::new();
    for value in (0..steps).map(|i| low + (high - low) * i as f64 / (steps - 1) as f64) {
        let value = match now {
            toml::Value::Integer(_) => toml::Value::Integer(value.round() as i64),
            _ => as_now(key, toml::Value::Float(value), now)
                .map_err(|error| ConfigError::new(error.message).or_at(Some(span.clone())))?,
        };
        // Rounding to whole numbers can make neighbours equal.
        if !values.contains(&value) {
            values.push(value);
        }
    }
    let places = vec![span.clone(); values.len()];
    Ok((values, places))
}

/// Converts a value to the setting's own type; a whole number is accepted for a float.
fn as_now(key: &str, value: toml::Value, now: &toml::Value) -> Result<toml::Value, ConfigError> {
    match (&value, now) {
        (toml::Value::Integer(whole), toml::Value::Float(_)) => {
            Ok(toml::Value::Float(*whole as f64))
        }
        (value, now) if value.same_type(now) => Ok(value.clone()),
        _ => {
            let is = value.type_str();
            let wanted = now.type_str();
            Err(ConfigError::new(format!("`{key}` = {value} is of type {is}, not {wanted}")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::doubles::{PLAIN, World};

    fn text(tune: &str) -> String {
        format!("{PLAIN}[tune]\n{tune}\n")
    }

    fn build(tune: &str) -> Result<Pipeline, String> {
        Pipeline::builder(&World::default().registry())
            .folder("a")
            .from_toml(&text(tune))
            .map_err(|error| error.to_string())
    }

    fn check(tune: &str) -> Result<(), String> {
        let checked = build(tune)?.check_tuning(&World::default().registry());
        checked.map_err(|error| error.to_string())
    }

    #[test]
    fn lists_and_spreads_take_the_type_of_their_setting() {
        let lines = [
            "\"manager.config.confirm_hits\" = [1, 2]",
            "manager.config.drop_after_s = [1, 2.5]",
            "\"detectors.0.config.script\" = { between = [0, 2], steps = 5 }",
            "associator.config.gate_m = { between = [0.5, 1.0], steps = 3 }",
            "associator.config.cost = [\"overlap\", \"mahalanobis\"]",
        ];
        let pipeline = build(&lines.join("\n")).unwrap();
        let shown: Vec<String> = pipeline
            .config()
            .tune
            .iter()
            .map(|t| format!("{} {}", t.key, toml::Value::Array(t.values.clone())))
            .collect();
        for line in [
            "manager.config.confirm_hits [1, 2]",
            "manager.config.drop_after_s [1.0, 2.5]",
            "detectors.0.config.script [0, 1, 2]",
            "associator.config.gate_m [0.5, 0.75, 1.0]",
            "associator.config.cost [\"overlap\", \"mahalanobis\"]",
        ] {
            assert!(shown.iter().any(|s| s == line), "{line} in {shown:#?}");
        }
        check(&lines.join("\n")).unwrap();
    }

    #[test]
    fn mistakes_are_shown_with_their_line() {
        let cases: &[(&str, &[&str])] = &[
            (
                "\"manager.config.confirm_hit\" = [1]",
                &["config.toml:7:1", "`manager.config.confirm_hits`?"],
            ),
            (
                "manager.config.confirm_hit = [1]",
                &["config.toml:7:16", "`manager.config.confirm_hits`?"],
            ),
            ("\"detectors.1.config.script\" = [1]", &["`detectors.0.config.script`?"]),
            ("seed = [1, 2]", &["config.toml:7:1", "nothing to tune is called `seed`"]),
            ("\"filter.plugin\" = ['odd']", &["nothing to tune is called `filter.plugin`"]),
            ("lifecycle = [1]", &["nothing to tune is called `lifecycle`"]),
            ("manager.config.confirm_hits = 2", &["config.toml:7:31", "needs a list of values"]),
            ("manager.config.confirm_hits = []", &["config.toml:7:31", "needs a list of values"]),
            ("manager.config.confirm_hits = [1, 2.5]", &["config.toml:7:35", "float, not integer"]),
            ("manager.config.confirm_hits = ['x']", &["config.toml:7:32", "string, not integer"]),
            ("manager.config.confirm_hits = [1, 1]", &["config.toml:7:35", "twice"]),
            (
                "associator.config.gate = { between = [2, 1], steps = 3 }",
                &["the lower number first"],
            ),
            (
                "associator.config.gate = { between = [1, 2], steps = 1 }",
                &["`steps` must be from 2"],
            ),
            (
                "associator.config.gate = { between = [1, 2] }",
                &["config.toml:7", "missing field `steps`"],
            ),
            ("associator.config.gate = { between = [1, 2], stps = 3 }", &["did you mean `steps`?"]),
            ("associator.config.cost = { between = [1, 2], steps = 2 }", &["float, not string"]),
        ];
        for (tune, expected) in cases {
            let shown = build(tune).map(|_| ()).expect_err(tune);
            for words in *expected {
                assert!(shown.contains(words), "{tune}\n{shown}\nlacks {words}");
            }
        }
    }

    #[test]
    fn values_that_a_setting_does_not_allow_are_shown_with_their_line() {
        let shown = check("manager.config.confirm_hits = [1, 2, 9]").unwrap_err();
        assert!(
            shown.contains("config.toml:7:38") && shown.contains("must be at least 9"),
            "{shown}"
        );
        let shown = check("\"associator.config.cost\" = ['overlap', 'far']").unwrap_err();
        assert!(shown.contains("config.toml:7:40") && shown.contains("unknown variant"), "{shown}");
    }

    #[test]
    fn the_table_leaves_the_pipeline_as_it_is() {
        let plain = World::default().pipeline(PLAIN).resolved();
        let tuned = build("manager.config.confirm_hits = [1, 2]").unwrap();
        assert_eq!(tuned.resolved(), plain);
    }

    #[test]
    fn values_are_put_where_they_belong() {
        fn count(text: &str) -> usize {
            text.lines().count()
        }

        let resolved = World::default().pipeline(PLAIN).resolved();
        let two = toml::Value::Integer(2);
        let script = toml::Value::Integer(7);
        let values =
            [("manager.config.confirm_hits", &two), ("detectors.0.config.script", &script)];
        let text = with_values(&resolved, &values).unwrap();
        let changed = World::default().pipeline(&text).resolved();
        assert!(changed.contains("confirm_hits = 2\n") && changed.contains("script = 7\n"));
        assert_eq!(count(&changed), count(&resolved));
        assert!(with_values(&resolved, &[("manager.config.no_such", &two)]).is_err());
        assert!(with_values(&resolved, &[("detectors.9.every", &two)]).is_err());
    }
}
