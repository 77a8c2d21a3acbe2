//! What a system makes of the rounding of its own run: the estimate, relative to the largest magnitude, covers it.
//! Rates that are rounding move nothing.

use nsd_tests::stress::{Extent, families};
use nsd_tests::{codes_of_rows, end, run, solved};

/// The tent map with a slope of 19/10, as jumps of a state that rests between them, against its orbit in whole numbers
/// over 10⁴ 10ᵏ: every jump makes errors 1.9 times as large.
fn tent(start: i128, jumps: u32) -> (f64, f64) {
    let text = format!(
        "model m {{
           state s = 0;
           state y = {start}/10000;
           s' = 1;
           y' = 0;
           jump fold when s > 1 {{ s := 0; y := 1.9*min(y, 1 - y); }}
         }}
         simulate r of m {{ horizon {jumps}.5; }}"
    );
    let trajectory = run(&text, "r");
    let (mut y, mut one) = (start, 10_000_i128);
    let mut scale = y as f64 / one as f64;
    for _ in 0..jumps {
        y = 19 * y.min(one - y);
        one *= 10;
        scale = scale.max(y as f64 / one as f64);
    }
    let known = y as f64 / one as f64;
    let error = (end(&trajectory, "y")[0] - known).abs();
    (
        error / scale,
        trajectory.quality.error_estimate.unwrap_or(1.0),
    )
}

/// y' = y and y less its whole part after each unit of time: the map y -> e y mod 1, in whole numbers over 10¹⁸.
fn exponential(start: i128, jumps: u32) -> (f64, f64) {
    const ONE: i128 = 1_000_000_000_000_000_000;
    const E: i128 = 2_718_281_828_459_045_235;
    let text = format!(
        "model m {{
           state s = 0;
           state y = {start}/10000;
           s' = 1;
           y' = y;
           jump fold when s > 1 {{ s := 0; y := y - (if y > 1 then 1 else 0) - (if y > 2 then 1 else 0); }}
         }}
         simulate r of m {{ horizon {jumps}; }}"
    );
    let trajectory = run(&text, "r");
    let mut y = start * (ONE / 10_000);
    let mut scale = 0.0_f64;
    for k in 0..jumps {
        y = y * E / ONE;
        scale = scale.max(y as f64 / ONE as f64);
        y = if k + 1 < jumps { y % ONE } else { y };
    }
    // The run ends before the last jump or behind it.
    let at_end = end(&trajectory, "y")[0];
    let distance = |y: i128| (at_end - y as f64 / ONE as f64).abs();
    let error = distance(y).min(distance(y % ONE));
    (
        error / scale,
        trajectory.quality.error_estimate.unwrap_or(1.0),
    )
}

/// Of 60 orbits each of two expanding maps.
#[test]
fn the_estimate_covers_what_expansion_makes_of_rounding() {
    let mut missed = Vec::new();
    for k in 0..60_u32 {
        let start = 1234 + 131 * i128::from(k);
        for (name, (error, estimate)) in [
            ("tent", tent(start, 12 + k % 19)),
            ("exponential", exponential(start, 8 + k % 11)),
        ] {
            if error > 1.1 * estimate + 1e-15 {
                missed.push(format!("{name} from {start}: {error:e} above {estimate:e}"));
            }
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Of the short family of identities: a state that starts at zero stays there, and drives nothing, without a warning.
#[test]
fn rates_that_are_rounding_move_nothing() {
    let all = families(Extent::Short).into_iter();
    let mut rounding = all.filter(|family| family.name == "rates that are rounding");
    let cases = rounding.next().expect("it is there").cases;
    assert!(cases.len() >= 48);
    let mut missed = Vec::new();
    for case in &cases {
        let outcome = case.run();
        if !case.keeps(&outcome) {
            missed.push(format!("{outcome}: {}", case.text()));
        }
    }
    assert!(missed.is_empty(), "{} {}", missed.len(), missed.join("\n"));
}

/// a' = -1000 a + I with an I that is zero, e' = a e: a stays 0 and e stays 1, and b has the accuracy that
/// is asked for.
#[test]
fn rounding_costs_no_digits() {
    let text = "model m {
           state a = 0; state b = 0.3; state e = 1;
           a' = -1e3*a + exp(b)*log(exp(b)) - b*exp(b); b' = cos(time)*e; e' = a*e;
         }
         simulate r of m { horizon 5; tolerance 1e-11; method fesd; }";
    let found = solved(text, "r");
    let exact = [("a", 0.0), ("b", 0.3 + 5_f64.sin()), ("e", 1.0)];
    for (name, exact) in exact {
        let value = end(&found, name)[0];
        assert!((value - exact).abs() < 1e-10, "{name}: {value}");
    }
}

/// Two rods on a joint, in free fall: joint, angles and their rates.
fn chain(settings: &str) -> String {
    format!(
        "model chain {{
           param g = 9.81; param m = 0.7; param n = 1.3; param a = 0.3; param b = 0.45;
           param J = 4/3*m*a^2; param K = 4/3*n*b^2;
           state x = 0; state y = 0; state q = 0.4; state p = 1.9;
           state vx = 0; state vy = 0; state w = 0; state u = 0;
           let M = [m + n, 0, -m*a*sin(q), -n*b*sin(p);
                    0, m + n, m*a*cos(q), n*b*cos(p);
                    -m*a*sin(q), m*a*cos(q), J, 0;
                    -n*b*sin(p), n*b*cos(p), 0, K];
           let f = solve(M, [m*a*w^2*cos(q) + n*b*u^2*cos(p), -(m + n)*g + m*a*w^2*sin(q) + n*b*u^2*sin(p),
                             -g*m*a*cos(q), -g*n*b*cos(p)]);
           x' = vx; y' = vy; q' = w; p' = u;
           vx' = f[1]; vy' = f[2]; w' = f[3]; u' = f[4];
         }}
         simulate r of chain {{ horizon 2; {settings} }}"
    )
}

/// The motion of the centre of mass, angular momentum about it, and the energy of the motion about it.
fn of_chain(state: [f64; 8]) -> [f64; 6] {
    let [x, y, q, p, vx, vy, w, u] = state;
    let rods = [(0.7, 0.3, q, w), (1.3, 0.45, p, u)];
    let centre = |rod: &(f64, f64, f64, f64)| {
        let (_, l, q, w) = *rod;
        let (s, c) = q.sin_cos();
        [x + l * c, y + l * s, vx - l * w * s, vy + l * w * c]
    };
    let mut mean = [0.0; 4];
    for rod in &rods {
        let at = centre(rod);
        (0..4).for_each(|k| mean[k] += rod.0 * at[k] / 2.0);
    }
    let (mut momentum, mut energy) = (0.0, 0.0);
    for rod in &rods {
        let (m, l, _, w) = *rod;
        let at = centre(rod);
        let [dx, dy, du, dv] = std::array::from_fn(|k| at[k] - mean[k]);
        let inertia = m * l * l / 3.0;
        momentum += m * (dx * dv - dy * du) + inertia * w;
        energy += 0.5 * m * (du * du + dv * dv) + 0.5 * inertia * w * w;
    }
    [mean[0], mean[1], mean[2], mean[3], momentum, energy]
}

#[test]
fn a_chain_of_two_links_falls_freely() {
    for method in ["event", "fesd"] {
        // From rest no link turns.
        let still = solved(&chain(&format!("method {method};")), "r");
        assert!(still.warnings.is_empty(), "{:?}", still.warnings);
        let known = [
            ("x", 0.0),
            ("y", -19.62),
            ("q", 0.4),
            ("p", 1.9),
            ("w", 0.0),
            ("u", 0.0),
        ];
        for (name, exact) in known {
            let found = end(&still, name)[0];
            assert!((found - exact).abs() < 1e-12, "{method}, {name}: {found}");
        }
        assert!(
            still.quality.stats.steps < 20,
            "{} steps",
            still.quality.stats.steps
        );
        let settings = format!("with {{ w = 3; u = -2; }} method {method};");
        let turning = solved(&chain(&settings), "r");
        let names = ["x", "y", "q", "p", "vx", "vy", "w", "u"];
        let found = of_chain(names.map(|name| end(&turning, name)[0]));
        let mut exact = of_chain([0.0, 0.0, 0.4, 1.9, 0.0, 0.0, 3.0, -2.0]);
        exact[0] += 2.0 * exact[2];
        exact[1] += 2.0 * exact[3] - 19.62;
        exact[3] -= 19.62;
        for (found, exact) in found.iter().zip(exact) {
            assert!((found - exact).abs() < 1e-8, "{method}: {found} {exact}");
        }
    }
}

/// A buck converter whose switch compares a voltage with a sine: x' = A x + b in between, by matrix exponentials and roots
/// with 45 digits. It is chaotic with 40 V.
#[test]
fn the_estimate_covers_a_converter_with_pulse_width_modulation() {
    let converter = |input: u32, periods: u32, method: &str| {
        format!(
            "model buck {{
               param L = 20e-3; param C = 47e-6; param R = 22;
               state v = 12; state i = 0.55;
               v' = (i - v/R)/C;
               i' = ((if 8.4*(v - 11.3) < 6 + 2.2*sin(2*pi*time/400e-6) then {input} else 0) - v)/L;
             }}
             simulate r of buck {{ horizon {periods}.5*400e-6; method {method}; }}"
        )
    };
    // At the end, and magnitudes are no smaller.
    let known = [
        (35, 20, [12.178488266022616, 0.616_291_182_032_407_6]),
        (40, 20, [12.352378437186442, 0.472_499_165_140_853_3]),
        (40, 60, [12.040246783949658, 0.735_161_563_522_495_5]),
    ];
    for (input, periods, exact) in known {
        for method in ["event", "fesd"] {
            let found = run(&converter(input, periods, method), "r");
            let estimate = found.quality.error_estimate.expect("there is one");
            for (name, exact) in ["v", "i"].iter().zip(exact) {
                let error = (end(&found, name)[0] - exact).abs() / exact;
                assert!(
                    error <= 2.0 * estimate,
                    "{input} V, {periods} periods, {method}: {error:e} above {estimate:e}"
                );
            }
        }
    }
}

#[test]
fn elements_say_where_a_switch_is_too_large_for_them() {
    let at = |offset: &str| {
        let text = format!(
            "model m {{ state x = {offset}; state y = 0; x' = 1; y' = if x > {offset} + 1 then 1 else 0; }}
             simulate run of m {{ horizon 3; method fesd; }}"
        );
        let run = run(&text, "run");
        let mut warnings = run.warnings.iter();
        (end(&run, "y")[0], warnings.any(|w| w.code == "W0727"))
    };
    for offset in ["1e13", "3e13", "1e14"] {
        assert!(at(offset).1, "{offset}");
    }
    for offset in ["0", "1e6", "1e9"] {
        let (y, is_told) = at(offset);
        assert!(!is_told && (y - 2.0).abs() < 1e-6, "{offset} {y}");
    }
}

/// A row of a sweep keeps the end of its run alone, and the warning needs how far states have moved.
#[test]
fn rows_of_sweeps_say_so_too() {
    let text = "model m { param offset = 0; state x = offset; state y = 0; x' = 1; y' = if x > offset + 1 then 1 else 0; }
                simulate r of m { horizon 3; method fesd; }";
    let codes = codes_of_rows(text, "r", ("offset", &[1e6, 1e13, 3e13]));
    let codes: Vec<Option<&str>> = codes.iter().map(Option::as_deref).collect();
    assert_eq!(codes, [None, Some("W0727"), Some("W0727")]);
}
