use std::sync::{Arc, Mutex, PoisonError};

use tagalong_config::Context;
use tagalong_core::{
    Capabilities, Derived, Detection, Detector, Error, Frame, Funnel, Input, Inputs, Query, Result,
};
use tagalong_network::{
    PersonNetwork, Preparation, Runtime, ScoredBox, model_file, rten, with_colours,
};
use tagalong_vision::log_odds_of;

use crate::NAME;
use crate::config::{Config, Thresholds};

/// Network with the preparation of its images.
struct Loaded {
    network: PersonNetwork,
    preparation: Preparation,
    thresholds: Thresholds,
    /// The file, as it was looked for.
    path: String,
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
    pub fn with_runtime(runtime: Runtime, config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let mark = format!("{:?} {config:?}", context.base_dir).into();
        let loaded =
            if config.model.is_empty() { None } else { Some(load(runtime, &config, context)?) };
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
                let answer = loaded.answer(frame, &self.config)?;
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
}

impl Loaded {
    fn answer(&mut self, frame: &Frame, config: &Config) -> Result<Answer> {
        let least = self.thresholds.discover.min(self.thresholds.track) as f32;
        let iou = config.suppress_iou;
        let found =
            with_colours(frame, |image| self.network.find(image, &self.preparation, least, iou))?
                .map_err(|why| Error::Model { path: self.path.clone(), why })?;
        Ok(found.map_or(Answer::Late, |people| Answer::People(people.into())))
    }
}

fn load(runtime: Runtime, config: &Config, context: &Context) -> Result<Loaded> {
    let file = model_file(&context.base_dir, &config.model);
    let path = file.display().to_string();
    let limits = config.limits.limits();
    let network = PersonNetwork::load_with(runtime, &file, &config.choices(), &limits);
    let network = network.map_err(|why| Error::Model { path: path.clone(), why })?;
    let preparation = config.preparation(network.family())?;
    let thresholds = config.thresholds(network.family());
    Ok(Loaded { network, preparation, thresholds, path })
}

impl Detector for Onnx {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE.require(Input::Colour).accept(Input::Depth))
            .discovering()
            .tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let people = self.people(frame, funnel)?;
        let Some(Loaded { thresholds, .. }) = &self.loaded else { return Ok(Vec::new()) };
        // A track lowers the threshold only once it is believed: a weak box must not feed itself.
        let least = match query {
            Query::Track(track) if track.confirmed => thresholds.track,
            _ => thresholds.discover,
        };
        // A box at the threshold of newcomers is even odds at least, so that the track manager starts
        // a track from it on, however unsure of itself a network is.
        let zero = log_odds_of(thresholds.discover).min(0.0);
        let mut found = Vec::new();
        for person in people.iter() {
            if f64::from(person.score) < least {
                funnel.drop_at("network: score", person.rect);
                continue;
            }
            let score = log_odds_of(person.score.into()) - zero;
            match self.config.boxes.detection(frame, &person.rect, score, NAME) {
                Some(detection) => found.push(detection.with_joints(person.joints.clone())),
                None => funnel.drop_at("outside", person.rect),
            }
        }
        Ok(match query {
            Query::Track(track) => self.config.boxes.near(track, found),
            Query::Discover { .. } => found,
        })
    }

    fn remembers(&self) -> bool {
        false
    }
}
