//! The runtime `rten` as an implementation of the trait [`Network`].

mod rewriting;

use std::sync::Arc;

use rten::{
    DataType, Dimension, Model, ModelOptions, NodeId, RunOptions, ThreadPool, Value, ValueOrView,
    ValueType,
};
use rten_tensor::prelude::*;

use crate::survey::Survey;
use crate::tensor::count;
use crate::{Element, Limits, Network, Port, Tensor};
use rewriting::without_scalar_division;

/// Network that runs on `rten`.
pub struct RtenNetwork {
    model: Model,
    options: RunOptions,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
}

impl RtenNetwork {
    /// Reads the bytes of an ONNX file.
    ///
    /// # Errors
    /// Bytes that fail the check, operators that the runtime does not know, weights in another
    /// file, and tensors that are too large; the message is a sentence.
    pub fn from_onnx(bytes: Vec<u8>, limits: &Limits) -> Result<Self, String> {
        let survey = Survey::of(&bytes, limits)?;
        let bytes = without_scalar_division(bytes);
        let model = ModelOptions::with_all_ops().load(bytes).map_err(|why| load_error(&why))?;
        check_tensors(&model, &survey, limits)?;
        let inputs = model.input_ids().iter().map(|id| port(&model, *id)).collect();
        let outputs = model.output_ids().iter().map(|id| port(&model, *id)).collect();
        let pool = Arc::new(ThreadPool::with_num_threads(limits.threads.max(1)));
        let options = RunOptions::default().with_thread_pool(Some(pool));
        Ok(Self { model, options, inputs, outputs })
    }
}

fn load_error(error: &rten::LoadError) -> String {
    let why = error.to_string();
    let remedy = match why.to_lowercase() {
        why if why.contains("external") => {
            "; save it with its weights in one file (`onnx.save` with \
             `save_as_external_data=False`)"
        }
        why if why.contains("operator") => {
            "; export it for opset 17, without operators of one vendor (plugins, `trt`)"
        }
        _ => "",
    };
    format!("{why}{remedy}")
}

/// Rejects tensors between operators that are too large, if their shapes are known.
fn check_tensors(model: &Model, survey: &Survey, limits: &Limits) -> Result<(), String> {
    for name in &survey.values {
        let shape = model.find_node(name).and_then(|id| model.node_info(id)?.shape());
        let known = shape.unwrap_or_default();
        let sizes: Vec<usize> = known.iter().filter_map(fixed).collect();
        if count(&sizes).is_none_or(|values| values > limits.tensor_values) {
            let most = limits.tensor_values;
            return Err(format!(
                "its tensor `{name}` has the shape {sizes:?}: above {most} numbers"
            ));
        }
    }
    Ok(())
}

fn fixed(dimension: &Dimension) -> Option<usize> {
    match dimension {
        Dimension::Fixed(size) => Some(*size),
        Dimension::Symbolic(_) => None,
    }
}

fn port(model: &Model, id: NodeId) -> Port {
    let info = model.node_info(id);
    let name = info.as_ref().and_then(|info| info.name()).unwrap_or_default().to_owned();
    let shape = info.as_ref().and_then(|info| info.shape()).unwrap_or_default();
    let element = match info.and_then(|info| info.dtype()) {
        Some(ValueType::Tensor(DataType::Float)) => Element::Float,
        Some(ValueType::Tensor(DataType::Int32)) => Element::Integer,
        Some(ValueType::Tensor(DataType::UInt8)) => Element::Byte,
        _ => Element::Other,
    };
    Port { name, shape: shape.iter().map(fixed).collect(), element }
}

/// Converts a tensor to the element type of an input.
fn to_value(port: &Port, tensor: &Tensor) -> Result<Value, String> {
    let shape = tensor.shape();
    let values = tensor.values();
    let value = match port.element {
        Element::Float | Element::Other => Value::from_shape(shape, values.to_vec()).ok(),
        Element::Integer => {
            let whole = values.iter().map(|value| value.round() as i32).collect::<Vec<_>>();
            Value::from_shape(shape, whole).ok()
        }
        Element::Byte => {
            let bytes = values.iter().map(|value| value.round() as u8).collect::<Vec<_>>();
            Value::from_shape(shape, bytes).ok()
        }
    };
    value.ok_or_else(|| format!("the input {port} cannot be made"))
}

fn to_tensor(value: Value) -> Option<Tensor> {
    match value {
        Value::FloatTensor(tensor) => Tensor::new(tensor.shape().to_vec(), tensor.to_vec()),
        Value::Int32Tensor(tensor) => {
            let values = tensor.iter().map(|value| *value as f32).collect();
            Tensor::new(tensor.shape().to_vec(), values)
        }
        Value::UInt8Tensor(tensor) => {
            let values = tensor.iter().map(|value| f32::from(*value)).collect();
            Tensor::new(tensor.shape().to_vec(), values)
        }
        _ => None,
    }
}

impl Network for RtenNetwork {
    fn inputs(&self) -> &[Port] {
        &self.inputs
    }

    fn outputs(&self) -> &[Port] {
        &self.outputs
    }

    fn run(&mut self, inputs: &[Tensor]) -> Result<Vec<Tensor>, String> {
        let ids = self.model.input_ids();
        if ids.len() != inputs.len() {
            return Err(format!("it has {} inputs, not {}", ids.len(), inputs.len()));
        }
        let mut values = Vec::with_capacity(ids.len());
        for ((id, port), tensor) in ids.iter().zip(&self.inputs).zip(inputs) {
            values.push((*id, ValueOrView::from(to_value(port, tensor)?)));
        }
        let options = Some(self.options.clone());
        let outputs = self.model.run(values, self.model.output_ids(), options);
        let outputs = outputs.map_err(|why| format!("it cannot be run: {why}"))?;
        self.outputs
            .iter()
            .zip(outputs)
            .map(|(port, value)| {
                to_tensor(value).ok_or_else(|| format!("the output {port} is no tensor of numbers"))
            })
            .collect()
    }
}
