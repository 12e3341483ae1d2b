//! Changes to the bytes of an ONNX file for the runtime `rten`.
//!
//! `rten` 0.27 treats a divisor with one value as a scalar, and so loses its dimensions: `Div` of a
//! scalar by a tensor [1] gives a scalar there, but a tensor [1] by the standard. Networks that
//! compute with their own sizes (`4 / height`, as tf2onnx writes MoveNet) then fail at a later
//! `Unsqueeze` or `Concat`. Therefore a constant that is divided is instead multiplied by the
//! reciprocal, which keeps the dimensions.

use std::collections::BTreeSet;

use crate::survey::{Content, Fields};

/// Wire type of a field with a length.
const LENGTH_DELIMITED: u64 = 2;
/// Field numbers of the messages in `onnx.proto`.
const MODEL_GRAPH: u64 = 7;
const GRAPH_NODE: u64 = 1;
const GRAPH_CONSTANT: u64 = 5;
const NODE_INPUT: u64 = 1;
const NODE_OUTPUT: u64 = 2;
const NODE_NAME: u64 = 3;
const NODE_KIND: u64 = 4;
const NODE_ATTRIBUTE: u64 = 5;
const TENSOR_SIZE: u64 = 1;
const TENSOR_TYPE: u64 = 2;
const TENSOR_NAME: u64 = 8;
const ATTRIBUTE_TENSOR: u64 = 5;
/// Type of a tensor of floating point numbers.
const FLOAT: u64 = 1;

/// Returns the bytes of a file in which divisions of constants are replaced by multiplications with
/// reciprocals. Bytes that cannot be read are returned unchanged.
pub(crate) fn without_scalar_division(file: Vec<u8>) -> Vec<u8> {
    rewritten(&file).unwrap_or(file)
}

/// Returns the rewritten file; `None` if there is nothing to change.
fn rewritten(file: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    let mut is_changed = false;
    for (bytes, number, content) in spans(file) {
        match content {
            Content::Bytes(graph) if number == MODEL_GRAPH => {
                let changed = rewritten_graph(graph);
                is_changed |= changed.is_some();
                put(&mut out, MODEL_GRAPH, changed.as_deref().unwrap_or(graph));
            }
            _ => out.extend_from_slice(bytes),
        }
    }
    is_changed.then_some(out)
}

fn rewritten_graph(graph: &[u8]) -> Option<Vec<u8>> {
    let scalars = scalars_of(graph);
    let mut out = Vec::new();
    let mut is_changed = false;
    for (bytes, number, content) in spans(graph) {
        match content {
            Content::Bytes(node) if number == GRAPH_NODE => match reciprocal(node, &scalars) {
                Some(nodes) => {
                    nodes.iter().for_each(|node| put(&mut out, GRAPH_NODE, node));
                    is_changed = true;
                }
                None => out.extend_from_slice(bytes),
            },
            _ => out.extend_from_slice(bytes),
        }
    }
    is_changed.then_some(out)
}

/// Returns the names of the constants that are a single floating point number without dimensions.
fn scalars_of(graph: &[u8]) -> BTreeSet<&[u8]> {
    let mut scalars = BTreeSet::new();
    for (_, number, content) in spans(graph) {
        let Content::Bytes(message) = content else { continue };
        match number {
            GRAPH_CONSTANT if is_scalar(message) => {
                scalars.extend(bytes_of(message, TENSOR_NAME).next());
            }
            GRAPH_NODE if bytes_of(message, NODE_KIND).next() == Some(b"Constant") => {
                let mut attributes = bytes_of(message, NODE_ATTRIBUTE);
                let is_scalar = attributes
                    .any(|attribute| bytes_of(attribute, ATTRIBUTE_TENSOR).any(is_scalar));
                scalars.extend(bytes_of(message, NODE_OUTPUT).next().filter(|_| is_scalar));
            }
            _ => {}
        }
    }
    scalars
}

fn is_scalar(tensor: &[u8]) -> bool {
    let mut is_float = false;
    for (_, number, content) in spans(tensor) {
        match content {
            Content::Number(kind) if number == TENSOR_TYPE => is_float = kind == FLOAT,
            _ if number == TENSOR_SIZE => return false,
            _ => {}
        }
    }
    is_float
}

/// Returns the operators that replace the division of a constant; `None` for any other operator.
fn reciprocal(node: &[u8], scalars: &BTreeSet<&[u8]>) -> Option<[Vec<u8>; 2]> {
    if bytes_of(node, NODE_KIND).next() != Some(b"Div") {
        return None;
    }
    let inputs: Vec<&[u8]> = bytes_of(node, NODE_INPUT).collect();
    let [constant, divisor] = inputs[..] else { return None };
    let output = bytes_of(node, NODE_OUTPUT).next()?;
    if !scalars.contains(constant) {
        return None;
    }
    let name = bytes_of(node, NODE_NAME).next().unwrap_or(output);
    let between = [output, b"/reciprocal"].concat();
    let inverse = operator(b"Reciprocal", &[divisor], &between, &[name, b"/reciprocal"].concat());
    let product = operator(b"Mul", &[&between, constant], output, name);
    Some([inverse, product])
}

fn operator(kind: &[u8], inputs: &[&[u8]], output: &[u8], name: &[u8]) -> Vec<u8> {
    let mut node = Vec::new();
    inputs.iter().for_each(|input| put(&mut node, NODE_INPUT, input));
    put(&mut node, NODE_OUTPUT, output);
    put(&mut node, NODE_NAME, name);
    put(&mut node, NODE_KIND, kind);
    node
}

/// Returns the contents of all fields with this number that contain bytes.
fn bytes_of(message: &[u8], wanted: u64) -> impl Iterator<Item = &[u8]> {
    spans(message).filter_map(move |(_, number, content)| match content {
        Content::Bytes(bytes) if number == wanted => Some(bytes),
        _ => None,
    })
}

/// Returns the fields of a message, each with its own bytes; it ends at a damaged one.
fn spans(message: &[u8]) -> impl Iterator<Item = (&[u8], u64, Content<'_>)> {
    let mut fields = Fields(message);
    std::iter::from_fn(move || {
        let before = fields.0;
        let (number, content) = fields.next()?.ok()?;
        let length = before.len() - fields.0.len();
        Some((&before[..length], number, content))
    })
}

/// Writes a field with bytes.
fn put(out: &mut Vec<u8>, number: u64, content: &[u8]) {
    put_number(out, number << 3 | LENGTH_DELIMITED);
    put_number(out, content.len() as u64);
    out.extend_from_slice(content);
}

fn put_number(out: &mut Vec<u8>, mut number: u64) {
    while number > 0x7f {
        out.push((number & 0x7f) as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn field(number: u64, content: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        put(&mut out, number, content);
        out
    }

    /// Returns a constant with these dimensions.
    fn constant(name: &[u8], sizes: &[u8], kind: u8) -> Vec<u8> {
        let mut tensor = Vec::new();
        sizes.iter().for_each(|size| tensor.extend([1 << 3, *size]));
        tensor.extend([2 << 3, kind]);
        put(&mut tensor, TENSOR_NAME, name);
        field(GRAPH_CONSTANT, &tensor)
    }

    fn file(parts: &[Vec<u8>]) -> Vec<u8> {
        [vec![1 << 3, 8], field(MODEL_GRAPH, &parts.concat()), vec![5 << 3, 1]].concat()
    }

    fn divide(constant: &[u8]) -> Vec<u8> {
        field(GRAPH_NODE, &operator(b"Div", &[constant, b"x"], b"y", b"half"))
    }

    #[test]
    fn a_constant_is_multiplied_by_the_reciprocal() {
        let four = constant(b"four", &[], 1);
        let inverse = operator(b"Reciprocal", &[b"x"], b"y/reciprocal", b"half/reciprocal");
        let product = operator(b"Mul", &[b"y/reciprocal", b"four"], b"y", b"half");
        let expected =
            file(&[field(GRAPH_NODE, &inverse), field(GRAPH_NODE, &product), four.clone()]);
        assert_eq!(without_scalar_division(file(&[divide(b"four"), four])), expected);
    }

    #[test]
    fn the_constant_of_an_operator_counts_as_well() {
        let tensor = [2 << 3, 1];
        let attribute = field(NODE_ATTRIBUTE, &field(ATTRIBUTE_TENSOR, &tensor));
        let node = [operator(b"Constant", &[], b"four", b"c"), attribute].concat();
        let graph = file(&[field(GRAPH_NODE, &node), divide(b"four")]);
        assert_ne!(without_scalar_division(graph.clone()), graph);
    }

    #[test]
    fn other_operators_and_constants_stay() {
        for parts in [
            [divide(b"four"), constant(b"four", &[1], 1)],
            [divide(b"four"), constant(b"four", &[], 7)],
            [divide(b"z"), constant(b"four", &[], 1)],
        ] {
            let file = file(&parts);
            assert_eq!(without_scalar_division(file.clone()), file);
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = without_scalar_division(bytes.clone());
            let _ = without_scalar_division(field(MODEL_GRAPH, &bytes));
        }
    }
}
