//! Optimal control in all units: lengths, times and costs in nanometres or megametres, microseconds or weeks, with weights of
//! any size. What ends as an optimum is the closed form to a relative tolerance.

use nsd_tests::optimum;
use nsd_tests::random::Random;
use nsdc::report::Status;

/// Units of length, of time and of the cost.
#[derive(Clone, Copy, Debug)]
struct Units {
    length: f64,
    time: f64,
    cost: f64,
}

/// A problem in some units with its optimal value.
type Kind = fn(Units) -> (String, f64);

const KINDS: [(&str, Kind); 6] = [
    ("shortest time", shortest_time),
    ("least energy", least_energy),
    ("least distance", least_distance),
    ("to a relay", to_a_relay),
    ("bounds far from zero", far_from_zero),
    ("a resource", a_resource),
];

/// Within [-a, a] from rest to rest over 1: 2/√a.
fn shortest_time(units: Units) -> (String, f64) {
    let Units { length, time, cost } = units;
    let a = length / (time * time);
    let text = format!(
        "model m {{ state x = 0; state v = 0; control u in [-{a}, {a}] = 0; x' = v; v' = u; }}
         optimize o of m {{ horizon free = {}; intervals 2 free; minimize {cost}*final(time);
           final {{ x = {length}; v = 0; }} }}",
        1.5 * time
    );
    (text, 2.0 * time * cost)
}

/// Over N intervals of 1/N, u_k = b (N/2 - k + 1/2) with Σ u_k (N/2 - k + 1/2) = N²: ∫ u² = 12 N² / (N² - 1).
fn least_energy(units: Units) -> (String, f64) {
    let Units { length, time, cost } = units;
    let text = format!(
        "model m {{ state x = 0; state v = 0; control u = 0; x' = v; v' = u; }}
         optimize o of m {{ horizon {time}; intervals 4; minimize {cost}*integral(u^2);
           final {{ x = {length}; v = 0; }} }}"
    );
    (text, 12.8 * length * length / time.powi(3) * cost)
}

/// From 1 to 0 with speed 1, and rest: ∫ |x| = 1/2.
fn least_distance(units: Units) -> (String, f64) {
    let Units { length, time, cost } = units;
    let speed = length / time;
    let text = format!(
        "model m {{ state x = {length}; control u in [-{speed}, {speed}] = 0; x' = u; }}
         optimize o of m {{ horizon {}; intervals 4; minimize {cost}*integral(abs(x)); }}",
        2.0 * time
    );
    (text, 0.5 * length * time * cost)
}

/// From 1 to 0 with 3/2, the relay and the control together, and rest by the relay: ∫ x² = 2/9.
fn to_a_relay(units: Units) -> (String, f64) {
    let Units { length, time, cost } = units;
    let speed = length / time;
    let text = format!(
        "model m {{ state x = {length}; control u in [-{half}, {half}] = 0; x' = u - {speed}*sign(x); }}
         optimize o of m {{ horizon {}; intervals 4; minimize {cost}*integral(x^2); }}",
        2.0 * time,
        half = 0.5 * speed
    );
    (text, 2.0 / 9.0 * length * length * time * cost)
}

/// A room between 18 and 21 from 20, in a cold of 10, with x' = (10 - x)/2 + u: u = 4 holds 18, and before x(3) = 18, or
/// (10 + 2 u) (1 - e) + 20 e = 18 with e = exp(-3/2).
fn far_from_zero(units: Units) -> (String, f64) {
    let Units { length, time, cost } = units;
    let text = format!(
        "model m {{ state x in [{}, {}] = {}; control u in [0, {}] = 0; x' = {}*({} - x) + u; }}
         optimize o of m {{ horizon {}; intervals 2; elements 2; scheme radau_iia(4); minimize {cost}*integral(u); }}",
        18.0 * length,
        21.0 * length,
        20.0 * length,
        10.0 * length / time,
        0.5 / time,
        10.0 * length,
        6.0 * time
    );
    let e = (-1.5_f64).exp();
    let first = 0.5 * ((18.0 - 20.0 * e) / (1.0 - e) - 10.0);
    (text, 3.0 * (first + 4.0) * length * cost)
}

/// To 1, the second half with twice the rate: ∫ u = 1/2 + 1/4.
fn a_resource(units: Units) -> (String, f64) {
    let Units { length, time, cost } = units;
    let text = format!(
        "model m {{ state x = 0; control u in [0, {}] = 0; x' = u*(1 + step(x - {})); }}
         optimize o of m {{ horizon {time}; intervals 2; minimize {cost}*integral(u); final {{ x = {length}; }} }}",
        2.0 * length / time,
        0.5 * length
    );
    (text, 0.75 * length * cost)
}

/// Whether a problem ends as solved, and then with its optimal value.
fn is_solved(name: &str, kind: Kind, units: Units) -> bool {
    let (text, exact) = kind(units);
    let found = optimum(&text, "o");
    if found.status != Status::Solved {
        return false;
    }
    let objective = found.objective.expect("a solution has an objective");
    let error = (objective - exact).abs() / exact;
    assert!(
        error < 1e-6,
        "{name} in {units:?} is {objective:e} and not {exact:e}\n{text}"
    );
    true
}

/// One unit is changed alone, or all of them are.
#[test]
fn optima_are_those_of_other_units() {
    const ONE: Units = Units {
        length: 1.0,
        time: 1.0,
        cost: 1.0,
    };
    let length = |length: f64| Units { length, ..ONE };
    let time = |time: f64| Units { time, ..ONE };
    let cost = |cost: f64| Units { cost, ..ONE };
    let all = [
        ONE,
        length(1e-9),
        length(1e-3),
        length(1e3),
        time(1e-6),
        time(1e-2),
        time(1e6),
        cost(1e-12),
        cost(1e-6),
        cost(1e12),
        // The objective is a thousandth of what its derivatives show at first, and lengths are in units of their own.
        Units {
            length: 1745.0,
            time: 1.5e-4,
            cost: 91.0,
        },
    ];
    for (name, kind) in KINDS {
        for units in all {
            assert!(is_solved(name, kind, units), "{name} in {units:?}");
        }
    }
}

/// All units are drawn at random: what is no optimum is not called one, and nearly everything is found.
#[test]
fn optima_in_random_units_are_those_of_one() {
    let mut random = Random(20);
    let mut power = |low: f64, high: f64| 10.0_f64.powf(random.within(low, high));
    let (mut n_solved, mut count) = (0, 0);
    for _ in 0..6 {
        let units = Units {
            length: power(-9.0, 6.0),
            time: power(-6.0, 6.0),
            cost: power(-12.0, 12.0),
        };
        for (name, kind) in KINDS {
            n_solved += usize::from(is_solved(name, kind, units));
            count += 1;
        }
    }
    assert!(n_solved >= count - 1, "{n_solved} of {count} are solved");
}

/// From rest to rest over 1/10 in a unit of time at least ∫ u²: 12 d² / (1 - 1/N²) with N controls, however far away the
/// bounds are.
#[test]
fn bounds_that_are_not_reached_are_no_sizes() {
    for bound in ["1e2", "1e3", "3e3", "1e4", "1e6", "1e8", "1e12"] {
        for scheme in ["radau_iia(3)", "gauss(2)", "lobatto_iiia(3)"] {
            for rows in [
                "final { x = 0.1; v = 0; }",
                "final { x = 0.1; v = 0; } soft l1 weight 1e3;",
                "final { 2*x = 0.2; v <= 0; v >= 0; }",
            ] {
                let text = format!(
                    "model m {{ state x = 0; state v = 0; control u in [-{bound}, {bound}] = 0; x' = v; v' = u; }}
                     optimize o of m {{ horizon 1; intervals 10; scheme {scheme}; minimize integral(u^2); {rows} }}"
                );
                let found = optimum(&text, "o");
                assert_eq!(
                    found.status,
                    Status::Solved,
                    "{bound} {scheme} {rows}: {:?}",
                    found.failure
                );
                let objective = found.objective.expect("an optimum has one");
                let least = 0.12 / 0.99;
                assert!(
                    (objective / least - 1.0).abs() < 1e-7,
                    "{bound} {scheme} {rows}: {objective}"
                );
            }
        }
        // What nothing satisfies is not satisfied in units of any size.
        let text = format!(
            "model m {{ state x = 0; control u in [-{bound}, {bound}] = 0; x' = u; }}
             optimize o of m {{ horizon 1; intervals 4; minimize integral(u^2); final {{ x = 1; 2*x = 3; }} }}"
        );
        let found = optimum(&text, "o");
        assert_eq!(found.status, Status::LocallyInfeasible, "{bound}");
    }
}

/// Where the least cost is zero its slopes are zero, too, and nothing but its curvature tells how large it is. ((x/L)² - c)² has
/// its minimum where the last digit of x decides.
#[test]
fn the_size_of_a_cost_that_vanishes_is_that_of_its_curvature() {
    for size in [1.0, 1e2, 1e3, 1e4] {
        for weight in [1e-3, 1.0, 10.0, 1e3] {
            let text = format!(
                "model m {{ state x = 0; control u in [{:?}, {:?}] = 0; x' = u; }}
                 optimize o of m {{ horizon 1; intervals 1; elements 1;
                   minimize {weight:?}*final(((x/{size:?})^2 - 0.1521)^2); }}",
                -2.0 * size,
                2.0 * size
            );
            let found = optimum(&text, "o");
            assert_eq!(found.status, Status::Solved, "{text}\n{:?}", found.failure);
            let objective = found.objective.expect("it was minimized");
            assert!(objective <= 1e-24 * weight, "{text}: {objective}");
        }
    }
}
