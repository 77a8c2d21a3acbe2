//! Contacts between bodies against closed forms.

use nsd_tests::{end, run, times, with_experiment};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

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
            trajectory
                .history
                .modes
                .last()
                .map(|mode| mode.mode.as_str()),
            Some("stick(floor)")
        );
    }
}

/// Point masses in a row that touch or nearly do, the first one with speed 1.
fn cradle(e: f64, apart: f64) -> Trajectory {
    let text = format!(
        "model cradle {{
           const n = 3;
           param d = {apart:?};
           state q[n] = [(1 + d)*i for i in 1..n];
           state v[n] = [1, 0, 0];
           q' = v;
           mechanics q, v {{ mass = eye(n); force = zeros(n); }}
           for i in 1..n-1 {{ contact touch {{ gap = q[i+1] - q[i] - 1; restitution = {e:?}; }} }}
         }}
         simulate this of cradle {{ horizon 1; }}"
    );
    let trajectory = run(&text, "this");
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    trajectory
}

#[test]
fn an_impact_of_several_contacts_is_that_of_newton_and_moreau() {
    // Impulses Λ of the two contacts: 2 Λ1 - Λ2 = 1 + e, 2 Λ2 - Λ1 = 0.
    for e in [0.0, 0.5, 1.0] {
        let share = (1.0 + e) / 3.0;
        let v = end(&cradle(e, 0.0), "v");
        for (v, exact) in v.iter().zip([1.0 - 2.0 * share, share, share]) {
            assert!((v - exact).abs() <= 1e-14, "{v}, not {exact} with e = {e}");
        }
    }
    // Balls apart collide one after the other.
    let v = end(&cradle(1.0, 0.01), "v");
    assert!(
        v[0].abs() <= 1e-14 && v[1].abs() <= 1e-14 && (v[2] - 1.0).abs() <= 1e-14,
        "{v:?}"
    );
}

#[test]
fn a_ball_in_a_box_is_a_pair_of_triangle_waves() {
    let text = "
        model billiard {
          state q[2] = [0.3, 0.4];
          state v[2] = [1, 0.7];
          q' = v;
          mechanics q, v {
            mass = 1;
            force = [0, 0];
            contact left  { gap = q[1]; restitution = 1; }
            contact right { gap = 1 - q[1]; restitution = 1; }
            contact floor { gap = q[2]; restitution = 1; }
            contact roof  { gap = 1 - q[2]; restitution = 1; }
          }
        }
        simulate this of billiard { horizon 10.1; }
        simulate corner of billiard { with { q = [0.5, 0.5]; v = [1, 1]; } horizon 3.2; }";
    let wave = |s: f64| 1.0 - ((s.rem_euclid(2.0)) - 1.0).abs();
    let trajectory = run(text, "this");
    let q = end(&trajectory, "q");
    assert!((q[0] - wave(0.3 + 10.1)).abs() <= 1e-12 && (q[1] - wave(0.4 + 7.07)).abs() <= 1e-12);
    // Into a corner: two contacts at once.
    let trajectory = run(text, "corner");
    let found = times(&trajectory, EventKind::Jump);
    assert_eq!(found.len(), 6);
    for (found, exact) in found.iter().zip([0.5, 0.5, 1.5, 1.5, 2.5, 2.5]) {
        assert!((found - exact).abs() <= 1e-15, "{found}");
    }
    assert!(
        end(&trajectory, "q")
            .iter()
            .all(|q| (q - 0.3).abs() <= 1e-14)
    );
}

#[test]
fn a_floor_throws_what_lies_on_it_where_it_falls_faster() {
    // The floor is at sin(2 t)/2; with g = 1 it falls as fast as the ball for sin(2 t) = 1/2.
    let text = "
        model lift {
          state q = 0;
          state v = 1;
          q' = v;
          mechanics q, v { mass = 1; force = -1; contact floor { gap = q - 0.5*sin(2*time); restitution = 0; } }
        }
        simulate this of lift { horizon 1.5; }";
    let trajectory = run(text, "this");
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    let leaves = 0.5 * (0.5_f64).asin();
    let found = times(&trajectory, EventKind::ContactOpen);
    assert!((found[0] - leaves).abs() <= 1e-9, "{found:?}, not {leaves}");
    // Back on the floor where q + v s - s²/2 meets it, by bisection.
    let (q, v) = (0.5 * (2.0 * leaves).sin(), (2.0 * leaves).cos());
    let gap = |s: f64| q + v * s - 0.5 * s * s - 0.5 * (2.0 * (leaves + s)).sin();
    let (mut low, mut high) = (0.5, 1.5);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if gap(middle) > 0.0 {
            low = middle
        } else {
            high = middle
        }
    }
    match times(&trajectory, EventKind::Jump)[..] {
        [back] => assert!((back - leaves - low).abs() <= 1e-9, "{back}"),
        _ => assert!(leaves + low > 1.5 && end(&trajectory, "q")[0] > 0.0),
    }
}

#[test]
fn more_contacts_than_forces_have_one_motion() {
    // Two discs fill the box from wall to wall, and a third one falls between them: eight contacts, six
    // coordinates, and rest at the height of an equilateral triangle.
    let text = "
        model disc {
          state q[2];
          state v[2] = [0, 0];
          q' = v;
          mechanics q, v { mass = 1; force = [0, -1]; }
        }
        model wedge {
          part a = disc { q = [1, 1]; }
          part b = disc { q = [3, 1]; }
          part c = disc { q = [2, 1 + sqrt(3) + 0.5]; }
          contact floor_a { gap = a.q[2] - 1; restitution = 0; }
          contact floor_b { gap = b.q[2] - 1; restitution = 0; }
          contact left    { gap = a.q[1] - 1; restitution = 0; }
          contact right   { gap = 3 - b.q[1]; restitution = 0; }
          contact ab { gap = norm(a.q - b.q) - 2; restitution = 0; }
          contact ac { gap = norm(a.q - c.q) - 2; restitution = 0; }
          contact bc { gap = norm(b.q - c.q) - 2; restitution = 0; }
        }
        simulate this of wedge { horizon 3; }";
    let trajectory = run(text, "this");
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    let c = end(&trajectory, "c.q");
    assert!(
        (c[0] - 2.0).abs() <= 1e-12 && (c[1] - 1.0 - 3.0_f64.sqrt()).abs() <= 1e-12,
        "{c:?}"
    );
    for (name, exact) in [("a.q", [1.0, 1.0]), ("b.q", [3.0, 1.0])] {
        let found = end(&trajectory, name);
        assert!((found[0] - exact[0]).abs() <= 1e-12 && (found[1] - exact[1]).abs() <= 1e-12);
    }
    assert!(trajectory.quality.stats.complementarity_residual <= 1e-12);
}

/// A rod of length 1 and mass 1, its angle measured from the vertical.
const ROD: &str = "
    model rod {
      param J = 1/32;
      param mu = 0.7;
      state q[3] = [0, 0.5*cos(pi/4) + 0.2, pi/4];
      state v[3] = [2, 0, 0];
      q' = v;
      mechanics q, v {
        mass = [1, 0, 0; 0, 1, 0; 0, 0, J];
        force = [0, -9.81, 0];
        contact lower {
          gap = q[2] - 0.5*cos(q[3]);
          restitution = 0;
          friction = mu;
          slip = v[1] + 0.5*cos(q[3])*v[3];
        }
        contact upper {
          gap = q[2] + 0.5*cos(q[3]);
          restitution = 0;
          friction = mu;
          slip = v[1] - 0.5*cos(q[3])*v[3];
        }
      }
      output energy = 0.5*(v[1]^2 + v[2]^2 + J*v[3]^2) + 9.81*q[2];
    }";

#[test]
fn a_rod_falls_on_its_end_then_flat_and_comes_to_rest() {
    let text = format!("{ROD} simulate this of rod {{ horizon 3; }}");
    let trajectory = run(&text, "this");
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    let struck = times(&trajectory, EventKind::Jump);
    assert!((struck[0] - (2.0_f64 * 0.2 / 9.81).sqrt()).abs() <= 1e-12);
    // The impulse of the end, by hand: v = (2, -u, 0), slip 2 > 0 stays positive or sticks.
    let u = (2.0_f64 * 9.81 * 0.2).sqrt();
    let (s, j, mu) = (0.5 * (std::f64::consts::FRAC_PI_4).cos(), 1.0 / 32.0, 0.7);
    let impulse = u / (1.0 + s * (s - mu * s) / j);
    let slip = 2.0 - mu * impulse + s * impulse * (s - mu * s) / j;
    assert!(slip > 0.0);
    let at = trajectory
        .samples
        .time
        .iter()
        .rposition(|&t| t == struck[0])
        .expect("an instant");
    let v = &trajectory.samples.states[1].values[3 * at..3 * at + 3];
    let exact = [2.0 - mu * impulse, -u + impulse, impulse * (s - mu * s) / j];
    for (v, exact) in v.iter().zip(exact) {
        assert!((v - exact).abs() <= 1e-12, "{v}, not {exact}");
    }
    let (q, v) = (end(&trajectory, "q"), end(&trajectory, "v"));
    assert!(
        q[1].abs() <= 1e-12 && (q[2] - std::f64::consts::FRAC_PI_2).abs() <= 1e-12,
        "{q:?}"
    );
    assert!(v.iter().all(|v| v.abs() <= 1e-12), "{v:?}");
    let energy = &trajectory.samples.outputs[0].values;
    assert!(energy.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12));
}

#[test]
fn painleves_paradox_is_told() {
    // J_n M⁻¹(J_n - μ J_t) = 5 - 4 cos 2θ - 4 μ sin 2θ for this rod where its end slips forwards: least at
    // tan 2θ = μ, where it is 5 - 4 √(1 + μ²).
    let failure = |mu: f64, speed: f64| {
        let text = format!(
            "{ROD} simulate this of rod {{
               with {{ mu = {mu:?}; q = [0, 0.5*cos(pi/8) + 0.1, pi/8]; v = [{speed:?}, 0, 0]; }}
               horizon 0.2;
             }}"
        );
        run(&text, "this").failure
    };
    let Some(Failure::Painleve { time, name, .. }) = failure(1.0, 10.0) else {
        panic!("a paradox");
    };
    assert!((time - (0.2_f64 / 9.81).sqrt()).abs() <= 1e-12 && name == "lower");
    assert!(failure(0.74, 10.0).is_none());
    assert!(failure(1.0, -10.0).is_none());
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

#[test]
fn a_mass_that_no_force_meets_may_switch() {
    let trajectory = run(
        "model ball {
           state q = 0;
           state v = 1;
           q' = v;
           mechanics q, v {
             mass = 2 + sign(time - 1);
             force = 0;
             contact wall { gap = 2 - q; restitution = 0.5; }
           }
         }
         simulate this of ball { horizon 3; }",
        "this",
    );
    assert_eq!(trajectory.status, Status::Solved);
    assert!((end(&trajectory, "q")[0] - 1.5).abs() <= 1e-12);
}

/// An output may ask for the direction of a velocity that friction keeps at zero: nothing depends on the answer.
#[test]
fn outputs_look_at_what_sticks() {
    let trajectory = run(
        "model block {
           state q[2] = [0, 1]; state v[2] = [1, 0];
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [20*max(time - 1, 0), -9.81];
             contact floor { gap = q[2]; restitution = 0; friction = 0.5; }
           }
           output speed = abs(v[1]);
           output direction = sign(v[1]);
         }
         simulate this of block { horizon 1.5; }",
        "this",
    );
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    // It sticks at once, and slips again when 20 (t - 1) = μg.
    let (mu, g) = (0.5, 9.81);
    let s = 0.5 - mu * g / 20.0;
    let expected = 10.0 * s * s;
    let (speed, v) = (end(&trajectory, "speed")[0], end(&trajectory, "v")[0]);
    assert!((v - expected).abs() <= 1e-9, "{v}, not {expected}");
    assert_eq!(speed, v);
    assert_eq!(end(&trajectory, "direction"), [1.0]);
}

/// Bounces with friction that accumulate: strikes with 4, 2, 1, .. at 0.4, 0.8, 1, .. to 1.2, whose impulses 6, 3, 1.5,
/// .. take a quarter as much of the slip velocity; then it slides.
#[test]
fn friction_of_bounces_that_accumulate_is_theirs() {
    for (restitution, horizon) in [(0.5_f64, 1.5), (0.8, 4.2)] {
        let found = run(
            &format!(
                "model body {{
                   state q[2] = [0, 0.8];
                   state v[2] = [20, 0];
                   q' = v;
                   mechanics q, v {{
                     mass = 1;
                     force = [0, -10];
                     contact floor {{ gap = q[2]; restitution = {restitution:?}; friction = 0.25; }}
                   }}
                 }}
                 simulate this of body {{ tolerance 1e-12; horizon {horizon:?}; }}"
            ),
            "this",
        );
        assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        let (mut speed, mut way, mut strikes, mut t) = (20.0, 20.0 * 0.4, 4.0, 0.4);
        for _ in 0..400 {
            speed -= 0.25 * (1.0 + restitution) * strikes;
            strikes *= restitution;
            let flight = 0.2 * strikes;
            (way, t) = (way + speed * flight, t + flight);
        }
        let rest = horizon - t;
        way += speed * rest - 1.25 * rest * rest;
        let v = speed - 2.5 * rest;
        assert!(
            (end(&found, "v")[0] - v).abs() <= 1e-10,
            "{} {v}",
            end(&found, "v")[0]
        );
        assert!(
            (end(&found, "q")[0] - way).abs() <= 1e-9,
            "{} {way}",
            end(&found, "q")[0]
        );
    }
}

/// Flights of a ball last 2 v/g, and each impact halves v: they end after 3 √(2h/g), whatever friction does.
#[test]
fn bounces_with_friction_accumulate_once() {
    let text = "model ball {
      state q[2] = [0, 0.5];
      state v[2] = [3, 0];
      q' = v;
      mechanics q, v {
        mass = eye(2);
        force = [0, -9.81];
        contact floor { gap = q[2]; slip = v[1]; restitution = 0.5; friction = 0.2; }
      }
    }
    simulate this of ball { horizon 3; }";
    let found = times(&run(text, "this"), EventKind::Zeno);
    let exact = 3.0 * (1.0_f64 / 9.81).sqrt();
    assert_eq!(found.len(), 1, "{found:?}");
    assert!((found[0] - exact).abs() < 1e-9, "{found:?}");
}
