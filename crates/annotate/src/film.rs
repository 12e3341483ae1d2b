//! Images and depth of all frames, stored in a temporary file, so that the page can request any
//! frame of a log that can only be read sequentially.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{Point2, Point3};
use tagalong_core::{DepthImage, RgbImage};
use tagalong_eval::Region;
use tagalong_geometry::{Camera, HEAD_BELOW_TOP_M, HEAD_RADIUS_M, Rect, UPPER_BODY_SIDE_M};
use tagalong_render::jpeg;

/// JPEG quality of the images, which are only displayed and not measured.
const QUALITY: u8 = 88;

/// Resolution of the stored depth, m.
const DEPTH_UNIT_M: f32 = 1e-3;

/// Side of the box of a head at a pixel without depth, as a share of the image's width.
const SIDE_WITHOUT_DEPTH: f64 = 0.15;

/// Side of the square around a pixel in which depth is read, pixels.
const PROBE_PX: f64 = 9.0;

/// Largest ratio between the depth in a box and the depth by the size of the box with which both
/// belong to the same person; boxes are drawn by hand, and people differ in size.
const SAME_DEPTH: f64 = 1.4;

/// Part of the temporary file.
#[derive(Clone, Copy, Debug)]
struct Piece {
    at: u64,
    length: usize,
}

/// One frame of the log.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Number of the frame, from 1.
    pub number: u32,
    /// Time since the first frame, s.
    pub t_s: f64,
    /// Camera of the frame.
    pub camera: Arc<Camera>,
    image: Option<Piece>,
    depth: Option<(Piece, usize, usize)>,
}

/// Position of a head, measured in depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Surface of the head in the camera frame, m: right, down, forward.
    pub head_in_camera_m: [f64; 3],
    /// True if the depth is that of the torso, because the head has none.
    pub by_torso: bool,
}

/// All frames of a log.
#[derive(Debug)]
pub struct Film {
    shots: Vec<Shot>,
    store: Mutex<File>,
    end: u64,
}

impl Film {
    /// Returns a film without frames.
    ///
    /// # Errors
    /// A temporary file that cannot be created.
    pub fn new() -> io::Result<Self> {
        let store = Mutex::new(tempfile::tempfile()?);
        Ok(Self { shots: Vec::new(), store, end: 0 })
    }

    /// Adds a frame; frames come in the order of their numbers.
    ///
    /// # Errors
    /// A temporary file that cannot be written.
    pub fn push(
        &mut self,
        number: u32,
        t_s: f64,
        camera: &Arc<Camera>,
        image: Option<&RgbImage>,
        depth: Option<&DepthImage>,
    ) -> io::Result<()> {
        let image = image.map(|image| jpeg(image, image.width(), QUALITY));
        let image = image.filter(|bytes| !bytes.is_empty());
        let image = image.map(|bytes| self.write(&bytes)).transpose()?;
        let depth = match depth {
            Some(depth) => {
                let piece = self.write(&packed(depth)?)?;
                Some((piece, depth.width(), depth.height()))
            }
            None => None,
        };
        self.shots.push(Shot { number, t_s, camera: Arc::clone(camera), image, depth });
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<Piece> {
        let store = self.store.get_mut().unwrap_or_else(PoisonError::into_inner);
        store.write_all(bytes)?;
        let piece = Piece { at: self.end, length: bytes.len() };
        self.end += bytes.len() as u64;
        Ok(piece)
    }

    fn read(&self, piece: Piece) -> io::Result<Vec<u8>> {
        let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        store.seek(SeekFrom::Start(piece.at))?;
        let mut bytes = vec![0; piece.length];
        store.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Returns all frames, in their order.
    pub fn shots(&self) -> &[Shot] {
        &self.shots
    }

    /// Returns the frame with a number.
    pub fn shot(&self, number: u32) -> Option<&Shot> {
        let at = self.shots.binary_search_by_key(&number, |shot| shot.number).ok()?;
        self.shots.get(at)
    }

    /// Returns true if any frame has depth.
    pub fn has_depth(&self) -> bool {
        self.shots.iter().any(|shot| shot.depth.is_some())
    }

    /// Returns the image of a frame as JPEG; `None` without an image.
    ///
    /// # Errors
    /// A temporary file that cannot be read.
    pub fn image(&self, number: u32) -> io::Result<Option<Vec<u8>>> {
        let piece = self.shot(number).and_then(|shot| shot.image);
        piece.map(|piece| self.read(piece)).transpose()
    }

    fn depth(&self, number: u32) -> Option<DepthImage> {
        let (piece, width, height) = self.shot(number)?.depth?;
        // If the temporary file fails, the position is unknown, as in a frame without depth.
        unpacked(&self.read(piece).ok()?, width, height)
    }

    /// Measures the positions of the heads of people in the boxes of a frame.
    pub fn places(&self, number: u32, regions: &[Region]) -> Vec<Option<Place>> {
        let camera = self.shot(number).map(|shot| Arc::clone(&shot.camera));
        // Decompressing takes longer than measuring, so it is done once for all people.
        let (Some(camera), Some(depth)) = (camera, self.depth(number)) else {
            return vec![None; regions.len()];
        };
        regions.iter().map(|region| place(&camera, &depth, region)).collect()
    }

    /// Returns the position of the head of a person in a box whose depth is known from elsewhere.
    pub fn head(&self, number: u32, region: &Region, depth_m: f64) -> Option<[f64; 3]> {
        let square = Rect::new(region.x, region.y, region.width, region.height);
        let camera = &self.shot(number)?.camera;
        // The depth of a panorama is a horizontal distance, and not a coordinate of the position.
        camera.panorama().is_none().then(|| head_at(camera, &square, depth_m))?
    }

    /// Returns the upper body of a person whose head is at a pixel; its size comes from depth, from
    /// `like`, or from the size of the image.
    pub fn upper_body(
        &self,
        number: u32,
        at: Point2<f64>,
        like: Option<&Region>,
    ) -> Option<Region> {
        let shot = self.shot(number)?;
        let probe = Rect::new(at.x - 0.5 * PROBE_PX, at.y - 0.5 * PROBE_PX, PROBE_PX, PROBE_PX);
        let depth_m = self.depth(number).and_then(|depth| depth.surface_m(&probe));
        let by_depth = depth_m.map(|depth_m| shot.camera.focal_px() * UPPER_BODY_SIDE_M / depth_m);
        let guess = SIDE_WITHOUT_DEPTH * shot.camera.width as f64;
        let side = by_depth.or(like.map(|like| like.width)).unwrap_or(guess).max(4.0);
        let above = HEAD_BELOW_TOP_M / UPPER_BODY_SIDE_M * side;
        Some(Region { x: at.x - 0.5 * side, y: at.y - above, width: side, height: side })
    }

    /// Returns the box of a person for whom only the position of the head is known.
    pub fn region_of(&self, number: u32, head_in_camera_m: [f64; 3]) -> Option<Region> {
        let camera = &self.shot(number)?.camera;
        let surface = Point3::from(head_in_camera_m);
        let centre = surface + surface.coords.try_normalize(1e-6)? * HEAD_RADIUS_M;
        let Rect { x, y, width, height } = camera.upper_body(&(camera.robot_from_camera * centre));
        (width > 0.0).then_some(Region { x, y, width, height })
    }
}

/// Measures the position of the head of a person in a box, by the depth of the face, or else by
/// that of the torso.
fn place(camera: &Camera, depth: &DepthImage, region: &Region) -> Option<Place> {
    let square = Rect::new(region.x, region.y, region.width, region.height);
    let face = depth.face_m(&square).filter(|depth_m| fits_box(camera, &square, *depth_m));
    let depth_m = match face {
        Some(face_m) => face_m,
        None => depth.surface_m(&square).filter(|depth_m| fits_box(camera, &square, *depth_m))?,
    };
    let head_in_camera_m = head_at(camera, &square, depth_m)?;
    Some(Place { head_in_camera_m, by_torso: face.is_none() })
}

/// Returns true if a depth agrees with the size of a box; another depth is that of an occluder or
/// of the background.
fn fits_box(camera: &Camera, square: &Rect, depth_m: f64) -> bool {
    let by_size = camera.focal_px() * UPPER_BODY_SIDE_M / square.width.max(square.height);
    let ratio = depth_m / by_size;
    camera.panorama().is_some() || (1.0 / SAME_DEPTH..=SAME_DEPTH).contains(&ratio)
}

/// Returns the surface of the head of a person in a box at a depth, in the camera frame, m.
fn head_at(camera: &Camera, square: &Rect, depth_m: f64) -> Option<[f64; 3]> {
    let centre = camera.robot_from_camera.inverse() * camera.head_of(square, depth_m);
    // Annotations contain the surface; the centre lies behind it.
    let ray = centre.coords.try_normalize(1e-6)?;
    Some(rounded(&(centre - ray * HEAD_RADIUS_M)))
}

/// Returns a position in whole millimetres.
fn rounded(point: &Point3<f64>) -> [f64; 3] {
    // Dividing gives the number nearest to three decimals, and adding 0 removes the sign of -0.
    [point.x, point.y, point.z].map(|v| (v * 1e3).round() / 1e3 + 0.0)
}

/// Compresses depth in whole millimetres; 0 means no reading.
fn packed(depth: &DepthImage) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(2 * depth.pixels().len());
    for metres in depth.pixels() {
        let units = (metres / DEPTH_UNIT_M).round();
        // NaN fails the comparison, too; depth beyond 65 m counts as no reading.
        let is_known = (1.0..=f32::from(u16::MAX)).contains(&units);
        bytes.extend(if is_known { units as u16 } else { 0 }.to_le_bytes());
    }
    zstd::stream::encode_all(&bytes[..], 1)
}

fn unpacked(bytes: &[u8], width: usize, height: usize) -> Option<DepthImage> {
    let bytes = zstd::stream::decode_all(bytes).ok()?;
    let metres = bytes.chunks_exact(2).map(|pair| match u16::from_le_bytes([pair[0], pair[1]]) {
        0 => f32::NAN,
        units => f32::from(units) * DEPTH_UNIT_M,
    });
    DepthImage::from_pixels(width, height, metres.collect())
}

#[cfg(test)]
pub mod tests {
    use tagalong_geometry::Pinhole;

    use super::*;

    /// Returns a film of frames with a wall, and a person 2.5 m before the middle of it.
    pub fn film(frames: u32) -> Film {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(260.0, 320, 240), 320, 240, 1.2, 0.0, 0.0));
        let depth = DepthImage::from_fn(320, 240, |x, y| {
            if (140..180).contains(&x) && y > 60 { 2.5 } else { 6.0 }
        });
        let image = RgbImage::filled(320, 240, [90, 120, 60]);
        let mut film = Film::new().unwrap();
        for number in 1..=frames {
            let t_s = f64::from(number - 1) * 0.25;
            film.push(number, t_s, &camera, Some(&image), Some(&depth)).unwrap();
        }
        film
    }

    #[test]
    fn a_head_at_a_pixel_gets_a_box_of_the_right_size_and_a_place() {
        let film = film(2);
        let region = film.upper_body(2, Point2::new(160.0, 90.0), None).unwrap();
        assert!((region.width - 0.57 * 260.0 / 2.5).abs() < 0.1, "{region:?}");
        assert!((region.x + 0.5 * region.width - 160.0).abs() < 1e-9, "{region:?}");
        let place = film.places(2, &[region])[0].unwrap();
        assert!(!place.by_torso);
        let [x, y, z] = place.head_in_camera_m;
        assert!(x.abs() < 0.02 && (z - 2.5).abs() < 0.03 && y < -0.2, "{place:?}");
        let back = film.region_of(2, place.head_in_camera_m).unwrap();
        assert!((back.x - region.x).abs() < 1.0 && (back.y - region.y).abs() < 1.0, "{back:?}");
        assert_eq!(film.places(3, &[region]), [None], "there is no such frame");
    }

    #[test]
    fn without_depth_a_box_is_as_large_as_the_last_one_and_has_no_place() {
        let camera = Arc::clone(&film(1).shots()[0].camera);
        let mut film = Film::new().unwrap();
        film.push(7, 0.0, &camera, None, None).unwrap();
        let like = Region { x: 0.0, y: 0.0, width: 64.0, height: 64.0 };
        let at = Point2::new(100.0, 100.0);
        assert_eq!(film.upper_body(7, at, Some(&like)).unwrap().width, 64.0);
        assert_eq!(film.upper_body(7, at, None).unwrap().width, 48.0);
        assert_eq!(film.places(7, &[like]), [None]);
        assert_eq!(film.image(7).unwrap(), None);
        assert!(!film.has_depth());
    }

    #[test]
    fn the_depth_of_an_occluder_or_of_the_wall_is_no_place() {
        fn at(x: f64, side: f64) -> Region {
            Region { x, y: 75.0, width: side, height: side }
        }

        let film = film(1);
        assert!(film.places(1, &[at(130.0, 59.0)])[0].is_some());
        // The box of a person at 5 m, behind the one at 2.5 m, and one at 2.5 m before the wall.
        assert_eq!(film.places(1, &[at(145.0, 29.0), at(20.0, 59.0)]), [None, None]);
        let [x, _, z] = film.head(1, &at(145.0, 29.0), 5.0).unwrap();
        assert!((z - 5.0).abs() < 0.02 && x.abs() < 0.05, "{x} {z}");
    }

    #[test]
    fn any_image_can_be_read_at_any_time() {
        let film = film(3);
        for number in [3, 1, 2, 1] {
            let bytes = film.image(number).unwrap().unwrap();
            let read = image::load_from_memory(&bytes).unwrap();
            assert_eq!((read.width(), read.height()), (320, 240));
        }
    }

    #[test]
    fn depth_comes_back_to_the_millimetre() {
        let depth = DepthImage::from_pixels(3, 1, vec![1.2345, f32::NAN, 99.0]).unwrap();
        let back = unpacked(&packed(&depth).unwrap(), 3, 1).unwrap();
        assert!((back.pixels()[0] - 1.2345).abs() <= 0.0006, "{back:?}");
        assert!(back.pixels()[1].is_nan() && back.pixels()[2].is_nan());
    }
}
