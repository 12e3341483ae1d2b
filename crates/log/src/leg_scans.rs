//! Laser scans with annotated legs, for training: ROS 1 bags of the kind that leg_tracker records.

use std::path::Path;

use nalgebra::{Isometry2, Isometry3, Point2};
use tagalong_core::LaserScan as CoreScan;

use crate::msgs::{LaserScan, PoseArray, decode};
use crate::packed::LogFile;
use crate::sensors::laser::{scan_fault, seen_from};
use crate::walker::LogWalker;
use crate::{Limits, LogError};

/// Topic suffix of annotated legs.
const LEGS: &str = "leg_cluster_positions";

/// Scan with its annotated legs.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LegScan {
    /// Topic of the scan.
    pub topic: String,
    /// The scan, in the frame of the scanner.
    pub scan: CoreScan,
    /// Centres of the legs in the frame of the scanner, m; empty if there are none.
    pub legs: Vec<Point2<f64>>,
}

/// Reads the scans of a log with their legs. Scans and annotations are paired by their order,
/// because the stamps are those of the extraction. A log without a topic of annotations contains no
/// people.
///
/// # Errors
/// A log that cannot be opened, that is damaged, or whose numbers of annotations and scans differ.
pub fn read_leg_scans(path: &Path, limits: &Limits) -> Result<Vec<LegScan>, LogError> {
    let file = LogFile::open(path, limits)?;
    let contents = file.path().to_owned();
    let is_unpacked = file.fault().is_none();
    let mut walker = LogWalker::at(&contents, file, limits)
        .map_err(|source| LogError::NotMcap { path: path.to_owned(), source })?;
    let mut scans = Vec::new();
    let mut legs = Vec::new();
    let mut unreadable = 0;
    while let Some(message) = walker.next() {
        let channel = message.channel;
        let is_scan = channel.schema_name.ends_with("/LaserScan");
        if is_scan {
            match decode::<LaserScan>(message.data).ok().filter(|scan| scan_fault(scan).is_none()) {
                Some(scan) => scans.push((channel.topic.clone(), core_scan(&scan))),
                None => unreadable += 1,
            }
        } else if channel.topic.ends_with(LEGS) {
            match decode::<PoseArray>(message.data) {
                Ok(poses) => legs.push(places(&poses)),
                Err(_) => unreadable += 1,
            }
        }
    }
    let annotated = walker.channels().any(|channel| channel.topic.ends_with(LEGS));
    let is_whole = is_unpacked && !walker.data_lost() && unreadable == 0;
    if !is_whole || (annotated && legs.len() != scans.len()) {
        let why = format!(
            "{} scans, {} annotations, {unreadable} unreadable messages{}; without all of them \
             it is not known which legs belong to which scan",
            scans.len(),
            legs.len(),
            if walker.data_lost() { ", and the file is damaged" } else { "" },
        );
        return Err(LogError::LegScans { path: path.to_owned(), why });
    }
    legs.resize(scans.len(), Vec::new());
    let both = scans.into_iter().zip(legs);
    Ok(both.map(|((topic, scan), legs)| LegScan { topic, scan, legs }).collect())
}

fn core_scan(scan: &LaserScan) -> CoreScan {
    seen_from(scan, &Isometry3::identity(), |_| Isometry2::identity())
}

fn places(poses: &PoseArray) -> Vec<Point2<f64>> {
    let places = poses.poses.iter().map(|pose| Point2::new(pose.position.x, pose.position.y));
    places.filter(|place| place.coords.iter().all(|v| v.is_finite())).collect()
}
