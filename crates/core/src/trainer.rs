use crate::{Detection, Frame, Result};

/// What is known of a candidate that a trainer is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Example {
    /// Whether it is a person.
    pub is_person: bool,
    /// Examples of one scene, subject or photograph share a group. A group is
    /// never split between what is fitted and what is held out, because its
    /// members resemble each other more than anything that is yet to be seen.
    pub group: u64,
}

/// What a trainer made of its examples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fitted {
    /// The content of the model file, as the plugin reads it.
    pub model: String,
    /// What the model's card says of the fit: counts, and the table of what was
    /// tried with its cross-validated figures.
    pub figures: toml::Table,
}

/// Makes the model file of a plugin from labelled candidates
/// ([`crate::Registry::trainer`]).
///
/// Candidates come as a stream, so features are computed at once and frames are
/// not kept. A trainer may be fitted, shown more, and fitted again: that is how
/// a verifier learns from its own mistakes. The settings of a plugin that can
/// be trained name the file under the key `model`.
pub trait Trainer: Send {
    /// Takes in one labelled candidate.
    ///
    /// # Errors
    /// [`crate::Error::MissingImage`] if the frame lacks what the plugin needs.
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()>;

    /// Fits a model to all examples so far. The same examples in the same order
    /// give the same bytes. `progress` is told the finished fraction, 0 to 1.
    ///
    /// # Errors
    /// If the examples do not suffice: one class only, too few groups.
    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted>;
}
