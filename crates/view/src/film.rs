//! One pass over the log of the runs, for images, laser scans, trails and the times of all frames.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::page::data::{FrameData, RunData};
use crate::page::frame::{add_trails, add_whole_people, scan_points, view_edges};
use nalgebra::Isometry2;
use tagalong_app::config_file::OuterSettings;
use tagalong_app::missed::Depths;
use tagalong_app::outcome::Failure;
use tagalong_app::progress::Progress;
use tagalong_app::scoring::{Shot, Shots};
use tagalong_geometry::Camera;
use tagalong_log::write::BoxedPart;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, LogFrame};
use tagalong_render::background;

use crate::pictures::Pictures;
use crate::recording::Recording;

/// Length of a trail, ns.
const TRAIL_NS: u64 = 2_000_000_000;

/// Parts of the page that come from the log.
pub struct Film {
    /// Images of the frames.
    pub pictures: Pictures,
    /// Points of laser scans in the odometry frame, cm.
    pub scans: Vec<Vec<i32>>,
    /// Depth images of the frames, reduced.
    pub depths: Vec<Option<Depths>>,
    /// Directions of the edges of the field of view, rad.
    pub view_rad: Option<[f64; 2]>,
    /// Times and poses of the frames.
    pub shots: Shots,
    /// Part of people that the boxes of each run enclose.
    boxes: Vec<BoxedPart>,
}

/// Opens the log of a run if it is the file that the run read.
///
/// # Errors
/// A log that the user named and that cannot be read or is another one. If the user named none, the
/// reason why no log was found becomes a sentence on the page instead.
pub fn open(run: &Recording, asked: Option<&Path>) -> Result<Result<FrameSource, String>, Failure> {
    let Some(path) = asked.map(Path::to_owned).or_else(|| find(run)) else {
        let name = &run.report.log.name;
        return Ok(Err(format!(
            "{name} was not found, so there are no images; name it with --log"
        )));
    };
    let outer = outer_settings(run);
    // The right image is not shown, and decoding it would take time.
    let inputs = Inputs::ANY.without(Input::Right);
    let source = FrameSource::open(&path, &outer.input, &outer.limits, inputs);
    let shown = path.display();
    match (source, asked.is_some()) {
        (Ok(source), _) if source.facts().sha256 == run.report.log.sha256 => Ok(Ok(source)),
        (Ok(_), true) => Err(Failure::usage(format!(
            "{shown} is not the log of {}: its contents differ from those of {}",
            run.folder.display(),
            run.report.log.name
        ))),
        (Ok(_), false) => {
            Ok(Err(format!("{shown} has changed since the run, so there are no images")))
        }
        (Err(error), true) => Err(error.into()),
        (Err(error), false) => Ok(Err(format!("there are no images: {error}"))),
    }
}

/// Returns the path of the log: its path at the time of the run, beside the run, or in the current
/// folder.
fn find(run: &Recording) -> Option<PathBuf> {
    let name = &run.report.log.name;
    let beside = run.folder.parent().map(|folder| folder.join(name));
    let places = [Some(run.origin.log.clone()), beside, Some(PathBuf::from(name))];
    places.into_iter().flatten().find(|path| path.exists() && !path.as_os_str().is_empty())
}

/// Returns the settings with which the run read its log.
fn outer_settings(run: &Recording) -> OuterSettings {
    let own = ["input", "limits", "output"];
    let tables = run.config.iter().filter(|(key, _)| own.contains(&key.as_str()));
    let tables = tables.map(|(key, value)| (key.clone(), value.clone())).collect();
    let mut outer: OuterSettings = toml::Value::Table(tables).try_into().unwrap_or_default();
    // The topics of `[input]` are those of the real robot; a ride does not read its log with them,
    // because the simulator writes its own topics.
    if run.report.ride.is_some() {
        outer.input = InputSettings::default();
    }
    outer
}

/// Returns the part of people that the boxes of a run enclose.
fn boxes_of(run: &Recording) -> BoxedPart {
    outer_settings(run).output.boxes
}

impl Film {
    /// Reads the log once, and fills in the trails of the runs.
    pub fn of(
        mut source: FrameSource,
        stamps: &[u64],
        runs: &mut [RunData],
        recordings: &[Recording],
        image_bytes: usize,
    ) -> Self {
        let positions: BTreeMap<u64, usize> =
            stamps.iter().enumerate().map(|(at, stamp)| (*stamp, at)).collect();
        let mut film = Self {
            pictures: Pictures::within(image_bytes, stamps.len()),
            scans: vec![Vec::new(); stamps.len()],
            depths: vec![None; stamps.len()],
            view_rad: None,
            shots: Shots::default(),
            boxes: recordings.iter().map(boxes_of).collect(),
        };
        let progress = Progress::titled("images");
        while let Some(item) = source.next_frame() {
            film.shots.push(Shot::of(&item));
            progress.advance(source.progress(), item.frame.index);
            if let Some(at) = positions.get(&item.frame.stamp.nanos()) {
                film.take(*at, &item, runs, stamps);
            }
        }
        film
    }

    fn take(&mut self, at: usize, item: &LogFrame, runs: &mut [RunData], stamps: &[u64]) {
        let frame = &item.frame;
        if let Some(image) = background(&frame.images()) {
            self.pictures.add(at, &image);
        }
        if let Some(laser) = frame.laser() {
            self.scans[at] = scan_points(&laser.points, &item.odom_from_robot);
        }
        if frame.camera.is_blind() {
            return;
        }
        self.depths[at] = Depths::of_frame(frame);
        if self.view_rad.is_none() && frame.camera.panorama().is_none() {
            self.view_rad = Some(view_edges(&frame.camera));
        }
        let oldest_ns = frame.stamp.nanos().saturating_sub(TRAIL_NS);
        let from = stamps.partition_point(|stamp| *stamp < oldest_ns);
        for (run, boxes) in runs.iter_mut().zip(&self.boxes) {
            add_trails_at(&mut run.frames, from..at, &frame.camera, &item.odom_from_robot);
            if let (BoxedPart::Full, Some(Some(shown))) = (boxes, run.frames.get_mut(at)) {
                add_whole_people(shown, &frame.camera, &item.odom_from_robot);
            }
        }
    }

    /// Returns the scans; `None` if the log has none.
    pub fn scans(&self) -> Option<Vec<Vec<i32>>> {
        self.scans.iter().any(|scan| !scan.is_empty()).then(|| self.scans.clone())
    }
}

/// Adds the trails of one frame of a run.
fn add_trails_at(
    frames: &mut [Option<FrameData>],
    trail: Range<usize>,
    camera: &Camera,
    odom_from_robot: &Isometry2<f64>,
) {
    let (past, rest) = frames.split_at_mut(trail.end);
    let Some(Some(frame)) = rest.first_mut() else { return };
    let before: Vec<&FrameData> = past[trail.start..].iter().flatten().collect();
    add_trails(&before, frame, camera, odom_from_robot);
}

#[cfg(test)]
mod tests {
    use crate::page::data::TrackData;
    use nalgebra::Vector2;
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;
    use crate::recording::RideFacts;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.6, 0.0, 0.0)
    }

    #[test]
    fn the_log_of_a_ride_is_read_without_the_topics_of_the_robot() {
        let config = toml::from_str("[input]\nlaser_topic = \"/scan\"\n[output]\nboxes = \"full\"");
        let mut run = Recording { config: config.unwrap(), ..Recording::default() };
        assert_ne!(outer_settings(&run).input, InputSettings::default());
        run.report.ride = Some(RideFacts::default());
        assert_eq!(outer_settings(&run).input, InputSettings::default());
        assert_eq!(
            outer_settings(&run).output.boxes,
            BoxedPart::Full,
            "the boxes are those of the run"
        );
    }

    #[test]
    fn a_trail_stays_on_the_floor_while_the_robot_turns() {
        fn person(at: [f64; 2]) -> TrackData {
            TrackData { id: 1, state: "seen", at, z: 1.6, ..TrackData::default() }
        }

        fn frame(at: [f64; 2]) -> Option<FrameData> {
            Some(FrameData { tracks: vec![person(at)], ..FrameData::default() })
        }

        let mut frames = vec![frame([4.0, 0.0]), None, frame([4.0, 0.5])];
        add_trails_at(&mut frames, 0..2, &camera(), &Isometry2::identity());
        assert_eq!(frames[2].as_ref().unwrap().tracks[0].trail, [320, 240], "straight ahead");
        // After a turn to the left, the position is to the right in the image.
        let turned = Isometry2::new(Vector2::zeros(), 0.1);
        add_trails_at(&mut frames, 0..2, &camera(), &turned);
        assert_eq!(frames[2].as_ref().unwrap().tracks[0].trail, [370, 240]);
    }
}
