//! S' = f_x S + f_p by Radau IIA, where steps are long for its time constants.
//!
//! α_K' stays an unknown: 0 = φ_x S + φ_α α' + φ_p. One factorization serves all directions.

use std::sync::Arc;

use super::functions::{Functions, Linearized, Moved};
use super::taylor::Tangent as Polynomial;
use super::variational::{Found, Known, TooLong, Way, difference};
use super::why::Why;
use crate::integrate::radau::{Implicit, Radau, Shape, Start, Tableau};

/// Nodes; the order is 13.
const NODES: usize = 7;

/// The method, with what it remembers of a step.
pub(super) struct Stiff {
    tolerance: f64,
    tableau: Option<Arc<Tableau>>,
    radau: Option<Radau>,
    /// The functions at points of the present part.
    known: Vec<(f64, Option<Linearized>)>,
}

/// S' of a direction along a step.
struct Tangent<'t, 'a, 'r> {
    functions: &'t mut Functions<'r>,
    way: Way<'a>,
    known: &'t mut Vec<(f64, Option<Linearized>)>,
    /// The functions beside the run.
    shaken: Linearized,
    direction: usize,
    failed: Option<Why>,
}

impl Tangent<'_, '_, '_> {
    fn at(&mut self, tau: f64) -> Option<usize> {
        let place = match self.known.iter().position(|(at, _)| *at == tau) {
            Some(place) => place,
            None => {
                let linear = self.way.linearize(self.functions, tau);
                self.failed = self.failed.or(linear.as_ref().err().copied());
                self.known.push((tau, linear.ok()));
                self.known.len() - 1
            }
        };
        self.known[place].1.is_some().then_some(place)
    }
}

impl Implicit for Tangent<'_, '_, '_> {
    fn eval(&mut self, t: f64, y: &[f64], values: &mut [f64]) {
        match self.at(t).and_then(|place| self.known[place].1.as_ref()) {
            Some(linear) => linear.open(self.functions, y, self.direction, values),
            None => values.fill(f64::NAN),
        }
    }

    fn jacobian(&mut self, t: f64, _: &[f64], matrix: &mut [f64]) {
        match self.at(t).and_then(|place| self.known[place].1.as_ref()) {
            Some(linear) => linear.matrix(self.functions.slots, matrix),
            None => matrix.fill(f64::NAN),
        }
    }
}

fn shape(way: Way) -> Shape {
    Shape {
        states: way.step.end.len(),
        algebraic: way.mode.sliding.len(),
    }
}

impl Stiff {
    pub fn new(tolerance: f64) -> Self {
        Stiff {
            tolerance,
            tableau: None,
            radau: None,
            known: Vec::new(),
        }
    }

    /// Begins a step.
    pub fn begin(&mut self, way: Way) {
        let shape = shape(way);
        self.radau = self.radau.take().filter(|radau| radau.shape() == shape);
        if let Some(radau) = &mut self.radau {
            radau.restart(way.step.length);
        }
    }

    /// Tangents along a part of a step.
    pub fn part(
        &mut self,
        functions: &mut Functions,
        way: Way,
        tangents: &[Option<Vec<f64>>],
        [a, b]: [f64; 2],
    ) -> Result<Known, Why> {
        let middle = way.linearize(functions, 0.5 * (a + b))?;
        let tableau = self
            .tableau
            .get_or_insert_with(|| Arc::new(Tableau::new(NODES)));
        let make = || Radau::new(tableau.clone(), shape(way), self.tolerance);
        let radau = self.radau.get_or_insert_with(make);
        self.known.clear();
        let mut problem = Tangent {
            shaken: way.shaken(functions, a, way.run.accuracy.0)?,
            functions,
            way,
            known: &mut self.known,
            direction: 0,
            failed: None,
        };
        let mut found = Vec::new();
        for (d, tangent) in tangents.iter().enumerate() {
            let Some(tangent) = tangent else {
                found.push(None);
                continue;
            };
            problem.direction = d;
            let Some(start) = problem.start(a, tangent) else {
                break;
            };
            found.push(Some(solved(radau, &mut problem, &start, b - a)));
        }
        match problem.failed {
            Some(why) => Err(why),
            None => Ok((middle, None, found)),
        }
    }
}

impl Tangent<'_, '_, '_> {
    fn start(&mut self, tau: f64, tangent: &[f64]) -> Option<Start> {
        let place = self.at(tau)?;
        let linear = self.known[place].1.as_ref()?;
        let moved = Moved::still(tangent);
        let [known, alpha] = linear.along(self.functions, moved, self.direction);
        let terms = linear.terms(self.functions, moved, self.direction);
        let [shaken, _] = self.shaken.along(self.functions, moved, self.direction);
        // What is not known of rates counts as their rounding.
        let noise = difference(&known, &shaken).into_iter();
        let noise = noise.map(|noise| noise / (8.0 * f64::EPSILON));
        let mut terms: Vec<f64> = terms
            .iter()
            .zip(noise)
            .map(|(term, noise)| term.max(noise))
            .collect();
        terms.extend(alpha.iter().map(|alpha| alpha.abs()));
        let largest = self.way.sizes.tangents(self.direction);
        let scales = tangent
            .iter()
            .enumerate()
            .map(|(i, s)| s.abs().max(largest(i)));
        Some(Start {
            t: tau,
            scales: scales
                .chain(alpha.iter().map(|alpha| alpha.abs()))
                .collect(),
            y: tangent.iter().copied().chain(alpha).collect(),
            terms,
        })
    }
}

/// S along a part of a length.
fn solved(radau: &mut Radau, problem: &mut Tangent, start: &Start, h: f64) -> Found {
    // Other directions say nothing of this one.
    radau.hold(start, h);
    radau
        .solve(problem, start, h)
        .map_err(|_| TooLong::Divergent)?;
    let probes = radau.tableau().probes.clone();
    for probe in [0.0].into_iter().chain(probes) {
        let error = radau.error_at(problem, start, probe * h);
        if error.is_nan() || error >= 1.0 {
            return Err(TooLong::Inexact);
        }
    }
    let n = problem.way.step.end.len();
    let series = |i| radau.series(i).iter().copied();
    let tangent = Polynomial::new(n, radau.series(0).len(), series);
    let end = tangent.at(h);
    Ok((tangent, end))
}
