//! Systems against their models, as numbers.

use rustc_hash::FxHashMap;

use crate::Compiled;
use crate::expr::{Expr, Var};
use crate::system::regions::sample::Random;
use crate::testing::with_last;

/// Off the surfaces, the system has the rates and readings of the model as it is written.
#[test]
fn systems_agree_with_their_models() {
    let region_models = [
        "param k = 2;
         region p where max(x, y) > k or x < -1 { x' = -k; y' = abs(x); }
         region q where x > -1 and max(x, y) < k and y > 0 { x' = sign(x)*y; y' = -sign(y - x); }
         region r else { x' = 2; y' = 0; }
         region extra where y > 1 { y' += -5*x; }",
        "switch s = sign(x - y);
         region a where not (x > 0 and y > 0) { x' = s*sign(x); y' = sat(y, -1, 2); }
         region b else { x' = if -1 < x - y < 1 then x else s; y' = deadzone(x)*step(y - 1); }",
        "switch s = sign(x - 0.5) sliding linear;
         x' = exp(s)*y - s^3; y' = -x/abs(x) + min(x, y)*s;",
    ];
    for statements in region_models {
        let text = format!(
            "model m {{ state x = 0.3; state y = 0.4; {statements} }} simulate run of m {{ horizon 1; }}"
        );
        with_last(&text, agrees);
    }
}

/// Off its surfaces, at random points.
fn agrees(compiled: &Compiled<'_>) {
    let Compiled { model, system, .. } = compiled;
    let mut random = Random(1);
    for _ in 0..200 {
        let at = [3.0 * random.symmetric(), 3.0 * random.symmetric()];
        let mut values: FxHashMap<Var, f64> = FxHashMap::default();
        let known = system
            .states
            .iter()
            .zip(at)
            .map(|(state, value)| (state.var, value));
        let params = system.exogenous.numbers();
        for (var, value) in known.chain(params).chain([(system.time, 0.5)]) {
            values.insert(var.as_variable().unwrap(), value);
        }
        let of = |e: Expr<'_>, values: &FxHashMap<Var, f64>| e.eval(&|var| values[&var]);
        for switch in &model.switches {
            let sign = of(switch.psi[0], &values).signum();
            values.insert(switch.vars[0].as_variable().unwrap(), sign);
        }
        for switch in &system.switches {
            let side = f64::from(of(switch.psi, &values) > 0.0);
            values.insert(switch.alpha.as_variable().unwrap(), side);
        }
        for (entry, state) in system.states.iter().enumerate() {
            let outside = model.statements.dynamics.iter().map(|rate| (rate, 1.0));
            let inside = model.statements.regions.iter().flat_map(|region| {
                let weight = of(region.guard, &values);
                region.rates.iter().map(move |rate| (rate, weight))
            });
            let terms = outside
                .chain(inside)
                .filter(|(rate, _)| rate.entry == entry);
            let written: f64 = terms.map(|(rate, w)| w * of(rate.value, &values)).sum();
            let lowered = of(state.rate, &values);
            assert!(
                (written - lowered).abs() < 1e-9,
                "{} at {at:?}: {written}, {lowered}",
                state.name
            );
            for rate in &model.statements.dynamics {
                let read = of(system.read(rate.value), &values);
                assert!(
                    (read - of(rate.value, &values)).abs() < 1e-9,
                    "{} at {at:?}",
                    rate.value
                );
            }
        }
    }
}
