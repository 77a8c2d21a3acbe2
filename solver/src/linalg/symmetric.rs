//! Symmetric indefinite systems behind one trait: sparse in a static order, or dense with pivoting.
//!
//! A matrix is given by the [`Pattern`](crate::optimization::problem::Pattern) of its lower triangle and its entries in that order.

/// Numbers of positive and of negative eigenvalues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inertia {
    /// How many are positive.
    pub positive: usize,
    /// How many are negative.
    pub negative: usize,
}

/// There is no factorization, or none whose signs mean anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorFailure {
    /// What is left of this pivot is rounding.
    ZeroPivot(usize),
    /// An entry or a pivot is no number.
    NotFinite,
}

/// Factors symmetric matrices of one pattern and solves with them.
pub trait KktSolver {
    /// Factors the matrix with these entries.
    fn factor(&mut self, values: &[f64]) -> Result<Inertia, FactorFailure>;
    /// Overwrites `rhs` with the solution for the matrix factored last.
    fn solve(&mut self, rhs: &mut [f64]);
}
