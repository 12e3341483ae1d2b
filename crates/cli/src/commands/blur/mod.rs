//! `tagalong blur`: a copy of a log in which heads cannot be recognised.

mod heads;
mod mosaic;
mod topics;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use tagalong_app::input_args::InputArgs;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, refused};
use tagalong_app::progress::Progress;
use tagalong_app::scoring::{Shot, Shots, Tracks};
use tagalong_app::signals::Signals;
use tagalong_app::suggest::check_log_path;
use tagalong_config::Registry;
use tagalong_log::images::{Pixels, decode_compressed, decode_raw};
use tagalong_log::msgs::{CompressedImage, Image, decode};
use tagalong_log::write::{MessageLog, WriteError};
use tagalong_log::{FrameSource, Inputs, Limits, LogFacts, LogFiles, LogWalker, Message};
use tagalong_math::counted;
use tagalong_render::jpeg;

use super::copies::copy_of;
use crate::run::{RunArgs, run_until};
use heads::Heads;
use mosaic::pixelate;
use topics::{Treatment, treatment};

/// Quality of the JPEG images of a copy.
const JPEG_QUALITY: u8 = 90;

/// Arguments of `tagalong blur`.
#[derive(Args, Debug)]
pub struct BlurArgs {
    /// The log.
    log: PathBuf,
    /// The copy [default: LOG-blurred.mcap in the current folder].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Folder of a run over this log, whose people are blurred [default: a new run, with the pipeline
    /// for the sensors in the log].
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Replace an earlier copy.
    #[arg(long)]
    overwrite: bool,
    /// Way in which the log is read.
    #[command(flatten)]
    input: InputArgs,
}

/// Runs `tagalong blur`.
///
/// # Errors
/// A log that cannot be read, a run of another log, a file that cannot be written.
pub fn blur(args: &BlurArgs, registry: &Registry) -> Outcome {
    check_log_path(&args.log)?;
    let copy = copy_of(&args.log, args.output.as_deref(), "blurred", args.overwrite)?;
    let signals = Signals::listen()?;
    let tracks = match &args.run {
        Some(run) => Tracks::read(run, None)?,
        None => match tracks_of_new_run(args, &copy, registry, &signals)? {
            Ok(tracks) => tracks,
            Err(ended) => return Ok(ended),
        },
    };
    check_run(args, &tracks)?;
    let outer = args.input.applied(Default::default());
    let mut source = FrameSource::open(&args.log, &outer.input, &outer.limits, Inputs::ANY)?;
    let facts = source.facts().clone();
    let mut shots = Shots::default();
    let progress = Progress::titled("frames");
    while let Some(item) = source.next_frame() {
        shots.push(Shot::of(&item));
        progress.advance(0.5 * source.progress(), item.frame.index);
    }
    let heads = Heads::new(&shots, tracks.reports);
    let mut copying =
        Copying { facts: &facts, heads, limits: &outer.limits, counts: Counts::default() };
    let stopped = copying.copy(&args.log, &copy, &signals, &progress)?;
    print(&copying.counts.summary(&copy))?;
    Ok(stopped.map_or(Ended::with_loss(copying.counts.undecodable > 0), Ended::BySignal))
}

/// Returns the tracks of a run by the automatic pipeline, in a folder that is removed; how the run
/// ended where a signal stopped it.
fn tracks_of_new_run(
    args: &BlurArgs,
    copy: &Path,
    registry: &Registry,
    signals: &Signals,
) -> Result<Result<Tracks, Ended>, Failure> {
    let folder = copy.with_extension("blur-run");
    let run = RunArgs {
        log: Some(args.log.clone()),
        input: args.input.clone(),
        ..RunArgs::quiet(None, folder.clone())
    };

    let ended = run_until(&run, registry, || Ok(signals.clone()));
    let tracks = match ended {
        Ok(ended @ Ended::BySignal(_)) => Ok(Err(ended)),
        Ok(_) => Tracks::read(&folder, None).map(Ok),
        Err(failure) => Err(failure),
    };
    // A folder that cannot be removed stays, which does no harm.
    let _ = fs::remove_dir_all(&folder);
    tracks
}

/// Refuses the run of another log: its people are elsewhere.
fn check_run(args: &BlurArgs, tracks: &Tracks) -> Result<(), Failure> {
    let name = args.log.file_name().map(OsString::from).unwrap_or_default();
    match (&args.run, &tracks.log_name) {
        (Some(run), Some(of)) if name != OsString::from(of) => Err(Failure::usage(format!(
            "{} is a run over {of}, so its people are not those of {}",
            run.display(),
            args.log.display()
        ))),
        _ => Ok(()),
    }
}

/// Pass over a log that writes its copy.
struct Copying<'a> {
    facts: &'a LogFacts,
    heads: Heads,
    limits: &'a Limits,
    counts: Counts,
}

/// Numbers of messages by their treatment.
#[derive(Default)]
struct Counts {
    /// Images with at least one head.
    blurred: u64,
    /// Areas in them: a head has several, of the frames before and after.
    areas: u64,
    /// Images of these topics.
    images: u64,
    /// Images that could not be decoded, which the copy lacks.
    undecodable: u64,
    /// Messages that the copy lacks, by topic, with the reason.
    left_out: BTreeMap<String, (u64, &'static str)>,
}

impl Copying<'_> {
    /// Writes the copy; returns the signal that ended it early.
    fn copy(
        &mut self,
        log: &Path,
        copy: &Path,
        signals: &Signals,
        progress: &Progress,
    ) -> Result<Option<u8>, Failure> {
        let mut out = MessageLog::create(copy).map_err(refused)?;
        let files = LogFiles::of(log)?;
        let share = 0.5 / files.parts().len().max(1) as f64;
        for (number, part) in files.parts().iter().enumerate() {
            let bytes = fs::metadata(part).map_or(1, |metadata| metadata.len().max(1));
            let mut walker = LogWalker::open(part, self.limits)?;
            while let Some(message) = walker.next() {
                self.take(&message, &mut out).map_err(refused)?;
                if let Some(signal) = signals.received() {
                    out.finish().map_err(refused)?;
                    return Ok(Some(signal));
                }
                let done = (walker.position() as f64 / bytes as f64).min(1.0);
                progress.advance(0.5 + share * (number as f64 + done), self.counts.images);
            }
        }
        out.finish().map_err(refused)?;
        Ok(None)
    }

    /// Copies a message, blurs it, or leaves it out.
    fn take(&mut self, message: &Message<'_>, out: &mut MessageLog) -> Result<(), WriteError> {
        match treatment(self.facts, message) {
            Treatment::Copy => out.copy(message),
            Treatment::LeaveOut(reason) => {
                self.leave_out(message, reason);
                Ok(())
            }
            Treatment::Blur { aside } => {
                self.counts.images += 1;
                let is_compressed = message.channel.schema_name.ends_with("CompressedImage");
                let is_written = if is_compressed {
                    self.blur_compressed(message, aside, out)?
                } else {
                    self.blur_raw(message, aside, out)?
                };
                if !is_written {
                    self.counts.undecodable += 1;
                    self.leave_out(message, "they cannot be decoded, or have another size");
                }
                Ok(())
            }
        }
    }

    fn leave_out(&mut self, message: &Message<'_>, reason: &'static str) {
        let topic = message.channel.topic.clone();
        self.counts.left_out.entry(topic).or_insert((0, reason)).0 += 1;
    }

    /// Writes a raw image with its heads blurred; returns false for one that cannot be decoded.
    fn blur_raw(
        &mut self,
        message: &Message<'_>,
        aside: f64,
        out: &mut MessageLog,
    ) -> Result<bool, WriteError> {
        let Ok(image) = decode::<Image<'_>>(message.data) else { return Ok(false) };
        let Ok(pixels) = decode_raw(&image, None, self.limits) else { return Ok(false) };
        let Some(pixels) = self.blurred(pixels, image.header.stamp().nanos(), aside) else {
            return Ok(false);
        };
        let (encoding, data) = match &pixels {
            Pixels::Colour(colour) => ("rgb8", colour.pixels().as_flattened()),
            Pixels::Grey(grey) => ("mono8", grey.pixels()),
            Pixels::Depth(_) => return Ok(false),
        };
        let image = Image::packed(image.header, encoding, image.width, image.height, data);
        out.send_like(message, &image)?;
        Ok(true)
    }

    /// Writes a compressed image with its heads blurred, as JPEG.
    fn blur_compressed(
        &mut self,
        message: &Message<'_>,
        aside: f64,
        out: &mut MessageLog,
    ) -> Result<bool, WriteError> {
        let Ok(image) = decode::<CompressedImage<'_>>(message.data) else { return Ok(false) };
        let Ok(pixels) = decode_compressed(&image, None, self.limits) else { return Ok(false) };
        let colour = match self.blurred(pixels, image.header.stamp().nanos(), aside) {
            Some(Pixels::Colour(colour)) => colour,
            Some(Pixels::Grey(grey)) => grey.map(|value| [value; 3]),
            _ => return Ok(false),
        };
        let data = jpeg(&colour, colour.width(), JPEG_QUALITY);
        let image = CompressedImage { format: "jpeg".into(), data: &data, ..image };
        out.send_like(message, &image)?;
        Ok(true)
    }

    /// Returns an image with its heads blurred; `None` if it is not one of the frames' size.
    fn blurred(&mut self, mut pixels: Pixels, stamp_ns: u64, aside: f64) -> Option<Pixels> {
        if pixels.size() != (self.facts.width, self.facts.height) {
            return None;
        }
        let heads = self.heads.at(stamp_ns, aside);
        self.counts.areas += heads.len() as u64;
        self.counts.blurred += u64::from(!heads.is_empty());
        for head in &heads {
            match &mut pixels {
                Pixels::Colour(colour) => pixelate(colour, head),
                Pixels::Grey(grey) => pixelate(grey, head),
                Pixels::Depth(_) => return None,
            }
        }
        Some(pixels)
    }
}

impl Counts {
    /// Returns the numbers, and the warning that a user needs before sharing the copy.
    fn summary(&self, copy: &Path) -> String {
        let Self { images, blurred, areas, .. } = self;
        let areas = counted(*areas, "area");
        let images = counted(*images, "image");
        let mut text = format!(
            "{}: heads blurred in {blurred} of {images}, as {areas} around each head and its places \
             shortly before and after\n",
            copy.display()
        );
        for (topic, (count, reason)) in &self.left_out {
            let _ = writeln!(text, "left out: {} of {topic}: {reason}", counted(*count, "message"));
        }
        text.push_str(
            "people that the run did not find are not blurred: look through the copy before you \
             share it\n",
        );
        text
    }
}
