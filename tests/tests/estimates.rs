//! The estimated error against the true one, for every model with a closed form.
//!
//! At every tolerance the estimate is at least a tenth of the largest error of a state at a reported
//! instant, relative to the largest magnitude of that state.

use std::f64::consts::{LN_2, PI, SQRT_2};

use nalgebra::{DMatrix, DVector};
use nsd_tests::affine::{Affine, Form, Kind, Surface, exact};
use nsd_tests::{end, larger, run, with_experiment};
use nsdc::report::{Status, Trajectory};
use nsdc::simulate::{self, Request};

const BRANICKY: &str = include_str!("../../examples/branicky.nsd");
const CHAIN: &str = include_str!("../../examples/friction_chain.nsd");
const CONTINUOUS: &str = include_str!("../../examples/continuous.nsd");
const FRICTION: &str = include_str!("../../stdlib/friction.nsd");
const GENES: &str = include_str!("../../examples/two_gene_network.nsd");
const INTERSECTIONS: &str = include_str!("../../examples/intersections.nsd");
const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");
const PARTS: &str = include_str!("../../examples/parts.nsd");
const RELAY: &str = include_str!("../../stdlib/relay.nsd");
const STICK_SLIP: &str = include_str!("../../examples/stick_slip.nsd");
const STICTION: &str = include_str!("../../examples/stiction.nsd");
const SWITCHING: &str = include_str!("../../examples/switching_cases.nsd");
const WALL: &str = include_str!("../../examples/impact_like.nsd");

/// Units in the last place that the closed form, evaluated in floating point, may be off by itself.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Checks one experiment at tolerances from 1e-4 to 1e-12; `exact` gives all reported states. The
/// error is below the tolerance, or there is a warning.
fn check(text: &str, experiment: &str, exact: impl Fn(f64) -> Vec<f64>) {
    check_estimate(text, experiment, exact, |trajectory, tolerance, error| {
        assert!(
            error <= tolerance || !trajectory.warnings.is_empty(),
            "{experiment} at {tolerance:e}: error {error:e} without a warning"
        );
    });
}

/// Checks the estimate alone; `also` sees every trajectory with its tolerance and its error.
fn check_estimate(
    text: &str,
    experiment: &str,
    exact: impl Fn(f64) -> Vec<f64>,
    also: impl Fn(&Trajectory, f64, f64),
) {
    with_experiment(text, experiment, |compiled| {
        for k in 4..=12 {
            let mut settings = compiled.settings.clone();
            settings.numerics.tolerance = 10.0_f64.powi(-k);
            let trajectory = simulate::run(&compiled.system, &settings, &Request::default());
            assert!(trajectory.failure.is_none(), "{experiment} at 1e-{k}");
            let error = error(&trajectory, &exact);
            let estimate = trajectory.quality.error_estimate.unwrap_or(0.0);
            assert!(
                error <= 10.0 * estimate + ROUNDING,
                "{experiment} at 1e-{k}: error {error:e}, estimate {estimate:e}"
            );
            also(&trajectory, settings.numerics.tolerance, error);
        }
    });
}

fn check_model(statements: &str, horizon: f64, exact: impl Fn(f64) -> Vec<f64>) {
    let text = format!("model m {{ {statements} }}\nsimulate run of m {{ horizon {horizon}; }}");
    check(&text, "run", exact);
}

/// Largest error at a reported instant, relative to the largest magnitude of each state, also between
/// these instants; states that are zero throughout have nothing to be relative to.
fn error(trajectory: &Trajectory, exact: impl Fn(f64) -> Vec<f64>) -> f64 {
    let n = trajectory.samples.n_states();
    let (mut error, mut scale) = (vec![0.0_f64; n], vec![0.0_f64; n]);
    for (k, &t) in trajectory.samples.time.iter().enumerate() {
        let exact = exact(t);
        let found = trajectory
            .samples
            .states
            .iter()
            .flat_map(|series| series.at(k));
        assert_eq!(exact.len(), n);
        for (i, (x, exact)) in found.zip(exact).enumerate() {
            error[i] = larger(error[i], (x - exact).abs());
            scale[i] = scale[i].max(exact.abs());
        }
    }
    for pair in trajectory.samples.time.windows(2) {
        for share in [0.25, 0.5, 0.75] {
            let exact = exact(pair[0] + share * (pair[1] - pair[0]));
            for (scale, x) in scale.iter_mut().zip(exact) {
                *scale = scale.max(x.abs());
            }
        }
    }
    let relative = error.iter().zip(&scale).filter(|(_, scale)| **scale > 0.0);
    relative
        .map(|(error, scale)| error / scale)
        .fold(0.0, f64::max)
}

#[test]
fn crossing_the_unit_circle() {
    check(OSCILLATOR, "crossing", |t| {
        let (radius, angle) = ((t - 1.0).exp(), 2.0 * PI * (t - 1.0).abs());
        vec![radius * angle.cos(), radius * angle.sin()]
    });
}

#[test]
fn sliding_on_curved_intersections() {
    let radius = |t: f64| (t - 0.5).min(0.0).exp();
    let turning = move |t: f64, released: f64| {
        let s = 0.5 * (t - released).max(0.0).powi(2);
        let radius = radius(t) / s.cosh();
        [radius * t.cos(), radius * t.sin(), s.tanh()]
    };
    check(INTERSECTIONS, "codimension_two", move |t| {
        turning(t, 1.0).to_vec()
    });
    check(INTERSECTIONS, "codimension_three", move |t| {
        let [x, y, z] = turning(t, 1.35);
        vec![x, y, z, 0.0]
    });
    check(INTERSECTIONS, "product_selection", |t| {
        let x = (-0.3 + 1.5 * t).min(0.0);
        let y = (0.5 - t).max(0.0);
        vec![x, y, -t.min(0.2) + 0.5 * (t.min(0.5) - 0.2).max(0.0)]
    });
}

#[test]
fn the_ways_to_meet_a_surface() {
    let sliding = |t: f64| 0.5 - t + 0.04 * (1.0 - (5.0 * t).cos());
    let simple = [
        (
            "cross",
            &(|t: f64| {
                if t < 1.0 / 3.0 {
                    3.0 * t - 1.0
                } else {
                    t - 1.0 / 3.0
                }
            }) as &dyn Fn(f64) -> f64,
        ),
        ("slide", &|t| {
            if t > 0.6 { 0.0 } else { sliding(t).max(0.0) }
        }),
        ("leave", &|t| 0.5 * (t - 1.0).max(0.0).powi(2)),
        ("switch", &|t| {
            if t < 1.0 / 3.0 {
                3.0 * t - 1.0
            } else {
                t - 1.0 / 3.0
            }
        }),
        ("stay", &|t| (3.0 * t - 1.0).min(0.0)),
        ("simplest", &|t| {
            if t < 0.5 {
                2.0 * t - 1.0
            } else {
                0.2 * (t - 0.5)
            }
        }),
        ("arrives", &|t| (t - SQRT_2).min(0.0)),
        ("uneven", &|t| (t - SQRT_2).min(0.0)),
        ("passes", &|t| {
            if t < SQRT_2 {
                t - SQRT_2
            } else {
                3.0 * (t - SQRT_2)
            }
        }),
        ("upwards", &|t| t),
        ("downwards", &|t| -t),
    ];
    for (experiment, exact) in simple {
        check(SWITCHING, experiment, |t| vec![exact(t)]);
    }
}

#[test]
fn kinks() {
    check(CONTINUOUS, "a", |t| {
        vec![if t < 1.0 { t - 1.0 } else { (t - 1.0).exp_m1() }]
    });
    check(CONTINUOUS, "b", |t| {
        vec![if t < LN_2 {
            1.0 - 2.0 * (-t).exp()
        } else {
            (t - LN_2).exp_m1()
        }]
    });
    check(CONTINUOUS, "c", |t| {
        vec![if t < LN_2 {
            2.0 - 2.0 * (-t).exp()
        } else {
            1.0 + t - LN_2
        }]
    });
}

/// A free fall, half a damped period in the wall, and a free flight.
#[test]
fn a_wall_of_springs() {
    let (a, k, c) = (10.0, 1000.0, 5.0_f64);
    let (t1, v1) = (0.1_f64.sqrt(), -a * 0.1_f64.sqrt());
    let (decay, omega) = (0.5 * c, (k - 0.25 * c * c).sqrt());
    // x'' + c x' + k x = 0
    let inside = move |t: f64| {
        let (envelope, angle) = ((-decay * t).exp(), omega * t);
        let x = v1 / omega * envelope * angle.sin();
        [x, v1 * envelope * angle.cos() - decay * x]
    };
    let t2 = t1 + PI / omega;
    let v2 = inside(PI / omega)[1];
    check(WALL, "exact", move |t| {
        if t < t1 {
            vec![0.5 - 0.5 * a * t * t, -a * t]
        } else if t < t2 {
            inside(t - t1).to_vec()
        } else {
            let t = t - t2;
            vec![v2 * t - 0.5 * a * t * t, v2 - a * t]
        }
    });
}

#[test]
fn relaxing_to_thresholds() {
    let relaxes = |t: f64, start: f64, gamma: f64| {
        let rest = 40.0 / gamma;
        (rest + (start - rest) * (-gamma * t).exp()).min(8.0)
    };
    for (experiment, start) in [("both_thresholds", 6.0), ("from_below", 5.0)] {
        check(GENES, experiment, |t| {
            vec![relaxes(t, start, 4.5), relaxes(t, start, 1.5)]
        });
    }
}

/// Each quadrant takes a quarter of the period of its ellipse, which is left along an axis.
#[test]
fn growth_from_two_decays() {
    let omega = 10.0_f64.sqrt();
    let turn = move |x: [f64; 2], t: f64, long_first: bool| {
        let (cosine, sine, decay) = ((omega * t).cos(), (omega * t).sin(), (-t).exp());
        let stretch = if long_first { omega } else { 1.0 / omega };
        [
            decay * (cosine * x[0] + stretch * sine * x[1]),
            decay * (cosine * x[1] - sine * x[0] / stretch),
        ]
    };
    let first = 10.0_f64.sqrt().atan() / omega;
    let quarter = 0.5 * PI / omega;
    check(BRANICKY, "growth", move |t| {
        let mut x = turn([1e-6, 1e-6], t.min(first), true);
        let mut left = t - first;
        let mut long_first = false;
        while left > 0.0 {
            x = turn(x, left.min(quarter), long_first);
            left -= quarter;
            long_first = !long_first;
        }
        x.to_vec()
    });
}

#[test]
fn the_standard_library() {
    check(FRICTION, "stops_at_rest", |t| {
        vec![(1.0 - 0.5 * t).max(0.0)]
    });
    check(FRICTION, "slows_down", |t| vec![(-2.0 * t).exp()]);
    check(RELAY, "reaches_zero", |t| vec![(1.0 - 2.0 * t).max(0.0)]);
    check(RELAY, "stops_at_the_edge", |t| vec![(1.0 - t).max(0.4)]);
}

#[test]
fn parts_that_come_to_rest() {
    let slides = |t: f64, speed: f64, grip: f64| {
        let t = t.min(speed / grip);
        speed * t - 0.5 * grip * t * t
    };
    check(PARTS, "to_rest", |t| {
        vec![slides(t, 1.0, 0.3 * 9.81), slides(t, 2.0, 0.5 * 9.81)]
    });
}

/// Slips about x = mu, is caught at half the speed that has no friction, and slips again.
#[test]
fn sticking_to_a_belt() {
    let (mu, speed) = (0.4, 0.2);
    let caught = PI / 6.0;
    let at = mu * (1.0 - caught.cos());
    let released = caught + (mu - at) / speed;
    check(STICK_SLIP, "coulomb", move |t| {
        if t < caught {
            vec![mu * (1.0 - t.cos()), mu * t.sin()]
        } else if t < released {
            vec![at + speed * (t - caught), speed]
        } else {
            let t = t - released;
            vec![mu + speed * t.sin(), speed * t.cos()]
        }
    });
}

/// Against the products of matrix exponentials.
#[test]
fn friction() {
    let belt = Affine {
        n: 2,
        field: DMatrix::from_row_slice(2, 4, &[0.0, 1.0, -1.0, 0.0, -1.0, -0.3, 0.3, 0.0]),
        surfaces: vec![rubs(2, 1, 1.0)],
        start: DVector::from_row_slice(&[2.4, 1.0]),
        horizon: 40.0,
        form: Form::Terms,
    };
    let solution = exact::solve(&belt);
    check(STICTION, "coulomb", |t| {
        solution.state(t).as_slice().to_vec()
    });

    let (blocks, stiffness) = (6, 30.0 / 0.5);
    let mut field = DMatrix::zeros(12, 14);
    for i in 0..blocks {
        field[(i, blocks + i)] = 1.0;
        for j in [i.wrapping_sub(1), i + 1] {
            if j < blocks {
                field[(blocks + i, j)] += stiffness;
                field[(blocks + i, i)] -= stiffness;
            }
        }
    }
    let chain = Affine {
        n: 2 * blocks,
        field,
        surfaces: (0..blocks)
            .map(|i| rubs(12, blocks + i, 0.2 * 9.81))
            .collect(),
        start: DVector::from_fn(12, |i, _| {
            if i < blocks {
                0.0
            } else {
                0.4 * (i - blocks + 1) as f64
            }
        }),
        horizon: 2.0,
        form: Form::Terms,
    };
    let solution = exact::solve(&chain);
    assert_eq!(solution.end, exact::End::Horizon);
    check(CHAIN, "to_rest", |t| solution.state(t).as_slice().to_vec());
}

/// x_i' = .. - force sign(x_i)
fn rubs(n: usize, i: usize, force: f64) -> Surface {
    let mut normal = DVector::zeros(n + 2);
    let mut jump = DMatrix::zeros(n, n + 2);
    normal[i] = 1.0;
    jump[(i, n)] = -force;
    Surface {
        normal,
        jump,
        kind: Kind::Jump,
    }
}

#[test]
fn forced_and_fast() {
    check_model("state x = 0; x' = sign(sin(time));", 300.0, |t| {
        let phase = t % (2.0 * PI);
        vec![PI - (phase - PI).abs()]
    });
    check_model("state x = 0; x' = time^60;", 1.0, |t| {
        vec![t.powi(61) / 61.0]
    });
    check_model("state x = 0; x' = 5*time^4*exp(time^5);", 1.2, |t| {
        vec![t.powi(5).exp_m1()]
    });
    check_model("state x = 1; x' = x^2;", 0.999, |t| vec![1.0 / (1.0 - t)]);
    check_model("state x = 1; x' = -1/x;", 0.4999, |t| {
        vec![(1.0 - 2.0 * t).sqrt()]
    });
    check_model("state x = 1; state v = 0; x' = v; v' = -x;", 2000.0, |t| {
        vec![t.cos(), -t.sin()]
    });
    // An unstable state that must be zero: errors grow as e^t.
    check_model("state x = 1; x' = x - 2*exp(-time);", 15.0, |t| {
        vec![(-t).exp()]
    });
    check_model(
        "state x = 0; x' = 1 - 2*step(max(x - 0.5, 0.2*time - 0.3));",
        4.0,
        |t| vec![t.min(0.5) - (t - 1.5).max(0.0)],
    );
}

/// Every step ends at zero: flights between two stays on the surface.
#[test]
fn a_state_that_is_zero_whenever_it_is_looked_at() {
    // Leaves when 1.5 sin t = 1.
    let leaves = (2.0_f64 / 3.0).asin();
    let flight = move |t: f64| (1.5 * (leaves.cos() - t.cos()) - (t - leaves)).max(0.0);
    let statements = "state x = 0; x' = 1.5*sin(time) - sign(x);";
    // Half a period later the same happens below.
    check_model(statements, 500.0, move |t| {
        let k = ((t - leaves) / PI).floor();
        let side = if k % 2.0 == 0.0 { 1.0 } else { -1.0 };
        let since = t - k * PI;
        let before = if k > 0.0 { flight(since + PI) } else { 0.0 };
        vec![if k < 0.0 {
            0.0
        } else {
            side * (flight(since) - before)
        }]
    });
}

/// At small angles, what rounding does to the time of an event is the error.
#[test]
fn crossings_that_are_hardly_any() {
    for k in [3, 6, 9, 10, 12] {
        let rate = 10.0_f64.powi(-k);
        let start = -1.0 - rate;
        let statements = format!(
            "state w = 0; state y = {start:e}; w' = step(y); y' = 3*(time - 1)^2 + {rate:e};"
        );
        check_model(&statements, 2.0, |t| {
            vec![(t - 1.0).max(0.0), (t - 1.0).powi(3) + rate * (t - 1.0)]
        });
    }
    for k in [3, 6, 9, 11, 13] {
        let start = 1.0 - 10.0_f64.powi(-k);
        let half = (1.0 - start).sqrt();
        let statements =
            format!("state w = 0; state y = {start}; w' = step(y); y' = 2*(time - 1);");
        check_model(&statements, 2.0, |t| {
            let below = (t - 1.0).clamp(-half, half) + half;
            vec![t - below, (t - 1.0).powi(2) - half * half]
        });
    }
}

/// Elements have no order beside a root: the finer run is not much better there.
#[test]
fn an_estimate_covers_the_error_beside_a_root() {
    for (power, start, rate, factor, horizon) in [
        (0.5_f64, 0.91, 1.86, 0.78, 1.0215),
        (0.25, 0.35, 1.1, 2.2, 0.3200),
        (0.75, 0.66, 1.5, 1.3, 0.4405),
        (1.5, 0.91, 1.86, 0.78, 1.0215),
    ] {
        let text = format!(
            "model m {{ state x = -{start:?}; state y = 0; x' = {rate:?}; y' = {factor:?}*abs(x)^({power:?}); }}
             simulate run of m {{ horizon {horizon:?}; method fesd; }}"
        );
        let area = |x: f64| x.signum() * x.abs().powf(power + 1.0) / (power + 1.0);
        let exact = |t: f64| {
            let x = rate * t - start;
            vec![x, factor / rate * (area(x) - area(-start))]
        };
        check(&text, "run", exact);
    }
}

/// A ball that falls for √2 and leaves with half of its speed, far from zero and in frozen time: when it strikes is known
/// to the rounding of its height, and so is its speed.
#[test]
fn elements_know_what_rounding_does_to_an_impact() {
    for offset in [1e3, 1e6, 1e9, 1e12] {
        let found = run(
            &format!(
                "model ball {{ param B = {offset:e}; state h = B + 1; state v = 0; h' = v;
                   mechanics h, v {{ mass = 1; force = -1; contact floor {{ gap = h - B; restitution = 0.5; }} }} }}
                 simulate falls of ball {{ horizon 2; method fesd; lower timefreezing; }}"
            ),
            "falls",
        );
        let exact = 1.5 * SQRT_2 - 2.0;
        let error = (end(&found, "v")[0] - exact).abs() / SQRT_2;
        let estimate = found.quality.error_estimate.unwrap_or(0.0);
        assert!(
            error <= estimate + ROUNDING,
            "{offset:e}: error {error:e}, estimate {estimate:e}"
        );
        assert!(
            error <= 1e-8 || !found.warnings.is_empty(),
            "{offset:e}: error {error:e} without a warning"
        );
    }
}

#[test]
fn steps_are_told_where_twice_as_many_fail() {
    // A peak beyond all numbers at y = 1/2, where no node of one step is and the first of two steps ends.
    let text = "model m { state x = 0; state y = 0; y' = 1; x' = 1 + exp(1000 - 1e6*(y - 0.5)^2); }
         simulate s of m { horizon 1; method timestepping { steps = 1; } }";
    let found = run(text, "s");
    assert_eq!(found.status, Status::Solved);
    assert_eq!(found.quality.error_estimate, None);
    let codes: Vec<&str> = found.warnings.iter().map(|w| &w.code[..]).collect();
    assert!(codes.contains(&"W0738"), "{codes:?}");
}
