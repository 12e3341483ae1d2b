use nalgebra::{Matrix3, Point3, Vector3};
use tagalong_config::{Context, check_settings};
use tagalong_core::{
    Capabilities, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result, Track,
};
use tagalong_geometry::{Camera, ImageBox};

use crate::peaks::peaks_of;
use crate::surface::Surface;
use crate::{BUILT_IN, Beams, Config, Model, NAME, Peak, Source};

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
    fn detection(&self, eyes: &Eyes<'_>, peak: &Peak) -> Option<Detection> {
        let config = &self.config;
        let measured = eyes.measured(&peak.head);
        let sigma_height_m = if measured.is_some() {
            config.sigma_measured_height_m
        } else if eyes.have_in_view(&peak.head) {
            config.sigma_height_m
        } else {
            config.sigma_unseen_height_m
        };
        let sigmas = Vector3::new(config.sigma_m, config.sigma_m, sigma_height_m);
        let head = measured.unwrap_or(peak.head);
        let image = eyes.image_box(&head);
        let has_place = image.is_none_or(|image| image.rect.width > 0.0);
        let detection = Detection::new(
            NAME,
            head,
            Matrix3::from_diagonal(&sigmas.map(|sigma| sigma * sigma)),
            self.model.log_odds(peak.logit).min(config.max_score),
        )
        .with_image(image);
        // A head behind the camera has no region.
        (detection.is_sane() && has_place).then_some(detection)
    }

    /// Returns the nearest peak within reach of a track.
    fn near<'a>(&self, track: &Track, found: &'a [Peak]) -> Option<&'a Peak> {
        let expected = track.estimate.person.position.xy();
        let near = found
            .iter()
            .map(|peak| (peak.distance_m(&expected), peak))
            .filter(|(distance_m, _)| *distance_m < self.config.track_radius_m);
        near.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, peak)| peak)
    }
}

/// The sensor by which a frame shows heads.
enum Eyes<'a> {
    /// A depth camera, with the surface that it shows if heads are measured on it.
    Camera(&'a Camera, Option<Surface<'a>>),
    /// A lidar.
    Lidar(&'a Beams),
}

impl Eyes<'_> {
    /// Returns the head near a place, measured on its surface.
    fn measured(&self, head: &Point3<f64>) -> Option<Point3<f64>> {
        match self {
            Self::Camera(_, surface) => surface.as_ref()?.head(head),
            Self::Lidar(_) => None,
        }
    }

    /// Returns true if a head at this place is in view.
    fn have_in_view(&self, head: &Point3<f64>) -> bool {
        match self {
            Self::Camera(camera, _) => camera.project(head).is_some_and(|at| {
                (0.0..camera.width as f64).contains(&at.x)
                    && (0.0..camera.height as f64).contains(&at.y)
            }),
            Self::Lidar(beams) => beams.range_m(head).is_some(),
        }
    }

    /// Returns the box of a person in the image, where there is one.
    fn image_box(&self, head: &Point3<f64>) -> Option<ImageBox> {
        match self {
            Self::Camera(camera, _) => Some(ImageBox::upper_body(camera.upper_body(head))),
            Self::Lidar(_) => None,
        }
    }
}

impl Detector for DepthNet {
    fn capabilities(&self) -> Capabilities {
        let input = match self.config.source {
            Source::Depth => Input::Depth,
            Source::Points => Input::POINTS,
        };
        Capabilities::new(Inputs::NONE.require(input)).discovering().tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let (views, passes) = self.model.look(frame, self.config.source)?;
        let Config { discover_score, track_score, separation_m, .. } = self.config;
        // A track lowers the threshold only once it is believed: a peak must not feed itself.
        let least = match query {
            Query::Track(track) if track.confirmed => track_score,
            _ => discover_score,
        };
        // Peaks below the threshold are counted, so that the funnel tells how near they came.
        let lowest = self.model.logit(least.min(track_score));
        let all = peaks_of(&views, &passes, lowest, separation_m);
        let (found, low): (Vec<Peak>, Vec<Peak>) =
            all.into_iter().partition(|peak| self.model.log_odds(peak.logit) >= least);
        funnel.drop_many("peak: score", low.len() as u64);
        let eyes = match &views.beams {
            Some(beams) => Eyes::Lidar(beams),
            None if self.config.measure_heads => {
                Eyes::Camera(&frame.camera, Some(Surface::new(frame)?))
            }
            None => Eyes::Camera(&frame.camera, None),
        };
        Ok(match query {
            Query::Track(track) => self
                .near(track, &found)
                .and_then(|peak| self.detection(&eyes, peak))
                .into_iter()
                .collect(),
            Query::Discover { .. } => {
                // People who are tracked already would be discovered twice.
                let free = found.iter().filter(|peak| !query.is_occupied(&peak.head, separation_m));
                free.filter_map(|peak| self.detection(&eyes, peak)).collect()
            }
        })
    }

    fn remembers(&self) -> bool {
        false
    }
}
