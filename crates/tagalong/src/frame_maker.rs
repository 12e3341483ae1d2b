use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3};
use tagalong_core::{
    DepthImage, EgoMotion, Frame, GreyImage, Images, Input, LaserScan, MAX_ODOMETRY_GAP_S,
    MAX_ODOMETRY_STEP_M, MAX_ODOMETRY_STEP_RAD, RgbImage, RightImage, Sensor, Sensors, Stamp,
};
use tagalong_geometry::Camera;
use tagalong_pipeline::Sources;

use crate::{Error, Result};

/// Standard deviation of odometry as a fraction of the travel, as in logs.
const ODOMETRY_SIGMA: f64 = 0.02;

/// Maker of frames from images, scans and poses of the caller. It numbers the frames, and turns the
/// poses of the robot into the motion between two frames.
#[derive(Clone, Debug)]
pub struct FrameMaker {
    camera: Arc<Camera>,
    odometry_sigma: f64,
    count: u64,
    /// Time and pose of the newest frame.
    previous: Option<(Stamp, Isometry2<f64>)>,
}

/// The frame of one moment while it is built: the data of the sensors are added to it.
#[must_use = "`frame` makes the frame of it"]
pub struct Moment<'m> {
    maker: &'m mut FrameMaker,
    stamp: Stamp,
    camera: Arc<Camera>,
    index: Option<u64>,
    images: Images,
    /// Readings of sensors other than cameras.
    sensors: Sensors,
    pose: Option<Isometry2<f64>>,
    odometry_age_s: f64,
}

impl FrameMaker {
    /// Creates a maker of frames with images of this camera.
    pub fn new(camera: impl Into<Arc<Camera>>) -> Self {
        Self { camera: camera.into(), odometry_sigma: ODOMETRY_SIGMA, count: 0, previous: None }
    }

    /// Creates a maker of frames without images, for example of a laser scanner only.
    pub fn without_camera() -> Self {
        Self::new(Camera::blind(Isometry3::identity()))
    }

    /// Sets the standard deviation of the robot's odometry, as a fraction of the travel.
    pub fn with_odometry_sigma(self, odometry_sigma: f64) -> Self {
        Self { odometry_sigma, ..self }
    }

    /// Begins the frame of this time.
    pub fn at(&mut self, stamp: Stamp) -> Moment<'_> {
        Moment {
            stamp,
            camera: Arc::clone(&self.camera),
            index: None,
            images: Images::default(),
            sensors: Sensors::default(),
            pose: None,
            odometry_age_s: 0.0,
            maker: self,
        }
    }

    /// Returns the motion since the previous frame, and true if the odometry has jumped.
    fn motion(&mut self, stamp: Stamp, pose: Option<Isometry2<f64>>) -> (EgoMotion, bool) {
        // Without a pose the robot is assumed to be at rest.
        let last = self.previous.map_or_else(Isometry2::identity, |(_, pose)| pose);
        let here = pose.unwrap_or(last);
        let previous = self.previous.replace((stamp, here));
        let Some((then, before)) = previous else { return (EgoMotion::at_rest(0.0), false) };
        let dt_s = stamp.seconds_since(then);
        let step_m = (here.translation.vector - before.translation.vector).norm();
        let turned_rad = before.rotation.angle_to(&here.rotation).abs();
        let is_large = step_m > MAX_ODOMETRY_STEP_M || turned_rad > MAX_ODOMETRY_STEP_RAD;
        // After a long gap a large step may be real motion.
        if is_large && (0.0..=MAX_ODOMETRY_GAP_S).contains(&dt_s) {
            return (EgoMotion::unknown(dt_s), true);
        }
        (EgoMotion::between(&before, &here, dt_s, self.odometry_sigma), false)
    }
}

impl Moment<'_> {
    /// Sets the camera of this frame, instead of that of the maker.
    pub fn camera(mut self, camera: impl Into<Arc<Camera>>) -> Self {
        self.camera = camera.into();
        self
    }

    /// Sets the number of the frame; without it frames are counted from 1.
    pub fn index(mut self, index: u64) -> Self {
        self.index = Some(index);
        self
    }

    /// Adds the colour image.
    pub fn colour(mut self, image: impl Into<Arc<RgbImage>>) -> Self {
        self.images.colour = Some(image.into());
        self
    }

    /// Adds the intensity image of a camera without colour.
    pub fn grey(mut self, image: impl Into<Arc<GreyImage>>) -> Self {
        self.images.grey = Some(image.into());
        self
    }

    /// Adds the depth image: metres along the optical axis, registered to the colour image. NaN,
    /// infinity, 0 and negative numbers mean that there is no reading.
    /// [`DepthImage::from_millimetres`] converts the millimetres of a depth camera.
    pub fn depth(mut self, image: impl Into<Arc<DepthImage>>) -> Self {
        self.images.depth = Some(image.into());
        self
    }

    /// Adds the right image of a rectified stereo pair, with the baseline of the pair, m.
    pub fn right(mut self, image: GreyImage, baseline_m: f64) -> Self {
        self.images.right = Some(Arc::new(RightImage { image, baseline_m }));
        self
    }

    /// Adds all images at once; they replace those that were added before.
    pub fn images(mut self, images: Images) -> Self {
        self.images = images;
        self
    }

    /// Adds the laser scan, in the robot frame.
    pub fn laser(self, scan: LaserScan) -> Self {
        self.sensor(scan)
    }

    /// Adds the reading of any other sensor, and replaces one of the same type. The type is one of the
    /// program's own that implements [`Sensor`], or one of Tagalong that has no function here. Plugins
    /// that declare [`Sensor::INPUT`] read it with `Frame::sensor`.
    ///
    /// ```
    /// use tagalong::prelude::*;
    ///
    /// /// Distances of the echoes of a radar, m.
    /// struct Radar(Vec<f64>);
    ///
    /// impl Sensor for Radar {
    ///     const INPUT: Input = Input::Named("radar");
    /// }
    ///
    /// let mut frames = FrameMaker::without_camera();
    /// let frame = frames.at(Stamp::default()).sensor(Radar(vec![2.5])).frame()?;
    /// assert_eq!(frame.sensor::<Radar>()?.0, [2.5]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn sensor<S: Sensor>(mut self, reading: S) -> Self {
        self.sensors = self.sensors.with(reading);
        self
    }

    /// Adds the pose of the robot in the odometry frame. Without one the robot is assumed to be at rest.
    pub fn pose(mut self, odom_from_robot: Isometry2<f64>) -> Self {
        self.pose = Some(odom_from_robot);
        self
    }

    /// Sets the age of the odometry that the pose comes from, s; 0 if this is not called. A robot is not
    /// steered by old odometry.
    pub fn odometry_age_s(mut self, age_s: f64) -> Self {
        self.odometry_age_s = age_s;
        self
    }

    /// Returns the sources of data that this frame offers to a controller; see
    /// `Pipeline::check_sources`.
    pub fn sources(&self) -> Sources {
        Sources {
            depth: self.images.depth.is_some(),
            right: self.images.right.is_some(),
            laser: self.sensors.get::<LaserScan>().is_some(),
            odometry: self.pose.is_some(),
        }
    }

    /// Makes the frame.
    ///
    /// # Errors
    /// [`Error::Frame`]: images whose size is not that of the camera, images without a camera,
    /// images added with [`Moment::sensor`], and a pose, an age or a baseline with impossible
    /// numbers.
    pub fn frame(self) -> Result<Frame> {
        if let Some(why) = self.mistake() {
            return Err(Error::Frame { stamp: self.stamp, why });
        }
        // An infinite age keeps a controller from steering without odometry.
        let age_s = if self.pose.is_some() { self.odometry_age_s } else { f64::INFINITY };
        let (motion, has_jumped) = self.maker.motion(self.stamp, self.pose);
        self.maker.count += 1;
        let index = self.index.unwrap_or(self.maker.count);
        let mut images = self.images;
        images.depth = images.depth.map(with_holes);
        let sensors = images.add_to(self.sensors, &self.camera);
        Ok(Frame::of_sensors(index, self.stamp, self.camera, motion, sensors)
            .with_odometry_age(age_s)
            .with_odometry_jump(has_jumped))
    }

    /// Returns the reason why no frame can be made from the data, if there is one.
    fn mistake(&self) -> Option<String> {
        self.misfit().or_else(|| {
            // Images have functions of their own, which check their size.
            let images = [Input::Colour, Input::Depth, Input::Right];
            if let Some(image) = images.into_iter().find(|image| self.sensors.holds(*image)) {
                let name = image.name();
                return Some(format!("`sensor` takes no {name} images; add them by `{name}`"));
            }
            if self.images.right.as_ref().is_some_and(|right| !is_distance(right.baseline_m)) {
                return Some(
                    "the baseline is the distance of the two cameras, m; give one above 0"
                        .to_owned(),
                );
            }
            if self.pose.is_some_and(|pose| !is_finite(&pose)) {
                return Some("the pose has numbers that are not finite; leave it out".to_owned());
            }
            // Written as `>=`, so that NaN is rejected.
            let has_age = self.odometry_age_s >= 0.0;
            let age_s = self.odometry_age_s;
            (!has_age).then(|| format!("odometry_age_s is {age_s}; give 0 or more"))
        })
    }

    /// Returns a message about an image whose size is not that of the camera, if there is one.
    fn misfit(&self) -> Option<String> {
        let Images { colour, grey, depth, right } = &self.images;
        let sizes = [
            ("colour", colour.as_ref().map(|image| (image.width(), image.height()))),
            ("grey", grey.as_ref().map(|image| (image.width(), image.height()))),
            ("depth", depth.as_ref().map(|image| (image.width(), image.height()))),
            ("right", right.as_ref().map(|right| (right.image.width(), right.image.height()))),
        ];
        let wanted = (self.camera.width, self.camera.height);
        for (name, size) in sizes {
            let Some((width, height)) = size else { continue };
            if self.camera.is_blind() {
                return Some(format!("there is a {name} image and no camera: give its camera"));
            }
            if (width, height) != wanted {
                return Some(format!(
                    "{name} has {width} x {height} pixels and the camera {} x {}; register depth to \
                     colour, or give the camera of these images",
                    wanted.0, wanted.1
                ));
            }
        }
        None
    }
}

/// Returns a depth image with NaN wherever there is no reading. Plugins test for NaN only, and the
/// caller's image may have zeros.
fn with_holes(depth: Arc<DepthImage>) -> Arc<DepthImage> {
    fn is_plain(metres: f32) -> bool {
        metres.is_nan() || DepthImage::is_reading(metres)
    }

    if depth.pixels().iter().all(|metres| is_plain(*metres)) {
        return depth;
    }
    Arc::new(depth.map(|metres| if is_plain(metres) { metres } else { f32::NAN }))
}

fn is_distance(value_m: f64) -> bool {
    value_m > 0.0 && value_m.is_finite()
}

fn is_finite(pose: &Isometry2<f64>) -> bool {
    let numbers = [pose.translation.x, pose.translation.y, pose.rotation.angle()];
    numbers.iter().all(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use tagalong_core::CameraImage;
    use tagalong_geometry::Pinhole;

    use super::*;

    fn maker() -> FrameMaker {
        FrameMaker::new(Camera::mounted(Pinhole::centred(50.0, 8, 6), 8, 6, 1.2, 0.0, 0.0))
    }

    fn at(seconds: f64) -> Stamp {
        Stamp::default().plus_seconds(seconds)
    }

    fn pose(x: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, 0.0), 0.0)
    }

    #[test]
    fn poses_become_motions_and_frames_are_counted() {
        let mut maker = maker();
        let first = maker.at(at(1.0)).pose(pose(0.0)).frame().unwrap();
        assert_eq!((first.index, first.motion), (1, EgoMotion::at_rest(0.0)));
        let second = maker.at(at(1.1)).pose(pose(0.05)).frame().unwrap();
        assert_eq!(second.index, 2);
        assert!((second.motion.forward - 0.05).abs() < 1e-12, "{:?}", second.motion);
        assert!((second.motion.dt - 0.1).abs() < 1e-9);
        assert_eq!(second.odometry_age_s, 0.0);
        let without = maker.at(at(1.2)).index(9).frame().unwrap();
        assert_eq!((without.index, without.odometry_age_s), (9, f64::INFINITY));
    }

    #[test]
    fn a_jump_of_the_odometry_is_marked_and_a_long_way_over_a_gap_is_none() {
        let mut maker = maker();
        maker.at(at(1.0)).pose(pose(0.0)).frame().unwrap();
        let jumped = maker.at(at(1.1)).pose(pose(1.5)).frame().unwrap();
        assert!(jumped.odometry_jumped);
        assert_eq!(jumped.motion.forward, 0.0, "the motion is unknown");
        let travelled = maker.at(at(3.1)).pose(pose(3.5)).frame().unwrap();
        assert!(!travelled.odometry_jumped);
        assert!((travelled.motion.forward - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_heading_that_jumps_is_marked_and_a_fast_turn_is_none() {
        let mut maker = maker();
        maker.at(at(1.0)).pose(pose(0.0)).frame().unwrap();
        let turned = Isometry2::new(Vector2::zeros(), 0.3);
        assert!(!maker.at(at(1.1)).pose(turned).frame().unwrap().odometry_jumped);
        let jumped = maker.at(at(1.2)).pose(Isometry2::new(Vector2::zeros(), 2.0)).frame();
        let jumped = jumped.unwrap();
        assert!(jumped.odometry_jumped);
        assert_eq!(jumped.motion.turn, 0.0, "the motion is unknown");
        let back = maker.at(at(1.3)).pose(Isometry2::new(Vector2::zeros(), 0.1)).frame();
        assert!(back.unwrap().odometry_jumped, "to the right");
    }

    #[test]
    fn depths_that_are_no_reading_become_nan_and_other_images_are_not_copied() {
        let mut maker = maker();
        let odd = [0.0, -1.0, f32::INFINITY, f32::NAN, 2.5];
        let depth = DepthImage::from_fn(8, 6, |x, y| odd[(8 * y + x) % 5]);
        let frame = maker.at(at(1.0)).depth(depth).frame().unwrap();
        let read: Vec<f32> =
            frame.depth().unwrap().pixels().iter().copied().filter(|m| !m.is_nan()).collect();
        assert_eq!(read, [2.5; 9]);
        let plain = Arc::new(DepthImage::from_fn(8, 6, |x, _| if x == 0 { f32::NAN } else { 2.0 }));
        let frame = maker.at(at(1.1)).depth(Arc::clone(&plain)).frame().unwrap();
        assert!(std::ptr::eq(frame.depth().unwrap(), &*plain));
    }

    /// Distances of echoes, m.
    struct Sonar(f64);

    impl Sensor for Sonar {
        const INPUT: Input = Input::Named("sonar");
    }

    #[test]
    fn sensors_of_any_type_are_beside_the_images_and_the_newest_of_a_type_counts() {
        let mut maker = maker();
        let moment = maker.at(at(1.0)).sensor(Sonar(2.0)).sensor(Sonar(3.0));
        let moment = moment.depth(DepthImage::filled(8, 6, 1.0)).sensor(LaserScan::of_points([]));
        let sources = moment.sources();
        assert!(sources.depth && sources.laser, "{sources:?}");
        let frame = moment.frame().unwrap();
        assert_eq!(frame.sensor::<Sonar>().unwrap().0, 3.0);
        assert!(frame.depth().is_ok() && frame.scan().is_ok());
        let next = maker.at(at(1.1)).frame().unwrap();
        assert!(next.sensor::<Sonar>().is_err(), "a reading is of one moment");
    }

    #[test]
    fn what_makes_no_frame_is_refused_with_the_remedy() {
        let mut maker = maker();
        fn small() -> DepthImage {
            DepthImage::filled(4, 4, 1.0)
        }
        let right = GreyImage::filled(8, 6, 0);
        let mut blind = FrameMaker::without_camera();
        let camera = Arc::clone(&maker.camera);
        let unsized_depth = CameraImage { image: Arc::new(small()), camera };
        let cases = [
            (
                maker.at(at(1.0)).depth(small()).frame(),
                "depth has 4 x 4 pixels and the camera 8 x 6",
            ),
            (maker.at(at(1.0)).right(right, 0.0).frame(), "the baseline is the distance"),
            (maker.at(at(1.0)).pose(pose(f64::NAN)).frame(), "the pose has numbers"),
            (maker.at(at(1.0)).pose(pose(0.0)).odometry_age_s(f64::NAN).frame(), "give 0 or more"),
            (maker.at(at(1.0)).sensor(unsized_depth).frame(), "add them by `depth`"),
            (blind.at(at(1.0)).depth(small()).frame(), "there is a depth image and no camera"),
        ];
        for (made, words) in cases {
            let shown = made.err().unwrap().to_string();
            assert!(
                shown.contains("the frame at 1.000000000 s") && shown.contains(words),
                "{shown}"
            );
        }
        assert_eq!(maker.at(at(1.0)).frame().unwrap().index, 1, "they are not counted");
    }
}
