//! A complementarity system in other units of z.
//!
//! Gaps, forces and λ count as zero below a share of one. With z = u ẑ, where u is about as large as z is in a run, that
//! is a share of what they are; u are powers of two, so that nothing is rounded.
//!
//! u follows from the sizes of states. Every row of g, and every rate with z in it, balances its terms: where the others
//! amount to R, z is about R/|∂g/∂z|. Where rows differ the least of these counts, next to which z may be rounding.

use serde::{Deserialize, Serialize};

use super::full::Kinds;
use super::pointwise::{Point, Rule, eval};
use crate::fesd::system::{ComplementaritySystem, Full, Member, NEGLIGIBLE};
use crate::tape::{Sum, Sums};

/// Units that differ by no more than this serve as well.
const SUITS: f64 = 1024.0;

/// The least of the sizes that rows give, next to the largest of them.
const SHARE: f64 = 1e-5;

/// A state that its rate would take no longer to come to, as a part of the horizon, is rounding.
const MOVES: f64 = 1e-14;

/// Units of z and of the rows of g, and sizes of states that equations determine; none where all are one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Units {
    pub(crate) z: Vec<f64>,
    pub(crate) rows: Vec<f64>,
    pub(crate) states: Vec<f64>,
}

impl Units {
    /// Those that a system is stated in.
    pub fn stated(system: &ComplementaritySystem) -> Self {
        let n_rows = system.full.directional.n_outputs();
        Units {
            z: vec![1.0; system.n_algebraics()],
            rows: vec![1.0; n_rows],
            states: vec![1.0; system.n_states()],
        }
    }

    /// The unit of a z.
    pub(crate) fn of_z(&self, z: usize) -> f64 {
        self.z.get(z).copied().unwrap_or(1.0)
    }

    /// The unit of a state.
    pub(crate) fn of_state(&self, state: usize) -> f64 {
        self.states.get(state).copied().unwrap_or(1.0)
    }

    /// Those for states of these sizes at some points (t, x) of a run of this length.
    pub fn at<'x>(
        system: &ComplementaritySystem,
        sizes: &[f64],
        horizon: f64,
        points: impl Iterator<Item = (f64, &'x [f64])>,
    ) -> Self {
        let mut terms = Terms::new(system, sizes, horizon);
        let mut numbers = vec![0.0; system.n_numbers()];
        for (t, x) in points {
            system.numbers(t, &mut numbers);
            let numbers = &numbers;
            terms.see(Point { t, x, numbers });
        }
        terms.units()
    }

    /// Whether these serve where others would be chosen.
    pub fn suit(&self, others: &Units) -> bool {
        let mut both = self.z.iter().zip(&others.z);
        both.all(|(a, b)| a / b <= SUITS && b / a <= SUITS)
    }

    /// The largest size of a state that equations determine, in its unit.
    pub(crate) fn largest(&self, algebraic: &[usize], sizes: &[f64]) -> f64 {
        let in_units = algebraic.iter().map(|&i| sizes[i].abs() / self.of_state(i));
        in_units.fold(0.0, f64::max)
    }

    /// A system that is stated in these units.
    pub(crate) fn scale(&self, system: &ComplementaritySystem) -> ComplementaritySystem {
        let n = system.n_states();
        let all: Vec<usize> = (0..system.behind()).collect();
        let mut sums = Sums::new(all.len(), |_| false);
        let mut inputs: Vec<Sum> = all.iter().map(|&input| sums.input(input)).collect();
        for (input, unit) in inputs[1 + n..].iter_mut().zip(&self.z) {
            *input = input.times(*unit);
        }
        let mut values = sums.take(&system.full.equations, &inputs);
        for (value, unit) in values[n..].iter_mut().zip(&self.rows) {
            *value = value.times(unit.recip());
        }
        let equations = sums.tape(&values, &all);
        let alphas = sums.take(&system.full.alphas, &inputs);
        let alphas = sums.tape(&alphas, &all);
        let kinds = Kinds {
            continuous: &system.continuous,
            determines_state: &system.full.determines_state,
            discs: &system.discs,
        };
        let mut scaled = ComplementaritySystem {
            full: Full::new(equations, alphas, kinds),
            ..system.clone()
        };
        scaled.surfaces.units = self.clone();
        scaled
    }
}

/// The terms of rates and equations of a system as it is stated.
struct Terms<'s> {
    system: &'s ComplementaritySystem,
    horizon: f64,
    /// Sizes by input, those of time and of z that is sought zero.
    sizes: Vec<f64>,
    /// What rates and equations have besides their linearization, and the entries of ∂(f, g), at most.
    left: Vec<f64>,
    slopes: Vec<f64>,
}

impl<'s> Terms<'s> {
    fn new(system: &'s ComplementaritySystem, states: &[f64], horizon: f64) -> Self {
        let z = (0..system.n_algebraics()).map(|z| f64::from(!has_unit(system, z)));
        let sizes = [0.0].into_iter().chain(states.iter().copied()).chain(z);
        Terms {
            sizes: sizes.collect(),
            left: vec![0.0; system.full.equations.n_outputs()],
            slopes: vec![0.0; system.full.slopes.entries.len()],
            system,
            horizon,
        }
    }

    /// Takes note of the terms at a point.
    fn see(&mut self, point: Point) {
        let full = &self.system.full;
        let z = self.sizes[1 + point.x.len()..].iter();
        let z: Vec<f64> = z.map(|size| 0.5 * size).collect();
        let inputs = point.with(&z);
        let mut left = eval(&full.equations, &inputs);
        let slopes = eval(&full.slopes.tape, &inputs);
        for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
            if input > 0 {
                left[row] -= slope * inputs[input];
            }
        }
        for (most, left) in self.left.iter_mut().zip(left) {
            *most = most.max(left.abs());
        }
        for (most, slope) in self.slopes.iter_mut().zip(slopes) {
            *most = most.max(slope.abs());
        }
    }

    /// What the terms of each rate and equation amount to.
    fn rows(&self) -> Vec<f64> {
        let mut rows = self.left.clone();
        for (row, input, slope) in self.entries() {
            rows[row] += slope * self.sizes[input];
        }
        rows
    }

    /// Entries of ∂(f, g) by row and input.
    fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let entries = self.system.full.slopes.entries.iter().zip(&self.slopes);
        entries.map(|(&(row, input), slope)| (row, input, *slope))
    }

    /// Raises the sizes of states that do not move to what their rates would make of them in the time in which others do,
    /// and those that equations determine to what they may be next to the other terms of these.
    fn raise_states(&mut self) {
        let (n, system) = (self.system.n_states(), self.system);
        let rates = self.rows();
        let is_algebraic = |i: &usize| system.algebraic_states.contains(i);
        let moving = (0..n).filter(|i| !is_algebraic(i));
        let times = moving.clone().map(|i| self.sizes[1 + i] / rates[i]);
        let times = times.filter(|time| *time > MOVES * self.horizon);
        let time = times.fold(self.horizon, f64::min);
        for i in moving {
            let size = time * rates[i];
            if size.is_finite() {
                self.sizes[1 + i] = self.sizes[1 + i].max(size);
            }
        }
        let rows = self.rows();
        let mut balanced = vec![f64::INFINITY; n];
        for (row, input, slope) in self.entries() {
            let others = rows[row] - slope * self.sizes[input];
            let is_sought = (1..=n).contains(&input) && is_algebraic(&(input - 1));
            if is_sought && slope > 0.0 && others > f64::EPSILON * rows[row] {
                balanced[input - 1] = balanced[input - 1].min(others / slope);
            }
        }
        for &y in &system.algebraic_states {
            if balanced[y].is_finite() {
                self.sizes[1 + y] = self.sizes[1 + y].max(NEGLIGIBLE * balanced[y]);
            }
        }
    }

    /// The sizes of z; zero where no row gives any.
    fn of_z(&mut self) -> Vec<f64> {
        self.raise_states();
        let (system, n) = (self.system, self.system.n_states());
        let mut rows = self.rows();
        for (row, size) in rows[..n].iter_mut().zip(&self.sizes[1..]) {
            *row = row.max(size / self.horizon);
        }
        let mut found = vec![[f64::INFINITY, 0.0]; system.n_algebraics()];
        for (row, input, slope) in self.entries() {
            let size = rows[row] / slope;
            if input > n && size > 0.0 && size.is_finite() {
                let [least, most] = &mut found[input - 1 - n];
                (*least, *most) = (least.min(size), most.max(size));
            }
        }
        let size = |[least, most]: [f64; 2]| {
            if most > 0.0 {
                least.max(SHARE * most)
            } else {
                0.0
            }
        };
        found.into_iter().map(size).collect()
    }

    fn units(mut self) -> Units {
        let (system, n) = (self.system, self.system.n_states());
        let mut units = Units::stated(system);
        for (z, size) in self.of_z().into_iter().enumerate() {
            if has_unit(system, z) {
                units.z[z] = power_of_two(size);
            }
        }
        for &y in &system.algebraic_states {
            units.states[y] = power_of_two(self.sizes[1 + y]);
        }
        let mut largest = vec![0.0_f64; units.rows.len()];
        for (row, input, slope) in self.entries() {
            if row >= n && input > n {
                largest[row - n] = largest[row - n].max(slope * units.z[input - 1 - n]);
            }
        }
        for (row, unit) in units.rows.iter_mut().enumerate() {
            if has_row_unit(system, row) {
                *unit = power_of_two(largest[row]);
            }
        }
        units
    }
}

/// That next to a size; one where it is none.
fn power_of_two(size: f64) -> f64 {
    let power = size.log2().round().exp2();
    if power.is_normal() { power } else { 1.0 }
}

/// Whether a z may be in another unit: not what is between 0 and 1, nor what belongs to a disc.
fn has_unit(system: &ComplementaritySystem, z: usize) -> bool {
    let is_share = |member: Member| member.complement && member.variable == z;
    let of_shares = system.pairs.iter().flat_map(|pair| [pair.left, pair.right]);
    !of_shares.into_iter().any(is_share)
        && match system.surfaces.rules.z[z] {
            Rule::Zero | Rule::Above(_) | Rule::Below(_) | Rule::Force(_) => true,
            Rule::Excess(..) | Rule::Least(_) => true,
            Rule::Alpha(_) | Rule::Share(_) | Rule::Product(_) => false,
            Rule::Speed(_) | Rule::Inside(_) => false,
        }
}

/// The same of a row of g.
fn has_row_unit(system: &ComplementaritySystem, row: usize) -> bool {
    let is_product = |rule: &Rule| *rule == Rule::Product(row);
    let mut discs = system.discs.iter();
    !system.surfaces.rules.z.iter().any(is_product)
        && !discs.any(|disc| disc.all_rows().contains(&row))
}
