//! Set points that step in time: what depends on them jumps, and is decided anew by value.

use nsd_tests::random::Random;
use nsd_tests::set_points::{Written, loops};
use nsd_tests::{DataFiles, assert_near, end, optimum, optimum_with_data, solved, times};
use nsdc::report::{EventKind, Status};

/// Random loops that are programs.
const SEEDS: u64 = 3;
/// Random set points that a plan follows.
const PLANS: usize = 3;
/// Random limits of a plan.
const ROWS: usize = 12;

/// What looks for switches, with every lowering.
const METHODS: [&str; 6] = [
    "event",
    "fesd",
    "fesd; lower stewart",
    "fesd; lower step",
    "event; lower timefreezing",
    "fesd; lower timefreezing",
];

fn response(law: &str, setting: &str) -> String {
    format!(
        "model m {{ state x = 0; control U in [-1, 1] = 0;
         let r = if time < 1 then 0 else 1; x' = {law}; }}
         {setting}"
    )
}

/// It slides on r = 0 to t = 1, and is on its way to r = 1 at t = 1.5.
#[test]
fn a_relay_leaves_a_set_point_that_steps() {
    for method in METHODS {
        let setting = format!("simulate run of m {{ horizon 1.5; method {method}; }}");
        let run = solved(&response("sign(r - x)", &setting), "run");
        let x = end(&run, "x")[0];
        assert!((x - 0.5).abs() < 1e-8, "{method}: {x}");
        let left = times(&run, EventKind::LeaveSliding);
        assert!(
            left.len() == 1 && (left[0] - 1.0).abs() < 1e-9,
            "{method}: {left:?}"
        );
    }
}

/// A region in which no term of its function g is a state: λ = g - μ is as rounded as μ. The end is by matrix exponentials.
#[test]
fn a_multiplier_gives_its_size_to_members() {
    for method in METHODS {
        let text = format!(
            "model m {{
               let r1 = if time < 0.25 then 1.0 else if time < 2.5 then 0.25 else 0.0; state x1 = -0.4208984375;
               x1' = 0.2275390625*x2 - 0.076171875*x3 + 0.010498046875 + sat(6*(r1 - x1), -1, 1);
               let r2 = if time < 2.5 then 1.0 else 0.25; state x2 = -0.2412109375;
               x2' = 0.19873046875*x1 - 0.5*x2 - 0.2236328125*x3 - 0.029052734375 + sat(4*(r2 - x2), -2, 2);
               let r3 = if time < 0.75 then -1.0 else if time < 1.75 then -0.5 else -0.25; state x3 = 0.802734375;
               x3' = -0.0341796875*x1 + 0.184814453125*x2 - 0.75*x3 - 0.0185546875 + sign(r3 - x3);
             }}
             simulate run of m {{ horizon 3; method {method}; }}"
        );
        let run = solved(&text, "run");
        for (state, exact) in [
            ("x1", 0.0373659582852006),
            ("x2", 0.30575868199274164),
            ("x3", -0.25),
        ] {
            let x = end(&run, state)[0];
            assert!((x - exact).abs() < 1e-8, "{method}, {state}: {x}");
        }
    }
}

/// x' = 2 until 8 (1 - x) = 2 at t = 1 + 3/8, then 1 - x = e^{-8 (t - 1.375)}/4.
#[test]
fn a_saturated_loop_follows_a_set_point_that_steps() {
    let exact = 1.0 - 0.25 * (-1.0_f64).exp();
    let others = ["timestepping { steps = 200; }", "adaptive"];
    for method in METHODS.iter().chain(&others) {
        let semicolon = if method.ends_with('}') { "" } else { ";" };
        let setting = format!("simulate run of m {{ horizon 1.5; method {method}{semicolon} }}");
        let run = solved(&response("sat(8*(r - x), -2, 2)", &setting), "run");
        let x = end(&run, "x")[0];
        let within = if method.starts_with("time") {
            1e-3
        } else {
            1e-8
        };
        assert!((x - exact).abs() < within, "{method}: {x}");
    }
}

/// The control has nothing to do; t = 1 is where an interval ends, and inside one.
#[test]
fn a_program_passes_steps_of_time() {
    for intervals in [3, 4] {
        for lowering in ["stewart", "step"] {
            let setting = format!(
                "optimize run of m {{ horizon 1.5; intervals {intervals}; elements 3; lower {lowering};
                 minimize integral(U^2); }}"
            );
            let run = optimum(&response("sign(r - x)", &setting), "run");
            let x = end(&run, "x")[0];
            assert!((x - 0.5).abs() < 1e-7, "{intervals}, {lowering}: {x}");
        }
    }
}

/// Set points that step where control intervals begin: there is nothing to detect, and nothing that a control does. The ends
/// are by matrix exponentials.
#[test]
fn set_points_step_where_intervals_begin() {
    for (written, seeds) in [
        (Written::Cases, SEEDS),
        (Written::Steps, 1),
        (Written::Input, 1),
    ] {
        for seed in 0..seeds {
            let loops = loops(seed, written);
            let intervals = 4.0 * loops.horizon;
            let text = format!(
                "model m {{ {} }}
                 optimize o of m {{ with {{ {} }} horizon {}; intervals {intervals}; elements 3; minimize integral(U^2); }}",
                loops.model, loops.given, loops.horizon
            );
            let found = optimum(&text, "o");
            assert_eq!(found.status, Status::Solved, "{:?}\n{text}", found.failure);
            assert!(found.objective.is_some_and(|least| least < 1e-12), "{text}");
            for (i, (exact, scale)) in loops.end.iter().zip(&loops.scales).enumerate() {
                let x = end(&found, &format!("x{}", i + 1))[0];
                assert!((x - exact).abs() < 1e-3 * scale, "{x} for {exact}\n{text}");
            }
        }
    }
}

/// What rests and what saturates at a set point that steps where control intervals begin, with a control that pays: by two
/// lowerings one optimum, which simulations with other controls do not contradict.
#[test]
fn plans_follow_set_points_that_step() {
    let mut random = Random(1);
    for _ in 0..PLANS {
        let values: [f64; 3] = std::array::from_fn(|_| random.within(-1.0, 1.0));
        let first = 1 + random.below(5);
        let steps = [first, first + 1 + random.below(5)].map(|k| k as f64 / 4.0);
        let step = format!(
            "(if time < {} then {} else if time < {} then {} else {})",
            steps[0], values[0], steps[1], values[1], values[2]
        );
        for law in [
            format!("{step}*x - 0.15*sign(x - {step}/4)"),
            format!("sat(2*({step} - x), -1, 1)"),
        ] {
            let optima = ["step", "stewart"].map(|lowering| {
                let text = format!(
                    "model m {{ state x = 1; control u in [-2, 2] = 0; x' = u + {law}; }}
                     optimize o of m {{ horizon 3; intervals 12; elements 2; lower {lowering}; minimize integral(x^2 + 0.2*u^2); }}"
                );
                let found = optimum(&text, "o");
                assert_eq!(found.status, Status::Solved, "{:?}\n{text}", found.failure);
                found.objective.expect("a solution has an objective")
            });
            assert!((optima[0] - optima[1]).abs() < 1e-6, "{optima:?}, {law}");
        }
    }
}

/// The shortest line below points that ends in the first and the last of them: their lower convex hull (Andrew 1979). Of all
/// x with these ends, x_k <= b_k and x' = u, it has the least ∫ u², which it gives.
fn least_below(points: &[[f64; 2]]) -> f64 {
    let slope = |a: [f64; 2], b: [f64; 2]| (b[1] - a[1]) / (b[0] - a[0]);
    let mut hull: Vec<[f64; 2]> = Vec::new();
    for &point in points {
        while let [.., a, b] = hull[..]
            && slope(a, b) >= slope(b, point)
        {
            hull.pop();
        }
        hull.push(point);
    }
    let square = |pair: &[[f64; 2]]| slope(pair[0], pair[1]).powi(2) * (pair[1][0] - pair[0][0]);
    hull.windows(2).map(square).sum()
}

/// Limits and targets that step where control intervals and the horizon end are those before, in rows, in the objective, and
/// in the simulations that confirm them, beside a relay at rest on what steps.
#[test]
fn rows_at_ends_of_intervals_have_data_of_before() {
    let mut random = Random(3);
    for _ in 0..ROWS {
        let values: [f64; 4] = std::array::from_fn(|_| random.rounded(-1.0, 1.0));
        let first = 1 + random.below(5);
        // The last step is where the horizon ends.
        let steps = [first, first + 1 + random.below(6), 12].map(|k| k as f64 / 4.0);
        let data = format!(
            "time,r\n0,{}\n{},{}\n{},{}\n{},{}\n",
            values[0], steps[0], values[1], steps[1], values[2], steps[2], values[3]
        );
        let files = DataFiles(vec![("r.csv", data)]);
        let before = |t: f64| values[steps.iter().filter(|&&step| step < t).count()];
        let (start, above) = (random.rounded(-1.0, 1.0), random.rounded(0.0, 0.5));
        let ends = (1..12).map(|k| f64::from(k) / 4.0);
        let mut points = vec![[0.0, start]];
        points.extend(ends.map(|t| [t, before(t) + above]));
        points.push([3.0, before(3.0)]);
        let exact = least_below(&points);
        let text = format!(
            "model m {{ state x = {start}; state w = {}; control u in [-20, 20] = 0;
               signal r = table(\"r.csv\", \"r\", fit = hold); x' = u; w' = sign(r - w)/4; }}
             optimize o of m {{ horizon 3; intervals 12; elements 2; minimize integral(u^2) + final((x - r)^2);
               subject to {{ x <= r + {above}; }} at intervals; final {{ x = r; }} }}",
            values[0]
        );
        let found = optimum_with_data(&text, &files, "o");
        assert_eq!(found.status, Status::Solved, "{:?}\n{text}", found.failure);
        assert!(found.warnings.is_empty(), "{:?}\n{text}", found.warnings);
        let least = found.objective.expect("a solution has an objective");
        assert_near(&[least], &[exact], 1e-7 * (1.0 + exact));
    }
}

/// Where no number of intervals is given they begin with all steps of time: u = r has no cost.
#[test]
fn intervals_begin_where_time_steps() {
    for [a, b] in [[0.25, 1.5], [3.0 / 7.0, 2.0], [0.6, 2.85], [1.4, 5.8 / 3.0]] {
        let files = DataFiles(vec![("r.csv", format!("time,r\n0,1\n{a},-1\n{b},0.5\n"))]);
        let cases = format!("let r = if time < {a} then 1 else if time < {b} then -1 else 0.5;");
        for r in ["signal r = table(\"r.csv\", \"r\", fit = hold);", &cases] {
            let text = format!(
                "model m {{ {r} state x = 0; control u in [-2, 2]; x' = u; }}
                 optimize o of m {{ horizon 3; minimize integral((u - r)^2); }}"
            );
            let found = optimum_with_data(&text, &files, "o");
            assert_eq!(found.status, Status::Solved, "{:?}\n{text}", found.failure);
            let least = found.objective.expect("a solution has an objective");
            assert_near(&[least], &[0.0], 1e-12);
        }
    }
}

/// x' = u <= 1 meets r = 2 - t/5 at the earliest at t = 5/3: rows and objectives at a free horizon have data of that instant,
/// and not of the guess.
#[test]
fn data_at_a_free_horizon_are_those_of_its_end() {
    let files = DataFiles(vec![("r.csv", "time,r\n0,2\n10,0\n".to_owned())]);
    for (minimize, last) in [
        ("final(time)", "final { x = r; }"),
        ("final(time) + 100*final(abs(x - r))", ""),
    ] {
        let text = format!(
            "model m {{ signal r = table(\"r.csv\", \"r\"); state x = 0; control u in [-1, 1]; x' = u; }}
             optimize o of m {{ horizon free in [0.5, 5] = 3; intervals 6; minimize {minimize}; {last} }}"
        );
        let found = optimum_with_data(&text, &files, "o");
        assert_eq!(found.status, Status::Solved, "{:?}\n{text}", found.failure);
        let least = found.objective.expect("a solution has an objective");
        assert_near(&[least], &[5.0 / 3.0], 1e-7);
    }
}
