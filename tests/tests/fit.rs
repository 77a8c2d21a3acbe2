//! Parameters from measurements: against least squares in closed form, against minima found in another way, and how often
//! intervals hold the parameters that measurements were made with.

use std::fmt::Write;

use nsd_tests::random::Random;
use nsdc::files::Memory;
use nsdc::report::{Bound, Estimate, Fit, Status, Trajectory};
use nsdc::{Messages, Options, Project};

fn project(text: &str, data: &str) -> Project {
    let files: Memory = [("model.nsd", text), ("data.csv", data)]
        .into_iter()
        .collect();
    Project::from_files("model.nsd", files).expect("the text is there")
}

/// The run of the fit `f` of a text to data.
fn ran(text: &str, data: &str) -> Trajectory {
    let found = project(text, data).run("f", &Options::default(), &mut ());
    found.unwrap_or_else(|errors| panic!("{errors}")).trajectory
}

fn fitted(text: &str, data: &str) -> (Trajectory, Fit) {
    let run = ran(text, data);
    let fit = run.several.fit.clone().expect("it is a fit");
    (run, fit)
}

pub fn estimate<'f>(fit: &'f Fit, name: &str) -> &'f Estimate {
    let mut all = fit.estimates.iter();
    all.find(|one| one.name == name).expect("it is free")
}

pub fn codes(run: &Trajectory) -> Vec<&str> {
    run.warnings.iter().map(|w| w.code.as_str()).collect()
}

pub fn close(a: f64, b: f64, within: f64) {
    assert!((a - b).abs() <= within, "{a} is not {b} within {within}");
}

/// A normal deviate (Box & Muller 1958).
pub fn normal(random: &mut Random) -> f64 {
    let (radius, angle) = (1.0 - random.unit(), random.unit());
    (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
}

/// The text of a table with columns of these values.
pub fn table(names: &str, rows: impl Iterator<Item = Vec<f64>>) -> String {
    let mut text = format!("{names}\n");
    for row in rows {
        let cells: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(text, "{}", cells.join(",")).expect("a string takes text");
    }
    text
}

/// x = b + a t.
const LINE: &str = "model line { param a = 1; param b = 2; state x = b; x' = a; }";

/// Twelve values around 1.5 + 0.4 t.
fn line_data() -> Vec<[f64; 2]> {
    let mut random = Random(5);
    let times = (0..12).map(|k| 0.25 * f64::from(k));
    times
        .map(|t| [t, 1.5 + 0.4 * t + 0.1 * normal(&mut random)])
        .collect()
}

pub fn rows(points: &[[f64; 2]]) -> impl Iterator<Item = Vec<f64>> + '_ {
    points.iter().map(|point| point.to_vec())
}

/// Intercept and slope of weighted points, with Σ w² r² and the inverse of [Σ w², Σ w² t; Σ w² t, Σ w² t²].
fn regression(points: &[[f64; 3]]) -> ([f64; 2], f64, [[f64; 2]; 2]) {
    let sum = |f: &dyn Fn(&[f64; 3]) -> f64| points.iter().map(f).sum::<f64>();
    let (n, t, tt) = (
        sum(&|[_, _, w]| w * w),
        sum(&|[t, _, w]| w * w * t),
        sum(&|[t, _, w]| w * w * t * t),
    );
    let (y, ty) = (sum(&|[_, y, w]| w * w * y), sum(&|[t, y, w]| w * w * t * y));
    let det = n * tt - t * t;
    let inverse = [[tt / det, -t / det], [-t / det, n / det]];
    let b = inverse[0][0] * y + inverse[0][1] * ty;
    let a = inverse[1][0] * y + inverse[1][1] * ty;
    let squares = sum(&|[t, y, w]| (w * (b + a * t - y)).powi(2));
    ([b, a], squares, inverse)
}

#[test]
fn a_line_is_that_of_linear_regression() {
    let points = line_data();
    let text = format!(
        "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> y; }} free {{ a; b; }} }}"
    );
    let (run, fit) = fitted(&text, &table("time,y", rows(&points)));
    let weighted: Vec<[f64; 3]> = points.iter().map(|&[t, y]| [t, y, 1.0]).collect();
    let ([b, a], squares, inverse) = regression(&weighted);
    assert_eq!(run.status, Status::Solved);
    let (slope, start) = (estimate(&fit, "a"), estimate(&fit, "b"));
    close(slope.value, a, 1e-8);
    close(start.value, b, 1e-8);
    close(run.objective.expect("squares"), squares, 1e-9);
    close(fit.residual_norm, squares.sqrt(), 1e-9);
    assert_eq!(fit.degrees_of_freedom, 10);
    let variance = squares / 10.0;
    close(fit.deviation.expect("ten degrees"), variance.sqrt(), 1e-9);
    // In the order of `free`: a, then b.
    let covariance = |j: usize, k: usize| fit.covariance[j][k].expect("it is determined");
    close(covariance(0, 0), variance * inverse[1][1], 1e-9);
    close(covariance(1, 1), variance * inverse[0][0], 1e-9);
    close(covariance(0, 1), variance * inverse[0][1], 1e-9);
    let error = (variance * inverse[1][1]).sqrt();
    close(slope.standard_error.expect("determined"), error, 1e-9);
    // Student's t with ten degrees of freedom, from a table.
    let [low, high] = slope.interval.expect("determined");
    close(low, a - 2.228_138_852 * error, 1e-8);
    close(high, a + 2.228_138_852 * error, 1e-8);
    let correlation = inverse[0][1] / (inverse[0][0] * inverse[1][1]).sqrt();
    close(
        fit.correlation[0][1].expect("determined"),
        correlation,
        1e-8,
    );
    for (residual, [t, y]) in fit.data[0].residuals.iter().zip(&points) {
        close(*residual, b + a * t - y, 1e-7);
    }
    assert!(codes(&run).is_empty());
}

#[test]
fn several_columns_and_files_have_their_weights_and_cells_may_be_empty() {
    let points = line_data();
    let mut text = "time,y,z\n".to_owned();
    for (k, [t, y]) in points.iter().enumerate() {
        // Every third cell is missing, and there are two rows of each instant.
        let z = match k % 3 {
            0 => ["", "nan"][k % 2].to_owned(),
            _ => (2.0 * y + 0.05).to_string(),
        };
        writeln!(text, "{t},{y},{z}\n{t},{},", y + 0.01).expect("a string takes text");
    }
    text += "7,0,0\n";
    let model = "model line { param a = 1; state x = 2; output twice = 2*x; x' = a; }
        fit f of line { horizon 3; data \"data.csv\" { x -> y; } data \"data.csv\" { twice -> z weight 0.5; }
          free { a; } initial { x free; } }";
    let (run, fit) = fitted(model, &text);
    assert_eq!(run.status, Status::Solved);
    // 0.5 (2 x - z) = x - z/2.
    let mut all = Vec::new();
    for (k, &[t, y]) in points.iter().enumerate() {
        all.extend([[t, y, 1.0], [t, y + 0.01, 1.0]]);
        if k % 3 != 0 {
            all.push([t, y + 0.025, 1.0]);
        }
    }
    let ([b, a], squares, _) = regression(&all);
    close(estimate(&fit, "a").value, a, 1e-8);
    close(estimate(&fit, "x at 0").value, b, 1e-8);
    close(run.objective.expect("squares"), squares, 1e-8);
    let counts: Vec<[usize; 3]> = (fit.data.iter())
        .map(|data| [data.time.len(), data.missing, data.outside])
        .collect();
    assert_eq!(counts, [[24, 0, 1], [8, 16, 1]]);
}

#[test]
fn a_decay_has_the_minimum_that_a_search_finds() {
    let mut random = Random(11);
    let points: Vec<[f64; 2]> = (1..=30)
        .map(|k| 0.1 * f64::from(k))
        .map(|t| [t, 2.0 * (-0.7 * t).exp() + 0.02 * normal(&mut random)])
        .collect();
    let text = "model decay { param k = 3; state x = 2; x' = -k*x; }
        fit f of decay { horizon 3; data \"data.csv\" { x -> y; } free { k in [0, 10]; } expect k ~ 0.7 within 0.03; }";
    let (run, fit) = fitted(text, &table("time,y", rows(&points)));
    // Golden section over k.
    let squares = |k: f64| {
        let r = points.iter().map(|[t, y]| 2.0 * (-k * t).exp() - y);
        r.map(|r| r * r).sum::<f64>()
    };
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.3, 1.5);
    while high - low > 1e-9 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        match squares(a) < squares(b) {
            true => high = b,
            false => low = a,
        }
    }
    let k = 0.5 * (low + high);
    assert_eq!(run.status, Status::Solved);
    let found = estimate(&fit, "k");
    close(found.value, k, 1e-7);
    let slopes = points
        .iter()
        .map(|[t, _]| (2.0 * t * (-k * t).exp()).powi(2));
    let error = (squares(k) / 29.0 / slopes.sum::<f64>()).sqrt();
    close(found.standard_error.expect("determined"), error, 1e-7);
    assert!(
        found
            .interval
            .is_some_and(|[low, high]| low < 0.7 && 0.7 < high)
    );
}

/// x = c exp(-a t) with both free: the columns of J are exp(-a t) and -c t exp(-a t), whatever x(0) depends on in the model.
#[test]
fn a_free_initial_value_depends_on_nothing_else_that_is_free() {
    let mut random = Random(21);
    let points: Vec<[f64; 2]> = (0..=30)
        .map(|k| 0.1 * f64::from(k))
        .map(|t| [t, 2.0 * (-0.7 * t).exp() + 0.02 * normal(&mut random)])
        .collect();
    let data = table("time,y", rows(&points));
    for given in [
        "state x = a; x' = -a*x; } fit f of d {",
        "state x = 1; x' = -a*x; } fit f of d { with { x = 8*a; }",
    ] {
        let text = format!(
            "model d {{ param a = 1; {given} horizon 3; data \"data.csv\" {{ x -> y; }} free {{ a; }} initial {{ x free; }} }}"
        );
        let (run, fit) = fitted(&text, &data);
        assert_eq!(run.status, Status::Solved, "{:?}", run.failure);
        let (a, c) = (estimate(&fit, "a"), estimate(&fit, "x at 0"));
        // r is orthogonal to both columns, and the standard errors are those of them.
        let columns = points.iter().map(|[t, y]| {
            let e = (-a.value * t).exp();
            (c.value * e - y, -c.value * t * e, e)
        });
        let sum = |f: &dyn Fn((f64, f64, f64)) -> f64| columns.clone().map(f).sum::<f64>();
        close(sum(&|(r, by_a, _)| r * by_a), 0.0, 1e-5);
        close(sum(&|(r, _, by_c)| r * by_c), 0.0, 1e-5);
        let (aa, ac, cc) = (
            sum(&|(_, a, _)| a * a),
            sum(&|(_, a, c)| a * c),
            sum(&|(_, _, c)| c * c),
        );
        let scale = sum(&|(r, _, _)| r * r) / 29.0 / (aa * cc - ac * ac);
        let errors = [a, c].map(|one| one.standard_error.expect("determined"));
        close(errors[0], (scale * cc).sqrt(), 1e-6);
        close(errors[1], (scale * aa).sqrt(), 1e-6);
    }
}

#[test]
fn a_bound_that_is_reached_is_said_and_the_rest_is_at_its_best_there() {
    let points = line_data();
    let text = format!(
        "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> y; }} free {{ a in [0.6, 2]; b; }} }}"
    );
    let (run, fit) = fitted(&text, &table("time,y", rows(&points)));
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec!["W0742"]));
    let (slope, start) = (estimate(&fit, "a"), estimate(&fit, "b"));
    assert_eq!((slope.value, slope.at_bound), (0.6, Some(Bound::Lower)));
    assert_eq!((slope.standard_error, slope.interval), (None, None));
    // b is the mean of what is left, with the standard error of a mean.
    let left: Vec<f64> = points.iter().map(|[t, y]| y - 0.6 * t).collect();
    let mean = left.iter().sum::<f64>() / 12.0;
    let squares: f64 = left.iter().map(|y| (y - mean).powi(2)).sum();
    close(start.value, mean, 1e-8);
    let error = (squares / 11.0 / 12.0).sqrt();
    close(start.standard_error.expect("determined"), error, 1e-8);
}

#[test]
fn outliers_pull_as_hubers_loss_lets_them() {
    let mut points = line_data();
    points[3][1] += 20.0;
    points[8][1] -= 7.0;
    let d = 0.15;
    let text = format!(
        "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> y; }} free {{ a; b; }} loss huber({d}); }}"
    );
    let (run, fit) = fitted(&text, &table("time,y", rows(&points)));
    assert_eq!(run.status, Status::Solved);
    let (a, b) = (estimate(&fit, "a").value, estimate(&fit, "b").value);
    close(a, 0.4, 0.1);
    // The minimum of a convex function: Σ ψ(r) = 0 and Σ ψ(r) t = 0, ψ(r) being r cut to [-d, d].
    let psi = |[t, y]: &[f64; 2]| (b + a * t - y).clamp(-d, d);
    close(points.iter().map(psi).sum(), 0.0, 1e-5);
    close(
        points.iter().map(|point| psi(point) * point[0]).sum(),
        0.0,
        1e-5,
    );
    assert!(
        estimate(&fit, "a")
            .standard_error
            .is_some_and(|error| error < 0.1)
    );
    // Without it the outliers win.
    let text = text.replace(&format!("loss huber({d});"), "");
    let (_, squared) = fitted(&text, &table("time,y", rows(&points)));
    assert!((estimate(&squared, "a").value - 0.4).abs() > 1.0);
}

/// Twelve points are few, and next to bounds that most residuals are beyond fewer still.
#[test]
fn intervals_of_hubers_loss_hold_the_truth_or_are_unknown() {
    let mut random = Random(11);
    let mut known = [0; 4];
    for (known, d) in known.iter_mut().zip([0.2, 0.1, 0.03, 1e-6]) {
        let mut held = 0;
        for _ in 0..100 {
            let times = (0..12).map(|k| 0.25 * f64::from(k));
            let points = times.map(|t| vec![t, 1.5 + 0.4 * t + 0.1 * normal(&mut random)]);
            let text = format!(
                "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> y; }} free {{ a; b; }} loss huber({d}); }}"
            );
            let (_, fit) = fitted(&text, &table("time,y", points));
            if let Some([low, high]) = estimate(&fit, "a").interval {
                *known += 1;
                held += usize::from(low <= 0.4 && 0.4 <= high);
            }
        }
        assert!(10 * held >= 9 * *known, "{d}: {held} of {known}");
    }
    assert!(
        known[0] == 100 && known[1] >= 95 && known[3] == 0,
        "{known:?}"
    );
}

#[test]
fn what_only_ratios_matter_to_is_named() {
    let truth = |t: f64| (1.3_f64.sqrt() * t).cos();
    let times = (0..40).map(|k| 0.2 * f64::from(k));
    let data = table("time,y", times.map(|t| vec![t, truth(t)]));
    let text = "model oscillator { param k = 2; param m = 2; param c = 1; state q = 1; state v = 0;
          q' = v; v' = -k/m*q; }
        fit f of oscillator { horizon 8; data \"data.csv\" { q -> y; } free { k in [0.1, 10]; m in [0.1, 10]; } }
        fit unused of oscillator { horizon 8; data \"data.csv\" { q -> y; } with { m = 1; } free { k; c; } }";
    let (run, fit) = fitted(text, &data);
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec!["W0741"]));
    let message = &run.warnings[0].message;
    assert!(
        message.contains("`k`, `m`") && message.contains("k^0.71 m^0.71"),
        "{message}"
    );
    let span = run.warnings[0].span.expect("it has a place");
    assert_eq!(&text[span.start as usize..span.end as usize], "k");
    let (k, m) = (estimate(&fit, "k"), estimate(&fit, "m"));
    close(k.value / m.value, 1.3, 1e-6);
    assert!(k.is_determined == Some(false) && k.standard_error.is_none() && m.interval.is_none());
    let open: Vec<bool> = fit.directions.iter().map(|one| one.is_determined).collect();
    assert_eq!(open, [true, false]);
    // What nothing depends on.
    let found = project(text, &data).run("unused", &Options::default(), &mut ());
    let run = found.unwrap_or_else(|errors| panic!("{errors}")).trajectory;
    assert_eq!(codes(&run), ["W0741"]);
    let message = &run.warnings[0].message;
    assert!(
        message.contains("do not determine `c`: no measurement"),
        "{message}"
    );
    let fit = run.several.fit.expect("it is a fit");
    close(estimate(&fit, "k").value, 1.3, 1e-6);
    let determined = ["k", "c"].map(|name| estimate(&fit, name).is_determined);
    assert_eq!(determined, [Some(true), Some(false)]);
    assert_eq!(run.status, Status::Solved);
}

const SLIDER: &str = "model slider { param k = 1; param mu = 0.3; state q = 0; state v = 0;
  let slip = v - 0.2;
  q' = v; v' = -k*q - mu*(0.6 + 0.4*exp(-abs(slip)/0.1))*sign(slip); }";

/// Positions of a mass on a belt at instants, by a method of its own: Runge and Kutta's of order four while it slips, and
/// formulas while it sticks.
fn stick_slip([k, mu]: [f64; 2], instants: &[f64]) -> Vec<f64> {
    let belt = 0.2;
    let rate = |[q, v]: [f64; 2]| {
        let friction = mu * (0.6 + 0.4 * (-(belt - v) / 0.1_f64).exp());
        [v, friction - k * q]
    };
    let along = |[q, v]: [f64; 2], [a, b]: [f64; 2], h: f64| [q + h * a, v + h * b];
    let step = |x: [f64; 2], h: f64| {
        let a = rate(x);
        let b = rate(along(x, a, 0.5 * h));
        let c = rate(along(x, b, 0.5 * h));
        let d = rate(along(x, c, h));
        let mean = |i: usize| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0;
        along(x, [mean(0), mean(1)], h)
    };
    let h: f64 = 1e-3;
    let (mut t, mut x, mut sticks) = (0.0, [0.0, 0.0], false);
    let mut found = Vec::new();
    for &instant in instants {
        while t < instant {
            let left = instant - t;
            if sticks {
                // Until the spring pulls as hard as friction at rest.
                let rest = (mu / k - x[0]) / belt;
                let lasts = rest.min(left);
                (x[0], t) = (
                    x[0] + belt * lasts,
                    if rest < left { t + rest } else { instant },
                );
                if rest < left {
                    // Torn loose: what is less than the belt's speed grows by itself.
                    (sticks, x[1]) = (false, belt - 1e-9);
                }
                continue;
            }
            let mut size = h.min(left);
            let next = step(x, size);
            if next[1] < belt {
                (x, t) = (next, if size == left { instant } else { t + size });
                continue;
            }
            // The instant at which it is as fast as the belt.
            let (mut low, mut high) = (0.0, size);
            for _ in 0..50 {
                size = 0.5 * (low + high);
                match step(x, size)[1] < belt {
                    true => low = size,
                    false => high = size,
                }
            }
            (x, t, sticks) = ([step(x, size)[0], belt], t + size, true);
        }
        found.push(x[0]);
    }
    found
}

/// 200 measurements of a run in 20 s with normal errors of deviation 0.02, for seeds from 0 to 99: intervals of 95 % hold
/// each of both parameters in at least 90 of the 100.
#[test]
fn friction_and_stiffness_of_stick_slip_are_in_their_intervals() {
    let instants: Vec<f64> = (1..=200).map(|k| 0.1 * f64::from(k)).collect();
    let truth = [1.0, 0.3];
    let positions = stick_slip(truth, &instants);
    let text = format!(
        "{SLIDER} fit f of slider {{ horizon 20.01; data \"data.csv\" {{ q -> position; }}
           with {{ mu = 0.25; k = 0.9; }} free {{ k in [0, 10]; mu in [0, 1]; }} }}"
    );
    let mut inside = [0, 0];
    for seed in 0..100 {
        let mut random = Random(seed);
        let measured = instants.iter().zip(&positions);
        let measured = measured.map(|(&t, q)| vec![t, q + 0.02 * normal(&mut random)]);
        let (run, fit) = fitted(&text, &table("time,position", measured));
        assert_eq!(run.status, Status::Solved, "seed {seed}");
        for ((inside, estimate), truth) in inside.iter_mut().zip(&fit.estimates).zip(truth) {
            let [low, high] = estimate.interval.expect("it is determined");
            *inside += i32::from(low <= truth && truth <= high);
            // An interval that holds everything says nothing.
            assert!(high - low < 0.05, "seed {seed}: {low} to {high}");
        }
    }
    assert!(
        inside.iter().all(|&inside| inside >= 90),
        "{inside:?} of 100"
    );
}

/// Mass, friction and stiffness of the same: only ratios matter.
#[test]
fn mass_and_friction_and_stiffness_together_are_not_determined() {
    let instants: Vec<f64> = (1..=200).map(|k| 0.1 * f64::from(k)).collect();
    let mut random = Random(3);
    let measured = stick_slip([1.0, 0.3], &instants);
    let measured = instants.iter().zip(&measured);
    let measured = measured.map(|(&t, q)| vec![t, q + 0.02 * normal(&mut random)]);
    let model = SLIDER
        .replace("param k = 1;", "param k = 1; param m = 1;")
        .replace("v' = -k*q - mu*", "v' = -k/m*q - mu/m*");
    let text = format!(
        "{model} fit f of slider {{ horizon 20.01; data \"data.csv\" {{ q -> position; }}
           with {{ mu = 0.25; k = 0.9; }} free {{ k in [0, 10]; mu in [0, 1]; m in [0.5, 2]; }} }}"
    );
    let (run, fit) = fitted(&text, &table("time,position", measured));
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec!["W0741"]));
    let message = &run.warnings[0].message;
    assert!(message.contains("`k`, `mu`, `m`"), "{message}");
    let value = |name: &str| estimate(&fit, name).value;
    close(value("k") / value("m"), 1.0, 0.02);
    close(value("mu") / value("m"), 0.3, 0.02);
}

#[test]
fn a_run_that_fails_is_a_shorter_step() {
    // x = 1/(1 - a t), which blows up before the horizon from a = 1 on.
    let times = (0..=10).map(|k| 0.1 * f64::from(k));
    let data = table("time,y", times.map(|t| vec![t, 1.0 / (1.0 - 0.9 * t)]));
    let text = "model blows { param a = 0.2; state x = 1; x' = a*x^2; }
        fit f of blows { horizon 1; data \"data.csv\" { x -> y; } free { a in [0, 5]; } }";
    let (run, fit) = fitted(text, &data);
    assert_eq!(run.status, Status::Solved);
    assert!(fit.search.failed_steps > 0, "{:?}", fit.search);
    close(estimate(&fit, "a").value, 0.9, 1e-6);
    // Where the first run fails there is nothing to begin with.
    let run = ran(&text.replace("param a = 0.2", "param a = 2"), &data);
    assert_eq!(run.status, Status::NumericalFailure);
    assert!(run.several.fit.is_none());
}

#[test]
fn events_that_come_or_go_are_told() {
    // A ball that is thrown harder strikes the floor fewer times.
    let text =
        "model ball { param g = 9.81; param u = 1; state q = 1; state v = u; q' = v; v' = -g;
          jump floor when q <= 0 and v < 0 { v := -0.8*v; } }
        fit f of ball { horizon 1; data \"data.csv\" { q -> y; } free { u in [0, 20]; } }";
    // q = 1 + 4 t - g t²/2 strikes after 0.99 s.
    let strikes = (4.0 + (16.0 + 2.0 * 9.81_f64).sqrt()) / 9.81;
    let times = (0..=40)
        .map(|k| 0.02 * f64::from(k))
        .filter(|&t| t < strikes);
    let data = table(
        "time,y",
        times.map(|t| vec![t, 1.0 + 4.0 * t - 4.905 * t * t]),
    );
    let (run, fit) = fitted(text, &data);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "u").value, 4.0, 1e-6);
    assert_eq!(codes(&run), ["W0743"]);
}

#[test]
fn where_a_derivative_is_lost_differences_take_its_place() {
    // The run starts on the surface y = 0, where derivatives by x(0) and by a parameter that moves y off it are not known.
    let text = "model start { param a = 0.5; param b = 2; state x = 0; state y = 0; x' = b + step(y); y' = a; }
        fit f of start { horizon 1; data \"data.csv\" { x -> y; } free { b; } initial { y free in [-1, 1]; } }";
    let times = (0..=10).map(|k| 0.1 * f64::from(k));
    // From y = -0.2 on it switches after 0.4.
    let data = table(
        "time,y",
        times.map(|t| vec![t, 1.5 * t + (t - 0.4).max(0.0)]),
    );
    let (run, fit) = fitted(text, &data);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "b").value, 1.5, 1e-4);
    close(estimate(&fit, "y at 0").value, -0.2, 1e-4);
    // In two dimensions both surfaces are met at once where the fit ends.
    let text = "model corner { param a = 0.8; state x = -1; state y = -1; x' = a + 0.5*step(y); y' = 1 + step(x); }
        fit f of corner { horizon 1.5; data \"data.csv\" { x -> y; } free { a in [0.1, 3]; } }";
    let times = (0..=15).map(|k| 0.1 * f64::from(k));
    let data = table(
        "time,y",
        times.map(|t| vec![t, t - 1.0 + 0.5 * (t - 1.0).max(0.0)]),
    );
    let (run, fit) = fitted(text, &data);
    close(estimate(&fit, "a").value, 1.0, 1e-4);
    assert!(codes(&run).contains(&"W0744"), "{:?}", run.warnings);
}

#[test]
fn several_starts_find_the_least_of_several_minima_always_the_same() {
    let times = (0..=60).map(|k| 0.1 * f64::from(k));
    let data = table("time,y", times.map(|t| vec![t, (3.0 * t).cos()]));
    let text = "model wave { param w = 1.2; state q = 1; state v = 0; q' = v; v' = -w^2*q; }
        fit f of wave { horizon 6; data \"data.csv\" { q -> y; } free { w in [0.1, 10]; } }";
    let (_, alone) = fitted(text, &data);
    assert!(
        (estimate(&alone, "w").value - 3.0).abs() > 0.5,
        "it is caught in another minimum"
    );
    let text = text.replace("free {", "starts 20 by gauss(1) seed 4; free {");
    let (run, fit) = fitted(&text, &data);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "w").value, 3.0, 1e-6);
    assert_eq!(fit.search.starts, 20);
    assert!((1..20).contains(&fit.search.best_starts));
    assert_eq!(fitted(&text, &data).1, fit);
}

#[test]
fn where_nothing_is_gained_and_the_gradient_stays_it_is_no_solution() {
    // A run that comes to x = 1 before its end jumps far away: p = 1 is the best and has a slope.
    let text = "model cliff { param p = 0.5; state x = 0; state z = 0; x' = p; z' = 0;
          jump top when x >= 1 { z := z + 100; x := x - 10; } output y = x + z; }
        fit f of cliff { horizon 1; data \"data.csv\" { y -> y; } free { p in [0, 5]; } }";
    let run = ran(text, "time,y\n0.5,1\n1,2\n");
    assert_eq!(run.status, Status::Feasible);
    let failure = run.failure.expect("it says why");
    assert!(
        failure.to_string().contains("standard errors from here"),
        "{failure}"
    );
    assert!(
        run.several
            .fit
            .is_some_and(|fit| fit.estimates[0].value < 1.0)
    );
}

#[test]
fn an_offset_or_an_outlier_is_no_accuracy() {
    // The line, far away from zero: the runs are as accurate in what changes as without it.
    let points = line_data();
    let far: Vec<[f64; 2]> = points.iter().map(|&[t, y]| [t, 6.4e6 + 1e-3 * y]).collect();
    let text =
        "model far { param a = 1; param b = 2; state x = b; x' = a; output q = 6.4e6 + 1e-3*x; }
        fit f of far { horizon 3; data \"data.csv\" { q -> y; } free { a; b; } }";
    let (run, fit) = fitted(text, &table("time,y", rows(&far)));
    let weighted: Vec<[f64; 3]> = points.iter().map(|&[t, y]| [t, y, 1.0]).collect();
    let ([b, a], ..) = regression(&weighted);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "a").value, a, 1e-4);
    close(estimate(&fit, "b").value, b, 1e-4);
    // A fill value beyond Huber's bound pulls by that alone: Σ ψ = 0.
    let mut filled = points.clone();
    filled[4][1] = 1e10;
    let text = format!(
        "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> y; }} free {{ a; b; }} loss huber(0.15); }}"
    );
    let (run, fit) = fitted(&text, &table("time,y", rows(&filled)));
    assert_eq!(run.status, Status::Solved);
    let (a, b) = (estimate(&fit, "a").value, estimate(&fit, "b").value);
    let psi = |[t, y]: &[f64; 2]| (b + a * t - y).clamp(-0.15, 0.15);
    close(filled.iter().map(psi).sum(), 0.0, 1e-3);
    close(filled.iter().map(|p| psi(p) * p[0]).sum(), 0.0, 1e-3);
}

#[test]
fn what_is_near_zero_is_determined_as_all_else_is() {
    // x(0) + a t of values around zero.
    let mut random = Random(8);
    let points: Vec<[f64; 2]> = (0..12)
        .map(|k| [0.25 * f64::from(k), 1e-7 * normal(&mut random)])
        .collect();
    let text = format!(
        "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> y; }} free {{ a; }} initial {{ x free; }} }}"
    );
    let (_, fit) = fitted(&text, &table("time,y", rows(&points)));
    for name in ["a", "x at 0"] {
        let one = estimate(&fit, name);
        assert_eq!(one.is_determined, Some(true), "{name}");
        assert!(one.value.abs() < 1e-6, "{}", one.value);
    }
}

#[test]
fn where_nothing_measured_changes_to_first_order_it_is_no_solution() {
    let text = "model top { param p = 0; state x = 1; x' = 0; output z = x^2; }
        fit f of top { horizon 1; data \"data.csv\" { z -> y; } with { x = 0; } initial { x free; } }";
    let (run, fit) = fitted(text, "time,y\n0,4\n0.5,4.1\n1,3.9\n");
    assert_eq!(run.status, Status::Feasible);
    let failure = run.failure.expect("it says why").to_string();
    assert!(failure.contains("to first order"), "{failure}");
    assert!(fit.estimates[0].standard_error.is_none());
}

/// One value, which infinitely many lines go through.
#[test]
fn fewer_measurements_than_what_is_free_do_not_determine_it() {
    let text = format!(
        "{LINE} fit f of line {{ horizon 2; data \"data.csv\" {{ x -> x; }} free {{ a; b; }} }}"
    );
    let (run, fit) = fitted(&text, "t,x\n1.5,3.2\n");
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec!["W0741"]));
    let [a, b] = ["a", "b"].map(|name| estimate(&fit, name));
    close(b.value + 1.5 * a.value, 3.2, 1e-9);
    let known = |one: &Estimate| one.is_determined == Some(true) || one.standard_error.is_some();
    assert!(!known(a) && !known(b), "{a:?} {b:?}");
}

#[test]
fn data_that_are_zero_are_met() {
    let text = format!(
        "{LINE} fit f of line {{ horizon 1; data \"data.csv\" {{ x -> y; }} with {{ b = 0; a = 1; }} initial {{ x free; }} free {{ a; }} }}"
    );
    let (run, fit) = fitted(&text, "time,y\n0,0\n0.5,0\n1,0\n");
    assert_eq!(run.status, Status::Solved, "{:?}", run.failure);
    for one in &fit.estimates {
        close(one.value, 0.0, 1e-7);
        assert!(
            one.interval
                .is_none_or(|ends| ends.iter().all(|end| end.is_finite()))
        );
    }
}

#[test]
fn squares_beyond_what_numbers_tell_are_no_success() {
    for weight in ["1e170", "1e-170"] {
        let text = format!(
            "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> y weight {weight}; }} free {{ a; b; }} }}"
        );
        let run = ran(&text, &table("time,y", rows(&line_data())));
        assert_eq!(run.status, Status::Feasible);
        assert!(run.several.fit.is_none());
    }
}

/// The errors of a fit, each with its code and the text that it is about.
fn errors(settings: &str, data: &str) -> Vec<(String, String)> {
    let text = format!(
        "model m {{ param k = 1; param zero = 0; param e = 2; param kind in {{1, 2}} = 1; state x = 1; state y[2] = [1, 2];
           let square = x^2; x' = -k*x^e + zero; y' = -y; output power = x^2; }}
         fit f of m {{ {settings} }}"
    );
    let files: Memory = [("model.nsd", text.as_str()), ("data.csv", data)]
        .into_iter()
        .collect();
    let project = Project::from_files("model.nsd", files).expect("the text is there");
    let of = |messages: &Messages| -> Vec<(String, String)> {
        let list = messages.list();
        let all = list.iter().map(|message| {
            let place = &message.labels[0].place;
            let code = message.code.clone().unwrap_or_default();
            (code, text[place.start..place.end].to_owned())
        });
        all.collect()
    };
    let found = of(&project.check());
    match found.is_empty() {
        false => found,
        true => match project.run("f", &Options::default(), &mut ()) {
            Ok(_) => Vec::new(),
            Err(messages) => of(&messages),
        },
    }
}

/// A fit without mistakes, and its data.
const BASE: &str = "horizon 1; data \"data.csv\" { x -> a; } free { k; }";
const DATA: &str = "time,a,b\n0,1,\n0.5,0.6,nan\n1,0.3,\n";

/// The one error of a fit.
fn one(settings: &str, data: &str) -> (String, String) {
    let found = errors(settings, data);
    assert_eq!(found.len(), 1, "{settings}: {found:?}");
    found[0].clone()
}

/// The one error of the fit without mistakes where a part of it is another one.
fn with(from: &str, to: &str) -> (String, String) {
    one(&BASE.replace(from, to), DATA)
}

fn is(found: (String, String), code: &str, about: &str) {
    assert_eq!((found.0.as_str(), found.1.as_str()), (code, about));
}

#[test]
fn mistakes_in_data_are_told_at_their_places() {
    assert_eq!(errors(BASE, DATA), []);
    is(with("data.csv", "dta.csv"), "E0122", "\"dta.csv\"");
    is(with("-> a", "-> c"), "E0123", "c");
    is(with("-> a", "-> \"c d\""), "E0123", "\"c d\"");
    is(with("-> a", "-> b"), "E0542", "b");
    is(
        with(
            "horizon 1",
            "horizon 1; data \"data.csv\" { x -> a weight -1; }",
        ),
        "E0504",
        "-1",
    );
    is(with("x -> a", "square -> a"), "E0543", "square");
    is(with("x -> a", "y -> a"), "E0543", "y");
    is(with("x -> a", "k -> a"), "E0510", "k");
}

#[test]
fn mistakes_in_settings_are_told_at_their_places() {
    is(with("free { k; }", ""), "E0541", "f");
    is(with("data \"data.csv\" { x -> a; }", ""), "E0541", "f");
    is(
        with("data \"data.csv\" { x -> a; }", "data \"data.csv\" {}"),
        "E0541",
        "f",
    );
    is(
        with("free { k; }", "free { k; } minimize 1;"),
        "E0540",
        "minimize 1;",
    );
    is(
        with("free { k; }", "free { k; } runs 3;"),
        "E0540",
        "runs 3;",
    );
    is(
        with("horizon 1;", "horizon free;"),
        "E0540",
        "horizon free;",
    );
    is(with("free { k; }", "free { k; k; }"), "E0506", "k");
    is(with("free { k; }", "free { x; }"), "E0517", "x");
    is(with("free { k; }", "free { kind; }"), "E0504", "kind");
    is(with("free { k; }", "free { k in [2, 1]; }"), "E0518", "k");
    is(
        with("free { k; }", "free { zero in [-1, 1]; }"),
        "E0532",
        "zero",
    );
    is(
        with("x -> a; } free { k; }", "power -> a; } free { e; }"),
        "E0532",
        "e",
    );
    is(
        with("free { k; }", "free { k; } method fesd { steps = 4; }"),
        "E0532",
        "k",
    );
    is(
        with("free { k; }", "free { k; } loss cubic;"),
        "E0508",
        "cubic",
    );
    is(
        with("free { k; }", "free { k; } loss huber(0);"),
        "E0504",
        "0",
    );
}

#[test]
fn mistakes_in_files_and_models_are_told_at_their_places() {
    let ranged = "model m { param k = 1; state x in [-k, k] = 1; x' = -k*x; }
         fit f of m { horizon 1; data \"data.csv\" { x -> a; } free { k; } }";
    let found = project(ranged, DATA).check();
    assert_eq!(found.list()[0].code.as_deref(), Some("E0527"));
    is(with("x -> a;", "x -> a; x -> a;"), "E0506", "x -> a;");
    is(
        with("free { k; }", "free { k; } lower moreau;"),
        "E0540",
        "lower moreau;",
    );
    let late = "time,a\n5,1\n6,1\n";
    is(one(BASE, late), "E0542", "a");
    is(
        one(BASE, "time,a\n0,1\n0.5,2\n0.4,1\n"),
        "E0241",
        "\"data.csv\"",
    );
    is(
        one(BASE, "time,a\n0,1\n0.5,much\n"),
        "E0240",
        "\"data.csv\"",
    );
    is(one(BASE, "time;a\n0;1\n"), "E0240", "\"data.csv\"");
    is(one(BASE, ""), "E0240", "\"data.csv\"");
    let simulated =
        "model m { state x = 1; x' = 0; } simulate f of m { horizon 1; data \"d\" { x -> a; } }";
    let found = Project::from_text("m.nsd", simulated).check();
    assert_eq!(found.list()[0].code.as_deref(), Some("E0509"));
}

#[test]
fn results_are_told_in_words_as_json_and_drawn() {
    let points = line_data();
    let text = format!(
        "{LINE} fit f of line {{ horizon 3; data \"data.csv\" {{ x -> \"y [m]\"; }} free {{ a; b in [0, 1.2]; }} }}"
    );
    let project = project(&text, &table("time,y [m]", rows(&points)));
    let options = Options {
        figure: true,
        ..Options::default()
    };
    let run = project.run("f", &options, &mut ());
    let run = run.unwrap_or_else(|errors| panic!("{errors}"));
    let told = run.text();
    for part in [
        "12 measurements",
        "95 % interval",
        "at a bound",
        "singular value",
        "W0742",
    ] {
        assert!(told.contains(part), "{part}:\n{told}");
    }
    let json: serde_json::Value = serde_json::from_str(&run.json()).expect("it is JSON");
    assert_eq!(json["kind"], "fit");
    let fit = &json["fit"];
    assert_eq!(fit["free"]["b"], 1.2);
    assert_eq!(fit["estimates"][1]["at_bound"], "upper");
    assert!(fit["covariance"][1][1].is_null() && fit["covariance"][0][0].is_number());
    // The parameters of the run are those that were found.
    assert_eq!(json["parameters"]["b"], 1.2);
    assert_eq!(json["parameters"]["a"], fit["free"]["a"]);
    // Each measurement, and each residual.
    let figure = run.figure.expect("it was asked for");
    assert_eq!(figure.matches("<circle").count(), 24);
    assert!(figure.contains("x - y [m]"));
}
