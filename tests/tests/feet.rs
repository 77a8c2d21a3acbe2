//! Tables on several feet: what rests at zero is as small as its rounding, and nothing else may move for it.

use nsd_tests::{end, solved, times};
use nsdc::report::{EventKind, Trajectory};

/// A table that turns about the vertical on feet half a metre from its middle: its height, the angle that it is turned
/// by, and how far it leans, with a unit of length for the height.
fn table(feet: &[f64], unit: f64, options: &str, run: &str) -> Trajectory {
    let contact = |(i, at): (usize, &f64)| {
        format!(
            "contact foot{i} {{ gap = {unit:?}*q[1] + 0.5*cos(q[2] + {at:?})*q[3] + 0.5*sin(q[2] + {at:?})*q[4];
               restitution = 0; {options} }}"
        )
    };
    let contacts: String = feet.iter().enumerate().map(contact).collect();
    let text = format!(
        "model table {{
           state x = 0; x' = 1;
           state q[4] = [0, 0, 0, 0];
           state v[4] = [0, 2, 0, 0];
           q' = v;
           mechanics q, v {{
             mass = [{:?}, 0, 0, 0; 0, 0.1, 0, 0; 0, 0, 0.06, 0; 0, 0, 0, 0.06];
             force = [{:?}, 0, 0, 0];
             {contacts}
           }}
         }}
         simulate this of table {{ tolerance 1e-12; {run} }}",
        unit * unit,
        -10.0 * unit,
    );
    solved(&text, "this")
}

fn close(found: &[f64], exact: &[f64], within: f64) {
    assert_eq!(found.len(), exact.len());
    for (found, exact) in found.iter().zip(exact) {
        assert!((found - exact).abs() <= within, "{found}, not {exact}");
    }
}

const THREE: [f64; 3] = [0.0, 2.1, 4.2];

/// Nothing brakes: the angle is 2 t, and the energy that of the start.
#[test]
fn a_table_turns_on_smooth_feet() {
    for unit in [1.0, 1e-6, 1e6] {
        for horizon in [0.1, 1.0, 30.0] {
            let run = format!("horizon {horizon};");
            let found = table(&THREE, unit, "", &run);
            close(&end(&found, "x"), &[horizon], 1e-12 * horizon);
            let q = end(&found, "q");
            close(
                &[unit * q[0], q[1], q[2], q[3]],
                &[0.0, 2.0 * horizon, 0.0, 0.0],
                1e-12 * horizon.max(1.0),
            );
            let v = end(&found, "v");
            close(
                &[unit * v[0], v[1], v[2], v[3]],
                &[0.0, 2.0, 0.0, 0.0],
                1e-12,
            );
        }
    }
}

/// The feet carry 10 newtons together, so that a friction of 0.1 brakes with a torque of 0.5: by 5, for 0.4 seconds.
#[test]
fn a_table_on_rough_feet_comes_to_rest() {
    let rough = "friction = 0.1; slip = 0.5*v[2];";
    let found = table(&THREE, 1.0, rough, "horizon 0.3;");
    close(&end(&found, "q"), &[0.0, 0.375, 0.0, 0.0], 1e-12);
    close(&end(&found, "v"), &[0.0, 0.5, 0.0, 0.0], 1e-12);
    let found = table(&THREE, 1.0, rough, "horizon 1;");
    close(&end(&found, "q"), &[0.0, 0.4, 0.0, 0.0], 1e-12);
    close(&end(&found, "v"), &[0.0; 4], 1e-12);
    assert!(
        times(&found, EventKind::Stick)
            .iter()
            .all(|t| (t - 0.4).abs() <= 1e-12)
    );
}
