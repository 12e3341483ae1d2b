/// Network of a plugin as an ONNX file ([`crate::Registry::exporter`]).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ExportedNetwork {
    /// Content of the file.
    pub onnx: Vec<u8>,
    /// Its card, as TOML: licence, inputs and outputs.
    pub card: String,
    /// An input, and the outputs that the plugin itself computes for it, so that another program
    /// can be compared.
    pub sample: Vec<NamedTensor>,
}

impl ExportedNetwork {
    /// Creates the network: the content of its file, its card as TOML, and an input with the outputs
    /// that the plugin itself computes for it.
    pub fn new(onnx: Vec<u8>, card: String, sample: Vec<NamedTensor>) -> Self {
        Self { onnx, card, sample }
    }
}

/// Input or output of an exported network.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NamedTensor {
    /// Name in the file.
    pub name: &'static str,
    /// True for an input.
    pub is_input: bool,
    /// Size of each dimension.
    pub shape: Vec<usize>,
    /// The numbers, in row order.
    pub values: Vec<f32>,
}

impl NamedTensor {
    /// Creates an input.
    pub fn input(name: &'static str, shape: &[usize], values: Vec<f32>) -> Self {
        Self { name, is_input: true, shape: shape.to_vec(), values }
    }

    /// Creates an output.
    pub fn output(name: &'static str, shape: &[usize], values: Vec<f32>) -> Self {
        Self { name, is_input: false, shape: shape.to_vec(), values }
    }
}
