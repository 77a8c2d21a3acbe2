//! A plan runs again with other numbers: what was compiled in is compiled again.

use nsd_tests::with_experiment;
use nsdc::report::{Status, Trajectory};
use nsdc::simulate::{self, Plan, Request};

/// Settings of an experiment, for each method, with a model that it takes.
const METHODS: [(&str, &str); 12] = [
    (SWITCH, ""),
    (SWITCH, "method fesd;"),
    (SWITCH, "method fesd { steps = 20; }"),
    (SWITCH, "method timestepping { steps = 200; }"),
    (LED, "method timestepping { steps = 200; }"),
    (SWITCH, "method adaptive;"),
    (LED, "method adaptive;"),
    (SWITCH, "method smoothing;"),
    (BALL, "method timestepping { steps = 200; }"),
    (BALL, "method fesd; lower timefreezing;"),
    (BALL, "lower timefreezing;"),
    (
        BALL,
        "method fesd { steps = 8; elements = 3; } lower impact;",
    ),
];

const SWITCH: &str = "model m { param k = 2; state x = 1; state y = 0; x' = 1; y' = sign(x) + k; }";

/// A threshold that jumps with time.
const LED: &str = "model m {
    param k = 2; state x = 1;
    x' = if x > (if time > 0.4 then 2.7 else 2.2) then 0.5 else k;
}";

const BALL: &str = "model m {
    param k = 9.81; state x = 1; state y = 0;
    x' = y;
    mechanics x, y { mass = 1; force = -k; contact floor { gap = x; restitution = 0.8; } }
}";

fn ends(run: &Trajectory) -> Vec<f64> {
    assert_eq!(run.status, Status::Solved, "{:?}", run.failure);
    let last = run.samples.time.len() - 1;
    let states = run.samples.states.iter();
    states.flat_map(|series| series.at(last).to_vec()).collect()
}

#[test]
fn another_start_is_another_run() {
    for (model, method) in METHODS {
        let text = format!("{model}\nsimulate s of m {{ horizon 0.8; {method} }}");
        with_experiment(&text, "s", |compiled| {
            let (mut system, settings) = (compiled.system.clone(), &compiled.settings);
            let request = Request::default();
            let mut plan = Plan::new(&system, settings);
            let first = ends(&plan.run(&system, settings, &request, &mut |_| {}));
            for (x, k) in [(2.0, 1.0), (1.5, 1.0), (1.5, 0.5), (1.0, 1.0)] {
                system.states[0].initial = x;
                system.exogenous.params[0].value = k * compiled.system.exogenous.params[0].value;
                let found = ends(&plan.run(&system, settings, &request, &mut |_| {}));
                let fresh = ends(&simulate::run(&system, settings, &request));
                assert_eq!(found, fresh, "{method} from {x}, {k}");
                assert_eq!(
                    found == first,
                    (x, k) == (1.0, 1.0),
                    "{method} from {x}, {k}"
                );
            }
        });
    }
}
