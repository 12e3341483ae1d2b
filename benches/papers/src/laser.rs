//! People by their legs in a laser scan: two logs of the leg tracker benchmark with annotated
//! people, beside its published figures.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

use nalgebra::{Isometry2, Isometry3, Point2, Point3};
use tagalong_core::{Frame, Inputs, LaserScan, spatial_pose};
use tagalong_eval::formats::floor::{self, Row as TruthRow};
use tagalong_eval::{FloorClear, FloorPoint, FloorScan, FloorTally};
use tagalong_log::{FrameSource, InputSettings, Limits};
use tagalong_pipeline::FrameReport;
use tagalong_report::{Cell, Row, Table};

use crate::findings::{Experiment, Findings, System};
use crate::lab::{Lab, ReproduceError, read};

/// The leg tracker benchmark.
pub const SYSTEM: System = System {
    name: "laser",
    about: "legs in a laser scan: the leg tracker benchmark (Leigh et al., ICRA 2015)",
    experiments: &[
        Experiment {
            name: "moving",
            about: "Table III: a robot that drives among people",
            run: moving,
        },
        Experiment {
            name: "following",
            about: "Table III: a robot that follows one person outdoors",
            run: following,
        },
        Experiment {
            name: "at-once",
            about: "the log of the robot that drives, with and without the times of the rays",
            run: at_once,
        },
    ],
};

/// Configs, and the log by which the settings of each were chosen.
const CONFIGS: [(&str, &str); 2] =
    [("laser-legs", "laser-moving"), ("laser-follow", "laser-following")];
/// Tracks that no scan has supported for longer than this are no estimates, s: none, one scan that
/// misses them in either log, and several.
const COASTING_S: [f64; 3] = [0.0, 0.15, 0.35];
/// Largest distance of a person and its estimate, m (the benchmark's).
const CUT_M: f64 = 0.75;
/// Bearings in the frame of the laser within which people and estimates count in `laser-moving`,
/// degrees (the benchmark's).
const SECTOR_DEG: [f64; 2] = [-80.0, 12.0];
/// Number of scans of a block for intervals.
const BLOCK: usize = 45;
const COLUMNS: [&str; 9] = [
    "objects",
    "valid",
    "switches",
    "misses",
    "false positives",
    "MOTA, %",
    "recall, %",
    "MOTP, m",
    "estimates a scan",
];

/// Columns of the table with and without the times of the rays.
const SWEEP_COLUMNS: [&str; 9] = [
    "objects",
    "found",
    "false positives",
    "precision, %",
    "recall, %",
    "switches",
    "IDs",
    "MOTA, %",
    "MOTP, m",
];

/// Number of scans after which what is seen again is compared: about a second.
const LAG: usize = 8;
/// Points farther than this from all of the earlier scan are of something new, m.
const NEAR_M: f64 = 0.3;

/// Use of the times of single rays.
#[derive(Clone, Copy, PartialEq)]
enum Rays {
    /// Each point moves with the robot since the time of its own ray, as the log reader has it.
    Timed,
    /// All points count as measured at the stamp of the scan.
    AtOnce,
}

/// Log with the scan rate and the part of the scan that counts.
struct Log {
    name: &'static str,
    sector_deg: Option<[f64; 2]>,
    scan_s: f64,
    /// False if only one of the people is annotated.
    is_complete: bool,
}

const MOVING: Log = Log {
    name: "laser-moving",
    sector_deg: Some(SECTOR_DEG),
    scan_s: 1.0 / 7.5,
    is_complete: true,
};
const FOLLOWING: Log =
    Log { name: "laser-following", sector_deg: None, scan_s: 0.1, is_complete: false };

/// Figures of a tracker: objects, valid, switches, misses, false positives, MOTA, recall, MOTP.
type Figures = [Option<f64>; 8];

/// Result on a log.
struct Tracked {
    config: &'static str,
    /// True if the settings were chosen on this log, so that the figures are no result.
    is_chosen_here: bool,
    coasting_s: f64,
    clear: FloorClear,
    /// Number of the first scan with an estimate of an annotated person.
    first: Option<u32>,
    /// Number of IDs among the estimates.
    ids: usize,
}

/// Counts of a run for one time of coasting.
struct Counting {
    coasting_s: f64,
    tally: FloorTally,
    first: Option<u32>,
    ids: BTreeSet<i64>,
}

/// Distances by which the motion of the robot during a scan moves its points, m.
#[derive(Default)]
struct Moved {
    scans: u32,
    moved_scans: u32,
    points: u64,
    sum_m: f64,
    most_m: f64,
    /// Points of the last scans in the odometry frame: de-skewed, and as if measured at once.
    earlier: VecDeque<[Vec<Point2<f64>>; 2]>,
    /// Number and sum of the distances to the nearest point of an earlier scan, m, of both.
    near: [(u64, f64); 2],
}

fn moving(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    fn given(of: [f64; 8]) -> [Option<f64>; 8] {
        of.map(Some)
    }

    let tracked = MOVING.track_all(lab, Rays::Timed)?;
    if tracked.is_empty() {
        return Ok(MOVING.without_data().into());
    }
    let mut table = MOVING.table(
        "People beside a robot that drives (laser-moving, strict, 0.75 m)",
        &[
            (
                "jump distance, pairs, Kalman",
                given([88.0, 34.0, 0.0, 54.0, 223.0, -214.8, 38.6, 0.118]),
            ),
            (
                "the same with foreground test and single legs, tuned on this log",
                given([88.0, 28.0, 0.0, 60.0, 9.0, 21.6, 31.8, 0.117]),
            ),
            (
                "Joint Leg Tracker, ported, forest retrained",
                given([88.0, 5.0, 0.0, 83.0, 16.0, -12.5, 5.7, 0.273]),
            ),
        ],
        &tracked,
    );
    table.rows.extend(MOVING_PUBLISHED.map(|(name, of)| published(name, of.map(Some))));
    table.notes.push(
        "The published rows are of two bags together, 645 objects; the second one is not at hand, \
         so they are no measure for this one."
            .into(),
    );
    let seen = tracked.iter().filter(|tracked| tracked.coasting_s == 0.0);
    let tables = std::iter::once(table).chain(seen.map(|tracked| MOVING.people(tracked)));
    Ok(Findings { tables: tables.collect(), ..Findings::default() })
}

fn following(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    fn figures(of: [f64; 6]) -> [Option<f64>; 8] {
        let [objects, valid, switches, misses, recall, motp] = of.map(Some);
        [objects, valid, switches, misses, None, None, recall, motp]
    }

    let tracked = FOLLOWING.track_all(lab, Rays::Timed)?;
    if tracked.is_empty() {
        return Ok(FOLLOWING.without_data().into());
    }
    let mut table = FOLLOWING.table(
        "One person before a robot that follows it (laser-following, 0.75 m)",
        &[
            ("jump distance, pairs, Kalman", figures([1479.0, 1409.0, 1.0, 69.0, 95.3, 0.072])),
            (
                "Joint Leg Tracker, ported, forest retrained",
                figures([1479.0, 1399.0, 0.0, 80.0, 94.6, 0.083]),
            ),
        ],
        &tracked,
    );
    table.rows.extend(FOLLOWING_PUBLISHED.map(|(name, [valid, switches, misses, motp])| {
        published(name, figures([6179.0, valid, switches, misses, 100.0 * valid / 6179.0, motp]))
    }));
    table.notes.extend(tracked.iter().filter(|tracked| tracked.coasting_s == 0.0).map(|tracked| {
        let first = tracked.first.map_or("never".into(), |scan| {
            format!("{:.1} s after the first scan", f64::from(scan) * FOLLOWING.scan_s)
        });
        format!("`{}` finds the person {first}; it stands still for 8.0 s.", tracked.config)
    }));
    table.notes.extend([
        "Only one person is annotated, so estimates of others are no false positives, and their \
         number is stated beside the recall. The published rows are of the whole bag, of which \
         this log is a part."
            .into(),
    ]);
    Ok(table.into())
}

fn at_once(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let timed = MOVING.track_all(lab, Rays::Timed)?;
    if timed.is_empty() {
        return Ok(MOVING.without_data().into());
    }
    let at_once = MOVING.track_all(lab, Rays::AtOnce)?;
    let mut notes = MOVING.moved(lab)?.sentences();
    notes.push(
        "The people were annotated in scans that are not de-skewed. IDs: those of all estimates that \
         count."
            .into(),
    );
    let mut rows = Vec::new();
    for (timed, at_once) in timed.iter().zip(&at_once) {
        rows.push(timed.sweep_row("de-skewed"));
        rows.push(at_once.sweep_row("as if measured at once"));
    }
    Ok(Table {
        title:
            "Scans de-skewed by the odometry, or taken as measured at once (laser-moving, strict, \
                0.75 m)"
                .into(),
        columns: SWEEP_COLUMNS.map(String::from).to_vec(),
        rows,
        notes,
    }
    .into())
}

/// Published figures (ICRA 2015, Table III) of both moving bags together.
const MOVING_PUBLISHED: [(&str, [f64; 8]); 3] = [
    ("ROS leg_detector", [645.0, 149.0, 15.0, 481.0, 294.0, -22.5, 23.1, 0.27]),
    ("Individual Leg", [645.0, 160.0, 2.0, 483.0, 88.0, 11.2, 24.8, 0.17]),
    ("Joint Leg", [645.0, 163.0, 2.0, 480.0, 97.0, 10.2, 25.3, 0.15]),
];

/// Published valid matches, switches, misses and MOTP of the following bag.
const FOLLOWING_PUBLISHED: [(&str, [f64; 4]); 3] = [
    ("ROS leg_detector", [4835.0, 172.0, 1172.0, 0.09]),
    ("Individual Leg", [5348.0, 12.0, 819.0, 0.11]),
    ("Joint Leg", [6073.0, 2.0, 104.0, 0.09]),
];

/// Digits of the figures.
const DIGITS: [usize; 8] = [0, 0, 0, 0, 0, 1, 1, 3];

fn cells(figures: Figures) -> Vec<Cell> {
    figures
        .into_iter()
        .zip(DIGITS)
        .map(|(value, digits)| {
            value.map_or_else(Cell::default, |value| Cell::number(value, digits))
        })
        .chain([Cell::default()])
        .collect()
}

fn published(name: &str, figures: Figures) -> Row {
    Row::published(name, cells(figures))
}

impl Log {
    /// Runs all configs; nothing without the log.
    fn track_all(&self, lab: &Lab<'_>, rays: Rays) -> Result<Vec<Tracked>, ReproduceError> {
        let Some(log) = self.path(lab) else { return Ok(Vec::new()) };
        let truth = truth(&log.with_extension("people-floor.csv"))?;
        lab.progress.begin(CONFIGS.len(), self.name);
        let mut all = Vec::new();
        for (config, chosen_on) in CONFIGS {
            for counted in self.track(lab, &log, &truth, config, rays)? {
                let Counting { coasting_s, tally, first, ids } = counted;
                all.push(Tracked {
                    config,
                    is_chosen_here: chosen_on == self.name,
                    coasting_s,
                    clear: tally.finish(),
                    first,
                    ids: ids.len(),
                });
            }
            lab.progress.step();
        }
        Ok(all)
    }

    /// Returns the file of the log; `None` without it.
    fn path(&self, lab: &Lab<'_>) -> Option<PathBuf> {
        let log = lab.data.as_ref()?.join("laser").join(format!("{}.mcap", self.name));
        log.is_file().then_some(log)
    }

    /// Runs one config, and counts its estimates for each time of coasting.
    fn track(
        &self,
        lab: &Lab<'_>,
        log: &Path,
        truth: &BTreeMap<u32, Vec<TruthRow>>,
        config: &str,
        rays: Rays,
    ) -> Result<[Counting; COASTING_S.len()], ReproduceError> {
        let mut pipeline = lab.contender(config)?.pipeline(lab.registry, 1)?;
        let mut source = self.open(log, pipeline.inputs())?;
        let mut all = COASTING_S.map(Counting::new);
        let mut number = 0;
        while let Some(item) = source.next_frame() {
            let frame = match rays {
                Rays::Timed => item.frame,
                Rays::AtOnce => without_times(item.frame),
            };
            let report =
                pipeline.step(&frame).map_err(|error| ReproduceError::of(self.name, error))?;
            let scan = frame.scan().map_err(|error| ReproduceError::of(self.name, error))?;
            let people = truth.get(&number).map_or(&[][..], Vec::as_slice);
            for counting in &mut all {
                let coasting_s = counting.coasting_s;
                let scan = self.scan(people, &report, &scan.robot_from_scanner, coasting_s);
                counting.add(&scan, number);
            }
            number += 1;
        }
        Ok(all)
    }

    fn open(&self, log: &Path, inputs: Inputs) -> Result<FrameSource, ReproduceError> {
        let source = FrameSource::open(log, &InputSettings::default(), &Limits::default(), inputs);
        source.map_err(|error| ReproduceError::of(self.name, error))
    }

    /// Returns the distances by which the motion of the robot during a scan moves its points.
    fn moved(&self, lab: &Lab<'_>) -> Result<Moved, ReproduceError> {
        let mut moved = Moved::default();
        let Some(log) = self.path(lab) else { return Ok(moved) };
        let mut source = self.open(&log, Inputs::ANY)?;
        while let Some(item) = source.next_frame() {
            let scan = item.frame.scan().map_err(|error| ReproduceError::of(self.name, error))?;
            moved.add(scan, &item.odom_from_robot);
        }
        Ok(moved)
    }

    /// Returns the people and the estimates of a scan that count, in the frame of the laser.
    fn scan(
        &self,
        people: &[TruthRow],
        report: &FrameReport,
        laser: &Isometry3<f64>,
        coasting_s: f64,
    ) -> FloorScan {
        let annotated = people.iter().filter(|row| row.annotated).map(|row| row.person);
        FloorScan {
            people: annotated.filter(|point| self.is_inside(point)).collect(),
            ignored: Vec::new(),
            estimates: estimates(report, laser, coasting_s)
                .filter(|point| self.is_inside(point))
                .collect(),
        }
    }

    fn is_inside(&self, point: &FloorPoint) -> bool {
        let [x, y] = point.at_m;
        let bearing_deg = y.atan2(x).to_degrees();
        self.sector_deg.is_none_or(|[right, left]| (right..=left).contains(&bearing_deg))
    }

    fn table(&self, title: &str, floors: &[(&str, Figures)], tracked: &[Tracked]) -> Table {
        let floors =
            floors.iter().map(|(name, of)| Row::ours(format!("floor: {name}"), cells(*of)));
        let ours = tracked.iter().map(|tracked| {
            let chosen = if tracked.is_chosen_here { ", chosen on this log" } else { "" };
            let coasting = tracked.coasting();
            Row::ours(format!("`{}`{coasting}{chosen}", tracked.config), self.cells(&tracked.clear))
        });
        let clusters = if self.is_complete { "people" } else { "blocks of 45 scans" };
        Table {
            title: title.into(),
            columns: COLUMNS.map(String::from).to_vec(),
            rows: floors.chain(ours).collect(),
            notes: vec![format!(
                "Estimates are confirmed tracks that this scan supports, or one within the time of \
                 coasting. Intervals of 95 % are over {clusters}. A match that is a switch is not \
                 valid. A row that says so is no result: its settings were chosen by these figures."
            )],
        }
    }

    fn cells(&self, clear: &FloorClear) -> Vec<Cell> {
        fn number(value: u64) -> Cell {
            Cell::number(value as f64, 0)
        }

        let (false_positives, mota) = if self.is_complete {
            (
                number(clear.false_positives),
                clear.mota().map_or_else(Cell::default, |mota| Cell::number(100.0 * mota, 1)),
            )
        } else {
            (Cell::default(), Cell::default())
        };
        vec![
            number(clear.objects),
            number(clear.valid),
            number(clear.switches),
            number(clear.misses),
            false_positives,
            mota,
            Cell::estimate(clear.recall(BLOCK), 3).percent(),
            clear.motp_m().map_or_else(Cell::default, |motp| Cell::number(motp, 3)),
            Cell::number(clear.estimates_per_scan(), 2),
        ]
    }

    /// Returns the table of recall by person, and of the rate of false positives.
    fn people(&self, Tracked { config, clear, .. }: &Tracked) -> Table {
        let rate = clear.false_per_minute(BLOCK, self.scan_s);
        let rate = rate.map_or_else(String::new, |rate| match rate.ends() {
            Some([low, high]) => format!("{:.1} a minute [{low:.1}, {high:.1}]", rate.estimate),
            None => format!("{:.1} a minute", rate.estimate),
        });
        Table {
            title: format!("Recall by person (`{config}` on {})", self.name),
            columns: vec!["objects".into(), "recall, %".into()],
            rows: clear.people.iter().map(|(id, [found, of])| {
            Row::ours(
                format!("person {id}"),
                vec![Cell::number(*of as f64, 0), Cell::share(*found, *of, 0)],
            )
        }).collect(),
            notes: vec![
                format!("False positives: {rate}; the interval is over blocks of {BLOCK} scans."),
                "1000 and 1001 stand, the others walk. Intervals by person are Wilson's, too narrow \
                 for scans that follow each other."
                    .into(),
            ],
        }
    }

    fn without_data(&self) -> Table {
        Table {
            title: format!("{}: the log is not at hand", self.name),
            notes: vec!["Name the folder of the data with --data.".into()],
            ..Table::default()
        }
    }
}

impl Counting {
    fn new(coasting_s: f64) -> Self {
        Self { coasting_s, tally: FloorTally::new(CUT_M), first: None, ids: BTreeSet::new() }
    }

    fn add(&mut self, scan: &FloorScan, number: u32) {
        self.tally.add(scan);
        self.ids.extend(scan.estimates.iter().map(|estimate| estimate.id));
        if self.first.is_none() && has_match(scan) {
            self.first = Some(number);
        }
    }
}

impl Tracked {
    /// Returns the row of the table with and without the times of the rays.
    fn sweep_row(&self, scans: &str) -> Row {
        let clear = &self.clear;
        let found = clear.valid + clear.switches;
        let has_any = clear.estimates > 0;
        let precision = has_any.then(|| found as f64 / clear.estimates as f64);
        let mota = clear.mota().map_or_else(Cell::default, |mota| Cell::number(100.0 * mota, 1));
        Row::ours(
            format!("`{}`{}: {scans}", self.config, self.coasting()),
            vec![
                Cell::number(clear.objects as f64, 0),
                Cell::number(found as f64, 0),
                Cell::number(clear.false_positives as f64, 0),
                precision.map_or_else(Cell::default, |share| Cell::number(100.0 * share, 1)),
                Cell::estimate(clear.recall(BLOCK), 3).percent(),
                Cell::number(clear.switches as f64, 0),
                Cell::number(self.ids as f64, 0),
                mota,
                clear.motp_m().map_or_else(Cell::default, |motp| Cell::number(motp, 3)),
            ],
        )
    }

    fn coasting(&self) -> String {
        match self.coasting_s {
            0.0 => String::new(),
            seconds => format!(", coasting for {seconds} s"),
        }
    }
}

impl Moved {
    fn add(&mut self, scan: &LaserScan, odom_from_robot: &Isometry2<f64>) {
        let skewed = points_at_once(scan);
        self.scans += 1;
        self.moved_scans += u32::from(scan.motion.is_some());
        for (moved, skewed) in scan.points.iter().zip(&skewed) {
            let by_m = (moved - skewed).norm();
            self.points += 1;
            self.sum_m += by_m;
            self.most_m = self.most_m.max(by_m);
        }
        let seen = [in_odom(&scan.points, odom_from_robot), in_odom(&skewed, odom_from_robot)];
        if self.earlier.len() == LAG
            && let Some(earlier) = self.earlier.pop_front()
        {
            for ((near, now), then) in self.near.iter_mut().zip(&seen).zip(&earlier) {
                for distance_m in now.iter().filter_map(|point| nearest_m(point, then)) {
                    near.0 += 1;
                    near.1 += distance_m;
                }
            }
        }
        self.earlier.push_back(seen);
    }

    fn sentences(&self) -> Vec<String> {
        let [deskewed_mm, skewed_mm] =
            self.near.map(|(number, sum_m)| 1000.0 * sum_m / number.max(1) as f64);
        vec![
            format!(
                "{} of {} scans are de-skewed, the others are of a robot that stands: points move by \
                 {:.3} m on average, and by {:.3} m at most.",
                self.moved_scans,
                self.scans,
                self.sum_m / self.points.max(1) as f64,
                self.most_m
            ),
            format!(
                "Points are {deskewed_mm:.1} mm from the nearest one of the scan {LAG} scans before, de-skewed \
                 both, and {skewed_mm:.1} mm as if measured at once, on average in the odometry frame, of \
                 those within {NEAR_M} m."
            ),
        ]
    }
}

/// Returns the points of a scan on the floor of the odometry frame.
fn in_odom(points: &[Point3<f64>], odom_from_robot: &Isometry2<f64>) -> Vec<Point2<f64>> {
    points.iter().map(|point| odom_from_robot * point.xy()).collect()
}

/// Returns the distance to the nearest one of some points, m; `None` if none is near.
fn nearest_m(point: &Point2<f64>, others: &[Point2<f64>]) -> Option<f64> {
    let distances = others.iter().map(|other| (other - point).norm());
    distances.min_by(f64::total_cmp).filter(|distance_m| *distance_m <= NEAR_M)
}

/// Returns the frame as it is without the times of single rays.
fn without_times(frame: Frame) -> Frame {
    let Some(scan) = frame.laser() else { return frame };
    let mut at_once = scan.clone();
    at_once.points = points_at_once(scan).into();
    at_once.motion = None;
    frame.with_sensor(at_once)
}

/// Returns the points of a scan as if the robot stood where it was at ray 0.
fn points_at_once(scan: &LaserScan) -> Vec<Point3<f64>> {
    let Some(motion) = scan.motion else { return scan.points.to_vec() };
    let mut points = Vec::new();
    for (ray, point) in scan.rays.iter().zip(scan.points.iter()) {
        let back = motion.first * motion.robot_at(*ray).inverse();
        points.push(spatial_pose(&back) * point);
    }
    points
}

/// Returns the annotated people by scan.
fn truth(path: &Path) -> Result<BTreeMap<u32, Vec<TruthRow>>, ReproduceError> {
    let rows = floor::parse(&read(path)?, &path.display().to_string());
    let mut truth: BTreeMap<u32, Vec<TruthRow>> = BTreeMap::new();
    for row in rows.map_err(ReproduceError::other)? {
        truth.entry(row.scan).or_default().push(row);
    }
    Ok(truth)
}

/// Yields the confirmed tracks that were supported within so many seconds, in the frame of the laser.
fn estimates(
    report: &FrameReport,
    laser: &Isometry3<f64>,
    coasting_s: f64,
) -> impl Iterator<Item = FloorPoint> {
    let laser_from_robot = laser.inverse();
    report
        .tracks
        .iter()
        .filter(move |track| {
            track.confirmed && (track.seen || (coasting_s > 0.0 && track.unseen_s <= coasting_s))
        })
        .map(move |track| {
            let at = laser_from_robot * track.estimate.person.position;
            FloorPoint { id: i64::from(track.id.0), at_m: [at.x, at.y] }
        })
}

fn has_match(scan: &FloorScan) -> bool {
    fn apart(a: &FloorPoint, b: &FloorPoint) -> bool {
        (a.at_m[0] - b.at_m[0]).hypot(a.at_m[1] - b.at_m[1]) <= CUT_M
    }

    scan.people.iter().any(|person| scan.estimates.iter().any(|one| apart(person, one)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{Isometry2, Vector2};
    use tagalong_core::SweepMotion;

    use super::*;

    /// A robot turns to the left by a right angle and drives 0.4 m while its scanner has five rays: two
    /// points as it saw them from where it was at rays 0 and 4, 2 m ahead both.
    #[test]
    fn without_the_times_of_the_rays_all_points_are_where_ray_0_would_have_seen_them() {
        let first = Isometry2::new(Vector2::new(0.1, 0.0), 0.0);
        let last = Isometry2::new(Vector2::new(0.5, 0.0), FRAC_PI_2);
        let points = vec![Point3::new(2.1, 0.0, 0.3), Point3::new(0.5, 2.0, 0.3)];
        let scan = LaserScan::of_points(points)
            .with_rays(0.0, 0.1, vec![0, 4])
            .with_motion(Some(SweepMotion { first, last, last_ray: 4 }));
        for point in points_at_once(&scan) {
            assert!((point - Point3::new(2.1, 0.0, 0.3)).norm() < 1e-12, "{point}");
        }
        let mut moved = Moved::default();
        for _ in 0..=LAG {
            moved.add(&scan, &Isometry2::identity());
        }
        assert!((moved.most_m - 6.56_f64.sqrt()).abs() < 1e-9, "{}", moved.most_m);
        assert_eq!([moved.scans, moved.moved_scans], [LAG as u32 + 1; 2]);
        assert_eq!(moved.near, [(2, 0.0), (2, 0.0)], "the last scan is the first one again");
        let [here, beside] = [Point2::new(1.0, 0.0), Point2::new(1.0, 0.2)];
        assert_eq!(nearest_m(&here, &[beside, Point2::new(9.0, 0.0)]), Some(0.2));
        assert_eq!(nearest_m(&here, &[Point2::new(1.0, 0.4)]), None, "something new");
        let still = scan.with_motion(None);
        assert_eq!(points_at_once(&still), still.points.to_vec());
    }
}
