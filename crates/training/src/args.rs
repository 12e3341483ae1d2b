use std::path::PathBuf;

use clap::Args;

/// Annotated logs for training.
pub const TRAIN_LOGS: [&str; 2] = ["filinha", "um"];

///. and one of another room, which is held out.
pub const TEST_LOGS: [&str; 1] = ["lab2-camera2"];

/// Arguments of `tagalong train`.
#[derive(Args, Debug)]
pub struct TrainArgs {
    /// The plugin to train, for example `svm-patch`; `omni-distance` is the model of the detector
    /// `omni-appearance`, and `cascade` that of `face-rgbd`; `laser-legs` is trained on bags of
    /// laser scans.
    pub plugin: String,
    /// Output file of the model; its card is written beside it [default:
    /// configs/models/PLUGIN.toml].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Folder for the leave-one-room-out models, PLUGIN.without-ROOM.toml; without it, they are
    /// written beside the model.
    #[arg(long, value_name = "DIR")]
    pub left_out: Option<PathBuf>,
    /// A folder of real data (logs, people, negatives); without it, only simulated rooms are used.
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Settings of the plugin, a TOML file.
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    /// A quick training, to see that it works; the model is poor.
    #[arg(long)]
    pub quick: bool,
    /// Number of scenes that are simulated for the first round of a verifier [default: 256], or for
    /// `laser-legs` in addition to its bags [default: none]; more scenes take longer, and help a
    /// large model.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(4..=900))]
    pub scenes: Option<u64>,
    /// Further rounds of a verifier, each of which adds the model's mistakes to the training data
    /// [default: 2].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(0..=8))]
    pub rounds: Option<u64>,
    /// A config whose detector, with its own thresholds, proposes the candidates of a verifier,
    /// instead of those of `depth-ekf` and `stereo-verified` with low thresholds.
    #[arg(long, value_name = "CONFIG")]
    pub proposes: Option<PathBuf>,
    /// A scene that is simulated for a verifier instead of random rooms, with its own rate and
    /// duration, and each time with another seed of the training split; may be given several times.
    #[arg(long, value_name = "SCENE", requires = "proposes")]
    pub world: Vec<PathBuf>,
    /// An annotated log to leave out of the training data of a verifier, so that the model can be
    /// tested in its room; may be given several times.
    #[arg(long, value_name = "LOG", value_parser = clap::builder::PossibleValuesParser::new(TRAIN_LOGS))]
    pub without: Vec<String>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}
