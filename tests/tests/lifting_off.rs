//! Contacts that open because the last of their force goes, against closed forms.

use nsd_tests::{end, solved, times};
use nsdc::report::EventKind;

/// A mass M on a spring on a foot of mass m, which stands on the floor and may slip: the jumper of every lecture.
struct Jumper {
    m: f64,
    big: f64,
    k: f64,
    squeeze: f64,
    friction: f64,
}

const G: f64 = 9.81;

impl Jumper {
    /// The foot is let go with the spring squeezed: z = z₀ - A cos(ωt), ω² = k/M, until the spring pulls with m g. Then
    /// the centre of mass falls, and both swing about it.
    fn check(&self) {
        let Jumper {
            m,
            big,
            k,
            squeeze,
            friction,
        } = *self;
        let text = format!(
            "model jumper {{
               state q[2] = 0;
               state v[2] = 0;
               state z = 1 - {squeeze:?};
               state w = 0;
               q' = v;
               z' = w;
               let push = {k:?}*(1 - (z - q[2]));
               mechanics z, w {{ mass = {big:?}; force = push - {big:?}*{G:?}; }}
               mechanics q, v {{
                 mass = {m:?};
                 force = [0, -push - {m:?}*{G:?}];
                 contact foot {{ gap = q[2]; slip = v[1]; restitution = 0; friction = {friction:?}; }}
               }}
             }}
             simulate this of jumper {{ horizon 0.3; tolerance 1e-11; }}"
        );
        let run = solved(&text, "this");
        let omega = (k / big).sqrt();
        let amplitude = squeeze - big * G / k;
        let opens = (-(m + big) * G / (k * amplitude)).acos() / omega;
        assert!(opens < 0.2, "{opens} is not within the run");
        let found = times(&run, EventKind::ContactOpen);
        assert!(
            found.len() == 1 && (found[0] - opens).abs() <= 1e-11,
            "opens at {found:?}, not at {opens}"
        );

        let tau = 0.3 - opens;
        let speed = amplitude * omega * (omega * opens).sin();
        let share = big / (m + big);
        let centre = share * (1.0 + m * G / k) + share * speed * tau - 0.5 * G * tau * tau;
        // The spring is longer than at rest by m g/k, and grows.
        let reduced = (k * (m + big) / (m * big)).sqrt();
        let stretch = m * G / k * (reduced * tau).cos() + speed / reduced * (reduced * tau).sin();
        let foot = centre - share * (1.0 + stretch);
        assert!(foot > 0.0, "the foot is in the air at the end: {foot}");
        let q = end(&run, "q");
        assert!((q[1] - foot).abs() <= 1e-9, "{} is not {foot}", q[1]);
        assert_eq!(q[0], 0.0);
    }
}

/// What a spring and weight leave of the force at the foot is rounding of both, which is more than the force itself.
#[test]
fn a_jumper_leaves_the_floor() {
    for friction in [0.0, 0.3, 2.0] {
        for (m, big, k) in [(0.2, 1.0, 400.0), (0.3, 2.1, 377.0), (1.0, 1.0, 500.0)] {
            for squeeze in [0.17, 0.19, 0.21, 0.24, 0.26] {
                Jumper {
                    m,
                    big,
                    k,
                    squeeze,
                    friction,
                }
                .check();
            }
        }
    }
}

/// A block that a rope lifts straight up: nothing pulls on its friction, which is no motion at any force, until there is
/// none. It rises with q'' = r (t - 2).
#[test]
fn a_block_on_a_rough_floor_is_lifted_straight_up() {
    for rate in [0.1, 1.0, 7.0] {
        let text = format!(
            "model block {{
               state q[2] = 0;
               state v[2] = 0;
               q' = v;
               mechanics q, v {{
                 mass = 3;
                 force = [0, 3*{rate:?}*(time - 2)];
                 contact floor {{ gap = q[2]; restitution = 0; friction = 0.5; }}
               }}
             }}
             simulate this of block {{ horizon 3; }}"
        );
        let run = solved(&text, "this");
        let opens = times(&run, EventKind::ContactOpen);
        assert!(
            opens.len() == 1 && (opens[0] - 2.0).abs() <= 1e-9,
            "{opens:?}"
        );
        let (q, v) = (end(&run, "q"), end(&run, "v"));
        assert!((q[1] - rate / 6.0).abs() <= 1e-8 && q[0] == 0.0, "{q:?}");
        assert!((v[1] - rate / 2.0).abs() <= 1e-8 && v[0] == 0.0, "{v:?}");
    }
}

/// Friction stops a block at the instant at which the force of its contact goes: 10 (2 - t)/2 slows it down by 10 in all.
#[test]
fn a_block_stops_as_it_is_lifted() {
    let text = "
      model block {
        state q[2] = 0;
        state v[2] = [10, 0];
        q' = v;
        mechanics q, v {
          mass = 1;
          force = [0, 10*(time - 2)];
          contact floor { gap = q[2]; restitution = 0; friction = 0.5; }
        }
      }
      simulate this of block { horizon 3; }";
    let run = solved(text, "this");
    let (q, v) = (end(&run, "q"), end(&run, "v"));
    // It slips 20/3 on the way: v = 5/2 (2 - t)^2.
    assert!((q[0] - 20.0 / 3.0).abs() <= 1e-8, "{q:?}");
    assert!((q[1] - 10.0 / 6.0).abs() <= 1e-8, "{q:?}");
    assert!(v[0].abs() <= 1e-8 && (v[1] - 5.0).abs() <= 1e-8, "{v:?}");
}
