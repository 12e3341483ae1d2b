//! Choice of a pipeline for a log.

use std::path::Path;

use tagalong_app::config_file::ConfigFile;
use tagalong_app::outcome::{Failure, say};
use tagalong_config::Registry;
use tagalong_log::FrameSource;

/// The config for a camera below a conical mirror.
const PANORAMIC: &str = "omni-best";

/// The config for laser scans that concludes from motion over ground.
const BY_MOTION: &str = "laser-legs";

/// A pipeline for logs of one kind.
struct Choice {
    config: &'static str,
    /// Data by which such a log is known, in words.
    has: &'static str,
    reason: &'static str,
}

/// The pipelines, the first that fits a log is taken. Where several fit, the order is that of
/// `tagalong bench --leave-one-room-out` in docs/benchmarks.md.
const CHOICES: [Choice; 8] = [
    Choice {
        config: "depth-verified",
        has: "colour and depth",
        reason: "it has the best HOTA in rooms that no setting was chosen on",
    },
    Choice {
        config: "depth-ekf",
        has: "depth without colour",
        reason: "no verifier can judge what it finds, so expect furniture among the people",
    },
    Choice { config: "stereo-best", has: "a stereo pair", reason: "verifiers judge what it finds" },
    Choice {
        config: "stereo-street",
        has: "a stereo pair with a long base",
        reason: "stereo-best looks for smaller disparities than such a pair has",
    },
    Choice {
        config: PANORAMIC,
        has: "panoramic images",
        reason: "it is the one for several people before a conical mirror",
    },
    Choice {
        config: "mono",
        has: "colour or grey images alone",
        reason: "nothing else works without depth; places in metres are rough",
    },
    Choice {
        config: BY_MOTION,
        has: "laser scans and odometry",
        reason: "it believes in what moves where nothing was; people who stand may be missed",
    },
    Choice {
        config: "laser-follow",
        has: "laser scans without odometry",
        reason: "nothing can be concluded from motion over ground",
    },
];

/// Returns the pipeline for a log, and says which and why.
///
/// # Errors
/// A log that cannot be read, or that no pipeline fits: the reasons of each.
pub(super) fn choose(log: &Path, registry: &Registry) -> Result<ConfigFile, Failure> {
    let mut refusals = String::new();
    for Choice { config: name, has, reason } in CHOICES {
        let Some(config) = ConfigFile::named(name) else { continue };
        match try_config(&config, log, registry) {
            Ok(()) => {
                say(&format!("the log has {has}: taking {name}, because {reason}"));
                return Ok(config);
            }
            Err(failure) => refusals += &format!("\n  {name}: {}", failure.message),
        }
    }
    let message = format!("{}: no built-in pipeline fits:{refusals}", log.display());
    Err(Failure::failed(message))
}

/// Takes the first frame of a log through a pipeline.
fn try_config(config: &ConfigFile, log: &Path, registry: &Registry) -> Result<(), Failure> {
    let (mut pipeline, _) = config.pipeline(registry, None)?;
    let outer = config.outer()?;
    let mut source = FrameSource::open(log, &outer.input, &outer.limits, pipeline.inputs())?;
    let Some(item) = source.next_frame() else {
        return Err(Failure::failed("no frame that can be used"));
    };
    // Any colour image passes for a panorama, and a panorama for any image.
    if item.frame.camera.panorama().is_some() != (config.stem() == PANORAMIC) {
        return Err(Failure::failed("another kind of camera"));
    }
    // Without odometry the robot is taken to be at rest, and all things seem to move.
    if config.stem() == BY_MOTION && source.facts().odometry_topic.is_none() {
        return Err(Failure::failed("no odometry"));
    }
    pipeline.step(&item.frame).map_err(Failure::failed)?;
    Ok(())
}
