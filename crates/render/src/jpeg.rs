use image::codecs::jpeg::JpegEncoder;
use image::imageops::{FilterType, resize};
use image::{ExtendedColorType, ImageBuffer, Rgb};
use tagalong_core::RgbImage;

/// Encodes an image as JPEG, reduced to at most `width` columns; empty for an image without pixels.
pub fn jpeg(image: &RgbImage, width: usize, quality: u8) -> Vec<u8> {
    let columns = image.width() as u32;
    let rows = image.height() as u32;
    let bytes = image.pixels().as_flattened().to_vec();
    let Some(whole) = ImageBuffer::<Rgb<u8>, _>::from_raw(columns, rows, bytes) else {
        return Vec::new();
    };
    let width = u32::try_from(width).unwrap_or(u32::MAX).min(columns);
    let height = (u64::from(rows) * u64::from(width) / u64::from(columns.max(1))).max(1) as u32;
    let small =
        if width < columns { resize(&whole, width, height, FilterType::Triangle) } else { whole };
    let mut out = Vec::new();
    let encoded = JpegEncoder::new_with_quality(&mut out, quality).encode(
        &small,
        small.width(),
        small.height(),
        ExtendedColorType::Rgb8,
    );
    // Encoding into memory fails for images without pixels or with too many.
    encoded.map_or_else(|_| Vec::new(), |()| out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_reduced_and_keeps_its_colours() {
        let red = RgbImage::filled(700, 20, [200, 10, 10]);
        for (width, expected) in [(640, (640, 18)), (900, (700, 20))] {
            let read = image::load_from_memory(&jpeg(&red, width, 70)).unwrap().to_rgb8();
            assert_eq!((read.width(), read.height()), expected);
            let pixel = read.get_pixel(300, 9).0;
            assert!(pixel[0] > 180 && pixel[1] < 40, "{pixel:?}");
        }
        assert!(jpeg(&RgbImage::default(), 640, 70).is_empty());
    }
}
