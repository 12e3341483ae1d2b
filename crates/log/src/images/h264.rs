//! Video in H.264 (ITU-T H.264, annex B), packet by packet: each contains one picture, which may
//! refer to earlier ones.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rust_h264::decoder::{Decoder, Frame};
use rust_h264::nal::{NalUnit, NalUnitType, parse_annex_b};
use rust_h264::sps::{Sps, parse_sps};
use tagalong_core::Stamp;

use super::video::with_start_codes;
use super::{ImageError, check_size};
use crate::Limits;
use crate::msgs::{Header, Image, encode};

/// Maximum distance in display order between a B-frame and the picture that was shown last: sixteen
/// pictures, each of which may count as two fields. A larger distance means that the count was
/// restarted.
const MOST_BACK: i32 = 32;

/// Outcome of a packet.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Picture {
    /// An `nv12` image as the bytes of a `sensor_msgs/Image`.
    Whole(Vec<u8>),
    /// The packet refers to missing pictures: there are none until the next key frame.
    Waits,
    /// The picture belongs before one with an earlier stamp, because the stamps are those of the
    /// packets.
    OutOfOrder,
    /// The packet contains only parameters and no picture.
    Parameters,
}

/// Decoder of one topic, to which all of its packets are passed in order.
pub(crate) struct VideoDecoder {
    decoder: Decoder,
    limits: Limits,
    sps: Option<Sps>,
    /// True after a key frame, as long as no packet is missing.
    is_whole: bool,
    /// Frame number of the last reference picture.
    last: u32,
    /// Display order and stamp of the last picture that was shown since the key frame.
    shown: Option<(i32, Stamp)>,
}

impl VideoDecoder {
    pub(crate) fn new(limits: &Limits) -> Self {
        let limits = limits.clone();
        Self { decoder: Decoder::new(), limits, sps: None, is_whole: false, last: 0, shown: None }
    }

    /// Decodes a packet into an image with this header.
    ///
    /// # Errors
    /// [`ImageError`]: a damaged packet, a size beyond the limits, or a pixel format other than 8
    /// bits with 4:2:0 chroma. No picture follows until the next key frame.
    pub(crate) fn decode(&mut self, packet: &[u8], header: Header) -> Result<Picture, ImageError> {
        let packet = &*with_start_codes(packet);
        // The decoder is a young one, and a log may contain any bytes, so a panic counts as a
        // damaged packet.
        match catch_unwind(AssertUnwindSafe(|| self.take(packet))) {
            Ok(Ok(Some(frame))) if self.is_out_of_order(&frame, header.stamp()) => {
                Ok(Picture::OutOfOrder)
            }
            Ok(Ok(Some(frame))) => self.image_of(&frame, header).map(Picture::Whole),
            Ok(Ok(None)) if self.is_whole || !has_picture(packet) => Ok(Picture::Parameters),
            Ok(Ok(None)) => Ok(Picture::Waits),
            Ok(Err(error)) => {
                self.is_whole = false;
                Err(error)
            }
            Err(_) => {
                *self = Self::new(&self.limits);
                Err(damaged("the decoder failed"))
            }
        }
    }

    fn take(&mut self, packet: &[u8]) -> Result<Option<Frame>, ImageError> {
        // The decoder would make a picture of the rest.
        if !is_at_unit(packet) {
            return Err(damaged("its start is missing: it begins within a unit"));
        }
        let units = parse_annex_b(packet);
        if lacks_first_block(&units) {
            return Err(damaged("the first part of its picture is missing"));
        }
        let begins = !self.is_whole;
        let mut outcome = Ok(());
        for unit in &units {
            outcome = outcome.and_then(|()| self.take_unit(unit));
        }
        // The rest of a damaged picture must not become part of the next one.
        let picture = self.decoder.flush();
        outcome?;
        if let Some(frame) = &picture
            && begins
            && is_cut_short(packet, frame)
        {
            return Err(damaged("its end is missing"));
        }
        Ok(picture)
    }

    fn take_unit(&mut self, unit: &NalUnit<'_>) -> Result<(), ImageError> {
        match unit.nal_unit_type {
            NalUnitType::Sps => self.sps = Some(checked(unit, &self.limits)?),
            NalUnitType::SliceIdr => {
                self.is_whole = true;
                self.last = 0;
                self.shown = None;
            }
            NalUnitType::Slice => self.is_whole = self.follows_on(unit)?,
            _ => {}
        }
        if is_picture(unit) && !self.is_whole {
            return Ok(());
        }
        self.decoder.decode_nal(unit).map(|_| ()).map_err(damaged)
    }

    /// Returns true if a picture is displayed before the last one but has a later stamp, as happens
    /// if packets with B-frames are stamped when they are published.
    fn is_out_of_order(&mut self, frame: &Frame, stamp: Stamp) -> bool {
        let place = frame.pic_order_cnt;
        let is_out = self.shown.is_some_and(|(shown, last)| {
            (1..=MOST_BACK).contains(&shown.saturating_sub(place)) && stamp > last
        });
        if !is_out {
            self.shown = Some((place, stamp));
        }
        is_out
    }

    /// Returns the bytes of a `sensor_msgs/Image` with the pixels of a picture.
    fn image_of(&self, frame: &Frame, header: Header) -> Result<Vec<u8>, ImageError> {
        let size = self.sps.as_ref().map(|sps| (sps.width(), sps.height()));
        if size != Some((frame.width, frame.height)) {
            let why = "video in half pictures (interlaced): record it as progressive";
            return Err(ImageError::Layout(why.to_owned()));
        }
        let mut pixels = Vec::with_capacity(frame.y.len() + 2 * frame.u.len());
        pixels.extend_from_slice(&frame.y);
        for (u, v) in frame.u.iter().zip(&frame.v) {
            pixels.extend([*u, *v]);
        }
        let image = Image::packed(header, "nv12", frame.width, frame.height, &pixels);
        // The rows of colour pairs count as rows of bytes, and not as rows of the image.
        Ok(encode(&Image { step: frame.width, ..image }))
    }

    /// Returns true if a picture follows the last one: the frame numbers of reference pictures
    /// count up, and a gap means that a packet was lost.
    fn follows_on(&mut self, unit: &NalUnit<'_>) -> Result<bool, ImageError> {
        let Some(sps) = &self.sps else { return Ok(false) };
        let bits = sps.log2_max_frame_num_minus4 + 4;
        let number =
            picture_number(&unit.rbsp, bits).ok_or_else(|| damaged("its end is missing"))?;
        let next = (self.last + 1) % (1 << bits.min(16));
        let follows = number == self.last || number == next;
        if unit.nal_ref_idc != 0 {
            self.last = number;
        }
        Ok(self.is_whole && follows)
    }
}

/// Returns columns and rows of the pictures of a packet with a sequence parameter set; `None` without
/// one.
///
/// # Errors
/// [`ImageError`]: damaged parameters, a size beyond the limits, or a pixel format that is not
/// decoded.
pub(crate) fn size_of_video(
    packet: &[u8],
    limits: &Limits,
) -> Result<Option<(u32, u32)>, ImageError> {
    let packet = with_start_codes(packet);
    let units = parse_annex_b(&packet);
    let Some(unit) = units.iter().find(|unit| unit.nal_unit_type == NalUnitType::Sps) else {
        return Ok(None);
    };
    let sps = checked(unit, limits)?;
    Ok(Some((sps.width(), sps.height())))
}

/// Reads a sequence parameter set, and checks that its pictures are within the limits and have 8
/// bits with 4:2:0 chroma.
fn checked(unit: &NalUnit<'_>, limits: &Limits) -> Result<Sps, ImageError> {
    let sps = parse_sps(&unit.rbsp).map_err(damaged)?;
    let deepest = sps.bit_depth_luma_minus8.max(sps.bit_depth_chroma_minus8);
    let colours = match sps.chroma_format_idc {
        0 => "4:0:0",
        1 => "4:2:0",
        2 => "4:2:2",
        _ => "4:4:4",
    };
    if deepest > 0 || sps.chroma_format_idc != 1 {
        return Err(ImageError::Layout(format!(
            "video with {} bits and colours as {colours}: record it with 8 bits and 4:2:0 (yuv420p)",
            8 + deepest
        )));
    }
    // The size before cropping, because the decoder allocates memory for all of it.
    let width = 16 * (u64::from(sps.pic_width_in_mbs_minus1) + 1);
    let height = 16 * (u64::from(sps.pic_height_in_map_units_minus1) + 1);
    let fields = if sps.frame_mbs_only_flag { 1 } else { 2 };
    check_size(width, fields * height, 3, limits)?;
    Ok(sps)
}

/// Returns true for a packet that begins with the start code of a unit, and for an empty one.
fn is_at_unit(packet: &[u8]) -> bool {
    let zeros = packet.iter().take_while(|byte| **byte == 0).count();
    packet.is_empty() || zeros >= 2 && packet.get(zeros) == Some(&1)
}

/// Returns true if the units have a picture whose first macroblock is missing.
fn lacks_first_block(units: &[NalUnit<'_>]) -> bool {
    let Some(picture) = units.iter().find(|unit| is_picture(unit)) else { return false };
    Bits { bytes: &picture.rbsp, at: 0 }.exponential() != Some(0)
}

/// Bytes that are appended to a packet; neither zeros, which the decoder reads there by itself, nor
/// a start code.
const BEHIND: [u8; 64] = [0x5a; 64];

/// Returns true if a packet with parameters and a key frame lacks its end: the picture then changes
/// if other bytes follow it.
fn is_cut_short(packet: &[u8], seen: &Frame) -> bool {
    let longer = [packet, &BEHIND].concat();
    let units = parse_annex_b(&longer);
    for needed in [NalUnitType::Sps, NalUnitType::Pps, NalUnitType::SliceIdr] {
        if !units.iter().any(|unit| unit.nal_unit_type == needed) {
            return false;
        }
    }
    let mut decoder = Decoder::new();
    for unit in &units {
        // As for the picture before, an error shows in its pixels.
        let _ = decoder.decode_nal(unit);
    }
    let other = decoder.flush();
    other.is_none_or(|other| (&other.y, &other.u, &other.v) != (&seen.y, &seen.u, &seen.v))
}

fn is_picture(unit: &NalUnit<'_>) -> bool {
    matches!(unit.nal_unit_type, NalUnitType::Slice | NalUnitType::SliceIdr)
}

fn has_picture(packet: &[u8]) -> bool {
    parse_annex_b(packet).iter().any(is_picture)
}

fn damaged(why: impl std::fmt::Debug) -> ImageError {
    ImageError::Codec(format!("a packet of H.264: {why:?}"))
}

/// Returns the frame number of a picture, which is `bits` long, from its slice header (7.3.3).
fn picture_number(rbsp: &[u8], bits: u32) -> Option<u32> {
    let mut reader = Bits { bytes: rbsp, at: 0 };
    // It is preceded by the first macroblock, the slice type and the picture parameter set.
    for _ in 0..3 {
        reader.exponential()?;
    }
    reader.number(bits)
}

/// Reader of single bits.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Bits<'_> {
    fn bit(&mut self) -> Option<u32> {
        let byte = self.bytes.get(self.at / 8)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(bit.into())
    }

    fn number(&mut self, bits: u32) -> Option<u32> {
        let mut value = 0;
        for _ in 0..bits.min(16) {
            value = 2 * value + self.bit()?;
        }
        Some(value)
    }

    /// Reads an exponential-Golomb code: after the first one bit there are as many bits as zeros
    /// before it.
    fn exponential(&mut self) -> Option<u64> {
        let mut zeros = 0;
        while self.bit()? == 0 {
            zeros += 1;
        }
        let mut value: u64 = 1;
        for _ in 0..zeros {
            value = value.checked_mul(2)? + u64::from(self.bit()?);
        }
        Some(value - 1)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::msgs::decode;

    /// Twelve pictures of 160 x 120 pixels, of which each sixth is a key picture.
    const WALK: &[u8] = include_bytes!("../../tests/data/walk.h264");
    /// Checksums of their pixels as `nv12`, as ffmpeg decodes them.
    const PICTURES: [u32; 12] = [
        0x4155_231e,
        0x0b92_bc02,
        0xa376_841a,
        0x2104_0b0d,
        0x6e94_5844,
        0xff42_b01d,
        0xa74c_b1a8,
        0xe6e7_b7bc,
        0xf58e_dae9,
        0xe4fb_b6b1,
        0x085f_27e0,
        0x95f7_b36b,
    ];

    /// Six pictures of 32 x 32 pixels in the order 0, 3, 1, 2, 5, 4: B-frames lie between others.
    const BETWEEN: &[u8] = include_bytes!("../../tests/data/between.h264");
    /// Order of their packets.
    const SHOWN: [u64; 6] = [0, 3, 1, 2, 5, 4];
    /// Checksums of their pixels in the order of display, as ffmpeg decodes them.
    const PICTURES_BETWEEN: [u32; 6] =
        [0x9ece_98c5, 0x8f51_ea02, 0x2bfb_bace, 0xbbc8_4846, 0x3bc6_f17c, 0x00f8_c701];
    /// Four pictures of 48 x 32 pixels, of which each second is a key picture.
    const SMALL: &[u8] = include_bytes!("../../tests/data/small.h264");

    fn packets() -> Vec<&'static [u8]> {
        split(WALK)
    }

    /// Returns the packets of the pictures; each begins with a delimiter.
    fn split(stream: &[u8]) -> Vec<&[u8]> {
        let starts: Vec<usize> =
            (0..stream.len()).filter(|at| stream[*at..].starts_with(&[0, 0, 0, 1, 9])).collect();
        let ends = starts.iter().copied().skip(1).chain([stream.len()]);
        starts.iter().zip(ends).map(|(start, end)| &stream[*start..end]).collect()
    }

    fn at(stamp_ns: u64) -> Header {
        Header::new(Stamp::from_nanos(stamp_ns), "camera")
    }

    /// Returns the number of the picture that each packet gives, from 0; `None` where one is waited for.
    fn numbers<'a>(packets: impl IntoIterator<Item = &'a [u8]>) -> Vec<Option<usize>> {
        let mut decoder = VideoDecoder::new(&Limits::default());
        let mut found = Vec::new();
        for packet in packets {
            match decoder.decode(packet, Header::default()).unwrap() {
                Picture::Whole(image) => {
                    let image: Image<'_> = decode(&image).unwrap();
                    assert_eq!((image.width, image.height, &*image.encoding), (160, 120, "nv12"));
                    let sum = crc32fast::hash(image.data);
                    found.push(PICTURES.iter().position(|known| *known == sum));
                }
                Picture::Waits => found.push(None),
                other => panic!("each packet has a picture, in order: {other:?}"),
            }
        }
        found
    }

    #[test]
    fn each_packet_gives_its_picture_to_the_last_bit() {
        let all: Vec<Option<usize>> = (0..12).map(Some).collect();
        assert_eq!(numbers(packets()), all);
        assert_eq!(size_of_video(packets()[0], &Limits::default()), Ok(Some((160, 120))));
        assert_eq!(size_of_video(packets()[1], &Limits::default()), Ok(None));
    }

    #[test]
    fn pictures_whose_predecessor_is_lost_are_left_out_until_the_next_key_picture() {
        let cut: Vec<&[u8]> = packets().into_iter().skip(2).collect();
        let late = [None, None, None, None, Some(6), Some(7), Some(8), Some(9), Some(10), Some(11)];
        assert_eq!(numbers(cut), late);
        let mut gap = packets();
        gap.remove(3);
        let found = numbers(gap);
        assert_eq!(found[..6], [Some(0), Some(1), Some(2), None, None, Some(6)]);
    }

    #[test]
    fn the_rest_of_a_packet_is_damaged_and_makes_no_picture() {
        let key = packets()[6];
        let rest = &key[key.len() / 2..];
        // A key picture that begins with its second block.
        let second_part = [0, 0, 0, 1, 0x65, 0x40, 0x80];
        let cases = [
            (rest, "its start is missing"),
            (&second_part, "the first part of its picture is missing"),
        ];
        for (part, why) in cases {
            let mut decoder = VideoDecoder::new(&Limits::default());
            assert!(matches!(decoder.decode(packets()[0], at(1)), Ok(Picture::Whole(_))));
            let error = decoder.decode(part, at(2)).unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
            assert_eq!(decoder.decode(packets()[7], at(3)), Ok(Picture::Waits));
            assert!(matches!(decoder.decode(key, at(4)), Ok(Picture::Whole(_))));
        }
    }

    #[test]
    fn a_first_key_picture_without_its_end_is_damaged() {
        for stream in [split(WALK), split(SMALL), split(BETWEEN)] {
            let key = stream[0];
            for parts in [4, 6, 7] {
                let mut decoder = VideoDecoder::new(&Limits::default());
                let error = decoder.decode(&key[..key.len() * parts / 8], at(1)).unwrap_err();
                assert!(matches!(error, ImageError::Codec(_)), "{parts}: {error}");
                assert_eq!(decoder.decode(stream[1], at(2)), Ok(Picture::Waits), "{parts}");
            }
            let mut decoder = VideoDecoder::new(&Limits::default());
            assert!(matches!(decoder.decode(key, at(1)), Ok(Picture::Whole(_))));
        }
    }

    /// Returns stamp and checksum of the pixels of each picture of a stream, whose packets have these
    /// stamps.
    fn shown(stream: &[u8], stamps: impl IntoIterator<Item = u64>) -> Vec<Option<(u64, u32)>> {
        let mut decoder = VideoDecoder::new(&Limits::default());
        let packets = split(stream).into_iter().zip(stamps);
        let pictures = packets.map(|(packet, stamp)| match decoder.decode(packet, at(stamp)) {
            Ok(Picture::Whole(image)) => {
                let image: Image<'_> = decode(&image).unwrap();
                Some((stamp, crc32fast::hash(image.data)))
            }
            Ok(Picture::OutOfOrder) => None,
            other => panic!("{other:?}"),
        });
        pictures.collect()
    }

    #[test]
    fn a_picture_between_two_others_has_its_own_stamp_or_is_left_out() {
        // Each packet has the stamp of its picture.
        let whole = shown(BETWEEN, SHOWN);
        let wanted = SHOWN.map(|picture| Some((picture, PICTURES_BETWEEN[picture as usize])));
        assert_eq!(whole, wanted);
        // Stamps of the publication: the pictures that are left come in their order.
        let left = shown(BETWEEN, 0..6);
        let kept: Vec<usize> = (0..6).filter(|packet| left[*packet].is_some()).collect();
        assert_eq!(kept, [0, 1, 4]);
        // A count that begins anew is no order.
        let mut decoder = VideoDecoder::new(&Limits::default());
        assert!(matches!(decoder.decode(split(BETWEEN)[0], at(2)), Ok(Picture::Whole(_))));
        decoder.shown = Some((1000, Stamp::from_nanos(1)));
        assert!(matches!(decoder.decode(split(BETWEEN)[1], at(3)), Ok(Picture::Whole(_))));
    }

    /// Parameters of 4:4:4, of 10 bits and of grey, as x264 writes them.
    const OTHER_PIXELS: [(&[u8], &str); 3] = [
        (
            &[
                0x67, 0xf4, 0x00, 0x0a, 0x91, 0x96, 0x42, 0x5a, 0x10, 0x00, 0x00, 0x03, 0x00, 0x10,
                0x00, 0x00, 0x03, 0x01, 0x40, 0xf1, 0x22, 0x64, 0x80,
            ],
            "8 bits and colours as 4:4:4",
        ),
        (
            &[
                0x67, 0x6e, 0x00, 0x0a, 0xa6, 0xcb, 0x21, 0x2d, 0x08, 0x00, 0x00, 0x03, 0x00, 0x08,
                0x00, 0x00, 0x03, 0x00, 0xa0, 0x78, 0x91, 0x32, 0x40,
            ],
            "10 bits and colours as 4:2:0",
        ),
        (
            &[
                0x67, 0x64, 0x00, 0x0a, 0xf2, 0xc8, 0x4b, 0x4d, 0x90, 0x00, 0x00, 0x03, 0x00, 0x10,
                0x00, 0x00, 0x03, 0x01, 0x40, 0xf1, 0x22, 0x64, 0x80,
            ],
            "8 bits and colours as 4:0:0",
        ),
    ];

    #[test]
    fn pixels_that_are_not_decoded_are_told_by_the_parameters() {
        for (parameters, pixels) in OTHER_PIXELS {
            let packet = [&[0, 0, 0, 1], parameters].concat();
            let why = size_of_video(&packet, &Limits::default()).unwrap_err().to_string();
            assert!(why.contains(pixels) && why.contains("yuv420p"), "{why}");
            let refused = VideoDecoder::new(&Limits::default()).decode(&packet, at(1));
            assert!(matches!(refused, Err(ImageError::Layout(_))), "{refused:?}");
        }
    }

    #[test]
    fn a_stream_may_change_its_size_at_a_key_picture() {
        let mut decoder = VideoDecoder::new(&Limits::default());
        let mut sizes = Vec::new();
        for packet in [split(SMALL), packets()].concat() {
            let Picture::Whole(image) = decoder.decode(packet, at(1)).unwrap() else { panic!() };
            let image: Image<'_> = decode(&image).unwrap();
            sizes.push((image.width, image.height));
        }
        assert_eq!(sizes, [[(48, 32); 4].as_slice(), &[(160, 120); 12]].concat());
    }

    #[test]
    fn pictures_beyond_the_limits_are_refused_before_memory_is_taken() {
        let limits = Limits { image_side_px: 120, ..Limits::default() };
        let mut decoder = VideoDecoder::new(&limits);
        let refused = decoder.decode(packets()[0], Header::default());
        assert!(matches!(refused, Err(ImageError::TooLarge { .. })), "{refused:?}");
    }

    proptest! {
        #[test]
        fn damaged_packets_are_errors_or_other_pictures(
            damage in proptest::collection::vec((0..BETWEEN.len(), any::<u8>()), 1..8),
        ) {
            let mut bytes = BETWEEN.to_vec();
            for (at, value) in damage {
                bytes[at] = value;
            }
            let mut decoder = VideoDecoder::new(&Limits::default());
            for packet in bytes.chunks(100) {
                let _ = decoder.decode(packet, Header::default());
            }
            let _ = decoder.decode(&bytes, Header::default());
        }
    }
}
