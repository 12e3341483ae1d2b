use std::sync::{Arc, Mutex, PoisonError};

use tagalong_config::Context;
use tagalong_core::{
    Capabilities, Derived, Detection, Detector, Error, Frame, Funnel, Input, Inputs, Query, Result,
};
use tagalong_network::{PersonNetwork, Preparation, Runtime, ScoredBox, rten, with_colours};
use tagalong_vision::log_odds_of;

use crate::NAME;
use crate::config::Config;

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
    let limits = config.limits.limits();
    let network = PersonNetwork::load_with(runtime, &path, &config.choices(), &limits);
    let network = network.map_err(|why| Error::Model { path: config.model.clone(), why })?;
    let preparation = config.preparation(network.family())?;
    Ok(Loaded { network, preparation })
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
            let score = log_odds_of(person.score.into());
            match self.config.boxes.detection(frame, &person.rect, score, NAME) {
                Some(detection) => found.push(detection),
                None => funnel.drop_at("outside", person.rect),
            }
        }
        Ok(match search {
            Query::Track(track) => self.config.boxes.near(track, found),
            Query::Discover { .. } => found,
        })
    }

    fn remembers(&self) -> bool {
        false
    }
}
