//! Tables on several feet: what rests at zero is as small as its rounding, and nothing else may move for it.

use nsd_tests::{assert_near, end, solved, times};
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

const THREE: [f64; 3] = [0.0, 2.1, 4.2];

/// Nothing brakes: the angle is 2 t, and the energy that of the start.
#[test]
fn a_table_turns_on_smooth_feet() {
    for unit in [1.0, 1e-6, 1e6] {
        for horizon in [0.1, 1.0, 30.0] {
            let run = format!("horizon {horizon};");
            let found = table(&THREE, unit, "", &run);
            assert_near(&end(&found, "x"), &[horizon], 1e-12 * horizon);
            let q = end(&found, "q");
            assert_near(
                &[unit * q[0], q[1], q[2], q[3]],
                &[0.0, 2.0 * horizon, 0.0, 0.0],
                1e-12 * horizon.max(1.0),
            );
            let v = end(&found, "v");
            assert_near(
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
    assert_near(&end(&found, "q"), &[0.0, 0.375, 0.0, 0.0], 1e-12);
    assert_near(&end(&found, "v"), &[0.0, 0.5, 0.0, 0.0], 1e-12);
    let found = table(&THREE, 1.0, rough, "horizon 1;");
    assert_near(&end(&found, "q"), &[0.0, 0.4, 0.0, 0.0], 1e-12);
    assert_near(&end(&found, "v"), &[0.0; 4], 1e-12);
    assert!(
        times(&found, EventKind::Stick)
            .iter()
            .all(|t| (t - 0.4).abs() <= 1e-12)
    );
}

/// A block slides on the floor along y and strikes a wall. Its mass joins all directions, so that what the floor bears is
/// 9.3 + c a_x + d a_y, but neither that nor the wall moves it off the floor.
#[test]
fn what_slides_on_the_floor_strikes_a_wall() {
    let (m, n, d, mu) = (1.1, 1.7, 0.2, 0.1);
    for k in 1..=20 {
        let (c, x) = (0.2 + 0.01 * f64::from(k), 0.3 + 0.01 * f64::from(k));
        let text = format!(
            "model block {{
               state q[3] = [{x:?}, 0.3, 0];
               state v[3] = [-1.36, 3.7, 0];
               q' = v;
               mechanics q, v {{
                 mass = [{m:?}, 0, {c:?}; 0, {n:?}, {d:?}; {c:?}, {d:?}, 1.3];
                 force = [0.3, 0.1, -9.3];
                 contact floor {{ gap = q[3]; restitution = 0.3; friction = {mu:?}; slip = v[2]; }}
                 contact wall {{ gap = q[1]; restitution = 0.5; }}
               }}
             }}
             simulate this of block {{ tolerance 1e-10; horizon 1; }}"
        );
        let found = solved(&text, "this");
        let ax: f64 = 0.3 / m;
        let strikes = (1.36 - (1.36 * 1.36 - 2.0 * ax * x).sqrt()) / ax;
        let vx = -1.36 + ax * strikes;
        // n a_y = 0.1 - mu (9.3 + c a_x + d a_y), and the same for impulses.
        let ay = (0.1 - mu * (9.3 + c * ax)) / (n + mu * d);
        let kick = -mu * c * 1.5 * -vx / (n + mu * d);
        let left = 1.0 - strikes;
        assert_eq!(times(&found, EventKind::Jump).len(), 1);
        assert_near(
            &end(&found, "v"),
            &[-0.5 * vx + ax * left, 3.7 + ay + kick, 0.0],
            1e-11,
        );
        assert_near(
            &end(&found, "q"),
            &[
                -0.5 * vx * left + 0.5 * ax * left * left,
                0.3 + 3.7 + 0.5 * ay + kick * left,
                0.0,
            ],
            1e-11,
        );
    }
}
