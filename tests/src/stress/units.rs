//! The same systems in other units: what a method compares with a fixed number shows here.

use super::{Case, Extent, Family};
use crate::affine::Affine;
use crate::affine::exact::{End, Solution, solve};

/// States in units of 2^±27, time in units of 2^±20.
pub fn families(extent: Extent) -> Vec<Family> {
    let states = extent.sweep(&[-27, 27], &[-27, -20, -13, -7, 0, 7, 13, 20, 27]);
    let times = extent.sweep(&[-20, 7, 13], &[-20, -13, -7, 0, 7, 13, 20]);
    let count = extent.of(4, 14);
    let systems: Vec<_> = systems().take(count).collect();
    let cases = |powers: &[i32], units: fn(i32, usize) -> (Vec<f64>, f64)| {
        let in_units = |power: &i32| {
            let power = *power;
            let of = move |(system, solution): &(Affine, Solution)| {
                let (states, time) = units(power, system.n);
                case(system, solution, power, &states, time)
            };
            systems.iter().flat_map(of).collect::<Vec<_>>()
        };
        powers.iter().flat_map(in_units).collect()
    };
    vec![
        Family {
            name: "scales of states",
            about: "Random piecewise affine systems of 2 to 8 states that cross and slide, all states times a \
                    power of two, from 1e-8 to 1e8; matrix exponentials.",
            hardness: "factor",
            cases: cases(&states, |power, n| (vec![2.0_f64.powi(power); n], 1.0)),
        },
        Family {
            name: "states far apart",
            about: "The same, every other state divided by the factor instead: up to 1e16 between them.",
            hardness: "factor",
            cases: cases(&states, |power, n| {
                let sign = |i: usize| if i.is_multiple_of(2) { power } else { -power };
                ((0..n).map(|i| 2.0_f64.powi(sign(i))).collect(), 1.0)
            }),
        },
        Family {
            name: "scales of time",
            about: "The same in other units of time, from 1e-6 to 1e6.",
            hardness: "factor",
            cases: cases(&times, |power, n| (vec![1.0; n], 2.0_f64.powi(power))),
        },
    ]
}

/// Systems with at least three events and some sliding, none of which is met at a small angle.
fn systems() -> impl Iterator<Item = (Affine, Solution)> {
    let solved = (0..).map(|seed| {
        let system = Affine::random(seed);
        let solution = solve(&system);
        (system, solution)
    });
    solved.filter(|(_, solution)| {
        let legs = &solution.legs;
        let is_clear = legs.iter().skip(1).all(|leg| leg.transversality > 1e-2);
        let slides = legs.iter().any(|leg| leg.sides.contains(&0));
        solution.end == End::Horizon && legs.len() > 3 && is_clear && slides
    })
}

fn case(system: &Affine, solution: &Solution, power: i32, states: &[f64], time: f64) -> [Case; 2] {
    let turned = system.in_units(states, time);
    let times: Vec<f64> = (solution.legs.iter().skip(1))
        .map(|leg| time * leg.start)
        .collect();
    let exact = solution.state(system.horizon);
    let magnitudes = magnitudes(solution, system);
    let case = Case::new(format!("2^{power}"), turned.model(), turned.horizon).switches_at(&times);
    let scaled = |values: &[f64]| -> Vec<f64> {
        let pairs = states.iter().zip(values);
        pairs.map(|(unit, value)| unit * value).collect()
    };
    let case = case.ends_each("x", &scaled(exact.as_slice()), &scaled(&magnitudes));
    case.within(20).both()
}

/// The largest magnitude of every state, over a grid.
pub fn magnitudes(solution: &Solution, system: &Affine) -> Vec<f64> {
    let mut largest = vec![0.0_f64; system.n];
    for k in 0..=200 {
        let x = solution.state(system.horizon * f64::from(k) / 200.0);
        for (largest, x) in largest.iter_mut().zip(x.iter()) {
            *largest = largest.max(x.abs());
        }
    }
    largest
}
