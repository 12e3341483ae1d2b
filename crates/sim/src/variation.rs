//! Any number of scenes from one file: its table `[vary]` lists the values that differ from seed to
//! seed, and a caller may set further values. Both are applied to the TOML before it is read as a
//! scene, so that an error is reported at its position in the file.

use std::ops::Range;

use serde::Deserialize;
use tagalong_config::ConfigError;
use tagalong_math::fingerprint;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue, ValueDeserializer};

use crate::random::Random;
use crate::split::Split;

const HOW: &str = "write { between = [low, high] }, { one_of = [...] }, { in_turn = [...] } or \
    { same_as = \"key\" }";

/// Selection of one of the scenes that a file describes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variant {
    /// Seed to use instead of the one in the file: an index within `split` if that is given.
    pub seed: Option<u64>,
    /// Split from which the seed is taken.
    pub split: Option<Split>,
    /// Values that replace those of the file and of its variations: dotted keys, with indices into
    /// lists (`people.0.speed_mps`), and values as in TOML, where words need no quotes.
    pub set: Vec<(String, String)>,
}

impl Variant {
    /// Selects the scene of a seed.
    pub fn of_seed(seed: u64) -> Self {
        Self { seed: Some(seed), ..Self::default() }
    }

    /// Selects the scene with this index within a split.
    pub fn of_split(split: Split, number: u64) -> Self {
        Self { seed: Some(number), split: Some(split), set: Vec::new() }
    }

    /// Returns the variant with one more value set.
    pub fn with(mut self, key: &str, value: impl ToString) -> Self {
        self.set.push((key.to_owned(), value.to_string()));
        self
    }

    fn choose(&self, in_file: u64) -> Result<u64, ConfigError> {
        let seed = self.seed.unwrap_or(in_file);
        self.split.map_or(Ok(seed), |split| split.seed(seed))
    }
}

/// Reads a file of scenes as the table of one scene, passes it to `read`, and returns the result.
pub fn one_scene<T>(
    text: &str,
    variant: &Variant,
    read: impl FnOnce(DeTable<'_>, u64) -> Result<T, ConfigError>,
) -> Result<T, ConfigError> {
    resolve(text, variant, read).map_err(|error| blame_argument(error, text, variant))
}

fn resolve<T>(
    text: &str,
    variant: &Variant,
    read: impl FnOnce(DeTable<'_>, u64) -> Result<T, ConfigError>,
) -> Result<T, ConfigError> {
    let set: Vec<Change> =
        variant.set.iter().enumerate().map(|(i, s)| argument(text, i, s)).collect();
    let mut written = DeTable::parse(text)?.into_inner();
    let mut rules = Rule::all(written.remove("vary"))?;
    // A seed that was set also determines the drawn values.
    apply(&mut written, set.iter().filter(|change| change.key == "seed"))?;
    rules.retain(|rule| !set.iter().any(|change| is_within(&rule.key, &change.key)));
    let seed = variant.choose(seed_of(&written))?;
    let drawn: Vec<Change> = rules.iter().filter_map(|rule| rule.draw(seed)).collect();
    let mut own = written;
    apply(&mut own, drawn.iter().chain(&set))?;
    let copies = rules.iter().filter_map(|rule| rule.copy(&own).transpose());
    let copies: Vec<Change> = copies.collect::<Result<_, _>>()?;
    let mut all = own;
    apply(&mut all, &copies)?;
    read(all, seed)
}

fn apply<'a>(
    root: &mut DeTable<'a>,
    changes: impl IntoIterator<Item = &'a Change>,
) -> Result<(), ConfigError> {
    changes.into_iter().try_for_each(|change| change.apply(root))
}

/// Returns true if `key` is `outer` or is inside of it.
fn is_within(key: &str, outer: &str) -> bool {
    key.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn seed_of(root: &DeTable<'_>) -> u64 {
    let number = root.get("seed").and_then(|v| v.get_ref().as_integer());
    number.and_then(|n| u64::from_str_radix(n.as_str(), n.radix()).ok()).unwrap_or(1)
}

/// A value to put at a key.
struct Change {
    key: String,
    /// The value in TOML.
    value: String,
    /// Position of the request, for errors.
    span: Range<usize>,
}

/// Returns the change of an argument. For errors, arguments count as following the end of the text,
/// one byte each.
fn argument(text: &str, index: usize, (key, value): &(String, String)) -> Change {
    let at = text.len() + 1 + index;
    let value = match DeValue::parse(value) {
        Ok(_) => value.clone(),
        Err(_) => toml::Value::String(value.clone()).to_string(),
    };
    Change { key: key.clone(), value, span: at..at + 1 }
}

/// Names the argument in an error that has no position in the text.
fn blame_argument(error: ConfigError, text: &str, variant: &Variant) -> ConfigError {
    let index = error.span.as_ref().and_then(|span| span.start.checked_sub(text.len() + 1));
    match index.and_then(|index| variant.set.get(index)) {
        Some((key, value)) => ConfigError::new(format!("{key}={value}: {}", error.message)),
        None => error,
    }
}

impl Change {
    fn apply<'a>(&'a self, root: &mut DeTable<'a>) -> Result<(), ConfigError> {
        let value = DeValue::parse(&self.value).map_err(|error| self.fails(error.message()))?;
        *self.slot(root)? = moved(value.into_inner(), &self.span);
        Ok(())
    }

    /// Returns the place of the key; missing tables are created.
    fn slot<'a, 'r>(
        &'a self,
        root: &'r mut DeTable<'a>,
    ) -> Result<&'r mut Spanned<DeValue<'a>>, ConfigError> {
        let (first, rest) = self.key.split_once('.').unwrap_or((&self.key, ""));
        let mut slot = self.entry(root, first);
        for part in rest.split('.').filter(|part| !part.is_empty()) {
            slot = match slot.get_mut() {
                DeValue::Table(table) if table.is_empty() && is_index(part) => {
                    return Err(self.fails("there is no such list in the file: give it whole"));
                }
                DeValue::Table(table) => self.entry(table, part),
                DeValue::Array(list) => self.item(list, part)?,
                _ => return Err(self.fails(&format!("there is no `{part}` in a plain value"))),
            };
        }
        Ok(slot)
    }

    fn entry<'a, 'r>(
        &self,
        table: &'r mut DeTable<'a>,
        key: &'a str,
    ) -> &'r mut Spanned<DeValue<'a>> {
        table
            .entry(Spanned::new(self.span.clone(), key.into()))
            .or_insert_with(|| Spanned::new(self.span.clone(), DeValue::Table(DeTable::new())))
    }

    fn item<'a, 'r>(
        &self,
        list: &'r mut DeArray<'a>,
        index: &str,
    ) -> Result<&'r mut Spanned<DeValue<'a>>, ConfigError> {
        let length = list.len();
        index.parse().ok().and_then(|index: usize| list.get_mut(index)).ok_or_else(|| {
            self.fails(&format!("there is no entry {index}: the list has {length}, from 0"))
        })
    }

    fn fails(&self, why: &str) -> ConfigError {
        let message = format!("cannot vary `{}`: {why}", self.key);
        ConfigError::new(message).or_at(Some(self.span.clone()))
    }
}

fn is_index(part: &str) -> bool {
    part.bytes().all(|byte| byte.is_ascii_digit())
}

/// Returns the value with all its spans replaced by one.
fn moved<'a>(value: DeValue<'a>, span: &Range<usize>) -> Spanned<DeValue<'a>> {
    let value = match value {
        DeValue::Array(list) => {
            DeValue::Array(list.into_iter().map(|v| moved(v.into_inner(), span)).collect())
        }
        DeValue::Table(table) => {
            let entries = table.into_iter().map(|(key, v)| {
                (Spanned::new(span.clone(), key.into_inner()), moved(v.into_inner(), span))
            });
            DeValue::Table(entries.collect())
        }
        plain => plain,
    };
    Spanned::new(span.clone(), value)
}

/// One line of `[vary]`.
struct Rule {
    key: String,
    span: Range<usize>,
    source: Source,
    /// True for different values in every split.
    apart: bool,
}

enum Source {
    Between(f64, f64),
    Whole(i64, i64),
    OneOf(Vec<toml::Value>),
    InTurn(Vec<toml::Value>),
    SameAs(String),
}

/// A rule as it is written in the file.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Written {
    between: Option<[toml::Value; 2]>,
    one_of: Option<Vec<toml::Value>>,
    in_turn: Option<Vec<toml::Value>>,
    same_as: Option<String>,
    apart: bool,
}

impl Rule {
    /// Returns all rules of `[vary]`, whether its keys are quoted or nested.
    fn all(vary: Option<Spanned<DeValue<'_>>>) -> Result<Vec<Self>, ConfigError> {
        let mut rules = Vec::new();
        vary.map_or(Ok(()), |vary| Self::collect(String::new(), vary, &mut rules))?;
        Ok(rules)
    }

    fn collect(
        key: String,
        value: Spanned<DeValue<'_>>,
        rules: &mut Vec<Self>,
    ) -> Result<(), ConfigError> {
        let span = value.span();
        let DeValue::Table(table) = value.get_ref() else {
            let message = format!("`{key}` does not say how it varies: {HOW}");
            return Err(ConfigError::new(message).or_at(Some(span)));
        };
        let names = ["between", "one_of", "in_turn", "same_as"];
        if names.iter().any(|name| table.contains_key(*name)) {
            rules.push(Self::read(key, value)?);
            return Ok(());
        }
        let DeValue::Table(table) = value.into_inner() else { return Ok(()) };
        for (part, value) in table {
            let part = part.into_inner();
            let inner = if key.is_empty() { part.into_owned() } else { format!("{key}.{part}") };
            Self::collect(inner, value, rules)?;
        }
        Ok(())
    }

    fn read(key: String, value: Spanned<DeValue<'_>>) -> Result<Self, ConfigError> {
        let span = value.span();
        let written = Written::deserialize(ValueDeserializer::from(value))?;
        let apart = written.apart;
        let source =
            written.source().filter(|source| source.is_possible(apart)).ok_or_else(|| {
                let message = format!(
                    "`{key}` does not say how it varies: {HOW}, numbers in rising order, lists not \
                 empty; `apart` needs fractions or a list of three or more"
                );
                ConfigError::new(message).or_at(Some(span.clone()))
            })?;
        Ok(Self { key, span, source, apart })
    }

    /// Returns the value for a seed; `None` for copies of other values.
    fn draw(&self, seed: u64) -> Option<Change> {
        let split = Split::of(seed);
        let mut random = Random::new(seed, stream(&self.key));
        let value = match &self.source {
            Source::Between(low, high) => {
                let uniform = random.uniform();
                let part = if self.apart { split.share(uniform) } else { uniform };
                format!("{:?}", low + (high - low) * part)
            }
            Source::Whole(low, high) => {
                let count = high.abs_diff(*low) + 1;
                (low + random.below(count) as i64).to_string()
            }
            Source::OneOf(values) => {
                let values = self.entries(values, split);
                values[random.below(values.len() as u64) as usize].to_string()
            }
            Source::InTurn(values) => {
                let values = self.entries(values, split);
                values[(Split::number(seed) % values.len() as u64) as usize].to_string()
            }
            Source::SameAs(_) => return None,
        };
        Some(Change { key: self.key.clone(), value, span: self.span.clone() })
    }

    /// Returns the entries of a list that a split may use.
    fn entries<'a>(&self, values: &'a [toml::Value], split: Split) -> Vec<&'a toml::Value> {
        values
            .iter()
            .enumerate()
            .filter(|(i, _)| !self.apart || split.has_entry(*i))
            .map(|(_, value)| value)
            .collect()
    }

    /// Returns the copy of another value, if the rule is a copy.
    fn copy(&self, root: &DeTable<'_>) -> Result<Option<Change>, ConfigError> {
        let Source::SameAs(other) = &self.source else { return Ok(None) };
        let value = find(root, other)
            .ok_or_else(|| {
                let message =
                    format!("`{}` cannot be the same as `{other}`: it is not there", self.key);
                ConfigError::new(message).or_at(Some(self.span.clone()))
            })?
            .clone();
        let value = toml::Value::deserialize(ValueDeserializer::from(value))?.to_string();
        Ok(Some(Change { key: self.key.clone(), value, span: self.span.clone() }))
    }
}

/// Returns the value at a dotted key.
fn find<'r, 'a>(root: &'r DeTable<'a>, key: &str) -> Option<&'r Spanned<DeValue<'a>>> {
    let (first, rest) = key.split_once('.').unwrap_or((key, ""));
    let mut parts = rest.split('.').filter(|part| !part.is_empty());
    parts.try_fold(root.get(first)?, |value, part| match value.get_ref() {
        DeValue::Table(table) => table.get(part),
        DeValue::Array(list) => list.get(part.parse::<usize>().ok()?),
        _ => None,
    })
}

/// Returns the stream of random numbers of a key, far from the small numbers of the streams in the
/// simulation.
fn stream(key: &str) -> u64 {
    fingerprint(key.bytes()) | 1 << 63
}

impl Written {
    /// Returns the source of the value; `None` unless exactly one is given.
    fn source(self) -> Option<Source> {
        match (self.between, self.one_of, self.in_turn, self.same_as) {
            (Some([low, high]), None, None, None) => range(&low, &high),
            (None, Some(values), None, None) => Some(Source::OneOf(values)),
            (None, None, Some(values), None) => Some(Source::InTurn(values)),
            (None, None, None, Some(key)) => Some(Source::SameAs(key)),
            _ => None,
        }
    }
}

fn range(low: &toml::Value, high: &toml::Value) -> Option<Source> {
    fn number(v: &toml::Value) -> Option<f64> {
        v.as_float().or_else(|| v.as_integer().map(|i| i as f64))
    }

    if let (Some(low), Some(high)) = (low.as_integer(), high.as_integer()) {
        return Some(Source::Whole(low, high));
    }
    Some(Source::Between(number(low)?, number(high)?))
}

impl Source {
    fn is_possible(&self, apart: bool) -> bool {
        match self {
            Self::Between(low, high) => low.is_finite() && high.is_finite() && low <= high,
            Self::Whole(low, high) => low <= high && high.abs_diff(*low) < u64::MAX && !apart,
            Self::OneOf(list) | Self::InTurn(list) => list.len() >= if apart { 3 } else { 1 },
            Self::SameAs(_) => !apart,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Scene;

    const TEXT: &str = r#"
[light]
lux = 300.0
[[people]]
path = [[4.0, 3.0], [4.0, 5.0]]
[[people]]
path = [[5.0, 3.0]]
[vary]
"light.lux" = { one_of = [50.0, 100.0, 800.0], apart = true }
crowd = { between = [1, 8] }
camera.height_m = { between = [0.9, 1.5], apart = true }
people.0.path.1.0 = { between = [3.0, 5.0] }
people.0.look = { between = [0, 99] }
people.1.look = { same_as = "people.0.look" }
people.1.speed_mps = { in_turn = [0.5, 0.75, 1.0] }
"#;

    fn drawn(variant: &Variant) -> Scene {
        Scene::parse_with(TEXT, variant).unwrap()
    }

    fn error(text: &str, variant: &Variant) -> String {
        Scene::parse_with(text, variant).unwrap_err().render("s.toml", text)
    }

    #[test]
    fn values_in_turn_follow_the_number_of_the_seed_in_its_split() {
        for (number, speed) in [(0, 0.5), (1, 0.75), (2, 1.0), (3, 0.5)] {
            let scene = drawn(&Variant::of_split(Split::Validation, number));
            assert_eq!(scene.people[1].speed_mps, speed);
            assert_eq!(scene.seed, 1_000_000_000 + number);
        }
    }

    #[test]
    fn what_is_set_outdoes_the_file_and_what_varies() {
        let variant = Variant::of_seed(3)
            .with("crowd", 5)
            .with("camera.kind", "stereo")
            .with("people.0.path", "[[1.5, 1.0], [2, 2]]")
            .with("people.0.look", 7);
        let scene = drawn(&variant);
        assert_eq!((scene.crowd, scene.camera.kind), (5, crate::CameraKind::Stereo));
        assert_eq!(scene.people[0].path, [[1.5, 1.0], [2.0, 2.0]]);
        assert_eq!((scene.people[0].look, scene.people[1].look), (Some(7), Some(7)));
    }

    #[test]
    fn a_seed_that_is_set_is_the_seed_of_the_scene() {
        let set = drawn(&Variant::default().with("seed", 9));
        assert_eq!(set, drawn(&Variant::of_seed(9)));
        assert_ne!(set.crowd, drawn(&Variant::of_seed(3)).crowd);
        assert_eq!(drawn(&Variant::of_seed(3).with("seed", 9)).seed, 3);
    }

    #[test]
    fn mistakes_are_shown_where_they_were_written() {
        let plain = Variant::default();
        let told = error("[vary]\ncrowd = { betwen = [1, 2] }\n", &plain);
        assert!(told.starts_with("s.toml:2:") && told.contains("between = [low"), "{told}");
        let told = error("[vary]\ncrowd = { between = [3, 2] }\n", &plain);
        assert!(told.starts_with("s.toml:2:") && told.contains("rising order"), "{told}");
        let told = error("[vary]\nlight.luxx = { one_of = [1.0] }\n", &plain);
        assert!(told.starts_with("s.toml:2:") && told.contains("did you mean `lux`?"), "{told}");
        let told =
            error("[vary]\npeople.2.look = { one_of = [1] }\n[[people]]\npath=[[1,1]]", &plain);
        assert!(told.contains("the list has 1"), "{told}");
        let told = error("[vary]\nroom.size_m.0 = { one_of = [9.0] }\n", &plain);
        assert!(told.starts_with("s.toml:2:") && told.contains("give it whole"), "{told}");
        let told = error("[vary]\ncrowd = { one_of = ['a'] }\n", &plain);
        assert!(told.starts_with("s.toml:2:") && told.contains("expected usize"), "{told}");
        let told = error(TEXT, &Variant::default().with("room.hight_m", 3.0));
        assert!(told.starts_with("s.toml: room.hight_m=3: "), "{told}");
        assert!(told.contains("did you mean `height_m`?"), "{told}");
        let told = error("", &Variant::of_split(Split::Test, 1_000_000_000));
        assert!(told.contains("does not belong to the split test"), "{told}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn the_same_seed_draws_the_same_scene_and_splits_differ_in_what_is_apart(
            a in 0..1_000_000u64, b in 0..1_000_000u64,
        ) {
            let scenes = Split::ALL.map(|split| drawn(&Variant::of_split(split, a)));
            for (split, scene) in Split::ALL.into_iter().zip(&scenes) {
                prop_assert_eq!(scene, &drawn(&Variant::of_split(split, a)));
                prop_assert!((1..=8).contains(&scene.crowd));
                prop_assert!((3.0..=5.0).contains(&scene.people[0].path[1][0]));
                prop_assert!((0.9..=1.5).contains(&scene.camera.height_m));
                prop_assert_eq!(scene.people[0].look, scene.people[1].look);
                let other = drawn(&Variant::of_split(Split::ALL[(split as usize + 1) % 3], b));
                prop_assert_ne!(scene.camera.height_m, other.camera.height_m);
                prop_assert_ne!(scene.light.lux, other.light.lux);
                let again = toml::to_string(scene).unwrap();
                prop_assert_eq!(scene, &Scene::parse(&again).unwrap());
            }
        }
    }
}
