//! Training on laser scans with annotated legs, and on simulated ones.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Point3};
use serde::Serialize;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say, write_file};
use tagalong_config::{Example, Trainer};
use tagalong_core::Detection;
use tagalong_log::{LegScan, Limits, read_leg_scans};

use super::leg_scenes::{self, frame};
use super::photos::fingerprint;
use crate::session::Session;

/// Folder of the bags in the data.
const FOLDER: &str = "laser/train";

/// Interval of the scans that are used from a bag without people: consecutive scans are similar,
/// and there are far more segments without people than legs.
const QUIET_SHARE: usize = 5;

/// Card of the model.
#[derive(Serialize)]
struct LegCard {
    plugin: String,
    quick: bool,
    seed: u64,
    trained_on: Vec<String>,
    scans: usize,
    /// Number of simulated scans among them.
    simulated_scans: usize,
    fit: toml::Table,
}

/// Passes the scans of all bags to the trainer, fits, writes model and card.
///
/// # Errors
/// No folder of bags, a damaged bag, files that cannot be written.
pub(super) fn train(session: &Session<'_>, trainer: &mut dyn Trainer) -> Outcome {
    let bags = bags(session)?;
    session.tell(0, "reading bags");
    session.bar.set_length(bags.len() as u64);
    let mut scans = 0;
    for bag in &bags {
        scans += add_bag(bag, session.args.quick, trainer)?;
        session.bar.inc(1);
    }
    let simulated = add_scenes(session, trainer)?;
    scans += simulated;
    session.tell(0, "fitting");
    session.bar.set_length(1000);
    let fitted = trainer.fit(&mut |part| session.bar.set_position((1000.0 * part) as u64));
    let fitted = fitted.map_err(Failure::failed)?;
    session.bar.finish_and_clear();
    write_file(&session.model, &fitted.model)?;
    let trained_on = bags.iter().map(|bag| {
        let name = bag.file_name().map(|name| name.to_string_lossy().into_owned());
        format!("{FOLDER}/{}", name.unwrap_or_default())
    });
    let card = LegCard {
        plugin: session.args.plugin.clone(),
        quick: session.args.quick,
        seed: session.args.seed,
        trained_on: trained_on.collect(),
        scans,
        simulated_scans: simulated,
        fit: fitted.figures,
    };
    let text = toml::to_string(&card).map_err(Failure::failed)?;
    let text = format!(
        "# Made by `tagalong train {}`. Cross-validation is over bags: no bag is split between\n\
         # fitted and held-out scans. Shares are of segments, at even odds.\n{text}",
        session.args.plugin
    );
    let path = session.model.with_extension("card.toml");
    write_file(&path, &text)?;
    print(&text)?;
    say(&format!("{} and {}", session.model.display(), path.display()));
    Ok(Ended::Well)
}

/// Passes the scans of simulated scenes to the trainer, if any are asked for; returns their number.
fn add_scenes(session: &Session<'_>, trainer: &mut dyn Trainer) -> Result<usize, Failure> {
    let Some(count) = session.args.scenes else { return Ok(0) };
    session.tell(0, "simulating");
    session.bar.set_length(count);
    let first = session.args.seed.wrapping_mul(1000) % 1_000_000;
    let mut scans = 0;
    for number in first..first + count {
        scans += leg_scenes::add(number, trainer)?;
        session.bar.inc(1);
    }
    Ok(scans)
}

/// Returns the bags in the order of their names.
fn bags(session: &Session<'_>) -> Result<Vec<PathBuf>, Failure> {
    let data = session.args.data.as_ref().ok_or_else(|| no_bags(session, ""))?;
    let folder = data.join(FOLDER);
    let entries = std::fs::read_dir(&folder)
        .map_err(|error| no_bags(session, &format!("; {}: {error}", folder.display())))?;
    let paths = entries.flatten().map(|entry| entry.path());
    let mut bags: Vec<PathBuf> =
        paths.filter(|path| path.extension().is_some_and(|e| e == "bag")).collect();
    bags.sort();
    if bags.is_empty() {
        return Err(no_bags(session, &format!("; {} has none", folder.display())));
    }
    Ok(bags)
}

/// Returns the failure if there is no bag, with the reason.
fn no_bags(session: &Session<'_>, why: &str) -> Failure {
    let text = format!("is trained on bags of laser scans: name a folder with {FOLDER}");
    Failure::usage(format!("`{}` {text} with --data{why}", session.args.plugin))
}

/// Passes the scans of a bag to the trainer; returns their number.
fn add_bag(bag: &Path, quick: bool, trainer: &mut dyn Trainer) -> Result<usize, Failure> {
    let mut scans = read_leg_scans(bag, &Limits::default()).map_err(Failure::failed)?;
    let has_people = scans.iter().any(|scan| !scan.legs.is_empty());
    let share = if has_people { 1 } else { QUIET_SHARE } * if quick { 5 } else { 1 };
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    scans.retain(|scan| {
        let count = counts.entry(scan.topic.clone()).or_default();
        *count += 1;
        count.is_multiple_of(share)
    });
    let name = bag.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    for scan in &scans {
        // Scanners with different fields of view see different objects, so each topic is a group.
        let group = fingerprint(&format!("{name} {}", scan.topic));
        add_scan(scan, group, trainer)?;
    }
    Ok(scans.len())
}

/// Passes the legs of a scan to the trainer, and then the complete scan.
fn add_scan(scan: &LegScan, group: u64, trainer: &mut dyn Trainer) -> Result<(), Failure> {
    let frame = frame(scan.scan.clone());
    let legs = scan.legs.iter().map(|leg| (leg.x, leg.y, true));
    for (x, y, is_person) in legs.chain([(0.0, 0.0, false)]) {
        let candidate = Detection::new("annotation", Point3::new(x, y, 0.0), Matrix3::zeros(), 0.0);
        let added = trainer.add(&frame, &candidate, Example { is_person, group });
        added.map_err(Failure::failed)?;
    }
    Ok(())
}
