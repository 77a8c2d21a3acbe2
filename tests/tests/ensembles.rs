//! Many runs of one experiment: seeds, threads, quantiles, and how often errors throw a state out of a layer.

use nsd_tests::with_source;
use nsdc::limit::Limit;
use nsdc::project::ensemble;
use nsdc::project::ensemble::{LEVELS, Seeded};
use nsdc::report::{Ensemble, Status, Trajectory};
use nsdc::simulate::{self, Request};

/// An experiment `run` of a text with all its seeds, on so many threads.
fn many(text: &str, n_threads: usize) -> (Trajectory, Ensemble) {
    with_source(text, "run", |source, compiled| {
        let (system, settings, request) =
            (&compiled.system, &compiled.settings, Request::default());
        let mut trajectory = simulate::run(system, settings, &request);
        let mut heard = 0;
        let mut hear = |done: usize| heard = done;
        ensemble::add(
            &mut trajectory,
            source,
            settings,
            &request,
            n_threads,
            &mut hear,
        );
        let ensemble = trajectory
            .several
            .ensemble
            .clone()
            .expect("the experiment has runs");
        assert_eq!(heard, ensemble.runs);
        (trajectory, ensemble)
    })
}

/// What every run says, in the order of the seeds.
fn each<T: Send>(text: &str, read: impl Fn(&Trajectory) -> T + Sync) -> Vec<T> {
    with_source(text, "run", |source, compiled| {
        let seeds = ensemble::seeds(&compiled.settings).expect("the experiment has runs");
        let work = |seeded: &mut Seeded<'_>| {
            let request = Request {
                dense: false,
                estimate: false,
                ..Request::default()
            };
            let settings = seeded.compiled.settings.clone();
            let found = seeded.run(&settings, &request);
            assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
            read(&found)
        };
        ensemble::over_seeds(source, seeds, (2, &Limit::default()), work, &mut |_| {})
    })
}

#[test]
fn quantiles_depend_on_seeds_and_not_on_threads() {
    let text =
        "model m { state x[2] = [1, 0]; x[1]' = x[2]; x[2]' = -x[1]; output E = dot(x, x)/2; }
        simulate run of m { horizon 3; perturb every 0.5 by gauss(0.1) seed 7; runs 25; }";
    let (first, one) = many(text, 1);
    assert_eq!((one.runs, one.first_seed), (25, 7));
    assert!(one.failed_seeds.is_empty());
    assert_eq!(one.time.len(), 241);
    let names: Vec<&str> = one.bands.iter().map(|bands| bands.name.as_str()).collect();
    assert_eq!(names, ["x[1]", "x[2]", "E"]);
    for n_threads in [2, 5] {
        let (again, other) = many(text, n_threads);
        assert_eq!(one, other);
        assert_eq!(first.samples.states, again.samples.states);
    }
    // Run number k is the run with the seed 7 + k; an odd number of runs has its median among them.
    let ends: Vec<f64> = (7..32)
        .map(|seed| {
            let text = text.replace("seed 7; runs 25", &format!("seed {seed}"));
            let found = nsd_tests::run(&text, "run");
            found.samples.states[0].at(found.samples.time.len() - 1)[0]
        })
        .collect();
    let mut sorted = ends.clone();
    sorted.sort_by(f64::total_cmp);
    let median = one.bands[0].values[2].last().copied();
    assert!((median.unwrap_or(f64::NAN) - sorted[12]).abs() < 1e-7);
    assert!((first.samples.states[0].at(first.samples.time.len() - 1)[0] - ends[0]).abs() < 1e-12);
}

/// x is a sum of normal deviates of variance n s², so that its quantiles are known.
#[test]
fn quantiles_of_a_random_walk_are_those_of_its_normal_law() {
    let text = "model m { state x = 0; x' = 0; }
        simulate run of m { horizon 1.05; perturb every 0.1 by gauss(0.2) seed 1; runs 2000; }";
    let (_, ensemble) = many(text, 2);
    let deviation = 0.2 * 10.0_f64.sqrt();
    // Quantiles of the standard normal law, and its density there.
    let known: [f64; 5] = [
        -1.6448536269514722,
        -0.6744897501960817,
        0.0,
        0.6744897501960817,
        1.6448536269514722,
    ];
    for ((values, z), level) in ensemble.bands[0].values.iter().zip(known).zip(LEVELS) {
        let found = values.last().copied().unwrap_or(f64::NAN) / deviation;
        let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let error = (level * (1.0 - level) / 2000.0).sqrt() / density;
        // Farther than 4.5 standard errors with a probability below 7e-6 each, 4e-5 for all.
        assert!(
            (found - z).abs() < 4.5 * error,
            "{level}: {found} {z} {error}"
        );
    }
}

/// The share of instants at which a state that slides is in the layer |y| < ε after an error of norm κ, P_γ of Jeffrey
/// 2014, section 6: 2 arcsin(ε/κ)/π in the plane for κ > ε, at most 2ε/(πκ) + (2ε/(πκ))², and 1 for κ < ε.
#[test]
fn errors_leave_the_layer_as_often_as_their_law_says() {
    let epsilon = 1e-3;
    // Friction without a load, smoothed: u = 0 attracts, and whatever is thrown out is back before the next error.
    let instants: Vec<String> = (1..=9).map(|k| format!("0.{k}0000001")).collect();
    let instants = instants.join(", ");
    let text = |kappa: f64| {
        format!(
            "model m {{ state x = 0; state u = 0; switch s = sign(u) sliding nonlinear;
               x' = 0; u' = -s; hidden on s {{ u' += -2*pi*s*(1 - s^2); }} }}
             simulate run of m {{ horizon 0.95; tolerance 1e-6; output x, u at [{instants}];
               method smoothing {{ epsilon = {epsilon}; law = tanh; }}
               perturb every 0.1 by sphere({kappa}) seed 1; runs 300; }}"
        )
    };
    for ratio in [0.9, 1.2, 3.0, 20.0] {
        let inside = each(&text(ratio * epsilon), |found| {
            // Right after each error u has moved by less than ε/10000.
            let after = (0..9).map(|k| found.samples.states[1].at(k)[0]);
            after.filter(|u| u.abs() < epsilon).count()
        });
        let trials = 2700.0;
        let share = inside.iter().sum::<usize>() as f64 / trials;
        if ratio < 1.0 {
            assert_eq!(share, 1.0);
            continue;
        }
        let known = 2.0 * (1.0 / ratio).asin() / std::f64::consts::PI;
        let bound = 2.0 / (std::f64::consts::PI * ratio);
        let bound = bound + bound * bound;
        assert!(known <= bound, "{ratio}: {known} {bound}");
        // The number inside is binomial. Farther off than 4.5 of its deviations with a probability below 1e-5 in the
        // normal law, and below 1e-4 for the binomial one with a mean of 86 at the least.
        let deviation = (known * (1.0 - known) / trials).sqrt();
        assert!(
            (share - known).abs() < 4.5 * deviation,
            "{ratio}: {share} {known} {deviation}"
        );
        assert!(share < bound + 4.5 * deviation, "{ratio}: {share} {bound}");
    }
}

#[test]
fn a_run_that_fails_is_named_by_its_seed() {
    // x' = x² from above 1/2 has no solution up to t = 2: some errors of norm 0.1 lead there, the others away from it.
    let text = "model m { state x = 0.45; x' = x^2; }
        simulate run of m { horizon 2; perturb every 0.1 by sphere(0.1) seed 3; runs 12; }";
    let (trajectory, ensemble) = many(text, 2);
    let alone: Vec<u64> = (3..15)
        .filter(|seed| {
            let text = text.replace("seed 3; runs 12", &format!("seed {seed}"));
            nsd_tests::run(&text, "run").status != Status::Solved
        })
        .collect();
    assert!(!alone.is_empty() && alone.len() < 12, "{alone:?}");
    assert_eq!(ensemble.failed_seeds, alone);
    assert_ne!(trajectory.status, Status::Solved);
    assert!(trajectory.failure.is_some());
}
