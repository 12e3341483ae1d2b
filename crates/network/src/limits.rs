use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Limits of a network: a file beyond them is rejected, and a call beyond its deadline is
/// abandoned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Maximum size of a file, bytes.
    pub file_bytes: u64,
    /// Maximum number of operators in a file, including those of its subgraphs.
    pub operators: usize,
    /// Maximum number of values of a tensor that a file declares or that follows from its input.
    pub tensor_values: usize,
    /// Maximum time for one call.
    pub deadline: Duration,
    /// Maximum time for reading a file and a first call.
    pub load_deadline: Duration,
    /// Number of threads of a call.
    pub threads: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 512 << 20,
            operators: 20_000,
            tensor_values: 1 << 27,
            deadline: Duration::from_secs(5),
            load_deadline: Duration::from_secs(60),
            threads: 1,
        }
    }
}

/// Limits of a network as a config states them, among other settings of a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct LimitSettings {
    /// Number of threads of the network.
    #[schemars(range(min = 1, max = 256))]
    pub threads: usize,
    /// A call that takes longer is abandoned, and its image has no result, s. Which calls are
    /// abandoned depends on the machine: with a tight deadline two runs may differ.
    #[schemars(range(min = 1e-3, max = 3600.0))]
    pub deadline_s: f64,
    /// Maximum size of the file, MB.
    #[schemars(range(min = 1, max = 100_000))]
    pub max_file_mb: u64,
    /// Maximum number of operators of the file.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub max_operators: usize,
    /// Maximum size of a tensor, MB, if it can be computed from the file.
    #[schemars(range(min = 1, max = 100_000))]
    pub max_tensor_mb: usize,
}

impl Default for LimitSettings {
    fn default() -> Self {
        Self {
            threads: 1,
            deadline_s: 5.0,
            max_file_mb: 512,
            max_operators: 20_000,
            max_tensor_mb: 512,
        }
    }
}

impl LimitSettings {
    /// Converts the settings, which are within their ranges.
    pub fn limits(&self) -> Limits {
        Limits {
            file_bytes: self.max_file_mb << 20,
            operators: self.max_operators,
            // A value of a tensor has four bytes.
            tensor_values: self.max_tensor_mb << 18,
            deadline: Duration::from_secs_f64(self.deadline_s),
            threads: self.threads,
            ..Limits::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_have_the_same_defaults_as_the_limits() {
        assert_eq!(LimitSettings::default().limits(), Limits::default());
    }

    #[test]
    fn each_setting_is_a_limit() {
        let settings = LimitSettings {
            threads: 2,
            deadline_s: 0.5,
            max_file_mb: 3,
            max_operators: 4,
            max_tensor_mb: 5,
        };
        let expected = Limits {
            threads: 2,
            deadline: Duration::from_millis(500),
            file_bytes: 3 * 1024 * 1024,
            operators: 4,
            tensor_values: 5 * 1024 * 1024 / 4,
            ..Limits::default()
        };
        assert_eq!(settings.limits(), expected);
    }
}
