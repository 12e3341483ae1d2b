use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use tagalong_app::outcome::Failure;
use tagalong_core::RgbImage;

/// Quality of the images in `tracks.mcap`: they are looked at, and not measured.
const QUALITY: u8 = 85;

/// Encodes an image as JPEG.
///
/// # Errors
/// An image without pixels, or with more than the format allows.
pub(super) fn jpeg(image: &RgbImage) -> Result<Vec<u8>, Failure> {
    let mut out = Vec::new();
    let width = image.width() as u32;
    let height = image.height() as u32;
    JpegEncoder::new_with_quality(&mut out, QUALITY)
        .encode(image.pixels().as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| {
            Failure::failed(format!(
                "an image cannot be written: {error}; run without --with-images"
            ))
        })?;
    Ok(out)
}
