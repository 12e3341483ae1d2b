use std::collections::BTreeMap;

use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, FilterRequirements, Result, TrackId, Update,
};
use tagalong_geometry::Camera;

use crate::reupdate::Gap;
use crate::{Config, State};

/// Kalman filter of the box in the image, with one state for each track.
pub struct ImageKalman {
    config: Config,
    states: BTreeMap<TrackId, State>,
    /// State to filter anew from the last observation of each track on.
    gaps: BTreeMap<TrackId, Gap>,
}

impl ImageKalman {
    /// Creates a filter without tracks.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        Ok(Self { config, states: BTreeMap::new(), gaps: BTreeMap::new() })
    }
}

impl Filter for ImageKalman {
    /// The state is that of a box; a box invented from a position would be counted as evidence
    /// beside the position.
    fn requirements(&self) -> FilterRequirements {
        FilterRequirements { image_box: true, ..FilterRequirements::default() }
    }

    fn start(&mut self, id: TrackId, detection: &Detection, camera: &Camera) {
        let state = State::start(&self.config, detection, camera);
        if self.config.reupdate {
            self.gaps.insert(id, Gap::new(&state, detection));
        }
        self.states.insert(id, state);
    }

    fn predict(&mut self, motion: &EgoMotion, camera: &Camera) {
        for state in self.states.values_mut() {
            state.predict(&self.config, motion, camera);
        }
        self.gaps.values_mut().for_each(|gap| gap.add(motion, camera));
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let camera = &evidence.frame.camera;
        let mut supported = BTreeMap::new();
        for (id, detection) in evidence.best_matches() {
            let Some(state) = self.states.get_mut(&id) else { continue };
            let gap = self.gaps.get(&id);
            let bridged = gap.and_then(|gap| gap.bridged(&self.config, detection, camera));
            // The consistency of a track is that of its prediction, so it is updated in any case.
            let support = state.correct(&self.config, detection, camera);
            if let Some(bridged) = bridged {
                *state = bridged;
            }
            if self.config.reupdate {
                self.gaps.insert(id, Gap::new(state, detection));
            }
            supported.insert(id, support);
        }
        Ok(supported)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.states.iter().map(|(id, state)| (*id, state.estimate(camera))).collect()
    }

    fn stop(&mut self, id: TrackId) {
        self.states.remove(&id);
        self.gaps.remove(&id);
    }
}
