use std::time::Duration;

/// Limits of a network: a file beyond them is refused, a call beyond its deadline is given up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest file, bytes.
    pub file_bytes: u64,
    /// Most operators of a file, those of its subgraphs included.
    pub operators: usize,
    /// Largest tensor that a file declares or that follows from its input, numbers.
    pub tensor_values: usize,
    /// Longest time for one call.
    pub deadline: Duration,
    /// Longest time for reading a file and a first call.
    pub load_deadline: Duration,
    /// Threads of a call.
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
