//! Derivatives from both sides, against closed forms of what has a kink there.

use nsdc::report::{Sensitivity, Status, Trajectory};
use nsdc::{Options, Project};
use proptest::prelude::*;

/// The run of the only experiment of a text.
fn solved(text: &str) -> Trajectory {
    let project = Project::from_text("model.nsd", text);
    let found = project.run("s", &Options::default(), &mut ());
    let run = found.expect("it compiles and is differentiated").trajectory;
    assert_eq!(run.status, Status::Solved, "{text}");
    run
}

/// What is known by a number at the end: derivatives of an entry from below and from above, none where they are not.
fn sides(run: &Trajectory, to: &str, of: &str) -> [Option<f64>; 2] {
    ["below", "above"].map(|side| {
        let name = format!("{to} from {side}");
        let mut all = run.samples.sensitivities.iter();
        let by: &Sensitivity = all.find(|by| by.to == name).expect(&name);
        let series = (by.states.iter().chain(&by.outputs)).find(|one| one.name == of);
        let end = *series.expect(of).values.last().expect("rows");
        assert!(by.until.is_some() || !end.is_nan(), "{name}");
        (!end.is_nan()).then_some(end)
    })
}

fn close(found: Option<f64>, expected: f64) {
    let found = found.expect("it is known");
    assert!((found - expected).abs() < 1e-7, "{found} for {expected}");
}

/// From below the surface is reached at -x(0), and behind it the rate is 2.
#[test]
fn a_start_on_a_surface_has_both() {
    let run = solved(
        "model m { state x = 0; x' = if x >= 0 then 2 else 1; output y = x^2; }
         simulate s of m { horizon 1; sensitivity to x at 0 one_sided; }",
    );
    let [below, above] = sides(&run, "x at 0", "x");
    close(below, 2.0);
    close(above, 1.0);
    let [below, above] = sides(&run, "x at 0", "y");
    close(below, 8.0);
    close(above, 4.0);
}

/// A ball that just reaches the ceiling passes under it for less, and strikes it at a speed that begins like a root for more.
#[test]
fn what_is_touched_has_one_side() {
    let run = solved(
        "model m {
           state q = 0; state v = 1;
           q' = v; v' = -1;
           jump ceiling when q >= 0.5 and v > 0 { v := -0.5*v; }
         }
         simulate s of m { horizon 1.5; sensitivity to v at 0 one_sided; }",
    );
    let [below, above] = sides(&run, "v at 0", "q");
    close(below, 1.5);
    assert_eq!(above, None);
}

/// What happens beside p, however near, is not taken for what happens at p.
#[test]
fn kinks_beside_a_number_are_not_skipped() {
    // y reaches zero at 3e-7/3, so that it has 1/3 of what it starts with, on both sides of p.
    let run = solved(
        "model m {
           param p = 1; state x = p - 1; state y = p - 1.0000003;
           x' = if x >= 0 then 2 else 1; y' = if y >= 0 then 1 else 3;
         }
         simulate s of m { horizon 1; sensitivity to p one_sided; }",
    );
    for side in sides(&run, "p", "y") {
        close(side, 1.0 / 3.0);
    }
    // z begins where x is 1, at a time of ln(20 (1 + c)/c)/20 for rates of 20 x + c: dz/dx(0) is 1/c.
    let run = solved(
        "model m {
           state x = 0; state z = 0;
           x' = if x >= 0 then 20*x + 1 else 20*x + 2; z' = if x > 1 then 1 else 0;
         }
         simulate s of m { horizon 1; sensitivity to x at 0 one_sided; }",
    );
    let [below, above] = sides(&run, "x at 0", "z");
    close(below, 0.5);
    close(above, 1.0);
    // Friction stops what moves slowly at once.
    for friction in [1.0, 1e-7] {
        let text = format!(
            "model m {{ state v = 0; v' = -{friction:?}*sign(v); }}
             simulate s of m {{ horizon 1; sensitivity to v at 0 one_sided; }}"
        );
        for side in sides(&solved(&text), "v at 0", "v") {
            close(side, 0.0);
        }
    }
}

/// Where the solution itself jumps at a number there is no derivative, whatever those beside it are.
#[test]
fn jumps_of_the_solution_have_no_sides() {
    let run = solved(
        "model m { param p = 1; state x = p - 1; x' = if x >= 0 then 1 else -1; output e = 1e12*p; }
         simulate s of m { horizon 1; sensitivity to p one_sided; method event { branch = plus; } }",
    );
    let [below, above] = sides(&run, "p", "x");
    assert_eq!(below, None);
    close(above, 1.0);
}

/// What has a derivative has no sides, and nothing else changes.
#[test]
fn what_has_a_derivative_has_no_sides() {
    let text = |sides: &str| {
        format!(
            "model m {{ param p = 2; state x = 1; x' = -p*x - 0.3*sign(x - 0.5); }}
             simulate s of m {{ horizon 1; sensitivity to p, x at 0{sides}; }}"
        )
    };
    let (with, without) = (solved(&text(" one_sided")), solved(&text("")));
    assert_eq!(with.samples.sensitivities.len(), 2);
    assert_eq!(with.samples.sensitivities, without.samples.sensitivities);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// z runs from when the last of several clocks has struck, all of them at t = 1 for p = 2 and at 1 + c (p - 2) beside:
    /// z(3) = 2 - max c (p - 2).
    #[test]
    fn clocks_that_strike_at_once_have_both(slopes in proptest::collection::vec(-2.0..2.0_f64, 2..=3)) {
        let clocks = slopes.iter().enumerate().map(|(k, c)| {
            format!("state x{k} = -1 - ({c:?})*(p - 2); x{k}' = 1;\n")
        });
        let clocks: String = clocks.collect();
        let gates: Vec<String> = (0..slopes.len()).map(|k| format!("step(x{k})")).collect();
        let text = format!(
            "model m {{ param p = 2; {clocks} state z = 0; z' = {}; }}
             simulate s of m {{ horizon 3; sensitivity to p one_sided; }}",
            gates.join("*")
        );
        let run = solved(&text);
        let [below, above] = sides(&run, "p", "z");
        let last = |sign: f64| slopes.iter().map(|c| sign * c).fold(f64::MIN, f64::max);
        close(above, -last(1.0));
        close(below, last(-1.0));
    }
}
