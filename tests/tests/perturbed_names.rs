//! Random perturbations belong to the names of states: what is kept, and in which order states stand, changes nothing.

use nsd_tests::random::Random;
use nsd_tests::{end, solved};

/// States that do not act on each other, a vector and one of a part among them, in two orders.
fn model(name: &str, order: &[usize], rates: &[f64]) -> String {
    let lines = [
        format!("state a = 1; a' = {:?} - a;", rates[0]),
        format!("state b = 0.5; b' = -{:?}*sign(b);", 0.5 + rates[1]),
        format!(
            "state v[2] = [1, -1]; v[1]' = v[2]; v[2]' = -{:?}*v[1];",
            0.5 + rates[2]
        ),
        format!("part p = lag {{ k = {:?}; }}", 0.5 + rates[3]),
    ];
    let lines: Vec<&str> = order.iter().map(|&k| lines[k].as_str()).collect();
    format!("model {name} {{ {} }}", lines.join(" "))
}

#[test]
fn what_is_kept_and_the_order_of_states_change_no_perturbation() {
    const NAMES: [&str; 4] = ["a", "b", "v", "p.x"];
    for seed in 0..200 {
        let mut random = Random(seed);
        let rates: Vec<f64> = (0..4).map(|_| random.unit()).collect();
        let mut order: Vec<usize> = (0..4).collect();
        for k in (1..4).rev() {
            order.swap(k, (random.unit() * (k + 1) as f64) as usize);
        }
        let mut kept: Vec<&str> = (NAMES.into_iter())
            .filter(|_| random.unit() < 0.5)
            .collect();
        if kept.is_empty() {
            kept.push(NAMES[seed as usize % 4]);
        }
        let by = match seed % 2 {
            0 => "sphere(0.05)",
            _ => "gauss(0.03)",
        };
        let settings = format!("horizon 0.7; perturb every 0.2 by {by} seed {seed};");
        let text = format!(
            "model lag {{ param k = 1; state x = 1; x' = -k*x; }}
             {} {}
             simulate all of whole {{ {settings} }}
             simulate some of turned {{ {settings} output {}; }}",
            model("whole", &[0, 1, 2, 3], &rates),
            model("turned", &order, &rates),
            kept.join(", ")
        );
        let (all, some) = (solved(&text, "all"), solved(&text, "some"));
        for name in kept {
            let pairs = end(&all, name).into_iter().zip(end(&some, name));
            for (whole, part) in pairs {
                assert!(
                    (whole - part).abs() < 1e-7,
                    "{name}: {whole} and {part}\n{text}"
                );
            }
        }
    }
}

/// Entries of one vector, and states of one model, have perturbations of their own.
#[test]
fn states_have_perturbations_of_their_own() {
    let text =
        "model m { state a = 0; state b = 0; state v[2] = [0, 0]; a' = 0; b' = 0; v' = [0, 0]; }
        simulate s of m { horizon 0.3; perturb every 0.2 by gauss(1) seed 4; }";
    let found = solved(text, "s");
    let mut ends = [end(&found, "a"), end(&found, "b"), end(&found, "v")].concat();
    ends.sort_by(f64::total_cmp);
    assert!(
        ends.windows(2).all(|pair| pair[1] - pair[0] > 1e-6),
        "{ends:?}"
    );
}
