use nalgebra::Point3;
use tagalong_core::{Detection, Error, Frame, Result};

/// Label of a training candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Example {
    /// True for a person.
    pub is_person: bool,
    /// Group shared by the examples of one scene, subject or photograph. A group is never split
    /// between the fitted and the held-out part, because its members resemble each other more than
    /// unseen data.
    pub group: u64,
}

/// Annotated person in a frame, for trainers of detectors.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct AnnotatedPerson {
    /// Centre of the head in the robot frame, m.
    pub head: Point3<f64>,
    /// False if it is neither an error to find this person nor one not to.
    pub counts: bool,
    /// Visible fraction of the upper body, 0 to 1.
    pub visible: f64,
}

impl AnnotatedPerson {
    /// Creates a person at a centre of the head in the robot frame, m, that counts and is all visible.
    pub fn new(head: Point3<f64>) -> Self {
        Self { head, counts: true, visible: 1.0 }
    }

    /// Returns the person with [`AnnotatedPerson::counts`] as given.
    pub fn with_counts(self, counts: bool) -> Self {
        Self { counts, ..self }
    }

    /// Returns the person with the visible fraction of the upper body, 0 to 1.
    pub fn with_visible(self, visible: f64) -> Self {
        Self { visible, ..self }
    }
}

/// Result of a fit.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Fitted {
    /// Content of the model file, in the plugin's format.
    pub model: String,
    /// Figures for the model card: counts, and the table of the tried settings with their
    /// cross-validated figures.
    pub figures: toml::Table,
    /// Content of further model files, each by the name of the real room that it has not seen.
    pub without: Vec<(String, String)>,
}

impl Fitted {
    /// Creates the result of a fit: the content of the model file, and figures for the model card.
    pub fn new(model: String, figures: toml::Table) -> Self {
        Self { model, figures, without: Vec::new() }
    }

    /// Returns the result with further model files, each by the name of the real room that it has not
    /// seen.
    pub fn with_rooms_left_out(self, without: Vec<(String, String)>) -> Self {
        Self { without, ..self }
    }
}

/// Trains the model file of a plugin from labelled candidates ([`crate::Registry::trainer`]).
///
/// Candidates come as a stream, so features are computed at once and frames are not kept. A trainer
/// may be fitted, given more examples, and fitted again: this allows a verifier to be trained on
/// its own errors. The settings of a trainable plugin name the file under the key `model`.
pub trait Trainer: Send {
    /// Adds one labelled candidate.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] if the frame lacks an input that the plugin needs.
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()>;

    /// Returns true if a trainer of photographs also learns from whole frames of annotated rooms.
    fn learns_from_rooms(&self) -> bool {
        false
    }

    /// Adds a whole frame with all people in it, for the model of a detector. `room` is the name of
    /// a real room, of which all frames are held out together; `None` for a simulated one, where
    /// `group` is the number of the scene.
    ///
    /// # Errors
    /// As [`Trainer::add`]; [`Error::Other`] by trainers that learn from candidates.
    fn add_frame(
        &mut self,
        frame: &Frame,
        people: &[AnnotatedPerson],
        room: Option<&str>,
        group: u64,
    ) -> Result<()> {
        let _ = (frame, people, room, group);
        Err(Error::Other("this model is trained on candidates, not on whole frames".into()))
    }

    /// Fits a model to all examples so far. The same examples in the same order give the same
    /// bytes. `progress` receives the finished fraction, 0 to 1.
    ///
    /// # Errors
    /// If the examples do not suffice: one class only, too few groups.
    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted>;
}
