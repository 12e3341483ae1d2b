//! `[appearance]`: a network that describes people, for all stages that compare them.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::OrAuto;
use tagalong_core::{Error, Frame, Result};
use tagalong_geometry::Rect;
use tagalong_network::{Convention, EmbeddingNetwork, LimitSettings, model_file, with_colours};
use tagalong_vision::{Describer, Embedder};

/// Embeddings of people from a re-identification network, for `[reidentification]`, its
/// `association_weight` and the target lock. Differences are 1 minus the cosine of two embeddings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct AppearanceSettings {
    /// ONNX file of a re-identification network, relative to the config, or the name of an
    /// installed one. Empty: colours and edges describe people.
    pub model: String,
    /// Convention of the input: `auto` (by the outputs), `osnet` (RGB, mean and deviation of
    /// ImageNet) or `omz` (BGR, 0 to 255).
    pub convention: OrAuto<Convention>,
    /// Limits of the network; a person without a result has no appearance in that frame.
    #[serde(flatten)]
    pub limits: LimitSettings,
}

impl AppearanceSettings {
    /// Returns true if a network describes people.
    pub(crate) fn has_network(&self) -> bool {
        !self.model.is_empty()
    }

    /// Returns the describer, and reads the network if there is one.
    ///
    /// # Errors
    /// [`Error::Model`] for a file that cannot be read, is beyond the limits or is no
    /// re-identification network.
    pub(crate) fn describer(&self, base_dir: &Path) -> Result<Describer> {
        if !self.has_network() {
            return Ok(Describer::default());
        }
        let file = model_file(base_dir, &self.model);
        let path = file.display().to_string();
        let network =
            EmbeddingNetwork::load(&file, self.convention.chosen(), &self.limits.limits());
        let network = network.map_err(|why| Error::Model { path: path.clone(), why })?;
        let mark = format!("{base_dir:?} {self:?}");
        let embedder = OfNetwork { network, path };
        Ok(Describer::new(mark, Box::new(embedder)))
    }
}

/// Vectors of an ONNX network.
struct OfNetwork {
    network: EmbeddingNetwork,
    /// The file, as it was looked for.
    path: String,
}

impl Embedder for OfNetwork {
    fn embed(&mut self, frame: &Frame, person: &Rect) -> Result<Option<Vec<f32>>> {
        let vector = with_colours(frame, |image| self.network.embed(image, person))?;
        vector.map_err(|why| Error::Model { path: self.path.clone(), why })
    }
}
