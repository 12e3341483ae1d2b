use std::sync::{Arc, Mutex, PoisonError};

use tagalong_config::Context;
use tagalong_core::{
    Capabilities, Derived, Detection, Detector, Error, Frame, Funnel, Input, Inputs, Query, Result,
    Track,
};
use tagalong_geometry::{FaceDepth, ImageBox, PointEstimate, Rect, UPPER_BODY_SIDE_M};
use tagalong_network::{PersonNetwork, Preparation, Runtime, ScoredBox, rten, with_colours};

use crate::NAME;
use crate::choices::Body;
use crate::config::Config;

/// Distance of probabilities from 0 and 1 at least.
const SURE: f64 = 1e-3;

/// Network with the preparation of its images.
struct Loaded {
    network: PersonNetwork,
    preparation: Preparation,
}

/// Detector that runs a neural network from an ONNX file.
pub struct Onnx {
    config: Config,
    /// `None`: the settings name no file.
    loaded: Option<Loaded>,
    /// Settings as text, by which answers in a frame are known.
    mark: Arc<str>,
}

/// Answer of a network to a frame.
#[derive(Clone)]
enum Answer {
    People(Arc<[ScoredBox]>),
    Late,
}

/// Answers of networks to a frame, by their settings: several queries ask for the same one.
struct Answers(Mutex<Vec<(Arc<str>, Answer)>>);

impl Derived for Answers {
    fn derive(_: &Frame) -> Result<Self> {
        Ok(Self(Mutex::default()))
    }
}

impl Onnx {
    /// Creates a detector, and reads its file and runs it once if the settings name one.
    ///
    /// # Errors
    /// [`Error::Settings`] for settings outside their ranges, [`Error::Model`] for a file that
    /// cannot be read, is beyond the limits, or is of no family.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        Self::with_runtime(rten, config, context)
    }

    /// Creates a detector whose network another runtime runs.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn with_runtime(runtime: Runtime, config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let mark = format!("{:?} {config:?}", context.base_dir).into();
        let loaded = match config.model.is_empty() {
            true => None,
            false => Some(load(runtime, &config, context)?),
        };
        Ok(Self { config, loaded, mark })
    }

    /// Returns the people in a frame, the likeliest first.
    fn people(&mut self, frame: &Frame, funnel: &mut Funnel) -> Result<Arc<[ScoredBox]>> {
        let nobody: Arc<[ScoredBox]> = Arc::new([]);
        let Some(loaded) = &mut self.loaded else {
            funnel.drop_many("no model", 1);
            return Ok(nobody);
        };
        let answers = frame.derived::<Answers>()?;
        let mut known = answers.0.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = match known.iter().find(|(mark, _)| *mark == self.mark) {
            Some((_, answer)) => answer.clone(),
            None => {
                let least = self.config.discover_score.min(self.config.track_score);
                let answer = loaded.answer(frame, least, &self.config)?;
                known.push((Arc::clone(&self.mark), answer.clone()));
                answer
            }
        };
        Ok(match answer {
            Answer::People(people) => people,
            Answer::Late => {
                funnel.drop_many("network: late", 1);
                nobody
            }
        })
    }

    fn detection(&self, frame: &Frame, person: &ScoredBox) -> Option<Detection> {
        let camera = &*frame.camera;
        let (upper_body, PointEstimate { position, covariance }) =
            self.located(frame, &person.rect)?;
        let image = match self.config.body {
            Body::Full => ImageBox::upper_body(upper_body),
            Body::FullBox => ImageBox::full_body(person.rect),
        };
        let inside = image.rect.clipped(camera.width, camera.height).area() > 0.0;
        let score = log_odds(person.score.into());
        let detection = Detection { image: Some(image), position, covariance, score, source: NAME };
        (inside && detection.is_sane()).then_some(detection)
    }

    /// Returns the upper-body square and the head position of the person in a box: from the depth
    /// image where that shows the face, otherwise from the size of the box.
    fn located(&self, frame: &Frame, whole: &Rect) -> Option<(Rect, PointEstimate)> {
        let (camera, config) = (&*frame.camera, &self.config);
        let by_height = whole.upper_body_of_standing(config.height_m);
        let measured = frame.depth().ok().and_then(|depth| depth.face_m(&by_height));
        let face =
            FaceDepth::by_size(camera, UPPER_BODY_SIDE_M, by_height.width, config.sigma_distance)
                .or_measured(measured, config.sigma_depth_m);
        let sane = face.depth_m.is_finite() && face.depth_m > 0.05;
        sane.then(|| (by_height, camera.locate_head(&by_height, face, config.sigma_px)))
    }

    /// Returns a score of the fit of a detection to a track; `None` if it is not near.
    fn fit(&self, track: &Track, detection: &Detection) -> Option<f64> {
        let overlap = detection.rect().map_or(0.0, |rect| track.estimate.region.iou(&rect));
        let away_m = (track.estimate.person.position.xy() - detection.position.xy()).norm();
        // The distance by size alone may be far off on the floor, so overlap is enough for such a
        // box.
        let guessed = detection.covariance.diagonal().xy().max() > 0.25 * self.config.near_m;
        let near = away_m <= self.config.near_m || guessed && overlap >= self.config.near_overlap;
        near.then_some(overlap - away_m)
    }
}

impl Loaded {
    fn answer(&mut self, frame: &Frame, least: f64, config: &Config) -> Result<Answer> {
        let (least, iou) = (least as f32, config.suppress_iou);
        let find = |image: &_| self.network.find(image, &self.preparation, least, iou);
        let found = with_colours(frame, find)?
            .map_err(|why| Error::Model { path: config.model.clone(), why })?;
        Ok(found.map_or(Answer::Late, |people| Answer::People(people.into())))
    }
}

fn load(runtime: Runtime, config: &Config, context: &Context) -> Result<Loaded> {
    let path = context.base_dir.join(&config.model);
    let network = PersonNetwork::load_with(runtime, &path, &config.choices(), &config.limits());
    let network = network.map_err(|why| Error::Model { path: config.model.clone(), why })?;
    let preparation = config.preparation(network.family())?;
    Ok(Loaded { network, preparation })
}

fn log_odds(probability: f64) -> f64 {
    // The log-odds of 0 and 1 are infinite.
    let sure = probability.clamp(SURE, 1.0 - SURE);
    (sure / (1.0 - sure)).ln()
}

impl Detector for Onnx {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            inputs: Inputs::NONE.require(Input::Colour).accept(Input::Depth),
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
        let people = self.people(frame, funnel)?;
        // A track lowers the threshold only once it is believed: a weak box must not feed itself.
        let least = match search {
            Query::Track(track) if track.confirmed => self.config.track_score,
            _ => self.config.discover_score,
        };
        let mut found = Vec::new();
        for person in people.iter() {
            if f64::from(person.score) < least {
                funnel.drop_at("network: score", person.rect);
                continue;
            }
            match self.detection(frame, person) {
                Some(detection) => found.push(detection),
                None => funnel.drop_at("outside", person.rect),
            }
        }
        // The best fit comes first, because the search is for one person.
        if let Query::Track(track) = search {
            let fits = found.into_iter().filter_map(|d| Some((self.fit(track, &d)?, d)));
            let mut near: Vec<(f64, Detection)> = fits.collect();
            near.sort_by(|a, b| b.0.total_cmp(&a.0));
            found = near.into_iter().map(|(_, detection)| detection).collect();
        }
        Ok(found)
    }

    fn remembers(&self) -> bool {
        false
    }
}
