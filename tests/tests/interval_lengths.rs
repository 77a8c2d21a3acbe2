//! Control intervals whose lengths are given or chosen: closed forms.

use nsd_tests::{agrees, codes, solved_optimum};
use nsdc::report::Trajectory;

#[track_caller]
fn solved(model: &str, experiment: &str) -> Trajectory {
    solved_optimum(
        &format!("model m {{ {model} }} optimize o of m {{ {experiment} }}"),
        "o",
    )
}

#[track_caller]
fn costs(found: &Trajectory, exact: f64, within: f64) {
    let cost = found.objective.expect("an optimum");
    assert!((cost - exact).abs() <= within, "{cost} is not {exact}");
    agrees(found, within);
}

const CART: &str = "state x = 0; state v = 0; control u in [-1, 1] = 0; x' = v; v' = u;";

/// Over 1 from rest to rest takes 2, half of it with full power, which three equal intervals cannot have.
#[test]
fn power_is_cut_where_it_has_to_be() {
    let task = |intervals: &str| {
        format!(
            "horizon free in [0.5, 9] = 3; {intervals} elements 1; scheme radau_iia(2);
             minimize final(time); final {{ x = 1; v = 0; }}"
        )
    };
    costs(&solved(CART, &task("intervals 3 free;")), 2.0, 1e-7);
    let equal = solved(CART, &task("intervals 3;"));
    assert!(equal.objective.expect("an optimum") > 2.01);
}

/// u = a for 1 and b for 2: a + 2 b = 0 and 2.5 a + 2 b = 1.5, so that a = 1, b = -1/2 and ∫ u² = 1 + 2/4.
#[test]
fn lengths_are_in_proportion_to_a_list() {
    let task = |intervals: &str| {
        format!(
            "horizon 3; {intervals} elements 1; scheme radau_iia(2);
             minimize integral(u^2); final {{ x = 1.5; v = 0; }}"
        )
    };
    for list in ["[1, 2]", "[0.25, 0.5]"] {
        let found = solved(CART, &task(&format!("intervals {list};")));
        costs(&found, 1.5, 1e-9);
        let controls = &found.samples.controls[0];
        for (k, &time) in found.samples.time.iter().enumerate() {
            let u = if time < 1.0 { 1.0 } else { -0.5 };
            let is_between = (time - 1.0).abs() < 1e-9;
            assert!(is_between || (controls.at(k)[0] - u).abs() < 1e-7, "{time}");
        }
    }
}

/// ∫ (u - t)² is Σ L³/12, with u in the middle of each interval: 9/12 for 1 and 2, least for equal lengths.
#[test]
fn time_runs_through_intervals_of_any_length() {
    let task = |intervals: &str| {
        format!(
            "horizon 3; {intervals} elements 2; scheme radau_iia(3);
             minimize integral((u - time)^2 + 0*x);"
        )
    };
    let model = "state x = 0; control u = 0; x' = time;";
    costs(&solved(model, &task("intervals [1, 2];")), 0.75, 1e-9);
    costs(
        &solved(model, &task("intervals 2 free;")),
        2.0 * 1.5_f64.powi(3) / 12.0,
        1e-8,
    );
}

/// A switch of time at 1 is where an interval may end, and where u is to jump from 1 to -1.
#[test]
fn an_interval_ends_where_the_target_jumps() {
    let found = solved(
        "state x = 0; control u in [-2, 2] = 0; x' = u; let target = if time < 1 then 1 else -1;",
        "horizon 3; intervals 2 free; elements 2; scheme radau_iia(2); minimize integral((u - target)^2);
         final { x = -1; }",
    );
    costs(&found, 0.0, 1e-8);
}

/// A jump at 0.05, and the first interval lasts 0.15 at least: u is -1/3 there, the mean of 1 and -1, and the cost of it
/// 0.05 (4/3)² + 0.1 (2/3)². A change of both lengths by one factor is none, and leads nowhere.
#[test]
fn a_shortest_interval_is_no_descent() {
    let found = solved(
        "state x = 0; control u in [-2, 2] = 0; x' = u; let target = if time < 0.05 then 1 else -1;",
        "horizon 3; intervals 2 free; elements 2; scheme radau_iia(2);
         minimize integral((u - target)^2 + 0*x);",
    );
    costs(&found, 2.0 / 15.0, 1e-7);
}

/// Lists that are no lengths are errors; whatever they add up to, lengths are in proportion.
#[test]
fn lists_are_of_lengths() {
    let of = |experiment: &str| {
        codes(&format!(
            "model m {{ param p = 3; state x = 0; control u in [-1, 1] = 0; x' = p*u; }}
             {experiment}"
        ))
    };
    let with = |intervals: &str| {
        of(&format!(
            "optimize o of m {{ horizon 1; {intervals}; minimize final((x - 1)^2); free {{ p; }} }}"
        ))
    };
    for list in ["[0, 1]", "[-1, 2]", "[1e-9, 1]", "0", "0 free", "1.5 free"] {
        assert_eq!(with(&format!("intervals {list}")), ["E0504"], "{list}");
    }
    assert_eq!(with("intervals [p, 2]"), ["E0527"]);
    for list in ["[1, 2]", "2 free"] {
        let straight = format!("intervals {list}; controls linear");
        assert_eq!(with(&straight), ["E0523"], "{list}");
    }
    // Equal lengths are those that a number says, one among them.
    for list in ["[2, 2]", "[3]", "2*[3]", "1 free"] {
        let none: [&str; 0] = [];
        let straight = format!("intervals {list}; controls linear");
        assert_eq!(with(&straight), none, "{list}");
    }
    assert_eq!(
        of("simulate s of m { horizon 1; with { u = 1; } intervals 2 free; }"),
        ["E0509"]
    );
    for list in ["[1e308, 1e308]", "[1e-300, 2e-300]", "2*[1, 2]"] {
        let none: [&str; 0] = [];
        assert_eq!(with(&format!("intervals {list}")), none, "{list}");
    }
}

/// A car, 5 m/s² at most, with a turbo that multiplies this by `power` from `on` on, until it is below `off`.
struct Car {
    on: f64,
    off: f64,
    top: f64,
    power: f64,
    distance: f64,
}

impl Car {
    fn drives(&self, task: &str) -> Trajectory {
        let Car {
            on,
            off,
            top,
            power,
            distance,
        } = self;
        let found = solved(
            &format!(
                "state q = 0; state v in [-{top}, {top}] = 0; control u in [-5, 5] = 0;
                 switch turbo = hysteresis(v, on = {on}, off = {off}, start = 0);
                 q' = v; v' = (1 + {}*turbo)*u;",
                power - 1.0
            ),
            &format!(
                "horizon free in [1, 100] = 20; elements 3; scheme radau_iia(2); lower timefreezing;
                 minimize final(time); final {{ q = {distance}; v = 0; }} {task}"
            ),
        );
        assert_eq!(found.history.events.len(), 2);
        found
    }

    /// Full power to `on` and on to `top`, as it is there, and full brakes to `off` and to rest.
    fn least(&self) -> f64 {
        let parts = [
            (0.0, self.on, 5.0),
            (self.on, self.top, 5.0 * self.power),
            (self.off, self.top, 5.0 * self.power),
            (0.0, self.off, 5.0),
        ];
        let time: f64 = parts.iter().map(|(low, high, a)| (high - low) / a).sum();
        let way = parts
            .iter()
            .map(|(low, high, a)| (high * high - low * low) / (2.0 * a));
        time + (self.distance - way.sum::<f64>()) / self.top
    }
}

/// 150 m: 3 s to 15 m/s, 2/3 s to 25 m/s, 1 s down to 10 m/s and 2 s to rest are 63 + 1/3 m.
const TURBO: Car = Car {
    on: 15.0,
    off: 10.0,
    top: 25.0,
    power: 3.0,
    distance: 150.0,
};

/// Without a guess a car first keeps to the speed at which the turbo would come, 13 s in the first case, which is a minimum,
/// too.
#[test]
fn a_turbo_with_memory_is_on_from_the_first_instant_to_the_last() {
    let other = Car {
        on: 12.0,
        off: 6.0,
        top: 22.0,
        power: 2.0,
        distance: 200.0,
    };
    for car in [TURBO, other] {
        costs(&car.drives("intervals 10 free;"), car.least(), 1e-7);
    }
}

/// With equal lengths L: full power for 3 L, with v = 15 + 15 (3 L - 3) then, 25 m/s at 4 L and until 7 L, v = 10 +
/// 15 (2 L - 2) at 8 L, and full brakes. That is 150 m where 135 L² - 55 L + 65 = 150. It costs as much from a guess
/// with the turbo off too late, which is a minimum of 15 s.
#[test]
fn events_go_where_other_intervals_are_better() {
    let length = (55.0 + 48925.0_f64.sqrt()) / 270.0;
    for guess in ["", "guess { u = 5*sign(9 - time); }"] {
        let found = TURBO.drives(&format!("intervals 10; {guess}"));
        costs(&found, 10.0 * length, 1e-6);
    }
}
