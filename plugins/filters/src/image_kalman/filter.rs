use std::collections::BTreeMap;

use tagalong_config::check_settings;
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, FilterRequirements, Inputs, Result, TrackId,
    Update,
};
use tagalong_geometry::Camera;

use crate::image_kalman::Config;
use crate::image_kalman::models::{Models, configs_of};

/// Kalman filter of the box in the image, with one state for each track, or two that interact.
pub struct ImageKalman {
    /// Settings of each model.
    configs: Vec<Config>,
    states: BTreeMap<TrackId, Models>,
}

impl ImageKalman {
    /// Creates a filter without tracks.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        Ok(Self { configs: configs_of(&config), states: BTreeMap::new() })
    }
}

impl Filter for ImageKalman {
    /// The state is that of a box; a box invented from a position would be counted as evidence
    /// beside the position.
    fn requirements(&self) -> FilterRequirements {
        FilterRequirements::new(Inputs::NONE).with_image_box()
    }

    fn start(&mut self, id: TrackId, detection: &Detection, camera: &Camera) {
        self.states.insert(id, Models::start(&self.configs, detection, camera));
    }

    fn predict(&mut self, motion: &EgoMotion, camera: &Camera) {
        self.states.values_mut().for_each(|models| models.predict(&self.configs, motion, camera));
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let camera = &evidence.frame.camera;
        let mut supported = BTreeMap::new();
        for (id, detection) in evidence.best_matches() {
            let Some(models) = self.states.get_mut(&id) else { continue };
            supported.insert(id, models.correct(&self.configs, detection, camera));
        }
        Ok(supported)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.states
            .iter()
            .filter_map(|(id, models)| Some((*id, models.estimate(camera)?)))
            .collect()
    }

    fn stop(&mut self, id: TrackId) {
        self.states.remove(&id);
    }
}
