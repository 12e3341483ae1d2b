use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use gif::{DisposalMethod, Encoder, Frame, Repeat};
use image::imageops::{FilterType, resize};
use image::{ImageReader, Rgba, RgbaImage};

/// Largest difference of a channel between two pictures that counts as no change: pixels with
/// smaller changes are left unchanged, which takes almost no bytes in a GIF.
const SAME: u8 = 10;

/// Speed of the search for colours, 1 (best) to 30.
const QUANTISING_SPEED: i32 = 10;

/// Animation of pictures of a run, as a GIF that is repeated.
#[derive(Clone, Copy, Debug)]
pub struct Animation {
    /// Largest width, pixels.
    pub width: u32,
    /// Time of each picture, ms.
    pub delay_ms: u32,
}

impl Animation {
    /// Writes the pictures, in their order.
    ///
    /// # Errors
    /// A sentence that names the file, for a picture that cannot be read or a full disk.
    pub fn write<P: AsRef<Path>>(&self, pictures: &[P], to: &Path) -> Result<(), String> {
        let file = BufWriter::new(File::create(to).map_err(|error| cannot_write(to, &error))?);
        let Some(first) = pictures.first() else { return Ok(()) };
        let mut shown = self.read(first.as_ref())?;
        let (columns, rows) = shown.dimensions();
        let (Ok(width), Ok(height)) = (u16::try_from(columns), u16::try_from(rows)) else {
            return Err(cannot_write(to, &"a GIF has at most 65535 columns and rows"));
        };
        let mut encoder =
            Encoder::new(file, width, height, &[]).map_err(|error| cannot_write(to, &error))?;
        encoder.set_repeat(Repeat::Infinite).map_err(|error| cannot_write(to, &error))?;
        for (at, path) in pictures.iter().enumerate() {
            let mut part = match at {
                0 => shown.clone(),
                _ => changed(&mut shown, self.read(path.as_ref())?),
            };
            if part.dimensions() != (columns, rows) {
                let why = format!("{} has another size", path.as_ref().display());
                return Err(cannot_write(to, &why));
            }
            let mut frame = Frame::from_rgba_speed(width, height, &mut part, QUANTISING_SPEED);
            frame.delay = u16::try_from(self.delay_ms / 10).unwrap_or(u16::MAX);
            // Pixels that are transparent in a later picture do not change.
            frame.dispose = DisposalMethod::Keep;
            encoder.write_frame(&frame).map_err(|error| cannot_write(to, &error))?;
        }
        Ok(())
    }

    fn read(&self, path: &Path) -> Result<RgbaImage, String> {
        let reader = ImageReader::open(path).map_err(image::ImageError::from);
        let whole = reader
            .and_then(ImageReader::decode)
            .map_err(|error| format!("cannot read {}: {error}", path.display()))?
            .into_rgba8();
        if whole.width() <= self.width {
            return Ok(whole);
        }
        let height = (u64::from(whole.height()) * u64::from(self.width)) / u64::from(whole.width());
        let height = u32::try_from(height).unwrap_or(u32::MAX).max(1);
        Ok(resize(&whole, self.width, height, FilterType::Triangle))
    }
}

/// The message on an animation that cannot be written.
fn cannot_write(to: &Path, why: &dyn std::fmt::Display) -> String {
    format!("cannot write {}: {why}", to.display())
}

/// Returns a picture in which pixels that are already shown are transparent, and updates the shown
/// picture.
fn changed(shown: &mut RgbaImage, picture: RgbaImage) -> RgbaImage {
    let mut part = picture;
    if shown.dimensions() != part.dimensions() {
        return part;
    }
    for (new, old) in part.pixels_mut().zip(shown.pixels_mut()) {
        let is_same = new.0.iter().zip(old.0).all(|(a, b)| a.abs_diff(b) <= SAME);
        if is_same { *new = Rgba([0, 0, 0, 0]) } else { *old = *new }
    }
    part
}

#[cfg(test)]
mod tests {
    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;

    use super::*;

    #[test]
    fn an_animation_shows_each_picture() {
        let home = tempfile::tempdir().unwrap();
        let pictures: Vec<_> = (0..3)
            .map(|i| {
                let path = home.path().join(format!("{i}.png"));
                RgbaImage::from_fn(80, 40, |x, _| {
                    if x / 20 == i { Rgba([250, 10, 10, 255]) } else { Rgba([20, 20, 20, 255]) }
                })
                .save(&path)
                .unwrap();
                path
            })
            .collect();
        let to = home.path().join("a.gif");
        Animation { width: 40, delay_ms: 100 }.write(&pictures, &to).unwrap();
        let file = std::io::BufReader::new(File::open(&to).unwrap());
        let frames = GifDecoder::new(file).unwrap().into_frames().collect_frames().unwrap();
        assert_eq!(frames.len(), 3);
        for (i, frame) in frames.iter().enumerate() {
            assert_eq!(frame.buffer().dimensions(), (40, 20));
            let red: Vec<bool> =
                (0..3).map(|part| frame.buffer().get_pixel(10 * part + 5, 10).0[0] > 200).collect();
            assert_eq!(red, [i == 0, i == 1, i == 2], "picture {i}");
            let unchanged = frame.buffer().get_pixel(38, 10).0;
            assert!(unchanged[0] < 30 && unchanged[3] == 255, "{unchanged:?}: it stays");
        }
    }

    #[test]
    fn a_picture_that_is_missing_is_named() {
        let home = tempfile::tempdir().unwrap();
        let gone = home.path().join("gone.png");
        let animation = Animation { width: 40, delay_ms: 100 };
        let error = animation.write(&[&gone], &home.path().join("a.gif")).unwrap_err();
        assert!(error.contains("gone.png"), "{error}");
    }
}
