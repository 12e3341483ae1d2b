//! Treatment of the messages of a topic.

use tagalong_log::images::{Content, content_of_encoding, content_of_format};
use tagalong_log::msgs::{CompressedImage, Image, PointCloud2, decode};
use tagalong_log::{LogFacts, Message};

/// Width of the box of an upper body, m.
const BOX_WIDTH_M: f64 = 0.57;

/// Treatment of a message.
pub(super) enum Treatment {
    /// It shows no face, or depth alone.
    Copy,
    /// Its heads are blurred; those of a right image are up to this many widths of their boxes farther
    /// to the left.
    Blur { aside: f64 },
    /// It may show faces, and the run did not look for people in it.
    LeaveOut(&'static str),
}

/// Names of messages with images of any kind.
const PICTURES: [&str; 7] = [
    "Image",
    "RawImage",
    "CompressedImage",
    "CompressedVideo",
    "FFMPEGPacket",
    "H264Packet",
    "Thumbnail",
];

/// Reason for images that the run did not use.
const NOT_SEARCHED: &str = "the run did not look for people in them";
/// Reason for points with colours.
const COLOURED: &str = "their colours may show faces";

/// Returns the treatment of a message.
pub(super) fn treatment(facts: &LogFacts, message: &Message<'_>) -> Treatment {
    let channel = message.channel;
    let name = channel.schema_name.rsplit(['/', '.']).next().unwrap_or_default();
    if name == "PointCloud2" {
        return match decode::<PointCloud2<'_>>(message.data) {
            Ok(cloud) if !has_colour(&cloud) => Treatment::Copy,
            _ => Treatment::LeaveOut(COLOURED),
        };
    }
    if !PICTURES.contains(&name) || is_depth(name, message.data) {
        return Treatment::Copy;
    }
    if facts.colour_topic.as_ref() == Some(&channel.topic) {
        return Treatment::Blur { aside: 0.0 };
    }
    match facts.baseline_m.filter(|_| facts.right_topic.as_ref() == Some(&channel.topic)) {
        Some(baseline_m) => Treatment::Blur { aside: baseline_m / BOX_WIDTH_M },
        None => Treatment::LeaveOut(NOT_SEARCHED),
    }
}

fn has_colour(cloud: &PointCloud2<'_>) -> bool {
    cloud.fields.iter().any(|field| ["rgb", "rgba", "intensity"].contains(&&*field.name))
}

/// Returns true for depth, in which no face is recognised.
fn is_depth(name: &str, data: &[u8]) -> bool {
    let content = match name {
        "Image" => {
            decode::<Image<'_>>(data).map(|image| content_of_encoding(&image.encoding, None))
        }
        "CompressedImage" => {
            decode::<CompressedImage<'_>>(data).map(|image| content_of_format(&image.format))
        }
        _ => return false,
    };
    content.is_ok_and(|content| content == Content::Depth)
}
