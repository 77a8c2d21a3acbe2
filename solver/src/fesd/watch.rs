//! Members along an element: do they stay positive, and which is the first that does not?

use wide::f64x4;

use super::element::Element;
use super::system::Reduced;
use crate::events::roots::RootFinder;
use crate::events::sensitivity;
use crate::fesd::element::scheme::{Scheme, WIDTH};
use crate::fesd::system::hidden::{Hidden, Unsolved};

/// How a member starts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) enum Start {
    /// Above zero.
    #[default]
    Inside,
    /// At zero, and it rises.
    Rising,
    /// At zero, and so is its rate.
    Tangent,
}

/// What members do in an element.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Verdict {
    /// None vanishes.
    Stays,
    /// One vanishes at this fraction of the element, the first to do so.
    Leaves { sigma: f64, member: usize },
    /// One is negative from the start: this is not the active set.
    Wrong { member: usize },
}

/// Below this, relative to the largest value of its pair so far, a member is zero.
pub(crate) const BAND: f64 = 1e-12;

/// Solutions w, w' of the hidden equations are on one branch if |w_k - w'_k| ≤ SAME_BRANCH (1 + |w_k|).
const SAME_BRANCH: f64 = 1e-5;

/// Values of the watched members of an element.
pub(crate) struct Values {
    /// One row per member, one column per point of the scheme.
    pub at_points: Vec<f64>,
    series: Vec<f64>,
    quotients: Vec<f64>,
    registers: Vec<f64x4>,
    /// w at the points, from the hidden equations.
    w: Vec<f64>,
    roots: RootFinder,
}

impl Values {
    /// Memory for the points of a scheme.
    pub fn new(scheme: &Scheme) -> Self {
        Values {
            at_points: Vec::new(),
            series: Vec::new(),
            quotients: Vec::new(),
            registers: Vec::new(),
            w: Vec::new(),
            roots: RootFinder::new(scheme.points.at.len()),
        }
    }

    /// Evaluates the watched members at all points of an element that is solved.
    pub fn evaluate(
        &mut self,
        scheme: &Scheme,
        element: &Element,
        hidden: &mut Hidden,
    ) -> Result<(), Unsolved> {
        let reduced = &element.reduced;
        let n = element.stages.n;
        let (n_w, n_points) = (reduced.unknowns.len(), scheme.points.at.len());
        self.w.resize(n_w * n_points, 0.0);
        if n_w > 0 {
            for p in 0..n_points {
                let node = scheme.points.nodes[p].unwrap_or(if p == 0 { 0 } else { scheme.s - 1 });
                let stages = &element.stages;
                stages.enter(scheme, p, hidden, stages.w(node));
                hidden.solve(reduced)?;
                self.w[p * n_w..(p + 1) * n_w].copy_from_slice(hidden.w());
            }
        }
        let tape = &reduced.members.tape;
        let n_rows = tape.n_outputs() + usize::from(reduced.has_branches);
        self.at_points.resize(n_rows * n_points, 0.0);
        if reduced.has_branches {
            self.follow(scheme, element, hidden)?;
        }
        self.registers
            .resize(tape.n_registers().max(tape.n_inputs()), f64x4::splat(0.0));
        // Lanes of nodes stand ready; a start or end that is no node is looked at by itself.
        for g in 0..scheme.groups {
            element.stages.load(scheme, g, &mut self.registers);
            for k in 0..n_w {
                let at = |lane: usize| {
                    let node = (g * WIDTH + lane).min(scheme.s - 1);
                    self.w[scheme.points.of_nodes[node] * n_w + k]
                };
                self.registers[1 + n + k] = f64x4::from(std::array::from_fn(at));
            }
            tape.run(&mut self.registers);
            let nodes = g * WIDTH..(g * WIDTH + WIDTH).min(scheme.s);
            for (member, value) in tape.results(&self.registers).enumerate() {
                let values = value.to_array();
                for node in nodes.clone() {
                    self.at_points[member * n_points + scheme.points.of_nodes[node]] =
                        values[node % WIDTH];
                }
            }
        }
        for p in 0..n_points {
            if scheme.points.nodes[p].is_none() {
                let w = &self.w[p * n_w..(p + 1) * n_w];
                element.stages.enter(scheme, p, hidden, w);
                for (member, value) in hidden.eval(tape).enumerate() {
                    self.at_points[member * n_points + p] = value;
                }
            }
        }
        Ok(())
    }

    /// Checks that w goes on from point to point on one branch, and writes det ∂hidden/∂w as one more member, with the
    /// sign that it starts with: where it vanishes the branch ends.
    fn follow(
        &mut self,
        scheme: &Scheme,
        element: &Element,
        hidden: &mut Hidden,
    ) -> Result<(), Unsolved> {
        let reduced = &element.reduced;
        let (n_w, n_points) = (reduced.unknowns.len(), scheme.points.at.len());
        let row = reduced.members.tape.n_outputs() * n_points;
        let mut sign = 1.0;
        for p in 0..n_points {
            let w = &self.w[p * n_w..(p + 1) * n_w];
            element.stages.enter(scheme, p, hidden, w);
            let determinant = hidden.determinant(reduced);
            if p == 0 {
                sign = determinant.signum();
            }
            self.at_points[row + p] = sign * determinant;
            if p > 0 {
                let before = &self.w[(p - 1) * n_w..p * n_w];
                element.stages.enter(scheme, p, hidden, before);
                hidden.solve(reduced)?;
                if !is_same_branch(hidden.w().iter().copied(), w) {
                    return Err(Unsolved::Diverged);
                }
            }
        }
        Ok(())
    }

    /// Lets slip velocities vanish where they stop: `sizes` of members are those over [`BAND`].
    pub fn lower_stops(&mut self, scheme: &Scheme, reduced: &Reduced, sizes: &[f64]) {
        let n_points = scheme.points.at.len();
        let rows = self.at_points.chunks_exact_mut(n_points);
        for ((values, watched), size) in rows.zip(&reduced.watched).zip(sizes) {
            if watched.stops {
                values.iter_mut().for_each(|value| *value -= BAND * size);
            }
        }
    }

    /// Whether w where the element starts is what it was before, after [`Values::evaluate`].
    pub fn starts_at(&self, reduced: &Reduced, w: impl Iterator<Item = f64>) -> bool {
        !reduced.has_branches || is_same_branch(w, &self.w)
    }

    /// w where the element ends, after [`Values::evaluate`].
    pub fn w_at_end(&self, reduced: &Reduced) -> &[f64] {
        &self.w[self.w.len() - reduced.unknowns.len()..]
    }

    /// α of the switches that slide at the points, one row each, after [`Values::evaluate`].
    pub fn alphas(
        &mut self,
        scheme: &Scheme,
        element: &Element,
        hidden: &mut Hidden,
        alphas: &mut Vec<f64>,
    ) {
        let reduced = &element.reduced;
        let (n_points, n_w) = (scheme.points.at.len(), reduced.unknowns.len());
        alphas.resize(reduced.alphas.n_outputs() * n_points, 0.0);
        if alphas.is_empty() {
            return;
        }
        for p in 0..n_points {
            let w = &self.w[p * n_w..(p + 1) * n_w];
            element.stages.enter(scheme, p, hidden, w);
            for (row, value) in hidden.eval(&reduced.alphas).enumerate() {
                alphas[row * n_points + p] = value;
            }
        }
    }

    /// Values of a member at the points.
    pub fn of(&self, scheme: &Scheme, member: usize) -> &[f64] {
        let n_points = scheme.points.at.len();
        &self.at_points[member * n_points..(member + 1) * n_points]
    }

    /// How long the root of a member at the end of an element is uncertain where values are rounded by so much, as a share
    /// of the element.
    pub fn uncertain(&mut self, scheme: &Scheme, member: usize, rounding: f64) -> f64 {
        let n_points = scheme.points.at.len();
        let values = &self.at_points[member * n_points..(member + 1) * n_points];
        self.series.resize(n_points, 0.0);
        scheme.points.all.series(values, &mut self.series);
        sensitivity::uncertain(&self.series, 1.0, rounding)
    }

    /// How far the polynomial through the values of a member is from what it is there, relative to the largest of
    /// them.
    pub fn misses(
        &mut self,
        scheme: &Scheme,
        member: usize,
        (sigma, value): (f64, f64),
        floor: f64,
    ) -> f64 {
        let n_points = scheme.points.at.len();
        let values = &self.at_points[member * n_points..(member + 1) * n_points];
        let largest = values
            .iter()
            .fold(value.abs().max(floor), |most, v| most.max(v.abs()));
        self.series.resize(n_points, 0.0);
        scheme.points.all.series(values, &mut self.series);
        (crate::expansion::series::value(&self.series, sigma) - value).abs() / largest
    }

    /// Whether the members stay positive; `starts` says how each begins, above zero where it does not.
    /// What starts at zero stays there below `least` and the `scales`, next to which it is rounding.
    pub fn judge(
        &mut self,
        scheme: &Scheme,
        starts: &[Start],
        (scales, least): (&[f64], f64),
    ) -> Verdict {
        let n_points = scheme.points.at.len();
        let mut first: Option<(f64, usize)> = None;
        for (member, values) in self.at_points.chunks_exact(n_points).enumerate() {
            let start = starts.get(member).unwrap_or(&Start::Inside);
            let sigma = match start {
                Start::Inside if stays_positive(values, scheme.points.all.lebesgue) => continue,
                Start::Inside => {
                    if values[0] <= -BAND * scales[member].max(least) {
                        return Verdict::Wrong { member };
                    }
                    self.series.resize(n_points, 0.0);
                    scheme.points.all.series(values, &mut self.series);
                    let start = values[0].max(f64::MIN_POSITIVE);
                    self.roots
                        .first(start, &self.series[1..], 1.0, 0.0)
                        .map(|root| root.tau)
                }
                // What is zero at the start is divided by its leading power of σ.
                Start::Rising | Start::Tangent => {
                    let power = if *start == Start::Rising { 1 } else { 2 };
                    let quotients = scheme.points.at[1..].iter().zip(&values[1..]);
                    self.quotients.clear();
                    self.quotients
                        .extend(quotients.map(|(sigma, v)| v / sigma.powi(power)));
                    let size = values.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
                    if size <= BAND * scales[member].max(least)
                        || stays_positive(&self.quotients, scheme.points.inner.lebesgue)
                    {
                        continue;
                    }
                    if self.quotients[0] <= 0.0 {
                        return Verdict::Wrong { member };
                    }
                    self.series.resize(n_points - 1, 0.0);
                    scheme
                        .points
                        .inner
                        .series(&self.quotients, &mut self.series);
                    let width = 1.0 - scheme.points.at[1];
                    let root = self
                        .roots
                        .first(self.quotients[0], &self.series[1..], width, 0.0);
                    root.map(|root| scheme.points.at[1] + root.tau)
                }
            };
            if let Some(sigma) = sigma.filter(|s| first.is_none_or(|(least, _)| *s < least)) {
                first = Some((sigma, member));
            }
        }
        match first {
            Some((sigma, member)) => Verdict::Leaves { sigma, member },
            None => Verdict::Stays,
        }
    }
}

/// Whether w = a and w = b at one instant are on the same branch of the hidden equations. Entries of b beyond those of
/// a are of other instants.
fn is_same_branch(a: impl Iterator<Item = f64>, b: &[f64]) -> bool {
    a.zip(b)
        .all(|(a, b)| (a - b).abs() <= SAME_BRANCH * (1.0 + a.abs()))
}

/// True when no polynomial with these values comes down to zero: it leaves the middle of its values
/// by no more than the Lebesgue constant times half their range.
fn stays_positive(values: &[f64], lebesgue: f64) -> bool {
    let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
    for &value in values {
        least = least.min(value);
        largest = largest.max(value);
    }
    least * (1.0 + lebesgue) > largest * (lebesgue - 1.0)
}
