//! Choice of a pipeline for a log.

use std::path::Path;

use tagalong_config::Registry;
use tagalong_log::{FrameSource, Input, InputAccount, Inputs, Inspection, Limits};

use crate::config_file::{ConfigFile, OuterSettings};
use crate::input_args::InputArgs;
use crate::installed::{NETWORK, missing_network};
use crate::lacking::Lacking;
use crate::misfit::Traits;
use crate::outcome::Failure;

/// The config for a camera below a conical mirror.
const PANORAMIC: &str = "omni-rich";

/// The config for colour alone if no network is installed.
pub const WITHOUT_NETWORK: &str = "mono";

/// The config for colour and depth, which can be combined with an installed network.
pub const COLOUR_AND_DEPTH: &str = "depth-verified";

/// The configs for depth. One that suits the height of the camera is tried first.
const OF_DEPTH: [&str; 3] = [COLOUR_AND_DEPTH, "depth-alone", "depth-net-ekf"];

/// Reason why a pipeline without a camera is not chosen if the user named a camera.
const WITHOUT_CAMERA: &str = "it uses no camera, and --camera names one";

/// End of the reason for a log without any camera.
const NO_IMAGES: &str = "it has no images of a camera";

/// A pipeline for logs of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Name of the built-in config, or [`NETWORK`] for the config of an installed network.
    pub config: &'static str,
    /// Reason for the choice.
    pub reason: &'static str,
}

/// The pipelines; the first that fits a log is chosen. If several fit, the order is that of
/// `tagalong bench --leave-one-room-out` in docs/benchmarks.md.
pub const CHOICES: [Choice; 11] = [
    Choice {
        config: COLOUR_AND_DEPTH,
        reason: "of those that need no network it has the best HOTA in leave-one-room-out tests",
    },
    Choice {
        config: "depth-alone",
        reason: "of those that need no colour it has the best HOTA in leave-one-room-out tests; it \
                 has only one verifier, so expect some tracks on furniture",
    },
    Choice {
        config: "depth-net-ekf",
        reason: "it needs neither visible heads nor settings for the height of the camera",
    },
    Choice {
        config: "stereo-verified",
        reason: "verifiers check its detections; at 2 to 3 images per second stereo-svm-ekf has \
                 the higher HOTA in real rooms",
    },
    Choice { config: "stereo-street", reason: "it is made for pairs with a wide baseline" },
    Choice {
        config: PANORAMIC,
        reason: "it is made for several people in front of a conical mirror",
    },
    Choice { config: NETWORK, reason: "you installed this network; positions in metres are rough" },
    Choice {
        config: "lidar",
        reason: "it finds people all around in the points of the lidar; it was tried on simulated \
                 points only",
    },
    Choice { config: WITHOUT_NETWORK, reason: "it needs no depth; positions in metres are rough" },
    Choice {
        config: "laser-legs",
        reason: "it detects objects that move into free space; people who stand still may be missed",
    },
    Choice {
        config: "laser-follow",
        reason: "without odometry, motion of the robot cannot be told from motion of people",
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
    /// Those that fit, best first.
    pub fitting: Vec<Fitting>,
    /// Use of the topics of the log by a pipeline that takes all inputs.
    pub account: InputAccount,
    /// Pipelines that were tried and do not fit.
    refusals: Vec<Refusal>,
    /// True for a log without a message.
    is_empty: bool,
    /// A line about lost data; empty for an intact log.
    damage: String,
    /// Camera that the user named.
    camera: Option<String>,
}

/// A pipeline that does not fit a log.
struct Refusal {
    config: &'static str,
    /// Reason, with the remedy if there is one.
    why: String,
    /// Inputs that the pipeline requires and on which it fails; `None` if it is not made for this
    /// kind of log.
    required: Option<Vec<Input>>,
}

impl Fittings {
    /// Returns the failure for a log that no pipeline fits.
    pub fn none_fits(&self, log: &Path) -> Failure {
        let account: String =
            self.account.lines().iter().map(|line| format!("\n  {line}")).collect();
        let account = if account.is_empty() { account } else { format!("\nits topics:{account}") };
        let log = log.display();
        if let Some(why) = self.missing_camera() {
            return Failure::failed(format!("{log}: {why}"));
        }
        if let Some(why) = self.common_reason() {
            let whole = format!("{log}: {why}\n{}", self.damage);
            return Failure::failed(whole.trim_end());
        }
        let refusals = self.refusals.iter();
        let refusals: String =
            refusals.map(|refusal| format!("\n  {}: {}", refusal.config, refusal.why)).collect();
        let damage = &self.damage;
        let hint = format!("`tagalong inspect {log}` lists its topics");
        Failure::failed(format!(
            "{log}: no built-in pipeline fits:{refusals}{account}\n{damage}{hint}"
        ))
    }

    /// Returns the reason of refusals because a named camera is not in the log. Pipelines without a
    /// camera have another reason, which would not help.
    fn missing_camera(&self) -> Option<String> {
        let missing = format!("no camera `{}`", self.camera.as_ref()?);
        let refusal = self.refusals.iter().find(|refusal| refusal.why.contains(&missing))?;
        // On the command line, the key of a config corresponds to the option.
        let why = refusal.why.replace("`camera` under [input]", "--camera");
        let remedy = format!("{NO_IMAGES}: leave out --camera");
        Some(why.replace(NO_IMAGES, &remedy))
    }

    /// Returns the reason of all refusals, if it is the same for all, as for a file that is not a
    /// log.
    fn common_reason(&self) -> Option<&str> {
        if self.is_empty {
            return Some("the log has no messages");
        }
        let (first, others) = self.refusals.split_first()?;
        let is_common = others.iter().all(|other| other.why == first.why);
        (is_common && !others.is_empty()).then_some(&*first.why)
    }

    /// Returns the contents of the log in words: the inputs that can be used, and how many topics
    /// cannot.
    pub fn contents(&self) -> String {
        let usable = self.account.usable();
        // "Alone" is said only if there is nothing else.
        let is_alone = self.account.topics.len() == usable.len();
        let missing = self.account.curable().filter_map(|topic| topic.could_be);
        let missing = missing.filter(|input| !usable.contains(input));
        let mut unusable: Vec<&str> = missing.map(words_of).collect();
        unusable.dedup();
        let usable: Vec<&str> = usable.into_iter().map(words_of).collect();
        let usable = match usable.split_last() {
            None => "nothing usable".to_owned(),
            Some((last, [])) if is_alone => format!("{last} alone"),
            Some((last, [])) => (*last).to_owned(),
            Some((last, others)) => format!("{} and {last}", others.join(", ")),
        };
        if unusable.is_empty() {
            usable
        } else {
            format!("{usable}, and also {} that cannot be used", unusable.join(", "))
        }
    }

    /// Returns the reason why none of the pipelines that fit has a neural network, with the command
    /// that installs one if none is installed; `None` if one has, or if a network would have no
    /// images.
    pub fn without_network(&self) -> Option<String> {
        if self.fitting.iter().any(|fitting| fitting.choice.config == NETWORK) {
            return None;
        }
        let has_colour = self.account.usable().contains(&Input::Colour.name());
        match self.refusals.iter().find(|refusal| refusal.config == NETWORK) {
            Some(refusal) => Some(refusal.why.clone()),
            None if has_colour => missing_network(NETWORK),
            None => None,
        }
    }

    /// Returns the pipeline that would be chosen if a topic could be used, with the reason why it
    /// cannot and the remedy; `None` if nothing in the log prevents a better one.
    pub fn better(&self) -> Option<String> {
        let best = CHOICES[0].config;
        if self.fitting.first()?.choice.config == best {
            return None;
        }
        let topic = self.account.curable().find(|topic| {
            // The best pipeline needs just these two inputs.
            matches!(topic.could_be, Some("depth" | "colour"))
        });
        let Some(topic) = topic else { return self.refused_though_there() };
        let could_be = topic.could_be.unwrap_or_default();
        let why = topic.problem.as_deref().unwrap_or_default();
        let remedy = topic.remedy.as_ref().map(|it| format!("; {it}")).unwrap_or_default();
        Some(format!(
            "{best} would do better and needs {could_be}, but {} ({}) cannot be used: {why}{remedy}",
            topic.topic, topic.kind
        ))
    }

    /// Returns the first pipeline that fails on inputs although the log has them, with the reason.
    fn refused_though_there(&self) -> Option<String> {
        let usable = self.account.usable();
        let taken = self.fitting.first()?.choice.config;
        let refusal = self.refusals.iter().find(|refusal| {
            place_of(refusal.config) < place_of(taken)
                && refusal.required.as_ref().is_some_and(|required| {
                    required.iter().all(|input| usable.contains(&input.name()))
                })
        })?;
        Some(format!("{} would do better, but: {}", refusal.config, refusal.why))
    }
}

/// Returns the index of a config among the choices.
fn place_of(config: &str) -> Option<usize> {
    CHOICES.iter().position(|choice| choice.config == config)
}

/// Returns an input in words.
fn words_of(input: &str) -> &str {
    match input {
        "right" => "right images of a stereo pair",
        "laser" => "laser scans",
        "points" => "points of a lidar",
        other => other,
    }
}

/// Returns true if a pipeline uses images of a camera.
pub fn uses_camera(inputs: Inputs) -> bool {
    [Input::Colour, Input::Depth, Input::Right].into_iter().any(|input| inputs.uses(input))
}

/// Returns the inputs that a pipeline requires.
fn required(inputs: Inputs) -> Vec<Input> {
    let known = Input::ALL.into_iter().chain([Input::POINTS]);
    known.filter(|input| inputs.requires(*input)).collect()
}

/// Returns a line about a log that is partly lost; empty for an intact one.
fn damage(found: &Inspection) -> String {
    if !found.data_lost {
        return String::new();
    }
    let first = found.notes.first().map_or("", String::as_str);
    format!("part of the log was lost ({first}): record it again, or look for a whole copy\n")
}

/// Returns the first pipelines that fit a log, at most `most`, by trying each on its first frame.
pub fn fitting(log: &Path, registry: &Registry, args: &InputArgs, most: usize) -> Fittings {
    let mut found = Fittings { camera: args.camera.clone(), ..Fittings::default() };
    let input = args.applied(OuterSettings::default()).input;
    // If a log cannot be read, the trials report the reason.
    if let Ok(inspected) = tagalong_log::inspect(log, &input, &Limits::default()) {
        found.damage = damage(&inspected);
        found.is_empty = inspected.topics.iter().all(|topic| topic.count == 0);
        found.account = inspected.inputs;
    }
    // Pipelines for depth that are made for a camera at another height.
    let mut unsuited = Vec::new();
    for choice in CHOICES {
        let Some(config) = ConfigFile::named(choice.config) else { continue };
        if !OF_DEPTH.contains(&choice.config) {
            found.fitting.append(&mut unsuited);
        }
        if found.fitting.len() >= most {
            break;
        }
        match try_config(&config, log, registry, args) {
            Ok(true) => found.fitting.push(Fitting { choice, config }),
            Ok(false) => unsuited.push(Fitting { choice, config }),
            Err(misfit) => found.refusals.push(Refusal {
                config: choice.config,
                why: reason(log, &misfit.why),
                required: misfit.required,
            }),
        }
    }
    found.fitting.append(&mut unsuited);
    found.fitting.truncate(most);
    found
}

/// Failure of a trial.
struct Misfit {
    why: Failure,
    /// As in [`Refusal`].
    required: Option<Vec<Input>>,
}

impl From<Failure> for Misfit {
    fn from(why: Failure) -> Self {
        Self { why, required: None }
    }
}

/// Returns the reason of a failure, without the path of the log and the list of its topics, which
/// would be the same for each pipeline.
fn reason(log: &Path, why: &Failure) -> String {
    let reason = why.message.lines().next().unwrap_or_default();
    let log = log.display();
    let reason = reason.replacen(&format!("`{log}`, "), "", 1);
    reason.replacen(&format!("`{log}` "), "the log ", 1).replacen(&format!("`{log}`: "), "", 1)
}

/// Largest number of frames of which the first that has all inputs is tried: a scanner may start after
/// the camera.
const TRIED_FRAMES: usize = 30;

/// Runs a pipeline on the first frame of a log that has its inputs; returns false if the height or the
/// pitch of the camera is outside of the range of the config.
fn try_config(
    config: &ConfigFile,
    log: &Path,
    registry: &Registry,
    args: &InputArgs,
) -> Result<bool, Misfit> {
    let (mut pipeline, settings) = config.pipeline(registry, None)?;
    let required = Some(required(pipeline.inputs()));
    if args.camera.is_some() && !uses_camera(pipeline.inputs()) {
        return Err(Failure::failed(WITHOUT_CAMERA).into());
    }
    let outer = args.applied(config.outer_for(&pipeline)?);
    let opened = FrameSource::open(log, &outer.input, &outer.limits, pipeline.inputs());
    let mut source =
        opened.map_err(|error| Misfit { why: error.into(), required: required.clone() })?;
    let Some(item) = source.next_frame() else {
        let account = source.account();
        let failing = account.topics.iter().find(|it| it.used_as.is_some() && it.problem.is_some());
        let last = source.notes().last().filter(|_| source.data_lost());
        let lost = source.first_loss().or(last.map(String::as_str));
        let why = failing.map(|topic| format!(": {topic}"));
        let why = why.or_else(|| lost.map(|note| format!(": {note}"))).unwrap_or_default();
        let why = Failure::failed(format!("no frame that can be used{why}"));
        return Err(Misfit { why, required });
    };
    // Any colour image is accepted as a panorama, and a panorama as any image.
    if item.frame.camera.panorama().is_some() != (config.stem() == PANORAMIC) {
        return Err(Failure::failed("another kind of camera").into());
    }
    // Without odometry the robot is assumed to be at rest, so that all objects seem to move.
    if settings.suits.odometry && !source.has_odometry() {
        return Err(Failure::failed("no odometry").into());
    }
    // A pair with a wide baseline sees no people nearby, one with a narrow baseline none far away.
    if let Some(baseline_m) = source.facts().baseline_m
        && settings.suits.baseline_off_m(baseline_m) > 0.0
    {
        let [low, high] = settings.suits.baseline_m.unwrap_or_default();
        return Err(Failure::failed(format!(
            "for pairs with a baseline of {low} to {high} m, but this one has {baseline_m:.2} m"
        ))
        .into());
    }
    let is_suited = Traits::of(&source).misfits(&settings.suits).is_empty();
    let mut lacking = Lacking::default();
    let mut next = Some(item);
    for _ in 0..TRIED_FRAMES {
        let Some(item) = next else { break };
        match lacking.step(&mut pipeline, &item.frame) {
            Ok(Some(_)) => return Ok(is_suited),
            Ok(None) => next = source.next_frame(),
            Err(error) => return Err(Misfit { why: Failure::failed(error), required }),
        }
    }
    let why = lacking.failure().map_or_else(|| "no frame".to_owned(), ToString::to_string);
    Err(Misfit { why: Failure::failed(why), required })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_that_is_not_taken_has_its_reason() {
        let why = "the log has no colour";
        let refusal = Refusal { config: NETWORK, why: why.to_owned(), required: None };
        let found = Fittings { refusals: vec![refusal], ..Fittings::default() };
        assert_eq!(found.without_network().as_deref(), Some(why));
        assert_eq!(Fittings::default().without_network(), None, "it would see nothing");
    }

    #[test]
    fn of_a_log_without_messages_that_is_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("empty.mcap");
        std::fs::write(&log, b"\x89MCAP0\r\n").unwrap();
        let found = fitting(&log, &Registry::default(), &InputArgs::default(), 1);
        let message = found.none_fits(&log).message;
        assert!(message.contains("empty.mcap: the log has no messages"), "{message}");
        assert!(!message.contains("no built-in pipeline fits"), "{message}");
    }

    #[test]
    fn a_scanner_that_cannot_be_used_beside_another_leaves_the_log_with_scans() {
        let front = tagalong_log::TopicUse {
            topic: "/scan".to_owned(),
            kind: "sensor_msgs/LaserScan".to_owned(),
            camera: None,
            used_as: Some("laser".to_owned()),
            calibration: None,
            problem: None,
            could_be: None,
            remedy: None,
        };
        let rear = tagalong_log::TopicUse {
            used_as: None,
            problem: Some("angle_increment is 0".to_owned()),
            could_be: Some("laser"),
            ..front.clone()
        };
        let mut found = Fittings::default();
        found.account.topics = vec![front, rear];
        assert_eq!(found.contents(), "laser scans");
    }

    #[test]
    fn a_camera_that_is_not_in_the_log_is_one_cause_and_not_ten() {
        fn refusal(config: &'static str, why: &str) -> Refusal {
            Refusal { config, why: why.to_owned(), required: None }
        }

        let why = "the log has no camera `/back`; `camera` under [input] can be one of: /front";
        let refusals = vec![refusal("lidar", "the log has no points"), refusal("mono", why)];
        let camera = Some("/back".to_owned());
        let mut found = Fittings { refusals, camera, ..Fittings::default() };
        let message = found.none_fits(Path::new("robot.mcap")).message;
        let expected = "robot.mcap: the log has no camera `/back`; --camera can be one of: /front";
        assert_eq!(message, expected);
        found.refusals[1].why =
            "the log has no camera `/back`; it has no images of a camera".into();
        let message = found.none_fits(Path::new("scans.mcap")).message;
        assert!(
            message.ends_with("; it has no images of a camera: leave out --camera"),
            "{message}"
        );
        found.camera = None;
        let message = found.none_fits(Path::new("robot.mcap")).message;
        assert!(message.contains("no built-in pipeline fits"), "{message}");
    }
}
