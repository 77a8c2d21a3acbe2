//! Stewart's reformulation: System -> Dcs.
//!
//! A row of signs S_r names a region {ψ : S_rk ψ_k > 0 for all k} of a subsystem s. Its indicator g_r = -Σ_k S_rk ψ_k
//! is the smallest one in that region, so θ solves a linear program in every point, and its KKT conditions replace it:
//!
//! x' = f_0 + Σ_s F_s θ_s,   0 = g_s - λ_s - μ_s e,   0 = 1 - eᵀθ_s,   0 <= θ_s ⟂ λ_s >= 0
//!
//! The columns of F_s are the rates with α at the corner of {0, 1}^n that the row names. Subsystems do not multiply
//! each other, so their regions add up instead of multiplying. A guard of the user's that leaves a sign open has a row
//! for both, because -Sψ with an open sign prefers the wrong region; rows are found in `signs`. Where the regions have
//! indicators of their own, these are g, and -Σ_k S_rk ψ_k is left of the other switches of the subsystem.
//!
//! Stewart 1990; Nurkanović & Diehl 2022.

use std::collections::{HashMap, HashSet};

use crate::expr::{Expr, Exprs, Substitution, Var, variables_of};
use crate::source::Span;
use crate::system::System;

use super::pointwise::Sides;
use super::signs::{Row, row_name, rows, sign};
use super::{Cause, Dcs, DcsError, Formulation, Origin, labels};
use nsd_solver::fesd::{Rule, Rules};

/// θ of a subsystem with its rows.
struct Simplex<'e> {
    /// α of the subsystem's switches, as the system has them.
    alphas: Vec<Var>,
    rows: Vec<Row>,
    theta: Vec<Expr<'e>>,
}

/// Declares one θ and one λ per region, and one μ per subsystem.
pub fn lower<'e>(system: &System<'e>) -> Result<Dcs<'e>, DcsError> {
    let mut dcs = Dcs::frame(system, Formulation::Stewart);
    let labels = labels::of(system);
    let start = Sides::at_start(system);
    let guesses = rules(system).values(&start.psi, &start.alpha);
    let mut guesses = guesses.into_iter();
    let mut guess = || guesses.next().unwrap_or(0.0);
    let mut taken = HashSet::new();
    let [theta, lambda, mu] = ["theta", "lambda", "mu"].map(|word| labels::prefix(system, word));

    let mut simplices = Vec::with_capacity(system.coupling.subsystems.len());
    let mut multipliers = Vec::with_capacity(system.coupling.subsystems.len());
    for (s, subsystem) in system.coupling.subsystems.iter().enumerate() {
        let rows = rows(system, subsystem)?;
        let names: Vec<String> = (rows.iter())
            .map(|row| row_name(system, subsystem, &rows, row, &labels))
            .map(|name| labels::unique(name, &mut taken))
            .collect();
        let named = |prefix: &str| -> Vec<String> {
            names
                .iter()
                .map(|name| format!("{prefix}[{name}]"))
                .collect()
        };
        let theta = named(&theta).into_iter();
        let theta: Vec<Expr> = theta.map(|name| dcs.algebraic(&name, guess())).collect();
        let lambda = named(&lambda).into_iter();
        let lambda: Vec<Expr> = lambda.map(|name| dcs.multiplier(&name, guess())).collect();
        let alone = system.coupling.subsystems.len() == 1;
        let mu = if alone {
            mu.clone()
        } else {
            format!("{mu}[{}]", s + 1)
        };
        multipliers.push((lambda, dcs.multiplier(&mu, guess())));
        let alphas = (subsystem.switches.iter())
            .filter_map(|&k| system.switches[k].alpha.as_variable())
            .collect();
        simplices.push(Simplex {
            alphas,
            rows,
            theta,
        });
    }

    // α_k = Σ θ_r over the rows with ψ_k > 0.
    let marginals: Substitution = simplices.iter().flat_map(Simplex::marginals).collect();
    let shares: Substitution = simplices.iter().flat_map(Simplex::shares).collect();
    dcs.switches.alphas = (system.switches.iter())
        .map(|switch| switch.alpha.substitute(&shares).substitute(&marginals))
        .collect();
    dcs.rows.rates = (system.states.iter())
        .map(|state| combine(system.exprs, state.rate, &simplices))
        .collect();

    for (s, (simplex, (lambda, mu))) in simplices.iter().zip(&multipliers).enumerate() {
        let subsystem = &system.coupling.subsystems[s];
        let psi: Vec<Expr> = (subsystem.switches.iter())
            .map(|&k| system.switches[k].psi.substitute(&marginals))
            .collect();
        for (row, &lambda) in simplex.rows.iter().zip(lambda) {
            let compared = (0..psi.len()).filter(|place| !row.indicated.contains(place));
            let compared = compared.map(|place| sign(row.signs[place]) * psi[place]);
            let g = indicator(system, row)
                .map_or(dcs.exprs.constant(0.0), |g| g.substitute(&marginals))
                - dcs.exprs.sum(compared);
            dcs.equation(g - lambda - *mu, origin(system, s, row));
        }
        let whole = subsystem_origin(system, s);
        dcs.equation(1.0 - dcs.exprs.sum(simplex.theta.iter().copied()), whole);
        for ((row, &theta), &lambda) in simplex.rows.iter().zip(&simplex.theta).zip(lambda) {
            dcs.pair(theta, lambda, origin(system, s, row));
        }
    }
    Ok(dcs)
}

/// The indicator of the region of a row, where it has one.
fn indicator<'e>(system: &System<'e>, row: &Row) -> Option<Expr<'e>> {
    let (partition, region) = row.region?;
    system.coupling.partitions[partition]
        .indicators
        .get(region)
        .copied()
        .filter(|_| !row.indicated.is_empty())
}

/// θ, λ and μ in the order in which [`lower`] declares them: θ_r = Π α or 1-α, μ = min g, λ = g - μ.
pub(crate) fn rules(system: &System) -> Rules {
    let mut rules = Rules::default();
    for subsystem in &system.coupling.subsystems {
        // `lower` refuses what has too many.
        let rows = rows(system, subsystem).unwrap_or_default();
        let own = |row: &Row| {
            let own = row.own.iter();
            own.map(|&place| (subsystem.switches[place], row.signs[place]))
                .collect()
        };
        let compared = |row: &Row| {
            let indicator = row.region.filter(|_| !row.indicated.is_empty());
            let indicator = indicator.map(|(partition, region)| {
                let before = system.coupling.partitions[..partition].iter();
                let before: usize = before.map(|partition| partition.indicators.len()).sum();
                (system.switches.len() + before + region, 1.0)
            });
            let switches = subsystem.switches.iter().enumerate();
            let others = switches.filter(|(place, _)| !row.indicated.contains(place));
            let others = others.map(|(place, &k)| (k, -sign(row.signs[place])));
            indicator.into_iter().chain(others).collect()
        };
        let first = rules.compared.len();
        rules.compared.extend(rows.iter().map(compared));
        let all = first..rules.compared.len();
        rules.z.extend(rows.iter().map(own).map(Rule::Share));
        let excess = |region: usize| Rule::Excess(region, all.clone());
        rules.z.extend(all.clone().map(excess));
        rules.z.push(Rule::Least(all));
    }
    rules
}

/// Σ_r rate(corner r) θ_r where one subsystem drives the row, else f_0 + Σ_s Σ_r (rate(corner r) - f_0) θ_sr.
fn combine<'e>(exprs: &'e Exprs, rate: Expr<'e>, simplices: &[Simplex<'e>]) -> Expr<'e> {
    let present: HashSet<Var> = variables_of(&[rate]).into_iter().collect();
    let drives =
        |simplex: &&Simplex<'e>| simplex.alphas.iter().any(|alpha| present.contains(alpha));
    let drivers: Vec<&Simplex<'e>> = simplices.iter().filter(drives).collect();
    match drivers.as_slice() {
        [] => rate,
        [simplex] => {
            let columns = simplex
                .rows
                .iter()
                .map(|row| rate.substitute(&simplex.corner(exprs, row)));
            simplex.weigh(columns.collect())
        }
        _ => {
            // f_0 is the rate where every α has one value: 0 for `step` and guards, 1/2 where `sign` vanishes.
            let [low, middle] = [0.0, 0.5].map(|base| expand(exprs, rate, &drivers, base));
            let better =
                (!middle.0.is_zero(), n_nodes(middle.1)) < (!low.0.is_zero(), n_nodes(low.1));
            if better { middle.1 } else { low.1 }
        }
    }
}

/// f_0 and the row, for f_0 taken where every α has the value `base`.
fn expand<'e>(
    exprs: &'e Exprs,
    rate: Expr<'e>,
    drivers: &[&Simplex<'e>],
    base: f64,
) -> (Expr<'e>, Expr<'e>) {
    let alphas = drivers.iter().flat_map(|simplex| &simplex.alphas);
    let centre: Substitution = alphas.map(|&alpha| (alpha, exprs.constant(base))).collect();
    let f_0 = rate.substitute(&centre);
    let shares = drivers.iter().map(|simplex| {
        let partials: Vec<Expr> = simplex
            .alphas
            .iter()
            .map(|&alpha| rate.diff(alpha))
            .collect();
        // Moving one α after the other from the base to the corner: the rate is affine in each.
        let column = |row: &Row| {
            let mut point = centre.clone();
            let moves = simplex.alphas.iter().zip(&partials).zip(&row.signs);
            exprs.sum(moves.map(|((&alpha, partial), &plus)| {
                let corner = f64::from(plus);
                let change = (corner - base) * partial.substitute(&point);
                point.insert(alpha, exprs.constant(corner));
                change
            }))
        };
        simplex.weigh(simplex.rows.iter().map(column).collect())
    });
    let shares: Vec<Expr> = shares.collect();
    (f_0, f_0 + exprs.sum(shares))
}

fn n_nodes(expr: Expr) -> usize {
    let mut count = 0;
    crate::expr::rewrite(expr, &mut |e| {
        count += 1;
        e
    });
    count
}

impl<'e> Simplex<'e> {
    /// α at the corner of a row.
    fn corner(&self, exprs: &'e Exprs, row: &Row) -> Substitution<'e> {
        let signs = self.alphas.iter().zip(&row.signs);
        signs
            .map(|(&alpha, &plus)| (alpha, exprs.constant(f64::from(plus))))
            .collect()
    }

    /// Σ_r column_r θ_r; rows with a common column share a term, and θ adds up to one.
    fn weigh(&self, columns: Vec<Expr<'e>>) -> Expr<'e> {
        let exprs = columns[0].exprs();
        let mut order: Vec<Expr<'e>> = Vec::new();
        let mut shares: HashMap<Expr<'e>, Vec<Expr<'e>>> = HashMap::new();
        for (&column, &theta) in columns.iter().zip(&self.theta) {
            let share = shares.entry(column).or_default();
            if share.is_empty() {
                order.push(column);
            }
            share.push(theta);
        }
        if let [column] = order.as_slice() {
            return *column;
        }
        let terms = order
            .iter()
            .map(|column| *column * exprs.sum(shares[column].iter().copied()));
        exprs.sum(terms)
    }

    /// β_k = θ_k / Σ_{j <= k} θ_j for the comparisons that indicators stand for: where the sum is zero, any value is as
    /// good as another.
    fn shares(&self) -> Vec<(Var, Expr<'e>)> {
        let exprs = self.theta[0].exprs();
        let indicated = self.rows[0].indicated.iter();
        let share = |&place: &usize| {
            let wins = |row: &Row| row.signs[place];
            let beaten = |row: &Row| !row.signs[place] && row.own.contains(&place);
            let rows = || self.rows.iter().zip(&self.theta);
            let won = exprs.sum(rows().filter(|(row, _)| wins(row)).map(|(_, &theta)| theta));
            let lost = exprs.sum(
                rows()
                    .filter(|(row, _)| beaten(row))
                    .map(|(_, &theta)| theta),
            );
            (self.alphas[place], won / (won + lost))
        };
        indicated.map(share).collect()
    }

    fn marginals(&self) -> impl Iterator<Item = (Var, Expr<'e>)> {
        let exprs = self.theta[0].exprs();
        self.alphas.iter().enumerate().map(move |(k, &alpha)| {
            let rows = self
                .rows
                .iter()
                .zip(&self.theta)
                .filter(|(row, _)| row.signs[k]);
            (alpha, exprs.sum(rows.map(|(_, &theta)| theta)))
        })
    }
}

fn subsystem_origin(system: &System, s: usize) -> Origin {
    let switches = || {
        system.coupling.subsystems[s]
            .switches
            .iter()
            .map(|&k| &system.switches[k])
    };
    let span = switches().flat_map(|switch| &switch.spans).next();
    Origin {
        cause: Cause::Subsystem(s),
        continuous: switches().all(|switch| switch.continuity.is_continuous()),
        span: span.copied().unwrap_or_else(Span::default),
    }
}

/// A row belongs to the user's region, to its switch where there is only one, else to the subsystem.
fn origin(system: &System, s: usize, row: &Row) -> Origin {
    let whole = subsystem_origin(system, s);
    let subsystem = &system.coupling.subsystems[s];
    match (row.region, subsystem.switches.as_slice()) {
        (Some((partition, region)), _) => Origin {
            cause: Cause::Region { partition, region },
            span: system.coupling.partitions[partition].regions[region].span,
            ..whole
        },
        (None, &[switch]) => Origin {
            cause: Cause::Switch(switch),
            ..whole
        },
        _ => whole,
    }
}
