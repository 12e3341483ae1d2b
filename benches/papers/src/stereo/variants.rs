//! Forms of a system that are compared in tables: a shipped config each, some with single settings
//! replaced, which separates the cost of one misprint from that of the rest of the method.

use tagalong_stereo::StereoSettings;
use tagalong_trials::Contender;
use toml::{Table, Value};

use crate::lab::{Lab, ReproduceError};

/// A form of a system.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// Name in tables.
    pub name: &'static str,
    /// Name of the config.
    pub of: &'static str,
    /// Numbers and switches that are replaced in it, by dotted keys.
    pub set: &'static [(&'static str, Setting)],
}

/// Value of a setting.
#[derive(Clone, Copy, Debug)]
pub enum Setting {
    /// A switch.
    Is(bool),
    /// A number.
    Number(f64),
}

use Setting::{Is, Number};

const NO_VELOCITY: (&str, Setting) = ("filter.config.velocity", Is(false));
const NO_NOISE: (&str, Setting) = ("filter.config.noise", Is(false));
const NO_UPDATE: (&str, Setting) = ("filter.config.update", Is(false));
/// The table `[odometry]`, with a default in it.
const ODOMETRY: (&str, Setting) = ("odometry.wheel_error", Number(0.01));
const NO_MEASUREMENT: (&str, Setting) = ("filter.config.measurement", Is(false));

/// P1, from the printed form to the best. Free parameters are fitted in each printed form
/// (`tagalong-papers reproduce stereo-ekf --only fit-printed`).
pub const OF_P1: [Variant; 5] = [
    Variant { name: "stereo-ekf-as-printed", of: "stereo-ekf-as-printed", set: &[] },
    Variant {
        name: "printed, velocity corrected",
        of: "stereo-ekf-as-printed",
        set: &[
            NO_VELOCITY,
            ("filter.config.sigma_w", Number(2.5)),
            ("filter.config.sigma_v_m", Number(0.1)),
        ],
    },
    Variant { name: "stereo-ekf", of: "stereo-ekf", set: &[] },
    Variant { name: "stereo-ekf with `[odometry]`", of: "stereo-ekf", set: &[ODOMETRY] },
    Variant { name: "stereo-verified", of: "stereo-verified", set: &[] },
];

/// P4, likewise. With the whole filter corrected, the remaining difference to `stereo-svm-ekf` is
/// the cost of the printed dissimilarity and of the verifier's pixels.
pub const OF_P4: [Variant; 6] = [
    Variant { name: "stereo-svm-ekf-as-printed", of: "stereo-svm-ekf-as-printed", set: &[] },
    Variant {
        name: "printed, velocity corrected",
        of: "stereo-svm-ekf-as-printed",
        set: &[
            NO_VELOCITY,
            ("filter.config.sigma_w", Number(1.0)),
            ("filter.config.sigma_v_m", Number(0.03)),
        ],
    },
    Variant {
        name: "printed, filter corrected",
        of: "stereo-svm-ekf-as-printed",
        set: &[NO_VELOCITY, NO_NOISE, NO_UPDATE, NO_MEASUREMENT],
    },
    Variant { name: "stereo-svm-ekf", of: "stereo-svm-ekf", set: &[] },
    Variant { name: "stereo-svm-ekf with `[odometry]`", of: "stereo-svm-ekf", set: &[ODOMETRY] },
    Variant { name: "stereo-verified", of: "stereo-verified", set: &[] },
];

impl Variant {
    /// Returns true if a part of the form is as printed and was fitted.
    pub fn is_printed(&self) -> bool {
        self.of.ends_with("as-printed") && !self.set.iter().any(|(key, _)| *key == NO_NOISE.0)
    }

    /// Returns the pipeline.
    ///
    /// # Errors
    /// A config that cannot be read or has no such key.
    pub fn contender(&self, lab: &Lab) -> Result<Contender, ReproduceError> {
        let set = self.set.iter().map(|(key, setting)| match setting {
            Is(is) => (*key, Value::from(*is)),
            Number(number) => (*key, Value::from(*number)),
        });
        Ok(Contender { name: self.name.into(), ..replaced(&lab.contender(self.of)?, set)? })
    }
}

/// Parses the config of a contender.
///
/// # Errors
/// A config that is not TOML.
pub fn table(contender: &Contender) -> Result<Table, ReproduceError> {
    contender.config.parse().map_err(|error| ReproduceError::of(&contender.name, error))
}

/// Returns the settings of the stereo matching of a config.
///
/// # Errors
/// A config that is not TOML, or has invalid settings.
pub fn stereo_settings(contender: &Contender) -> Result<StereoSettings, ReproduceError> {
    let settings = table(contender)?.remove("stereo").unwrap_or_else(|| Table::new().into());
    settings.try_into().map_err(|error| ReproduceError::of(&contender.name, error))
}

/// Returns the contender with numbers replaced.
pub fn with(contender: &Contender, set: &[(&str, f64)]) -> Result<Contender, ReproduceError> {
    replaced(contender, set.iter().map(|(key, number)| (*key, Value::from(*number))))
}

/// Returns the contender with values replaced.
pub fn replaced<'a>(
    contender: &Contender,
    set: impl Iterator<Item = (&'a str, Value)>,
) -> Result<Contender, ReproduceError> {
    let mut config = table(contender)?;
    for (key, value) in set {
        let Some(place) = find(&mut config, key) else {
            let why = format!("nothing can be set at `{key}`");
            return Err(ReproduceError::of(&contender.name, why));
        };
        *place = value;
    }
    Ok(Contender { config: config.to_string(), ..contender.clone() })
}

/// Returns the value at a dotted key; missing tables are created, lists are not.
fn find<'a>(config: &'a mut Table, key: &str) -> Option<&'a mut Value> {
    let mut names = key.split('.');
    let first = config.entry(names.next()?).or_insert_with(|| Table::new().into());
    names.try_fold(first, |at, name| match at {
        Value::Table(table) => Some(table.entry(name).or_insert_with(|| Table::new().into())),
        Value::Array(list) => list.get_mut(name.parse::<usize>().ok()?),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> Contender {
        Contender::new("test", "[[detectors]]\nplugin = \"a\"\n[filter]\nplugin = \"ekf\"\n")
    }

    #[test]
    fn a_key_is_replaced_or_made_and_a_wrong_one_is_named() {
        let keys = [("detectors.0.config.cost", 2.0), ("filter.config.noise", 0.5)];
        let table: Table = with(&config(), &keys).unwrap().config.parse().unwrap();
        assert_eq!(table["detectors"][0]["config"]["cost"].as_float(), Some(2.0));
        assert_eq!(table["filter"]["config"]["noise"].as_float(), Some(0.5));
        assert_eq!(table["filter"]["plugin"].as_str(), Some("ekf"));
        for key in ["detectors.7.cost", "filter.plugin.noise"] {
            let error = with(&config(), &[(key, 1.0)]).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
    }
}
