use tagalong_core::{Controller, Scene, Track, TrackId, WheelSpeeds};

/// Frames that must be processed after a reset before the robot may move.
const FRESH_FRAMES: u32 = 3;

/// The controller and whom it follows: the nearest confirmed person in front
/// at first, then that one while the track lives, and nobody after that.
pub(crate) struct Steering {
    pub(crate) name: String,
    pub(crate) controller: Box<dyn Controller>,
    target: Option<TrackId>,
    fresh: u32,
}

impl Steering {
    pub(crate) fn new(name: String, controller: Box<dyn Controller>) -> Self {
        Self { name, controller, target: None, fresh: FRESH_FRAMES }
    }

    /// After a jump of the clock nothing is known: choose anew, and wait.
    pub(crate) fn reset(&mut self) {
        self.target = None;
        self.fresh = 0;
    }

    /// The track to follow, among tracks ordered near to far.
    pub(crate) fn choose<'t>(&mut self, tracks: &'t [Track]) -> Option<&'t Track> {
        if self.target.is_none() {
            let in_front = |t: &&Track| t.confirmed && t.estimate.person.position.x > 0.0;
            self.target = tracks.iter().find(in_front).map(|t| t.id);
        }
        tracks.iter().find(|t| Some(t.id) == self.target)
    }

    /// True once enough frames were processed since the last reset; counts one.
    pub(crate) fn is_ready(&mut self) -> bool {
        self.fresh = self.fresh.saturating_add(1);
        self.fresh > FRESH_FRAMES
    }

    pub(crate) fn command(&mut self, scene: &Scene<'_>) -> WheelSpeeds {
        self.controller.command(scene)
    }
}

/// The command within the speed limit, with its curvature kept; `None` if it
/// is not finite.
pub(crate) fn limited(command: WheelSpeeds, max_speed_mps: f64) -> Option<WheelSpeeds> {
    if !command.left.is_finite() || !command.right.is_finite() {
        return None;
    }
    let fastest = command.left.abs().max(command.right.abs());
    let scale = if fastest > max_speed_mps { max_speed_mps / fastest } else { 1.0 };
    let wheel = |speed: f64| (speed * scale).clamp(-max_speed_mps, max_speed_mps);
    Some(WheelSpeeds { left: wheel(command.left), right: wheel(command.right) })
}
