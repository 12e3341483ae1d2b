use std::collections::BTreeMap;

use tagalong_core::{Detection, Estimate, Evidence, Filter, Motion, Result, Support, TrackId};
use tagalong_geometry::Camera;

use crate::{Belief, Config};

/// Kalman filter of the box in the image, with one state for each track.
pub struct ImageKalman {
    config: Config,
    beliefs: BTreeMap<TrackId, Belief>,
}

impl ImageKalman {
    /// Creates a filter without tracks.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        Ok(Self { config, beliefs: BTreeMap::new() })
    }
}

impl Filter for ImageKalman {
    fn start(&mut self, id: TrackId, detection: &Detection, camera: &Camera) {
        let belief = Belief::start(&self.config, detection, camera);
        self.beliefs.insert(id, belief);
    }

    fn predict(&mut self, motion: &Motion, camera: &Camera) {
        for belief in self.beliefs.values_mut() {
            belief.predict(&self.config, motion, camera);
        }
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Support>> {
        let camera = &evidence.frame.camera;
        let mut supported = BTreeMap::new();
        for (id, detection) in evidence.best_matches() {
            if let Some(belief) = self.beliefs.get_mut(&id) {
                let support = belief.correct(&self.config, detection, camera);
                supported.insert(id, support);
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
