use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Posture of a person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Posture {
    /// Stands and walks.
    #[default]
    Upright,
    /// Looks down at a phone while standing and walking.
    Phone,
    /// Sits on a chair at the first point of the path; with more points, gets up by `start_s`.
    Seated,
    /// Bends down now and then while standing.
    Bending,
}
