//! Choices of sides worth judging where surfaces meet.
//!
//! Up to six surfaces that interact, all 3^|I| choices are tried with every α that keeps the
//! sliding ones in place, which finds every solution. Beyond, Lemke's method finds one, and where
//! -∂φ/∂α is no P-matrix, a search looks for more (`pivot`).

use std::sync::Arc;

use super::selection::{Choice, Choices};
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::TIE;
use crate::expansion::sliding::{Tie, held};
use crate::hybrid::point::Point;
use crate::hybrid::{HybridSystem, Role, Settings, Side, Status};
use crate::linalg::DenseLu;
use crate::runtime::limit::Limit;
use crate::selector::lemke::Problem;

/// Beyond this many interacting surfaces, Lemke's method replaces enumeration.
pub(crate) const MAX_ENUMERATED: usize = 6;

/// Boxes looked at for the zeros of rates that contain products of α.
const MAX_BOXES: usize = 4000;

/// Up to this many choices where pairs meet, all are tried by their rates.
const MAX_CHOICES: f64 = 4096.0;

/// Halvings of the unit cube before Newton's method takes over.
const MAX_DEPTH: usize = 4;

/// A change of α that does not become smaller any more is rounding below this.
const ROUNDED: f64 = 1e-9;

/// No α of this size is looked for: those of solutions are in [0, 1]. Forces, 1 - α, have no bound and the unit of the model.
pub(crate) const FAR: f64 = 1e6;

/// What a force does to its gap is rounding below this share of the terms that it is the sum of.
const CANCELS: f64 = 1e-13;

/// Finds the choices of sides that are worth judging where surfaces meet.
pub(crate) struct Enumeration<'a> {
    pub mode: &'a mut Mode,
    pub system: Arc<HybridSystem>,
    pub settings: &'a Settings,
}

impl<'a> Enumeration<'a> {
    /// In a mode, as the settings of a run say.
    pub(crate) fn new(mode: &'a mut Mode, settings: &'a Settings) -> Self {
        Enumeration {
            system: mode.system.clone(),
            mode,
            settings,
        }
    }

    /// All choices of sides with their α.
    pub(crate) fn choices(
        &mut self,
        state: &mut State,
        group: &[usize],
    ) -> Result<Choices, Status> {
        if self.is_of_contacts(group) {
            return self.contact_choices(state, group);
        }
        if self.holds_disc(group) {
            return self.disc_choices(state, group);
        }
        let options = group.iter().map(|&i| self.options(&state.point, group, i));
        let options: Vec<Vec<Side>> = options.collect();
        let (candidates, all) = if group.iter().any(|&i| self.system.role(i) != Role::Step) {
            self.with_members(group, &options)
        } else if group.len() > MAX_ENUMERATED {
            self.pivots(state, group, &options)
        } else {
            (product(&options), true)
        };
        let mut choices = Choices {
            found: Vec::new(),
            singular: false,
            all,
        };
        for candidate in candidates {
            // There may be hundreds, each with many boxes.
            self.settings.limit.check()?;
            self.mode.enter_choice(&state.point, group, &candidate);
            let outcome = self.solve(state, group, &candidate, &mut choices.found);
            choices.singular |= outcome == Search::Singular;
            choices.all &= outcome != Search::Bounded;
        }
        Ok(choices)
    }

    /// The sides of a switch on its surface, the present one first.
    pub(crate) fn options(&self, point: &Point, group: &[usize], switch: usize) -> Vec<Side> {
        if let Some(options) = self.options_of_role(point, group, switch) {
            return options;
        }
        let mut options = match self.system.is_unilateral(switch) {
            true => vec![Side::Plus],
            false => vec![Side::Minus, Side::Plus],
        };
        if !self.system.is_continuous(switch) {
            options.push(Side::Slide);
        }
        if let Some(present) = options.iter().position(|side| *side == point.sides[switch]) {
            options.swap(0, present);
        }
        options
    }

    /// Solutions by Lemke's method and, where there may be others, by search; true when these are
    /// all that need to be looked at.
    fn pivots(
        &mut self,
        state: &State,
        group: &[usize],
        options: &[Vec<Side>],
    ) -> (Vec<Vec<Side>>, bool) {
        let mut problem = Problem {
            mode: self.mode,
            state,
            group,
        };
        let unique = problem.is_unique();
        let mut candidates = problem
            .pivot(options)
            .map_or(Vec::new(), |sides| alternatives(&sides));
        let mut all = true;
        if !unique {
            let others;
            (others, all) = problem.search(options);
            candidates.extend(
                others
                    .into_iter()
                    .filter(|sides| !candidates.contains(sides))
                    .collect::<Vec<_>>(),
            );
        }
        (candidates, all)
    }

    /// Adds every solution of φ_S = 0 for the sliding switches S of a candidate.
    pub(crate) fn solve(
        &mut self,
        state: &State,
        group: &[usize],
        sides: &[Side],
        found: &mut Vec<Choice>,
    ) -> Search {
        let mode = &mut self.mode;
        let mut alpha = state.point.alpha.clone();
        let mut unknowns = Vec::new();
        for (&i, &side) in group.iter().zip(sides) {
            alpha[i] = match side {
                Side::Minus => 0.0,
                Side::Plus => 1.0,
                Side::Slide => {
                    unknowns.push(i);
                    if state.point.sides[i] == Side::Slide {
                        alpha[i]
                    } else {
                        0.5
                    }
                }
            };
        }
        let mut zeros = Zeros::new(mode, alpha, unknowns);
        zeros.limit = self.settings.limit.clone();
        let outcome = zeros.find();
        let (solutions, mut alpha, unknowns) = (zeros.found, zeros.alpha, zeros.unknowns);
        for solution in solutions {
            for (&i, a) in unknowns.iter().zip(solution) {
                alpha[i] = a;
            }
            mode.vary(&alpha);
            let states = mode.focus.states.iter();
            found.push(Choice {
                sides: sides.into(),
                alpha: group.iter().map(|&i| alpha[i]).collect(),
                f: states.map(|&state| mode.field.f[state]).collect(),
            });
        }
        outcome
    }

    /// The sides of an equation or a member of a pair where it meets others.
    fn options_of_role(&self, point: &Point, group: &[usize], switch: usize) -> Option<Vec<Side>> {
        match self.system.role(switch) {
            Role::Step => None,
            Role::Equation => Some(vec![Side::Slide]),
            Role::Member(other) if !group.contains(&other) => Some(vec![point.sides[switch]]),
            // What the second one does follows from the first.
            Role::Member(other) if other < switch => Some(vec![Side::Minus]),
            Role::Member(_) => Some(match point.sides[switch] {
                Side::Slide => vec![Side::Slide, Side::Minus],
                _ => vec![Side::Minus, Side::Slide],
            }),
        }
    }

    /// All choices of a group in which there are equations or pairs; false where they are too many.
    fn with_members(&self, group: &[usize], options: &[Vec<Side>]) -> (Vec<Vec<Side>>, bool) {
        let sizes = options.iter().map(|sides| sides.len() as f64);
        let (mut candidates, all) = match sizes.product::<f64>() <= MAX_CHOICES {
            true => (product(options), true),
            false => (alternatives(options), false),
        };
        for (at, &i) in group.iter().enumerate() {
            let Role::Member(other) = self.system.role(i) else {
                continue;
            };
            let Some(first) = group.iter().position(|&j| j == other && other < i) else {
                continue;
            };
            for sides in &mut candidates {
                sides[at] = match sides[first] {
                    Side::Slide => Side::Minus,
                    _ => Side::Slide,
                };
            }
        }
        (candidates, all)
    }
}

/// What a search for zeros has seen.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Search {
    /// Everything.
    Complete,
    /// Equations that leave α undetermined.
    Singular,
    /// A part, up to the bound on its effort.
    Bounded,
}

/// Combinations of one option each: all of them, or where that is too many, those that take the
/// first or the last option everywhere or but for one switch.
pub(crate) fn alternatives(options: &[Vec<Side>]) -> Vec<Vec<Side>> {
    let open: Vec<usize> = (0..options.len())
        .filter(|&i| options[i].len() > 1)
        .collect();
    if open.len() <= MAX_ENUMERATED {
        return product(options);
    }
    let first: Vec<Side> = options.iter().map(|sides| sides[0]).collect();
    let last: Vec<Side> = options.iter().map(|sides| sides[sides.len() - 1]).collect();
    let mut found = vec![first.clone(), last.clone()];
    for &i in &open {
        for (start, side) in [(&first, last[i]), (&last, first[i])] {
            let mut sides = start.clone();
            sides[i] = side;
            found.push(sides);
        }
    }
    found
}

/// Every combination of one option each.
pub(crate) fn product<T: Copy>(options: &[Vec<T>]) -> Vec<Vec<T>> {
    options.iter().fold(vec![Vec::new()], |prefixes, options| {
        let extend = |prefix: Vec<T>| {
            options
                .iter()
                .map(move |&side| [prefix.as_slice(), &[side]].concat())
        };
        prefixes.into_iter().flat_map(extend).collect()
    })
}

/// The zeros of φ_S(α_S) in the unit cube.
pub(crate) struct Zeros<'m> {
    mode: &'m mut Mode,
    /// Of all switches; the unknown ones start where Newton's method does.
    alpha: Vec<f64>,
    /// The switches S.
    pub unknowns: Vec<usize>,
    /// Unknowns that stay what they are: slip velocities that others keep at zero.
    held: Vec<usize>,
    found: Vec<Vec<f64>>,
    /// When the search has to stop.
    limit: Limit,
}

impl<'m> Zeros<'m> {
    /// None found yet.
    pub(crate) fn new(mode: &'m mut Mode, alpha: Vec<f64>, unknowns: Vec<usize>) -> Self {
        Zeros {
            mode,
            alpha,
            unknowns,
            held: Vec::new(),
            found: Vec::new(),
            limit: Limit::default(),
        }
    }

    /// The one that Newton's method finds from where the unknowns start.
    pub(crate) fn near(&mut self) -> Option<Vec<f64>> {
        let start = self.values();
        if self.unknowns.is_empty() {
            return Some(start);
        }
        self.set(&start);
        let is_slip = |at: usize| self.mode.surfaces.is_slip(self.unknowns[at]);
        let held = held(&self.matrix(), start.len(), is_slip).into_iter();
        let held = held.zip(&self.unknowns).filter(|(held, _)| *held);
        self.held = held.map(|(_, &switch)| switch).collect();
        self.newton(&start);
        self.found.pop()
    }

    /// Finds them.
    fn find(&mut self) -> Search {
        let start = self.values();
        if self.unknowns.is_empty() {
            self.found.push(start);
            return Search::Complete;
        }
        if let [switch] = self.unknowns[..]
            && !self.is_unbounded(switch)
        {
            return self.solve_one(switch, start[0]);
        }
        if self.is_affine() {
            return match self.newton(&start) {
                true => Search::Complete,
                false => Search::Singular,
            };
        }
        // A box holds the α of steps only.
        if self.unknowns.iter().any(|&i| self.is_unbounded(i)) {
            return match self.newton(&start) {
                true => Search::Bounded,
                false => Search::Singular,
            };
        }
        let system = &self.mode.system;
        if self.unknowns.iter().any(|&i| system.is_unilateral(i)) {
            return self.solve_forces();
        }
        match self.subdivide() {
            true => Search::Complete,
            false => Search::Bounded,
        }
    }

    /// True for the α of an equation or a member, which is a rate.
    fn is_unbounded(&self, switch: usize) -> bool {
        self.mode.system.role(switch) != Role::Step
    }

    /// What ties α of an unknown to that of another one before it, where both surfaces are kept by one equation.
    fn tie(&self, switch: usize) -> Option<Tie> {
        let mode = &*self.mode;
        let mut before = self.unknowns.iter().take_while(|&&other| other != switch);
        let is_redundant = |&&other: &&usize| mode.surfaces.are_redundant(switch, other);
        let other = *before.find(is_redundant)?;
        let coefficient = |alpha: usize| mode.coupling(other, alpha);
        Some(Tie::new(&mode.surfaces, [switch, other], coefficient))
    }

    /// The largest α of a switch that is looked for.
    fn far(&self, switch: usize) -> f64 {
        if self.is_unbounded(switch) || self.mode.system.is_unilateral(switch) {
            f64::INFINITY
        } else {
            FAR
        }
    }

    /// The zero of the rate of one switch, which is affine in its α.
    fn solve_one(&mut self, switch: usize, start: f64) -> Search {
        self.set(&[start]);
        let coupling = self.mode.coupling(switch, switch);
        let change = self.mode.phi(switch) / coupling;
        if !change.is_finite() {
            return Search::Singular;
        }
        if coupling.abs() <= CANCELS * terms_of_coupling(self.mode, switch) {
            return Search::Complete;
        }
        // Far outside, rounding is all that there is of the dependence on α.
        if (start - change).abs() <= self.far(switch) {
            self.set(&[start - change]);
            self.found.push(vec![start - change]);
        }
        Search::Complete
    }

    /// The zero of rates that are affine in the forces λ = 1 - α of contacts and in their friction λ (2 α - 1), and in the α
    /// of others. Rates are linearized at λ = 1 without friction; Newton's method shows whether they are affine.
    fn solve_forces(&mut self) -> Search {
        let k = self.unknowns.len();
        let force_of = |&i: &usize| {
            let contact = self.mode.system.slip_of(i)?;
            self.unknowns.iter().position(|&j| j == contact)
        };
        let forces: Vec<Option<usize>> = self.unknowns.iter().map(force_of).collect();
        let starts = self
            .unknowns
            .iter()
            .map(|&i| match self.mode.system.is_unilateral(i) {
                true => 0.0,
                false => 0.5,
            });
        let mut values: Vec<f64> = starts.collect();
        self.set(&values);
        let mut rhs: Vec<f64> = self
            .unknowns
            .iter()
            .map(|&row| self.residual(row))
            .collect();
        let mut lu = DenseLu::new(k);
        if lu.factor(&self.matrix()).is_err() {
            return Search::Singular;
        }
        lu.solve(&mut rhs);
        for (value, change) in values.iter_mut().zip(&rhs) {
            *value -= change;
        }
        let linear = values.clone();
        for (at, force) in forces.iter().enumerate() {
            if let Some(force) = force {
                values[at] = 0.5 + (linear[at] - 0.5) / (1.0 - linear[*force]);
            }
        }
        let known = self.found.len();
        if !self.newton(&values) {
            return Search::Singular;
        }
        let is_affine = self.found.get(known).is_none_or(|found| {
            let mut pairs = found.iter().zip(&values);
            pairs.all(|(found, value)| (found - value).abs() <= ROUNDED * (1.0 + value.abs()))
        });
        match is_affine {
            true => Search::Complete,
            false => Search::Bounded,
        }
    }

    fn values(&self) -> Vec<f64> {
        self.unknowns.iter().map(|&i| self.alpha[i]).collect()
    }

    fn set(&mut self, values: &[f64]) {
        for (&i, &value) in self.unknowns.iter().zip(values) {
            self.alpha[i] = value;
        }
        self.mode.vary(&self.alpha);
        self.mode.linearize(&self.unknowns);
    }

    /// What must vanish for an unknown: its rate, or what ties it to another one.
    fn residual(&self, row: usize) -> f64 {
        match self.tie(row) {
            _ if self.held.contains(&row) => 0.0,
            Some(tie) => tie.residual(&self.alpha),
            None => self.mode.phi(row),
        }
    }

    fn matrix(&self) -> Vec<f64> {
        let mut matrix = Vec::new();
        for &row in &self.unknowns {
            let tie = self.tie(row);
            let is_held = self.held.contains(&row);
            let entry = |&col: &usize| match tie {
                _ if is_held => f64::from(u8::from(row == col)),
                Some(tie) => tie.derivative(col),
                None => self.mode.coupling(row, col),
            };
            matrix.extend(self.unknowns.iter().map(entry));
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

    /// Newton's method; false where it meets a singular matrix, or one so close to it that it does not converge.
    fn newton(&mut self, start: &[f64]) -> bool {
        let k = self.unknowns.len();
        let (mut lu, mut rhs) = (DenseLu::new(k), vec![0.0; k]);
        let mut values = start.to_vec();
        self.set(&values);
        let mut last = f64::INFINITY;
        for _ in 0..30 {
            let matrix = self.matrix();
            for (rhs, &row) in rhs.iter_mut().zip(&self.unknowns) {
                *rhs = self.residual(row);
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
            // Close to a singular matrix, what rounding does to φ is large in α.
            if change <= 1e-13 || change <= ROUNDED && change > 0.5 * last {
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
            let mut known = values.iter().zip(&self.unknowns);
            if change.is_nan() || known.any(|(value, &i)| value.abs() > self.far(i)) {
                return true;
            }
            last = change;
        }
        false
    }

    /// All zeros of rates with products of α: a multi-affine function has its extremes over a box at
    /// the corners, so that corners of one sign prove that the box holds none. False where boxes were
    /// left that are too large for Newton's method alone, or that there was no time for.
    fn subdivide(&mut self) -> bool {
        let mut all = true;
        let k = self.unknowns.len();
        let outside = 2.0 * TIE;
        let mut boxes = vec![(vec![-outside; k], 1.0 + 2.0 * outside, 0)];
        let mut looked_at = 0;
        while let Some((corner, width, depth)) = boxes.pop() {
            looked_at += 1;
            if looked_at > MAX_BOXES || self.limit.is_over() {
                return false;
            }
            if self.has_no_zero(&corner, width) {
                continue;
            }
            let bounded = looked_at + (1 << k) > MAX_BOXES;
            if depth == MAX_DEPTH || bounded {
                all &= depth == MAX_DEPTH;
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
        all
    }

    fn has_no_zero(&mut self, corner: &[f64], width: f64) -> bool {
        let k = self.unknowns.len();
        let (mut least, mut largest) = (vec![f64::INFINITY; k], vec![f64::NEG_INFINITY; k]);
        for at in 0..1_usize << k {
            let shift = |(i, c): (usize, &f64)| c + width * f64::from(at >> i & 1 == 1);
            let values: Vec<f64> = corner.iter().enumerate().map(shift).collect();
            self.set(&values);
            for (j, &row) in self.unknowns.iter().enumerate() {
                let rate = self.residual(row);
                least[j] = least[j].min(rate);
                largest[j] = largest[j].max(rate);
            }
        }
        let mut ranges = least.iter().zip(&largest);
        ranges.any(|(least, largest)| *least > 0.0 || *largest < 0.0)
    }
}

/// What the terms of ∂φ_i/∂α_i amount to.
fn terms_of_coupling(mode: &Mode, switch: usize) -> f64 {
    let (surfaces, field) = (&mode.surfaces, &mode.field);
    let by_state = surfaces.gradient(switch).iter().flat_map(|&(state, g)| {
        let slopes = field.slopes(state).filter(move |(j, _)| *j == switch);
        slopes.map(move |(_, slope)| (g * slope).abs())
    });
    let mixed = surfaces.now(switch).mixed(switch, &field.f);
    by_state.sum::<f64>() + mixed.abs()
}
