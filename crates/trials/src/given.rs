//! Given boxes: sequences of the MOTChallenge, tracked in memory and without images.
//!
//! To compare association alone, every tracker gets exactly the same boxes. A sequence needs its
//! truth and the boxes of any detector; the images are not used.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cpu_time::ThreadTime;
use tagalong_config::{FileLimit, Registry, read_text};
use tagalong_core::{EgoMotion, ExternalDetection, Frame, Images, Stamp};
use tagalong_eval::formats::mot::{
    self, Rules, SequenceInfo, parse_info, parse_truth, write_report,
};
use tagalong_eval::formats::{FormatError, Timeline, keep_first_of_id};
use tagalong_eval::{Comparison, Report, Sequence, SetDistance, Similarity, Tally, Truth};
use tagalong_geometry::{Camera, Distortion, Pinhole, Rect};
use tagalong_pipeline::FrameReport;

use crate::{Contender, TrialError};

/// A sequence with its annotated people and the given boxes.
pub struct GivenSequence {
    /// Name, length and rate.
    pub info: SequenceInfo,
    truths: Vec<(u32, Truth)>,
    frames: Vec<Frame>,
}

impl fmt::Debug for GivenSequence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GivenSequence").field("info", &self.info).finish_non_exhaustive()
    }
}

/// Tracks of a sequence.
#[derive(Clone, Debug, Default)]
pub struct GivenTracks {
    /// Confirmed tracks that are matched with a box of the frame; coasting ones do not count.
    pub reports: Vec<(u32, Report)>,
    /// Processor time of all steps, ms.
    pub worked_ms: f64,
}

impl GivenSequence {
    /// Reads a sequence from its folder, which contains `seqinfo.ini` and `gt/gt.txt`, and its
    /// boxes from a file in the format of `det.txt`.
    ///
    /// # Errors
    /// [`TrialError::Given`] for a missing or invalid file.
    pub fn read(folder: &Path, boxes: &Path) -> Result<Self, TrialError> {
        let (path, info) = text(folder, "seqinfo.ini")?;
        let info = parse_info(&info, &path).map_err(given)?;
        let (path, truth) = text(folder, "gt/gt.txt")?;
        let rules = Rules::of_truth(&truth, &path).map_err(given)?;
        let truths = parse_truth(&truth, &path, rules).map_err(given)?;
        let (path, boxes) = text(boxes, "")?;
        let frames = frames(&info, given_boxes(&boxes, &path).map_err(given)?);
        Ok(Self { info, truths: truths.iter().map(|row| row.truth(rules)).collect(), frames })
    }

    /// Reads all sequences of a folder, sorted by name. The boxes of `NAME` are in
    /// `BOXES/NAME/det.txt` or `BOXES/NAME.txt`, or without a folder of boxes in `NAME/det/det.txt`
    /// beside the truth.
    ///
    /// # Errors
    /// A folder without sequences, or a missing or invalid file.
    pub fn read_all(folder: &Path, boxes: Option<&Path>) -> Result<Vec<Self>, TrialError> {
        let shown = folder.display();
        let entries =
            fs::read_dir(folder).map_err(|error| given(format!("cannot read {shown}: {error}")))?;
        let mut folders: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        folders.retain(|folder| folder.join("seqinfo.ini").is_file());
        folders.sort();
        if folders.is_empty() {
            let why = if folder.join("seqinfo.ini").is_file() {
                "is a sequence itself: name the folder above it"
            } else {
                "holds no folder with a seqinfo.ini"
            };
            return Err(given(format!("{shown} {why}")));
        }
        let mut all = Vec::new();
        for folder in folders {
            let found = boxes_of(&folder, boxes);
            if boxes.is_none() && !found.exists() {
                return Err(given(format!(
                    "there is no {}; --boxes DIR names the folder of the boxes",
                    found.display()
                )));
            }
            all.push(Self::read(&folder, &found)?);
        }
        Ok(all)
    }

    /// Keeps the first of several people with the same ID in a frame of the truth; returns the
    /// number of those that are removed.
    pub fn drop_doubled_ids(&mut self) -> usize {
        keep_first_of_id(&mut self.truths, |(frame, truth)| (u64::from(*frame), truth.id))
    }

    /// Tracks the boxes with a contender. Its detector gets them with the frames, as whole bodies,
    /// even if its config names files.
    ///
    /// # Errors
    /// An invalid config, or a plugin that fails.
    pub fn track(
        &self,
        contender: &Contender,
        registry: &Registry,
    ) -> Result<GivenTracks, TrialError> {
        let mut pipeline = contender.pipeline(registry, 1)?;
        let mut tracks = GivenTracks::default();
        for frame in &self.frames {
            // Only the time of this thread, so that other load on the machine does not count.
            let before = ThreadTime::now();
            let report = pipeline.step(frame).map_err(|error| TrialError::Step {
                pipeline: contender.name.clone(),
                seed: 1,
                error,
            })?;
            tracks.worked_ms += 1e3 * before.elapsed().as_secs_f64();
            tracks.add(&report);
        }
        Ok(tracks)
    }

    /// Scores tracks by the rules of the sequence's truth, with IoU 0.5 as the threshold.
    ///
    /// # Errors
    /// Tracks that cannot be scored.
    pub fn tally(&self, tracks: &GivenTracks) -> Result<Tally, TrialError> {
        let sequence = self.against_truth(tracks);
        let comparison = Comparison::from(Similarity::Iou);
        Ok(Tally::measure(&sequence, &comparison, &SetDistance::default())?)
    }

    /// Returns the number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Returns true for a sequence without frames.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    fn against_truth(&self, tracks: &GivenTracks) -> Sequence {
        let mut timeline = Timeline::new();
        timeline.add_truths(self.truths.iter().cloned());
        for (frame, report) in &tracks.reports {
            timeline.frame(*frame).reports.push(*report);
        }
        let SequenceInfo { name, length, rate_hz, .. } = &self.info;
        timeline.into_sequence(name, 1, *length, *rate_hz).0
    }
}

impl GivenTracks {
    /// Formats the tracks as a result file of the MOTChallenge.
    pub fn text(&self) -> String {
        let mut out = Vec::new();
        for (frame, report) in &self.reports {
            // Writing to memory cannot fail.
            write_report(&mut out, *frame, report).unwrap_or_default();
        }
        String::from_utf8(out).unwrap_or_default()
    }

    fn add(&mut self, report: &FrameReport) {
        let seen = report.tracks.iter().filter(|track| track.confirmed && track.seen);
        self.reports.extend(seen.map(|track| {
            let Rect { x, y, width, height } = track.estimate.region;
            let region = Some(tagalong_eval::Region::new(x, y, width, height));
            let id = i64::from(track.id.0);
            (report.index as u32, Report { id, region, floor_m: None, score: track.score })
        }));
    }
}

/// Returns a config for given boxes: the detector takes them from the frames instead of a file or a
/// topic, and as whole bodies, as the MOTChallenge annotates them. `resolved` is the config with every
/// setting.
///
/// # Errors
/// A config without a detector for recorded detections.
pub fn for_given_boxes(resolved: &str, registry: &Registry) -> Result<String, TrialError> {
    let mut root: toml::Table = resolved.parse().map_err(given)?;
    let detectors = root.get_mut("detectors").and_then(toml::Value::as_array_mut);
    let mut changed = false;
    for slot in detectors.into_iter().flatten() {
        let plugin = slot.get("plugin").and_then(toml::Value::as_str);
        let offer = registry.all_recorded().find(|(name, _)| Some(*name) == plugin);
        let config = slot.get_mut("config").and_then(toml::Value::as_table_mut);
        if let (Some((_, offer)), Some(config)) = (offer, config) {
            config.extend(offer.whole_people.parse::<toml::Table>().map_err(given)?);
            changed = true;
        }
    }
    if !changed {
        let names: Vec<String> =
            registry.all_recorded().map(|(name, _)| format!("`{name}`")).collect();
        let names = names.join(" or ");
        return Err(given(format!("the config has no detector {names}, which reads boxes")));
    }
    toml::to_string(&root).map_err(given)
}

/// Returns the file with the boxes of a sequence.
fn boxes_of(folder: &Path, boxes: Option<&Path>) -> PathBuf {
    let name = folder.file_name().unwrap_or_default();
    let Some(boxes) = boxes else { return folder.join("det/det.txt") };
    let own_folder = boxes.join(name).join("det.txt");
    if own_folder.is_file() {
        return own_folder;
    }
    boxes.join(format!("{}.txt", name.to_string_lossy()))
}

/// Returns the path of a file as it is shown in messages, and its text.
fn text(folder: &Path, name: &str) -> Result<(String, String), TrialError> {
    let path = if name.is_empty() { folder.to_owned() } else { folder.join(name) };
    let shown = path.display().to_string();
    match read_text(&path, FileLimit::Table) {
        Ok(text) => Ok((shown, text)),
        Err(error) => Err(given(format!("cannot read {shown}: {error}"))),
    }
}

fn given_boxes(
    text: &str,
    file: &str,
) -> Result<BTreeMap<u32, Vec<ExternalDetection>>, FormatError> {
    let mut boxes: BTreeMap<u32, Vec<ExternalDetection>> = BTreeMap::new();
    for row in mot::parse(text, file)? {
        let region = Rect::new(row.region.x, row.region.y, row.region.width, row.region.height);
        let recorded = ExternalDetection::in_image(region, row.confidence);
        boxes.entry(row.frame).or_default().push(recorded);
    }
    Ok(boxes)
}

/// Returns frames that have a stamp each but no images, and a camera with the size of the images (a
/// field of view of 53 degrees, at chest height).
fn frames(info: &SequenceInfo, mut boxes: BTreeMap<u32, Vec<ExternalDetection>>) -> Vec<Frame> {
    let width = info.width as usize;
    let height = info.height as usize;
    let lens = Pinhole {
        fx: width as f64,
        fy: width as f64,
        cx: 0.5 * width as f64,
        cy: 0.5 * height as f64,
        distortion: Distortion::None,
    };
    let camera = Arc::new(Camera::mounted(lens, width, height, 1.2, 0.0, 0.0));
    let dt = 1.0 / info.rate_hz;
    let frames = (1..=info.length).map(|index| {
        let stamp = Stamp::default().plus_seconds(f64::from(index) * dt);
        let motion = EgoMotion::at_rest(dt);
        let frame = Frame::new(index.into(), stamp, Arc::clone(&camera), motion, Images::default());
        frame.with_recorded(Some(boxes.remove(&index).unwrap_or_default()))
    });
    frames.collect()
}

fn given(error: impl ToString) -> TrialError {
    TrialError::Given(error.to_string())
}

#[cfg(test)]
mod tests {
    use tagalong_config::RecordedOffer;
    use tagalong_eval::Role;

    use super::*;

    const INFO: &str = "[Sequence]\nname=Walk-1\nframeRate=10\nseqLength=3\nimWidth=640\n\
                        imHeight=480\n";

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("Walk-1");
        fs::create_dir_all(path.join("gt")).unwrap();
        fs::create_dir_all(path.join("det")).unwrap();
        fs::write(path.join("seqinfo.ini"), INFO).unwrap();
        fs::write(path.join("gt/gt.txt"), "1,1,10,10,20,60,1,-1,-1,-1\n").unwrap();
        fs::write(path.join("det/det.txt"), "2,-1,10,10,20,60,0.9\n").unwrap();
        folder
    }

    #[test]
    fn each_frame_has_its_boxes_and_its_time() {
        let folder = folder();
        let all = GivenSequence::read_all(folder.path(), None).unwrap();
        assert_eq!((all.len(), all[0].len(), all[0].is_empty()), (1, 3, false));
        let counts: Vec<usize> =
            all[0].frames.iter().map(|frame| frame.recorded().unwrap().len()).collect();
        assert_eq!(counts, [0, 1, 0]);
        let stamps: Vec<u64> = all[0].frames.iter().map(|frame| frame.stamp.nanos()).collect();
        assert_eq!(stamps, [100_000_000, 200_000_000, 300_000_000]);
        assert_eq!(all[0].truths[0].1.role, Role::Counts);
    }

    #[test]
    fn doubled_ids_stop_the_scores_unless_the_first_is_kept() {
        let folder = folder();
        let row = "1,1,10,10,20,60,1,-1,-1,-1\n";
        fs::write(folder.path().join("Walk-1/gt/gt.txt"), row.repeat(2)).unwrap();
        let mut sequence = GivenSequence::read_all(folder.path(), None).unwrap().remove(0);
        let error = sequence.tally(&GivenTracks::default()).unwrap_err();
        assert!(error.to_string().contains("occurs twice"), "{error}");
        assert_eq!(sequence.drop_doubled_ids(), 1);
        assert_eq!(sequence.tally(&GivenTracks::default()).unwrap().scores().truths, 1);
    }

    #[test]
    fn boxes_may_lie_elsewhere() {
        let folder = folder();
        let other = folder.path().join("other");
        fs::create_dir_all(other.join("Walk-1")).unwrap();
        let missing = GivenSequence::read_all(folder.path(), Some(&other)).unwrap_err();
        assert!(missing.to_string().contains("Walk-1.txt"));
        fs::write(other.join("Walk-1.txt"), "").unwrap();
        let beside = GivenSequence::read_all(folder.path(), Some(&other)).unwrap();
        assert_eq!(beside[0].frames[1].recorded().unwrap().len(), 0);
        fs::write(other.join("Walk-1/det.txt"), "3,-1,1,1,9,9,0.5\n").unwrap();
        let inside = GivenSequence::read_all(folder.path(), Some(&other)).unwrap();
        assert_eq!(inside[0].frames[2].recorded().unwrap()[0].score, 0.5);
    }

    #[test]
    fn a_folder_that_holds_none_is_an_error() {
        let empty = tempfile::tempdir().unwrap();
        let error = GivenSequence::read_all(empty.path(), None).unwrap_err();
        assert!(error.to_string().contains("seqinfo.ini"), "{error}");
    }

    #[test]
    fn a_sequence_itself_and_one_without_boxes_are_told_with_the_remedy() {
        let folder = folder();
        let walk = folder.path().join("Walk-1");
        let error = GivenSequence::read_all(&walk, None).unwrap_err().to_string();
        assert!(error.contains("a sequence itself: name the folder above it"), "{error}");
        fs::remove_file(walk.join("det/det.txt")).unwrap();
        let error = GivenSequence::read_all(folder.path(), None).unwrap_err().to_string();
        assert!(error.ends_with("--boxes DIR names the folder of the boxes"), "{error}");
    }

    #[test]
    fn the_detector_of_a_config_takes_whole_bodies_from_the_frames() {
        let config = "[[detectors]]\nplugin = 'recorded-detections'\n\
                      config = { path = 'x/det.txt', body = 'upper', min_score = 0.4 }\n";
        let mut registry = Registry::default();
        let whole_people = "path = ''\nbody = 'full-box'";
        let offer = RecordedOffer { whole_people, known_positions: "" };
        registry.recorded("recorded-detections", offer);
        let root: toml::Table = for_given_boxes(config, &registry).unwrap().parse().unwrap();
        let detector = &root["detectors"][0]["config"];
        assert_eq!(
            (detector["path"].as_str(), detector["body"].as_str()),
            (Some(""), Some("full-box"))
        );
        assert_eq!(detector["min_score"].as_float(), Some(0.4));
        let none = for_given_boxes("[[detectors]]\nplugin = 'other'\n", &registry).unwrap_err();
        let words = "no detector `recorded-detections`, which reads boxes";
        assert!(none.to_string().contains(words), "{none}");
    }

    #[test]
    fn tracks_are_written_as_the_challenge_reads_them() {
        let region = Some(tagalong_eval::Region::new(1.0, 2.0, 3.0, 4.0));
        let report = Report { id: 7, region, floor_m: None, score: 0.5 };
        let tracks = GivenTracks { reports: vec![(2, report)], ..GivenTracks::default() };
        let rows = mot::parse_tracks(&tracks.text(), "tracks").unwrap();
        assert_eq!((rows.len(), rows[0].frame, rows[0].id), (1, 2, 7));
        assert_eq!(rows[0].region.width, 3.0);
    }
}
