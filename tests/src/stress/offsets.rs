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
    vec![
        contacts(extent, &offsets),
        Family {
            name: "far from zero",
            about: "A state that starts at an offset and passes two thresholds whole numbers away, is sent back by a jump \
                there, or is the linear term of a program with two bounds; closed forms in whole numbers.",
            hardness: "offset",
            cases: cases.flatten().collect(),
        },
    ]
}

/// Bodies beside a floor or each other at an offset, whose gaps are whole numbers and close after whole times.
fn contacts(extent: Extent, offsets: &[f64]) -> Family {
    let all: [fn(f64, f64) -> Case; 5] = [bounce, slide, roll, chain, stack];
    let scales = extent.sweep(&[1.0], &[1.0, 2.0, 3.0, 4.0, 5.0]);
    let cases = offsets.iter().flat_map(|&offset| {
        let scales = scales.clone();
        scales
            .into_iter()
            .flat_map(move |scale| all.map(|case| case(offset, scale)))
    });
    Family {
        name: "contacts far from zero",
        about: "A ball with restitution one half, a puck that falls, slides and stops, a disc that falls and rolls, \
                three balls that pass on their speed, and two that come to rest on each other, with gaps of 1 to 10 at \
                an offset; closed forms in whole numbers.",
        hardness: "offset",
        cases: cases.collect(),
    }
}

/// A body at an offset: each place in the text is written `$`, and lengths are multiples of one that is written `#`.
fn scene(offset: f64, scale: f64, text: &str, horizon: f64) -> Case {
    let text = text.replace('$', &format!("{offset:?}"));
    let case = Case::new(
        format!("{offset:.1e}"),
        text.replace('#', &format!("{scale:?}")),
        horizon,
    );
    case.rounds(64.0 * f64::EPSILON * offset)
        .promises(Promise::AccuracyOrReport)
}

/// It falls for one second, and its second flight ends after another.
fn bounce(offset: f64, scale: f64) -> Case {
    let text = "state q = $ + #; state v = 0; q' = v; \
        mechanics q, v { mass = 1; force = -2*#; contact floor { gap = q - $; restitution = 0.5; } }";
    scene(offset, scale, text, 1.5).ends("q", &[offset + 0.25 * scale], scale)
}

/// Its impact takes 1 of its speed of 4, and friction the rest in three seconds.
fn slide(offset: f64, scale: f64) -> Case {
    let text = "state q[2] = [$, $ + #]; state v[2] = [4*#, 0]; q' = v; \
        mechanics q, v { mass = eye(2); force = [0, -2*#]; \
          contact floor { gap = q[2] - $; slip = v[1]; restitution = 0; friction = 0.5; } }";
    let end = [offset + 8.5 * scale, offset];
    scene(offset, scale, text, 6.0).ends("q", &end, scale)
}

/// Its impact is enough to let it roll with two thirds of its speed.
fn roll(offset: f64, scale: f64) -> Case {
    let text = "state q[3] = [$, $ + 2*#, 0]; state v[3] = [3*#, 0, 0]; q' = v; \
        mechanics q, v { mass = [1, 0, 0; 0, 1, 0; 0, 0, 0.5]; force = [0, -2*#, 0]; \
          contact floor { gap = q[2] - # - $; slip = v[1] + v[3]; restitution = 0; friction = 0.5; } }";
    let end = [2.0, 0.0, -2.0].map(|v| v * scale);
    scene(offset, scale, text, 4.0).ends("v", &end, scale)
}

/// The first one meets the second after one second, which meets the third after another.
fn chain(offset: f64, scale: f64) -> Case {
    let text = "state q[3] = [$, $ + 2*#, $ + 4*#]; state v[3] = [#, 0, 0]; q' = v; \
        mechanics q, v { mass = eye(3); force = zeros(3); \
          contact first { gap = q[2] - q[1] - #; restitution = 1; } \
          contact second { gap = q[3] - q[2] - #; restitution = 1; } }";
    let end = [1.0, 3.0, 6.0].map(|q| offset + q * scale);
    scene(offset, scale, text, 4.0).ends("q", &end, scale)
}

/// Both fall with 2, the lower one from 1 and the upper one from 3.
fn stack(offset: f64, scale: f64) -> Case {
    let text = "state q[2] = [$ + #, $ + 3*#]; state v[2] = 0; q' = v; \
        mechanics q, v { mass = eye(2); force = [-2*#, -2*#]; \
          contact floor { gap = q[1] - $; restitution = 0; } \
          contact upper { gap = q[2] - q[1] - #; restitution = 0; } }";
    let end = [offset, offset + scale];
    scene(offset, scale, text, 3.0).ends("q", &end, scale)
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
