use std::path::PathBuf;

use clap::{Parser, Subcommand};
use clap_complete::Shell;
use tagalong_annotate::{AnnotateArgs, HELP as ANNOTATE_HELP};
use tagalong_app::format::{Format, TableFormat};
use tagalong_app::input_args::InputArgs;
use tagalong_benchmark::BenchArgs;
use tagalong_benchmark::experiments::boxes::{BoxesArgs, HELP as BOXES_HELP};
use tagalong_benchmark::experiments::follow::FollowArgs;
use tagalong_benchmark::experiments::trials::TrialsArgs;
use tagalong_doctor::DoctorArgs;
use tagalong_import::ImportArgs;
use tagalong_simulate::SimulateArgs;
use tagalong_training::TrainArgs;
use tagalong_view::{HELP as VIEW_HELP, ViewArgs};

use crate::commands::{AlterArgs, BlurArgs, EvalArgs, ModelArgs};
use crate::demo::DemoArgs;
use crate::run::RunArgs;

/// Detects people in the logs of a mobile robot, tracks them, and follows one of
/// them.
#[derive(Debug, Parser)]
#[command(name = "tagalong", version, about, after_help = EXIT_CODES, max_term_width = 100)]
pub struct Cli {
    /// Subcommand to run.
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_CODES: &str = "\
Examples:
  tagalong demo
  tagalong run configs/depth-ekf.toml robot.mcap --overlay

Results go to stdout, log messages to stderr. Exit codes: 0 ok; 1 failed; 2 wrong usage or config; 3
finished, but part of the log was lost or `doctor` found a defect; 130 and 143 stopped by a signal (the
files are valid).";

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Demonstrates all steps on a simulated scene: a log, two pipelines, pictures, a report
    #[command(after_help = DEMO_HELP)]
    Demo(DemoArgs),
    /// Tracks the people in a log
    #[command(after_help = RUN_HELP)]
    Run(RunArgs),
    /// Writes a page about a run: images, plan, events, and why people were missed
    #[command(after_help = VIEW_HELP)]
    View(ViewArgs),
    /// Opens a page to annotate the people in a log: truth for `eval`, `bench` and `view`
    #[command(after_help = ANNOTATE_HELP)]
    Annotate(AnnotateArgs),
    /// Lists the plugins
    #[command(after_help = "Example:\n  tagalong list --format json")]
    List {
        /// Output format.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Prints the default settings of a plugin, each with its explanation
    #[command(after_help = CONFIG_HELP)]
    Config {
        /// Name of the plugin, `pipeline` for everything around the plugins, `all`, or `funnel` for
        /// the settings of each test.
        plugin: String,
        /// Output format: TOML, a table, or a JSON schema.
        #[arg(long, value_enum, default_value_t)]
        format: TableFormat,
    },
    /// Prints a JSON schema of configs, for editors
    #[command(after_help = SCHEMA_HELP)]
    Schema,
    /// Prints the completion script of a shell
    #[command(after_help = COMPLETIONS_HELP)]
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Writes manual pages, one per command
    #[command(
        after_help = "Example:\n  tagalong man -o ~/.local/share/man/man1 && man tagalong-run"
    )]
    Man {
        /// Folder to write to.
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
    },
    /// Checks a config, and whether it fits a log
    #[command(after_help = CHECK_HELP)]
    Check {
        /// The config.
        config: PathBuf,
        /// A log that the config should work on.
        log: Option<PathBuf>,
        /// Output format.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Explains missing or false detections in a log
    #[command(after_help = DOCTOR_HELP)]
    Doctor(DoctorArgs),
    /// Converts a data set or a folder of images to a log
    #[command(after_help = IMPORT_HELP)]
    Import(ImportArgs),
    /// Compares pipelines on the same logs
    #[command(after_help = BENCH_HELP)]
    Bench(BenchArgs),
    /// Scores tracks against the ground truth
    #[command(after_help = EVAL_HELP)]
    Eval(EvalArgs),
    /// Simulates a scene, and writes the log of a robot among people with the ground truth
    #[command(after_help = SIMULATE_HELP)]
    Simulate(SimulateArgs),
    /// Lets a pipeline drive a simulated robot that follows a person, and scores the rides
    #[command(after_help = FOLLOW_HELP)]
    Follow(FollowArgs),
    /// Compares pipelines on many random variants of the same scenes, in memory
    #[command(after_help = TRIALS_HELP)]
    Trials(TrialsArgs),
    /// Tracks the boxes of another detector, without images, and compares associations
    #[command(after_help = BOXES_HELP)]
    Boxes(BoxesArgs),
    /// Trains the model of a plugin, and writes it with its card
    #[command(after_help = TRAIN_HELP)]
    Train(TrainArgs),
    /// Inspects a neural network in an ONNX file, installs it, or prints a config for it
    #[command(after_help = MODEL_HELP)]
    Model(ModelArgs),
    /// Copies a log with one thing changed: half the rate, mirrored, scaled depth, wrong pixels
    #[command(after_help = ALTER_HELP)]
    Alter(AlterArgs),
    /// Copies a log with the heads of people blurred, to share it
    #[command(after_help = BLUR_HELP)]
    Blur(BlurArgs),
    /// Lists the contents of a log, and the inputs that a pipeline could use
    #[command(after_help = INSPECT_HELP)]
    Inspect {
        /// The log: MCAP, `.db3`, `.bag`, or the folder of a bag.
        log: PathBuf,
        /// Use the `[input]` and `[limits]` sections of this config.
        #[arg(long)]
        config: Option<PathBuf>,
        /// Way in which the log is read.
        #[command(flatten)]
        input: InputArgs,
        /// Output format.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
}

const BLUR_HELP: &str = "\
A run finds people, and their heads are blurred in the images that it used, from half a second before
to half a second after. Everything else is copied message by message, depth included; images and
coloured points that were not searched for people are left out, and listed. A head that the run did
not find is not blurred: check the copy before you share it. The copy is an MCAP file without the
attachments of the log; pictures and pages of a run over it show the blurred images. Exit code 3: some
images could not be decoded, and are left out.

Examples:
  tagalong blur robot.mcap
  tagalong blur robot.mcap -o shared/robot.mcap
  tagalong run depth-verified robot.mcap -o runs/robot && tagalong blur robot.mcap --run runs/robot
  tagalong run robot-blurred.mcap --overlay      # pictures in which no person is recognised";

const ALTER_HELP: &str = "\
The copy has the frames that a pipeline would see: colour or grey images, depth registered to them, the
pose of the camera, and the odometry of the log. Right images, laser scans and everything else are
left out. LOG.people.csv, if it exists, is changed in the same way. A pipeline whose figures are much
worse on the copy than on the log depends on the property that was changed.

Examples:
  tagalong alter robot.mcap --every 2                        # half the images per second
  tagalong alter robot.mcap --mirror -o mirrored.mcap
  tagalong alter robot.mcap --scale-depth 1.02 --salt 0.02   # a depth camera that is a little off
  tagalong bench --logs robot.mcap robot-altered.mcap -o out";

const MODEL_HELP: &str = "\
Prints the inputs and outputs of the file, the family of detectors that its outputs match, or that it
is for re-identification, and the part of a config that runs it; the output is valid TOML. Exit code 1:
no config can use the file; the reason is printed. With `--export` it writes the network of a plugin
into the file instead.

Examples:
  tagalong model yolox_s.onnx
  tagalong model yolox_s.onnx > people.toml && tagalong run people.toml robot.mcap
  tagalong model yolov8n-dynamic.onnx --size 320 320
  tagalong model yolox_s.onnx --format json | jq -r .family
  tagalong model osnet_x0_25.onnx        # prints the section [appearance] for it
  tagalong model --export depth-net depth-net.onnx";

const DEMO_HELP: &str = "\
Needs no input file, and takes half a minute.

Examples:
  tagalong demo
  tagalong demo -o another-demo --seed 3";

const DOCTOR_HELP: &str = "\
Measures intrinsics, stamps, frames, light, depth, its registration to colour, floor and mount; then
runs the pipeline for a while, compares its tracks with the person-sized shapes that come and go in
depth, and shows what each of its tests dropped. If tracks and depth disagree, it tries other settings
on the log. Each finding says what to change in the config. Exit code 3: a finding is bad.

Examples:
  tagalong doctor robot.mcap
  tagalong doctor robot.mcap -o checkup
  tagalong doctor configs/depth-ekf.toml robot.mcap
  tagalong doctor configs/depth-ekf.toml robot.mcap -o checkup --frames 1000 --settings always
  tagalong doctor configs/depth-ekf.toml robot.mcap --format json | jq '.findings[] | select(.severity == \"bad\")'";

const IMPORT_HELP: &str = "\
Images are copied unchanged; truth, if the data set has it, is written beside the log, where `eval`
and `bench` find it.

Examples:
  tagalong import tum rgbd_dataset_freiburg3_walking_xyz
  tagalong import kitti training --sequence 0013 -o runs/kitti-0013.mcap
  tagalong import mot MOT17-04-FRCNN
  tagalong import leg-tracker general_tracking_moving_1.bag   (truth for that bag)
  tagalong import images photos --fps 15 --view 69 --height 1.2 --tilt 5
  tagalong import cvat annotations.xml -o robot.people.csv    (truth for robot.mcap)
  tagalong import images colour --depth depth --depth-unit 0.001 --focal 525";

const FOLLOW_HELP: &str = "\
Prints how long the right person and a wrong one were followed, how soon a person who came back was
found again, the distance, the clearance to people and objects, and how smooth the ride was. The log of
a ride has its images, the truth, the commands (/cmd_vel) and their reasons (/follow/frames); --overlay
adds a picture per frame.

--inject adds a fault in the middle of a ride: a sensor freezes, goes dark, is late or repeats its data,
the odometry is silent or wrong, the clock jumps, the wheels do not obey. The kinds of faults are
  freeze-depth freeze-all freeze-laser blank-depth saturate-depth dark-columns noise-depth
  laser-invalid laser-near delay resend drop drop-laser freeze-sensors drop-sensors
  nan-odometry odometry-silent odometry-frozen odometry-wrong odometry-late-stamps
  calibration-changed mount-moved mount-knocked wheels-stuck wheels-slip wheels-runaway
  wheel-latency clock-back clock-forward enable-stuck, and random;
docs/reference/faults.md describes them.

With --approaches a person or a trolley comes at the robot from any side, at 0.2 to 1.6 m/s, at any
moment of a short ride, and does not avoid it. Prints in how many approaches the robot moved at a
contact, with the exact 95 % bound for this number of approaches. --replay prints the course of the
approach with a seed.

Examples:
  tagalong follow
  tagalong follow configs/follow-depth.toml configs/scenes/follow-passing.toml -o rides --overlay
  tagalong follow configs/follow-depth.toml --seeds 50 --against configs/follow-arc.toml
  tagalong follow configs/follow-depth.toml --latency-ms 150 --drop 0.2 --format markdown
  tagalong follow configs/follow-depth.toml configs/scenes/follow-passing.toml --inject freeze-depth@5
  tagalong follow configs/follow-depth.toml --seeds 50 --inject random
  tagalong follow configs/follow-depth.toml --approaches 1000 --faults one -o contacts
  tagalong follow configs/follow-depth.toml --replay 2000000007 --faults one";

const TRIALS_HELP: &str = "\
Prints MOTA, IDF1, position errors, and how often all people are tracked in all frames, with intervals
over the draws, and the gain of each pipeline over the last one on the same draws.

Examples:
  tagalong trials
  tagalong trials configs/scenes/crossing.toml --seeds 50 --configs configs/depth-ekf.toml
  tagalong trials --format json | jq .gains";

const RUN_HELP: &str = "\
Files: tracks.mcap (for `tagalong view`, Foxglove and Rerun), tracks.csv (MOTChallenge columns,
pixels), tracks-metres.csv, joints.csv (if a pose network runs), report.json (what was dropped and
why), timings.json, origin.json, with --smoothed tracks-smoothed.csv, and with --overlay
overlay/000001.png and so on.

Examples:
  tagalong run --overlay --overwrite       (built-in config, simulated log)
  tagalong run robot.mcap                  (selects a pipeline for the sensors)
  tagalong run depth-verified robot.mcap   (a built-in pipeline, from any folder)
  tagalong run my-pipeline.toml robot.mcap -o out --overlay --overwrite
  tagalong run robot.mcap --with-images    (tracks.mcap with the images, for Foxglove)
  tagalong run robot.mcap --format json | jq .funnel";

const CONFIG_HELP: &str = "\
Examples:
  tagalong config ekf
  tagalong config pipeline > my-pipeline.toml
  tagalong config all --format markdown";

const SCHEMA_HELP: &str = "\
Editors with Taplo check and complete a config while you write it, if its first line is
`#:schema tagalong.json`.

Example:
  tagalong schema > tagalong.json";

const COMPLETIONS_HELP: &str = "\
Examples:
  tagalong completions bash > ~/.local/share/bash-completion/completions/tagalong
  tagalong completions zsh > ~/.zfunc/_tagalong
  tagalong completions fish > ~/.config/fish/completions/tagalong.fish";

const CHECK_HELP: &str = "\
Examples:
  tagalong check configs/depth-ekf.toml
  tagalong check configs/depth-ekf.toml robot.mcap";

const BENCH_HELP: &str = "\
Without a step it plans, runs and reports. Results are kept under a hash of everything they depend
on; running again computes only what is missing. docs/reference/figures.md defines each figure.

Examples:
  tagalong bench --logs-dir logs -o bench --jobs 2
  tagalong bench --configs a.toml b.toml --logs walk.mcap --seeds 5
  tagalong bench --logs-dir logs --baseline old/report.json --fail-if 'HOTA<-0.01'
  tagalong bench plan --logs-dir logs -o bench | jq .hash
  tagalong bench --leave-one-room-out benches/rooms.toml
  tagalong bench export -o bench --trackeval tree";

const EVAL_HELP: &str = "\
Prints the usual metrics (HOTA, MOTA, IDF1, LAMR, OSPA, position errors), the rules by which the truth
was read, and notes on input that may have been misread; --format json prints one flat object.
MOTChallenge text is refused, with its line, for the same errors as in TrackEval: an unknown class in
truth, tracks of other classes than people, ids below 0, frames beyond seqLength. Boxes without an area
match no person, and are counted. docs/reference/figures.md defines each figure, its range, and which
direction is better.

--repairs prints what HOTA, MOTA and IDF1 would be if one kind of error were gone and everything else
stayed: the largest gain shows what to work on. Tracks and people whose boxes overlap by a tenth count
as pairs there, so that a badly placed box is not both a false positive and a miss.

Examples:
  tagalong eval --truth robot.people.csv --tracks runs/robot-depth-ekf
  tagalong eval --truth robot.people.csv --tracks runs/robot-depth-ekf --similarity metres
  tagalong eval --truth robot.people.csv --tracks runs/robot-depth-ekf --repairs
  tagalong eval --truth MOT17-04/gt/gt.txt --tracks MOT17-04.txt --format json | jq .HOTA";

const SIMULATE_HELP: &str = "\
The same scene and seed give the same bytes.

Examples:
  tagalong simulate configs/scenes/crossing.toml
  tagalong simulate configs/scenes/crossing.toml -o crossing.mcap --seed 7 --split test
  tagalong simulate configs/scenes/crowd.toml --set crowd=3 --set camera.kind=stereo
  tagalong simulate configs/scenes/crossing.toml --gallery pictures";

const TRAIN_HELP: &str = "\
The template detector proposes the candidates in simulated rooms and annotated logs. The same seed and
data give the same bytes. The card beside the model has the counts, the cross-validation and the
figures on held-out rooms and logs. Trainers need a program that is built with `--features train`.

Examples:
  tagalong train svm-patch --quick -o quick.toml
  tagalong train svm-patch --data ../shared/data";

const INSPECT_HELP: &str = "\
Examples:
  tagalong inspect robot.mcap
  tagalong inspect robot.mcap --format json | jq .topics";

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_shows_an_example() {
        for command in Cli::command().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains("Example"), "{}", command.get_name());
        }
    }

    #[test]
    fn the_kinds_of_injected_faults_are_in_the_help_and_in_the_reference() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/faults.md");
        let page = std::fs::read_to_string(path).expect("the page is in the clone");
        let named: Vec<&str> = FOLLOW_HELP.split([' ', ',', '\n']).collect();
        for kind in tagalong_sim::FaultKind::ALL {
            assert!(named.contains(&kind.name()), "{kind}");
            assert!(page.contains(&format!("| `{kind}` | ")), "{kind}");
        }
    }

    #[test]
    fn no_threads_at_all_are_refused() {
        assert!(Cli::try_parse_from(["tagalong", "run", "a", "b", "--threads", "0"]).is_err());
        assert!(Cli::try_parse_from(["tagalong", "run", "a", "b", "--threads", "2"]).is_ok());
    }
}
