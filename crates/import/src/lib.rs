//! `tagalong import`: converts data sets and folders of images to logs.
//!
//! Each layout has a module that reads it into a `Sequence`, and one writer converts this to a log.
//! No other part of Tagalong knows these layouts.
//!
//! ```
//! let export = r#"<annotations><track id="0" label="person">
//!     <box frame="0" keyframe="1" outside="0" occluded="0" xtl="10" ytl="20" xbr="60" ybr="70"/>
//! </track></annotations>"#;
//! let people = tagalong_import::people_of_cvat(export)?;
//! assert_eq!((people.len(), people[0].frame), (1, 1), "frames of truth are counted from 1");
//! assert!(tagalong_import::people_of_cvat("<html/>").is_err());
//! # Ok::<(), String>(())
//! ```

mod args;
mod boxes;
mod cvat;
mod folders;
mod follow_bench;
mod kitti;
mod leg_bags;
mod recorded;
mod sequence;
mod truth;
mod tum;
mod writer;

use std::path::{Path, PathBuf};

use tagalong_app::format::Format;
use tagalong_app::outcome::{
    CUT_SHORT, Ended, Failure, Outcome, make_room_for, print, say, spare, write_file,
};
use tagalong_app::signals::Signals;
use tagalong_config::PathText;
use tagalong_math::counted;

pub use self::args::{ImportArgs, Kind};
pub use self::boxes::{PersonBox, person_boxes};
pub use self::cvat::people_of_cvat;
pub use self::follow_bench::scene_of_follow_bench;
use self::sequence::Sequence;

/// Imports a data set.
///
/// # Errors
/// Exit code 1 for a path with unexpected content, or with a file that cannot be read; 2 for a log
/// that exists or cannot be written.
pub fn import(args: &ImportArgs) -> Outcome {
    let path = &args.path;
    if !path.exists() {
        return Err(Failure::failed(format!("{}: no such file or folder", path.display())));
    }
    if args.boxes.is_some() && args.kind != Kind::Images {
        let message =
            "--boxes is for a folder of images: `tagalong import images FOLDER --boxes FILE`";
        return Err(Failure::usage(message));
    }
    match args.kind {
        Kind::Cvat => return cvat::import(args),
        Kind::LegTracker => return leg_bags::import(args),
        Kind::FollowBench => return follow_bench::import(args),
        _ => {}
    }
    let log = args.output.clone().unwrap_or_else(|| default_log(args));
    let signals = Signals::listen()?;
    spare(&log, args.overwrite)?;
    if !path.is_dir() {
        return Err(Failure::failed(file_for_folder(path)));
    }
    let sequence = read(args)?;
    make_room_for(&log)?;
    writer::write(&sequence, &log, &signals).inspect_err(|_| {
        // An incomplete log would be taken for the complete sequence.
        let _ = std::fs::remove_file(&log);
    })?;
    beside(&sequence, &log)?;
    if let Some(signal) = signals.received() {
        say(CUT_SHORT);
        return Ok(Ended::BySignal(signal));
    }
    sequence.notes.iter().for_each(|note| say(&format!("note: {note}")));
    let images = sequence.moments.len();
    print(&match args.format {
        Format::Text => {
            let log = log.display();
            // Data sets come with truth or boxes, whose next step the notes name.
            let next = if args.kind == Kind::Images {
                format!("; next: tagalong run {log} --overlay")
            } else {
                String::new()
            };
            format!("{log}: {}{next}\n", counted(images, "image"))
        }
        Format::Json => {
            format!("{:#}\n", serde_json::json!({ "log": PathText(&log), "images": images }))
        }
    })?;
    Ok(Ended::Well)
}

/// Returns the message for a file that is given instead of a folder of images.
fn file_for_folder(path: &Path) -> String {
    let shown = path.display();
    let ending = path.extension().and_then(|it| it.to_str()).unwrap_or_default().to_lowercase();
    let remedy = match ending.as_str() {
        "json" | "csv" => format!(
            ": `tagalong import images FOLDER --boxes {shown}` takes its boxes, if it is JSON of COCO or a \
             CSV with a header"
        ),
        "xml" => format!(": `tagalong import cvat {shown}` reads annotations of CVAT"),
        _ => String::new(),
    };
    format!("{shown} is a file; give the folder that holds the sequence{remedy}")
}

fn read(args: &ImportArgs) -> Result<Sequence, Failure> {
    let sequence = match args.kind {
        Kind::Tum => tum::read(args)?,
        Kind::Kitti => kitti::read(args)?,
        Kind::Mot => folders::mot(args)?,
        Kind::Images => folders::images(args)?,
        Kind::Cvat | Kind::LegTracker | Kind::FollowBench => {
            return Err(Failure::usage("annotations are no log"));
        }
    };
    if sequence.moments.is_empty() {
        return Err(Failure::failed(format!("{} has no images", args.path.display())));
    }
    Ok(sequence)
}

/// Writes the truth beside the log, where `eval` and `bench` look for it, and the config that tracks
/// recorded detections.
fn beside(sequence: &Sequence, log: &Path) -> Result<(), Failure> {
    for (ending, text) in &sequence.beside {
        let path = log.with_extension(ending);
        write_file(&path, text)?;
        say(&format!("truth is in {}", path.display()));
    }
    if let Some(text) = &sequence.recorded {
        let config = log.with_extension("recorded.toml");
        write_file(&config, text)?;
        let config = config.display();
        let log = log.display();
        say(&format!("its detections can be tracked: tagalong run {config} {log}"));
    }
    Ok(())
}

fn default_log(args: &ImportArgs) -> PathBuf {
    let whole = args.path.canonicalize().unwrap_or_else(|_| args.path.clone());
    let name = match args.kind {
        Kind::Kitti => format!("kitti-{}", args.sequence),
        _ => whole.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    };
    Path::new("runs").join(name + ".mcap")
}
