//! `sensor_msgs/CompressedImage`: JPEG, PNG and `compressedDepth`.

use std::io::Cursor;

use tagalong_core::DepthImage;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::raw::exact;
use super::{
    Content, ImageError, Pixels, check_size, content_of_format, deep_png, metres, metres_of_float,
    rvl, video_codec,
};
use crate::Limits;
use crate::mcap::record::u32_at;
use crate::msgs::CompressedImage;

/// Maximum number of scans of a progressive JPEG; a regular one has about ten.
const MAX_JPEG_SCANS: usize = 64;

/// Length of the `compressedDepth` header, bytes: format, quantisation a and b.
const DEPTH_HEADER: usize = 12;
/// First bytes of a PNG.
const PNG: &[u8] = &[0x89, b'P', b'N', b'G'];
/// First bytes of a JPEG.
const JPEG: &[u8] = &[0xff, 0xd8];

/// Decodes a compressed image. Except for `compressedDepth`, the codec is recognised by the first
/// bytes, not by the format string, which differs between drivers. Depth is scaled as in
/// [`super::decode_raw`].
///
/// # Errors
/// [`ImageError`]. A JPEG that ends early is an error and does not give half a picture.
pub fn decode_compressed(
    image: &CompressedImage<'_>,
    depth_unit_m: Option<f64>,
    limits: &Limits,
) -> Result<Pixels, ImageError> {
    if let Some(packet) = DepthPacket::of(image) {
        return packet.decode(&image.format, depth_unit_m, limits).map(Pixels::Depth);
    }
    match image.data {
        [0xff, 0xd8, ..] => jpeg(image.data, limits),
        [0x89, b'P', b'N', b'G', ..] => png(image.data, depth_unit_m, limits),
        data => {
            let codec = video_codec(data).map(str::to_owned);
            Err(ImageError::Encoding(codec.unwrap_or_else(|| image.format.clone())))
        }
    }
}

/// Codec of a compressed image, by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Codec {
    /// JPEG with one channel.
    GreyJpeg,
    /// JPEG with three channels, or with a header that cannot be read.
    Jpeg,
    /// PNG with one channel of 16 bits.
    DeepPng,
    /// Any other PNG.
    Png,
    /// None of them.
    Unknown,
}

impl Codec {
    /// Returns the codec of an image, after the header of `compressedDepth` if there is one.
    pub(crate) fn of(image: &CompressedImage<'_>) -> Self {
        let body = DepthPacket::of(image).map_or(image.data, |packet| packet.body);
        match body {
            [0xff, 0xd8, ..] => {
                let mut decoder = JpegDecoder::new(ZCursor::new(body));
                let is_read = decoder.decode_headers().is_ok();
                match decoder.input_colorspace() {
                    Some(ColorSpace::Luma) if is_read => Self::GreyJpeg,
                    _ => Self::Jpeg,
                }
            }
            _ if is_deep_png(body) => Self::DeepPng,
            [0x89, b'P', b'N', b'G', ..] => Self::Png,
            _ => Self::Unknown,
        }
    }

    pub(crate) fn is_jpeg(self) -> bool {
        matches!(self, Self::GreyJpeg | Self::Jpeg)
    }
}

/// Returns true for a PNG with one channel of 16 bits.
fn is_deep_png(data: &[u8]) -> bool {
    // Bits and channels are at a fixed position in the first chunk.
    data.starts_with(PNG) && data.get(24..26) == Some(&[16, 0])
}

/// Returns the content of a compressed image, from its format and its first bytes.
pub(crate) fn content_of_compressed(image: &CompressedImage<'_>) -> Content {
    match DepthPacket::of(image) {
        Some(_) => Content::Depth,
        None => content_of_format(&image.format),
    }
}

/// Returns the columns and rows of a compressed image, from its header.
///
/// # Errors
/// [`ImageError`]: an unknown codec, a damaged header, a size beyond the limits.
pub fn size_of_compressed(
    image: &CompressedImage<'_>,
    limits: &Limits,
) -> Result<(usize, usize), ImageError> {
    let packet = DepthPacket::of(image);
    let data = packet.as_ref().map_or(image.data, |packet| packet.body);
    match data {
        [0xff, 0xd8, ..] => {
            let mut decoder = JpegDecoder::new(ZCursor::new(data));
            decoder.decode_headers().map_err(codec)?;
            let info = decoder.info().ok_or_else(|| codec("no header"))?;
            check_size(info.width.into(), info.height.into(), 3, limits)?;
            Ok((info.width.into(), info.height.into()))
        }
        [0x89, b'P', b'N', b'G', ..] => {
            let reader = png::Decoder::new(Cursor::new(data)).read_info().map_err(codec)?;
            let width = reader.info().width;
            let height = reader.info().height;
            check_size(width.into(), height.into(), 4, limits)?;
            Ok((width as usize, height as usize))
        }
        // RVL has its size in a separate header, which the decoder reads and checks.
        _ => match packet {
            Some(packet) => {
                let values = packet.decode(&image.format, None, limits)?;
                Ok((values.width(), values.height()))
            }
            None => Err(ImageError::Encoding(image.format.clone())),
        },
    }
}

fn codec(error: impl std::fmt::Debug) -> ImageError {
    ImageError::Codec(format!("{error:?}"))
}

/// Returns true if a JPEG has its end marker after its last scan. Otherwise the decoder would fill
/// in the last few blocks of a slightly truncated picture.
fn has_jpeg_end(data: &[u8]) -> bool {
    // 0xd9 ends the image and 0xda starts a scan; the last of either decides.
    let markers = data.windows(2).rev().filter(|pair| pair[0] == 0xff);
    markers.map(|pair| pair[1]).find(|code| matches!(code, 0xd9 | 0xda)) == Some(0xd9)
}

fn jpeg(data: &[u8], limits: &Limits) -> Result<Pixels, ImageError> {
    if !has_jpeg_end(data) {
        return Err(ImageError::Codec("a JPEG without its end".into()));
    }
    let side = limits.image_side_px as usize;
    // Strict mode, so that a damaged scan is an error and not half a picture.
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(side)
        .set_max_height(side)
        .jpeg_set_max_scans(MAX_JPEG_SCANS);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(data), options);
    decoder.decode_headers().map_err(codec)?;
    let info = decoder.info().ok_or_else(|| codec("no header"))?;
    let width = usize::from(info.width);
    let height = usize::from(info.height);
    check_size(width as u64, height as u64, 3, limits)?;
    // Grey stays grey, which takes a third of the memory.
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let colours = if grey { ColorSpace::Luma } else { ColorSpace::RGB };
    decoder.set_options(options.jpeg_set_out_colorspace(colours));
    if grey {
        let mut pixels = vec![0; width * height];
        decoder.decode_into(&mut pixels).map_err(codec)?;
        return Ok(Pixels::Grey(exact(width, height, pixels)));
    }
    let mut pixels = vec![[0; 3]; width * height];
    decoder.decode_into(pixels.as_flattened_mut()).map_err(codec)?;
    Ok(Pixels::Colour(exact(width, height, pixels)))
}

fn png(data: &[u8], depth_unit_m: Option<f64>, limits: &Limits) -> Result<Pixels, ImageError> {
    // Millimetres, as for `16UC1`.
    let unit = depth_unit_m.unwrap_or(0.001) as f32;
    if let Some(depth) = deep_png::decode(data, limits, |v| metres(v, unit)) {
        return Ok(Pixels::Depth(depth));
    }
    let png = PngPixels::read(data, limits)?;
    if let Some(depth) = png.scaled(|v| metres(v, unit)) {
        return Ok(Pixels::Depth(depth));
    }
    let w = png.width;
    let h = png.height;
    let bytes = png.bytes;
    let pixels = match (png.colour, png.depth) {
        (png::ColorType::Grayscale, png::BitDepth::Eight) => Pixels::Grey(exact(w, h, bytes)),
        (png::ColorType::Rgb, png::BitDepth::Eight) => {
            Pixels::Colour(exact(w, h, bytes.as_chunks::<3>().0.to_vec()))
        }
        (png::ColorType::Rgba, png::BitDepth::Eight) => {
            let (pixels, _) = bytes.as_chunks::<4>();
            Pixels::Colour(exact(w, h, pixels.iter().map(|p| [p[0], p[1], p[2]]).collect()))
        }
        (colour, depth) => {
            return Err(ImageError::Codec(format!("a PNG of {colour:?} with {depth:?} bits")));
        }
    };
    Ok(pixels)
}

/// Decoded PNG; samples of 16 bits have the high byte first.
struct PngPixels {
    width: usize,
    height: usize,
    colour: png::ColorType,
    depth: png::BitDepth,
    bytes: Vec<u8>,
}

impl PngPixels {
    fn read(data: &[u8], limits: &Limits) -> Result<Self, ImageError> {
        let bytes = usize::try_from(limits.image_bytes).unwrap_or(usize::MAX);
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(data), png::Limits { bytes });
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().map_err(codec)?;
        let width = reader.info().width;
        let height = reader.info().height;
        check_size(width.into(), height.into(), 4, limits)?;
        let size = reader.output_buffer_size().filter(|size| *size <= bytes);
        let size =
            size.ok_or(ImageError::TooLarge { width: width.into(), height: height.into() })?;
        let mut bytes = vec![0; size];
        let frame = reader.next_frame(&mut bytes).map_err(codec)?;
        bytes.truncate(frame.buffer_size());
        Ok(Self {
            width: width as usize,
            height: height as usize,
            colour: frame.color_type,
            depth: frame.bit_depth,
            bytes,
        })
    }

    /// Converts the values with `pixel`; `None` if they are not 16-bit grey.
    fn scaled(&self, pixel: impl Fn(u16) -> f32) -> Option<DepthImage> {
        let is_deep =
            (self.colour, self.depth) == (png::ColorType::Grayscale, png::BitDepth::Sixteen);
        let values = self.bytes.as_chunks::<2>().0.iter().map(|p| pixel(u16::from_be_bytes(*p)));
        is_deep.then(|| exact(self.width, self.height, values.collect()))
    }
}

/// Depth as `compressed_depth_image_transport` writes it: a header of 12 bytes, then a 16-bit PNG
/// or RVL.
struct DepthPacket<'a> {
    /// Format, and the numbers a and b of the quantisation; some drivers leave the header out.
    header: Option<&'a [u8]>,
    body: &'a [u8],
}

impl<'a> DepthPacket<'a> {
    /// Returns the packet of an image whose format names it, or of one that has the header before a
    /// 16-bit PNG under any other format; `None` for every other image.
    fn of(image: &CompressedImage<'a>) -> Option<Self> {
        let data = image.data;
        let is_declared = image.format.to_ascii_lowercase().contains("compresseddepth");
        if data.starts_with(PNG) || data.starts_with(JPEG) {
            return is_declared.then_some(Self { header: None, body: data });
        }
        match data.split_at_checked(DEPTH_HEADER) {
            Some((header, body)) if is_declared || is_deep_png(body) => {
                Some(Self { header: Some(header), body })
            }
            Some(_) => None,
            None => is_declared.then_some(Self { header: None, body: data }),
        }
    }

    /// Returns the numbers a and b of floating-point depth, which is quantised as inverse depth,
    /// `a / (v - b)`; `None` for integer units.
    fn quantisation(&self, format: &str) -> Option<[f32; 2]> {
        let header = self.header?;
        let [a, b] = [4, 8].map(|at| f32::from_bits(u32_at(header, at)));
        let format = format.to_ascii_uppercase();
        let is_float = if format.contains("32FC1") {
            true
        } else {
            // Without the encoding the two numbers decide, because they are not set before integer
            // units: a is some ten thousand, and b is 1 minus a divided by the largest depth.
            !format.contains("16UC1") && (1.0..1e8).contains(&a) && (-1e8..1.0).contains(&b)
        };
        is_float.then_some([a, b])
    }

    fn decode(
        &self,
        format: &str,
        depth_unit_m: Option<f64>,
        limits: &Limits,
    ) -> Result<DepthImage, ImageError> {
        let is_rvl = format.to_ascii_lowercase().contains("rvl");
        let Some([a, b]) = self.quantisation(format) else {
            let unit = depth_unit_m.unwrap_or(0.001) as f32;
            return depth_of(self.body, is_rvl, limits, |v| metres(v, unit));
        };
        let unit = depth_unit_m.unwrap_or(1.0) as f32;
        depth_of(self.body, is_rvl, limits, |v| {
            let depth = if v == 0 { f32::NAN } else { a / (f32::from(v) - b) };
            metres_of_float(depth, unit)
        })
    }
}

/// Converts the values in the body of a `compressedDepth` message with `pixel`.
fn depth_of(
    body: &[u8],
    is_rvl: bool,
    limits: &Limits,
    pixel: impl Fn(u16) -> f32,
) -> Result<DepthImage, ImageError> {
    fn lost(why: &str) -> ImageError {
        ImageError::Codec(why.into())
    }

    if body.starts_with(PNG) {
        if let Some(depth) = deep_png::decode(body, limits, &pixel) {
            return Ok(depth);
        }
        let depth = PngPixels::read(body, limits)?.scaled(pixel);
        return depth.ok_or_else(|| lost("compressedDepth whose PNG has not 16 bits of grey"));
    }
    if !is_rvl {
        return Err(lost("compressedDepth that is neither PNG nor RVL"));
    }
    // Columns and rows as 32-bit numbers, then the stream.
    let (size, stream) = body.split_first_chunk::<8>().ok_or_else(|| lost("RVL without a size"))?;
    let width = u32_at(size, 0);
    let height = u32_at(size, 4);
    check_size(width.into(), height.into(), 4, limits)?;
    let width = width as usize;
    let height = height as usize;
    rvl::decode(stream, width * height, pixel)
        .map(|values| exact(width, height, values))
        .ok_or_else(|| lost("the RVL stream does not fit the size"))
}

/// Returns the data of a `16UC1; compressedDepth rvl` message: header, size, stream. `values` are
/// `width * height` readings in millimetres, 0 means none.
pub fn encode_rvl(width: u32, height: u32, values: &[u16]) -> Vec<u8> {
    let mut out = vec![0; DEPTH_HEADER];
    out.extend_from_slice(&width.to_le_bytes());
    out.extend_from_slice(&height.to_le_bytes());
    out.extend(rvl::encode(values));
    out
}
