//! Choice of a pipeline for a log.

use std::path::Path;

use tagalong_config::Registry;
use tagalong_log::{FrameSource, InputSettings, Limits};

use crate::config_file::ConfigFile;
use crate::installed::NETWORK;
use crate::outcome::Failure;

/// The config for a camera below a conical mirror.
const PANORAMIC: &str = "omni-rich";

/// The config for colour alone where no network is installed.
pub const WITHOUT_NETWORK: &str = "mono";

/// A pipeline for logs of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Name of the built-in config, or [`NETWORK`] for that of an installed network.
    pub config: &'static str,
    /// Data by which such a log is known, in words.
    pub has: &'static str,
    /// Reason for the choice.
    pub reason: &'static str,
}

/// The pipelines; the first that fits a log is taken. Where several fit, the order is that of
/// `tagalong bench --leave-one-room-out` in docs/benchmarks.md.
pub const CHOICES: [Choice; 10] = [
    Choice {
        config: "depth-verified",
        has: "colour and depth",
        reason: "it has the best HOTA in rooms that no setting was chosen on",
    },
    Choice {
        config: "depth-alone",
        has: "depth without colour",
        reason: "of those that need no colour it has the best HOTA in rooms that no setting was \
                 chosen on; one verifier judges what it finds, so expect some furniture",
    },
    Choice {
        config: "depth-net-ekf",
        has: "depth of a camera at an unusual height",
        reason: "it needs no heads, and no settings for the height of the camera",
    },
    Choice {
        config: "stereo-verified",
        has: "a stereo pair",
        reason: "verifiers judge what it finds",
    },
    Choice {
        config: "stereo-street",
        has: "a stereo pair with a long base",
        reason: "stereo-verified looks for smaller disparities than such a pair has",
    },
    Choice {
        config: PANORAMIC,
        has: "panoramic images",
        reason: "it is the one for several people before a conical mirror",
    },
    Choice {
        config: NETWORK,
        has: "colour or grey images alone",
        reason: "you installed this network; places in metres are rough",
    },
    Choice {
        config: WITHOUT_NETWORK,
        has: "colour or grey images alone",
        reason: "nothing else works without depth; places in metres are rough",
    },
    Choice {
        config: "laser-legs",
        has: "laser scans and odometry",
        reason: "it believes in what moves where nothing was; people who stand may be missed",
    },
    Choice {
        config: "laser-follow",
        has: "laser scans without odometry",
        reason: "nothing can be concluded from motion over ground",
    },
];

/// A pipeline that fits a log.
pub struct Fitting {
    /// The pipeline, in words.
    pub choice: Choice,
    /// Its config.
    pub config: ConfigFile,
}

/// Pipelines that fit a log, and the reasons why others do not.
#[derive(Default)]
pub struct Fittings {
    /// Those that fit, the best first.
    pub fitting: Vec<Fitting>,
    /// A line for each of the others.
    pub refusals: String,
}

impl Fittings {
    /// Returns the failure of a log that no pipeline fits.
    pub fn none_fits(&self, log: &Path) -> Failure {
        let damage = damage(log);
        let (log, refusals) = (log.display(), &self.refusals);
        let hint = format!("`tagalong inspect {log}` lists its topics");
        Failure::failed(format!("{log}: no built-in pipeline fits:{refusals}\n{damage}{hint}"))
    }
}

/// Returns a line about a log of which part was lost; nothing for a whole one.
fn damage(log: &Path) -> String {
    let found = tagalong_log::inspect(log, &InputSettings::default(), &Limits::default());
    let Some(found) = found.ok().filter(|found| found.data_lost) else { return String::new() };
    let first = found.notes.first().map_or("", String::as_str);
    format!("part of the log was lost ({first}): record it again, or look for a whole copy\n")
}

/// Returns the first pipelines that fit a log, at most `most`, by trying each on its first frame.
pub fn fitting(log: &Path, registry: &Registry, most: usize) -> Fittings {
    let mut found = Fittings::default();
    for choice in CHOICES {
        let Some(config) = ConfigFile::named(choice.config) else { continue };
        if found.fitting.len() == most {
            break;
        }
        match try_config(&config, log, registry) {
            Ok(()) => found.fitting.push(Fitting { choice, config }),
            Err(why) => found.refusals += &refusal(choice.config, log, &why),
        }
    }
    found
}

/// Returns a line that says why a config does not fit: without the path of the log and the list of
/// its topics, which would be the same in each.
fn refusal(config: &str, log: &Path, why: &Failure) -> String {
    let reason = why.message.lines().next().unwrap_or_default();
    let reason = reason.replacen(&format!("`{}` ", log.display()), "the log ", 1);
    format!("\n  {config}: {reason}")
}

/// Takes the first frame of a log through a pipeline.
fn try_config(config: &ConfigFile, log: &Path, registry: &Registry) -> Result<(), Failure> {
    let (mut pipeline, settings) = config.pipeline(registry, None)?;
    let outer = config.outer_for(&pipeline)?;
    let mut source = FrameSource::open(log, &outer.input, &outer.limits, pipeline.inputs())?;
    let Some(item) = source.next_frame() else {
        return Err(Failure::failed("no frame that can be used"));
    };
    // Any colour image passes for a panorama, and a panorama for any image.
    if item.frame.camera.panorama().is_some() != (config.stem() == PANORAMIC) {
        return Err(Failure::failed("another kind of camera"));
    }
    // Without odometry the robot is taken to be at rest, and all things seem to move.
    if settings.suits.odometry && !source.has_odometry() {
        return Err(Failure::failed("no odometry"));
    }
    pipeline.step(&item.frame).map_err(Failure::failed)?;
    Ok(())
}
