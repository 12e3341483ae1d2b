//! Distribution of the messages of a log to the parts of a frame.

use tagalong_core::{Stamp, planar_pose};

use super::plan::Plan;
use crate::InputSettings;
use crate::msgs::{
    CameraInfo, CdrError, CompressedImage, DisparityImage, Image, Odometry, TFMessage, decode,
};
use crate::odometry::PoseBuffer;
use crate::pairing::{Arrival, Payload, Popped, Reorder, Waiting};
use crate::scan::{Scan, Type, is_static};
use crate::sensors::{SENSORS, SensorReader};
use crate::tally::Tally;
use crate::tf::TfBuffer;
use crate::topics::Chosen;
use crate::walk::Message;

/// Messages that have been read and not yet become a frame.
pub(super) struct Intake {
    chosen: Chosen,
    /// Topic that makes the frames: colour, or depth without it, or laser scans.
    primary: String,
    info: Option<CameraInfo>,
    /// Time of the first calibration that differs from `info`.
    changed_at: Option<Stamp>,
    pub(super) frames: Reorder,
    pub(super) depth: Waiting,
    pub(super) right: Waiting,
    /// Topics of the sensors beside the images, with their readers.
    pub(super) sensors: Vec<(String, Box<dyn SensorReader>)>,
    pub(super) tf: TfBuffer,
    pub(super) poses: PoseBuffer,
}

impl Intake {
    pub(super) fn new(scan: &Scan, chosen: &Chosen, primary: &str, input: &InputSettings) -> Self {
        let mut tf = scan.tf.clone();
        // The first pass left one sample of each moving transform, to know the links only.
        tf.clear_moving();
        let info = chosen.colour_info.as_ref().and_then(|topic| scan.infos.get(topic));
        Self {
            chosen: chosen.clone(),
            primary: primary.to_owned(),
            info: info.cloned(),
            changed_at: None,
            frames: Reorder::new(input.reorder_frames),
            depth: Waiting::default(),
            right: Waiting::default(),
            sensors: readers(scan, chosen, primary),
            tf,
            poses: PoseBuffer::default(),
        }
    }

    /// Takes in a message. One that cannot be decoded is counted as lost.
    pub(super) fn take(&mut self, message: &Message<'_>, tally: &mut Tally) {
        let topic = Some(&message.channel.topic);
        let outcome = if *message.channel.topic == self.primary {
            payload(message).map(|image| self.take_frame(image, tally))
        } else if topic == self.chosen.depth.as_ref() {
            payload(message).map(|image| self.depth.push(image))
        } else if topic == self.chosen.right.as_ref() {
            payload(message).map(|image| self.right.push(image))
        } else if let Some(reader) = self.reader(&message.channel.topic) {
            reader.take(message, tally)
        } else if topic == self.chosen.odometry.as_ref() {
            decode(message.data).map(|odometry| self.take_odometry(&odometry, tally))
        } else if topic == self.chosen.colour_info.as_ref() {
            decode(message.data).map(|info| self.watch_info(&info, tally))
        } else if Type::of(&message.channel.schema_name) == Type::Tf {
            decode(message.data).map(|tf| self.take_tf(&tf, &message.channel.topic, tally))
        } else {
            Ok(())
        };
        if let Err(error) = outcome {
            tally.lose("messages_undecodable", || format!("{}: {error}", message.channel.topic));
        }
    }

    fn take_frame(&mut self, image: Payload, tally: &mut Tally) {
        let newest = self.frames.last();
        match self.frames.push(image) {
            Arrival::Queued | Arrival::Suspect => {}
            Arrival::Duplicate => tally.count("duplicate_frames"),
            Arrival::LateBefore => tally.count("late_frames"),
            Arrival::Jumped => {
                tally.count("time_jumps_back");
                // Partners with older stamps than the newest image belong to the new time already.
                if let Some(newest) = newest {
                    self.depth.set_aside(newest);
                    self.right.set_aside(newest);
                    self.sensors.iter_mut().for_each(|(_, sensor)| sensor.set_aside(newest));
                }
            }
        }
    }

    fn take_odometry(&mut self, odometry: &Odometry, tally: &mut Tally) {
        let pose = odometry.pose.pose.isometry();
        let taken =
            pose.is_some_and(|pose| self.poses.push(odometry.header.stamp(), planar_pose(&pose)));
        if !taken {
            tally.lose("odometry_invalid", || "a pose of the odometry is not finite".into());
        }
    }

    /// Returns the reader of a topic, if it is one of a sensor.
    fn reader(&mut self, topic: &str) -> Option<&mut dyn SensorReader> {
        let (_, reader) = self.sensors.iter_mut().find(|(name, _)| name == topic)?;
        Some(reader.as_mut())
    }

    /// Selects the messages of the sensors for a frame.
    pub(super) fn pair_sensors(&mut self, stamp: Stamp, next: Option<Stamp>, tolerance_s: f64) {
        self.sensors.iter_mut().for_each(|(_, sensor)| sensor.pair(stamp, next, tolerance_s));
    }

    fn take_tf(&mut self, tf: &TFMessage, topic: &str, tally: &mut Tally) {
        for transform in &tf.transforms {
            if !self.tf.insert(transform, is_static(topic)) {
                tally.lose("transforms_invalid", || {
                    format!(
                        "{topic}: {} to {} is no rigid transform",
                        transform.header.frame_id, transform.child_frame_id
                    )
                });
            }
        }
    }

    fn watch_info(&mut self, info: &CameraInfo, tally: &mut Tally) {
        // Field by field, because the header differs in each message.
        let changed = self.info.as_ref().is_some_and(|first| {
            first.k != info.k || first.d != info.d || first.p != info.p || first.roi != info.roi
        });
        if changed {
            self.changed_at.get_or_insert(info.header.stamp());
            tally.lose("camera_info_changes", || {
                "the calibration changes on the way; the first one is used throughout, and from \
                 the change on tracks stay where they were"
                    .into()
            });
        }
    }

    /// Returns true if the calibration has changed by this time.
    pub(super) fn has_changed_camera(&self, stamp: Stamp) -> bool {
        self.changed_at.is_some_and(|at| at <= stamp)
    }

    /// Returns the newest image with all its partners, and the number of older ones that were
    /// skipped.
    pub(super) fn pop_newest(&mut self, plan: &Plan) -> (Option<Popped>, u64) {
        let near = plan.input.pair_tolerance_s;
        let Self { frames, depth, right, sensors, chosen, .. } = self;
        frames.pop_newest(|stamp| {
            (!plan.has_second_depth() || depth.has(stamp, near))
                && (chosen.right.is_none() || right.has(stamp, near))
                && sensors.iter().all(|(_, sensor)| sensor.is_ready(stamp, near))
        })
    }

    /// Returns to the partners of the new time once all images from before a jump of the clock are
    /// delivered.
    pub(super) fn settle(&mut self) {
        if self.frames.is_flushed() {
            self.depth.restore();
            self.right.restore();
            self.sensors.iter_mut().for_each(|(_, sensor)| sensor.restore());
        }
    }
}

/// Creates the readers of the chosen topics; the topic that makes the frames has none.
fn readers(scan: &Scan, chosen: &Chosen, primary: &str) -> Vec<(String, Box<dyn SensorReader>)> {
    let topics = SENSORS.iter().filter_map(|sensor| Some((sensor, chosen.sensor(sensor.input)?)));
    let others = topics.filter(|(_, topic)| *topic != primary);
    let schema = |topic: &str| scan.topics.get(topic).map_or("", |topic| &topic.schema);
    others.map(|(sensor, topic)| (topic.to_owned(), (sensor.reader)(schema(topic)))).collect()
}

/// Returns the stamp, the frame and the bytes of an image or a scan.
fn payload(message: &Message<'_>) -> Result<Payload, CdrError> {
    let header = match Type::of(&message.channel.schema_name) {
        Type::Image => decode::<Image<'_>>(message.data)?.header,
        Type::CompressedImage => decode::<CompressedImage<'_>>(message.data)?.header,
        Type::DisparityImage => decode::<DisparityImage<'_>>(message.data)?.header,
        _ => decode(message.data)?,
    };
    Ok(Payload::new(header, message.data))
}
