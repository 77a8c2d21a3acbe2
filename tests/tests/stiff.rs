//! Stiff models, which an implicit method integrates between their events: closed forms and published
//! values.

use nsd_tests::stress::{relay_exactly, root};
use nsd_tests::{distance, end, run};
use nsdc::report::{EventKind, Status, Trajectory};

fn assert_solved(trajectory: &Trajectory, most_steps: u64) {
    assert_eq!(trajectory.status, Status::Solved);
    let stats = &trajectory.quality.stats;
    assert!(stats.newton_iterations > 0 && stats.factorizations > 0);
    assert!(stats.steps <= most_steps, "{} steps", stats.steps);
}

/// A relay acts through a fast actuator on a slow oscillator.
fn relay(lambda: f64, tolerance: f64) -> Trajectory {
    let text = format!(
        "model relay {{
          state x = 1;
          state v = 0;
          state u = 0;
          switch s = sign(x);
          x' = v;
          v' = -u - 0.1*v;
          u' = -{lambda:e}*(u - s);
        }}
        simulate a of relay {{ horizon 10; tolerance {tolerance:e}; }}"
    );
    run(&text, "a")
}

#[test]
fn a_stiff_relay_meets_every_tolerance() {
    let lambda = 1e6;
    let (crossings, exact) = relay_exactly(lambda);
    for k in [3, 4, 6, 8, 10, 12] {
        let tolerance = 10.0_f64.powi(-k);
        let trajectory = relay(lambda, tolerance);
        assert_solved(&trajectory, 200);
        let found = ["x", "v", "u"].map(|name| end(&trajectory, name)[0]);
        let error =
            distance(&found, &exact).max(distance(&trajectory.history.switch_times(), &crossings));
        // Sums of terms of size 100 are what the closed form rounds.
        let rounding = 1e-13;
        assert!(error <= tolerance + rounding, "{error:e} at {tolerance:e}");
        let estimate = trajectory.quality.error_estimate.unwrap();
        assert!(
            error <= 10.0 * estimate + rounding,
            "{error:e} is above the estimate {estimate:e}"
        );
    }
}

#[test]
fn stiffness_costs_neither_steps_nor_accuracy() {
    for lambda in [1e4, 1e6, 1e9] {
        let (crossings, exact) = relay_exactly(lambda);
        let trajectory = relay(lambda, 1e-8);
        assert_solved(&trajectory, 200);
        let found = ["x", "v", "u"].map(|name| end(&trajectory, name)[0]);
        assert!(
            distance(&found, &exact) <= 1e-9,
            "{found:?} is not {exact:?}"
        );
        assert!(distance(&trajectory.history.switch_times(), &crossings) <= 1e-10);
    }
}

/// Slides twice, with α that follows the fast state, and leaves where α reaches its bounds: both kinds
/// of event inside implicit steps.
#[test]
fn sliding_starts_and_ends_within_implicit_steps() {
    for lambda in [1e4, 1e6, 1e9] {
        let text = format!(
            "model slip {{
              state y = 0.5;
              state z = 1;
              switch s = sign(y);
              y' = -s + 1.5*z;
              z' = -{lambda:e}*(z - cos(time));
            }}
            simulate a of slip {{ horizon 6; tolerance 1e-9; }}"
        );
        let trajectory = run(&text, "a");
        assert_solved(&trajectory, 400);
        // z = a cos t + b sin t + c e^{-λt} and its integral.
        let (a, b) = (
            lambda * lambda / (lambda * lambda + 1.0),
            lambda / (lambda * lambda + 1.0),
        );
        let z = |t: f64| a * t.cos() + b * t.sin() + (1.0 - a) * (-lambda * t).exp();
        let integral = |t: f64| {
            let fast = (1.0 - a) / lambda * (1.0 - (-lambda * t).exp());
            a * t.sin() + b * (1.0 - t.cos()) + fast
        };
        let t1 = root(|t| 0.5 - t + 1.5 * integral(t), 1.8, 2.0);
        let t2 = root(|t| 1.5 * z(t) + 1.0, 2.0, 3.0);
        let t3 = root(|t| t - t2 + 1.5 * (integral(t) - integral(t2)), 4.5, 5.2);
        let t4 = root(|t| 1.5 * z(t) - 1.0, 5.0, 6.0);
        let y = t4 - 6.0 + 1.5 * (integral(6.0) - integral(t4));
        assert!(distance(&trajectory.history.switch_times(), &[t1, t2, t3, t4]) <= 1e-10);
        let kinds: Vec<EventKind> = trajectory
            .history
            .events
            .iter()
            .map(|event| event.kind)
            .collect();
        let (enter, leave) = (EventKind::EnterSliding, EventKind::LeaveSliding);
        assert_eq!(kinds, [enter, leave, enter, leave]);
        assert!(distance(&end(&trajectory, "y"), &[y]) <= 1e-10);
        assert!(distance(&end(&trajectory, "z"), &[z(6.0)]) <= 1e-10);
    }
}

/// Slides on a circle around which a fast state drives it: the surface is curved, and so is φ.
#[test]
fn curved_surfaces_are_followed() {
    let lambda = 1e6;
    let text = "model turn {
          state x = 1;
          state y = 0;
          state z = 1;
          switch s = sign(x^2 + y^2 - 1);
          x' = -3*z*y + (0.3 - s)*x;
          y' = 3*z*x + (0.3 - s)*y;
          z' = -1e6*(z - cos(time));
        }
        simulate a of turn { horizon 10; tolerance 1e-9; }";
    let trajectory = run(text, "a");
    assert_solved(&trajectory, 300);
    assert!(
        trajectory.history.events.is_empty(),
        "it starts on the circle"
    );
    // The integral of z = (λ² cos t + λ sin t + e^{-λt})/(λ² + 1).
    let t: f64 = 10.0;
    let integral = lambda * lambda * t.sin() + lambda * (1.0 - t.cos()) + 1.0 / lambda;
    let angle = 3.0 * integral / (lambda * lambda + 1.0);
    let found = [end(&trajectory, "x")[0], end(&trajectory, "y")[0]];
    let exact = [angle.cos(), angle.sin()];
    assert!(
        distance(&found, &exact) <= 1e-9,
        "{found:?} is not {exact:?}"
    );
}

/// The dense output of an implicit step is as accurate as its end, for stiff components too.
#[test]
fn instants_within_implicit_steps_are_accurate() {
    let text = "model follow {
          state x = 1;
          x' = -1e9*(x - cos(time)) - sin(time);
        }
        simulate a of follow { horizon 10; output x every 0.01; }";
    let trajectory = run(text, "a");
    assert_solved(&trajectory, 100);
    for (k, t) in trajectory.samples.time.iter().enumerate() {
        let x = trajectory.samples.states[0].at(k)[0];
        assert!((x - t.cos()).abs() <= 1e-8, "{x} at {t}");
    }
}

/// Mazzia & Magherini 2008, problems VDPOL and ROBER.
#[test]
fn the_literature_agrees() {
    let van_der_pol = "model vdp {
          state y = 2;
          state z = 0;
          y' = z;
          z' = 1e6*((1 - y^2)*z - y);
        }
        simulate a of vdp { horizon 2; }";
    let trajectory = run(van_der_pol, "a");
    assert_solved(&trajectory, 1000);
    let found = [end(&trajectory, "y")[0], end(&trajectory, "z")[0]];
    let exact = [0.1706167732170483e1, -0.8928097010247975];
    assert!(distance(&found, &exact) <= 1e-9, "{found:?}");

    let robertson = "model rober {
          state x[3] = [1, 0, 0];
          let slow = 0.04*x[1] - 1e4*x[2]*x[3];
          let fast = 3e7*x[2]^2;
          x' = [-slow, slow - fast, fast];
        }
        simulate a of rober { horizon 1e11; }";
    let trajectory = run(robertson, "a");
    assert_solved(&trajectory, 1000);
    let exact = [
        0.2083340149701255e-7,
        0.8333360770334713e-13,
        0.999999979166505,
    ];
    let found = end(&trajectory, "x");
    assert!(distance(&found, &exact) <= 1e-10, "{found:?}");
}

#[test]
fn an_algebraic_state_of_a_stiff_model() {
    // Robertson's reactions again, with the third share from a cube, so that it stays an equation.
    let text = "model rober {
          state x[2] = [1, 0];
          algebraic y = 0;
          0 = (x[1] + x[2] + y)^3 - 1;
          let slow = 0.04*x[1] - 1e4*x[2]*y;
          x' = [-slow, slow - 3e7*x[2]^2];
        }
        simulate a of rober { horizon 1e11; }";
    let trajectory = run(text, "a");
    assert_solved(&trajectory, 1000);
    let found = [end(&trajectory, "x"), end(&trajectory, "y")].concat();
    let exact = [
        0.2083340149701255e-7,
        0.8333360770334713e-13,
        0.999999979166505,
    ];
    assert!(distance(&found, &exact) <= 1e-10, "{found:?}");
    // z³ + z = w behind a fast filter, w = cos t + e^(-Lt) from w(0) = 2: the slow manifold and the root on it.
    let text = "model filter {
          state w = 2;
          state y = 0;
          algebraic z = 1;
          0 = z^3 + z - w;
          w' = -1e6*(w - cos(time)) - sin(time);
          y' = z^3 + z;
        }
        simulate a of filter { horizon 3; }";
    let trajectory = run(text, "a");
    assert_solved(&trajectory, 1000);
    let z = end(&trajectory, "z")[0];
    assert!((z.powi(3) + z - 3.0_f64.cos()).abs() <= 1e-8, "{z}");
    let y = end(&trajectory, "y")[0];
    assert!((y - 3.0_f64.sin() - 1e-6).abs() <= 1e-8, "{y}");
}

#[test]
fn a_model_that_is_not_stiff_takes_no_implicit_step() {
    let text = include_str!("../../examples/oscillator.nsd");
    let trajectory = run(text, "crossing");
    assert_eq!(trajectory.quality.stats.newton_iterations, 0);
}

/// Solutions that end before the horizon: a pole, and a slow manifold that folds back.
#[test]
fn what_cannot_go_on_ends_in_a_status() {
    let pole = "model pole {
          state x = 1;
          state z = 1;
          x' = x^2;
          z' = -1e6*(z - x);
        }
        simulate a of pole { horizon 2; }";
    let fold = "model fold {
          state x = -1;
          state z = 1;
          x' = 1;
          z' = 1e4*(-x - z^2);
        }
        simulate a of fold { horizon 3; }";
    // z follows √-x to its fold at t = 1 and falls where the first zero of Ai(-ξ) is, as Riccati's
    // equation has it.
    let falls = 1.0 + 2.338_107_410_459_767 / 1e4_f64.powf(2.0 / 3.0);
    for (text, latest) in [(pole, 1.0), (fold, falls)] {
        let trajectory = run(text, "a");
        assert_eq!(trajectory.status, Status::NumericalFailure);
        let last = trajectory.samples.time[trajectory.samples.time.len() - 1];
        assert!((last - latest).abs() < 1e-6, "{last} is not {latest}");
    }
}
