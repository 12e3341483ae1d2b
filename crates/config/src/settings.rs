//! Settings from TOML: parsing, ranges, and the place of an error in the file.

use std::fmt::{self, Write as _};
use std::ops;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use toml::{Spanned, de::DeValue};

use crate::names::with_suggestion;
use tagalong_core::Error;

/// A TOML value with its place in the file.
pub type Value<'a> = Spanned<DeValue<'a>>;

/// Settings of a plugin: a plain struct with documented fields, defaults, and `#[serde(default,
/// deny_unknown_fields)]`.
pub trait Settings: Default + Serialize + DeserializeOwned + JsonSchema + 'static {}

impl<T: Default + Serialize + DeserializeOwned + JsonSchema + 'static> Settings for T {}

/// Settings of a plugin that has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NoSettings {}

/// An error in a config, with its place in the text.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
#[non_exhaustive]
pub struct ConfigError {
    /// Description of the error and of valid values.
    pub message: String,
    /// Byte range in the text; `None` if it concerns the file as a whole.
    pub span: Option<ops::Range<usize>>,
}

impl ConfigError {
    /// Creates an error without a place.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), span: None }
    }

    /// Returns the error at `span`, unless it already has a place.
    pub fn or_at(mut self, span: Option<ops::Range<usize>>) -> Self {
        self.span = self.span.or(span);
        self
    }

    /// Returns the error of settings that stand at `value`, at the key that it names.
    pub fn at_key(error: &Error, value: &Value<'_>) -> Self {
        let named = match error {
            Error::Settings { key, .. } => place_of(value, key),
            _ => None,
        };
        Self { message: error.to_string(), span: Some(named.unwrap_or_else(|| value.span())) }
    }

    /// Returns the line of the error in the text, from 1; `None` if it concerns the file as a whole.
    pub fn line(&self, text: &str) -> Option<usize> {
        let span = self.span.as_ref().filter(|span| span.start <= text.len())?;
        Some(text.get(..span.start).unwrap_or_default().matches('\n').count() + 1)
    }

    /// Formats the error for the terminal: file, line, column, and the line itself with the place
    /// marked.
    pub fn render(&self, file: &str, text: &str) -> String {
        let Some(span) = self.span.clone().filter(|s| s.start <= text.len()) else {
            return format!("{file}: {}", self.message);
        };
        let before = text.get(..span.start).unwrap_or_default();
        let line = self.line(text).unwrap_or(1);
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        let source = text.lines().nth(line - 1).unwrap_or_default();
        // A span may cover several lines; the marks end with the line that is shown.
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

/// Returns where the value of a dotted key stands.
fn place_of(value: &Value<'_>, key: &str) -> Option<ops::Range<usize>> {
    let found = key.split('.').try_fold(value, |at, part| match at.get_ref() {
        DeValue::Table(table) => table.get(part),
        _ => None,
    });
    found.map(Spanned::span)
}

impl From<toml::de::Error> for ConfigError {
    fn from(error: toml::de::Error) -> Self {
        // Serde names the types of Rust.
        let message = error.message().trim_end().replace(", expected f64", ", expected a number");
        Self { message: with_suggestion(&message), span: error.span() }
    }
}

/// Refuses numbers outside of the ranges that the fields declare with
/// `#[schemars(range(min = ..., max = ...))]`, and floats that are not finite where a field
/// declares none. Those of an editor's schema are the same.
///
/// # Errors
/// [`Error::Settings`] names the first such key, its range and its value.
pub fn check_settings<T: Settings>(settings: &T) -> tagalong_core::Result<()> {
    let value = toml::Value::try_from(settings).map_err(|why| Error::Other(why.to_string()))?;
    let schema = schemars::schema_for!(T).to_value();
    match out_of_range(&value, &schema, &schema, "") {
        Some((key, why)) => Err(Error::Settings { key, why }),
        None => Ok(()),
    }
}

/// Returns the first value below `path` that its schema does not allow, and why.
fn out_of_range(
    value: &toml::Value,
    schema: &serde_json::Value,
    root: &serde_json::Value,
    path: &str,
) -> Option<(String, String)> {
    let number = match value {
        toml::Value::Table(table) => {
            return table.iter().find_map(|(key, value)| {
                let property = resolve(&schema["properties"][key], root).1;
                out_of_range(value, property, root, &join(path, key))
            });
        }
        toml::Value::Array(items) => return list_out_of_range(items, schema, root, path),
        toml::Value::Integer(number) => *number as f64,
        toml::Value::Float(number) => *number,
        _ => return None,
    };
    let range = Range::of(schema);
    (!range.contains(number)).then(|| (path.to_owned(), format!("must {range}, not {number}")))
}

fn list_out_of_range(
    items: &[toml::Value],
    schema: &serde_json::Value,
    root: &serde_json::Value,
    path: &str,
) -> Option<(String, String)> {
    let count = items.len() as f64;
    let least = schema["minItems"].as_f64().unwrap_or(0.0);
    let most = schema["maxItems"].as_f64().unwrap_or(f64::INFINITY);
    if !(least..=most).contains(&count) {
        return Some((path.to_owned(), format!("must have {least} to {most} values, not {count}")));
    }
    let each = resolve(&schema["items"], root).1;
    items.iter().find_map(|item| out_of_range(item, each, root, path))
}

/// Least number of a range that stands for "positive": any smaller one is a mistake of units.
const POSITIVE: f64 = 1e-6;

/// The numbers that a schema allows.
struct Range {
    least: Option<f64>,
    most: Option<f64>,
    above: Option<f64>,
    below: Option<f64>,
}

impl Range {
    fn of(schema: &serde_json::Value) -> Self {
        Self {
            least: schema["minimum"].as_f64(),
            most: schema["maximum"].as_f64(),
            above: schema["exclusiveMinimum"].as_f64(),
            below: schema["exclusiveMaximum"].as_f64(),
        }
    }

    /// Returns true for a number within the bounds. Not for one that is not finite: a
    /// comparison with NaN is never true, and a robot would drive on.
    fn contains(&self, number: f64) -> bool {
        let Self { least, most, above, below } = self;
        number.is_finite()
            && least.is_none_or(|bound| number >= bound)
            && most.is_none_or(|bound| number <= bound)
            && above.is_none_or(|bound| number > bound)
            && below.is_none_or(|bound| number < bound)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { least, most, above, below } = *self;
        match (least, most, above, below) {
            (None, None, None, None) => return f.write_str("be a finite number"),
            (None, None, Some(0.0), None) => return f.write_str("be positive"),
            (Some(least), Some(most), None, None) if least != POSITIVE => {
                return write!(f, "lie between {} and {}", Shown(least), Shown(most));
            }
            _ => {}
        }
        let lower = match (least, above) {
            (Some(POSITIVE), _) | (_, Some(0.0)) => Some("positive".to_owned()),
            (Some(least), _) => Some(format!("at least {}", Shown(least))),
            (_, above) => above.map(|above| format!("above {}", Shown(above))),
        };
        let upper = match (most, below) {
            (Some(most), _) => Some(format!("at most {}", Shown(most))),
            (_, below) => below.map(|below| format!("below {}", Shown(below))),
        };
        let both: Vec<String> = lower.into_iter().chain(upper).collect();
        write!(f, "be {}", both.join(" and "))
    }
}

/// A bound in few digits.
struct Shown(f64);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.abs() {
            0.0 | 1e-3..1e5 => write!(f, "{}", self.0),
            _ => write!(f, "{:e}", self.0),
        }
    }
}

/// Reads settings from a value of a config file; the defaults where there is none.
///
/// # Errors
/// Unknown keys, wrong types and numbers out of their range, with their place; for a name
/// the nearest valid one.
pub fn parse_settings<T: Settings>(value: Option<Value<'_>>) -> Result<T, ConfigError> {
    let Some(value) = value else { return Ok(T::default()) };
    let settings = T::deserialize(toml::de::ValueDeserializer::from(value.clone()))
        .map_err(|error| at_its_key::<T>(error, &value))?;
    check_settings(&settings).map_err(|error| ConfigError::at_key(&error, &value))?;
    Ok(settings)
}

/// Returns the error at the key that it is about.
///
/// Serde forgets the places within flattened structs and the names that they allow, so each key
/// is read alone, as if the others were left out, and the schema has the names.
fn at_its_key<T: Settings>(error: toml::de::Error, value: &Value<'_>) -> ConfigError {
    let is_precise = error.span().is_some_and(|span| !is_place_of_table(value, &span));
    let wrong = if is_precise {
        None
    } else {
        wrong_key(value, &|alone| {
            let read = T::deserialize(toml::de::ValueDeserializer::from(alone));
            read.is_err_and(|why| why.message() == error.message())
        })
    };
    let Some(WrongKey { path, key, entry }) = wrong else { return error.into() };
    if error.message().starts_with("unknown field") {
        let message = format!("{}, expected one of {}", error.message(), names_in::<T>(&path));
        ConfigError { message: with_suggestion(&message), span: Some(key) }
    } else {
        ConfigError { span: Some(entry), ..error.into() }
    }
}

/// A key that a config must not have, or not with its value.
struct WrongKey {
    /// Keys of the tables that hold it, from the outside to the inside.
    path: Vec<String>,
    /// Place of the key.
    key: ops::Range<usize>,
    /// Place of its value.
    entry: ops::Range<usize>,
}

/// Returns true if a table stands at `span`: serde names it in place of one of its keys.
fn is_place_of_table(value: &Value<'_>, span: &ops::Range<usize>) -> bool {
    let DeValue::Table(table) = value.get_ref() else { return false };
    value.span() == *span || table.values().any(|inner| is_place_of_table(inner, span))
}

/// Returns the key, as deep in the tables as it can be, that fails alone.
fn wrong_key<'a>(value: &Value<'a>, fails: &dyn Fn(Value<'a>) -> bool) -> Option<WrongKey> {
    let DeValue::Table(table) = value.get_ref() else { return None };
    table.iter().find_map(|(key, entry)| {
        let with = |entry: Value<'a>| {
            let alone = [(key.clone(), entry)].into_iter().collect();
            fails(Spanned::new(value.span(), DeValue::Table(alone)))
        };
        if !with(entry.clone()) {
            return None;
        }
        let deeper = wrong_key(entry, &with).map(|mut wrong| {
            wrong.path.insert(0, key.get_ref().clone().into_owned());
            wrong
        });
        Some(deeper.unwrap_or_else(|| WrongKey {
            path: Vec::new(),
            key: key.span(),
            entry: entry.span(),
        }))
    })
}

/// Returns the keys of a table in `T`, quoted.
fn names_in<T: Settings>(path: &[String]) -> String {
    let root = schemars::schema_for!(T).to_value();
    let table = path.iter().fold(&root, |at, key| resolve(&at["properties"][key], &root).1);
    let declared = table["properties"].as_object().into_iter().flat_map(|keys| keys.keys());
    let quoted: Vec<String> = declared.map(|key| format!("`{key}`")).collect();
    quoted.join(", ")
}

/// Returns the defaults of `T` as TOML, each key under its documentation.
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
    let properties = &schema["properties"];
    let mut keys: Vec<&str> = table.keys().map(String::as_str).collect();
    if let Some(declared) = schema["properties"].as_object() {
        let order: Vec<&str> = declared.keys().map(String::as_str).collect();
        // A TOML table is sorted by name, but the schema has the order of the fields.
        keys.sort_by_key(|key| order.iter().position(|name| name == key));
    }
    // In TOML the plain keys of a table must stand before its subtables.
    let (tables, plain): (Vec<_>, Vec<_>) =
        keys.into_iter().partition(|key| table[*key].is_table());
    for key in plain {
        comment(out, resolve(&properties[key], root).0);
        let _ = writeln!(out, "{key} = {}", table[key]);
    }
    let (absent_tables, absent): (Vec<_>, Vec<_>) = absent(schema, table)
        .into_iter()
        .partition(|key| resolve(&properties[*key], root).1["properties"].is_object());
    for key in absent {
        comment(out, resolve(&properties[key], root).0);
        let _ = writeln!(out, "# {key} =");
    }
    for key in tables {
        let (text, inner) = resolve(&properties[key], root);
        let name = join(path, key);
        out.push('\n');
        comment(out, text);
        let _ = writeln!(out, "[{name}]");
        if let toml::Value::Table(table) = &table[key] {
            write_table(out, &name, table, inner, root);
        }
    }
    for key in absent_tables {
        write_absent_table(out, &join(path, key), resolve(&properties[key], root), root);
    }
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// Writes a table that may be left out, as a comment, with the defaults of its keys.
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

/// Returns the description of a property, and the schema that a reference points to.
fn resolve<'a>(
    property: &'a serde_json::Value,
    root: &'a serde_json::Value,
) -> (Option<&'a str>, &'a serde_json::Value) {
    // The schema of an optional table is `anyOf` a reference and null.
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
    use toml::de::DeTable;

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
        for (span, whole) in [
            (None, "a.toml: wrong"),
            // Beyond the end.
            (Some(99..100), "a.toml: wrong"),
            (Some(14..18), "a.toml:2:7: wrong\n  |\n2 | two = true\n  |       ^^^^"),
        ] {
            assert_eq!(ConfigError { message: "wrong".into(), span }.render("a.toml", text), whole);
        }
        // A mark is no longer than the line, and there is one at the end too.
        for (span, first, last) in [
            (14..90, "a.toml:2:7: wrong", "  |       ^"),
            (8..19, "a.toml:2:1: wrong", "  | ^^^^^^^^^^"),
            (19..19, "a.toml:3:1: wrong", "  | ^"),
        ] {
            let span = Some(span);
            let shown = ConfigError { message: "wrong".into(), span }.render("a.toml", text);
            assert_eq!(shown.lines().next(), Some(first));
            assert_eq!(shown.lines().last(), Some(last));
        }
    }

    #[test]
    fn a_mistake_that_has_a_place_keeps_it() {
        let placed = ConfigError::new("wrong").or_at(Some(1..2));
        assert_eq!(placed.span, Some(1..2));
        assert_eq!(placed.or_at(Some(5..6)).span, Some(1..2));
    }

    #[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    struct Joined {
        own: u32,
        #[serde(flatten)]
        shared: Shared,
    }

    #[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
    #[serde(default)]
    struct Shared {
        /// Height, m.
        #[schemars(range(min = 0.0, max = 3.0))]
        height_m: f64,
    }

    #[test]
    fn flattened_settings_are_read_and_refused_like_all_others() {
        fn parse(text: &str) -> Result<Joined, ConfigError> {
            parse_settings::<Joined>(Some(DeValue::parse(text).unwrap()))
        }

        fn shown(text: &str) -> String {
            parse(text).unwrap_err().render("a.toml", text)
        }

        let read = parse("{ own = 2, height_m = 1 }").unwrap();
        assert_eq!((read.own, read.shared.height_m), (2, 1.0));
        let unknown = shown("{ own = 2, hight_m = 1.0 }");
        let nearest_first =
            "unknown field `hight_m`; did you mean `height_m`? expected one of `own`";
        assert!(unknown.contains(&format!("a.toml:1:12: {nearest_first}")), "{unknown}");
        assert!(unknown.ends_with("           ^^^^^^^"), "{unknown}");
        let kind = shown("{ own = 2, height_m = 'tall' }");
        let number = "a.toml:1:23: invalid type: string \"tall\", expected a number\n";
        assert!(kind.contains(number), "{kind}");
        let range = shown("{ own = 2, height_m = 4.0 }");
        assert!(range.contains("a.toml:1:23: `height_m` must lie between 0 and 3"), "{range}");
        let own = shown("{ own = -2, height_m = 1.0 }");
        assert!(own.contains("a.toml:1:9: invalid value: integer `-2`"), "{own}");
        let defaults = commented_defaults::<Joined>();
        assert!(defaults.ends_with("own = 0\n# Height, m.\nheight_m = 0.0\n"), "{defaults}");
    }

    #[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    struct Outer {
        plain: u32,
        joined: Joined,
    }

    #[test]
    fn flattened_settings_of_an_inner_table_are_named_with_their_line() {
        fn shown(line: &str) -> String {
            let text = format!("plain = 1\n\n[joined]\nown = 2\n{line}\n");
            let root = DeTable::parse(&text).unwrap();
            let value = Spanned::new(0..0, DeValue::Table(root.into_inner()));
            parse_settings::<Outer>(Some(value)).unwrap_err().render("a.toml", &text)
        }

        let unknown = shown("hight_m = 1.0");
        let nearest_first =
            "unknown field `hight_m`; did you mean `height_m`? expected one of `own`";
        assert!(unknown.contains(&format!("a.toml:5:1: {nearest_first}")), "{unknown}");
        let kind = shown("height_m = 'tall'");
        assert!(kind.contains("a.toml:5:12: invalid type: string \"tall\""), "{kind}");
        let range = shown("height_m = 4.0");
        assert!(range.contains("a.toml:5:12: `joined.height_m` must lie between"), "{range}");
    }

    #[derive(Serialize, Deserialize, JsonSchema, Clone)]
    #[serde(default, deny_unknown_fields)]
    struct Ranges {
        #[schemars(range(min = 1e-6, max = 1e6))]
        positive: f64,
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        inside: f64,
        any: f64,
        #[schemars(range(min = 1, max = 16))]
        count: usize,
        #[schemars(length(min = 1, max = 2), inner(range(min = 0.5)))]
        list: Vec<f64>,
        inner: InnerRanges,
    }

    #[derive(Serialize, Deserialize, JsonSchema, Clone)]
    #[serde(default, deny_unknown_fields)]
    struct InnerRanges {
        #[schemars(range(max = 2.0))]
        deep: f64,
    }

    impl Default for InnerRanges {
        fn default() -> Self {
            Self { deep: 0.0 }
        }
    }

    impl Default for Ranges {
        fn default() -> Self {
            let inner = InnerRanges::default();
            Self { positive: 1.0, inside: 0.5, any: 0.0, count: 1, list: vec![1.0], inner }
        }
    }

    #[test]
    fn the_first_setting_out_of_its_range_is_named() {
        type Change<'a> = &'a dyn Fn(&mut Ranges);
        fn says(change: Change<'_>) -> String {
            let mut ranges = Ranges::default();
            change(&mut ranges);
            check_settings(&ranges).map_or_else(|error| error.to_string(), |()| "fine".into())
        }
        assert_eq!(says(&|_| ()), "fine");
        assert_eq!(says(&|r| r.positive = 1e6), "fine");
        assert_eq!(says(&|r| r.list = vec![0.5, 9.0]), "fine");
        let wrong: [(Change<'_>, &str); 8] = [
            (&|r| r.positive = 0.0, "`positive` must be positive and at most 1e6, not 0"),
            (&|r| r.inside = 1.0, "`inside` must be positive and below 1, not 1"),
            (&|r| r.any = f64::NAN, "`any` must be a finite number, not NaN"),
            (&|r| r.any = f64::INFINITY, "`any` must be a finite number, not inf"),
            (&|r| r.count = 17, "`count` must lie between 1 and 16, not 17"),
            (&|r| r.list = vec![1.0, 0.4], "`list` must be at least 0.5, not 0.4"),
            (&|r| r.list = vec![], "`list` must have 1 to 2 values, not 0"),
            (&|r| r.inner.deep = 2.5, "`inner.deep` must be at most 2, not 2.5"),
        ];
        for (change, expected) in wrong {
            assert_eq!(says(change), expected);
        }
    }

    #[test]
    fn a_number_out_of_its_range_is_shown_at_its_key() {
        let text = "x = { any = 1.0, inner = { deep = 9.0 } }";
        let mut root = DeTable::parse(text).unwrap().into_inner();
        let error = parse_settings::<Ranges>(root.remove("x")).err().unwrap();
        assert_eq!(error.span.map(|span| &text[span]), Some("9.0"));
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
