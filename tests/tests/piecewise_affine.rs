//! Random piecewise affine systems against their solutions by matrix exponentials.
//!
//! The modes, their times and the states of 200 systems, at tolerances from 1e-6 to 1e-11. Where
//! several solutions go on from a point, the run must say so there. (Some solution goes on from
//! every point: fields that add are a variational inequality on a box, which has one.)

use std::thread;

use nsd_tests::affine::Affine;
use nsd_tests::affine::exact::{End, Leg, Solution, solve};
use nsd_tests::{end, larger, run};
use nsdc::report::{Side, Status, Trajectory};

/// What the systems of one test have been about.
#[derive(Default, Debug)]
struct Seen {
    events: usize,
    /// Legs by the number of surfaces that slide.
    codimensions: [usize; 5],
    branches: usize,
}

/// The first `count` systems from a seed on whose solutions are affine in every mode.
fn systems(
    make: fn(u64) -> Affine,
    seed: u64,
    count: usize,
) -> impl Iterator<Item = (u64, Affine, Solution)> {
    let solved = (seed..).map(move |seed| {
        let system = make(seed);
        let solution = solve(&system);
        (seed, system, solution)
    });
    solved
        .filter(|(_, _, solution)| !matches!(solution.end, End::Unsuitable | End::Events(_)))
        .take(count)
}

/// Compares the runs of `count` systems, each in its units.
fn compare(
    make: fn(u64) -> Affine,
    units: fn(u64, usize) -> (Vec<f64>, f64),
    first: u64,
    count: usize,
) -> Seen {
    let mut seen = Seen::default();
    let mut wrong = Vec::new();
    for (seed, system, solution) in systems(make, first, count) {
        let tolerance = 10.0_f64.powi(-6 - (seed % 6) as i32);
        let (states, time) = units(seed, system.n);
        let text = system.in_units(&states, time).text(tolerance);
        let trajectory = in_units_of(run(&text, "run"), &states, time);
        if let Err(reason) = agrees(&trajectory, &solution, tolerance) {
            wrong.push(format!("seed {seed}: {reason}\n{text}"));
        }
        seen.events += solution.legs.len().saturating_sub(1);
        for leg in &solution.legs {
            seen.codimensions[leg.sides.iter().filter(|side| **side == 0).count()] += 1;
        }
        seen.branches += usize::from(matches!(solution.end, End::Branches(..)));
    }
    let n_wrong = wrong.len();
    assert!(
        wrong.is_empty(),
        "{n_wrong} of {count}\n{}",
        wrong.join("\n")
    );
    seen
}

/// Takes the units off again. They are powers of two, so that nothing is rounded.
fn in_units_of(mut trajectory: Trajectory, states: &[f64], time: f64) -> Trajectory {
    trajectory.samples.time.iter_mut().for_each(|t| *t /= time);
    for interval in &mut trajectory.history.modes {
        interval.from /= time;
        interval.to /= time;
    }
    for row in trajectory.samples.states[0].values.chunks_mut(states.len()) {
        row.iter_mut()
            .zip(states)
            .for_each(|(x, state)| *x /= state);
    }
    trajectory
}

fn as_they_are(_: u64, n: usize) -> (Vec<f64>, f64) {
    (vec![1.0; n], 1.0)
}

/// Ratios of up to 1e15 between states, and of up to 1e6 in time.
fn far_apart(seed: u64, n: usize) -> (Vec<f64>, f64) {
    let power = |k: u64, largest: i32| {
        let spread = (seed * 31 + k * 17) % (2 * largest as u64 + 1);
        2.0_f64.powi(spread as i32 - largest)
    };
    ((0..n as u64).map(|i| power(i, 26)).collect(), power(8, 20))
}

/// Compares modes, then times and states; the reason when they differ.
fn agrees(trajectory: &Trajectory, solution: &Solution, tolerance: f64) -> Result<(), String> {
    ends_as_due(trajectory, solution, tolerance)?;
    let modes = modes(trajectory);
    let exact: Vec<_> = solution.legs.iter().map(|leg| leg.sides.clone()).collect();
    let found: Vec<_> = modes.iter().map(|(_, sides)| sides.clone()).collect();
    if found != exact && !exact.is_empty() {
        return Err(format!("modes {found:?} instead of {exact:?}"));
    }
    for ((t, _), leg) in modes.iter().zip(&solution.legs) {
        // An error of the states moves what crosses zero by as much.
        let shift = (t - leg.start).abs();
        if shift * leg.transversality > tolerance {
            return Err(format!("event at {t} instead of {}", leg.start));
        }
    }
    if exact.is_empty() {
        return Ok(());
    }
    is_accurate(trajectory, solution, tolerance)
}

/// Whether the run is solved, or ends where the solution does and says why.
fn ends_as_due(trajectory: &Trajectory, solution: &Solution, tolerance: f64) -> Result<(), String> {
    let reason = trajectory
        .failure
        .as_ref()
        .map(|failure| failure.to_string());
    let reason = reason.unwrap_or_default();
    match solution.end {
        End::Branches(at, count) => {
            if trajectory.status != Status::NumericalFailure {
                return Err(format!("{count} solutions at {at} are passed in silence"));
            }
            let t = trajectory.samples.time.last().copied().unwrap_or(0.0);
            if (t - at).abs() > tolerance {
                return Err(format!("ends at {t} instead of {at}: {reason}"));
            }
            let code = if count == 0 {
                "no solution"
            } else {
                "solutions go on"
            };
            if !reason.contains(code) {
                return Err(format!("{count} solutions at {at}, but: {reason}"));
            }
        }
        _ if trajectory.status != Status::Solved => return Err(reason),
        _ => {}
    }
    Ok(())
}

/// Where modes begin, and the sides of their surfaces: -1, 0 and 1, or 2 where there is none.
fn modes(trajectory: &Trajectory) -> Vec<(f64, Vec<i8>)> {
    // Surfaces are numbered by the last character of their names.
    let number = |name: &String| {
        name.bytes()
            .last()
            .map_or(0, |digit| usize::from(digit - b'1'))
    };
    let modes = trajectory.history.modes.iter().map(|interval| {
        let mut sides = vec![2; interval.sides.len()];
        for (name, side) in trajectory.history.switches.iter().zip(&interval.sides) {
            sides[number(name)] = match side {
                Side::Below | Side::Off => -1,
                Side::Sliding | Side::Closed | Side::Stick | Side::Active => 0,
                Side::Above | Side::On | Side::Open | Side::Slip | Side::Inactive => 1,
            };
        }
        (interval.from, sides)
    });
    modes.collect()
}

/// Whether the states are, and the estimate of their error.
fn is_accurate(trajectory: &Trajectory, solution: &Solution, tolerance: f64) -> Result<(), String> {
    let states = &trajectory.samples.states[0];
    let n = states.n_entries();
    let (mut error, mut scale) = (vec![0.0_f64; n], vec![0.0_f64; n]);
    for (k, &t) in trajectory.samples.time.iter().enumerate() {
        let exact = solution.state(t);
        for (i, x) in states.at(k).iter().enumerate() {
            error[i] = larger(error[i], (x - exact[i]).abs());
            scale[i] = scale[i].max(exact[i].abs());
        }
    }
    let relative = error.iter().zip(&scale).map(|(error, scale)| error / scale);
    let error = relative.fold(0.0, f64::max);
    if error > tolerance {
        return Err(format!("error {error:e} at tolerance {tolerance:e}"));
    }
    let estimate = trajectory.quality.error_estimate.unwrap_or(0.0);
    let rounding = 10.0 * solution.rounding + 64.0 * f64::EPSILON;
    if error > 10.0 * estimate + rounding {
        return Err(format!(
            "error {error:e} is far above its estimate {estimate:e}"
        ));
    }
    Ok(())
}

#[test]
fn two_hundred_systems_follow_their_matrix_exponentials() {
    let seen: Vec<Seen> = thread::scope(|scope| {
        let parts = [0, 1000, 2000, 3000]
            .map(|seed| scope.spawn(move || compare(Affine::random, as_they_are, seed, 50)));
        let finished = parts.map(|part| part.join());
        finished.into_iter().map(Result::unwrap).collect()
    });
    let total = |count: &dyn Fn(&Seen) -> usize| seen.iter().map(count).sum::<usize>();
    assert!(total(&|seen| seen.events) >= 500);
    for codimension in 0..=4 {
        assert!(
            total(&|seen| seen.codimensions[codimension]) >= 5,
            "{codimension}"
        );
    }
    assert!(total(&|seen| seen.branches) >= 5);
}

#[test]
fn units_change_nothing() {
    let seen = compare(Affine::random, far_apart, 4000, 25);
    assert!(seen.events >= 50 && seen.codimensions[2] >= 5);
}

#[test]
fn surfaces_may_be_nearly_parallel() {
    let seen = compare(Affine::nearly_parallel, as_they_are, 5000, 25);
    assert!(seen.events >= 50 && seen.codimensions[2] >= 5);
}

/// Compares the end of a run by elements with the solution.
fn ends_by_elements(seed: u64) -> Solution {
    let system = Affine::random(seed);
    let solution = solve(&system);
    let text = format!(
        "model m {{\n{}}}\nsimulate run of m {{ horizon {:?}; method fesd; }}",
        system.model(),
        system.horizon
    );
    let trajectory = run(&text, "run");
    assert_eq!(trajectory.status, Status::Solved, "{seed}");
    let exact = solution.state(system.horizon);
    for (found, exact) in end(&trajectory, "x").iter().zip(exact.iter()) {
        assert!(
            (found - exact).abs() <= 1e-8,
            "{seed}: {found}, not {exact}"
        );
    }
    solution
}

/// Sixteen weights for five equations: elements hold any that do.
#[test]
fn elements_slide_on_four_surfaces_between_sixteen_regions() {
    for seed in [84, 177, 358] {
        let solution = ends_by_elements(seed);
        let slides = |leg: &Leg| leg.sides == [0; 4];
        assert!(solution.legs.iter().any(slides), "{seed}");
    }
}

/// On two surfaces two states stand still: all weights that do so have rates that are rounding.
#[test]
fn elements_rest_where_weights_are_not_unique() {
    ends_by_elements(273);
}
