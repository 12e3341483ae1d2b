//! People in the messages of planners that keep a distance from them (`people_msgs`).

use serde::{Deserialize, Serialize};

use super::{Header, Point, message};

/// `people_msgs/Person`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PersonMsg {
    /// Name; the same person has the same name in all messages.
    pub name: String,
    /// Position, m.
    pub position: Point,
    /// Velocity, m/s.
    pub velocity: Point,
    /// Probability that the person exists, 0 to 1.
    pub reliability: f64,
    /// Names of further properties.
    pub tagnames: Vec<String>,
    /// Values of further properties.
    pub tags: Vec<String>,
}

/// `people_msgs/People`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct People {
    /// Time and frame.
    pub header: Header,
    /// The people.
    pub people: Vec<PersonMsg>,
}

message!(People, "people_msgs/msg/People", "People.msg");
