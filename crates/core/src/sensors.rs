use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::Arc;

use tagalong_geometry::Camera;

use crate::{
    DepthImage, ExternalDetection, FurtherScans, GreyImage, Input, Inputs, LaserScan, RgbImage,
};

/// Data of one sensor in a frame.
///
/// A crate that has a sensor of its own implements this for its data, puts them into the frame
/// ([`crate::Frame::with_sensor`]) and declares [`Sensor::INPUT`] for the plugins that read them.
///
/// ```
/// # use tagalong_core::{EgoMotion, Frame, Input, Inputs, Sensor, Sensors, Stamp};
/// # use nalgebra::Isometry3;
/// # use tagalong_geometry::Camera;
/// /// Distances by a radar, m.
/// struct Radar(Vec<f64>);
///
/// impl Sensor for Radar {
///     const INPUT: Input = Input::Named("radar");
/// }
///
/// let sensors = Sensors::default().with(Radar(vec![2.5]));
/// let blind = Camera::blind(Isometry3::identity()).into();
/// let frame = Frame::of_sensors(1, Stamp::default(), blind, EgoMotion::at_rest(0.0), sensors);
/// assert_eq!(frame.sensor::<Radar>()?.0, [2.5]);
/// // A pipeline whose plugins do not declare the input works on a frame without it.
/// let hidden = frame.restricted_to(&Inputs::NONE).unwrap();
/// assert!(hidden.sensor::<Radar>().is_err());
/// # Ok::<(), tagalong_core::Error>(())
/// ```
pub trait Sensor: Send + Sync + 'static {
    /// The input that a plugin declares in order to receive the data.
    const INPUT: Input;
}

/// Image with the camera that took it.
#[derive(Clone, Debug)]
pub struct CameraImage<T> {
    /// The image.
    pub image: Arc<T>,
    /// The camera.
    pub camera: Arc<Camera>,
}

impl Sensor for CameraImage<RgbImage> {
    const INPUT: Input = Input::Colour;
}

impl Sensor for CameraImage<GreyImage> {
    const INPUT: Input = Input::Colour;
}

impl Sensor for CameraImage<DepthImage> {
    const INPUT: Input = Input::Depth;
}

impl Sensor for CameraImage<RightImage> {
    const INPUT: Input = Input::Right;
}

impl Sensor for LaserScan {
    const INPUT: Input = Input::Laser;
}

impl Sensor for FurtherScans {
    const INPUT: Input = Input::Laser;
}

/// The right-hand image of a rectified stereo pair.
#[derive(Clone, Debug, PartialEq)]
pub struct RightImage {
    /// The image.
    pub image: GreyImage,
    /// Distance between the two cameras, m.
    pub baseline_m: f64,
}

/// Detections that an external detector recorded, with the camera to which their boxes refer.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ExternalDetections {
    /// The detections.
    pub detections: Vec<ExternalDetection>,
    /// The camera.
    pub camera: Arc<Camera>,
}

impl ExternalDetections {
    /// Creates the recorded detections of a frame, with the camera to which their boxes refer.
    pub fn new(detections: Vec<ExternalDetection>, camera: Arc<Camera>) -> Self {
        Self { detections, camera }
    }
}

impl Sensor for ExternalDetections {
    const INPUT: Input = Input::Detections;
}

/// Data of any type, with the input under which plugins declare them.
#[derive(Clone)]
struct Entry {
    input: Input,
    data: Arc<dyn Any + Send + Sync>,
}

/// Data of the sensors at one moment: at most one value of each type. Values are shared by clones,
/// not copied.
#[derive(Clone, Default)]
pub struct Sensors(BTreeMap<TypeId, Entry>);

impl Sensors {
    /// Returns the set with the data of one more sensor, in place of data of the same type.
    pub fn with<S: Sensor>(mut self, sensor: S) -> Self {
        let entry = Entry { input: S::INPUT, data: Arc::new(sensor) };
        self.0.insert(TypeId::of::<S>(), entry);
        self
    }

    /// Returns the data of a sensor, if there are any.
    pub fn get<S: Sensor>(&self) -> Option<&S> {
        self.0.get(&TypeId::of::<S>())?.data.downcast_ref()
    }

    /// Returns true if there are data of this input.
    pub fn holds(&self, input: Input) -> bool {
        self.0.values().any(|entry| entry.input == input)
    }

    /// Returns true if all data are of declared inputs.
    pub fn are_within(&self, inputs: &Inputs) -> bool {
        self.0.values().all(|entry| inputs.uses(entry.input))
    }

    /// Returns the data of the declared inputs alone.
    pub fn restricted_to(&self, inputs: &Inputs) -> Self {
        let used = self.0.iter().filter(|(_, entry)| inputs.uses(entry.input));
        Self(used.map(|(kind, entry)| (*kind, entry.clone())).collect())
    }
}
