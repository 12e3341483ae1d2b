//! Analysis of topic names: the device, its stream, and the side of a stereo pair.

use std::collections::BTreeSet;

/// Stream of a device, as far as the topic name shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stream {
    /// The name does not show it.
    Plain,
    /// Colour or grey images.
    Colour,
    /// Depth or disparities.
    Depth,
    /// Infrared, confidences and the like.
    Other,
}

/// Side of a stereo pair that a name shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Side {
    /// None.
    Neither,
    /// The left camera, or the first infrared one.
    Left,
    /// The right camera, or the second infrared one.
    Right,
}

/// Parts of the name of a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TopicName {
    /// Words for the device: those that are not for streams, sides or codecs.
    pub(crate) device: Vec<String>,
    pub(crate) stream: Stream,
    pub(crate) side: Side,
}

/// Words that contain no information about the device.
const GENERIC: &[&str] = &[
    "image",
    "images",
    "raw",
    "rect",
    "rectified",
    "compressed",
    "compresseddepth",
    "theora",
    "ffmpeg",
    "h264",
    "zstd",
    "data",
    "info",
    "camera",
    "cam",
    "cameras",
    "sensor",
    "sensors",
    "stream",
    "streams",
    "aligned",
    "registered",
    "stereo",
    "hd",
    "qhd",
    "sd",
    "node",
    "video",
    "throttle",
    "throttled",
    "republished",
    "decoded",
    "resized",
    "optical",
    "calibration",
];
const COLOUR: &[&str] = &["color", "colour", "rgb", "bgr", "gray", "grey", "mono"];
const DEPTH: &[&str] = &["depth", "disparity", "disp"];
const OTHER: &[&str] = &[
    "ir",
    "infra",
    "infrared",
    "amplitude",
    "intensity",
    "confidence",
    "reflectivity",
    "fisheye",
    "points",
];

/// Words for the position of a device; two different ones mean two devices.
const PLACES: &[&str] =
    &["front", "rear", "back", "left", "right", "side", "top", "bottom", "up", "down", "head"];

impl TopicName {
    /// Splits a topic name into its parts.
    pub(crate) fn of(topic: &str) -> Self {
        let mut parts = Self { device: Vec::new(), stream: Stream::Plain, side: Side::Neither };
        let mut follows_stream = false;
        let lower = parted(topic);
        let mut words =
            lower.split(['/', '_', '-', '.']).filter(|word| !word.is_empty()).peekable();
        while let Some(word) = words.next() {
            // The stream after "to" is the one to which depth is aligned, not that of the images.
            if word == "to" && words.peek().is_some_and(|next| stream_of(next).is_some()) {
                words.next();
                continue;
            }
            follows_stream = parts.take(word, follows_stream);
        }
        parts
    }

    /// Returns true for the points of a person that a run writes into its own track log for
    /// viewers.
    pub(crate) fn is_own_output(topic: &str) -> bool {
        topic.strip_prefix("/people/person_").is_some_and(|rest| rest.ends_with("/body"))
    }

    /// Adds a word; returns true if a number after it counts streams and not devices.
    fn take(&mut self, word: &str, follows_stream: bool) -> bool {
        let stem = word.trim_end_matches(|c: char| c.is_ascii_digit());
        let number = &word[stem.len()..];
        if stem.is_empty() {
            // `Depth_0` and `sensor_1` in a recording, unlike `camera_1`.
            if !follows_stream {
                self.push(number);
            }
            return false;
        }
        if let Some(stream) = stream_of(stem) {
            self.stream = stream;
            if stream == Stream::Other {
                self.side = match number {
                    "1" => Side::Left,
                    "2" => Side::Right,
                    _ => self.side,
                };
            }
            return true;
        }
        match stem {
            "left" => self.side = Side::Left,
            "right" => self.side = Side::Right,
            _ if GENERIC.contains(&stem) => {
                let counts_devices = matches!(stem, "camera" | "cam" | "stereo");
                if counts_devices && !number.is_empty() {
                    self.push(number);
                }
                return !counts_devices;
            }
            _ => self.push(word),
        }
        false
    }

    fn push(&mut self, word: &str) {
        // A node often repeats the name of its namespace.
        if self.device.last().is_none_or(|last| last != word) {
            self.device.push(word.to_owned());
        }
    }

    /// Returns true if two names mean devices at different positions, or with different numbers.
    pub(crate) fn contradicts(&self, other: &Self) -> bool {
        let ours = self.places();
        let theirs = other.places();
        !ours.is_empty() && !theirs.is_empty() && ours != theirs
    }

    fn places(&self) -> BTreeSet<&str> {
        let words = self.device.iter().map(String::as_str);
        let places = words.filter(|word| {
            PLACES.iter().any(|place| word.contains(place))
                || word.chars().all(|c| c.is_ascii_digit())
        });
        places.collect()
    }
}

/// Returns a name in lower case, with `leftImage` split into two words.
fn parted(topic: &str) -> String {
    let mut out = String::with_capacity(topic.len() + 8);
    let mut was_lower = false;
    for c in topic.chars() {
        if c.is_ascii_uppercase() && was_lower {
            out.push('_');
        }
        was_lower = c.is_ascii_lowercase();
        out.extend(c.to_lowercase());
    }
    out
}

fn stream_of(word: &str) -> Option<Stream> {
    let stem = word.trim_end_matches(|c: char| c.is_ascii_digit());
    if COLOUR.contains(&stem) {
        Some(Stream::Colour)
    } else if DEPTH.contains(&stem) {
        Some(Stream::Depth)
    } else if OTHER.contains(&stem) {
        Some(Stream::Other)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(topic: &str) -> (String, Stream, Side) {
        let name = TopicName::of(topic);
        (name.device.join(" "), name.stream, name.side)
    }

    #[test]
    fn the_streams_of_one_device_have_the_same_words() {
        use Side::{Left, Neither, Right};
        use Stream::{Colour, Depth, Other, Plain};
        for (topic, device, stream, side) in [
            ("/front_camera/color/image_raw/compressed", "front", Colour, Neither),
            ("/front_camera/aligned_depth_to_color/image_raw", "front", Depth, Neither),
            ("/camera/camera/color/image_raw", "", Colour, Neither),
            ("/device_0/sensor_0/Depth_0/image/data", "device 0", Depth, Neither),
            ("/device_0/sensor_1/Color_0/image/data", "device 0", Colour, Neither),
            ("/camera_1/rgb/image_raw", "1", Colour, Neither),
            ("/cam1/depth/image_raw", "1", Depth, Neither),
            ("/zed/zed_node/depth/depth_registered", "zed", Depth, Neither),
            ("/zed/zed_node/rgb/image_rect_color", "zed", Colour, Neither),
            ("/kinect2/sd/image_depth_rect", "kinect2", Depth, Neither),
            ("/kinect2/qhd/image_color_rect", "kinect2", Colour, Neither),
            ("/rgb_to_depth/image_raw", "", Colour, Neither),
            ("/camera/infra2/image_rect_raw", "", Other, Right),
            ("/stereo/left/image_raw", "", Plain, Left),
            ("/kitti/camera_color_right/image_raw", "kitti", Colour, Right),
            ("/leftCamera/image", "", Plain, Left),
            ("/depth/front", "front", Depth, Neither),
            ("/color/front", "front", Colour, Neither),
        ] {
            assert_eq!(parts(topic), (device.to_owned(), stream, side), "{topic}");
        }
    }

    #[test]
    fn names_of_other_places_and_numbers_contradict() {
        for (a, b, contradict) in [
            ("/front_camera/color/image", "/back_camera/depth/image", true),
            ("/cam0/image_raw", "/cam1/depth", true),
            ("/usb_cam/image_raw", "/camera/depth/image", false),
            ("/front/color/image", "/front/depth/image", false),
        ] {
            assert_eq!(TopicName::of(a).contradicts(&TopicName::of(b)), contradict, "{a} {b}");
        }
    }
}
