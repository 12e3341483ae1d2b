//! Frames, tracks and detections for the checks.

use std::sync::Arc;

use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_core::{
    DepthImage, Detection, EgoMotion, Estimate, Frame, Image, Images, Inputs, LaserScan, Person,
    RgbImage, RightImage, Stamp, Track, TrackId, Usage,
};
use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole};
use tagalong_math::{RandomSource, SplitMix64};

use crate::figure::{Figure, World};

/// Time between frames, s.
pub(crate) const DT_S: f64 = 0.1;

/// Returns a camera of the given width (4:3) and the field of view of a Kinect.
fn camera(width: usize, height_m: f64, pitch_down_deg: f64, roll_deg: f64) -> Camera {
    let height = width * 3 / 4;
    let focal = width as f64 * 0.82;
    let cx = 0.5 * (width as f64 - 1.0);
    let cy = 0.5 * (height as f64 - 1.0);
    let lens = Pinhole { fx: focal, fy: focal, cx, cy, distortion: Distortion::None };
    let pitch = pitch_down_deg.to_radians();
    let roll = roll_deg.to_radians();
    Camera::mounted(lens, width, height, height_m, pitch, roll)
}

/// Returns a level camera at chest height.
pub(crate) fn level() -> Arc<Camera> {
    Arc::new(camera(640, 1.2, 0.0, 0.0))
}

/// Returns the mountings with which a detector must work: level; looking down from above with a
/// roll; level at half the resolution.
pub(crate) fn mountings() -> [(&'static str, Arc<Camera>); 3] {
    [
        ("level at 1.2 m", level()),
        ("at 2.4 m, 27 degrees down, rolled by 11", Arc::new(camera(640, 2.4, 27.0, 11.0))),
        ("level at 1.2 m, 320x240", Arc::new(camera(320, 1.2, 0.0, 0.0))),
    ]
}

/// Returns a frame of a robot at rest.
pub(crate) fn frame(index: u64, camera: &Arc<Camera>, images: Images) -> Frame {
    moving_frame(index, camera, images, EgoMotion::at_rest(DT_S))
}

/// Returns a frame after a motion of the robot.
pub(crate) fn moving_frame(
    index: u64,
    camera: &Arc<Camera>,
    images: Images,
    motion: EgoMotion,
) -> Frame {
    let stamp = Stamp::from_nanos(1_000_000_000).plus_seconds(index as f64 * DT_S);
    Frame::new(index, stamp, Arc::clone(camera), motion, images)
}

/// Renders a frame of people in front of a wall, with a laser scan of it.
pub(crate) fn drawn(index: u64, camera: &Arc<Camera>, people: &[Figure]) -> Frame {
    let world = World { noise_seed: Some(index), ..World::with(people) };
    frame(index, camera, world.draw(camera)).with_laser(Some(world.scan()))
}

/// Returns frames without useful content, with their names.
pub(crate) fn odd_frames() -> Vec<(&'static str, Frame)> {
    fn flat(camera: &Arc<Camera>, grey: u8, depth: f32) -> Frame {
        let w = camera.width;
        let h = camera.height;
        let images = Images {
            colour: Some(Arc::new(RgbImage::filled(w, h, [grey; 3]))),
            grey: Some(Arc::new(Image::filled(w, h, grey))),
            depth: Some(Arc::new(DepthImage::filled(w, h, depth))),
            right: Some(Arc::new(RightImage { image: Image::filled(w, h, grey), baseline_m: 0.1 })),
        };
        // Five reflections at the scanner itself: another scan without useful content.
        let scan = LaserScan::of_points(vec![Point3::origin(); 5]);
        frame(1, camera, images).with_laser(Some(scan))
    }

    fn sized(width: usize, height: usize) -> Arc<Camera> {
        let camera = camera(640, 1.2, 0.0, 0.0);
        Arc::new(Camera { width, height, ..camera })
    }

    vec![
        ("black", flat(&level(), 0, 2.0)),
        ("white at zero depth", flat(&level(), 255, 0.0)),
        ("NaN depth", flat(&level(), 128, f32::NAN)),
        ("infinite depth", flat(&level(), 128, f32::INFINITY)),
        ("empty (0x0)", flat(&sized(0, 0), 0, 2.0)),
        ("one-pixel", flat(&sized(1, 1), 0, 2.0)),
        ("one row", flat(&sized(640, 1), 9, 2.0)),
        ("one column", flat(&sized(1, 480), 9, 2.0)),
    ]
}

/// Returns a frame of an ordinary camera without any image.
pub(crate) fn bare_frame() -> Frame {
    frame(1, &level(), Images::default())
}

/// Returns the frame with only these inputs.
pub(crate) fn restricted(frame: Frame, inputs: &Inputs) -> Frame {
    frame.restricted_to(inputs).unwrap_or(frame)
}

/// Returns those of these inputs that are required.
pub(crate) fn required(inputs: &Inputs) -> Inputs {
    inputs.of(Usage::Optional).fold(*inputs, Inputs::without)
}

/// Returns a confirmed track at a position, at rest, with a standard deviation of `sigma_m`.
pub(crate) fn track(id: u32, head: Point3<f64>, sigma_m: f64, camera: &Camera) -> Track {
    let mut covariance = SMatrix::<f64, 5, 5>::identity() * (sigma_m * sigma_m);
    covariance[(3, 3)] = 0.05;
    covariance[(4, 4)] = 0.05;
    let person = Person { position: head, velocity: Vector2::zeros() };
    let estimate = Estimate::new(person, covariance, camera.upper_body(&head));
    Track::new(TrackId(id), estimate, 3.0).with_age(20)
}

/// Simulates a detection of a person with an error of `sigma_m`.
pub(crate) fn sighting(
    head: &Point3<f64>,
    camera: &Camera,
    sigma_m: f64,
    random: &mut SplitMix64,
) -> Detection {
    let error = nalgebra::Vector3::from_fn(|_, _| sigma_m * random.normal());
    let position = head + error;
    // At least 1 cm of standard deviation, because filters invert the covariance.
    let covariance = nalgebra::Matrix3::identity() * (sigma_m * sigma_m).max(1e-4);
    Detection::new("conformance", position, covariance, 3.0)
        .with_image(ImageBox::upper_body(camera.upper_body(&position)))
}

/// Returns the mirror images.
pub(crate) fn mirrored(images: &Images) -> Images {
    fn reversed<P: Copy>(image: &Image<P>) -> Image<P> {
        let w = image.width();
        let h = image.height();
        Image::from_fn(w, h, |x, y| image.row(y)[w - 1 - x])
    }
    fn flip<P: Copy>(image: &Arc<Image<P>>) -> Arc<Image<P>> {
        Arc::new(reversed(image))
    }
    Images {
        colour: images.colour.as_ref().map(flip),
        grey: images.grey.as_ref().map(flip),
        depth: images.depth.as_ref().map(flip),
        right: images.right.as_ref().map(|right| {
            Arc::new(RightImage { image: reversed(&right.image), baseline_m: right.baseline_m })
        }),
    }
}
