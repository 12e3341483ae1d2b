//! Serialisation of values as text, with a failure that names the value.

use std::fmt::Display;

use serde::Serialize;

use crate::outcome::Failure;

/// Returns a value as indented JSON, with a newline.
///
/// # Errors
/// A value that cannot be written as JSON, such as a map whose keys are not text: exit code 1, with
/// the `name` of the value.
pub fn to_json<T: Serialize + ?Sized>(name: &str, value: &T) -> Result<String, Failure> {
    let text = serde_json::to_string_pretty(value).map_err(|why| failed(name, "JSON", why))?;
    Ok(text + "\n")
}

/// Returns a value as JSON on one line, with a newline.
pub fn to_json_line<T: Serialize + ?Sized>(name: &str, value: &T) -> Result<String, Failure> {
    let text = serde_json::to_string(value).map_err(|why| failed(name, "JSON", why))?;
    Ok(text + "\n")
}

/// Returns a value as TOML.
///
/// # Errors
/// A value that cannot be written as TOML, such as a text outside of a table: exit code 1, with the
/// `name` of the value.
pub fn to_toml<T: Serialize + ?Sized>(name: &str, value: &T) -> Result<String, Failure> {
    toml::to_string(value).map_err(|why| failed(name, "TOML", why))
}

fn failed(name: &str, format: &str, why: impl Display) -> Failure {
    Failure::failed(format!("cannot write {name} as {format}: {why}"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn a_value_ends_with_one_line_end() {
        assert_eq!(to_json("a list", &[1]).unwrap(), "[\n  1\n]\n");
        assert_eq!(to_json_line("a list", &[1]).unwrap(), "[1]\n");
        assert_eq!(to_toml("a table", &BTreeMap::from([("a", 1)])).unwrap(), "a = 1\n");
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let pairs = BTreeMap::from([((1, 2), 3)]);
        for failure in [
            to_json("the pairs", &pairs).unwrap_err(),
            to_json_line("the pairs", &pairs).unwrap_err(),
            to_toml("the pairs", &3).unwrap_err(),
        ] {
            assert_eq!(failure.code, 1);
            assert!(failure.message.starts_with("cannot write the pairs as "), "{failure:?}");
        }
    }
}
