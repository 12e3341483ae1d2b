//! Sequences of the MOTChallenge with given detections, as frames without
//! images: `../shared/data/mot`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tagalong_core::{Camera, Distortion, Frame, Images, Motion, Pinhole, Registry, Stamp};
use tagalong_eval::formats::Timeline;
use tagalong_eval::formats::mot::{Rules, SequenceInfo, parse_info, parse_truth};
use tagalong_eval::{Region, Report, Sequence};
use tagalong_pipeline::{FrameReport, Pipeline};

/// A sequence: who was there, and the detections that everybody gets.
pub struct Given {
    /// Name, frame rate, length, size of the images.
    pub info: SequenceInfo,
    truth: String,
    detections: PathBuf,
}

/// The eleven training sequences of MOT15 with the detections of the SORT
/// paper; empty where they are absent.
///
/// # Panics
/// If they are there and cannot be read.
pub fn mot15() -> Vec<Given> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/mot");
    let Ok(folders) = std::fs::read_dir(root.join("gt/MOT15-train")) else { return Vec::new() };
    let mut folders: Vec<PathBuf> = folders.flatten().map(|entry| entry.path()).collect();
    folders.sort();
    folders.iter().map(|folder| Given::read(&root, folder)).collect()
}

impl Given {
    fn read(root: &Path, folder: &Path) -> Self {
        let text = |name: &str| {
            let path = folder.join(name);
            std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
        };
        let info = parse_info(&text("seqinfo.ini"), "seqinfo.ini");
        let info = info.unwrap_or_else(|error| panic!("{error}"));
        let detections = root.join("sort-detections").join(&info.name).join("det.txt");
        Self { truth: text("gt/gt.txt"), detections, info }
    }

    /// A shipped config, with the detections of this sequence in it. Its boxes
    /// are whole bodies, and so is its truth.
    ///
    /// # Panics
    /// If the config has no detector, or is no config.
    pub fn pipeline(&self, config: &str) -> Pipeline {
        let detector = "plugin = \"recorded-detections\"";
        assert!(config.contains(detector), "no {detector}");
        let path = self.detections.canonicalize().unwrap_or_else(|e| panic!("{e}"));
        let given = format!("config = {{ path = {path:?}, body = \"full-box\", ");
        let text = config.replacen("config = { ", &given, 1);
        let mut registry = Registry::default();
        tagalong_catalog::register(&mut registry);
        let built = Pipeline::from_toml(&text, Path::new("."), &registry);
        built.unwrap_or_else(|error| panic!("{error:?}")).0
    }

    /// The frames: a stamp each, no image, and a camera of which only the size
    /// is known (a view of 53 degrees, at breast height).
    pub fn frames(&self) -> impl Iterator<Item = Frame> + use<> {
        let (width, height) = (self.info.width as usize, self.info.height as usize);
        let lens = Pinhole {
            fx: width as f64,
            fy: width as f64,
            cx: 0.5 * width as f64,
            cy: 0.5 * height as f64,
            distortion: Distortion::None,
        };
        let camera = Arc::new(Camera::mounted(lens, width, height, 1.2, 0.0, 0.0));
        let (dt, length) = (1.0 / self.info.rate_hz, u64::from(self.info.length));
        (1..=length).map(move |index| {
            let stamp = Stamp::default().plus_seconds(index as f64 * dt);
            Frame::new(index, stamp, Arc::clone(&camera), Motion::at_rest(dt), Images::default())
        })
    }

    /// Truth and what was reported, side by side.
    ///
    /// # Panics
    /// If the truth cannot be read.
    pub fn against_truth(&self, reports: &[FrameReport]) -> Sequence {
        let mut timeline = Timeline::new();
        let truth = parse_truth(&self.truth, "gt.txt", Rules::Mot15);
        timeline.add_truths(truth.unwrap_or_else(|error| panic!("{error}")));
        for report in reports {
            let seen = report.tracks.iter().filter(|t| t.confirmed && t.seen);
            timeline.frame(report.index as u32).reports.extend(seen.map(|track| {
                let r = track.estimate.region;
                let region = Some(Region::new(r.x, r.y, r.width, r.height));
                Report { id: i64::from(track.id.0), region, floor_m: None, score: track.score }
            }));
        }
        timeline.into_sequence(&self.info.name, 1, self.info.length, self.info.rate_hz).0
    }
}
