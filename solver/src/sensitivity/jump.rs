//! Jumps x⁺ = g(t, x⁻) to first order: laws that set states, and impacts.
//!
//! An impact of closed contacts gives x⁺ = x⁻ + Σ_k d_k λ_k with d = -∂f/∂α where they are closed, and what it stops or
//! throws back has h_k(x⁺) = -e_k h_k(x⁻), h being ψ' of gaps and ψ of slip velocities that stick behind it. So
//!
//! (h_x d) λ = -(1 + e) h,   (h_x d) δλ = -δ((1 + e) h) - δ(h_x d) λ,
//!
//! which holds as long as the same contacts push, slip and stick.

use std::sync::Arc;

use super::Why;
use super::functions::{Functions, Group, Moved, Point};
use super::recording::Jump;
use super::saltation::Slope;
use crate::hybrid::{Effect, Guard, Impact, Reset, Side};
use crate::linalg::DenseLu;

/// States behind a jump are those of its law up to this part of their sizes.
const SAME: f64 = 1e-9;
/// A slip velocity is zero up to this part of its terms.
const STICKS: f64 = 1e-12;

/// The states that change, as functions of time, states and parameters.
pub(super) struct Jumped {
    rows: Vec<(usize, Slope)>,
}

impl Jumped {
    /// The tangent behind it, with the size of its terms.
    pub fn apply(&self, moved: Moved, direction: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut x, mut size) = (moved.x.to_vec(), moved.size.to_vec());
        for (state, slope) in &self.rows {
            [x[*state], size[*state]] = slope.along(moved, direction);
        }
        (x, size)
    }
}

/// The jumps of an event, in order, where they lead to the state behind it.
pub(super) fn jumped(
    functions: &mut Functions,
    point: Point,
    event: &Jump,
    sizes: &[f64],
) -> Result<Vec<Jumped>, Why> {
    let single: Vec<Vec<usize>> = event.laws.iter().map(|&law| vec![law]).collect();
    let all = [vec![event.laws.clone()], single];
    for (rounds, closed) in all
        .iter()
        .flat_map(|rounds| [(rounds, false), (rounds, true)])
    {
        let mut x = event.before.clone();
        let mut found = Vec::new();
        for laws in rounds {
            let here = Point { x: &x, ..point };
            let Some((behind, jumped)) = together(functions, here, (event, sizes), (laws, closed))?
            else {
                break;
            };
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

/// Laws that jump together, with impulses of contacts that are `closed` or without: the state behind them.
fn together(
    functions: &mut Functions,
    point: Point,
    (event, sizes): (&Jump, &[f64]),
    (laws, closed): (&[usize], bool),
) -> Result<Option<(Vec<f64>, Jumped)>, Why> {
    let system = functions.system.clone();
    let mut x = point.x.to_vec();
    let mut rows = Vec::new();
    let mut impacts = Vec::new();
    for &law in laws {
        match (&system.laws[law].guard, &system.laws[law].effect) {
            (_, Effect::Reset(reset)) => {
                for (state, value, slope) in reset_to(functions, point, event, reset)? {
                    x[state] = value;
                    rows.push((state, slope));
                }
            }
            (Guard::Strikes(normal), Effect::Impact(impact)) => impacts.push((*normal, impact)),
            (Guard::Sides { .. }, Effect::Impact(_)) => return Err(Why::Jump),
        }
    }
    if closed && !impacts.is_empty() {
        let all = system.laws.iter().enumerate();
        let others = all.filter(|(law, _)| !laws.contains(law));
        impacts.extend(
            others.filter_map(|(_, law)| match (&law.guard, &law.effect) {
                (Guard::Strikes(normal), Effect::Impact(impact)) => {
                    (event.from[*normal] == Side::Slide).then_some((*normal, impact))
                }
                _ => None,
            }),
        );
    }
    match (impacts.is_empty(), rows.is_empty()) {
        (true, _) => Ok(Some((x, Jumped { rows }))),
        (false, true) => struck(functions, point, (event, sizes), &impacts),
        (false, false) => Ok(None),
    }
}

/// What a law sets: states with their values.
fn reset_to(
    functions: &mut Functions,
    point: Point,
    event: &Jump,
    reset: &Reset,
) -> Result<Vec<(usize, f64, Slope)>, Why> {
    let group = Group::new(
        Arc::new(reset.values.clone()),
        reset.inputs.clone(),
        functions.slots,
    );
    let values = group.values(&point, &mut functions.registers);
    let slopes = group.slopes(&point, &mut functions.registers);
    let slots = functions.slots;
    let slides = |slot: usize| {
        let switch = slot.checked_sub(slots.alpha(0));
        switch.is_some_and(|i| i < slots.n_switches && event.from[i] == Side::Slide)
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

/// Derivatives by t, states and directions, one after another.
fn whole(slope: &Slope) -> Vec<f64> {
    [&[slope.time], &slope.x[..], &slope.by].concat()
}

/// The state behind an impact of contacts that push, none where they do not.
fn struck(
    functions: &mut Functions,
    point: Point,
    (event, sizes): (&Jump, &[f64]),
    impacts: &[(usize, &Impact)],
) -> Result<Option<(Vec<f64>, Jumped)>, Why> {
    let n = functions.slots.n_states;
    let (mut sides, mut alpha) = (event.from.clone(), point.alpha.to_vec());
    let mut pushed: Vec<(usize, Slope, f64)> = Vec::new();
    for &(normal, impact) in impacts {
        (sides[normal], alpha[normal]) = (Side::Slide, 0.0);
        let group = Group::new(
            Arc::new(impact.numbers.clone()),
            impact.inputs.clone(),
            functions.slots,
        );
        let numbers = group.values(&point, &mut functions.registers);
        let slopes = group.slopes(&point, &mut functions.registers);
        let of_e: Vec<_> = slopes
            .iter()
            .filter(|s| s.0 == 0)
            .map(|s| (s.1, s.2))
            .collect();
        pushed.push((normal, Slope::of(functions, &of_e), numbers[0]));
        for &slip in &impact.slips {
            let behind = Point {
                x: &event.after,
                ..point
            };
            let psi = functions.psi(slip, 0, &event.from);
            let after = psi.value(&behind, &mut functions.registers);
            let slopes = psi.slopes(&behind, &mut functions.registers);
            let terms = slopes.iter().filter(|(slot, _)| (1..=n).contains(slot));
            let size: f64 = terms
                .map(|&(slot, slope)| slope.abs() * sizes[slot - 1])
                .sum();
            // With two entries friction has a direction of its own.
            if functions.system.across(slip).is_some() {
                return Err(Why::Jump);
            }
            if after.abs() <= STICKS * size {
                (sides[slip], alpha[slip]) = (Side::Slide, 0.5);
                let none = Slope {
                    time: 0.0,
                    x: vec![0.0; n],
                    by: vec![0.0; functions.n_directions()],
                };
                pushed.push((slip, none, 0.0));
            } else {
                sides[slip] = Side::of(after);
                alpha[slip] = 0.5 + 0.5 * sides[slip].sign();
            }
        }
    }
    let point = Point {
        alpha: &alpha,
        ..point
    };
    let switches: Vec<usize> = pushed.iter().map(|p| p.0).collect();
    let kicks = functions.kicks(&sides, &point, &switches);
    let k = switches.len();
    let width = 1 + n + functions.n_directions();
    // h with its slopes, and how these change.
    let (mut h, mut h_rows, mut h_bends) = (Vec::new(), Vec::new(), Vec::new());
    for &i in &switches {
        let psi = functions.psi(i, functions.n_derivatives(i), &sides);
        h.push(psi.value(&point, &mut functions.registers));
        let slopes = psi.slopes(&point, &mut functions.registers);
        h_rows.push(whole(&Slope::of(functions, &slopes)));
        h_bends.push(functions.bends(&psi, &point));
    }
    let product = |row: &[f64], kick: &[f64]| -> f64 {
        row[1..=n].iter().zip(kick).map(|(a, b)| a * b).sum()
    };
    let matrix: Vec<f64> = h_rows
        .iter()
        .flat_map(|row| kicks.iter().map(|kick| product(row, &kick.0)))
        .collect();
    let mut lu = DenseLu::new(k);
    lu.factor(&matrix).map_err(|_| Why::Jump)?;
    let mut lambda: Vec<f64> = (0..k).map(|i| -(1.0 + pushed[i].2) * h[i]).collect();
    lu.solve(&mut lambda);
    let pushes = |at: usize| !functions.system.is_unilateral(switches[at]) || lambda[at] > 0.0;
    if !(0..k).all(pushes) {
        return Ok(None);
    }
    let mut x = point.x.to_vec();
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let mut row = vec![0.0; width];
            row[1 + i] = 1.0;
            row
        })
        .collect();
    // By columns: δλ, and with it δx⁺.
    for column in 0..width {
        let mut rhs: Vec<f64> = (0..k)
            .map(|i| {
                let e = whole(&pushed[i].1);
                let mut sum = e[column] * h[i] + (1.0 + pushed[i].2) * h_rows[i][column];
                for (l, kick) in kicks.iter().enumerate() {
                    let of_kick: f64 = (0..n).map(|j| h_rows[i][1 + j] * kick.1[j][column]).sum();
                    let of_row: f64 = (0..n).map(|j| h_bends[i][j][column] * kick.0[j]).sum();
                    sum += (of_kick + of_row) * lambda[l];
                }
                -sum
            })
            .collect();
        lu.solve(&mut rhs);
        for (i, row) in rows.iter_mut().enumerate() {
            for (l, kick) in kicks.iter().enumerate() {
                row[column] += kick.0[i] * rhs[l] + kick.1[i][column] * lambda[l];
            }
        }
    }
    for (l, kick) in kicks.iter().enumerate() {
        x.iter_mut()
            .zip(&kick.0)
            .for_each(|(x, d)| *x += d * lambda[l]);
    }
    let slope = |row: Vec<f64>| Slope {
        time: row[0],
        x: row[1..=n].to_vec(),
        by: row[1 + n..].to_vec(),
    };
    let rows = rows.into_iter().map(slope).enumerate().collect();
    Ok(Some((x, Jumped { rows })))
}
