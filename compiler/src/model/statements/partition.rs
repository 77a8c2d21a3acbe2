//! Partitions: regions that set a common state, and that every state entry is set once.

use rustc_hash::{FxHashMap, FxHashSet};

use super::indicators;
use crate::diagnostics::Diagnostics;
use crate::model::expressions::check::corners_are_empty;
use crate::model::{DynamicsError, Model, Partition, Region};
use crate::source::Span;

/// Finds the partitions and checks who sets what.
///
/// `touched` are states of which some statement is wrong.
pub(crate) fn partition(
    model: &mut Model<'_>,
    touched: &FxHashSet<String>,
    diags: &mut Diagnostics,
) {
    thin_guards(model, diags);
    let outside = set_outside(model, diags);
    let inside: Vec<FxHashMap<usize, Span>> = (0..model.statements.regions.len())
        .map(|r| set_inside(model, r, diags))
        .collect();
    for set in &inside {
        let twice = set
            .iter()
            .filter(|(entry, _)| outside.contains_key(entry))
            .min();
        if let Some((&entry, &second)) = twice {
            let entry_name = entry_name(model, entry);
            diags.push(DynamicsError::SetTwice {
                entry: entry_name,
                first: outside[&entry],
                second,
            });
        }
    }
    model.partitions = components(&inside, model);
    for (index, region) in model.statements.regions.iter().enumerate() {
        if region.is_else && inside[index].is_empty() {
            diags.push(DynamicsError::ElseAlone {
                region: local(&region.name),
                span: region.span,
            });
        }
    }
    for partition in &model.partitions {
        check(model, partition, &inside, touched, diags);
    }
    missing(model, &outside, touched, diags);
    complements(model);
    indicators::compare(model, diags);
}

/// Guards that hold on no side of their surfaces.
fn thin_guards(model: &Model<'_>, diags: &mut Diagnostics) {
    let guarded = |region: &&Region<'_>| !region.is_else && region.indicator.is_none();
    for region in model.statements.regions.iter().filter(guarded) {
        if corners_are_empty(region.guard) {
            diags.push(DynamicsError::ThinGuard {
                span: region.guard_span,
            });
        }
    }
}

fn set_outside(model: &Model<'_>, diags: &mut Diagnostics) -> FxHashMap<usize, Span> {
    let rates = model
        .statements
        .dynamics
        .iter()
        .filter(|rate| !rate.adds)
        .map(|rate| (rate.entry, rate.span));
    once(model, rates, diags)
}

fn set_inside(model: &Model<'_>, region: usize, diags: &mut Diagnostics) -> FxHashMap<usize, Span> {
    let rates = model.statements.regions[region]
        .rates
        .iter()
        .filter(|rate| !rate.adds)
        .map(|rate| (rate.entry, rate.span));
    once(model, rates, diags)
}

/// Entries with the statement that sets them; a second one is reported, once per pair of statements.
fn once(
    model: &Model<'_>,
    rates: impl Iterator<Item = (usize, Span)>,
    diags: &mut Diagnostics,
) -> FxHashMap<usize, Span> {
    let mut set = FxHashMap::default();
    let mut reported = FxHashSet::default();
    for (entry, span) in rates {
        if let Some(&first) = set.get(&entry) {
            if reported.insert((first, span)) {
                diags.push(DynamicsError::SetTwice {
                    entry: entry_name(model, entry),
                    first,
                    second: span,
                });
            }
        } else {
            set.insert(entry, span);
        }
    }
    set
}

/// Regions joined by the entries they set.
fn components(inside: &[FxHashMap<usize, Span>], model: &Model<'_>) -> Vec<Partition> {
    let mut joined = petgraph::unionfind::UnionFind::<usize>::new(inside.len());
    let mut first: FxHashMap<usize, usize> = FxHashMap::default();
    for (region, set) in inside.iter().enumerate() {
        for &entry in set.keys() {
            joined.union(*first.entry(entry).or_insert(region), region);
        }
    }
    let mut partitions: Vec<(usize, Partition)> = vec![];
    for (region, set) in inside.iter().enumerate().filter(|(_, set)| !set.is_empty()) {
        let root = joined.find(region);
        let partition = match partitions.iter().position(|(other, _)| *other == root) {
            Some(known) => &mut partitions[known].1,
            None => {
                partitions.push((
                    root,
                    Partition {
                        regions: vec![],
                        entries: vec![],
                    },
                ));
                let last = partitions.len() - 1;
                &mut partitions[last].1
            }
        };
        partition.regions.push(region);
        partition.entries.extend(set.keys());
    }
    let tidy = |(_, mut partition): (usize, Partition)| {
        partition
            .regions
            .sort_by_key(|&region| (model.statements.regions[region].is_else, region));
        partition.entries.sort_unstable();
        partition.entries.dedup();
        partition
    };
    partitions.into_iter().map(tidy).collect()
}

/// All regions of a partition set the same entries, and there is a rest of something.
fn check(
    model: &Model<'_>,
    partition: &Partition,
    inside: &[FxHashMap<usize, Span>],
    touched: &FxHashSet<String>,
    diags: &mut Diagnostics,
) {
    let region = |index: usize| &model.statements.regions[index];
    let is_touched = |entry: usize| touched.contains(&state_name(model, entry));
    if let [only] = partition.regions[..] {
        let Some(&entry) = partition.entries.first() else {
            return;
        };
        if is_touched(entry) {
            return;
        }
        let name = local(&region(only).name);
        let span = inside[only]
            .get(&entry)
            .copied()
            .unwrap_or(region(only).span);
        diags.push(match region(only).is_else {
            true => DynamicsError::ElseAlone {
                region: name,
                span: region(only).span,
            },
            // Told with the indicators.
            false if region(only).indicator.is_some() => return,
            false => DynamicsError::LoneRegion {
                region: name,
                entry: entry_name(model, entry),
                span,
                statement: region(only).span,
                entries: (partition.entries.iter())
                    .map(|&entry| entry_name(model, entry))
                    .collect(),
            },
        });
        return;
    }
    let rests: Vec<usize> = partition
        .regions
        .iter()
        .copied()
        .filter(|&index| region(index).is_else)
        .collect();
    if let [first, second, ..] = rests[..] {
        let entry = entry_name(model, partition.entries[0]);
        diags.push(DynamicsError::TwoElse {
            entry,
            first: region(first).span,
            second: region(second).span,
        });
    }
    for &index in &partition.regions {
        let misses = |entry: &&usize| !inside[index].contains_key(*entry) && !is_touched(**entry);
        let Some(&entry) = partition.entries.iter().find(misses) else {
            continue;
        };
        let other = partition
            .regions
            .iter()
            .find_map(|&other| Some((other, *inside[other].get(&entry)?)));
        let Some((other, first)) = other else {
            continue;
        };
        diags.push(DynamicsError::RegionMisses {
            region: local(&region(index).name),
            entry: entry_name(model, entry),
            first,
            second: region(index).span,
            other: local(&region(other).name),
        });
    }
}

/// The name of an entry as the model that declares it says it, without the parts around it.
fn entry_name(model: &Model<'_>, entry: usize) -> String {
    local(&model.entry_name(entry))
}

/// `q[1]` of `ball[3].q[1]`
pub(crate) fn local(name: &str) -> String {
    name.rsplit('.').next().unwrap_or_default().to_owned()
}

fn state_name(model: &Model<'_>, entry: usize) -> String {
    let mut first = 0;
    let state = model.quantities.states.iter().find(|state| {
        first += state.vars.len();
        entry < first
    });
    state.map(|state| state.name.clone()).unwrap_or_default()
}

/// States of which an entry is set nowhere; one error per state.
fn missing(
    model: &Model<'_>,
    outside: &FxHashMap<usize, Span>,
    touched: &FxHashSet<String>,
    diags: &mut Diagnostics,
) {
    let in_regions: FxHashSet<usize> = model
        .partitions
        .iter()
        .flat_map(|partition| partition.entries.iter().copied())
        .collect();
    let mut first = 0;
    for state in &model.quantities.states {
        let n = state.vars.len();
        let unset: Vec<usize> = (0..n)
            .filter(|position| {
                !outside.contains_key(&(first + position))
                    && !in_regions.contains(&(first + position))
            })
            .collect();
        if let Some(&position) = unset.first()
            && !touched.contains(&state.name)
        {
            let name = local(&state.name);
            let entry = if unset.len() == n {
                name.clone()
            } else {
                state.shape.entry_name(&name, position)
            };
            diags.push(DynamicsError::NoDynamics {
                name,
                entry,
                span: state.span,
            });
        }
        first += n;
    }
}

/// `else` is 1 minus the others.
fn complements(model: &mut Model<'_>) {
    for partition in &model.partitions {
        let Some((&last, others)) = partition.regions.split_last() else {
            continue;
        };
        if model.statements.regions[last].is_else {
            let covered = model.exprs.sum(
                others
                    .iter()
                    .map(|&index| model.statements.regions[index].guard),
            );
            model.statements.regions[last].guard = 1.0 - covered;
        }
    }
}
