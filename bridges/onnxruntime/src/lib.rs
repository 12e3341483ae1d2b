//! The detector `onnx` on onnxruntime.
//!
//! The runtime that Tagalong brings is written in Rust and needs no library. onnxruntime is about
//! twice as fast on a CPU, and runs on graphics cards. It is a library of the user: the environment
//! variable `ORT_DYLIB_PATH` names it, or it is found in the active Python environment, among the user's
//! Python packages or in the system. [`register`] adds the plugin `onnxruntime`, which has the
//! settings of `onnx`; [`onnxruntime`] is the runtime by itself.

mod library;

use std::sync::OnceLock;

pub use library::LIBRARY;

use ort::environment::Environment;
use ort::session::{Session, SessionInputValue};
use ort::value::{DynValue, Outlet, TensorElementType, ValueType};
use tagalong_config::Registry;
use tagalong_network::{Element, Limits, Network, Port, Tensor, check_file};
use tagalong_onnx::Onnx;

/// Name of the plugin in configs.
pub const NAME: &str = "onnxruntime";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    let summary = "people by a neural network from an ONNX file, run by onnxruntime";
    registry.detector(NAME, summary, |config, context| {
        Onnx::with_runtime(onnxruntime, config, context)
    });
}

/// Makes a network of the bytes of an ONNX file.
///
/// # Errors
/// No library, bytes that are damaged or beyond the limits, and a file that onnxruntime refuses; the
/// message is a sentence about the file.
pub fn onnxruntime(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    check_file(&bytes, limits)?;
    let builder = Session::builder(environment()?).map_err(refusal_for)?;
    let builder = builder.with_intra_threads(limits.threads.max(1));
    let mut builder = builder.map_err(refusal_for)?;
    let session = builder.commit_from_memory(&bytes).map_err(refusal_for)?;
    let [inputs, outputs] = [session.inputs(), session.outputs()].map(ports);
    let kinds = session.inputs().iter().map(element_type).collect();
    Ok(Box::new(OrtNetwork { session, inputs, outputs, kinds }))
}

/// The message on a network that the runtime does not take.
fn refusal_for(why: impl std::fmt::Display) -> String {
    format!("onnxruntime refuses it: {why}")
}

/// Loads the library on the first call.
fn environment() -> Result<&'static Environment, String> {
    static LOADED: OnceLock<Result<Environment, String>> = OnceLock::new();
    LOADED.get_or_init(load).as_ref().map_err(Clone::clone)
}

fn load() -> Result<Environment, String> {
    let path = library::path().ok_or_else(|| {
        format!(
            "needs onnxruntime: `pip install onnxruntime`, or set {LIBRARY} to the path of its library \
             (libonnxruntime.so)"
        )
    })?;
    let builder = ort::init_from(&path).map_err(|why| why.to_string());
    let built = builder.and_then(|builder| builder.build().map_err(|why| why.to_string()));
    built.map_err(|why| {
        let shown = path.display();
        format!("needs onnxruntime, which {shown} is not ({LIBRARY} names another one): {why}")
    })
}

/// Network that onnxruntime runs.
struct OrtNetwork {
    session: Session,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    kinds: Vec<Option<TensorElementType>>,
}

fn element_type(outlet: &Outlet) -> Option<TensorElementType> {
    match outlet.dtype() {
        ValueType::Tensor { ty, .. } => Some(*ty),
        _ => None,
    }
}

fn ports(outlets: &[Outlet]) -> Vec<Port> {
    let ports = outlets.iter().map(|outlet| {
        let element = match element_type(outlet) {
            Some(TensorElementType::Float32) => Element::Float,
            Some(TensorElementType::Int32 | TensorElementType::Int64) => Element::Integer,
            Some(TensorElementType::Uint8) => Element::Byte,
            _ => Element::Other,
        };
        let shape = match outlet.dtype() {
            // An open dimension is negative.
            ValueType::Tensor { shape, .. } => {
                shape.iter().map(|size| usize::try_from(*size).ok()).collect()
            }
            _ => Vec::new(),
        };
        Port { name: outlet.name().to_owned(), shape, element }
    });
    ports.collect()
}

/// Converts a tensor to the element type of an input.
fn to_value(kind: Option<TensorElementType>, tensor: &Tensor) -> Result<DynValue, String> {
    let shape = tensor.shape().to_vec();
    let rounded = tensor.values().iter().map(|value| value.round());
    let made = match kind {
        Some(TensorElementType::Int64) => {
            let values: Vec<i64> = rounded.map(|value| value as i64).collect();
            ort::value::Tensor::from_array((shape, values)).map(|value| value.into_dyn())
        }
        Some(TensorElementType::Int32) => {
            let values: Vec<i32> = rounded.map(|value| value as i32).collect();
            ort::value::Tensor::from_array((shape, values)).map(|value| value.into_dyn())
        }
        Some(TensorElementType::Uint8) => {
            let values: Vec<u8> = rounded.map(|value| value as u8).collect();
            ort::value::Tensor::from_array((shape, values)).map(|value| value.into_dyn())
        }
        _ => {
            let values = tensor.values().to_vec();
            ort::value::Tensor::from_array((shape, values)).map(|value| value.into_dyn())
        }
    };
    made.map_err(|why| format!("an input cannot be made: {why}"))
}

/// Converts an output; `None` if it is no tensor of numbers.
fn to_tensor(value: &DynValue) -> Option<Tensor> {
    if let Ok((shape, values)) = value.try_extract_tensor::<f32>() {
        return Tensor::new(known_sizes(shape)?, values.to_vec());
    }
    if let Ok((shape, values)) = value.try_extract_tensor::<i64>() {
        return Tensor::new(
            known_sizes(shape)?,
            values.iter().map(|value| *value as f32).collect(),
        );
    }
    if let Ok((shape, values)) = value.try_extract_tensor::<i32>() {
        return Tensor::new(
            known_sizes(shape)?,
            values.iter().map(|value| *value as f32).collect(),
        );
    }
    let (shape, values) = value.try_extract_tensor::<u8>().ok()?;
    Tensor::new(known_sizes(shape)?, values.iter().map(|value| f32::from(*value)).collect())
}

/// The sizes of a shape, where all are known.
fn known_sizes(shape: &ort::value::Shape) -> Option<Vec<usize>> {
    shape.iter().map(|size| usize::try_from(*size).ok()).collect()
}

impl Network for OrtNetwork {
    fn inputs(&self) -> &[Port] {
        &self.inputs
    }

    fn outputs(&self) -> &[Port] {
        &self.outputs
    }

    fn run(&mut self, inputs: &[Tensor]) -> Result<Vec<Tensor>, String> {
        if self.inputs.len() != inputs.len() {
            return Err(format!("it has {} inputs, not {}", self.inputs.len(), inputs.len()));
        }
        let mut values: Vec<(&str, SessionInputValue<'_>)> = Vec::with_capacity(inputs.len());
        for ((port, kind), tensor) in self.inputs.iter().zip(&self.kinds).zip(inputs) {
            values.push((&port.name, to_value(*kind, tensor)?.into()));
        }
        let outputs = self.session.run(values).map_err(|why| format!("it cannot be run: {why}"))?;
        let tensors = self.outputs.iter().map(|port| {
            let tensor = outputs.get(port.name.as_str()).and_then(to_tensor);
            tensor.ok_or_else(|| format!("the output {port} is no tensor of numbers"))
        });
        tensors.collect()
    }
}
