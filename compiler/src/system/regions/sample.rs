//! Deterministic points of the state space, and points on a surface near them.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use nsd_solver::runtime::random;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::expr::{Evaluator, Expr, Interval, Var, variables_of};
use crate::source::table::Table;

/// Values of all variables, and how the switches follow from the others.
pub(crate) struct Sampler<'e> {
    /// Values by number of the variable: parameters and initial states at their values.
    base: Rc<Vec<f64>>,
    states: Rc<Vec<Var>>,
    /// Free parameters with their ranges.
    free: Rc<Vec<(Var, Interval)>>,
    time: Var,
    horizon: f64,
    /// (α, ψ), inner ones first.
    switches: Vec<(Var, Expr<'e>)>,
    /// α of relays, which have either value anywhere.
    relays: Rc<Vec<Var>>,
    /// Functions of time.
    data: Rc<Vec<(Var, Arc<Table>)>>,
    gradients: RefCell<FxHashMap<Expr<'e>, Gradient<'e>>>,
    evaluators: RefCell<FxHashMap<Expr<'e>, Evaluator<'e>>>,
}

/// The entries of ∇ψ that are not zero.
type Gradient<'e> = Rc<Vec<(Var, Expr<'e>)>>;

/// Values by number of the variable.
#[derive(Clone)]
pub(crate) struct Point(Vec<f64>);

impl Point {
    /// The value of a variable.
    pub fn get(&self, var: Var) -> f64 {
        self.0.get(var.index()).copied().unwrap_or(f64::NAN)
    }

    /// Sets a variable.
    pub fn set(&mut self, var: Var, value: f64) {
        if var.index() >= self.0.len() {
            self.0.resize(var.index() + 1, f64::NAN);
        }
        self.0[var.index()] = value;
    }
}

impl<'e> Sampler<'e> {
    /// Samples around the initial point; `fixed` gives parameters and initial values.
    pub fn new(
        fixed: impl IntoIterator<Item = (Var, f64)>,
        states: Vec<Var>,
        time: Var,
        horizon: f64,
        switches: Vec<(Var, Expr<'e>)>,
    ) -> Self {
        let mut base = Point(Vec::new());
        base.set(time, 0.0);
        for (var, value) in fixed {
            base.set(var, value);
        }
        Sampler {
            base: Rc::new(base.0),
            states: Rc::new(states),
            free: Rc::default(),
            time,
            horizon,
            switches,
            relays: Rc::default(),
            data: Rc::default(),
            gradients: RefCell::default(),
            evaluators: RefCell::default(),
        }
    }

    /// The same with relays, whose values at the start are among those that are fixed.
    pub fn with_relays(self, relays: Vec<Var>) -> Self {
        Sampler {
            relays: Rc::new(relays),
            ..self
        }
    }

    /// The same with free parameters, in order of declaration.
    pub fn with_free(self, mut free: Vec<(Var, Interval)>) -> Self {
        free.sort_unstable_by_key(|&(var, _)| var);
        Sampler {
            free: Rc::new(free),
            ..self
        }
    }

    /// The same with functions of time.
    pub fn with_data(self, data: Vec<(Var, Arc<Table>)>) -> Self {
        let mut base = Point(self.base.to_vec());
        data.iter()
            .for_each(|(var, table)| base.set(*var, table.value(0.0)));
        Sampler {
            base: Rc::new(base.0),
            data: Rc::new(data),
            ..self
        }
    }

    /// Moves to an instant.
    fn set_time(&self, point: &mut Point, time: f64) {
        point.set(self.time, time);
        for (var, table) in self.data.iter() {
            point.set(*var, table.value(time));
        }
    }

    /// Moves along one variable; data goes with time.
    fn shift(&self, point: &mut Point, var: Var, by: f64) {
        let value = point.get(var) + by;
        match var == self.time {
            true => self.set_time(point, value),
            false => point.set(var, value),
        }
    }

    /// The initial point.
    pub fn start(&self) -> Point {
        let mut point = Point(self.base.to_vec());
        self.settle(&mut point);
        point
    }

    /// The same for some functions: only the switches that they reach are settled.
    pub fn only(&self, functions: &[Expr<'e>]) -> Self {
        let mut reached: FxHashSet<Var> = variables_of(functions).into_iter().collect();
        // Inner switches come first, so one pass from the last one finds them all.
        let mut switches: Vec<(Var, Expr<'e>)> = (self.switches.iter().rev().copied())
            .filter(|&(alpha, psi)| {
                let is_reached = reached.contains(&alpha);
                if is_reached {
                    reached.extend(variables_of(&[psi]));
                }
                is_reached
            })
            .collect();
        switches.reverse();
        Sampler {
            base: Rc::clone(&self.base),
            states: Rc::clone(&self.states),
            free: Rc::clone(&self.free),
            time: self.time,
            horizon: self.horizon,
            switches,
            relays: Rc::clone(&self.relays),
            data: Rc::clone(&self.data),
            gradients: RefCell::default(),
            evaluators: RefCell::default(),
        }
    }

    /// The value of an expression at a point.
    pub fn eval(&self, e: Expr<'e>, point: &Point) -> f64 {
        let mut evaluators = self.evaluators.borrow_mut();
        let evaluator = evaluators.entry(e).or_insert_with(|| Evaluator::new(e));
        evaluator.eval(&|var| point.get(var))
    }

    /// How far rounding may have taken that value from the exact one; 0 where that is not known.
    pub fn rounding(&self, e: Expr<'e>, point: &Point) -> f64 {
        let mut evaluators = self.evaluators.borrow_mut();
        let evaluator = evaluators.entry(e).or_insert_with(|| Evaluator::new(e));
        let error = evaluator.running_error(&|var| point.get(var));
        if error.is_finite() { error } else { 0.0 }
    }

    /// `count` points at distances from 1e-3 to 10 times the initial state's size, the initial point first.
    pub fn points(&self, count: usize) -> impl Iterator<Item = Point> + '_ {
        const SCALES: [f64; 5] = [1.0, 0.1, 10.0, 1e-2, 1e-3];
        let size = self
            .states
            .iter()
            .map(|&x| self.base[x.index()].abs())
            .fold(1.0, f64::max);
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        (0..count).map(move |k| {
            let mut point = Point(self.base.to_vec());
            if k > 0 {
                let scale = size * SCALES[k % SCALES.len()];
                for &x in self.states.iter() {
                    point.set(x, point.get(x) + scale * random.symmetric());
                }
                for &(p, range) in self.free.iter() {
                    let value = point.get(p) + scale * random.symmetric();
                    point.set(p, value.max(range.low).min(range.high));
                }
                self.set_time(&mut point, self.horizon * random.symmetric().abs());
                for &alpha in self.relays.iter() {
                    point.set(alpha, f64::from(random.symmetric() > 0.0));
                }
            }
            self.settle(&mut point);
            point
        })
    }

    /// The initial point with other values of some variables.
    pub fn point_at(&self, values: &[(Var, f64)]) -> Point {
        let mut point = Point(self.base.to_vec());
        let time = values.iter().find(|(var, _)| *var == self.time);
        if let Some(&(_, time)) = time {
            self.set_time(&mut point, time);
        }
        values
            .iter()
            .for_each(|&(var, value)| point.set(var, value));
        self.settle(&mut point);
        point
    }

    /// The point with its states and time in as few digits as it still is `right` with.
    pub fn shortened(&self, point: &Point, right: impl Fn(&Point) -> bool) -> Point {
        const DIGITS: [usize; 6] = [1, 2, 3, 5, 7, 10];
        let vars = || self.states.iter().copied().chain([self.time]);
        let mut shorter = DIGITS.iter().map(|digits| {
            let rounded = |var| {
                let value = point.get(var);
                format!("{value:.digits$e}").parse().unwrap_or(value)
            };
            let values: Vec<(Var, f64)> = vars().map(|var| (var, rounded(var))).collect();
            self.point_at(&values)
        });
        shorter.find(right).unwrap_or_else(|| point.clone())
    }

    /// Sets every α to the side of its ψ.
    pub fn settle(&self, point: &mut Point) {
        for &(alpha, psi) in &self.switches {
            let side = if self.eval(psi, point) > 0.0 {
                1.0
            } else {
                0.0
            };
            point.set(alpha, side);
        }
    }

    /// Follows Newton's method along ∇ψ to ψ = 0, in the states, or in time where ψ has no states.
    pub fn to_surface(&self, psi: Expr<'e>, start: &Point) -> Option<Point> {
        const MOST_STEPS: usize = 40;
        let gradient = self.gradient(psi);
        let mut point = start.clone();
        let mut last = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            let value = self.eval(psi, &point);
            // At rounding, the value stops getting smaller.
            if value == 0.0
                || (value.abs() >= last && last < 1e-12 * (1.0 + self.eval(psi, start).abs()))
            {
                return Some(point);
            }
            last = value.abs();
            let g: Vec<f64> = gradient
                .iter()
                .map(|&(_, g)| self.eval(g, &point))
                .collect();
            let squared: f64 = g.iter().map(|g| g * g).sum();
            if !(value.is_finite() && squared.is_finite() && squared > 0.0) {
                return None;
            }
            for (&(x, _), g) in gradient.iter().zip(g) {
                self.shift(&mut point, x, -value * g / squared);
            }
            self.settle(&mut point);
        }
        (last < 1e-12 * (1.0 + self.eval(psi, start).abs())).then_some(point)
    }

    /// Points at all distances from the initial point, then points on both sides of each surface, from near to far,
    /// then points on all sides of where two surfaces meet.
    pub fn points_around<'a>(&'a self, psi: &'a [Expr<'e>]) -> impl Iterator<Item = Point> + 'a {
        const N_POINTS: usize = 200;
        const N_STARTS: usize = 8;
        const MOST_PAIRS: usize = 45;
        let beside = psi.iter().flat_map(move |&psi| {
            let on_surface = self
                .points(N_STARTS)
                .filter_map(move |start| self.to_surface(psi, &start));
            on_surface.flat_map(move |point| self.beside(psi, &point))
        });
        let pairs = (0..psi.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let corners = pairs.take(MOST_PAIRS).flat_map(move |(i, j)| {
            let both = [psi[j], psi[i]];
            let met = self
                .points(N_STARTS)
                .filter_map(move |start| self.to_both(both, &start));
            met.flat_map(move |point| self.around(both, &point))
        });
        self.points(N_POINTS).chain(beside).chain(corners)
    }

    /// Follows the Gauss-Newton method to a point of two surfaces: the shortest step that is zero on both planes.
    fn to_both(&self, psi: [Expr<'e>; 2], start: &Point) -> Option<Point> {
        const MOST_STEPS: usize = 30;
        let mut point = start.clone();
        for _ in 0..MOST_STEPS {
            let values = psi.map(|psi| self.eval(psi, &point));
            if values.iter().all(|value| value.abs() < 1e-12) {
                return Some(point);
            }
            for (var, step) in self.shortest(psi, &point, values.map(|value| -value))? {
                self.shift(&mut point, var, step);
            }
            self.settle(&mut point);
        }
        None
    }

    /// Points in the four corners where two surfaces meet, from near to far.
    fn around(&self, psi: [Expr<'e>; 2], on: &Point) -> Vec<Point> {
        const DISTANCES: [f64; 3] = [1e-4, 1e-2, 0.3];
        let mut found = Vec::new();
        for sides in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
            let Some(steps) = self.shortest(psi, on, sides) else {
                continue;
            };
            let length = steps
                .iter()
                .map(|(_, step)| step * step)
                .sum::<f64>()
                .sqrt();
            for distance in DISTANCES {
                let mut point = on.clone();
                for &(var, step) in &steps {
                    self.shift(&mut point, var, distance * step / length);
                }
                self.settle(&mut point);
                found.push(point);
            }
        }
        found
    }

    /// The shortest change of the point that changes both functions by `change`, to first order.
    fn shortest(
        &self,
        psi: [Expr<'e>; 2],
        point: &Point,
        change: [f64; 2],
    ) -> Option<Vec<(Var, f64)>> {
        let slopes = psi.map(|psi| -> FxHashMap<Var, f64> {
            let gradient = self.gradient(psi);
            let slope = gradient.iter().map(|&(var, g)| (var, self.eval(g, point)));
            slope.collect()
        });
        let dot = |a: &FxHashMap<Var, f64>, b: &FxHashMap<Var, f64>| -> f64 {
            let products = a.iter().map(|(var, g)| g * b.get(var).unwrap_or(&0.0));
            products.sum()
        };
        // Δx = Jᵀ (J Jᵀ)⁻¹ Δψ
        let [a, b, c] = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| dot(&slopes[i], &slopes[j]));
        let determinant = a * c - b * b;
        if !(determinant.is_finite() && determinant > 1e-12 * a * c) {
            return None;
        }
        let weights = [
            (c * change[0] - b * change[1]) / determinant,
            (a * change[1] - b * change[0]) / determinant,
        ];
        let mut steps: FxHashMap<Var, f64> = FxHashMap::default();
        for (slope, weight) in slopes.iter().zip(weights) {
            for (&var, g) in slope {
                *steps.entry(var).or_insert(0.0) += weight * g;
            }
        }
        let mut steps: Vec<(Var, f64)> = steps.into_iter().collect();
        steps.sort_by_key(|&(var, _)| var);
        Some(steps)
    }

    /// Points off the surface along ±∇ψ.
    fn beside(&self, psi: Expr<'e>, on: &Point) -> Vec<Point> {
        const OFFSETS: [f64; 8] = [1e-7, -1e-7, 1e-4, -1e-4, 1e-2, -1e-2, 0.3, -0.3];
        self.moved(psi, on, &OFFSETS)
    }

    /// Points along ±∇ψ where ψ has changed by small multiples of `distance`, relative to the size
    /// of its terms |∂ψ/∂x_i|·|x_i|: other units of states, time or ψ give the same points.
    pub fn near(&self, psi: Expr<'e>, on: &Point, distance: f64) -> Vec<Point> {
        const MULTIPLES: [f64; 8] = [1.0, -1.0, 3.0, -3.0, 7.0, -7.0, 16.0, -16.0];
        let gradient = self.gradient(psi);
        let (mut length, mut terms, mut slopes) = (0.0_f64, 0.0, 0.0);
        for &(x, g) in gradient.iter() {
            let slope = self.eval(g, on).abs();
            length = length.hypot(slope);
            slopes += slope;
            terms += slope * on.get(x).abs().max(self.base[x.index()].abs());
        }
        // At the origin there is no size to be relative to.
        let size = if terms > 0.0 { terms } else { slopes } / length;
        self.moved(psi, on, &MULTIPLES.map(|k| k * distance * size))
    }

    fn moved(&self, psi: Expr<'e>, on: &Point, offsets: &[f64]) -> Vec<Point> {
        let gradient = self.gradient(psi);
        let slope: Vec<f64> = gradient.iter().map(|&(_, g)| self.eval(g, on)).collect();
        let length = slope.iter().map(|g| g * g).sum::<f64>().sqrt();
        if !(length.is_finite() && length > 0.0) {
            return Vec::new();
        }
        let moved = offsets.iter().map(|offset| {
            let mut point = on.clone();
            for (&(x, _), g) in gradient.iter().zip(&slope) {
                self.shift(&mut point, x, offset * g / length);
            }
            self.settle(&mut point);
            point
        });
        moved.collect()
    }

    /// ∇ψ in the states, or in time where ψ has no states.
    fn gradient(&self, psi: Expr<'e>) -> Gradient<'e> {
        if let Some(known) = self.gradients.borrow().get(&psi) {
            return Rc::clone(known);
        }
        let below = variables_of(&[psi]);
        let slope = |var: &Var| (*var, psi.diff(*var));
        let mut entries: Vec<_> = below
            .iter()
            .filter(|var| self.states.contains(var))
            .map(slope)
            .collect();
        // Without states it is one of time, which data may stand for.
        if entries.is_empty() {
            let is_data = |var: &Var| self.data.iter().any(|(data, _)| data == var);
            let of_time = below.iter().filter(|var| **var == self.time);
            entries = of_time.map(slope).collect();
            if entries.is_empty() {
                entries = below.iter().filter(|var| is_data(var)).map(slope).collect();
            }
        }
        let gradient = Rc::new(entries);
        self.gradients
            .borrow_mut()
            .insert(psi, Rc::clone(&gradient));
        gradient
    }

    /// The values that decide the given functions, for a witness in a message.
    pub fn witness(&self, point: &Point, psi: &[Expr<'e>], name: impl Fn(Var) -> String) -> String {
        let below = variables_of(psi);
        let vars = self
            .states
            .iter()
            .copied()
            .chain([self.time])
            .chain(self.data.iter().map(|(var, _)| *var))
            .filter(|var| below.contains(var));
        let values = vars.map(|x| format!("{} = {}", name(x), point.get(x)));
        values.collect::<Vec<_>>().join(", ")
    }
}

/// SplitMix64 (Steele, Lea & Flood 2014).
pub(crate) struct Random(pub u64);

impl Random {
    /// Uniform in [-1, 1).
    pub fn symmetric(&mut self) -> f64 {
        (random::next(&mut self.0) >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0
    }
}
