use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::{
    DepthImage, EgoMotion, Error, ExternalDetection, GreyImage, Input, Inputs, LaserScan, Result,
    RgbImage, Stamp,
};
use tagalong_geometry::Camera;

/// Images of one moment. All have the size of the camera's image, and show the same view unless the
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

/// The right-hand image of a rectified stereo pair.
#[derive(Clone, Debug, PartialEq)]
pub struct RightImage {
    /// The image.
    pub image: GreyImage,
    /// Distance between the two cameras, m.
    pub baseline_m: f64,
}

/// Data computed from a frame and shared by several plugins; see [`Frame::derived`].
pub trait Derived: Send + Sync + Sized + 'static {
    /// Computes the data.
    ///
    /// # Errors
    /// If the frame lacks an image that the computation needs.
    fn derive(frame: &Frame) -> Result<Self>;
}

/// Derived data, or the error of their computation.
type Slot = OnceLock<Result<Arc<dyn Any + Send + Sync>>>;

/// One moment of a log: images or a laser scan, the camera, and the robot's motion since the
/// previous frame. A frame is immutable; data that plugins derive from it are computed once, on
/// first use.
pub struct Frame {
    /// 1-based index of the image in the log.
    pub index: u64,
    /// Capture time of the frame.
    pub stamp: Stamp,
    /// The camera of all images; [`Camera::blind`] in a frame of a laser scan alone.
    pub camera: Arc<Camera>,
    /// The robot's motion since the previous frame.
    pub motion: EgoMotion,
    images: Images,
    recorded: Option<Vec<ExternalDetection>>,
    laser: Option<LaserScan>,
    grey: OnceLock<Arc<GreyImage>>,
    derived: Mutex<BTreeMap<TypeId, Arc<Slot>>>,
}

impl Frame {
    /// Creates a frame without a laser scan and recorded detections.
    pub fn new(
        index: u64,
        stamp: Stamp,
        camera: Arc<Camera>,
        motion: EgoMotion,
        images: Images,
    ) -> Self {
        Self {
            index,
            stamp,
            camera,
            motion,
            images,
            recorded: None,
            laser: None,
            grey: OnceLock::new(),
            derived: Mutex::default(),
        }
    }

    /// Returns the frame with the detections that an external detector recorded.
    pub fn with_recorded(self, recorded: Option<Vec<ExternalDetection>>) -> Self {
        Self { recorded, ..self }
    }

    /// Returns the detections that an external detector recorded; `None` if no topic is configured
    /// for them (`[input] detections_topic`).
    pub fn recorded(&self) -> Option<&[ExternalDetection]> {
        self.recorded.as_deref()
    }

    /// Returns the frame with a laser scan.
    pub fn with_laser(self, laser: Option<LaserScan>) -> Self {
        Self { laser, ..self }
    }

    /// Returns the laser scan, in the robot frame at the time of the frame; `None` without a
    /// scanner, or if it delivered no scan.
    pub fn laser(&self) -> Option<&LaserScan> {
        self.laser.as_ref()
    }

    /// Returns the laser scan, for plugins that require one.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn scan(&self) -> Result<&LaserScan> {
        self.laser.as_ref().ok_or(Error::MissingImage { input: Input::Laser })
    }

    /// Returns the same moment with a depth image. Derived data are not copied.
    pub fn with_depth(&self, depth: Arc<DepthImage>) -> Self {
        let images = Images { depth: Some(depth), ..self.images.clone() };
        let camera = Arc::clone(&self.camera);
        let frame = Self::new(self.index, self.stamp, camera, self.motion, images);
        let (recorded, laser) = (self.recorded.clone(), self.laser.clone());
        // Derived data may depend on the depth image and are left behind; the grey image does not.
        Self { recorded, laser, grey: self.grey.clone(), ..frame }
    }

    /// Returns true if the frame holds this input.
    pub fn holds(&self, input: Input) -> bool {
        let Images { colour, grey, depth, right } = &self.images;
        match input {
            Input::Colour => colour.is_some() || grey.is_some(),
            Input::Depth => depth.is_some(),
            Input::Right => right.is_some(),
            Input::Laser => self.laser.is_some(),
            Input::Detections => self.recorded.is_some(),
        }
    }

    /// Returns the same moment with the declared inputs alone; `None` if it holds no others. Images
    /// are shared, not copied.
    pub fn restricted_to(&self, inputs: &Inputs) -> Option<Self> {
        if Input::ALL.into_iter().all(|input| inputs.uses(input) || !self.holds(input)) {
            return None;
        }
        let Images { colour, grey, depth, right } = &self.images;
        // The new frame starts without derived data, which may stem from the withheld inputs.
        let uses = |input| inputs.uses(input).then_some(());
        let images = Images {
            colour: uses(Input::Colour).and_then(|()| colour.clone()),
            grey: uses(Input::Colour).and_then(|()| grey.clone()),
            depth: uses(Input::Depth).and_then(|()| depth.clone()),
            right: uses(Input::Right).and_then(|()| right.clone()),
        };
        let camera = Arc::clone(&self.camera);
        let frame = Self::new(self.index, self.stamp, camera, self.motion, images);
        let laser = uses(Input::Laser).and_then(|()| self.laser.clone());
        let recorded = uses(Input::Detections).and_then(|()| self.recorded.clone());
        Some(frame.with_laser(laser).with_recorded(recorded))
    }

    /// Returns the images of the log.
    pub fn images(&self) -> &Images {
        &self.images
    }

    /// Returns the colour image.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn colour(&self) -> Result<&RgbImage> {
        self.images.colour.as_deref().ok_or(Error::MissingImage { input: Input::Colour })
    }

    /// Returns the depth image: metres along the optical axis, NaN = no reading.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn depth(&self) -> Result<&DepthImage> {
        self.images.depth.as_deref().ok_or(Error::MissingImage { input: Input::Depth })
    }

    /// Returns the right image of a stereo pair.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries none.
    pub fn right(&self) -> Result<&RightImage> {
        self.images.right.as_deref().ok_or(Error::MissingImage { input: Input::Right })
    }

    /// Returns the intensity image, converted from colour if the log carries only that.
    ///
    /// # Errors
    /// [`Error::MissingImage`] if the log carries neither.
    pub fn grey(&self) -> Result<&GreyImage> {
        if let Some(grey) = &self.images.grey {
            return Ok(grey);
        }
        let missing = Error::MissingImage { input: Input::Colour };
        let colour = self.images.colour.as_ref().ok_or(missing)?;
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
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use nalgebra::Point3;

    use super::*;
    use tagalong_geometry::{Distortion, Pinhole};

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
        let lens = Pinhole { fx: 5.0, fy: 5.0, cx: 1.5, cy: 1.5, distortion: Distortion::None };
        let camera = Arc::new(Camera::mounted(lens, 4, 4, 1.0, 0.0, 0.0));
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
        let with_depth = frame.with_depth(Arc::new(DepthImage::filled(4, 4, 2.0)));
        assert!(with_depth.depth().is_ok());
        assert_eq!(with_depth.laser().unwrap().points[..], [Point3::new(1.0, 0.5, 0.2)]);
        assert_eq!(with_depth.recorded().map(<[_]>::len), Some(0));
        assert!(with_depth.images().depth.is_some() && with_depth.images().colour.is_none());
    }

    #[test]
    fn only_declared_inputs_are_left() {
        let (colour, grey) = (RgbImage::filled(4, 4, [9; 3]), GreyImage::filled(4, 4, 9));
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
        let held = |frame: &Frame| {
            let Images { colour, grey, depth, right } = frame.images();
            let (laser, recorded) = (frame.laser().is_some(), frame.recorded().is_some());
            assert_eq!(colour.is_some(), grey.is_some());
            [colour.is_some(), depth.is_some(), right.is_some(), laser, recorded]
        };
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
            "needs depth images, which this log does not carry"
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
