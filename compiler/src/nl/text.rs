//! The report on the terminal, and what AMPL shows.

use std::fmt::{self, Write};

use super::Report;
use crate::diagnostics::counted;
use crate::report::Status;
use crate::report::forms::text::{duration, significant};

/// The report, plain text with a line break at the end.
pub fn write(report: &Report) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = full(report, &mut text);
    text
}

fn full(report: &Report, text: &mut String) -> fmt::Result {
    let Report {
        quality,
        sizes,
        stats,
        ..
    } = report;
    writeln!(text, "{}: {}", report.problem, verdict(report))?;
    writeln!(
        text,
        "  objective             {}",
        significant(report.objective, 12)
    )?;
    write!(text, "  constraint violation  {:.1e}", quality.violation)?;
    match &report.worst {
        Some(worst) if !report.is_feasible => writeln!(text, ", largest in {worst}")?,
        _ => writeln!(text)?,
    }
    if sizes.complementarities + sizes.kinks + sizes.binaries > 0 {
        writeln!(
            text,
            "  complementarity       {:.1e}, products {:.1e}",
            quality.complementarity_min, quality.complementarity_product
        )?;
        writeln!(
            text,
            "  stationarity          {}",
            report.certificate.stationarity.as_str()
        )?;
    }
    write!(
        text,
        "\n  {}, {}, {}",
        counted(sizes.variables, "variable"),
        counted(sizes.rows, "constraint"),
        counted(sizes.complementarities, "complementarity")
    )?;
    if sizes.kinks > 0 {
        write!(text, ", {} of abs, min and max as pairs", sizes.kinks)?;
    }
    if sizes.binaries > 0 {
        write!(
            text,
            ", {} as pairs",
            counted(sizes.binaries, "binary variable")
        )?;
    }
    writeln!(
        text,
        "\n  {}, {}",
        counted(stats.newton_iterations as usize, "iteration"),
        duration(stats.solve_s)
    )
}

/// The line that AMPL shows.
pub fn message(report: &Report) -> String {
    format!(
        "nsdc {}: {}; objective {}\n{}, stationarity {}",
        env!("CARGO_PKG_VERSION"),
        verdict(report),
        significant(report.objective, 12),
        counted(report.stats.newton_iterations as usize, "iteration"),
        report.certificate.stationarity.as_str(),
    )
}

/// The status, and what can be said of a point that is none of a solution.
fn verdict(report: &Report) -> String {
    let status = report.status.as_str();
    match report.status {
        Status::Solved => status.to_owned(),
        _ if report.is_feasible => format!("{status}, with a feasible point"),
        Status::LocallyInfeasible => {
            let least = report.certificate.max_violation;
            format!("{status}, with a violation of {least:.1e}")
        }
        _ => status.to_owned(),
    }
}
