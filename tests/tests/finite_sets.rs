//! Controls with finite sets of values, against all of their sequences in closed form.

use nsd_tests::optimum;
use nsdc::report::Status;

/// What a problem costs with a sequence of values.
type Cost = dyn Fn(&[f64]) -> f64;

/// The least cost of all sequences of so many values.
fn least(values: &[f64], n: usize, cost: &Cost) -> f64 {
    let count = values.len().pow(n as u32);
    let sequence = |number: usize| -> Vec<f64> {
        (0..n as u32)
            .map(|k| values[number / values.len().pow(k) % values.len()])
            .collect()
    };
    (0..count)
        .map(|number| cost(&sequence(number)))
        .fold(f64::INFINITY, f64::min)
}

fn objective(text: &str) -> f64 {
    let found = optimum(text, "o");
    assert_eq!(found.status, Status::Solved, "{text}\n{:?}", found.failure);
    found.objective.expect("it was minimized")
}

/// Of (x(1) - r)² with x' = g one change alone leads to a better sequence, or none does.
#[test]
fn a_sequence_is_better_than_those_beside_it() {
    for r in [0.05, 0.2, 0.4, 0.55, 0.7, 0.95] {
        for (set, values) in [("0, 1", vec![0.0, 1.0]), ("-1, 0, 1", vec![-1.0, 0.0, 1.0])] {
            let text = format!(
                "model m {{ state x = 0; control g in {{{set}}} = 0; x' = g; }}
                 optimize o of m {{ horizon 1; intervals 3; minimize final((x - {r:?})^2); }}"
            );
            let cost = move |g: &[f64]| (g.iter().sum::<f64>() / 3.0 - r).powi(2);
            let (found, best) = (objective(&text), least(&values, 3, &cost));
            assert!(found <= best + 1e-9, "{set}, {r}: {found}, not {best}");
        }
    }
}

/// A room that is heated, on or off, at a price: x' = a - x + b g.
#[test]
fn heating_is_as_cheap_as_enumeration_finds() {
    for case in 0..6 {
        let (a, b) = (0.3 * f64::from(case % 3), 2.0 + 0.5 * f64::from(case % 4));
        let price = 0.05 + 0.1 * f64::from(case);
        let text = format!(
            "model m {{ state x = 0.5; control g in {{0, 1}} = 0; x' = {a:?} - x + {b:?}*g; }}
             optimize o of m {{ horizon 2; intervals 4; elements 1; scheme radau_iia(4);
               minimize final((x - 1)^2) + {price:?}*integral(g); }}"
        );
        let cost = move |g: &[f64]| {
            let decay = (-0.5_f64).exp();
            let x = g
                .iter()
                .fold(0.5, |x, g| a + b * g + (x - a - b * g) * decay);
            (x - 1.0).powi(2) + price * 0.5 * g.iter().sum::<f64>()
        };
        let (found, best) = (objective(&text), least(&[0.0, 1.0], 4, &cost));
        assert!((found - best).abs() < 1e-4, "{case}: {found}, not {best}");
    }
}

/// A ball that bounces beside x' = g, by impulses where elements meet: what tells of the value of g is none of the impulses.
#[test]
fn contacts_do_not_change_choices() {
    for r in [0.4, -0.7, 0.95] {
        let text = format!(
            "model m {{ state q = 0.05; state v = 0; state x = 0; control g in {{-1, 0, 1}} = 0;
               q' = v; x' = g;
               mechanics q, v {{ mass = 1; force = -10; contact ground {{ gap = q; restitution = 0; }} }} }}
             optimize o of m {{ horizon 1; intervals 3; elements 2; lower impact; minimize final((x - {r:?})^2); }}"
        );
        let cost = move |g: &[f64]| (g.iter().sum::<f64>() / 3.0 - r).powi(2);
        let (found, best) = (objective(&text), least(&[-1.0, 0.0, 1.0], 3, &cost));
        assert!(found <= best + 1e-9, "{r}: {found}, not {best}");
    }
}
