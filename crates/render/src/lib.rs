//! Pictures of the pipeline's detections and tracks, one per frame.
//!
//! On the left the camera's image (depth in shades where there is no colour) with upper-body boxes,
//! ids and trails; dropped candidates are rendered faintly with the test that dropped them. On the
//! right the same people from above.

pub mod canvas;
mod image_view;
mod plan_view;
mod trails;

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use self::canvas::{Canvas, Ink};
pub use image_view::background;
use nalgebra::Isometry2;
use tagalong_core::{Images, RgbImage};
use tagalong_geometry::Camera;
use tagalong_pipeline::FrameReport;
use trails::Trails;

/// Data that a picture of one frame shows.
pub struct OverlayData {
    /// Camera of the frame.
    pub camera: Arc<Camera>,
    /// Images of the frame; shared, not copied.
    pub images: Images,
    /// Pose of the robot in the odometry frame.
    pub odom_from_robot: Isometry2<f64>,
    /// Report of the pipeline.
    pub report: FrameReport,
}

/// Renderer of the pictures of a run, into a folder.
pub struct Overlay {
    folder: PathBuf,
    trails: Trails,
}

impl Overlay {
    /// Renders into `folder`, which exists.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, trails: Trails::default() }
    }

    /// Renders one frame as `000001.png` and so on, by the frame's index.
    ///
    /// # Errors
    /// A sentence that names the file.
    pub fn draw(&mut self, scene: &OverlayData) -> Result<(), String> {
        self.trails.follow(scene);
        let picture = picture(scene, &self.trails);
        let path = self.folder.join(format!("{:06}.png", scene.report.index));
        write_png(&path, &picture).map_err(|why| format!("cannot write {}: {why}", path.display()))
    }
}

fn picture(scene: &OverlayData, trails: &Trails) -> RgbImage {
    let (width, height) = (scene.camera.width, scene.camera.height);
    let plan_width = plan_view::width_px(height);
    let mut canvas = Canvas::new(width + plan_width, height, [24, 24, 28]);
    plan_view::draw(&mut canvas, width, scene, trails);
    // The image comes second and covers the parts of the plan view beyond its area.
    canvas.paste(&image_view::draw(scene, trails).into_image(), 0, 0);
    canvas.into_image()
}

/// Returns the colour of a track: neighbours in number are far apart in hue.
fn colour_of(id: u32) -> Ink {
    const COLOURS: [[u8; 3]; 10] = [
        [255, 99, 71],
        [64, 196, 255],
        [124, 252, 0],
        [255, 215, 0],
        [238, 130, 238],
        [0, 250, 154],
        [255, 140, 0],
        [173, 216, 230],
        [255, 105, 180],
        [154, 205, 50],
    ];
    Ink::solid(COLOURS[id as usize % COLOURS.len()])
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
