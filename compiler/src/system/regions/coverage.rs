//! Proof that exactly one region of a partition holds at every point off the surfaces.
//!
//! The combinations of sides of the guards' surfaces are walked as a tree, surface by surface. A branch ends where no
//! point has its sides, or where every guard is decided by them: then exactly one must hold. Where the surfaces are
//! planes, a branch that is left with none or several is a cell with an interior, and a point in it is the
//! counterexample. Regions that no branch has met hold on a thin set at most.
//!
//! Weights of guards may fail where a point on several surfaces touches a combination of sides that no point has: of the
//! three cells a < b and a < c, b < a and b < c, c < a and c < b, none holds where a < b, b < c and c < a, and all of
//! this is touched where a = b = c. Between the corners of α, weights that are not those of one region there are no
//! convex combination, and give vector fields that are not Filippov's. Then the tree itself gives the weights:
//!
//! w = α_k w|ψ_k>0 + (1 - α_k) w|ψ_k<0 where both sides occur, else w of the side that does,
//!
//! which are 0 or 1 in every corner and add up to one for every α.

use rustc_hash::FxHashSet;

use super::arrangement::{Arrangement, Side, Sides};
use crate::expr::{Expr, Interval, Substitution, Var, variables_of};
use crate::system::regions::conjunction::conjunction;
use crate::system::switches::interaction::positions;

/// More linear programs are not worth the wait; samples take their place.
const MOST_PROGRAMS: usize = 1000;
/// The same for branches.
const MOST_BRANCHES: usize = 20_000;

/// What is known about the regions of a partition.
#[derive(Clone, Debug, Default)]
pub(crate) struct Proof<'e> {
    /// Points, by states and time, that have no region or several.
    pub counterexample: Option<Vec<(Var, f64)>>,
    /// Whether every combination of sides was decided.
    pub is_complete: bool,
    /// Whether the walk was given up.
    pub is_interrupted: bool,
    /// Regions that hold on a thin set at most; all of them only where the proof is complete.
    pub thin: Vec<usize>,
    /// Weights that are right where the surfaces meet, if those of the guards are not.
    pub weights: Option<Vec<Expr<'e>>>,
}

/// The smooth frame of a partition.
pub(crate) struct Frame<'e> {
    /// (α, ψ) of all switches, inner ones first.
    pub switches: Vec<(Var, Expr<'e>)>,
    /// Numbers of the parameters.
    pub params: Substitution<'e>,
    /// Initial values of states and time, and guesses of free parameters.
    pub origin: Vec<(Var, f64)>,
    /// Where free parameters may be.
    pub free: Vec<(Var, Interval)>,
    /// Time, and the end of the run.
    pub time: (Var, f64),
}

/// Walks over the sides of the switches in the guards, of which `weights` are 1 where they hold. `rest` is the region
/// `else`, which holds where no other does.
///
/// With one region nothing is asked but whether it is thin.
pub(crate) fn prove<'e>(weights: &[Expr<'e>], rest: Option<usize>, frame: &Frame<'e>) -> Proof<'e> {
    let alphas: Vec<Var> = frame.switches.iter().map(|&(alpha, _)| alpha).collect();
    let inner = |k: usize| positions(frame.switches[k].1, &alphas);
    let needs = weights
        .iter()
        .map(|&weight| closure(positions(weight, &alphas), inner));
    let needs: Vec<Vec<usize>> = needs.collect();
    let mut members: Vec<usize> = needs.iter().flatten().copied().collect();
    members.sort_unstable();
    members.dedup();
    let place = |k: &usize| members.binary_search(k).expect("a member");
    let needs: Vec<Vec<usize>> = (needs.iter())
        .map(|needs| needs.iter().map(place).collect())
        .collect();
    let surfaces: Vec<(Var, Expr<'e>)> = members.iter().map(|&k| frame.switches[k]).collect();
    let arrangement = Arrangement::new(&surfaces, &frame.params, frame.origin.iter().copied());
    let literals = |&weight: &Expr<'e>| {
        let literals = conjunction(weight, &alphas)?;
        Some(literals.iter().map(|(k, on)| (place(k), *on)).collect())
    };
    let mut walk = Walk {
        weights,
        rest,
        surfaces: &surfaces,
        literals: weights.iter().map(literals).collect(),
        needs,
        arrangement: &arrangement,
        branches: 0,
        held: vec![false; weights.len()],
        is_touched: false,
        proof: Proof {
            is_complete: true,
            ..Proof::default()
        },
    };
    let all = arrangement.all();
    let (time, end) = frame.time;
    let timed = surfaces.iter().find(|(_, psi)| psi.depends_on(time));
    let start = match timed {
        Some((_, psi)) => arrangement.between(&all, psi.exprs().expr(time), 0.0, end),
        None => all,
    };
    let occurring = variables_of(&surfaces.iter().map(|&(_, psi)| psi).collect::<Vec<_>>());
    let free = frame.free.iter().filter(|(var, _)| occurring.contains(var));
    let start = free.fold(start, |sides, &(var, range)| {
        let var = weights[0].exprs().expr(var);
        arrangement.between(&sides, var, range.low, range.high)
    });
    let tree = walk.branch(&start);
    let (mut proof, held) = (walk.proof, walk.held);
    if walk.is_touched && !proof.is_interrupted && weights.len() > 1 {
        proof.weights = tree;
    }
    // A guard that begins to hold after the end of the run is not thin.
    if proof.is_complete && timed.is_none() {
        proof.thin = (0..weights.len())
            .filter(|&r| !held[r] && Some(r) != rest)
            .collect();
    }
    proof
}

/// With what is inside.
pub(crate) fn closure(of: Vec<usize>, inner: impl Fn(usize) -> Vec<usize>) -> Vec<usize> {
    let mut found: FxHashSet<usize> = FxHashSet::default();
    let mut open = of;
    while let Some(k) = open.pop() {
        if found.insert(k) {
            open.extend(inner(k));
        }
    }
    let mut found: Vec<usize> = found.into_iter().collect();
    found.sort_unstable();
    found
}

struct Walk<'w, 'e> {
    weights: &'w [Expr<'e>],
    rest: Option<usize>,
    surfaces: &'w [(Var, Expr<'e>)],
    /// Guards that are conjunctions, by surface.
    literals: Vec<Option<Vec<(usize, bool)>>>,
    /// Surfaces that decide a guard, ascending.
    needs: Vec<Vec<usize>>,
    arrangement: &'w Arrangement<'e>,
    branches: usize,
    held: Vec<bool>,
    /// Whether some point is on surfaces around sides that have no region, or several.
    is_touched: bool,
    proof: Proof<'e>,
}

impl<'e> Walk<'_, 'e> {
    /// The weights of the regions below a branch; none where no point has its sides.
    fn branch(&mut self, sides: &Sides) -> Option<Vec<Expr<'e>>> {
        self.branches += 1;
        let (programs, found) = (self.arrangement.n_programs(), &self.proof.counterexample);
        if self.branches > MOST_BRANCHES || programs > MOST_PROGRAMS || found.is_some() {
            self.proof.is_complete = false;
            self.proof.is_interrupted = true;
            return None;
        }
        let named = (0..self.weights.len()).filter(|&r| Some(r) != self.rest);
        let guards: Vec<(usize, Option<bool>)> =
            named.map(|r| (r, self.decided(r, sides))).collect();
        let open = guards.iter().filter(|(_, holds)| holds.is_none());
        let next = open.filter_map(|(r, _)| {
            let mut needed = self.needs[*r].iter();
            needed.find(|&&k| sides.signs[k].is_none()).copied()
        });
        let Some(next) = next.min() else {
            let holding = guards.iter().filter(|(_, holds)| *holds == Some(true));
            let holding: Vec<usize> = holding.map(|&(r, _)| r).collect();
            return self.leaf(&holding, sides);
        };
        let [below, above] =
            [false, true].map(|above| match self.arrangement.side(sides, next, above) {
                Side::Cell(part) => self.branch(&part),
                Side::Empty => None,
                Side::Unknown(_) => {
                    self.proof.is_complete = false;
                    None
                }
            });
        match (below, above) {
            (Some(below), Some(above)) => {
                let alpha = self.weights[0].exprs().expr(self.surfaces[next].0);
                let pairs = below.into_iter().zip(above);
                Some(pairs.map(|(b, a)| (1.0 - alpha) * b + alpha * a).collect())
            }
            (below, above) => below.or(above),
        }
    }

    fn leaf(&mut self, holding: &[usize], sides: &Sides) -> Option<Vec<Expr<'e>>> {
        let region = match *holding {
            [] => self.rest,
            [region] => Some(region),
            _ => None,
        };
        if sides.is_thin() {
            self.is_touched |= region.is_none();
            return None;
        }
        holding.iter().for_each(|&r| self.held[r] = true);
        let Some(region) = region else {
            self.is_touched = true;
            if self.weights.len() > 1 {
                match self.arrangement.witness(sides) {
                    Some(point) => self.proof.counterexample = Some(point),
                    None => self.proof.is_complete = false,
                }
            }
            return None;
        };
        let number = |r: usize| f64::from(r == region);
        let exprs = self.weights[0].exprs();
        Some(
            (0..self.weights.len())
                .map(|r| exprs.constant(number(r)))
                .collect(),
        )
    }

    /// Whether a guard holds on the sides that are known, where they decide it.
    fn decided(&self, r: usize, sides: &Sides) -> Option<bool> {
        let signs = &sides.signs;
        if let Some(literals) = &self.literals[r] {
            let fails = |&(k, on): &(usize, bool)| signs[k] == Some(!on);
            return match literals.iter().any(fails) {
                true => Some(false),
                false => (literals.iter())
                    .all(|&(k, _)| signs[k].is_some())
                    .then_some(true),
            };
        }
        if self.needs[r].iter().any(|&k| signs[k].is_none()) {
            return None;
        }
        let value = self.weights[r].eval(&|var| {
            let place = (self.needs[r].iter()).find(|&&k| self.surfaces[k].0 == var);
            place.map_or(f64::NAN, |&k| f64::from(signs[k] == Some(true)))
        });
        Some(value > 0.5)
    }
}
