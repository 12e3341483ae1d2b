use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use tagalong_app::outcome::{Ended, Failure, Outcome, print, write_file};
use tagalong_config::{Context, NamedTensor, Registry};
use tagalong_core::DiffDrive;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Paths of an export.
pub(super) struct Export<'a> {
    /// Plugin of the network.
    pub(super) plugin: &'a str,
    /// The ONNX file; its card is written beside it.
    pub(super) file: &'a Path,
    /// Model file of the plugin; without one its built-in model is taken.
    pub(super) weights: Option<&'a Path>,
    /// File for a sample of inputs and outputs.
    pub(super) sample: Option<&'a Path>,
    /// True if files that exist are replaced.
    pub(super) overwrite: bool,
}

impl Export<'_> {
    /// Writes the network of a plugin as an ONNX file, and its card.
    ///
    /// # Errors
    /// A plugin without a network, a model that it refuses (exit code 2), a file that cannot be
    /// written.
    pub(super) fn run(&self, registry: &Registry) -> Outcome {
        let card = card_of(self.file);
        for file in [Some(self.file), Some(card.as_path()), self.sample].into_iter().flatten() {
            // The file is an argument of its own here, and -o names a config.
            if file.exists() && !self.overwrite {
                let shown = file.display();
                let why = format!("{shown} exists; name another file, or add --overwrite");
                return Err(Failure::usage(why));
            }
        }
        let text = self.settings()?.to_string();
        let table = DeTable::parse(&text).map_err(Failure::usage)?;
        let value = Spanned::new(table.span(), DeValue::Table(table.into_inner()));
        let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
        let context = Context::new(0, ".", wheels);
        let network = registry.export(self.plugin, Some(value), &context);
        let network = network.map_err(|error| Failure::usage(error.message))?;
        write_file(self.file, &network.onnx)?;
        write_file(&card, &network.card)?;
        let mut written = vec![self.file.display().to_string(), card.display().to_string()];
        if let Some(sample) = self.sample {
            write_file(sample, as_json(&network.sample).to_string())?;
            written.push(sample.display().to_string());
        }
        print(&format!("written: {}\n", written.join(", ")))?;
        Ok(Ended::Well)
    }

    /// Returns the settings of the plugin: the model file alone.
    fn settings(&self) -> Result<toml::Table, Failure> {
        let Some(weights) = self.weights else { return Ok(toml::Table::new()) };
        let path = std::path::absolute(weights).map_err(Failure::failed)?;
        Ok(toml::Table::from_iter([("model".to_owned(), path.display().to_string().into())]))
    }
}

/// Returns the path of the card of a file.
fn card_of(file: &Path) -> PathBuf {
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(".card.toml");
    file.with_file_name(name)
}

fn as_json(sample: &[NamedTensor]) -> Value {
    let mut inputs = Map::new();
    let mut outputs = Map::new();
    for tensor in sample {
        let part = if tensor.is_input { &mut inputs } else { &mut outputs };
        let value = json!({ "shape": tensor.shape, "values": tensor.values });
        part.insert(tensor.name.to_owned(), value);
    }
    json!({ "inputs": inputs, "outputs": outputs })
}
