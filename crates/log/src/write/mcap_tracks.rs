use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapResult, WriteOptions, Writer};
use tagalong_core::{Stamp, TrackId};

use super::body::Body;
use super::messages;
use super::record::{BoxedPart, FrameRecord};
use super::scene;
use super::trails::Trails;
use crate::msgs::{
    CameraInfo, CompressedImage, Detection3DArray, Header, ImageAnnotations, MarkerArray, Message,
    PointCloud2, PoseStamped, SceneUpdate, StringMsg, TFMessage, encode,
};

/// Maximum number of pose topics: a file has 65,535 channels, and no viewer shows more. Further
/// people are still on the other topics.
const MAX_POSE_TOPICS: usize = 10_000;

/// Frame ids of the messages.
#[derive(Clone, Debug)]
pub struct FrameNames {
    /// Robot frame, for example `base_link`.
    pub base: String,
    /// Odometry frame, for example `odom`.
    pub odom: String,
    /// Frame of the camera, for example `camera_color_optical_frame`.
    pub camera: String,
}

/// Writer of `tracks.mcap`.
pub(super) struct McapTracks<W: Write + Seek> {
    writer: Writer<W>,
    frames: FrameNames,
    /// Part of a person that boxes in the image enclose.
    boxes: BoxedPart,
    tracks: Channel,
    json: Channel,
    tf: Channel,
    markers: Channel,
    scene: Channel,
    annotations: Channel,
    camera_info: Option<Channel>,
    images: Option<Channel>,
    target: Option<Channel>,
    people: BTreeMap<TrackId, Person>,
    trails: Trails,
    texts: BTreeMap<String, Channel>,
}

/// Topics of one person.
struct Person {
    pose: Channel,
    points: Channel,
    body: Body,
}

/// Topic and its number of messages.
struct Channel {
    id: u16,
    sequence: u32,
}

impl<W: Write + Seek> McapTracks<W> {
    /// Starts the file; the resolved config becomes the attachment `config.toml`.
    pub fn new(out: W, frames: FrameNames, config: &str) -> McapResult<Self> {
        // One compression thread: with none the files differ from those with any number of threads,
        // and more are not needed for so little data.
        let mut writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("tagalong ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_threads(1)
            .create(out)?;
        writer.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: "config.toml".into(),
            media_type: "application/toml".into(),
            data: Cow::Borrowed(config.as_bytes()),
        })?;
        // These topics are opened at once, so that they exist even in a run without tracks.
        let tracks = open::<Detection3DArray, W>(&mut writer, "/people/tracks")?;
        let json = open::<StringMsg, W>(&mut writer, "/people/tracks_json")?;
        let tf = open::<TFMessage, W>(&mut writer, "/tf")?;
        let markers = open::<MarkerArray, W>(&mut writer, "/people/markers")?;
        let scene = open::<SceneUpdate, W>(&mut writer, "/people/scene")?;
        let annotations = open::<ImageAnnotations, W>(&mut writer, "/people/annotations")?;
        Ok(Self {
            writer,
            frames,
            boxes: BoxedPart::default(),
            tracks,
            json,
            tf,
            markers,
            scene,
            annotations,
            camera_info: None,
            images: None,
            target: None,
            people: BTreeMap::new(),
            trails: Trails::default(),
            texts: BTreeMap::new(),
        })
    }

    /// Returns the writer with boxes that enclose this part of a person.
    pub fn with_boxes(self, boxes: BoxedPart) -> Self {
        Self { boxes, ..self }
    }

    /// Writes one frame.
    pub fn write(&mut self, record: &FrameRecord<'_>) -> McapResult<()> {
        let at = record.stamp;
        let detections = encode(&messages::detections(record, &self.frames.base));
        self.tracks.send(&mut self.writer, at, &detections)?;
        let json = encode(&StringMsg { data: messages::json(record).map_err(io::Error::from)? });
        self.json.send(&mut self.writer, at, &json)?;
        let tf = encode(&messages::transforms(record, &self.frames));
        self.tf.send(&mut self.writer, at, &tf)?;
        self.write_scene(record)?;
        self.write_poses(record)
    }

    /// Writes the messages for visualisation.
    fn write_scene(&mut self, record: &FrameRecord<'_>) -> McapResult<()> {
        let at = record.stamp;
        self.trails.follow(at, record.tracks, record.odom_from_robot);
        let markers = encode(&scene::markers(record, &self.trails, &self.frames.odom));
        self.markers.send(&mut self.writer, at, &markers)?;
        let update = encode(&scene::scene(record, &self.trails, &self.frames.odom));
        self.scene.send(&mut self.writer, at, &update)?;
        let annotations = encode(&scene::annotations(record, self.boxes));
        self.annotations.send(&mut self.writer, at, &annotations)?;
        let Some(info) = scene::camera_info(record, &self.frames.camera) else { return Ok(()) };
        let channel = match &mut self.camera_info {
            Some(channel) => channel,
            none => none.insert(open::<CameraInfo, W>(&mut self.writer, "/camera/camera_info")?),
        };
        channel.send(&mut self.writer, at, &encode(&info))
    }

    /// Writes a JPEG as the image of a frame.
    pub fn write_image(&mut self, at: Stamp, jpeg: &[u8]) -> McapResult<()> {
        let header = Header::new(at, self.frames.camera.as_str());
        let image = CompressedImage { header, format: "jpeg".into(), data: jpeg };
        let channel = match &mut self.images {
            Some(channel) => channel,
            none => none.insert(open::<CompressedImage<'_>, W>(
                &mut self.writer,
                "/camera/image/compressed",
            )?),
        };
        channel.send(&mut self.writer, at, &encode(&image))
    }

    /// Writes a text to its own topic, which is opened on first use.
    pub fn write_text(&mut self, topic: &str, at: Stamp, data: String) -> McapResult<()> {
        if !self.texts.contains_key(topic) {
            let channel = open::<StringMsg, W>(&mut self.writer, topic)?;
            self.texts.insert(topic.to_owned(), channel);
        }
        match self.texts.get_mut(topic) {
            Some(channel) => channel.send(&mut self.writer, at, &encode(&StringMsg { data })),
            None => Ok(()),
        }
    }

    fn write_poses(&mut self, record: &FrameRecord<'_>) -> McapResult<()> {
        for track in record.confirmed() {
            let pose = encode(&messages::pose(record, track, &self.frames.odom));
            if let Some(person) = person(&mut self.people, &mut self.writer, track.id)? {
                person.pose.send(&mut self.writer, record.stamp, &pose)?;
            }
            if record.target == Some(track.id) {
                let mut channel = match self.target.take() {
                    Some(channel) => channel,
                    None => open::<PoseStamped, W>(&mut self.writer, "/people/target_pose")?,
                };
                channel.send(&mut self.writer, record.stamp, &pose)?;
                self.target = Some(channel);
            }
        }
        self.write_bodies(record)
    }

    /// Writes the bodies that have changed, and clears those of tracks that have ended.
    fn write_bodies(&mut self, record: &FrameRecord<'_>) -> McapResult<()> {
        let heads: BTreeMap<TrackId, f64> =
            record.confirmed().map(|t| (t.id, record.head_in_odom(t).z)).collect();
        for (id, person) in &mut self.people {
            if person.body.update(heads.get(id).copied()) {
                let cloud = person.body.cloud(record.stamp, &format!("person_{id}"));
                person.points.send(&mut self.writer, record.stamp, &encode(&cloud))?;
            }
        }
        Ok(())
    }

    #[cfg(test)]
    pub fn images(&self) -> u32 {
        self.images.as_ref().map_or(0, |channel| channel.sequence)
    }

    #[cfg(test)]
    pub fn topics(&self) -> usize {
        self.people.len()
    }

    /// Closes the chunk and passes everything to the operating system.
    pub fn flush(&mut self) -> McapResult<()> {
        self.writer.flush()
    }

    /// Writes the end of the file. Without it readers have to recover the file.
    pub fn finish(mut self, about: BTreeMap<String, String>) -> McapResult<()> {
        self.writer.write_metadata(&Metadata { name: "tagalong".into(), metadata: about })?;
        self.writer.finish()?;
        self.writer.into_inner().flush()?;
        Ok(())
    }
}

impl Channel {
    fn send<W: Write + Seek>(
        &mut self,
        writer: &mut Writer<W>,
        at: Stamp,
        message: &[u8],
    ) -> McapResult<()> {
        self.sequence += 1;
        write_to(writer, self.id, self.sequence, at, message)
    }
}

/// Returns the topics of a person, which are opened on first use.
fn person<'a, W: Write + Seek>(
    people: &'a mut BTreeMap<TrackId, Person>,
    writer: &mut Writer<W>,
    id: TrackId,
) -> McapResult<Option<&'a mut Person>> {
    if !people.contains_key(&id) && people.len() < MAX_POSE_TOPICS {
        let pose = open::<PoseStamped, W>(writer, &format!("/people/person_{id}"))?;
        let points = open::<PointCloud2, W>(writer, &format!("/people/person_{id}/body"))?;
        people.insert(id, Person { pose, points, body: Body::default() });
    }
    Ok(people.get_mut(&id))
}

fn write_to<W: Write + Seek>(
    writer: &mut Writer<W>,
    channel_id: u16,
    sequence: u32,
    at: Stamp,
    message: &[u8],
) -> McapResult<()> {
    let log_time = at.nanos();
    let publish_time = at.nanos();
    writer.write_to_known_channel(
        &MessageHeader { channel_id, sequence, log_time, publish_time },
        message,
    )
}

fn open<M: Message, W: Write + Seek>(writer: &mut Writer<W>, topic: &str) -> McapResult<Channel> {
    let schema = writer.add_schema(M::TYPE, "ros2msg", M::DEFINITION.as_bytes())?;
    let about = BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]);
    Ok(Channel { id: writer.add_channel(schema, topic, "cdr", &about)?, sequence: 0 })
}
