//! Defaults in the READMEs of plugins, against those of the generated page of all settings.

use std::collections::BTreeMap;

use crate::accuracy::cells;

/// Defaults of the settings of each plugin, by its name.
pub type Defaults<'a> = BTreeMap<&'a str, BTreeMap<&'a str, &'a str>>;

/// Reads the defaults from the generated page: tables of "| `key` | `default` | meaning |" below
/// headings "### `plugin` (kind)".
pub fn of_page(page: &str) -> Defaults<'_> {
    let mut all = Defaults::new();
    let mut plugin = None;
    for line in page.lines() {
        if line.starts_with('#') {
            plugin = named_in(line);
        } else if let (Some(plugin), [key, default, ..]) = (plugin, &setting_cells(line)[..]) {
            all.entry(plugin).or_default().insert(key.trim_matches('`'), default.trim_matches('`'));
        }
    }
    all
}

/// Returns the name of the plugin in a heading "### `plugin` (kind)".
pub fn named_in(heading: &str) -> Option<&str> {
    heading.strip_prefix("### `")?.split_once("` (").map(|(name, _)| name)
}

/// Returns the numbers in the tables of a README that are not the defaults of its plugin. A row names
/// one setting or several, with as many defaults; words instead of a number are not compared.
pub fn wrong_defaults(readme: &str, of_plugin: &BTreeMap<&str, &str>) -> Vec<String> {
    let mut complaints = Vec::new();
    for line in readme.lines() {
        let [keys, told, ..] = &setting_cells(line)[..] else { continue };
        let keys: Vec<&str> = keys.split(", ").map(|key| key.trim_matches('`')).collect();
        let told: Vec<&str> = told.split(", ").map(|value| value.trim_matches('`')).collect();
        if keys.len() != told.len() {
            continue;
        }
        for (key, told) in keys.into_iter().zip(told) {
            let Some(default) = of_plugin.get(key) else { continue };
            if let (Some(told_number), Some(number)) = (parse_number(told), parse_number(default))
                && told_number != number
            {
                complaints
                    .push(format!("says {told} for `{key}`, of which the default is {default}"));
            }
        }
    }
    complaints
}

/// Returns the cells of a row of settings; none of another line.
fn setting_cells(line: &str) -> Vec<&str> {
    if line.starts_with("| `") { cells(line) } else { Vec::new() }
}

fn parse_number(text: &str) -> Option<f64> {
    text.replace(',', "").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "## All\n| `a` | `9` | of no plugin |\n### `p-q` (filter)\n\n| key | default | m |\n|---|---|---|\n\
                        | `a` | `2` | one |\n| `b` | `-0.5` | two |\n| `w` | `\"x\"` | a word |\n\
                        ### `r` (filter)\n| `a` | `12000` | other |\n";

    #[test]
    fn the_page_has_the_defaults_of_each_plugin() {
        let defaults = of_page(PAGE);
        assert_eq!(defaults.keys().collect::<Vec<_>>(), [&"p-q", &"r"]);
        assert_eq!(defaults["p-q"]["b"], "-0.5");
        assert_eq!(defaults["r"]["a"], "12000");
    }

    #[test]
    fn numbers_that_are_not_the_defaults_are_told() {
        let defaults = of_page(PAGE);
        for (row, expected) in [
            ("| `a`, `b` | 2, -0.50 | right |", &[][..]),
            (
                "| `a`, `b` | 3, -0.5 | the first is wrong |",
                &["says 3 for `a`, of which the default is 2"],
            ),
            ("| `b` | `0.5` | wrong |", &["says 0.5 for `b`, of which the default is -0.5"]),
            ("| `a` | by family | words |", &[]),
            ("| `w` | 3 | a number for a word |", &[]),
            ("| `unknown` | 3 | no setting |", &[]),
            ("| `a` | 3, 4 | not as many |", &[]),
            ("`a` | 3 | no row", &[]),
        ] {
            assert_eq!(wrong_defaults(row, &defaults["p-q"]), expected, "{row}");
        }
        assert!(wrong_defaults("| `a` | 12,000 | thousands |", &defaults["r"]).is_empty());
    }
}
