//! How large the quantities of a program are.
//!
//! A quantity is what several variables are values of: a state at all nodes. Its size d is known from bounds, values that
//! are given, and guesses; and the entries of a row are of one size, as a sum of them is zero: |a_ij| d_j ≈ r_i, and of N
//! rows with differences of a quantity, as a state has from node to node, |a_ij| d_j ≈ N r_i. Logarithms of all sizes are
//! the least-squares solution of these equations (Curtis and Reid 1972). They follow a change of units.

use std::collections::BTreeMap;

use super::{nearest, offsets};
use crate::optimization::problem::{Bounds, Member, Mpcc};
use crate::runtime::random;

/// Sizes are powers of 2^`PREFIX`, as prefixes of units are powers of 1000.
const PREFIX: f64 = 10.0;
/// Logarithms of sizes that are 1 as well: what is not far from 1 stays in the units that a user has chosen. Sizes of which
/// nothing but rows tells are estimated too large more often than too small, and an interior-point method divides a large
/// objective by its gradient.
const ONE: [f64; 2] = [-11.0, 9.0];
const ONE_UNKNOWN: [f64; 2] = [-11.0, 12.0];
const ONE_OBJECTIVE: [f64; 2] = [-5.0, 25.0];
/// An objective below 1 that is smaller than it was taken for, and its quantities are, by more prefixes is zero.
const MOST_PREFIXES: f64 = 4.0;
/// How many points of the sizes found so far show the derivatives that vanish at the start.
const POINTS: usize = 5;
/// Sweeps over all equations, at most, and the change of a logarithm that ends them.
const SWEEPS: usize = 300;
const SETTLED: f64 = 1e-9;
/// What is known of a size counts as so many rows.
const KNOWN: f64 = 2.0;
/// What ties a size to 1 that nothing else tells: next to nothing.
const UNKNOWN: f64 = 1e-6;
/// Logarithms to base 2 beyond this are none.
const LARGEST: f64 = 200.0;
/// Sums below this share of their terms are zero.
const CANCELS: f64 = 1e-9;
/// Numbers that are given with logarithms below this are roundings of zero.
const ROUNDING: f64 = -45.0;

/// D, R and s: the sizes of the variables, of the rows and of the objective, powers of two.
#[derive(Clone, Debug, PartialEq)]
pub struct Sizes {
    /// The quantity that every variable is a value of, which has one size.
    pub quantities: Vec<usize>,
    /// Of the variables.
    pub variables: Vec<f64>,
    /// Of the rows.
    pub rows: Vec<f64>,
    /// Of the objective.
    pub objective: f64,
}

/// |a| d ≈ r, in logarithms.
struct Entry {
    row: usize,
    quantity: usize,
    log: f64,
}

/// The largest of several |a|, the sum of their logarithms, and how many there are.
#[derive(Clone, Copy, Default)]
struct Slopes {
    largest: f64,
    logs: f64,
    count: f64,
    /// How many differences add up to the change of a quantity of which rows have differences.
    parts: f64,
}

/// Rows that have differences of a quantity: those that begin one after the other add up to all of its change.
struct Differences {
    /// The sum of the entries of a row, that of their magnitudes and the first column, by quantity.
    sums: Vec<(f64, f64, usize)>,
    /// The first column of the last difference, and how many of them there are, by class and quantity.
    chains: BTreeMap<(usize, usize), (usize, f64)>,
}

impl Differences {
    fn new(n: usize) -> Self {
        Differences {
            sums: vec![(0.0, 0.0, 0); n],
            chains: BTreeMap::new(),
        }
    }

    /// Takes the entries of the next row.
    fn row<'a>(
        &mut self,
        class: usize,
        quantities: &[usize],
        entries: impl Iterator<Item = (usize, &'a f64)> + Clone,
    ) {
        for (column, entry) in entries.clone() {
            let (net, all, first) = &mut self.sums[quantities[column]];
            if *all == 0.0 {
                *first = column;
            }
            (*net, *all) = (*net + entry, *all + entry.abs());
        }
        for (column, _) in entries {
            let quantity = quantities[column];
            let (net, all, first) = std::mem::take(&mut self.sums[quantity]);
            if all > 0.0 && net.abs() <= CANCELS * all {
                let (last, parts) = self.chains.entry((class, quantity)).or_default();
                if *parts == 0.0 || *last != first {
                    (*last, *parts) = (first, *parts + 1.0);
                }
            }
        }
    }
}

/// The logarithms of sizes of quantities and of rows that have the same quantities.
struct Balance<'n> {
    nlp: &'n mut dyn Mpcc,
    /// The quantity of every variable.
    quantities: &'n [usize],
    /// The class of every row, and of the objective.
    classes: Vec<usize>,
    offsets: Vec<f64>,
    /// |a| of a quantity in rows of a class.
    entries: BTreeMap<(usize, usize), Slopes>,
    /// The largest constant in rows of a class.
    constants: BTreeMap<usize, f64>,
    known: Vec<Known>,
    /// log₂ d.
    sizes: Vec<f64>,
    /// -log₂ r.
    rows: Vec<f64>,
}

impl Sizes {
    /// Those of a program whose variables are values of such quantities, numbered from 0, near a point.
    ///
    /// They are those of the objective itself, without terms that only steer.
    pub fn new(problem: &mut dyn Mpcc, quantities: &[usize], start: &[f64]) -> Self {
        let members = vec![Member::A; problem.pairs().len()];
        problem.settle(Some(&members));
        let sizes = Self::balanced(problem, quantities, start);
        problem.settle(None);
        sizes
    }

    /// Whether a problem has as many variables and rows.
    pub fn fit(&self, problem: &dyn Mpcc) -> bool {
        self.variables.len() == problem.n_variables() && self.rows.len() == problem.n_rows()
    }

    /// Those that a point has reached, where it was to be far larger than it is: at least 1. Of the objective, what its slopes
    /// and its curvature make of the values of the variables: at its own minimum slopes are rounding.
    pub fn at(&self, problem: &mut dyn Mpcc, w: &[f64]) -> Option<Sizes> {
        let variables = self.variables_at(problem, w);
        let rows = self.rows_at(problem, w, &variables);
        let objective = self.objective_at(problem, w, &variables);
        let reached = Sizes {
            quantities: self.quantities.clone(),
            variables,
            rows,
            objective,
        };
        (reached != *self).then_some(reached)
    }

    /// A large size at a value that is smaller.
    fn reached(size: f64, value: f64) -> f64 {
        let smaller = log(value).map_or(1.0, |log| power(log, ONE));
        match size > 1.0 {
            true => smaller.clamp(1.0, size),
            false => size,
        }
    }

    fn variables_at(&self, problem: &dyn Mpcc, w: &[f64]) -> Vec<f64> {
        let offsets = offsets(problem.variable_bounds());
        let mut largest = vec![0.0_f64; self.quantities.iter().max().map_or(0, |last| last + 1)];
        for ((&quantity, w), offset) in self.quantities.iter().zip(w).zip(&offsets) {
            largest[quantity] = largest[quantity].max((w - offset).abs());
        }
        let places = self.quantities.iter().zip(&self.variables);
        places
            .map(|(&quantity, &size)| Self::reached(size, largest[quantity]))
            .collect()
    }

    fn rows_at(&self, problem: &mut dyn Mpcc, w: &[f64], variables: &[f64]) -> Vec<f64> {
        let mut entries = vec![0.0; problem.jacobian_pattern().n_entries()];
        problem.jacobian(w, &mut entries);
        let pattern = problem.jacobian_pattern();
        let of_row = |(row, &size): (usize, &f64)| {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            let terms = pattern.row(row).iter().zip(&entries[places]);
            let terms = terms.map(|(&column, a)| a.abs() * variables[column as usize]);
            // Of several rows with the same quantities one may be far smaller than the others.
            let own = log(terms.fold(0.0, f64::max)).map(|log| power(log, ONE));
            own.filter(|own| size > 1.0 && *own < size).unwrap_or(size)
        };
        self.rows.iter().enumerate().map(of_row).collect()
    }

    fn objective_at(&self, problem: &mut dyn Mpcc, w: &[f64], variables: &[f64]) -> f64 {
        let terms = terms_of_objective(problem, w).into_iter();
        let (sum, largest) = terms.fold((0.0, 0.0_f64), |(sum, m), term| (sum + term, m.max(term)));
        let Some(log) = log(largest) else {
            return self.objective;
        };
        let fall = self.objective.log2() - log;
        let smaller = self.variables.iter().zip(variables);
        let smaller = smaller.map(|(size, reached)| (size / reached).log2());
        // Products of two quantities fall with both.
        let most = MOST_PREFIXES * PREFIX + 2.0 * smaller.fold(0.0, f64::max);
        let is_zero = fall >= most && sum < 1.0;
        let is_smaller = self.objective != 1.0 && fall >= 0.5 * PREFIX && !is_zero;
        match is_smaller {
            true => power(log, ONE_OBJECTIVE),
            false => self.objective,
        }
    }

    fn balanced(problem: &mut dyn Mpcc, quantities: &[usize], start: &[f64]) -> Self {
        let mut balance = Balance::new(problem, quantities, start);
        balance.look(start);
        balance.settle();
        let objective = balance.objective();
        let ones = balance.ones(objective, &balance.constants);
        if let Some(ones) = ones.filter(|_| objective.is_some()) {
            return balance.with_small_rows(ones, start);
        }
        let at_start = (balance.entries.clone(), balance.constants.clone());
        for number in 0..POINTS as u64 {
            let point = balance.point(number);
            // Points of other sizes than those found so far say nothing.
            (balance.entries, balance.constants) = at_start.clone();
            balance.look(&point);
            balance.settle();
        }
        let objective = objective.or_else(|| balance.objective());
        let ones = balance.ones(objective, &at_start.1);
        let sizes = ones.unwrap_or_else(|| balance.sizes(objective));
        balance.with_small_rows(sizes, start)
    }
}

/// |∂f/∂w_i w_i| and |∂²f/∂w_i∂w_j w_i w_j|, without terms that only steer.
fn terms_of_objective(problem: &mut dyn Mpcc, w: &[f64]) -> Vec<f64> {
    let members = vec![Member::A; problem.pairs().len()];
    problem.settle(Some(&members));
    let mut gradient = vec![0.0; w.len()];
    problem.gradient(w, &mut gradient);
    let mut curvature = vec![0.0; problem.hessian_pattern().n_entries()];
    problem.hessian(w, 1.0, &vec![0.0; problem.n_rows()], &mut curvature);
    problem.settle(None);
    let slopes = gradient.iter().zip(w).map(|(slope, w)| (slope * w).abs());
    let pattern = problem.hessian_pattern();
    let curved = (0..w.len()).flat_map(|i| {
        let entries = &curvature[pattern.starts[i]..pattern.starts[i + 1]];
        let columns = pattern.row(i).iter().zip(entries);
        columns.map(move |(&j, entry)| (entry * w[i] * w[j as usize]).abs())
    });
    slopes.chain(curved).collect()
}

/// The logarithm of a size, if it is one.
fn log(size: f64) -> Option<f64> {
    let log = size.abs().log2();
    (log.abs() <= LARGEST).then_some(log)
}

/// That of a number that is given, if it is more than what is left of others by rounding.
fn log_of_given(size: f64) -> Option<f64> {
    log(size).filter(|&log| log >= ROUNDING)
}

/// The size nearest to one of such a logarithm, 1 between two of them.
fn power(log: f64, [small, large]: [f64; 2]) -> f64 {
    match small <= log && log <= large {
        true => 1.0,
        false => (PREFIX * (log / PREFIX).round()).exp2(),
    }
}

impl<'n> Balance<'n> {
    fn new(nlp: &'n mut dyn Mpcc, quantities: &'n [usize], start: &[f64]) -> Self {
        let pattern = nlp.jacobian_pattern();
        let mut numbers: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        let mut classes = Vec::new();
        for row in 0..pattern.n_rows() {
            let columns = pattern.row(row).iter();
            let mut key: Vec<usize> = columns.map(|&j| quantities[j as usize]).collect();
            key.sort_unstable();
            key.dedup();
            let next = numbers.len();
            classes.push(*numbers.entry(key).or_insert(next));
        }
        classes.push(numbers.len());
        let n = quantities.iter().max().map_or(0, |last| last + 1);
        let bounds = nlp.variable_bounds();
        let (offsets, known) = known(bounds, quantities, start, n);
        let n_classes = numbers.len() + 1;
        Balance {
            nlp,
            quantities,
            classes,
            offsets,
            entries: BTreeMap::new(),
            constants: BTreeMap::new(),
            known,
            sizes: vec![0.0; n],
            rows: vec![0.0; n_classes],
        }
    }

    /// Takes what derivatives at a point tell.
    fn look(&mut self, w: &[f64]) {
        let mut entries = vec![0.0; self.nlp.jacobian_pattern().n_entries()];
        self.nlp.jacobian(w, &mut entries);
        let mut gradient = vec![0.0; w.len()];
        self.nlp.gradient(w, &mut gradient);
        let mut values = vec![0.0; self.nlp.n_rows()];
        self.nlp.rows(w, &mut values);
        let pattern = self.nlp.jacobian_pattern();
        let bounds = self.nlp.row_bounds();
        let mut keep = |class: usize, column: usize, value: f64| {
            if value != 0.0 && value.is_finite() {
                let place = (class, self.quantities[column]);
                let slopes = self.entries.entry(place).or_default();
                slopes.largest = slopes.largest.max(value.abs());
                slopes.logs += value.abs().log2();
                slopes.count += 1.0;
            }
        };
        for (column, &slope) in gradient.iter().enumerate() {
            keep(*self.classes.last().expect("the objective"), column, slope);
        }
        let mut differences = Differences::new(self.sizes.len());
        for (row, value) in values.into_iter().enumerate() {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            let mut constant = value - nearest(bounds.lower[row], bounds.upper[row]);
            let mut sum = constant.abs();
            let columns = pattern.row(row).iter().map(|&column| column as usize);
            let columns = columns.zip(&entries[places]);
            differences.row(self.classes[row], self.quantities, columns.clone());
            for (column, &entry) in columns {
                keep(self.classes[row], column, entry);
                let term = entry * (w[column] - self.offsets[column]);
                constant -= term;
                sum = sum.max(term.abs());
            }
            // What rounding leaves is none.
            if constant.abs() > CANCELS * sum && constant.is_finite() {
                let largest = self.constants.entry(self.classes[row]).or_default();
                *largest = largest.max(constant.abs());
            }
        }
        for (place, (_, parts)) in differences.chains {
            let slopes = self.entries.entry(place).or_default();
            slopes.parts = slopes.parts.max(parts);
        }
    }

    /// Solves for all sizes, by Gauss and Seidel.
    fn settle(&mut self) {
        // The objective is no sum that is zero.
        let of_rows = self.rows.len() - 1;
        let entries = self.entries.iter().filter_map(|(&(row, quantity), a)| {
            let mean = (a.logs / a.count).exp2() / a.parts.max(1.0);
            let log = log(mean).filter(|_| row < of_rows)?;
            Some(Entry { row, quantity, log })
        });
        let entries: Vec<Entry> = entries.collect();
        for _ in 0..SWEEPS {
            let mut rows = vec![(0.0, 0.0_f64); self.rows.len()];
            for (&row, &constant) in &self.constants {
                if let Some(log) = log(constant) {
                    rows[row] = (-log, 1.0);
                }
            }
            for entry in &entries {
                let (sum, weight) = &mut rows[entry.row];
                *sum -= entry.log + self.sizes[entry.quantity];
                *weight += 1.0;
            }
            for (row, (sum, weight)) in self.rows.iter_mut().zip(rows) {
                *row = sum / weight.max(1.0);
            }
            let of_known = self.known.iter().zip(&self.sizes).map(|(known, &size)| {
                let (sum, count) = known
                    .of(size)
                    .fold((0.0, 0.0), |(sum, count), log| (sum + log, count + 1.0));
                (KNOWN * sum, KNOWN * count + UNKNOWN)
            });
            let mut sizes: Vec<(f64, f64)> = of_known.collect();
            for entry in &entries {
                let (sum, weight) = &mut sizes[entry.quantity];
                *sum -= entry.log + self.rows[entry.row];
                *weight += 1.0;
            }
            let mut change = 0.0_f64;
            for (size, (sum, weight)) in self.sizes.iter_mut().zip(sizes) {
                change = change.max((sum / weight - *size).abs());
                *size = sum / weight;
            }
            if change < SETTLED {
                break;
            }
        }
    }

    /// A point of the sizes found so far, between the bounds.
    fn point(&self, number: u64) -> Vec<f64> {
        let mut state = random::mix(number);
        let bounds = self.nlp.variable_bounds();
        let values = self.quantities.iter().enumerate().map(|(i, &quantity)| {
            // From 1/2 to 1, of either sign.
            let number = random::next(&mut state);
            let share = 0.5 + 0.5 * (number >> 11) as f64 / (1_u64 << 53) as f64;
            let signed = if number & 1 == 0 { share } else { -share };
            let size = self.sizes[quantity].clamp(-LARGEST, LARGEST).exp2();
            let value = self.offsets[i] + signed * size;
            value.max(bounds.lower[i]).min(bounds.upper[i])
        });
        values.collect()
    }

    /// The logarithm of the largest a d of the objective, if there is one.
    fn objective(&self) -> Option<f64> {
        let class = self.rows.len() - 1;
        let slopes = self.entries.range((class, 0)..);
        let sizes = slopes.map(|(&(_, quantity), a)| a.largest * self.sizes[quantity].exp2());
        log(sizes.fold(0.0, f64::max))
    }

    /// Sizes of 1 of all but the objective, where all that is given is not far from 1, constants of rows among that: so is what
    /// rows make of it.
    fn ones(&self, objective: Option<f64>, constants: &BTreeMap<usize, f64>) -> Option<Sizes> {
        let mut constants = constants.values().filter_map(|&size| log_of_given(size));
        let mut known = self.sizes.iter().zip(&self.known);
        let are_ones = constants.all(|log| power(log, ONE) == 1.0)
            && known.all(|(&log, known)| known.is_empty() || power(log, ONE) == 1.0);
        are_ones.then(|| Sizes {
            quantities: self.quantities.to_vec(),
            variables: vec![1.0; self.quantities.len()],
            rows: vec![1.0; self.classes.len() - 1],
            objective: objective.map_or(1.0, |log| power(log, ONE_OBJECTIVE)),
        })
    }

    fn sizes(&self, objective: Option<f64>) -> Sizes {
        let sizes = self.sizes.iter().zip(&self.known).map(|(&log, known)| {
            let one = if known.is_empty() { ONE_UNKNOWN } else { ONE };
            power(log, one)
        });
        let sizes: Vec<f64> = sizes.collect();
        let mut rows = vec![(0.0_f64, f64::INFINITY); self.rows.len()];
        for (&(row, quantity), a) in &self.entries {
            let (largest, most) = &mut rows[row];
            *largest = largest.max(a.largest * sizes[quantity]);
            // Large rows of quantities in the units that were chosen stay in theirs.
            if sizes[quantity] != 1.0 {
                *most = ONE[1];
            }
        }
        let row = |class: usize| {
            let (largest, most) = rows[class];
            log(largest).map_or(1.0, |log| power(log, [ONE[0], most]))
        };
        let (_, of_rows) = self.classes.split_last().expect("the objective");
        Sizes {
            quantities: self.quantities.to_vec(),
            variables: self.quantities.iter().map(|&q| sizes[q]).collect(),
            rows: of_rows.iter().map(|&class| row(class)).collect(),
            objective: objective.map_or(1.0, |log| power(log, ONE_OBJECTIVE)),
        }
    }
}

impl Balance<'_> {
    /// The same with sizes of their own of rows whose terms are far smaller, at the start and at points of these sizes: neither
    /// other rows of the same quantities nor what is given say that of a row.
    fn with_small_rows(mut self, mut sizes: Sizes, start: &[f64]) -> Sizes {
        for (&quantity, size) in sizes.quantities.iter().zip(&sizes.variables) {
            self.sizes[quantity] = size.log2();
        }
        let points = (0..POINTS as u64).map(|number| self.point(number));
        let points: Vec<Vec<f64>> = points.chain([start.to_vec()]).collect();
        let n_entries = self.nlp.jacobian_pattern().n_entries();
        let (mut entries, mut largest) = (vec![0.0; n_entries], vec![0.0_f64; n_entries]);
        for point in &points {
            self.nlp.jacobian(point, &mut entries);
            for (largest, entry) in largest.iter_mut().zip(&entries) {
                *largest = largest.max(entry.abs());
            }
        }
        let pattern = self.nlp.jacobian_pattern();
        for (row, size) in sizes.rows.iter_mut().enumerate() {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            let terms = pattern.row(row).iter().zip(&largest[places]);
            let terms = terms.map(|(&column, a)| a * sizes.variables[column as usize]);
            let own = log(terms.fold(0.0, f64::max));
            if let Some(own) = own.filter(|own| own - size.log2() < ONE[0]) {
                *size = power(own, ONE);
            }
        }
        sizes
    }
}

/// What is known of the size of a quantity, in logarithms.
#[derive(Clone, Debug, Default)]
struct Known {
    /// Of values that are given, and of guesses.
    sizes: Vec<f64>,
    /// Of bounds: it is no larger. Far away ones are often reached by nothing.
    most: Option<f64>,
}

impl Known {
    fn is_empty(&self) -> bool {
        self.sizes.is_empty() && self.most.is_none()
    }

    /// Those that say something of a size that is thought to be so.
    fn of(&self, log: f64) -> impl Iterator<Item = f64> {
        let most = self.most.filter(|&most| most <= ONE[1] || most <= log);
        self.sizes.iter().copied().chain(most)
    }
}

/// Offsets of all variables, and what is known of the sizes of quantities: logarithms of the distances of their values,
/// bounds and guesses from there.
fn known(
    bounds: Bounds<'_>,
    quantities: &[usize],
    start: &[f64],
    n: usize,
) -> (Vec<f64>, Vec<Known>) {
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; n];
    for (i, &quantity) in quantities.iter().enumerate() {
        let [lower, upper] = &mut ranges[quantity];
        *lower = lower.min(bounds.lower[i]);
        *upper = upper.max(bounds.upper[i]);
    }
    let offset = |i: usize| {
        let [lower, upper] = ranges[quantities[i]];
        nearest(lower, upper)
    };
    let offsets: Vec<f64> = (0..quantities.len()).map(offset).collect();
    // The largest value that is given, bound and guess of each.
    let mut largest = vec![[0.0_f64; 3]; n];
    for (i, &quantity) in quantities.iter().enumerate() {
        let (lower, upper) = (bounds.lower[i], bounds.upper[i]);
        let kept = &mut largest[quantity];
        let mut keep = |kind: usize, value: f64| {
            let distance = (value - offsets[i]).abs();
            if distance.is_finite() {
                kept[kind] = kept[kind].max(distance);
            }
        };
        if lower == upper {
            keep(0, lower);
        } else {
            keep(1, lower);
            keep(1, upper);
            keep(2, start[i]);
        }
    }
    let known = largest.iter().map(|&[given, most, guess]| Known {
        sizes: [given, guess]
            .into_iter()
            .filter_map(log_of_given)
            .collect(),
        most: log_of_given(most),
    });
    (offsets, known.collect())
}
