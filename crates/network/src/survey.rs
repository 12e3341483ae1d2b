//! Check of the bytes of an ONNX file before a runtime reads them.
//!
//! An ONNX file is a Protocol Buffers message. The runtime limits neither its nesting nor the sizes
//! that a few bytes can request, so [`Survey::of`] walks over the message without allocating memory
//! for it, counts its operators, and rejects those with constants that would create huge tensors.

use std::collections::BTreeMap;

use crate::Limits;

/// Maximum nesting of graphs within operators.
const MAX_DEPTH: usize = 8;
/// Maximum nesting of messages: three for each graph, and those of the type of a tensor.
const MAX_MESSAGES: usize = 3 * MAX_DEPTH + 16;
/// Maximum number of values of a constant that can be a size: no operator has a shape with more.
const MAX_SIZES: usize = 16;
/// Operators whose output size is given by the values of a constant input.
const GROWING: [&str; 8] =
    ["ConstantOfShape", "Expand", "Tile", "Range", "Pad", "Resize", "Upsample", "OneHot"];

/// Attributes that make the output of an operator larger, or its loops longer, with the largest
/// values that occur in networks.
const BOUNDED: [(&str, u64); 6] = [
    ("pads", 256),
    ("output_padding", 256),
    ("strides", 4096),
    ("dilations", 4096),
    ("kernel_shape", 4096),
    ("output_shape", 16_384),
];

/// Operators and constants of an ONNX file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Number of operators.
    pub operators: usize,
    /// Names of their outputs.
    pub values: Vec<String>,
    /// Integer constants by name: the product of their values above one.
    sizes: BTreeMap<String, f64>,
}

impl Survey {
    /// Checks a file.
    ///
    /// # Errors
    /// Bytes that are not an ONNX file, a file that ends early, and one beyond the limits; the
    /// message is a sentence with the remedy.
    pub fn of(bytes: &[u8], limits: &Limits) -> Result<Self, String> {
        check_encoding(bytes, Part::Model, 0)?;
        let mut survey = Self::default();
        let mut graphs = 0;
        for field in Fields(bytes) {
            let (number, content) = field?;
            if let (7, Content::Bytes(graph)) = (number, content) {
                graphs += 1;
                survey.add_graph(graph, limits, 0)?;
            }
        }
        if graphs == 0 {
            return Err("it holds no graph: export the network as ONNX".into());
        }
        Ok(survey)
    }

    fn add_graph(&mut self, graph: &[u8], limits: &Limits, depth: usize) -> Result<(), String> {
        if depth > MAX_DEPTH {
            return Err(format!("its graphs are nested more than {MAX_DEPTH} deep"));
        }
        // Constants come first, because the check of operators needs them.
        for field in Fields(graph) {
            if let (5, Content::Bytes(tensor)) = field? {
                self.add_constant(&Constant::of(tensor)?, limits)?;
            }
        }
        for field in Fields(graph) {
            if let (1, Content::Bytes(node)) = field? {
                self.add_operator(node, limits, depth)?;
            }
        }
        Ok(())
    }

    fn add_constant(&mut self, constant: &Constant, limits: &Limits) -> Result<(), String> {
        let values = constant.values;
        if values > limits.tensor_values as f64 {
            let most = limits.tensor_values;
            let name = &constant.name;
            return Err(format!("its constant `{name}` has {values} numbers; at most {most} may"));
        }
        if let Some(size) = constant.size {
            self.sizes.insert(constant.name.clone(), size);
        }
        Ok(())
    }

    fn add_operator(&mut self, node: &[u8], limits: &Limits, depth: usize) -> Result<(), String> {
        self.operators += 1;
        if self.operators > limits.operators {
            let most = limits.operators;
            return Err(format!("it has more than {most} operators: raise `max_operators`"));
        }
        let operator = Operator::of(node)?;
        for constant in &operator.constants {
            // The constant of a `Constant` operator has the name of its output.
            let name = operator.outputs.first().cloned().unwrap_or_default();
            self.add_constant(&Constant { name, ..constant.clone() }, limits)?;
        }
        for graph in &operator.graphs {
            self.add_graph(graph, limits, depth + 1)?;
        }
        if GROWING.contains(&operator.kind) {
            let sizes = operator.inputs.iter().filter_map(|input| self.sizes.get(input));
            let largest = sizes.copied().fold(0.0, f64::max);
            if largest > limits.tensor_values as f64 {
                let kind = operator.kind;
                let most = limits.tensor_values;
                return Err(format!(
                    "its operator `{kind}` makes a tensor of {largest} numbers; at most {most} may"
                ));
            }
        }
        self.values.extend(operator.outputs);
        Ok(())
    }
}

/// Kind of message in a file, as in `onnx.proto`.
#[derive(Clone, Copy)]
enum Part {
    Model,
    Graph,
    Node,
    Attribute,
    Tensor,
    Sparse,
    ValueInfo,
    Type,
    TensorType,
    Nested,
    Map,
    Shape,
    Function,
    /// A message that contains no other.
    Leaf,
}

impl Part {
    /// Returns the kind of message in a field of this one; `None` for a field without one.
    fn within(self, field: u64) -> Option<Self> {
        Some(match (self, field) {
            (Self::Model, 7) | (Self::Attribute, 6 | 11) => Self::Graph,
            (Self::Model, 25) => Self::Function,
            (Self::Model, 8 | 14) | (Self::Graph, 14 | 16) | (Self::Node, 9) => Self::Leaf,
            (Self::Graph, 1) | (Self::Function, 7) => Self::Node,
            (Self::Graph, 5) | (Self::Attribute, 5 | 10) | (Self::Sparse, 1 | 2) => Self::Tensor,
            (Self::Graph, 11..=13) | (Self::Function, 12) => Self::ValueInfo,
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Self::Sparse,
            (Self::Node, 5) | (Self::Function, 11) => Self::Attribute,
            (Self::ValueInfo, 2) | (Self::Attribute, 14 | 15) => Self::Type,
            (Self::Type, 1 | 8) => Self::TensorType,
            (Self::Type, 4 | 9) => Self::Nested,
            (Self::Type, 5) => Self::Map,
            (Self::Nested, 1) | (Self::Map, 2) => Self::Type,
            (Self::TensorType, 2) => Self::Shape,
            (Self::Tensor, 3 | 13 | 16) | (Self::Shape, 1) => Self::Leaf,
            (Self::Function, 9 | 14) | (Self::ValueInfo, 4) => Self::Leaf,
            _ => return None,
        })
    }
}

/// Rejects a message with damaged fields, or with groups, at any depth: a reader that skips over
/// groups may never end in a damaged one.
fn check_encoding(message: &[u8], part: Part, depth: usize) -> Result<(), String> {
    if depth > MAX_MESSAGES {
        return Err(format!("its messages are nested more than {MAX_MESSAGES} deep"));
    }
    for field in Fields(message) {
        if let (number, Content::Bytes(content)) = field?
            && let Some(inner) = part.within(number)
        {
            check_encoding(content, inner, depth + 1)?;
        }
    }
    Ok(())
}

/// Parts of an operator of a graph.
#[derive(Default)]
struct Operator<'a> {
    kind: &'a str,
    inputs: Vec<String>,
    outputs: Vec<String>,
    constants: Vec<Constant>,
    graphs: Vec<&'a [u8]>,
}

impl<'a> Operator<'a> {
    fn of(node: &'a [u8]) -> Result<Self, String> {
        let mut operator = Self::default();
        for field in Fields(node) {
            match field? {
                (1, Content::Bytes(name)) => operator.inputs.push(text(name)),
                (2, Content::Bytes(name)) => operator.outputs.push(text(name)),
                (4, Content::Bytes(kind)) => {
                    operator.kind = std::str::from_utf8(kind).unwrap_or_default();
                }
                (5, Content::Bytes(attribute)) => operator.add_attribute(attribute)?,
                _ => {}
            }
        }
        Ok(operator)
    }

    fn add_attribute(&mut self, attribute: &'a [u8]) -> Result<(), String> {
        let mut name = "";
        let mut largest = 0;
        for field in Fields(attribute) {
            match field? {
                (1, Content::Bytes(text)) => name = std::str::from_utf8(text).unwrap_or_default(),
                (3 | 8, Content::Number(number)) => largest = largest.max(magnitude(number)),
                (8, Content::Bytes(packed)) => {
                    largest = varints(packed)?.into_iter().map(magnitude).fold(largest, u64::max);
                }
                (5, Content::Bytes(tensor)) => self.constants.push(Constant::of(tensor)?),
                (6 | 11, Content::Bytes(graph)) => self.graphs.push(graph),
                _ => {}
            }
        }
        match BOUNDED.iter().find(|(bounded, most)| *bounded == name && largest > *most) {
            Some((_, most)) => Err(format!(
                "the `{name}` of an operator has the number {largest}; at most {most} may be there"
            )),
            None => Ok(()),
        }
    }
}

/// Constant tensor of a file.
#[derive(Clone, Debug, Default)]
struct Constant {
    name: String,
    /// Number of its values, from its dimensions.
    values: f64,
    /// Product of its values above one, if they are a few integers.
    size: Option<f64>,
}

impl Constant {
    fn of(tensor: &[u8]) -> Result<Self, String> {
        const INT64: u64 = 7;
        let mut constant = Self { values: 1.0, ..Self::default() };
        let mut numbers = Vec::new();
        let mut kind = 0;
        for field in Fields(tensor) {
            match field? {
                (1, Content::Number(size)) => constant.values *= size as f64,
                (1, Content::Bytes(packed)) => {
                    for size in varints(packed)? {
                        constant.values *= size as f64;
                    }
                }
                (2, Content::Number(number)) => kind = number,
                (7, Content::Number(number)) => numbers.push(number as i64),
                (7, Content::Bytes(packed)) if packed.len() <= 10 * MAX_SIZES => {
                    numbers.extend(varints(packed)?.into_iter().map(|number| number as i64));
                }
                (8, Content::Bytes(name)) => constant.name = text(name),
                (9, Content::Bytes(raw)) if kind == INT64 && raw.len() <= 8 * MAX_SIZES => {
                    let (words, _) = raw.as_chunks::<8>();
                    numbers.extend(words.iter().map(|word| i64::from_le_bytes(*word)));
                }
                _ => {}
            }
        }
        let above_one = numbers.iter().filter(|number| **number > 1).map(|number| *number as f64);
        constant.size = (!numbers.is_empty()).then(|| above_one.product());
        Ok(constant)
    }
}

/// Returns the magnitude of an integer that is written as unsigned.
fn magnitude(number: u64) -> u64 {
    (number as i64).unsigned_abs()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn varints(mut bytes: &[u8]) -> Result<Vec<u64>, String> {
    let mut numbers = Vec::new();
    while !bytes.is_empty() {
        numbers.push(varint(&mut bytes).ok_or_else(truncated)?);
    }
    Ok(numbers)
}

fn truncated() -> String {
    "it is truncated or no ONNX file: export or copy it again".into()
}

/// Content of a field of a message.
#[derive(Clone, Copy)]
pub(crate) enum Content<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

/// Fields of a message, by number. After an error there are no more.
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl<'a> Fields<'a> {
    fn read(&mut self) -> Option<(u64, Content<'a>)> {
        let key = varint(&mut self.0)?;
        let content = match key & 7 {
            0 => Content::Number(varint(&mut self.0)?),
            1 => Content::Bytes(self.take(8)?),
            2 => {
                let length = varint(&mut self.0)?;
                Content::Bytes(self.take(usize::try_from(length).ok()?)?)
            }
            5 => Content::Bytes(self.take(4)?),
            _ => return None,
        };
        Some((key >> 3, content))
    }

    fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<(u64, Content<'a>), String>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let field = self.read();
        if field.is_none() {
            self.0 = &[];
        }
        Some(field.ok_or_else(truncated))
    }
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    for shift in (0..64).step_by(7) {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u64::from(first & 0x7f) << shift;
        if first & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Writes a field with bytes.
    fn field(number: u8, content: &[u8]) -> Vec<u8> {
        let mut bytes = vec![number << 3 | 2];
        let mut length = content.len();
        while length > 127 {
            bytes.push((length & 127) as u8 | 128);
            length >>= 7;
        }
        bytes.push(length as u8);
        [bytes, content.to_vec()].concat()
    }

    fn node(kind: &str, input: &str, output: &str) -> Vec<u8> {
        let parts = [field(1, input.as_bytes()), field(2, output.as_bytes())].concat();
        field(1, &[parts, field(4, kind.as_bytes())].concat())
    }

    fn sizes(name: &str, numbers: &[i64]) -> Vec<u8> {
        let raw: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let head = vec![1 << 3, numbers.len() as u8, 2 << 3, 7];
        field(5, &[head, field(8, name.as_bytes()), field(9, &raw)].concat())
    }

    fn survey(graph: &[u8]) -> Result<Survey, String> {
        Survey::of(&field(7, graph), &Limits { operators: 3, ..Limits::default() })
    }

    #[test]
    fn operators_and_their_outputs_are_counted() {
        let graph = [node("Relu", "x", "y"), node("Relu", "y", "z")].concat();
        let survey = survey(&graph).unwrap();
        assert_eq!((survey.operators, survey.values), (2, vec!["y".to_owned(), "z".to_owned()]));
    }

    /// A damaged file must not exhaust the stack before its graphs are counted.
    #[test]
    fn messages_that_are_nested_too_deep_are_refused() {
        fn nested(depth: usize) -> Vec<u8> {
            // Field 5 of an operator is an attribute, field 6 of that another graph.
            (0..depth)
                .fold(node("Relu", "x", "y"), |graph, _| field(1, &field(5, &field(6, &graph))))
        }

        fn check(depth: usize) -> Result<(), String> {
            check_encoding(&field(7, &nested(depth)), Part::Model, 0)
        }

        assert!(check(MAX_MESSAGES / 3 - 2).is_ok());
        let why = check(MAX_MESSAGES / 3 + 2).unwrap_err();
        assert!(why.contains("nested more than"), "{why}");
    }

    /// The constant of an operator has no name of its own.
    #[test]
    fn the_constant_of_an_operator_is_known_by_its_output() {
        let raw: Vec<u8> = [1_i64 << 20, 1 << 20].iter().flat_map(|n| n.to_le_bytes()).collect();
        let tensor = [vec![1 << 3, 2, 2 << 3, 7], field(9, &raw)].concat();
        let constant = [field(2, b"shape"), field(4, b"Constant"), field(5, &field(5, &tensor))];
        let graph = [field(1, &constant.concat()), node("ConstantOfShape", "shape", "y")].concat();
        let why = survey(&graph).unwrap_err();
        assert!(why.contains("makes a tensor of 1099511627776"), "{why}");
    }

    #[test]
    fn too_many_operators_are_refused() {
        let three = node("Relu", "x", "y").repeat(3);
        assert!(survey(&three).is_ok());
        let four = node("Relu", "x", "y").repeat(4);
        assert!(survey(&four).unwrap_err().contains("more than 3 operators"));
    }

    #[test]
    fn constants_that_ask_for_huge_tensors_are_refused() {
        fn make(kind: &str, numbers: &[i64]) -> Result<Survey, String> {
            survey(&[node(kind, "shape", "y"), sizes("shape", numbers)].concat())
        }

        assert!(make("ConstantOfShape", &[1, 64, 80, 80]).is_ok());
        let why = make("ConstantOfShape", &[1 << 20, 1 << 20]).unwrap_err();
        assert!(why.contains("`ConstantOfShape` makes a tensor of 1099511627776"), "{why}");
        assert!(make("Expand", &[-1, 1 << 40]).is_err());
        // The ends of a slice are often the largest integer there is.
        assert!(make("Slice", &[i64::MAX]).is_ok());
    }

    #[test]
    fn attributes_that_ask_for_huge_outputs_are_refused() {
        fn with(name: &str, numbers: &[u8]) -> Result<Survey, String> {
            let attribute = [field(1, name.as_bytes()), numbers.to_vec()].concat();
            let parts = [field(2, b"y"), field(4, b"AveragePool"), field(5, &attribute)].concat();
            survey(&field(1, &parts))
        }

        // 256 and 257, as a number by itself and in a packed list, and the least negative number.
        assert!(with("pads", &[8 << 3, 0x80, 2]).is_ok());
        let why = with("pads", &[8 << 3, 0x81, 2]).unwrap_err();
        assert!(why.contains("`pads` of an operator has the number 257"), "{why}");
        assert!(with("pads", &field(8, &[0, 0x81, 2, 0])).is_err());
        let least = [[8 << 3].as_slice(), &[0x80; 9], &[1]].concat();
        assert!(with("pads", &least).is_err());
        assert!(with("axis", &[3 << 3, 0x81, 2]).is_ok());
    }

    #[test]
    fn damage_is_found_in_every_message() {
        fn survey(bytes: &[u8]) -> Result<Survey, String> {
            Survey::of(bytes, &Limits::default())
        }

        /// Surveys a model with this version of the operators.
        fn survey_version(content: &[u8]) -> Result<Survey, String> {
            survey(&[field(7, &node("Relu", "x", "y")), field(8, content)].concat())
        }

        assert!(survey_version(&[2 << 3, 17]).is_ok());
        // A group, and a field that ends early, in the version of the operators.
        assert!(survey_version(&[2 << 3 | 3, 17]).unwrap_err().contains("truncated"));
        assert!(survey_version(&[1 << 3 | 2, 17]).is_err());
        for (size, is_fine) in [([1 << 3, 64], true), ([1 << 3 | 4, 64], false)] {
            // A size of an input: value, type, tensor, shape, size.
            let tensor = field(1, &field(2, &field(1, &size)));
            let graph = [node("Relu", "x", "y"), field(11, &field(2, &tensor))].concat();
            assert_eq!(survey(&field(7, &graph)).is_ok(), is_fine, "{size:?}");
        }
    }

    #[test]
    fn a_constant_of_huge_dimensions_is_refused() {
        let tensor = [vec![1 << 3, 255, 255, 255, 255, 15], field(8, b"w")].concat();
        assert!(survey(&field(5, &tensor)).unwrap_err().contains("`w` has 4294967295 numbers"));
    }

    #[test]
    fn deep_nesting_is_refused_and_does_not_overflow() {
        let mut graph = node("Relu", "x", "y");
        for _ in 0..2000 {
            graph = field(1, &field(5, &field(6, &graph)));
        }
        let limits = Limits { operators: usize::MAX, ..Limits::default() };
        let why = Survey::of(&field(7, &graph), &limits).unwrap_err();
        assert!(why.contains("nested"), "{why}");
    }

    #[test]
    fn bytes_that_are_no_onnx_file_are_refused() {
        for bytes in [&b""[..], b"\x08\x07", b"#!/bin/sh\n", b"\x89PNG\r\n\x1a\n"] {
            assert!(Survey::of(bytes, &Limits::default()).is_err(), "{bytes:?}");
        }
        let whole = field(7, &node("Relu", "x", "y"));
        for end in 1..whole.len() {
            let why = Survey::of(&whole[..end], &Limits::default()).unwrap_err();
            assert!(why.contains("truncated"), "{end}: {why}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = Survey::of(&bytes, &Limits::default());
            let _ = Survey::of(&field(7, &bytes), &Limits::default());
        }
    }
}
