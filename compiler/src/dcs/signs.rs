//! The sign matrix of a subsystem: which combinations of sides are regions, and what they are called.
//!
//! Where ψ_i and ψ_j, each divided by a number, differ by a constant, their surfaces are parallel, and one combination
//! of their signs cannot happen: x < 1 and x > 2. Such rows are left out, since nothing but an orthant that can be
//! reached needs one. The constant may depend on parameters; their values decide.

use rustc_hash::FxHashMap;

use crate::expr::{Expr, Var};
use crate::system::{Subsystem, System};

use super::DcsError;
use super::labels::signed;

/// No subsystem has more regions.
const MAX_REGIONS: usize = 1 << 10;

/// Surfaces that are closer are not taken for parallel ones: the distance may be rounding.
const MIN_DISTANCE: f64 = 1e-9;

/// A region of a subsystem with the sign of every switch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Row {
    /// The user's region, as partition and index in it.
    pub region: Option<(usize, usize)>,
    /// True for ψ > 0, by position in [`Subsystem::switches`].
    pub signs: Vec<bool>,
}

/// Refuses the first subsystem with too many regions.
pub(super) fn check(system: &System) -> Result<(), DcsError> {
    let mut subsystems = system.subsystems.iter();
    subsystems.try_for_each(|subsystem| rows(system, subsystem).map(|_| ()))
}

/// Whether the subsystem is nothing but disjoint regions of the user.
pub(super) fn is_named(system: &System, subsystem: &Subsystem) -> bool {
    let Ok(rows) = rows(system, subsystem) else {
        return false;
    };
    let alone = |row: &Row| {
        rows.iter()
            .filter(|other| other.region == row.region)
            .count()
            == 1
    };
    rows.iter()
        .all(|row| row.region.is_some() && (subsystem.regions.is_some() || alone(row)))
}

/// The rows that can be reached: region by region where they are the user's, the last switch changing fastest.
pub(super) fn rows(system: &System, subsystem: &Subsystem) -> Result<Vec<Row>, DcsError> {
    let psi: Vec<Expr> = subsystem
        .switches
        .iter()
        .map(|&k| system.switches[k].psi)
        .collect();
    let params = system.params.iter();
    let params: FxHashMap<Var, f64> = params
        .filter_map(|p| Some((p.var.as_variable()?, p.value)))
        .collect();
    let mut signs: Vec<Vec<bool>> = vec![Vec::new()];
    for place in 0..psi.len() {
        let impossible = (0..place).filter_map(|other| {
            let (first, second) = impossible(psi[other], psi[place], &params)?;
            Some((other, first, second))
        });
        let impossible: Vec<(usize, bool, bool)> = impossible.collect();
        let possible = |row: &[bool], sign: bool| {
            impossible
                .iter()
                .all(|&(other, first, second)| row[other] != first || sign != second)
        };
        let longer = signs.iter().flat_map(|row| {
            let signs = [false, true]
                .into_iter()
                .filter(|&sign| possible(row, sign));
            signs.map(|sign| row.iter().copied().chain([sign]).collect())
        });
        signs = longer.take(MAX_REGIONS + 1).collect();
        if signs.len() > MAX_REGIONS {
            let mut spans = (subsystem.switches.iter()).flat_map(|&k| &system.switches[k].spans);
            return Err(DcsError::TooManyRegions {
                count: psi.len(),
                span: spans.next().copied().unwrap_or_default(),
            });
        }
    }
    let rows = signs.into_iter().map(|signs| Row {
        region: region(system, subsystem, &signs),
        signs,
    });
    let mut rows: Vec<Row> = rows.collect();
    rows.sort_by_key(|row| row.region);
    Ok(rows)
}

/// The signs of two parallel surfaces that exclude each other.
fn impossible(a: Expr, b: Expr, params: &FxHashMap<Var, f64>) -> Option<(bool, bool)> {
    let ((scale_a, a), (scale_b, b)) = (a.split_scale(), b.split_scale());
    // â - b̂ is this constant, so that b̂ > 0 implies â > 0 where it is positive; other variables give no number.
    let distance = (a - b).eval(&|var| params.get(&var).copied().unwrap_or(f64::NAN));
    let (plus_a, plus_b) = (scale_a > 0.0, scale_b > 0.0);
    if distance > MIN_DISTANCE {
        Some((!plus_a, plus_b))
    } else if distance < -MIN_DISTANCE {
        Some((plus_a, !plus_b))
    } else {
        None
    }
}

/// The region that holds at a row, of the first partition that is about no other switches.
fn region(system: &System, subsystem: &Subsystem, signs: &[bool]) -> Option<(usize, usize)> {
    let own = |k: &usize| subsystem.switches.contains(k);
    let mut partitions = system.partitions.iter();
    let partition =
        partitions.position(|p| !p.switches.is_empty() && p.switches.iter().all(own))?;
    let corner = |var| {
        let place = subsystem
            .switches
            .iter()
            .position(|&k| system.switches[k].alpha.as_variable() == Some(var));
        place.map_or(f64::NAN, |place| f64::from(signs[place]))
    };
    let regions = &system.partitions[partition].regions;
    let region = regions
        .iter()
        .position(|region| region.weight.eval(&corner) > 0.5)?;
    Some((partition, region))
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
    let region = row.region;
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
