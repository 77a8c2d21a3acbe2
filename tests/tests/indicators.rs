//! Regions by indicators against closed forms, and against the same regions with guards.

use nsd_tests::{end, run};
use nsdc::report::{EventKind, Status, Trajectory};

const SITES: [[f64; 2]; 4] = [[0.1, 1.0], [-1.2, -0.3], [1.0, -0.8], [0.2, -0.1]];
const FLOWS: [[f64; 2]; 4] = [[0.3, -1.0], [1.0, 0.2], [-0.7, 0.5], [0.1, 0.9]];

/// Voronoi cells of [`SITES`] with the constant flows [`FLOWS`].
fn cells(by_indicators: bool, start: [f64; 2]) -> Trajectory {
    let distance = |i: usize| format!("((x - {:?})^2 + (y - {:?})^2)", SITES[i][0], SITES[i][1]);
    let region = |i: usize| {
        let others = (0..SITES.len()).filter(|&j| j != i);
        let guards: Vec<String> = others
            .map(|j| format!("{} < {}", distance(i), distance(j)))
            .collect();
        let head = match by_indicators {
            true => format!("indicator {}", distance(i)),
            false => format!("where {}", guards.join(" and ")),
        };
        format!(
            "region r{i} {head} {{ x' = {:?}; y' = {:?}; }}\n",
            FLOWS[i][0], FLOWS[i][1]
        )
    };
    let regions: String = (0..SITES.len()).map(region).collect();
    from(start, &regions)
}

/// Two units of time in the plane.
fn from([x, y]: [f64; 2], regions: &str) -> Trajectory {
    run(
        &format!(
            "model m {{ state x = {x:?}; state y = {y:?};\n{regions}}}
             simulate s of m {{ horizon 2; tolerance 1e-10; }}"
        ),
        "s",
    )
}

/// Instants at which the regions change.
fn changes(trajectory: &Trajectory) -> Vec<f64> {
    let mut found: Vec<f64> = Vec::new();
    let modes = trajectory.history.modes.windows(2);
    for pair in modes.filter(|pair| pair[0].regions != pair[1].regions) {
        found.push(pair[1].from);
    }
    found
}

#[test]
fn indicators_and_guards_are_the_same_regions() {
    // From the second one, three cells meet on the way.
    let starts = [
        [0.3, 1.7],
        [-1.5, 0.4],
        [1.6, -1.1],
        [-0.4, -1.9],
        [0.9, 0.6],
        [0.05, -0.6],
    ];
    for start in starts {
        let (one, other) = (cells(true, start), cells(false, start));
        assert_eq!(one.status, Status::Solved, "{start:?}");
        assert_eq!(other.status, Status::Solved, "{start:?}");
        for name in ["x", "y"] {
            let (a, b) = (end(&one, name)[0], end(&other, name)[0]);
            assert!((a - b).abs() < 1e-9, "{name} from {start:?}: {a} and {b}");
        }
        let (a, b) = (changes(&one), changes(&other));
        assert_eq!(a.len(), b.len(), "from {start:?}: {a:?} and {b:?}");
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() < 1e-9, "from {start:?}: {a} and {b}");
        }
    }
}

#[test]
fn a_corner_is_passed_along_another_boundary() {
    // From r1 onto the boundary with r0 at t = 3/4, along it to where r3 begins, and on between r0 and r3: there
    // ψ = g_0 - g_3 has the rates -2 (z_0 - z_3)·f = 2.26 with f_0 and -1.96 with f_3.
    let found = cells(true, [-1.5, 0.4]);
    assert_eq!(found.status, Status::Solved);
    let modes: Vec<&str> = found
        .history
        .modes
        .iter()
        .map(|mode| mode.mode.as_str())
        .collect();
    assert_eq!(modes[..3], ["r1", "sliding(r0, r1)", "sliding(r0, r3)"]);
    let corner = found.history.modes[2].from;
    assert!((found.history.modes[1].from - 0.75).abs() < 1e-10);
    assert_eq!(modes.len(), 3);
    let share = 1.96 / (1.96 + 2.26);
    let mean = |k: usize| share * FLOWS[0][k] + (1.0 - share) * FLOWS[3][k];
    let x = -7.0 / 12.0 + mean(0) * (2.0 - corner);
    let y = 23.0 / 60.0 + mean(1) * (2.0 - corner);
    assert!((end(&found, "x")[0] - x).abs() < 1e-9);
    assert!((end(&found, "y")[0] - y).abs() < 1e-9);
}

/// Three sectors of 120 degrees around the origin with constant flows.
fn sectors(flows: [[f64; 2]; 3], start: [f64; 2]) -> Trajectory {
    let r = 0.75_f64.sqrt();
    let sites = [[0.0, 1.0], [-r, -0.5], [r, -0.5]];
    let region = |i: usize| {
        let ([a, b], [u, v]) = (sites[i], flows[i]);
        format!("region r{i} indicator -({a:?}*x + ({b:?})*y) {{ x' = {u:?}; y' = {v:?}; }}\n")
    };
    let regions: String = (0..3).map(region).collect();
    from(start, &regions)
}

#[test]
fn where_three_cells_meet_filippovs_mean_of_all_three_is_found() {
    // From the sector of r0 straight into the origin, where θ = (1/2, 1/4, 1/4) is at rest.
    let found = sectors([[0.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], [0.0, 0.5]);
    assert_eq!(found.status, Status::Solved);
    let modes: Vec<&str> = found
        .history
        .modes
        .iter()
        .map(|mode| mode.mode.as_str())
        .collect();
    assert_eq!(modes, ["r0", "sliding(r0, r1, r2)"]);
    assert!((found.history.modes[1].from - 0.5).abs() < 1e-10);
    assert!(end(&found, "x")[0].abs() + end(&found, "y")[0].abs() < 1e-10);
    let [event] = &found.history.events[..] else {
        panic!("{:?}", found.history.events)
    };
    assert_eq!(
        (event.kind, event.surface.as_str()),
        (EventKind::EnterSliding, "r0 | r1 | r2")
    );
}

#[test]
fn a_tie_of_indicators_that_are_not_the_smallest_is_nothing() {
    // On x = 0 in the sector of r0, the indicators of r1 and r2 are equal all the way.
    let found = sectors([[0.0, 1.0], [1.0, 1.0], [-1.0, 1.0]], [0.0, 0.5]);
    assert_eq!(found.status, Status::Solved);
    let modes: Vec<&str> = found
        .history
        .modes
        .iter()
        .map(|mode| mode.mode.as_str())
        .collect();
    assert_eq!(modes, ["r0"]);
    assert_eq!(end(&found, "y"), [2.5]);
    // Across that line, still in the sector of r0: y = 2 + t/2, x = t - 1.
    let found = sectors([[1.0, 0.5], [1.0, 1.0], [-1.0, 1.0]], [-1.0, 2.0]);
    assert_eq!(found.history.modes.len(), 1, "{:?}", found.history.modes);
    assert!(found.history.events.is_empty());
    assert!((end(&found, "x")[0] - 1.0).abs() < 1e-12);
}

#[test]
fn a_switch_inside_a_region_keeps_the_indicators() {
    // x' = -sign(x) in the upper half, and 0.3 in the lower one; y falls through the boundary at t = 1.
    let text = "model m { state x = 0.5; state y = 1;
                region high indicator -y { x' = -sign(x); y' = -1; }
                region low indicator y { x' = 0.3; y' = -2; } }
                simulate s of m { horizon 2; }";
    let found = run(text, "s");
    let modes: Vec<&str> = found
        .history
        .modes
        .iter()
        .map(|mode| mode.mode.as_str())
        .collect();
    assert_eq!(modes[0], "high, above(x)");
    assert_eq!(modes[1], "high, sliding(x)");
    assert!(
        modes.last().is_some_and(|mode| mode.starts_with("low")),
        "{modes:?}"
    );
    assert!((end(&found, "x")[0] - 0.3).abs() < 1e-10);
    assert!((end(&found, "y")[0] + 2.0).abs() < 1e-10);
}
