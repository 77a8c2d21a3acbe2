//! What a system makes of the rounding of its own run: the estimate, relative to the largest magnitude, covers it.

use nsd_tests::{end, run};

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
    (error / scale, trajectory.error_estimate.unwrap_or(1.0))
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
    (error / scale, trajectory.error_estimate.unwrap_or(1.0))
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
