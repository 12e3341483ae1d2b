//! Pictures of the pipeline's detections and tracks, one per frame.
//!
//! The left side has the image of the camera (shaded depth if there is no colour), enlarged to at
//! least 640 columns, with the people, their IDs, distances and trails. The right side has the same
//! people in a plan view, and below it a legend. [`Detail::Debug`] adds dropped candidates, dashed,
//! with the test that dropped them, tentative tracks and the state of the filter. All pictures of a
//! run have the same size.
//!
//! ```
//! use tagalong_render::canvas::{Canvas, Ink};
//! use tagalong_render::jpeg;
//!
//! let mut canvas = Canvas::new(64, 48, [24, 24, 28]);
//! canvas.line([4.0, 40.0].into(), [60.0, 8.0].into(), Ink::solid([250, 200, 0]));
//! let picture = canvas.into_image();
//! assert_eq!(picture.get(4, 40), Some([250, 200, 0]));
//! assert!(jpeg(&picture, 32, 80).starts_with(&[0xff, 0xd8]));
//! ```

mod animation;
pub mod canvas;
mod data;
mod enlarge;
mod image_view;
mod jpeg;
mod labels;
mod legend;
mod plan_view;
mod style;
mod trails;

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

pub use animation::Animation;

use self::canvas::Canvas;
pub use data::OverlayData;
pub use image_view::background;
pub use jpeg::jpeg;
pub use style::{Detail, OverlayStyle};
use tagalong_core::RgbImage;
use trails::Trails;

/// Renderer of the pictures of a run, into a folder.
pub struct Overlay {
    folder: PathBuf,
    style: OverlayStyle,
    trails: Trails,
}

impl Overlay {
    /// Creates a renderer into an existing `folder`.
    pub fn new(folder: PathBuf, style: OverlayStyle) -> Self {
        Self { folder, style, trails: Trails::default() }
    }

    /// Renders one frame as `000001.png` and so on, by the frame's index.
    ///
    /// # Errors
    /// A sentence that names the file.
    pub fn draw(&mut self, scene: &OverlayData) -> Result<(), String> {
        self.trails.follow(scene);
        let picture = picture(scene, &self.trails, self.style);
        let path = self.folder.join(format!("{:06}.png", scene.report.index));
        write_png(&path, &picture).map_err(|why| format!("cannot write {}: {why}", path.display()))
    }
}

/// Least number of rows of image and plan: with fewer, the numbers in the plan would not be
/// legible.
const LEAST_ROWS: usize = 360;

/// Number of rows of the plan if there is no image: the plan is then as wide as an image.
const ROWS_ALONE: usize = 800;

fn picture(scene: &OverlayData, trails: &Trails, style: OverlayStyle) -> RgbImage {
    let image = image_view::draw(scene, trails, style).into_image();
    // Even, because most video formats ask for it.
    let least = if image.width() == 0 { ROWS_ALONE } else { LEAST_ROWS };
    let [left, rows] = [image.width(), image.height().max(least)].map(|n| n.next_multiple_of(2));
    let plan_width = plan_view::width_px(rows);
    let mut canvas = Canvas::new(left + plan_width, rows + legend::height_px(style), [24, 24, 28]);
    canvas.paste(&plan_view::draw(scene, trails, style, rows).into_image(), left, 0);
    canvas.paste(&image, 0, 0);
    legend::draw(&mut canvas, rows, scene, trails, style);
    canvas.into_image()
}

/// Writes a picture.
pub fn write_png(path: &Path, image: &RgbImage) -> Result<(), png::EncodingError> {
    let file = BufWriter::new(File::create(path)?);
    let mut encoder = png::Encoder::new(file, image.width() as u32, image.height() as u32);
    encoder.set_color(png::ColorType::Rgb);
    // One picture per frame: the time to compress matters more than the size.
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.pixels().as_flattened())?;
    writer.finish()
}

#[cfg(test)]
mod tests;
