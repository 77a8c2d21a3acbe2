//! Terms that jump and bend where parameters say so, with these open: what is prepared for one value is right for others,
//! or it is refused to keep them open.
//!
//! x' = r(x, m) with a random r, and y' = u beside it. The least of ∫ (u - 1)² dt + x(1) is x(1), which a simulation that
//! is compiled for m finds, too.

use std::fmt::Write as _;

use nsd_solver::hybrid;
use nsdc::expr::Exprs;
use nsdc::limit::Limit;
use nsdc::report::Status;
use nsdc::study::sweep::{Axis, Grid};
use nsdc::{Options, Project};

use nsd_tests::random::Random;

/// Models, and values of m; the first one is what they are prepared for.
const MODELS: usize = 30;
const VALUES: [f64; 4] = [1.0, 3.0, 0.3, 2.2];

/// Finite elements of fifth order at least, beside a simulation to 1e-8.
const CLOSE: f64 = 1e-5;

/// A term in x and m, in which conditions and kinks are nested so deep.
fn term(random: &mut Random, depth: usize) -> String {
    let leaves = ["m", "x", "2", "0.5", "(m - 2)", "(x - m)", "m*x", "m^2"];
    if depth == 0 {
        return leaves[random.below(leaves.len())].to_owned();
    }
    let mut inner = || term(random, depth - 1);
    let [a, b, c, d] = [inner(), inner(), inner(), inner()];
    match random.below(8) {
        0 => format!("abs({a} - {b})"),
        1 => format!("max({a}, {b})"),
        2 => format!("min({a}, {b})"),
        3 => format!("sat({a}, -1, 2)"),
        4 => format!("sign({a} - {b})"),
        5 => format!("(if {a} > {b} then {c} else {d})"),
        6 => format!("(if {a} > 1 and {b} < 2 then {c} else {d})"),
        _ => format!("({a} + {b})"),
    }
}

/// x(1) of a simulation that is compiled for m, where it has one.
fn compiled_for(project: &Project, m: f64) -> Option<f64> {
    let options = Options {
        values: vec![("m".to_owned(), m)],
        ..Options::default()
    };
    let run = project.run("s", &options, &mut ()).ok()?.trajectory;
    let solved = run.status == Status::Solved && run.warnings.is_empty();
    solved.then(|| run.samples.states[0].values[run.samples.states[0].values.len() - 1])
}

#[test]
fn values_of_open_parameters_are_not_compiled_in() {
    let mut random = Random(20);
    let (mut wrong, mut n_optimal, mut n_simulated) = (String::new(), 0, 0);
    for number in 0..MODELS {
        let term = term(&mut random, 1 + number % 2);
        let text = format!(
            "model k {{ param m = 1; state x = 0.1; state y = 0; control u in [-9, 9] = 0;
               x' = sat({term}, -3, 3) - x; y' = u; }}
             simulate s of k {{ with {{ u = 0; }} horizon 1; }}
             optimize o of k {{ horizon 1; intervals 2; elements 4;
               minimize integral((u - 1)^2) + final(x); }}"
        );
        let project = Project::from_text("test.nsd", &text);
        let exprs = Exprs::new();
        let simulation = project.prepare("s", &["m"], &[]).ok();
        let mut runs = simulation.as_ref().map(|prepared| prepared.runs());
        let mut optimal = project.prepare_optimal(&exprs, "o", &["m"], &[]).ok();
        for m in VALUES {
            let Some(exact) = compiled_for(&project, m) else {
                continue;
            };
            let mut compare = |road: &str, found: f64, count: &mut usize| {
                *count += 1;
                if (found - exact).abs() > CLOSE {
                    let _ = writeln!(wrong, "{road}, m = {m}: {found}, not {exact}: {term}");
                }
            };
            if let Some(runs) = &mut runs
                && let Ok(found) = runs.run(&[m], None, 1.0, &mut ())
                && found.status == hybrid::Status::Solved
            {
                compare("simulation", found.x[0], &mut n_simulated);
            }
            if let Some(optimal) = &mut optimal
                && let Ok(found) = optimal.solve(&[m], None, None, &Limit::default(), &mut ())
                && found.trajectory.status == Status::Solved
            {
                let objective = found.trajectory.objective.expect("it has one");
                compare("optimum", objective, &mut n_optimal);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert!(
        n_simulated > 40 && n_optimal > 40,
        "{n_simulated} simulations, {n_optimal} optima"
    );
}

/// cos(ωt) is zero at (k - 1/2) π/ω, as often as that is before the end: what each row of a sweep is expected to do is
/// about its own times, and as many of them as it has.
#[test]
fn expectations_of_rows_are_about_their_own_words() {
    let project = Project::from_text(
        "model.nsd",
        "model m {
           param omega = 2; state x = 1; state y = 0; state n = 0;
           x' = -omega*y; y' = omega*x; n' = sign(x);
         }
         simulate s of m {
           horizon 3;
           expect switches[1] ~ pi/(2*omega) within 1e-8;
           expect switches[2] ~ 1.5*pi/omega within 1e-8;
           expect switches[3] ~ 2.5*pi/omega within 1e-8;
           expect switches[len(switches)] - switches[1] ~ (len(switches) - 1)*pi/omega within 1e-8;
           expect [switches[1], end] ~ [pi/(2*omega), 3] within 1e-8*omega;
           expect x at end ~ cos(omega*end) within 1e-7;
           expect len(switches) = 2;
           expect len(events(crossing)) <= 3;
         }",
    );
    let values = vec![2.0, 0.7, 3.0, 4.0, 2.5, 0.7, 2.0];
    let missed = [1, 3, 1, 2, 1, 3, 1];
    let name = "omega".to_owned();
    let grid = Grid::new(vec![Axis { name, values }], false).expect("there are few points");
    let sweep = project.sweep("s", &Options::default(), grid);
    let sweep = sweep.unwrap_or_else(|errors| panic!("{errors}"));
    let found = sweep.rows(0..missed.len(), 1, &mut |_| {}).rows;
    let found: Vec<Option<usize>> = found.iter().flatten().map(|row| row.missed).collect();
    assert_eq!(found, missed.map(Some));
}
