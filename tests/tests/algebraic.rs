//! Algebraic states and complementarity against closed forms.

use nsd_tests::{assert_near, end, run, solved, times};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

/// Runs a model to a horizon.
fn runs(model: &str, horizon: f64, settings: &str) -> Trajectory {
    let trajectory = ends(model, horizon, settings);
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    trajectory
}

/// Runs a model as far as it goes.
fn ends(model: &str, horizon: f64, settings: &str) -> Trajectory {
    let text = format!(
        "model m {{ {model} }} simulate this of m {{ horizon {horizon:?}; tolerance 1e-12; {settings} }}"
    );
    run(&text, "this")
}

#[test]
fn an_equation_of_third_degree_is_solved_along_the_way() {
    // y' = -y and x = y³ + y.
    let model = "state x = 2; algebraic y = 0.3; 0 = y^3 + y - x; x' = -(3*y^2 + 1)*y;";
    let found = runs(model, 2.0, "");
    let y = (-2.0_f64).exp();
    assert_near(&end(&found, "y"), &[y], 1e-12);
    assert_near(&end(&found, "x"), &[y.powi(3) + y], 1e-12);
}

#[test]
fn the_guess_chooses_the_root() {
    for (guess, root) in [(2.0, 1.0), (-2.0, -1.0)] {
        let model = "state x = 1; algebraic z = 0; 0 = z^2 - x; x' = z;";
        let found = runs(model, 0.5, &format!("with {{ z = {guess}; }}"));
        // √x changes at the rate ±½.
        let z: f64 = root + 0.25;
        assert_near(&end(&found, "z"), &[z], 1e-12);
        assert_near(&end(&found, "x"), &[z * z], 1e-12);
    }
}

#[test]
fn equations_that_give_states_one_after_another_cost_nothing() {
    let model = "state x = 1; algebraic a = 0; algebraic b = 0; algebraic c[2] = 0;
      0 = 2*a - b - c[1];
      0 = b - sign(x)*c[2];
      0 = c - [x, 3];
      x' = -a;";
    // 2a = 3 + x while x > 0; then 2a = x - 3 < 0: x stays at zero.
    let found = runs(model, 1.0, "");
    let reached = 2.0 * (4.0_f64 / 3.0).ln();
    assert_near(&times(&found, EventKind::EnterSliding), &[reached], 1e-12);
    assert_near(&end(&found, "x"), &[0.0], 1e-14);
}

#[test]
fn a_loop_of_two_is_solved_together() {
    // y² + z = 2x and z = xy: y = 1 and z = x at first, and (y - 1)(y + 1 + x) = 0 at x = 1 only.
    let model = "state x = 1; algebraic y = 0.5; algebraic z = 0;
      0 = y^2 + z - 2*x; 0 = z - x*y; x' = -x;";
    let found = runs(model, 1.0, "");
    let x = (-1.0_f64).exp();
    let y = 0.5 * (-x + (x * x + 8.0 * x).sqrt());
    assert_near(&end(&found, "y"), &[y], 1e-12);
    assert_near(&end(&found, "z"), &[x * y], 1e-12);
}

#[test]
fn an_equation_has_a_kink() {
    let model = "state x = -1; algebraic y = 0; 0 = 2*y + abs(y) - x; x' = 1;";
    // Two in a loop: y = z³ + z and 4y + z = x above zero, 2y + z = x below.
    let in_loop = "state x = 2; algebraic y = 0; algebraic z = 0; 0 = 3*y + abs(y) + z - x; 0 = z^3 + z - y; x' = -1;";
    let z = (0..60).fold(-0.3_f64, |z, _| {
        z - (2.0 * (z.powi(3) + z) + z + 1.0) / (6.0 * z * z + 3.0)
    });
    for road in ROADS {
        let found = runs(model, 2.0, &format!("output y at [0.5, 2]; {road}"));
        assert_near(&end(&found, "y"), &[1.0 / 3.0], 1e-13);
        assert_near(&times(&found, EventKind::Crossing), &[1.0], 1e-12);
        let found = runs(in_loop, 3.0, road);
        assert_near(&end(&found, "z"), &[z], 1e-12);
        assert_near(&times(&found, EventKind::Crossing), &[2.0], 1e-12);
    }
}

#[test]
fn what_a_relay_switches_jumps() {
    // p = 2 while it is on, and 0 while it is off: T goes from 10 to 12, to 8, to 12.
    let model = "state T = 10; algebraic p = 0;
      switch h = hysteresis(T, on = 8, off = 12, start = 1);
      0 = p^3 + p - 10*h;
      T' = p - 1;";
    let found = runs(model, 11.0, "");
    assert_near(&times(&found, EventKind::Relay), &[2.0, 6.0, 10.0], 1e-11);
    assert_near(&end(&found, "T"), &[11.0], 1e-11);
    assert_near(&end(&found, "p"), &[0.0], 1e-12);
}

#[test]
fn what_time_switches_and_states_that_jump_move_algebraic_states() {
    let model = "state x = 1; state v = 0; algebraic f = 0;
      0 = f + f^3 + 10*step(time - 1) - x;
      x' = v; v' = 0;
      jump up when time >= 2 and v <= 0.5 { x := 40; v := 1; }";
    let found = runs(model, 3.0, "output f at [0.5, 1.5, 3];");
    // f + f³ = 1, -9 and 31.
    let root = |c: f64| {
        let mut f = c.cbrt();
        for _ in 0..50 {
            f -= (f + f.powi(3) - c) / (1.0 + 3.0 * f * f);
        }
        f
    };
    assert_near(&end(&found, "f"), &[root(31.0)], 1e-12);
    let samples = &found.samples.outputs[0].values;
    assert_near(&[samples[0], samples[1]], &[root(1.0), root(-9.0)], 1e-12);
}

#[test]
fn a_switch_slides_on_an_algebraic_state() {
    // z = 0.5 where x = 0.625.
    let model = "state x = 1; algebraic z = 0; 0 = z + z^3 - x; x' = -sign(z - 0.5);";
    let found = runs(model, 3.0, "");
    assert_near(&times(&found, EventKind::EnterSliding), &[0.375], 1e-11);
    assert_near(&end(&found, "x"), &[0.625], 1e-12);
}

/// A resonant circuit with a rectifier in parallel to its capacitor, of four diodes that bear a resistor: for the
/// circuit it is the resistor alone (Acary & Brogliato 2008).
const BRIDGE: &str = "
  param R = 1000; param L = 1e-2; param C = 1e-6;
  state v = 10; state i = 0;
  algebraic l[4] = 0;
  0 <= l[1] perp (l[1] + l[2])/R - l[3] >= 0;
  0 <= l[2] perp (l[1] + l[2])/R - l[4] >= 0;
  0 <= l[3] perp l[1] - v >= 0;
  0 <= l[4] perp l[2] + v >= 0;
  v' = -i/C + (l[4] - l[3])/C;
  i' = v/L;
  output load = l[1] + l[2];";

#[test]
fn four_diodes_rectify() {
    let found = runs(BRIDGE, 5e-3, "");
    // v'' + v'/(RC) + v/(LC) = 0 with v(0) = 10, v'(0) = -10/(RC).
    let (decay, omega): (f64, f64) = (500.0, (1e8_f64 - 500.0_f64.powi(2)).sqrt());
    let sine = -500.0 * 10.0 / omega;
    let voltage =
        |t: f64| (-decay * t).exp() * (10.0 * (omega * t).cos() + sine * (omega * t).sin());
    assert_near(&end(&found, "v"), &[voltage(5e-3)], 1e-10);
    assert_near(&end(&found, "load"), &[voltage(5e-3).abs()], 1e-10);
    // 10 cos ωt = -c sin ωt: every half turn.
    let first = (10.0 / -sine).atan() / omega;
    let zeros: Vec<f64> = (0..16)
        .map(|k| first + f64::from(k) * std::f64::consts::PI / omega)
        .collect();
    let mut seen = times(&found, EventKind::Activate);
    seen.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    assert_near(&seen, &zeros, 1e-12);
}

#[test]
fn a_pair_of_no_unique_sides_has_unique_states() {
    // x - a + b is x clipped to [-1, 1], and (1 -1; -1 1) is no P-matrix.
    let model = "state x = 2; algebraic a = 0; algebraic b = 0;
      0 <= a perp 1 - (x - a + b) >= 0;
      0 <= b perp (x - a + b) + 1 >= 0;
      x' = -(x - a + b);";
    let found = runs(model, 3.0, "");
    assert_near(&end(&found, "x"), &[(-2.0_f64).exp()], 1e-12);
    assert_near(&times(&found, EventKind::Activate), &[1.0], 1e-12);
}

#[test]
fn pairs_touch_and_pass_with_any_order() {
    // max(0, (t - 1)³) turns on with three derivatives zero; -(t - 1)² never does.
    let model = "state x = 0; state y = 0; algebraic a = 0; algebraic b = 0;
      0 <= a perp a - (time - 1)^3 >= 0;
      0 <= b perp b + (time - 1)^2 >= 0;
      x' = a; y' = b + 1;";
    let found = runs(model, 2.0, "");
    assert_near(&end(&found, "x"), &[0.25], 1e-12);
    assert_near(&end(&found, "y"), &[2.0], 1e-14);
}

#[test]
fn pairs_that_are_both_zero_at_the_start_are_decided_by_rates() {
    let model = "state x = 0; algebraic a = 0; 0 <= a perp a - x >= 0; x' = 1 - a;";
    assert_near(
        &end(&runs(model, 1.0, ""), "x"),
        &[1.0 - (-1.0_f64).exp()],
        1e-13,
    );
    // At rest, neither member moves.
    let model = "state x = 0; algebraic a = 0; 0 <= a perp a - x >= 0; x' = -x;";
    assert_near(&end(&runs(model, 1.0, ""), "a"), &[0.0], 1e-14);
}

#[test]
fn more_pairs_than_choices_are_solved_one_by_one() {
    // Twelve clipped copies of the same ramp, coupled by a matrix with a dominant diagonal.
    let model = "state x = -1; algebraic a[12] = 0;
      for k in 1..12 { 0 <= a[k] perp 3*a[k] - 0.1*sum(a) - x + k/8 >= 0; }
      x' = 1;";
    let found = runs(model, 3.0, "");
    // All are active at x = 2: 3 a_k - 0.1 s = x - k/8, and the sum of these is 3s - 1.2s = 24 - 78/8.
    let sum = (24.0 - 9.75) / 1.8;
    let exact: Vec<f64> = (1..=12)
        .map(|k| (2.0 - f64::from(k) / 8.0 + 0.1 * sum) / 3.0)
        .collect();
    assert_near(&end(&found, "a"), &exact, 1e-12);
}

#[test]
fn many_pairs_are_exchanged_one_by_one_at_the_start() {
    // Whoever is first is taken, and put back when the next one is: it leaves him nothing.
    let model = "state x = 1; algebraic a[10] = 0;
      for k in 1..9 { 0 <= a[k] perp 2*a[k] + 3*a[k+1] - x >= 0; }
      0 <= a[10] perp 2*a[10] - x >= 0;
      x' = -1;";
    let found = runs(model, 0.5, "");
    // a_10 = x/2, and every second one before.
    let exact = [0.0, 0.25].repeat(5);
    assert_near(&end(&found, "a"), &exact, 1e-12);
}

#[test]
fn no_solution_and_several_are_told() {
    let none: fn(&Failure) -> bool = |failure| matches!(failure, Failure::Inconsistent { .. });
    let several: fn(&Failure) -> bool =
        |failure| matches!(failure, Failure::SeveralSolutions { .. });
    let singular: fn(&Failure) -> bool = |failure| matches!(failure, Failure::HighIndex { .. });
    let cases = [
        (
            "state x = 2; algebraic z = 1; 0 = z^2 + x^2 - 1; x' = -x;",
            none,
        ),
        (
            "state x = 0; algebraic a = 0; 0 <= a perp x - 1 - a >= 0; x' = a;",
            none,
        ),
        (
            "state x = 0; algebraic a = 0; 0 <= a perp 1 - a >= 0; x' = a;",
            several,
        ),
        // Rows that contradict each other from t = 1 on.
        (
            "state x = 0; z in argmin z^2 subject to { z >= x; z <= 1; } x' = 1;",
            none,
        ),
        // z = √x ends at x = 0.
        (
            "state x = 1; algebraic z = 1; 0 = z^2 - x; x' = -1;",
            singular,
        ),
        (
            "state x = 1; algebraic z[2] = 0; 0 = z[1] + z[2] - x; 0 = 2*z[1] + 2*z[2] - 2*x; x' = -z[1];",
            singular,
        ),
    ];
    for (model, is_told) in cases {
        let found = ends(model, 2.0, "");
        assert!(
            found.failure.as_ref().is_some_and(is_told),
            "{model}: {:?}",
            found.failure
        );
    }
}

/// By events, and by finite elements of an order that leaves rounding.
const ROADS: [&str; 2] = ["", "method fesd { steps = 400; scheme = radau_iia(4); }"];

#[test]
fn finite_elements_find_the_same() {
    let fesd = ROADS[1];
    let model = "state x = 2; algebraic y = 0.3; 0 = y^3 + y - x; x' = -(3*y^2 + 1)*y;";
    let y = (-2.0_f64).exp();
    assert_near(&end(&runs(model, 2.0, fesd), "y"), &[y], 1e-11);
    let model = "state x = 2; algebraic a = 0; algebraic b = 0;
      0 <= a perp 1 - (x - a + b) >= 0;
      0 <= b perp (x - a + b) + 1 >= 0;
      x' = -(x - a + b);";
    let found = runs(model, 3.0, fesd);
    assert_near(&end(&found, "x"), &[(-2.0_f64).exp()], 1e-11);
    assert_near(&times(&found, EventKind::Activate), &[1.0], 1e-11);
    let model = "state x = 1; algebraic z = 0; 0 = z + z^3 - x; x' = -sign(z - 0.5);";
    let found = runs(model, 3.0, fesd);
    assert_near(&times(&found, EventKind::EnterSliding), &[0.375], 1e-10);
    assert_near(&end(&found, "z"), &[0.5], 1e-11);
}

/// What steps in time takes a complementarity, a kink of an equation and a variational inequality to other pieces, where
/// algebraic states jump: by events, and by finite elements of any length.
#[test]
fn steps_of_time_take_algebraic_states_to_other_pieces() {
    let models = [
        (
            "algebraic z = 0; 0 <= z perp z + (if time < 1 then 1 else -1) >= 0;",
            1.0,
        ),
        (
            "algebraic z = 0; 0 = 2*z + abs(z - (if time < 1 then 2 else -2));",
            -8.0 / 3.0,
        ),
        (
            "z in variational [0, 0.5] solves z - (if time < 1 then 0.2 else 0.8);",
            0.7,
        ),
        (
            "algebraic z = 0; 0 <= z perp 2*z - sin(time) + floor(time)/2 >= 0;",
            // ∫ sin(t)/2 up to 1, then ∫ (sin(t) - 1/2)/2 up to 2.
            0.5 * (1.0 - 2.0_f64.cos()) - 0.25,
        ),
    ];
    let grids = ["radau_iia(1)", "radau_iia(4)", "gauss(3)"]
        .map(|scheme| format!("method fesd {{ scheme = {scheme}; steps = 40; }}"));
    for (model, exact) in models {
        let model = format!("state x = 0; {model} x' = z;");
        for settings in ["", "method fesd;", &grids[1], &grids[2]] {
            assert_near(&end(&runs(&model, 2.0, settings), "x"), &[exact], 1e-10);
        }
        assert_near(&end(&runs(&model, 2.0, &grids[0]), "x"), &[exact], 1e-1);
    }
}

#[test]
fn a_point_is_projected_onto_a_ball_and_a_polyhedron() {
    // The nearest point of the unit disc, and where x goes with it.
    let ball = "state x[2] = [3, 4]; z[2] in variational { norm(z) <= 2; } solves z - x; x' = -z;";
    for road in ROADS {
        // |x| falls at the rate 2 from 5 to 2, and then as an exponential.
        let size = 2.0 * (-0.5_f64).exp();
        let found = runs(ball, 2.0, road);
        assert_near(&end(&found, "x"), &[0.6 * size, 0.8 * size], 1e-10);
        assert_near(&times(&found, EventKind::Activate), &[1.5], 1e-10);
    }
    // The least distance to a triangle: at first to its edge z₁ + z₂ = 1, then to x itself.
    let triangle = "state x[2] = [2, 2]; x' = -[1, 1];
      z[2] in argmin dot(z - x, z - x) subject to { z >= 0; sum(z) <= 1; }";
    let found = runs(triangle, 1.75, "");
    assert_near(&end(&found, "z"), &[0.25, 0.25], 1e-12);
    assert_near(&times(&found, EventKind::Activate), &[1.5], 1e-12);
}

#[test]
fn an_equation_among_the_rows_holds() {
    // Two sources share a load at least cost until the first one is at its limit.
    let model = "state load = 1; load' = 1;
      p[2] in argmin p[1]^2 + 3*p[2]^2 subject to { sum(p) = load; p <= 2; }";
    let found = runs(model, 2.0, "output p at [1, 2];");
    let shares = &found.samples.outputs[0].values;
    assert_near(shares, &[1.5, 0.5, 2.0, 1.0], 1e-12);
}

#[test]
fn gauss_methods_keep_their_order_with_equations_and_pairs() {
    // x = 4/3 e^(-3t) - 1/3 while a = x, then x' = -1; z³ + z = x along the way.
    let model = "state x = 1; algebraic a = 1; algebraic z = 0.7;
      0 <= a perp a - x >= 0; 0 = z^3 + z - x; x' = -1 - 3*a;";
    let exact = 4.0_f64.ln() / 3.0 - 1.0;
    for (nodes, grids) in [(1, [20, 80]), (2, [6, 24]), (3, [3, 9])] {
        let errors = grids.map(|steps| {
            let method = format!("method fesd {{ steps = {steps}; scheme = gauss({nodes}); }}");
            let found = runs(model, 1.0, &method);
            let (x, z) = (end(&found, "x")[0], end(&found, "z")[0]);
            // z at the end is the root there, no extrapolation.
            assert!((z.powi(3) + z - x).abs() < 1e-10, "{z} at {x}");
            (x - exact).abs()
        });
        let order = (errors[0] / errors[1]).ln() / (f64::from(grids[1]) / f64::from(grids[0])).ln();
        let least = f64::from(2 * nodes) - 0.3;
        assert!(order >= least, "{nodes} nodes: {order} from {errors:?}");
    }
}

/// z is u = 1.61 sin(1.26 t + 1.54) between its bounds: each is met and left, and in those instants both members of a
/// pair are zero.
#[test]
fn bounds_of_a_program_are_met_and_left() {
    let model = "state y = 0; y' = z;
      z in argmin 0.5*z^2 - 1.61*sin(1.26*time + 1.54)*z subject to { z >= -0.66; z <= 0.5; };";
    let found = runs(model, 6.0, "");
    let instants = times(&found, EventKind::Activate);
    // u = 0.5 falling, -0.66 falling and rising, 0.5 rising; ∫ sin = -cos.
    let (above, below) = ((0.5_f64 / 1.61).asin(), (0.66_f64 / 1.61).asin());
    let pi = std::f64::consts::PI;
    let phases = [pi - above, pi + below, 2.0 * pi - below, 2.0 * pi + above];
    let t = phases.map(|phase| (phase - 1.54) / 1.26);
    assert_near(&instants, &t, 1e-10);
    let inside = |a: usize, b: usize| 1.61 / 1.26 * (phases[a].cos() - phases[b].cos());
    let y = 0.5 * (t[0] + 6.0 - t[3]) - 0.66 * (t[2] - t[1]) + inside(0, 1) + inside(2, 3);
    assert_near(&end(&found, "y"), &[y], 1e-10);
}

/// A program in t - B, which is known to the rounding of B: z is t - B between its bounds.
#[test]
fn bounds_of_a_program_far_from_zero_are_met() {
    for offset in ["0", "1e6", "1e9", "1e12", "1e13"] {
        let model = format!(
            "param B = {offset}; state t = B; state y = 0; t' = 1; y' = z;
             z in argmin 0.5*z^2 - (t - B)*z subject to {{ z >= 0.5; z <= 1.5; }};"
        );
        let found = solved(
            &format!("model m {{ {model} }} simulate s of m {{ horizon 2; method event; }}"),
            "s",
        );
        let instants = times(&found, EventKind::Activate);
        let known = 1e-10 + 64.0 * f64::EPSILON * offset.parse::<f64>().expect("it is a number");
        assert_near(&instants, &[0.5, 1.5], known);
        assert_near(&end(&found, "y"), &[2.0], known);
    }
}

/// Bounds that are never met have multipliers that are zero, or rounding: neither has an error of its own.
#[test]
fn multipliers_that_stay_zero_have_no_error() {
    for phase in 0..20 {
        let drive = |shift: u32| format!("0.53*sin(1.6*time + {})", 0.3 * f64::from(phase + shift));
        let models = [
            format!(
                "state y = 0; y' = z; z in variational [-0.63, 0.93] solves z - {};",
                drive(0)
            ),
            format!(
                "state y = 0; y' = z[1] + z[2];
                 z[2] in argmin 0.5*(z[1]^2 + z[2]^2) + 0.2*z[1]*z[2] - {}*z[1] - {}*z[2]
                   subject to {{ z[1] >= -2; z[2] <= 3; z[1] + z[2] <= 4; }};",
                drive(0),
                drive(2)
            ),
        ];
        for model in models {
            let text =
                format!("model m {{ {model} }} simulate s of m {{ horizon 3; method event; }}");
            let found = solved(&text, "s");
            assert!(found.warnings.is_empty(), "{text}: {:?}", found.warnings);
            let estimate = found.quality.error_estimate.expect("a second run was made");
            assert!(estimate <= 1e-8, "{text}: {estimate}");
        }
    }
}

/// x(t) = s(1000 + 500 sin t) stays positive, so that its multiplier is zero, whatever units both have.
#[test]
fn multipliers_that_stay_zero_in_steps_of_time_have_no_error() {
    for (size, gain) in [
        (1.0, 1.0),
        (1e-6, 1.0),
        (1e3, 1e-6),
        (1e3, 1e6),
        (1e-9, 1.0),
        (1.0, 1e3),
    ] {
        let model = format!(
            "state x = {size:?}*1e3; algebraic l = 0; 0 <= l perp x + {gain:?}*l >= 0;
             x' = {size:?}*500*cos(time) + {gain:?}*l;"
        );
        let found = runs(&model, 1.0, "method timestepping;");
        assert!(found.warnings.is_empty(), "{model}: {:?}", found.warnings);
        let estimate = found.quality.error_estimate.expect("a second run was made");
        assert!(estimate <= 1e-11, "{model}: {estimate}");
        let exact = size * (1000.0 + 500.0 * 1.0_f64.sin());
        assert_near(&[end(&found, "x")[0] / exact], &[1.0], 1e-11);
    }
}

/// A diode charges a capacitor: what steps of time tell of it happens where it does from event to event, in any units.
#[test]
fn steps_of_time_tell_which_members_vanish() {
    for (farad, ohm) in [
        (1e-12, 50.0),
        (1e-9, 100.0),
        (1e-9, 1e3),
        (1e-12, 1e3),
        (1.0, 1.0),
    ] {
        let (leak, rate): (f64, f64) = (1e4 * ohm, 120.0 / (farad * 1e4 * ohm));
        let horizon = 12.0 / rate;
        let model = format!(
            "state v = 0.2; algebraic l = 0; 0 <= l perp v - sin({rate:?}*time) + {ohm:?}*l >= 0;
             v' = (l - v/{leak:?})/{farad:?};"
        );
        let told = |method: &str| {
            let found = runs(&model, horizon, method);
            let modes = found.history.modes.iter().map(|mode| mode.mode.clone());
            (
                times(&found, EventKind::Activate),
                modes.collect::<Vec<_>>(),
            )
        };
        let (instants, modes) = told("method event;");
        let (found, by_steps) = told("method timestepping { steps = 4000; }");
        assert_eq!(instants.len(), 4, "{model}");
        assert_eq!(by_steps, modes, "{model}");
        assert_near(&found, &instants, 2.0 * horizon / 4000.0);
    }
}

/// From t = 1 on z₁ + z₂ ≤ 3 - t cuts off the corner (1, 1), in which both multipliers are positive: with three rows on
/// two entries they are not determined in that instant, and that of z₂ ≤ 1 jumps to zero.
#[test]
fn a_row_that_moves_cuts_off_a_corner() {
    let model = "state y = 0; y' = z[2];
      z[2] in argmin 0.5*((z[1] - 5)^2 + (z[2] - 3)^2)
        subject to { z[1] <= 1; z[2] <= 1; z[1] + z[2] <= 3 - time; };";
    let found = runs(model, 2.0, "");
    assert_near(&end(&found, "z"), &[1.0, 0.0], 1e-10);
    assert_near(&end(&found, "y"), &[1.5], 1e-10);
}

/// Twelve rows of a variational inequality whose map is not symmetric: no choice of multipliers that vanish is known.
#[test]
fn many_rows_of_a_variational_inequality_are_solved_at_the_start() {
    let model = "state y = 0; y' = z[1];
      z[6] in variational { for i in 1..6 { z[i] >= -1; z[i] <= 1; } }
        solves [z[1] - 2*z[2] + 5, z[2] + 2*z[1] + 1.5, z[3] - 4, z[4] + 4, z[5] - 0.5, z[6] + 0.5];";
    let found = runs(model, 1.0, "");
    // At z₁ = -1: z₂ = 2 - 1.5, and 5 - 1 - 1 > 0 holds it there.
    assert_near(&end(&found, "z"), &[-1.0, 0.5, 1.0, -1.0, 0.5, -0.5], 1e-9);
}

/// A step of time at √p, where ψ = t² - p is zero or what rounding makes of it: z is 0 before it and 1 behind it, as the root of
/// an equation, a member of a pair, and a solution of a variational inequality.
#[test]
fn algebraic_states_follow_steps_at_instants_that_are_rounded() {
    for p in [1.0_f64, 1.000_01, 1.01, 1.2, 1.3, 1.5, 2.4, 3.0, 3.3] {
        for statement in [
            "algebraic z = 0; 0 = z + z^3 - 2*step(time^2 - p);",
            "algebraic z = 0; 0 <= z perp z - step(time^2 - p) >= 0;",
            "z in variational [0, 1] solves z - 2*step(time^2 - p);",
        ] {
            let text = format!(
                "model m {{ param p = {p:?}; state x = 0; {statement} x' = z; }}
                 simulate s of m {{ horizon 2.3; tolerance 1e-10; }}"
            );
            assert_near(&end(&solved(&text, "s"), "x"), &[2.3 - p.sqrt()], 1e-9);
        }
    }
}
