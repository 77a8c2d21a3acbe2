//! Functions of states that are narrow beside the steps of a run, and vanish with all derivatives where these start.
//!
//! s moves by a law that is known, and y' = B(s) s', so that y is the integral of B over s whatever the speed.

use std::f64::consts::PI;

use super::{Case, Extent, Family, Promise, by_hardness};
use crate::random::Random;

/// Instances in all.
const COUNT: usize = 240;

/// Those of a normal test.
const FEW: usize = 12;

/// That of a Lorentz curve: ∫ (1 + u²)⁻ᵖ du = π (2p - 3)!!/(2p - 2)!!.
const POWER: u32 = 2000;

pub fn families(extent: Extent) -> Vec<Family> {
    let count = extent.of(FEW, COUNT);
    let mut random = Random(20_250_117);
    vec![Family {
        name: "narrow functions of states",
        about: "y' = B(s) s' with a Gauss or Lorentz curve, a power of the latter, a hyperbolic secant with or without \
                overflow, or a difference of two tanh, in the rate or in a switching function, at a random place, width, \
                tolerance and law of s; integrals of B over s.",
        hardness: "width from",
        cases: by_hardness((0..count).flat_map(|at| by_all(bump(at, &mut random)))),
    }]
}

/// A body that strikes a wall, for methods that take contacts.
const CONTACT: &str = "state q = 0; state v = 1; q' = v;
    mechanics q, v { mass = 1; force = 0; contact wall { gap = 9 - q; restitution = 0.5; } }";

/// By events, which find them, and by methods that have to say what they have passed over.
fn by_all(case: Case) -> Vec<Case> {
    let [elements, adaptive] = ["fesd", "adaptive"].map(|method| case.clone().by(method));
    let grid = case.clone().by("fesd { steps = 20; }");
    let grid = grid.promises(Promise::Grid(20));
    let steps = case.clone().in_steps(50);
    let mut beside = case.clone().within(20);
    beside.model = format!("{} {CONTACT}", beside.model);
    let frozen = beside.clone().by("fesd; lower timefreezing");
    let impulses = beside.clone().by("fesd { steps = 20; } lower impact");
    let impulses = impulses.promises(Promise::Grid(20));
    // These take no switches that jump.
    let impacts = Some(beside.in_steps(50)).filter(|case| !case.model.contains("if "));
    let all = [case, elements, grid, adaptive, steps, frozen, impulses];
    all.into_iter().chain(impacts).collect()
}

/// s, its rate, and where it ends after 10.
fn laws() -> [(f64, &'static str, f64); 4] {
    [
        (0.0, "1", 10.0),
        (0.0, "(1 + 0.5*cos(time))", 10.0 + 0.5 * 10_f64.sin()),
        (10.0, "(-s/3)", 10.0 * (-10.0_f64 / 3.0).exp()),
        // s = 10/(1 + 99 exp(-t))
        (
            0.1,
            "(s*(1 - s/10))",
            10.0 / (1.0 + 99.0 * (-10.0_f64).exp()),
        ),
    ]
}

fn bump(at: usize, random: &mut Random) -> Case {
    let (from, rate, to) = random.of(&laws());
    let (low, high) = (f64::min(from, to), f64::max(from, to));
    // Tails of exp(-100) are cut off.
    let center = low + 1.5 + (high - low - 3.0) * random.unit();
    let width = 10_f64.powf(-6.0 + 5.0 * random.unit());
    let tolerance = random.of(&[1e-4, 1e-6, 1e-8, 1e-10]);
    let start = random.of(&[0.0, 1.0]);
    let u = |s: f64| (s - center) / width;
    let far = format!("((s - {center:?})/{width:?})");
    // The curve, its integral in widths, and half of its width at half of its height.
    let root = 2_f64.ln().sqrt();
    let (curve, area, half) = match at % 6 {
        0 => (format!("exp(-{far}^2)"), PI.sqrt(), root),
        1 => (
            format!("1/(1 + {far}^2)"),
            u(high).atan() - u(low).atan(),
            1.0,
        ),
        2 => (
            format!("2*exp(-abs({far}))/(1 + exp(-2*abs({far})))"),
            PI,
            2.0_f64.acosh(),
        ),
        3 => (format!("1/cosh({far})"), PI, 2.0_f64.acosh()),
        4 => (
            format!("(1 + {far}^2)^(-{POWER})"),
            (1..POWER).fold(PI, |area, k| area * f64::from(2 * k - 1) / f64::from(2 * k)),
            (2_f64.ln() / f64::from(POWER)).exp_m1().sqrt(),
        ),
        _ => (
            format!("0.5*(tanh({far} + 3) - tanh({far} - 3))"),
            6.0,
            f64::NAN,
        ),
    };
    let sign = (to - from).signum();
    // tanh(3 + u) = tanh(u - 3) + 1, where u is the half: found from both ends.
    let half = if half.is_nan() { plateau() } else { half };
    let (body, integral) = match random.of(&[false, true]) {
        false => (format!("y' = {rate}*{curve}/{width:?};"), sign * area),
        true => (
            format!("y' = if {curve} > 0.5 then {rate}/{width:?} else 0;"),
            sign * 2.0 * half,
        ),
    };
    let model = format!("state s = {from:?}; state y = {start:?}; s' = {rate}; {body}");
    let exact = start + integral;
    // The place is known to a rounding of s, which the ends of the plateau are from zero.
    let rounding = 16.0 * f64::EPSILON * 10.0 / width;
    let decade = 10_f64.powf(width.log10().floor());
    let mut case = Case::new(format!("{decade:.0e}"), model, 10.0)
        .ends("y", &[exact], exact.abs().max(1.0))
        .rounds(rounding)
        .accurate_if(false);
    case.tolerance = tolerance;
    case
}

/// Where 0.5 (tanh(u + 3) - tanh(u - 3)) is 0.5, by bisection.
fn plateau() -> f64 {
    let height = |u: f64| 0.5 * ((u + 3.0).tanh() - (u - 3.0).tanh());
    let (mut inside, mut outside) = (0.0, 6.0);
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        if height(middle) > 0.5 {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}
