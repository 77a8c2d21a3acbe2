//! Both sides of what jumps in tables: an instant with a jump has two rows, and every other one has one.

use nsd_tests::{DataFiles, assert_near, end, run_with_data, solved, solved_optimum};
use nsdc::report::{Series, Trajectory};
use nsdc::{Options, Project};

/// Time and the columns of some quantities, row by row.
fn rows(trajectory: &Trajectory, names: &[&str]) -> Vec<Vec<f64>> {
    let all: Vec<&Series> = (trajectory.samples.states.iter())
        .chain(&trajectory.samples.outputs)
        .chain(&trajectory.samples.controls)
        .collect();
    let series = names.iter().map(|name| {
        let series = all.iter().find(|series| series.name == *name);
        *series.expect("it is reported")
    });
    let series: Vec<&Series> = series.collect();
    let row = |(k, &t): (usize, &f64)| {
        let values = series.iter().flat_map(|series| series.at(k).to_vec());
        [t].into_iter().chain(values).collect()
    };
    trajectory
        .samples
        .time
        .iter()
        .enumerate()
        .map(row)
        .collect()
}

/// Pairs of rows at one instant.
fn doubled(rows: &[Vec<f64>]) -> Vec<[&[f64]; 2]> {
    let pairs = rows.windows(2).filter(|pair| pair[0][0] == pair[1][0]);
    pairs.map(|pair| [&pair[0][..], &pair[1][..]]).collect()
}

#[track_caller]
fn assert_rows(found: &[Vec<f64>], exact: &[&[f64]], within: f64) {
    assert_eq!(found.len(), exact.len(), "{found:?}");
    for (found, exact) in found.iter().zip(exact) {
        assert_near(found, exact, within);
    }
}

/// From -1 with rate 2, and 3 behind the surface, which is met at 1/2.
const STEP: &str = "
    model m {
      state x = -1;
      x' = 2 + step(x);
      output y = if x > 0 then 1 else 0;
      output z = max(x, 0);
    }
    simulate steps of m { horizon 1; }
    simulate bends of m { horizon 1; output x, z; }
    simulate every of m { horizon 1; output every 0.25; }
    simulate at of m { horizon 1; output at [0.25, 0.5, 1]; }
    simulate elements of m { horizon 1; output at [0.25, 0.5, 1]; method fesd; }";

#[test]
fn an_output_that_jumps_with_a_switch_has_two_rows() {
    let found = |experiment: &str| rows(&solved(STEP, experiment), &["x", "y", "z"]);
    let at: [&[f64]; 4] = [
        &[0.25, -0.5, 0.0, 0.0],
        &[0.5, 0.0, 0.0, 0.0],
        &[0.5, 0.0, 1.0, 0.0],
        &[1.0, 1.5, 1.0, 1.5],
    ];
    let start: &[f64] = &[0.0, -1.0, 0.0, 0.0];
    let middle: &[f64] = &[0.75, 0.75, 1.0, 0.75];
    assert_rows(&found("at"), &at, 1e-12);
    assert_rows(&found("elements"), &at, 1e-9);
    let every = [start, at[0], at[1], at[2], middle, at[3]];
    assert_rows(&found("every"), &every, 1e-12);
    assert_rows(&found("steps"), &[start, at[1], at[2], at[3]], 1e-12);
}

/// A bend is no jump: max(x, 0) and the state have one row where the rates jump.
#[test]
fn an_instant_without_a_jump_has_one_row() {
    let found = rows(&solved(STEP, "bends"), &["x", "z"]);
    assert_rows(
        &found,
        &[&[0.0, -1.0, 0.0], &[0.5, 0.0, 0.0], &[1.0, 1.5, 1.5]],
        1e-12,
    );
}

/// The tables that are written are those along the curves: from (cos t, sin t), whose second entry is zero at π, two rows
/// there, and no other instant twice.
#[test]
fn tables_along_curves_have_both_sides() {
    let text = "
        model m {
          state x[2] = [1, 0];
          x' = [-x[2], x[1]];
          output y = if x[2] > 0 then 1 else 0;
        }
        simulate turns of m { horizon 6; }";
    let project = Project::from_text("m.nsd", text);
    let run = project
        .run("turns", &Options::default(), &mut ())
        .expect("it compiles");
    let found = rows(&run.trajectory, &["y"]);
    assert!(found.len() > 60, "{}", found.len());
    let [[before, behind]] = doubled(&found)[..] else {
        panic!("{found:?}");
    };
    assert!((before[0] - std::f64::consts::PI).abs() <= 1e-8);
    assert_eq!([before[1], behind[1]], [1.0, 0.0]);
    let value = |t: f64| if t < std::f64::consts::PI { 1.0 } else { 0.0 };
    let inside = found
        .iter()
        .filter(|row| row[0] > 0.0 && row[0] != before[0]);
    assert!(inside.into_iter().all(|row| row[1] == value(row[0])));
}

/// Heating with rate 1 from 0 to 1, where it is switched off, and back with rate -1 to 0.
#[test]
fn a_relay_has_two_rows_where_it_switches() {
    let text = "
        model m {
          state x = 0.5;
          switch heater = hysteresis(x, on = 0, off = 1, start = 1);
          x' = 2*heater - 1;
          output h = heater;
        }
        simulate heats of m { horizon 2; output x, h; }";
    let found = rows(&solved(text, "heats"), &["x", "h"]);
    let exact: [&[f64]; 6] = [
        &[0.0, 0.5, 1.0],
        &[0.5, 1.0, 1.0],
        &[0.5, 1.0, 0.0],
        &[1.5, 0.0, 0.0],
        &[1.5, 0.0, 1.0],
        &[2.0, 0.5, 1.0],
    ];
    assert_rows(&found, &exact, 1e-12);
}

/// What a relay reads has the value of the start from the start on: a step of time, one that another relay reads first, a
/// kink inside of it. Behind a jump of states it is the same.
#[test]
fn a_relay_remembers_nothing_of_before_the_start() {
    for (switches, reads) in [
        ("", "(if time < 1 then 0 else 0.5)"),
        ("", "0.25*(1 + sign(time - 1))"),
        (
            "switch inner = hysteresis(time - 1, on = 0, off = -0.5, start = 1);",
            "0.5*inner",
        ),
        ("", "max(0, 0.5*step(time - 1))"),
    ] {
        let text = format!(
            "model m {{ state x = 0.2; {switches}
               switch h = hysteresis({reads}, on = 0.3, off = -1, start = 0); x' = h; }}
             simulate s of m {{ horizon 2; }}"
        );
        assert_near(&end(&solved(&text, "s"), "x"), &[1.2], 1e-12);
    }
    // A set point steps at 5: T = 17 + 3 exp(-t) until then, and T' = 13 - (T - 17) behind it.
    let text = "model m { state T = 20; let set = if time < 5 then 0 else 20;
                  switch heats = hysteresis(set - T, on = 1, off = -30, start = 0); T' = 17 - T + 13*heats; }
                simulate s of m { horizon 6; }";
    let exact = 30.0 - (13.0 - 3.0 * (-5.0_f64).exp()) * (-1.0_f64).exp();
    assert_near(&end(&solved(text, "s"), "T"), &[exact], 1e-7);
}

/// In one dimension the sphere of radius 1 has two points.
#[test]
fn a_kick_has_two_rows() {
    for when in ["", "output every 0.25;", "output at [0.25, 0.5, 0.75, 1];"] {
        let text = format!(
            "model m {{ state x = 0; x' = 1; output y = 2*x; }}
             simulate kicked of m {{ horizon 1; {when} perturb every 0.25 by sphere(1) seed 3; }}"
        );
        let trajectory = solved(&text, "kicked");
        let found = rows(&trajectory, &["x", "y"]);
        let pairs = doubled(&found);
        let instants: Vec<f64> = pairs.iter().map(|[before, _]| before[0]).collect();
        assert_eq!(instants, [0.25, 0.5, 0.75], "{when}");
        for [before, behind] in &pairs {
            assert!(((behind[1] - before[1]).abs() - 1.0).abs() <= 1e-12);
            assert!((behind[2] - 2.0 * behind[1]).abs() <= 1e-12);
        }
        for pair in found.windows(2).filter(|pair| pair[0][0] < pair[1][0]) {
            let rate = (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0]);
            assert!((rate - 1.0).abs() <= 1e-12, "{when}: {pair:?}");
        }
        // What the kicks do is no error.
        let estimate = trajectory.quality.error_estimate;
        assert!(
            estimate.is_some_and(|error| error < 1e-12),
            "{when}: {estimate:?}"
        );
    }
}

/// What is held jumps at instants of its own, without an event.
#[test]
fn what_is_held_has_two_rows_where_it_jumps() {
    let text = "
        model m { state x = 0; x' = 1 + floor(2*time); output f = floor(2*time); output g = x + 1; }
        simulate held of m { horizon 1; output x, f; }
        simulate bends of m { horizon 1; output g; }";
    let found = rows(&solved(text, "held"), &["x", "f"]);
    let [[before, behind]] = doubled(&found)[..] else {
        panic!("{found:?}");
    };
    assert_eq!([before[0], before[2], behind[2]], [0.5, 0.0, 1.0]);
    assert_eq!(before[1], behind[1]);
    assert!(doubled(&rows(&solved(text, "bends"), &["g"])).is_empty());
}

/// A state jumps at 1/2 and a ball comes to rest at 3/2, where nothing is sampled; at 1 an output jumps with a switch, and
/// another with time.
#[test]
fn jumps_between_samples_leave_the_rows_of_samples() {
    let text = "
        model m {
          state x = 0; state w = 0;
          x' = 1; w' = 1;
          jump reset when w > 0.5 { w := -9; }
          output f = floor(time);
          output g = if x > 1 then 5 else 2;
        }
        simulate s of m { horizon 1.5; output x, w, f, g every 1; }
        model ball {
          state q = 0.5; state v = 0;
          q' = v;
          mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q; restitution = 0.2; } }
          output f = floor(time);
        }
        simulate rests of ball { horizon 1.5; output q, f every 1; }";
    let found = rows(&solved(text, "s"), &["x", "w", "f", "g"]);
    let exact: [&[f64]; 4] = [
        &[0.0, 0.0, 0.0, 0.0, 2.0],
        &[1.0, 1.0, -8.5, 0.0, 2.0],
        &[1.0, 1.0, -8.5, 1.0, 5.0],
        &[1.5, 1.5, -8.0, 1.0, 5.0],
    ];
    assert_rows(&found, &exact, 1e-12);
    let rests = rows(&solved(text, "rests"), &["q", "f"]);
    let pairs = doubled(&rests);
    let [[before, behind]] = pairs[..] else {
        panic!("{rests:?}");
    };
    assert_eq!([before[0], before[2], behind[2]], [1.0, 0.0, 1.0]);
}

/// Data that are held jump at 1/2, and at 1, the end.
#[test]
fn data_that_are_held_have_two_rows_where_they_jump() {
    for (settings, within) in [
        ("", 1e-12),
        ("output every 0.5;", 1e-12),
        ("method fesd;", 1e-9),
    ] {
        let text = format!(
            "model m {{ signal d = table(\"d.csv\", \"w\", fit = hold); state x = 0; x' = 1 + d; output f = d; output l = log(2 - d); }}
             simulate r of m {{ horizon 1; {settings} }}"
        );
        let data = DataFiles(vec![("d.csv", "t,w\n0,0\n0.5,1\n1,3\n".to_owned())]);
        let trajectory = run_with_data(&text, &data, "r");
        let found = rows(&trajectory, &["x", "f"]);
        let [[a, b], [c, d]] = doubled(&found)[..] else {
            panic!("{settings}: {found:?}");
        };
        let pairs = [a, b, c, d].map(<[f64]>::to_vec);
        let exact: [&[f64]; 4] = [
            &[0.5, 0.5, 0.0],
            &[0.5, 0.5, 1.0],
            &[1.0, 1.5, 1.0],
            &[1.0, 1.5, 3.0],
        ];
        assert_rows(&pairs, &exact, within);
        // What is no number behind a jump has jumped.
        assert!(rows(&trajectory, &["l"])[found.len() - 1][1].is_nan());
    }
}

/// The mean of 2 t over each quarter: the least squares by a control that is constant there.
#[test]
fn a_control_has_two_rows_where_its_intervals_meet() {
    for when in [
        "",
        "output x, u every 0.25;",
        "output x, u at [0, 0.25, 0.5, 0.75, 1];",
    ] {
        let text = format!(
            "model m {{ state x = 0; control u in [-9, 9]; x' = u; }}
             optimize follows of m {{ horizon 1; intervals 4; {when} minimize integral((u - 2*time)^2); }}"
        );
        let found = rows(&solved_optimum(&text, "follows"), &["x", "u"]);
        let pairs = doubled(&found);
        let exact = [0.25, 0.5, 0.75];
        assert_eq!(pairs.len(), exact.len(), "{when}: {found:?}");
        for ([before, behind], t) in pairs.iter().zip(exact) {
            assert!((before[0] - t).abs() <= 1e-12);
            assert!(
                (before[1] - t * t).abs() <= 1e-7 && (behind[1] - before[1]).abs() <= 1e-12,
                "{before:?}"
            );
            assert!((before[2] - (2.0 * t - 0.25)).abs() <= 1e-7, "{before:?}");
            assert!((behind[2] - (2.0 * t + 0.25)).abs() <= 1e-7, "{behind:?}");
        }
    }
}
