//! Grids that refine themselves: closed forms, and what is said of the way there.

use nsd_tests::{agrees, codes, optimum, solved_optimum};
use nsdc::report::{GridTried, Trajectory};

#[track_caller]
fn solved(model: &str, experiment: &str) -> Trajectory {
    solved_optimum(
        &format!("model m {{ {model} }} optimize o of m {{ {experiment} }}"),
        "o",
    )
}

fn grids(found: &Trajectory) -> &[GridTried] {
    &found.optimum.as_ref().expect("how it was found").grids
}

/// An optimum that a first grid misses, and the last one has to the tolerance, with a simulation that agrees.
#[track_caller]
fn is_refined_to(found: &Trajectory, exact: f64, missed: f64) {
    let cost = found.objective.expect("an optimum");
    assert!((cost - exact).abs() <= 1e-6, "{cost} is not {exact}");
    let grids = grids(found);
    let first = grids.first().expect("a grid").objective;
    assert!((first - exact).abs() > missed, "{first} on the first grid");
    let last = grids.last().expect("a grid");
    assert_eq!(last.objective, cost);
    assert!(last.error <= 1e-6, "{grids:?}");
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    agrees(found, 1e-6);
}

/// x(2) = cos 6 + Σ u_k w_k with w_k = ∫ sin(3 (2 - s))/3 ds over interval k is least for u_k = -sign(w_k).
#[test]
fn nodes_are_added_until_a_simulation_agrees() {
    let found = solved(
        "state x = 1; state v = 0; control u in [-1, 1] = 0; x' = v; v' = -9*x + u;",
        "horizon 2; intervals 10; elements 2; scheme radau_iia(1); grid auto; minimize final(x);",
    );
    let at = |k: i32| (3.0 * (2.0 - 0.2 * f64::from(k))).cos() / 9.0;
    let gained: f64 = (1..=10).map(|k| (at(k) - at(k - 1)).abs()).sum();
    is_refined_to(&found, 6.0_f64.cos() - gained, 1e-2);
    let elements: Vec<usize> = grids(&found).iter().map(|grid| grid.elements).collect();
    assert!(elements.iter().all(|&elements| elements == 2));
    let nodes: Vec<usize> = grids(&found).iter().map(|grid| grid.nodes).collect();
    assert!(nodes.is_sorted() && nodes[0] == 1, "{nodes:?}");
}

/// From 1, x = 2 e^-t - 1 is zero at ln 2 and stays there, so that y(1) = u (1 - ln 2).
#[test]
fn a_switch_stays_where_elements_meet() {
    let found = solved(
        "state x = 1; state y = 0; control u = 0; x' = -x - sign(x); y' = u*x;",
        "horizon 1; intervals 1; elements 3; scheme radau_iia(2); grid auto;
         minimize integral((u - 1)^2) + final(y);",
    );
    let way = 1.0 - 2.0_f64.ln();
    is_refined_to(&found, way - way * way / 4.0, 1e-5);
    assert_eq!(found.history.events.len(), 1);
    assert!((found.history.events[0].time - 2.0_f64.ln()).abs() < 1e-6);
}

/// x' = v, v' = 4 x + u from (1, 0) to rest at 0: p = v + 2 x and q = v - 2 x have p' = 2 p + u and q' = -2 q + u, and
/// errors of p grow by e^10. The least h Σ u² with two equations for u is that of least squares.
#[test]
fn what_grows_along_the_run_is_met() {
    let found = solved(
        "state x = 1; state v = 0; control u = 0; x' = v; v' = 4*x + u;",
        "horizon 5; intervals 10; elements 1; scheme radau_iia(2); grid auto;
         minimize integral(u^2); final { x = 0; v = 0; }",
    );
    let h = 0.5;
    let end = |k: i32| h * f64::from(k);
    // 0 = 2 + Σ u (e^{-2 t_{k-1}} - e^{-2 t_k})/2, and 0 = -2 e^{-10} + Σ u (e^{-2 (5 - t_k)} - e^{-2 (5 - t_{k-1})})/2.
    let rows = (1..=10).map(|k| {
        let p = ((-2.0 * end(k - 1)).exp() - (-2.0 * end(k)).exp()) / 2.0;
        let q = ((-2.0 * (5.0 - end(k))).exp() - (-2.0 * (5.0 - end(k - 1))).exp()) / 2.0;
        [p, q]
    });
    let (mut a, mut b, mut d) = (0.0, 0.0, 0.0);
    for [p, q] in rows {
        (a, b, d) = (a + p * p, b + p * q, d + q * q);
    }
    let [s, t] = [-2.0, 2.0 * (-10.0_f64).exp()];
    let exact = h * (d * s * s - 2.0 * b * s * t + a * t * t) / (a * d - b * b);
    is_refined_to(&found, exact, 1e-5);
}

/// A ball that falls by the air: v' = a - v has v = a + (v0 - a) e^-t, with a = u - 10.
#[test]
fn impacts_stay_where_elements_meet() {
    let found = solved(
        "state q = 1; state v = 0; control u in [-1, 1] = 0; q' = v;
         mechanics q, v { mass = 1; force = u - 10 - v; contact floor { gap = q; restitution = 0.8; } }",
        "horizon 0.8; intervals 2; elements 2; scheme radau_iia(2); grid auto; lower impact; minimize -final(q);",
    );
    let flight = |(q, v): (f64, f64), a: f64, t: f64| {
        let left = 1.0 - (-t).exp();
        (q + a * t + (v - a) * left, v + (a - v) * left)
    };
    let height = |u: [f64; 2]| {
        let [first, last] = u.map(|u| u - 10.0);
        let thrown = flight((1.0, 0.0), first, 0.4);
        let s = (0..50).fold(0.06, |s, _| {
            let (q, v) = flight(thrown, last, s);
            s - q / v
        });
        let (_, v) = flight(thrown, last, s);
        flight((0.0, -0.8 * v), last, 0.4 - s).0
    };
    let highest = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]].map(height);
    let highest = highest.into_iter().fold(f64::NEG_INFINITY, f64::max);
    is_refined_to(&found, -highest, 1e-7);
    assert!(grids(&found).iter().all(|grid| grid.elements == 2));
}

/// Nodes at the ends of elements, and two at one place.
#[test]
fn every_family_has_polynomials() {
    for scheme in [
        "radau_ia(1)",
        "radau_ia(2)",
        "lobatto_iiia(3)",
        "lobatto_iiic(3)",
        "explicit(2)",
        "explicit(3)",
        "explicit(4)",
    ] {
        let found = optimum(
            &format!(
                "model m {{ state x = 1; state v = 0; control u in [-1, 1] = 0; x' = v; v' = -9*x + u; }}
                 optimize o of m {{ horizon 1; intervals 2; elements 60; scheme {scheme}; minimize final(x); }}"
            ),
            "o",
        );
        let at = |k: i32| (3.0 * (1.0 - 0.5 * f64::from(k))).cos() / 9.0;
        let gained: f64 = (1..=2).map(|k| (at(k) - at(k - 1)).abs()).sum();
        let cost = found.objective.expect("an optimum");
        assert!(
            (cost - (3.0_f64.cos() - gained)).abs() < 0.05,
            "{scheme}: {cost}"
        );
    }
}

/// Explicit methods have 4 nodes at most; each halving of elements divides their error by 16.
#[test]
fn elements_are_halved_where_there_are_no_more_nodes() {
    let found = optimum(
        "model m { state x = 1; state v = 0; control u in [-1, 1] = 0; x' = v; v' = -9*x + u; }
         optimize o of m { horizon 2; intervals 4; elements 1; scheme explicit(4); grid auto; minimize final(x); }",
        "o",
    );
    let grids = grids(&found);
    let sizes: Vec<[usize; 2]> = grids
        .iter()
        .map(|grid| [grid.elements, grid.nodes])
        .collect();
    assert_eq!(sizes, [[1, 4], [2, 4], [4, 4]]);
    for pair in grids.windows(2) {
        let gain = pair[0].error / pair[1].error;
        assert!(gain > 8.0, "{grids:?}");
    }
    // There it ends, and says so.
    let codes: Vec<&str> = found
        .warnings
        .iter()
        .map(|warning| &warning.code[..])
        .collect();
    assert_eq!(codes, ["W0709"]);
}

#[test]
fn a_grid_that_is_fine_stays() {
    let found = solved(
        "state x = 1; control u in [-9, 9] = 0; x' = u;",
        "horizon 1; intervals 2; grid auto; minimize integral(u^2); final { x = 0; }",
    );
    assert_eq!(grids(&found).len(), 1);
    agrees(&found, 1e-9);
}

/// Where no grid is given, it is looked for.
#[test]
fn grids_refine_themselves_unless_they_are_given() {
    let with = |grid: &str| {
        let found = solved(
            "state x = 1; control u in [-9, 9] = 0; x' = u;",
            &format!("horizon 1; {grid} minimize integral(u^2); final {{ x = 0; }}"),
        );
        grids(&found).len()
    };
    for (grid, count) in [
        ("", 1),
        ("scheme radau_iia(2);", 1),
        ("grid fixed;", 0),
        ("intervals 3;", 0),
        ("elements 1;", 0),
        ("intervals 3 free;", 0),
        ("intervals 3; elements 1; grid auto;", 1),
    ] {
        assert_eq!(with(grid), count, "{grid}");
    }
}

#[test]
fn other_words_are_errors() {
    let of = |settings: &str| {
        codes(&format!(
            "model m {{ state x = 1; control u in [-9, 9] = 0; x' = u; }}
             optimize o of m {{ horizon 1; {settings} minimize integral(u^2); }}"
        ))
    };
    assert_eq!(of("grid fine;"), of("controls fine;"));
    assert_eq!(
        of("grid auto; grid fixed;"),
        of("scheme radau_iia(2); scheme radau_iia(2);")
    );
    assert_eq!(
        codes("model m { state x = 1; x' = 0; } simulate s of m { horizon 1; grid auto; }"),
        ["E0509"]
    );
}
