//! Inputs that a pipeline declares: those of its plugins, and its own.

use std::ops::Range;

use tagalong_config::ConfigError;
use tagalong_core::{Input, Inputs};
use tagalong_following::ObstacleSource;
use tagalong_vision::odometry::MotionSource;

use super::PipelineSettings;

/// Inputs of the target lock and the collision monitor, which every controller has.
const STEERING: Inputs = Inputs::NONE
    .accept(Input::Colour)
    .accept(Input::Depth)
    .accept(Input::Laser)
    .accept(Input::OBSTACLES);
/// Inputs of `[odometry]`, by depth and by the image alone.
const ODOMETRY: Inputs = CAMERA_MOTION.require(Input::Depth);
const CAMERA_MOTION: Inputs = Inputs::NONE.require(Input::Colour);
/// Inputs of `[reidentification]`.
const REIDENTIFICATION: Inputs = Inputs::NONE.accept(Input::Colour).accept(Input::Depth);
/// Inputs of the network of `[appearance]`.
pub(super) const APPEARANCE: Inputs = Inputs::NONE.require(Input::Colour);
/// Inputs of `[stereo]`, which leaves a frame with depth unchanged.
const STEREO: Inputs =
    Inputs::NONE.require(Input::Colour).require(Input::Right).accept(Input::Depth);

/// Name of a plugin or a stage, and its inputs.
pub(super) type Declared<'a> = (&'a str, Inputs);

/// Returns the union of the inputs that the plugins and the stages declare.
///
/// # Errors
/// If a plugin or a stage requires an input that the setting `without` leaves out.
pub(super) fn declared_inputs(
    settings: &PipelineSettings,
    plugins: &[Declared<'_>],
    has_controller: bool,
    without_span: Option<Range<usize>>,
) -> Result<Inputs, ConfigError> {
    let odometry = settings.odometry.as_ref().map(|odometry| match odometry.source {
        MotionSource::Depth => ("[odometry]", ODOMETRY),
        MotionSource::Image => ("[odometry]", CAMERA_MOTION),
    });
    let steering = has_controller.then_some(("[collision_monitor]", STEERING));
    let remembers = settings.reidentification.remember_s > 0.0;
    let people = remembers.then_some(("[reidentification]", REIDENTIFICATION));
    let looks = describes(settings, has_controller).then_some(("[appearance]", APPEARANCE));
    let plugins = plugins.iter().copied();
    let mut all: Vec<Declared<'_>> =
        plugins.chain(odometry).chain(steering).chain(people).chain(looks).collect();
    // The pipeline computes depth from the pair; that of the log is used where it is there.
    if settings.stereo.is_some() {
        all.iter_mut().for_each(|(_, inputs)| *inputs = inputs.relax(Input::Depth));
        all.push(("[stereo]", STEREO));
    }
    for input in &settings.without {
        if let Some((name, _)) = all.iter().find(|(_, inputs)| inputs.requires(*input)) {
            let message = format!(
                "`{name}` requires {input}, which `without` leaves out: remove \"{}\" from \
                 `without`, or `{name}` from the config",
                input.name()
            );
            return Err(ConfigError::new(message).or_at(without_span));
        }
    }
    if has_controller && lacks_eyes(settings) {
        let message = "the controller has no sensor of obstacles, for `without` leaves out depth and \
                       laser: remove one of them from `without`, or, for a robot that is to drive \
                       without eyes, set `obstacles = \"none\"` in [collision_monitor]";
        return Err(ConfigError::new(message).or_at(without_span));
    }
    if has_controller && guesses_motion(settings) {
        let message = "`[odometry] source = \"image\"` is a guess by which no robot may drive: \
                       remove it, or the controller";
        return Err(ConfigError::new(message));
    }
    let sum = all.into_iter().fold(Inputs::NONE, |sum, (_, inputs)| sum.union(inputs));
    Ok(settings.without.iter().fold(sum, |sum, input| sum.without(*input)))
}

/// Returns true if a network describes the people, by which they are compared.
pub(super) fn describes(settings: &PipelineSettings, has_controller: bool) -> bool {
    let remembers = settings.reidentification.remember_s > 0.0;
    let compares = remembers || has_controller && settings.target.remember;
    settings.appearance.has_network() && compares
}

/// Returns true if the motion of the robot comes from images alone, without a scale. The collision
/// monitor moves the obstacles that it remembers by that motion.
fn guesses_motion(settings: &PipelineSettings) -> bool {
    settings.odometry.as_ref().is_some_and(|odometry| odometry.source == MotionSource::Image)
}

/// Returns true if the settings leave out every sensor of obstacles, and do not say that the robot
/// drives without.
fn lacks_eyes(settings: &PipelineSettings) -> bool {
    let has_depth = settings.stereo.is_some() || !settings.without.contains(&Input::Depth);
    settings.collision_monitor.obstacles == ObstacleSource::Sensed
        && !has_depth
        && settings.without.contains(&Input::Laser)
}
