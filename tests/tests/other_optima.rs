//! Optima that no small change of one quantity alone shows: several controls change together, or a range is searched.

use nsd_tests::random::Random;
use nsd_tests::{optimum, solved_optimum};
use nsdc::report::Status;

fn objective(text: &str) -> f64 {
    let found = optimum(text, "o");
    assert_eq!(found.status, Status::Solved, "{text}\n{:?}", found.failure);
    found.objective.expect("it was minimized")
}

/// ∫ |x - c| of a line from a to b over h, with a and b relative to c.
fn distance(a: f64, b: f64, h: f64) -> f64 {
    match a * b < 0.0 {
        true => 0.5 * h * (a * a + b * b) / (a.abs() + b.abs()),
        false => 0.5 * h * (a + b).abs(),
    }
}

/// x' = u over N intervals of 1/N, ∫ w |x - c| + (x(1) - r)², by states at the ends of intervals.
struct Line {
    start: f64,
    n: usize,
    weight: f64,
    kink: f64,
    target: f64,
}

impl Line {
    fn random(numbers: &mut Random) -> Self {
        Line {
            start: numbers.rounded(-1.0, 1.0),
            n: 2 + numbers.below(3),
            weight: numbers.of(&[0.2, 1.0, 3.0]),
            kink: numbers.rounded(-1.0, 1.0),
            target: numbers.rounded(-1.0, 1.0),
        }
    }

    fn cost(&self, ends: &[f64]) -> f64 {
        let h = 1.0 / self.n as f64;
        let (mut last, mut sum) = (self.start - self.kink, 0.0);
        for x in ends {
            sum += self.weight * distance(last, x - self.kink, h);
            last = x - self.kink;
        }
        sum + (last + self.kink - self.target).powi(2)
    }

    /// By random steps that become smaller: the cost is convex.
    fn least(&self) -> f64 {
        let mut numbers = Random(7);
        let mut ends = vec![self.start; self.n];
        let (mut best, mut size) = (self.cost(&ends), 1.0);
        while size > 1e-9 {
            let mut has_fallen = false;
            for _ in 0..60 {
                let next: Vec<f64> = (ends.iter())
                    .map(|x| x + size * numbers.within(-1.0, 1.0))
                    .collect();
                let cost = self.cost(&next);
                if cost < best {
                    (best, ends, has_fallen) = (cost, next, true);
                }
            }
            size *= if has_fallen { 1.5 } else { 0.7 };
        }
        best
    }

    fn text(&self, rows: &str) -> String {
        let Line {
            start,
            n,
            weight,
            kink,
            target,
        } = self;
        format!(
            "model m {{ state x = {start:?}; control u in [-50, 50] = 0; x' = u; }}
             optimize o of m {{ horizon 1; intervals {n}; elements 3;
               minimize integral({weight:?}*abs(x - ({kink:?}))) + final((x - ({target:?}))^2); {rows} }}"
        )
    }
}

/// Where x rests on the kink all along an interval, moves of several controls cross it on the way.
#[test]
fn distances_have_their_minimum() {
    let mut numbers = Random(31);
    for _ in 0..8 {
        let line = Line::random(&mut numbers);
        let least = line.least();
        for rows in ["", "final { x <= 3; }"] {
            let text = line.text(rows);
            let found = objective(&text);
            assert!(found <= least + 1e-6, "{found}, not {least}: {text}");
        }
    }
}

/// x' = a x + b u with |x - c|, against smoothed programs whose smoothing falls to 3e-4. In the last one x crosses the kink in
/// the middle of the interval that it rests in.
#[test]
fn what_rests_on_a_kink_crosses_it_in_joint_moves() {
    let cases = [
        (
            "-0.3*x + u",
            0.0,
            2.0,
            3,
            "0.2*abs(x - 1.36)",
            "(x - 1.47)^2",
            "final { x <= 1.97; }",
            0.0925321,
        ),
        (
            "-0.3*x + 1.22*u",
            -0.27,
            1.0,
            3,
            "0.2*abs(x - 0.27)",
            "(x - 1.08)^2",
            "",
            0.043326,
        ),
        (
            "-0.22*x + 1.82*u",
            -0.76,
            2.0,
            4,
            "abs(x + 0.56)",
            "(x + 0.77)^2",
            "subject to { x <= 0.448; }",
            0.086073,
        ),
    ];
    for (rate, start, horizon, n, integral, last, rows, least) in cases {
        let text = format!(
            "model m {{ state x = {start:?}; control u in [-50, 50] = 0; x' = {rate}; }}
             optimize o of m {{ horizon {horizon:?}; intervals {n}; elements 3;
               minimize integral({integral}) + final({last}); {rows} }}"
        );
        let found = objective(&text);
        assert!(
            (found / least - 1.0).abs() < 1e-4,
            "{found}, not {least}: {text}"
        );
    }
}

/// x' = 2 - sign(x) from p: x(1) = p + 1 for p >= 0, and behind -3 it is p + 3. With (p - a)² + (x(1) - b)² the best p >= 0 is
/// the mean of a and b - 1.
#[test]
fn a_parameter_that_states_start_from_is_looked_for_in_its_range() {
    for unit in [1.0, 1e2, 1e-5, 1e4] {
        for (a, b, best) in [(0.17, 2.05, 0.3872), (-1.01, 2.94, 4.35125)] {
            let text = format!(
                "model m {{ param p in [{:?}, {:?}] = {:?}; state x = p; x' = {unit:?}*(2 - sign(x)); }}
                 optimize o of m {{ horizon 1; intervals 1; elements 3; free {{ p; }}
                   minimize {:?}*((p - ({:?}))^2 + final((x - ({:?}))^2)); }}",
                -2.0 * unit,
                2.0 * unit,
                -unit,
                1.0 / (unit * unit),
                a * unit,
                b * unit,
            );
            let found = objective(&text);
            assert!((found - best).abs() < 1e-6, "{unit}: {found}, not {best}");
        }
    }
}

/// A constraint that is not active changes nothing: 0.0033 is what a simulation with u = (0.1075, -0.0700) has.
#[test]
fn inequalities_do_not_end_the_search() {
    for rows in ["", "final { x <= 0.48; }"] {
        let text = format!(
            "model m {{ state x = 0; state v = -0.93; control u in [-2, 2] = 0; x' = v;
               v' = u - 5*deadzone(x + 0.51, 0.5); }}
             optimize o of m {{ horizon 4; intervals 2; elements 3; grid auto;
               minimize integral(0.1*u^2) + final(5*(x + 0.02)^2); {rows} }}"
        );
        let found = objective(&text);
        assert!(found < 0.00331, "{rows}: {found}");
    }
}

/// Without constraints any control has a run, and a solution: what loses its way begins at one.
#[test]
fn what_no_constraint_holds_is_feasible() {
    let sat = "model m { state x = 0.28; state v = -0.63; control u in [-1, 1] = 0; x' = v;
          v' = u + 2*sat(x - 0.18, 0, 1e3); }
        optimize o of m { horizon 2; intervals 2; elements 3; scheme radau_iia(4);
          minimize final(5*(x - 0.73)^2); }";
    assert!(objective(sat) < 1e-12);
    let steps = "model m { state x = 0; control u in [-20000, 20000] = 0;
          x' = 1000*(u/10000 - 0.95*sign(x + 0.048) + 0.3*sign(x - 0.052)); }
        optimize o of m { horizon 0.0001; intervals 3; elements 3;
          minimize 0.0001*(integral(1000*(u/10000)^2) + final(500*(x - 0.181)^2)); }";
    let natural = "model m { state x = 0; control u in [-2, 2] = 0;
          x' = u - 9.5*sign(x + 0.048) + 3*sign(x - 0.052); }
        optimize o of m { horizon 0.1; intervals 3; elements 3; minimize final((x - 0.181)^2); }";
    for text in [steps, natural] {
        objective(text);
    }
}

/// Constraints in any units: energies, charges and integrals are kept to a small part of themselves.
#[test]
fn constraints_are_kept_in_small_units() {
    for power in (-12..=0).step_by(2) {
        let c = 10.0_f64.powi(power);
        let limits = [
            format!("subject to {{ 0.5*{c:e}*x^2 <= 0.5*{c:e}; }}"),
            format!("final {{ {c:e}*x <= {c:e}; }}"),
            format!("final {{ {c:e}*(x^2 - 1) <= 0; }}"),
            format!("subject to {{ {c:e}*integral(u^2) <= {c:e}; }}"),
            // Beside one of ordinary size.
            format!("final {{ {c:e}*x <= {c:e}; x >= -3; }}"),
        ];
        for limit in limits {
            let text = format!(
                "model m {{ state x = 0; control u in [-3, 3] = 0; x' = u; }}
                 optimize o of m {{ horizon 1; intervals 2; elements 1; minimize -final(x); {limit} }}"
            );
            let found = solved_optimum(&text, "o");
            let objective = found.objective.expect("it was minimized");
            assert!((objective + 1.0).abs() < 1e-6, "{limit}: {objective}");
        }
    }
}

/// x' = u - a x - μ sign(x), the same at the end as at the start: at rest at p > 0 with u = a p + μ, where (p - r)² + R u² is
/// least, or at 0 with no control at all. These units of x and of time lose the first one to the second without a search on
/// the equation.
#[test]
fn periodic_motions_are_looked_for_on_their_equation() {
    let cases = [
        (1.15_f64, 0.87_f64, 1.0, 0.2, 4, [1e-4, 1e4], 0.5),
        (1.07, 1.58, 0.5, 0.39, 1, [1e4, 1e-2], 0.0),
        (0.74, 0.62, 0.1, 0.22, 4, [1e-4, 1e-2], 1.0),
        (0.82, 1.32, 0.5, 0.22, 4, [1e-4, 1e4], 1.0),
        (0.82, 1.32, 0.5, 0.22, 2, [1.0, 1.0], 0.0),
        // So much friction that rest is best.
        (0.5, 0.6, 0.5, 1.3, 2, [1e2, 1e-3], 1.0),
    ];
    for (a, r, weight, mu, n, [x, time], guess) in cases {
        let p: f64 = ((r - weight * a * mu) / (1.0 + weight * a * a)).max(0.0);
        let moving = (p - r).powi(2) + weight * (a * p + mu).powi(2);
        let least = moving.min(r * r);
        let u = x / time;
        let text = format!(
            "model m {{ param p in [{:?}, {:?}] = {:?}; state x = p; control u in [{:?}, {:?}] = 0;
               x' = u - {:?}*x - {:?}*sign(x); }}
             optimize o of m {{ horizon {time:?}; intervals {n}; elements 3; free {{ p; }}
               minimize {:?}*integral({:?}*(x - {:?})^2 + {:?}*u^2); final {{ x = p; }} }}",
            -5.0 * x,
            5.0 * x,
            guess * x,
            -9.0 * u,
            9.0 * u,
            a / time,
            mu * u,
            1.0 / time,
            1.0 / (x * x),
            r * x,
            weight / (u * u),
        );
        let found = objective(&text);
        assert!(
            (found / least - 1.0).abs() < 1e-4,
            "{found}, not {least}: {text}"
        );
    }
}

/// From rest a push of μ_static slides at once. With less there is a motion as well, which sticking does not end in: that a
/// program has it, with a smaller objective and without a simulation, is no reason to take it.
#[test]
fn what_no_simulation_follows_is_not_taken() {
    let text = "use std.friction.{stiction};
        model m { state x = 0; state v = 0; control u in [-2, 2] = 0;
          part floor = stiction { slip = v; mu = 0.2; mu_static = 0.5; }
          x' = v; v' = u + floor.force; }
        optimize o of m { horizon 4; intervals 2; elements 6; controls linear; final { x = 1; }
          guess { u = 0.5*time; } minimize integral(u^2); }";
    let found = solved_optimum(text, "o");
    let codes: Vec<&str> = found.warnings.iter().map(|w| w.code.as_str()).collect();
    assert!(!codes.contains(&"W0709"), "{codes:?}");
}

/// What controls of few intervals do, those of more do as well, which they are made of. In the first one a gain is far away
/// from where doing nothing is best, in the second one a belt is dear to be in.
#[test]
fn more_intervals_are_no_worse() {
    let gain = "model m { state x = 0; control u in [-1, 1] = 0; x' = u - 0.3*x; }
        optimize o of m { horizon 4; intervals N; elements 3; scheme radau_iia(4);
          minimize integral(if x > 1.12 then -0.2 else 0) + final(5*(x + 0.72)^2); }";
    let belt = "model m { state x = 0; control u in [-5, 5] = 0;
          x' = (if x > 0.47 and x < 0.97 then 0.2*u else u); }
        optimize o of m { horizon 4; intervals N; elements 3; scheme radau_iia(4);
          minimize integral(0.1*u^2 + (if x > 0.47 and x < 0.97 then 0.93 else 0)) + final(5*(x - 1.45)^2);
          final { x <= 1.95; } }";
    for (text, few, most) in [(gain, 2, -0.1735), (belt, 4, 1.5887)] {
        let on = |n: usize| objective(&text.replace('N', &n.to_string()));
        let (few, many) = (on(few), on(8));
        assert!(few < most, "{few}: {text}");
        // What is found first ends the search where no more than this is to be gained.
        let none = 3e-4 * few.abs() + 1e-5;
        assert!(many < few + none, "{many} with more than {few}: {text}");
    }
}
