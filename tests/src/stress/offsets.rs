//! States, thresholds and guards far from zero: what rounding can tell apart is told apart.

use super::{Case, Extent, Family, Promise};

/// Offsets up to 10¹⁵ of a state that moves through two thresholds.
pub fn families(extent: Extent) -> Vec<Family> {
    let offsets = extent.sweep(
        &[1.7e12, 1e15],
        &[1e3, 1e6, 1e9, 1e11, 1.7e12, 1e13, 1e14, 5e14, 1e15],
    );
    let methods = ["event", "fesd", "fesd; lower timefreezing", "adaptive"];
    let count = extent.sweep(&[1], &[1, 2, 3, 4, 5, 6, 7, 8]).len();
    let cases = offsets.iter().flat_map(|&offset| {
        (0..count).flat_map(move |k| {
            methods.into_iter().flat_map(move |method| {
                let all = [thresholds, resets, bounds];
                all.map(|case| case(offset, k, method))
            })
        })
    });
    vec![Family {
        name: "far from zero",
        about: "A state that starts at an offset and passes two thresholds whole numbers away, is sent back by a jump \
                there, or is the linear term of a program with two bounds; closed forms in whole numbers.",
        hardness: "offset",
        cases: cases.flatten().collect(),
    }]
}

/// x' = ±1 over 8 from an offset: y counts the time behind one threshold, and 3 times that behind another.
fn thresholds(offset: f64, k: usize, method: &str) -> Option<Case> {
    let (first, second) = (1 + k % 4, 5 + k % 3);
    let sign = if k.is_multiple_of(2) { "" } else { "-" };
    let text = format!(
        "state x = {sign}{offset:?}; x' = {sign}1; let z = {sign}x; state y = 0; \
         y' = (if z > {offset:?} + {first} then 1 else 0) + (if z > {offset:?} + {second} then 3 else 0);"
    );
    let known = (8 - first + 3 * (8 - second)) as f64;
    Some(of(offset, text, known, 8.0, method))
}

/// A jump that sends x back to where it was, and adds 1 to y, after every 1 or 2; none by elements.
fn resets(offset: f64, k: usize, method: &str) -> Option<Case> {
    if method != "event" {
        return None;
    }
    let gap = 1 + k % 2;
    let text = format!(
        "state x = {offset:?}; x' = 1; state y = 0; y' = 0; \
         jump back when x > {offset:?} + {gap} {{ x := {offset:?}; y := y + 1; }}"
    );
    Some(of(offset, text, (7 / gap) as f64, 7.5, method))
}

/// z = x - offset between two bounds, as the solution of a program: y' = z.
fn bounds(offset: f64, k: usize, method: &str) -> Option<Case> {
    if !matches!(method, "event" | "fesd") {
        return None;
    }
    let (low, high) = (1 + k % 4, 5 + k % 3);
    let text = format!(
        "state x = {offset:?}; x' = 1; state y = 0; y' = z; \
         z in argmin 0.5*z^2 - (x - {offset:?})*z subject to {{ z >= {low}; z <= {high}; }};"
    );
    let known = (2 * low * low + high * high - low * low + 2 * (8 - high) * high) as f64 / 2.0;
    Some(of(offset, text, known, 8.0, method))
}

/// An instant is known to a few roundings of the offset.
fn of(offset: f64, text: String, known: f64, horizon: f64, method: &str) -> Case {
    Case::new(format!("{offset:.1e}"), text, horizon)
        .by(method)
        .ends("y", &[known], known)
        .rounds(16.0 * f64::EPSILON * offset)
        .promises(Promise::AccuracyOrReport)
}
