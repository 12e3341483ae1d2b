//! Tensors that are exchanged between a network and its callers.

use std::fmt;

/// Dense tensor of numbers, in row-major order. A network converts them from and to the element
/// types of its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

impl Tensor {
    /// Creates a tensor; `None` if the number of values does not fit the shape.
    pub fn new(shape: Vec<usize>, values: Vec<f32>) -> Option<Self> {
        (count(&shape)? == values.len()).then_some(Self { shape, values })
    }

    /// Returns the size of each dimension.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Returns the numbers in row-major order.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns the rows of the last dimension; none if that is empty.
    pub fn rows(&self) -> impl Iterator<Item = &[f32]> {
        let width = self.shape.last().copied().unwrap_or(0);
        self.values.chunks_exact(width.max(1))
    }
}

/// Returns the number of values of a shape; `None` if it does not fit into a `usize`.
pub(crate) fn count(shape: &[usize]) -> Option<usize> {
    shape.iter().try_fold(1_usize, |product, size| product.checked_mul(*size))
}

/// Type of the elements of an input or output in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Element {
    /// Floating point numbers.
    Float,
    /// Integers of 32 or 64 bits.
    Integer,
    /// Bytes.
    Byte,
    /// Any other type, which no decoder reads.
    Other,
}

/// Named input or output of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Name in the file.
    pub name: String,
    /// Size of each dimension; `None` if the file leaves it open.
    pub shape: Vec<Option<usize>>,
    /// Type of the elements.
    pub element: Element,
}

impl Port {
    /// Returns the shape if the file leaves no dimension open.
    pub fn fixed_shape(&self) -> Option<Vec<usize>> {
        self.shape.iter().copied().collect()
    }
}

impl fmt::Display for Port {
    /// Writes the name and the shape: `images [1, 3, ?, ?]`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fn size(size: &Option<usize>) -> String {
            size.map_or("?".to_owned(), |size| size.to_string())
        }
        let sizes: Vec<String> = self.shape.iter().map(size).collect();
        let element = match self.element {
            Element::Float => "",
            Element::Integer => " of integers",
            Element::Byte => " of bytes",
            Element::Other => " of another type",
        };
        write!(f, "`{}` [{}]{element}", self.name, sizes.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tensor_has_the_numbers_of_its_shape() {
        let tensor = Tensor::new(vec![1, 2, 3], (0..6).map(|v| v as f32).collect()).unwrap();
        let rows: Vec<&[f32]> = tensor.rows().collect();
        assert_eq!(rows, [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
        assert!(Tensor::new(vec![2, 2], vec![0.0; 3]).is_none());
        assert!(Tensor::new(vec![usize::MAX, 2], Vec::new()).is_none());
        let empty = Tensor::new(vec![4, 0], Vec::new()).unwrap();
        assert_eq!(empty.rows().count(), 0);
    }

    #[test]
    fn a_port_is_shown_with_its_open_dimensions() {
        let shape = vec![None, Some(3)];
        let port = Port { name: "images".into(), shape, element: Element::Byte };
        assert_eq!(port.to_string(), "`images` [?, 3] of bytes");
        assert_eq!(port.fixed_shape(), None);
    }
}
