//! The solution by matrix exponentials, and the next mode by trying all of them.
//!
//! In a mode z' = M z with z = (x, 1, t), so z(t + τ) = exp(M τ) z(t). What ends a mode is the root
//! of a row times that: ψ of a side, 1 - s and 1 + s of a surface that slides.

use nalgebra::{DMatrix, DVector, RowDVector};

use super::{Affine, Kind};

/// -1 below, 0 sliding, 1 above; one for each surface.
pub type Sides = Vec<i8>;

/// The time in one mode.
#[derive(Clone, Debug)]
pub struct Leg {
    /// When it begins.
    pub start: f64,
    /// The mode.
    pub sides: Sides,
    /// |rate| of what ended the mode before, relative to the sizes of what it is made of: how much
    /// of an error of the states becomes one of `start`. 0 of the first leg.
    pub transversality: f64,
    z: DVector<f64>,
    matrix: DMatrix<f64>,
}

/// How a solution ends.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum End {
    /// At the horizon.
    Horizon,
    /// At this time, where this many solutions go on.
    Branches(f64, usize),
    /// More events than anyone waits for.
    Events(f64),
    /// On a surface whose sliding mode is not affine, or at an event too flat for the search.
    Unsuitable,
}

/// The solution of a system.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Its modes, in order.
    pub legs: Vec<Leg>,
    /// How it ends.
    pub end: End,
    /// Largest difference between one exponential over a leg and the product of many over its
    /// parts, relative to the state: what rounding does.
    pub rounding: f64,
}

/// Events after which a solution is given up.
const MAX_EVENTS: usize = 200;

/// Below this, relative to its terms, a number is zero.
const ZERO: f64 = 1e-9;

/// Derivatives looked at where the first ones vanish.
const MAX_DERIVATIVES: usize = 6;

/// A linear mode, with what must stay positive in it.
struct Mode {
    matrix: DMatrix<f64>,
    watched: Vec<Watched>,
}

struct Watched {
    surface: usize,
    row: RowDVector<f64>,
}

/// Solves a system over its horizon.
pub fn solve(system: &Affine) -> Solution {
    let mut z = DVector::zeros(system.n + 2);
    z.rows_mut(0, system.n).copy_from(&system.start);
    z[system.n] = 1.0;
    let mut solution = Solution {
        legs: Vec::new(),
        end: End::Horizon,
        rounding: 0.0,
    };
    let (mut t, mut transversality) = (0.0, 0.0);
    let mut sides: Sides = (system.surfaces.iter())
        .map(|surface| if surface.normal.dot(&z) < 0.0 { -1 } else { 1 })
        .collect();
    let mut decide = meeting(system, &sides, &z);
    loop {
        if !decide.is_empty() {
            let found = consistent(system, &sides, &decide, &z);
            let [found] = &found[..] else {
                solution.end = End::Branches(t, found.len());
                return solution;
            };
            sides.clone_from(found);
        }
        let unsuitable = |(side, kind): (&i8, Kind)| *side == 0 && kind == Kind::Cross;
        let kinds = system.surfaces.iter().map(|surface| surface.kind);
        let mode = mode(system, &sides, &z);
        let (Some(mode), false) = (mode, sides.iter().zip(kinds).any(unsuitable)) else {
            solution.end = End::Unsuitable;
            return solution;
        };
        solution.legs.push(Leg {
            start: t,
            sides: sides.clone(),
            transversality,
            z: z.clone(),
            matrix: mode.matrix.clone(),
        });
        let remaining = system.horizon - t;
        let (event, rounding) = match mode.first_event(&z, remaining) {
            Ok(found) => found,
            Err(Flat) => {
                solution.end = End::Unsuitable;
                return solution;
            }
        };
        solution.rounding = solution.rounding.max(rounding);
        let Some((tau, surface, rate)) = event else {
            return solution;
        };
        if solution.legs.len() > MAX_EVENTS {
            solution.end = End::Events(t);
            return solution;
        }
        z = (&mode.matrix * tau).exp() * z;
        t += tau;
        transversality = rate;
        decide = meeting(system, &sides, &z);
        decide.extend([surface]);
        decide.sort_unstable();
        decide.dedup();
        // What slides goes on where its rate has nothing to do with what changes.
        let linked = interacting(system, &decide, surface);
        decide.retain(|i| sides[*i] != 0 || linked.contains(i));
    }
}

/// The surfaces among some that a first one interacts with: the sign of one occurs in the rate of the
/// other.
fn interacting(system: &Affine, among: &[usize], first: usize) -> Vec<usize> {
    let acts_on = |j: usize, i: usize| {
        let normal = system.surfaces[i].normal.rows(0, system.n).transpose();
        (normal * &system.surfaces[j].jump).amax() > 0.0
    };
    let mut found = vec![first];
    let mut next = 0;
    while next < found.len() {
        let i = found[next];
        for &j in among {
            if !found.contains(&j) && (acts_on(i, j) || acts_on(j, i)) {
                found.push(j);
            }
        }
        next += 1;
    }
    found
}

impl Solution {
    /// The states at a time before the end.
    pub fn state(&self, t: f64) -> DVector<f64> {
        let after = self.legs.partition_point(|leg| leg.start <= t).max(1);
        let leg = &self.legs[after - 1];
        let z = (&leg.matrix * (t - leg.start)).exp() * &leg.z;
        z.rows(0, z.len() - 2).into_owned()
    }
}

/// Surfaces that slide, or hold the state.
fn meeting(system: &Affine, sides: &Sides, z: &DVector<f64>) -> Vec<usize> {
    let on = |&i: &usize| {
        let normal = &system.surfaces[i].normal;
        sides[i] == 0 || normal.dot(z).abs() <= 1e-3 * ZERO * normal.abs().dot(&z.abs())
    };
    (0..sides.len()).filter(on).collect()
}

/// M of a mode that holds at z, and what is watched in it; nothing where s is not determined.
///
/// On surfaces K, ψ_K' = C (F z + Σ_{i∉K} s_i J_i z) + ∂ψ_K/∂t + Σ_{j∈K} C d_j s_j = 0 gives s_K.
fn mode(system: &Affine, sides: &Sides, z: &DVector<f64>) -> Option<Mode> {
    let (n, size) = (system.n, system.n + 2);
    let mut matrix = DMatrix::zeros(size, size);
    matrix.rows_mut(0, n).copy_from(&system.field);
    matrix[(n + 1, n)] = 1.0;
    for (surface, &side) in system.surfaces.iter().zip(sides) {
        let mut rows = matrix.rows_mut(0, n);
        rows += f64::from(side) * &surface.jump;
    }
    let sliding: Vec<usize> = (0..sides.len()).filter(|&i| sides[i] == 0).collect();
    let k = sliding.len();
    let normals = DMatrix::from_fn(k, size, |row, j| system.surfaces[sliding[row]].normal[j]);
    let jumps = DMatrix::from_fn(size, k, |row, j| {
        if row < n {
            system.surfaces[sliding[j]].jump_on_it(row, z)
        } else {
            0.0
        }
    });
    let mut signs = DMatrix::zeros(k, size);
    if k > 0 {
        let gains = (&normals * &jumps).lu();
        if gains.determinant().abs() <= ZERO {
            return None;
        }
        signs = -gains.solve(&(&normals * &matrix))?;
        matrix += &jumps * &signs;
    }

    let mut watched = Vec::new();
    for (i, &side) in sides.iter().enumerate() {
        match sliding.iter().position(|&j| j == i) {
            Some(place) => {
                for bound in [-1.0, 1.0] {
                    // 1 - s and 1 + s
                    let mut row = bound * signs.row(place).into_owned();
                    row[n] += 1.0;
                    watched.push(Watched { surface: i, row });
                }
            }
            None => watched.push(Watched {
                surface: i,
                row: f64::from(side) * system.surfaces[i].normal.transpose(),
            }),
        }
    }
    Some(Mode { matrix, watched })
}

/// The modes that are consistent with their own motion from z on, one for each solution.
fn consistent(system: &Affine, sides: &Sides, decide: &[usize], z: &DVector<f64>) -> Vec<Sides> {
    let mut found: Vec<(Sides, Mode)> = Vec::new();
    for choice in 0..3_usize.pow(decide.len() as u32) {
        let mut candidate = sides.clone();
        for (place, &i) in decide.iter().enumerate() {
            candidate[i] = (choice / 3_usize.pow(place as u32) % 3) as i8 - 1;
        }
        let Some(mode) = mode(system, &candidate, z) else {
            continue;
        };
        let decided = |watched: &&Watched| decide.contains(&watched.surface);
        let stays = |watched: &Watched| {
            let on_surface = candidate[watched.surface] != 0;
            mode.sign(&watched.row, z, usize::from(on_surface)) >= 0
        };
        if mode.watched.iter().filter(decided).all(stays)
            && !found.iter().any(|(_, other)| other.moves_like(&mode, z))
        {
            found.push((candidate, mode));
        }
    }
    found.into_iter().map(|(sides, _)| sides).collect()
}

/// Something comes too close to an event to say whether it is one.
struct Flat;

/// Time from the start of the mode, surface, and relative rate; then what rounding did.
type Found = (Option<(f64, usize, f64)>, f64);

impl Mode {
    /// Sign of row z, or of the first derivative from `order` on that does not vanish; 0 if all do.
    fn sign(&self, row: &RowDVector<f64>, z: &DVector<f64>, order: usize) -> i8 {
        let (mut value, mut size) = (z.clone(), z.abs());
        let sizes = self.matrix.abs();
        for k in 0..=MAX_DERIVATIVES {
            if k >= order {
                let (value, size) = ((row * &value)[0], (row.abs() * &size)[0]);
                if value.abs() > ZERO * size {
                    return if value > 0.0 { 1 } else { -1 };
                }
            }
            value = &self.matrix * value;
            size = &sizes * size;
        }
        0
    }

    /// True when the states move alike, to the third derivative.
    fn moves_like(&self, other: &Mode, z: &DVector<f64>) -> bool {
        let (mut a, mut b) = (z.clone(), z.clone());
        (0..3).all(|_| {
            (a, b) = (&self.matrix * &a, &other.matrix * &b);
            (&a - &b).amax() <= ZERO * a.amax().max(b.amax())
        })
    }

    /// exp(M τ) z
    fn flow(&self, z: &DVector<f64>, tau: f64) -> DVector<f64> {
        (&self.matrix * tau).exp() * z
    }

    /// The root of row exp(M τ) z between two times at which it has different signs, by Newton's
    /// method within the bracket.
    fn root(&self, row: &RowDVector<f64>, z: &DVector<f64>, mut low: f64, mut high: f64) -> f64 {
        let sign = (row * self.flow(z, high))[0].signum();
        let mut tau = 0.5 * (low + high);
        for _ in 0..100 {
            let at = self.flow(z, tau);
            let value = (row * &at)[0];
            if value * sign > 0.0 {
                high = tau;
            } else {
                low = tau;
            }
            let newton = tau - value / (row * &self.matrix * &at)[0];
            let inside = newton > low && newton < high;
            let next = if inside { newton } else { 0.5 * (low + high) };
            if (next - tau).abs() <= f64::EPSILON * high {
                return next;
            }
            tau = next;
        }
        tau
    }

    /// The first root of what is watched, up to a time.
    ///
    /// The flow is sampled at steps in which no exponential turns by more than a fraction of a
    /// radian. A pair of roots between two samples shows as a minimum between them.
    fn first_event(&self, z: &DVector<f64>, until: f64) -> Result<Found, Flat> {
        let step = 0.05 / self.matrix.amax().max(1.0);
        let steps = (until / step).ceil().max(1.0);
        let step = until / steps;
        let propagate = (&self.matrix * step).exp();
        let slopes: Vec<RowDVector<f64>> = (self.watched.iter())
            .map(|watched| &watched.row * &self.matrix)
            .collect();
        let mut before = z.clone();
        let mut scale = before.abs();
        let reach = step * self.matrix.abs();
        for k in 0..steps as usize {
            let after = &propagate * &before;
            let sizes = before.abs() + &reach * before.abs();
            let (from, to) = (k as f64 * step, (k + 1) as f64 * step);
            let mut first: Option<(f64, usize)> = None;
            for (watched, slope) in self.watched.iter().zip(&slopes) {
                let row = &watched.row;
                let at = |row: &RowDVector<f64>, tau: f64| (row * self.flow(z, tau))[0];
                let size = (row.abs() * &sizes)[0];
                let (mut low, mut high) = (from, to);
                let (mut start, mut falls) = ((row * &before)[0], (slope * &before)[0] < 0.0);
                if k == 0 && start.abs() <= ZERO * size {
                    // It has been decided that it grows at first.
                    low = 1e-3 * step;
                    (start, falls) = (at(row, low), at(slope, low) < 0.0);
                }
                if start <= 0.0 {
                    return Err(Flat);
                }
                if (row * &after)[0] > 0.0 {
                    if !falls || (slope * &after)[0] < 0.0 {
                        continue;
                    }
                    // The least value in between.
                    high = self.root(slope, z, low, high);
                    let least = at(row, high);
                    if least.abs() <= ZERO * size {
                        return Err(Flat);
                    }
                    if least > 0.0 {
                        continue;
                    }
                }
                let root = self.root(row, z, low, high);
                if first.is_none_or(|(tau, _)| root < tau) {
                    first = Some((root, watched.surface));
                }
            }
            scale = scale.zip_map(&after, |a, b| a.max(b.abs()));
            if let Some((tau, surface)) = first {
                let end = self.flow(z, tau);
                let chain = self.flow(&before, tau - from);
                let slope = |(watched, slope): (&Watched, &RowDVector<f64>)| {
                    let size = (watched.row.abs() * &scale)[0];
                    (watched.surface == surface).then(|| (slope * &end)[0].abs() / size)
                };
                let rate = self.watched.iter().zip(&slopes).filter_map(slope);
                let rate = rate.fold(0.0, f64::max);
                return Ok((Some((tau, surface, rate)), difference(&end, &chain, &scale)));
            }
            before = after;
        }
        let end = self.flow(z, until);
        Ok((None, difference(&end, &before, &scale)))
    }
}

/// Largest difference, relative to the largest magnitudes.
fn difference(a: &DVector<f64>, b: &DVector<f64>, scale: &DVector<f64>) -> f64 {
    let relative = |i: usize| (a[i] - b[i]).abs() / scale[i].max(f64::MIN_POSITIVE);
    (0..a.len() - 2).map(relative).fold(0.0, f64::max)
}
