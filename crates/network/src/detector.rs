//! Detection networks of one of the families, from a file to boxes in an image.

use std::io::ErrorKind;
use std::path::Path;

use tagalong_config::{FileLimit, model_hint, read_bytes};
use tagalong_core::RgbImage;

use crate::decode::{Wanted, decode, suppress};
use crate::family::{OutputShape, recognise, shapes_of};
use crate::installed::installed_names;
use crate::network::rten;
use crate::order::Shapes;
use crate::values::{unit_of_columns, unit_of_rows};
use crate::worker::Worker;
use crate::{
    BoxOrder, BoxUnit, ClassNames, Element, Family, InputSize, Limits, Network, Port, Preparation,
    Runtime, ScoredBox, Tensor,
};

/// Columns and rows of an input whose size the file leaves open.
pub(crate) const USUAL_SIZE: [usize; 2] = [640, 640];
/// The same for integers with the channels last, as in MoveNet: the size that its authors use for
/// six people.
const MOVENET_SIZE: [usize; 2] = [256, 256];
/// Maximum number of columns and rows of an input.
const MAX_SIDE: usize = 4096;
/// Name of the input for the size of the image.
const SIZES: &str = "orig_target_sizes";

/// Columns and rows of an input whose size the file leaves open.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenSize {
    /// Size that the caller chose; an error if the file has a fixed size that differs.
    pub chosen: Option<[usize; 2]>,
    /// Size if the caller chose none.
    pub usual: [usize; 2],
}

/// Choices of the caller that a file leaves open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// The family; by default recognised from the outputs.
    pub family: Option<Family>,
    /// Columns and rows of the input, if the file leaves them open.
    pub size: Option<[usize; 2]>,
    /// Classes of people; by default those that the file names so, otherwise that of the family.
    pub classes: Vec<usize>,
    /// Unit of the boxes; by default recognised from the outputs.
    pub unit: Option<BoxUnit>,
    /// Order of the corners in a list; by default x before y. If the boxes that are found show
    /// another order, that is an error.
    pub order: Option<BoxOrder>,
}

/// Description of a network file.
#[derive(Clone, Debug)]
pub struct About {
    /// Inputs as the file declares them.
    pub inputs: Vec<Port>,
    /// Outputs as the file declares them.
    pub outputs: Vec<Port>,
    /// Size and layout of the input image; an error is a sentence.
    pub input: Result<InputSize, String>,
    /// Outputs of a first call; an error is a sentence.
    pub run: Result<Vec<OutputShape>, String>,
    /// Names of the classes, if the file has them.
    pub class_names: ClassNames,
    /// Family, recognised from those outputs.
    family: Result<Family, String>,
    /// Unit of the boxes of a grid, recognised from those outputs.
    unit: Option<BoxUnit>,
}

impl About {
    /// Describes a network, and runs it once.
    fn of(network: &mut impl Network, class_names: ClassNames, size: OpenSize) -> Self {
        let inputs = network.inputs().to_vec();
        let outputs = network.outputs().to_vec();
        let image = image_port(&inputs).and_then(|image| input_size(&inputs[image], size));
        let run = image.clone().and_then(|input| {
            let found = first_run(network, input)?;
            let named = outputs.iter().map(|port| port.name.as_str()).zip(&found);
            let named: Vec<(&str, &Tensor)> = named.collect();
            let unit = match &found[..] {
                [output] => unit_of_rows(output, input).or_else(|| unit_of_columns(output, input)),
                _ => None,
            };
            Ok((shapes_of(&named), recognise(&named, input), unit))
        });
        let (run, family, unit) = match run {
            Ok((shapes, family, unit)) => (Ok(shapes), family, unit),
            Err(why) => (Err(why.clone()), Err(why), None),
        };
        Self { inputs, outputs, input: image, run, class_names, family, unit }
    }

    /// Returns the classes of people: those that the file names so, or without names that of the
    /// family.
    ///
    /// # Errors
    /// If none of the names is that of a person: a sentence with the names and the remedy.
    pub fn people(&self, family: Family) -> Result<Vec<usize>, String> {
        if self.class_names.is_empty() || family == Family::MoveNet {
            return Ok(vec![family.person_class()]);
        }
        let people = self.class_names.people();
        if people.is_empty() {
            return Err(format!(
                "names its classes {}, and none of them person, pedestrian or people: set `classes` \
                 to the numbers of those that are people",
                self.class_names.shown()
            ));
        }
        Ok(people)
    }

    /// Returns the unit of the boxes, if the outputs of the first call show it. Lists of boxes do
    /// so only if something was found.
    fn unit(&self, family: Family) -> Option<BoxUnit> {
        self.unit.filter(|_| matches!(family, Family::Yolox | Family::YoloV8))
    }

    /// Returns the family of the network.
    ///
    /// # Errors
    /// A sentence with the reason why it belongs to none.
    pub fn family(&self) -> Result<Family, String> {
        let family = self.family.clone()?;
        let has_sizes = self.inputs.iter().any(|port| port.name == SIZES);
        if family == Family::RtDetr && !has_sizes {
            return Err(format!(
                "its outputs are those of {family}, but it has no input `{SIZES}`"
            ));
        }
        Ok(family)
    }
}

/// Reads the bytes of a file within the limits.
fn read(path: &Path, limits: &Limits) -> Result<Vec<u8>, String> {
    read_bytes(path, FileLimit::Bytes(limits.file_bytes)).map_err(|why| match why.kind() {
        ErrorKind::FileTooLarge => format!("{why}: raise `max_file_mb`"),
        ErrorKind::NotFound => {
            let hint = model_hint(path, &installed_names());
            format!("cannot be read: {why}{hint}")
        }
        _ => format!("cannot be read: {why}"),
    })
}

/// Reads a network and runs it once, in a separate thread.
pub(crate) fn start(
    path: &Path,
    size: OpenSize,
    limits: &Limits,
    runtime: Runtime,
) -> Result<(Worker, About), String> {
    let bytes = read(path, limits)?;
    let names = ClassNames::of(&bytes);
    let own = *limits;
    Worker::start(
        move || runtime(bytes, &own),
        move |network| Ok(About::of(network, names, size)),
        limits.load_deadline,
    )
}

/// Describes the network in a file, and runs it once on a grey image.
///
/// # Errors
/// A file that cannot be read or is beyond the limits; the message is a sentence about the file.
pub fn inspect(path: &Path, size: Option<[usize; 2]>, limits: &Limits) -> Result<About, String> {
    let size = OpenSize { chosen: size, usual: USUAL_SIZE };
    start(path, size, limits, rten).map(|(_, about)| about)
}

/// Returns the index of the image input.
fn image_port(inputs: &[Port]) -> Result<usize, String> {
    fn is_image(port: &Port) -> bool {
        port.shape.len() == 4
    }

    let images: Vec<usize> = (0..inputs.len()).filter(|k| is_image(&inputs[*k])).collect();
    let [image] = images[..] else {
        let count = images.len();
        return Err(format!("it has {count} inputs of four dimensions; an image is one"));
    };
    match inputs.iter().enumerate().find(|(k, port)| *k != image && port.name != SIZES) {
        Some((_, port)) => Err(format!("its input {port} is not known; export it without")),
        None => Ok(image),
    }
}

fn input_size(port: &Port, size: OpenSize) -> Result<InputSize, String> {
    let [batch, first, second, last] = port.shape[..] else {
        return Err(format!("its input {port} is no image"));
    };
    let channels_last = last == Some(3) && first != Some(3);
    let (channels, height, width) =
        if channels_last { (last, first, second) } else { (first, second, last) };
    if batch.is_some_and(|batch| batch != 1) || channels.is_some_and(|channels| channels != 3) {
        return Err(format!("its input {port} is not one image of three colours"));
    }
    if port.element == Element::Other {
        return Err(format!("its input {port} must be f32, integers or bytes: export it so"));
    }
    let usual = if channels_last && port.element == Element::Integer && size.usual == USUAL_SIZE {
        MOVENET_SIZE
    } else {
        size.usual
    };
    let mut sides = usual;
    for (axis, fixed) in [width, height].into_iter().enumerate() {
        let chosen = size.chosen.map(|size| size[axis]);
        if fixed.zip(chosen).is_some_and(|(fixed, chosen)| fixed != chosen) {
            return Err(format!("its input {port} has a fixed size: remove `size`"));
        }
        sides[axis] = fixed.or(chosen).unwrap_or(usual[axis]);
    }
    let [width, height] = sides;
    if sides.iter().any(|side| !(1..=MAX_SIDE).contains(side)) {
        return Err(format!("its input is {width} x {height} pixels; a side has 1 to {MAX_SIDE}"));
    }
    Ok(InputSize { width, height, channels_last })
}

/// Returns the image together with the other inputs.
fn with_sizes(inputs: &[Port], input: InputSize, image: Tensor) -> Vec<Tensor> {
    // The boxes then come back in pixels of the input, whatever the size of the image.
    let size = vec![input.width as f32, input.height as f32];
    let sizes = Tensor::new(vec![1, 2], size).unwrap_or_default();
    inputs
        .iter()
        .map(|port| if port.name == SIZES { sizes.clone() } else { image.clone() })
        .collect()
}

/// Returns the outputs for an empty image.
fn first_run(network: &mut impl Network, input: InputSize) -> Result<Vec<Tensor>, String> {
    let shape = input.shape();
    let values = vec![0.0; shape.iter().product()];
    let image = Tensor::new(shape, values).unwrap_or_default();
    let inputs = with_sizes(network.inputs(), input, image);
    network.run(&inputs)
}

/// Network that detects people in images.
pub struct PersonNetwork {
    worker: Worker,
    about: About,
    family: Family,
    input: InputSize,
    classes: Vec<usize>,
    unit: Option<BoxUnit>,
    order: BoxOrder,
    /// Shapes of the boxes so far, from which the order of corners can be recognised; `None` if the
    /// order is known.
    shapes: Option<Shapes>,
    limits: Limits,
}

impl PersonNetwork {
    /// Reads a file and runs the network once.
    ///
    /// # Errors
    /// A file that [`inspect`] rejects, outputs of another family than the chosen one or of none,
    /// classes that the network does not have, and class names without a person; the message is a
    /// sentence about the file.
    pub fn load(path: &Path, choices: &Choices, limits: &Limits) -> Result<Self, String> {
        Self::load_with(rten, path, choices, limits)
    }

    /// Reads a file as [`Self::load`] does, with another runtime.
    ///
    /// # Errors
    /// Those of [`Self::load`].
    pub fn load_with(
        runtime: Runtime,
        path: &Path,
        choices: &Choices,
        limits: &Limits,
    ) -> Result<Self, String> {
        let size = OpenSize { chosen: choices.size, usual: USUAL_SIZE };
        let (worker, about) = start(path, size, limits, runtime)?;
        let input = about.input.clone()?;
        let shapes = about.run.clone()?;
        let family = match choices.family {
            Some(family) => family,
            None => about.family()?,
        };
        let Some(known) = family.classes(&shapes, input) else {
            let shown: Vec<String> = shapes.iter().map(OutputShape::to_string).collect();
            let shown = shown.join(", ");
            let needs = family.outputs();
            return Err(format!("is not of the family {family}: it has {shown}, not {needs}"));
        };
        let classes = if choices.classes.is_empty() {
            about.people(family)?
        } else {
            choices.classes.clone()
        };
        if let Some(beyond) = classes.iter().find(|class| known > 0 && **class >= known) {
            return Err(format!("has {known} classes from 0, and no {beyond}: set `classes`"));
        }
        if choices.unit.is_some() && !family.has_unit() {
            return Err(format!("boxes of the family {family} have one unit: remove `box_unit`"));
        }
        let unit = choices.unit.or_else(|| about.unit(family));
        if choices.order.is_some() && !family.has_order() {
            return Err(format!("boxes of the family {family} have one order: remove `box_order`"));
        }
        let is_open = family.has_order() && choices.order.is_none();
        let shapes = is_open.then(Shapes::default);
        let order = choices.order.unwrap_or_default();
        let limits = *limits;
        Ok(Self { worker, about, family, input, classes, unit, order, shapes, limits })
    }

    /// Returns the description of the file.
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Returns the family.
    pub fn family(&self) -> Family {
        self.family
    }

    /// Detects people in an image: boxes in its pixels with a score of at least `min_score`, the
    /// likeliest first. If the family leaves the suppression to the caller, boxes that overlap a
    /// likelier one by more than `iou` are removed. `None` if the call did not finish within the
    /// deadline.
    ///
    /// # Errors
    /// A failure of the runtime, and boxes whose shapes show another order of corners, in a
    /// sentence.
    pub fn find(
        &mut self,
        image: &RgbImage,
        preparation: &Preparation,
        min_score: f32,
        iou: f64,
    ) -> Result<Option<Vec<ScoredBox>>, String> {
        let Some((tensor, place)) = preparation.apply(image, self.input) else {
            return Ok(Some(Vec::new()));
        };
        let Some(outputs) = self.run(tensor)? else {
            return Ok(None);
        };
        let names = self.about.outputs.iter().map(|port| port.name.as_str());
        let outputs: Vec<(&str, &Tensor)> = names.zip(&outputs).collect();
        let shapes = shapes_of(&outputs);
        if self.family.classes(&shapes, self.input).is_none() {
            return Err("its outputs change their shape from call to call".into());
        }
        let wanted = Wanted { classes: &self.classes, min_score, order: self.order };
        let found = decode(self.family, &outputs, self.input, self.unit, wanted);
        // Lists without duplicates are sorted as well.
        let iou = if self.family.needs_suppression(&shapes) { iou } else { 1.0 };
        let mut people = suppress(found, iou);
        for person in &mut people {
            person.rect = place.rect_to_image(&person.rect);
            person.joints = person.joints.take().map(|joints| place.joints_to_image(&joints));
        }
        if let Some(shapes) = &mut self.shapes {
            shapes.take(&people, self.family.usual_score())?;
        }
        Ok(Some(people))
    }

    /// Runs the network on a prepared image. Returns its outputs in the order of the file, or
    /// `None` if they did not arrive within the deadline.
    ///
    /// # Errors
    /// A failure of the runtime, in a sentence.
    pub fn run(&mut self, image: Tensor) -> Result<Option<Vec<Tensor>>, String> {
        let inputs = with_sizes(&self.about.inputs, self.input, image);
        self.worker.run(inputs, self.limits.deadline)
    }
}
