//! Changes of the cameras during a recording, after which positions in the images are wrong.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use tagalong_core::{Input, Stamp};

use super::mount::{Mount, robot_frame};
use super::plan::Plan;
use crate::camera_info::is_blank;
use crate::msgs::CameraInfo;
use crate::pairing::Payload;
use crate::tally::Tally;
use crate::tf::{TfBuffer, plain};

/// Minimum translation for which a mount counts as changed, m.
const MOVED_M: f64 = 1e-3;
/// Minimum rotation for which a mount counts as changed, degrees.
const TURNED_DEG: f64 = 0.1;
/// Consequence of a change, at the end of a sentence about it.
const CONSEQUENCE: &str = "the first one is used throughout, and from the change on tracks stay \
                           where they were";

/// Watches everything that must not change during a run: the calibrations of the cameras, the frame
/// ids of the images, and the mounts in the static transforms, also those of further sensors.
pub(super) struct CameraWatch {
    /// First calibrations, by topic.
    infos: BTreeMap<String, CameraInfo>,
    /// Topic of the first calibration that changed.
    changed_info: Option<String>,
    mounts: Vec<WatchedMount>,
    /// Frame of the robot.
    robot_frame: String,
    /// Time of the first change.
    changed_at: Option<Stamp>,
}

/// Pose of a sensor that is given by static transforms, wholly or in part.
#[derive(PartialEq)]
struct WatchedMount {
    target: String,
    source: String,
}

impl CameraWatch {
    pub(super) fn new(plan: &Plan) -> Self {
        let chosen = &plan.chosen;
        let topics = [&chosen.colour_info, &chosen.depth_info, &chosen.right_info];
        let further = plan.sources.iter().map(|source| &source.info_topic);
        let infos = topics
            .into_iter()
            .chain(further)
            .flatten()
            .filter_map(|topic| Some((topic.clone(), plan.scan.infos.get(topic)?.clone())))
            .collect();
        Self {
            infos,
            changed_info: None,
            mounts: watched_mounts(plan),
            robot_frame: robot_frame(&plan.scan, &plan.input).to_owned(),
            changed_at: None,
        }
    }

    /// Returns true for the topic of a watched calibration.
    pub(super) fn has_info(&self, topic: &str) -> bool {
        self.infos.contains_key(topic)
    }

    /// Compares a calibration with the first one on its topic. A blank one does not count as a
    /// change.
    pub(super) fn watch_info(&mut self, topic: &str, info: &CameraInfo, tally: &mut Tally) {
        if is_blank(info) {
            return;
        }
        // Compared field by field, because the header differs in each message.
        let changed = self.infos.get(topic).is_some_and(|first| {
            first.k != info.k || first.d != info.d || first.p != info.p || first.roi != info.roi
        });
        if changed {
            self.change_at(info.header.stamp());
            self.changed_info.get_or_insert_with(|| topic.to_owned());
            tally.lose("camera_info_changes", || {
                format!("{topic}: the calibration changes on the way; {CONSEQUENCE}")
            });
        }
    }

    /// Compares the frame id of an image with that of the first image on its topic.
    pub(super) fn watch_frame(
        &mut self,
        topic: &str,
        first: Option<&str>,
        image: &Payload,
        frame_stamp: Stamp,
        tally: &mut Tally,
    ) {
        let Some(first) = first.filter(|first| plain(first) != plain(&image.frame_id)) else {
            return;
        };
        self.change_at(frame_stamp);
        tally.lose("frame_id_changes", || {
            format!(
                "{topic}: the frame_id changes from `{first}` to `{}` at {}, which is another \
                 camera or another mount; from the change on tracks stay where they were: give \
                 each camera a topic of its own",
                image.frame_id, image.stamp
            )
        });
    }

    /// Returns the topic of the first calibration that changed.
    pub(super) fn changed_info(&self) -> Option<&str> {
        self.changed_info.as_deref()
    }

    /// Watches the mount of one more sensor on the robot, by its frame id.
    pub(super) fn watch_sensor(&mut self, frame: &str) {
        let mount = WatchedMount { target: self.robot_frame.clone(), source: frame.to_owned() };
        if mount.target != mount.source && !self.mounts.contains(&mount) {
            self.mounts.push(mount);
        }
    }

    /// Returns the static parts of the watched mounts, in order.
    pub(super) fn mounts(&self, tf: &TfBuffer) -> Vec<Option<Isometry3<f64>>> {
        self.mounts.iter().map(|mount| tf.static_pose(&mount.target, &mount.source)).collect()
    }

    /// Compares the static parts of the mounts with those of `before`; returns true if one of them
    /// changed at this time.
    pub(super) fn watch_mounts(
        &mut self,
        before: &[Option<Isometry3<f64>>],
        tf: &TfBuffer,
        now: Stamp,
        tally: &mut Tally,
    ) -> bool {
        let mut has_changed = false;
        for (mount, (old, new)) in self.mounts.iter().zip(before.iter().zip(self.mounts(tf))) {
            // A mount that only becomes known is not a change.
            let Some(old) = old.filter(|old| has_moved(old, new.as_ref())) else { continue };
            has_changed = true;
            tally.lose("mount_changes", || {
                let WatchedMount { target, source } = mount;
                let place = new.as_ref().map_or("nowhere".to_owned(), pose_text);
                let old = pose_text(&old);
                format!(
                    "tf_static moves `{source}` in `{target}` at {now} from {old} to {place}; \
                     {CONSEQUENCE}"
                )
            });
        }
        if has_changed {
            self.change_at(now);
        }
        has_changed
    }

    /// Returns true if something has changed before this time.
    pub(super) fn has_changed(&self, stamp: Stamp) -> bool {
        self.changed_at.is_some_and(|at| at <= stamp)
    }

    /// Keeps a change in force for the earlier times after a backward jump of the clock.
    pub(super) fn clock_jumps(&mut self) {
        if self.changed_at.is_some() {
            self.changed_at = Some(Stamp::default());
        }
    }

    fn change_at(&mut self, stamp: Stamp) {
        let first = self.changed_at.map_or(stamp, |at| at.min(stamp));
        self.changed_at = Some(first);
    }
}

/// Returns the poses on which the frames depend: of the camera on the robot, of the depth camera
/// relative to the colour camera, and of the laser scanners on the robot.
fn watched_mounts(plan: &Plan) -> Vec<WatchedMount> {
    let primary = plan.scan.frame_of(plan.primary());
    let depth = plan.chosen.depth.as_ref().and_then(|topic| plan.scan.frame_of(topic));
    let laser = plan.chosen.sensor(Input::Laser).filter(|topic| *topic != plan.primary());
    let further = plan.chosen.further_scans.iter().map(String::as_str);
    let scanners = laser.into_iter().chain(further).filter_map(|topic| plan.scan.frame_of(topic));
    let robot = robot_frame(&plan.scan, &plan.input);
    let camera = match &plan.mount {
        Mount::Tf { base, camera } => Some((base.as_str(), camera.as_str())),
        Mount::Fixed { .. } => None,
    };
    let cameras = [camera, primary.zip(depth)].into_iter().flatten();
    let pairs = cameras.chain(scanners.map(|scanner| (robot, scanner)));
    let pairs = pairs.filter(|(target, source)| target != source);
    pairs
        .map(|(target, source)| WatchedMount {
            target: target.to_owned(),
            source: source.to_owned(),
        })
        .collect()
}

/// Returns true if a pose has moved or turned by more than repeated publishing explains, or is
/// gone.
fn has_moved(old: &Isometry3<f64>, new: Option<&Isometry3<f64>>) -> bool {
    let Some(new) = new else { return true };
    let moved_m = (old.translation.vector - new.translation.vector).norm();
    let turned_deg = old.rotation.angle_to(&new.rotation).to_degrees();
    moved_m > MOVED_M || turned_deg > TURNED_DEG
}

/// Returns a pose as text: position and angles.
fn pose_text(pose: &Isometry3<f64>) -> String {
    let at = &pose.translation.vector;
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_degrees);
    format!(
        "x, y, z = {:.3}, {:.3}, {:.3} m and roll, pitch, yaw = {roll:.1}, {pitch:.1}, {yaw:.1} \
         degrees",
        at.x, at.y, at.z
    )
}
