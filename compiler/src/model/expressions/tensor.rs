//! Shapes, and values of a shape as lists of scalar expressions.

use std::fmt;

use crate::expr::Expr;

/// The shape of a value. A column is a vector; a row is a matrix with one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// One number.
    Scalar,
    /// A column of so many numbers.
    Vector(usize),
    /// Rows and columns.
    Matrix(usize, usize),
}

impl Shape {
    /// The matrix of that size, or the vector when it has one column.
    pub fn matrix(rows: usize, columns: usize) -> Shape {
        if columns == 1 {
            Shape::Vector(rows)
        } else {
            Shape::Matrix(rows, columns)
        }
    }

    /// Number of entries.
    pub fn len(self) -> usize {
        let (rows, columns) = self.size();
        rows.saturating_mul(columns)
    }

    /// True for a vector or matrix without entries.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Rows and columns; a scalar is 1 by 1, a vector is a column.
    pub fn size(self) -> (usize, usize) {
        match self {
            Shape::Scalar => (1, 1),
            Shape::Vector(rows) => (rows, 1),
            Shape::Matrix(rows, columns) => (rows, columns),
        }
    }

    /// Sizes as written in a declaration: none for a scalar.
    pub fn sizes(self) -> Vec<usize> {
        match self {
            Shape::Scalar => vec![],
            Shape::Vector(rows) => vec![rows],
            Shape::Matrix(rows, columns) => vec![rows, columns],
        }
    }

    /// Number of indices an entry needs.
    pub fn rank(self) -> usize {
        self.sizes().len()
    }

    /// The name of the entry at a position: `x`, `x[2]`, `A[1,2]`.
    pub fn entry_name(self, name: &str, position: usize) -> String {
        match self {
            Shape::Scalar => name.to_owned(),
            Shape::Vector(_) => format!("{name}[{}]", position + 1),
            Shape::Matrix(_, columns) => {
                format!(
                    "{name}[{},{}]",
                    position / columns + 1,
                    position % columns + 1
                )
            }
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Shape::Scalar => write!(f, "a scalar"),
            Shape::Vector(rows) => write!(f, "a vector of {rows}"),
            Shape::Matrix(1, columns) => write!(f, "a row of {columns}"),
            Shape::Matrix(rows, columns) => write!(f, "a {rows} by {columns} matrix"),
        }
    }
}

/// A value: its entries row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor<'e> {
    /// Its shape.
    pub shape: Shape,
    /// As many entries as the shape says.
    pub data: Vec<Expr<'e>>,
}

impl<'e> Tensor<'e> {
    /// A scalar.
    pub fn scalar(value: Expr<'e>) -> Self {
        Tensor {
            shape: Shape::Scalar,
            data: vec![value],
        }
    }

    /// A column.
    pub fn vector(data: Vec<Expr<'e>>) -> Self {
        Tensor {
            shape: Shape::Vector(data.len()),
            data,
        }
    }

    /// A matrix, a vector when it has one column.
    pub fn matrix(rows: usize, columns: usize, data: Vec<Expr<'e>>) -> Self {
        debug_assert_eq!(
            rows * columns,
            data.len(),
            "a tensor has the entries of its shape"
        );
        Tensor {
            shape: Shape::matrix(rows, columns),
            data,
        }
    }

    /// The entry of a value that has only one.
    pub fn as_scalar(&self) -> Option<Expr<'e>> {
        if let [only] = self.data[..] {
            Some(only)
        } else {
            None
        }
    }

    /// The entries as numbers, when all are constant.
    pub fn constants(&self) -> Option<Vec<f64>> {
        self.data.iter().map(|entry| entry.as_constant()).collect()
    }

    /// The entry in a row and a column, counted from 0.
    pub fn at(&self, row: usize, column: usize) -> Expr<'e> {
        self.data[row * self.shape.size().1 + column]
    }

    /// Entry by entry.
    pub fn map(&self, f: impl FnMut(Expr<'e>) -> Expr<'e>) -> Self {
        Tensor {
            shape: self.shape,
            data: self.data.iter().copied().map(f).collect(),
        }
    }

    /// Entry by entry with another value of the same shape; a scalar on either side is repeated.
    pub fn zip(&self, other: &Self, f: impl Fn(Expr<'e>, Expr<'e>) -> Expr<'e>) -> Option<Self> {
        if self.shape == other.shape {
            let pairs = self.data.iter().zip(&other.data);
            return Some(Tensor {
                shape: self.shape,
                data: pairs.map(|(&a, &b)| f(a, b)).collect(),
            });
        }
        match (self.shape, other.shape) {
            (Shape::Scalar, _) => Some(other.map(|b| f(self.data[0], b))),
            (_, Shape::Scalar) => Some(self.map(|a| f(a, other.data[0]))),
            _ => None,
        }
    }

    /// The value in another shape: itself, a repeated scalar, or the same single entry.
    pub fn conform(&self, shape: Shape) -> Option<Self> {
        if self.shape == shape || (self.data.len() == 1 && shape.len() == 1) {
            return Some(Tensor {
                shape,
                data: self.data.clone(),
            });
        }
        match self.shape {
            Shape::Scalar => Some(Tensor {
                shape,
                data: vec![self.data[0]; shape.len()],
            }),
            _ => None,
        }
    }

    /// Rows and columns exchanged.
    pub fn transpose(&self) -> Self {
        let (rows, columns) = self.shape.size();
        let data = (0..columns)
            .flat_map(|j| (0..rows).map(move |i| self.at(i, j)))
            .collect();
        if self.shape == Shape::Scalar {
            self.clone()
        } else {
            Tensor::matrix(columns, rows, data)
        }
    }
}
