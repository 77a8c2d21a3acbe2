//! Friction in two directions by finite elements with jumps between them (`lower impact`), against closed forms.

use nsd_tests::bodies::Body;
use nsd_tests::{assert_near, end, solved, times, with_experiment};
use nsdc::lowering::dcs;
use nsdc::report::{EventKind, Trajectory};

fn text(body: &Body, horizon: f64, method: &str) -> String {
    let model = body.model();
    format!(
        "{model}
         simulate o of m {{ horizon {horizon:?}; lower impact; method fesd {{ {method} }} }}"
    )
}

fn run(body: &Body, horizon: f64, method: &str) -> Trajectory {
    solved(&text(body, horizon, method), "o")
}

/// The directions of slip of a scene: along the axes, and turned.
const TURNS: [f64; 3] = [0.0, 0.9, -2.3];

/// Three Gauss-Radau points, four elements in each of eight steps.
const GRID: &str = "scheme = radau_iia(3); steps = 8; elements = 4;";

/// It falls √0.2; the impact takes μ √20 of the tangential speed, and friction the rest at the rate μ g, along one line.
#[test]
fn a_ball_strikes_slides_and_stops() {
    let (g, mu): (f64, f64) = (10.0, 0.2);
    let fall = (2.0 / g).sqrt();
    let speed = 5_f64.sqrt();
    let after = speed - mu * g * fall;
    let path = speed * fall + after * after / (2.0 * mu * g);
    for turned in TURNS {
        let ball = Body {
            q: [0.0, 0.0, 1.0],
            v: [2.0, 1.0, 0.0],
            force: [0.0, 0.0, -g],
            friction: mu,
            restitution: 0.0,
            turned,
        };
        let found = run(&ball, 2.0, GRID);
        assert_near(
            &end(&found, "q"),
            &[path * 2.0 / speed, path / speed, 0.0],
            1e-12,
        );
        assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
        assert_near(&times(&found, EventKind::Jump), &[fall], 1e-12);
        assert_near(
            &times(&found, EventKind::Stick),
            &[fall + after / (mu * g)],
            1e-12,
        );
    }
}

/// A constant pull along x bends the path of a block that slides along y, until it stops and sticks: with
/// k = μ g/f and τ from 1 down to 0, v_y = C τ^k, v_x = (C/2)(τ^(k-1) - τ^(k+1)), which is x* = C²/(4f (k² - 1)) and
/// y* = (C²/2f) 4k/(4k² - 1) at t* = C k/(f (k² - 1)).
#[track_caller]
fn bends(k: f64, method: &str, [of_place, of_time]: [f64; 2]) {
    let (f, c): (f64, f64) = (2.0, 3.0);
    let x = c * c / (4.0 * f * (k * k - 1.0));
    let y = c * c / (2.0 * f) * 4.0 * k / (4.0 * k * k - 1.0);
    for turned in TURNS {
        let block = Body {
            q: [0.0; 3],
            v: [0.0, c, 0.0],
            force: [f, 0.0, -10.0],
            friction: k * f / 10.0,
            restitution: 0.0,
            turned,
        };
        let found = run(&block, 1.5, method);
        assert_near(&end(&found, "q"), &[x, y, 0.0], of_place);
        assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
        let stops = c * k / (f * (k * k - 1.0));
        assert_near(&times(&found, EventKind::Stick), &[stops], of_time);
    }
}

#[test]
fn a_path_that_bends_ends_smoothly() {
    bends(2.0, GRID, [1e-8, 1e-9]);
    bends(
        2.0,
        "scheme = radau_iia(5); steps = 8; elements = 3;",
        [1e-12, 1e-12],
    );
}

/// Near its end v_y is a power 3/2 of the time that is left.
#[test]
fn a_path_that_bends_ends_with_a_root() {
    bends(3.0, "steps = 50;", [2e-8, 1e-6]);
}

/// On a tilted plane, which pulls by 3 and 1 along no axis.
fn tilted(friction: f64, turned: f64) -> Body {
    Body {
        q: [0.0; 3],
        v: [0.0; 3],
        force: [3.0, 1.0, -10.0],
        friction,
        restitution: 0.0,
        turned,
    }
}

#[test]
fn a_block_sticks_below_the_angle_of_friction() {
    for turned in TURNS {
        let found = run(&tilted(0.4, turned), 1.5, GRID);
        assert_near(&end(&found, "q"), &[0.0; 3], 1e-12);
        assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
        assert_eq!(found.history.modes.len(), 1);
        assert_eq!(found.history.modes[0].mode, "stick(floor)");
    }
}

/// It slides straight down, at the rate √10 - μ g.
#[test]
fn a_block_slides_down_from_rest_above_it() {
    let (mu, t): (f64, f64) = (0.2, 1.5);
    let pull = 10_f64.sqrt();
    let rate = (pull - mu * 10.0) / pull;
    for turned in TURNS {
        let found = run(&tilted(mu, turned), t, GRID);
        let [x, y] = [3.0, 1.0].map(|share| rate * share);
        assert_near(
            &end(&found, "q"),
            &[x * t * t / 2.0, y * t * t / 2.0, 0.0],
            1e-12,
        );
        assert_near(&end(&found, "v"), &[x * t, y * t, 0.0], 1e-12);
    }
}

/// It slides along one line against a pull that is stronger than friction: it comes to rest at once only, and slides back.
#[test]
fn a_block_that_is_pulled_back_turns_round_at_rest() {
    let (pull, friction, t): (f64, f64, f64) = (3.0, 1.0, 1.0);
    // No instant of rest is in the middle of a step, or where it has equal elements.
    for (speed, steps, elements) in [(1.0, 5, 3), (0.9, 5, 3), (0.9, 4, 4), (1.3, 3, 2)] {
        let rest = speed / (pull + friction);
        let back = pull - friction;
        let place = 0.5 * speed * rest - 0.5 * back * (t - rest) * (t - rest);
        for turned in TURNS {
            let (s, c) = 0.4_f64.sin_cos();
            let along = |length: f64| [c * length, s * length, 0.0];
            let block = Body {
                q: [0.0; 3],
                v: along(speed),
                force: [-c * pull, -s * pull, -10.0],
                friction: friction / 10.0,
                restitution: 0.0,
                turned,
            };
            let grid = format!("scheme = radau_iia(3); steps = {steps}; elements = {elements};");
            let found = run(&block, t, &grid);
            assert_near(&end(&found, "q"), &along(place), 1e-12);
            assert_near(&end(&found, "v"), &along(-back * (t - rest)), 1e-12);
            assert!(
                found
                    .quality
                    .error_estimate
                    .is_some_and(|error| error <= 1e-12)
            );
            assert_eq!(found.history.modes.len(), 1, "it slips all the time");
        }
    }
}

/// Thrown along one line with a pull against it, slip turns round in flight, at or before the impact, which takes at most
/// μ (1 + e) √(2gh) of it.
#[test]
fn slip_turns_round_in_flight() {
    let (g, h, e, t): (f64, f64, f64, f64) = (10.0, 0.5, 0.8, 0.6);
    let fall = (2.0 * h / g).sqrt();
    for (speed, pull, mu) in [(0.2, 1.0, 0.01), (1.0, 1.0, 0.5), (0.4, 2.0, 0.1)] {
        let before = speed - pull * fall;
        let most = mu * (1.0 + e) * g * fall;
        let (after, left) = (before - before.clamp(-most, most), t - fall);
        let place = (speed - 0.5 * pull * fall) * fall + (after - 0.5 * pull * left) * left;
        for turned in TURNS {
            let (s, c) = 0.4_f64.sin_cos();
            let along = |length: f64, up: f64| [c * length, s * length, up];
            let ball = Body {
                q: [0.0, 0.0, h],
                v: along(speed, 0.0),
                force: along(-pull, -g),
                friction: mu,
                restitution: e,
                turned,
            };
            let found = run(&ball, t, GRID);
            let up = e * g * fall - 0.5 * g * left;
            assert_near(&end(&found, "q"), &along(place, up * left), 1e-10);
            let up = e * g * fall - g * left;
            assert_near(&end(&found, "v"), &along(after - pull * left, up), 1e-10);
        }
    }
}

/// It passes rest at a distance: with k = μ g/f < 1 and τ from 4 down, v_y = C τ^k and v_x = (C/2)(τ^(k-1) - τ^(k+1)),
/// which turns from -x to x about τ = 1. For k = 1/2, t = (C/2f)(2 (τ^(-1/2) - τ₀^(-1/2)) + ⅔(τ₀^(3/2) - τ^(3/2))),
/// x = (C²/4f)(1/τ - 1/τ₀ + ⅓(τ³ - τ₀³)) and y = (C²/2f)(ln(τ₀/τ) + ½(τ₀² - τ²)).
#[test]
fn a_block_that_all_but_stops_turns_round() {
    let (f, c, first): (f64, f64, f64) = (2.0, 0.1, 4.0);
    let last: f64 = 1.0 / 64.0;
    let velocity = |tau: f64| [0.5 * c * (tau.powf(-0.5) - tau.powf(1.5)), c * tau.sqrt()];
    let t = c / (2.0 * f)
        * (2.0 * (last.powf(-0.5) - first.powf(-0.5))
            + (first.powf(1.5) - last.powf(1.5)) * 2.0 / 3.0);
    let x = c * c / (4.0 * f) * (1.0 / last - 1.0 / first + (last.powi(3) - first.powi(3)) / 3.0);
    let y = c * c / (2.0 * f) * ((first / last).ln() + 0.5 * (first * first - last * last));
    let [[a, b], [v, w]] = [velocity(first), velocity(last)];
    for turned in TURNS {
        let block = Body {
            q: [0.0; 3],
            v: [a, b, 0.0],
            force: [f, 0.0, -10.0],
            friction: 0.5 * f / 10.0,
            restitution: 0.0,
            turned,
        };
        let chosen = ("", 1e-8);
        let own = (turned == TURNS[1]).then_some(chosen);
        for (grid, within) in [(GRID, 1e-3)].into_iter().chain(own) {
            let found = run(&block, t, grid);
            assert_near(&end(&found, "q"), &[x, y, 0.0], within);
            assert_near(&end(&found, "v"), &[v, w, 0.0], within);
        }
    }
}

/// Where the direction of slip turns like a root of the time that is left, the end of slip is less well known than what
/// the block does until then: the estimate says how well.
#[test]
fn the_estimate_is_one_of_the_end_of_slip_too() {
    let (f, c, k): (f64, f64, f64) = (1.0, 1.0, 3.0);
    let stops = c * k / (f * (k * k - 1.0));
    let block = Body {
        q: [0.0; 3],
        v: [0.0, c, 0.0],
        force: [f, 0.0, -10.0],
        friction: k * f / 10.0,
        restitution: 0.0,
        turned: 0.0,
    };
    for steps in [10, 50, 100] {
        let found = run(&block, 1.0, &format!("steps = {steps};"));
        let estimate = found.quality.error_estimate.expect("there are two runs");
        let error = (times(&found, EventKind::Stick)[0] - stops).abs();
        assert!(error <= 2.0 * estimate, "{error:e} is above {estimate:e}");
        assert!(error >= 0.2 * estimate, "{error:e} is below {estimate:e}");
    }
}

/// The slip velocity of a ball that spins keeps its direction, and falls by (1 + 5/2) μ g: the ball runs along a parabola
/// until it rolls.
#[test]
fn a_billiard_ball_runs_along_a_parabola() {
    let (g, mu, r, mass) = (9.81, 0.2, 0.03, 0.17);
    let (v, spin) = ([1.0, 0.5, 0.0], [30.0, -20.0, 10.0]);
    let slip: [f64; 2] = [v[0] - r * spin[1], v[1] + r * spin[0]];
    let speed = slip[0].hypot(slip[1]);
    let rolls = 2.0 * speed / (7.0 * mu * g);
    let t = 1.0;
    for method in [
        "",
        "steps = 7;",
        "scheme = radau_iia(2); steps = 3; elements = 3;",
    ] {
        let text = format!(
            "model billiard {{
               state q[3] = [0, 0, 0];
               state turned[3] = [0, 0, 0];
               state v[3] = {v:?};
               state w[3] = {spin:?};
               q' = v;
               turned' = w;
               mechanics q, v {{ mass = {mass}; force = [0, 0, -{mass}*{g}]; }}
               mechanics turned, w {{ mass = 0.4*{mass}*{r}^2; force = [0, 0, 0]; }}
               contact cloth {{
                 gap = q[3]; restitution = 0; friction = {mu};
                 slip = [v[1] - {r}*w[2], v[2] + {r}*w[1]];
               }}
             }}
             simulate o of billiard {{ horizon {t}; lower impact; method fesd {{ {method} }} }}"
        );
        let found = solved(&text, "o");
        assert_near(&times(&found, EventKind::Stick), &[rolls], 1e-12);
        let behind = [0, 1].map(|k| v[k] - slip[k] / 3.5);
        // It slips with the deceleration 2/7 slip/rolls.
        let place = [0, 1].map(|k| behind[k] * t + slip[k] / 7.0 * rolls);
        assert_near(&end(&found, "v"), &[behind[0], behind[1], 0.0], 1e-12);
        assert_near(&end(&found, "q"), &[place[0], place[1], 0.0], 1e-12);
        let rolling = [-behind[1] / r, behind[0] / r, spin[2]];
        assert_near(&end(&found, "w"), &rolling, 1e-11);
    }
}

#[test]
fn printed_form() {
    let text = "model m {
           state q[3] = [0, 0, 1];
           state v[3] = [2, 1, 0];
           q' = v;
           mechanics q, v {
             mass = eye(3);
             force = [0, 0, -10];
             contact floor { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = 0.2; }
           }
         }
         simulate o of m { horizon 2; lower impact; method fesd; }";
    with_experiment(text, "o", |compiled| {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let dcs = dcs::lower(system, &settings.numerics.lowerings).expect("contacts give impulses");
        dcs.verify().expect("the invariants of `Dcs`");
        insta::assert_snapshot!("impulses_space_dcs", dcs);
    });
}
