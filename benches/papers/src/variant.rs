//! Contenders with changed values in their configs.

use tagalong_trials::Contender;
use toml::{Table, Value};

use crate::lab::ReproduceError;

/// Parses the config of a contender.
///
/// # Errors
/// A config that is not TOML.
pub(crate) fn parsed(contender: &Contender) -> Result<Table, ReproduceError> {
    contender.config.parse().map_err(|error| ReproduceError::of(&contender.name, error))
}

/// Returns the contender without a table of its config.
pub(crate) fn without_table(contender: &Contender, key: &str) -> Result<Contender, ReproduceError> {
    let mut config = parsed(contender)?;
    config.remove(key);
    Ok(Contender { config: config.to_string(), ..contender.clone() })
}

/// Returns the contender under another name, with other values, TOML, at dotted keys; a number is
/// an index into an array. Missing tables are created.
///
/// # Errors
/// A config or a value that is not TOML, or a key that leads through another type.
pub(crate) fn with_values(
    contender: &Contender,
    name: &str,
    values: &[(&str, &str)],
) -> Result<Contender, ReproduceError> {
    let mut config = Value::Table(parsed(contender)?);
    for (key, text) in values {
        let value = text.parse().map_err(|error: toml::de::Error| error.message().to_owned());
        let set = value.and_then(|value| {
            *slot(&mut config, key).ok_or("there is no such place")? = value;
            Ok(())
        });
        set.map_err(|why| ReproduceError::Other(format!("{name}: {key} = {text}: {why}")))?;
    }
    let config = toml::to_string(&config).map_err(|error| ReproduceError::of(name, error))?;
    Ok(Contender { name: name.to_owned(), config, ..contender.clone() })
}

fn slot<'a>(config: &'a mut Value, key: &str) -> Option<&'a mut Value> {
    key.split('.').try_fold(config, |at, part| match at {
        Value::Array(values) => values.get_mut(part.parse::<usize>().ok()?),
        Value::Table(table) => {
            Some(table.entry(part).or_insert_with(|| Value::Table(Table::new())))
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_replaced_and_added() {
        let config =
            "[[detectors]]\nplugin = \"a\"\nconfig = { size = 1 }\n[filter]\nplugin = \"b\"\n";
        let contender = Contender::new("old", config);
        let values = [("detectors.0.config.size", "2.5"), ("filter.config.kind", "\"round\"")];
        let table = parsed(&with_values(&contender, "new", &values).unwrap()).unwrap();
        let expected = "[[detectors]]\nplugin = \"a\"\nconfig = { size = 2.5 }\n\
                        [filter]\nplugin = \"b\"\nconfig = { kind = \"round\" }\n";
        assert_eq!(table, expected.parse::<Table>().unwrap());
    }

    #[test]
    fn mistakes_are_named() {
        let contender = Contender::new("old", "[filter]\nplugin = \"b\"\n");
        for (key, text, told) in [
            ("filter.plugin.size", "1", "filter.plugin.size = 1: there is no such place"),
            ("filter.size", "1 2", "filter.size = 1 2"),
        ] {
            let error = with_values(&contender, "new", &[(key, text)]).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }
}
