//! `nsdc run --animate`: keyframes of shapes that move.

use std::fs;

use crate::terminal::{folder, nsdc};

/// The ball falls from 1 for 1 s, bounces without loss, and is taken back by 1.5 at 1.5 s.
const BALL: &str = "
model ball {
  state x : m = 0;
  state y : m = 1;
  state v : m/s = 0;
  state turn = 0;
  param r : m = 0.1;
  param rate : 1/s = 3;
  param pace : m/s = 1;
  param length : m = 1.5;
  x' = pace;
  y' = v;
  v' = -2 m/s^2;
  turn' = rate;
  jump floor when y <= 0 and v < 0 { v := -v; }
  jump back when x >= length { x := x - length; }
}
simulate bounces of ball {
  horizon 2.5;
  animate {
    segment -r, -r, 2*length, -r;
    disc x, y, r, turn;
    polygon [x, y; x + r, y; x, y + r];
    trace x, y;
    speed 2;
    title \"A ball\";
  }
}
simulate still of ball { horizon 0.5; }
";

const HORIZON: f64 = 2.5;

fn height(t: f64) -> f64 {
    if t < 1.0 {
        1.0 - t * t
    } else {
        2.0 * (t - 1.0) - (t - 1.0).powi(2)
    }
}

/// What stands between the quotes of an attribute.
fn attribute<'t>(text: &'t str, name: &str) -> &'t str {
    let rest = text.split_once(&format!(" {name}=\"")).expect(name).1;
    rest.split_once('"').expect("it is closed").0
}

/// The keyframes of an attribute of an element: shares of the period, and numbers at each.
fn keyframes(element: &str, name: &str) -> Vec<(f64, Vec<f64>)> {
    let of = format!("attributeName=\"{name}\"");
    let animate = element.lines().find(|line| line.contains(&of)).expect(name);
    assert!(animate.contains(" repeatCount=\"indefinite\""));
    assert_eq!(attribute(animate, "dur"), "1.25s");
    let number = |text: &str| -> f64 { text.parse().expect("a number") };
    let shares = attribute(animate, "keyTimes").split(';').map(number);
    let values = attribute(animate, "values").split(';');
    let frames: Vec<_> = shares
        .zip(values.map(|value| value.split(' ').map(number).collect()))
        .collect();
    assert_eq!((frames[0].0, frames[frames.len() - 1].0), (0.0, 1.0));
    assert!(frames.is_sorted_by(|a, b| a.0 <= b.0));
    frames
}

/// The numbers that a viewer shows at a share of the period: on a straight line between keyframes, the last of an instant.
fn shown(frames: &[(f64, Vec<f64>)], share: f64) -> Vec<f64> {
    let next = frames
        .partition_point(|(at, _)| *at <= share)
        .min(frames.len() - 1);
    let [(a, from), (b, to)] = [&frames[next - 1], &frames[next]];
    let part = ((share - a) / (b - a)).min(1.0);
    from.iter()
        .zip(to)
        .map(|(from, to)| from + part * (to - from))
        .collect()
}

/// The elements of a name, from tag to tag.
fn elements<'t>(svg: &'t str, name: &str) -> Vec<&'t str> {
    let moving = svg.split_once("<g transform").expect("shapes move").1;
    let tag = format!("<{name} ");
    let starts = moving.split(&tag).skip(1);
    let element = |text: &'t str| text.split_once("\n<").map_or(text, |(element, _)| element);
    starts.map(element).collect()
}

fn drawn(test: &str) -> String {
    let folder = folder(test);
    fs::write(folder.join("m.nsd"), BALL).expect("the folder is writable");
    let ran = nsdc(&folder, &["run", "m.nsd", "bounces", "--animate", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    ran.out
}

#[test]
fn keyframes_have_the_states_at_their_instants() {
    let svg = drawn("animate_states");
    let disc = elements(&svg, "circle")[0];
    let (x, y) = (keyframes(disc, "cx"), keyframes(disc, "cy"));
    for (share, value) in &y {
        let t = HORIZON * share;
        assert!((value[0] - height(t)).abs() < 1e-12, "{} at {t}", value[0]);
    }
    // Between keyframes, straight lines follow the parabolas.
    for k in 0..1000 {
        let share = f64::from(k) / 1000.0;
        let off = shown(&y, share)[0] - height(HORIZON * share);
        assert!(off.abs() < 6e-4, "{off} at {share}");
    }
    assert!(y.len() < 100, "{} keyframes", y.len());
    // The jump has two keyframes at one instant.
    let jump: Vec<f64> = x
        .iter()
        .filter(|(share, _)| (share - 0.6).abs() < 1e-12)
        .map(|(_, x)| x[0])
        .collect();
    assert!(
        jump.len() == 2 && (jump[0] - 1.5).abs() < 1e-12 && jump[1].abs() < 1e-12,
        "{jump:?}"
    );
    let spoke = elements(&svg, "line")[0];
    for (share, end) in keyframes(spoke, "x2") {
        let t = HORIZON * share;
        let centre = if share < 0.6 { t } else { t - 1.5 };
        // At the jump itself, both places are right.
        let off = end[0] - centre - 0.1 * (3.0 * t).cos();
        assert!(
            off.abs() < 1e-12 || (share - 0.6).abs() < 1e-12,
            "{off} at {t}"
        );
    }
    let corners = keyframes(elements(&svg, "polygon")[0], "points");
    for (share, points) in &corners {
        let [x, y] = [points[0], points[1]];
        assert_eq!(points[2..], [x + 0.1, y, x, y + 0.1]);
        assert!((y - height(HORIZON * share)).abs() < 1e-12);
    }
}

#[test]
fn traces_grow_from_jump_to_jump_and_what_stays_has_no_keyframes() {
    let svg = drawn("animate_traces");
    let lines = elements(&svg, "polyline");
    assert_eq!(lines.len(), 3);
    assert!(!lines[0].contains("<animate"));
    assert_eq!(attribute(lines[0], "points"), "-0.1 -0.1 3 -0.1");
    let offsets = [1, 2].map(|k| keyframes(lines[k], "stroke-dashoffset"));
    let whole = |k: usize| offsets[k][0].1[0];
    let dashes = |k: usize| attribute(lines[k + 1], "stroke-dasharray").to_owned();
    for (k, [from, to]) in [[0.0, 0.6], [0.6, 1.0]].into_iter().enumerate() {
        assert_eq!(dashes(k), format!("{} {}", whole(k), 2.0 * whole(k)));
        assert_eq!(shown(&offsets[k], from - 1e-9_f64.min(from)), [whole(k)]);
        assert!(shown(&offsets[k], to)[0].abs() < 1e-12);
        // The way until half of it, along ten thousand short lines.
        let middle = 0.5 * (from + to);
        let place = |share: f64| (HORIZON * share, height(HORIZON * share));
        let steps = (0..10_000).map(|j| {
            let [a, b] = [j, j + 1].map(|j| place(from + (middle - from) * f64::from(j) / 1e4));
            (b.0 - a.0).hypot(b.1 - a.1)
        });
        let way = whole(k) - shown(&offsets[k], middle)[0];
        assert!((way - steps.sum::<f64>()).abs() < 2e-3, "{way}");
    }
}

#[test]
fn one_scale_holds_the_whole_motion() {
    let svg = drawn("animate_scale");
    let numbers = |text: &str| -> Vec<f64> {
        let parts = text.split([' ', '(', ')']);
        parts.filter_map(|part| part.parse().ok()).collect()
    };
    let matrix = numbers(attribute(
        svg.split_once("<g").expect("shapes").1,
        "transform",
    ));
    let view = numbers(attribute(&svg, "viewBox"));
    let [a, _, _, d, e, f] = matrix[..] else {
        panic!("{matrix:?}")
    };
    assert!((a + d).abs() < 1e-9 * a && a > 0.0);
    for (x, y) in [(-0.1, -0.1), (3.0, 1.1)] {
        let (x, y) = (a * x + e, d * y + f);
        assert!(x > 0.0 && x < view[2] && y > 0.0 && y < view[3], "{x}, {y}");
    }
    for text in ["x [m]", "y [m]", "A ball", "time [s], 2 times as fast"] {
        assert!(svg.contains(&format!(">\n{text}\n<")), "{text}");
    }
    // The bar of time is passed at one speed.
    let mark = elements(&svg, "circle")[1];
    assert_eq!(keyframes(mark, "cx").len(), 2);
}

/// From -1 to 1 in 2 s: √x is a number in the second half, √(x² - 1/4) in the first and the last quarter.
#[test]
fn traces_leave_out_what_has_no_place_and_shapes_wait() {
    let folder = folder("animate_holes");
    let text = "model m { state x = -1; param turn : rad = 1; x' = 1; }
        simulate run of m { horizon 2; animate { disc sqrt(x), x, x, turn; trace x, sqrt(x^2 - 0.25); speed 1.6; } }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["run", "m.nsd", "run", "--animate", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    let disc = elements(&ran.out, "circle")[0];
    let height = keyframes(disc, "cy");
    for share in [0.5, 0.6, 0.9, 1.0] {
        let off = shown(&height, share)[0] - (2.0 * share - 1.0);
        assert!(off.abs() < 1e-9, "{off} at {share}");
    }
    assert_eq!(shown(&height, 0.25), [0.0]);
    assert!(keyframes(disc, "r").iter().all(|(_, r)| r[0] >= 0.0));
    assert_eq!(
        elements(&ran.out, "polyline").len(),
        2,
        "one line each side"
    );
    // An angle is no unit of the plane.
    assert!(ran.out.contains(">\nx\n<") && !ran.out.contains("rad"));
}

#[test]
fn what_is_not_animated_is_refused() {
    let folder = folder("animate_refused");
    fs::write(folder.join("m.nsd"), BALL).expect("the folder is writable");
    for (args, status, told) in [
        (
            &["bounces", "--animate", "f.gif"][..],
            64,
            "animations are SVG: `f.gif` must end in `.svg`",
        ),
        (
            &["bounces", "--animate", "-", "--csv", "-"],
            64,
            "`--animate`",
        ),
        (&["still", "--animate", "f.svg"], 1, "nothing is animated"),
        (
            &["bounces", "--animate", "f.svg", "--plot", "f.svg"],
            64,
            "`f.svg` is named for two results",
        ),
    ] {
        let ran = nsdc(&folder, &[&["run", "m.nsd"], args].concat());
        assert_eq!((ran.status, ran.out.as_str()), (status, ""), "{args:?}");
        assert!(ran.err.contains(told), "{args:?}: {}", ran.err);
    }
    // Of several experiments, those that say what moves are drawn.
    let all = nsdc(&folder, &["run", "m.nsd", "-q", "--animate", "f.svg"]);
    assert_eq!((all.status, all.err.as_str()), (0, ""));
    assert!(folder.join("f-bounces.svg").exists() && !folder.join("f-still.svg").exists());
}

/// Shapes in loops are those that are written one by one, in the order of the indices.
#[test]
fn shapes_in_loops_are_drawn_for_every_index() {
    let model = "model m { param r[2] = [0.1, 0.2]; state q[2, 2] = [0, 0; 1, 0]; for i in 1..2 { q[i, 1]' = i; q[i, 2]' = 0; } }";
    let draws = |name: &str, shapes: &str| {
        let folder = folder(name);
        let text = format!("{model} simulate run of m {{ horizon 1; animate {{ {shapes} }} }}");
        fs::write(folder.join("m.nsd"), text).expect("the folder is there");
        let ran = nsdc(&folder, &["run", "m.nsd", "--animate", "-"]);
        assert_eq!(ran.status, 0, "{}", ran.err);
        ran.out
    };
    let loops = "for i in 1..2 { disc q[i, 1], q[i, 2], r[i]; for j in i..2 { segment i, j, q[j, 1], 0; } }";
    let written = "disc q[1, 1], q[1, 2], r[1]; segment 1, 1, q[1, 1], 0; segment 1, 2, q[2, 1], 0;
        disc q[2, 1], q[2, 2], r[2]; segment 2, 2, q[2, 1], 0;";
    assert_eq!(draws("loops", loops), draws("written", written));
    for (shapes, told) in [
        (
            "for i in 2..1 { disc q[1, 1], i, 1; }",
            "nothing is animated",
        ),
        (
            "for i in 1..300, j in 1..300 { disc i, j, 1; }",
            "90000 turns",
        ),
        ("for i in 1..n { } disc 0, 0, 1;", "unknown name `n`"),
    ] {
        let folder = folder("loops_without_shapes");
        let text = format!("{model} simulate run of m {{ horizon 1; animate {{ {shapes} }} }}");
        fs::write(folder.join("m.nsd"), text).expect("the folder is there");
        let ran = nsdc(&folder, &["run", "m.nsd", "--animate", "f.svg"]);
        assert_eq!(
            (ran.status, ran.err.matches(told).count()),
            (1, 1),
            "{}",
            ran.err
        );
    }
    let folder = folder("wrong_loops");
    let text = format!(
        "{model} simulate run of m {{ horizon 1; animate {{ for i in 1..2 {{ disc q[i, 1], 0, 1; speed 2; title \"a\"; }} }} }}"
    );
    fs::write(folder.join("m.nsd"), text).expect("the folder is there");
    let ran = nsdc(&folder, &["check", "m.nsd"]);
    assert_eq!(
        ran.err.matches("unknown member of an animation").count(),
        2,
        "{}",
        ran.err
    );
}
