//! Which experiments pass, by name: the list may only grow.

use std::fs;
use std::path::{Path, PathBuf};

use nsd_tests::test_folder;
use nsdc::cli::Exit;

/// Experiments of the examples. All of them pass.
const EXAMPLES: &[&str] = &[
    "abs_brake.nsd: brakes",
    "around_ellipse.nsd: across",
    "around_ellipse.nsd: published",
    "ball_pile.nsd: by_events",
    "ball_pile.nsd: clay",
    "ball_pile.nsd: settles",
    "billiard.nsd: dropped",
    "billiard.nsd: thrown",
    "boost.nsd: ten_periods",
    "bouncing_ball.nsd: at_rest",
    "bouncing_ball.nsd: bounces",
    "bouncing_ball.nsd: elastic",
    "bouncing_ball.nsd: frozen",
    "box.nsd: lap",
    "branicky.nsd: growth",
    "buck.nsd: from_rest",
    "buck.nsd: ten_periods",
    "cart_pole.nsd: swing",
    "choices_ocp.nsd: empty",
    "choices_ocp.nsd: hold",
    "choices_ocp.nsd: line",
    "continuous.nsd: a",
    "continuous.nsd: b",
    "continuous.nsd: c",
    "convex.nsd: conditions",
    "convex.nsd: program",
    "corner.nsd: drop",
    "corner.nsd: pushed",
    "dispatch.nsd: day",
    "epidemic.nsd: held",
    "epidemic.nsd: waves",
    "falling_rod.nsd: by_elements",
    "falling_rod.nsd: falls",
    "fast_actuator.nsd: follows",
    "fast_actuator.nsd: slides",
    "fit_stick_slip.nsd: belts",
    "fit_stick_slip.nsd: friction",
    "fit_stick_slip.nsd: ratios",
    "friction_chain.nsd: longer",
    "friction_chain.nsd: to_rest",
    "gear.nsd: turns_round",
    "hidden_modes.nsd: attract",
    "hidden_modes.nsd: elements",
    "hidden_modes.nsd: filippov",
    "hidden_modes.nsd: steep",
    "hopper.nsd: runs",
    "impact_like.nsd: exact",
    "impact_like.nsd: with_detection",
    "impact_like.nsd: without_detection",
    "incline.nsd: slides_back",
    "incline.nsd: stays",
    "intersections.nsd: codimension_three",
    "intersections.nsd: codimension_two",
    "intersections.nsd: product_selection",
    "junction.nsd: fill",
    "junction.nsd: levels_out",
    "laws_at_rest.nsd: coulomb",
    "laws_at_rest.nsd: cube",
    "laws_at_rest.nsd: excess",
    "laws_at_rest.nsd: sine",
    "laws_at_rest.nsd: torn_loose",
    "loop_turbo_car.nsd: hurry",
    "loop_turbo_car.nsd: late",
    "minimum_time.nsd: across",
    "minimum_time.nsd: shift",
    "motor.nsd: published",
    "motor.nsd: shift",
    "newtons_cradle.nsd: apart",
    "newtons_cradle.nsd: clay",
    "newtons_cradle.nsd: given_back",
    "newtons_cradle.nsd: together",
    "oscillator.nsd: crossing",
    "oscillator.nsd: reversed",
    "oscillator.nsd: seventh_order",
    "oscillator.nsd: smoothed",
    "oscillator.nsd: without_detection",
    "parts.nsd: on_ice",
    "parts.nsd: one_alone",
    "parts.nsd: pulled",
    "parts.nsd: to_rest",
    "pass_discs.nsd: pass",
    "place_disc.nsd: place",
    "projected.nsd: along",
    "projected.nsd: carried",
    "projected.nsd: cut",
    "projected.nsd: level",
    "puck.nsd: carry",
    "push_crate.nsd: push",
    "quarter_car.nsd: on_waves",
    "rectifier.nsd: rectifies",
    "sampled_motor.nsd: settles",
    "sampled_motor.nsd: turns",
    "schedule.nsd: day",
    "servo.nsd: tracked",
    "servo.nsd: wound_up",
    "sledge.nsd: back",
    "sledge.nsd: back_by_elements",
    "sledge.nsd: bend",
    "sledge.nsd: straight",
    "sliding_mode.nsd: chatters",
    "sliding_mode.nsd: slides",
    "sliding_mode.nsd: spirals",
    "sliding_ocp.nsd: reach",
    "spiral.nsd: zeno",
    "spring_slider.nsd: coulomb",
    "spring_slider.nsd: stick_slip",
    "stairs.nsd: bounces",
    "stairs.nsd: down",
    "stairs.nsd: slides",
    "stick_slip.nsd: coulomb",
    "stick_slip.nsd: cycles",
    "stiction.nsd: coulomb",
    "stiction.nsd: released",
    "stiction.nsd: stick_slip",
    "sump.nsd: storm",
    "switching_cases.nsd: arrives",
    "switching_cases.nsd: cross",
    "switching_cases.nsd: downwards",
    "switching_cases.nsd: hold",
    "switching_cases.nsd: leave",
    "switching_cases.nsd: passes",
    "switching_cases.nsd: rest",
    "switching_cases.nsd: simplest",
    "switching_cases.nsd: slide",
    "switching_cases.nsd: stay",
    "switching_cases.nsd: steep",
    "switching_cases.nsd: switch",
    "switching_cases.nsd: uneven",
    "switching_cases.nsd: up",
    "switching_cases.nsd: upwards",
    "tanks.nsd: level",
    "tanks.nsd: published",
    "thermostat.nsd: day",
    "thermostat.nsd: frozen",
    "throw_and_catch.nsd: by_impulses",
    "throw_and_catch.nsd: frozen",
    "thrown_ball.nsd: by_elements",
    "thrown_ball.nsd: frozen",
    "thrown_ball.nsd: slower",
    "thrown_ball.nsd: throw",
    "toggle.nsd: falls_to_one_side",
    "turbo_car.nsd: hurry",
    "tutorial_ocp.nsd: tutorial",
    "two_gene_network.nsd: both_thresholds",
    "two_gene_network.nsd: from_below",
    "unmodelled_errors.nsd: coulomb",
    "unmodelled_errors.nsd: large",
    "unmodelled_errors.nsd: small",
    "unmodelled_errors.nsd: smooth",
    "voronoi.nsd: comes_to_rest",
    "voronoi.nsd: passes",
    "voronoi.nsd: slides",
    "walker.nsd: limps",
    "walker.nsd: strides",
    "walker.nsd: walks",
];

/// Experiments of the standard library. All of them pass.
const LIBRARY: &[&str] = &[
    "biology.nsd: grades",
    "biology.nsd: holds",
    "biology.nsd: parts_ways",
    "biology.nsd: saturates",
    "contact.nsd: bounces",
    "contact.nsd: depend_on_speed",
    "contact.nsd: docks",
    "contact.nsd: exchanges",
    "contact.nsd: holds",
    "contact.nsd: stops",
    "contact.nsd: turns",
    "control.nsd: differentiates",
    "control.nsd: follow",
    "control.nsd: lags_behind",
    "control.nsd: leads",
    "control.nsd: modulates",
    "control.nsd: samples",
    "control.nsd: settles",
    "control.nsd: unwinds",
    "friction.nsd: breaks_loose",
    "friction.nsd: slows_down",
    "friction.nsd: sticks_longer",
    "friction.nsd: stops_at_rest",
    "friction.nsd: stops_in_time",
    "friction.nsd: without_excess",
    "hydraulics.nsd: empties",
    "hydraulics.nsd: fills",
    "hydraulics.nsd: levels_out",
    "hydraulics.nsd: spills",
    "mechanics.nsd: falls",
    "mechanics.nsd: slows_down",
    "mechanics.nsd: swings",
    "prelude.nsd: closed_forms",
    "prelude.nsd: follows",
    "prelude.nsd: narrow",
    "relay.nsd: reaches_zero",
    "relay.nsd: stops_at_the_edge",
    "signals.nsd: areas",
    "signals.nsd: frequencies",
];

/// What `nsdc test` says of the experiments below a folder.
struct Outcome {
    exit: Exit,
    passed: Vec<String>,
    failed: Vec<String>,
    not_yet: Vec<String>,
    text: String,
}

fn test(folder: &Path) -> Outcome {
    let (exit, text, err) = test_folder(folder);
    let below = |line: &str| {
        let name = line.rsplit('/').next().unwrap_or(line);
        // Warnings of the run are behind it.
        name.split(", ").next().unwrap_or(name).to_owned()
    };
    let lines = |prefix: &str| {
        text.lines()
            .filter_map(|line| line.strip_prefix(prefix).map(below))
            .collect::<Vec<_>>()
    };
    let (mut passed, mut failed) = (lines("ok "), lines("FAILED "));
    let mut not_yet: Vec<String> = lines("-- ")
        .into_iter()
        .map(|line| line.replacen(": not yet supported", "", 1))
        .collect();
    passed.sort();
    failed.sort();
    not_yet.sort();
    let text = format!("{text}{err}");
    Outcome {
        exit,
        passed,
        failed,
        not_yet,
        text,
    }
}

fn beside_the_tests(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

#[test]
fn every_example_passes() {
    let outcome = test(&beside_the_tests("../examples"));
    assert_eq!(outcome.passed, EXAMPLES, "{}", outcome.text);
    assert_eq!(outcome.not_yet, [""; 0]);
    assert_eq!(outcome.exit, Exit::Success);
}

#[test]
fn the_standard_library_passes() {
    let outcome = test(&beside_the_tests("../stdlib"));
    assert_eq!(outcome.passed, LIBRARY, "{}", outcome.text);
    assert_eq!(outcome.not_yet, [""; 0]);
    assert_eq!(outcome.exit, Exit::Success);
}

#[test]
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn the_design_models_pass() {
    let models = beside_the_tests("../../shared/design/models");
    if !models.is_dir() {
        eprintln!("skipped: {} is not here", models.display());
        return;
    }
    let outcome = test(&models);
    assert_eq!(outcome.exit, Exit::Success, "{}", outcome.text);
    assert_eq!(outcome.failed, [""; 0]);
    assert_eq!(outcome.not_yet, [""; 0]);
    for model in fs::read_dir(&models).expect("a folder") {
        let model = model.expect("a model").file_name();
        let prefix = format!("{}: ", model.display());
        assert!(
            outcome
                .passed
                .iter()
                .any(|passed| passed.starts_with(&prefix)),
            "{prefix}no experiment passed"
        );
    }
}
