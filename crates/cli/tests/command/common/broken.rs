//! Logs broken on purpose: every message of a good one passes through a change.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions, Writer};
use tagalong_core::Stamp;
use tagalong_log::msgs::{CameraInfo, CompressedImage, Header, Image, TFMessage, decode, encode};

use super::{code, tagalong, text};

/// A depth reading by column and row, from the readings of the log and their width.
pub type Readings = Box<dyn Fn(&[u16], usize, i64, i64) -> u16>;

/// Changes to a log; `None` leaves the messages as they are.
#[derive(Default)]
pub struct Changes {
    /// Depth readings.
    pub depth: Option<Readings>,
    /// Colour images are replaced by JPEG images of this grey level.
    pub grey_level: Option<u8>,
    /// Every calibration.
    pub info: Option<fn(&mut CameraInfo)>,
    /// Every set of transforms.
    pub tf: Option<fn(&mut TFMessage)>,
    /// Stamps of depth images, ns, by their number.
    pub depth_stamp: Option<fn(u64, u64) -> u64>,
    /// Stamps of all images, ns.
    pub stamp: Option<fn(u64) -> u64>,
    /// Topics that are left out, by a part of their name.
    pub without: &'static [&'static str],
    /// Topic that keeps only some of its images, and the interval.
    pub thinned: Option<(&'static str, u64)>,
    /// Seconds of the log that are kept, from its first message on.
    pub first_s: Option<f64>,
}

/// Simulates a scene in a folder, and returns the log `scene.mcap` there, with the changes.
pub fn simulated(home: &Path, scene: &str, changes: &Changes) -> PathBuf {
    let [text_path, whole, log] =
        ["scene.toml", "whole.mcap", "scene.mcap"].map(|name| home.join(name));
    fs::write(&text_path, scene).unwrap();
    let drawn = tagalong()
        .arg("simulate")
        .arg(&text_path)
        .arg("-o")
        .arg(&whole)
        .arg("--overwrite")
        .output();
    let drawn = drawn.unwrap();
    assert_eq!(code(&drawn), 0, "{}", text(&drawn.stderr));
    write(&whole, &log, changes);
    log
}

/// Writes the log `from` with the changes to `to`.
pub fn write(from: &Path, to: &Path, changes: &Changes) {
    let bytes = fs::read(from).unwrap();
    let file = BufWriter::new(File::create(to).unwrap());
    let mut writer = WriteOptions::new().profile("ros2").create(file).unwrap();
    let mut channels = BTreeMap::new();
    let mut counts = BTreeMap::new();
    let mut end_ns = None;
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let length_ns = changes.first_s.map_or(u64::MAX, |seconds| (1e9 * seconds) as u64);
        if message.log_time > *end_ns.get_or_insert(message.log_time.saturating_add(length_ns)) {
            continue;
        }
        let topic = message.channel.topic.clone();
        let count = counts.entry(topic.clone()).or_insert(0u64);
        *count += 1;
        let thinned =
            changes.thinned.is_some_and(|(part, n)| topic.contains(part) && *count % n != 0);
        if thinned || changes.without.iter().any(|part| topic.contains(part)) {
            continue;
        }
        let channel_id = *channels.entry(topic.clone()).or_insert_with(|| {
            let schema = message.channel.schema.as_ref().unwrap();
            let id = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            writer.add_channel(id, &topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let schema = message.channel.schema.as_ref().unwrap().name.clone();
        let data = changes.apply(&schema, *count, &message.data);
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time: message.log_time,
            publish_time: message.publish_time,
        };
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    finish(writer);
}

fn finish(mut writer: Writer<BufWriter<File>>) {
    writer.finish().unwrap();
}

impl Changes {
    fn apply(&self, schema: &str, number: u64, data: &[u8]) -> Vec<u8> {
        match schema {
            "sensor_msgs/msg/Image" => self.image(number, decode(data).unwrap()),
            "sensor_msgs/msg/CompressedImage" => self.compressed(decode(data).unwrap()),
            "sensor_msgs/msg/CameraInfo" => edited(data, self.info),
            "tf2_msgs/msg/TFMessage" => edited(data, self.tf),
            _ => data.to_vec(),
        }
    }

    fn image(&self, number: u64, image: Image<'_>) -> Vec<u8> {
        let mut header = self.restamped(&image.header);
        if let Some(change) = self.depth_stamp {
            header = at(&header, change(number, header.stamp().nanos()));
        }
        let Some(change) = &self.depth else { return encode(&Image { header, ..image }) };
        let readings: Vec<u16> =
            image.data.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        let width = i64::from(image.width);
        let height = i64::from(image.height);
        let changed = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let data: Vec<u8> = changed
            .flat_map(|(x, y)| change(&readings, width as usize, x, y).to_le_bytes())
            .collect();
        encode(&Image { header, data: &data, ..image })
    }

    fn compressed(&self, image: CompressedImage<'_>) -> Vec<u8> {
        let header = self.restamped(&image.header);
        let Some(level) = self.grey_level else {
            return encode(&CompressedImage { header, ..image });
        };
        let picture = image::load_from_memory(image.data).unwrap();
        let flat =
            image::GrayImage::from_pixel(picture.width(), picture.height(), image::Luma([level]));
        let mut data = Vec::new();
        let format = image::ImageFormat::Jpeg;
        flat.write_to(&mut std::io::Cursor::new(&mut data), format).unwrap();
        encode(&CompressedImage { header, data: &data, ..image })
    }

    fn restamped(&self, header: &Header) -> Header {
        self.stamp
            .map_or_else(|| header.clone(), |change| at(header, change(header.stamp().nanos())))
    }
}

fn at(header: &Header, nanos: u64) -> Header {
    Header::new(Stamp::from_nanos(nanos), header.frame_id.as_str())
}

fn edited<T>(data: &[u8], change: Option<fn(&mut T)>) -> Vec<u8>
where
    T: for<'de> serde::Deserialize<'de> + serde::Serialize,
{
    let mut message: T = decode(data).unwrap();
    change.iter().for_each(|change| change(&mut message));
    encode(&message)
}

/// The reading at a place, 0 outside.
pub fn reading(readings: &[u16], width: usize, x: i64, y: i64) -> u16 {
    let inside = x >= 0 && y >= 0 && x < width as i64;
    let at = (y.max(0) as usize) * width + x.max(0) as usize;
    if inside { readings.get(at).copied().unwrap_or(0) } else { 0 }
}
