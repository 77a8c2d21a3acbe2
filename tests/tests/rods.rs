//! A rod that falls on its end and then flat, by finite elements with impulses where they meet: the order, and all grids.

use nsd_tests::{end, times};
use nsdc::report::{EventKind, Trajectory};

#[track_caller]
fn close(value: f64, exact: f64, within: f64) {
    assert!((value - exact).abs() <= within, "{value} is not {exact}");
}

/// Experiment `o` of a text, which must solve.
#[track_caller]
fn solved(text: &str) -> Trajectory {
    nsd_tests::solved(text, "o")
}

/// Positions and speeds at the end.
fn whole(run: &Trajectory) -> Vec<f64> {
    ["q", "v"].iter().flat_map(|name| end(run, name)).collect()
}

/// A rod of length 1 and mass 1 above a rough floor, its angle measured from the vertical.
const ROD: &str = "
    model rod {
      state q[3] = [0, 0.5*cos(pi/4) + 0.2, pi/4];
      state v[3] = [2, 0, 0];
      q' = v;
      mechanics q, v {
        mass = [1, 0, 0; 0, 1, 0; 0, 0, 1/32];
        force = [0, -9.81, 0];
        contact lower {
          gap = q[2] - 0.5*cos(q[3]); slip = v[1] + 0.5*cos(q[3])*v[3]; restitution = 0; friction = 0.7;
        }
        contact upper {
          gap = q[2] + 0.5*cos(q[3]); slip = v[1] - 0.5*cos(q[3])*v[3]; restitution = 0; friction = 0.7;
        }
      }
    }";

/// The contact turns with its body: the gap and its rate vanish at the nodes while it slips, so that the order of
/// speeds is that of the scheme.
#[test]
fn a_rod_slips_on_its_end() {
    let exact = solved(&format!(
        "{ROD} simulate o of rod {{ horizon 0.36; tolerance 1e-12; }}"
    ));
    let exact = end(&exact, "v")[2];
    for (nodes, steps, order) in [(2, 18, 3.0), (3, 9, 5.0)] {
        let errors = [steps, 2 * steps].map(|steps| {
            let found = solved(&format!(
                "{ROD} simulate o of rod {{
                   horizon 0.36; lower impact;
                   method fesd {{ scheme = radau_iia({nodes}); steps = {steps}; }}
                 }}"
            ));
            // It has fallen by 0.2 m.
            let struck = times(&found, EventKind::Jump);
            assert_eq!(struck.len(), 1);
            close(struck[0], (0.4_f64 / 9.81).sqrt(), 1e-9);
            (end(&found, "v")[2] - exact).abs()
        });
        let seen = (errors[0] / errors[1]).log2();
        assert!(seen > order - 0.5, "{errors:?}, order {seen}");
    }
}

/// Its other end strikes, and both stay: whatever the grid, and by steps of a few nodes.
#[test]
fn a_rod_comes_to_lie_on_every_grid() {
    let events = solved(&format!(
        "{ROD} simulate o of rod {{ horizon 1; tolerance 1e-12; }}"
    ));
    let exact = whole(&events);
    let happened = |run: &Trajectory| {
        let events = run.history.events.iter();
        let mut all: Vec<_> = events
            .map(|event| (event.kind, event.surface.clone()))
            .collect();
        all.sort();
        all
    };
    let grids = [
        (10, 2),
        (20, 3),
        (30, 4),
        (40, 2),
        (60, 3),
        (80, 2),
        (100, 3),
    ];
    for (steps, nodes) in grids {
        let found = solved(&format!(
            "{ROD} simulate o of rod {{
               horizon 1; lower impact;
               method fesd {{ scheme = radau_iia({nodes}); steps = {steps}; }}
             }}"
        ));
        assert_eq!(happened(&found), happened(&events), "{steps} steps");
        let estimate = found.quality.error_estimate.expect("a finer run");
        for (value, exact) in whole(&found).into_iter().zip(&exact) {
            close(value, *exact, 10.0 * estimate + 1e-12);
        }
        assert!(
            estimate <= if nodes == 2 { 1e-3 } else { 1e-5 },
            "{estimate}"
        );
    }
}
