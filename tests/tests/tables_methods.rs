//! Signals from data in the methods besides `event`: breakpoints are ends of elements and of steps.

use nsd_tests::{DataFiles, end, run_with_data, with_data};
use nsdc::report::{EventKind, Status, Trajectory};
use nsdc::simulate::{self, Request};

/// A file `data.csv` with the columns `time` and `r`.
fn data(rows: &[(f64, f64)]) -> DataFiles<'static> {
    let rows: String = rows.iter().map(|(t, r)| format!("{t},{r}\n")).collect();
    DataFiles(vec![("data.csv", format!("time,r\n{rows}"))])
}

fn text(settings: &str, fit: &str, statements: &str, horizon: f64) -> String {
    format!(
        "model m {{ signal r = table(\"data.csv\", \"r\", fit = {fit}); {statements} }}
        simulate run of m {{ horizon {horizon}; {settings} }}"
    )
}

fn tracked(
    settings: &str,
    fit: &str,
    statements: &str,
    horizon: f64,
    rows: &[(f64, f64)],
) -> Trajectory {
    let text = text(settings, fit, statements, horizon);
    run_with_data(&text, &data(rows), "run")
}

const RELAY: &str = "state x = 0.3; x' = -2*sign(x - r);";

/// Grids whose steps end at the breakpoints and beside them, lengths by a tolerance, both lowerings.
fn elements() -> Vec<String> {
    let grids = ["steps = 8;", "steps = 7; elements = 3;", ""];
    let settings = grids.iter().flat_map(|grid| {
        ["stewart", "step"]
            .map(|lower| format!("tolerance 1e-11; method fesd {{ {grid} }} lower {lower};"))
    });
    settings.collect()
}

/// Events, with times to rounding, and the state at the end.
fn assert_run(
    what: &str,
    found: &Trajectory,
    events: &[(f64, EventKind)],
    state: f64,
    accuracy: f64,
) {
    assert_eq!(found.status, Status::Solved, "{what}: {:?}", found.failure);
    let same = found.history.events.len() == events.len()
        && (found.history.events.iter().zip(events))
            .all(|(a, b)| (a.time - b.0).abs() <= accuracy && a.kind == b.1);
    assert!(
        same,
        "{what}: {:?} instead of {events:?}",
        found.history.events
    );
    let x = end(found, "x")[0];
    assert!(
        (x - state).abs() <= accuracy,
        "{what}: {x} instead of {state}"
    );
}

#[test]
fn elements_end_where_held_data_jumps() {
    use EventKind::{Crossing, EnterSliding, LeaveSliding};
    for settings in elements() {
        let rows = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.5), (3.0, 2.0)];
        let found = tracked(&settings, "hold", RELAY, 3.0, &rows);
        let expected = [
            (0.15, EnterSliding),
            (1.0, LeaveSliding),
            (1.5, EnterSliding),
            (2.0, LeaveSliding),
            (2.25, EnterSliding),
        ];
        assert_run(&settings, &found, &expected, 0.5, 1e-12);

        // In the rates alone: to 0 with -1.5, away from t = 2 on with 1, back from 1 with -2.
        let rows = [(0.0, 0.5), (1.0, -0.5), (2.0, 3.0), (3.0, 0.0)];
        let statements = "state x = 0.75; x' = r - 2*sign(x);";
        let found = tracked(&settings, "hold", statements, 4.0, &rows);
        let expected = [
            (0.5, EnterSliding),
            (2.0, LeaveSliding),
            (3.5, EnterSliding),
        ];
        assert_run(&settings, &found, &expected, 0.0, 1e-12);

        // x = 1 at t = 1, where r becomes 1: sliding where both sides lead back, else crossing.
        let rows = [(0.0, 0.0), (1.0, 1.0)];
        let statements = "state x = 1.5; x' = -0.5*sign(x - r);";
        let found = tracked(&settings, "hold", statements, 2.0, &rows);
        assert_run(&settings, &found, &[(1.0, EnterSliding)], 1.0, 1e-12);
        let statements = "state x = 1.5; x' = if x > r then -0.5 else -0.25;";
        let found = tracked(&settings, "hold", statements, 2.0, &rows);
        assert_run(&settings, &found, &[(1.0, Crossing)], 0.75, 1e-12);

        // x reaches r = 0 at t = 1, and there r goes away to -1: no sliding in between.
        let rows = [(0.0, 0.0), (1.0, -1.0)];
        let statements = "state x = 0.5; x' = -0.5*sign(x - r);";
        let found = tracked(&settings, "hold", statements, 4.0, &rows);
        assert_run(&settings, &found, &[(3.0, EnterSliding)], -1.0, 1e-12);
    }
}

#[test]
fn elements_slide_along_lines_and_leave_them_at_bends() {
    use EventKind::{EnterSliding, LeaveSliding};
    for settings in elements() {
        // Slopes 1 and -1 are below the relay's 2.
        let rows = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)];
        let found = tracked(&settings, "linear", RELAY, 2.0, &rows);
        assert_run(&settings, &found, &[(0.1, EnterSliding)], 0.0, 1e-12);
        // α keeps x' = r': -2 (2 α - 1) is 1, then -1.
        let alpha = |t: f64| found.row_at(t).unwrap()[1];
        let (rising, falling) = (alpha(0.9), alpha(1.1));
        assert!(
            (rising - 0.25).abs() <= 1e-12 && (falling - 0.75).abs() <= 1e-12,
            "{settings}: {rising} {falling}"
        );
        // From 1 at t = 1 with -2 to -2 at t = 2.5.
        let rows = [(0.0, 0.0), (1.0, 1.0), (2.0, -2.0), (4.0, -2.0)];
        let found = tracked(&settings, "linear", RELAY, 4.0, &rows);
        let expected = [
            (0.1, EnterSliding),
            (1.0, LeaveSliding),
            (2.5, EnterSliding),
        ];
        assert_run(&settings, &found, &expected, -2.0, 1e-12);
    }
}

#[test]
fn multipliers_jump_with_the_data_and_nowhere_else() {
    let rows = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.5), (3.0, 2.0)];
    let settings = "method fesd { steps = 7; } lower step;";
    let text = text(settings, "hold", RELAY, 2.4);
    let found = with_data(&text, &mut data(&rows), "run", |compiled| {
        let request = Request {
            multipliers: true,
            ..Request::default()
        };
        simulate::run(&compiled.system, &compiled.settings, &request)
    });
    let kept = found.multipliers.expect("they were asked for");
    // λn - λp = -ψ = r - x: 1 from t = 1 on, where x = 0, and λp = 1 - 0.5 from t = 2 on, where x = 1.
    let series = |name: &str| {
        let found = kept.values.iter().find(|s| s.name.starts_with(name));
        &found.expect("the step form has it").values
    };
    let (below, above) = (series("lambda_n"), series("lambda_p"));
    let mut jumps = Vec::new();
    for (k, pair) in kept.time.windows(2).enumerate() {
        let jump = [below, above].map(|values| values[k + 1] - values[k]);
        if pair[0] == pair[1] && jump.iter().any(|jump| jump.abs() > 1e-10) {
            jumps.push((pair[0], jump));
        }
    }
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(
        matches!(jumps[..], [(t1, [n1, p1]), (t2, [n2, p2])]
            if near(t1, 1.0) && near(n1, 1.0) && near(p1, 0.0)
            && near(t2, 2.0) && near(n2, 0.0) && near(p2, 0.5)),
        "{jumps:?}"
    );
}

/// x' = r - x along lines r = a + b s: x = a - b + b s + (x₀ - a + b) e^-s.
fn filtered(rows: &[(f64, f64)], mut x: f64) -> f64 {
    for pair in rows.windows(2) {
        let s = pair[1].0 - pair[0].0;
        let (a, b) = (pair[0].1, (pair[1].1 - pair[0].1) / s);
        x = a - b + b * s + (x - a + b) * (-s).exp();
    }
    x
}

const ROWS: [(f64, f64); 5] = [
    (0.0, 1.0),
    (0.7, -0.5),
    (1.0, 2.0),
    (2.25, 0.5),
    (3.0, 0.75),
];

#[test]
fn no_order_is_lost_at_bends() {
    // None of these grids meets the bends at 0.7, 1 and 2.25.
    let statements = "state x = 0.5; x' = r - x + 0*sign(x + 10);";
    let exact = filtered(&ROWS, 0.5);
    for (settings, accuracy) in [
        (
            "method timestepping { scheme = radau_iia(3); steps = 32; }",
            1e-8,
        ),
        (
            "method timestepping { scheme = gauss(4); steps = 32; }",
            1e-12,
        ),
        ("method fesd { scheme = gauss(4); steps = 16; }", 1e-12),
        ("tolerance 1e-10; method fesd;", 1e-10),
        ("tolerance 1e-10; method adaptive;", 1e-10),
    ] {
        let found = tracked(settings, "linear", statements, 3.0, &ROWS);
        assert_eq!(found.status, Status::Solved, "{settings}");
        let x = end(&found, "x")[0];
        assert!((x - exact).abs() <= accuracy, "{settings}: {:e}", x - exact);
    }
}

#[test]
fn adaptive_steps_end_at_jumps() {
    // ∫ of sign(r) and of r over held values.
    let rows = [(0.0, 1.0), (0.7, -2.0), (1.3, 0.5), (2.1, -1.0)];
    let statements = "state x = 0; state y = 0; x' = sign(r); y' = r;";
    let found = tracked("method adaptive;", "hold", statements, 3.0, &rows);
    assert_eq!(found.status, Status::Solved);
    let (x, y) = (end(&found, "x")[0], end(&found, "y")[0]);
    assert!((x - (0.7 - 0.6 + 0.8 - 0.9)).abs() < 1e-13, "{x}");
    assert!((y - (0.7 - 1.2 + 0.4 - 0.9)).abs() < 1e-13, "{y}");
    // Four pieces take a few steps each.
    assert!(
        found.quality.stats.steps < 40,
        "{}",
        found.quality.stats.steps
    );
}

/// Data of a higher degree than what steps and elements are told with are told as they are.
#[test]
fn cubic_data_are_told_beside_lines() {
    let rows = [(0.0, 1.0), (0.41, 0.5), (0.63, 0.2), (1.0, 0.0)];
    let output = "output y = r; state x = 0; x' = r;";
    let exact = tracked("", "cubic", output, 1.0, &rows);
    for settings in [
        "method timestepping { scheme = radau_iia(1); }",
        "method timestepping { scheme = gauss(2); }",
        "method fesd { scheme = radau_iia(2); }",
        "method fesd { scheme = explicit(2); }",
    ] {
        let found = tracked(settings, "cubic", output, 1.0, &rows);
        for k in 0..=50 {
            let t = f64::from(k) / 50.0;
            let rows = [&found, &exact].map(|run| run.dense.at(t).expect("it is in the horizon"));
            let [r, exact] = rows.map(|row| *row.last().expect("data come last"));
            assert!(
                (r - exact).abs() < 1e-12,
                "{settings}, {t}: {r} for {exact}"
            );
        }
    }
}
