//! A config with the configs that it extends: `extends = "base.toml"`.
//!
//! The texts are joined end to end, so that a byte range identifies the file in which it lies.

use std::io;
use std::mem;
use std::ops::Range;
use std::path::{Path, PathBuf};

use tagalong_config::{ConfigError, FileLimit, model_hint, nearest, read_text};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use super::{builtin, tune};

/// Longest config, bytes.
const MAX_BYTES: usize = 1 << 20;
/// Deepest nesting of a config.
const MAX_DEPTH: usize = 32;
/// Most configs that extend one another.
const MAX_BASES: usize = 8;
/// The key that names the config to extend.
pub(super) const EXTENDS: &str = "extends";

/// Ending of the name of a config.
const ENDING: &str = "toml";

/// A config, and those that it extends.
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    text: String,
    bases: Vec<Base>,
}

/// A config that is extended.
#[derive(Clone, Debug, PartialEq)]
struct Base {
    path: PathBuf,
    /// The text behind as much space as the texts before it take.
    padded: String,
    start: usize,
    /// Part of the program, and so are the configs that it extends: no file stands for them.
    is_builtin: bool,
}

impl Base {
    fn text(&self) -> &str {
        self.padded.get(self.start..).unwrap_or_default()
    }

    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }
}

impl Document {
    /// Reads a config. The config that it extends is looked for from `folder`.
    ///
    /// # Errors
    /// A text that is no TOML, too long or nested too deep, an entry that an inherited list does not
    /// have, and a base that cannot be read, extends itself, or has such a fault.
    pub fn read(text: &str, folder: &Path) -> Result<Self, ConfigError> {
        Self::read_from(text, folder, false)
    }

    /// Reads a config that is part of the program, and so are those that it extends.
    ///
    /// # Errors
    /// As [`Document::read`].
    pub(super) fn read_builtin(text: &str) -> Result<Self, ConfigError> {
        Self::read_from(text, Path::new("configs"), true)
    }

    fn read_from(text: &str, folder: &Path, mut is_builtin: bool) -> Result<Self, ConfigError> {
        let mut document = Self { text: text.to_owned(), bases: Vec::new() };
        let mut folder = folder.to_owned();
        let mut end = text.len();
        let mut extends = parse(text, 0)?.remove(EXTENDS).map(name_of);
        while let Some((name, span)) = &extends {
            let base = base_at(&folder, name.as_deref(), end, &document.bases, is_builtin)
                .map_err(|message| ConfigError::new(message).or_at(Some(span.clone())));
            let base = base.map_err(|error| document.locate(error))?;
            end = base.padded.len();
            is_builtin = base.is_builtin;
            base.folder().clone_into(&mut folder);
            document.bases.push(base.clone());
            let table = parse(&base.padded, base.start).map_err(|error| document.locate(error));
            extends = table?.remove(EXTENDS).map(name_of);
        }
        document.root()?;
        Ok(document)
    }

    /// Returns the config with everything that it inherits.
    ///
    /// # Errors
    /// None for a config that was read.
    pub(crate) fn root(&self) -> Result<DeTable<'_>, ConfigError> {
        // From the far end: each config knows then which plugins it inherits.
        let mut inherited = DeTable::new();
        for base in self.bases.iter().rev() {
            let mut table = parse(&base.padded, base.start)?;
            table.remove(EXTENDS);
            // A list of values to try belongs to the file that was written for the trial.
            table.remove(tune::TABLE);
            let mut table =
                if base.is_builtin { table } else { anchor_paths(table, base.folder()) };
            inherit(&mut table, inherited).map_err(|error| self.locate(error))?;
            inherited = table;
        }
        let mut root = parse(&self.text, 0)?;
        root.remove(EXTENDS);
        inherit(&mut root, inherited)?;
        Ok(root)
    }

    /// Returns the lists of tables that a config states anew, with their length and that of the list which
    /// they replace.
    ///
    /// # Errors
    /// None for a config that was read.
    pub fn replaced_lists(&self) -> Result<Vec<(String, usize, usize)>, ConfigError> {
        let Some(base) = self.bases.first() else { return Ok(Vec::new()) };
        let rest = Self { text: base.text().to_owned(), bases: self.bases[1..].to_vec() };
        let inherited = rest.root()?;
        let mut replaced = Vec::new();
        for (key, own) in &parse(&self.text, 0)? {
            let before = inherited.get(key).map(Spanned::get_ref);
            if let (DeValue::Array(own), Some(DeValue::Array(before))) = (own.get_ref(), before)
                && own.iter().any(|entry| entry.get_ref().is_table())
            {
                replaced.push((key.get_ref().to_string(), own.len(), before.len()));
            }
        }
        Ok(replaced)
    }

    /// Returns the texts of the configs that are extended, with their paths, the nearest first.
    pub fn bases(&self) -> impl Iterator<Item = (&Path, &str)> {
        self.bases.iter().map(|base| (base.path.as_path(), base.text()))
    }

    /// Returns the config with everything that it inherits, without places.
    ///
    /// # Errors
    /// None for a config that was read.
    pub fn table(&self) -> Result<toml::Table, ConfigError> {
        use serde::Deserialize;
        let whole = Spanned::new(0..0, DeValue::Table(self.root()?));
        Ok(toml::Table::deserialize(toml::de::ValueDeserializer::from(whole))?)
    }

    /// Returns the config as one TOML text that extends no other: the text itself if it does so
    /// already.
    ///
    /// # Errors
    /// None for a config that was read.
    pub(super) fn into_flat_text(self) -> Result<String, ConfigError> {
        if self.bases.is_empty() {
            return Ok(self.text);
        }
        toml::to_string(&self.table()?).map_err(|error| ConfigError::new(error.to_string()))
    }

    /// Names the file of a mistake that lies in a base, with the line there.
    pub fn locate(&self, error: ConfigError) -> ConfigError {
        let Some(span) = &error.span else { return error };
        let Some(base) = self.bases.iter().rev().find(|base| base.start <= span.start) else {
            return error;
        };
        let start = span.start.saturating_sub(base.start);
        let span = Range { start, end: span.end.saturating_sub(base.start) };
        let there = ConfigError::new(error.message).or_at(Some(span));
        // No file stands for a config that is part of the program.
        let kind = if base.is_builtin { "the built-in " } else { "" };
        let path = base.path.display().to_string();
        let shown = there.render(&path, base.text());
        ConfigError::new(format!("it extends {kind}{path}, where:\n{shown}"))
    }
}

/// Returns a config as one TOML text that extends no other: the text itself if it does so
/// already.
///
/// # Errors
/// As [`Document::read`].
pub fn flattened(text: &str, folder: &Path) -> Result<String, ConfigError> {
    Document::read(text, folder)?.into_flat_text()
}

/// Parses a text that begins at byte `start` of the given one.
fn parse(padded: &str, start: usize) -> Result<DeTable<'_>, ConfigError> {
    let bytes = padded.len() - start;
    if bytes > MAX_BYTES {
        let message = format!("the config has {bytes} bytes; at most {MAX_BYTES} are read");
        return Err(ConfigError::new(message));
    }
    let root = DeTable::parse(padded)?.into_inner();
    for value in root.values() {
        if depth(value.get_ref()) >= MAX_DEPTH {
            let message = format!("nested deeper than {MAX_DEPTH} levels");
            return Err(ConfigError::new(message).or_at(Some(value.span())));
        }
    }
    Ok(root)
}

/// Returns the levels of nesting below a value. The parser bounds the recursion.
fn depth(value: &DeValue<'_>) -> usize {
    match value {
        DeValue::Array(items) => 1 + items.iter().map(|v| depth(v.get_ref())).max().unwrap_or(0),
        DeValue::Table(table) => 1 + table.values().map(|v| depth(v.get_ref())).max().unwrap_or(0),
        _ => 0,
    }
}

/// Returns the path that a value names, and its place.
fn name_of(value: Spanned<DeValue<'_>>) -> (Option<String>, Range<usize>) {
    (value.get_ref().as_str().map(str::to_owned), value.span())
}

fn base_at(
    folder: &Path,
    name: Option<&str>,
    start: usize,
    before: &[Base],
    of_builtin: bool,
) -> Result<Base, String> {
    let Some(name) = name else { return Err(format!("`{EXTENDS}` must be the path of a config")) };
    let path = folder.join(name);
    if before.len() == MAX_BASES || before.iter().any(|base| base.path == path) {
        return Err(format!(
            "`{EXTENDS}` goes on in a circle, or through more than {MAX_BASES} configs"
        ));
    }
    if !is_config(&path) {
        let shown = path.display();
        let remedy = match path.extension() {
            None => format!("; write `{EXTENDS} = \"{name}.{ENDING}\"`"),
            Some(_) => String::new(),
        };
        return Err(format!(
            "cannot extend {shown}: a config is a file whose name ends in .{ENDING}{remedy}"
        ));
    }
    let found = if of_builtin {
        builtin::read_base(&path).map(|text| (text, true))
    } else {
        file_or_builtin(&path, name)
    };
    let (text, is_builtin) = found.map_err(|error| {
        let hint =
            if error.kind() == io::ErrorKind::NotFound { hint(&path) } else { String::new() };
        format!("cannot extend {}: {error}{hint}", path.display())
    })?;
    Ok(Base { path, padded: "\n".repeat(start) + &text, start, is_builtin })
}

/// Returns the text of a config, and whether it is built in. A file stands before a built-in config,
/// which is looked up by its name where there is none: a program that was installed comes without the
/// folder of its configs.
fn file_or_builtin(path: &Path, name: &str) -> io::Result<(String, bool)> {
    let error = match read_text(path, FileLimit::Config) {
        Ok(text) => return Ok((text, false)),
        Err(error) => error,
    };
    if error.kind() != io::ErrorKind::NotFound {
        return Err(error);
    }
    builtin::text_of_file(name).map(|text| (text.to_owned(), true)).ok_or(error)
}

/// Returns "; did you mean `NAME.toml`?" for a base that is missing, with the nearest config of its
/// folder or built-in one; nothing if none is near.
fn hint(missing: &Path) -> String {
    let wanted = missing.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    if builtin::OF_A_FILE.contains(&wanted) {
        return format!(
            "; `{wanted}` runs the network of a file, and is not built in: extend the config of an \
             installed network by its path"
        );
    }
    let hint = model_hint(missing, &[]);
    if !hint.is_empty() {
        return hint;
    }
    let best = nearest(wanted, builtin::builtin_names());
    best.map_or(String::new(), |best| format!("; did you mean `{best}.{ENDING}`?"))
}

/// Returns true for a file that is a config by its name. The mistakes of a base are shown with their
/// lines, and a config may come from anywhere: it must not show those of other files.
fn is_config(path: &Path) -> bool {
    // A link does not lend its name to another file.
    let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    [path, &real].iter().all(|path| path.extension().is_some_and(|ending| ending == ENDING))
}

/// Adds the keys that a table lacks. A list replaces the inherited one; a table of its indices
/// (`detectors.0.config.min_body = 0.3`) changes its entries. The settings of another plugin are not
/// inherited.
///
/// # Errors
/// An entry that the list does not have.
fn inherit<'a>(table: &mut DeTable<'a>, base: DeTable<'a>) -> Result<(), ConfigError> {
    for (key, value) in base {
        match table.get_mut(&key) {
            Some(own) => inherit_value(own.get_mut(), value.into_inner())?,
            None => {
                table.insert(key, value);
            }
        }
    }
    Ok(())
}

fn inherit_value<'a>(own: &mut DeValue<'a>, base: DeValue<'a>) -> Result<(), ConfigError> {
    match (&mut *own, base) {
        (DeValue::Table(own), DeValue::Table(base)) if same_plugin(own, &base) => {
            inherit(own, base)
        }
        (DeValue::Table(changes), DeValue::Array(items)) => {
            *own = DeValue::Array(change_entries(items, mem::take(changes))?);
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Changes entries of a list by their indices.
fn change_entries<'a>(
    mut items: DeArray<'a>,
    changes: DeTable<'a>,
) -> Result<DeArray<'a>, ConfigError> {
    let length = items.len();
    for (index, change) in changes {
        let at = index.get_ref().parse().ok();
        let Some(item) = at.and_then(|at: usize| items.get_mut(at)) else {
            let message = format!(
                "there is no entry `{}`: the list of the extended config has {length}, from 0",
                index.get_ref()
            );
            return Err(ConfigError::new(message).or_at(Some(index.span())));
        };
        let inherited = mem::replace(item, change);
        inherit_value(item.get_mut(), inherited.into_inner())?;
    }
    Ok(items)
}

fn same_plugin(own: &DeTable<'_>, base: &DeTable<'_>) -> bool {
    let [own, base] = [own, base].map(|table| table.get("plugin")?.get_ref().as_str());
    own.is_none() || base.is_none() || own == base
}

/// Lets texts that name files beside a base do so from elsewhere.
fn anchor_paths<'a>(table: DeTable<'a>, folder: &Path) -> DeTable<'a> {
    table.into_iter().map(|(key, value)| (key, anchor_path(value, folder))).collect()
}

fn anchor_path<'a>(value: Spanned<DeValue<'a>>, folder: &Path) -> Spanned<DeValue<'a>> {
    let span = value.span();
    let anchored = match value.into_inner() {
        DeValue::String(name) if !name.is_empty() && folder.join(&*name).is_file() => {
            DeValue::String(folder.join(&*name).display().to_string().into())
        }
        DeValue::Array(items) => {
            DeValue::Array(items.into_iter().map(|item| anchor_path(item, folder)).collect())
        }
        DeValue::Table(table) => DeValue::Table(anchor_paths(table, folder)),
        other => other,
    };
    Spanned::new(span, anchored)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        folder
    }

    fn table(text: &str, files: &[(&str, &str)]) -> Result<toml::Table, String> {
        let folder = folder(files);
        Document::read(text, folder.path())
            .and_then(|document| document.table())
            .map_err(|error| error.render("own.toml", text))
    }

    #[test]
    fn a_config_states_only_what_differs() {
        let base = "[filter]\nplugin = 'a'\nconfig = { x = 1, y = 2 }\n[clock]\nmax_gap_s = 1.0\n\
                    [[detectors]]\nplugin = 'd'\n[[detectors]]\nplugin = 'e'\n[tune]\nx = [1]\n";
        let own = "extends = 'base.toml'\nfilter.config.y = 3\n[[detectors]]\nplugin = 'f'\n";
        let expected = "[filter]\nplugin = 'a'\nconfig = { x = 1, y = 3 }\n\
                        [clock]\nmax_gap_s = 1.0\n[[detectors]]\nplugin = 'f'\n";
        assert_eq!(table(own, &[("base.toml", base)]).unwrap(), expected.parse().unwrap());
    }

    #[test]
    fn an_index_changes_one_entry_of_an_inherited_list() {
        let base = "[[detectors]]\nplugin = 'd'\nconfig = { x = 1, y = 2 }\n\
                    [[detectors]]\nplugin = 'e'\nconfig = { z = 3 }\n";
        let middle = "extends = 'base.toml'\ndetectors.1.config.z = 4\n";
        let files = [("base.toml", base), ("middle.toml", middle)];
        let own = "extends = 'middle.toml'\n[detectors.0]\nconfig = { x = 5 }\n";
        let expected = "[[detectors]]\nplugin = 'd'\nconfig = { x = 5, y = 2 }\n\
                        [[detectors]]\nplugin = 'e'\nconfig = { z = 4 }\n";
        assert_eq!(table(own, &files).unwrap(), expected.parse().unwrap());
        // Another plugin in its place has its own defaults.
        let own = "extends = 'base.toml'\ndetectors.0.plugin = 'f'\n";
        let expected = "[[detectors]]\nplugin = 'f'\n\
                        [[detectors]]\nplugin = 'e'\nconfig = { z = 3 }\n";
        assert_eq!(table(own, &files).unwrap(), expected.parse().unwrap());

        let error = table("extends = 'base.toml'\n[detectors.2]\nevery = 2\n", &files).unwrap_err();
        assert!(error.starts_with("own.toml:2:12: there is no entry `2`"), "{error}");
        let named = table("extends = 'base.toml'\n[detectors.d]\nevery = 2\n", &files).unwrap_err();
        assert!(named.contains("there is no entry `d`: the list"), "{named}");
        let odd = [("base.toml", base), ("odd.toml", "extends = 'base.toml'\ndetectors.9 = {}\n")];
        let there = table("extends = 'odd.toml'\n", &odd).unwrap_err();
        assert!(there.contains("odd.toml:2:11: there is no entry `9`"), "{there}");
    }

    #[test]
    fn lists_that_replace_inherited_ones_are_named() {
        let base = "x = [1]\n[[detectors]]\nplugin = 'd'\n[[detectors]]\nplugin = 'e'\n";
        let own = "extends = 'base.toml'\nx = [2]\n[[detectors]]\nplugin = 'f'\n";
        let folder = folder(&[("base.toml", base)]);
        let document = Document::read(own, folder.path()).unwrap();
        assert_eq!(document.replaced_lists().unwrap(), [("detectors".to_owned(), 1, 2)]);
        let changed = "extends = 'base.toml'\ndetectors.0.every = 2\n";
        let document = Document::read(changed, folder.path()).unwrap();
        assert_eq!(document.replaced_lists().unwrap(), []);
    }

    #[test]
    fn another_plugin_inherits_no_settings() {
        let base = "filter = { plugin = 'a', config = { x = 1 } }\n";
        let middle = "extends = 'base.toml'\nfilter.config.y = 2\n";
        let files = [("base.toml", base), ("middle.toml", middle)];
        for extended in ["base.toml", "middle.toml"] {
            let own = format!("extends = '{extended}'\nfilter.plugin = 'b'\n");
            let expected = "filter = { plugin = 'b' }\n".parse().unwrap();
            assert_eq!(table(&own, &files).unwrap(), expected);
        }
    }

    #[test]
    fn a_base_may_extend_another_one_in_its_own_folder() {
        let files = [
            ("sub/near.toml", "extends = 'far.toml'\na = 1\nb = 1\n"),
            ("sub/far.toml", "a = 2\nb = 2\nc = 'model.txt'\n"),
            ("sub/model.txt", "x"),
        ];
        let read = table("extends = 'sub/near.toml'\nb = 0\n", &files).unwrap();
        assert_eq!((read["a"].as_integer(), read["b"].as_integer()), (Some(1), Some(0)));
        let model = read["c"].as_str().unwrap();
        assert!(Path::new(model).ends_with("sub/model.txt"), "{model}");
    }

    #[test]
    fn a_built_in_robot_is_extended_from_any_folder_with_all_that_it_extends() {
        let built_in: toml::Table =
            builtin::builtin_text("turtlebot4").expect("built in").parse().expect("TOML");
        // A file with the name of a config that the built-in one extends does not get between them.
        let other = ("follow-low.toml", "[robot]\nwheel_half_separation_m = 9.0\n");
        for files in [&[][..], &[other, ("robots/another.toml", "")]] {
            for name in ["robots/turtlebot4.toml", "turtlebot4.toml"] {
                let own = format!(
                    "extends = '{name}'\nrobot.max_speed_mps = 0.2\n\
                     [collision_monitor]\nsources.0.topic = '/robot1/hazard_detection'\n"
                );
                let read = table(&own, files).expect("it is found");
                let mut expected = built_in.clone();
                expected["robot"]["max_speed_mps"] = 0.2.into();
                let sources = &mut expected["collision_monitor"]["sources"];
                sources[0]["topic"] = "/robot1/hazard_detection".into();
                assert_eq!(read, expected, "{name}");
            }
        }
    }

    #[test]
    fn a_file_of_the_robot_stands_before_the_built_in_one() {
        let files =
            [("robots/turtlebot4.toml", "extends = '../near.toml'\n"), ("near.toml", "a = 1\n")];
        let read = table("extends = 'robots/turtlebot4.toml'\n", &files).expect("both are files");
        assert_eq!(read.get("a").and_then(toml::Value::as_integer), Some(1));
        assert_eq!(read.len(), 1);
    }

    #[test]
    fn names_in_a_built_in_base_are_no_files() {
        let files = [("clear-follow", "a file that is called like a plugin")];
        let read = table("extends = 'follow-depth.toml'\n", &files).expect("it is built in");
        assert_eq!(read["controller"]["plugin"].as_str(), Some("clear-follow"));
    }

    #[test]
    fn mistakes_of_a_base_are_shown_there() {
        let shown = table("extends = 'base.toml'\n", &[("base.toml", "a = 1\nb = \n")]);
        let shown = shown.unwrap_err();
        for words in ["own.toml: it extends ", "base.toml:2:5: ", "b = "] {
            assert!(shown.contains(words), "{shown}");
        }
    }

    #[test]
    fn no_line_of_a_file_that_is_no_config_is_shown() {
        let secret = "root:$6$salt$hash:19000:0:99999:7:::\nSEED = 'abc'\n";
        for name in ["shadow", "secret.env", "sub/secret.txt"] {
            let own = format!("a = 1\nextends = '{name}'\n");
            let shown = table(&own, &[(name, secret)]).unwrap_err();
            assert!(shown.contains("own.toml:2:11: cannot extend "), "{shown}");
            assert!(shown.contains("ends in .toml"), "{shown}");
            assert!(!shown.contains("salt") && !shown.contains("abc"), "{shown}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_with_the_name_of_a_config_shows_no_line_either() {
        let folder = folder(&[("shadow", "root:$6$salt$hash\n"), ("real.toml", "a = \n")]);
        for name in ["shadow", "real.toml"] {
            let link = folder.path().join(format!("to-{}.toml", name.len()));
            std::os::unix::fs::symlink(folder.path().join(name), &link).unwrap();
        }
        let [secret, config] = ["extends = 'to-6.toml'\n", "extends = 'to-9.toml'\n"]
            .map(|own| Document::read(own, folder.path()).unwrap_err().render("own", own));
        assert!(secret.contains("ends in .toml") && !secret.contains("salt"), "{secret}");
        assert!(config.contains("to-9.toml:1:5: "), "{config}");
    }

    #[test]
    fn circles_and_missing_bases_are_refused_with_their_line() {
        let missing = table("a = 1\nextends = 'b.toml'\n", &[]).unwrap_err();
        assert!(missing.contains("own.toml:2:11: cannot extend "), "{missing}");
        let mistyped = table("extends = 'depth-ekff.toml'\n", &[]).unwrap_err();
        assert!(mistyped.contains("; did you mean `depth-ekf.toml`?"), "{mistyped}");
        let network = table("extends = 'colour-net.toml'\n", &[]).unwrap_err();
        assert!(network.contains("`colour-net` runs the network of a file"), "{network}");
        let own = table("extends = 'robt.toml'\n", &[("robot.toml", "")]).unwrap_err();
        assert!(own.contains("; did you mean `robot.toml`?"), "{own}");
        // A plain name without a file is that of a built-in config.
        let builtin = table("extends = 'mono.toml'\n", &[]).unwrap();
        assert!(builtin.contains_key("filter"), "{builtin:?}");
        let robot = table("extends = 'robots/turtlebot.toml'\n", &[]).unwrap_err();
        assert!(robot.contains("; did you mean `turtlebot"), "{robot}");
        let elsewhere = table("extends = 'robots/follow-low.toml'\n", &[]).unwrap_err();
        assert!(elsewhere.contains("; did you mean `follow-low.toml`?"), "{elsewhere}");
        let circle = [("b.toml", "extends = 'b.toml'\n")];
        let circle = table("extends = 'b.toml'\n", &circle).unwrap_err();
        assert!(circle.contains("b.toml:1:11: `extends` goes on in a circle"), "{circle}");
        let number = table("extends = 1\n", &[]).unwrap_err();
        assert!(number.contains("own.toml:1:11: `extends` must be the path"), "{number}");
    }

    #[test]
    fn what_extends_nothing_stays_as_it_is() {
        let text = "# a comment\nseed = 1\n";
        assert_eq!(flattened(text, Path::new(".")).unwrap(), text);
        let folder = folder(&[("b.toml", "a = 1\n")]);
        assert_eq!(
            flattened("extends = 'b.toml'\nc = 2\n", folder.path()).unwrap(),
            "a = 1\nc = 2\n"
        );
    }
}
