//! Controls with finite sets of values, against all of their sequences in closed form.

use nsd_tests::optimum;
use nsd_tests::random::Random;
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

/// x' = a x + b u + c from x₀: over an interval x goes to g x + (b u + c) (g - 1)/a, g = exp(a h). All sequences of few are
/// tried, however many values differ, and where one keeps a constraint there is a solution.
#[test]
fn few_sequences_are_all_tried() {
    let mut numbers = Random(5);
    for case in 0..24 {
        let values: Vec<f64> = numbers.of(&[&[-1.0, 1.0][..], &[-1.0, 0.0, 2.0]]).to_vec();
        let n = if values.len() == 2 { 6 } else { 4 };
        let [a, b, c] = [0.0; 3].map(|_| numbers.rounded(0.3, 2.0));
        let [start, target, push] = [0.0; 3].map(|_| numbers.rounded(-1.0, 1.0));
        let h = 2.0 / n as f64;
        let g = (a * h).exp();
        let end = move |u: &[f64]| {
            u.iter()
                .fold(start, |x, u| g * x + (c - b * u) * (g - 1.0) / a)
        };
        let sequences = |limit: f64| {
            let cost = move |u: &[f64]| match end(u) <= limit {
                true => (end(u) - target).powi(2) + push * h * u.iter().sum::<f64>(),
                false => f64::INFINITY,
            };
            least(&values, n, &cost)
        };
        let lowest = least(&values, n, &end);
        let limits = [f64::INFINITY, lowest + 1e-3];
        let limit = limits[case % 2];
        let row = match limit.is_finite() {
            true => format!("final {{ x <= {limit:?}; }}"),
            false => String::new(),
        };
        let set: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
        let text = format!(
            "model m {{ state x = {start:?}; control u in {{{}}} = -1; x' = {a:?}*x - {b:?}*u + {c:?}; }}
             optimize o of m {{ horizon 2; intervals {n}; elements 1; scheme radau_iia(5);
               minimize integral({push:?}*u) + final((x - ({target:?}))^2); {row} }}",
            set.join(", ")
        );
        let (found, best) = (objective(&text), sequences(limit));
        assert!(
            (found - best).abs() <= 1e-5 * best.abs().max(1.0),
            "{text}: {found}, not {best}"
        );
    }
}
