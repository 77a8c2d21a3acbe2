//! Switching functions whose terms cancel: of polynomials that is seen when they are compiled, of others the run ends
//! where their sign matters, at their line, or goes on where it does not. None is wrong in silence, and none hangs.

use nsd_tests::{end, run, solved};
use nsdc::report::{Trajectory, Warning};

/// Polynomials that are zero.
const POLYNOMIALS: [&str; 6] = [
    "(x + 1)^2 - x^2 - 2*x - 1",
    "x - x*1.0",
    "(x - 1)*(x + 1) - x^2 + 1",
    "(x + z)^2 - x^2 - 2*x*z - z^2",
    "(x + 0.1)^2 - x^2 - 0.2*x - 0.01",
    "sin((x + z)^2) - sin(x^2 + 2*x*z + z^2)",
];

/// Functions that are zero, and no polynomials of the functions they are made of.
const OTHERS: [&str; 6] = [
    "sin(x)^2 + cos(x)^2 - 1",
    "exp(x)*exp(-x) - 1",
    "sin(2*x) - 2*sin(x)*cos(x)",
    "tan(x/20)*cos(x/20) - sin(x/20)",
    "log(exp(x)) - x",
    "1e6*(sin(x)^2 - (1 - cos(2*x))/2)",
];

/// A run over 10 with y' of this form, where ψ stands for a function.
fn over(form: &str, psi: &str, method: &str) -> Trajectory {
    let rate = form.replace('ψ', psi);
    let text = format!(
        "model m {{
           state x = 0.3;
           state z = 1;
           state y = 0;
           x' = 1 + 0.1*sin(z);
           z' = -0.3*(z - 2) + 0.1*cos(x);
           y' = {rate};
         }}
         simulate r of m {{ horizon 10; {method} }}"
    );
    run(&text, "r")
}

fn code(trajectory: &Trajectory) -> Option<String> {
    let failure = trajectory.failure.as_ref();
    failure.map(|failure| Warning::of(failure).code)
}

#[test]
fn polynomials_that_cancel_are_zero() {
    for psi in POLYNOMIALS {
        for (form, exact) in [
            ("sign(ψ)", 0.0),
            ("if ψ > 0 then 1 else 2", 20.0),
            ("if ψ >= 0 then 1 else 2", 10.0),
            ("1 + max(0, ψ)", 10.0),
            ("abs(ψ)", 0.0),
            ("sat(ψ)", 0.0),
        ] {
            for method in ["", "method fesd;"] {
                let trajectory = over(form, psi, method);
                assert_eq!(code(&trajectory), None, "{form} {psi} {method}");
                let y = end(&trajectory, "y")[0];
                assert!(
                    (y - exact).abs() <= 1e-12 * (1.0 + exact),
                    "{form} {psi}: {y}"
                );
            }
        }
    }
}

#[test]
fn other_identities_end_a_run_where_their_sign_matters() {
    for psi in OTHERS {
        for form in ["sign(ψ)", "if ψ > 0 then 1 else 2"] {
            let by_events = over(form, psi, "");
            assert_eq!(code(&by_events).as_deref(), Some("E0701"), "{form} {psi}");
            assert_eq!(by_events.history.modes.len(), 0, "{form} {psi}");
            let by_elements = over(form, psi, "method fesd;");
            assert!(by_elements.failure.is_some(), "{form} {psi}");
        }
    }
}

/// Neither side of a kink that is zero differs from the other.
#[test]
fn kinks_of_identities_are_passed_over() {
    for psi in OTHERS {
        for (form, exact) in [("1 + max(0, ψ)", 10.0), ("sat(ψ)", 0.0)] {
            let trajectory = over(form, psi, "");
            assert_eq!(code(&trajectory), None, "{form} {psi}");
            let y = end(&trajectory, "y")[0];
            assert!((y - exact).abs() <= 1e-8, "{form} {psi}: {y}");
        }
    }
}

/// What rests on a surface is asked for its side when another switch makes it matter, not before.
#[test]
fn a_side_that_made_no_difference_is_asked_for_where_it_makes_one() {
    for rate in ["0", "-z"] {
        for form in [
            "if z > 0 and x > 1.5 then 1 else 2",
            "(if x > 1.5 then 1 else 0)*sign(z)",
            "max(x - 1.5, 0)*sign(z)",
        ] {
            let of = |horizon: f64| {
                let text = format!(
                    "model m {{
                       state x = 0;
                       state z = 0;
                       state y = 0;
                       x' = 1;
                       z' = {rate} + 0*y;
                       y' = {form};
                     }}
                     simulate r of m {{ horizon {horizon:?}; }}"
                );
                text
            };
            solved(&of(1.25), "r");
            let trajectory = run(&of(2.0), "r");
            assert_eq!(code(&trajectory).as_deref(), Some("E0701"), "{form}");
            let told = trajectory.failure.as_ref().map(ToString::to_string);
            assert!(
                told.as_deref()
                    .is_some_and(|told| told.starts_with("at t = 1.5, ")),
                "{told:?}"
            );
        }
    }
}

/// A body in free flight beside a contact, whose force (1 - α)/m is none, with an acceleration of a - 1/m + 1/m: what is far
/// smaller than 1/m keeps its digits.
#[test]
fn accelerations_keep_their_digits_beside_forces() {
    for (mass, size, rate) in [
        (0.1, 1e-8, 4e-4),
        (1e-6, 1.0, 4.0),
        (1e-3, 1e-4, 4e-2),
        (1.0, 1e-10, 4e-5),
    ] {
        let text = format!(
            "model m {{ state x = 1; state v = 0; x' = v;
               mechanics x, v {{ mass = {mass:e}; force = {:e}*(-9.81 + 3*sin({rate:e}*time));
                 contact C {{ gap = x + {:e}; restitution = 0.5; }} }} }}
             simulate s of m {{ horizon {:e}; tolerance 1e-12; }}",
            mass * size,
            2.0 * size / (rate * rate),
            0.4 * 4.0 / rate,
        );
        let found = solved(&text, "s");
        // v' = s (-9.81 + 3 sin(r t)) with r t = 1.6 at the end.
        let t = 1.6 / rate;
        let exact = size * (-9.81 * t + 3.0 / rate * (1.0 - f64::cos(1.6)));
        let v = end(&found, "v")[0];
        assert!(
            (v / exact - 1.0).abs() < 2e-11,
            "{mass}, {size}: {v}, not {exact}"
        );
    }
}
