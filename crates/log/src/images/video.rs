//! Video in image messages, recognised by its bytes: some drivers publish it as
//! `sensor_msgs/CompressedImage` with any format, even with `jpeg` or none.

use std::borrow::Cow;

use crate::msgs::{CdrError, CompressedImage, CompressedVideo, FfmpegPacket, Header, decode};

/// Name of the codec that is decoded.
pub(crate) const H264: &str = "h264";

/// Video packet, whatever message it came in.
pub(crate) struct Packet<'a> {
    /// Time of the picture, and frame of the camera.
    pub(crate) header: Header,
    /// Codec as the message names it.
    pub(crate) codec: String,
    /// Bytes of the packet.
    pub(crate) data: &'a [u8],
}

impl<'a> Packet<'a> {
    /// Reads a message of a type that carries packets.
    pub(crate) fn of(schema: &str, message: &'a [u8]) -> Result<Self, CdrError> {
        match schema.rsplit('/').next() {
            Some("CompressedVideo") => {
                let video: CompressedVideo<'a> = decode(message)?;
                let header = Header { stamp: video.timestamp, frame_id: video.frame_id };
                Ok(Self { header, codec: video.format, data: video.data })
            }
            Some("FFMPEGPacket") => {
                let packet: FfmpegPacket<'a> = decode(message)?;
                Ok(Self { header: packet.header, codec: packet.encoding, data: packet.data })
            }
            _ => {
                let image: CompressedImage<'a> = decode(message)?;
                Ok(Self { header: image.header, codec: image.format, data: image.data })
            }
        }
    }
}

/// Start code that precedes each unit of a packet (ITU-T H.264 and H.265, annex B).
const START_CODE: [u8; 4] = [0, 0, 0, 1];

/// Reason why packets with lengths alone give no picture, with the remedy.
pub(crate) const NO_PARAMETERS: &str = "its packets have lengths in place of start codes (AVCC), and the parameters of the stream are not \
     among them: let the encoder write start codes (annex B), and parameters before each key picture";

/// Returns the units of a packet that has their lengths in place of start codes, as in MP4 files
/// (ISO/IEC 14496-15); `None` unless the lengths add up to the whole packet.
fn units_by_length(packet: &[u8]) -> Option<Vec<&[u8]>> {
    let mut units = Vec::new();
    let mut rest = packet;
    while let Some((length, behind)) = rest.split_first_chunk::<4>() {
        let length = usize::try_from(u32::from_be_bytes(*length)).ok()?;
        // A length of one would be a start code.
        if length < 2 {
            return None;
        }
        let (unit, behind) = behind.split_at_checked(length)?;
        units.push(unit);
        rest = behind;
    }
    (rest.is_empty() && !units.is_empty()).then_some(units)
}

/// Returns true for a packet that has lengths in place of start codes.
pub(crate) fn has_lengths(packet: &[u8]) -> bool {
    units_by_length(packet).is_some()
}

/// Returns a packet with start codes in place of lengths.
pub(crate) fn with_start_codes(packet: &[u8]) -> Cow<'_, [u8]> {
    let Some(units) = units_by_length(packet) else { return Cow::Borrowed(packet) };
    let mut bytes = Vec::with_capacity(packet.len());
    for unit in units {
        bytes.extend_from_slice(&START_CODE);
        bytes.extend_from_slice(unit);
    }
    Cow::Owned(bytes)
}

/// Returns the codec of a video packet; `None` for everything else.
///
/// Packets of H.264 and H.265 begin with a start code, or with the length of a unit, and then with
/// a unit that starts a picture.
pub(crate) fn video_codec(data: &[u8]) -> Option<&'static str> {
    let data = &*with_start_codes(data);
    let unit = data.strip_prefix(&START_CODE).or_else(|| data.strip_prefix(&[0, 0, 1]))?;
    let &[first, second, ..] = unit else { return None };
    // The type of a unit shows whether others refer to it.
    let is_reference = first & 0x60 != 0;
    let is_h264 = match first & 0x1f {
        // A picture.
        1 => true,
        // A key frame, and parameters.
        5 | 7 | 8 => is_reference,
        // Supplemental information, and a delimiter.
        6 | 9 => !is_reference,
        _ => false,
    };
    // Layer 0 and temporal layer 0: pictures, key frames, parameters, delimiters, supplemental
    // information.
    let is_h265 =
        first & 1 == 0 && second == 1 && matches!(first >> 1, 1..=9 | 16..=21 | 32..=35 | 39);
    // The highest bit is always 0.
    match (is_h264, is_h265) {
        _ if first & 0x80 != 0 => None,
        (true, _) => Some(H264),
        (false, true) => Some("h265"),
        (false, false) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_of_video_are_told_by_their_first_unit() {
        for (data, codec) in [
            // Sequence parameters, a delimiter, a key picture and one between.
            (&[0, 0, 0, 1, 0x67, 0x42, 0x00][..], Some("h264")),
            (&[0, 0, 0, 1, 0x09, 0xf0], Some("h264")),
            (&[0, 0, 1, 0x65, 0x88], Some("h264")),
            (&[0, 0, 0, 1, 0x41, 0x9a], Some("h264")),
            // Video parameters, sequence parameters, a delimiter, a key picture.
            (&[0, 0, 0, 1, 0x40, 0x01, 0x0c], Some("h265")),
            (&[0, 0, 0, 1, 0x42, 0x01], Some("h265")),
            (&[0, 0, 0, 1, 0x46, 0x01], Some("h265")),
            (&[0, 0, 1, 0x26, 0x01], Some("h265")),
            (&[0, 0, 1, 0x02, 0x01], Some("h265")),
            // Lengths: a delimiter and a key picture, and video parameters.
            (&[0, 0, 0, 2, 0x09, 0xf0, 0, 0, 0, 3, 0x65, 0x88, 0x80], Some("h264")),
            (&[0, 0, 0, 3, 0x40, 0x01, 0x0c], Some("h265")),
            (&[0, 0, 0, 2, 0x09, 0xf0, 0], None),
            (&[0, 0, 0, 4, 0x09, 0xf0], None),
            (&[0xff, 0xd8, 0xff, 0xe0], None),
            (&[0, 0, 0, 1], None),
            (&[0, 0, 0, 1, 0xe7, 1], None),
            (&[0, 0, 0, 0], None),
            (&[], None),
        ] {
            assert_eq!(video_codec(data), codec, "{data:02x?}");
        }
    }

    #[test]
    fn lengths_become_start_codes_where_they_add_up() {
        let whole = [0, 0, 0, 2, 0x09, 0xf0, 0, 0, 0, 3, 0x65, 0x88, 0x80];
        let codes = [0, 0, 0, 1, 0x09, 0xf0, 0, 0, 0, 1, 0x65, 0x88, 0x80];
        assert_eq!(*with_start_codes(&whole), codes);
        assert_eq!(*with_start_codes(&codes), codes);
        assert_eq!(*with_start_codes(&whole[..12]), whole[..12]);
        assert!(has_lengths(&whole) && !has_lengths(&codes) && !has_lengths(&[]));
        // Three bytes of a start code may be those of a length.
        let long = [&[0, 0, 1, 0x02, 0x65][..], &[0x88; 0x101]].concat();
        assert_eq!(with_start_codes(&long)[..5], [0, 0, 0, 1, 0x65]);
    }
}
