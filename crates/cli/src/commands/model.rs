use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::serialize::to_json;
use tagalong_core::RgbImage;
use tagalong_network::{
    About, Choices, Colours, Family, Fit, InputSize, Limits, PersonNetwork, Port, inspect,
};

/// Calls of which the fastest is told.
const CALLS: usize = 3;

/// Arguments of `tagalong model`.
#[derive(Debug, Args)]
pub struct ModelArgs {
    /// The ONNX file.
    file: PathBuf,
    /// Columns and rows of the input, if the file leaves them open.
    #[arg(long, value_names = ["COLUMNS", "ROWS"], num_args = 2)]
    size: Option<Vec<usize>>,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Network of a known family.
struct Known<'a> {
    about: &'a About,
    family: Family,
    input: InputSize,
    call_ms: f64,
}

/// Runs `tagalong model FILE`.
///
/// # Errors
/// A file that is refused (its cause and remedy), or whose outputs no decoder reads.
pub fn model(args: &ModelArgs) -> Outcome {
    let size = args.size.as_deref().and_then(|size| <[usize; 2]>::try_from(size).ok());
    let shown = args.file.display();
    let refused = |why: String| Failure::failed(format!("{shown}: {why}"));
    let limits = Limits::default();
    let about = inspect(&args.file, size, &limits).map_err(refused)?;
    let known = known(&args.file, &about, size, &limits);
    print(&match args.format {
        Format::Text => as_text(&args.file, &about, known.as_ref().ok()),
        Format::Json => to_json("the network", &as_json(&about, known.as_ref().ok()))?,
    })?;
    known.map(|_| Ended::Well).map_err(refused)
}

fn known<'a>(
    file: &Path,
    about: &'a About,
    size: Option<[usize; 2]>,
    limits: &Limits,
) -> Result<Known<'a>, String> {
    let (family, input) = (about.family()?, about.input.clone()?);
    let choices = Choices { size, ..Choices::default() };
    // A network without the usual class of people is known all the same.
    let call_ms = match PersonNetwork::load(file, &choices, limits) {
        Ok(mut network) => fastest_call_ms(&mut network, family, input)?,
        Err(_) => 0.0,
    };
    Ok(Known { about, family, input, call_ms })
}

fn fastest_call_ms(
    network: &mut PersonNetwork,
    family: Family,
    input: InputSize,
) -> Result<f64, String> {
    let image = RgbImage::filled(input.width, input.height, [114; 3]);
    let mut fastest = f64::INFINITY;
    for _ in 0..CALLS {
        let start = Instant::now();
        network.find(&image, &family.preparation(), 0.5, 0.5)?;
        fastest = fastest.min(1e3 * start.elapsed().as_secs_f64());
    }
    Ok(fastest)
}

fn list(ports: &[Port]) -> String {
    ports.iter().map(Port::to_string).collect::<Vec<_>>().join(", ")
}

/// Returns a part of a config, with the description as comments.
fn as_text(file: &Path, about: &About, known: Option<&Known<'_>>) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(out, "# inputs   {}", list(&about.inputs));
    let _ = writeln!(out, "# outputs  {}", list(&about.outputs));
    if let Ok(shapes) = &about.run {
        let shapes: Vec<String> = shapes.iter().map(ToString::to_string).collect();
        let _ = writeln!(out, "# a call   {}", shapes.join(", "));
    }
    if let Some(known) = known {
        known.describe(&mut out);
        known.write_config(file, &mut out);
    }
    out
}

impl Known<'_> {
    fn describe(&self, out: &mut String) {
        let Self { family, input, .. } = self;
        let preparation = family.preparation();
        let colours = match preparation.colours {
            Colours::Rgb => "RGB",
            Colours::Bgr => "BGR",
        };
        let fit = match preparation.fit {
            Fit::Stretch => "stretched to it".to_owned(),
            Fit::Centre => format!("centred, padded with {}", preparation.padding),
            Fit::TopLeft => format!("at the top left, padded with {}", preparation.padding),
        };
        let (mean, deviation) = (preparation.mean, preparation.deviation);
        let _ = writeln!(out, "# family   {family} ({})", family.networks());
        let _ = writeln!(out, "# image    {} x {} pixels, {fit}", input.width, input.height);
        let _ = writeln!(out, "# colours  {colours}, mean {mean:?}, deviation {deviation:?}");
        let _ = writeln!(out, "# people   class {} (`classes` if not)", family.person_class());
        if self.call_ms > 0.0 {
            let _ = writeln!(out, "# time     {:.1} ms a call, on one thread", self.call_ms);
        }
    }

    fn write_config(&self, file: &Path, out: &mut String) {
        // A string of JSON is one of TOML.
        let name = json!(file.to_string_lossy());
        let _ = write!(out, "\n[[detectors]]\nplugin = \"onnx\"\n[detectors.config]\n");
        let _ = writeln!(out, "model = {name}    # relative to this config");
        let _ = writeln!(out, "family = \"{}\"", self.family);
        let is_open = |port: &Port| port.shape.len() == 4 && port.shape[1..].contains(&None);
        if self.about.inputs.iter().any(is_open) {
            let _ = writeln!(out, "size = [{}, {}]", self.input.width, self.input.height);
        }
        let _ = writeln!(out, "\n[filter]\nplugin = \"image-kalman\"");
    }
}

fn as_json(about: &About, known: Option<&Known<'_>>) -> Value {
    let ports = |ports: &[Port]| -> Vec<Value> {
        ports.iter().map(|port| json!({ "name": port.name, "shape": port.shape })).collect()
    };
    json!({
        "inputs": ports(&about.inputs),
        "outputs": ports(&about.outputs),
        "family": known.map(|known| known.family.name()),
        "size": known.map(|known| [known.input.width, known.input.height]),
        "call_ms": known.map(|known| known.call_ms),
    })
}
