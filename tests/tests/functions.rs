//! Functions of one argument, and floors and remainders of time, against closed forms.

use nsd_tests::{assert_near, end, solved, solved_optimum, times};
use nsdc::report::{EventKind, Trajectory};

const METHODS: [&str; 3] = [
    "tolerance 1e-12;",
    "tolerance 1e-11; method fesd { steps = 40; }",
    "tolerance 1e-11; method fesd { steps = 40; } lower step;",
];

fn by(settings: &str, model: &str, horizon: f64) -> Trajectory {
    let text = format!(
        "model m {{ {model} }}
         simulate run of m {{ {settings} horizon {horizon:?}; }}"
    );
    solved(&text, "run")
}

fn close(found: f64, exact: f64, within: f64, what: &str) {
    assert!(
        (found - exact).abs() <= within,
        "{what}: {found}, not {exact}"
    );
}

/// Each undoes what drives its argument: x = sinh t, cosh(1 + t), tanh t; y' = t, 1 + t, t.
#[test]
fn inverses_of_hyperbolic_functions_undo_them() {
    let cases = [
        ("asinh", "0", "sqrt(1 + x^2)", 4.5),
        ("asinh", "sinh(-5)", "sqrt(1 + x^2)", -10.5),
        ("acosh", "cosh(1)", "sqrt(x^2 - 1)", 7.5),
        ("atanh", "0", "1 - x^2", 4.5),
        ("atanh", "tanh(-2)", "1 - x^2", -1.5),
    ];
    for settings in METHODS {
        for (function, start, rate, exact) in cases {
            let model = format!("state x = {start}; state y = 0; x' = {rate}; y' = {function}(x);");
            let found = end(&by(settings, &model, 3.0), "y")[0];
            close(found, exact, 1e-8, &format!("{function} {settings}"));
        }
    }
}

/// x' = asinh(x), x' = 1/(1 + acosh(x)) and x' = -atanh(x)/(1 + x²): roots of ∫ dx/x' = 2 by quadrature in 30 digits
/// (mpmath).
#[test]
fn rates_with_them_follow_their_integrals() {
    let cases = [ASINH, ACOSH, ATANH];
    for settings in METHODS {
        for (rate, start, exact) in cases {
            let model = format!("state x = {start}; x' = {rate};");
            let found = end(&by(settings, &model, 2.0), "x")[0];
            close(found, exact, 1e-9, rate);
        }
    }
}

const ASINH: (&str, f64, f64) = ("asinh(x)", 0.5, 2.613_552_553_852_069);
const ACOSH: (&str, f64, f64) = ("1/(1 + acosh(x))", 1.5, 2.381_871_259_763_606);
const ATANH: (&str, f64, f64) = ("-atanh(x)/(1 + x^2)", 0.9, 0.144_902_940_985_639_6);

/// Near ±1 a step of the argument is a leap of the result: 1 - |u| = 1e-4 at the middle of a step is not passed over.
#[test]
fn narrow_places_of_inverses_are_seen() {
    // ∫ atanh(0.9999 sech(20 (t - 1))) over [0, 2] by quadrature in 30 digits (mpmath).
    let model = "state x = -1; state y = 0; x' = 1; y' = atanh(0.9999/cosh(20*x));";
    let found = end(&by("tolerance 1e-10;", model, 2.0), "y")[0];
    close(found, PEAK, 1e-8, "atanh");
}

const PEAK: f64 = 0.244_518_649_633_536_5;

/// ∫ mod(t, 0.3) over n periods and a rest r is n 0.045 + r²/2.
#[test]
fn sawtooth_drives_integrate_exactly() {
    let methods = METHODS.into_iter().chain([
        "tolerance 1e-10; method timestepping { steps = 400; }",
        "method adaptive;",
        "method smoothing { epsilon = 1e-3; }",
    ]);
    for settings in methods {
        let run = by(
            settings,
            "param T = 0.3; state x = 0; x' = mod(time, T);",
            2.0,
        );
        close(end(&run, "x")[0], 6.0 * 0.045 + 0.02, 1e-9, settings);
    }
    // Falling, shifted, and a period with a unit.
    let run = by(
        METHODS[0],
        "param T : s = 0.4; state x = 0; state y : s^2 = 0; x' = mod(0.1 - time, 0.3); y' = mod(time, T);",
        1.0,
    );
    // From 0.1 down to 0 at 0.1, then three ramps from 0.3 to 0.
    close(end(&run, "x")[0], 0.005 + 3.0 * 0.045, 1e-12, "falling");
}

/// x' = 1 for a share d of each period and -1 else.
#[test]
fn pulse_widths_are_exact() {
    for settings in METHODS {
        let model = "param T = 0.25; param d = 0.3; state x = 0; x' = -sign(mod(time, T) - d*T);";
        let run = by(settings, model, 1.6);
        // Six periods lose 0.4 T each, and the rest of 0.1 has 0.075 up and 0.025 down.
        close(end(&run, "x")[0], -6.0 * 0.1 + 0.05, 1e-9, settings);
    }
}

/// floor(u) of functions that rise, fall, turn and touch.
#[test]
fn floors_jump_where_their_argument_passes_integers() {
    // 2 sin passes 1 at π/6 and 5π/6, and touches 2.
    let model = "state x = 0; x' = floor(2*sin(time));";
    let run = by(METHODS[0], model, std::f64::consts::PI);
    close(
        end(&run, "x")[0],
        2.0 * std::f64::consts::PI / 3.0,
        1e-12,
        "sine",
    );
    // Of a floor: mod(floor(t), 3) is 0, 1, 2, 0, ...
    let run = by(
        METHODS[0],
        "state x = 0; x' = mod(floor(time), 3) + floor(-time/49*49);",
        7.0,
    );
    close(end(&run, "x")[0], 6.0 - 28.0, 1e-12, "nested");
    // Counts of seven sevenths are whole.
    let run = by(METHODS[0], "state x = 0; x' = floor(floor(time)/49);", 50.0);
    close(end(&run, "x")[0], 1.0, 1e-12, "sevenths");
    let run = by(METHODS[0], "state x = 0; x' = floor(abs(time - 1.5));", 4.0);
    close(end(&run, "x")[0], 0.5 + 1.0 + 2.0 * 0.5, 1e-12, "kink");
}

/// Within the ranges of states, floors of them are sums of steps: crossings are located, and there is sliding on them.
#[test]
fn floors_of_states_are_staircases() {
    // x = 3.7 + 3 sin t; the integral of its floor with all instants from arcsines.
    let exact = 19.119_160_340_080_324;
    let turns = "state x in [0, 7] = 3.7; state z = 0; x' = 3*cos(time); z' = floor(x);";
    // What the message of E0423 says, from the floor at the start.
    let counts = "state x = 3.7; discrete n = 3; state z = 0; x' = 3*cos(time); z' = n;
        jump up when x > n + 1 { n := n + 1; } jump down when x < n { n := n - 1; }";
    let narrow = "state x in [1, 7] = 3.7; state z = 0; x' = 3*cos(time); z' = floor(x);";
    for settings in METHODS {
        let run = by(settings, turns, 6.0);
        close(end(&run, "z")[0], exact, 1e-9, settings);
    }
    let run = by(METHODS[0], counts, 6.0);
    close(end(&run, "z")[0], exact, 1e-11, "counted");
    assert!(by(METHODS[0], turns, 6.0).warnings.is_empty());
    // Out of its range, the last step goes on, and the run says so.
    let run = by(METHODS[0], narrow, 6.0);
    assert!(run.warnings.iter().any(|warning| warning.code == "W0703"));
    // One more wherever x < 1.
    close(
        end(&run, "z")[0],
        exact + 2.0 * 0.9_f64.acos(),
        1e-9,
        "out of range",
    );

    // Speeds 1, 2, 3 from step to step.
    let rises = "param top = 4; state x in [0, top] = 0; x' = 1 + floor(x);";
    let run = by(METHODS[0], rises, 1.9);
    let exact = [1.0, 1.5, 1.5 + 1.0 / 3.0];
    let found = times(&run, EventKind::Crossing);
    assert_near(&found, &exact, 1e-12);
    let rests = by(
        METHODS[0],
        "state x in [-3, 8] = 0.5; x' = 0.5 - floor(x);",
        3.0,
    );
    close(end(&rests, "x")[0], 1.0, 1e-12, "slides on a step");
    assert_eq!(times(&rests, EventKind::EnterSliding).len(), 1);
    // Of x = t: 1 + 2 + 3 rounded up, 0.5 + ... to the nearest, and a sawtooth of period 2.
    let all = "state x[1] in [-1, 4] = 0; state z = 0; x' = [1]; z' = ceil(x[1]) + round(x[1]) + mod(x[1], 2);";
    let run = by(METHODS[0], all, 3.0);
    close(end(&run, "z")[0], 6.0 + 4.5 + 2.5, 1e-11, "rounded");
}

/// y = ∫ floor(x + t) with x = 0 is 0 + 1 + .. + 4 + 5 (T - 5) = 14.5 for T = 5.9, wherever the search begins.
#[test]
fn floors_hold_over_a_free_horizon() {
    for guess in [1, 6] {
        let text = format!(
            "model m {{ state x in [0, 3] = 0; state y = 0; control u in [0, 1] = 0; x' = 0*u; y' = floor(x + time); }}
             optimize run of m {{
               horizon free in [0.5, 6.5] = {guess}; intervals 13;
               minimize final(time) + integral(u^2); final {{ y = 14.5; }}
             }}"
        );
        let run = solved_optimum(&text, "run");
        let found = run.samples.time[run.samples.time.len() - 1];
        close(found, 5.9, 1e-6, &format!("from {guess}"));
    }
}

/// Of u = t - 1, and what is limited twice: bounds of what has kinks are named as they are written.
#[test]
fn bounds_of_kinks_keep_their_words() {
    let surfaces = |model: &str| {
        let run = by(METHODS[0], model, 4.0);
        let names = run.history.events.iter().map(|event| event.surface.clone());
        names.collect::<Vec<_>>()
    };
    let nested = "param top = 1; state u = -1; state x = 0; u' = 1; x' = sat(sat(u, -0.5, 0.5) + 0.3*time, -top, top);";
    assert_eq!(
        surfaces(nested),
        ["u + 0.5", "u - 0.5", "sat(u, -0.5, 0.5) + 0.3*time - top"]
    );
    // A bound that is only touched is no surface.
    let touched = "state u = -1; state x = 0; u' = 1; x' = sat(abs(u), 0, 2);";
    assert_eq!(surfaces(touched), ["u", "abs(u) - 2"]);
    let units = "param c : m/s = 1; state u : m = -1; u' = if u < 0 m then 2*c else c;";
    assert_eq!(surfaces(units), ["u"]);
}

/// Relays on a staircase switch where it steps.
#[test]
fn relays_follow_staircases() {
    for settings in METHODS {
        let model = "state x = 0.5; x' = -3*sign(x - floor(2*time));";
        let run = by(settings, model, 2.0);
        close(end(&run, "x")[0], 3.0, 1e-8, settings);
    }
    let run = by(
        METHODS[0],
        "state x = 0; x' = if floor(time) > 0.5 then 1 else 0;",
        3.0,
    );
    close(end(&run, "x")[0], 2.0, 1e-12, "condition");
    assert_eq!(times(&run, EventKind::Crossing).len(), 1);
}

/// Names that models had before the functions mean what the model declares.
#[test]
fn names_of_models_stay_theirs() {
    let text = "fn cbrt(x) = x^2;
        model m { state mod = 1; state floor = 0; mod' = mod(time, 2); floor' = cbrt(3) + floor(2.5); }
        simulate run of m { horizon 1; }";
    let run = solved(text, "run");
    close(end(&run, "mod")[0], 1.5, 1e-9, "mod");
    close(end(&run, "floor")[0], 11.0, 1e-9, "floor");
}

/// Names of functions that came later are the model's, too, whatever declares them.
#[test]
fn names_of_later_functions_stay_theirs() {
    let text = "fn log10(x) = x^2;
        fn erf(a, b) = a + b;
        const frac = 2;
        model m {
          param hypot = 1; param exp2 = 2; input clamp = 3; let round = hypot + exp2; output log2 = 7;
          state ceil = 0; state pulse = 0; signal triangle = time;
          region sawtooth where pulse < 0.5 { ceil' = log10(3); }
          region other else { ceil' = 0; }
          pulse' = erf(round, clamp)*frac + 0*triangle;
        }
        simulate run of m { horizon 0.1; expect log2 at end = 7; }";
    let run = solved(text, "run");
    close(end(&run, "pulse")[0], 1.2, 1e-9, "pulse");
    close(end(&run, "ceil")[0], 9.0 / 24.0, 1e-9, "ceil");
}

/// ∫ over [0, 2.2] of ceil, round and frac of what rises and falls.
#[test]
fn rounding_up_and_to_the_nearest() {
    let cases = [
        ("ceil(time)", 1.0 + 2.0 + 0.2 * 3.0),
        ("ceil(-time)", 0.0 - 1.0 - 0.2 * 2.0),
        ("round(time)", 1.0 + 0.7 * 2.0),
        ("round(1 - time)", 0.5 + 0.0 - 0.7),
        ("frac(time)", 0.5 + 0.5 + 0.02),
        ("frac(-time)", 0.5 + 0.5 + 0.2 - 0.02),
        (
            "ceil(2.5) + round(2.5) + round(-2.5) + frac(2.25) + round(2.4)",
            2.2 * (3.0 + 3.0 - 2.0 + 0.25 + 2.0),
        ),
        ("ceil(n) + round(n/3)", 2.2 * 7.0),
    ];
    for settings in METHODS {
        for (rate, exact) in cases {
            let model = format!("param n = 5; state x = 0; x' = {rate};");
            let found = end(&by(settings, &model, 2.2), "x")[0];
            close(found, exact, 1e-11, &format!("{rate} {settings}"));
        }
    }
}

/// Periods of 0.4, two and a quarter of them.
#[test]
fn periodic_signals_have_their_means() {
    let cases = [
        ("pulse(time, T, d)", 2.0 * 0.12 + 0.1),
        ("pulse(time, 0.4, 0.3)", 2.0 * 0.12 + 0.1),
        ("pulse(time - 0.1, T, d)", 2.0 * 0.12),
        ("pulse(time, T, 0)", 0.0),
        ("pulse(time, T, 1)", 0.9),
        ("sawtooth(time, T)", 2.0 * 0.2 + 0.0125),
        ("triangle(time, T)", 2.0 * 0.2 + 0.025),
        ("triangle(time + T/4, T)", 2.0 * 0.2 + 0.075),
        ("triangle(-time, T)", 2.0 * 0.2 + 0.025),
    ];
    let methods = METHODS
        .into_iter()
        .chain(["tolerance 1e-10; method timestepping { steps = 400; }"]);
    for settings in methods {
        for (rate, exact) in cases {
            // A quarter of a period is 0.1, of which the pulse has all.
            let model = format!("param T = 0.4; param d = 0.3; state x = 0; x' = {rate};");
            let found = end(&by(settings, &model, 0.9), "x")[0];
            close(found, exact, 1e-10, &format!("{rate} {settings}"));
        }
    }
    // A triangle goes through its ends and middle, and its corners are where it turns.
    let run = by(
        METHODS[0],
        "state x = 0; x' = triangle(time, 2); output y = triangle(time, 2);",
        1.5,
    );
    close(end(&run, "x")[0], 0.5 + 0.375, 1e-12, "two halves");
    close(end(&run, "y")[0], 0.5, 1e-12, "half way down");
}

/// A duty that a state has switches where the sawtooth passes it.
#[test]
fn pulse_widths_follow_states() {
    for settings in METHODS {
        // Within period n, from n to n + 1, the pulse ends where frac(t) = t/4: at 4n/3.
        let model = "state d = 0; state x = 0; d' = 1/4; x' = pulse(time, 1, d);";
        let run = by(settings, model, 3.0);
        // Widths are n/3 for n = 0, 1, 2.
        close(end(&run, "x")[0], 1.0, 1e-9, settings);
    }
}

/// ∫ erf over [-1, 2] is u erf(u) + exp(-u²)/√π between its ends, and a narrow one is a step.
#[test]
fn error_functions_follow_their_integrals() {
    for settings in METHODS {
        let run = by(
            settings,
            "state x = -1; state y = 0; state z = 0; x' = 1; y' = erf(x); z' = exp(-x^2)*2/sqrt(pi) - 1;",
            3.0,
        );
        close(end(&run, "y")[0], ERF_INTEGRAL, 1e-9, settings);
        close(end(&run, "z")[0], ERF_RISE - 3.0, 1e-9, settings);
    }
    let narrow = by(
        "tolerance 1e-10;",
        "state x = -1; state y = 0; x' = 1; y' = erf(200*x + 3);",
        2.5,
    );
    close(
        end(&narrow, "y")[0],
        1.5 - 1.0 + 2.0 * 3.0 / 200.0,
        1e-9,
        "narrow",
    );
    let optimum = "model m { state x = 0; control u in [-1, 1] = 0; x' = u + erf(x); }
        optimize o of m { horizon 1; intervals 4; minimize integral(u^2); final { x = 1; } }";
    nsd_tests::agrees(&solved_optimum(optimum, "o"), 1e-6);
}

/// erf(2) + erf(1).
const ERF_RISE: f64 = ERF_2 + ERF_1;
const ERF_1: f64 = 0.842_700_792_949_714_9;
const ERF_2: f64 = 0.995_322_265_018_952_7;
/// 2 erf(2) - erf(1) + (exp(-4) - exp(-1))/√π.
const ERF_INTEGRAL: f64 = 0.950_723_481_054_939_3;

/// Where a state drives them, and where a share or period is none, the error says what to write.
#[test]
fn what_is_no_duty_or_period_is_told() {
    let cases = [
        ("pulse(time, 1, 1.5)", "E0210"),
        ("sawtooth(time, 0)", "E0210"),
        ("pulse(time, 1, d)", "E0423"),
        ("triangle(time, d - 3)", "E0423"),
        ("ceil(x)", "E0423"),
        ("round(x)", "E0423"),
        ("clamp(x, 1)", "E0210"),
        ("hypot(x)", "E0210"),
    ];
    for (rate, code) in cases {
        let text = format!(
            "model m {{ param d = 3; state x = 0; x' = {rate}; }}
             simulate run of m {{ horizon 1; }}"
        );
        let found = nsdc::Project::from_text("test.nsd", &text)
            .check()
            .to_string();
        assert!(found.contains(code), "{rate}: {found}");
    }
}

/// Logarithms, powers of two, lengths and bounds are what they are made of.
#[test]
fn short_names_are_what_they_stand_for() {
    let model = "state x = 1; state y = 0; x' = 1;
        y' = (log10(x) - log(x)/log(10))^2 + (log2(x) - log(x)/log(2))^2 + (exp2(x) - 2^x)^2
           + (hypot(x, 2*x) - sqrt(5)*x)^2 + (clamp(x, 2, 3) - sat(x, 2, 3))^2
           + (log10(1000) - 3)^2 + (log2(1024) - 10)^2 + (exp2(0.5) - sqrt(2))^2 + hypot(3, 4) - 5;";
    for settings in METHODS {
        close(end(&by(settings, model, 3.0), "y")[0], 0.0, 1e-12, settings);
    }
}

/// Units behind numbers are converted, in models with units and without.
#[test]
fn quantities_drive_models() {
    let model = "state x : m = 1 km; state y : m = 0; param m : kg = 500 g;
        x' = -20 km/h; y' = 2 (m/s)*sin(5 rad/s*time) + 3 mm/1 ms*pulse(time, 100 ms, 0.5);";
    for settings in METHODS {
        let run = by(settings, model, 0.9);
        close(end(&run, "x")[0], 1000.0 - 5.0, 1e-8, settings);
        let exact = 0.4 * (1.0 - 4.5_f64.cos()) + 3.0 * 0.45;
        close(end(&run, "y")[0], exact, 1e-8, settings);
    }
    let text = "model m { state x = 0; x' = 1; }
        simulate run of m { horizon 30 ms; output x every 10 ms; expect x at 20 ms ~ 2 cm within 1 nm; }";
    close(end(&solved(text, "run"), "x")[0], 0.03, 1e-12, "horizon");
}
