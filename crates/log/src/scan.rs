//! First pass over a log: finds its contents. No image is decoded.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};
use tagalong_core::Stamp;
use tagalong_math::counted;

use crate::camera_info::is_blank;
use crate::clock::{Times, constant_lag_s, other_clock_s};
use crate::hashing::Hashing;
use crate::images::{
    CloudAxes, CloudCamera, Codec, Content, H264, ImageError, NO_PARAMETERS, Packet,
    camera_of_cloud, content_of_compressed, content_of_encoding, has_lengths, may_be_disparity,
    points_of_cloud, size_of_compressed, size_of_video, video_codec,
};
use crate::log_files::LogFiles;
use crate::msgs::{
    CameraInfo, CompressedImage, DisparityImage, Float32Msg, Header, Image, Odometry, PointCloud2,
    TFMessage, TransformStamped, decode,
};
use crate::packed::LogFile;
use crate::sensors::SensorType;
use crate::tf::{TfBuffer, plain};
use crate::timing::Skew;
use crate::topics::{Stream, TopicName, part_of};
use crate::walk::{Channel, Counters, Message};
use crate::walker::LogWalker;
use crate::{Limits, LogError};

/// Maximum number of image stamps stored per topic, to measure rate and skew.
const MAX_STAMPS: usize = 20_000;

/// Message type of a topic, if Tagalong uses it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Type {
    Image,
    CompressedImage,
    /// Video packets, either in their own message type or as compressed images.
    Video,
    DisparityImage,
    PointCloud,
    CameraInfo,
    Tf,
    Odometry,
    /// Messages of an entry in [`crate::sensors::SENSORS`].
    Sensor,
    /// A number, which may be the depth unit of a camera.
    Number,
    #[default]
    Other,
}

impl Type {
    /// Returns the type by its name, with or without the middle part (`msg`).
    pub(crate) fn of(schema: &str) -> Self {
        let (package, name) = schema.split_once('/').unwrap_or(("", schema));
        match (package, name.rsplit('/').next().unwrap_or(name)) {
            ("sensor_msgs", "Image") => Self::Image,
            ("sensor_msgs", "CompressedImage") => Self::CompressedImage,
            ("foxglove_msgs", "CompressedVideo") => Self::Video,
            ("ffmpeg_image_transport_msgs", "FFMPEGPacket") => Self::Video,
            ("stereo_msgs", "DisparityImage") => Self::DisparityImage,
            ("sensor_msgs", "PointCloud2") => Self::PointCloud,
            ("sensor_msgs", "CameraInfo") => Self::CameraInfo,
            ("tf2_msgs" | "tf", "TFMessage" | "tfMessage") => Self::Tf,
            ("nav_msgs", "Odometry") => Self::Odometry,
            ("std_msgs", "Float32") => Self::Number,
            _ if SensorType::of_message(schema).is_some() => Self::Sensor,
            _ => Self::Other,
        }
    }
}

/// One topic of a log.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topic {
    pub(crate) kind: Type,
    pub(crate) schema: String,
    pub(crate) encoding: String,
    pub(crate) count: u64,
    pub(crate) undecodable: u64,
    /// Number of messages with an impossible field, and the first such field.
    pub(crate) faulty: u64,
    pub(crate) fault: Option<String>,
    pub(crate) first_log_time: u64,
    pub(crate) last_log_time: u64,
    /// `encoding` or `format` of the first image.
    pub(crate) pixels: Option<String>,
    pub(crate) content: Content,
    /// True for grey images of 16 bits whose encoding does not show whether they are depth.
    pub(crate) is_deep_grey: bool,
    /// True for images with the encoding of depth but the name of another stream: infrared or
    /// confidence.
    pub(crate) is_other_stream: bool,
    /// True for depth that was compressed as JPEG, which has only 8 bits.
    pub(crate) is_jpeg_depth: bool,
    /// Columns and rows of the first image.
    pub(crate) size: Option<(u32, u32)>,
    /// Camera of an organised point cloud, or the reason why there is none.
    pub(crate) cloud: Option<CloudCamera>,
    pub(crate) cloud_fault: Option<String>,
    /// Reason why the H.264 packets so far give no picture.
    pub(crate) video_fault: Option<String>,
    /// True for points that can be read, even if they are not those of a camera.
    pub(crate) has_points: bool,
    pub(crate) frame_id: Option<String>,
    /// Frame whose pose the odometry gives.
    pub(crate) child_frame_id: Option<String>,
    /// Type of images, points or scans that are contained in messages of an unknown type.
    pub(crate) part: Option<&'static str>,
    pub(crate) stamps: Vec<Stamp>,
    /// Times at which the messages with these stamps were recorded.
    pub(crate) recorded: Vec<Stamp>,
}

/// Contents of a log.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scan {
    pub(crate) path: PathBuf,
    pub(crate) bytes: u64,
    pub(crate) sha256: String,
    /// Files of the log; empty for a source that is not a file.
    pub(crate) parts: Vec<LogPart>,
    pub(crate) topics: BTreeMap<String, Topic>,
    /// First calibration of each topic that is not blank.
    pub(crate) infos: BTreeMap<String, CameraInfo>,
    /// Metres per unit of depth, by the topics on which depth cameras publish it.
    pub(crate) depth_units: BTreeMap<String, f64>,
    /// All static transforms, and for the moving ones the frames that they connect.
    pub(crate) tf: TfBuffer,
    /// Times of the moving transforms, by the frame that moves.
    pub(crate) link_times: BTreeMap<String, Times>,
    pub(crate) counters: Counters,
    pub(crate) notes: Vec<String>,
    pub(crate) data_lost: bool,
    /// True if recording times replace all stamps.
    pub(crate) has_recording_times: bool,
}

/// One file of a log.
#[derive(Clone, Debug)]
pub(crate) struct LogPart {
    pub(crate) path: PathBuf,
    /// Channels of the file, because their IDs are unique within one file only.
    pub(crate) channels: Vec<Arc<Channel>>,
}

impl Scan {
    /// Reads the whole log once; a file is read a second time if it had messages of channels whose
    /// records came later.
    ///
    /// Chunks are unpacked here and again for the frames: stamps, frames and sizes are in the
    /// messages, while the index of a file has only recording times; a transform may come late; and
    /// damage and the hash concern every byte. The unpacked data is not kept, because a log may be
    /// larger than the memory.
    ///
    /// # Errors
    /// A file that cannot be opened or is not MCAP.
    pub(crate) fn read(
        path: &Path,
        depth_unit_m: Option<f64>,
        limits: &Limits,
    ) -> Result<Self, LogError> {
        let files = LogFiles::of(path)?;
        let first = Self::pass(path, depth_unit_m, limits, &unread(&files))?;
        let scan = if first.counters.contains_key("unknown_channel_messages") {
            Self::pass(path, depth_unit_m, limits, &first.parts)?
        } else {
            first
        };
        Ok(scan.without_parts(files.missing()))
    }

    fn pass(
        path: &Path,
        depth_unit_m: Option<f64>,
        limits: &Limits,
        parts: &[LogPart],
    ) -> Result<Self, LogError> {
        let mut gathering = Gathering::new(depth_unit_m);
        let mut scan = Self { parts: Vec::new(), ..gathering.scan("") };
        let mut hash = Sha256::new();
        for part in parts {
            let file = LogFile::open(&part.path, limits)?;
            let contents = file.path().to_owned();
            let fault = file.fault().map(str::to_owned);
            let file = Hashing::new(file, hash);
            let mut walker = LogWalker::at(&contents, file, limits)
                .map_err(|source| LogError::NotMcap { path: part.path.clone(), source })?
                .knowing(part.channels.iter().cloned());
            while let Some(message) = walker.next() {
                gathering.take(&message);
            }
            // Topics without messages are listed as well.
            for channel in walker.channels() {
                gathering.topic(&channel.topic, &channel.schema_name, &channel.encoding);
            }
            scan.add_part(part, &walker, parts.len() > 1);
            scan.add_fault(part, fault);
            let (bytes, so_far) = walker.into_reader().finish();
            (scan.bytes, hash) = (scan.bytes + bytes, so_far);
        }
        let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let Gathering { topics, infos, depth_units, mut tf, link_times, replaced, .. } = gathering;
        // The frames begin with the first transforms, and find the later ones while reading.
        for first in replaced.values() {
            tf.insert(first, true);
        }
        let path = path.to_owned();
        Ok(Self { path, sha256, topics, infos, depth_units, tf, link_times, ..scan })
    }

    /// Adds the results of reading one file.
    fn add_part<R: Read>(&mut self, part: &LogPart, walker: &LogWalker<R>, is_split: bool) {
        let channels = walker.channels().cloned().collect();
        self.parts.push(LogPart { path: part.path.clone(), channels });
        for (name, count) in walker.counters() {
            // Summed over the files, because the report describes one log.
            *self.counters.entry(name).or_default() += count;
        }
        let file = part.path.file_name().unwrap_or_default().display();
        for note in walker.notes() {
            self.notes.push(if is_split { format!("{file}: {note}") } else { note.clone() });
        }
        self.data_lost |= walker.data_lost();
    }

    /// Counts a file that cannot be unpacked to its end.
    fn add_fault(&mut self, part: &LogPart, fault: Option<String>) {
        let Some(fault) = fault else { return };
        self.data_lost = true;
        *self.counters.entry("damaged_compression").or_default() += 1;
        let file = part.path.file_name().unwrap_or_default().display();
        self.notes.push(format!("{file}: {fault}; what came before is used"));
    }

    /// Counts missing files as lost.
    fn without_parts(mut self, missing: &[String]) -> Self {
        if missing.is_empty() {
            return self;
        }
        self.data_lost = true;
        self.counters.insert("missing_files", missing.len() as u64);
        self.notes.push(format!("listed in metadata.yaml, but missing: {}", missing.join(", ")));
        self
    }

    /// Returns true for a source that is not a file, and may have more topics later.
    pub(crate) fn is_live(&self) -> bool {
        self.parts.is_empty()
    }

    /// Yields the names of all topics, in order.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.topics.keys().map(String::as_str)
    }

    /// Returns the contents with recording times in place of all stamps.
    pub(crate) fn with_recording_times(&self) -> Self {
        let mut scan = self.clone();
        scan.has_recording_times = true;
        for topic in scan.topics.values_mut() {
            topic.stamps = topic.recorded.clone();
        }
        for times in scan.link_times.values_mut() {
            *times = times.as_recorded();
        }
        scan
    }

    /// Returns the frame of the images of a topic.
    pub(crate) fn frame_of(&self, topic: &str) -> Option<&str> {
        self.topics.get(topic)?.frame_id.as_deref()
    }

    /// Returns the topics as lines of text.
    pub(crate) fn listing(&self) -> String {
        let mut lines = Vec::new();
        for (name, topic) in &self.topics {
            let pixels =
                topic.pixels.as_ref().map(|pixels| format!(", {pixels}")).unwrap_or_default();
            let messages = counted(topic.count, "message");
            lines.push(format!("  {name} ({}{pixels}; {messages})", topic.schema));
        }
        if lines.is_empty() { "  nothing".into() } else { lines.join("\n") }
    }
}

/// Returns the files of a log, before anything is known of their channels.
fn unread(files: &LogFiles) -> Vec<LogPart> {
    files.parts().iter().map(|path| LogPart { path: path.clone(), channels: Vec::new() }).collect()
}

/// Contents that are collected message by message.
#[derive(Default)]
pub(crate) struct Gathering {
    topics: BTreeMap<String, Topic>,
    infos: BTreeMap<String, CameraInfo>,
    depth_units: BTreeMap<String, f64>,
    tf: TfBuffer,
    linked: BTreeSet<(String, String)>,
    link_times: BTreeMap<String, Times>,
    /// First static transform of each frame that has several.
    replaced: BTreeMap<String, TransformStamped>,
    depth_unit_m: Option<f64>,
}

impl Gathering {
    pub(crate) fn new(depth_unit_m: Option<f64>) -> Self {
        Self { depth_unit_m, ..Self::default() }
    }

    /// Returns the contents so far of a source that is not a file.
    pub(crate) fn scan(&self, name: &str) -> Scan {
        Scan {
            path: name.into(),
            topics: self.topics.clone(),
            infos: self.infos.clone(),
            depth_units: self.depth_units.clone(),
            tf: self.tf.clone(),
            link_times: self.link_times.clone(),
            ..Scan::default()
        }
    }

    /// Returns true once an image has arrived.
    pub(crate) fn has_image(&self) -> bool {
        self.topics.values().any(|topic| topic.pixels.is_some() && topic.cloud_fault.is_none())
    }

    /// Returns a topic, and adds it if it is new.
    pub(crate) fn topic(&mut self, name: &str, schema: &str, encoding: &str) -> &mut Topic {
        self.topics.entry(name.to_owned()).or_insert_with(|| Topic {
            kind: if matches!(encoding, "cdr" | "ros1") { Type::of(schema) } else { Type::Other },
            schema: schema.to_owned(),
            encoding: encoding.to_owned(),
            first_log_time: u64::MAX,
            ..Topic::default()
        })
    }

    pub(crate) fn take(&mut self, message: &Message<'_>) {
        let channel = message.channel;
        let unit = self.depth_unit_m;
        let topic = self.topic(&channel.topic, &channel.schema_name, &channel.encoding);
        topic.count += 1;
        topic.first_log_time = topic.first_log_time.min(message.log_time);
        topic.last_log_time = topic.last_log_time.max(message.log_time);
        let done = match topic.kind {
            Type::Image => topic.take_image(&channel.topic, message.data, unit),
            Type::CompressedImage => topic.take_compressed(&channel.topic, message.data),
            Type::Video => topic.take_video(message.data),
            Type::DisparityImage => topic.take_disparity(message.data),
            Type::PointCloud => self.take_cloud(&channel.topic, message.data),
            Type::Odometry => topic.take_odometry(message.data),
            Type::Sensor => topic.take_sensor(message),
            Type::CameraInfo => self.take_info(&channel.topic, message.data),
            Type::Number => self.take_number(&channel.topic, message.data),
            Type::Tf => self.take_tf(&channel.topic, message.data, message.log_time),
            Type::Other => {
                // If the type is unknown, the definition shows what it contains.
                if topic.count == 1 {
                    topic.part = part_of(&channel.definition);
                }
                Some(())
            }
        };
        let topic = self.topic(&channel.topic, "", "");
        if topic.recorded.len() < topic.stamps.len() {
            topic.recorded.push(Stamp::from_nanos(message.log_time));
        }
        if done.is_none() {
            self.topic(&channel.topic, "", "").undecodable += 1;
        }
    }

    fn take_info(&mut self, topic: &str, data: &[u8]) -> Option<()> {
        // Only the first calibration is used, but blank ones are skipped, which a driver may
        // publish at first.
        if self.infos.get(topic).is_some_and(|known| !is_blank(known)) {
            return Some(());
        }
        let info: CameraInfo = decode(data).ok()?;
        self.topic(topic, "", "").frame_id = Some(info.header.frame_id.clone());
        self.infos.insert(topic.to_owned(), info);
        Some(())
    }

    /// Adds a cloud. The first one with enough points determines the camera, and serves as its
    /// calibration.
    fn take_cloud(&mut self, name: &str, data: &[u8]) -> Option<()> {
        let topic = self.topic(name, "", "");
        if TopicName::is_own_output(name) {
            topic.kind = Type::Other;
            return Some(());
        }
        let cloud: PointCloud2<'_> = decode(data).ok()?;
        if topic.cloud.is_none() {
            let camera = camera_of_cloud(&cloud, &Limits::default());
            topic.size = Some((cloud.width, cloud.height));
            if camera != Ok(None) {
                topic.pixels = Some("points".to_owned());
            }
            match camera {
                Ok(None) => {}
                Ok(Some(camera)) => {
                    if topic.take_camera(camera, &cloud.header.frame_id) {
                        let size = (cloud.width as usize, cloud.height as usize);
                        let info = CameraInfo::of_lens(&cloud.header, &camera.lens, size, 0.0);
                        self.infos.insert(calibration_by_points(name), info);
                    }
                }
                Err(error) => {
                    topic.cloud_fault = Some(error.to_string());
                    topic.has_points =
                        topic.has_points || points_of_cloud(&cloud, &Limits::default()).is_ok();
                }
            }
        }
        self.topic(name, "", "").take_header(cloud.header);
        Some(())
    }

    /// Adds the depth unit of a camera, which the recordings of some cameras contain.
    fn take_number(&mut self, topic: &str, data: &[u8]) -> Option<()> {
        let number: Float32Msg = decode(data).ok()?;
        let unit_m = short(number.data);
        let is_unit = topic.to_lowercase().contains("depth_unit") && DEPTH_UNITS.contains(&unit_m);
        if is_unit {
            self.depth_units.entry(topic.to_owned()).or_insert(unit_m);
        }
        Some(())
    }

    fn take_tf(&mut self, topic: &str, data: &[u8], log_time: u64) -> Option<()> {
        let message: TFMessage = decode(data).ok()?;
        let is_static = is_static(topic);
        for transform in &message.transforms {
            let link = (transform.child_frame_id.clone(), transform.header.frame_id.clone());
            if is_static {
                self.take_static(transform);
                continue;
            }
            if self.linked.insert(link) {
                // One sample of a moving transform is enough to know the link.
                self.tf.insert(transform, false);
            }
            self.take_times(transform, Stamp::from_nanos(log_time));
        }
        Some(())
    }

    /// Adds the times of a moving transform.
    fn take_times(&mut self, transform: &TransformStamped, recorded: Stamp) {
        let child = plain(&transform.child_frame_id);
        let stamp = transform.header.stamp();
        if let Some(times) = self.link_times.get_mut(child) {
            times.add(stamp, recorded);
        } else if self.tf.knows_child(child) {
            self.link_times.insert(child.to_owned(), Times::new(stamp, recorded));
        }
    }

    /// Adds a static transform, and keeps the one that it replaces if that is the first.
    fn take_static(&mut self, transform: &TransformStamped) {
        let child = &transform.child_frame_id;
        let replaced = self.tf.static_transform(child).filter(|old| {
            old.transform != transform.transform || old.header.frame_id != transform.header.frame_id
        });
        if self.tf.insert(transform, true)
            && let Some(replaced) = replaced
        {
            self.replaced.entry(child.clone()).or_insert(replaced);
        }
    }
}

/// Plausible units of depth cameras, m.
const DEPTH_UNITS: std::ops::RangeInclusive<f64> = 1e-6..=1.0;

/// Returns the number with the shortest text that gives this single-precision number: 0.001 instead
/// of 0.0010000000474974513.
fn short(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| f64::from(number))
}

/// Returns true for static transforms, which have a topic of their own.
pub(crate) fn is_static(tf_topic: &str) -> bool {
    tf_topic.ends_with("tf_static")
}

impl Topic {
    /// Returns true if all messages have the same stamp but were recorded at different times.
    pub(crate) fn has_constant_stamps(&self) -> bool {
        let [stamps_same, recorded_same] = [&self.stamps, &self.recorded]
            .map(|stamps| stamps.windows(2).all(|pair| pair[0] == pair[1]));
        self.stamps.len() > 1 && stamps_same && !recorded_same
    }

    /// Returns the offset of its images from those of a first topic, with that of its clock; `None` if
    /// either has no image.
    pub(crate) fn skew_from(&self, first: &Self, tolerance_s: f64) -> Option<Skew> {
        let skew = Skew::between(&first.stamps, &self.stamps, tolerance_s)?;
        Some(Skew { clock_s: self.clock_from(first, skew.paired == 0.0), ..skew })
    }

    /// Returns the time by which its stamps are later than those of a first topic, s, if the recording
    /// times show that the two have different clocks. `are_apart`: none of its stamps is near one of the
    /// first.
    pub(crate) fn clock_from(&self, first: &Self, are_apart: bool) -> Option<f64> {
        let of_first_s = constant_lag_s(&first.stamps, &first.recorded)?;
        let own_s = constant_lag_s(&self.stamps, &self.recorded)?;
        other_clock_s(of_first_s, own_s, are_apart)
    }

    /// Returns the reason why no message can be used, although all can be decoded.
    pub(crate) fn impossible(&self) -> Option<&str> {
        self.fault.as_deref().filter(|_| self.faulty == self.count)
    }

    /// Returns true for points that are not those of a camera.
    pub(crate) fn is_lidar(&self) -> bool {
        self.has_points && self.cloud.is_none()
    }

    /// Returns the ranges of the topic's times; `None` without a stamp.
    pub(crate) fn times(&self) -> Option<Times> {
        let mut times = Times::of(&self.stamps, &self.recorded)?;
        // Stamps are stored for a limited number of messages only.
        times.first_recorded = Stamp::from_nanos(self.first_log_time);
        times.last_recorded = Stamp::from_nanos(self.last_log_time);
        Some(times)
    }

    fn take_image(&mut self, name: &str, data: &[u8], depth_unit_m: Option<f64>) -> Option<()> {
        let image: Image<'_> = decode(data).ok()?;
        if self.pixels.is_none() {
            // A unit turns grey images into depth, but not infrared ones.
            let unit = depth_unit_m.filter(|_| TopicName::of(name).stream != Stream::Other);
            self.content = content_of_encoding(&image.encoding, unit);
            self.is_deep_grey = image.encoding == "mono16";
            if self.is_deep_grey && TopicName::of(name).stream == Stream::Depth {
                self.content = Content::Depth;
            }
            self.doubt_depth(name);
            self.size = Some((image.width, image.height));
            self.pixels = Some(image.encoding);
        }
        self.take_header(image.header);
        Some(())
    }

    fn take_compressed(&mut self, name: &str, data: &[u8]) -> Option<()> {
        let image: CompressedImage<'_> = decode(data).ok()?;
        if self.pixels.is_none() {
            let size = size_of_compressed(&image, &Limits::default());
            self.size = size.ok().map(|(width, height)| (width as u32, height as u32));
            let codec = Codec::of(&image);
            let declared = content_of_compressed(&image);
            self.is_deep_grey = codec == Codec::DeepPng && declared != Content::Depth;
            let is_named_depth = TopicName::of(name).stream == Stream::Depth;
            // Three channels may be depth that was coloured for display.
            self.is_jpeg_depth = codec.is_jpeg()
                && (declared == Content::Depth || codec == Codec::GreyJpeg && is_named_depth);
            self.content = match declared {
                _ if self.is_jpeg_depth => Content::Unknown,
                _ if self.is_deep_grey && is_named_depth => Content::Depth,
                // Not a picture, because the decoder turns it into depth.
                _ if self.is_deep_grey => Content::Unknown,
                // The format is free text, so the codec is recognised by the first bytes.
                Content::Unknown if codec != Codec::Unknown => Content::Picture,
                content => content,
            };
            self.doubt_depth(name);
            self.pixels = Some(image.format);
        }
        // Video is recognised under any format name.
        if let Some(codec) = video_codec(image.data) {
            self.kind = Type::Video;
            self.take_packet(codec, image.data);
        }
        self.take_header(image.header);
        Some(())
    }

    /// Excludes images with the encoding of depth whose name says infrared or confidence, because
    /// those also have 16 bits or floating-point numbers.
    fn doubt_depth(&mut self, name: &str) {
        if self.content == Content::Depth && TopicName::of(name).stream == Stream::Other {
            self.content = Content::Unknown;
            self.is_other_stream = true;
        }
    }

    fn take_video(&mut self, data: &[u8]) -> Option<()> {
        let packet = Packet::of(&self.schema, data).ok()?;
        let codec = video_codec(packet.data).unwrap_or(&packet.codec);
        self.take_packet(codec, packet.data);
        self.take_header(packet.header);
        Some(())
    }

    /// Adds a video packet: the first parameters give the size of the pictures.
    fn take_packet(&mut self, codec: &str, data: &[u8]) {
        if codec != H264 {
            (self.content, self.pixels) = (Content::Unknown, Some(codec.to_owned()));
            return;
        }
        self.pixels = Some(codec.to_owned());
        if self.size.is_none() {
            match size_of_video(data, &Limits::default()) {
                Ok(None) if self.video_fault.is_none() && has_lengths(data) => {
                    self.video_fault = Some(NO_PARAMETERS.to_owned());
                }
                Ok(size) => self.size = size,
                // After damaged parameters, intact ones may follow.
                Err(ImageError::Codec(_)) => {}
                Err(error) => self.video_fault = Some(error.to_string()),
            }
        }
        // Without its parameters no picture can be decoded.
        self.content = if self.size.is_some() { Content::Picture } else { Content::Unknown };
    }

    fn take_disparity(&mut self, data: &[u8]) -> Option<()> {
        let message: DisparityImage<'_> = decode(data).ok()?;
        if self.pixels.is_none() {
            let image = &message.image;
            self.content =
                if may_be_disparity(&image.encoding) { Content::Depth } else { Content::Unknown };
            self.size = Some((image.width, image.height));
            self.pixels = Some(format!("{} disparity", image.encoding));
        }
        self.take_header(message.header);
        Some(())
    }

    /// Adds the camera of a cloud; returns true if it can be used. Points with x forward are those
    /// of a camera only if the frame is nevertheless called optical, as in a simulator; otherwise
    /// the frame is not that of its images.
    fn take_camera(&mut self, camera: CloudCamera, frame: &str) -> bool {
        let is_usable = camera.axes == CloudAxes::Optical || frame.contains("optical");
        self.cloud = Some(camera);
        if is_usable {
            self.content = Content::Depth;
            self.cloud_fault = None;
        } else {
            self.cloud_fault = Some(format!(
                "its points have x ahead (frame `{frame}`), but only those of an optical frame, \
                 with z ahead, can be read: record the depth images of that camera"
            ));
        }
        is_usable
    }

    fn take_odometry(&mut self, data: &[u8]) -> Option<()> {
        let odometry: Odometry = decode(data).ok()?;
        self.child_frame_id.get_or_insert(odometry.child_frame_id);
        self.take_header(odometry.header);
        Some(())
    }

    fn take_sensor(&mut self, message: &Message<'_>) -> Option<()> {
        let sensor = SensorType::of_message(&self.schema)?;
        let header = (sensor.header)(message).ok()?;
        if let Some(fault) = (sensor.fault)(message.data) {
            self.faulty += 1;
            self.fault.get_or_insert(fault);
        }
        header.into_iter().for_each(|header| self.take_header(header));
        Some(())
    }

    fn take_header(&mut self, header: Header) {
        if self.stamps.len() < MAX_STAMPS {
            self.stamps.push(header.stamp());
        }
        self.frame_id.get_or_insert(header.frame_id);
    }
}

/// Returns the name of the calibration that is derived from the points of a cloud.
pub(crate) fn calibration_by_points(topic: &str) -> String {
    format!("{topic} (by its points)")
}
