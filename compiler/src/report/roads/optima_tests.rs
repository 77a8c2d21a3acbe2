use super::optima::Verdict;
use super::{Found, Optima, Refusal, Resumed, optima_json, optima_text};
use crate::report::{Certificate, Kind, Stationarity, Status, Trajectory, sample};

fn optimum(objective: f64) -> Trajectory {
    let mut trajectory = sample::oscillator();
    trajectory.setup.kind = Kind::Optimize;
    trajectory.objective = Some(objective);
    trajectory.quality.certificate = Certificate {
        stationarity: Stationarity::S,
        max_violation: 1e-12,
    };
    trajectory
}

/// The objectives of lowerings, from their own starts and from the best point, which is that of the first one.
fn optima(objectives: &[[f64; 2]]) -> Optima {
    let names = ["as written, stewart", "step", "timefreezing, step"];
    let found = objectives.iter().zip(names).enumerate();
    let found = found.map(|(number, ([own, again], name))| Found {
        name: name.to_owned(),
        run: Ok(Box::new(optimum(*own))),
        resumed: (number > 0).then(|| Resumed {
            is_same_point: number < 2,
            run: Box::new(optimum(*again)),
        }),
    });
    Optima {
        experiment: "lap".to_owned(),
        model: "car".to_owned(),
        tolerance: 1e-6,
        found: found.collect(),
        best: Some(0),
    }
}

#[test]
fn an_optimum_of_its_own_is_no_contradiction() {
    let all = optima(&[[2.0, 2.0], [5.0, 2.0 + 1e-9]]);
    assert_eq!(all.verdict(0), Verdict::Itself);
    assert_eq!(all.verdict(1), Verdict::Confirms);
    assert!(all.agree());
    assert_eq!(all.n_agreeing(), 2);
}

#[test]
fn another_objective_at_the_same_point_is_one() {
    for again in [2.1, 1.9] {
        let all = optima(&[[2.0, 2.0], [2.0, again]]);
        assert!(matches!(all.verdict(1), Verdict::Differs(_)), "{again}");
        assert!(!all.agree());
        let text = optima_text(&all);
        assert!(
            text.contains("1 differs") && text.contains("DIFFERS by"),
            "{text}"
        );
        assert!(optima_json(&all).contains(r#""agree":false"#));
    }
}

#[test]
fn no_feasible_point_is_one_too() {
    let mut all = optima(&[[2.0, 2.0], [2.0, 2.0]]);
    let resumed = all.found[1].resumed.as_mut().expect("it is there");
    resumed.run.quality.certificate.max_violation = 1e-3;
    assert_eq!(all.verdict(1), Verdict::Differs(f64::INFINITY));
    let resumed = all.found[1].resumed.as_mut().expect("it is there");
    resumed.run.quality.certificate.max_violation = 0.0;
    resumed.run.status = Status::LocallyInfeasible;
    assert!(!all.agree());
}

#[test]
fn programs_with_other_points_may_have_other_optima() {
    let all = optima(&[[2.0, 2.0], [2.0, 2.0], [7.0, 3.0]]);
    assert_eq!(all.verdict(2), Verdict::Another(1.0));
    assert!(all.agree());
    assert_eq!(all.n_agreeing(), 2);
    assert!(optima_text(&all).contains("another optimum"));
}

#[test]
fn a_simulation_that_ends_elsewhere_is_told_and_no_contradiction() {
    let mut all = optima(&[[2.0, 2.0], [2.0, 2.0]]);
    assert!(!optima_text(&all).contains("elsewhere"));
    if let Ok(run) = &mut all.found[1].run {
        run.quality.error_estimate = Some(0.1);
    }
    assert_eq!(all.elsewhere(), [1]);
    assert!(optima_text(&all).contains("controls of 2 end elsewhere"));
    assert!(all.agree());
}

#[test]
fn as_it_is_written_there_has_to_be_an_optimum() {
    let mut all = optima(&[[2.0, 2.0], [2.0, 2.0]]);
    if let Ok(run) = &mut all.found[0].run {
        run.status = Status::TimeLimit;
    }
    all.best = Some(1);
    assert!(!all.agree());
    assert!(optima_text(&all).contains("as written it has no optimum"));
}

#[test]
fn the_experiment_is_none_of_the_worse_optima() {
    let mut all = optima(&[[3.018, 3.018], [1.134, 1.134]]);
    all.best = Some(1);
    all.found[1].resumed = None;
    all.found[0].resumed = Some(Resumed {
        is_same_point: true,
        run: Box::new(optimum(1.134)),
    });
    assert!(
        all.excess()
            .is_some_and(|excess| (excess - 1.884).abs() < 1e-9)
    );
    assert!(!all.agree());
    assert!(optima_text(&all).contains("as written it stops 1.9e0 above another optimum"));
}

#[test]
fn a_lowering_that_takes_the_experiment_has_to_confirm_it() {
    let mut all = optima(&[[2.0, 2.0], [2.0, 2.0]]);
    all.found[1].resumed = None;
    assert!(!all.agree());
    all.found[1].run = Err(Refusal {
        codes: "E0905".to_owned(),
        reason: "there is a projection".to_owned(),
    });
    assert!(all.agree());
    assert!(optima_text(&all).contains("E0905: there is a projection"));
}
