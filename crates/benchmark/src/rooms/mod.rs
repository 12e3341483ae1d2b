//! `tagalong bench --leave-one-room-out`: the settings that a config names in `[tune]` are chosen
//! on all rooms but one, and scored in that one.

mod args;
mod contest;
mod pairs;
mod report;
mod work;

use std::path::Path;

use crate::tuning::Rooms;
pub use args::{HELP, RoomsArgs};
use contest::{Contestant, Location};
use report::Report;
use tagalong_app::format::TableFormat;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say};
use tagalong_app::scoring::read_text;
use tagalong_config::{ConfigError, Registry};
use tagalong_math::counted;
use work::Desk;

use super::plan::{self, facts};
use super::store::Store;

/// Runs the whole procedure and prints the tables.
///
/// # Errors
/// Files that cannot be read; a pipeline that fails on some log.
pub fn rooms(args: &RoomsArgs, registry: &Registry) -> Outcome {
    let locations = locations(args)?;
    let contestants = contestants(args, &locations, registry)?;
    let store = Store::new(&args.folder.output);
    let desk = Desk::new(&store, registry, &contestants, &locations)?;
    let done = desk.work(usize::from(args.jobs))?;
    if let Some(signal) = done.signal {
        say(&super::stopped(done.done, &counted(done.asked, "run"), &store));
        return Ok(Ended::BySignal(signal));
    }
    let ran = counted(done.ran, "run");
    say(&format!("{ran} done{}", super::earlier(done.asked - done.ran)));
    let report = Report::new(args, &locations, &contestants, &desk)?;
    let json = report.json()?;
    store.put("rooms.json", json.as_bytes())?;
    print(&match args.format {
        TableFormat::Text => report.text(),
        TableFormat::Markdown => report.markdown(),
        TableFormat::Json => json,
    })?;
    Ok(Ended::with_loss(done.lost))
}

/// Returns the rooms and their logs, all of which have truth.
fn locations(args: &RoomsArgs) -> Result<Vec<Location>, Failure> {
    let path = &args.rooms;
    let shown = path.display().to_string();
    let text = read_text(path).map_err(|failure| Failure::usage(failure.message))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let rooms = Rooms::parse(&text, folder, args.logs_dir.as_deref())
        .map_err(|error| Failure::usage(error.render(&shown, &text)))?;
    let mut locations = Vec::new();
    for room in rooms.rooms {
        let logs =
            facts::of_room(&room).map_err(|error| Failure::usage(error.render(&shown, &text)))?;
        let models = room.models.into_iter().map(|(plugin, model)| {
            let path = std::path::absolute(&model.path).map_err(Failure::failed)?;
            if path.is_file() {
                return Ok((plugin, path));
            }
            let message = format!("there is no model {}", model.path.display());
            let error = ConfigError::new(message).or_at(Some(model.place));
            Err(Failure::usage(error.render(&shown, &text)))
        });
        let models = models.collect::<Result<_, Failure>>()?;
        locations.push(Location {
            name: room.name,
            about: room.about,
            logs,
            models,
            single_frames: room.single_frames,
        });
    }
    Ok(locations)
}

/// Returns the pipelines with all settings that are tried.
fn contestants(
    args: &RoomsArgs,
    locations: &[Location],
    registry: &Registry,
) -> Result<Vec<Contestant>, Failure> {
    let named = &args.configs;
    let mut configs = if named.is_empty() {
        plan::shipped(registry)?
    } else {
        named.iter().map(|path| plan::candidate(path, registry)).collect::<Result<_, _>>()?
    };
    // A named config takes part even without `[tune]`, for comparison.
    if named.is_empty() {
        configs.retain(|config| !config.tune.is_empty());
    }
    plan::unique("configs", configs.iter().map(|config| config.file.stem()))?;
    if configs.is_empty() {
        let why = "no config in the folder configs has a table [tune]; name some with --configs";
        return Err(Failure::usage(why));
    }
    configs.into_iter().map(|config| Contestant::new(config, args, locations, registry)).collect()
}
