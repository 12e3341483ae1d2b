use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tagalong_app::choice::CHOICES;
use tagalong_app::format::Format;
use tagalong_app::input_args::InputArgs;
use tagalong_app::installed::NETWORK;
use tagalong_app::suggest::LOG_ENDINGS;
use tagalong_log::write::BoxedPart;
use tagalong_render::OverlayStyle;

/// Returns the help on the pipeline, with the names of those that are taken without one.
fn config_help() -> String {
    let built_in = CHOICES.iter().map(|choice| choice.config).filter(|name| *name != NETWORK);
    let names: Vec<&str> = built_in.collect();
    format!(
        "The pipeline, a TOML file or the name of a built-in one: {} and others [default: one for \
         the sensors in the log]",
        names.join(", ")
    )
}

/// Arguments of `tagalong run`.
#[derive(Args, Clone, Debug, Default)]
pub struct RunArgs {
    /// The pipeline: a TOML file or the name of a built-in one.
    // The help has the names of the list of pipelines.
    #[arg(help = config_help())]
    pub config: Option<PathBuf>,
    /// The log: .mcap, .db3, .bag, or the folder of a recording [default: a short simulated one, written to
    /// runs/sample.mcap].
    pub log: Option<PathBuf>,
    /// Output folder [default: runs/LOG-CONFIG, or runs/LOG-CONFIG-CAMERA with --camera].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Render a picture of every frame: people with ids, distances and trails, and a view from above;
    /// `--overlay=debug` adds dropped candidates with their tests, and the state of the filter.
    #[arg(
        long,
        value_enum,
        value_name = "DETAIL",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "people"
    )]
    pub overlay: Option<Overlaid>,
    /// Also write the images into tracks.mcap, as JPEG, so that one file shows the whole scene.
    #[arg(long)]
    pub with_images: bool,
    /// Also write tracks-smoothed.csv: tracks.csv with the IDs corrected that later frames showed to be
    /// wrong. Only for recordings: on a robot these IDs would come too late.
    #[arg(long)]
    pub smoothed: bool,
    /// Replace the files of an earlier run in the same directory.
    #[arg(long)]
    pub overwrite: bool,
    /// Fail (exit code 1) if any part of the log was lost or damaged.
    #[arg(long)]
    pub strict: bool,
    /// Threads: 1 does everything in turn, 2 reads ahead, 3 also renders in parallel; stereo matching
    /// uses at most as many. The results are the same.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub threads: Option<u8>,
    /// Use this seed instead of the config's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Serve a live page: images with people, the plan from above, target and command, events. Only on
    /// this computer and on a free port, unless a port or an address is given; the printed address is
    /// the key to the page. The run does not wait for browsers.
    #[arg(
        long,
        value_name = "[ADDRESS:]PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "0",
        value_parser = tagalong_view::parse_address
    )]
    pub serve: Option<SocketAddr>,
    /// Process frames no faster than they were recorded, to watch the run with --serve.
    #[arg(long)]
    pub realtime: bool,
    /// Output format of the results.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Run once for each camera of the log, each time into a folder with the camera's name; a person
    /// has a separate ID in each.
    #[arg(long, conflicts_with_all = ["camera", "serve"])]
    pub each_camera: bool,
    /// Way in which the log is read.
    #[command(flatten)]
    pub input: InputArgs,
    /// Suppresses all output; for commands that consist of runs.
    #[arg(skip)]
    pub quiet: bool,
}

/// Parts that the pictures of a run show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Overlaid {
    /// Only people.
    #[default]
    People,
    /// Also dropped candidates and the state of the filter.
    Debug,
}

impl Overlaid {
    /// Returns the style of the pictures, with boxes as the config sets them.
    pub fn style(self, boxes: BoxedPart) -> OverlayStyle {
        match self {
            Self::People => OverlayStyle { boxes, ..OverlayStyle::default() },
            Self::Debug => OverlayStyle::debug(boxes),
        }
    }
}

impl RunArgs {
    /// Arguments of a run that prints nothing and replaces the files of an earlier one, for commands
    /// that consist of runs; without a config it is the one for the sensors in the log.
    pub fn quiet(config: Option<PathBuf>, output: PathBuf) -> Self {
        Self { config, output: Some(output), overwrite: true, quiet: true, ..Self::default() }
    }

    /// Returns the path of the log.
    pub fn log(&self) -> &Path {
        self.in_order().1.unwrap_or(Path::new(SAMPLE))
    }

    /// Returns true if a log is given.
    pub fn has_log(&self) -> bool {
        self.in_order().1.is_some()
    }

    /// Returns the config, if one is given.
    pub fn config(&self) -> Option<&Path> {
        self.in_order().0
    }

    /// Returns config and log, given in either order; a single path is that of a log if it looks
    /// like one.
    fn in_order(&self) -> (Option<&Path>, Option<&Path>) {
        match (self.config.as_deref(), self.log.as_deref()) {
            (Some(single), None) if is_log(single) => (None, Some(single)),
            (Some(first), Some(second)) if is_log(first) && !is_log(second) => {
                (Some(second), Some(first))
            }
            given => given,
        }
    }
}

/// Returns true for the path of a log, as opposed to that of a config: a file of a recorder, or a
/// folder with its files.
fn is_log(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| LOG_ENDINGS.contains(&ending.as_str())) || path.is_dir()
}

/// Path of the simulated log that stands in for a real one.
const SAMPLE: &str = "runs/sample.mcap";

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        run: RunArgs,
    }

    fn split(arguments: &[&str]) -> (Option<String>, String) {
        let line = Line::parse_from([&["run"], arguments].concat());
        let config = line.run.config().map(|path| path.display().to_string());
        (config, line.run.log().display().to_string())
    }

    #[test]
    fn the_help_names_each_pipeline_that_a_log_may_get() {
        use clap::CommandFactory as _;
        let help = Line::command().render_long_help().to_string().replace('\n', " ");
        for choice in CHOICES.iter().filter(|choice| choice.config != NETWORK) {
            assert!(help.contains(&format!(" {}", choice.config)), "{}: {help}", choice.config);
        }
        let pipeline =
            help.split("The pipeline,").nth(1).and_then(|rest| rest.split("[default").next());
        assert_eq!(pipeline.map(|text| text.contains(" network,")), Some(false));
    }

    #[test]
    fn a_log_is_known_by_its_ending_wherever_it_stands() {
        for log in ["robot.mcap", "robot.MCAP", "robot.db3", "robot.bag"] {
            assert_eq!(split(&[log]), (None, log.into()));
            assert_eq!(split(&["depth-ekf", log]), (Some("depth-ekf".into()), log.into()));
            assert_eq!(split(&[log, "depth-ekf"]), (Some("depth-ekf".into()), log.into()));
        }
        assert_eq!(split(&["depth-ekf"]), (Some("depth-ekf".into()), SAMPLE.into()));
        // The first of two logs is an error, not left out.
        assert_eq!(split(&["a.mcap", "b.mcap"]), (Some("a.mcap".into()), "b.mcap".into()));
        assert_eq!(split(&[]), (None, SAMPLE.into()));
    }
}
