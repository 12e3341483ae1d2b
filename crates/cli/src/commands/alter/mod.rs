//! `tagalong alter`: a copy of a log with one thing changed, to see what a pipeline makes of it.

mod mirror;
mod recording;
mod salt;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use tagalong_app::input_args::InputArgs;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, refused, write_file};
use tagalong_app::progress::Progress;
use tagalong_app::signals::Signals;
use tagalong_app::suggest::check_log_path;
use tagalong_config::{FileLimit, read_text};
use tagalong_core::{DepthImage, Images};
use tagalong_eval::formats::people::{self, Row};
use tagalong_geometry::Lens;
use tagalong_log::{FrameSource, Inputs, LogFacts, LogFrame};
use tagalong_math::counted;

use super::copies::{check_place, copy_of};
use recording::Recording;
use salt::Salt;

/// Ending of the truth beside a log.
const TRUTH: &str = "people.csv";
/// Ending of the truth of a log whose boxes are those of whole bodies, which is not altered.
const BOXES: &str = "boxes.csv";

/// Arguments of `tagalong alter`.
#[derive(Args, Debug)]
pub struct AlterArgs {
    /// The log.
    log: PathBuf,
    /// The copy [default: LOG-altered.mcap in the current folder].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Keep every n-th frame, from the first one on.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// Mirror the images, the poses and the odometry: left becomes right.
    #[arg(long)]
    mirror: bool,
    /// Multiply depth by this factor.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    scale_depth: f64,
    /// Replace this share of the pixels: colour by black or white, depth by no reading or a random one.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    salt: f64,
    /// Seed of the replaced pixels.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Replace an earlier copy and its truth.
    #[arg(long)]
    overwrite: bool,
    /// Way in which the log is read.
    #[command(flatten)]
    input: InputArgs,
}

impl AlterArgs {
    fn check(&self) -> Result<(), Failure> {
        if !(self.scale_depth > 0.0 && self.scale_depth.is_finite()) {
            return Err(Failure::usage("--scale-depth must be above zero"));
        }
        if !(0.0..=1.0).contains(&self.salt) {
            return Err(Failure::usage("--salt is a share of the pixels, from 0 to 1"));
        }
        let changes = self.every > 1 || self.mirror || self.scale_depth != 1.0 || self.salt > 0.0;
        if changes {
            Ok(())
        } else {
            Err(Failure::usage("nothing to alter: give --every, --mirror, --scale-depth or --salt"))
        }
    }
}

/// Runs `tagalong alter`.
///
/// # Errors
/// A log that cannot be read, an alteration that its images do not allow, a file that cannot be
/// written.
pub fn alter(args: &AlterArgs) -> Outcome {
    args.check()?;
    check_log_path(&args.log)?;
    let copy = copy_of(&args.log, args.output.as_deref(), "altered", args.overwrite)?;
    let truth = args.log.with_extension(TRUTH);
    let altered_truth = copy.with_extension(TRUTH);
    if truth.is_file() {
        check_place(&altered_truth, &truth, "truth", args.overwrite)?;
    }
    let signals = Signals::listen()?;
    let outer = args.input.applied(Default::default());
    let mut source = FrameSource::open(&args.log, &outer.input, &outer.limits, Inputs::ANY)?;
    check_images(args, source.facts())?;
    let mut recording = Recording::create(&copy, source.facts()).map_err(refused)?;
    let mut kept = BTreeMap::new();
    let mut width = 0;
    let progress = Progress::titled("frames");
    while let Some(item) = source.next_frame() {
        progress.advance(source.progress(), item.frame.index);
        if args.mirror && !matches!(item.frame.camera.lens, Lens::Pinhole(_)) {
            let shown = args.log.display();
            return Err(Failure::failed(format!("{shown}: only perspective cameras are mirrored")));
        }
        if (item.frame.index - 1).is_multiple_of(args.every) {
            width = item.frame.camera.width;
            kept.insert(item.frame.index, kept.len() as u32 + 1);
            recording.frame(&altered(args, item)).map_err(refused)?;
        }
        if let Some(signal) = signals.received() {
            recording.finish().map_err(refused)?;
            return Ok(Ended::BySignal(signal));
        }
    }
    let left_out = left_out(source.facts());
    recording.finish().map_err(refused)?;
    let mut told = format!("{}: {}\n", copy.display(), counted(kept.len(), "frame"));
    if truth.is_file() {
        alter_truth(args, [&truth, &altered_truth], &kept, width)?;
        let _ = writeln!(told, "its truth: {}", altered_truth.display());
    }
    let whole_bodies = args.log.with_extension(BOXES);
    if whole_bodies.is_file() {
        let _ = writeln!(told, "left out: its truth of whole bodies, {}", whole_bodies.display());
    }
    for (topic, kind) in left_out {
        let _ = writeln!(told, "left out: {topic} ({kind})");
    }
    print(&told)?;
    Ok(Ended::Well)
}

/// Refuses alterations that the images of a log do not allow.
fn check_images(args: &AlterArgs, facts: &LogFacts) -> Result<(), Failure> {
    let shown = args.log.display();
    if facts.colour_topic.is_none() && facts.depth_topic.is_none() {
        return Err(Failure::failed(format!("{shown}: it has neither colour nor depth images")));
    }
    if args.scale_depth != 1.0 && facts.depth_topic.is_none() {
        return Err(Failure::failed(format!("{shown}: it has no depth to scale")));
    }
    Ok(())
}

/// Returns the topics that a run uses and the copy has not.
fn left_out(facts: &LogFacts) -> Vec<(String, &'static str)> {
    let topics = [(&facts.right_topic, "right images"), (&facts.laser_topic, "laser scans")];
    topics.into_iter().filter_map(|(topic, kind)| Some((topic.clone()?, kind))).collect()
}

fn altered(args: &AlterArgs, mut item: LogFrame) -> recording::Moment {
    let images = item.frame.images();
    let mut images = Images { right: None, ..images };
    let mut camera = (*item.frame.camera).clone();
    if args.scale_depth != 1.0 {
        let factor = args.scale_depth as f32;
        images.depth =
            images.depth.map(|depth: Arc<DepthImage>| Arc::new(depth.map(|m| m * factor)));
    }
    if args.mirror {
        images = mirror::images(&images);
        camera = mirror::camera(&camera);
        item.odom_from_robot = mirror::pose(&item.odom_from_robot);
    }
    if args.salt > 0.0 {
        images = Salt::of_frame(args.salt, args.seed, item.frame.index).on(&images);
    }
    recording::Moment {
        stamp: item.frame.stamp,
        images,
        camera,
        odom_from_robot: item.odom_from_robot,
    }
}

/// Writes the truth of the copy from that of the log.
fn alter_truth(
    args: &AlterArgs,
    [truth, altered]: [&Path; 2],
    kept: &BTreeMap<u64, u32>,
    width: usize,
) -> Result<(), Failure> {
    let shown = truth.display().to_string();
    let text = read_text(truth, FileLimit::Table)
        .map_err(|why| Failure::failed(format!("{shown}: {why}")))?;
    let rows = people::parse(&text, &shown).map_err(Failure::failed)?;
    let rows: Vec<Row> = rows
        .into_iter()
        .filter_map(|row| {
            let frame = *kept.get(&u64::from(row.frame))?;
            let row = if args.mirror { mirror::row(&row, width) } else { row };
            Some(Row { frame, ..row })
        })
        .collect();
    let mut out = Vec::new();
    people::write(&mut out, &rows).map_err(Failure::failed)?;
    write_file(altered, out)
}
