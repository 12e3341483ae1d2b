use std::fmt::Write as _;
use std::ops::{Range, RangeInclusive};

use schemars::JsonSchema;
use serde::{Serialize, de::DeserializeOwned};
use toml::{Spanned, de::DeValue};

use crate::{Error, nearest};

/// A TOML value that remembers where in the file it stood.
pub type Value<'a> = Spanned<DeValue<'a>>;

/// The settings of a plugin: a plain struct with documented fields, defaults,
/// and `#[serde(default, deny_unknown_fields)]`.
pub trait Settings: Default + Serialize + DeserializeOwned + JsonSchema + 'static {}

impl<T: Default + Serialize + DeserializeOwned + JsonSchema + 'static> Settings for T {}

/// A mistake in a config, with its place in the text.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct ConfigError {
    /// What is wrong and what would be right.
    pub message: String,
    /// Byte range in the text; `None` if it concerns the file as a whole.
    pub span: Option<Range<usize>>,
}

impl ConfigError {
    /// An error without a place.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), span: None }
    }

    /// The same error at `span`, unless it already has a place.
    pub fn or_at(mut self, span: Option<Range<usize>>) -> Self {
        self.span = self.span.or(span);
        self
    }

    /// The error as a person wants to read it: file, line, column, the line
    /// itself with the place marked.
    pub fn render(&self, file: &str, text: &str) -> String {
        let Some(span) = self.span.clone().filter(|s| s.start <= text.len()) else {
            return format!("{file}: {}", self.message);
        };
        let before = text.get(..span.start).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        let source = text.lines().nth(line - 1).unwrap_or_default();
        let room = source.chars().count().saturating_sub(column - 1).max(1);
        let marks = text.get(span).map_or(1, |s| s.chars().count()).clamp(1, room);
        let number = line.to_string();
        let pad = " ".repeat(number.len());
        format!(
            "{file}:{line}:{column}: {}\n{pad} |\n{number} | {source}\n{pad} | {}{}",
            self.message,
            " ".repeat(column - 1),
            "^".repeat(marks),
        )
    }
}

impl From<toml::de::Error> for ConfigError {
    fn from(error: toml::de::Error) -> Self {
        let message = error.message().trim_end();
        Self { message: with_suggestion(message), span: error.span() }
    }
}

/// Numbers that are neither endless nor far beyond anything that is measured.
pub const ANY: RangeInclusive<f64> = -1e6..=1e6;
/// The same without negative ones.
pub const NOT_NEGATIVE: RangeInclusive<f64> = 0.0..=1e6;
/// The same without nothing.
pub const POSITIVE: RangeInclusive<f64> = 1e-6..=1e6;

/// Refuses settings that are no numbers or out of their range.
///
/// # Errors
/// [`Error::Settings`] names the first such setting, and the range.
pub fn check_ranges(settings: &[(&str, f64, RangeInclusive<f64>)]) -> crate::Result<()> {
    match settings.iter().find(|(_, value, range)| !range.contains(value)) {
        None => Ok(()),
        Some((key, value, range)) => {
            let bound = match range {
                range if *range == POSITIVE => "be positive and at most 1e6".to_owned(),
                range => format!("lie between {:?} and {:?}", range.start(), range.end()),
            };
            Err(Error::Settings(format!("`{key}` must {bound}, not {value}")))
        }
    }
}

/// Reads settings from a value of a config file; the defaults where there is none.
///
/// # Errors
/// Unknown keys and wrong types, with their place and the nearest valid name.
pub fn parse_settings<T: Settings>(value: Option<Value<'_>>) -> Result<T, ConfigError> {
    match value {
        None => Ok(T::default()),
        Some(value) => Ok(T::deserialize(toml::de::ValueDeserializer::from(value))?),
    }
}

/// Adds "did you mean" to serde's "unknown field `a`, expected one of `b`, `c`".
fn with_suggestion(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let unknown = if message.starts_with("unknown ") { quoted.next() } else { None };
    match unknown.and_then(|name| nearest(name, quoted)) {
        Some(better) => format!("{message}; did you mean `{better}`?"),
        None => message.to_owned(),
    }
}

/// The defaults of `T` as TOML, each key under its documentation.
pub fn commented_defaults<T: Settings>() -> String {
    let schema = schemars::schema_for!(T).to_value();
    let mut out = String::new();
    if let Ok(toml::Value::Table(defaults)) = toml::Value::try_from(T::default()) {
        write_table(&mut out, "", &defaults, &schema, &schema);
    }
    out
}

fn write_table(
    out: &mut String,
    path: &str,
    table: &toml::Table,
    schema: &serde_json::Value,
    root: &serde_json::Value,
) {
    let property = |key: &str| resolve(&schema["properties"][key], root);
    let mut keys: Vec<&str> = table.keys().map(String::as_str).collect();
    if let Some(declared) = schema["properties"].as_object() {
        let order: Vec<&str> = declared.keys().map(String::as_str).collect();
        keys.sort_by_key(|key| order.iter().position(|name| name == key));
    }
    let (tables, plain): (Vec<_>, Vec<_>) =
        keys.into_iter().partition(|key| table[*key].is_table());
    for key in plain {
        comment(out, property(key).0);
        let _ = writeln!(out, "{key} = {}", table[key]);
    }
    let (absent_tables, absent): (Vec<_>, Vec<_>) = absent(schema, table)
        .into_iter()
        .partition(|key| property(key).1["properties"].is_object());
    for key in absent {
        comment(out, property(key).0);
        let _ = writeln!(out, "# {key} =");
    }
    for key in tables {
        let (text, inner) = property(key);
        let name = join(path, key);
        out.push('\n');
        comment(out, text);
        let _ = writeln!(out, "[{name}]");
        if let toml::Value::Table(table) = &table[key] {
            write_table(out, &name, table, inner, root);
        }
    }
    for key in absent_tables {
        write_absent_table(out, &join(path, key), property(key), root);
    }
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// A table that may be left out, as a comment, with the defaults of its keys.
fn write_absent_table(
    out: &mut String,
    name: &str,
    (text, table): (Option<&str>, &serde_json::Value),
    root: &serde_json::Value,
) {
    out.push('\n');
    comment(out, text);
    let _ = writeln!(out, "# [{name}]");
    for (key, property) in table["properties"].as_object().into_iter().flatten() {
        comment(out, resolve(property, root).0);
        let _ = writeln!(out, "# {key} = {}", property["default"]);
    }
}

/// Keys that have no default, because leaving them out means something.
fn absent<'a>(schema: &'a serde_json::Value, table: &toml::Table) -> Vec<&'a str> {
    let declared = schema["properties"].as_object().into_iter().flat_map(|keys| keys.keys());
    declared.map(String::as_str).filter(|key| !table.contains_key(*key)).collect()
}

/// The description of a property, and the schema that a reference points to.
fn resolve<'a>(
    property: &'a serde_json::Value,
    root: &'a serde_json::Value,
) -> (Option<&'a str>, &'a serde_json::Value) {
    let any = property["anyOf"].as_array().into_iter().flatten();
    let mut references = std::iter::once(property).chain(any).map(|p| &p["$ref"]);
    let target = references
        .find_map(|reference| reference.as_str())
        .and_then(|path| root.pointer(path.trim_start_matches('#')))
        .unwrap_or(property);
    let text = property["description"].as_str().or_else(|| target["description"].as_str());
    (text, target)
}

fn comment(out: &mut String, text: Option<&str>) {
    for line in text.into_iter().flat_map(str::lines) {
        let _ = writeln!(out, "{}", format!("# {line}").trim_end());
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Serialize, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    struct Example {
        /// Nearest depth, m.
        min_depth_m: f64,
        /// Names.
        names: Vec<String>,
        /// A topic, else the only one.
        topic: Option<String>,
        /// More of it.
        inner: Inner,
        /// More, if wanted.
        wanted: Option<Inner>,
    }

    #[derive(Serialize, Deserialize, JsonSchema, Default)]
    #[serde(default, deny_unknown_fields)]
    struct Inner {
        /// A count.
        count: u32,
    }

    impl Default for Example {
        fn default() -> Self {
            Self {
                min_depth_m: 0.5,
                names: vec!["a".into()],
                topic: None,
                inner: Inner::default(),
                wanted: None,
            }
        }
    }

    fn parse(text: &str) -> Result<Example, ConfigError> {
        parse_settings(Some(DeValue::parse(text).unwrap()))
    }

    #[test]
    fn an_unknown_key_is_named_with_its_place_and_the_nearest_one() {
        let text = "{ min_dept_m = 1.0 }";
        let error = parse(text).err().unwrap();
        let shown = error.render("a.toml", text);
        assert!(shown.contains("a.toml:1:3: unknown field `min_dept_m`"), "{shown}");
        assert!(shown.contains("did you mean `min_depth_m`?"), "{shown}");
        assert!(shown.contains("^^^^^^^^^^"), "{shown}");
    }

    #[test]
    fn defaults_are_printed_under_their_documentation() {
        let text = commented_defaults::<Example>();
        assert!(text.contains("# Nearest depth, m.\nmin_depth_m = 0.5\n"), "{text}");
        assert!(text.contains("# More of it.\n[inner]\n# A count.\ncount = 0\n"), "{text}");
        assert!(text.contains("# A topic, else the only one.\n# topic =\n"), "{text}");
        let optional = "# More, if wanted.\n# [wanted]\n# A count.\n# count = 0\n";
        assert!(text.contains(optional), "{text}");
        assert_eq!(toml::from_str::<Example>(&text).unwrap().min_depth_m, 0.5);
    }

    #[test]
    fn the_place_of_a_mistake_is_marked_in_its_line() {
        let text = "one = 1\ntwo = true\n";
        let at = |span| ConfigError { message: "wrong".into(), span }.render("a.toml", text);
        assert_eq!(at(None), "a.toml: wrong");
        assert_eq!(at(Some(99..100)), "a.toml: wrong", "beyond the end");
        assert_eq!(at(Some(14..18)), "a.toml:2:7: wrong\n  |\n2 | two = true\n  |       ^^^^");
        assert_eq!(at(Some(14..90)).lines().last(), Some("  |       ^"));
        assert_eq!(
            at(Some(8..19)).lines().last(),
            Some("  | ^^^^^^^^^^"),
            "no longer than the line"
        );
        assert_eq!(at(Some(19..19)).lines().next(), Some("a.toml:3:1: wrong"), "at the end");
    }

    #[test]
    fn a_mistake_that_has_a_place_keeps_it() {
        let placed = ConfigError::new("wrong").or_at(Some(1..2));
        assert_eq!(placed.span, Some(1..2));
        assert_eq!(placed.or_at(Some(5..6)).span, Some(1..2));
    }

    #[test]
    fn the_first_setting_out_of_its_range_is_named() {
        let check = |settings: &[(&str, f64, RangeInclusive<f64>)]| {
            check_ranges(settings).map_err(|error| error.to_string())
        };
        let fine = [("a", 0.0, NOT_NEGATIVE), ("b", -1e6, ANY), ("c", 1e6, POSITIVE)];
        assert_eq!(check(&fine), Ok(()));
        let wrong = |value, range| check(&[("a", 1.0, ANY), ("b", value, range)]).unwrap_err();
        assert_eq!(wrong(0.0, POSITIVE), "`b` must be positive and at most 1e6, not 0");
        assert_eq!(wrong(2.0, 0.0..=1.0), "`b` must lie between 0.0 and 1.0, not 2");
        assert_eq!(wrong(f64::NAN, ANY), "`b` must lie between -1000000.0 and 1000000.0, not NaN");
        assert!(check(&[("a", -0.1, NOT_NEGATIVE)]).is_err());
    }

    #[test]
    fn keys_are_printed_in_the_order_of_their_declaration() {
        let text = commented_defaults::<Example>();
        let places: Vec<usize> = ["min_depth_m =", "names =", "# topic =", "[inner]", "# [wanted]"]
            .map(|key| text.find(key).unwrap())
            .into();
        assert!(places.is_sorted(), "{text}");
        assert!(text.contains("names = [\"a\"]"), "{text}");
    }
}
