use std::net::SocketAddr;
use std::path::PathBuf;

use tagalong::config::Registry;
use tagalong::log::{InputSettings, Limits};
use tagalong::pipeline::RobotSettings;
use tagalong::{ConfigSource, LogSettings, Pipeline};

use crate::forecast::ForecastSettings;
use crate::{BridgeError, ClockSource, ForecastFrame, Middleware};

/// Follows people live: ROS 2 images and odometry in, tracks and commands out.
///
/// Needs no ROS on this machine. Uses the configs of `tagalong run`; topics that
/// neither the config nor the command line names are found by type. Ctrl-C ends
/// it, with zero as the last command. This is no safety function: the robot needs
/// its own bumper, scanner or emergency stop.
#[derive(Clone, Debug, clap::Parser)]
#[command(
    name = "tagalong-ros2",
    version,
    after_help = "Examples:
  tagalong-ros2 depth-ekf
        tracks people without commands (the config has no controller)
  tagalong-ros2 my-robot.toml --namespace /robot1 --domain 7
        follows a person; commands go to /robot1/cmd_vel
  tagalong-ros2 my-robot.toml --command cmd_vel_nav
        sends commands to another node, such as a collision monitor, which passes them on

Exit codes: 0 ok, 1 failed or a topic is missing, 2 wrong usage or config,
130 and 143 after SIGINT and SIGTERM."
)]
pub struct Options {
    /// The config of the pipeline: a file, or the name of a built-in config (`follow-depth`,
    /// `robots/turtlebot4`).
    pub config: PathBuf,
    /// ROS domain.
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=232))]
    pub domain: u16,
    /// Namespace of the node; relative topic names are inside it.
    #[arg(long, default_value = "/")]
    pub namespace: String,
    /// Topic of the colour images, instead of `[input] colour_topic`.
    #[arg(long, value_name = "TOPIC")]
    pub colour: Option<String>,
    /// Topic of the depth images, instead of `[input] depth_topic`.
    #[arg(long, value_name = "TOPIC")]
    pub depth: Option<String>,
    /// Topic of the odometry, instead of `[input] odometry_topic`.
    #[arg(long, value_name = "TOPIC")]
    pub odometry: Option<String>,
    /// Topic of confirmed tracks (vision_msgs/Detection3DArray).
    #[arg(long, value_name = "TOPIC", default_value = "people/tracks")]
    pub tracks: String,
    /// Topic of the pose of the target (geometry_msgs/PoseStamped).
    #[arg(long, value_name = "TOPIC", default_value = "people/target_pose")]
    pub target: String,
    /// Topic of states and reasons, as text (std_msgs/String).
    #[arg(long, value_name = "TOPIC", default_value = "people/state")]
    pub state: String,
    /// Topic of the deadman's switch (std_msgs/Bool): true lets the robot move for a moment and must
    /// be repeated, false stops it until a reset.
    #[arg(long, value_name = "TOPIC", default_value = "people/enable")]
    pub enable: String,
    /// Topic that clears a stop and a fault (std_msgs/Empty); needed after each start.
    #[arg(long, value_name = "TOPIC", default_value = "people/reset")]
    pub reset: String,
    /// Topic of the heartbeat, a header for each turn of the bridge's loop (std_msgs/Header).
    #[arg(long, value_name = "TOPIC", default_value = "people/heartbeat")]
    pub heartbeat: String,
    /// Topic of the bridge's state (diagnostic_msgs/DiagnosticArray).
    #[arg(long, value_name = "TOPIC", default_value = "/diagnostics")]
    pub diagnostics: String,
    /// Topic of markers for RViz (visualization_msgs/MarkerArray); empty for none.
    #[arg(long, value_name = "TOPIC", default_value = "people/markers")]
    pub markers: String,
    /// Topic of a transform for each person, `person_ID` (tf2_msgs/TFMessage); empty for none.
    #[arg(long, value_name = "TOPIC", default_value = "/tf")]
    pub transforms: String,
    /// Topic of people for planners with a social cost map (people_msgs/People); empty for none.
    #[arg(long, value_name = "TOPIC", default_value = "people")]
    pub people: String,
    /// Topic of a grid of where people will be, for social layers of costmaps
    /// (nav_msgs/OccupancyGrid); empty for none.
    #[arg(long, value_name = "TOPIC", default_value = "people/forecast")]
    pub forecast: String,
    /// Frame of that grid.
    #[arg(long, value_enum, default_value_t)]
    pub forecast_frame: ForecastFrame,
    /// Side of a cell of that grid, m.
    #[arg(long, value_name = "METRES", default_value_t = 0.1, value_parser = cell)]
    pub forecast_resolution: f64,
    /// Side of that grid, with the robot in its middle, m.
    #[arg(long, value_name = "METRES", default_value_t = 12.0, value_parser = side)]
    pub forecast_size: f64,
    /// Time for which people are forecast in that grid, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 3.0, value_parser = horizon)]
    pub forecast_horizon: f64,
    /// Topic of commands.
    #[arg(long, value_name = "TOPIC", default_value = "cmd_vel")]
    pub command: String,
    /// Type of the commands: geometry_msgs/TwistStamped, or geometry_msgs/Twist for bases and Nav2 of
    /// Humble.
    #[arg(long, value_enum, default_value_t)]
    pub command_type: CommandType,
    /// Topic of speed limits (nav2_msgs/SpeedLimit).
    #[arg(long, value_name = "TOPIC", default_value = "speed_limit")]
    pub speed_limit: String,
    /// Address on this computer for HTTP with JSON: POST /enroll and /clear, GET /status and
    /// /healthz; none if left out.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub http: Option<SocketAddr>,
    /// Middleware of the nodes that call the services people/enroll and so on.
    #[arg(long, env = "RMW_IMPLEMENTATION", value_enum, default_value_t)]
    pub rmw: Middleware,
    /// Commands per second.
    #[arg(long, value_name = "HZ", default_value_t = 25.0, value_parser = rate)]
    pub rate: f64,
    /// Longest wait for topics and their first messages, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 15.0, value_parser = seconds)]
    pub wait: f64,
    /// Serve a live page, as `tagalong run --serve` does: only on this computer and on a free port,
    /// unless a port or an address is given. The page cannot change anything.
    #[arg(
        long,
        value_name = "[ADDRESS:]PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "0",
        value_parser = tagalong_view::parse_address
    )]
    pub serve: Option<SocketAddr>,
    /// Clock for the age of a frame.
    #[arg(long, value_enum, default_value_t)]
    pub clock: ClockSource,
    /// Action of Nav2's following server (nav2_msgs/FollowObject), which drives instead of this
    /// program; it has a goal while the switch allows it and a person is followed.
    #[arg(
        long,
        value_name = "ACTION",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "follow_object"
    )]
    pub follow_object: Option<String>,
    /// Check the config, print the distances that follow from it, and exit: nothing is published.
    #[arg(long)]
    pub check: bool,
    /// Start unconfigured, and wait for a manager to configure and activate the node (lifecycle_msgs).
    /// Otherwise the node activates itself.
    #[arg(long)]
    pub lifecycle: bool,
}

/// The environment variable that names a Discovery Server of Fast DDS.
const DISCOVERY_SERVER: &str = "ROS_DISCOVERY_SERVER";

/// Type of the command messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum CommandType {
    /// `geometry_msgs/TwistStamped`.
    #[default]
    TwistStamped,
    /// `geometry_msgs/Twist`.
    Twist,
}

/// Parses the rate; commands must come at 20 Hz or more.
fn rate(text: &str) -> Result<f64, String> {
    within(text, 20.0, 200.0)
}

fn seconds(text: &str) -> Result<f64, String> {
    within(text, 1.0, 3600.0)
}

fn cell(text: &str) -> Result<f64, String> {
    within(text, 0.02, 1.0)
}

fn side(text: &str) -> Result<f64, String> {
    within(text, 1.0, 40.0)
}

fn horizon(text: &str) -> Result<f64, String> {
    within(text, 1.0, 4.0)
}

fn within(text: &str, least: f64, most: f64) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (least..=most).contains(&value) {
        Ok(value)
    } else {
        Err(format!("must lie between {least} and {most}"))
    }
}

/// Contents of the config.
pub(crate) struct Setup {
    pub(crate) pipeline: Pipeline,
    pub(crate) robot: RobotSettings,
    pub(crate) input: InputSettings,
    pub(crate) limits: Limits,
}

impl Options {
    /// Reads the config and builds the pipeline.
    ///
    /// # Errors
    /// [`BridgeError::Config`], with file, line and remedy.
    pub(crate) fn setup(&self, registry: &Registry) -> Result<Setup, BridgeError> {
        check_security(|name| std::env::var(name).ok())?;
        check_discovery(|name| std::env::var(name).ok())?;
        let pipeline = Pipeline::builder(registry).build(&ConfigSource::open(&self.config)?)?;
        let LogSettings { input, limits, .. } = LogSettings::of(&pipeline)?;
        if self.follow_object.is_some() && !pipeline.has_controller() {
            let words = "--follow-object needs a config with a [controller], whose target Nav2 follows; \
                         configs/README.md lists them";
            return Err(BridgeError::Config(words.to_owned()));
        }
        let robot = pipeline.config().robot.clone();
        Ok(Setup { pipeline, robot, input: self.named(input), limits })
    }

    /// Checks the config, and returns the values that follow from it, as lines of text.
    ///
    /// # Errors
    /// [`BridgeError::Config`], with file, line and remedy.
    pub fn checked(&self, registry: &Registry) -> Result<String, BridgeError> {
        let Setup { pipeline, .. } = self.setup(registry)?;
        let distances = pipeline.safety_distances().map(|distances| distances.to_string());
        let mut lines = format!("{}: valid\n", self.config.display());
        let nothing = "  the config has no controller: no commands\n".to_owned();
        lines += &distances.unwrap_or(nothing);
        for caution in pipeline.cautions(None) {
            lines += &format!("  warning: {caution}\n");
        }
        Ok(lines)
    }

    pub(crate) fn forecast_settings(&self) -> ForecastSettings {
        ForecastSettings {
            frame: self.forecast_frame,
            resolution_m: self.forecast_resolution,
            size_m: self.forecast_size,
            horizon_s: self.forecast_horizon,
        }
    }

    /// Returns the settings with the topics from the command line.
    fn named(&self, input: InputSettings) -> InputSettings {
        InputSettings {
            colour_topic: self.colour.clone().or(input.colour_topic),
            depth_topic: self.depth.clone().or(input.depth_topic),
            odometry_topic: self.odometry.clone().or(input.odometry_topic),
            ..input
        }
    }
}

/// Refuses unencrypted communication if the environment enforces ROS 2 security, which this node
/// does not have.
fn check_security(variable: impl Fn(&str) -> Option<String>) -> Result<(), BridgeError> {
    let is_enabled = variable("ROS_SECURITY_ENABLE").as_deref() == Some("true");
    if is_enabled && variable("ROS_SECURITY_STRATEGY").as_deref() == Some("Enforce") {
        let words = "ROS_SECURITY_STRATEGY is Enforce, but this program has no DDS security; its \
                     README says why, under Security";
        return Err(BridgeError::Config(words.to_owned()));
    }
    Ok(())
}

/// Refuses to start if nodes find each other through a Discovery Server of Fast DDS: this node does
/// not use one, and would see no topics.
fn check_discovery(variable: impl Fn(&str) -> Option<String>) -> Result<(), BridgeError> {
    let server = variable(DISCOVERY_SERVER).unwrap_or_default();
    if server.is_empty() {
        return Ok(());
    }
    let words = format!(
        "{DISCOVERY_SERVER} is `{server}`, but this program supports Simple Discovery only, so it \
         would see no topic. Set the robot to Simple Discovery (on a TurtleBot 4 in \
         `turtlebot4-setup`), restart its nodes, and unset {DISCOVERY_SERVER} for this program"
    );
    Err(BridgeError::Config(words))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_node_starts_where_others_are_found_through_a_server_that_it_does_not_ask() {
        for (server, may_start) in [
            (Some("192.168.186.2:11811"), false),
            (Some(";10.0.0.1:11811"), false),
            (Some(""), true),
            (None, true),
        ] {
            let checked = check_discovery(|name| {
                server.filter(|_| name == "ROS_DISCOVERY_SERVER").map(str::to_owned)
            });
            assert_eq!(checked.is_ok(), may_start, "{server:?}");
            if let (Some(server), Err(error)) = (server, checked) {
                assert_eq!(error.exit_code(), 2);
                let words = error.to_string();
                assert!(words.contains(server) && words.contains("Simple Discovery"), "{words}");
            }
        }
    }

    #[test]
    fn a_built_in_config_is_read_by_its_name_and_an_unknown_one_is_a_wrong_config() {
        let registry = tagalong::builtin_registry();
        for (config, topic) in
            [("follow-depth", None), ("robots/turtlebot4", Some("/oakd/rgb/image_raw"))]
        {
            let options: Options = clap::Parser::parse_from(["tagalong-ros2", config]);
            let setup = options.setup(&registry).map_err(|error| error.to_string());
            let setup = setup.unwrap_or_else(|error| panic!("{config}: {error}"));
            assert!(setup.pipeline.has_controller(), "{config}");
            assert_eq!(setup.input.colour_topic.as_deref(), topic);
        }
        let options: Options = clap::Parser::parse_from(["tagalong-ros2", "follow-deep"]);
        let code = options.setup(&registry).err().map(|error| error.exit_code());
        assert_eq!(code, Some(2));
    }

    #[test]
    fn a_check_tells_the_distances_of_a_config_that_drives() {
        let registry = tagalong::builtin_registry();
        for (config, words) in [
            ("robots/turtlebot4", "at 0.306 m/s it stops within "),
            ("depth-ekf", "the config has no controller"),
        ] {
            let options: Options = clap::Parser::parse_from(["tagalong-ros2", config, "--check"]);
            let lines = options.checked(&registry).map_err(|error| error.to_string());
            assert!(lines.as_ref().is_ok_and(|lines| lines.contains(words)), "{lines:?}");
        }
    }

    #[test]
    fn no_node_without_security_starts_where_security_is_enforced() {
        // The default strategy of ROS 2 is Permissive: nodes without keys may talk.
        for (enable, strategy, may_start) in
            [(Some("true"), Some("Enforce"), false), (Some("true"), None, true), (None, None, true)]
        {
            let checked = check_security(|name| {
                let value = if name == "ROS_SECURITY_ENABLE" { enable } else { strategy };
                value.map(str::to_owned)
            });
            let code = checked.err().map(|error| error.exit_code());
            assert_eq!(code, if may_start { None } else { Some(2) }, "{enable:?} {strategy:?}");
        }
    }
}
