use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::Translation3;
use tagalong_geometry::Camera;

use crate::{
    CameraImage, DepthImage, EgoMotion, Error, ExternalDetection, ExternalDetections, FurtherScans,
    GreyImage, Input, Inputs, LaserScan, Result, RgbImage, RightImage, Sensor, Sensors, Stamp,
};

/// Images of one moment and one camera. All have the size of the camera's image, and show the same view unless the
/// name says otherwise.
#[derive(Clone, Debug, Default)]
pub struct Images {
    /// Colour.
    pub colour: Option<Arc<RgbImage>>,
    /// Intensity, if the log carries no colour.
    pub grey: Option<Arc<GreyImage>>,
    /// Depth, registered to the colour image.
    pub depth: Option<Arc<DepthImage>>,
    /// The right-hand image of a rectified stereo pair.
    pub right: Option<Arc<RightImage>>,
}

impl Images {
    /// Returns the images as data of sensors, with the camera that took them; the right camera of a
    /// stereo pair is its copy beside it.
    pub fn taken_by(self, camera: &Arc<Camera>) -> Sensors {
        self.add_to(Sensors::default(), camera)
    }

    /// Returns the sensors with the images added as [`Images::taken_by`] returns them.
    pub fn add_to(self, sensors: Sensors, camera: &Arc<Camera>) -> Sensors {
        let Self { colour, grey, depth, right } = self;
        let sensors = with_image(sensors, colour, camera);
        let sensors = with_image(with_image(sensors, grey, camera), depth, camera);
        match right {
            Some(image) => sensors.with(CameraImage { camera: beside(camera, &image), image }),
            None => sensors,
        }
    }
}

/// Adds an image to the sensors, if there is one.
fn with_image<T>(sensors: Sensors, image: Option<Arc<T>>, camera: &Arc<Camera>) -> Sensors
where
    CameraImage<T>: Sensor,
{
    match image {
        Some(image) => sensors.with(CameraImage { image, camera: Arc::clone(camera) }),
        None => sensors,
    }
}

/// Returns the right camera of a rectified stereo pair: the left one, moved along its image rows.
fn beside(left: &Camera, image: &RightImage) -> Arc<Camera> {
    let step = Translation3::new(image.baseline_m, 0.0, 0.0);
    Arc::new(Camera { robot_from_camera: left.robot_from_camera * step, ..left.clone() })
}

/// Data computed from a frame and shared by several plugins; see [`Frame::derived`].
///
/// ```
/// # use tagalong_core::*;
/// # use nalgebra::Isometry3;
/// # use tagalong_geometry::Camera;
/// /// Distance of the nearest point of the laser scan, m.
/// struct Clearance(f64);
///
/// impl Derived for Clearance {
///     fn derive(frame: &Frame) -> Result<Self> {
///         let ranges = frame.scan()?.points.iter().map(|point| point.coords.norm());
///         Ok(Self(ranges.fold(f64::INFINITY, f64::min)))
///     }
/// }
///
/// let sensors = Sensors::default().with(LaserScan::of_points([[3.0, 4.0, 0.0].into()]));
/// let (blind, motion) = (Camera::blind(Isometry3::identity()).into(), EgoMotion::at_rest(0.1));
/// let frame = Frame::of_sensors(1, Stamp::default(), blind, motion, sensors);
/// assert_eq!(frame.derived::<Clearance>()?.0, 5.0);
/// # Ok::<(), Error>(())
/// ```
pub trait Derived: Send + Sync + Sized + 'static {
    /// Computes the data.
    ///
    /// # Errors
    /// If the frame lacks an image that the computation needs.
    fn derive(frame: &Frame) -> Result<Self>;
}

/// Derived data, or the error of their computation.
type Slot = OnceLock<Result<Arc<dyn Any + Send + Sync>>>;

/// One moment of a log: the data of the sensors, and the robot's motion since the previous frame. A
/// frame is immutable; data that plugins derive from it are computed once, on first use.
pub struct Frame {
    /// 1-based index of the image in the log.
    pub index: u64,
    /// Capture time of the frame.
    pub stamp: Stamp,
    /// The camera to which boxes in the image refer; [`Camera::blind`] in a frame without images.
    pub camera: Arc<Camera>,
    /// The robot's motion since the previous frame.
    pub motion: EgoMotion,
    /// True if the camera was calibrated anew since the first frame, while `camera` stayed as it was:
    /// positions from the images are wrong.
    pub calibration_changed: bool,
    /// Age of the newest odometry at the time of the frame, s; infinite if there never was any. A
    /// robot is not steered by old odometry.
    pub odometry_age_s: f64,
    /// True if odometry has jumped since the previous frame: where the robot drove is unknown, and
    /// a robot that is steered stops.
    pub odometry_jumped: bool,
    /// Age of the pose of the camera on the robot at the time of the frame, s: that of the oldest
    /// moving transform to it; 0 where nothing moves. A robot is not steered by an old one.
    pub camera_pose_age_s: f64,
    /// Time from the capture of the frame until it was handed over, s, by the clock of the stamps;
    /// `None` where there is no such clock, as for a log.
    pub latency_s: Option<f64>,
    /// Inputs that the source of the frames reads besides what the frames are made of: a frame that
    /// lacks one of them is one of a silent sensor, also if it never delivered.
    pub expected: Inputs,
    sensors: Sensors,
    grey: OnceLock<Arc<GreyImage>>,
    derived: Mutex<BTreeMap<TypeId, Arc<Slot>>>,
}

impl Frame {
    /// Creates a frame of the images of its camera.
    pub fn new(
        index: u64,
        stamp: Stamp,
        camera: Arc<Camera>,
        motion: EgoMotion,
        images: Images,
    ) -> Self {
        let sensors = images.taken_by(&camera);
        Self::of_sensors(index, stamp, camera, motion, sensors)
    }

    /// Creates a frame of the data of any sensors.
    pub fn of_sensors(
        index: u64,
        stamp: Stamp,
        camera: Arc<Camera>,
        motion: EgoMotion,
        sensors: Sensors,
    ) -> Self {
        Self {
            index,
            stamp,
            camera,
            motion,
            calibration_changed: false,
            odometry_age_s: 0.0,
            odometry_jumped: false,
            camera_pose_age_s: 0.0,
            latency_s: None,
            expected: Inputs::NONE,
            sensors,
            grey: OnceLock::new(),
            derived: Mutex::default(),
        }
    }

    /// Returns the frame with [`Frame::calibration_changed`] as given.
    pub fn with_changed_calibration(self, calibration_changed: bool) -> Self {
        Self { calibration_changed, ..self }
    }

    /// Returns the frame with [`Frame::odometry_age_s`] as given.
    pub fn with_odometry_age(self, odometry_age_s: f64) -> Self {
        Self { odometry_age_s, ..self }
    }

    /// Returns the frame with [`Frame::odometry_jumped`] as given.
    pub fn with_odometry_jump(self, odometry_jumped: bool) -> Self {
        Self { odometry_jumped, ..self }
    }

    /// Returns the frame with [`Frame::camera_pose_age_s`] as given.
    pub fn with_camera_pose_age(self, camera_pose_age_s: f64) -> Self {
        Self { camera_pose_age_s, ..self }
    }

    /// Returns the frame with [`Frame::latency_s`] as given.
    pub fn with_latency(self, latency_s: Option<f64>) -> Self {
        Self { latency_s, ..self }
    }

    /// Returns the frame with [`Frame::expected`] as given.
    pub fn with_expected(self, expected: Inputs) -> Self {
        Self { expected, ..self }
    }

    /// Returns the frame with the data of one more sensor, in place of data of the same type.
    pub fn with_sensor<S: Sensor>(self, sensor: S) -> Self {
        self.of_same_moment(self.sensors.clone().with(sensor))
    }

    /// Returns the data of a sensor.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the frame carries none.
    pub fn sensor<S: Sensor>(&self) -> Result<&S> {
        self.sensors.get().ok_or(Error::MissingImage { input: S::INPUT })
    }

    /// Returns the data of all sensors.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Returns the frame with the detections that an external detector recorded, if any.
    pub fn with_recorded(self, recorded: Option<Vec<ExternalDetection>>) -> Self {
        let Some(detections) = recorded else { return self };
        let camera = Arc::clone(&self.camera);
        self.with_sensor(ExternalDetections::new(detections, camera))
    }

    /// Returns the detections that an external detector recorded; `None` if no topic is configured
    /// for them (`[input] detections_topic`).
    pub fn recorded(&self) -> Option<&[ExternalDetection]> {
        self.sensors.get::<ExternalDetections>().map(|recorded| &recorded.detections[..])
    }

    /// Returns the frame with a laser scan, if there is one.
    pub fn with_laser(self, laser: Option<LaserScan>) -> Self {
        match laser {
            Some(scan) => self.with_sensor(scan),
            None => self,
        }
    }

    /// Returns the laser scan, in the robot frame at the time of the frame; `None` without a
    /// scanner, or if it delivered no scan.
    pub fn laser(&self) -> Option<&LaserScan> {
        self.sensors.get()
    }

    /// Yields the scans of all laser scanners: [`Frame::laser`] and those of further ones.
    pub fn scans(&self) -> impl Iterator<Item = &LaserScan> {
        self.laser().into_iter().chain(self.further_scans().iter().flatten())
    }

    /// Returns the scans of further laser scanners, each in a place of its own; `None` where a scanner
    /// is silent.
    pub fn further_scans(&self) -> &[Option<LaserScan>] {
        self.sensors.get::<FurtherScans>().map_or(&[], |further| &further.0)
    }

    /// Returns the laser scan, for plugins that require one.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn scan(&self) -> Result<&LaserScan> {
        self.sensor()
    }

    /// Returns the same moment with a depth image. Derived data are not copied.
    pub fn with_depth(&self, depth: Arc<DepthImage>) -> Self {
        let taken = CameraImage { image: depth, camera: Arc::clone(&self.camera) };
        let frame = self.of_same_moment(self.sensors.clone().with(taken));
        // Derived data may depend on the depth image and are left behind; the grey image does not.
        Self { grey: self.grey.clone(), ..frame }
    }

    /// Returns the same moment with other images of the frame's camera; a kind that `images` lacks stays.
    /// Derived data are not copied.
    pub fn with_images(&self, images: Images) -> Self {
        self.of_same_moment(images.add_to(self.sensors.clone(), &self.camera))
    }

    /// Returns the same moment, seen by another camera. The data of the sensors are shared; derived
    /// data are not copied.
    pub fn with_camera(&self, camera: Arc<Camera>) -> Self {
        let frame = self.of_same_moment(self.sensors.clone());
        Self { camera, ..frame }
    }

    /// Returns true if the frame holds this input.
    pub fn holds(&self, input: Input) -> bool {
        self.sensors.holds(input)
    }

    /// Returns the same moment with the declared inputs alone; `None` if it holds no others. Images
    /// are shared, not copied.
    pub fn restricted_to(&self, inputs: &Inputs) -> Option<Self> {
        // The new frame starts without derived data, which may stem from the withheld inputs.
        (!self.sensors.are_within(inputs))
            .then(|| self.of_same_moment(self.sensors.restricted_to(inputs)))
    }

    /// Returns the images of the log.
    pub fn images(&self) -> Images {
        Images {
            colour: self.image().map(Arc::clone),
            grey: self.image().map(Arc::clone),
            depth: self.image().map(Arc::clone),
            right: self.image().map(Arc::clone),
        }
    }

    /// Returns the colour image.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn colour(&self) -> Result<&RgbImage> {
        self.required_image()
    }

    /// Returns the depth image: metres along the optical axis, NaN = no reading.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn depth(&self) -> Result<&DepthImage> {
        self.required_image()
    }

    /// Returns the right image of a stereo pair.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn right(&self) -> Result<&RightImage> {
        self.required_image()
    }

    /// Returns the intensity image, converted from colour if the log carries only that.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries neither.
    pub fn grey(&self) -> Result<&GreyImage> {
        if let Some(grey) = self.image::<GreyImage>() {
            return Ok(grey);
        }
        let colour = self.colour()?;
        Ok(self.grey.get_or_init(|| Arc::new(colour.to_grey())))
    }

    /// Returns the derived data `T` of this frame, computed on the first call and shared
    /// afterwards.
    ///
    /// # Errors
    /// The error of [`Derived::derive`].
    pub fn derived<T: Derived>(&self) -> Result<Arc<T>> {
        // The lock covers the lookup alone: `derive` may itself request other derived data of the
        // frame, which would deadlock under the lock.
        let slot = {
            let mut slots = self.derived.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(slots.entry(TypeId::of::<T>()).or_default())
        };
        let shared = slot.get_or_init(|| Ok(Arc::new(T::derive(self)?))).clone()?;
        shared.downcast::<T>().map_err(|_| Error::Other("a derived image changed its type".into()))
    }

    /// Returns a frame of the same moment with other sensors, without derived data.
    fn of_same_moment(&self, sensors: Sensors) -> Self {
        let camera = Arc::clone(&self.camera);
        Self::of_sensors(self.index, self.stamp, camera, self.motion, sensors)
            .with_changed_calibration(self.calibration_changed)
            .with_odometry_age(self.odometry_age_s)
            .with_odometry_jump(self.odometry_jumped)
            .with_camera_pose_age(self.camera_pose_age_s)
            .with_latency(self.latency_s)
            .with_expected(self.expected)
    }

    /// Returns the image of a kind, if the frame carries one.
    fn image<T: 'static>(&self) -> Option<&Arc<T>>
    where
        CameraImage<T>: Sensor,
    {
        self.sensors.get::<CameraImage<T>>().map(|taken| &taken.image)
    }

    /// Returns the image of a kind.
    fn required_image<T: 'static>(&self) -> Result<&T>
    where
        CameraImage<T>: Sensor,
    {
        self.sensor::<CameraImage<T>>().map(|taken| &*taken.image)
    }
}

impl AsRef<Frame> for Frame {
    fn as_ref(&self) -> &Self {
        self
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use nalgebra::Point3;

    use super::*;
    use tagalong_geometry::Pinhole;

    static COMPUTED: AtomicUsize = AtomicUsize::new(0);

    struct Mean(f64);

    impl Derived for Mean {
        fn derive(frame: &Frame) -> Result<Self> {
            COMPUTED.fetch_add(1, Ordering::Relaxed);
            let depth = frame.depth()?.pixels();
            Ok(Self(depth.iter().map(|d| f64::from(*d)).sum::<f64>() / depth.len() as f64))
        }
    }

    fn frame(images: Images) -> Frame {
        let camera = Arc::new(Camera::mounted(Pinhole::centred(5.0, 4, 4), 4, 4, 1.0, 0.0, 0.0));
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.0), images)
    }

    #[test]
    fn derived_things_are_computed_once() {
        let depth = Some(Arc::new(DepthImage::filled(4, 4, 2.0)));
        let frame = frame(Images { depth, ..Images::default() });
        assert_eq!(frame.derived::<Mean>().unwrap().0, 2.0);
        assert_eq!(frame.derived::<Mean>().unwrap().0, 2.0);
        assert_eq!(COMPUTED.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn depth_that_is_added_leaves_the_rest() {
        let laser = LaserScan::of_points([Point3::new(1.0, 0.5, 0.2)]);
        let frame = frame(Images::default()).with_laser(Some(laser)).with_recorded(Some(vec![]));
        let frame = frame.with_changed_calibration(true).with_odometry_jump(true);
        let with_depth = frame.with_depth(Arc::new(DepthImage::filled(4, 4, 2.0)));
        assert!(with_depth.calibration_changed && with_depth.odometry_jumped);
        assert!(with_depth.depth().is_ok());
        assert_eq!(with_depth.laser().unwrap().points[..], [Point3::new(1.0, 0.5, 0.2)]);
        assert_eq!(with_depth.recorded().map(<[_]>::len), Some(0));
        assert!(with_depth.images().depth.is_some() && with_depth.images().colour.is_none());
    }

    #[test]
    fn another_camera_leaves_the_rest() {
        let depth = Some(Arc::new(DepthImage::filled(4, 4, 2.0)));
        let frame = frame(Images { depth, ..Images::default() })
            .with_changed_calibration(true)
            .with_odometry_age(0.3)
            .with_latency(Some(0.1));
        let higher = Arc::new(Camera::clone(&frame.camera));
        let other = frame.with_camera(Arc::clone(&higher));
        assert!(Arc::ptr_eq(&other.camera, &higher) && other.depth().is_ok());
        let kept = (other.calibration_changed, other.odometry_age_s, other.latency_s);
        assert_eq!(kept, (true, 0.3, Some(0.1)));
    }

    #[test]
    fn only_declared_inputs_are_left() {
        fn held(frame: &Frame) -> [bool; 5] {
            let Images { colour, grey, depth, right } = frame.images();
            let laser = frame.laser().is_some();
            let recorded = frame.recorded().is_some();
            assert_eq!(colour.is_some(), grey.is_some());
            [colour.is_some(), depth.is_some(), right.is_some(), laser, recorded]
        }

        let colour = RgbImage::filled(4, 4, [9; 3]);
        let grey = GreyImage::filled(4, 4, 9);
        let right = RightImage { image: grey.clone(), baseline_m: 0.1 };
        let images = Images {
            colour: Some(Arc::new(colour)),
            grey: Some(Arc::new(grey)),
            depth: Some(Arc::new(DepthImage::filled(4, 4, 2.0))),
            right: Some(Arc::new(right)),
        };
        let frame =
            frame(images).with_laser(Some(LaserScan::of_points([]))).with_recorded(Some(vec![]));
        assert!(frame.restricted_to(&Inputs::ANY).is_none(), "nothing has to go");
        for (place, input) in Input::ALL.into_iter().enumerate() {
            let alone = frame.restricted_to(&Inputs::NONE.require(input)).unwrap();
            let expected: [bool; 5] = std::array::from_fn(|i| i == place);
            assert_eq!((held(&alone), alone.index), (expected, frame.index), "{input}");
            let others = frame.restricted_to(&Inputs::ANY.without(input)).unwrap();
            assert_eq!(held(&others), expected.map(|is| !is), "{input}");
            assert!(others.restricted_to(&Inputs::ANY.without(input)).is_none());
        }
    }

    #[test]
    fn a_missing_image_is_named() {
        let frame = frame(Images::default());
        assert_eq!(
            frame.depth().unwrap_err().to_string(),
            "needs depth images, which this frame does not have"
        );
        assert!(frame.colour().is_err() && frame.right().is_err());
        assert!(frame.grey().unwrap_err().to_string().contains("colour or grey"));
    }

    #[test]
    fn grey_comes_from_colour() {
        let colour = Some(Arc::new(RgbImage::filled(4, 4, [255, 0, 0])));
        let frame = frame(Images { colour, ..Images::default() });
        assert_eq!(frame.grey().unwrap().get(0, 0), Some(76));
    }
}
