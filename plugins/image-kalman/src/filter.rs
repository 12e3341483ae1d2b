use std::collections::BTreeMap;
use std::sync::Arc;

use tagalong_core::{
    Camera, Detection, Distortion, Estimate, Evidence, Filter, Motion, Pinhole, Result, Support,
    TrackId,
};

use crate::{Belief, Config};

/// The filter. It predicts through the camera of the frame before.
pub struct ImageKalman {
    config: Config,
    camera: Arc<Camera>,
    beliefs: BTreeMap<TrackId, Belief>,
}

impl ImageKalman {
    /// A filter.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        Ok(Self { config, camera: Arc::new(unknown_camera()), beliefs: BTreeMap::new() })
    }
}

/// Stands in until the first frame shows the camera.
fn unknown_camera() -> Camera {
    let lens = Pinhole { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
    Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0)
}

impl Filter for ImageKalman {
    fn start(&mut self, id: TrackId, detection: &Detection) {
        let belief = Belief::start(&self.config, detection, &self.camera);
        self.beliefs.insert(id, belief);
    }

    fn predict(&mut self, motion: &Motion) {
        for belief in self.beliefs.values_mut() {
            belief.predict(&self.config, motion, &self.camera);
        }
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Support>> {
        let camera = &evidence.frame.camera;
        self.camera = Arc::clone(camera);
        let mut supported = BTreeMap::new();
        for matched in evidence.matched {
            if let Some(belief) = self.beliefs.get_mut(&matched.id) {
                let support = belief.correct(&self.config, matched.detection, camera);
                supported.insert(matched.id, support);
            }
        }
        Ok(supported)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.beliefs.iter().map(|(id, belief)| (*id, belief.estimate(camera))).collect()
    }

    fn stop(&mut self, id: TrackId) {
        self.beliefs.remove(&id);
    }
}
