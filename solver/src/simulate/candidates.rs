//! Choices of sides worth judging where surfaces meet.
//!
//! Up to six surfaces that interact, all 3^|I| choices are tried with every α that keeps the
//! sliding ones in place, which finds every solution. Beyond, Lemke's method finds one, and where
//! -∂φ/∂α is no P-matrix, other starts of the method look for more.

use super::judge::TIE;
use super::mode::Mode;
use super::select::{Choice, Choices};
use super::state::State;
use super::{Side, Simulator, SwitchedSystem};
use crate::lcp;
use crate::linalg::DenseLu;

/// Beyond this many interacting surfaces, Lemke's method replaces enumeration.
const MAX_ENUMERATED: usize = 6;

/// α and rates this close to their bounds after Lemke's method are tried on both sides.
const NEAR: f64 = 1e-7;

/// Starts of Lemke's method where one solution may not be the only one.
const MAX_STARTS: usize = 32;

/// Boxes looked at for the zeros of rates that contain products of α.
const MAX_BOXES: usize = 4000;

/// Halvings of the unit cube before Newton's method takes over.
const MAX_DEPTH: usize = 4;

impl<S: SwitchedSystem> Simulator<'_, S> {
    /// All choices of sides with their α.
    pub(super) fn choices(&mut self, free: usize, state: &State, group: &[usize]) -> Choices {
        let options: Vec<Vec<Side>> = group.iter().map(|&i| self.options(state, i)).collect();
        let candidates = if group.len() > MAX_ENUMERATED {
            self.pivots(free, state, group, &options)
        } else {
            product(&options)
        };
        let mut choices = Choices {
            found: Vec::new(),
            singular: false,
        };
        for candidate in candidates {
            let complete = self.solve(free, state, group, &candidate, &mut choices.found);
            choices.singular |= !complete;
        }
        choices
    }

    /// The sides of a switch on its surface, the present one first.
    fn options(&self, state: &State, switch: usize) -> Vec<Side> {
        let mut options = vec![Side::Minus, Side::Plus];
        if !self.system.is_continuous(switch) {
            options.push(Side::Slide);
        }
        if let Some(present) = options.iter().position(|side| *side == state.sides[switch]) {
            options.swap(0, present);
        }
        options
    }

    /// Solutions by Lemke's method, with the alternatives where a rate vanishes at a bound of α.
    fn pivots(
        &mut self,
        free: usize,
        state: &State,
        group: &[usize],
        options: &[Vec<Side>],
    ) -> Vec<Vec<Side>> {
        let mode = &mut self.modes[free];
        let found: Result<Vec<usize>, _> = group
            .iter()
            .map(|i| mode.sliding.binary_search(i))
            .collect();
        let Ok(at) = found else {
            return Vec::new();
        };
        let mut problem = Problem {
            mode,
            state,
            group,
            at,
        };
        let mut candidates: Vec<Vec<Side>> = Vec::new();
        let unique = problem.is_unique();
        let starts = if unique { 1 } else { MAX_STARTS };
        for start in 0..starts {
            let Some(sides) = problem.pivot(start, options) else {
                continue;
            };
            let mut near: Vec<Vec<Side>> = product(&sides);
            near.retain(|sides| !candidates.contains(sides));
            candidates.extend(near);
        }
        candidates
    }

    /// Adds every solution of φ_S = 0 for the sliding switches S of a candidate; false where that
    /// is singular.
    fn solve(
        &mut self,
        free: usize,
        state: &State,
        group: &[usize],
        sides: &[Side],
        found: &mut Vec<Choice>,
    ) -> bool {
        let mode = &mut self.modes[free];
        let mut alpha = state.alpha.clone();
        let mut unknowns = Vec::new();
        for (&i, &side) in group.iter().zip(sides) {
            alpha[i] = match side {
                Side::Minus => 0.0,
                Side::Plus => 1.0,
                Side::Slide => {
                    let Ok(at) = mode.sliding.binary_search(&i) else {
                        return false;
                    };
                    unknowns.push((i, at));
                    if state.sides[i] == Side::Slide {
                        alpha[i]
                    } else {
                        0.5
                    }
                }
            };
        }
        let mut zeros = Zeros {
            mode,
            state,
            alpha,
            unknowns,
            found: Vec::new(),
        };
        let complete = zeros.find();
        let (solutions, mut alpha, unknowns) = (zeros.found, zeros.alpha, zeros.unknowns);
        for solution in solutions {
            for (&(i, _), a) in unknowns.iter().zip(solution) {
                alpha[i] = a;
            }
            mode.eval(state.t, &state.x, &alpha);
            found.push(Choice {
                sides: sides.to_vec(),
                alpha: group.iter().map(|&i| alpha[i]).collect(),
                f: mode.f().to_vec(),
            });
        }
        complete
    }
}

/// Every combination of one option each.
fn product(options: &[Vec<Side>]) -> Vec<Vec<Side>> {
    options.iter().fold(vec![Vec::new()], |prefixes, options| {
        let extend = |prefix: Vec<Side>| {
            options
                .iter()
                .map(move |&side| [prefix.as_slice(), &[side]].concat())
        };
        prefixes.into_iter().flat_map(extend).collect()
    })
}

/// The zeros of φ_S(α_S) in the unit cube.
struct Zeros<'m> {
    mode: &'m mut Mode,
    state: &'m State,
    /// Of all switches; the unknown ones start where Newton's method does.
    alpha: Vec<f64>,
    /// The switches S and their places among the sliding ones.
    unknowns: Vec<(usize, usize)>,
    found: Vec<Vec<f64>>,
}

impl Zeros<'_> {
    /// Finds them; false where the equations are singular.
    fn find(&mut self) -> bool {
        let start = self.values();
        if self.unknowns.is_empty() {
            self.found.push(start);
            return true;
        }
        if self.unknowns.len() == 1 || self.is_affine() {
            return self.newton(&start);
        }
        self.subdivide();
        true
    }

    fn values(&self) -> Vec<f64> {
        self.unknowns.iter().map(|&(i, _)| self.alpha[i]).collect()
    }

    fn set(&mut self, values: &[f64]) {
        for (&(i, _), &value) in self.unknowns.iter().zip(values) {
            self.alpha[i] = value;
        }
        self.mode.eval(self.state.t, &self.state.x, &self.alpha);
    }

    fn matrix(&mut self) -> Vec<f64> {
        self.mode.linearize();
        let mut matrix = Vec::new();
        for &(_, row) in &self.unknowns {
            let row = self
                .unknowns
                .iter()
                .map(|&(_, col)| self.mode.coupling(row, col));
            matrix.extend(row);
        }
        matrix
    }

    /// True when ∂φ/∂α is the same at three corners in general position.
    fn is_affine(&mut self) -> bool {
        let k = self.unknowns.len();
        let mut matrices = Vec::new();
        for corner in [0.0, 1.0, 0.35] {
            let values: Vec<f64> = (0..k).map(|i| corner * (1.0 + 0.1 * i as f64)).collect();
            self.set(&values);
            matrices.push(self.matrix());
        }
        let scale = matrices[0].iter().chain(&matrices[1]);
        let scale = scale.fold(0.0_f64, |m, v| m.max(v.abs()));
        let same = |other: &Vec<f64>| {
            let mut pairs = matrices[0].iter().zip(other);
            pairs.all(|(a, b)| (a - b).abs() <= 1e-12 * scale)
        };
        matrices[1..].iter().all(same)
    }

    /// Newton's method; false where it meets a singular matrix.
    fn newton(&mut self, start: &[f64]) -> bool {
        let k = self.unknowns.len();
        let (mut lu, mut rhs) = (DenseLu::new(k), vec![0.0; k]);
        let mut values = start.to_vec();
        self.set(&values);
        for _ in 0..30 {
            let matrix = self.matrix();
            for (rhs, &(_, row)) in rhs.iter_mut().zip(&self.unknowns) {
                *rhs = self.mode.phi()[row];
            }
            if lu.factor(&matrix).is_err() {
                return false;
            }
            lu.solve(&mut rhs);
            let mut change = 0.0_f64;
            for (value, delta) in values.iter_mut().zip(&rhs) {
                *value -= delta;
                change = change.max(delta.abs() / (1.0 + value.abs()));
            }
            self.set(&values);
            if change <= 1e-13 {
                let known = |other: &Vec<f64>| {
                    let mut pairs = other.iter().zip(&values);
                    pairs.all(|(a, b)| (a - b).abs() <= 1e-9)
                };
                if !self.found.iter().any(known) {
                    self.found.push(values);
                }
                return true;
            }
            // NaN, or far outside.
            if change.is_nan() || values.iter().any(|value| value.abs() > 1e6) {
                break;
            }
        }
        true
    }

    /// All zeros of rates with products of α: a multi-affine function has its extremes over a box at
    /// the corners, so that corners of one sign prove that the box holds none.
    fn subdivide(&mut self) {
        let k = self.unknowns.len();
        let outside = 2.0 * TIE;
        let mut boxes = vec![(vec![-outside; k], 1.0 + 2.0 * outside, 0)];
        let mut looked_at = 0;
        while let Some((corner, width, depth)) = boxes.pop() {
            looked_at += 1;
            if looked_at > MAX_BOXES {
                break;
            }
            if self.has_no_zero(&corner, width) {
                continue;
            }
            if depth == MAX_DEPTH || looked_at + (1 << k) > MAX_BOXES {
                let middle: Vec<f64> = corner.iter().map(|c| c + 0.5 * width).collect();
                self.newton(&middle);
                continue;
            }
            let half = 0.5 * width;
            for octant in 0..1_usize << k {
                let shift = |(i, c): (usize, &f64)| c + half * f64::from(octant >> i & 1 == 1);
                boxes.push((
                    corner.iter().enumerate().map(shift).collect(),
                    half,
                    depth + 1,
                ));
            }
        }
    }

    fn has_no_zero(&mut self, corner: &[f64], width: f64) -> bool {
        let k = self.unknowns.len();
        let (mut least, mut largest) = (vec![f64::INFINITY; k], vec![f64::NEG_INFINITY; k]);
        for at in 0..1_usize << k {
            let shift = |(i, c): (usize, &f64)| c + width * f64::from(at >> i & 1 == 1);
            let values: Vec<f64> = corner.iter().enumerate().map(shift).collect();
            self.set(&values);
            for (j, &(_, row)) in self.unknowns.iter().enumerate() {
                least[j] = least[j].min(self.mode.phi()[row]);
                largest[j] = largest[j].max(self.mode.phi()[row]);
            }
        }
        let mut ranges = least.iter().zip(&largest);
        ranges.any(|(least, largest)| *least > 0.0 || *largest < 0.0)
    }
}

/// φ = b + Aα on the surfaces of a group.
struct Problem<'m> {
    mode: &'m mut Mode,
    state: &'m State,
    group: &'m [usize],
    /// Places of the group among the sliding switches.
    at: Vec<usize>,
}

impl Problem<'_> {
    /// -A, with every row divided by its size.
    fn matrix(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.group.len();
        let mut matrix = vec![0.0; n * n];
        let mut sizes = vec![1.0; n];
        for row in 0..n {
            for col in 0..n {
                matrix[row * n + col] = -self.mode.coupling(self.at[row], self.at[col]);
            }
            let row_of = &mut matrix[row * n..(row + 1) * n];
            let size = row_of.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            sizes[row] = size.max(self.mode.phi()[self.at[row]].abs());
            if sizes[row] == 0.0 {
                sizes[row] = 1.0;
            }
            row_of.iter_mut().for_each(|v| *v /= sizes[row]);
        }
        (matrix, sizes)
    }

    /// True when -A is proved to be a P-matrix here, so that there is exactly one solution.
    fn is_unique(&mut self) -> bool {
        self.mode
            .eval(self.state.t, &self.state.x, &self.state.alpha);
        self.mode.linearize();
        let (matrix, _) = self.matrix();
        lcp::is_p_matrix(&matrix, self.group.len()) == Some(true)
    }

    /// One solution by Lemke's method, relinearized until the sides repeat: the sides of every
    /// switch, several where a rate vanishes at a bound of α.
    ///
    /// w = Mz + q with z = (α, p), w = (n, 1 - α), M = (-A I; -I 0), q = (-b, e).
    fn pivot(&mut self, start: usize, options: &[Vec<Side>]) -> Option<Vec<Vec<Side>>> {
        let n = self.group.len();
        let mut alpha = self.state.alpha.clone();
        let mut last = Vec::new();
        for _ in 0..20 {
            self.mode.eval(self.state.t, &self.state.x, &alpha);
            self.mode.linearize();
            let (matrix, sizes) = self.matrix();
            let size = 2 * n;
            let mut m = vec![0.0; size * size];
            let (mut q, mut cover) = (vec![1.0; size], vec![1.0; size]);
            for row in 0..n {
                let mut b = self.mode.phi()[self.at[row]] / sizes[row];
                for col in 0..n {
                    let entry = matrix[row * n + col];
                    b += entry * alpha[self.group[col]];
                    m[row * size + col] = entry;
                    cover[row] += entry.abs();
                }
                m[row * size + n + row] = 1.0;
                m[(n + row) * size + row] = -1.0;
                q[row] = -b;
            }
            // Other covering vectors lead along other paths.
            let mut share = 0.37 * start as f64;
            for entry in cover.iter_mut().filter(|_| start > 0) {
                share = (share + 0.618_033_988_749_895).fract();
                *entry *= 1.0 + 30.0 * share * share;
            }
            let z = lcp::lemke(&m, &q, &cover).ok()?;
            let rate = |row: usize| {
                let terms = (0..n).map(|col| matrix[row * n + col] * z[col]);
                -q[row] - terms.sum::<f64>()
            };
            let sides: Vec<Vec<Side>> = (0..n)
                .map(|row| nearest(z[row], rate(row), &options[row]))
                .collect();
            for (&i, &a) in self.group.iter().zip(&z) {
                alpha[i] = a;
            }
            if sides == last {
                break;
            }
            last = sides;
        }
        // Everything at once undecided is more than can be tried: keep the nearest.
        let mut open = 0;
        for sides in &mut last {
            open += usize::from(sides.len() > 1);
            if open > MAX_ENUMERATED {
                sides.truncate(1);
            }
        }
        Some(last)
    }
}

/// The sides α and its rate stand for, of those a switch has.
fn nearest(alpha: f64, rate: f64, options: &[Side]) -> Vec<Side> {
    let side = if alpha <= TIE {
        Side::Minus
    } else if alpha >= 1.0 - TIE {
        Side::Plus
    } else {
        Side::Slide
    };
    let slides = options.contains(&Side::Slide);
    if !slides {
        // α of a continuous switch does not matter: its rate decides.
        return match rate {
            rate if rate.abs() <= NEAR => options.to_vec(),
            rate => vec![Side::of(rate)],
        };
    }
    let mut sides = vec![side];
    if rate.abs() <= NEAR {
        let other = if side != Side::Slide {
            Some(Side::Slide)
        } else if alpha <= NEAR {
            Some(Side::Minus)
        } else if alpha >= 1.0 - NEAR {
            Some(Side::Plus)
        } else {
            None
        };
        sides.extend(other);
    }
    sides
}
