//! Time constants far below the time scale of the solution.

use super::{Case, Extent, Family, root};

pub fn families(extent: Extent) -> Vec<Family> {
    vec![relay(extent), slip(extent), chain(extent)]
}

fn rates(extent: Extent) -> Vec<f64> {
    extent.sweep(&[1e3, 1e9], &[1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9])
}

/// A relay acts through a fast actuator on a slow oscillator.
fn relay(extent: Extent) -> Family {
    let case = |rate: f64| {
        let model = format!(
            "state x = 1; state v = 0; state u = 0; switch s = sign(x);
             x' = v; v' = -u - 0.1*v; u' = -{rate:e}*(u - s);"
        );
        let (times, [x, v, u]) = relay_exactly(rate);
        let case = Case::new(format!("{rate:e}"), model, 10.0).switches_at(&times);
        case.ends("x", &[x], 1.0)
            .ends("v", &[v], 1.4)
            .ends("u", &[u], 1.0)
            .both()
    };
    Family {
        name: "a stiff actuator",
        about: "x'' = -u - x'/10 with u' = -λ (u - sign(x)); closed form between crossings.",
        hardness: "λ",
        cases: rates(extent).into_iter().flat_map(case).collect(),
    }
}

/// (x, v, u) of the relay `tau` after `start`, for a constant s.
fn actuated(start: [f64; 3], lambda: f64, s: f64, tau: f64) -> [f64; 3] {
    let ([x, v, u], c) = (start, 0.1);
    let (fast, slow) = ((-lambda * tau).exp(), (-c * tau).exp());
    let b = (u - s) / (lambda - c);
    let a = v + s / c - b;
    [
        x + a * (1.0 - slow) / c - s / c * tau + b * (1.0 - fast) / lambda,
        a * slow - s / c + b * fast,
        s + (u - s) * fast,
    ]
}

/// Crossings until 10, and (x, v, u) there, from (1, 0, 0).
pub fn relay_exactly(lambda: f64) -> (Vec<f64>, [f64; 3]) {
    let (mut t, mut s, mut now) = (0.0, 1.0, [1.0, 0.0, 0.0]);
    let mut crossings = Vec::new();
    loop {
        let x = |tau: f64| actuated(now, lambda, s, tau)[0];
        let mut tau = 0.1;
        while x(tau) * s > 0.0 && t + tau < 10.0 {
            tau += 0.1;
        }
        if t + tau >= 10.0 {
            return (crossings, actuated(now, lambda, s, 10.0 - t));
        }
        let tau = root(x, tau - 0.1, tau);
        now = actuated(now, lambda, s, tau);
        now[0] = 0.0;
        (t, s) = (t + tau, -s);
        crossings.push(t);
    }
}

/// Slides twice, with a sign that follows the fast state.
fn slip(extent: Extent) -> Family {
    let case = |rate: f64| {
        let model = format!(
            "state y = 0.5; state z = 1; switch s = sign(y);
             y' = -s + 1.5*z; z' = -{rate:e}*(z - cos(time));"
        );
        // z = a cos t + b sin t + c e^{-λt} and its integral.
        let squares = rate * rate + 1.0;
        let (a, b, c) = (rate * rate / squares, rate / squares, 1.0 / squares);
        let z = |t: f64| a * t.cos() + b * t.sin() + c * (-rate * t).exp();
        let integral =
            |t: f64| a * t.sin() + b * (1.0 - t.cos()) + c / rate * (1.0 - (-rate * t).exp());
        let t1 = root(|t| 0.5 - t + 1.5 * integral(t), 1.5, 2.1);
        let t2 = root(|t| 1.5 * z(t) + 1.0, t1, 3.0);
        let t3 = root(|t| t - t2 + 1.5 * (integral(t) - integral(t2)), 4.5, 5.5);
        let t4 = root(|t| 1.5 * z(t) - 1.0, t3, 6.0);
        let y = t4 - 6.0 + 1.5 * (integral(6.0) - integral(t4));
        let case = Case::new(format!("{rate:e}"), model, 6.0).switches_at(&[t1, t2, t3, t4]);
        case.ends("y", &[y], 1.5).ends("z", &[z(6.0)], 1.0).both()
    };
    Family {
        name: "sliding on a stiff state",
        about: "y' = -sign(y) + 3/2 z, z' = -λ (z - cos t) slides twice; closed form.",
        hardness: "λ",
        cases: rates(extent).into_iter().flat_map(case).collect(),
    }
}

/// A slow state behind a fast one behind a faster one, and a relay on the first.
fn chain(extent: Extent) -> Family {
    let case = |rate: f64| {
        let fast = rate.sqrt();
        let model = format!(
            "state x = 1; state a = 0; state b = 0; x' = -sign(x) + 0.5*a;
             a' = -{fast:e}*(a - b); b' = -{rate:e}*(b - 1);"
        );
        // b = 1 - e^{-λt}, a = 1 - (λ e^{-μt} - μ e^{-λt})/(λ - μ) with μ = √λ; then x slides.
        let area = |t: f64| {
            let slow = rate / fast * -(-fast * t).exp_m1();
            let quick = fast / rate * -(-rate * t).exp_m1();
            t - (slow - quick) / (rate - fast)
        };
        let t = root(|t| 1.0 - t + 0.5 * area(t), 0.5, 3.0);
        let case = Case::new(format!("{rate:e}"), model, 4.0).switches_at(&[t]);
        case.ends("x", &[0.0], 1.0)
            .ends(
                "a",
                &[1.0 - (rate * (-fast * 4.0).exp() - fast * (-rate * 4.0).exp()) / (rate - fast)],
                1.0,
            )
            .both()
    };
    Family {
        name: "two fast scales",
        about: "A relay behind filters of rates √λ and λ, which slides at last; closed form.",
        hardness: "λ",
        cases: rates(extent).into_iter().flat_map(case).collect(),
    }
}
