//! Stewart's form of a partition: R_i = { g_i < min_{j≠i} g_j } -> guards.
//!
//! The smallest of m indicators is found as in a tournament, which needs m - 1 comparisons instead of one for each pair:
//!
//! m_1 = g_1,   β_k = step(m_{k-1} - g_k),   m_k = min(m_{k-1}, g_k),   1_{R_k} = β_k Π_{j>k} (1 - β_j),   β_1 = 1
//!
//! β_k says that region k beats all before it. The guards add up to one for all values of β, and where several β are free
//! in [0, 1] they take all values of a simplex: Filippov's set is kept where three regions or more meet. The comparison
//! β_k holds the earlier ones in a continuous minimum only.
//!
//! Stewart 1990 for the form.

use super::partition::local;
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::{DynamicsError, Model, Surface};

/// Checks the indicators of all partitions and makes guards of them.
pub(crate) fn compare<'e>(model: &mut Model<'e>, diags: &mut Diagnostics) {
    let alone = (0..model.statements.regions.len()).filter(|&index| {
        let partition = model.partitions.iter().find(|p| p.regions.contains(&index));
        let is_alone = partition.is_none_or(|partition| partition.regions.len() == 1);
        is_alone && model.statements.regions[index].indicator.is_some()
    });
    for index in alone {
        diags.push(DynamicsError::LoneIndicator {
            region: local(&model.statements.regions[index].name),
            span: model.statements.regions[index].guard_span,
        });
    }
    for partition in model.partitions.clone() {
        let regions = &partition.regions;
        let indicators = regions
            .iter()
            .map(|&index| model.statements.regions[index].indicator);
        let indicators: Vec<Option<Expr<'e>>> = indicators.collect();
        let Some(first) = indicators.iter().position(Option::is_some) else {
            continue;
        };
        if let Some(second) = indicators.iter().position(Option::is_none) {
            let (first, second) = (
                &model.statements.regions[regions[first]],
                &model.statements.regions[regions[second]],
            );
            diags.push(DynamicsError::MixedGuards {
                first: local(&first.name),
                second: local(&second.name),
                first_span: first.guard_span,
                second_span: second.guard_span,
                note: match second.is_else {
                    true => "; indicators leave no rest",
                    false => "",
                },
            });
            continue;
        }
        let indicators: Vec<Expr<'e>> = indicators.into_iter().flatten().collect();
        if has_boundaries(model, regions, &indicators, diags) {
            tournament(model, regions, &indicators);
        }
    }
}

/// Whether every two indicators are equal somewhere, as far as their form shows.
fn has_boundaries(
    model: &Model<'_>,
    regions: &[usize],
    indicators: &[Expr<'_>],
    diags: &mut Diagnostics,
) -> bool {
    let pairs = (0..regions.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
    let mut fine = true;
    for (i, j) in pairs {
        let Some(difference) = (indicators[j] - indicators[i]).as_constant() else {
            continue;
        };
        fine = false;
        let (first, second) = (
            &model.statements.regions[regions[i]],
            &model.statements.regions[regions[j]],
        );
        diags.push(DynamicsError::NoBoundary {
            first: local(&first.name),
            second: local(&second.name),
            relation: match difference {
                0.0 => "are equal".to_owned(),
                _ => "differ by a constant".to_owned(),
            },
            first_span: first.guard_span,
            second_span: second.guard_span,
        });
    }
    fine
}

fn tournament<'e>(model: &mut Model<'e>, regions: &[usize], indicators: &[Expr<'e>]) {
    let mut names = local(&model.statements.regions[regions[0]].name);
    let mut smallest = indicators[0];
    model.statements.regions[regions[0]].guard = model.exprs.constant(1.0);
    for (k, &g) in indicators.iter().enumerate().skip(1) {
        let psi = smallest - g;
        let beats = psi.step();
        let region = &model.statements.regions[regions[k]];
        let name = local(&region.name);
        let (words, span) = (format!("{names} | {name}"), region.guard_span);
        model.surfaces.push(Surface::new(words, psi, span));
        for &earlier in &regions[..k] {
            let guard = &mut model.statements.regions[earlier].guard;
            *guard = *guard * (1.0 - beats);
        }
        model.statements.regions[regions[k]].guard = beats;
        smallest = smallest.min(g);
        names = format!("{names}, {name}");
    }
}
