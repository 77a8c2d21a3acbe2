//! Jumps x⁺ = g(t, x⁻) to first order: laws that set states, and impacts.
//!
//! An impact of closed contacts gives x⁺ = x⁻ + Σ_k d_k λ_k with d = -∂f/∂α where they are closed, and what it stops or
//! throws back has h_k(x⁺) = -e_k h_k(x⁻), h being ψ' of gaps and ψ of slip velocities that stick behind it. So
//!
//! (h_x d) λ = -(1 + e) h,   (h_x d) δλ = -δ((1 + e) h) - δ(h_x d) λ,
//!
//! which holds as long as the same contacts push, slip and stick.

use std::sync::Arc;

use super::adjoint::Costate;
use super::functions::{Functions, Group, Kick, Moved, Point};
use super::meeting::Held;
use super::saltation::{Slope, weigh};
use super::why::Why;
use crate::contact::impact::impact_of;
use crate::event::recording::EventRecord;
use crate::hybrid::{Effect, Guard, HybridSystem, Impact, ImpactLaw, Input, Reset, Side, Sided};
use crate::linalg::DenseLu;
use crate::selector::coupling::Coupling;

/// States behind a jump are those of its law up to this part of their sizes.
const SAME: f64 = 1e-9;
/// A derivative is zero up to this part of its terms.
const CANCELS: f64 = 1e-13;
/// A slip velocity is zero up to this part of its terms.
const STICKS: f64 = 1e-12;

/// The states that change, as functions of time, states and parameters.
pub(super) struct Jumped {
    rows: Vec<(usize, Slope)>,
    /// What has to stay zero before it: where a guard becomes true by a jump, ψ of those of its switches that are on their
    /// surface.
    pub guards: Vec<Held>,
}

impl Jumped {
    /// Whatever leads to it.
    fn of(rows: Vec<(usize, Slope)>) -> Self {
        Jumped {
            rows,
            guards: Vec::new(),
        }
    }

    /// The tangent behind it, with the size of its terms.
    pub fn apply(&self, moved: Moved, direction: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut x, mut size) = (moved.x.to_vec(), moved.size.to_vec());
        for (state, slope) in &self.rows {
            [x[*state], size[*state]] = slope.along(moved, direction);
        }
        (x, size)
    }

    /// Whether it changes a state.
    pub fn sets(&self, state: usize) -> bool {
        self.rows.iter().any(|(own, _)| *own == state)
    }

    /// How large its derivatives are.
    pub fn magnitude(&self) -> Jumped {
        let rows = self.rows.iter();
        Jumped::of(
            rows.map(|(state, slope)| (*state, slope.magnitude()))
                .collect(),
        )
    }

    /// The transpose of that.
    pub fn transpose(&self, costate: &mut Costate) {
        let rows = self.rows.iter();
        let weights: Vec<f64> = rows
            .map(|(state, _)| std::mem::take(&mut costate.x[*state]))
            .collect();
        for ((_, slope), weight) in self.rows.iter().zip(weights) {
            costate.add_slope(slope, weight);
        }
    }
}

/// The jumps of an event, in order, where they lead to the state behind it.
pub(super) fn jumped(
    functions: &mut Functions,
    point: Point,
    (event, coupling): (&EventRecord, &Coupling),
    sizes: &[f64],
) -> Result<Vec<Jumped>, Why> {
    // Laws by their places.
    let places = 0..event.laws.len();
    let all = [
        vec![places.clone().collect()],
        places.map(|place| vec![place]).collect::<Vec<Vec<usize>>>(),
    ];
    for (rounds, closed) in all
        .iter()
        .flat_map(|rounds| [(rounds, false), (rounds, true)])
    {
        let mut x = event.before.clone();
        let mut found = Vec::new();
        for places in rounds {
            let here = Point { x: &x, ..point };
            let laws: Vec<usize> = places.iter().map(|&place| event.laws[place]).collect();
            let beside = match closed {
                true => beside(&functions.system, event, coupling, &laws),
                false => Vec::new(),
            };
            let Some((behind, mut jumped)) =
                together(functions, here, (event, sizes), [places, &beside])?
            else {
                break;
            };
            jumped.guards = guards(functions, &here, (event, sizes), &laws);
            x = behind;
            found.push(jumped);
        }
        let same = |i: usize| {
            let is_near = (x[i] - event.after[i]).abs() <= SAME * sizes[i];
            is_near || functions.system.is_algebraic(i)
        };
        if found.len() == rounds.len() && (0..x.len()).all(same) {
            return Ok(found);
        }
    }
    Err(Why::Jump)
}

/// The switches that guards look at which are on their surface where a jump has led.
fn guards(
    functions: &mut Functions,
    point: &Point,
    (event, sizes): (&EventRecord, &[f64]),
    laws: &[usize],
) -> Vec<Held> {
    let system = functions.system.clone();
    let mut held = Vec::new();
    for &law in laws {
        let Guard::Sides { switches, .. } = &system.laws[law].guard else {
            continue;
        };
        for &switch in switches {
            let psi = functions.psi(switch, 0, &event.from);
            let slopes = psi.slopes(point, &mut functions.registers);
            let value = psi.value(point, &mut functions.registers);
            let terms = weigh(&slopes, sizes.len(), |state| sizes[state]);
            if value.abs() <= SAME * terms {
                held.push(Held {
                    switch,
                    slopes,
                    slides: false,
                });
            }
        }
    }
    held
}

/// The laws of closed contacts that hang together with those that laws strike.
fn beside(
    system: &HybridSystem,
    event: &EventRecord,
    coupling: &Coupling,
    laws: &[usize],
) -> Vec<usize> {
    let is_there = |&(law, (normal, _)): &(usize, (usize, &Impact))| {
        laws.contains(&law) || event.from[normal] == Side::Slide
    };
    let all = (0..system.laws.len()).filter_map(|law| Some((law, impact_of(system, law)?)));
    let contacts: Vec<_> = all.filter(is_there).collect();
    let of_each = contacts.iter();
    let mut touching: Vec<usize> = of_each
        .flat_map(|(_, (normal, impact))| [&[*normal], &impact.slips[..]].concat())
        .collect();
    touching.sort_unstable();
    let struck = contacts.iter().filter(|(law, _)| laws.contains(law));
    let group: Vec<usize> = struck
        .flat_map(|(_, (normal, _))| coupling.interacting(*normal, &touching))
        .collect();
    let others = contacts.iter().filter(|(law, _)| !laws.contains(law));
    let others = others.filter(|(_, (normal, _))| group.contains(normal));
    others.map(|(law, _)| *law).collect()
}

/// Laws that jump together, by their places, with the impulses of contacts `beside` them: the state behind them.
fn together(
    functions: &mut Functions,
    point: Point,
    (event, sizes): (&EventRecord, &[f64]),
    [places, beside]: [&[usize]; 2],
) -> Result<Option<(Vec<f64>, Jumped)>, Why> {
    let system = functions.system.clone();
    let mut x = point.x.to_vec();
    let mut rows: Vec<(usize, Slope)> = Vec::new();
    let mut impacts = Vec::new();
    let is_same = |i: usize, a: f64, b: f64| (a - b).abs() <= SAME * sizes[i];
    let laws = places.iter().map(|&place| (event.laws[place], place));
    let beside = beside.iter().map(|&law| (law, usize::MAX));
    for (law, place) in laws.chain(beside) {
        match (&system.laws[law].guard, &system.laws[law].effect) {
            (_, Effect::Reset(reset)) => {
                for (state, value, slope) in reset_to(functions, point, (event, place), reset)? {
                    match rows.iter().find(|(set, _)| *set == state) {
                        Some(_) if !is_same(state, x[state], value) => return Ok(None),
                        Some((_, other)) if !slope.is_near(other) => return Err(Why::Several),
                        Some(_) => {}
                        None => {
                            x[state] = value;
                            rows.push((state, slope));
                        }
                    }
                }
            }
            (Guard::Strikes(normal), Effect::Impact(impact)) => impacts.push((*normal, impact)),
            (Guard::Sides { .. } | Guard::Every(_), Effect::Impact(_)) => return Err(Why::Jump),
            (_, Effect::Stop) => {}
        }
    }
    match (impacts.is_empty(), rows.is_empty()) {
        (true, _) => Ok(Some((x, Jumped::of(rows)))),
        (false, true) => struck(functions, point, (event, sizes), &impacts),
        (false, false) => Ok(None),
    }
}

/// What a law sets: states with their values.
fn reset_to(
    functions: &mut Functions,
    point: Point,
    (event, place): (&EventRecord, usize),
    reset: &Reset,
) -> Result<Vec<(usize, f64, Slope)>, Why> {
    let on = event.on.iter().filter(|(law, _)| *law == place);
    let on: Vec<usize> = on.map(|(_, switch)| *switch).collect();
    let inputs: Vec<Input> = reset.inputs_on(&on, &event.from).collect();
    let is_alpha = |place: usize| matches!(reset.inputs[place], Input::Alpha(_));
    let mut values = Sided::new(reset.values.clone(), is_alpha);
    let values = values.on(|place| match inputs[place] {
        Input::Alpha(switch) => point.alpha[switch],
        Input::Number(number) => number,
        _ => f64::NAN,
    });
    let group = Group::new(Arc::new(values.clone()), inputs, functions.slots);
    let values: Vec<f64> = group.values(&point, &mut functions.registers).collect();
    let slopes = group.slopes(&point, &mut functions.registers);
    let slopes: Vec<(usize, usize, f64)> = slopes.collect();
    let slots = functions.slots;
    let slides = |slot| {
        slots
            .switch(slot)
            .is_some_and(|i| event.from[i] == Side::Slide)
    };
    if slopes.iter().any(|&(_, slot, _)| slides(slot)) {
        return Err(Why::Jump);
    }
    let states = reset.states.iter().zip(values).enumerate();
    let row = |(at, (&state, value))| {
        let own = slopes.iter().filter(|&&(function, ..)| function == at);
        let own: Vec<(usize, f64)> = own.map(|&(_, slot, slope)| (slot, slope)).collect();
        (state, value, Slope::of(functions, &own))
    };
    Ok(states.map(row).collect())
}

/// What an impact stops or throws back.
struct Stopped {
    switch: usize,
    /// e, and its derivatives.
    restitution: f64,
    slope: Slope,
}

/// Contacts as an impact closes them, those that stick behind it sticking.
struct Closed {
    sides: Box<[Side]>,
    alpha: Vec<f64>,
    stopped: Vec<Stopped>,
}

impl Closed {
    fn of(
        functions: &mut Functions,
        point: Point,
        (event, sizes): (&EventRecord, &[f64]),
        impacts: &[(usize, &Impact)],
    ) -> Result<Self, Why> {
        let mut closed = Closed {
            sides: event.from.clone(),
            alpha: point.alpha.to_vec(),
            stopped: Vec::new(),
        };
        let behind = Point {
            x: &event.after,
            ..point
        };
        for &(normal, impact) in impacts {
            (closed.sides[normal], closed.alpha[normal]) = (Side::Slide, 0.0);
            let tape = Arc::new(impact.numbers.clone());
            let group = Group::new(tape, impact.inputs.clone(), functions.slots);
            let numbers: Vec<f64> = group.values(&point, &mut functions.registers).collect();
            let slopes = group.slopes(&point, &mut functions.registers);
            let of_e = slopes.filter(|&(number, ..)| number == 0);
            let of_e: Vec<_> = of_e.map(|(_, slot, slope)| (slot, slope)).collect();
            closed.stopped.push(Stopped {
                switch: normal,
                restitution: numbers[0],
                slope: Slope::of(functions, &of_e),
            });
            for &slip in &impact.slips {
                closed.slip(functions, (&behind, sizes), slip)?;
            }
        }
        Ok(closed)
    }

    /// A slip velocity sticks where it is zero behind the impact.
    fn slip(
        &mut self,
        functions: &mut Functions,
        (behind, sizes): (&Point, &[f64]),
        slip: usize,
    ) -> Result<(), Why> {
        // With two entries friction has a direction of its own.
        if functions.system.across(slip).is_some() {
            return Err(Why::Jump);
        }
        let psi = functions.psi(slip, 0, &self.sides);
        let after = psi.value(behind, &mut functions.registers);
        let slopes = psi.slopes(behind, &mut functions.registers);
        let terms = weigh(&slopes, sizes.len(), |state| sizes[state]);
        if after.abs() <= STICKS * terms {
            (self.sides[slip], self.alpha[slip]) = (Side::Slide, 0.5);
            self.stopped.push(Stopped {
                switch: slip,
                restitution: 0.0,
                slope: Slope::of(functions, &[]),
            });
        } else {
            self.sides[slip] = Side::of(after);
            self.alpha[slip] = 0.5 + 0.5 * self.sides[slip].sign();
        }
        Ok(())
    }
}

/// h of what is stopped, with its slopes, and how those by states change.
#[derive(Default)]
struct Speeds {
    h: Vec<f64>,
    rows: Vec<Vec<f64>>,
    bends: Vec<Vec<Vec<f64>>>,
}

impl Speeds {
    fn of(functions: &mut Functions, point: &Point, sides: &[Side], switches: &[usize]) -> Self {
        let mut speeds = Speeds::default();
        for &i in switches {
            let psi = functions.psi(i, functions.n_derivatives(i), sides);
            let slopes = psi.slopes(point, &mut functions.registers);
            speeds.h.push(psi.value(point, &mut functions.registers));
            speeds.rows.push(Slope::of(functions, &slopes).entries());
            speeds.bends.push(functions.bends(&psi, point));
        }
        speeds
    }

    /// δ(h_x d) of one of these and a kick, by column.
    fn coupled(&self, i: usize, (kick, moves): &Kick, column: usize) -> f64 {
        let (row, bends) = (&self.rows[i], &self.bends[i]);
        let terms =
            (0..kick.len()).map(|j| row[1 + j] * moves[j][column] + bends[j][column] * kick[j]);
        terms.sum()
    }
}

/// A sum, zero where rounding alone is left of its terms: what is stopped does not move with what it was.
fn sum(terms: impl Iterator<Item = f64>) -> f64 {
    let add = |[sum, size]: [f64; 2], term: f64| [sum + term, size + term.abs()];
    let [sum, size] = terms.fold([0.0; 2], add);
    match sum.abs() <= CANCELS * size {
        true => 0.0,
        false => sum,
    }
}

/// The state behind an impact of contacts that push, none where they do not.
fn struck(
    functions: &mut Functions,
    point: Point,
    of: (&EventRecord, &[f64]),
    impacts: &[(usize, &Impact)],
) -> Result<Option<(Vec<f64>, Jumped)>, Why> {
    let Closed {
        sides,
        alpha,
        stopped,
    } = Closed::of(functions, point, of, impacts)?;
    let point = Point {
        alpha: &alpha,
        ..point
    };
    let (n, k) = (functions.slots.n_states, stopped.len());
    let switches: Vec<usize> = stopped.iter().map(|stopped| stopped.switch).collect();
    let kicks = functions.kicks(&sides, &point, &switches);
    let speeds = Speeds::of(functions, &point, &sides, &switches);
    let product = |row: &[f64], kick: &[f64]| -> f64 {
        row[1..=n].iter().zip(kick).map(|(a, b)| a * b).sum()
    };
    let of_row =
        |row: &Vec<f64>| -> Vec<f64> { kicks.iter().map(|kick| product(row, &kick.0)).collect() };
    let matrix: Vec<f64> = speeds.rows.iter().flat_map(of_row).collect();
    let mut lu = DenseLu::new(k);
    if lu.factor(&matrix).is_err() {
        return Ok(None);
    }
    let kept = |i: usize| -(1.0 + stopped[i].restitution) * speeds.h[i];
    let mut lambda: Vec<f64> = (0..k).map(kept).collect();
    lu.solve(&mut lambda);
    let pushes = |at: usize| !functions.system.is_unilateral(switches[at]) || lambda[at] > 0.0;
    if !(0..k).all(pushes) {
        return Ok(None);
    }
    let width = 1 + n + functions.n_directions();
    let coupled = |i: usize, l: usize, column: usize| speeds.coupled(i, &kicks[l], column);
    let slopes: Vec<Vec<f64>> = stopped.iter().map(|own| own.slope.entries()).collect();
    // Poisson's law gives back impulses: those of Newton's law where e is the same for all that act on each other.
    let is_apart = |i: usize, l: usize| {
        let is_same = stopped[i].restitution == stopped[l].restitution && slopes[i] == slopes[l];
        is_same || matrix[i * k + l] == 0.0 && (0..width).all(|at| coupled(i, l, at) == 0.0)
    };
    let is_poisson = |(_, impact): &(usize, &Impact)| impact.law == ImpactLaw::Poisson;
    if impacts.iter().any(is_poisson) && !(0..k * k).all(|at| is_apart(at / k, at % k)) {
        return Err(Why::Jump);
    }
    let by_e = |i: usize, column: usize| slopes[i][column] * speeds.h[i];
    let mut rows: Vec<Vec<f64>> = vec![Vec::new(); n];
    // By columns: δλ, and with it δx⁺.
    for column in 0..width {
        let change = |i: usize| {
            let of_e = by_e(i, column);
            let of_h = (1.0 + stopped[i].restitution) * speeds.rows[i][column];
            let of_kicks = (0..k).map(|l| lambda[l] * coupled(i, l, column));
            -(of_e + of_h + of_kicks.sum::<f64>())
        };
        let mut changes: Vec<f64> = (0..k).map(change).collect();
        lu.solve(&mut changes);
        for (i, row) in rows.iter_mut().enumerate() {
            let own = if column == 1 + i { 1.0 } else { 0.0 };
            let of_kicks = kicks
                .iter()
                .enumerate()
                .flat_map(|(l, kick)| [kick.0[i] * changes[l], kick.1[i][column] * lambda[l]]);
            row.push(sum(of_kicks.chain([own])));
        }
    }
    let pushed = |i: usize| {
        let pushes = kicks
            .iter()
            .zip(&lambda)
            .map(|(kick, lambda)| kick.0[i] * lambda);
        point.x[i] + pushes.sum::<f64>()
    };
    let rows = rows.iter().map(|row| Slope::row(row, n)).enumerate();
    let rows = rows.collect();
    Ok(Some(((0..n).map(pushed).collect(), Jumped::of(rows))))
}
