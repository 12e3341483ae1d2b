use tagalong_core::{Command, Controller, Frame, Scene, Stamp, Track, TrackId};

use crate::boundary::{StepError, contain};
use crate::governor::{Ahead, Governor, Wish, ahead};
use crate::{CorridorSettings, GovernorSettings, RobotSettings};

/// Frames that must be processed after a reset before the robot may move.
const FRESH_FRAMES: u32 = 3;

/// The controller, whom it follows, and the governor of its commands. Followed
/// is the nearest confirmed person in front at first, then that one while the
/// track lives, and nobody after that.
pub(crate) struct Steering {
    name: String,
    controller: Box<dyn Controller>,
    governor: Governor,
    robot: RobotSettings,
    target: Option<TrackId>,
    fresh: u32,
    last: Option<Stamp>,
}

impl Steering {
    pub(crate) fn new(
        name: String,
        controller: Box<dyn Controller>,
        robot: RobotSettings,
        settings: GovernorSettings,
    ) -> Self {
        Self {
            name,
            controller,
            governor: Governor::new(settings, robot.wheels(), robot.max_speed_mps),
            robot,
            target: None,
            fresh: FRESH_FRAMES,
            last: None,
        }
    }

    /// After a jump of the clock nothing is known: choose anew, and wait.
    pub(crate) fn reset(&mut self) {
        self.target = None;
        self.fresh = 0;
    }

    /// The distance that the controller keeps, m, if it keeps one.
    pub(crate) fn stand_off_m(&self) -> Option<f64> {
        self.controller.stand_off_m()
    }

    pub(crate) fn governor(&self) -> &Governor {
        &self.governor
    }

    pub(crate) fn governor_mut(&mut self) -> &mut Governor {
        &mut self.governor
    }

    /// The command for a frame, and who is followed.
    ///
    /// # Errors
    /// The controller panicked.
    pub(crate) fn steer(
        &mut self,
        frame: &Frame,
        tracks: &[Track],
    ) -> Result<(Command, Option<TrackId>), StepError> {
        self.governor.check_odometry(&frame.motion);
        let settled = self.is_settled();
        let target = if settled { self.choose(tracks).cloned() } else { None };
        let confirmed: Vec<Track> = tracks.iter().filter(|t| t.confirmed).cloned().collect();
        let scene = Scene {
            frame,
            target: target.as_ref(),
            tracks: &confirmed,
            wheels: self.robot.wheels(),
            max_speed_mps: self.robot.max_speed_mps,
        };
        let wheels = contain(&self.name, frame.index, || self.controller.command(&scene))?;
        let wish = Wish {
            wheels,
            stamp: frame.stamp,
            has_target: target.is_some(),
            settled,
            pause_s: self.last.map_or(0.0, |last| frame.stamp.seconds_since(last)),
        };
        self.last = Some(frame.stamp);
        let look = |corridor: &_, curvature| look(corridor, frame, curvature, target.as_ref());
        Ok((self.governor.govern(&wish, look), target.map(|track| track.id)))
    }

    /// The track to follow, among tracks ordered near to far.
    fn choose<'t>(&mut self, tracks: &'t [Track]) -> Option<&'t Track> {
        if self.target.is_none() {
            let in_front = |t: &&Track| t.confirmed && t.estimate.person.position.x > 0.0;
            self.target = tracks.iter().find(in_front).map(|t| t.id);
        }
        tracks.iter().find(|t| Some(t.id) == self.target)
    }

    /// True once enough frames were processed since the last reset; counts one.
    fn is_settled(&mut self) -> bool {
        self.fresh = self.fresh.saturating_add(1);
        self.fresh > FRESH_FRAMES
    }
}

/// What the depth image shows ahead; nothing to say without one.
fn look(
    corridor: &CorridorSettings,
    frame: &Frame,
    curvature: f64,
    target: Option<&Track>,
) -> Option<Ahead> {
    let depth = frame.depth().ok()?;
    let target = target.map(|track| track.estimate.person.position.xy());
    Some(ahead(corridor, &frame.camera, depth, curvature, target))
}
