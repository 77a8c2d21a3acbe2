//! S' = f_x S + f_p along a step, whose polynomials are known: a linear equation with known coefficients.
//!
//! It is solved by Gauss collocation with [`NODES`] nodes: with J_i and b_i at node i, K_i = J_i (S₀ + h Σ_j a_ij K_j) + b_i
//! and S₁ = S₀ + h Σ_j b_j K_j, by iteration, which contracts where h|J| is no larger than steps of Taylor series make it.
//! A part of the step is halved until the iteration converges, and until the defect S' - J S - b of the polynomial, seen at
//! its ends and between its nodes, moves no entry by more than the tolerance: at the end, where it does so by its integral
//! alone, and everywhere where instants are asked for inside. Where stiffness would take it far, Radau IIA goes on, whose
//! linear systems are of the size of the state and serve all directions.
//!
//! What the run does not move by, it does not see: a pulse times a parameter or a state that is zero. A part is therefore
//! halved until the derivatives of f are tame over it (`tape/enclosures/tame.rs`), so that no pulse of theirs is between the
//! points that are looked at.

use super::functions::{Functions, Linearized, ModeFunctions, Moved, Point};
use super::recording::Step;
use super::run::Run;
use super::sizes::Sizes;
use super::stiff::Stiff;
use super::why::Why;
use crate::expansion::series;
use crate::hybrid::Input;
use crate::integrate::tableau::{Family, Tableau, lagrange, monomials};
use crate::tape::{Ball, NOTHING};

/// Nodes of a part of a step.
const NODES: usize = 9;
/// Halvings of a step, and after how many that do not converge it is stiff.
const MOST_HALVINGS: usize = 20;
const STIFF: usize = 4;
/// Steps that are stiff without another look.
const PATIENCE: usize = 32;
/// Iterations, and those of them that may diverge at first: powers of h|J| do before factorials are larger.
const MOST_ITERATIONS: usize = 50;
const FIRST: usize = 16;
/// Parts of a step that are enclosed at most.
const MOST_ENCLOSED: usize = 4000;
/// A defect is rounding up to this part of its terms.
const ROUNDING: f64 = 1e-14;
/// Where the defect is looked at besides the ends: between nodes.
const BETWEEN: [f64; 2] = [0.25, 0.6];

/// A part of a step.
pub(super) struct Part {
    /// Its ends, from the start of the step.
    pub ends: [f64; 2],
    /// By direction that is known, S at [`Variational::points`].
    pub values: Vec<Option<Vec<Vec<f64>>>>,
}

/// A step in its mode.
#[derive(Clone, Copy)]
pub(super) struct Way<'a> {
    pub step: &'a Step,
    pub mode: &'a ModeFunctions,
    pub coefficients: &'a [f64],
    pub run: &'a Run<'a>,
    pub sizes: &'a Sizes,
}

/// Why a part of a step is too long for a direction.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum TooLong {
    Inexact,
    Divergent,
}

/// S at the start, the nodes and the end.
pub(super) type Values = Result<Vec<Vec<f64>>, TooLong>;

/// Where the defect is looked at besides the nodes, where it is zero.
struct Check {
    share: f64,
    /// From the slopes at the nodes to that here, and from the values at all points.
    slopes: Vec<f64>,
    values: Vec<f64>,
    /// Its weight in the integral of the polynomial through all that is known of the defect.
    integral: f64,
}

impl Check {
    fn of(nodes: &[f64], points: &[f64]) -> Vec<Check> {
        let shares = [0.0, 1.0, BETWEEN[0], BETWEEN[1]];
        let all = [nodes, &shares].concat();
        let coefficients = monomials(&all);
        let integral = |at: usize| -> f64 {
            let powers = coefficients.chunks(all.len()).enumerate();
            powers.map(|(k, row)| row[at] / (k + 1) as f64).sum()
        };
        let check = |(at, &share): (usize, &f64)| Check {
            share,
            slopes: lagrange(nodes, &[share]),
            values: lagrange(points, &[share]),
            integral: integral(nodes.len() + at),
        };
        shares.iter().enumerate().map(check).collect()
    }
}

/// The method.
pub(super) struct Variational {
    tableau: Tableau,
    /// The start, the nodes, and the end.
    points: Vec<f64>,
    checks: Vec<Check>,
    stiff: Stiff,
    /// Steps that are taken for stiff.
    patience: usize,
}

impl Variational {
    pub fn new(tolerance: f64) -> Self {
        let tableau = Tableau::new(Family::GaussLegendre, NODES).expect("there are Gauss methods");
        let points = tableau.points();
        Variational {
            checks: Check::of(&tableau.nodes, &points),
            points,
            stiff: Stiff::new(tolerance),
            patience: 0,
            tableau,
        }
    }

    /// Where the values of a part are, as shares of it.
    pub fn points(&self) -> &[f64] {
        &self.points
    }

    /// S inside of a part, `share` of it behind its start.
    pub fn inside(&self, values: &[Vec<f64>], share: f64) -> Vec<f64> {
        let weights = lagrange(&self.points, &[share]);
        combined(values, &weights)
    }

    /// Forgets how the steps before were.
    pub fn restart(&mut self) {
        self.patience = 0;
    }

    /// Takes tangents of the directions that are known along a step, and hands on its parts. Where one cannot go on it is
    /// taken away and told with how far it went.
    pub fn follow(
        &mut self,
        functions: &mut Functions,
        (way, asked): (Way, &[f64]),
        tangents: &mut [Option<Vec<f64>>],
        mut see: impl FnMut(&mut Functions, &Self, &Part) -> Vec<(usize, Why, Vec<usize>)>,
    ) -> Vec<(usize, Why, Vec<usize>, f64)> {
        let length = way.step.length;
        let mut lost = Vec::new();
        let mut enclosed = 0..MOST_ENCLOSED;
        let mut left = vec![([0.0, length], 0)];
        self.stiff.begin(way);
        while let Some((ends, halvings)) = left.pop() {
            if tangents.iter().all(Option::is_none) {
                break;
            }
            let is_stiff = self.patience > 0;
            let is_tame = halvings >= MOST_HALVINGS || way.is_tame(functions, ends);
            if !is_tame && enclosed.next().is_some() {
                left.extend(halves(ends, halvings));
                continue;
            }
            let found = match way.run.limit.over() {
                Some(over) => Err(Why::from(over)),
                None if !is_tame => Err(Why::Rough),
                None if is_stiff => self
                    .stiff
                    .part(functions, way, tangents, (ends, &self.points)),
                None => self.part(functions, (way, asked), tangents, ends),
            };
            let found = match found {
                Ok(found) => found,
                Err(why) => {
                    let all = (0..tangents.len()).filter(|&d| tangents[d].take().is_some());
                    lost.extend(all.map(|d| (d, why, way.mode.sliding.clone(), ends[0])));
                    break;
                }
            };
            let too_long: Vec<TooLong> = found
                .iter()
                .filter_map(|v| v.as_ref()?.as_ref().err().copied())
                .collect();
            if !too_long.is_empty() && halvings < MOST_HALVINGS {
                if !is_stiff && halvings >= STIFF && too_long.contains(&TooLong::Divergent) {
                    self.patience = PATIENCE;
                    left = vec![([ends[0], length], 0)];
                    continue;
                }
                left.extend(halves(ends, halvings));
                continue;
            }
            let mut part = Part {
                ends,
                values: Vec::new(),
            };
            for (d, values) in found.into_iter().enumerate() {
                let values = values.and_then(|values| match values {
                    Ok(values) => Some(values),
                    Err(_) => {
                        lost.push((d, Why::Rough, way.mode.sliding.clone(), ends[0]));
                        None
                    }
                });
                tangents[d] = values.as_ref().and_then(|values| values.last().cloned());
                part.values.push(values);
            }
            for (d, why, switches) in see(functions, self, &part) {
                tangents[d] = None;
                lost.push((d, why, switches, ends[0]));
            }
        }
        self.patience = self.patience.saturating_sub(1);
        lost
    }

    /// The values of a part of a step, by direction.
    fn part(
        &self,
        functions: &mut Functions,
        (way, asked): (Way, &[f64]),
        tangents: &[Option<Vec<f64>>],
        [a, b]: [f64; 2],
    ) -> Result<Vec<Option<Values>>, Why> {
        let next = asked.partition_point(|tau| *tau <= a);
        let mut at = |share: f64| way.linearize(functions, a + (b - a) * share);
        let nodes = self.tableau.nodes.iter();
        let nodes: Vec<Linearized> = nodes.map(|&c| at(c)).collect::<Result<_, Why>>()?;
        let checks = self.checks.iter().map(|check| at(check.share));
        let checks: Vec<Linearized> = checks.collect::<Result<_, Why>>()?;
        let shaken = way.shaken(functions, 0.5 * (a + b))?;
        let of = Collocation {
            method: self,
            functions,
            nodes: &nodes,
            checks: &checks,
            shaken: &shaken,
            h: b - a,
            tolerance: way.run.tolerance,
            everywhere: asked.get(next).is_some_and(|tau| *tau < b),
        };
        let values = tangents.iter().enumerate().map(|(d, tangent)| {
            let tangent = tangent.as_ref()?;
            Some(of.solve(tangent, way.sizes.tangents(d), d))
        });
        Ok(values.collect())
    }
}

/// The halves of a part, the first one last.
fn halves([a, b]: [f64; 2], halvings: usize) -> [([f64; 2], usize); 2] {
    let middle = 0.5 * (a + b);
    [([middle, b], halvings + 1), ([a, middle], halvings + 1)]
}

/// Σ_j w_j v_j.
fn combined(values: &[Vec<f64>], weights: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; values.first().map_or(0, Vec::len)];
    for (weight, values) in weights.iter().zip(values) {
        for (sum, value) in sum.iter_mut().zip(values) {
            *sum += weight * value;
        }
    }
    sum
}

/// |v - w|.
pub(super) fn difference(v: &[f64], w: &[f64]) -> Vec<f64> {
    v.iter().zip(w).map(|(v, w)| (v - w).abs()).collect()
}

/// The equations of a part of a step.
struct Collocation<'a, 'r> {
    method: &'a Variational,
    functions: &'a Functions<'r>,
    nodes: &'a [Linearized],
    checks: &'a [Linearized],
    /// In the middle, beside the run.
    shaken: &'a Linearized,
    h: f64,
    tolerance: f64,
    /// Whether S is asked for inside.
    everywhere: bool,
}

impl Collocation<'_, '_> {
    /// S of a direction, from how large its entries have been.
    fn solve(&self, tangent: &[f64], largest: impl Fn(usize) -> f64, d: usize) -> Values {
        let size = |k: usize| largest(k).max(tangent[k].abs());
        let sizes: Vec<f64> = (0..tangent.len()).map(size).collect();
        let noise = self.noise(tangent, d);
        let slopes = self.iterate(tangent, (&sizes, &noise), d)?;
        let tableau = &self.method.tableau;
        let inner = tableau.a.chunks(NODES);
        let mut values = vec![tangent.to_vec()];
        values.extend(inner.map(|row| self.moved(tangent, row, &slopes)));
        values.push(self.moved(tangent, &tableau.weights, &slopes));
        let n = tangent.len();
        let (mut missed, mut terms) = (vec![0.0; n], vec![0.0_f64; n]);
        let mut largest = vec![0.0_f64; n];
        for (check, linear) in self.method.checks.iter().zip(self.checks) {
            let s = combined(&values, &check.values);
            let rates = self.along(linear, &s, d);
            let slopes = combined(&slopes, &check.slopes);
            let own = linear.terms(self.functions, Moved::still(&s), d);
            for k in 0..n {
                let defect = slopes[k] - rates[k];
                missed[k] += check.integral * defect;
                largest[k] = crate::linalg::largest(&[largest[k], defect]);
                terms[k] = terms[k].max(own[k]);
            }
        }
        let is_small = |k: usize| {
            let size = values.iter().fold(sizes[k], |most, s| most.max(s[k].abs()));
            // Where an entry has been small so far, its size is that of what it is made of.
            let size = size / self.h + terms[k] + NOTHING;
            let known = ROUNDING * terms[k] + noise[k];
            // Inside of a part the defect is much larger than what it makes of the end.
            let inside = match self.everywhere {
                true => self.tolerance,
                false => self.tolerance.sqrt(),
            };
            missed[k].abs() <= self.tolerance * size + known && largest[k] <= inside * size + known
        };
        if !(0..n).all(is_small) {
            return Err(TooLong::Inexact);
        }
        Ok(values)
    }

    /// The slopes at the nodes.
    fn iterate(
        &self,
        tangent: &[f64],
        (sizes, noise): (&[f64], &[f64]),
        d: usize,
    ) -> Result<Vec<Vec<f64>>, TooLong> {
        let nodes = || self.nodes.iter();
        let mut slopes: Vec<Vec<f64>> = nodes().map(|node| self.along(node, tangent, d)).collect();
        let mut last = f64::INFINITY;
        for iteration in 0..MOST_ITERATIONS {
            let rows = self.method.tableau.a.chunks(NODES);
            let inner = rows.map(|row| self.moved(tangent, row, &slopes));
            let inner: Vec<Vec<f64>> = inner.collect();
            let next = nodes().zip(&inner).map(|(node, s)| self.along(node, s, d));
            let next: Vec<Vec<f64>> = next.collect();
            let mut change = 0.0_f64;
            for k in 0..tangent.len() {
                let within = inner.iter().map(|s| s[k].abs());
                let within = within.chain(next.iter().map(|slope| self.h * slope[k].abs()));
                let size = within.fold(sizes[k], f64::max) + self.h * noise[k] / self.tolerance;
                let size = size + NOTHING;
                let changes: [f64; NODES] =
                    std::array::from_fn(|i| self.h * (next[i][k] - slopes[i][k]));
                let own = crate::linalg::largest(&changes);
                let own = if own == 0.0 { 0.0 } else { own / size };
                change = crate::linalg::largest(&[change, own]);
            }
            slopes = next;
            if change <= 0.1 * self.tolerance {
                return Ok(slopes);
            }
            if !change.is_finite() || iteration >= FIRST && change > 0.8 * last {
                break;
            }
            last = change;
        }
        Err(TooLong::Divergent)
    }

    /// S₀ + h Σ_j w_j K_j.
    fn moved(&self, tangent: &[f64], weights: &[f64], slopes: &[Vec<f64>]) -> Vec<f64> {
        let sum = combined(slopes, weights).into_iter();
        let pairs = tangent.iter().zip(sum);
        pairs.map(|(s, sum)| s + self.h * sum).collect()
    }

    fn along(&self, linear: &Linearized, s: &[f64], d: usize) -> Vec<f64> {
        let [f, _] = linear.along(self.functions, Moved::still(s), d);
        f
    }

    /// What the error of the run and rounding make of the rates of a tangent, and of the rates that follow from these.
    fn noise(&self, tangent: &[f64], d: usize) -> Vec<f64> {
        const ROUNDS: usize = 3;
        let middle = &self.nodes[NODES / 2];
        let known = self.along(middle, tangent, d);
        let mut noise = difference(&known, &self.along(self.shaken, tangent, d));
        let terms = middle.terms(self.functions, Moved::still(tangent), d);
        for (noise, term) in noise.iter_mut().zip(terms) {
            *noise = noise.max(ROUNDING * term);
        }
        let rest = self.along(middle, &vec![0.0; tangent.len()], d);
        for _ in 0..ROUNDS {
            let moved: Vec<f64> = noise.iter().map(|noise| self.h * noise).collect();
            let more = difference(&self.along(middle, &moved, d), &rest);
            for (noise, more) in noise.iter_mut().zip(more) {
                *noise = noise.max(more);
            }
        }
        noise
    }
}

impl Way<'_> {
    /// The functions `tau` after the start of the step, where the run moves as they say.
    pub fn linearize(&self, functions: &mut Functions, tau: f64) -> Result<Linearized, Why> {
        const UNLIKE: f64 = 1e-3;
        const ROUNDING: f64 = 1e-9;
        let (n, m) = (functions.slots.n_states, functions.slots.n_switches);
        let (mut x, mut slope, mut alpha) = (vec![0.0; n], vec![0.0; n], vec![0.0; m]);
        self.step.state(tau, &mut x, &mut slope);
        self.step.alpha(tau, &mut alpha);
        let point = self.point(tau, &x, &alpha);
        let linear = functions
            .linearize(self.mode, &point)
            .map_err(|_| Why::Singular)?;
        let is_alike = |i: usize, more: f64| {
            let (f, slope) = (linear.f[i], slope[i]);
            let size = f.abs() + slope.abs() + x[i].abs() / self.step.length;
            let allowed = UNLIKE * size + ROUNDING * self.sizes.fastest[i] + more + NOTHING;
            (f - slope).abs() <= allowed
        };
        if !(0..n).all(|i| is_alike(i, 0.0)) {
            // Terms that cancel are known to the tolerance, and to what rounding leaves of them.
            let (accuracy, largest) = (10.0 * self.run.accuracy, &self.sizes.largest);
            let terms = linear.rates(
                functions.slots,
                |slot, slope| match slot {
                    slot if (1..=n).contains(&slot) => (slope * largest[slot - 1]).abs(),
                    _ => 0.0,
                },
                |_, slope| slope.abs(),
            );
            let rounded = functions.rounded(self.mode, &point);
            if !(0..n).all(|i| is_alike(i, accuracy * terms[i] + 16.0 * rounded[i])) {
                return Err(Why::Unknown);
            }
        }
        Ok(linear)
    }

    /// The functions beside the run, as far as its tolerance goes: tangents are no better known than what that makes of their
    /// rates.
    pub fn shaken(&self, functions: &mut Functions, tau: f64) -> Result<Linearized, Why> {
        let (n, m) = (functions.slots.n_states, functions.slots.n_switches);
        let (mut x, mut alpha) = (vec![0.0; n], vec![0.0; m]);
        self.step.state(tau, &mut x, &mut vec![0.0; n]);
        self.step.alpha(tau, &mut alpha);
        let mut share = 0.0_f64;
        for (x, size) in x.iter_mut().zip(&self.sizes.largest) {
            // Signs in proportions that do not cancel.
            share = (share + 0.618_033_988_749_895).fract();
            *x += self.run.accuracy * size * (2.0 * share - 1.0).signum();
        }
        let shaken = functions.linearize(self.mode, &self.point(tau, &x, &alpha));
        shaken.map_err(|_| Why::Singular)
    }

    /// Whether no derivative of the functions hides anything in a part of the step.
    fn is_tame(&self, functions: &mut Functions, [a, b]: [f64; 2]) -> bool {
        let (middle, radius) = (0.5 * (a + b), 0.5 * (b - a));
        let moving = |at: usize| {
            let row = self.step.row(at);
            let motion = series::motion(row, middle, radius);
            Ball::new(series::value(row, middle), motion)
        };
        let n = functions.slots.n_states;
        let mut alpha = vec![0.0; functions.slots.n_switches];
        self.step.alpha(middle, &mut alpha);
        let point = self.point(middle, &[], &alpha);
        let sliding = &self.mode.sliding;
        functions.are_tame(self.mode, |input| match input {
            Input::Time => Ball::new(point.t, radius),
            Input::State(i) => moving(i),
            Input::Alpha(switch) if sliding.contains(&switch) => moving(n + switch),
            _ => Ball::new(point.value(input), 0.0),
        })
    }

    /// A point of the step.
    pub fn point<'p>(&'p self, tau: f64, x: &'p [f64], alpha: &'p [f64]) -> Point<'p> {
        Point {
            t: self.step.start + tau,
            x,
            alpha,
            coefficients: self.coefficients,
            parameters: self.run.parameters,
        }
    }
}
