//! People annotated in laser scans, in bags of leg_tracker_benchmarks (A. Leigh, J. Pineau, N. Olmedo,
//! H. Zhang, *Person Tracking and Following with 2D Laser Scanners*, ICRA 2015).
//!
//! The scans are read from the bag as they are. The people are messages `leg_tracker/Person` (a
//! pose in the frame of the laser and an ID, without header) on `/ground_truth_people_tracks`.
//! Their recording times are half way between the annotated scan and the next
//! (`annotate_rosbags.py` there), so that a person belongs to the last scan before the message.
//! Gaps between two annotations of a person are not filled.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, spare, write_file};
use tagalong_config::PathText;
use tagalong_core::Stamp;
use tagalong_log::msgs::{LaserScan, Pose, decode};
use tagalong_log::{Limits, LogWalker, Message};

use super::args::ImportArgs;

/// Topic of the annotations.
const PEOPLE: &str = "ground_truth_people_tracks";
/// Points within this distance of a person are counted, m.
const NEAR_M: f64 = 0.4;

/// `leg_tracker/Person`.
#[derive(Debug, Deserialize)]
struct Person {
    pose: Pose,
    id: u32,
}

/// Annotated person: recording time, ID, and position in the frame of the laser.
struct Annotated {
    log_time: u64,
    id: u32,
    at_m: [f64; 2],
}

/// Scan: recording time, stamp, and points in the frame of the laser.
struct Scan {
    log_time: u64,
    stamp_ns: u64,
    points_m: Vec<[f64; 2]>,
}

/// Contents of a bag.
#[derive(Default)]
struct Bag {
    /// Scans by topic.
    scans: BTreeMap<String, Vec<Scan>>,
    people: Vec<Annotated>,
    unreadable: u64,
}

/// Writes the annotations of a bag as `people-floor.csv`.
///
/// # Errors
/// Exit code 1 for a bag that cannot be read or has no annotations; 2 for an output that exists.
pub fn import(args: &ImportArgs) -> Outcome {
    let ending = "people-floor.csv";
    let output = args.output.clone().unwrap_or_else(|| args.path.with_extension(ending));
    spare(&output, args.overwrite)?;
    let bag = read(&args.path)?;
    let (text, count) = table(&bag, args)?;
    write_file(&output, text)?;
    let shown = output.display();
    print(&match args.format {
        Format::Json => {
            format!("{:#}\n", serde_json::json!({ "truth": PathText(&output), "people": count }))
        }
        Format::Text => format!("{count} annotated people are in {shown}\n"),
    })?;
    Ok(Ended::Well)
}

fn read(path: &Path) -> Result<Bag, Failure> {
    let limits = Limits::default();
    let mut walker = LogWalker::open(path, &limits).map_err(Failure::failed)?;
    let mut bag = Bag::default();
    while let Some(message) = walker.next() {
        bag.take(&message);
    }
    for scans in bag.scans.values_mut() {
        scans.sort_by_key(|scan| scan.log_time);
    }
    let shown = path.display();
    // People belong to scans by their order, so that a lost scan would move them.
    if walker.data_lost() || bag.unreadable > 0 {
        let why = format!(
            "{shown}: damaged, or with {} unreadable messages; without all of them it is not known \
             which people belong to which scan: fetch it anew",
            bag.unreadable
        );
        return Err(Failure::failed(why));
    }
    if bag.people.is_empty() {
        let why = format!(
            "{shown}: there are no annotations on /{PEOPLE}; give a bag of \
             benchmark_rosbags/annotated of leg_tracker_benchmarks"
        );
        return Err(Failure::failed(why));
    }
    Ok(bag)
}

impl Bag {
    fn take(&mut self, message: &Message<'_>) {
        let channel = message.channel;
        let log_time = message.log_time;
        if channel.schema_name.ends_with("/LaserScan") {
            match decode::<LaserScan>(message.data) {
                Ok(scan) => {
                    let scans = self.scans.entry(channel.topic.clone()).or_default();
                    scans.push(Scan::of(log_time, &scan));
                }
                Err(_) => self.unreadable += 1,
            }
        } else if channel.topic.trim_start_matches('/') == PEOPLE {
            match decode::<Person>(message.data) {
                Ok(Person { pose, id }) => {
                    let at_m = [pose.position.x, pose.position.y];
                    self.people.push(Annotated { log_time, id, at_m });
                }
                Err(_) => self.unreadable += 1,
            }
        }
    }

    /// Returns the scans of the given topic, or of the only one.
    fn annotated_scans(&self, args: &ImportArgs) -> Result<&[Scan], Failure> {
        let topics = self.scans.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
        let shown = args.path.display();
        let found = match &args.scan {
            Some(topic) => self.scans.get(topic),
            None if self.scans.len() > 1 => {
                let why = format!("{shown}: scans on {topics}; name one with --scan TOPIC");
                return Err(Failure::failed(why));
            }
            None => self.scans.values().next(),
        };
        found
            .map(Vec::as_slice)
            .ok_or_else(|| Failure::failed(format!("{shown}: no such scans; there are: {topics}")))
    }
}

impl Scan {
    fn of(log_time: u64, scan: &LaserScan) -> Self {
        let [first, step] = [scan.angle_min, scan.angle_increment].map(f64::from);
        let range = f64::from(scan.range_min)..=f64::from(scan.range_max);
        let beams = scan.ranges.iter().enumerate();
        let seen = beams.filter(|(_, range_m)| range.contains(&f64::from(**range_m)));
        let points_m = seen.map(|(beam, range_m)| {
            let angle = first + step * beam as f64;
            let range_m = f64::from(*range_m);
            [range_m * angle.cos(), range_m * angle.sin()]
        });
        let stamp_ns = Stamp::from(scan.header.stamp).nanos();
        Self { log_time, stamp_ns, points_m: points_m.collect() }
    }

    fn points_near(&self, [x, y]: [f64; 2]) -> usize {
        self.points_m.iter().filter(|point| (point[0] - x).hypot(point[1] - y) <= NEAR_M).count()
    }
}

/// Returns the rows of `people-floor.csv`, and their number.
fn table(bag: &Bag, args: &ImportArgs) -> Result<(String, usize), Failure> {
    let scans = bag.annotated_scans(args)?;
    let mut rows = BTreeMap::new();
    for Annotated { log_time, id, at_m } in &bag.people {
        // The scan that the annotator saw is the last one before.
        let after = scans.partition_point(|scan| scan.log_time <= *log_time);
        let Some(number) = after.checked_sub(1) else {
            let why = "an annotation before the first scan; is --scan the annotated topic?";
            return Err(Failure::failed(format!("{}: {why}", args.path.display())));
        };
        // If a person was annotated twice, the last annotation counts.
        rows.insert((number, *id), *at_m);
    }
    let mut out = "stamp_s,scan,id,x_laser_m,y_laser_m,points,ignore,source\n".to_owned();
    for ((number, id), at_m) in &rows {
        let (scan, [x, y]) = (&scans[*number], at_m);
        let seconds = scan.stamp_ns / 1_000_000_000;
        let nanos = scan.stamp_ns % 1_000_000_000;
        let points = scan.points_near(*at_m);
        let _ =
            writeln!(out, "{seconds}.{nanos:09},{number},{id},{x:.4},{y:.4},{points},0,annotated");
    }
    Ok((out, rows.len()))
}
