//! Export of networks as ONNX files, so that other programs can run them.
//!
//! A file is a Protocol Buffers message, `ModelProto` of [`onnx.proto`]; this module writes the few
//! fields that a network needs.
//!
//! [`onnx.proto`]: https://github.com/onnx/onnx/blob/main/onnx/onnx.proto

use crate::conv::Conv;

/// Version of the format, and of the set of operators.
const IR_VERSION: u64 = 9;
const OPSET: u64 = 17;
/// Element type of all tensors: `TensorProto.FLOAT`.
const FLOAT: u64 = 1;
/// Type of an attribute that is a list of integers: `AttributeProto.INTS`.
const INTS: u64 = 7;
/// Type of an attribute that is an integer: `AttributeProto.INT`.
const INT: u64 = 2;

/// Attribute of an operator.
#[derive(Clone, Copy, Debug)]
pub enum Attribute<'a> {
    /// An integer.
    Int(i64),
    /// A list of integers.
    Ints(&'a [i64]),
}

/// Graph of a network for an ONNX file: operators in the order of their computation.
#[derive(Clone, Debug, Default)]
pub struct OnnxGraph {
    name: String,
    nodes: Vec<Message>,
    constants: Vec<Message>,
    inputs: Vec<Message>,
    outputs: Vec<Message>,
    notes: Vec<(String, String)>,
}

impl OnnxGraph {
    /// Creates a graph without operators.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }

    /// Adds an input.
    pub fn input(&mut self, name: &str, shape: &[usize]) {
        self.inputs.push(port(name, shape));
    }

    /// Adds an output that an operator of the graph computes.
    pub fn output(&mut self, name: &str, shape: &[usize]) {
        self.outputs.push(port(name, shape));
    }

    /// Adds an entry of metadata: a key and its text.
    pub fn note(&mut self, key: &str, text: &str) {
        self.notes.push((key.to_owned(), text.to_owned()));
    }

    /// Adds a constant.
    pub fn constant(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let mut tensor = Message::default();
        shape.iter().for_each(|size| tensor.number(1, *size as u64));
        tensor.number(2, FLOAT);
        tensor.text(8, name);
        tensor.bytes(9, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>());
        self.constants.push(tensor);
    }

    /// Adds an operator with one output.
    pub fn operator(
        &mut self,
        kind: &str,
        inputs: &[&str],
        output: &str,
        attributes: &[(&str, Attribute<'_>)],
    ) {
        let mut node = Message::default();
        inputs.iter().for_each(|input| node.text(1, input));
        node.text(2, output);
        node.text(3, output);
        node.text(4, kind);
        for (name, value) in attributes {
            let mut attribute = Message::default();
            attribute.text(1, name);
            match value {
                Attribute::Int(value) => {
                    attribute.number(3, *value as u64);
                    attribute.number(20, INT);
                }
                Attribute::Ints(values) => {
                    values.iter().for_each(|value| attribute.number(8, *value as u64));
                    attribute.number(20, INTS);
                }
            }
            node.message(5, &attribute);
        }
        self.nodes.push(node);
    }

    /// Adds a convolution; the names of its constants are that of its output, with a suffix.
    pub fn conv<
        const IN: usize,
        const OUT: usize,
        const SIZE: usize,
        const STRIDE: usize,
        const DILATION: usize,
    >(
        &mut self,
        conv: &Conv<IN, OUT, SIZE, STRIDE, DILATION>,
        input: &str,
        output: &str,
    ) {
        let weights = format!("{output}.weights");
        let bias = format!("{output}.bias");
        let mut turned = Vec::with_capacity(conv.weights.len());
        // A file has the weights in the order output, input, tap.
        for out in 0..OUT {
            for input in 0..IN {
                turned.extend(
                    (0..SIZE * SIZE).map(|tap| conv.weights[(tap * IN + input) * OUT + out]),
                );
            }
        }
        self.constant(&weights, &[OUT, IN, SIZE, SIZE], &turned);
        self.constant(&bias, &[OUT], &conv.bias);
        let reach = (DILATION * (SIZE / 2)) as i64;
        let attributes = [
            ("kernel_shape", Attribute::Ints(&[SIZE as i64; 2])),
            ("strides", Attribute::Ints(&[STRIDE as i64; 2])),
            ("dilations", Attribute::Ints(&[DILATION as i64; 2])),
            ("pads", Attribute::Ints(&[reach; 4])),
        ];
        self.operator("Conv", &[input, &weights, &bias], output, &attributes);
    }

    /// Returns the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut graph = Message::default();
        self.nodes.iter().for_each(|node| graph.message(1, node));
        graph.text(2, &self.name);
        self.constants.iter().for_each(|constant| graph.message(5, constant));
        self.inputs.iter().for_each(|input| graph.message(11, input));
        self.outputs.iter().for_each(|output| graph.message(12, output));
        let mut opset = Message::default();
        opset.text(1, "");
        opset.number(2, OPSET);
        let mut model = Message::default();
        model.number(1, IR_VERSION);
        model.text(2, "tagalong");
        model.message(7, &graph);
        model.message(8, &opset);
        for (key, text) in &self.notes {
            let mut note = Message::default();
            note.text(1, key);
            note.text(2, text);
            model.message(14, &note);
        }
        model.0
    }
}

/// Returns the `ValueInfoProto` of an input or output.
fn port(name: &str, shape: &[usize]) -> Message {
    let mut sizes = Message::default();
    for size in shape {
        let mut dimension = Message::default();
        dimension.number(1, *size as u64);
        sizes.message(1, &dimension);
    }
    let mut tensor = Message::default();
    tensor.number(1, FLOAT);
    tensor.message(2, &sizes);
    let mut kind = Message::default();
    kind.message(1, &tensor);
    let mut port = Message::default();
    port.text(1, name);
    port.message(2, &kind);
    port
}

/// Message of Protocol Buffers, as bytes.
#[derive(Clone, Debug, Default)]
struct Message(Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value > 0x7f {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn number(&mut self, field: u64, value: u64) {
        self.varint(field << 3);
        self.varint(value);
    }

    fn bytes(&mut self, field: u64, content: &[u8]) {
        self.varint(field << 3 | 2);
        self.varint(content.len() as u64);
        self.0.extend_from_slice(content);
    }

    fn text(&mut self, field: u64, text: &str) {
        self.bytes(field, text.as_bytes());
    }

    fn message(&mut self, field: u64, message: &Self) {
        self.bytes(field, &message.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_texts_have_the_bytes_of_protocol_buffers() {
        let mut message = Message::default();
        message.number(1, 300);
        message.text(2, "ab");
        // 300 is the example of the encoding's documentation.
        assert_eq!(message.0, [0x08, 0xac, 0x02, 0x12, 2, b'a', b'b']);
        let mut negative = Message::default();
        negative.number(20, (-1_i64) as u64);
        assert_eq!(negative.0.len(), 2 + 10);
    }

    #[test]
    fn weights_are_turned_from_taps_to_outputs() {
        let weights: Vec<f32> = (0..12).map(|value| value as f32).collect();
        // One tap, three inputs, four outputs.
        let conv: Conv<3, 4, 1, 1> = Conv { weights, bias: vec![0.5; 4] };
        let mut graph = OnnxGraph::new("test");
        graph.conv(&conv, "x", "y");
        let numbers: Vec<u8> =
            [0.0_f32, 4.0, 8.0, 1.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let bytes = graph.to_bytes();
        assert!(bytes.windows(numbers.len()).any(|window| window == numbers));
    }
}
