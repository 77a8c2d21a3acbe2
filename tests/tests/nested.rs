//! Many control intervals: what happens when is found with fewer of them, and the optimum is that of all.

use nsd_tests::optimum;
use nsd_tests::random::Random;
use nsdc::report::{Status, Trajectory, Way};

/// How many random motions are looked at.
const MOVES: usize = 6;

/// The optimum with an objective to a relative tolerance.
fn solved(text: &str, exact: f64, tolerance: f64) -> Trajectory {
    let found = optimum(text, "o");
    assert_eq!(found.status, Status::Solved, "{:?}\n{text}", found.failure);
    let objective = found.objective.expect("a solution has an objective");
    let error = (objective - exact).abs() / exact.max(1.0);
    assert!(error < tolerance, "{objective:e} and not {exact:e}\n{text}");
    found
}

/// Whether it began with fewer intervals.
fn is_nested(found: &Trajectory) -> bool {
    let ways = found.optimum.iter().flat_map(|found| &found.ways);
    ways.skip(1).any(|found| found.way == Way::Grid)
}

/// From rest to rest over 1 in a unit of time at least ∫ u²: 12 / (1 - 1/N²) with N constant controls, 12 with lines.
#[test]
fn optima_are_those_of_all_intervals() {
    for (n, first) in [(131, false), (132, true), (195, true)] {
        for (shape, exact) in [
            ("constant", 12.0 / (1.0 - 1.0 / f64::from(n).powi(2))),
            ("linear", 12.0),
        ] {
            for scheme in ["radau_iia(2)", "gauss(2)", "lobatto_iiia(3)"] {
                let text = format!(
                    "model m {{ state x = 0; state v = 0; control u = 0; x' = v; v' = u; }}
                     optimize o of m {{ horizon 1; intervals {n}; scheme {scheme}; controls {shape}; minimize integral(u^2);
                       final {{ x = 1; v = 0; }} }}"
                );
                assert_eq!(is_nested(&solved(&text, exact, 1e-9)), first, "{text}");
            }
        }
    }
}

/// Within [-1, 1] from rest to rest over 1 in 2, with a free horizon.
#[test]
fn horizons_are_free() {
    let text = "model m { state x = 0; state v = 0; control u in [-1, 1] = 0; x' = v; v' = u; }
        optimize o of m { horizon free = 3; intervals 144; minimize final(time); final { x = 1; v = 0; } }";
    assert!(is_nested(&solved(text, 2.0, 1e-8)));
}

/// From 1 to 0 with 3/2, the relay and the control together, and rest by the relay: ∫ x² = 2/9, whether the switch is in an
/// interval of the first grid or at its end, by elements that detect it and in both lowerings.
#[test]
fn switches_are_where_they_are() {
    for (horizon, n, rest) in [
        (2.0, 528, "elements 2;"),
        (2.0, 135, "elements 2; lower step;"),
        (2.0, 128, "elements 2; lower stewart;"),
    ] {
        let text = format!(
            "model m {{ state x = 1; control u in [-0.5, 0.5] = 0; x' = u - sign(x); }}
             optimize o of m {{ horizon {horizon}; intervals {n}; {rest} minimize integral(x^2); }}"
        );
        assert!(is_nested(&solved(&text, 2.0 / 9.0, 1e-7)), "{text}");
    }
}

/// What elements of equal lengths do not detect costs no more than the lengths of elements.
#[test]
fn elements_are_plain() {
    let text = "model m { state x = 1; control u in [-0.5, 0.5] = 0; x' = u - sign(x); }
        optimize o of m { horizon 2; intervals 160; elements plain(3); minimize integral(x^2); }";
    assert!(is_nested(&solved(text, 2.0 / 9.0, 1e-3)));
}

/// A price that triples at 3/4: all of x = 1 is bought before. The first grid has an end of an interval there, too.
#[test]
fn prices_rise_at_ends_of_intervals() {
    for (n, first) in [(160, true), (180, true), (148, false)] {
        let text = format!(
            "model m {{ state x = 0; control u in [0, 4] = 1; x' = u; }}
             optimize o of m {{ horizon 1; intervals {n}; minimize integral((1 + 2*floor(time/0.75))*u); final {{ x = 1; }} }}"
        );
        assert_eq!(is_nested(&solved(&text, 1.0, 1e-6)), first, "{text}");
    }
}

/// With friction μ from rest to rest over d at least ∫ u²: while it moves, for τ in all, u - μ is a line, and u² is
/// 12 d²/τ³ + μ² τ, least for τ² = 6 d / μ. With N constant controls it is larger by a share of the square of an interval.
#[test]
fn blocks_with_friction_move_as_long_as_pays() {
    let mut random = Random(2);
    for _ in 0..MOVES {
        let (mu, d) = (random.within(0.1, 0.6), random.within(0.2, 1.0));
        let tau = (6.0 * d / mu).sqrt();
        let horizon = tau * random.within(1.05, 2.5);
        let n = random.of(&[96, 130, 192]);
        let limit = 2.0 * mu * random.within(1.3, 3.0);
        let text = format!(
            "model m {{ state x = 0; state v = 0; control u in [-{limit}, {limit}] = 0; x' = v; v' = u - {mu}*sign(v); }}
             optimize o of m {{ horizon {horizon}; intervals {n}; minimize integral(u^2); final {{ x = {d}; v = 0; }} }}"
        );
        let found = optimum(&text, "o");
        assert_eq!(found.status, Status::Solved, "{:?}\n{text}", found.failure);
        assert!(is_nested(&found), "{text}");
        let exact = 4.0 / 3.0 * mu * mu * tau;
        let excess = found.objective.expect("a solution has an objective") / exact - 1.0;
        let interval = horizon / n as f64 / tau;
        assert!(
            (-1e-9..3.0 * interval * interval).contains(&excess),
            "{excess:e}\n{text}"
        );
    }
}
