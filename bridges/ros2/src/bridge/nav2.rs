//! Nav2's following server, which is discovered while the bridge works.

use super::Bridge;
use crate::BridgeError;
use crate::diagnostics::DriverState;
use crate::nav2::{Feedback, FollowGoal, FollowResult, Follower, HUMBLE, HumbleResult, NAV2};

/// Type of the action.
const KIND: &str = "FollowObject";

impl Bridge {
    /// Reports for which action the bridge waits.
    pub(super) fn tell_action(&self, tell: &dyn Fn(&str)) {
        if let Some(action) = &self.options.follow_object {
            tell(&format!(
                "Nav2 drives: a server of the action {action} ({NAV2}/action/{KIND}) is given the goal"
            ));
        }
    }

    /// Looks for the server, starts its client, and reports its messages.
    pub(super) fn look_at_follower(&mut self, tell: &dyn Fn(&str)) {
        let Some(action) = self.options.follow_object.clone() else { return };
        let package = self.network.action_package(&action);
        match (&self.follower, package) {
            (Some(follower), package) => {
                follower.note_server(package.is_some());
                follower.take_told().iter().for_each(|sentence| tell(sentence));
                self.callers.desk.set_goal(follower.report());
            }
            (None, Some(package)) if !self.is_refused => {
                self.start_follower(&action, &package, tell)
            }
            _ => {}
        }
    }

    fn start_follower(&mut self, action: &str, package: &str, tell: &dyn Fn(&str)) {
        match self.follower_of(action, package) {
            Ok(Some(follower)) => {
                tell(&format!("found the action {action} ({package}/action/{KIND})"));
                self.follower = Some(follower);
            }
            Ok(None) => {
                self.is_refused = true;
                tell(&format!(
                    "the action {action} is of the package {package}; known are {NAV2} and {HUMBLE}: \
                     name another one with --follow-object=ACTION"
                ));
            }
            Err(error) => {
                self.is_refused = true;
                tell(&format!("no client of the action {action}: {error}"));
            }
        }
    }

    fn follower_of(
        &mut self,
        action: &str,
        package: &str,
    ) -> Result<Option<Follower>, BridgeError> {
        let Some(switch) = self.switch() else { return Ok(None) };
        let mapping = self.options.rmw.mapping();
        let target = self.network.full_name(&self.options.target);
        let follower = match package {
            NAV2 => {
                let client = self.network.action_client::<FollowGoal, FollowResult, Feedback>(
                    action, package, KIND, mapping,
                )?;
                Follower::start(client, target, switch)?
            }
            HUMBLE => {
                let client = self.network.action_client::<FollowGoal, HumbleResult, Feedback>(
                    action, package, KIND, mapping,
                )?;
                Follower::start(client, target, switch)?
            }
            _ => return Ok(None),
        };
        Ok(Some(follower))
    }

    /// Returns the state of the goal for the diagnostics: `None` if this program drives.
    pub(super) fn driver_state(&self) -> Option<DriverState> {
        self.options.follow_object.as_ref()?;
        let Some(follower) = &self.follower else { return Some(DriverState::Missing) };
        let report = follower.report();
        Some(if report.is_unconfirmed {
            DriverState::Unconfirmed
        } else {
            DriverState::Goal(report.state)
        })
    }
}
