//! Piles of bodies that fall to rest from event to event, without rebound, and what lies on a floor that moves.

use nsd_tests::random::Random;
use nsd_tests::{end, run, times};
use nsdc::report::{EventKind, Status, Trajectory};

#[test]
fn what_lies_on_a_shaken_floor_leaves_it_again_and_again() {
    // The floor at sin(8 t)/5 falls faster than g where 64/5 sin(8 t) > g.
    let trajectory = run(
        "model shaken {
           state q = 0;
           state v = 1.6;
           q' = v;
           mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q - 0.2*sin(8*time); restitution = 0; } }
         }
         simulate this of shaken { horizon 4; }",
        "this",
    );
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    let (opens, closes) = (
        times(&trajectory, EventKind::ContactOpen),
        times(&trajectory, EventKind::ContactClose),
    );
    let period = std::f64::consts::TAU / 8.0;
    let first = (9.81_f64 / 12.8).asin() / 8.0;
    assert_eq!((opens.len(), closes.len()), (5, 5));
    for (k, (open, close)) in opens.iter().zip(&closes).enumerate() {
        let leaves = first + period * k as f64;
        assert!((open - leaves).abs() <= 1e-9, "{open}, not {leaves}");
        // Down again where q + v s - g s²/2 meets the floor.
        let (sin, cos) = (8.0 * leaves).sin_cos();
        let gap =
            |s: f64| 0.2 * sin + 1.6 * cos * s - 4.905 * s * s - 0.2 * (8.0 * (leaves + s)).sin();
        let (mut low, mut high) = (0.2, 0.6);
        assert!(gap(low) > 0.0 && gap(high) < 0.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            match gap(middle) > 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        assert!((close - leaves - low).abs() <= 1e-9, "{close}");
    }
}

/// Discs of radius 0.1 fall into a bin, one above the other.
fn pile(n: usize, width: f64, friction: &str) -> Trajectory {
    let x: Vec<f64> = (1..=n)
        .map(|i| width / 2.0 + 0.05 * (7.0 * i as f64).sin())
        .collect();
    let y: Vec<f64> = (1..=n).map(|i| 0.25 * i as f64).collect();
    pile_from(&x, &y, width, friction)
}

/// Discs fall into a bin from these places.
fn pile_from(x: &[f64], y: &[f64], width: f64, friction: &str) -> Trajectory {
    let n = x.len();
    let trajectory = run(
        &format!(
            "model disc {{
               param r = 0.1;
               state q[2];
               state v[2] = [0, 0];
               q' = v;
               mechanics q, v {{ mass = eye(2); force = [0, -9.81]; }}
               output energy = dot(v, v)/2 + 9.81*q[2];
             }}
             model bin {{
               const n = {n};
               const x = {x:?};
               const y = {y:?};
               param width = {width:?};
               part ball[i in 1..n] = disc {{ q = [x[i], y[i]]; }}
               for i in 1..n {{
                 contact floor {{ gap = ball[i].q[2] - ball[i].r; restitution = 0; {friction} }}
                 contact left {{ gap = ball[i].q[1] - ball[i].r; restitution = 0; {friction} }}
                 contact right {{ gap = width - ball[i].q[1] - ball[i].r; restitution = 0; {friction} }}
               }}
               for i in 1..n, j in i+1..n {{
                 contact pair {{
                   gap = norm(ball[i].q - ball[j].q) - ball[i].r - ball[j].r; restitution = 0; {friction}
                 }}
               }}
               output energy = sum(ball[i].energy for i in 1..n);
             }}
             simulate this of bin {{ horizon 4; }}"
        ),
        "this",
    );
    let name = format!("{n} discs, width {width}, {friction}");
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{name}: {:?}",
        trajectory.failure
    );
    let disc = |i: usize| {
        let name = format!("ball[{}].q", i + 1);
        let series = trajectory
            .samples
            .states
            .iter()
            .find(|series| series.name == name);
        series.expect("it is a state")
    };
    for instant in 0..trajectory.samples.time.len() {
        let places: Vec<&[f64]> = (0..n).map(|i| disc(i).at(instant)).collect();
        for (i, a) in places.iter().enumerate() {
            let walls = (a[0] - 0.1).min(width - a[0] - 0.1).min(a[1] - 0.1);
            let others = places[..i].iter();
            let gaps = others.map(|b| (a[0] - b[0]).hypot(a[1] - b[1]) - 0.2);
            let least = gaps.fold(walls, f64::min);
            assert!(least >= -1e-10, "{name}: {least}");
        }
    }
    let energy = values(&trajectory, "energy");
    let grows = energy
        .windows(2)
        .find(|pair| pair[1] > pair[0] + 1e-9 * energy[0]);
    assert_eq!(grows, None, "{name}");
    trajectory
}

fn values(trajectory: &Trajectory, name: &str) -> Vec<f64> {
    let output = trajectory
        .samples
        .outputs
        .iter()
        .find(|output| output.name == name);
    output.expect("the model has it").values.clone()
}

#[test]
fn piles_of_four_fall_without_depth_and_without_energy() {
    // Two to five discs wide: from zigzags to a row.
    for width in [0.5, 0.58, 0.68, 0.75, 1.0] {
        pile(4, width, "");
        let rough = pile(4, width, "friction = 0.3;");
        for i in 1..=4 {
            let v = end(&rough, &format!("ball[{i}].v"));
            assert!(v[0].abs() + v[1].abs() <= 1e-9, "{width}: {v:?}");
        }
    }
}

/// Discs between others that close off a row push them apart: what is closed stays so, however slowly it moves.
#[test]
fn piles_of_five_and_six_come_to_rest() {
    let bins: [(f64, &[f64], &[f64]); 2] = [
        (
            1.066,
            &[0.52, 0.3266, 0.1004, 0.674, 0.5072, 0.7579],
            &[0.2649, 0.5308, 0.7609, 1.0321, 1.2792, 1.5166],
        ),
        (
            0.652,
            &[0.3392, 0.2581, 0.2725, 0.5505, 0.3181],
            &[0.2757, 0.5184, 0.7846, 1.0091, 1.2501],
        ),
    ];
    for (width, x, y) in bins {
        pile_from(x, y, width, "");
    }
}

#[test]
fn three_discs_fit_a_bin_exactly() {
    // The third one grazes both others and comes down between them: a row without any room.
    let trajectory = pile(3, 0.6, "");
    let mut x: Vec<f64> = Vec::new();
    for i in 1..=3 {
        let q = end(&trajectory, &format!("ball[{i}].q"));
        assert!((q[1] - 0.1).abs() <= 1e-7, "{q:?}");
        x.push(q[0]);
    }
    x.sort_by(f64::total_cmp);
    for (x, exact) in x.iter().zip([0.1, 0.3, 0.5]) {
        assert!((x - exact).abs() <= 1e-9, "{x}, not {exact}");
    }
}

/// Bins that come to rest after few events.
const SEEDS: [u64; 16] = [3, 5, 7, 8, 10, 12, 14, 17, 18, 20, 21, 27, 35, 41, 49, 57];

/// Four to six discs fall from anywhere into bins of any width.
#[test]
fn piles_that_fall_at_random_come_to_rest() {
    for seed in SEEDS {
        let mut random = Random(seed);
        let n = 4 + (3.0 * random.unit()) as usize;
        let width = 0.5 + 0.6 * random.unit();
        let x: Vec<f64> = (0..n)
            .map(|_| 0.1 + (width - 0.2) * random.unit())
            .collect();
        let y: Vec<f64> = (1..=n).map(|i| 0.25 * i as f64).collect();
        for friction in ["", "friction = 0.3;"] {
            let found = pile_from(&x, &y, width, friction);
            for i in 1..=n {
                let (q, v) = (
                    end(&found, &format!("ball[{i}].q")),
                    end(&found, &format!("ball[{i}].v")),
                );
                // Without friction nothing stops what slides along the floor, until it meets another one.
                let slides = friction.is_empty() && (q[1] - 0.1).abs() <= 1e-10;
                let at_rest = v[1].abs() <= 1e-9 && (slides || v[0].abs() <= 1e-9);
                assert!(at_rest, "seed {seed}, {friction}: {v:?}");
            }
        }
    }
}
