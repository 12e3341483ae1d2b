use std::sync::{Arc, Mutex};

use nalgebra::{Matrix3, Point3, Vector3};
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, Frame, Images, Likelihood, Matched, Person,
    Result, RgbImage, Stamp, TrackId, Update,
};
use tagalong_geometry::{Camera, ImageBox, Pinhole, Rect};
use tagalong_vision::Sketch;

use crate::{Config, JointParticle};

type Log = dyn Fn(&[Person]) -> f64 + Send + Sync;

/// A likelihood by a formula; it records the scenes it was asked for.
pub struct Formula {
    log: Box<Log>,
    asked: Mutex<Vec<Vec<Person>>>,
}

impl Formula {
    pub fn new(log: impl Fn(&[Person]) -> f64 + Send + Sync + 'static) -> Self {
        Self { log: Box::new(log), asked: Mutex::default() }
    }

    /// The same likelihood at all places, of this many nats for each person.
    pub fn flat(nats: f64) -> Self {
        Self::new(move |scene| nats * scene.len() as f64)
    }

    /// Returns the scenes that were asked for since the last call.
    pub fn asked(&self) -> Vec<Vec<Person>> {
        std::mem::take(&mut *self.asked.lock().unwrap())
    }
}

impl Likelihood for Formula {
    fn log_likelihood(&self, _: &Frame, scene: &[Person]) -> Result<f64> {
        self.asked.lock().unwrap().push(scene.to_vec());
        Ok((self.log)(scene))
    }
}

/// A frame of a level camera 1.5 m above the robot's origin.
pub fn frame(motion: EgoMotion, colour: Option<RgbImage>) -> Frame {
    let camera = Arc::new(Camera::mounted(Pinhole::centred(80.0, 100, 80), 100, 80, 1.5, 0.0, 0.0));
    let images = Images { colour: colour.map(Arc::new), ..Images::default() };
    Frame::new(1, Stamp::default(), camera, motion, images)
}

/// A detection with standard deviations along x, y and z, m.
pub fn sighting(position: Point3<f64>, sigmas: [f64; 3]) -> Detection {
    let covariance = Matrix3::from_diagonal(&Vector3::from(sigmas).map(|s| s * s));
    let region = Rect::new(40.0, 30.0, 20.0, 20.0);
    Detection::new("drawn", position, covariance, 3.0).with_image(ImageBox::upper_body(region))
}

/// A filter and its frames.
pub struct Rig {
    pub filter: JointParticle,
}

impl Rig {
    pub fn new(config: Config, seed: u64) -> Self {
        Self { filter: JointParticle::new(config, seed).unwrap() }
    }

    pub fn start(&mut self, id: u32, position: [f64; 3], sigmas: [f64; 3]) {
        let camera = frame(EgoMotion::at_rest(0.1), None).camera;
        self.filter.start(TrackId(id), &sighting(Point3::from(position), sigmas), &camera);
    }

    /// Runs one frame without detections, the robot at rest, a tenth of a second later.
    pub fn look(&mut self, likelihood: &Formula) -> Vec<u32> {
        self.look_after(EgoMotion::at_rest(0.1), likelihood, &[], None)
    }

    /// Runs one frame; returns the seen people.
    pub fn look_after(
        &mut self,
        motion: EgoMotion,
        likelihood: &Formula,
        sightings: &[(u32, Detection)],
        colour: Option<RgbImage>,
    ) -> Vec<u32> {
        let frame = frame(motion, colour);
        let matched: Vec<Matched<'_>> = sightings
            .iter()
            .map(|(id, detection)| Matched::certain(TrackId(*id), detection))
            .collect();
        self.filter.predict(&motion, &frame.camera);
        let likelihood: Option<&dyn Likelihood> = Some(likelihood);
        let evidence = Evidence::new(&frame, &matched).with_likelihood(likelihood);
        let seen: std::collections::BTreeMap<TrackId, Update> =
            self.filter.update(&evidence).unwrap();
        seen.into_keys().map(|id| id.0).collect()
    }

    pub fn estimate(&self, id: u32) -> Estimate {
        let frame = frame(EgoMotion::at_rest(0.1), None);
        self.filter.estimates(&frame.camera).remove(&TrackId(id)).unwrap()
    }

    pub fn place(&self, id: u32) -> Point3<f64> {
        self.estimate(id).person.position
    }

    pub fn sketch(&self, likelihood: &Formula) -> Sketch {
        let frame = frame(EgoMotion::at_rest(0.1), None);
        let likelihood: Option<&dyn Likelihood> = Some(likelihood);
        let evidence = Evidence::new(&frame, &[]).with_likelihood(likelihood);
        let shown = self.filter.visualise(&evidence).unwrap().unwrap();
        shown.downcast_ref::<Sketch>().unwrap().clone()
    }

    /// Returns the image columns of the particles of a person.
    pub fn columns(&self, id: u32) -> Vec<f64> {
        let points = self.sketch(&Formula::flat(0.0)).points.into_iter();
        points.filter(|point| point.id == TrackId(id)).map(|point| point.pixel.x).collect()
    }
}

/// Standard deviation of the exactly known components of a detection.
pub const EXACT: f64 = 1e-6;
