use proptest::prelude::*;

use super::*;
use crate::msgs::{CompressedImage, DisparityImage, Header, Image, RegionOfInterest};

mod coded_depth;

const JPEG: &[u8] = include_bytes!("../../tests/data/gradient.jpg");
const GREY_JPEG: &[u8] = include_bytes!("../../tests/data/gradient-grey.jpg");
const PROGRESSIVE_JPEG: &[u8] = include_bytes!("../../tests/data/gradient-progressive.jpg");

fn raw<'a>(encoding: &str, width: u32, height: u32, step: u32, data: &'a [u8]) -> Image<'a> {
    let header = Header::default();
    Image { header, height, width, encoding: encoding.into(), is_bigendian: 0, step, data }
}

fn decoded(image: &Image<'_>) -> Result<Pixels, ImageError> {
    decode_raw(image, None, &Limits::default())
}

/// Returns the counter of an image that does not decode.
fn fault(image: Image<'_>) -> &'static str {
    decoded(&image).unwrap_err().counter()
}

fn compressed(format: &str, data: &[u8]) -> Result<Pixels, ImageError> {
    let image = CompressedImage { header: Header::default(), format: format.into(), data };
    decode_compressed(&image, None, &Limits::default())
}

fn png_16(width: u32, height: u32, values: &[u16]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
    out
}

fn png_8(colour: png::ColorType, width: u32, height: u32, bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(colour);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    out
}

fn depth_of(pixels: Pixels) -> Vec<f32> {
    match pixels {
        Pixels::Depth(depth) => depth.pixels().to_vec(),
        other => panic!("no depth: {other:?}"),
    }
}

fn same_depth(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len()
        && a.iter().zip(b).all(|(a, b)| a.is_nan() && b.is_nan() || (a - b).abs() < 1e-6)
}

#[test]
fn every_colour_encoding_gives_red_green_blue() {
    let expected = Pixels::Colour(RgbImage::from_pixels(2, 1, vec![[1, 2, 3], [4, 5, 6]]).unwrap());
    let cases: [(&str, &[u8]); 5] = [
        ("rgb8", &[1, 2, 3, 4, 5, 6]),
        ("bgr8", &[3, 2, 1, 6, 5, 4]),
        ("rgba8", &[1, 2, 3, 9, 4, 5, 6, 9]),
        ("bgra8", &[3, 2, 1, 9, 6, 5, 4, 9]),
        ("8UC4", &[3, 2, 1, 9, 6, 5, 4, 9]),
    ];
    for (encoding, data) in cases {
        assert_eq!(decoded(&raw(encoding, 2, 1, data.len() as u32, data)).unwrap(), expected);
    }
}

#[test]
fn padding_between_rows_is_passed_over() {
    let image = raw("mono8", 2, 2, 3, &[1, 2, 99, 3, 4, 99]);
    let expected = GreyImage::from_pixels(2, 2, vec![1, 2, 3, 4]).unwrap();
    assert_eq!(decoded(&image).unwrap(), Pixels::Grey(expected));
}

#[test]
fn depth_is_metres_and_nan() {
    let values: Vec<u8> = [0_u16, 1500, 65535].iter().flat_map(|v| v.to_le_bytes()).collect();
    let millimetres = depth_of(decoded(&raw("16UC1", 3, 1, 6, &values)).unwrap());
    assert!(same_depth(&millimetres, &[f32::NAN, 1.5, f32::NAN]), "{millimetres:?}");
    let floats = [2.5, 0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let bytes: Vec<u8> = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
    let metres = depth_of(decoded(&raw("32FC1", 6, 1, 24, &bytes)).unwrap());
    assert!(same_depth(&metres, &[2.5, f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN]));
}

#[test]
fn the_high_byte_may_come_first() {
    let mut image = raw("16UC1", 1, 1, 2, &[0x05, 0xdc]);
    image.is_bigendian = 1;
    assert!(same_depth(&depth_of(decoded(&image).unwrap()), &[1.5]));
    let bytes = 2.5_f32.to_be_bytes();
    let mut image = raw("32FC1", 1, 1, 4, &bytes);
    image.is_bigendian = 1;
    assert!(same_depth(&depth_of(decoded(&image).unwrap()), &[2.5]));
}

#[test]
fn mono16_is_depth_with_a_unit_and_intensity_without() {
    let mut image = raw("mono16", 3, 1, 6, &[0xdc, 0x05, 0xff, 0xff, 0x80, 0x00]);
    let expected = GreyImage::from_pixels(3, 1, vec![6, 255, 0]).unwrap();
    assert_eq!(decoded(&image).unwrap(), Pixels::Grey(expected));
    let scaled = decode_raw(&image, Some(0.0001), &Limits::default()).unwrap();
    assert!(same_depth(&depth_of(scaled), &[0.15, f32::NAN, 0.0128]));
    image.is_bigendian = 1;
    let expected = GreyImage::from_pixels(3, 1, vec![219, 255, 128]).unwrap();
    assert_eq!(decoded(&image).unwrap(), Pixels::Grey(expected));
}

#[test]
fn deep_colour_says_so() {
    for encoding in ["rgb16", "bgra16", "bayer_rggb16", "16UC3"] {
        let error = decoded(&raw(encoding, 1, 1, 6, &[0; 6])).unwrap_err();
        assert!(error.to_string().contains("16 bits a channel"), "{error}");
        assert_eq!(content_of_encoding(encoding, None), Content::Unknown);
        assert!(refusal_of(encoding).contains("16 bits a channel"));
    }
    assert!(refusal_of("h264").contains("image_transport republish"));
    assert!(refusal_of("yuv999").contains("`yuv999` is not known: let the driver publish rgb8"));
}

/// Pixels as OpenCV 4.10 decodes them, an encoding a line: its name, columns, rows and values, as
/// `tests/clients/encodings_opencv.py` prints them.
const OPENCV: &str = include_str!("../../tests/data/encodings-opencv.txt");

/// The bytes of that script.
fn noise(count: usize) -> Vec<u8> {
    (0..count).map(|i| ((7 + 37 * i) % 256) as u8).collect()
}

/// Bytes of a row and rows of an encoding, for an image of this size.
fn layout(encoding: &str, width: usize, height: usize) -> (usize, usize) {
    match encoding {
        _ if encoding.starts_with("bayer") => (width, height),
        "nv24" => (width, height * 3),
        _ if encoding.starts_with("nv") => (width, height * 3 / 2),
        _ => (2 * width, height),
    }
}

#[test]
fn mosaics_and_apart_colours_are_decoded_as_opencv_does() {
    assert_eq!(OPENCV.lines().count(), 9);
    for line in OPENCV.lines() {
        let (encoding, numbers) = line.split_once(' ').unwrap();
        let numbers: Vec<usize> = numbers.split(' ').map(|n| n.parse().unwrap()).collect();
        let [width, height, ref expected @ ..] = numbers[..] else { panic!("{line}") };
        let expected: Vec<u8> = expected.iter().map(|value| *value as u8).collect();
        let (step, rows) = layout(encoding, width, height);
        let bytes = noise(step * rows);
        let image = raw(encoding, width as u32, height as u32, step as u32, &bytes);
        let expected: Vec<[u8; 3]> = expected.as_chunks().0.to_vec();
        let expected = Pixels::Colour(RgbImage::from_pixels(width, height, expected).unwrap());
        assert_eq!(decoded(&image).unwrap(), expected, "{encoding}");
        assert_eq!(content_of_encoding(encoding, None), Content::Picture);
        // A line of colour pairs of `nv24` takes two rows, with the padding behind both.
        let (bright, pairs) = bytes.split_at(if encoding == "nv24" { step * height } else { 0 });
        let length = if encoding == "nv24" { 2 * step } else { step };
        let mut padded: Vec<u8> =
            bright.chunks(step).flat_map(|row| [row, &[9, 9][..]].concat()).collect();
        let padding = vec![9; 2 * length / step];
        padded.extend(pairs.chunks(length).flat_map(|row| [row, &padding].concat()));
        let image = raw(encoding, width as u32, height as u32, step as u32 + 2, &padded);
        assert_eq!(decoded(&image).unwrap(), expected, "{encoding}, padded");
    }
}

#[test]
fn other_names_of_the_same_order_give_the_same_image() {
    for (name, other) in [("uyvy", "yuv422"), ("yuyv", "yuv422_yuy2")] {
        let bytes = noise(16);
        let [a, b] = [name, other].map(|encoding| decoded(&raw(encoding, 4, 2, 8, &bytes)));
        assert_eq!(a.unwrap(), b.unwrap());
    }
}

#[test]
fn the_step_of_planes_of_one_resolution_may_be_that_of_any_plane() {
    let bytes = noise(24);
    let [four, eight, twelve] =
        [4, 8, 12].map(|step| decoded(&raw("nv24", 4, 2, step, &bytes)).unwrap());
    assert!(four == eight && four == twelve);
    let odd = noise(27);
    assert!(decoded(&raw("nv24", 3, 3, 3, &odd)).is_ok());
    assert_eq!(fault(raw("nv24", 4, 2, 8, &bytes[1..])), "images_of_wrong_layout");
}

#[test]
fn small_and_odd_mosaics_do_no_harm() {
    for (width, height) in [(1, 1), (1, 3), (2, 1), (2, 2), (3, 2)] {
        let bytes = noise((width * height) as usize);
        assert!(decoded(&raw("bayer_rggb8", width, height, width, &bytes)).is_ok());
    }
    assert_eq!(fault(raw("yuyv", 3, 2, 6, &[0; 12])), "images_of_wrong_layout");
    assert_eq!(fault(raw("nv12", 2, 3, 2, &[0; 9])), "images_of_wrong_layout");
    assert_eq!(fault(raw("nv12", 2, 2, 2, &[0; 4])), "images_of_wrong_layout");
    assert_eq!(fault(raw("bayer_grbg8", 4, 2, 3, &[0; 6])), "images_of_wrong_layout");
}

#[test]
fn lies_about_the_layout_are_refused() {
    let data = [0; 12];
    assert_eq!(fault(raw("rgb8", 2, 2, 5, &data)), "images_of_wrong_layout");
    assert_eq!(fault(raw("rgb8", 2, 2, 7, &data)), "images_of_wrong_layout");
    assert_eq!(fault(raw("rgb8", 2, 3, 6, &data)), "images_of_wrong_layout");
    assert_eq!(fault(raw("rgb8", 0, 0, 0, &[])), "images_of_wrong_layout");
    let huge = i32::MAX as u32;
    assert_eq!(fault(raw("rgb8", huge, huge, huge, &data)), "images_too_large");
    assert_eq!(fault(raw("mono8", 16_000, 16_000, 16_000, &data)), "images_too_large");
    assert_eq!(fault(raw("nonsense99", 2, 2, 6, &data)), "images_of_unknown_encoding");
    assert_eq!(fault(raw("", 2, 2, 6, &data)), "images_of_unknown_encoding");
}

#[test]
fn jpegs_are_read_whatever_the_format_says() {
    for (data, format) in [(JPEG, "bgr8; jpeg compressed bgr8"), (PROGRESSIVE_JPEG, "png")] {
        let Pixels::Colour(image) = compressed(format, data).unwrap() else { panic!("colour") };
        assert_eq!((image.width(), image.height()), (48, 32));
        for (x, y) in [(0, 0), (40, 3), (20, 30)] {
            let [r, g, b] = image.get(x, y).unwrap();
            for (got, want) in [(r, x * 5), (g, y * 8), (b, 128)] {
                assert!((i64::from(got) - want).abs() < 9, "{r} {g} {b}");
            }
        }
    }
    let Pixels::Grey(grey) = compressed("mono8; jpeg", GREY_JPEG).unwrap() else { panic!("grey") };
    assert_eq!((grey.width(), grey.height()), (48, 32));
}

#[test]
fn a_jpeg_cut_anywhere_is_an_error() {
    for picture in [JPEG, GREY_JPEG, PROGRESSIVE_JPEG] {
        assert!(compressed("jpeg", picture).is_ok());
        for length in 0..picture.len() {
            let cut = compressed("jpeg", &picture[..length]);
            assert!(cut.is_err(), "cut at {length} of {}", picture.len());
        }
    }
}

#[test]
fn pngs_of_all_kinds_are_read() {
    let rgb = compressed("png", &png_8(png::ColorType::Rgb, 1, 2, &[1, 2, 3, 4, 5, 6])).unwrap();
    assert_eq!(
        rgb,
        Pixels::Colour(RgbImage::from_pixels(1, 2, vec![[1, 2, 3], [4, 5, 6]]).unwrap())
    );
    let rgba = compressed("png", &png_8(png::ColorType::Rgba, 1, 1, &[1, 2, 3, 4])).unwrap();
    assert_eq!(rgba, Pixels::Colour(RgbImage::filled(1, 1, [1, 2, 3])));
    let grey = compressed("png", &png_8(png::ColorType::Grayscale, 1, 1, &[7])).unwrap();
    assert_eq!(grey, Pixels::Grey(GreyImage::filled(1, 1, 7)));
    let palette = include_bytes!("../../tests/data/gradient-palette.png");
    assert_eq!(compressed("png", palette).unwrap().size(), (48, 32));
    let depth = compressed("16UC1; png compressed", &png_16(2, 1, &[0, 2000])).unwrap();
    assert!(same_depth(&depth_of(depth), &[f32::NAN, 2.0]));
}

#[test]
fn a_png_cut_anywhere_is_an_error_or_whole() {
    let values: Vec<u16> = (0..600).map(|v| v * 7).collect();
    let data = [&[0; 12][..], &png_16(30, 20, &values)].concat();
    let whole = depth_of(compressed("16UC1; compressedDepth png", &data).unwrap());
    for length in 0..data.len() {
        if let Ok(pixels) = compressed("16UC1; compressedDepth png", &data[..length]) {
            assert!(length + 20 > data.len(), "cut at {length}");
            assert!(same_depth(&depth_of(pixels), &whole));
        }
    }
}

#[test]
fn a_png_of_giant_size_is_refused() {
    let mut data = png_8(png::ColorType::Grayscale, 1, 1, &[7]);
    data[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
    let crc = crc32fast::hash(&data[12..29]);
    data[29..33].copy_from_slice(&crc.to_be_bytes());
    let error = compressed("png", &data).unwrap_err();
    assert_eq!(error, ImageError::TooLarge { width: 60_000, height: 60_000 });
}

#[test]
fn a_jpeg_of_giant_size_is_refused() {
    let mut data = JPEG.to_vec();
    let frame = data.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    data[frame + 5..frame + 9].copy_from_slice(&[0xea, 0x60, 0xea, 0x60]);
    assert!(compressed("jpeg", &data).is_err());
    data[frame + 5..frame + 9].copy_from_slice(&[0x3a, 0x98, 0x3a, 0x98]);
    let error = compressed("jpeg", &data).unwrap_err();
    assert_eq!(error, ImageError::TooLarge { width: 15_000, height: 15_000 });
}

/// Returns a progressive JPEG with its first scan repeated until there are `scans` of them.
fn with_scans(scans: usize) -> Vec<u8> {
    fn is_marker(pair: &[u8]) -> bool {
        pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xd0..=0xd7 | 0xff)
    }

    fn starts(pair: &&[u8]) -> bool {
        *pair == [0xff, 0xda]
    }

    let data = PROGRESSIVE_JPEG;
    let has = data.windows(2).filter(starts).count();
    let first = data.windows(2).position(|pair| starts(&pair)).unwrap();
    let after = first + 2 + data[first + 2..].windows(2).position(is_marker).unwrap();
    let more = data[first..after].repeat(scans - has);
    [&data[..after], &more, &data[after..]].concat()
}

#[test]
fn a_jpeg_of_too_many_scans_is_refused() {
    assert!(compressed("jpeg", &with_scans(60)).is_ok());
    // 64 is the limit; each scan costs the work of a picture.
    for scans in [66, 10_000] {
        assert!(compressed("jpeg", &with_scans(scans)).is_err(), "{scans}");
    }
}

#[test]
fn quantised_float_depth_is_inverted() {
    // a / (v - b) with a = 100, b = 2: 52 is 2 m, 102 is 1 m, 0 is none.
    let mut data = vec![1, 0, 0, 0];
    data.extend(100.0_f32.to_le_bytes());
    data.extend(2.0_f32.to_le_bytes());
    data.extend(png_16(4, 1, &[52, 102, 0, 2]));
    let depth = depth_of(compressed("32FC1; compressedDepth", &data).unwrap());
    assert!(same_depth(&depth, &[2.0, 1.0, f32::NAN, f32::NAN]), "{depth:?}");
}

#[test]
fn compressed_depth_is_told_by_its_bytes_and_its_numbers() {
    let png = png_16(2, 1, &[1500, 0]);
    // Of whole units the numbers of the header are those of the memory before.
    let unset = [[0, 0, 0, 0], [0xcd; 4], [0xcd; 4]].concat();
    let whole = [unset, png.clone()].concat();
    for format in ["png", "", "16UC1", "16UC1; compressedDepth", "compressedDepth"] {
        let depth = depth_of(compressed(format, &whole).unwrap());
        assert!(same_depth(&depth, &[1.5, f32::NAN]), "{format}: {depth:?}");
    }
    // Without the header of 12 bytes.
    let depth = depth_of(compressed("16UC1; compressedDepth png", &png).unwrap());
    assert!(same_depth(&depth, &[1.5, f32::NAN]), "{depth:?}");

    // The numbers of `depth_quantization` 100 and `depth_max` 10 m.
    let quantised = [&[1, 0, 0, 0][..], &10_100_f32.to_le_bytes(), &(-1009_f32).to_le_bytes()];
    let floats = [quantised.concat(), png_16(2, 1, &[1011, 0])].concat();
    for format in ["32FC1; compressedDepth png", "32fc1; compressedDepth", "compressedDepth"] {
        let depth = depth_of(compressed(format, &floats).unwrap());
        assert!(same_depth(&depth, &[5.0, f32::NAN]), "{format}: {depth:?}");
    }
}

#[test]
fn compressed_depth_without_its_header_is_refused() {
    for length in 0..12 {
        assert!(compressed("16UC1; compressedDepth", &vec![0; length]).is_err());
    }
    assert!(compressed("16UC1; compressedDepth rvl", &[0; 19]).is_err());
    let giant = [&[0; 12][..], &[0xff; 8], &[0; 40]].concat();
    assert_eq!(
        compressed("16UC1; compressedDepth rvl", &giant).unwrap_err().counter(),
        "images_too_large"
    );
}

/// Calculated by hand from the paper: 2 zeros, 3 readings 5, 5, 4. Differences 5, 0, -1 are 10, 0,
/// 1 in zigzag. 10 is 1010 binary: nibble 2 with more, then 1.
#[test]
fn rvl_is_as_published() {
    let nibbles = [2_u32, 3, 8 | 2, 1, 0, 1];
    let word = nibbles.iter().fold(0, |word, nibble| word << 4 | nibble) << 8;
    assert_eq!(rvl::encode(&[0, 0, 5, 5, 4]), word.to_le_bytes());
    assert_eq!(rvl::decode(&word.to_le_bytes(), 5, |v| v).unwrap(), [0, 0, 5, 5, 4]);
}

#[test]
fn what_is_in_an_image_shows_in_its_name() {
    assert_eq!(content_of_format("16UC1; compressedDepth"), Content::Depth);
    assert_eq!(content_of_format("rgb8; jpeg compressed bgr8"), Content::Picture);
    assert_eq!(content_of_format("h264"), Content::Unknown);
    assert_eq!(content_of_encoding("mono16", None), Content::Picture);
    assert_eq!(content_of_encoding("mono16", Some(0.001)), Content::Depth);
}

const STEREO: StereoGeometry = StereoGeometry { focal_px: 420.0, baseline_m: 0.12 };

fn plain_disparity(
    encoding: &str,
    unit_px: Option<f64>,
    data: &[u8],
) -> Result<Vec<f32>, ImageError> {
    let image = raw(encoding, 6, 1, data.len() as u32, data);
    let read = decode_plain_disparity(&image, STEREO, unit_px, &Limits::default())?;
    assert_eq!(read.invalid, read.depth.pixels().iter().filter(|z| z.is_nan()).count());
    Ok(read.depth.pixels().to_vec())
}

/// The values are those of `tests/clients/disparity_opencv.py`.
fn is_same(read: &[f32], expected: &[f32; 6]) -> bool {
    let mut pairs = read.iter().zip(expected);
    pairs.all(|(a, b)| a.is_nan() && b.is_nan() || (a - b).abs() <= 1e-6 * b.abs())
}

#[test]
fn disparities_are_the_depth_that_opencv_computes() {
    let tables: [(&str, &[u8], [f32; 6]); 3] = [
        ("8UC1", &[0, 1, 7, 42, 200, 255], [f32::NAN, 50.4, 7.2, 1.2, 0.252, 0.197_647_07]),
        (
            "16SC1",
            &[240, 255, 1, 0, 113, 0, 160, 2, 128, 12, 255, 127],
            [f32::NAN, 806.4, 7.136_283_4, 1.2, 0.252, 0.024_610_126],
        ),
        (
            "32FC1",
            &[0, 0, 0, 0, 0, 0, 0, 63, 0, 0, 232, 64, 0, 0, 40, 66, 0, 0, 126, 66, 0, 0, 250, 67],
            [f32::NAN, 100.8, 6.951_724, 1.2, 0.793_700_8, 0.1008],
        ),
    ];
    for (encoding, data, expected) in &tables {
        let read = plain_disparity(encoding, None, data).unwrap();
        assert!(is_same(&read, expected), "{encoding}: {read:?}");
    }
    // The same numbers without a sign, in the unit that the settings state.
    let (_, mut data, expected) = tables[1];
    let unsigned = [&[0, 0][..], &data[2..]].concat();
    data = &unsigned;
    for encoding in ["16UC1", "mono16"] {
        assert!(is_same(&plain_disparity(encoding, Some(0.0625), data).unwrap(), &expected));
        let error = plain_disparity(encoding, None, data).unwrap_err().to_string();
        assert!(error.contains(encoding) && error.contains("disparity.unit_px"), "{error}");
    }
    let bytes: Vec<u16> =
        unsigned.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
    let png = png_16(6, 1, &bytes);
    let header = Header::default();
    let image = CompressedImage { header, format: "png".into(), data: &png };
    let read = decode_compressed_disparity(&image, STEREO, Some(0.0625), &Limits::default());
    assert!(is_same(read.unwrap().depth.pixels(), &expected));
    let jpeg = CompressedImage { data: GREY_JPEG, ..image };
    assert!(decode_compressed_disparity(&jpeg, STEREO, None, &Limits::default()).is_err());
    let error = plain_disparity("rgb8", None, &[0; 18]).unwrap_err().to_string();
    assert!(error.contains("disparities as `rgb8`"), "{error}");
}

fn disparity_message(data: &[u8]) -> DisparityImage<'_> {
    DisparityImage {
        image: raw("32FC1", 4, 1, 16, data),
        f: 400.0,
        t: 0.125,
        ..DisparityImage::default()
    }
}

fn depth_of_message(message: &DisparityImage<'_>) -> (Vec<f32>, usize) {
    let read = decode_disparity(message, None, None, &Limits::default()).unwrap();
    (read.depth.pixels().to_vec(), read.invalid)
}

#[test]
fn disparities_outside_of_the_range_or_the_window_are_invalid() {
    let data: Vec<u8> = [2.0_f32, 10.0, 60.0, 64.5].iter().flat_map(|d| d.to_le_bytes()).collect();
    let message = disparity_message(&data);
    let all = [25.0, 5.0, 50.0 / 60.0, 50.0 / 64.5];
    let (read, invalid) = depth_of_message(&message);
    assert!(same_depth(&read, &all) && invalid == 0, "{read:?}");
    let of_range = DisparityImage { min_disparity: 10.0, max_disparity: 64.0, ..message.clone() };
    let (read, invalid) = depth_of_message(&of_range);
    assert!(same_depth(&read, &[f32::NAN, all[1], all[2], f32::NAN]), "{read:?}");
    assert_eq!(invalid, 2);
    // A range whose end is not set has a start all the same, and one of no numbers has none.
    let no_end = DisparityImage { min_disparity: 10.0, ..message.clone() };
    assert_eq!(depth_of_message(&no_end).1, 1);
    let none = DisparityImage { min_disparity: f32::NAN, ..message.clone() };
    assert_eq!(depth_of_message(&none).1, 0);
    let window = RegionOfInterest { x_offset: 1, width: u32::MAX, height: 1, ..Default::default() };
    let windowed = DisparityImage { valid_window: window, ..message.clone() };
    let (read, _) = depth_of_message(&windowed);
    assert!(same_depth(&read, &[f32::NAN, all[1], all[2], all[3]]), "{read:?}");
    for (f, t) in [(0.0, 0.12), (420.0, -0.12), (f32::NAN, 1.0), (420.0, f32::INFINITY)] {
        let wrong = DisparityImage { f, t, ..message.clone() };
        let error = decode_disparity(&wrong, None, None, &Limits::default()).unwrap_err();
        assert!(error.to_string().contains("have to be positive"), "{error}");
    }
    let in_millimetres = DisparityImage { t: 125.0, ..message };
    let read = decode_disparity(&in_millimetres, None, Some(1e-3), &Limits::default()).unwrap();
    assert!(same_depth(read.depth.pixels(), &all));
}

proptest! {
    #[test]
    fn rvl_round_trips(runs in proptest::collection::vec((any::<u16>(), 1..40_usize, any::<bool>()), 0..30)) {
        let values: Vec<u16> = runs.iter()
            .flat_map(|(value, count, zero)| (0..*count).map(|i| if *zero { 0 } else { value.wrapping_add(i as u16) }))
            .collect();
        let coded = rvl::encode(&values);
        prop_assert_eq!(rvl::decode(&coded, values.len(), |v| v).unwrap(), values.clone());
        for length in 0..coded.len().saturating_sub(4) {
            prop_assert!(rvl::decode(&coded[..length], values.len(), |v| v).is_none_or(|v| v.len() == values.len()));
        }
        if !values.is_empty() {
            let data = encode_rvl(values.len() as u32, 1, &values);
            let expected: Vec<f32> = values.iter().map(|v| metres(*v, 0.001)).collect();
            let read = depth_of(compressed("16UC1; compressedDepth rvl", &data).unwrap());
            prop_assert!(same_depth(&read, &expected));
        }
    }

    #[test]
    fn any_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), at in 0..600_usize, with in any::<u8>()) {
        for format in ["16UC1; compressedDepth rvl", "32FC1; compressedDepth", "jpeg"] {
            let _ = compressed(format, &bytes);
        }
        for picture in [JPEG, PROGRESSIVE_JPEG, GREY_JPEG] {
            let mut flipped = picture.to_vec();
            let place = at % flipped.len();
            flipped[place] = with;
            let _ = compressed("jpeg", &flipped);
        }
    }
}
