//! Mass matrices with large condition.

use super::{Case, Extent, Family};

pub fn families(extent: Extent) -> Vec<Family> {
    vec![
        unequal(extent),
        row(extent),
        clay_and_steel(extent),
        coupled(extent),
        friction(extent),
    ]
}

fn powers(extent: Extent) -> Vec<i32> {
    extent.sweep(
        &[-40, 40],
        &[-40, -33, -27, -20, -13, -7, 0, 7, 13, 20, 27, 33, 40],
    )
}

/// By events, and in steps of time.
fn with_a_grid(case: Case) -> [Case; 2] {
    let grid = case.clone().in_steps(1000);
    [case, grid]
}

/// Two masses collide, one of them as heavy as the ratio.
fn unequal(extent: Extent) -> Family {
    let case = |power: i32| {
        let (m, e) = (2.0_f64.powi(power), 0.5);
        let model = format!(
            "state q[2] = [0, 1]; state v[2] = [1, 0]; q' = v;
             mechanics q, v {{ mass = [1, 0; 0, {m:e}]; force = [0, 0];
               contact pair {{ gap = q[2] - q[1]; restitution = {e:?}; }} }}"
        );
        // 1 + m Δv₂ + Δv₁ = 1: the common speed, less or more of what remains of the relative one.
        let common = 1.0 / (1.0 + m);
        let (first, second) = (common - e * m * common, common * (1.0 + e));
        let case = Case::new(format!("2^{power}"), model, 2.0);
        let case = case.ends("q", &[1.0 + first, 1.0 + second], 2.5);
        with_a_grid(case.ends_each("v", &[first, second], &[1.0, second]))
    };
    Family {
        name: "unequal masses",
        about: "Masses 1 and m collide; closed form, each speed relative to itself.",
        hardness: "m",
        cases: powers(extent).into_iter().flat_map(case).collect(),
    }
}

/// The same row with Poisson's law, clay between the first two balls.
fn clay_and_steel(extent: Extent) -> Family {
    let case = |power: i32| {
        let (m, e) = (2.0_f64.powi(power), 0.5);
        let model = format!(
            "state q[3] = [-1, 0, 0]; state v[3] = [1, 0, 0]; q' = v;
             mechanics q, v {{ mass = diag([1, {m:e}, 1]); force = zeros(3); }}
             contact clay {{ gap = q[2] - q[1]; restitution = plastic; }}
             contact steel {{ gap = q[3] - q[2]; restitution = poisson({e:?}); }}"
        );
        // Compression has the impulse c = 1/(2 + m) between the last two, and leaves all with the speed c.
        let common = 1.0 / (2.0 + m);
        let (first, last) = (common * (1.0 - e / (1.0 + m)), common * (1.0 + e));
        let case = Case::new(format!("2^{power}"), model, 2.0);
        let case = case.ends_each("v", &[first, first, last], &[1.0, 1.0, last]);
        let case = case.ends("q", &[first, first, last], 2.5);
        // Forces are known to rounding of one, and what that moves a light mass by is large.
        case.conditioned(2.0_f64.powi(power.abs()))
    };
    Family {
        name: "clay and steel",
        about: "Masses 1, m and 1 that touch are hit by the first one, which is of clay; Poisson's law, closed form.",
        hardness: "m",
        cases: powers(extent).into_iter().map(case).collect(),
    }
}

/// Three balls that touch, the first one hit the others.
fn row(extent: Extent) -> Family {
    let case = |power: i32| {
        let (m, e) = (2.0_f64.powi(power), 0.5);
        let model = format!(
            "state q[3] = [-1, 0, 0]; state v[3] = [1, 0, 0]; q' = v;
             mechanics q, v {{ mass = diag([1, {m:e}, 1]); force = zeros(3); }}
             for i in 1..2 {{ contact pair {{ gap = q[i+1] - q[i]; restitution = {e:?}; }} }}"
        );
        // Impulses (1 + e) (m + 1)/S and (1 + e)/S with the sum S of masses.
        let speed = (1.0 + e) / (2.0 + m);
        let first = 1.0 - speed * (m + 1.0);
        let case = Case::new(format!("2^{power}"), model, 2.0);
        let case = case.ends_each("v", &[first, speed, speed], &[1.0, speed, speed]);
        let [events, grid] = with_a_grid(case.ends("q", &[first, speed, speed], 2.0));
        // Forces are known to rounding of one, and what that moves a light mass by is large.
        [events.conditioned(2.0_f64.powi(power.abs())), grid]
    };
    Family {
        name: "a row of unequal masses",
        about: "Masses 1, m and 1 that touch are hit by the first one; Newton's law for all contacts, closed form.",
        hardness: "m",
        cases: powers(extent).into_iter().flat_map(case).collect(),
    }
}

fn conditions(extent: Extent) -> Vec<i32> {
    extent.sweep(&[10, 38], &[0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 38])
}

/// M = [1 + d, 1; 1, 1] has the inverse [1, -1; -1, 1 + d]/d: all of it is exact in binary numbers.
fn coupled(extent: Extent) -> Family {
    let case = |power: i32| {
        let (d, e) = (2.0_f64.powi(-power), 0.5);
        // Falls with the accelerations -2 and 1 from the speeds 0.
        let force = [-2.0 * (1.0 + d) + 1.0, -1.0];
        let model = format!(
            "state q[2] = [1, 0]; state v[2] = [0, 0]; q' = v;
             mechanics q, v {{ mass = [{:?}, 1; 1, 1]; force = [{:?}, {:?}];
               contact floor {{ gap = q[1]; restitution = {e:?}; }} }}",
            1.0 + d,
            force[0],
            force[1]
        );
        // Struck at t = 1 with the speed 2: M⁻¹ (1, 0) is in proportion to (1, -1).
        let (up, t) = (2.0 * e, 0.5);
        let right = 1.0 - 2.0 * (1.0 + e);
        let q = [up * t - t * t, 0.5 + right * t + 0.5 * t * t];
        let case = Case::new(format!("{:.0e}", 4.0 / d), model, 1.0 + t);
        let case = case
            .ends("q", &q, 1.0)
            .ends("v", &[up - 2.0 * t, right + t], 2.0);
        // What elimination loses is of the data, not of the method: a report will do where that is above the tolerance.
        let [events, grid] = with_a_grid(case);
        [events.conditioned(4.0 / d), grid]
    };
    Family {
        name: "masses that hang together",
        about: "M = [1 + d, 1; 1, 1], whose inverse is known, falls and bounces; closed form.",
        hardness: "condition of M",
        cases: conditions(extent).into_iter().flat_map(case).collect(),
    }
}

/// The same with friction, which a thrown body slips against until it sticks.
fn friction(extent: Extent) -> Family {
    let case = |power: i32| {
        let m = 2.0_f64.powi(power);
        let model = format!(
            "state q[3] = [0, 0, 5]; state v[3] = [2, 0, 0.5]; q' = v;
             mechanics q, v {{ mass = diag([1, 1, {m:e}]); force = [0, -8, 0];
               contact floor {{ gap = q[2]; restitution = 0; slip = v[1]; friction = 0.25; }}
               contact wall {{ gap = q[3] - q[1]; restitution = 0; }} }}"
        );
        // Slips with -2 and stops after 1 s at 1; the mass of m goes on.
        let case = Case::new(format!("2^{power}"), model, 3.0);
        with_a_grid(
            case.ends("q", &[1.0, 0.0, 6.5], 5.0)
                .ends("v", &[0.0, 0.0, 0.5], 2.0),
        )
    };
    Family {
        name: "friction beside a heavy mass",
        about: "A block slips and stops, beside a mass m that it does not reach; closed form.",
        hardness: "m",
        cases: powers(extent).into_iter().flat_map(case).collect(),
    }
}
