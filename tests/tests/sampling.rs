//! Digital controllers: jumps at instants t + k T, against matrix exponentials from sample to sample and closed forms.

use std::fmt::Write as _;

use nsd_tests::random::Random;
use nsd_tests::{DataFiles, assert_near, codes, end, run, run_with_data, solved, times};
use nsdc::lowering::hybrid::Structural;
use nsdc::project::prepared::{NotPrepared, Prepared};
use nsdc::report::{EventKind, Failure, Status, Trajectory};
use nsdc::{Options, Project};

/// A square matrix, row by row.
#[derive(Clone)]
struct Matrix {
    n: usize,
    entries: Vec<f64>,
}

impl Matrix {
    fn identity(n: usize) -> Self {
        let entries = (0..n * n).map(|k| f64::from(u8::from(k / n == k % n)));
        Matrix {
            n,
            entries: entries.collect(),
        }
    }

    fn times(&self, other: &Matrix) -> Matrix {
        let n = self.n;
        let entry = |k: usize| {
            let (i, j) = (k / n, k % n);
            let terms = (0..n).map(|l| self.entries[i * n + l] * other.entries[l * n + j]);
            terms.sum()
        };
        Matrix {
            n,
            entries: (0..n * n).map(entry).collect(),
        }
    }

    fn scaled(&self, by: f64) -> Matrix {
        Matrix {
            n: self.n,
            entries: self.entries.iter().map(|entry| by * entry).collect(),
        }
    }

    fn apply(&self, x: &[f64]) -> Vec<f64> {
        let row = |row: &[f64]| row.iter().zip(x).map(|(a, x)| a * x).sum();
        self.entries.chunks_exact(self.n).map(row).collect()
    }

    /// exp(A), by its series on a part of A, and squares of that.
    fn exp(&self) -> Matrix {
        let size = self
            .entries
            .iter()
            .fold(0.0, |size: f64, a| size.max(a.abs()));
        let squarings = (size * self.n as f64 * 4.0).max(1.0).log2().ceil() as i32;
        let part = self.scaled(0.5_f64.powi(squarings));
        let (mut sum, mut term) = (Matrix::identity(self.n), Matrix::identity(self.n));
        for k in 1..=24 {
            term = term.times(&part).scaled(1.0 / f64::from(k));
            for (sum, term) in sum.entries.iter_mut().zip(&term.entries) {
                *sum += term;
            }
        }
        for _ in 0..squarings {
            sum = sum.times(&sum);
        }
        sum
    }
}

/// Current and speed of a motor, and a PI controller at 1 kHz for 10 s.
const MOTOR: &str = "model motor {
  param kp = 0.8; param ki = 5; param r = 10; const T = 1e-3;
  state i = 0; state w = 0;
  discrete u = 0; discrete I = 0;
  i' = (u - 2*i - 0.1*w)/0.05;
  w' = (0.1*i - 0.02*w)/0.01;
  every T { u := kp*(r - w) + I; I := I + ki*T*(r - w); }
}
simulate run of motor { horizon 10; tolerance 1e-12; output i, w, u, I at [10]; }";

#[test]
fn ten_thousand_samples_of_a_controller_are_those_of_the_exponential() {
    let found = solved(MOTOR, "run");
    let (kp, ki, r, t) = (0.8, 5.0, 10.0, 1e-3);
    // x' = A x in x = (i, w, u), with u constant.
    let a = [
        -2.0 / 0.05,
        -0.1 / 0.05,
        1.0 / 0.05,
        0.1 / 0.01,
        -0.02 / 0.01,
        0.0,
        0.0,
        0.0,
        0.0,
    ];
    let step = Matrix {
        n: 3,
        entries: a.to_vec(),
    };
    let step = step.scaled(t).exp();
    let (mut x, mut integral) = (vec![0.0; 3], 0.0);
    for _ in 0..10_000 {
        let e = r - x[1];
        x[2] = kp * e + integral;
        integral += ki * t * e;
        x = step.apply(&x);
    }
    // That at the horizon.
    let e = r - x[1];
    let exact = [x[0], x[1], kp * e + integral, integral + ki * t * e];
    for (name, exact) in ["i", "w", "u", "I"].into_iter().zip(exact) {
        assert_near(&end(&found, name), &[exact], 1e-11);
    }
    let samples = times(&found, EventKind::Sample);
    assert_eq!(samples.len(), 10_001);
    for (k, time) in samples.iter().enumerate() {
        assert_near(&[*time], &[k as f64 * t], 1e-14);
    }
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
}

/// Where 3 · 0.1 and 0.3 meet, in binary numbers a rounding apart, both read what the other one had before.
#[test]
fn two_rates_that_meet_read_the_values_before() {
    let text = "model m {
      discrete a = 1; discrete b = 1; discrete met = 0; state x = 0; x' = a - b;
      every 0.3 { b := a; }
      jump fast every 0.1 { a := a + b; met := met + 1; }
    }
    simulate s of m { horizon 1.95; tolerance 1e-12; }";
    let found = solved(text, "s");
    let (mut a, mut b, mut x, mut all) = (1.0, 1.0, 0.0, Vec::new());
    for k in 0..20 {
        let before = (a, b);
        a = before.0 + before.1;
        if k % 3 == 0 {
            b = before.0;
            all.push(0.1 * f64::from(k));
        }
        all.push(0.1 * f64::from(k));
        x += (a - b) * if k == 19 { 0.05 } else { 0.1 };
    }
    assert_near(&end(&found, "a"), &[a], 0.0);
    assert_near(&end(&found, "b"), &[b], 0.0);
    assert_near(&end(&found, "met"), &[20.0], 0.0);
    assert_near(&end(&found, "x"), &[x], 1e-11 * x.abs());
    assert_near(&times(&found, EventKind::Sample), &all, 1e-14);
}

/// Two blocks that give one state two values end the run, whatever the others are; the same value is none of two.
#[test]
fn a_state_has_one_value() {
    let model = |value: &str| {
        format!(
            "model m {{ discrete u = 0; state x = 0; x' = u;
               every 0.5 {{ u := {value}; }} jump slow every 1 offset 0.5 {{ u := 2; }} }}
             simulate s of m {{ horizon 2; }}"
        )
    };
    let failed = run(&model("1"), "s");
    let Some(Failure::ConflictingJumps { time, state, .. }) = &failed.failure else {
        panic!("{:?}", failed.failure);
    };
    assert_eq!((*time, state.as_str()), (0.5, "u"));
    assert_near(&end(&solved(&model("2"), "s"), "x"), &[4.0], 1e-12);
}

/// The sampler of the standard library keeps its next instant as a state.
#[test]
fn a_sampler_made_of_jumps_comes_to_the_same() {
    let model = |law: &str| {
        format!(
            "model m {{ state x = 1; state v = 0; {law} x' = v; v' = -x - 2*y*(1 + 0.1*sin(time)); }}
             simulate s of m {{ horizon 3; tolerance 1e-11; output x, v; }}"
        )
    };
    let own = solved(
        &model("discrete y = 0; every 0.125 { y := v + 0.5*x; }"),
        "s",
    );
    let jump = "discrete y = 0; discrete next = 0;
        jump sample when time >= next { y := v + 0.5*x; next := next + 0.125; }";
    let other = solved(&model(jump), "s");
    for name in ["x", "v"] {
        assert_near(&end(&own, name), &end(&other, name), 1e-10);
    }
    let instants = times(&own, EventKind::Sample);
    assert_near(&instants, &times(&other, EventKind::Jump), 1e-12);
    assert_eq!(instants.len(), 25);
}

/// A block of a random system: u_j := K x + L u at t + k T.
struct Block {
    period: f64,
    offset: f64,
    rows: Vec<Vec<f64>>,
}

fn random_matrix(random: &mut Random, rows: usize, columns: usize, size: f64) -> Vec<Vec<f64>> {
    let mut entry = || random.rounded(-size, size);
    (0..rows)
        .map(|_| (0..columns).map(|_| entry()).collect())
        .collect()
}

fn sum_of(row: &[f64], names: &[String]) -> String {
    let terms = row.iter().zip(names).map(|(a, x)| format!("({a:?})*{x}"));
    terms.collect::<Vec<_>>().join(" + ")
}

/// The state at the horizon, from one instant to the next.
fn exponentials(a: &[Vec<f64>], blocks: &[Block], x0: &[f64], horizon: f64) -> Vec<f64> {
    let n = x0.len();
    let mut instants: Vec<(f64, usize)> = Vec::new();
    for (j, block) in blocks.iter().enumerate() {
        let all = (0..).map(|k| block.offset + f64::from(k) * block.period);
        instants.extend(all.take_while(|t| *t < horizon).map(|t| (t, j)));
    }
    instants.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole = Matrix {
        n,
        entries: a.concat(),
    };
    let (mut x, mut t) = (x0.to_vec(), 0.0);
    let mut at = 0;
    while at < instants.len() {
        let here = instants[at].0;
        x = whole.scaled(here - t).exp().apply(&x);
        t = here;
        let before = x.clone();
        while at < instants.len() && instants[at].0 - here < 1e-12 {
            let block = instants[at].1;
            let own = n - blocks.len() + block;
            let terms = blocks[block].rows[0].iter().zip(&before);
            x[own] = terms.map(|(k, x)| k * x).sum();
            at += 1;
        }
    }
    whole.scaled(horizon - t).exp().apply(&x)
}

#[test]
fn random_sampled_systems_follow_their_exponentials() {
    let mut random = Random(7);
    for case in 0..60 {
        let (n_states, n_blocks) = (1 + random.below(4), 1 + random.below(3));
        let n = n_states + n_blocks;
        let mut names: Vec<String> = (1..=n_states).map(|i| format!("x{i}")).collect();
        names.extend((1..=n_blocks).map(|j| format!("u{j}")));
        let mut a = random_matrix(&mut random, n_states, n, 2.0);
        a.extend((0..n_blocks).map(|_| vec![0.0; n]));
        let block = |random: &mut Random| Block {
            // Some of them meet, and none by chance next to another.
            period: 0.05 * (1 + random.below(6)) as f64,
            offset: 0.025 * random.below(5) as f64,
            rows: random_matrix(random, 1, n, 0.5),
        };
        let blocks: Vec<Block> = (0..n_blocks).map(|_| block(&mut random)).collect();
        let x0: Vec<f64> = (0..n).map(|_| random.rounded(-1.0, 1.0)).collect();
        let mut text = "model m {\n".to_owned();
        for (k, name) in names.iter().enumerate() {
            let kind = if k < n_states { "state" } else { "discrete" };
            let _ = writeln!(text, "{kind} {name} = {:?};", x0[k]);
        }
        for (row, name) in a.iter().zip(&names).take(n_states) {
            let _ = writeln!(text, "{name}' = {};", sum_of(row, &names));
        }
        for (j, block) in blocks.iter().enumerate() {
            let Block { period, offset, .. } = block;
            let law = sum_of(&block.rows[0], &names);
            let name = &names[n_states + j];
            let _ = writeln!(
                text,
                "every {period:?} offset {offset:?} {{ {name} := {law}; }}"
            );
        }
        text += "}\nsimulate s of m { horizon 1.0125; tolerance 1e-12; }";
        let found = solved(&text, "s");
        let exact = exponentials(&a, &blocks, &x0, 1.0125);
        for (name, exact) in names.iter().zip(&exact) {
            let size = exact.abs().max(1.0);
            let error = (end(&found, name)[0] - exact).abs();
            assert!(
                error <= 1e-10 * size,
                "case {case}, {name}: {error:e}\n{text}"
            );
        }
        let estimate = found
            .quality
            .error_estimate
            .expect("runs estimate their error");
        assert!(estimate <= 1e-11, "case {case}: {estimate:e}");
    }
}

/// A row of data and a sample that differ by rounding are one instant, and the new value is read.
#[test]
fn samples_read_the_row_of_their_instant() {
    let text = "model m { signal s = floor(time/0.1); discrete u = 0; discrete wrong = 0; state x = 0; x' = 0;
      every 0.1 offset 0.1 { u := s; wrong := wrong + (s - u - 1)^2; } }
    simulate s of m { horizon 5.05; }";
    let found = solved(text, "s");
    assert_near(&end(&found, "u"), &[50.0], 0.0);
    assert_near(&end(&found, "wrong"), &[0.0], 0.0);
}

/// Kicks at the instants of samples come behind them, and both are in the table.
#[test]
fn samples_and_kicks_share_instants() {
    let text = "model m { state x = 0; x' = 0; discrete n = 0; discrete u = 0;
      every 0.1 { n := n + 1; u := x; } }
    simulate s of m { horizon 1.05; perturb every 0.1 by sphere(1e-3) seed 3; }";
    let found = solved(text, "s");
    assert_near(&end(&found, "n"), &[11.0], 1e-2);
    assert_eq!(times(&found, EventKind::Sample).len(), 11);
    let plain = text.replace("discrete u = 0;", "").replace(" u := x;", "");
    assert_eq!(times(&solved(&plain, "s"), EventKind::Sample).len(), 11);
}

/// In loops and parts, each with a period of its own.
#[test]
fn loops_and_parts_sample_by_themselves() {
    let text = "model counter { param T = 1; discrete n = 0; jump tick every T { n := n + 1; } }
    model m { part a = counter { T = 0.5; } part b = counter { T = 0.25; }
      discrete c[2] = [0, 0]; state x = 0; x' = 0;
      for i in 1..2 { jump each every i offset 0.5 { c[i] := c[i] + 1; } } }
    simulate s of m { horizon 2.1; expect events(sample, a.tick) ~ [0, 0.5, 1, 1.5, 2] within 1e-15; }";
    let found = solved(text, "s");
    assert_near(&end(&found, "a.n"), &[5.0], 0.0);
    assert_near(&end(&found, "b.n"), &[9.0], 0.0);
    assert_near(&end(&found, "c"), &[2.0, 1.0], 0.0);
}

#[test]
fn instants_have_to_be_known() {
    let model = |every: &str| {
        format!(
            "model m {{ param T = 0.1; param z = 0; state x = 1; x' = -x; discrete u = 0; {every} {{ u := x; }} }}
             simulate s of m {{ horizon 1; }}"
        )
    };
    for wrong in [
        "every 0",
        "every -1",
        "every z",
        "every x",
        "every time",
        "every inf",
        "every 1/z",
        "every 1e-300",
        "every 1e-15",
        "every T offset -0.1",
        "every T offset x",
        "every T offset inf",
        "jump j every 0*T",
    ] {
        assert_eq!(codes(&model(wrong)), ["E0424"], "{wrong}");
    }
    for right in [
        "every T",
        "every 2*T offset T/3",
        "jump j every 1e-3",
        "every 5 offset 7",
    ] {
        assert_eq!(codes(&model(right)), [""; 0], "{right}");
    }
    // What jumps set, and where they stand.
    let other = |body: &str| {
        format!(
            "model m {{ state x = 1; x' = -x; param p = 1; {body} }} simulate s of m {{ horizon 1; }}"
        )
    };
    assert_eq!(codes(&other("every 1 { p := 2; }")), ["E0303"]);
    assert_eq!(codes(&other("every 1 { x := 2; x := 3; }")), ["E0318"]);
    let inside = "region a where x > 0 { every 1 { x := 2; } } region b else { }";
    assert!(codes(&other(inside)).contains(&"E0111".to_owned()));
    // In units of time.
    let units = "model m { param T : m = 1; state x : m = 1; x' = -x/(1 s); every T { x := 2; } } simulate s of m { horizon 1; }";
    assert_eq!(codes(units), ["E0232"]);
}

/// More samples than events may be end a run as events do, at once where they are seen to be one.
#[test]
fn a_run_takes_no_more_samples_than_events() {
    let text = "model m { state x = 1; x' = -x; discrete u = 0; every 1e-9 { u := x; } }
      simulate s of m { horizon 1; method event { max_events = 500; } }";
    let found = run(text, "s");
    assert_eq!(found.status, Status::IterationLimit);
    let end = found.samples.time.last().expect("it has begun");
    assert!(*end < 1e-6, "{end}");
}

#[test]
fn other_methods_refuse_samples() {
    let text = |settings: &str| {
        format!(
            "model m {{ state x = 1; x' = -x + u; discrete u = 0; every 0.1 {{ u := x; }} }}
             simulate s of m {{ horizon 1; {settings} }}"
        )
    };
    for (settings, code) in [
        ("method fesd;", "E0904"),
        ("method timestepping;", "E0904"),
        ("method smoothing;", "E0904"),
        ("method adaptive;", "E0904"),
        ("lower timefreezing;", "E0925"),
        ("method fesd; lower timefreezing;", "E0925"),
    ] {
        assert_eq!(codes(&text(settings)), [code], "{settings}");
    }
    let optimal = "model m { state x = 1; control c in [-1, 1]; x' = -x + c + u; discrete u = 0; every 0.1 { u := x; } }
      optimize s of m { horizon 1; intervals 5; minimize integral(x^2); }";
    assert_eq!(codes(optimal), ["E0904"]);
}

/// x' = u with u = -k x at every T: x(n T) = (1 - k T)^n.
const HELD: &str = "model m { param k = 1.5; param T = 0.1; state x = 1; discrete u = 0; x' = u; every T { u := -k*x; } }
  simulate s of m { horizon 1.05; tolerance 1e-11; output x, u at [0.5, 1]; ";

fn held(k: f64, t: f64) -> f64 {
    (0..10).fold(1.0, |x, _| x - k * t * x)
}

#[test]
fn gains_have_sensitivities_and_periods_none() {
    let project = Project::from_text("m.nsd", &format!("{HELD} sensitivity to k, x at 0; }}"));
    let found = project.run("s", &Options::default(), &mut ());
    let found: Trajectory = found.expect("it is differentiated").trajectory;
    let by = |k: usize| {
        let row = found.samples.time.iter().position(|t| *t == 1.0);
        found.samples.sensitivities[k].states[0].at(row.expect("it is recorded"))[0]
    };
    assert_near(&[by(0)], &[-10.0 * 0.1 * 0.85_f64.powi(9)], 1e-10);
    assert_near(&[by(1)], &[0.85_f64.powi(10)], 1e-10);
    // Known instants do not move.
    let moves = &found.samples.sensitivities[0].events;
    assert!(moves.len() >= 10 && moves.iter().all(|event| event.derivative == 0.0));
    assert_eq!(codes(&format!("{HELD} sensitivity to T; }}")), ["E0532"]);
}

#[test]
fn prepared_runs_have_other_gains_and_no_other_periods() {
    let text = format!("{HELD} }}");
    let one = |name: &str, value: f64| {
        let options = Options {
            values: vec![(name.to_owned(), value)],
            ..Options::default()
        };
        let run = Project::from_text("m.nsd", &text).run("s", &options, &mut ());
        let run = run.expect("it compiles").trajectory;
        let row = run.samples.time.iter().position(|t| *t == 1.0);
        run.samples.states[0].at(row.expect("it is recorded"))[0]
    };
    assert_near(&[one("k", 2.5)], &[held(2.5, 0.1)], 1e-10);
    // Five samples up to 1, and half a period.
    assert_near(&[one("T", 0.2)], &[(1.0_f64 - 0.3).powi(5)], 1e-10);
    assert!(Prepared::from_text(&text, "s", &["k"]).is_ok());
    let refused = Prepared::from_text(&text, "s", &["T"]);
    assert!(matches!(
        refused,
        Err(NotPrepared::Structural(_, Structural::Sampling))
    ));
}

/// A period that other parameters give, and one with kinks: samples up to 1 of each.
#[test]
fn periods_are_functions_of_parameters() {
    let derived = "model m { param h = 0.11; param T = 2*h; discrete n = 0;
      every T offset h { n := n + 1; } }";
    let part = "model counter { param T = 1; discrete n = 0; every T offset T/2 { n := n + 1; } }
      model m { param h = 0.11; part a = counter { T = 2*h; } output n = a.n; }";
    let kinked = "model m { param h = 0.11; discrete n = 0;
      every max(abs(-2*h), 1e-3) offset if h > 0.01 then h else 2*h { n := n + 1; } }";
    for model in [derived, part, kinked] {
        let text = format!("{model} simulate s of m {{ horizon 1; output n at [1]; }}");
        let project = Project::from_text("m.nsd", &text);
        for h in [0.01, 0.11, 0.3, 0.45] {
            let options = Options {
                values: vec![("h".to_owned(), h)],
                ..Options::default()
            };
            let run = project.run("s", &options, &mut ()).expect("it compiles");
            let first = if model == kinked && h == 0.01 {
                2.0 * h
            } else {
                h
            };
            let samples = ((1.0 - first) / (2.0 * h)).floor() + 1.0;
            assert_near(&end(&run.trajectory, "n"), &[samples], 0.0);
        }
        let refused = Prepared::from_text(&text, "s", &["h"]);
        assert!(matches!(
            refused,
            Err(NotPrepared::Structural(_, Structural::Sampling))
        ));
        let text = text.replace("horizon 1;", "horizon 1; sensitivity to h;");
        assert_eq!(codes(&text), ["E0532"]);
    }
}

/// Rows of data at 0.1 k and multiples of 0.1 in binary numbers: all samples read what begins at their instant, whatever
/// else is met there; data at the horizon, too.
#[test]
fn known_instants_that_differ_by_rounding_are_one() {
    let rows: String = (0..=80)
        .map(|k| format!("{}.{},{k}\n", k / 10, k % 10))
        .collect();
    let files = DataFiles(vec![("rows.csv", format!("t,r\n{rows}"))]);
    for (horizon, perturb) in [
        (5.05, ""),
        (5.05, "perturb every 0.3 by sphere(1e-9) seed 1;"),
        (0.3, ""),
        (0.6, ""),
        (0.7, ""),
        (1.7, ""),
    ] {
        let text = format!(
            "model m {{ signal r = table(\"rows.csv\", \"r\", fit=hold); signal f = floor(time/0.1);
              signal g = floor(time/0.3);
              discrete n = 0; discrete a = 0; discrete b = 0; discrete c = 0; discrete d = 0;
              every 0.1 {{ a := a + (r - n)^2; b := b + (f - n)^2; n := n + 1; }}
              every 0.3 {{ c := c + (3*g - f)^2; d := d + (3*g - r)^2; }} }}
            simulate s of m {{ horizon {horizon:?}; {perturb} output a, b, c, d; }}"
        );
        let found = run_with_data(&text, &files, "s");
        // Roundings are known up to the horizon: floor(0.3/0.1) is 2 there.
        let names: &[&str] = match horizon == 5.05 {
            true => &["a", "b", "c", "d"],
            false => &["a"],
        };
        for name in names {
            assert_near(&end(&found, name), &[0.0], 1e-4);
        }
    }
}
