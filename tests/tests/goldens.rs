//! Every model of `examples/` in both lowerings: their printed forms, and that they are the same system.

use std::fs;
use std::path::{Path, PathBuf};

use nsd_tests::with_experiment;
use nsdc::expr::Var;
use nsdc::lowering::dcs::{Dcs, Formulation, Pointwise, lower_as, solve_pointwise};
use nsdc::optimize;
use nsdc::system::{Role, System};

const FORMULATIONS: [Formulation; 2] = [Formulation::Stewart, Formulation::Step];

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples")
}

/// Calls `check` with the system of every example model that has a complementarity form: without relays, jumps and
/// contacts.
fn for_each_example(mut check: impl FnMut(&str, &System)) {
    nsd_tests::for_each_example(|stem, system| {
        let jumps = !system.jumps.laws.is_empty() || !system.jumps.contacts.is_empty();
        if !jumps && system.switches.iter().all(|k| k.relay.is_none()) {
            check(stem, system);
        }
    });
}

fn lower<'e>(system: &System<'e>, formulation: Formulation) -> Dcs<'e> {
    let dcs = lower_as(system, formulation).expect("the examples are small");
    dcs.verify()
        .expect("a lowering keeps the invariants of `Dcs`");
    dcs
}

/// Projections, algebraic states and nonlinear switches have no form of Stewart's.
fn has_no_regions(system: &System) -> bool {
    let mut switches = system.switches.iter();
    switches.any(|k| k.unilateral || k.role != Role::Step || k.is_nonlinear)
}

#[test]
fn printed_forms() {
    for_each_example(|stem, system| {
        let projected = has_no_regions(system);
        for &formulation in &FORMULATIONS[usize::from(projected)..] {
            let name = format!("{stem}.{}.{formulation}", system.name);
            insta::assert_snapshot!(name, lower(system, formulation));
        }
    });
}

/// Numbers between -1 and 1 that look random and are always the same.
fn scatter(seed: usize) -> f64 {
    (43_758.545 * (12.9898 * (seed as f64 + 1.0)).sin()).fract()
}

#[test]
fn both_lowerings_give_the_same_rates() {
    for_each_example(|stem, system| {
        if has_no_regions(system) {
            return;
        }
        let [stewart, step] = FORMULATIONS.map(|formulation| lower(system, formulation));
        for point in 0..50 {
            let params = system.exogenous.numbers();
            let states = system.states.iter().enumerate();
            let states =
                states.map(|(i, state)| (state.var, state.initial + 2.0 * scatter(97 * point + i)));
            let t = scatter(31 * point).abs();
            let data = (system.exogenous.data.iter()).map(|data| (data.var, data.table.value(t)));
            let time = (system.time, t);
            let values: Vec<(Option<Var>, f64)> = params
                .chain(states)
                .chain([time])
                .chain(data)
                .map(|(var, value)| (var.as_variable(), value))
                .collect();
            let value = |var| {
                let known = values.iter().find(|known| known.0 == Some(var));
                known.map_or(f64::NAN, |known| known.1)
            };
            let [a, b] = [&stewart, &step].map(|dcs| solve_pointwise(system, dcs, &value));
            let scale = 1.0
                + a.algebraics
                    .iter()
                    .chain(&b.algebraics)
                    .fold(0.0f64, |m, z| m.max(z.abs()));
            assert!(
                a.residual <= 1e-13 * scale,
                "{stem}: Stewart's form leaves {}",
                a.residual
            );
            assert!(
                b.residual <= 1e-13 * scale,
                "{stem}: the step form leaves {}",
                b.residual
            );
            for ((a, b), state) in a.rates.iter().zip(&b.rates).zip(&system.states) {
                // A point may be where no function of the rate is defined; then both forms say so.
                let close = (a - b).abs() <= 1e-12 * (1.0 + a.abs()) || a.is_nan() && b.is_nan();
                assert!(close, "{stem}: der({}) is {a} and {b}", state.name);
            }
            // Where comparisons of indicators are behind others, their α may have any value.
            let alphas = |dcs: &Dcs, found: &Pointwise| -> Vec<f64> {
                let inside = |var| {
                    let mut all = dcs.algebraics.iter().zip(&found.algebraics);
                    let own = all.find(|(z, _)| z.var.as_variable() == Some(var));
                    own.map_or_else(|| value(var), |(_, z)| *z)
                };
                dcs.switches.at(&inside)
            };
            let [a, b] = [alphas(&stewart, &a), alphas(&step, &b)];
            for ((a, b), switch) in a.iter().zip(&b).zip(&system.switches) {
                let close = (a - b).abs() <= 1e-12 || a.is_nan();
                assert!(close, "{stem}: alpha of {} is {a} and {b}", switch.name);
            }
        }
    });
}

/// Small versions of the optimal control problems of the examples: file, and what is asked of its model.
const PROGRAMS: [(&str, &str); 5] = [
    (
        "tutorial_ocp",
        "of crossing { horizon 2; intervals 1; elements 2; scheme radau_iia(2); initial { x free; }
           minimize integral(x^2) + final((x - 5/3)^2); }",
    ),
    (
        "motor",
        "of voice_coil { horizon 0.08; intervals 2; elements 2; scheme radau_iia(1);
           minimize integral(U^2); final { x1 = 0.01; v1 = 0; x2 = 0.01; v2 = 0; I = 0; } }",
    ),
    (
        "turbo_car",
        "of turbo_car { horizon free in [1, 100] = 20; intervals 2; elements 2; scheme radau_iia(1);
           minimize final(time); final { q = 200; v = 0; } }",
    ),
    (
        "choices_ocp",
        "of tank { horizon 1; intervals 2; elements 1; scheme radau_iia(1); free { leak; }
           minimize integral((h - 2)^2); subject to { h <= 3; } at nodes; final { h >= 1; } }",
    ),
    (
        "tanks",
        "of tanks { horizon 10; intervals 1; elements 2; scheme radau_iia(1); controls linear;
           minimize integral((L[1] - 0.75)^2) + final((L[3] - 0.75)^2); }",
    ),
];

/// As `nsdc emit --ir fesd` and `--ir mpcc` show them.
#[test]
fn printed_programs() {
    for (stem, asked) in PROGRAMS {
        let path = examples().join(stem).with_extension("nsd");
        let text = fs::read_to_string(path).expect("an example is text");
        with_experiment(
            &format!("{text}\noptimize golden {asked}"),
            "golden",
            |compiled| {
                let settings = &compiled.settings;
                let task = settings.optimize.as_ref().expect("an optimization");
                let program = optimize::program(&compiled.system, settings, task, &[]);
                let program = program.expect("the program is small");
                insta::assert_snapshot!(format!("{stem}.fesd"), program);
                insta::assert_snapshot!(format!("{stem}.mpcc"), program.flat());
            },
        );
    }
}
