//! Functions that are made of ⌊u⌋, the largest integer that is not above u, and jump or bend where it jumps.
//!
//! ceil(u) = -⌊-u⌋,  round(u) = ⌊u + 1/2⌋,  frac(u) = mod(u, 1),  mod(u, T) = u - T ⌊u/T⌋
//!
//! Of a time t with a period T, s = t/T is the number of periods, and
//!
//! sawtooth = s - ⌊s⌋,  pulse = ⌊s⌋ - ⌊s - d⌋,  triangle = q + p (2 - 2q)
//!
//! with q = 2 (s - ⌊s⌋), which is in [0, 2), and p = ⌊2s⌋ - 2⌊s⌋, which is 1 in the second half of a period.
//! Where the duty d moves, pulse = step(d - sawtooth) has a switch of its own.

use super::builtins::fold_with;
use super::calls::{Call, wrong};
use crate::expr::{Expr, Var, variables_of};
use crate::model::expressions::Lowering;
use crate::model::names::scope::{Meaning, Reported};
use crate::model::{Rounded, Surface, TargetKind, Tensor};

/// A function of values; their number is right.
pub(crate) fn rounding<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    values: &[Tensor<'e>],
) -> Result<Tensor<'e>, Reported> {
    let u = &values[0];
    match call.name {
        "floor" => return Ok(floors(lowering, call, u, [None; 2])),
        "ceil" => {
            let floors = floors(lowering, call, &u.map(|u| -u), [None; 2]);
            return Ok(floors.map(|floor| -floor));
        }
        "round" => return Ok(floors(lowering, call, &u.map(|u| u + 0.5), [None; 2])),
        _ => {}
    }
    let one = Tensor::scalar(lowering.constant(1.0));
    let period = values.get(1).unwrap_or(&one);
    check_numbers(lowering, call, period, "a positive period", |period| {
        period > 0.0 && period.is_finite()
    })?;
    let turns = fold_with(lowering, call, &[u.clone(), period.clone()], |u, period| {
        u / period
    })?;
    let whole = floors(lowering, call, &turns, [Some(period), None]);
    let rest = turns.zip(&whole, |turns, whole| turns - whole);
    let rest = rest.ok_or(Reported)?;
    match call.name {
        "sawtooth" => Ok(rest),
        "triangle" => {
            let halves = floors(
                lowering,
                call,
                &turns.map(|s| 2.0 * s),
                [Some(period), None],
            );
            let falls = halves.zip(&whole, |halves, whole| halves - 2.0 * whole);
            let falls = falls.ok_or(Reported)?;
            let triangle = |rest: Expr<'e>, falls| 2.0 * rest + falls * (2.0 - 4.0 * rest);
            rest.zip(&falls, triangle).ok_or(Reported)
        }
        "pulse" => pulse(
            lowering,
            call,
            [&turns, &whole, &rest],
            [period, &values[2]],
        ),
        _ => {
            let whole = fold_with(lowering, call, &[whole, period.clone()], |whole, period| {
                period * whole
            })?;
            u.zip(&whole, |u, whole| u - whole).ok_or(Reported)
        }
    }
}

/// 1 for the share d of each period, else 0.
fn pulse<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    [turns, whole, rest]: [&Tensor<'e>; 3],
    [period, duty]: [&Tensor<'e>; 2],
) -> Result<Tensor<'e>, Reported> {
    check_numbers(lowering, call, duty, "a duty between 0 and 1", |duty| {
        (0.0..=1.0).contains(&duty)
    })?;
    if is_fixed(lowering, duty) {
        let late = [turns.clone(), duty.clone()];
        let late = fold_with(lowering, call, &late, |turns, duty| turns - duty)?;
        let late = floors(lowering, call, &late, [Some(period), Some(duty)]);
        return fold_with(lowering, call, &[whole.clone(), late], |whole, late| {
            whole - late
        });
    }
    let ahead = [duty.clone(), rest.clone()];
    let ahead = fold_with(lowering, call, &ahead, |duty, rest| duty - rest)?;
    let text = |arg: usize| lowering.names.whole().text(call.args[arg]);
    let name = format!("{} - sawtooth({}, {})", text(2), text(0), text(1));
    for (position, &psi) in ahead.data.iter().enumerate() {
        let name = match ahead.data.len() {
            1 => name.clone(),
            _ => ahead.shape.entry_name(&format!("({name})"), position),
        };
        (lowering.surfaces).push(Surface::new(name, psi, call.span));
    }
    Ok(ahead.map(Expr::step))
}

/// Whether values consist of numbers and parameters of the model.
fn is_fixed(lowering: &Lowering<'_, '_>, value: &Tensor<'_>) -> bool {
    let names = lowering.names.scope.names.values();
    let params = names.filter_map(|meaning| match meaning {
        Meaning::Value(value, TargetKind::Param(_)) => Some(&value.tensor.data),
        _ => None,
    });
    let params: Vec<Var> = params
        .flatten()
        .filter_map(|param| param.as_variable())
        .collect();
    let of = variables_of(&value.data);
    of.iter().all(|var| params.contains(var))
}

/// An error for the first number that is not what it has to be.
fn check_numbers(
    lowering: &mut Lowering<'_, '_>,
    call: &Call,
    value: &Tensor<'_>,
    expected: &str,
    holds: impl Fn(f64) -> bool,
) -> Result<(), Reported> {
    let mut numbers = value.data.iter().filter_map(|entry| entry.as_constant());
    match numbers.find(|&number| !holds(number)) {
        Some(number) => wrong(lowering, call, expected, &number.to_string()),
        None => Ok(()),
    }
}

/// ⌊u⌋, remembered with the period and the duty that u is made of.
fn floors<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    u: &Tensor<'e>,
    [period, duty]: [Option<&Tensor<'e>>; 2],
) -> Tensor<'e> {
    let entry = |of: Option<&Tensor<'e>>, k: usize| {
        let data = &of?.data;
        data.get(k).or(data.last()).copied()
    };
    let calls = u.data.iter().enumerate();
    lowering.rounded.extend(calls.map(|(k, &argument)| Rounded {
        argument,
        period: entry(period, k),
        duty: entry(duty, k),
        span: call.span,
    }));
    u.map(Expr::floor)
}
