//! Distribution of the messages of a log to the parts of frames.

use std::collections::BTreeMap;

use tagalong_core::{Stamp, planar_pose};

use super::changes::CameraWatch;
use super::plan::Plan;
use super::restamp::restamp;
use crate::images::{Packet, Picture, VideoDecoder};
use crate::msgs::{
    CdrError, CompressedImage, DisparityImage, Image, Odometry, PointCloud2, TFMessage, decode,
};
use crate::obstacles::ObstacleReader;
use crate::odometry::PoseBuffer;
use crate::pairing::{Arrival, Payload, Popped, Reorder, Waiting};
use crate::scan::{Type, is_static};
use crate::sensors::laser::Scans;
use crate::sensors::{SENSORS, SensorReader};
use crate::tally::Tally;
use crate::tf::TfBuffer;
use crate::topics::{Chosen, camera_frames};
use crate::walk::Message;

/// Recording time of a live message whose arrival time is not known.
pub(super) const UNKNOWN_TIME: u64 = 0;
/// Maximum time between the last frame and a message without a stamp, s, up to which it counts.
const MAX_WAIT_S: f64 = 10.0;

/// Messages that have been read but are not yet part of a frame.
pub(super) struct Intake {
    chosen: Chosen,
    /// Topic from which the frames are made: colour, or depth without colour, or laser scans.
    primary: String,
    pub(super) watch: CameraWatch,
    /// Newest stamp of the messages from which frames are made.
    newest: Option<Stamp>,
    pub(super) frames: Reorder,
    pub(super) depth: Waiting,
    pub(super) right: Waiting,
    /// Topics of the sensors other than cameras, with their readers.
    pub(super) sensors: Vec<(String, Box<dyn SensorReader>)>,
    /// Readers of the further obstacle sources.
    pub(super) obstacles: Vec<ObstacleReader>,
    /// Stamp of the last message from which a frame is made, and the time of its arrival, ns.
    heard: Option<(Stamp, u64)>,
    pub(super) tf: TfBuffer,
    pub(super) poses: PoseBuffer,
    /// Decoders of the topics with video.
    videos: BTreeMap<String, VideoDecoder>,
    /// True if messages have recording times in place of their stamps.
    has_recording_times: bool,
}

impl Intake {
    pub(super) fn new(plan: &Plan) -> Self {
        let Plan { scan, chosen, input, .. } = plan;
        let primary = plan.primary();
        let sources = plan.sources.iter();
        let mut tf = scan.tf.clone();
        // The first pass left one sample of each moving transform, only to know the links.
        tf.clear_moving();
        Self {
            chosen: chosen.clone(),
            primary: primary.to_owned(),
            watch: CameraWatch::new(plan),
            newest: None,
            frames: Reorder::new(input.reorder_frames),
            depth: Waiting::default(),
            right: Waiting::default(),
            sensors: readers(plan, primary),
            obstacles: sources.filter_map(|it| ObstacleReader::new(it, scan.is_live())).collect(),
            heard: None,
            tf,
            poses: PoseBuffer::default(),
            videos: videos(plan),
            has_recording_times: plan.has_recording_times,
        }
    }

    /// Adds a message. One that cannot be decoded is counted as lost.
    pub(super) fn take(&mut self, message: &Message<'_>, tally: &mut Tally) {
        if !self.has_recording_times {
            return self.take_stamped(message, tally);
        }
        let restamped = restamp(message);
        let data = restamped.as_deref().unwrap_or(message.data);
        self.take_stamped(&Message { data, ..*message }, tally);
    }

    fn take_stamped(&mut self, message: &Message<'_>, tally: &mut Tally) {
        self.take_obstacles(message, tally);
        let topic = Some(&message.channel.topic);
        let is_of_frames = *message.channel.topic == self.primary
            || topic == self.chosen.depth.as_ref()
            || topic == self.chosen.right.as_ref();
        let outcome = if is_of_frames {
            self.payload(message, tally).map(|image| {
                if let Some(image) = image {
                    self.take_image(message, image, tally);
                }
            })
        } else if let Some(reader) = self.reader(&message.channel.topic) {
            reader.take(message, tally)
        } else if topic == self.chosen.odometry.as_ref() {
            decode(message.data).map(|odometry| self.take_odometry(&odometry, tally))
        } else if self.watch.has_info(&message.channel.topic) {
            let topic = &message.channel.topic;
            decode(message.data).map(|info| self.watch.watch_info(topic, &info, tally))
        } else if Type::of(&message.channel.schema_name) == Type::Tf {
            decode(message.data).map(|mut tf: TFMessage| {
                if self.has_recording_times {
                    let stamp = Stamp::from_nanos(message.log_time).into();
                    tf.transforms.iter_mut().for_each(|link| link.header.stamp = stamp);
                }
                self.take_tf(&tf, &message.channel.topic, tally);
            })
        } else {
            Ok(())
        };
        if let Err(error) = outcome {
            tally.lose("messages_undecodable", || format!("{}: {error}", message.channel.topic));
        }
    }

    /// Adds an image or a scan from which a frame is made, or that belongs to one.
    fn take_image(&mut self, message: &Message<'_>, image: Payload, tally: &mut Tally) {
        let topic = &message.channel.topic;
        if *topic == self.primary {
            self.heard = Some((image.stamp, message.log_time));
            self.take_frame(image, tally);
        } else if self.chosen.depth.as_ref() == Some(topic) {
            self.depth.push(image);
        } else {
            self.right.push(image);
        }
    }

    /// Returns the stamp, the frame id and the bytes of an image or a scan, and for a video packet
    /// those of its picture; `None` for a packet without one.
    fn payload(
        &mut self,
        message: &Message<'_>,
        tally: &mut Tally,
    ) -> Result<Option<Payload>, CdrError> {
        let topic = &message.channel.topic;
        let Some(decoder) = self.videos.get_mut(topic) else { return payload(message).map(Some) };
        let packet = Packet::of(&message.channel.schema_name, message.data)?;
        match decoder.decode(packet.data, packet.header.clone()) {
            Ok(Picture::Whole(image)) => return Ok(Some(Payload::new(packet.header, &image))),
            Ok(Picture::Parameters) => {}
            Ok(Picture::OutOfOrder) => tally.lose("video_out_of_order", || {
                format!(
                    "{topic} at {}: the picture belongs before one with an earlier stamp, so its \
                     time is not known; record video without B-frames",
                    packet.header.stamp()
                )
            }),
            Ok(Picture::Waits) => tally.lose("video_without_key_picture", || {
                format!(
                    "{topic} at {}: the picture refers to one that is not in the log; the next key \
                     picture is waited for",
                    packet.header.stamp()
                )
            }),
            Err(error) => tally
                .lose(error.counter(), || format!("{topic} at {}: {error}", packet.header.stamp())),
        }
        Ok(None)
    }

    /// Passes a message to the obstacle sources on its topic, which may also be a topic from which
    /// frames are made.
    fn take_obstacles(&mut self, message: &Message<'_>, tally: &mut Tally) {
        let topic = &message.channel.topic;
        let arrival = self.arrival(message.log_time);
        for reader in self.obstacles.iter_mut().filter(|reader| reader.topic() == *topic) {
            if let Err(error) = reader.take(message.data, arrival, tally) {
                tally.lose("messages_undecodable", || format!("{topic}: {error}"));
            }
        }
    }

    /// Returns the arrival time of a message by the clock of the stamps, which may differ from that
    /// of the arrivals: the stamp of the last frame, plus the time since then if both arrival times
    /// are known.
    fn arrival(&self, log_time: u64) -> Stamp {
        let Some((stamp, then)) = self.heard else { return Stamp::default() };
        if then == UNKNOWN_TIME || log_time == UNKNOWN_TIME {
            return stamp;
        }
        let since_s = log_time.saturating_sub(then) as f64 * 1e-9;
        stamp.plus_seconds(since_s.min(MAX_WAIT_S))
    }

    fn take_frame(&mut self, image: Payload, tally: &mut Tally) {
        let newest = self.frames.last();
        let stamp = image.stamp;
        self.newest = self.newest.max(Some(image.stamp));
        match self.frames.push(image) {
            Arrival::Queued | Arrival::Suspect => {}
            Arrival::Duplicate => tally.count("duplicate_frames"),
            Arrival::SameStamp => {
                let topic = self.primary.clone();
                let remedy = if self.has_recording_times {
                    "the recorder gave them one time"
                } else {
                    "`--stamps recording` takes the times of recording"
                };
                tally.lose("frames_of_same_stamp", || {
                    format!(
                        "{topic}: different images have the same stamp, and only the first one \
                         makes a frame: {remedy}"
                    )
                });
            }
            Arrival::LateBefore => tally.count("late_frames"),
            Arrival::Jumped => {
                let topic = self.primary.clone();
                tally.remark("time_jumps_back", || {
                    format!("the stamps of {topic} are set back to {stamp}: all tracks end there")
                });
                self.newest = self.frames.newest();
                self.watch.clock_jumps();
                // Partners with stamps before the newest image belong to the new time already.
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

    /// Returns the reader of a topic, if it belongs to a sensor.
    fn reader(&mut self, topic: &str) -> Option<&mut dyn SensorReader> {
        let (_, reader) = self.sensors.iter_mut().find(|(name, _)| name == topic)?;
        Some(reader.as_mut())
    }

    /// Selects the messages of the sensors for a frame.
    pub(super) fn pair_sensors(&mut self, stamp: Stamp, next: Option<Stamp>, tolerance_s: f64) {
        self.sensors.iter_mut().for_each(|(_, sensor)| sensor.pair(stamp, next, tolerance_s));
    }

    fn take_tf(&mut self, tf: &TFMessage, topic: &str, tally: &mut Tally) {
        match self.newest {
            Some(now) if is_static(topic) => self.take_static(tf, topic, now, tally),
            // Before the first frame, a later mount replaces an earlier one.
            _ => self.insert_all(tf, topic, tally),
        }
    }

    /// Adds static transforms during the run; those that would move a sensor are not used.
    fn take_static(&mut self, tf: &TFMessage, topic: &str, now: Stamp, tally: &mut Tally) {
        for frame in self.obstacles.iter().filter_map(ObstacleReader::mount_frame) {
            self.watch.watch_sensor(frame);
        }
        let before = self.watch.mounts(&self.tf);
        let children = tf.transforms.iter().map(|transform| &transform.child_frame_id);
        let saved: Vec<_> = children.map(|child| self.tf.saved(child)).collect();
        self.insert_all(tf, topic, tally);
        if self.watch.watch_mounts(&before, &self.tf, now, tally) {
            // Restored in reverse order, because a frame may occur twice.
            saved.into_iter().rev().for_each(|link| self.tf.restore(link));
        }
    }

    fn insert_all(&mut self, tf: &TFMessage, topic: &str, tally: &mut Tally) {
        for transform in &tf.transforms {
            if !self.tf.insert(transform, is_static(topic)) {
                tally.lose("transforms_invalid", || {
                    let q = transform.transform.rotation;
                    let at = transform.transform.translation;
                    format!(
                        "{topic}: {} to {} is no rigid transform: translation [{}, {}, {}], quaternion \
                         [{}, {}, {}, {}]",
                        transform.header.frame_id,
                        transform.child_frame_id,
                        at.x,
                        at.y,
                        at.z,
                        q.x,
                        q.y,
                        q.z,
                        q.w
                    )
                });
            }
        }
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

    /// Continues with the partners of the new time once all images from before a jump of the clock
    /// are delivered.
    pub(super) fn settle(&mut self) {
        if self.frames.is_flushed() {
            self.depth.restore();
            self.right.restore();
            self.sensors.iter_mut().for_each(|(_, sensor)| sensor.restore());
        }
    }

    /// Counts, at the end of a log, the messages that were assigned to no frame.
    pub(super) fn close(&mut self, tally: &mut Tally) {
        tally.add("depth_without_colour", self.depth.leave());
        tally.add("right_without_left", self.right.leave());
        for (topic, sensor) in &mut self.sensors {
            sensor.close(topic, tally);
        }
    }
}

/// Creates a decoder for each topic with video.
fn videos(plan: &Plan) -> BTreeMap<String, VideoDecoder> {
    let topics = plan.scan.topics.iter();
    let videos = topics.filter(|(_, topic)| topic.kind == Type::Video);
    videos.map(|(name, _)| (name.clone(), VideoDecoder::new(&plan.limits))).collect()
}

/// Creates the readers of the chosen topics, except for the topic from which the frames are made.
fn readers(plan: &Plan, primary: &str) -> Vec<(String, Box<dyn SensorReader>)> {
    let Plan { scan, chosen, input, .. } = plan;
    let topics = SENSORS.iter().filter_map(|sensor| Some((sensor, chosen.sensor(sensor.input)?)));
    let others = topics.filter(|(_, topic)| *topic != primary);
    let mut readers: Vec<(String, Box<dyn SensorReader>)> = others
        .map(|(sensor, name)| {
            let schema = scan.topics.get(name).map_or("", |topic| &topic.schema);
            (name.to_owned(), (sensor.reader)(schema, input))
        })
        .collect();
    let cameras = camera_frames(scan, primary);
    readers.iter_mut().for_each(|(_, reader)| reader.know_cameras(&cameras));
    for topic in &chosen.further_scans {
        readers.push((topic.clone(), Box::new(Scans::further())));
    }
    readers
}

/// Returns the stamp, the frame id and the bytes of an image or a scan.
fn payload(message: &Message<'_>) -> Result<Payload, CdrError> {
    let header = match Type::of(&message.channel.schema_name) {
        Type::Image => decode::<Image<'_>>(message.data)?.header,
        Type::CompressedImage => decode::<CompressedImage<'_>>(message.data)?.header,
        Type::DisparityImage => decode::<DisparityImage<'_>>(message.data)?.header,
        Type::PointCloud => decode::<PointCloud2<'_>>(message.data)?.header,
        _ => decode(message.data)?,
    };
    Ok(Payload::new(header, message.data))
}
