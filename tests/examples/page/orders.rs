//! Errors of every method on every system of the three sources that `examples/README.md` names.

use std::fs;
use std::path::Path;
use std::time::Duration;

use nsd_tests::DataFolder;
use nsdc::compile;
use nsdc::diagnostics::Diagnostics;
use nsdc::expr::Exprs;
use nsdc::project::clock::Clock;
use nsdc::source::SourceMap;
use nsdc::source::imports;
use nsdc::study::order;
use nsdc::study::order::Study;
use nsdc::syntax::{self, Item};
use serde_json::json;

use super::format::{Row, table};
use super::{figure, print, repository};

/// Example, experiment, and what it is.
const SYSTEMS: [(&str, &str, &str); 19] = [
    ("switching_cases", "cross", "x' = 2 - sign(x)"),
    ("switching_cases", "slide", "x' = -sign(x) + 0.2 sin(5t)"),
    ("switching_cases", "leave", "x' = -sign(x) + t"),
    ("switching_cases", "hold", "x' = -sign(x)"),
    (
        "oscillator",
        "crossing",
        "two matrices on both sides of a circle",
    ),
    ("continuous", "a", "x' = 1 + max(0, x)"),
    ("continuous", "b", "x' = 1 + abs(x)"),
    ("impact_like", "exact", "a spring-damper wall"),
    ("branicky", "growth", "Branicky's pair of matrices"),
    ("spiral", "zeno", "Filippov's spiral"),
    ("convex", "program", "a projection as a convex program"),
    ("projected", "along", "projected dynamics on a disc"),
    ("bouncing_ball", "bounces", "a bouncing ball"),
    ("corner", "drop", "two inelastic contacts"),
    ("thrown_ball", "throw", "a contact with friction"),
    ("thermostat", "day", "a relay with memory"),
    (
        "hidden_modes",
        "attract",
        "two sliding modes and their fold",
    ),
    ("stiction", "coulomb", "a block on a belt, Coulomb friction"),
    ("stiction", "stick_slip", "the same with static friction"),
];

/// Time for a system.
const LIMIT: Duration = Duration::from_secs(5);

/// A figure and a table for each system.
pub fn write(figures: &Path) -> String {
    let mut text = String::from(
        "Each method goes from coarse to fine until its error is that of the reference, or its share of five seconds is over.\n\
         Times are medians of solves with compiled functions; an order is the slope of errors over the step size, the tolerance or ε.\n",
    );
    for (file, experiment, what) in SYSTEMS {
        print(&format!("{file} {experiment}"));
        text.push_str(&format!(
            "\n### {what}\n\n`nsdc order examples/{file}.nsd {experiment}`\n\n"
        ));
        match study(file, experiment) {
            Ok(study) => {
                let name = format!("{file}-{experiment}");
                text.push_str(&format!("Errors against {}.\n\n", study.reference.source));
                text.push_str(&figure(figures, &name, what, &study.error_time()));
                text.push_str(&format!("\n{}", table(&rows(&study))));
            }
            Err(failure) => text.push_str(&format!("Not compared: {failure}.\n")),
        }
    }
    text
}

fn study(name: &str, experiment: &str) -> Result<Study, String> {
    let folder = repository("examples");
    let text = fs::read_to_string(folder.join(format!("{name}.nsd"))).expect("an example is text");
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let mut file = syntax::parse(&sources.add(name, text), &mut diags);
    imports::link(
        &mut file,
        name,
        &mut DataFolder(folder),
        &mut sources,
        &mut diags,
    );
    let item = file.items.iter().find_map(|item| match item {
        Item::Experiment(found) if found.name.name == experiment => Some(found),
        _ => None,
    });
    let item = item.unwrap_or_else(|| panic!("{name} has no {experiment}"));
    let (exprs, mut clock) = (Exprs::new(), Clock::default());
    let compiled = compile(&exprs, &file, item, &[], &mut clock, &mut diags);
    let compiled = compiled.expect("examples compile");
    order::study(&compiled, &[], &sources, LIMIT, &mut |_| {})
}

/// One row per method that has an error.
fn rows(study: &Study) -> Vec<Row> {
    let rows = study.curves.iter().filter_map(|curve| {
        let errors = curve
            .points
            .iter()
            .filter_map(|point| Some((*point.error.as_ref().ok()?, point)));
        let (error, point) = errors.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let row = [
            ("method", json!(curve.name)),
            ("order", json!(curve.remark())),
            ("least error", json!(error)),
            ("steps", json!(point.steps)),
            ("seconds", json!(point.seconds)),
        ];
        Some(row.map(|(name, value)| (name.to_owned(), value)).into())
    });
    rows.collect()
}
