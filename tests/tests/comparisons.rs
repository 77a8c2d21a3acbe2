//! Comparisons of equal numbers, wherever the language reads numbers at an instant: values of parameters and initial
//! values, laws of jumps, their guards, ends of runs. Rust's own operators are the reference.

use nsd_tests::random::Random;
use nsd_tests::{assert_near, end, run, solved, times};
use nsdc::report::{EventKind, Trajectory};
use nsdc::study::sweep::{Axis, Grid};
use nsdc::{Options, Project};

/// A condition on small integers a, b and c.
enum Condition {
    /// One member less another one, compared with a number: members are known by their places.
    Compare(usize, &'static str, usize, i32),
    Not(Box<Condition>),
    And(Box<[Condition; 2]>),
    Or(Box<[Condition; 2]>),
}

impl Condition {
    fn random(random: &mut Random, depth: usize) -> Self {
        let two =
            |random: &mut Random| Box::new([(); 2].map(|()| Condition::random(random, depth - 1)));
        match random.below(if depth == 0 { 2 } else { 5 }) {
            2 => Condition::Not(Box::new(Condition::random(random, depth - 1))),
            3 => Condition::And(two(random)),
            4 => Condition::Or(two(random)),
            _ => {
                let one = random.below(3);
                let other = (one + 1 + random.below(2)) % 3;
                let relation = random.of(&["<", "<=", ">", ">="]);
                Condition::Compare(one, relation, other, random.below(3) as i32 - 1)
            }
        }
    }

    /// As it is written of members with these names.
    fn text(&self, names: [&str; 3]) -> String {
        match self {
            Condition::Compare(a, relation, b, number) => {
                format!("{} {relation} {} + {number}", names[*a], names[*b])
            }
            Condition::Not(inner) => format!("not ({})", inner.text(names)),
            Condition::And(both) => {
                let [a, b] = both.each_ref().map(|one| one.text(names));
                format!("(({a}) and ({b}))")
            }
            Condition::Or(both) => {
                let [a, b] = both.each_ref().map(|one| one.text(names));
                format!("(({a}) or ({b}))")
            }
        }
    }

    fn holds(&self, values: [i32; 3]) -> bool {
        match self {
            Condition::Compare(a, relation, b, number) => {
                let (left, right) = (values[*a], values[*b] + number);
                match *relation {
                    "<" => left < right,
                    "<=" => left <= right,
                    ">" => left > right,
                    _ => left >= right,
                }
            }
            Condition::Not(inner) => !inner.holds(values),
            Condition::And(both) => both.iter().all(|one| one.holds(values)),
            Condition::Or(both) => both.iter().any(|one| one.holds(values)),
        }
    }
}

/// Three numbers that are often equal.
fn numbers(random: &mut Random) -> [i32; 3] {
    [(); 3].map(|()| random.below(3) as i32)
}

#[test]
fn values_are_those_of_one_branch() {
    let mut random = Random(5);
    for case in 0..150 {
        let (condition, [a, b, c]) = (Condition::random(&mut random, 2), numbers(&mut random));
        let text = condition.text(["a", "b", "c"]);
        let found = solved(
            &format!(
                "model m {{
                   param a = {a}; param b = {b}; param c = 9;
                   param p = if {text} then 7 else 5;
                   state x = if {text} then 7 else 5;
                   state y = p;
                   x' = 0; y' = 0;
                 }}
                 simulate s of m {{ with {{ c = {c}; }} horizon 1; }}"
            ),
            "s",
        );
        let expected = if condition.holds([a, b, c]) { 7.0 } else { 5.0 };
        for state in ["x", "y"] {
            assert_eq!(
                end(&found, state),
                [expected],
                "{case}: {text}, {a} {b} {c}"
            );
        }
    }
}

/// Held states, which stand on their surfaces, and a law at an instant. What a law sets, the next one reads.
#[test]
fn sampled_laws_compare_numbers() {
    let mut random = Random(7);
    for case in 0..150 {
        let (first, second) = (
            Condition::random(&mut random, 2),
            Condition::random(&mut random, 1),
        );
        let [a, b, c] = numbers(&mut random);
        let names = ["a", "b", "c"];
        let (one, other) = (first.text(names), second.text(names));
        let found = solved(
            &format!(
                "model m {{
                   state a = {a}; state b = {b}; state c = {c}; state u = 9;
                   a' = 0; b' = 0; c' = 0; u' = 0;
                   every 1 offset 1 {{
                     u := if {one} then 7 else if {other} then 5 else 3;
                     a := if {other} then b else a;
                   }}
                 }}
                 simulate s of m {{ horizon 2.5; }}"
            ),
            "s",
        );
        let (mut a, mut u) = (a, 0);
        for _ in 0..2 {
            let [one, other] = [&first, &second].map(|condition| condition.holds([a, b, c]));
            u = if one {
                7
            } else if other {
                5
            } else {
                3
            };
            a = if other { b } else { a };
        }
        let ends = ["u", "a"].map(|state| end(&found, state)[0]);
        let expected = [u, a].map(f64::from);
        assert_eq!(ends, expected, "{case}: {one}, {other}, {a} {b} {c}");
    }
}

/// A ramp with steps of 1/4 comes to its surfaces exactly where it is sampled.
#[test]
fn what_moves_is_compared_where_it_is() {
    let mut random = Random(11);
    for case in 0..60 {
        let (condition, [_, b, c]) = (Condition::random(&mut random, 2), numbers(&mut random));
        let text = condition.text(["q", "b", "c"]);
        let found = solved(
            &format!(
                "model m {{
                   state q = 0; state b = {b}; state c = {c}; state n = 0;
                   q' = 1; b' = 0; c' = 0; n' = 0;
                   every 1 {{ n := 2*n + (if {text} then 1 else 0); }}
                 }}
                 simulate s of m {{ horizon 3.5; }}"
            ),
            "s",
        );
        let expected = (0..4).fold(0, |n, q| 2 * n + i32::from(condition.holds([q, b, c])));
        assert_eq!(
            end(&found, "n"),
            [f64::from(expected)],
            "{case}: {text}, {b} {c}"
        );
    }
}

/// A guard that becomes true by a sample lets its law jump once, and ends the run where it is a condition for that.
#[test]
fn guards_and_ends_compare_numbers() {
    let mut random = Random(13);
    for case in 0..100 {
        let (condition, [a, b, c]) = (Condition::random(&mut random, 1), numbers(&mut random));
        let text = condition.text(["a", "b", "c"]);
        let model = |law: &str| {
            format!(
                "model m {{
                   state a = 9; state b = 9; state c = 9; state on = 0; state u = 0;
                   a' = 0; b' = 0; c' = 0; on' = 0; u' = 0;
                   every 10 offset 1 {{ a := {a}; b := {b}; c := {c}; on := 1; }}
                   {law}
                 }}"
            )
        };
        let jumps = format!("jump look when on >= 1 and u < 0.5 and ({text}) {{ u := 1; }}");
        let found = solved(
            &format!("{} simulate s of m {{ horizon 2; }}", model(&jumps)),
            "s",
        );
        let holds = condition.holds([a, b, c]);
        assert_near(&end(&found, "u"), &[f64::from(u8::from(holds))], 0.0);
        let ends = format!(
            "{} simulate s of m {{ horizon 2; stop when on >= 1 and ({text} or on > 5); }}",
            model("")
        );
        let found = run(&ends, "s");
        let expected = if holds { 1.0 } else { 2.0 };
        assert_eq!(found.samples.time.last(), Some(&expected), "{case}: {text}");
    }
}

/// Equality of its two arguments has a value of its own: between them a sign is zero, and what is not zero has a sign.
#[test]
fn signs_of_nothing_are_zero_in_laws() {
    let found = solved(
        "model m {
           state e = 0; state u = 5; state v = 5; state w = 5; state s = 5;
           e' = 0; u' = 0; v' = 0; w' = 0; s' = 0;
           switch named = sign(e);
           every 1 {
             s := named;
             u := if e > 0 then 1 else if e < 0 then -1 else 0;
             v := sign(e);
             w := 3*abs(e) + max(e, 0);
             e := 2;
           }
         }
         simulate first of m { horizon 0.5; }
         simulate second of m { horizon 1.5; }",
        "first",
    );
    let ends = |found: &Trajectory| ["u", "v", "w", "s"].map(|state| end(found, state)[0]);
    assert_eq!(ends(&found), [0.0; 4]);
}

/// What slides is on its surface.
#[test]
fn what_slides_is_on_its_surface() {
    let found = solved(
        "model m {
           state x = 0.5; state u = 0; state v = 0;
           x' = 0.3 - sign(x); u' = 0; v' = 0;
           every 1 offset 1 {
             u := if x > 0 then 2 else if x < 0 then 3 else 4;
             v := if x >= 0 and x <= 0 then 1 else -1;
           }
         }
         simulate s of m { horizon 1.5; }",
        "s",
    );
    let ends = ["u", "v"].map(|state| end(&found, state)[0]);
    assert_eq!(ends, [4.0, 1.0]);
}

/// A law that comes with an event reads the side to which the state goes, and so holds what has brought it about.
#[test]
fn laws_of_events_are_on_the_side_that_they_come_to() {
    for relation in [">", ">="] {
        let text = format!(
            "model m {{
               state x = 0; state v = 1;
               x' = v; v' = 0;
               jump back when x {relation} 1 {{ v := if x {relation} 1 then -1 else 5; x := 0.75; }}
             }}
             simulate s of m {{ horizon 1.5; }}"
        );
        let found = solved(&text, "s");
        assert_eq!(times(&found, EventKind::Jump).len(), 1);
        assert_near(&end(&found, "x"), &[0.25], 1e-12);
        assert_near(&end(&found, "v"), &[-1.0], 0.0);
    }
}

/// What samples at the instant of an event is no concern of its law.
#[test]
fn samples_beside_an_event_change_nothing_for_its_law() {
    let text = |beside: &str| {
        format!(
            "model m {{
               state x = 0; state v = 1; discrete n = 0; discrete s = 0;
               x' = v; v' = 0;
               jump back when x > 1 and v > 0 {{ v := if x > 1 then -v else 5; x := 0.75; s := if n > 0 then 7 else 5; }}
               {beside}
             }}
             simulate s of m {{ horizon 1.5; }}"
        )
    };
    for beside in [
        "",
        "every 1 offset 1 { n := n + 1; }",
        "every 0.25 { n := 0; }",
    ] {
        let found = solved(&text(beside), "s");
        assert_eq!(times(&found, EventKind::Jump).len(), 1, "{beside}");
        let ends = ["x", "v", "s"].map(|state| end(&found, state)[0]);
        assert_near(&ends, &[0.25, -1.0, 5.0], 1e-12);
    }
}

/// A law that is set off by a sample reads what the sample has made, to first order, too.
#[test]
fn derivatives_are_those_of_the_round_that_jumps() {
    for (law, slope) in [
        ("if n > 0 then 3*(a - 2) else a - 2", 3.0),
        ("if n > 1 then 3*(a - 2) else a - 2", 1.0),
        ("if n >= 1 then 5*(a - 2) else a - 2", 5.0),
    ] {
        let text = format!(
            "model m {{
               param a = 2; state y = 0; discrete n = 0; discrete f = 0; y' = 0;
               every 5 offset 1 {{ n := 1; }}
               jump j when n > 0.5 and f < 0.5 {{ y := {law}; f := 1; }}
             }}
             simulate s of m {{ horizon 2; sensitivity to a; output y; }}"
        );
        let project = Project::from_text("model.nsd", &text);
        let run = project.run("s", &Options::default(), &mut ());
        let found = run.expect("it compiles").trajectory;
        assert!(found.warnings.is_empty(), "{law}: {:?}", found.warnings);
        let by_a = &found.samples.sensitivities[0].states[0];
        assert_near(by_a.at(found.samples.time.len() - 1), &[slope], 1e-12);
    }
}

/// Comparisons inside of other nonsmooth terms are on the side that decides these: a branch and its values agree.
#[test]
fn nested_terms_have_the_values_of_one_side() {
    let found = solved(
        "model m {
           state x = 0.25; discrete u = 9; discrete v = 9; discrete w = 9; x' = 0;
           signal r = if time >= 1 then 2 else 0;
           every 5 offset 1 { u := if r > 1 then 7 else 5; v := abs(r - x); w := max(r, x) + 10*sat(r - x, -1, 1); }
         }
         simulate s of m { horizon 2; }",
        "s",
    );
    let ends = ["u", "v", "w"].map(|state| end(&found, state)[0]);
    assert_near(&ends, &[7.0, 1.75, 12.0], 1e-12);
}

/// Conditions that only equal numbers decide are no constants.
#[test]
fn equal_numbers_decide_conditions() {
    let stops = |n: i32, condition: &str| {
        let text = format!(
            "model m {{ state x = 0; discrete n = {n}; x' = 1; }}
             simulate s of m {{ horizon 3; stop when {condition}; }}"
        );
        run(&text, "s").samples.time.last().copied()
    };
    for (condition, ends) in [
        ("n >= 3 and n <= 3 and x > 1", [3.0, 1.0, 3.0]),
        ("n < 3 or n > 3 or x >= 1", [0.0, 1.0, 0.0]),
    ] {
        for (n, time) in [2, 3, 4].into_iter().zip(ends) {
            if time > 0.0 {
                assert_eq!(stops(n, condition), Some(time), "{condition}, {n}");
            }
        }
    }
    let found = solved(
        "model m {
           state x = 0; discrete n = 1; discrete f = 0; x' = 1;
           jump j when n < 3 or n > 3 { n := 3; f := f + 1; }
         }
         simulate s of m { horizon 1; }",
        "s",
    );
    assert_eq!([end(&found, "n")[0], end(&found, "f")[0]], [3.0, 1.0]);
}

/// Rows of a sweep, in whatever order numbers come to be equal: what is compiled once reads them as a run of its own does.
#[test]
fn rows_of_sweeps_compare_their_numbers() {
    let mut random = Random(17);
    for case in 0..12 {
        let (condition, c) = (Condition::random(&mut random, 1), random.below(3) as i32);
        let text = condition.text(["a", "b", "c"]);
        let project = Project::from_text(
            "model.nsd",
            &format!(
                "model m {{
                   param a = 1; param b = 2; param c = {c};
                   param p = if {text} then 7 else 5;
                   state x = if {text} then 7 else 5; state y = 9; state u = 9; state k = a;
                   x' = 0; y' = p; u' = 0; k' = 0;
                   every 1 offset 1 {{ y := p; u := if {text} then k else -k; }}
                 }}
                 simulate s of m {{ horizon 1; output x, y, u; }}"
            ),
        );
        let axis = |name: &str, values: &[f64]| Axis {
            name: name.to_owned(),
            values: values.to_vec(),
        };
        let axes = vec![
            axis("a", &[1.0, 2.0, 0.0, 3.0]),
            axis("b", &[2.0, 1.0, 3.0]),
        ];
        let grid = Grid::new(axes, false).expect("there are few points");
        let sweep = project.sweep("s", &Options::default(), grid.clone());
        let sweep = sweep.unwrap_or_else(|errors| panic!("{case}: {errors}"));
        let found = sweep.rows(0..grid.len(), 1, &mut |_| {});
        for (at, row) in found.rows.iter().flatten().enumerate() {
            let [a, b] = grid.point(at)[..] else {
                panic!("there are two axes")
            };
            let [u, x] = match condition.holds([a as i32, b as i32, c]) {
                true => [a, 7.0],
                false => [-a, 5.0],
            };
            assert_eq!(row.end, [x, x, u], "{case}: {text}, {a} {b} {c}");
        }
    }
}
