//! The table on the terminal and the CSV form.

use std::fmt::{self, Write};

use super::fit::local_orders;
use super::{Curve, Fit, Knob, Study};
use crate::report::forms::text::{duration, significant};

/// The table of all runs, then a line per method.
pub fn text(study: &Study) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(study, &mut text);
    text
}

fn write(study: &Study, text: &mut String) -> fmt::Result {
    let Study {
        experiment,
        model,
        reference,
        ..
    } = study;
    writeln!(text, "{experiment} of {model}: order of convergence\n")?;
    writeln!(text, "  error |x(T) - x*| against {}", reference.source)?;
    if let Some(remark) = &reference.remark {
        writeln!(text, "  {remark}")?;
    }
    writeln!(
        text,
        "  orders over errors above {:.1e} and below {:.1e}, without coarse runs of another slope
  values are step sizes h, tolerances tol of `event` and `adaptive`, epsilons eps of `smoothing`\n",
        reference.floor,
        super::COARSE * reference.size
    )?;
    let width = study.curves.iter().map(|curve| curve.name.len()).max();
    let width = width.unwrap_or(0).max("method".len());
    writeln!(
        text,
        "  {:width$}  {:>9}  {:>7}  {:>9}  {:>9}  {:>6}",
        "method", "value", "steps", "error", "time", "order"
    )?;
    for curve in &study.curves {
        for (point, order) in curve.points.iter().zip(local_orders(&curve.points)) {
            write!(
                text,
                "  {:width$}  {:>9}  {:>7}  ",
                curve.name,
                significant(point.knob, 4),
                point.steps
            )?;
            match &point.error {
                Err(failure) => writeln!(text, "failed: {failure}")?,
                Ok(error) => {
                    let order = order.map(|order| format!("{order:.2}"));
                    let order = order.unwrap_or_default();
                    let time = duration(point.seconds);
                    let line = format!("{error:>9.2e}  {time:>9}  {order:>6}");
                    writeln!(text, "{}", line.trim_end())?;
                }
            }
        }
        writeln!(text)?;
    }
    for curve in &study.curves {
        writeln!(text, "  {:width$}  {}", curve.name, summary(curve))?;
    }
    for (name, reason) in &study.left_out {
        writeln!(text, "  {name:width$}  left out: {reason}")?;
    }
    writeln!(text, "\n  {}", duration(study.seconds))
}

/// What there is to say about a method in a line.
pub fn summary(curve: &Curve) -> String {
    let solved = curve.points.iter().filter_map(|point| {
        let error = point.error.as_ref().ok()?;
        Some((*error, point.seconds))
    });
    let Some((error, seconds)) = solved.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        let failure = curve.points.first().and_then(|p| p.error.as_ref().err());
        return match failure {
            Some(failure) => format!("no run reached the end: {failure}"),
            None => "no run reached the end".into(),
        };
    };
    let order = match (&curve.fit, curve.knob) {
        (None, _) => "no order: too few errors are in range".to_owned(),
        (Some(fit), Knob::Step) => format!("order {:.2} in h{}", fit.order, doubt(fit)),
        (Some(fit), knob) => {
            format!("error ~ {}^{:.2}{}", knob.symbol(), fit.order, doubt(fit))
        }
    };
    let used = curve.fit.as_ref().map(|fit| used(curve, fit));
    let used = used.unwrap_or_default();
    format!(
        "{order}{used}; least error {error:.1e} in {}",
        duration(seconds)
    )
}

/// What the scatter of the errors leaves open, where that shows.
fn doubt(fit: &Fit) -> String {
    match fit.spread {
        spread if spread >= 0.05 => format!(" (± {spread:.1})"),
        _ => String::new(),
    }
}

/// The runs that a line goes through.
fn used(curve: &Curve, fit: &Fit) -> String {
    let knob = |at: Option<&usize>| at.map_or(f64::NAN, |&at| curve.points[at].knob);
    format!(
        ", from {} of {} runs, {} to {}",
        fit.used.len(),
        curve.points.len(),
        significant(knob(fit.used.first()), 2),
        significant(knob(fit.used.last()), 2)
    )
}

/// One line per run. Numbers round-trip; a run that failed has no error.
pub fn csv(study: &Study) -> String {
    let mut text = csv::Writer::from_writer(Vec::new());
    // Writing to memory does not fail and every record has the same length.
    let _ = text.write_record([
        "method",
        "refines",
        "value",
        "steps",
        "step_size",
        "error",
        "seconds",
        "order",
        "status",
        "fitted",
    ]);
    for curve in &study.curves {
        let used = |at: usize| curve.fit.as_ref().is_some_and(|fit| fit.used.contains(&at));
        let orders = local_orders(&curve.points);
        for (at, (point, order)) in curve.points.iter().zip(orders).enumerate() {
            let number = |number: f64| format!("{number:?}");
            let (error, status) = match &point.error {
                Ok(error) => (number(*error), "solved"),
                Err(failure) => (String::new(), failure.as_str()),
            };
            let refines = curve.knob.word();
            let _ = text.write_record([
                curve.name.as_str(),
                refines,
                &number(point.knob),
                &point.steps.to_string(),
                &number(point.step),
                &error,
                &number(point.seconds),
                &order.map(number).unwrap_or_default(),
                status,
                if used(at) { "yes" } else { "no" },
            ]);
        }
    }
    let bytes = text.into_inner().unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default()
}
