//! Stationarity classes of a point by its multipliers.
//!
//! With the reduced gradient r = ∇f + Jᵀy, where y is zero for rows that are not active and has the sign of the bound
//! for inequalities, a point is weakly stationary when r_i = 0 for variables strictly between their bounds, r_i >= 0
//! at lower and r_i <= 0 at upper bounds, and r_i is anything for a side whose other side is positive. The multipliers
//! ν_a = r_a and ν_b = r_b of the biactive pairs make the difference (Scheel and Scholtes 2000, section 2; Ye 2005):
//!
//! - W: any ν_a and ν_b,
//! - A: ν_a >= 0 or ν_b >= 0,
//! - C: ν_a ν_b >= 0,
//! - M: ν_a ν_b = 0 or both are positive,
//! - S: ν_a >= 0 and ν_b >= 0.
//!
//! Where multipliers are not unique a class needs *one* y that has its signs for all pairs. It is looked for by
//! branching over the pairs, each node a linear program: minimize the largest violation e over y. A point belongs to
//! the class when e is at most the tolerance times max(1, |∇f|).

use super::least::LeastNorm;
use crate::optimization::mpcc::certificate::Tolerances;
use crate::optimization::mpcc::lift::Lifted;
use crate::optimization::mpcc::linear::{LinearProgram, Outcome, solve};
use crate::optimization::mpcc::local::{Local, Sets};
use crate::optimization::problem::Nlp;

/// A stationarity class, the strongest last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// Not even weakly stationary.
    #[default]
    None,
    /// Weakly stationary.
    W,
    /// Alternatively stationary.
    A,
    /// Clarke stationary.
    C,
    /// Mordukhovich stationary.
    M,
    /// Strongly stationary, and therefore B-stationary.
    S,
}

/// A class with the multipliers that show it.
#[derive(Clone, Debug)]
pub struct Classified {
    /// The strongest class found.
    pub class: Class,
    /// y of that class.
    pub y: Vec<f64>,
    /// Whether all stronger classes are excluded, that is, no search met its limit.
    pub is_exact: bool,
}

/// The cone that a multiplier is in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cone {
    Zero,
    Positive,
    Negative,
    Free,
}

/// What is asked of r_i of the variables, and of y of the rows.
struct Conditions<'a> {
    local: &'a Local,
    pairs: &'a [[u32; 2]],
    biactive: &'a [usize],
    /// The cone of r for every variable that is in no biactive pair.
    variables: Vec<Cone>,
    /// How far they are from their lower and upper bounds.
    distances: Vec<[f64; 2]>,
    rows: Vec<Cone>,
    tolerances: &'a Tolerances,
    tolerance: f64,
}

/// How many linear programs the search for one class may take.
const NODE_LIMIT: usize = 100;
/// How often multipliers of least norm are asked for.
const LEAST_ROUNDS: usize = 4;
/// Multipliers beyond this, times max(1, |∇f|), are none.
const LARGEST_MULTIPLIER: f64 = 1e8;

/// The class of a point; `y` are multipliers to try first.
pub fn classify(
    lifted: &Lifted<'_>,
    local: &Local,
    sets: &Sets,
    y: &[f64],
    tolerances: &Tolerances,
) -> Classified {
    let conditions = Conditions::new(lifted, local, sets, tolerances);
    let (of_these, y) = conditions.best_of_least(y);
    let mut best = Classified {
        class: of_these,
        y,
        is_exact: of_these == Class::S,
    };
    if best.is_exact {
        return best;
    }
    best.is_exact = true;
    // With no biactive pair there is one class only.
    let classes: &[Class] = match sets.biactive.len() {
        0 => &[Class::S],
        _ => &[Class::S, Class::M, Class::C, Class::A, Class::W],
    };
    for &class in classes.iter().filter(|class| **class > of_these) {
        match conditions.search(class) {
            Search::Found(y) => {
                best.class = class;
                best.y = y;
                return best;
            }
            Search::Excluded => {}
            Search::Undecided => best.is_exact = false,
        }
    }
    best
}

/// Multipliers of a point that are nearest to each of these, whatever their signs at bounds that are active.
pub fn nearest<const N: usize>(
    lifted: &Lifted<'_>,
    local: &Local,
    sets: &Sets,
    points: [Vec<f64>; N],
    tolerances: &Tolerances,
) -> Option<[Vec<f64>; N]> {
    let conditions = Conditions::new(lifted, local, sets, tolerances);
    let (cones, rows) = (conditions.strong_cones(), &conditions.rows);
    let is_zero: Vec<bool> = cones.iter().map(|&cone| cone == Cone::Zero).collect();
    let is_without: Vec<bool> = rows.iter().map(|&cone| cone == Cone::Zero).collect();
    let mut least = LeastNorm::new(
        local,
        |i| is_zero[i],
        |row| !is_without[row],
        &tolerances.analyses,
    );
    least.factor(&is_zero, &is_without)?;
    Some(points.map(|mut y| {
        for (y, is_without) in y.iter_mut().zip(&is_without) {
            *y *= f64::from(u8::from(!is_without));
        }
        least.nearest(y, &is_zero)
    }))
}

enum Search {
    Found(Vec<f64>),
    Excluded,
    Undecided,
}

impl<'a> Conditions<'a> {
    fn new(
        lifted: &'a Lifted<'_>,
        local: &'a Local,
        sets: &'a Sets,
        tolerances: &'a Tolerances,
    ) -> Self {
        let cone = |value: f64, lower: f64, upper: f64| {
            let reach = tolerances.active * value.abs().max(1.0);
            match (value - lower <= reach, upper - value <= reach) {
                (false, false) => Cone::Zero,
                (true, false) => Cone::Positive,
                (false, true) => Cone::Negative,
                (true, true) => Cone::Free,
            }
        };
        let bounds = lifted.variable_bounds();
        let variable = |i: usize| match sets.fixed[i] {
            true => Cone::Free,
            false => cone(local.w[i], bounds.lower[i], bounds.upper[i]),
        };
        let variables = (0..local.w.len()).map(variable).collect();
        let distance = |i: usize| [local.w[i] - bounds.lower[i], bounds.upper[i] - local.w[i]];
        let distances = (0..local.w.len()).map(distance).collect();
        let bounds = lifted.row_bounds();
        // y has the opposite sign: the Lagrangian has + yᵀc.
        let rows = (0..local.rows.len()).map(|row| {
            match cone(local.rows[row], bounds.lower[row], bounds.upper[row]) {
                Cone::Positive => Cone::Negative,
                Cone::Negative => Cone::Positive,
                other => other,
            }
        });
        Conditions {
            local,
            pairs: lifted.pairs(),
            biactive: &sets.biactive,
            variables,
            distances,
            rows: rows.collect(),
            tolerances,
            tolerance: tolerances.stationarity * local.scale,
        }
    }

    fn is_in(&self, cone: Cone, value: f64) -> bool {
        match cone {
            Cone::Zero => value.abs() <= self.tolerance,
            Cone::Positive => value >= -self.tolerance,
            Cone::Negative => value <= self.tolerance,
            Cone::Free => true,
        }
    }

    /// Whether the way of a variable along -r to its bound decreases f by next to nothing.
    fn gains_little(&self, i: usize, r: f64) -> bool {
        let [down, up] = self.distances[i];
        let distance = if r > 0.0 { down } else { up };
        self.variables[i] == Cone::Zero
            && r.abs() * distance <= self.tolerances.gain * self.local.scale
    }

    /// The class that these multipliers have.
    fn class_of(&self, y: &[f64]) -> Class {
        let reduced = self.local.reduced_gradient(y);
        let mut in_pair = vec![false; reduced.len()];
        for &pair in self.biactive {
            for side in self.pairs[pair] {
                in_pair[side as usize] = true;
            }
        }
        let mut others = (0..reduced.len()).filter(|&i| !in_pair[i]);
        let mut rows = self.rows.iter().zip(y);
        let is_weak = others
            .all(|i| self.is_in(self.variables[i], reduced[i]) || self.gains_little(i, reduced[i]))
            && rows.all(|(&cone, &y)| self.is_in(cone, y));
        if !is_weak {
            return Class::None;
        }
        let is = |class: Class| {
            let satisfies = |&pair: &usize| self.satisfies(class, pair, &reduced);
            self.biactive.iter().all(satisfies)
        };
        let classes = [Class::S, Class::M, Class::C, Class::A];
        classes
            .into_iter()
            .find(|&class| is(class))
            .unwrap_or(Class::W)
    }

    /// Whether the multipliers of a pair have the signs of a class.
    fn satisfies(&self, class: Class, pair: usize, reduced: &[f64]) -> bool {
        let nu = self.pairs[pair].map(|side| reduced[side as usize]);
        let choices = choices(class).iter();
        choices.into_iter().any(|cones| {
            let sides = cones.iter().zip(nu);
            sides.into_iter().all(|(&cone, nu)| self.is_in(cone, nu))
        })
    }

    /// These multipliers or such of least norm, which are quicker than linear programs: those of the strongest class,
    /// and of these the ones that come closest to S. What has the wrong sign is asked to be zero, some times over.
    fn best_of_least(&self, y: &[f64]) -> (Class, Vec<f64>) {
        let mut best = (self.class_of(y), y.to_vec());
        let cones = self.strong_cones();
        let mut miss = self.miss(&cones, y);
        if best.0 == Class::S {
            return best;
        }
        let mut least = LeastNorm::new(
            self.local,
            |i| cones[i] != Cone::Free,
            |row| self.rows[row] != Cone::Zero,
            &self.tolerances.analyses,
        );
        let mut is_zero: Vec<bool> = cones.iter().map(|&cone| cone == Cone::Zero).collect();
        let mut is_without = vec![false; self.rows.len()];
        for _ in 0..LEAST_ROUNDS {
            if self.tolerances.limit.is_over() {
                break;
            }
            let Some(y) = least.multipliers(&is_zero, &is_without) else {
                break;
            };
            let (class, missed) = (self.class_of(&y), self.miss(&cones, &y));
            let mut has_changed = false;
            let mut ask = |is: &mut bool, cone: Cone, value: f64| {
                has_changed |= !*is && !self.is_in(cone, value);
                *is |= !self.is_in(cone, value);
            };
            let reduced = self.local.reduced_gradient(&y);
            for ((is_zero, &cone), r) in is_zero.iter_mut().zip(&cones).zip(reduced) {
                ask(is_zero, cone, r);
            }
            for ((is_without, &cone), &y) in is_without.iter_mut().zip(&self.rows).zip(&y) {
                ask(is_without, cone, y);
            }
            if class > best.0 || class == best.0 && missed < miss {
                (best, miss) = ((class, y), missed);
            }
            if class == Class::S || !has_changed {
                break;
            }
        }
        best
    }

    /// The cones of r that S-stationarity asks for.
    fn strong_cones(&self) -> Vec<Cone> {
        let mut cones = self.variables.clone();
        for side in self.biactive.iter().flat_map(|&pair| self.pairs[pair]) {
            cones[side as usize] = Cone::Positive;
        }
        cones
    }

    /// How far r and y are from their cones.
    fn miss(&self, cones: &[Cone], y: &[f64]) -> f64 {
        let outside = |(cone, value): (Cone, f64)| match cone {
            Cone::Zero => value.abs(),
            Cone::Positive => (-value).max(0.0),
            Cone::Negative => value.max(0.0),
            Cone::Free => 0.0,
        };
        let variables = cones.iter().copied().zip(self.local.reduced_gradient(y));
        let rows = self.rows.iter().copied().zip(y.iter().copied());
        variables.chain(rows).map(outside).fold(0.0, f64::max)
    }

    /// Looks for y of a class by branching over the pairs.
    fn search(&self, class: Class) -> Search {
        let choices = choices(class);
        // One choice for every pair that has been decided.
        let mut stack: Vec<Vec<(usize, [Cone; 2])>> = vec![match choices {
            [only] => self.biactive.iter().map(|&pair| (pair, *only)).collect(),
            _ => Vec::new(),
        }];
        let mut is_undecided = false;
        for _ in 0..NODE_LIMIT {
            let Some(decided) = stack.pop() else {
                return if is_undecided {
                    Search::Undecided
                } else {
                    Search::Excluded
                };
            };
            let y = match self.multipliers(&decided) {
                Ok(Some(y)) => y,
                Ok(None) => continue,
                Err(Undecided) => {
                    is_undecided = true;
                    continue;
                }
            };
            let reduced = self.local.reduced_gradient(&y);
            let open = self.biactive.iter().copied().find(|&pair| {
                let is_decided = decided.iter().any(|(other, _)| *other == pair);
                !is_decided && !self.satisfies(class, pair, &reduced)
            });
            let Some(pair) = open else {
                return Search::Found(y);
            };
            for &cones in choices {
                let mut child = decided.clone();
                child.push((pair, cones));
                stack.push(child);
            }
        }
        Search::Undecided
    }

    /// Multipliers with the smallest violation, or `None` where that exceeds the tolerance.
    fn multipliers(&self, decided: &[(usize, [Cone; 2])]) -> Result<Option<Vec<f64>>, Undecided> {
        // A variable in several pairs has the sum of their multipliers.
        let mut cones = self.variables.clone();
        let mut is_first = vec![true; cones.len()];
        for &pair in self.biactive {
            let choice = decided.iter().find(|(other, _)| *other == pair);
            let choice = choice.map_or([Cone::Free; 2], |(_, cones)| *cones);
            for (side, cone) in self.pairs[pair].into_iter().zip(choice) {
                let side = side as usize;
                cones[side] = match is_first[side] {
                    true => cone,
                    false => cones[side].plus(cone),
                };
                is_first[side] = false;
            }
        }
        // Variables of the program: y of the active rows, and e. The gradient is measured by its largest entry.
        let active: Vec<usize> = (0..self.rows.len())
            .filter(|&row| self.rows[row] != Cone::Zero)
            .collect();
        let e = active.len();
        let mut place = vec![usize::MAX; self.rows.len()];
        for (index, &row) in active.iter().enumerate() {
            place[row] = index;
        }
        let mut program = LinearProgram {
            cost: vec![0.0; e + 1],
            lower: vec![0.0; e + 1],
            upper: vec![LARGEST_MULTIPLIER; e + 1],
            ..LinearProgram::default()
        };
        program.cost[e] = 1.0;
        for (index, &row) in active.iter().enumerate() {
            if self.rows[row] != Cone::Positive {
                program.lower[index] = -LARGEST_MULTIPLIER;
            }
            if self.rows[row] == Cone::Negative {
                program.upper[index] = 0.0;
            }
        }
        // r_i >= -e and r_i <= e, as far as the cone asks for them.
        let mut at_least = vec![usize::MAX; cones.len()];
        let mut at_most = at_least.clone();
        for (i, &cone) in cones.iter().enumerate() {
            let constant = self.local.gradient[i] / self.local.scale;
            if matches!(cone, Cone::Zero | Cone::Positive) {
                at_least[i] = program.push_row(-constant, f64::INFINITY, (e, 1.0));
            }
            if matches!(cone, Cone::Zero | Cone::Negative) {
                at_most[i] = program.push_row(f64::NEG_INFINITY, -constant, (e, -1.0));
            }
        }
        for &(row, i, value) in &self.local.jacobian {
            if place[row] != usize::MAX {
                let lines = [at_least[i], at_most[i]].into_iter();
                let lines = lines.filter(|&line| line != usize::MAX);
                program
                    .entries
                    .extend(lines.map(|line| (line, place[row], value)));
            }
        }
        let limit = &self.tolerances.limit;
        if limit.is_over() {
            return Err(Undecided);
        }
        match solve(&program, &program.lower, &program.upper, limit) {
            Outcome::Optimal(x) if x[e] * self.local.scale <= self.tolerance => {
                let mut y = vec![0.0; self.rows.len()];
                for (index, &row) in active.iter().enumerate() {
                    y[row] = x[index] * self.local.scale;
                }
                Ok(Some(y))
            }
            Outcome::Optimal(_) | Outcome::Infeasible => Ok(None),
            Outcome::Failed => Err(Undecided),
        }
    }
}

/// A linear program that could not be solved.
struct Undecided;

impl Cone {
    fn plus(self, other: Cone) -> Cone {
        match (self, other) {
            (Cone::Zero, cone) | (cone, Cone::Zero) => cone,
            (a, b) if a == b => a,
            _ => Cone::Free,
        }
    }
}

impl LinearProgram {
    /// Adds a row with one entry; its number.
    fn push_row(&mut self, lower: f64, upper: f64, (column, value): (usize, f64)) -> usize {
        let row = self.row_lower.len();
        self.row_lower.push(lower);
        self.row_upper.push(upper);
        self.entries.push((row, column, value));
        row
    }
}

/// The cones whose union is a class, for (ν_a, ν_b).
fn choices(class: Class) -> &'static [[Cone; 2]] {
    use Cone::*;
    match class {
        Class::S => &[[Positive, Positive]],
        Class::M => &[[Positive, Positive], [Zero, Free], [Free, Zero]],
        Class::C => &[[Positive, Positive], [Negative, Negative]],
        Class::A => &[[Positive, Free], [Free, Positive]],
        Class::W | Class::None => &[[Free, Free]],
    }
}
