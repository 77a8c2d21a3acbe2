//! The sign matrix of a subsystem: which combinations of sides are regions, and what they are called.

use crate::system::{Subsystem, System};

use super::DcsError;
use super::labels::signed;

/// No subsystem has more regions.
const MAX_REGIONS: usize = 1 << 10;

/// A region of a subsystem with the sign of every switch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Row {
    /// The user's region, as an index of the partition.
    pub region: Option<usize>,
    /// True for ψ > 0, by position in [`Subsystem::switches`].
    pub signs: Vec<bool>,
}

/// Refuses 2^n regions where n is large.
pub(super) fn check_size(system: &System, subsystem: &Subsystem) -> Result<(), DcsError> {
    let n = subsystem.switches.len();
    if u32::try_from(n).is_ok_and(|n| n <= MAX_REGIONS.ilog2()) {
        return Ok(());
    }
    let mut spans = (subsystem.switches.iter()).flat_map(|&k| &system.switches[k].spans);
    Err(DcsError::TooManyRegions {
        count: n,
        span: spans.next().copied().unwrap_or_default(),
    })
}

/// Refuses the first subsystem with too many regions.
pub(super) fn check(system: &System) -> Result<(), DcsError> {
    let mut subsystems = system.subsystems.iter();
    subsystems.try_for_each(|subsystem| check_size(system, subsystem))
}

/// All 2^n rows: region by region where they are the user's, the last switch changing fastest.
pub(super) fn rows(system: &System, subsystem: &Subsystem) -> Vec<Row> {
    let named = subsystem.regions;
    let named = named.and_then(|partition| named_rows(system, subsystem, partition));
    named.unwrap_or_else(|| {
        let all = completions(&vec![None; subsystem.switches.len()]).into_iter();
        let row = |signs| Row {
            region: None,
            signs,
        };
        all.map(row).collect()
    })
}

fn named_rows(system: &System, subsystem: &Subsystem, partition: usize) -> Option<Vec<Row>> {
    let mut rows = Vec::new();
    for (region, what) in system.partitions[partition].regions.iter().enumerate() {
        let mut pattern = vec![None; subsystem.switches.len()];
        for &(switch, plus) in what.literals.as_ref()? {
            let place = subsystem.switches.iter().position(|&k| k == switch)?;
            pattern[place] = Some(plus);
        }
        rows.extend(completions(&pattern).into_iter().map(|signs| Row {
            region: Some(region),
            signs,
        }));
    }
    Some(rows)
}

/// All ways to fill the open signs, minus before plus.
fn completions(pattern: &[Option<bool>]) -> Vec<Vec<bool>> {
    let mut rows = vec![Vec::with_capacity(pattern.len())];
    for sign in pattern {
        let choices: &[bool] = match sign {
            Some(true) => &[true],
            Some(false) => &[false],
            None => &[false, true],
        };
        let extend = |row: Vec<bool>| {
            choices.iter().map(move |&choice| {
                let mut row = row.clone();
                row.push(choice);
                row
            })
        };
        rows = rows.into_iter().flat_map(extend).collect();
    }
    rows
}

/// `inside`, `x[1]-,x[2]+`, or `one,x[2]+` where region `one` leaves the sign of x[2] open.
pub(super) fn row_name(
    system: &System,
    subsystem: &Subsystem,
    rows: &[Row],
    row: &Row,
    labels: &[String],
) -> String {
    let siblings = || rows.iter().filter(|other| other.region == row.region);
    let varies = |place: usize| siblings().any(|other| other.signs[place] != row.signs[place]);
    let signs = subsystem.switches.iter().zip(&row.signs).enumerate();
    let signs = signs
        .filter(|&(place, _)| row.region.is_none() || varies(place))
        .map(|(_, (&k, &plus))| signed(&labels[k], plus));
    let region = subsystem.regions.zip(row.region);
    let region =
        region.map(|(partition, region)| system.partitions[partition].regions[region].name.clone());
    region
        .into_iter()
        .chain(signs)
        .collect::<Vec<_>>()
        .join(",")
}

/// S_rk.
pub(super) fn sign(plus: bool) -> f64 {
    if plus { 1.0 } else { -1.0 }
}
