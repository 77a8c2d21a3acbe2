//! The program of a step of so many elements: made once, and started from any instant and state.

use serde::{Deserialize, Serialize};

use crate::optimization::problem::Mpcc;

/// A program whose numbers can be given other values.
pub trait Program: Mpcc {
    /// Gives a variable other bounds; where it is a side of a pair, its lower one has to stay.
    fn bound(&mut self, variable: usize, lower: f64, upper: f64);

    /// How many numbers its functions need at least.
    fn n_parameters(&self) -> usize;

    /// Gives the parameters of the system, and behind them the length of a step, other values.
    fn set_parameters(&mut self, values: &[f64]);

    /// Gives a variable its value; it is no side of a pair by itself.
    fn fix(&mut self, variable: usize, value: f64) {
        self.bound(variable, value, value);
    }
}

/// Where the variables of an element are.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Element {
    /// Its length.
    pub length: usize,
    /// The instant at which it begins, where functions depend on time.
    pub start: Option<usize>,
    /// The first state where the element before ends.
    pub before: usize,
    /// The first state at its left end, at its nodes, and at its right end where that is no node.
    pub states: Vec<usize>,
    /// z at these points, as far as it is there.
    pub algebraics: Vec<Vec<Option<usize>>>,
    /// The impulse of the first contact where it begins, where there are contacts.
    pub impulses: usize,
}

/// The program of a step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StepProgram<P> {
    /// The program itself.
    pub program: P,
    /// Its elements.
    pub elements: Vec<Element>,
    /// Where their lengths are in a step of length 1.
    pub shares: Vec<[f64; 2]>,
    /// How many Runge-Kutta nodes an element has.
    pub nodes: usize,
    /// Where the points of an element of length 1 are: its left end, its nodes, and its right end where that is none.
    pub points: Vec<f64>,
    /// How many states there are.
    pub n_states: usize,
    /// τ as a share of it: gaps up to τ times the speed of an impact are closed where elements meet.
    pub window: f64,
    /// The parameters of the system, and the length of a step.
    pub numbers: Vec<f64>,
    /// The variables of the z that are given at the start, with their places among z.
    pub continuous: Vec<(usize, usize)>,
    /// The places of c of all contacts among z.
    pub closed: Vec<usize>,
}

/// Where a step starts: the instant, and the values of states and algebraic variables.
#[derive(Clone, Debug)]
pub struct StepStart {
    /// t.
    pub time: f64,
    /// x.
    pub x: Vec<f64>,
    /// z, without c and what belongs to it.
    pub z: Vec<f64>,
}

impl<P> StepProgram<P> {
    /// The length of a step, behind the parameters.
    pub fn length(&self) -> f64 {
        self.numbers[self.numbers.len() - 1]
    }
}

impl<P: Program> StepProgram<P> {
    /// Takes the values of all parameters, and the length of a step.
    pub fn set_numbers(&mut self, parameters: &[f64], length: f64) {
        let (known, last) = self.numbers.split_at_mut(parameters.len());
        if known == parameters && last == [length] {
            return;
        }
        known.copy_from_slice(parameters);
        last[0] = length;
        self.program.set_parameters(&self.numbers);
        for (element, shares) in self.elements.iter().zip(&self.shares) {
            let [lower, upper] = shares.map(|share| share * length);
            self.program.bound(element.length, lower, upper);
        }
    }

    /// Gives the program a start, with the contacts that stay closed in each of its elements. The point is where a
    /// solution is looked for as long as nothing else is known: all values are those at the start.
    pub fn start_from(&mut self, from: &StepStart, closed: &[Vec<bool>]) -> Vec<f64> {
        let mut w = self.program.start().to_vec();
        let mean = self.length() / self.elements.len() as f64;
        for (j, element) in self.elements.iter().enumerate() {
            w[element.length] = mean;
            if let Some(t) = element.start {
                w[t] = from.time + j as f64 * mean;
            }
            for (&first, z) in element.states.iter().zip(&element.algebraics) {
                w[first..][..self.n_states].copy_from_slice(&from.x);
                for (index, &z) in z.iter().zip(&from.z) {
                    if let Some(index) = *index {
                        w[index] = z;
                    }
                }
            }
            for (c, &place) in self.closed.iter().enumerate() {
                let is_closed = closed.get(j).is_some_and(|closed| closed[c]);
                for z in &element.algebraics[1..=self.nodes] {
                    let index = z[place].expect("it is there at nodes");
                    self.program.fix(index, f64::from(u8::from(is_closed)));
                }
            }
        }
        let first = &self.elements[0];
        if let Some(t) = first.start {
            self.program.fix(t, from.time);
        }
        for (i, &x) in from.x.iter().enumerate() {
            self.program.fix(first.before + i, x);
        }
        for &(index, i) in &self.continuous {
            self.program.fix(index, from.z[i]);
        }
        let bounds = self.program.variable_bounds();
        for (w, (lower, upper)) in w.iter_mut().zip(bounds.lower.iter().zip(bounds.upper)) {
            *w = w.max(*lower).min(*upper);
        }
        w
    }
}

impl<P> StepProgram<P> {
    /// The states at a point of an element.
    pub fn states<'w>(&self, w: &'w [f64], j: usize, m: usize) -> &'w [f64] {
        &w[self.elements[j].states[m]..][..self.n_states]
    }

    /// The states where the element before ends.
    pub fn before<'w>(&self, w: &'w [f64], j: usize) -> &'w [f64] {
        &w[self.elements[j].before..][..self.n_states]
    }

    /// z_i at a point of an element; zero where it is not there.
    pub fn z(&self, w: &[f64], j: usize, m: usize, i: usize) -> f64 {
        self.elements[j].algebraics[m][i].map_or(0.0, |index| w[index])
    }
}
