//! Factorizations of the matrix of a step: in a static order, with pivots of a row and a variable, or dense.

use super::matrix::{Entries, Matrix};
use crate::linalg::analyses::Analyses;
use crate::linalg::bunch_kaufman::BunchKaufman;
use crate::linalg::ldl::SparseLdl;
use crate::linalg::matching::{self, Weights, matching};
use crate::linalg::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::ipm::options::Options;

/// The diagonal of a variable counts against it as the partner of a row from 1 on, and no more beyond this.
const STIFFEST: f64 = 1e16;
/// A dense factorization of this size is affordable.
const MAX_DENSE: usize = 300;

pub(crate) struct Factors {
    sparse: SparseLdl,
    dense: Option<BunchKaufman>,
    pub is_dense: bool,
    /// Pivots of a row and a variable, used from where the static order has lost one.
    paired: Option<SparseLdl>,
    pairs_pivots: bool,
    analyses: Analyses,
    pub has_lost_pivots: bool,
}

impl Factors {
    pub fn new(matrix: &Matrix, options: &Options) -> Self {
        let size = matrix.n + matrix.m;
        Factors {
            sparse: options.analyses.ldl(&matrix.pattern, &[]),
            dense: (size <= MAX_DENSE).then(|| BunchKaufman::new(&matrix.pattern)),
            is_dense: false,
            paired: None,
            pairs_pivots: options.pairs_pivots,
            analyses: options.analyses.clone(),
            has_lost_pivots: false,
        }
    }

    /// The number of entries of L below its diagonal, in the static order.
    pub fn n_entries(&self) -> usize {
        self.sparse.n_entries()
    }

    /// LDLᵀ in the static order with 1×1 pivots; from the first zero pivot on, if `pairs_pivots`, with 2×2 pivots of a row
    /// and the variable that a matching by entries of `jacobian` gives it. The pairs are kept until they fail.
    pub fn factor(
        &mut self,
        matrix: &Matrix,
        jacobian: Entries<'_>,
    ) -> Result<Inertia, FactorFailure> {
        self.is_dense = false;
        if let Some(paired) = &mut self.paired {
            let found = paired.factor(&matrix.values);
            if found.is_ok() {
                return found;
            }
        } else {
            let found = self.sparse.factor(&matrix.values);
            self.has_lost_pivots |= found.is_err();
            let is_lost = matches!(found, Err(FactorFailure::ZeroPivot(_)));
            // Small systems are left to `factor_dense`.
            if !is_lost || !self.pairs_pivots || self.dense.is_some() {
                return found;
            }
        }
        // None yet, or entries have become too small for the pairs that there were.
        let pairs = partners(matrix, jacobian);
        let paired = self.analyses.ldl(&matrix.pattern, &pairs);
        let paired = self.paired.insert(paired);
        paired.factor(&matrix.values)
    }

    /// Pivots of one unknown or two where they are needed, where that is affordable.
    pub fn factor_dense(&mut self, matrix: &Matrix) -> Option<Inertia> {
        let inertia = self.dense.as_mut()?.factor(&matrix.values).ok()?;
        self.is_dense = true;
        Some(inertia)
    }

    /// Overwrites the right-hand side with the solution for the matrix factored last.
    pub fn solve(&mut self, rhs: &mut [f64]) {
        match (&mut self.dense, &mut self.paired) {
            (Some(dense), _) if self.is_dense => dense.solve(rhs),
            (_, Some(paired)) => paired.solve(rhs),
            _ => self.sparse.solve(rhs),
        }
    }
}

/// Rows with a variable each, whose entry is large and whose diagonal is not.
fn partners(matrix: &Matrix, jacobian: Entries<'_>) -> Vec<[u32; 2]> {
    let stiffness = |column: u32| matrix.at_diagonal(column).abs().clamp(1.0, STIFFEST);
    let columns = &jacobian.sparse.columns;
    let entries = columns.iter().zip(jacobian.values);
    let weights: Vec<f64> = entries
        .map(|(&column, a)| a.abs() / stiffness(column).sqrt())
        .collect();
    let found = matching(&Weights {
        starts: &jacobian.sparse.starts,
        columns,
        weights: &weights,
        n_columns: matrix.n,
    });
    let rows = found.into_iter().zip(matrix.n as u32..);
    rows.filter(|pair| pair.0 != matching::NONE)
        .map(|(column, row)| [column, row])
        .collect()
}
