use std::path::PathBuf;

use clap::{Args, ValueEnum};
use tagalong_app::format::Format;

/// Layout of the imported data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// A folder of the TUM RGB-D benchmark or of the Bonn RGB-D dynamic dataset: rgb.txt, depth.txt,
    /// groundtruth.txt.
    Tum,
    /// The `training` or `testing` folder of KITTI tracking; one --sequence.
    Kitti,
    /// A sequence of the MOTChallenge: seqinfo.ini and its images.
    Mot,
    /// A folder of JPEG or PNG images, in the order of their names.
    Images,
    /// The XML file of annotations made with CVAT (for video 1.1 or for images 1.1): writes truth
    /// for a log instead of a log.
    Cvat,
    /// An annotated bag of leg_tracker_benchmarks: writes truth for the bag instead of a log.
    LegTracker,
    /// A YAML file of the benchmark Follow-Bench: writes a scene to simulate instead of a log.
    FollowBench,
}

/// Arguments of `tagalong import`.
#[derive(Args, Debug)]
pub struct ImportArgs {
    /// Layout of the data.
    #[arg(value_enum)]
    pub kind: Kind,
    /// File or folder to import.
    pub path: PathBuf,
    /// The log to write [default: runs/NAME.mcap]; for cvat and leg-tracker the truth [default:
    /// NAME.people.csv, NAME.people-floor.csv]; for follow-bench the scene [default: NAME.toml].
    #[arg(short, long, value_name = "LOG")]
    pub output: Option<PathBuf>,
    /// Replace the log if it exists.
    #[arg(long)]
    pub overwrite: bool,
    /// kitti: number of the sequence.
    #[arg(long, value_name = "NUMBER", default_value = "0000")]
    pub sequence: String,
    /// images: images per second.
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = rate)]
    pub fps: f64,
    /// Focal length, pixels; positions in metres need this or --view.
    #[arg(long, value_name = "PX", value_parser = focal_length)]
    pub focal: Option<f64>,
    /// Horizontal field of view, degrees; an alternative to --focal.
    #[arg(long, value_name = "DEG", conflicts_with = "focal", value_parser = angle)]
    pub view: Option<f64>,
    /// Height of the camera above the floor, m.
    #[arg(long, value_name = "M", value_parser = height)]
    pub height: Option<f64>,
    /// Downward tilt of the camera, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 0.0,
        requires = "height",
        allow_negative_numbers = true
    )]
    pub tilt: f64,
    /// images: folder of 16-bit PNG depth images, one for each image.
    #[arg(long, value_name = "DIR")]
    pub depth: Option<PathBuf>,
    /// images: metres per unit of depth.
    #[arg(long, value_name = "M", default_value_t = 0.001, requires = "depth", value_parser = positive)]
    pub depth_unit: f64,
    /// images: boxes of whole people in the images, as COCO JSON (image_id, bbox, track_id) or as
    /// CSV with a header (image, x, y, w, h or image, xmin, ymin, xmax, ymax, and track_id): writes
    /// NAME.boxes.csv beside the log.
    #[arg(long, value_name = "FILE")]
    pub boxes: Option<PathBuf>,
    /// cvat: the boxes are those of whole bodies, and upper bodies are derived from them for the
    /// comparison: writes NAME.boxes.csv.
    #[arg(long)]
    pub whole_bodies: bool,
    /// leg-tracker: topic of the annotated scans, if the bag has several.
    #[arg(long, value_name = "TOPIC")]
    pub scan: Option<String>,
    /// Output format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("must be positive".into()) }
}

/// Largest rate of images, Hz.
pub(crate) const MAX_HZ: f64 = 1e4;

/// Parses a number up to a plausible maximum.
fn up_to(text: &str, most: f64) -> Result<f64, String> {
    positive(text).and_then(|v| if v <= most { Ok(v) } else { Err(format!("at most {most}")) })
}

fn rate(text: &str) -> Result<f64, String> {
    up_to(text, MAX_HZ)
}

fn focal_length(text: &str) -> Result<f64, String> {
    up_to(text, 1e6)
}

fn height(text: &str) -> Result<f64, String> {
    up_to(text, 100.0)
}

fn angle(text: &str) -> Result<f64, String> {
    // The focal length goes to zero as the view approaches 180 degrees.
    positive(text).and_then(|v| if v < 175.0 { Ok(v) } else { Err("must be below 175".into()) })
}
