use nalgebra::{Matrix3, Vector3};
use tagalong_config::{Context, check_settings};
use tagalong_core::{
    Capabilities, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result, Track,
};
use tagalong_geometry::{Camera, ImageBox};

use crate::surface::Surface;
use crate::{BUILT_IN, Config, Model, NAME, Peak, peaks};

/// Detector of people in a plan view of depth.
pub struct DepthNet {
    config: Config,
    model: Model,
}

impl DepthNet {
    /// Creates a detector and reads its model.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is not a model,
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        check_settings(&config)?;
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        Ok(Self { config, model })
    }

    /// Makes a detection of a peak, with its head measured on the surface if that is given.
    fn detection(
        &self,
        camera: &Camera,
        surface: Option<&Surface<'_>>,
        peak: &Peak,
    ) -> Option<Detection> {
        let config = &self.config;
        let measured = surface.and_then(|surface| surface.head(&peak.head));
        let sigma_height_m = if measured.is_some() {
            config.sigma_measured_height_m
        } else if is_in_image(camera, peak) {
            config.sigma_height_m
        } else {
            config.sigma_unseen_height_m
        };
        let sigmas = Vector3::new(config.sigma_m, config.sigma_m, sigma_height_m);
        let head = measured.unwrap_or(peak.head);
        let region = camera.upper_body(&head);
        let detection = Detection {
            image: Some(ImageBox::upper_body(region)),
            position: head,
            covariance: Matrix3::from_diagonal(&sigmas.map(|sigma| sigma * sigma)),
            score: self.model.log_odds(peak.logit).min(config.max_score),
            source: NAME,
        };
        // A head behind the camera has no region.
        (detection.is_sane() && region.width > 0.0).then_some(detection)
    }

    /// Returns the nearest peak within reach of a track.
    fn near<'a>(&self, track: &Track, found: &'a [Peak]) -> Option<&'a Peak> {
        let expected = track.estimate.person.position.xy();
        let cost = |peak: &Peak| peak.distance_m(&expected.coords.into());
        let near = found.iter().filter(|peak| cost(peak) < self.config.track_radius_m);
        near.min_by(|a, b| cost(a).total_cmp(&cost(b)))
    }
}

fn is_in_image(camera: &Camera, peak: &Peak) -> bool {
    let pixel = camera.project(&peak.head);
    pixel.is_some_and(|at| {
        (0.0..camera.width as f64).contains(&at.x) && (0.0..camera.height as f64).contains(&at.y)
    })
}

impl Detector for DepthNet {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            inputs: Inputs::NONE.require(Input::Depth),
            discovers: true,
            tracks: true,
            weighs: false,
        }
    }

    fn detect(
        &mut self,
        frame: &Frame,
        search: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let (map, pass) = self.model.look(frame)?;
        let Config { discover_score, track_score, separation_m, .. } = self.config;
        // A track lowers the threshold only once it is believed: a peak must not feed itself.
        let least = match search {
            Query::Track(track) if track.confirmed => track_score,
            _ => discover_score,
        };
        // Peaks below the threshold are counted, so that the funnel tells how near they came.
        let all = peaks(&map, &pass, self.model.logit(least.min(track_score)), separation_m);
        let (found, low): (Vec<Peak>, Vec<Peak>) =
            all.into_iter().partition(|peak| self.model.log_odds(peak.logit) >= least);
        funnel.drop_many("peak: score", low.len() as u64);
        let camera = &*frame.camera;
        let surface = if self.config.measure_heads { Some(Surface::new(frame)?) } else { None };
        let surface = surface.as_ref();
        Ok(match search {
            Query::Track(track) => self
                .near(track, &found)
                .and_then(|peak| self.detection(camera, surface, peak))
                .into_iter()
                .collect(),
            Query::Discover { .. } => {
                // People who are tracked already would be discovered twice.
                let free =
                    found.iter().filter(|peak| !search.is_occupied(&peak.head, separation_m));
                free.filter_map(|peak| self.detection(camera, surface, peak)).collect()
            }
        })
    }

    fn remembers(&self) -> bool {
        false
    }
}
