//! Checks of all kinds of plugin.

use tagalong_config::nearest;

use crate::subject::{From, Subject};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const BUILDS: Check = ("is built from its defaults", builds);

pub(crate) const CHECKS: &[Check] = &[
    ("defaults survive TOML", defaults_survive),
    ("an unknown key is refused and named", unknown_key_is_named),
    ("every setting is documented", settings_are_documented),
    ("has a summary", has_summary),
];

fn builds(subject: &Subject<'_>) -> Verdict {
    subject.try_build(From::Nothing)
}

/// Checks that the printed defaults are TOML, contain each required setting, and can be built. The
/// check "same seed, same output" shows that they also *mean* the defaults.
fn defaults_survive(subject: &Subject<'_>) -> Verdict {
    let text = subject.info.defaults();
    let table: toml::Table =
        toml::from_str(&text).map_err(|e| format!("its printed defaults are no TOML: {e}"))?;
    let schema = subject.info.schema();
    let settings = schema["properties"].as_object();
    for (key, property) in settings.into_iter().flatten() {
        let optional = property.to_string().contains("\"null\"");
        demand(optional || table.contains_key(key), || format!("`{key}` has no default in TOML"))?;
    }
    subject
        .try_build(From::Text(&text))
        .map_err(|error| format!("it refuses its own printed defaults: {error}"))
}

fn unknown_key_is_named(subject: &Subject<'_>) -> Verdict {
    let schema = subject.info.schema();
    let known: Vec<&String> =
        schema["properties"].as_object().into_iter().flat_map(|settings| settings.keys()).collect();
    let wrong = known.first().map_or("no_such_setting".to_owned(), |key| format!("{key}x"));
    let Err(message) = subject.try_build(From::Text(&format!("{wrong} = 1"))) else {
        return Err(format!(
            "it accepts the unknown key `{wrong}`: deny_unknown_fields is missing"
        ));
    };
    demand(message.contains(&wrong), || format!("the refusal does not name `{wrong}`: {message}"))?;
    let meant = nearest(&wrong, known.iter().map(|key| key.as_str()));
    demand(meant.is_none_or(|key| message.contains(&format!("`{key}`"))), || {
        format!("the refusal of `{wrong}` does not name the nearest key: {message}")
    })
}

fn settings_are_documented(subject: &Subject<'_>) -> Verdict {
    let text = subject.info.defaults();
    let mut documented = false;
    for line in text.lines() {
        let is_setting = !line.is_empty() && !line.starts_with(['#', '[', ' ', ']', '}']);
        demand(documented || !is_setting || !line.contains(" = "), || {
            format!("the setting `{line}` has no documentation")
        })?;
        documented = line.starts_with('#');
    }
    Ok(())
}

fn has_summary(subject: &Subject<'_>) -> Verdict {
    let lines = subject.info.summary.lines().count();
    demand(lines == 1, || format!("its summary has {lines} lines instead of one"))
}
