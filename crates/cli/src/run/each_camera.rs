//! `tagalong run --each-camera`: a run for each camera of a log.

use std::collections::BTreeSet;

use tagalong_app::config_file::OuterSettings;
use tagalong_app::input_args::InputArgs;
use tagalong_app::outcome::{Ended, Failure, Outcome, say};
use tagalong_app::progress::Progress;
use tagalong_app::signals::Signals;
use tagalong_app::suggest::check_log_path;
use tagalong_config::Registry;
use tagalong_log::{FrameSource, Inputs};

use super::{RunArgs, run_until};

/// Runs once for each camera. A camera that cannot be used is reported, and the others are run.
///
/// # Errors
/// A log that cannot be read or has no camera, and a log of which no camera can be used.
pub(super) fn run(args: &RunArgs, registry: &Registry) -> Outcome {
    if !args.has_log() {
        return Err(Failure::usage("--each-camera needs a log"));
    }
    let cameras = cameras(args)?;
    let signals = Signals::listen()?;
    let mut all_well = true;
    let mut failure = None;
    let mut is_any_run = false;
    for camera in cameras {
        if let Some(signal) = signals.received() {
            return Ok(Ended::BySignal(signal));
        }
        say(&format!("camera {camera}:"));
        match run_until(&args_for(args, &camera), registry, || Ok(signals.clone())) {
            Ok(ended @ Ended::BySignal(_)) => return Ok(ended),
            Ok(ended) => {
                is_any_run = true;
                all_well &= ended == Ended::Well;
            }
            Err(why) => {
                all_well = false;
                say(&format!("error: camera {camera}: {}", why.message));
                failure = Some(why);
            }
        }
    }
    match failure {
        Some(why) if !is_any_run => {
            Err(Failure { message: "no camera of the log could be used".into(), ..why })
        }
        _ => Ok(Ended::with_loss(!all_well)),
    }
}

/// Returns the names of the cameras of the log, in their order.
fn cameras(args: &RunArgs) -> Result<BTreeSet<String>, Failure> {
    let log = args.log();
    check_log_path(log)?;
    let OuterSettings { input, limits, .. } = args.input.applied(OuterSettings::default());
    let source = Progress::waiting(&format!("looking through {}", log.display()), || {
        FrameSource::open(log, &input, &limits, Inputs::ANY)
    })?;
    let topics = &source.account().topics;
    let cameras: BTreeSet<String> =
        topics.iter().filter_map(|entry| entry.camera.clone()).collect();
    if cameras.is_empty() {
        let log = log.display();
        return Err(Failure::usage(format!("{log} has no camera: leave out --each-camera")));
    }
    Ok(cameras)
}

/// Returns the arguments of the run for one camera.
fn args_for(args: &RunArgs, camera: &str) -> RunArgs {
    RunArgs {
        each_camera: false,
        output: args.output.as_ref().map(|folder| folder.join(folder_name(camera))),
        input: InputArgs { camera: Some(camera.to_owned()), ..args.input.clone() },
        ..args.clone()
    }
}

/// Returns the name of a camera as that of a folder: `front_camera` for `/front_camera`.
pub(super) fn folder_name(camera: &str) -> String {
    fn kept(letter: char) -> bool {
        letter.is_alphanumeric() || "-_".contains(letter)
    }

    let name = camera.trim_matches('/').chars();
    name.map(|letter| if kept(letter) { letter } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_camera_makes_one_folder() {
        assert_eq!(folder_name("/front_camera"), "front_camera");
        assert_eq!(folder_name("/robot/rear/"), "robot-rear");
        assert_eq!(folder_name("../rear"), "---rear");
    }
}
