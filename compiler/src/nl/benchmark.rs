//! A folder of problems: the table, what is known of them, and how many are solved.
//!
//! A problem is solved when the constraint violation and every |min(G, H)| are at most 1e-6, and solved well when its
//! objective is, besides, within 1e-4, relative to max(1, |f|), of the best known one f or better. What a solver says
//! of itself does not count.

use std::collections::HashMap;

use super::Report;
use crate::report::forms::text::{duration, significant};
use crate::report::{Stationarity, Status};

/// What a solved problem may violate.
const FEASIBLE: f64 = 1e-6;
/// What an objective may miss the best known one by.
const WELL: f64 = 1e-4;
/// The word for a problem that is known to be infeasible.
const INFEASIBLE: &str = "(I)";

/// What is known of a problem.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// The best known objective.
    pub best: Option<f64>,
    /// Whether it is known to be infeasible.
    pub is_infeasible: bool,
    /// What another solver has reached.
    pub peer: Option<Peer>,
}

/// What another solver has reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peer {
    /// Its objective, in the sense of the file.
    pub objective: f64,
    /// The largest violation of a row or bound.
    pub violation: f64,
    /// The largest |min(G, H)|.
    pub complementarity: f64,
    /// How long it took.
    pub seconds: f64,
}

/// One problem of a folder.
#[derive(Clone, Debug)]
pub struct Record {
    /// Its name.
    pub name: String,
    /// What came of it, or why it was not read.
    pub result: Result<Report, String>,
    /// What is known of it.
    pub known: Known,
}

/// All problems of a folder.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Row by row.
    pub records: Vec<Record>,
}

/// Reads the column `best_known` and those that start with `peer_` of a file `results.csv`.
pub fn read_known(text: &str) -> Result<HashMap<String, Known>, csv::Error> {
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .from_reader(text.as_bytes());
    let titles = reader.headers()?.clone();
    let column = |name: &str| titles.iter().position(|title| title.trim() == name);
    let names = column("problem").unwrap_or(0);
    let best = column("best_known");
    let peers = ["objective", "violation", "complementarity_min", "seconds"];
    let peers = peers.map(|name| column(&format!("peer_{name}")));
    let mut known = HashMap::new();
    for record in reader.records() {
        let record = record?;
        let cell = |column: Option<usize>| record.get(column?).map(str::trim);
        let number = |column| cell(column)?.parse::<f64>().ok();
        let [objective, violation, complementarity, seconds] = peers.map(number);
        let peer = objective.map(|objective| Peer {
            objective,
            violation: violation.unwrap_or(f64::INFINITY),
            complementarity: complementarity.unwrap_or(f64::INFINITY),
            seconds: seconds.unwrap_or(f64::INFINITY),
        });
        let entry = Known {
            best: number(best),
            is_infeasible: cell(best) == Some(INFEASIBLE),
            peer,
        };
        known.insert(record.get(names).unwrap_or_default().to_owned(), entry);
    }
    Ok(known)
}

/// Whether an objective is within the tolerance of another one, or better.
fn reaches(objective: f64, best: f64, is_maximized: bool) -> bool {
    let excess = match is_maximized {
        true => best - objective,
        false => objective - best,
    };
    excess <= WELL * best.abs().max(1.0)
}

impl Peer {
    fn is_solved(&self) -> bool {
        self.violation <= FEASIBLE && self.complementarity <= FEASIBLE
    }
}

impl Record {
    /// Whether the point satisfies the problem.
    pub fn is_solved(&self) -> bool {
        let point = self.result.as_ref().ok().map(|report| report.quality);
        point.is_some_and(|q| q.violation <= FEASIBLE && q.complementarity_min <= FEASIBLE)
    }

    /// Whether the point has a class of stationarity; the other solver shows none.
    pub fn is_stationary(&self) -> bool {
        let report = self.result.as_ref().ok();
        report.is_some_and(|report| report.certificate.stationarity != Stationarity::None)
    }

    /// Whether it is as good as the best known one; `None` where none is known.
    pub fn is_solved_well(&self) -> Option<bool> {
        let best = self.known.best?;
        let report = self.result.as_ref().ok();
        let reached = report.is_some_and(|r| reaches(r.objective, best, r.is_maximized));
        Some(self.is_solved() && reached)
    }

    /// Whether the other solver has solved it.
    pub fn is_solved_by_peer(&self) -> bool {
        self.known.peer.is_some_and(|peer| peer.is_solved())
    }

    /// Whether the other solver has solved it well.
    pub fn is_solved_well_by_peer(&self) -> Option<bool> {
        let (best, peer) = (self.known.best?, self.known.peer?);
        let is_maximized = self.result.as_ref().is_ok_and(|report| report.is_maximized);
        Some(peer.is_solved() && reaches(peer.objective, best, is_maximized))
    }

    /// Seconds of solving.
    pub fn seconds(&self) -> f64 {
        let report = self.result.as_ref().ok();
        report.map_or(f64::INFINITY, |report| report.stats.solve_s)
    }

    /// The titles of [`Record::line`].
    pub fn titles(width: usize) -> String {
        format!(
            "{:width$} {:>6} {:>6} {:>5}  {:18} {:>16}  {:>9} {:>9} {:>5} {:>6} {:>9}",
            "problem",
            "vars",
            "rows",
            "pairs",
            "status",
            "objective",
            "violation",
            "min(G,H)",
            "class",
            "iter",
            "time"
        )
    }

    /// A line of the table, with a remark where the result is worth one.
    pub fn line(&self, width: usize) -> String {
        let report = match &self.result {
            Ok(report) => report,
            Err(message) => return format!("{:width$} not read: {message}", self.name),
        };
        let remark = match (self.is_solved(), self.is_solved_well()) {
            _ if self.known.is_infeasible => "  (known to be infeasible)".to_owned(),
            (false, _) => "  not solved".to_owned(),
            (true, Some(false)) => {
                let best = self.known.best.unwrap_or(f64::NAN);
                format!("  (best known {})", significant(best, 6))
            }
            _ => String::new(),
        };
        format!(
            "{:width$} {:6} {:6} {:5}  {:18} {:>16}  {:9.1e} {:9.1e} {:>5} {:6} {:>9}{remark}",
            self.name,
            report.sizes.variables,
            report.sizes.rows,
            report.sizes.complementarities,
            report.status.as_str(),
            significant(report.objective, 9),
            report.quality.violation,
            report.quality.complementarity_min,
            report.certificate.stationarity.as_str(),
            report.stats.newton_iterations,
            duration(report.stats.solve_s),
        )
    }
}

impl Table {
    /// How many are solved, in how much time, and by whom.
    pub fn summary(&self) -> String {
        let n = self.records.len();
        let count = |is: &dyn Fn(&Record) -> bool| self.records.iter().filter(|r| is(r)).count();
        let seconds: f64 = self
            .records
            .iter()
            .map(Record::seconds)
            .filter(|s| s.is_finite())
            .sum();
        let n_best = count(&|r| r.known.best.is_some());
        let well = |n_well: usize| match n_best {
            0 => String::new(),
            _ => format!(", {n_well} of {n_best} with a known optimum solved well"),
        };
        let solved = count(&Record::is_solved);
        let solved_well = well(count(&|r| r.is_solved_well() == Some(true)));
        let stationary = count(&|r| r.is_solved() && r.is_stationary());
        let mut text = format!(
            "{solved} of {n} solved{solved_well}, {stationary} shown to be stationary, {}\n",
            duration(seconds)
        );
        if count(&|r| r.known.peer.is_some()) > 0 {
            let solved = count(&Record::is_solved_by_peer);
            let solved_well = well(count(&|r| r.is_solved_well_by_peer() == Some(true)));
            let peers = self.records.iter().filter_map(|r| r.known.peer);
            let seconds: f64 = peers
                .map(|peer| peer.seconds)
                .filter(|s| s.is_finite())
                .sum();
            text += &format!(
                "peer: {solved} of {n} solved{solved_well}, {}\n",
                duration(seconds)
            );
            let (better, worse) = self.compared();
            text += &format!(
                "both solved: {better} with a better objective, {worse} with a worse one\n"
            );
        }
        let infeasible = count(&|r| {
            let report = r.result.as_ref();
            report.is_ok_and(|r| r.status == Status::LocallyInfeasible && !r.is_feasible)
        });
        if infeasible > 0 {
            text += &format!("locally infeasible: {infeasible}\n");
        }
        text
    }

    /// How often the objective is better and worse than that of the peer, where both have solved the problem.
    fn compared(&self) -> (usize, usize) {
        let (mut better, mut worse) = (0, 0);
        for record in &self.records {
            let (Ok(report), Some(peer)) = (&record.result, record.known.peer) else {
                continue;
            };
            if record.is_solved() && peer.is_solved() {
                let (ours, theirs) = (report.objective, peer.objective);
                better += usize::from(!reaches(theirs, ours, report.is_maximized));
                worse += usize::from(!reaches(ours, theirs, report.is_maximized));
            }
        }
        (better, worse)
    }

    /// All numbers, one line per problem.
    pub fn csv(&self) -> Result<String, csv::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record([
            "problem",
            "variables",
            "constraints",
            "complementarities",
            "sense",
            "status",
            "objective",
            "constraint_violation",
            "complementarity_min",
            "complementarity_product",
            "stationarity",
            "iterations",
            "solve_s",
            "best_known",
            "solved",
            "solved_well",
            "stationary",
            "peer_objective",
            "peer_solved",
            "peer_solved_well",
            "peer_seconds",
        ])?;
        for record in &self.records {
            let mut cells = vec![record.name.clone()];
            match &record.result {
                Ok(r) => cells.extend([
                    r.sizes.variables.to_string(),
                    r.sizes.rows.to_string(),
                    r.sizes.complementarities.to_string(),
                    if r.is_maximized { "max" } else { "min" }.to_owned(),
                    r.status.as_str().to_owned(),
                    r.objective.to_string(),
                    r.quality.violation.to_string(),
                    r.quality.complementarity_min.to_string(),
                    r.quality.complementarity_product.to_string(),
                    r.certificate.stationarity.as_str().to_owned(),
                    r.stats.newton_iterations.to_string(),
                    r.stats.solve_s.to_string(),
                ]),
                Err(_) => {
                    cells.extend(["", "", "", "", "not_read"].map(str::to_owned));
                    cells.extend([const { String::new() }; 7]);
                }
            }
            let yes = |is: Option<bool>| is.map_or(String::new(), |is| is.to_string());
            let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
            let peer = record.known.peer;
            cells.extend([
                match record.known.is_infeasible {
                    true => INFEASIBLE.to_owned(),
                    false => number(record.known.best),
                },
                record.is_solved().to_string(),
                yes(record.is_solved_well()),
                yes(Some(record.is_stationary())),
                number(peer.map(|peer| peer.objective)),
                yes(peer.map(|peer| peer.is_solved())),
                yes(record.is_solved_well_by_peer()),
                number(peer.map(|peer| peer.seconds)),
            ]);
            writer.write_record(&cells)?;
        }
        let bytes = writer.into_inner().map_err(|error| error.into_error())?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// For each solver its name, and its seconds for every problem that it has solved, and solved well.
    pub fn times(&self) -> Vec<(String, Vec<Option<f64>>)> {
        let all = |time: &dyn Fn(&Record) -> Option<f64>| -> Vec<Option<f64>> {
            self.records.iter().map(time).collect()
        };
        let peer = |r: &Record| r.known.peer.map(|peer| peer.seconds);
        let mut times = vec![(
            "nsdc".to_owned(),
            all(&|r| r.is_solved().then(|| r.seconds())),
        )];
        if self.records.iter().any(|r| r.known.peer.is_some()) {
            let own = all(&|r| peer(r).filter(|_| r.is_solved_by_peer()));
            times.push(("peer".to_owned(), own));
        }
        if self.records.iter().any(|r| r.known.best.is_some()) {
            let well = |r: &Record| r.is_solved_well() == Some(true);
            let own = all(&|r| well(r).then(|| r.seconds()));
            times.push(("nsdc, solved well".to_owned(), own));
            let well = |r: &Record| r.is_solved_well_by_peer() == Some(true);
            let own = all(&|r| peer(r).filter(|_| well(r)));
            if own.iter().any(Option::is_some) {
                times.push(("peer, solved well".to_owned(), own));
            }
        }
        times
    }
}
