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
    /// Sits on a chair at the first point of the path; if there are more points, gets up at
    /// `start_s`.
    Seated,
    /// Bends down from time to time while standing.
    Bending,
}
