//! Nonlinear programs with complementarity constraints, as the solvers see them.
//!
//! minimize f(w)   subject to   cl <= c(w) <= cu,   l <= w <= u,   0 <= a ⟂ b >= 0
//!
//! where a and b are distances of variables or rows from their lower bounds. The Lagrangian is f + yᵀc - zₗᵀ(w - l) +
//! zᵤᵀ(w - u) with zₗ, zᵤ >= 0, so y >= 0 where a row is at its upper bound and y <= 0 where it is at its lower one.

use serde::{Deserialize, Serialize};

/// Entries of a sparse matrix that are not structurally zero, row by row.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pattern {
    /// Where the entries of a row start; one more than there are rows.
    pub starts: Vec<usize>,
    /// The columns of the entries, ascending within a row.
    pub columns: Vec<u32>,
}

/// Finite or infinite bounds, one pair per variable or row.
#[derive(Clone, Copy, Debug)]
pub struct Bounds<'a> {
    /// Lower bounds, or minus infinity.
    pub lower: &'a [f64],
    /// Upper bounds, or infinity; not below the lower ones.
    pub upper: &'a [f64],
}

/// [`Bounds`] that are held.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds.
    pub upper: Vec<f64>,
}

impl Intervals {
    /// The bounds.
    pub fn view(&self) -> Bounds<'_> {
        Bounds {
            lower: &self.lower,
            upper: &self.upper,
        }
    }

    /// Bounds, and more with one interval each.
    pub fn extended(bounds: Bounds<'_>, n: usize, [lower, upper]: [f64; 2]) -> Self {
        Intervals {
            lower: [bounds.lower, &vec![lower; n]].concat(),
            upper: [bounds.upper, &vec![upper; n]].concat(),
        }
    }
}

/// The bounds, the start and the patterns of a program.
#[derive(Clone, Copy, Debug)]
pub struct Structure<'a> {
    /// l and u.
    pub variables: Bounds<'a>,
    /// cl and cu; equal for equations.
    pub rows: Bounds<'a>,
    /// Where to start; not necessarily within the bounds.
    pub start: &'a [f64],
    /// The pattern of the Jacobian of c, m by n.
    pub jacobian: &'a Pattern,
    /// The pattern of the lower triangle of the Hessian of the Lagrangian, n by n: columns do not exceed their row.
    pub hessian: &'a Pattern,
}

/// A [`Structure`] that is held.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct HeldStructure {
    pub variables: Intervals,
    pub rows: Intervals,
    pub start: Vec<f64>,
    pub jacobian: Pattern,
    pub hessian: Pattern,
}

impl HeldStructure {
    pub fn view(&self) -> Structure<'_> {
        Structure {
            variables: self.variables.view(),
            rows: self.rows.view(),
            start: &self.start,
            jacobian: &self.jacobian,
            hessian: &self.hessian,
        }
    }
}

/// minimize f(w) subject to cl <= c(w) <= cu, l <= w <= u; f and c are twice differentiable.
///
/// Values that are not finite are allowed: a solver takes a shorter step there. Slices have the lengths that their
/// names say, and the functions allocate nothing.
pub trait Nlp {
    /// What is known before any function is evaluated.
    fn structure(&self) -> Structure<'_>;
    /// The number n of variables.
    fn n_variables(&self) -> usize {
        self.structure().variables.lower.len()
    }
    /// The number m of rows c.
    fn n_rows(&self) -> usize {
        self.structure().rows.lower.len()
    }
    /// l and u.
    fn variable_bounds(&self) -> Bounds<'_> {
        self.structure().variables
    }
    /// cl and cu; equal for equations.
    fn row_bounds(&self) -> Bounds<'_> {
        self.structure().rows
    }
    /// Where to start.
    fn start(&self) -> &[f64] {
        self.structure().start
    }
    /// The pattern of the Jacobian.
    fn jacobian_pattern(&self) -> &Pattern {
        self.structure().jacobian
    }
    /// The pattern of the Hessian.
    fn hessian_pattern(&self) -> &Pattern {
        self.structure().hessian
    }
    /// Whether f depends on anything; where it does not, all feasible points are minima.
    fn has_objective(&self) -> bool {
        true
    }
    /// f at w.
    fn objective(&mut self, w: &[f64]) -> f64;
    /// ∇f at w, dense.
    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]);
    /// c at w.
    fn rows(&mut self, w: &[f64], rows: &mut [f64]);
    /// The entries of the Jacobian of c at w, in the order of its pattern.
    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]);
    /// The entries of the Hessian of `factor` f + yᵀc at w, in the order of its pattern.
    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]);
    /// Adds to the entries of the Hessian at w what is known to be missing for a convex Lagrangian: a solver asks for
    /// it where that is not convex enough to go down. Says whether there is anything.
    fn convexify(&mut self, _w: &[f64], _y: &[f64], _entries: &mut [f64]) -> bool {
        false
    }
    /// Called when an interior-point method changes its barrier parameter: a relaxation follows it. Says whether
    /// rows or bounds have changed.
    fn follow(&mut self, _mu: f64) -> bool {
        false
    }
}

/// A nonlinear program with complementarity constraints.
pub trait Mpcc: Nlp {
    /// The pairs 0 <= a ⟂ b >= 0.
    fn pairs(&self) -> &[Pair];
    /// Called with the member of every pair that an active-set method holds at zero, in the order of the pairs, and
    /// with `None` when it takes all pairs as they are again.
    ///
    /// Here rows that hold for some choices only get or lose their bounds, as steps of equal length do where nothing
    /// switches, and terms that only steer a relaxation leave the objective; otherwise such rows have no finite bound.
    /// Says whether bounds or the objective have changed; patterns never do.
    fn settle(&mut self, _zeros: Option<&[Member]>) -> bool {
        false
    }
    /// The variables that are at their lower bounds wherever this member of a pair is zero: the terms of a sum of
    /// variables that are not negative. A branch holds them there, as its bounds would have no interior otherwise.
    fn terms(&self, _pair: usize, _member: Member) -> &[u32] {
        &[]
    }
    /// Points of other branches that mean the same as this one, which solves its branch with multipliers y of the rows.
    ///
    /// A program may describe one and the same solution by points that are far from each other, with other members
    /// zero. A minimum is one only where none of them has a direction of descent.
    fn others(&mut self, _w: &[f64], _zeros: &[Member], _y: &[f64]) -> Vec<Other> {
        Vec::new()
    }
}

/// A point near another branch, by what differs: where a program is long and the change short, this stays small.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Other {
    /// Variables with their values, ascending.
    pub w: Vec<(u32, f64)>,
    /// Pairs with the member that the branch holds at zero, ascending.
    pub zeros: Vec<(u32, Member)>,
}

/// A member of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Member {
    /// The first one.
    A,
    /// The second one.
    B,
}

/// 0 <= a ⟂ b >= 0: both are not negative and one is zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pair {
    /// One side.
    pub a: Side,
    /// The other.
    pub b: Side,
}

/// The distance of a variable or a row from its lower bound, which is finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// w - l.
    Variable(u32),
    /// c(w) - cl; the row has no upper bound.
    Row(u32),
}

impl Pattern {
    /// The pattern of these entries (row, column), which may come in any order and repeatedly: compressed sparse rows,
    /// by a counting sort over the rows.
    pub fn new(n_rows: usize, entries: Vec<(u32, u32)>) -> Self {
        // The next free place of every row, at first its start: sums of the numbers of entries of the rows before it.
        // Sorting all entries at once would take several times as long.
        let mut next = vec![0; n_rows + 1];
        for &(row, _) in &entries {
            next[row as usize + 1] += 1;
        }
        for row in 0..n_rows {
            next[row + 1] += next[row];
        }
        let mut all = vec![0; entries.len()];
        for (row, column) in entries {
            let place = &mut next[row as usize];
            all[*place] = column;
            *place += 1;
        }
        // The next place of a full row is its end. Columns of a row are sorted, and repeated ones dropped, in place.
        let mut starts = Vec::with_capacity(n_rows + 1);
        let (mut kept, mut start) = (0, 0);
        starts.push(0);
        for &end in &next[..n_rows] {
            all[start..end].sort_unstable();
            for entry in start..end {
                if entry == start || all[entry] != all[entry - 1] {
                    all[kept] = all[entry];
                    kept += 1;
                }
            }
            starts.push(kept);
            start = end;
        }
        all.truncate(kept);
        Pattern {
            starts,
            columns: all,
        }
    }

    /// The number of rows.
    pub fn n_rows(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The number of entries.
    pub fn n_entries(&self) -> usize {
        self.columns.len()
    }

    /// The columns of a row.
    pub fn row(&self, row: usize) -> &[u32] {
        &self.columns[self.starts[row]..self.starts[row + 1]]
    }

    /// Whether this is one of so many rows and columns.
    pub(crate) fn is_of(&self, n_rows: usize, n_columns: usize) -> bool {
        let are_starts = self.starts.len() == n_rows + 1
            && self.starts[0] == 0
            && self.starts.is_sorted()
            && self.starts[n_rows] == self.columns.len();
        let ascends = |row: &[u32]| {
            row.is_sorted_by(|a, b| a < b) && row.last().is_none_or(|&c| (c as usize) < n_columns)
        };
        are_starts && (0..n_rows).all(|row| ascends(self.row(row)))
    }

    /// The number of an entry, if it is there.
    pub fn place(&self, row: usize, column: u32) -> Option<usize> {
        let place = self.row(row).binary_search(&column).ok()?;
        Some(self.starts[row] + place)
    }
}
