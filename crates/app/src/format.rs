//! Output formats, as arguments.

use clap::ValueEnum;

/// Output format of results.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Human-readable text.
    #[default]
    Text,
    /// For programs.
    Json,
}

/// Output format of tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum TableFormat {
    /// Human-readable text.
    #[default]
    Text,
    /// For documentation pages.
    Markdown,
    /// For programs.
    Json,
}
