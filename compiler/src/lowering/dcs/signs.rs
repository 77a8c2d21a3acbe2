//! The sign matrix of a subsystem: which combinations of sides are regions, and what they are called.
//!
//! Combinations that cannot happen are left out, since nothing but an orthant that can be reached needs a row: x < 1 and
//! x > 2, or x > 0, y > 0 and x + y < -1. Those that a point on several surfaces can touch are kept. ψ may depend on
//! parameters; their values decide.
//!
//! Regions with indicators are rows as they are: what their switches compare is in the indicators.

use crate::expr::{Expr, Interval, variables_of};
use crate::system::regions::arrangement::{Side, Sides};
use crate::system::{Subsystem, System};

use super::DcsError;
use super::labels::signed;

/// No subsystem has more regions,
const MAX_REGIONS: usize = 1 << 10;

/// or than these, where switching functions hold sides of others: each then has as many terms as there are regions.
const MAX_NESTED: usize = 1 << 7;

/// After so many linear programs, combinations are taken to be possible.
const MOST_PROGRAMS: usize = 1000;

/// A region of a subsystem with the sign of every switch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    /// The user's region, as partition and index in it.
    pub region: Option<(usize, usize)>,
    /// True for ψ > 0, by position in [`Subsystem::switches`].
    pub signs: Vec<bool>,
    /// Positions of the signs that the row is about; the others follow from the indicator of its region.
    pub own: Vec<usize>,
    /// Positions of the switches that the indicator of the row's region stands for.
    pub indicated: Vec<usize>,
}

/// Refuses the first subsystem with too many regions.
pub(crate) fn check(system: &System) -> Result<(), DcsError> {
    let mut subsystems = system.coupling.subsystems.iter();
    subsystems.try_for_each(|subsystem| rows(system, subsystem).map(|_| ()))
}

/// The first of some parameters, by their numbers, with which within its range other combinations of sides are regions.
pub(crate) fn first_deciding(system: &System, open: &[(usize, Interval)]) -> Option<usize> {
    several(system).find_map(|subsystem| {
        let switches = subsystem.switches.iter();
        let psi: Vec<Expr> = switches.map(|&k| system.switches[k].psi).collect();
        let inside = variables_of(&psi);
        let occurs = |place: usize| {
            let var = system.exogenous.params[place].var.as_variable();
            var.is_some_and(|var| inside.contains(&var))
        };
        let open = open.iter().filter(|(place, _)| occurs(*place));
        let open: Vec<(usize, Interval)> = open.copied().collect();
        let known = rows(system, subsystem).ok()?;
        let differs = |n: &usize| {
            let found = rows_over(system, subsystem, &open[..*n]).ok();
            found.as_ref() != Some(&known)
        };
        (1..=open.len()).find(differs).map(|n| open[n - 1].0)
    })
}

/// The subsystems of several switches.
pub(crate) fn several<'s>(system: &'s System) -> impl Iterator<Item = &'s Subsystem> {
    let subsystems = system.coupling.subsystems.iter();
    subsystems.filter(|subsystem| subsystem.switches.len() > 1)
}

/// Whether the subsystem is nothing but disjoint regions of the user.
pub(crate) fn is_named(system: &System, subsystem: &Subsystem) -> bool {
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

/// The partition with indicators whose switches are in the subsystem; none where there are several.
fn indicated(system: &System, subsystem: &Subsystem) -> Option<usize> {
    let own = |k: &usize| subsystem.switches.contains(k);
    let inside = |&p: &usize| {
        let partition = &system.coupling.partitions[p];
        !partition.indicators.is_empty() && partition.switches.iter().all(own)
    };
    let mut found = (0..system.coupling.partitions.len()).filter(inside);
    match (found.next(), found.next()) {
        (Some(partition), None) => Some(partition),
        _ => None,
    }
}

/// The rows that can be reached: region by region where they are the user's, the last switch changing fastest.
pub(crate) fn rows(system: &System, subsystem: &Subsystem) -> Result<Vec<Row>, DcsError> {
    rows_over(system, subsystem, &[])
}

/// Those that can be reached with some value of parameters within their ranges.
fn rows_over(
    system: &System,
    subsystem: &Subsystem,
    open: &[(usize, Interval)],
) -> Result<Vec<Row>, DcsError> {
    let Some(p) = indicated(system, subsystem) else {
        let all: Vec<usize> = (0..subsystem.switches.len()).collect();
        let rows = combinations(system, subsystem, &subsystem.switches, open)?;
        let rows = rows.into_iter().map(|signs| Row {
            region: region(system, subsystem, &signs),
            signs,
            own: all.clone(),
            indicated: Vec::new(),
        });
        let mut rows: Vec<Row> = rows.collect();
        rows.sort_by_key(|row| row.region);
        return Ok(rows);
    };
    let partition = &system.coupling.partitions[p];
    let place = |k: &usize| subsystem.switches.binary_search(k).expect("a member");
    let indicated: Vec<usize> = partition.switches.iter().map(place).collect();
    let others: Vec<usize> = (subsystem.switches.iter().copied())
        .filter(|k| !partition.switches.contains(k))
        .collect();
    let combinations = combinations(system, subsystem, &others, open)?;
    let mut rows = Vec::new();
    for (r, region) in partition.regions.iter().enumerate() {
        let literals = region.literals.as_deref().unwrap_or_default();
        for combination in &combinations {
            let decided = || literals.iter().copied();
            let signed = decided().chain(others.iter().copied().zip(combination.iter().copied()));
            let mut row = Row {
                region: Some((p, r)),
                signs: vec![false; subsystem.switches.len()],
                own: Vec::new(),
                indicated: indicated.clone(),
            };
            for (k, sign) in signed {
                row.signs[place(&k)] = sign;
                row.own.push(place(&k));
            }
            rows.push(row);
        }
    }
    match rows.len() > most_regions(system, subsystem) {
        true => Err(too_many(system, subsystem)),
        false => Ok(rows),
    }
}

/// How many regions a subsystem may have.
fn most_regions(system: &System, subsystem: &Subsystem) -> usize {
    let alphas = subsystem.switches.iter().map(|&k| system.switches[k].alpha);
    let alphas = variables_of(&alphas.collect::<Vec<_>>());
    let holds = |&k: &usize| {
        let vars = variables_of(&[system.switches[k].psi]);
        vars.iter().any(|var| alphas.contains(var))
    };
    match subsystem.switches.iter().any(holds) {
        true => MAX_NESTED,
        false => MAX_REGIONS,
    }
}

fn too_many(system: &System, subsystem: &Subsystem) -> DcsError {
    let mut spans = (subsystem.switches.iter()).flat_map(|&k| &system.switches[k].spans);
    DcsError::TooManyRegions {
        count: subsystem.switches.len(),
        span: spans.next().copied().unwrap_or_default(),
    }
}

/// The combinations of the sides of some switches of a subsystem that can be reached.
fn combinations(
    system: &System,
    subsystem: &Subsystem,
    switches: &[usize],
    open: &[(usize, Interval)],
) -> Result<Vec<Vec<bool>>, DcsError> {
    let count = switches.len();
    match count {
        0 => return Ok(vec![Vec::new()]),
        1 => return Ok(vec![vec![false], vec![true]]),
        _ => {}
    }
    let is_open = |place: usize| open.iter().any(|(known, _)| *known == place);
    let arrangement = system.arrangement(switches, is_open);
    let most = most_regions(system, subsystem);
    let within = |sides: Sides, (place, range): &(usize, Interval)| {
        arrangement.between(
            &sides,
            system.exogenous.params[*place].var,
            range.low,
            range.high,
        )
    };
    let mut combinations = vec![open.iter().fold(arrangement.all(), within)];
    for place in 0..count {
        // What fails or takes too long is not left out; neither is one that can only be touched.
        let side = |sides: &Sides, above: bool| {
            if arrangement.n_programs() > MOST_PROGRAMS {
                return Some(sides.with(place, above));
            }
            match arrangement.side(sides, place, above) {
                Side::Cell(part) | Side::Unknown(part) => Some(part),
                Side::Empty => None,
            }
        };
        let longer = combinations.iter().flat_map(|sides| {
            [false, true]
                .into_iter()
                .filter_map(|above| side(sides, above))
        });
        combinations = longer.take(most + 1).collect();
        if combinations.len() > most {
            return Err(too_many(system, subsystem));
        }
    }
    let signs = combinations.into_iter();
    let signs = signs.map(|sides| sides.signs.iter().map(|sign| *sign == Some(true)).collect());
    Ok(signs.collect())
}

/// The first partition that is about switches of a subsystem and no others.
pub(crate) fn partition(system: &System, subsystem: &Subsystem) -> Option<usize> {
    let own = |k: &usize| subsystem.switches.contains(k);
    let mut partitions = system.coupling.partitions.iter();
    partitions.position(|p| !p.switches.is_empty() && p.switches.iter().all(own))
}

/// The region that holds at a row, of that partition.
fn region(system: &System, subsystem: &Subsystem, signs: &[bool]) -> Option<(usize, usize)> {
    let partition = partition(system, subsystem)?;
    let corner = |var| {
        let place = subsystem
            .switches
            .iter()
            .position(|&k| system.switches[k].alpha.as_variable() == Some(var));
        place.map_or(f64::NAN, |place| f64::from(signs[place]))
    };
    let regions = &system.coupling.partitions[partition].regions;
    let region = regions
        .iter()
        .position(|region| region.weight.eval(&corner) > 0.5)?;
    Some((partition, region))
}

/// `inside`, `x[1]-,x[2]+`, or `one,x[2]+` where region `one` leaves the sign of x[2] open.
pub(crate) fn row_name(
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
    let partitions = &system.coupling.partitions;
    let region = region.map(|(p, region)| partitions[p].regions[region].name.clone());
    region
        .into_iter()
        .chain(signs)
        .collect::<Vec<_>>()
        .join(",")
}

/// S_rk.
pub(crate) fn sign(plus: bool) -> f64 {
    if plus { 1.0 } else { -1.0 }
}
