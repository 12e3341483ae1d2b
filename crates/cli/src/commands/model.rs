use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};
use tagalong_app::format::Format;
use tagalong_app::installed::{NetworkFiles, missing_network};
use tagalong_app::outcome::{Ended, Failure, Outcome, make_room_for, print, spare, write_file};
use tagalong_app::serialize::to_json;
use tagalong_config::Registry;
use tagalong_core::RgbImage;
use tagalong_geometry::Rect;
use tagalong_network::{
    About, Choices, Colours, EmbeddingNetwork, Family, Fit, InputSize, Limits, PersonNetwork, Port,
    Preparation, inspect, networks_folder,
};

use super::export::Export;
use super::install::{Install, hash_of, read_network, remove};
use super::networks::{self, KnownNetwork};

/// Config for a network of the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NetworkConfig {
    /// The network alone.
    Colour,
    /// The network beside detectors in depth.
    Depth,
}

impl NetworkConfig {
    /// Returns the config without a network, and without the comments before it.
    fn text(self) -> &'static str {
        let text = match self {
            Self::Colour => include_str!("../../configs/colour-net.toml"),
            Self::Depth => include_str!("../../configs/depth-network.toml"),
        };
        let comments: usize =
            text.split_inclusive('\n').take_while(|line| line.starts_with('#')).map(str::len).sum();
        text[comments..].trim_start()
    }
}
/// Line of a config below which the settings of the network stand.
const SETTINGS: &str = "[detectors.config]\n";

/// Calls of which the fastest is told.
const CALLS: usize = 3;

/// Arguments of `tagalong model`.
#[derive(Debug, Args)]
pub struct ModelArgs {
    /// The ONNX file.
    #[arg(required_unless_present_any = ["list", "remove"])]
    file: Option<PathBuf>,
    /// List networks that are known to work, with their licences and figures, and those that are
    /// installed.
    #[arg(long, conflicts_with_all = ["file", "install", "export", "output", "size"])]
    list: bool,
    /// Install the file for this user: `run LOG` uses it for a log with colour only, and configs can
    /// name it (`model = "yolox-nano"`).
    #[arg(long, conflicts_with_all = ["export", "output", "format"])]
    install: bool,
    /// Name of the installed network [default: that of a known network, or of the file].
    #[arg(long, value_name = "NAME", requires = "install")]
    name: Option<String>,
    /// Remove the installed network of this name, with its configs and its card.
    #[arg(long, value_name = "NAME",
          conflicts_with_all = ["file", "list", "install", "export", "output", "size", "format"])]
    remove: Option<String>,
    /// Write the config that runs the network into this file, and name the network relative to it.
    #[arg(short, long, value_name = "CONFIG", conflicts_with_all = ["export", "format"])]
    output: Option<PathBuf>,
    /// Replace an existing config, the edited config of an installed network, or an exported network
    /// and its card.
    #[arg(long)]
    overwrite: bool,
    /// Write the network of this plugin into the file, and its card beside it, instead of reading
    /// the file.
    #[arg(long, value_name = "PLUGIN", conflicts_with_all = ["size", "format"])]
    export: Option<String>,
    /// Model file of the plugin whose network is exported [default: the built-in one].
    #[arg(long, value_name = "MODEL", requires = "export")]
    weights: Option<PathBuf>,
    /// Write an input of the exported network, and the outputs that the plugin computes for it, into
    /// this file as JSON, to compare another program with.
    #[arg(long, value_name = "JSON", requires = "export")]
    sample: Option<PathBuf>,
    /// Columns and rows of the input, if the file leaves them open.
    #[arg(long, value_names = ["COLUMNS", "ROWS"], num_args = 2)]
    size: Option<Vec<usize>>,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Network that a config can name.
pub(super) enum Known<'a> {
    Detector(KnownDetector<'a>),
    Embedding(Box<KnownEmbedding>),
}

/// Network for re-identification.
pub(super) struct KnownEmbedding {
    network: EmbeddingNetwork,
    pub(super) numbers: usize,
    pub(super) call_ms: f64,
}

/// Detector of a known family.
pub(super) struct KnownDetector<'a> {
    about: &'a About,
    pub(super) family: Family,
    pub(super) input: InputSize,
    pub(super) call_ms: f64,
    /// The entry of the table of networks, for a file that is in it.
    published: Option<&'static KnownNetwork>,
}

/// Runs `tagalong model`.
///
/// # Errors
/// A file that is refused (its cause and remedy), or whose outputs no decoder reads; an export of
/// a plugin without a network; files that cannot be written.
pub fn model(args: &ModelArgs, registry: &Registry) -> Outcome {
    if let Some(name) = &args.remove {
        return remove(name);
    }
    let Some(file) = &args.file else {
        print(&match args.format {
            Format::Text => networks::as_text(),
            Format::Json => to_json("the networks", &networks::as_json())?,
        })?;
        return Ok(Ended::Well);
    };
    if let Some(plugin) = &args.export {
        let weights = args.weights.as_deref();
        let sample = args.sample.as_deref();
        let overwrite = args.overwrite;
        return Export { plugin, file, weights, sample, overwrite }.run(registry);
    }
    if let Some(why) = name_for_file(file) {
        return Err(Failure::usage(why));
    }
    let size = args.size.as_deref().and_then(|size| <[usize; 2]>::try_from(size).ok());
    let shown = file.display();
    let limits = Limits::default();
    let about =
        inspect(file, size, &limits).map_err(|why| Failure::failed(format!("{shown}: {why}")))?;
    let known = known(file, &about, size, &limits)
        .map_err(|why| Failure::failed(format!("{shown}: {why}")));
    if args.install {
        let known = known?;
        return Install {
            file,
            name: args.name.as_deref(),
            about: &about,
            known: &known,
            overwrite: args.overwrite,
        }
        .run();
    }
    if let Some(config) = &args.output {
        let known = known?;
        spare(config, args.overwrite)?;
        make_room_for(config)?;
        let name = relative_to(config, file)?;
        write_file(config, as_text(&name, &about, Some(&known), NetworkConfig::Colour))?;
        print(&format!("written: {}\n", config.display()))?;
        return Ok(Ended::Well);
    }
    print(&match args.format {
        // The text may become a config anywhere, so it names the file from the root on.
        Format::Text => {
            as_text(&absolute(file)?, &about, known.as_ref().ok(), NetworkConfig::Colour)
        }
        Format::Json => to_json("the network", &as_json(&about, known.as_ref().ok()))?,
    })?;
    known.map(|_| Ended::Well)
}

/// Returns the remedy for the name of a network in the place of its file; `None` for any other path.
fn name_for_file(file: &Path) -> Option<String> {
    let name = file.to_str().filter(|_| !file.exists())?;
    if let Some(folder) = networks_folder() {
        let NetworkFiles { onnx, .. } = NetworkFiles::of(&folder, name);
        if onnx.is_file() && !name.contains(['/', '\\']) {
            let path = onnx.display();
            return Some(format!("`{name}` is installed already: {path} is its file"));
        }
    }
    missing_network(name)
}

/// Returns a path from the root on.
fn absolute(file: &Path) -> Result<PathBuf, Failure> {
    std::path::absolute(file).map_err(|why| Failure::failed(format!("{}: {why}", file.display())))
}

/// Returns the path of a file by which a config names it: relative to the folder of the config
/// where the file is in it, and otherwise from the root on.
fn relative_to(config: &Path, file: &Path) -> Result<PathBuf, Failure> {
    let config = absolute(config)?;
    let file = absolute(file)?;
    let folder = config.parent().unwrap_or(&config);
    Ok(file.strip_prefix(folder).map(Path::to_owned).unwrap_or(file))
}

fn known<'a>(
    file: &Path,
    about: &'a About,
    size: Option<[usize; 2]>,
    limits: &Limits,
) -> Result<Known<'a>, String> {
    if let Ok((numbers, _)) = about.embedding() {
        let mut network = EmbeddingNetwork::load(file, None, limits)?;
        let InputSize { width, height, .. } = network.input();
        let image = RgbImage::filled(width, height, [114; 3]);
        let whole = Rect::new(0.0, 0.0, width as f64, height as f64);
        let call_ms = fastest_ms(|| network.embed(&image, &whole).map(drop))?;
        let known = KnownEmbedding { network, numbers, call_ms };
        return Ok(Known::Embedding(Box::new(known)));
    }
    let family = about.family()?;
    let input = about.input.clone()?;
    let choices = Choices { size, ..Choices::default() };
    // A network without the usual class of people is known all the same.
    let call_ms = match PersonNetwork::load(file, &choices, limits) {
        Ok(mut network) => {
            let image = RgbImage::filled(input.width, input.height, [114; 3]);
            fastest_ms(|| network.find(&image, &family.preparation(), 0.5, 0.5).map(drop))?
        }
        Err(_) => 0.0,
    };
    let published =
        read_network(file).ok().and_then(|bytes| networks::known_by_hash(&hash_of(&bytes)));
    Ok(Known::Detector(KnownDetector { about, family, input, call_ms, published }))
}

/// Returns the time of the fastest of some calls.
fn fastest_ms(mut call: impl FnMut() -> Result<(), String>) -> Result<f64, String> {
    let mut fastest = f64::INFINITY;
    for _ in 0..CALLS {
        let start = Instant::now();
        call()?;
        fastest = fastest.min(1e3 * start.elapsed().as_secs_f64());
    }
    Ok(fastest)
}

fn list(ports: &[Port]) -> String {
    ports.iter().map(Port::to_string).collect::<Vec<_>>().join(", ")
}

/// Returns a part of a config, with the description as comments.
pub(super) fn as_text(
    file: &Path,
    about: &About,
    known: Option<&Known<'_>>,
    config: NetworkConfig,
) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(out, "# inputs   {}", list(&about.inputs));
    let _ = writeln!(out, "# outputs  {}", list(&about.outputs));
    if let Ok(shapes) = &about.run {
        let shapes: Vec<String> = shapes.iter().map(ToString::to_string).collect();
        let _ = writeln!(out, "# a call   {}", shapes.join(", "));
    }
    match known {
        Some(Known::Detector(known)) => {
            known.describe(&mut out);
            known.write_config(file, config, &mut out);
        }
        Some(Known::Embedding(known)) => known.describe(file, &mut out),
        None => {}
    }
    out
}

/// Writes the preparation of the image of a network.
fn describe_input(input: InputSize, preparation: &Preparation, out: &mut String) {
    let colours = match preparation.colours {
        Colours::Rgb => "RGB",
        Colours::Bgr => "BGR",
    };
    let fit = match preparation.fit {
        Fit::Stretch => "stretched to it".to_owned(),
        Fit::Centre => format!("centred, padded with {}", preparation.padding),
        Fit::TopLeft => format!("at the top left, padded with {}", preparation.padding),
    };
    let mean = preparation.mean;
    let deviation = preparation.deviation;
    let _ = writeln!(out, "# image    {} x {} pixels, {fit}", input.width, input.height);
    let _ = writeln!(out, "# colours  {colours}, mean {mean:?}, deviation {deviation:?}");
}

impl KnownEmbedding {
    fn describe(&self, file: &Path, out: &mut String) {
        let convention = self.network.convention();
        let name = json!(file.to_string_lossy());
        let numbers = self.numbers;
        let _ = writeln!(
            out,
            "# kind     re-identification: an embedding of {numbers} numbers per person"
        );
        describe_input(self.network.input(), &convention.preparation(), out);
        let _ = writeln!(out, "# time     {:.1} ms a person, on one thread", self.call_ms);
        let _ = write!(out, "\n[appearance]\nmodel = {name}\n");
        let _ = writeln!(out, "convention = \"{}\"", convention.name());
        let _ = write!(out, "\n[reidentification]\nremember_s = 60.0\nassociation_weight = 4.0\n");
    }
}

impl KnownDetector<'_> {
    fn describe(&self, out: &mut String) {
        let Self { family, input, .. } = self;
        let _ = writeln!(out, "# family   {family} ({})", family.networks());
        describe_input(*input, &family.preparation(), out);
        let people = match self.about.people(*family) {
            Ok(classes) => format!("class {} (`classes` if not)", self.named(&classes)),
            Err(why) => format!("none: the file {why}"),
        };
        let _ = writeln!(out, "# people   {people}");
        if self.call_ms > 0.0 {
            let _ = writeln!(out, "# time     {:.1} ms a call, on one thread", self.call_ms);
        }
    }

    /// Returns classes with the names that the file has for them.
    fn named(&self, classes: &[usize]) -> String {
        let mut named = Vec::new();
        for class in classes {
            named.push(match self.about.class_names.get(*class) {
                Some(name) => format!("{class}, `{}`", name.escape_debug()),
                None => class.to_string(),
            });
        }
        named.join(" and ")
    }

    fn write_config(&self, file: &Path, config: NetworkConfig, out: &mut String) {
        // A string of JSON is one of TOML.
        let mut lines = format!("model = {}\n", json!(file.to_string_lossy()));
        let _ = writeln!(lines, "family = \"{}\"", self.family);
        let mut shapes = self.about.inputs.iter().map(|port| &port.shape);
        if shapes.any(|shape| shape.len() == 4 && shape[1..].contains(&None)) {
            let _ = writeln!(lines, "size = [{}, {}]", self.input.width, self.input.height);
        }
        // Beside other detectors and their verifiers the scores of its family do.
        if let Some(network) = self.published.filter(|_| config == NetworkConfig::Colour) {
            let scores =
                [("discover_score", network.discover_score), ("track_score", network.track_score)];
            for (key, score) in scores {
                // A number of Rust is one of TOML.
                let _ = score.map(|score| writeln!(lines, "{key} = {score:?}"));
            }
        }
        let settings = format!("{SETTINGS}{lines}");
        let _ = write!(out, "\n{}", config.text().replacen(SETTINGS, &settings, 1));
    }
}

fn as_json(about: &About, known: Option<&Known<'_>>) -> Value {
    let [inputs, outputs] = [&about.inputs, &about.outputs].map(|ports| {
        ports
            .iter()
            .map(|port| json!({ "name": port.name, "shape": port.shape }))
            .collect::<Vec<_>>()
    });
    let detector = match known {
        Some(Known::Detector(known)) => Some(known),
        _ => None,
    };
    let embedding = match known {
        Some(Known::Embedding(known)) => Some(known),
        _ => None,
    };
    let input = detector.map(|known| known.input).or(embedding.map(|known| known.network.input()));
    let call_ms = detector.map(|known| known.call_ms).or(embedding.map(|known| known.call_ms));
    json!({
        "inputs": inputs,
        "outputs": outputs,
        "family": detector.map(|known| known.family.name()),
        "vector": embedding.map(|known| known.numbers),
        "size": input.map(|input| [input.width, input.height]),
        "call_ms": call_ms,
    })
}
