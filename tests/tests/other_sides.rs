//! What is on another side has no part in values: limits that are never met, branches without a value, powers of quotients.

use nsd_tests::{end, solved};

/// What a form is of x and L.
type Exact = fn(f64, f64) -> f64;

/// Limits that take all digits of 1 with them, and some that take a few.
const LIMITS: [f64; 5] = [1e3, 1e9, 1e15, 1e20, 1e300];

fn close(found: f64, exact: f64, what: &str) {
    let error = (found - exact).abs() / exact.abs().max(1.0);
    assert!(error <= 1e-10, "{what}: {found:e}, not {exact:e}");
}

/// x = e⁻ᵗ is between all limits, and 3 - x beyond a few.
#[test]
fn values_do_not_see_limits_that_are_not_met() {
    let (end_of_run, half) = ((-1.0_f64).exp(), (-0.5_f64).exp());
    let cases: [(&str, Exact); 15] = [
        ("sat(x, -L, L)", |x, _| x),
        ("sat(-2*x, -L, L)", |x, _| -2.0 * x),
        ("sat(L*(x + 1), -1, 1)", |_, _| 1.0),
        ("clamp(x, 0, L)", |x, _| x),
        ("max(x, -L)", |x, _| x),
        ("sat(x - 1.5, -L, L)", |x, _| x - 1.5),
        ("max(2*x - 3, -L)", |x, _| 2.0 * x - 3.0),
        ("max(time - 1.5, -L)/(time - 1.5) + 1", |_, _| 2.0),
        ("min(x, L)", |x, _| x),
        ("max(min(x, L), -L) + 1", |x, _| x + 1.0),
        ("deadzone(x + L, L)", |x, _| x),
        ("1/max(x, 1/L)", |x, _| 1.0 / x),
        ("if x > 2 then L else x", |x, _| x),
        ("abs(x - L) - L", |x, limit| (x - limit).abs() - limit),
        ("sqrt(max(x, 0)) + L*step(-x)", |x, _| x.sqrt()),
    ];
    for limit in LIMITS {
        for (form, exact) in cases {
            let text = format!(
                "model m {{
                   param L = {limit:e};
                   state x = 1; x' = -x;
                   discrete sampled = 0; every 0.5 {{ sampled := {form}; }}
                   discrete kept = 0; state clock = 0; clock' = 1;
                   jump keep when clock > 0.5 {{ kept := {form}; clock := -10; }}
                   output told = {form};
                 }}
                 simulate run of m {{ horizon 1; tolerance 1e-12; }}"
            );
            let found = solved(&text, "run");
            let what = format!("{form} with {limit:e}");
            // A sum with a limit has the digits that the limit leaves.
            let of_sum = ["deadzone", "abs", "sat(L"]
                .iter()
                .any(|name| form.starts_with(name));
            if of_sum && limit > 1e3 {
                continue;
            }
            close(end(&found, "told")[0], exact(end_of_run, limit), &what);
            close(end(&found, "sampled")[0], exact(end_of_run, limit), &what);
            close(end(&found, "kept")[0], exact(half, limit), &what);
        }
    }
}

/// Rates by events and by `adaptive`, initial values and parameters by others, and numbers.
#[test]
fn rates_and_numbers_do_not_either() {
    for limit in LIMITS {
        for method in ["event", "adaptive"] {
            let text = format!(
                "model m {{
                   param p = 1.25; param q = sat(p, -{limit:e}, {limit:e});
                   state x = 1; state y = q; state z = 0;
                   x' = sat(-x, -{limit:e}, {limit:e}); y' = 0;
                   state w = 0; w' = 1 + sat(-w, -{limit:e}, {limit:e});
                   state v = 0; v' = sat(time - 1.5, -{limit:e}, p*{limit:e});
                   z' = sat(1.3, -{limit:e}, {limit:e});
                 }}
                 simulate run of m {{ horizon 1; tolerance 1e-11; method {method}; }}"
            );
            let found = solved(&text, "run");
            let what = format!("{limit:e} by {method}");
            close(end(&found, "x")[0], (-1.0_f64).exp(), &what);
            close(end(&found, "y")[0], 1.25, &what);
            close(end(&found, "z")[0], 1.3, &what);
            close(end(&found, "v")[0], -1.0, &what);
            close(end(&found, "w")[0], 1.0 - (-1.0_f64).exp(), &what);
        }
    }
}

/// x = 1 + sin(t)/2 stays above zero, where y follows 1/2 sin(2t)/2 with what is added to it: the other branches, which
/// several switches choose among, are never taken, and their weights are products of α.
#[test]
fn elements_have_nothing_of_branches_that_are_not_taken() {
    let large = ["L*sin(time) + 1", "-L*cos(y)", "L*(1 + y^2)", "L*x"];
    for limit in [1e9, 1e12, 1e15] {
        for first in large {
            for second in large {
                for lowering in ["step", "stewart"] {
                    let text = format!(
                        "model m {{
                           param L = {limit:e};
                           state x = 1; state y = 0.2; x' = 0.5*cos(time);
                           y' = 0.5*cos(2*time) + (if x > 0 then 0.3 else if x > -1 then {first} else {second});
                         }}
                         simulate run of m {{ horizon 1; tolerance 1e-11; method fesd; lower {lowering}; }}"
                    );
                    let found = solved(&text, "run");
                    let what = format!("{first}, {second} with {limit:e} by {lowering}");
                    close(end(&found, "x")[0], 1.0 + 0.5 * 1.0_f64.sin(), &what);
                    close(end(&found, "y")[0], 0.5 + 0.25 * 2.0_f64.sin(), &what);
                }
            }
        }
    }
}

/// The rate is 3/10 wherever a run comes, and no digit of it is lost to the rates that are numbers on other sides. Elements
/// take such a system to other units where these are larger than all digits of 1.
#[test]
fn rates_keep_their_digits_beside_numbers_of_other_sides() {
    let forms = [
        "if x > 0 then 0.3 else L",
        "if x > 0 then 0.3 else if y > 4 then 3*L + y else L",
        "if x > 0 then 0.3 else if y > 4 then L*y^2 else L",
        "if x > 0 and y < 4 then 0.3 else L",
        "0.3*step(x) + L*step(-x)",
        "(if x > 0 then 0.1 else -L) + (if y < 4 then 0.2 else L)",
    ];
    let all = [
        "event;",
        "adaptive;",
        "fesd; lower step;",
        "fesd; lower stewart;",
    ];
    let cases = [
        ("1e6", &all[..]),
        ("1e9", &all),
        ("1e9/3", &all),
        ("-1.7e11", &all),
        ("1e16/3", &all[..2]),
    ];
    for (limit, methods) in cases {
        for form in forms {
            let named =
                format!("param L = {limit}; state x = 1; state y = 0; y' = 1; x' = {form};");
            let number = form.replace('L', &format!("({limit})"));
            let written = format!("state x = 1; state y = 0; y' = 1; x' = {number};");
            for model in [named, written] {
                for method in methods {
                    let text = format!(
                        "model m {{ {model} }}
                         simulate run of m {{ horizon 1; tolerance 1e-12; method {method} }}"
                    );
                    let x = end(&solved(&text, "run"), "x")[0];
                    assert!((x - 1.3).abs() < 1e-14, "{model} by {method}: {x:?}");
                }
            }
        }
    }
}

/// log(x - 5) and √(x - 5) have no value where x is below 5.
#[test]
fn what_has_no_value_is_not_asked_for_one() {
    let text = "model m {
           state x = 1; x' = -x;
           let branch = if x > 5 then log(x - 5) else x;
           discrete d = 0; every 0.5 { d := if x > 5 then sqrt(x - 5) else x; }
           output told = branch;
           output level = log(abs(x));
         }
         simulate run of m { horizon 1; tolerance 1e-12; }";
    let found = solved(text, "run");
    close(end(&found, "told")[0], (-1.0_f64).exp(), "if");
    close(end(&found, "level")[0], -1.0, "abs");
    close(end(&found, "d")[0], (-1.0_f64).exp(), "sampled");
}

/// A harvest that sets in at K: r N (1 - N/(2 K)) = h (N/K)ⁿ/(1 + (N/K)ⁿ) at rest, by bisection; K⁻ⁿ is no number.
#[test]
fn steep_powers_of_quotients_act() {
    for (k, n) in [
        (5000.0, 20),
        (5000.0, 88),
        (5000.0, 100),
        (1e6, 55),
        (1e13, 25),
        (1e-3, 120),
    ] {
        let power = |x: f64| (x / k).powi(n);
        let rate = |x: f64| x * (1.0 - x / (2.0 * k)) - 0.6 * k * power(x) / (1.0 + power(x));
        let (mut low, mut high) = (0.5 * k, 1.5 * k);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            match rate(middle) > 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        for parameter in ["param K", "const K"] {
            let text = format!(
                "{} model m {{ {} state N = {:e};
                   N' = N*(1 - N/(2*K)) - 0.6*K*(N/K)^{n}/(1 + (N/K)^{n}); }}
                 simulate run of m {{ horizon 40; }}",
                if parameter == "const K" {
                    format!("const K = {k:e};")
                } else {
                    String::new()
                },
                if parameter == "param K" {
                    format!("param K = {k:e};")
                } else {
                    String::new()
                },
                0.2 * k
            );
            let found = end(&solved(&text, "run"), "N")[0];
            assert!(
                (found / low - 1.0).abs() < 1e-6,
                "{k:e}, {n}: {found:e}, not {low:e}"
            );
        }
    }
}

/// N' = N/2 halves at K: after ln 2/(1/2) again and again.
#[test]
fn guards_see_powers_of_quotients() {
    for n in [20, 100, 300] {
        let text = format!(
            "model m {{ state N = 4000; discrete n = 0; N' = N/2;
               jump halve when (N/5000)^{n} > 1 {{ N := N/2; n := n + 1; }} }}
             simulate run of m {{ horizon 10; }}"
        );
        let first = 2.0 * (5.0_f64 / 4.0).ln();
        let count = 1.0 + ((10.0 - first) / (2.0 * 2.0_f64.ln())).floor();
        assert_eq!(end(&solved(&text, "run"), "n")[0], count, "{n}");
    }
}

/// Sides that parameters alone decide, small ones beside large ones.
#[test]
fn sides_of_numbers_are_known() {
    for (large, small) in [(1e9, 0.3), (2.1e11, 0.3), (1.0, 1e-9), (1e20, -1.0)] {
        let text = format!(
            "model m {{ param a = {large:e}; param b = {small:e}; state x = 1; state y = 0;
               x' = if a - b > 0 then 1 else 0; y' = sign(a + b) + max(b - a, 0); }}
             simulate run of m {{ horizon 1; }}"
        );
        let found = solved(&text, "run");
        close(end(&found, "x")[0], 2.0, "x");
        close(end(&found, "y")[0], 1.0, "y");
    }
}
