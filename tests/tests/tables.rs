//! Signals from data: closed forms for every fit, and what switches do where data jumps and bends.

use std::f64::consts::PI;

use nsd_tests::{DataFiles, end, run_with_data, with_data};
use nsdc::report::{EventKind, Status, Trajectory};
use nsdc::simulate::{self, Request};

/// A file `data.csv` with the columns `time` and `r`.
fn data(rows: &[(f64, f64)]) -> DataFiles<'static> {
    let rows: String = rows.iter().map(|(t, r)| format!("{t},{r}\n")).collect();
    DataFiles(vec![("data.csv", format!("time,r\n{rows}"))])
}

/// Runs a model with the signal `r`.
fn tracked(fit: &str, statements: &str, horizon: f64, rows: &[(f64, f64)]) -> Trajectory {
    run_with_data(&text(fit, statements, horizon), &data(rows), "run")
}

fn text(fit: &str, statements: &str, horizon: f64) -> String {
    format!(
        "model m {{ signal r = table(\"data.csv\", \"r\", fit = {fit}); {statements} }}
        simulate run of m {{ horizon {horizon}; tolerance 1e-11; }}"
    )
}

fn events(trajectory: &Trajectory) -> Vec<(f64, EventKind)> {
    let events = trajectory.history.events.iter();
    events.map(|event| (event.time, event.kind)).collect()
}

/// Compares kinds exactly and times to rounding.
fn assert_events(trajectory: &Trajectory, expected: &[(f64, EventKind)]) {
    let found = events(trajectory);
    let same =
        |(a, b): (&(f64, EventKind), &(f64, EventKind))| (a.0 - b.0).abs() <= 1e-12 && a.1 == b.1;
    assert!(
        found.len() == expected.len() && found.iter().zip(expected).all(same),
        "{found:?} instead of {expected:?}"
    );
}

fn assert_end(trajectory: &Trajectory, expected: &[f64], accuracy: f64) {
    assert_eq!(trajectory.status, Status::Solved);
    let found: Vec<f64> = trajectory
        .samples
        .states
        .iter()
        .flat_map(|s| end(trajectory, &s.name))
        .collect();
    let close = |(a, b): (&f64, &f64)| (a - b).abs() <= accuracy;
    assert!(
        found.len() == expected.len() && found.iter().zip(expected).all(close),
        "{found:?} instead of {expected:?}"
    );
}

const ROWS: [(f64, f64); 5] = [
    (0.0, 1.0),
    (0.7, -0.5),
    (1.0, 2.0),
    (2.25, 0.5),
    (3.0, 0.75),
];

/// A pole -1 driven by a polynomial c in s: x = p(s) + (x_0 - p(0)) e^{-s}, p = Σ_j (-1)^j c^(j).
fn driven(x: f64, c: &[f64], s: f64) -> f64 {
    let mut p = vec![0.0; c.len()];
    let mut derivative = c.to_vec();
    let mut sign = 1.0;
    while !derivative.is_empty() {
        for (p, d) in p.iter_mut().zip(&derivative) {
            *p += sign * d;
        }
        sign = -sign;
        derivative = derivative
            .iter()
            .enumerate()
            .skip(1)
            .map(|(k, d)| k as f64 * d)
            .collect();
    }
    let value = |s: f64| p.iter().rev().fold(0.0, |sum, c| sum * s + c);
    value(s) + (x - value(0.0)) * (-s).exp()
}

/// The pieces of data: where they begin and end, and their coefficients.
fn pieces(hold: bool, rows: &[(f64, f64)]) -> Vec<(f64, f64, Vec<f64>)> {
    let piece = |pair: &[(f64, f64)]| {
        let ((t0, r0), (t1, r1)) = (pair[0], pair[1]);
        let slope = (r1 - r0) / (t1 - t0);
        (t0, t1, if hold { vec![r0] } else { vec![r0, slope] })
    };
    rows.windows(2).map(piece).collect()
}

#[test]
fn integrals_of_all_fits() {
    for hold in [true, false] {
        let fit = if hold { "hold" } else { "linear" };
        let trajectory = tracked(fit, "state x = 0; x' = r;", 3.0, &ROWS);
        let exact: f64 = pieces(hold, &ROWS)
            .iter()
            .map(|(from, to, c)| {
                let h = to - from;
                c[0] * h + c.get(1).unwrap_or(&0.0) * h * h / 2.0
            })
            .sum();
        assert_end(&trajectory, &[exact], 1e-14);
    }
    // `scipy.interpolate.CubicSpline(t, r).integrate(0, 4.2)` of SciPy 1.17.1.
    let rows = [
        (0.0, 1.0),
        (0.7, -0.3),
        (1.1, 0.4),
        (2.5, 2.2),
        (3.0, 1.9),
        (4.2, -1.0),
    ];
    let trajectory = tracked("cubic", "state x = 0; x' = r;", 4.2, &rows);
    assert_end(&trajectory, &[3.986355871289184], 1e-13);
}

#[test]
fn a_filter_follows_steps_and_lines() {
    for hold in [true, false] {
        let fit = if hold { "hold" } else { "linear" };
        let trajectory = tracked(fit, "state x = 0.5; x' = r - x;", 3.0, &ROWS);
        let exact = pieces(hold, &ROWS)
            .iter()
            .fold(0.5, |x, (from, to, c)| driven(x, c, to - from));
        assert_end(&trajectory, &[exact], 1e-13);
        // Between the rows too, where the dense output is asked.
        let (from, _, c) = &pieces(hold, &ROWS)[2];
        let start = pieces(hold, &ROWS)[..2]
            .iter()
            .fold(0.5, |x, (from, to, c)| driven(x, c, to - from));
        let row = trajectory.row_at(from + 0.3).unwrap();
        assert!((row[0] - driven(start, c, 0.3)).abs() <= 1e-13);
    }
}

#[test]
fn a_filter_follows_a_cubic() {
    let c = [0.5, -1.0, 2.0, -0.75];
    let cubic = |t: f64| c.iter().rev().fold(0.0, |sum, c| sum * t + c);
    let rows: Vec<(f64, f64)> = (0..=20)
        .map(|k| 0.1 * f64::from(k))
        .map(|t| (t, cubic(t)))
        .collect();
    let trajectory = tracked("cubic", "state x = 1; x' = r - x;", 2.0, &rows);
    assert_end(&trajectory, &[driven(1.0, &c, 2.0)], 1e-12);
}

#[test]
fn growth_at_a_rate_from_data() {
    // x = exp ∫ r.
    for hold in [true, false] {
        let fit = if hold { "hold" } else { "linear" };
        let trajectory = tracked(fit, "state x = 1; x' = r*x;", 3.0, &ROWS);
        let integral = |(from, to, c): &(f64, f64, Vec<f64>)| {
            let h = to - from;
            c[0] * h + c.get(1).unwrap_or(&0.0) * h * h / 2.0
        };
        let exact = pieces(hold, &ROWS).iter().map(integral).sum::<f64>().exp();
        assert_end(&trajectory, &[exact], 1e-12 * exact);
    }
}

#[test]
fn a_stiff_filter_follows_steps_and_lines() {
    // x' = λ (r - x) is a pole -1 in the time λ t.
    let lambda = 1e5;
    for hold in [true, false] {
        let fit = if hold { "hold" } else { "linear" };
        let statements = format!("state x = 0.5; state y = 0; x' = {lambda:e}*(r - x); y' = x;");
        let trajectory = tracked(fit, &statements, 3.0, &ROWS);
        let (mut x, mut y) = (0.5, 0.0);
        for (from, to, c) in pieces(hold, &ROWS) {
            let h = to - from;
            let scaled: Vec<f64> = c
                .iter()
                .zip([1.0, 1.0 / lambda])
                .map(|(c, k)| c * k)
                .collect();
            let next = driven(x, &scaled, lambda * h);
            // x' = λ (r - x): ∫ x = ∫ r - Δx/λ.
            y += c[0] * h + c.get(1).unwrap_or(&0.0) * h * h / 2.0 - (next - x) / lambda;
            x = next;
        }
        assert_end(&trajectory, &[x, y], 1e-11);
        assert!(trajectory.quality.stats.newton_iterations > 0);
        assert!(
            trajectory.quality.stats.steps < 2000,
            "{} steps",
            trajectory.quality.stats.steps
        );
    }
}

#[test]
fn a_relay_tracks_a_held_reference() {
    use EventKind::{EnterSliding, LeaveSliding};
    let rows = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.5), (3.0, 2.0)];
    let relay = "state x = 0.3; x' = -2*sign(x - r);";
    let trajectory = tracked("hold", relay, 3.0, &rows);
    let expected = [
        (0.15, EnterSliding),
        (1.0, LeaveSliding),
        (1.5, EnterSliding),
        (2.0, LeaveSliding),
        (2.25, EnterSliding),
    ];
    assert_events(&trajectory, &expected);
    assert_end(&trajectory, &[0.5], 1e-14);
}

#[test]
fn sliding_along_a_line_survives_a_bend_that_the_relay_can_follow() {
    use EventKind::EnterSliding;
    // Slopes 1 and -1 are below the relay's 2.
    let rows = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)];
    let trajectory = tracked("linear", "state x = 0.3; x' = -2*sign(x - r);", 2.0, &rows);
    assert_events(&trajectory, &[(0.1, EnterSliding)]);
    assert_end(&trajectory, &[0.0], 1e-14);
    // α keeps x' = r': -2 (2 α - 1) is 1, then -1.
    let alpha = |t: f64| trajectory.row_at(t).unwrap()[1];
    assert!((alpha(0.9) - 0.25).abs() <= 1e-13 && (alpha(1.0) - 0.75).abs() <= 1e-13);
}

#[test]
fn sliding_along_a_line_ends_at_a_bend_that_is_too_steep() {
    use EventKind::{EnterSliding, LeaveSliding};
    let rows = [(0.0, 0.0), (1.0, 1.0), (2.0, -2.0), (4.0, -2.0)];
    let trajectory = tracked("linear", "state x = 0.3; x' = -2*sign(x - r);", 4.0, &rows);
    // From 1 at t = 1 with -2 to -2 at t = 2.5.
    let expected = [
        (0.1, EnterSliding),
        (1.0, LeaveSliding),
        (2.5, EnterSliding),
    ];
    assert_events(&trajectory, &expected);
    assert_end(&trajectory, &[-2.0], 1e-14);
}

#[test]
fn data_in_the_rates_alone_ends_sliding_too() {
    use EventKind::{EnterSliding, LeaveSliding};
    let rows = [(0.0, 0.5), (1.0, -0.5), (2.0, 3.0), (3.0, 0.0)];
    let trajectory = tracked("hold", "state x = 0.75; x' = r - 2*sign(x);", 4.0, &rows);
    // To 0 with -1.5, away from t = 2 on with 1, back from 1 with -2.
    let expected = [
        (0.5, EnterSliding),
        (2.0, LeaveSliding),
        (3.5, EnterSliding),
    ];
    assert_events(&trajectory, &expected);
    assert_end(&trajectory, &[0.0], 1e-14);
}

#[test]
fn sliding_that_data_makes_repelling_has_several_solutions() {
    let rows = [(0.0, -1.0), (1.0, 1.0)];
    let trajectory = tracked("hold", "state x = 0.5; x' = r*sign(x);", 2.0, &rows);
    assert!(trajectory.failure.is_some());
    assert_eq!(trajectory.samples.time.last(), Some(&1.0));
}

#[test]
fn a_jump_onto_a_surface_is_decided_by_the_rates() {
    use EventKind::{Crossing, EnterSliding};
    // x = 1 at t = 1, where r becomes 1.
    let rows = [(0.0, 0.0), (1.0, 1.0)];
    let trajectory = tracked("hold", "state x = 1.5; x' = -0.5*sign(x - r);", 2.0, &rows);
    assert_events(&trajectory, &[(1.0, EnterSliding)]);
    assert_end(&trajectory, &[1.0], 1e-14);
    // Where both sides lead down, it is crossed.
    let statements = "state x = 1.5; x' = if x > r then -0.5 else -0.25;";
    let trajectory = tracked("hold", statements, 2.0, &rows);
    assert_events(&trajectory, &[(1.0, Crossing)]);
    assert_end(&trajectory, &[0.75], 1e-14);
}

#[test]
fn an_event_at_a_breakpoint_is_one_event() {
    use EventKind::{Crossing, EnterSliding};
    // x reaches r = 0 at t = 1, and there r goes away to -1: no sliding in between.
    let rows = [(0.0, 0.0), (1.0, -1.0)];
    let trajectory = tracked("hold", "state x = 0.5; x' = -0.5*sign(x - r);", 4.0, &rows);
    assert_events(&trajectory, &[(3.0, EnterSliding)]);
    // x reaches 0 at 0.7, where the rates change: with the new ones it is crossed.
    let rows = [(0.0, 1.0), (0.7, -3.0)];
    let trajectory = tracked("hold", "state x = 0.7; x' = r - 2*step(x);", 0.9, &rows);
    assert_eq!(
        trajectory.history.events.len(),
        1,
        "{:?}",
        trajectory.history.events
    );
    assert_eq!(events(&trajectory)[0].1, Crossing);
}

#[test]
fn zeros_of_data_at_its_rows() {
    use EventKind::Crossing;
    // Crossed at 1 and touched at 3.
    let rows = [(0.0, 1.0), (1.0, 0.0), (2.0, -0.7), (3.0, 0.0), (4.0, -0.3)];
    let trajectory = tracked("linear", "state x = 0; x' = sign(r);", 4.0, &rows);
    assert_events(&trajectory, &[(1.0, Crossing)]);
    assert_end(&trajectory, &[-2.0], 1e-14);
    // Zeros within and at ends of pieces that binary fractions do not meet.
    let rows: Vec<(f64, f64)> = (0..=40)
        .map(|k| 0.1 * f64::from(k))
        .map(|t| (t, (PI * t).cos()))
        .collect();
    let trajectory = tracked("linear", "state x = 0; x' = sign(r);", 4.0, &rows);
    let times: Vec<f64> = events(&trajectory).iter().map(|event| event.0).collect();
    assert_eq!(times.len(), 4, "{times:?}");
    for (time, expected) in times.iter().zip([0.5, 1.5, 2.5, 3.5]) {
        assert!((time - expected).abs() <= 1e-12, "{times:?}");
    }
}

#[test]
fn a_thermostat_with_held_thresholds() {
    use EventKind::Relay;
    // Heats with 1, cools with -1 between r - 1 and r + 1.
    let statements = "state T = 0;
        switch h = hysteresis(T - r, on = -1, off = 1, start = 1);
        T' = 2*h - 1;";
    let rows = [(0.0, 0.0), (3.5, 4.0), (8.0, -6.0)];
    let trajectory = tracked("hold", statements, 10.0, &rows);
    // Up to 1 at 1, down to -1 at 3, up; at 3.5 the band is [3, 5]: up from -0.5 to 5 at 9, but at 8 it is [-7, -5].
    let expected = [(1.0, Relay), (3.0, Relay), (8.0, Relay)];
    assert_events(&trajectory, &expected);
    assert_end(&trajectory, &[2.0], 1e-13);
}

#[test]
fn estimates_of_the_error_are_honest() {
    for hold in [true, false] {
        let fit = if hold { "hold" } else { "linear" };
        let statements = "state x = 0.5; state y = 0; x' = r - x; y' = x;";
        let text = text(fit, statements, 3.0);
        let exact = pieces(hold, &ROWS)
            .iter()
            .fold(0.5, |x, (from, to, c)| driven(x, c, to - from));
        with_data(&text, &mut data(&ROWS), "run", |compiled| {
            for k in 4..=12 {
                let mut settings = compiled.settings.clone();
                settings.numerics.tolerance = 10.0_f64.powi(-k);
                let run = simulate::run(&compiled.system, &settings, &Request::default());
                let error = (end(&run, "x")[0] - exact).abs();
                let estimate = run.quality.error_estimate.unwrap();
                assert!(
                    error <= settings.numerics.tolerance,
                    "{fit} at 1e-{k}: {error:e}"
                );
                assert!(
                    error <= 10.0 * estimate + 1e-14,
                    "{fit} at 1e-{k}: {error:e} {estimate:e}"
                );
            }
        });
    }
}

/// A state that sets off from a line with another slope: ψ = x - r is small beside both, which are zero at the start.
#[test]
fn a_line_is_left_slowly() {
    let sides = (1..=8).flat_map(|k| [1.0, -1.0].map(|side| side * 10.0_f64.powi(-k)));
    for (by, horizon) in sides.flat_map(|by| [(by, 0.3), (by, 0.9)]) {
        let rate = 1.0 + by;
        let exact = [rate * horizon, if by > 0.0 { horizon } else { 0.0 }];
        for tolerance in [1e-6, 1e-8, 1e-10, 1e-12] {
            let text = format!(
                "model m {{ signal r = table(\"data.csv\", \"r\"); state x = 0; state y = 0; x' = {rate:?}; y' = step(x - r); }}
                 simulate run of m {{ horizon {horizon}; tolerance {tolerance:e}; }}"
            );
            let run = run_with_data(&text, &data(&[(0.0, 0.0), (1.0, 1.0)]), "run");
            assert_end(&run, &exact, 1e-14);
            assert!(run.warnings.is_empty(), "{:?}\n{text}", run.warnings);
        }
    }
}

#[test]
fn many_rows_cost_a_step_each() {
    let rows: Vec<(f64, f64)> = (0..=20_000)
        .map(|k| f64::from(k) * 1e-3)
        .map(|t| (t, t.sin()))
        .collect();
    for fit in ["hold", "linear", "cubic"] {
        let trajectory = tracked(fit, "state x = 0; x' = r - x;", 20.0, &rows);
        assert_eq!(trajectory.status, Status::Solved);
        let steps = trajectory.quality.stats.steps;
        assert!((19_990..=20_020).contains(&steps), "{fit}: {steps} steps");
    }
    // (sin t - cos t + e^{-t})/2, which the spline meets to h^4.
    let trajectory = tracked("cubic", "state x = 0; x' = r - x;", 20.0, &rows);
    let exact = 0.5 * (20.0_f64.sin() - 20.0_f64.cos() + (-20.0_f64).exp());
    assert_end(&trajectory, &[exact], 1e-12);
}

/// A ball that falls from 5 t² with 10 meets the floor at t, where data jump, too: one is not the other but for rounding.
#[test]
fn a_bounce_where_data_jump_is_passed() {
    for k in 1..=12 {
        let (t, more) = (f64::from(k) / 10.0, 0.04);
        let statements = format!(
            "state q = 5*{t}^2; state v = 0; state w = 0; q' = v; v' = -10; w' = r;
             jump floor when q <= 0 and v < 0 {{ v := -0.5*v; }}"
        );
        let rows: Vec<(f64, f64)> = (0..20)
            .map(|k| (f64::from(k) / 10.0, f64::from(k)))
            .collect();
        let trajectory = tracked("hold", &statements, t + more, &rows);
        assert_eq!(
            trajectory.status,
            Status::Solved,
            "{k}: {:?}",
            trajectory.failure
        );
        let close = |name: &str, exact: f64| {
            let found = end(&trajectory, name)[0];
            assert!(
                (found - exact).abs() <= 1e-10,
                "{k}: {name} = {found} for {exact}"
            );
        };
        close("q", 5.0 * t * more - 5.0 * more * more);
        close("v", 5.0 * t - 10.0 * more);
        close("w", 0.05 * f64::from(k * (k - 1)) + f64::from(k) * more);
    }
}
