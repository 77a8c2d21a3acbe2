use insta::assert_snapshot;

use super::*;
use crate::report::{Event, EventKind, Status, sample};

const TOLERANCE: f64 = 1e-8;

#[test]
fn every_number_has_a_tolerance() {
    assert_snapshot!(renewed(None, &sample::oscillator(), TOLERANCE), @r"
    // Numbers of crossing of oscillator. Tolerances are yours to change.
    status is solved
    x[1] at end = -1.648721271 within 2e-8
    x[2] at end = 0.25 within 2e-8
    crossing of c = 1 within 2e-8
    ");
}

#[test]
fn a_tolerance_is_ten_estimates_where_that_is_more() {
    let mut trajectory = sample::oscillator();
    trajectory.quality.error_estimate = Some(3e-5);
    let text = renewed(None, &trajectory, TOLERANCE);
    assert!(text.contains("x[2] at end = 0.25 within 5e-4"), "{text}");
}

#[test]
fn what_is_close_enough_stays_as_it_is_written() {
    let mut trajectory = sample::oscillator();
    let text = renewed(None, &trajectory, TOLERANCE);
    trajectory.samples.states[0].values[5] += 1.9e-8;
    trajectory.history.events[0].time -= 1.9e-8;
    assert_eq!(renewed(Some(&text), &trajectory, TOLERANCE), text);

    trajectory.samples.states[0].values[5] += 2e-8;
    let moved = renewed(Some(&text), &trajectory, TOLERANCE);
    assert_eq!(
        difference::lines(&text, &moved)
            .iter()
            .filter(|line| !line.starts_with(' '))
            .collect::<Vec<_>>(),
        [
            "- x[2] at end = 0.25 within 2e-8",
            "+ x[2] at end = 0.250000039 within 2e-8"
        ]
    );
}

#[test]
fn tolerances_and_comments_of_the_user_are_kept() {
    let mut trajectory = sample::oscillator();
    let text = renewed(None, &trajectory, TOLERANCE);
    let edited = text.replace(
        "x[2] at end = 0.25 within 2e-8",
        "// Ill-conditioned.\nx[2] at end = 0.25 within 1e-3  // by hand",
    );
    trajectory.samples.states[0].values[5] += 9e-4;
    assert_eq!(renewed(Some(&edited), &trajectory, TOLERANCE), edited);
    trajectory.samples.states[0].values[5] += 2e-4;
    assert_ne!(renewed(Some(&edited), &trajectory, TOLERANCE), edited);
}

#[test]
fn another_status_an_event_more_and_what_is_no_number_differ() {
    let text = renewed(None, &sample::oscillator(), TOLERANCE);
    let changes: [fn(&mut Trajectory); 4] = [
        |run| run.status = Status::TimeLimit,
        |run| run.history.events.push(run.history.events[0].clone()),
        |run| run.history.events.clear(),
        |run| run.samples.states[0].values[4] = f64::NAN,
    ];
    for change in changes {
        let mut trajectory = sample::oscillator();
        change(&mut trajectory);
        let now = renewed(Some(&text), &trajectory, TOLERANCE);
        assert_ne!(now, text);
        assert_eq!(renewed(Some(&now), &trajectory, TOLERANCE), now);
    }
}

#[test]
fn events_of_a_name_agree_in_their_order() {
    let mut trajectory = sample::oscillator();
    let crossing = trajectory.history.events[0].clone();
    let event = |time: f64| Event {
        time,
        ..crossing.clone()
    };
    trajectory.history.events = vec![event(0.25), event(0.75)];
    let text = renewed(None, &trajectory, TOLERANCE);
    // One that comes first moves the other ones up.
    let first = event(0.125);
    trajectory.history.events.insert(0, first);
    assert_ne!(renewed(Some(&text), &trajectory, TOLERANCE), text);
    trajectory.history.events.remove(0);
    trajectory.history.events[1].kind = EventKind::EnterSliding;
    assert_ne!(renewed(Some(&text), &trajectory, TOLERANCE), text);
}

#[test]
fn of_many_events_the_first_are_kept() {
    let mut trajectory = sample::oscillator();
    let event = trajectory.history.events[0].clone();
    trajectory.history.events = vec![event; 100];
    let text = renewed(None, &trajectory, TOLERANCE);
    assert_eq!(text.matches("crossing of c").count(), 20);
}

#[test]
fn numbers_are_as_long_as_they_are_known() {
    assert_eq!(shown(1.0 / 3.0, 1e-4), "0.33333");
    assert_eq!(shown(-1e-9, 1e-4), "0");
    assert_eq!(shown(1.25e20, 2e12), "1.250000000e20");
    assert_eq!(shown(3.25e-9, 1e-12), "3.2500e-9");
    assert_eq!(shown(123456.0, 100.0), "123456");
    for value in [1.0, 0.3, 1e-9, 4.2e-9, 7e3] {
        let within = rounded(value);
        assert!(
            (value * (1.0 - 1e-9)..=2.5 * value).contains(&within),
            "{value}: {within}"
        );
    }
}
