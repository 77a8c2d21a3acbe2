use super::{Refusal, Road, Roads, json, text};
use crate::report::{Method, MethodOption, Moves, Sensitivity, Status, sample};

/// The sample trajectory as it is, another time, and with this added to the first entry of its last state.
fn roads(error: f64, estimate: Option<f64>) -> Roads {
    let mut other = sample::oscillator();
    let last = other.samples.states[0].values.len() - 2;
    other.samples.states[0].values[last] += error;
    other.quality.error_estimate = estimate;
    let ways = [("event", ""), ("fesd", "stewart"), ("fesd", "step")];
    let runs = [sample::oscillator(), sample::oscillator(), other];
    let roads = ways.iter().zip(runs).map(|((name, lowering), mut run)| {
        let lowering = MethodOption::Text((*lowering).to_owned());
        run.setup.method = Method {
            name: (*name).to_owned(),
            options: vec![("lowering".to_owned(), lowering)],
        };
        Road {
            name: format!("{name} {}", run.setup.method.lowering().unwrap_or_default()),
            run: Ok(Box::new(run)),
        }
    });
    let mut roads: Vec<Road> = roads.collect();
    roads.push(Road {
        name: "fesd, lower impact".to_owned(),
        run: Err(Refusal {
            codes: "E0935".to_owned(),
            reason: "there are no contacts".to_owned(),
        }),
    });
    Roads {
        experiment: "crossing".to_owned(),
        model: "oscillator".to_owned(),
        tolerance: 1e-6,
        roads,
    }
}

#[test]
fn a_difference_beyond_tolerance_and_estimates_is_found() {
    let roads = roads(1e-3, Some(1e-9));
    assert_eq!(roads.disagreements(), [(0, 2), (1, 2)]);
    assert!(!roads.agree());
    assert!(text(&roads).contains("DIFFERS"));
}

#[test]
fn what_a_run_says_of_its_own_error_is_believed() {
    assert!(roads(1e-3, Some(1e-3)).agree());
    // What knows that it is far off confirms nothing, and contradicts nothing.
    let far_off = roads(0.5, Some(0.5));
    assert!(far_off.agree());
    assert_eq!(far_off.n_sound(), 2);
    assert!(text(&far_off).contains("estimates that it is far off: confirms nothing"));
    assert!(!roads(1e-3, None).agree());
}

#[test]
fn numbers_that_are_none_differ() {
    assert_eq!(roads(f64::NAN, None).disagreements().len(), 2);
}

#[test]
fn runs_that_fail_are_not_compared_but_the_written_one_has_to_end() {
    let mut roads = roads(1.0, None);
    let fail = |roads: &mut Roads, k: usize| {
        if let Ok(run) = &mut roads.roads[k].run {
            run.status = Status::NumericalFailure;
        }
    };
    let first_line = |roads: &Roads| text(roads).lines().next().unwrap_or_default().to_owned();
    fail(&mut roads, 2);
    assert!(roads.agree());
    assert!(first_line(&roads).ends_with(": 2 roads agree"));
    fail(&mut roads, 0);
    assert!(!roads.agree());
    let said = first_line(&roads);
    assert!(
        said.contains("as written it does not come to the end"),
        "{said}"
    );
}

#[test]
fn one_road_alone_is_enough_where_no_other_takes_the_experiment() {
    let mut roads = roads(0.0, None);
    for k in [1, 2] {
        if let Ok(run) = &mut roads.roads[k].run {
            run.status = Status::NumericalFailure;
        }
    }
    assert!(!roads.agree(), "the others take it, and fail");
    assert!(text(&roads).contains("one road alone, nothing confirms it"));
    roads.roads.drain(1..3);
    assert!(roads.agree());
    assert!(text(&roads).contains("E0935: there are no contacts"));
}

/// Another order makes the mistakes of the method.
#[test]
fn a_method_does_not_confirm_itself() {
    let mut roads = roads(0.0, None);
    let written = roads.roads[0].run.as_ref().expect("a run");
    let mut method = written.setup.method.clone();
    let order = ("order".to_owned(), MethodOption::Number(12.0));
    method.options.push(order);
    if let Ok(run) = &mut roads.roads[1].run {
        run.setup.method = method;
    }
    assert_eq!(roads.n_confirming(), 1);
    assert!(roads.agree());
    // The other one takes the experiment, and fails.
    if let Ok(run) = &mut roads.roads[2].run {
        run.status = Status::NumericalFailure;
    }
    assert!(!roads.agree());
    assert!(text(&roads).contains("nothing confirms it but its own method"));
    roads.roads.remove(2);
    assert!(roads.agree());
    assert!(text(&roads).contains("one road alone"));
}

#[test]
fn a_run_that_misses_its_own_equations_is_wrong() {
    let mut roads = roads(0.0, None);
    if let Ok(run) = &mut roads.roads[2].run {
        run.quality.certificate.max_violation = 0.34;
    }
    assert!(!roads.agree());
    assert!(text(&roads).contains("2 roads agree, 1 misses its own equations"));
}

#[test]
fn the_way_counts_as_the_end_does() {
    let mut roads = roads(0.0, None);
    if let Ok(run) = &mut roads.roads[2].run {
        run.samples.time.insert(1, 0.5);
        run.samples.states[0].values.splice(2..2, [0.7, 0.1]);
    }
    assert!(roads.agree(), "there is no such instant in the others");
    if let Ok(run) = &mut roads.roads[1].run {
        run.samples.time.insert(1, 0.5);
        run.samples.states[0].values.splice(2..2, [0.2, 0.1]);
    }
    assert_eq!(roads.disagreements(), [(1, 2)]);
}

#[test]
fn one_pair_differs() {
    let mut roads = roads(1e-3, None);
    roads.roads.remove(1);
    let said = text(&roads);
    assert!(said.contains("2 roads, 1 pair of them differs"), "{said}");
}

#[test]
fn events_of_other_kinds_have_no_difference_in_time() {
    let mut roads = roads(0.0, None);
    if let Ok(run) = &mut roads.roads[1].run {
        run.history.events[0].time += 0.15;
    }
    if let Ok(run) = &mut roads.roads[2].run {
        run.history.events.clear();
    }
    let times = |a, b| {
        roads
            .difference(a, b)
            .and_then(|difference| difference.times)
    };
    assert!(times(0, 1).is_some_and(|times| (times - 0.1).abs() < 1e-12));
    assert_eq!(times(0, 2), None);
    // Events at other instants are another solution, and so is one that others do not have.
    assert_eq!(roads.disagreements(), [(0, 1), (0, 2), (1, 2)]);
    roads.roads.remove(2);
    if let Ok(run) = &mut roads.roads[1].run {
        run.setup.method.name = "timestepping".to_owned();
    }
    assert!(roads.agree(), "its events are known to a step only");
}

#[test]
fn events_that_differ_stand_side_by_side() {
    let mut roads = roads(0.0, None);
    assert!(!text(&roads).contains("not the same"));
    if let Ok(run) = &mut roads.roads[1].run {
        run.history.events[0].time += 0.15;
    }
    if let Ok(run) = &mut roads.roads[2].run {
        run.history.events.clear();
    }
    let shown = text(&roads);
    let (_, shown) = shown
        .split_once("events that are not the same")
        .expect("a table");
    insta::assert_snapshot!(shown, @r"
    in all runs
                                   1                 2                 3
     crossing of c       1.000000000       1.150000000                 -
    ");
}

#[test]
fn a_program_reads_the_same() {
    let roads = roads(1e-3, None);
    let object: serde_json::Value = serde_json::from_str(&json(&roads)).expect("an object");
    assert_eq!(object["agree"], false);
    assert_eq!(object["roads"].as_array().map(Vec::len), Some(4));
    assert_eq!(object["roads"][3]["status"], "not_applicable");
    assert_eq!(object["roads"][3]["code"], "E0935");
    let explained = |pair: usize| object["differences"][pair]["is_explained"].as_bool();
    assert_eq!(
        [0, 1, 2].map(explained),
        [Some(true), Some(false), Some(false)]
    );
}

/// The same runs, differentiated; of the last one derivatives have this added at the end, and those of instants this.
fn sensed(error: f64, of_instant: f64) -> Roads {
    let mut roads = roads(0.0, Some(1e-9));
    for (number, road) in roads.roads.iter_mut().enumerate() {
        let Ok(run) = &mut road.run else { continue };
        let (error, of_instant) = if number == 2 {
            (error, of_instant)
        } else {
            (0.0, 0.0)
        };
        let mut states = run.samples.states.clone();
        if let Some(last) = states[0].values.last_mut() {
            *last += error;
        }
        let moves = run.history.events.iter().map(|event| Moves {
            time: event.time,
            derivative: 2.0 + of_instant,
        });
        run.samples.sensitivities = vec![Sensitivity {
            to: "omega".to_owned(),
            events: moves.collect(),
            states,
            ..Sensitivity::default()
        }];
    }
    roads
}

#[test]
fn derivatives_are_compared_where_both_runs_have_them() {
    let same = sensed(0.0, 0.0);
    assert!(same.agree());
    assert!(text(&same).contains("behind them those of derivatives"));
    assert!(!text(&roads(0.0, None)).contains("derivatives"));
    for (error, of_instant) in [(1e-3, 0.0), (0.0, 1e-3)] {
        let other = sensed(error, of_instant);
        assert_eq!(other.disagreements(), [(0, 2), (1, 2)]);
        assert!(text(&other).contains("of derivatives"));
    }
    // What is no number is not known, and contradicts nothing.
    assert!(sensed(f64::NAN, f64::NAN).agree());
    // An error of states is explained by less than one of derivatives.
    assert!(sensed(5e-6, 0.0).agree());
    assert!(!roads(5e-6, Some(1e-9)).agree());
}

#[test]
fn derivatives_stand_in_json() {
    let value: serde_json::Value =
        serde_json::from_str(&json(&sensed(1e-3, 0.0))).expect("it is JSON");
    let differences = value["differences"].as_array().expect("runs are compared");
    let of = |k: usize| differences[k]["sensitivities"]["end"].as_f64();
    assert_eq!(of(0), Some(0.0));
    assert!(of(1).is_some_and(|end| end > 1e-4));
    let plain: serde_json::Value =
        serde_json::from_str(&json(&roads(0.0, None))).expect("it is JSON");
    assert!(plain["differences"][0]["sensitivities"].is_null());
}
