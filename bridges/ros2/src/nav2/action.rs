//! The action `FollowObject` in its serialised form.

use std::fmt;

use ros2_client::Message;
use serde::{Deserialize, Serialize};

/// Package of the action in releases where it is part of Nav2.
pub(crate) const NAV2: &str = "nav2_msgs";
/// Package of the action for Humble, whose result has neither error code nor message.
pub(crate) const HUMBLE: &str = "opennav_following_msgs";

/// `builtin_interfaces/Duration`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Span {
    pub(crate) sec: i32,
    pub(crate) nanosec: u32,
}

impl Span {
    pub(crate) fn seconds(self) -> f64 {
        f64::from(self.sec) + 1e-9 * f64::from(self.nanosec)
    }
}

/// Goal: a topic of poses, or a frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FollowGoal {
    pose_topic: String,
    tracked_frame: String,
    /// Zero for no limit.
    max_duration: Span,
}

impl FollowGoal {
    /// Returns a goal to follow the poses on a topic until it is cancelled.
    pub(crate) fn of_topic(pose_topic: &str) -> Self {
        let pose_topic = pose_topic.to_owned();
        Self { pose_topic, tracked_frame: String::new(), max_duration: Span::default() }
    }
}

/// Result.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FollowResult {
    pub(crate) total_elapsed_time: Span,
    pub(crate) error_code: u16,
    pub(crate) num_retries: u16,
    pub(crate) error_msg: String,
}

/// Result of the package for Humble.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct HumbleResult {
    pub(crate) total_elapsed_time: Span,
    pub(crate) num_retries: u16,
}

/// Feedback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Feedback {
    pub(crate) state: u16,
    pub(crate) following_time: Span,
    pub(crate) num_retries: u16,
}

impl Message for FollowGoal {}
impl Message for FollowResult {}
impl Message for HumbleResult {}
impl Message for Feedback {}

impl Feedback {
    /// Returns the state of the server in words.
    pub(crate) fn state_name(&self) -> &'static str {
        match self.state {
            1 => "looks for the person",
            2 => "drives",
            3 => "stands near the person",
            4 => "tries again",
            _ => "in an unknown state",
        }
    }
}

/// Result of either package.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    pub(crate) elapsed_s: f64,
    error_code: u16,
    num_retries: u16,
    error_msg: String,
}

impl From<FollowResult> for Outcome {
    fn from(result: FollowResult) -> Self {
        Self {
            elapsed_s: result.total_elapsed_time.seconds(),
            error_code: result.error_code,
            num_retries: result.num_retries,
            error_msg: result.error_msg,
        }
    }
}

impl From<HumbleResult> for Outcome {
    fn from(result: HumbleResult) -> Self {
        let HumbleResult { total_elapsed_time, num_retries } = result;
        FollowResult { total_elapsed_time, num_retries, ..FollowResult::default() }.into()
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.error_code {
            0 => "no error code",
            901 => "a transform is missing",
            902 => "it does not detect the person",
            903 => "it finds no command",
            904 => "its time is over",
            _ => "unknown error",
        };
        write!(f, "{name} ({}), after {} retries", self.error_code, self.num_retries)?;
        if self.error_msg.is_empty() { Ok(()) } else { write!(f, ": {}", self.error_msg) }
    }
}

#[cfg(test)]
mod tests {
    use tagalong::log::msgs::{decode, encode};

    use super::*;

    #[test]
    fn an_outcome_says_what_went_wrong() {
        let error_msg = "no pose for 2 s".to_owned();
        let result =
            FollowResult { error_code: 902, num_retries: 3, error_msg, ..Default::default() };
        let said = Outcome::from(result).to_string();
        assert_eq!(said, "it does not detect the person (902), after 3 retries: no pose for 2 s");
        let humble = HumbleResult { num_retries: 2, ..Default::default() };
        let said = Outcome::from(humble).to_string();
        assert_eq!(said, "no error code (0), after 2 retries");
    }

    #[test]
    fn fields_are_in_the_order_of_the_definition() {
        let total_elapsed_time = Span { sec: 1, nanosec: 2 };
        let error_msg = "m".to_owned();
        let result = FollowResult { total_elapsed_time, error_code: 3, num_retries: 4, error_msg };
        let bytes = encode(&result);
        assert_eq!(bytes[4..16], [1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 4, 0]);
        assert_eq!(decode::<FollowResult>(&bytes).unwrap(), result);
        let feedback =
            Feedback { state: 2, following_time: Span { sec: 5, nanosec: 0 }, num_retries: 1 };
        // The time begins at a multiple of four.
        assert_eq!(encode(&feedback)[4..], [2, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 1, 0]);
        assert_eq!(feedback.following_time.seconds(), 5.0);
        assert_eq!(feedback.state_name(), "drives");
    }
}
