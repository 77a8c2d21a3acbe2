//! Contacts between bodies against closed forms.

use nsd_tests::{end, run, times, with_experiment};
use nsdc::report::{EventKind, Status};

/// A ball of mass 2 above a floor, as mechanics.
const BALL: &str = "
    model ball {
      param g = 9.81;
      param e = 0.9;
      state q = 1;
      state v = 0;
      q' = v;
      mechanics q, v {
        mass = 2;
        force = -2*g;
        contact floor { gap = q; restitution = e; }
      }
    }";

#[test]
fn a_ball_bounces_as_its_law_says() {
    let text = format!("{BALL} simulate this of ball {{ horizon 3; tolerance 1e-10; }}");
    let trajectory = run(&text, "this");
    assert_eq!(trajectory.status, Status::Solved);
    let (g, e) = (9.81_f64, 0.9);
    let (mut bounce, mut speed) = ((2.0 / g).sqrt(), e * (2.0 * g).sqrt());
    while bounce + 2.0 * speed / g < 3.0 {
        (bounce, speed) = (bounce + 2.0 * speed / g, e * speed);
    }
    let s = 3.0 - bounce;
    assert!((end(&trajectory, "q")[0] - (speed * s - 0.5 * g * s * s)).abs() <= 1e-12);
    assert!((end(&trajectory, "v")[0] - (speed - g * s)).abs() <= 1e-12);
}

#[test]
fn bounces_accumulate_and_end() {
    let text =
        format!("{BALL} simulate this of ball {{ with {{ e = 0.5; q = 0.5; }} horizon 3; }}");
    let trajectory = run(&text, "this");
    assert_eq!(trajectory.status, Status::Solved);
    let found = times(&trajectory, EventKind::Zeno);
    assert_eq!(found.len(), 1);
    assert!((found[0] - 3.0 * (1.0_f64 / 9.81).sqrt()).abs() <= 1e-9);
    assert!(end(&trajectory, "q")[0].abs() <= 1e-12 && end(&trajectory, "v")[0].abs() <= 1e-12);
}

#[test]
fn a_thrown_ball_slips_and_sticks() {
    // Impact at sqrt(2 h/g) with speed sqrt(2 g h); the impulse takes mu times that off the slip velocity, and
    // mu g the rest. Heights and coefficients of two published cases.
    let cases = [
        (10.0, 0.3, 1.0, 4.0, 3.0),
        (10.0, 0.2, 1.0, 3.0, 2.5),
        (9.81, 0.6, 0.5, 2.0, 1.2),
    ];
    for (g, mu, h, u, horizon) in cases {
        let text = format!(
            "model ball {{
               state q[2] = [0, {h:?}];
               state v[2] = [{u:?}, 0];
               q' = v;
               mechanics q, v {{
                 mass = eye(2);
                 force = [0, -{g:?}];
                 contact floor {{ gap = q[2]; restitution = 0; friction = {mu:?}; }}
               }}
             }}
             simulate this of ball {{ horizon {horizon:?}; }}"
        );
        let trajectory = run(&text, "this");
        assert_eq!(
            trajectory.status,
            Status::Solved,
            "{:?}",
            trajectory.failure
        );
        let fall: f64 = (2.0_f64 * h / g).sqrt();
        let slip = u - mu * g * fall;
        let (rest, x) = (
            fall + slip / (mu * g),
            u * fall + slip * slip / (2.0 * mu * g),
        );
        let at = |kind| times(&trajectory, kind);
        assert!((at(EventKind::ContactClose)[0] - fall).abs() <= 1e-12);
        assert!((at(EventKind::Slip)[0] - fall).abs() <= 1e-12);
        assert_eq!(at(EventKind::Stick).len(), 1);
        assert!(
            (at(EventKind::Stick)[0] - rest).abs() <= 1e-9,
            "{:?}",
            at(EventKind::Stick)
        );
        let q = end(&trajectory, "q");
        assert!(
            (q[0] - x).abs() <= 1e-9 && q[1].abs() <= 1e-12,
            "{q:?}, not {x}"
        );
        assert_eq!(
            trajectory.modes.last().map(|mode| mode.mode.as_str()),
            Some("stick(floor)")
        );
    }
}

#[test]
fn bodies_and_contacts_are_printed_with_the_system() {
    let text = "
        model box {
          param m = 2;
          param mu = 0.3;
          state q[2] = [0, 1];
          state v[2] = [1, 0];
          q' = v;
          mechanics q, v {
            mass = m;
            force = [0, -9.81*m];
            contact floor { gap = q[2]; restitution = 0; friction = mu; along = [1, 0]; }
          }
        }
        simulate this of box { horizon 1; }";
    with_experiment(text, "this", |compiled| {
        insta::assert_snapshot!(compiled.system.to_string(), @r"
        system box
        param m = 2
        param mu = 0.3
        state q[1] = 0
        state q[2] = 1
        state v[1] = 1
        state v[2] = 0
        der(q[1]) = v[1]
        der(q[2]) = v[2]
        der(v[1]) = -mu*(1 - alpha[1])*(2*alpha[2] - 1)/m
        der(v[2]) = (1 - alpha[1])/m - 9.81
        0 <= 1 - alpha[1] perp q[2] >= 0  // floor
        alpha[2] in step(v[1])  // floor, slips where it is closed
        body q[1], q[2] with v[1], v[2]
          mass [m, 0, 0, m]
          force [0, -9.81*m]
        contact floor q[2] >= 0
          normal v[2]: 1
          restitution 0
          slip v[1], tangent v[1]: 1
          friction mu
        subsystem alpha[1], alpha[2]
        ");
    });
}
