//! Laws of restitution: impacts in which Poisson's law is another one than Newton's, and those in which it is not.

use nsd_tests::{assert_near, end, solved, times};
use nsdc::report::{EventKind, Trajectory};

fn gains_energy(run: &Trajectory) -> bool {
    run.warnings.iter().any(|warning| warning.code == "W0712")
}

/// Three balls of mass 1 that touch, the first one with speed 1; contacts with these laws.
fn row(laws: [&str; 2]) -> Trajectory {
    let [first, second] = laws;
    let text = format!(
        "model row {{
           state q[3] = [0, 1, 2]; state v[3] = [1, 0, 0]; q' = v;
           mechanics q, v {{ mass = eye(3); force = zeros(3); }}
           contact first {{ gap = q[2] - q[1] - 1; restitution = {first}; }}
           contact second {{ gap = q[3] - q[2] - 1; restitution = {second}; }}
         }}
         simulate this of row {{ horizon 1; }}"
    );
    solved(&text, "this")
}

/// Compression: 2 Λ1 - Λ2 = 1 and 2 Λ2 - Λ1 = 0, so that Λ = (2, 1)/3 and all have the speed 1/3. What is given back is
/// at least (2 e1, e2)/3, and the rates of the gaps behind are (2 L1 - L2, 2 L2 - L1): with equal e that is Newton's
/// law. With e1 = 0, L2 = e2/3 and L1 = e2/6, while Newton's law knows nothing of e2, as the speed it multiplies is
/// zero. With e1 = 1 and e2 = 0, L = (2, 1)/3.
#[test]
fn a_row_gives_back_what_has_stopped_it() {
    let behind = |l1: f64, l2: f64| [1.0 / 3.0 - l1, 1.0 / 3.0 + l1 - l2, 1.0 / 3.0 + l2];
    for e in [0.0, 0.25, 0.5, 1.0] {
        let equal = row([&format!("poisson({e:?})"), &format!("poisson({e:?})")]);
        assert_near(&end(&equal, "v"), &behind(2.0 * e / 3.0, e / 3.0), 1e-14);
        let newton = row([&format!("newton({e:?})"), &format!("{e:?}")]);
        assert_near(&end(&equal, "v"), &end(&newton, "v"), 1e-14);
        for plastic in ["plastic", "poisson(0)", "0"] {
            let second = row([plastic, &format!("poisson({e:?})")]);
            assert_near(&end(&second, "v"), &behind(e / 6.0, e / 3.0), 1e-14);
            assert!(!gains_energy(&second));
        }
    }
    let newton = row(["plastic", "newton(1)"]);
    assert_near(&end(&newton, "v"), &[1.0 / 3.0; 3], 1e-14);
    let first = row(["poisson(1)", "plastic"]);
    assert_near(&end(&first, "v"), &behind(2.0 / 3.0, 1.0 / 3.0), 1e-14);
}

/// A rod of mass 1, length 2 and inertia 1/3 that strikes the floor with its left end, at 45 degrees. Its end has
/// J_n = (0, 1, -c) and J_t = (1, 0, c) with c² = 1/2, so that impulses change its rate of the gap and its slip by
/// [5/2, -3/2; -3/2, 5/2] Λ.
fn rod(law: &str, friction: f64, speed: [f64; 3]) -> Trajectory {
    let text = format!(
        "model rod {{
           state q[3] = [0, sin(pi/4), pi/4]; state v[3] = {speed:?}; q' = v;
           mechanics q, v {{
             mass = diag([1, 1, 1/3]); force = zeros(3);
             contact lower {{
               gap = q[2] - sin(q[3]); slip = v[1] + sin(q[3])*v[3]; restitution = {law}; friction = {friction:?};
             }}
           }}
           output energy = (v[1]^2 + v[2]^2 + v[3]^2/3)/2;
         }}
         simulate this of rod {{ horizon 0.1; }}"
    );
    solved(&text, "this")
}

/// v⁺ of the rod for the impulses (Λ_n, Λ_t).
fn thrown([x, y, turn]: [f64; 3], [normal, tangential]: [f64; 2]) -> [f64; 3] {
    let c = 0.5_f64.sqrt();
    let turned = turn + 3.0 * c * (tangential - normal);
    [x + tangential, y + normal, turned]
}

/// v⁻ = (1, -1, 0) and μ = 1/2. Compression slips, (5/2 + 3/4) Λ_n = 1 and Λ_t = -Λ_n/2, and leaves the slip 2/13. With
/// e = 1 expansion has Λ_n = 4/13 and sticks: 5/2 Λ_t = 3/2 Λ_n - 2/13, Λ_t = 8/65 < Λ_n/2. Newton's law sticks with
/// Λ = (7/8, 1/8) and adds Λ_t/2 = 1/16 to the energy, as in Kane's example.
#[test]
fn friction_that_turns_takes_no_energy_from_nowhere() {
    let before = [1.0, -1.0, 0.0];
    let newton = rod("newton(1)", 0.5, before);
    assert_near(
        &end(&newton, "v"),
        &thrown(before, [7.0 / 8.0, 1.0 / 8.0]),
        1e-13,
    );
    assert_near(&end(&newton, "energy"), &[1.0 + 1.0 / 16.0], 1e-13);
    assert!(gains_energy(&newton));

    let poisson = rod("poisson(1)", 0.5, before);
    let impulses = [8.0 / 13.0, 8.0 / 65.0 - 2.0 / 13.0];
    assert_near(&end(&poisson, "v"), &thrown(before, impulses), 1e-13);
    // Λᵀ(J v⁺ + J v⁻)/2, with J v⁺ = (38/65, 0).
    let gain = (impulses[0] * (38.0 / 65.0 - 1.0) + impulses[1]) / 2.0;
    assert_near(&end(&poisson, "energy"), &[1.0 + gain], 1e-13);
    assert!(!gains_energy(&poisson));

    // At e = 1/10 expansion slips on: Λ_n = 2/65, Λ_t = -Λ_n/2, 2/13 - 11/4 Λ_n > 0.
    let slow = rod("poisson(0.1)", 0.5, before);
    let (first, second) = (4.0 / 13.0, 2.0 / 65.0);
    let impulses = [first + second, -(first + second) / 2.0];
    assert_near(&end(&slow, "v"), &thrown(before, impulses), 1e-13);
}

/// Where slip keeps its direction, or sticks all along, both laws are one: v⁻ = (0, -1, 0) with μ = 1/5, where
/// (5/2 - 3/10) Λ_n = 1 + e slips backwards, and with μ = 1, where Λ = (1 + e) (5/8, 3/8) sticks.
#[test]
fn both_laws_are_one_where_slip_does_not_turn() {
    let before = [0.0, -1.0, 0.0];
    for e in [0.0, 0.5, 1.0] {
        let slips = (1.0 + e) / 2.2;
        let sticks = [5.0 / 8.0, 3.0 / 8.0].map(|part| (1.0 + e) * part);
        for law in [format!("newton({e:?})"), format!("poisson({e:?})")] {
            let found = end(&rod(&law, 0.2, before), "v");
            assert_near(&found, &thrown(before, [slips, 0.2 * slips]), 1e-13);
            let found = end(&rod(&law, 1.0, before), "v");
            assert_near(&found, &thrown(before, sticks), 1e-13);
        }
    }
}

/// A body in space: mass 1, inertia 1 about all axes, its corner at (1, 0, -1) from the centre, where impulses change the
/// rate of the gap and both slips by [2, 1, 0; 1, 2, 0; 0, 0, 3] Λ. With v⁻ = (-1, 0, -1) and μ = 1/2 compression slips,
/// (2 + 1/2) Λ_n = 1, and leaves the slip -1/5. With e = 1 expansion has Λ_n = 2/5 and sticks, Λ_1 = -1/10.
#[test]
fn slip_in_two_directions_obeys_the_law_too() {
    let (normal, tangential) = (4.0 / 5.0, 1.0 / 5.0 - 1.0 / 10.0);
    for turned in [0.0, 0.7] {
        let (s, c) = f64::sin_cos(turned);
        let text = format!(
            "model cube {{
               state q[6] = [0, 0, 1, 0, 0, 0]; state v[6] = [-1, 0, -1, 0, 0, 0]; q' = v;
               mechanics q, v {{
                 mass = eye(6); force = zeros(6);
                 contact corner {{
                   gap = q[3] - q[5] - 1; friction = 0.5; restitution = poisson(1);
                   slip = [{c:?}*(v[1] - v[5]) + {s:?}*(v[2] + v[4] + v[6]),
                           {c:?}*(v[2] + v[4] + v[6]) - {s:?}*(v[1] - v[5])];
                 }}
               }}
             }}
             simulate this of cube {{ horizon 0.1; }}"
        );
        let turn = -normal - tangential;
        let exact = [-1.0 + tangential, 0.0, -1.0 + normal, 0.0, turn, 0.0];
        assert_near(&end(&solved(&text, "this"), "v"), &exact, 1e-12);
    }
}

/// A ball bounces by both laws alike until it rests: at √(2h/g) (1 + 2 e/(1 - e)).
#[test]
fn a_single_ball_bounces_by_both_laws_alike() {
    let run = |law: &str| {
        let text = format!(
            "model ball {{ state q = 1; state v = 0; q' = v;
               mechanics q, v {{ mass = 2; force = -16; contact floor {{ gap = q; restitution = {law}; }} }} }}
             simulate this of ball {{ horizon 3; }}"
        );
        solved(&text, "this")
    };
    let [newton, poisson] = ["newton(0.5)", "poisson(0.5)"].map(run);
    let ends = [&newton, &poisson].map(|run| times(run, EventKind::Zeno));
    assert_near(&ends[0], &[1.5], 1e-8);
    assert_near(&ends[1], &[1.5], 1e-8);
    assert_near(
        &times(&poisson, EventKind::Jump)[..5],
        &times(&newton, EventKind::Jump)[..5],
        1e-13,
    );
}

/// e of Poisson's law may switch, and leaves [0, 1] as that of Newton's does: 0.75 from t = 1 on, and 1.5.
#[test]
fn a_coefficient_may_switch() {
    let ball = |e: &str| {
        format!(
            "model ball {{ state q = 1; state v = 0; q' = v;
               mechanics q, v {{ mass = 1; force = -2; contact floor {{ gap = q; restitution = poisson({e}); }} }} }}
             simulate this of ball {{ horizon 1.5; }}"
        )
    };
    // Struck at t = 1 with the speed 2.
    let found = solved(&ball("if time > 0.5 then 0.75 else 0.25"), "this");
    assert_near(&end(&found, "v"), &[1.5 - 1.0], 1e-12);
    let found = nsd_tests::run(&ball("0.5 + time"), "this");
    let failure = found.failure.expect("1.5 is no restitution");
    assert!(format!("{failure:?}").contains("1.5"), "{failure:?}");
}
