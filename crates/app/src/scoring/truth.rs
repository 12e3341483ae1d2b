use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::outcome::Failure;
use crate::suggest::is_run;
use clap::ValueEnum;
use nalgebra::{Isometry3, Point3};
use tagalong_eval::formats::mot::{self, SequenceInfo};
use tagalong_eval::formats::{Timeline, floor, keep_first_of_id, kitti, people};
use tagalong_eval::{Region, Role, Truth};
use tagalong_geometry::{Camera, HEAD_RADIUS_M, Rect};
use tagalong_log::{Limits, TRUTH_TOPIC, TruthFrame, TruthPerson, read_truth, read_truth_lines};

use super::beside::file_beside;
use super::{Shots, odd_labels, read_text, region, without_area};

/// Maximum difference between the stamps of an image and its truth in a log, ns.
const SAME_MOMENT_NS: u64 = 5_000_000;

/// Number of frames, and fraction of all frames, after the last person of a truth beyond which it
/// may be unfinished.
const EARLY_FRAMES: u32 = 10;
const EARLY_PART: f64 = 0.2;

/// Assumed height of a person in a whole-body box, m.
pub const STANDING_HEIGHT_M: f64 = 1.7;

/// People in a frame, and the regions of the frame without annotation.
pub type People = (Vec<Truth>, Vec<Region>);

/// Rules for reading MOTChallenge truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum RulesChoice {
    /// MOT17 if all boxes have a class of it, MOT15 if none has; a mixture is rejected.
    #[default]
    Auto,
    /// No classes; boxes with confidence 0 do not count.
    Mot15,
    /// Pedestrians count, distractors are ignored.
    Mot17,
    /// As MOT17, but bicycles are ignored as well.
    Mot20,
}

/// Options for reading truth.
#[derive(Clone, Copy, Debug, Default)]
pub struct TruthOptions {
    /// Rules of MOTChallenge text.
    pub rules: RulesChoice,
    /// True if the caller has an option `--rules`, which an error about rules then names.
    pub takes_rules: bool,
    /// True if boxes enclose whole people: then their upper bodies are compared.
    pub upper_body: bool,
    /// True if only the first of several people with the same ID in a frame is kept, and the others
    /// are removed and counted.
    pub drops_doubled_ids: bool,
}

/// Position of a person, if the file has one.
#[derive(Clone, Copy, Debug, PartialEq)]
enum TruthPosition {
    Unknown,
    /// Surface of the head in the colour optical frame, m.
    HeadInCamera([f64; 3]),
    /// Position on the floor in the frame of the tracks, m.
    Floor([f64; 2]),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Mot,
    People,
    /// People annotated in laser scans.
    Floor,
    Kitti,
    Log,
    /// Messages of a log's truth channel, as text lines.
    Lines,
}

/// Annotated frame; the key of the map is its number, or its stamp.
#[derive(Clone, Debug, Default)]
struct Annotated {
    people: Vec<(Truth, TruthPosition)>,
    ignore_regions: Vec<Region>,
}

/// File of truth.
#[derive(Clone, Debug)]
pub struct TruthFile {
    kind: Kind,
    frames: BTreeMap<u64, Annotated>,
    /// True if its boxes are reduced to upper bodies.
    whole_bodies: bool,
    /// The `seqinfo.ini` beside it.
    pub info: Option<SequenceInfo>,
    /// Rules with which its rows were read, if it is MOTChallenge text.
    pub rules: Option<mot::Rules>,
    /// Notes on lines that may have another meaning than intended.
    pub notes: Vec<String>,
}

impl TruthFile {
    /// Finds the file with the truth of a log, beside it or the log itself; the flag is true if its
    /// boxes enclose whole people.
    ///
    /// # Errors
    /// A log that cannot be read, if there is no file beside it.
    pub fn beside(log: &Path) -> Result<Option<(PathBuf, bool)>, Failure> {
        // Files beside the log take precedence, so that they can replace the log's own truth.
        if let Some(found) = file_beside(log) {
            return Ok(Some(found));
        }
        Ok(read_truth(log, &Limits::default())?.map(|_| (log.to_owned(), false)))
    }

    /// Reads truth of any format.
    ///
    /// # Errors
    /// A file that cannot be read; with the name of the file and the line.
    pub fn read(path: &Path, options: TruthOptions) -> Result<Self, Failure> {
        if is_run(path) || is_of_run(path) {
            let shown = path.display();
            return Err(Failure::usage(format!(
                "{shown} was written by a run, and is not a truth: perhaps --truth and --tracks \
                 are swapped"
            )));
        }
        let mut truth = match kind_of(path)? {
            Kind::Log => Self::of_log(path)?,
            Kind::Lines => Self::of_frames(Kind::Lines, read_truth_lines(path)?),
            Kind::People => Self::of_people(path)?,
            Kind::Floor => Self::of_floor(path)?,
            Kind::Kitti => Self::of_kitti(path)?,
            Kind::Mot => Self::of_mot(path, options)?,
        };
        truth.whole_bodies = options.upper_body;
        if options.drops_doubled_ids {
            truth.drop_doubled_ids(&path.display().to_string());
        }
        Ok(truth)
    }

    /// Keeps the first of the people with the same ID in a frame, and notes the number of the others.
    fn drop_doubled_ids(&mut self, name: &str) {
        let mut dropped = 0;
        for frame in self.frames.values_mut() {
            dropped += keep_first_of_id(&mut frame.people, |(truth, _)| (0, truth.id));
        }
        if dropped > 0 {
            self.notes.push(format!(
                "{name}: {dropped} people are left out, because the frame has their ID already"
            ));
        }
    }

    /// Returns a note if the people of the truth end long before its frames do, if a file or the
    /// log states their number.
    pub fn early_end(&self, name: &str, shots: &Shots) -> Option<String> {
        let (length, stated) = match &self.info {
            Some(info) => (info.length, "seqLength is"),
            None => (shots.last(), "the last of the log is"),
        };
        let last = self.last_annotated(shots)?;
        let missing = length.saturating_sub(last);
        let is_far = missing > EARLY_FRAMES && f64::from(missing) > EARLY_PART * f64::from(length);
        is_far.then(|| {
            format!(
                "{name}: its last frame with people is {last}, and {stated} {length}: if the {missing} \
                 frames after it are not annotated, all tracks in them count as false positives"
            )
        })
    }

    fn empty(kind: Kind) -> Self {
        let frames = BTreeMap::new();
        let notes = Vec::new();
        Self { kind, frames, whole_bodies: false, info: None, rules: None, notes }
    }

    fn add(&mut self, key: u64, truth: Truth, place: TruthPosition) {
        self.frames.entry(key).or_default().people.push((truth, place));
    }

    fn of_mot(path: &Path, options: TruthOptions) -> Result<Self, Failure> {
        let text = read_text(path)?;
        let name = path.display().to_string();
        let rules = match options.rules {
            RulesChoice::Auto => mot::Rules::of_truth(&text, &name).map_err(|error| {
                // Rows that no rules can read are rejected by the same function.
                let is_of_rules = error.why.contains("rules");
                let remedy = if !is_of_rules {
                    ""
                } else if options.takes_rules {
                    " (--rules mot15, mot17 or mot20)"
                } else {
                    " (by `--rules` of `eval`, not here)"
                };
                Failure::failed(format!("{error}{remedy}"))
            })?,
            RulesChoice::Mot15 => mot::Rules::Mot15,
            RulesChoice::Mot17 => mot::Rules::Mot17,
            RulesChoice::Mot20 => mot::Rules::Mot20,
        };
        let mut file = Self::empty(Kind::Mot);
        file.rules = Some(rules);
        file.info = sequence_info(path)?;
        let rows = mot::parse_truth(&text, &name, rules).map_err(Failure::failed)?;
        if let Some(info) = &file.info {
            mot::check_length(&rows, &name, info.length).map_err(Failure::failed)?;
        }
        file.notes.extend(without_area(&name, rows.iter().map(|row| (row.line, &row.region))));
        for (number, truth) in rows.iter().map(|row| row.truth(rules)) {
            file.add(u64::from(number), truth, TruthPosition::Unknown);
        }
        Ok(file)
    }

    fn of_people(path: &Path) -> Result<Self, Failure> {
        let text = read_text(path)?;
        let name = path.display().to_string();
        let rows = people::parse(&text, &name).map_err(Failure::failed)?;
        let mut file = Self::empty(Kind::People);
        file.notes.extend(proposed_note(&name, &rows));
        for row in rows {
            let (number, truth) = row.truth(|_| None);
            let head = row.head_in_camera_m;
            let position = head.map_or(TruthPosition::Unknown, TruthPosition::HeadInCamera);
            file.add(u64::from(number), truth, position);
        }
        Ok(file)
    }

    /// Reads people in laser scans. Scans start at 0, frames at 1.
    fn of_floor(path: &Path) -> Result<Self, Failure> {
        let text = read_text(path)?;
        let rows = floor::parse(&text, &path.display().to_string()).map_err(Failure::failed)?;
        let mut file = Self::empty(Kind::Floor);
        for row in rows {
            let role = if row.ignore { Role::Ignored } else { Role::Counts };
            let truth = Truth { id: row.person.id, role, ..Truth::default() };
            // A run assumes that a scanner without a pose in tf is at the robot's origin.
            let place = TruthPosition::Floor(row.robot_m.unwrap_or(row.person.at_m));
            file.add(u64::from(row.scan) + 1, truth, place);
        }
        Ok(file)
    }

    /// Reads KITTI labels. Their frames start at 0, those of all other formats at 1.
    fn of_kitti(path: &Path) -> Result<Self, Failure> {
        let text = read_text(path)?;
        let name = path.display().to_string();
        let labels = kitti::parse(&text, &name).map_err(Failure::failed)?;
        let mut timeline = Timeline::new();
        kitti::add_truths(&mut timeline, &labels);
        let mut file = Self::empty(Kind::Kitti);
        file.notes = odd_labels(&name, &labels);
        for (number, frame) in timeline.into_frames() {
            let annotated = file.frames.entry(u64::from(number) + 1).or_default();
            annotated.ignore_regions = frame.ignore_regions;
            annotated.people = frame
                .truths
                .into_iter()
                .map(|truth| {
                    (truth, truth.floor_m.map_or(TruthPosition::Unknown, TruthPosition::Floor))
                })
                .collect();
        }
        Ok(file)
    }

    fn of_log(path: &Path) -> Result<Self, Failure> {
        let frames = read_truth(path, &Limits::default())?.ok_or_else(|| without_truth(path))?;
        Ok(Self::of_frames(Kind::Log, frames))
    }

    fn of_frames(kind: Kind, frames: Vec<TruthFrame>) -> Self {
        let mut file = Self::empty(kind);
        for frame in frames {
            let annotated = file.frames.entry(frame.stamp_ns).or_default();
            annotated.people = frame.people.iter().map(of_person).collect();
        }
        file
    }

    /// Excludes the people of these frames from scoring: their boxes become regions without
    /// annotation.
    #[must_use]
    pub fn without_judging(mut self, frames: &[u32]) -> Self {
        for number in frames {
            let Some(frame) = self.frames.get_mut(&u64::from(*number)) else { continue };
            let people = frame.people.drain(..);
            frame.ignore_regions.extend(people.filter_map(|(truth, _)| truth.region));
        }
        self
    }

    /// Returns true if the rules of KITTI apply.
    pub fn is_kitti(&self) -> bool {
        self.kind == Kind::Kitti
    }

    /// Returns true if floor positions need the camera's pose.
    pub fn needs_pose(&self) -> bool {
        let mut people = self.frames.values().flat_map(|frame| &frame.people);
        people.any(|(_, place)| matches!(place, TruthPosition::HeadInCamera(_)))
    }

    /// Returns true if frames are identified by stamps, so that only the log knows their numbers.
    pub fn needs_stamps(&self) -> bool {
        matches!(self.kind, Kind::Log | Kind::Lines)
    }

    /// Returns true if the file of truth is the log itself.
    pub fn is_in_log(&self) -> bool {
        self.kind == Kind::Log
    }

    /// Returns the number of the last frame that is known to exist.
    pub fn last(&self, shots: &Shots) -> u32 {
        let stated = self.info.as_ref().map_or(0, |info| info.length);
        let annotated = self.frames.keys().filter_map(|key| self.number(*key, shots)).max();
        stated.max(annotated.unwrap_or(0))
    }

    /// Returns the number of the last frame with an entry; `None` without entries.
    pub fn last_annotated(&self, shots: &Shots) -> Option<u32> {
        self.frames.keys().filter_map(|key| self.number(*key, shots)).next_back()
    }

    /// Returns the number of moments with an entry.
    pub fn annotated(&self) -> usize {
        self.frames.len()
    }

    /// Yields the boxes of all people, as they are annotated.
    pub fn regions(&self) -> impl Iterator<Item = &Region> {
        let people = self.frames.values().flat_map(|frame| &frame.people);
        people.filter_map(|(truth, _)| truth.region.as_ref())
    }

    /// Returns the number of annotated moments without an image of the log.
    pub fn without_image(&self, shots: &Shots) -> usize {
        self.frames.keys().filter(|key| self.number(**key, shots).is_none()).count()
    }

    fn number(&self, key: u64, shots: &Shots) -> Option<u32> {
        match self.kind {
            Kind::Log | Kind::Lines => shots.near(key, SAME_MOMENT_NS).map(|shot| shot.number),
            _ => u32::try_from(key).ok(),
        }
    }

    /// Returns the box of a person that is compared with those of tracks. If the feet of a person
    /// are in the image, the position of the upper body follows from the floor, whether crouching
    /// or upright; otherwise it is that of a standing person.
    fn compared(&self, annotated: Region, camera: Option<&Camera>) -> Region {
        if !self.whole_bodies {
            return annotated;
        }
        let Region { x, y, width, height } = annotated;
        let whole = Rect::new(x, y, width, height);
        let on_floor = camera.and_then(|camera| {
            let head = camera.head_above_floor(&whole)?;
            Some(camera.upper_body(&head))
        });
        region(&on_floor.unwrap_or_else(|| whole.upper_body_of_standing(STANDING_HEIGHT_M)))
    }

    /// Returns the people by the number of the frame, with positions on the floor if possible.
    pub fn frames(&self, shots: &Shots) -> BTreeMap<u32, People> {
        let mut all = BTreeMap::new();
        for (key, frame) in &self.frames {
            let Some(number) = self.number(*key, shots) else { continue };
            let camera = shots.at(number).map(|shot| &*shot.camera);
            let pose = camera.map(|camera| &camera.robot_from_camera);
            let people = frame.people.iter().map(|(truth, place)| Truth {
                floor_m: place.on_floor(pose),
                region: truth.region.map(|region| self.compared(region, camera)),
                ..*truth
            });
            all.insert(number, (people.collect(), frame.ignore_regions.clone()));
        }
        all
    }
}

impl TruthPosition {
    /// Returns the position in the robot frame; heads are moved from their surface to their centre.
    fn on_floor(self, robot_from_camera: Option<&Isometry3<f64>>) -> Option<[f64; 2]> {
        match self {
            Self::Unknown => None,
            Self::Floor(place) => Some(place),
            Self::HeadInCamera(surface) => {
                let surface = Point3::from(surface);
                let ray = surface.coords.try_normalize(1e-6)?;
                // Depth measures the surface, but tracks estimate the centre of the head.
                let centre = surface + ray * HEAD_RADIUS_M;
                let head = robot_from_camera? * centre;
                Some([head.x, head.y])
            }
        }
    }
}

/// Returns a note on boxes of a truth that a pipeline proposed and that have not been reviewed.
fn proposed_note(name: &str, rows: &[people::Row]) -> Option<String> {
    let proposed = rows.iter().filter(|row| !row.proposed.is_empty());
    let proposers: BTreeSet<&str> = proposed.clone().map(|row| row.proposed.as_str()).collect();
    let frames: BTreeSet<u32> = proposed.clone().map(|row| row.frame).collect();
    let proposers: Vec<&str> = proposers.into_iter().collect();
    (!proposers.is_empty()).then(|| {
        format!(
            "{name}: {} of {} boxes, in {} frames, were proposed by {} and not reviewed: its \
             figures there, and those of similar pipelines, are too good",
            proposed.count(),
            rows.len(),
            frames.len(),
            proposers.join(" and ")
        )
    })
}

/// Returns true for the tracks in the folder of a run.
fn is_of_run(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with("tracks") && path.parent().is_some_and(is_run)
}

/// Returns the failure for a log without truth, with the file of truth beside it.
fn without_truth(log: &Path) -> Failure {
    let shown = log.display();
    if let Some((beside, _)) = file_beside(log) {
        let beside = beside.display();
        return Failure::usage(format!(
            "{shown} has no truth in it, and {beside} is beside it: `--truth {beside}`"
        ));
    }
    Failure::failed(format!("{shown} has no truth: no channel {TRUTH_TOPIC}"))
}

fn of_person(person: &TruthPerson) -> (Truth, TruthPosition) {
    let truth = Truth {
        id: person.id,
        region: person.upper_body_px.map(|[x, y, width, height]| Region { x, y, width, height }),
        role: if person.ignore { Role::Ignored } else { Role::Counts },
        ..Truth::default()
    };
    (
        truth,
        person
            .head_in_robot_m
            .map_or(TruthPosition::Unknown, |[x, y, _]| TruthPosition::Floor([x, y])),
    )
}

/// Distinguishes formats by their first line.
fn kind_of(path: &Path) -> Result<Kind, Failure> {
    fn has_class(fields: &[&str]) -> bool {
        fields.get(2).is_some_and(|f| f.parse::<f64>().is_err())
    }

    match path.extension().and_then(|extension| extension.to_str()) {
        // A log is binary, so its extension decides; the text formats have no reliable extension.
        Some("mcap") => return Ok(Kind::Log),
        Some("jsonl") => return Ok(Kind::Lines),
        _ => {}
    }
    let text = read_text(path)?;
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let blank_separated: Vec<&str> = first.split_whitespace().collect();
    Ok(match first {
        _ if first.contains("x_laser_m") => Kind::Floor,
        _ if first.contains("ub_x") || first.contains("head_x") => Kind::People,
        _ if !first.contains(',') && has_class(&blank_separated) => Kind::Kitti,
        _ => match foreign(first) {
            Some(remedy) => return Err(Failure::failed(remedy.replace("FILE", &shown(path)))),
            None => Kind::Mot,
        },
    })
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Returns the problem and the remedy for annotations that an importer reads, recognised by their
/// first line; `None` for any other file.
fn foreign(first: &str) -> Option<&'static str> {
    match first.trim_start().chars().next()? {
        '{' | '[' => Some(
            "FILE is JSON, not a truth of a log: of COCO `tagalong import images FOLDER --boxes \
             FILE` makes a log with truth",
        ),
        '<' => Some(
            "FILE is XML, not a truth of a log: of CVAT `tagalong import cvat FILE -o \
             LOG.people.csv` makes one",
        ),
        letter if letter.is_alphabetic() && first.contains([',', ';', '\t']) => Some(
            "FILE has columns of another format, and is not a truth of a log: with image and box \
             `tagalong import images FOLDER --boxes FILE` makes a log with truth; see docs/logs.md \
             for people.csv",
        ),
        _ => None,
    }
}

/// Returns the `seqinfo.ini` of a MOTChallenge folder: beside `gt.txt` or above `gt`.
fn sequence_info(truth: &Path) -> Result<Option<SequenceInfo>, Failure> {
    let folders = truth.ancestors().skip(1).take(2);
    let Some(path) = folders.map(|f| f.join("seqinfo.ini")).find(|path| path.is_file()) else {
        return Ok(None);
    };
    let text = read_text(&path)?;
    mot::parse_info(&text, &path.display().to_string()).map(Some).map_err(Failure::failed)
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.0, 0.0, 0.0)
    }

    #[test]
    fn annotations_of_other_tools_lead_to_their_importer() {
        let home = tempfile::tempdir().unwrap();
        for (text, part) in [
            ("{\"images\": []}", "import images FOLDER --boxes "),
            ("<annotations/>", "import cvat "),
            ("filename,xmin,ymin,xmax,ymax\na.jpg,1,2,3,4\n", "import images FOLDER --boxes "),
        ] {
            let path = home.path().join("boxes");
            std::fs::write(&path, text).unwrap();
            let why = TruthFile::read(&path, TruthOptions::default()).err().unwrap().message;
            assert!(why.contains(&format!("{part}{}", path.display())), "{why}");
        }
    }

    #[test]
    fn the_upper_body_of_a_person_who_crouches_is_as_large_as_that_of_one_upright() {
        fn whole(top: f64) -> Region {
            let [feet, head] =
                [0.0, top].map(|z| camera().project(&Point3::new(3.0, 0.0, z)).unwrap().y);
            Region { x: 280.0, y: head, width: 80.0, height: feet - head }
        }

        let file = TruthFile { whole_bodies: true, ..TruthFile::empty(Kind::Mot) };
        let [upright, crouching] =
            [1.75, 1.1].map(|top| file.compared(whole(top), Some(&camera())));
        assert!((upright.width - crouching.width).abs() < 1.0, "{upright:?} {crouching:?}");
        // Without a camera it is that of a small person upright.
        let guessed = file.compared(whole(1.1), None);
        assert!(guessed.width < 0.7 * crouching.width, "{guessed:?} {crouching:?}");
        // Upright the two rules agree.
        let guessed = file.compared(whole(1.7), None);
        let on_floor = file.compared(whole(1.7), Some(&camera()));
        assert!((guessed.width / on_floor.width - 1.0).abs() < 0.06, "{guessed:?} {on_floor:?}");
    }

    #[test]
    fn an_error_about_rules_names_the_option_of_a_caller_that_has_it() {
        let name = format!("tagalong-mixed-rules-{}.txt", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, "1,1,10,10,5,5,1,1,1\n1,2,30,10,5,5,1,-1,-1,-1\n").unwrap();
        for (takes_rules, remedy) in [
            (true, "(--rules mot15, mot17 or mot20)"),
            (false, "(by `--rules` of `eval`, not here)"),
        ] {
            let options = TruthOptions { takes_rules, ..TruthOptions::default() };
            let failure = TruthFile::read(&path, options).unwrap_err();
            assert!(failure.message.ends_with(remedy), "{}", failure.message);
        }
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn truth_that_ends_far_before_its_frames_is_told() {
        for (last, length, is_told) in
            [(20, 600, true), (590, 600, false), (1, 9, false), (85, 100, false)]
        {
            let mut file = TruthFile::empty(Kind::Mot);
            (1..=last)
                .for_each(|number| file.add(number, Truth::default(), TruthPosition::Unknown));
            file.info = Some(SequenceInfo { length, ..SequenceInfo::default() });
            let note = file.early_end("gt.txt", &Shots::default());
            assert_eq!(note.is_some(), is_told, "{last} of {length}: {note:?}");
        }
        let mut nobody = TruthFile::empty(Kind::Mot);
        nobody.info = Some(SequenceInfo { length: 600, ..SequenceInfo::default() });
        assert_eq!(nobody.early_end("gt.txt", &Shots::default()), None);
    }

    #[test]
    fn the_first_of_doubled_ids_is_kept_and_the_others_are_counted() {
        let mut file = TruthFile::empty(Kind::Mot);
        for (number, id, x) in [(1, 5, 1.0), (1, 5, 2.0), (1, 6, 3.0), (2, 5, 4.0)] {
            file.add(number, person_at(id, x), TruthPosition::Unknown);
        }
        file.drop_doubled_ids("gt.txt");
        let frames = file.frames(&Shots::default());
        assert_eq!(frames[&1].0, [person_at(5, 1.0), person_at(6, 3.0)]);
        assert_eq!(frames[&2].0.len(), 1);
        assert_eq!(
            file.notes,
            ["gt.txt: 1 people are left out, because the frame has their ID already"]
        );
    }

    /// A person with a small box at this column.
    fn person_at(id: i64, x: f64) -> Truth {
        Truth {
            id,
            region: Some(Region { x, y: 0.0, width: 3.0, height: 4.0 }),
            ..Truth::default()
        }
    }

    #[test]
    fn proposed_boxes_that_nobody_reviewed_are_told() {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("walk.people.csv");
        let text = "frame,id,ub_x,ub_y,ub_w,ub_h,proposed\n1,1,5,5,9,9,depth-ekf\n1,2,5,5,9,9,\n\
                    2,1,5,5,9,9,depth-ekf\n";
        std::fs::write(&path, text).expect("a file");
        let told = TruthFile::read(&path, TruthOptions::default()).expect("a truth").notes;
        assert!(
            told.len() == 1
                && told[0].contains("2 of 3 boxes, in 2 frames, were proposed by depth-ekf"),
            "{told:?}"
        );
        std::fs::write(&path, text.replace("depth-ekf", "")).expect("a file");
        assert_eq!(
            TruthFile::read(&path, TruthOptions::default()).expect("a truth").notes,
            [""; 0]
        );
    }

    #[test]
    fn people_of_frames_that_are_not_judged_are_regions_without_annotation() {
        let mut file = TruthFile::empty(Kind::Mot);
        let region = Region { x: 1.0, y: 2.0, width: 3.0, height: 4.0 };
        let person = Truth { region: Some(region), ..Truth::default() };
        (1..=3).for_each(|number| file.add(number, person, TruthPosition::Unknown));
        let frames = file.without_judging(&[2, 9]).frames(&Shots::default());
        assert_eq!(frames[&1], (vec![person], vec![]));
        assert_eq!(frames[&2], (vec![], vec![region]));
        assert_eq!(frames[&3].0.len(), 1);
    }

    #[test]
    fn boxes_of_upper_bodies_stay_as_they_are() {
        let region = Region { x: 1.0, y: 2.0, width: 3.0, height: 4.0 };
        assert_eq!(TruthFile::empty(Kind::Mot).compared(region, Some(&camera())), region);
    }
}
