//! Against closed forms: smooth fields, dense output, a jump, sliding.

use std::ops::ControlFlow;

use super::{Field, Settings, Simulator};
use crate::event::{Event, Observer, Segment};
use crate::hybrid::{Outcome, Side, Status};

/// A field with one sign at most.
struct Given<F, P> {
    n: usize,
    psi: Option<P>,
    rates: F,
}

impl<F: FnMut(f64, &[f64], &mut [f64]), P: Fn(f64, &[f64]) -> f64> Field for Given<F, P> {
    fn n_states(&self) -> usize {
        self.n
    }

    fn n_switches(&self) -> usize {
        usize::from(self.psi.is_some())
    }

    fn sides(&mut self, t: f64, x: &[f64], sides: &mut [Side]) {
        if let Some(psi) = &self.psi {
            sides[0] = Side::of(psi(t, x));
        }
    }

    fn rates(&mut self, t: f64, x: &[f64], rates: &mut [f64]) {
        (self.rates)(t, x, rates);
    }
}

type NoSign = fn(f64, &[f64]) -> f64;

/// The largest error between the points too, and the number of events.
struct Against<E> {
    exact: E,
    error: f64,
    events: usize,
}

impl<E: Fn(f64) -> Vec<f64>> Observer for Against<E> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let mut x = vec![0.0; segment.end.len()];
        for share in [0.0, 0.1, 0.35, 0.5, 0.8, 1.0] {
            let tau = share * segment.length;
            segment.state(tau, &mut x);
            let exact = (self.exact)(segment.start + tau);
            let apart = x.iter().zip(exact).map(|(a, b)| (a - b).abs());
            self.error = apart.fold(self.error, f64::max);
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {
        self.events += 1;
    }
}

fn settings(tolerance: f64) -> Settings {
    Settings {
        tolerance,
        ..Settings::default()
    }
}

/// x'' = -x to t = 20 from x = cos 0, within it and at its end.
fn oscillation(tolerance: f64) -> (Outcome, f64) {
    let field = Given {
        n: 2,
        psi: None::<NoSign>,
        rates: |_, x: &[f64], f: &mut [f64]| (f[0], f[1]) = (x[1], -x[0]),
    };
    let mut simulator = Simulator::new(field, settings(tolerance));
    let mut against = Against {
        exact: |t: f64| vec![t.cos(), -t.sin()],
        error: 0.0,
        events: 0,
    };
    let outcome = simulator.run(0.0, 20.0, &[1.0, 0.0], &mut against);
    (outcome, against.error)
}

/// How far its end is off.
fn error_at_end(outcome: &Outcome) -> f64 {
    (outcome.x[0] - 20_f64.cos()).hypot(outcome.x[1] + 20_f64.sin())
}

#[test]
fn a_pendulum_of_one_frequency_is_followed_between_the_points_too() {
    for tolerance in [1e-3, 1e-6, 1e-9, 1e-11] {
        let (outcome, error) = oscillation(tolerance);
        assert_eq!((outcome.status, outcome.time), (Status::Solved, 20.0));
        assert!(error < tolerance, "{tolerance:e}: {error:e}");
        assert!(outcome.stats.steps < 100, "{:?}", outcome.stats);
    }
}

#[test]
fn time_is_an_argument_and_the_last_step_ends_at_the_end() {
    let field = Given {
        n: 1,
        psi: None::<NoSign>,
        rates: |t: f64, x: &[f64], f: &mut [f64]| f[0] = 3.0 * t * t - (x[0] - t.powi(3)),
    };
    let mut simulator = Simulator::new(field, settings(1e-11));
    let exact = |t: f64| vec![t.powi(3) + (-t).exp()];
    let mut against = Against {
        exact,
        error: 0.0,
        events: 0,
    };
    let outcome = simulator.run(0.0, 3.0, &[1.0], &mut against);
    assert_eq!(outcome.time, 3.0);
    assert!((outcome.x[0] - exact(3.0)[0]).abs() < 1e-10);
    assert!(against.error < 1e-9, "{:e}", against.error);
}

#[test]
fn a_jump_costs_steps_and_is_seen_at_a_point() {
    // x' = 1 below 1, 3 above: x = t up to 1, 3 t - 2 from there.
    let field = Given {
        n: 1,
        psi: Some(|_: f64, x: &[f64]| x[0] - 1.0),
        rates: |_, x: &[f64], f: &mut [f64]| f[0] = if x[0] < 1.0 { 1.0 } else { 3.0 },
    };
    let mut simulator = Simulator::new(field, settings(1e-7));
    let exact = |t: f64| vec![t.max(3.0 * t - 2.0)];
    let mut against = Against {
        exact,
        error: 0.0,
        events: 0,
    };
    let outcome = simulator.run(0.0, 2.0, &[0.0], &mut against);
    assert_eq!(outcome.status, Status::Solved);
    assert_eq!((outcome.x.len(), against.events), (1, 1));
    assert!((outcome.x[0] - 4.0).abs() < 4e-7, "{}", outcome.x[0]);
    assert!(outcome.stats.rejected > 2, "{:?}", outcome.stats);
}

/// Here all rows of a step that starts on the surface agree, on x - H/2 in the second case.
#[test]
fn sliding_ends_at_a_limit_of_steps() {
    for (below, above) in [(1.0, -1.0), (1.0, -2.0)] {
        let field = Given {
            n: 1,
            psi: Some(|_: f64, x: &[f64]| x[0]),
            rates: |_, x: &[f64], f: &mut [f64]| f[0] = if x[0] < 0.0 { below } else { above },
        };
        let limited = Settings {
            max_steps: 1000,
            ..settings(1e-7)
        };
        let mut simulator = Simulator::new(field, limited);
        let mut against = Against {
            exact: |t: f64| vec![(1.0 + above * t).max(0.0)],
            error: 0.0,
            events: 0,
        };
        let outcome = simulator.run(0.0, 3.0, &[1.0], &mut against);
        assert_eq!(outcome.status, Status::StepLimit);
        assert!(outcome.time > -1.0 / above, "{}", outcome.time);
        assert!(against.error < 1e-6, "{:e}", against.error);
        assert!(outcome.stats.steps + outcome.stats.rejected == 1000);
    }
}

#[test]
fn what_leaves_the_numbers_ends_the_run() {
    // x' = x² from 1 is 1/(1 - t).
    let field = Given {
        n: 1,
        psi: None::<NoSign>,
        rates: |_, x: &[f64], f: &mut [f64]| f[0] = x[0] * x[0],
    };
    let mut simulator = Simulator::new(field, settings(1e-6));
    let mut against = Against {
        exact: |t: f64| vec![1.0 / (1.0 - t)],
        error: 0.0,
        events: 0,
    };
    let outcome = simulator.run(0.0, 2.0, &[1.0], &mut against);
    assert_eq!(outcome.status, Status::StepLimit);
    assert!(outcome.time < 1.0 + 1e-6);
}

/// How far (x, x')(20) of x'' = -x is from (cos 20, -sin 20) by n steps of the method of order 5 of
/// Dormand & Prince (Hairer, Nørsett & Wanner 1993, table II.5.2), which asks for f six times a step.
/// Steps of one length are the best there for a field of one frequency.
fn error_of_order_five(n: usize) -> f64 {
    const A: [&[f64]; 6] = [
        &[0.2],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[
            19372.0 / 6561.0,
            -25360.0 / 2187.0,
            64448.0 / 6561.0,
            -212.0 / 729.0,
        ],
        &[
            9017.0 / 3168.0,
            -355.0 / 33.0,
            46732.0 / 5247.0,
            49.0 / 176.0,
            -5103.0 / 18656.0,
        ],
        &[
            35.0 / 384.0,
            0.0,
            500.0 / 1113.0,
            125.0 / 192.0,
            -2187.0 / 6784.0,
            11.0 / 84.0,
        ],
    ];
    let h = 20.0 / n as f64;
    let mut x = [1.0, 0.0];
    for _ in 0..n {
        let mut slopes = vec![[x[1], -x[0]]];
        for row in A {
            let moved = |i: usize| {
                let terms = row.iter().zip(&slopes);
                x[i] + h * terms.map(|(a, slope)| a * slope[i]).sum::<f64>()
            };
            let next = [moved(0), moved(1)];
            slopes.push([next[1], -next[0]]);
            if slopes.len() > A.len() {
                x = next;
            }
        }
    }
    (x[0] - 20_f64.cos()).hypot(x[1] + 20_f64.sin())
}

#[test]
fn order_five_asks_for_the_field_more_often_where_it_is_smooth_and_much_is_wanted() {
    for (tolerance, times) in [(1e-6, 1.9), (1e-9, 5.5), (1e-11, 10.0)] {
        let (outcome, _) = oscillation(tolerance);
        let (error, evaluations) = (error_at_end(&outcome), outcome.stats.rhs_evaluations);
        let other = error_of_order_five((times * evaluations as f64 / 6.0) as usize);
        assert!(other > error, "{tolerance:e}: {other:e} {error:e}");
    }
}

/// T_{9,9} multiplies what rounding leaves in T_{j,1} by up to 100: plain sums end 1e-13 away.
#[test]
fn extrapolation_does_not_multiply_the_rounding_of_substeps() {
    for tolerance in [1e-12, 6e-13, 3e-13] {
        let error = error_at_end(&oscillation(tolerance).0);
        assert!(error < 3e-14, "{tolerance:e}: {error:e}");
    }
}
