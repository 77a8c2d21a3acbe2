//! Impulses of contacts where elements meet (FESD-J).
//!
//! Every element has a state x⁺ of its own at its left end, behind the end x⁻ of the one before, or the initial state:
//!
//! x⁺ - x⁻ = Σ_c r_c(x⁺) y_c,   0 <= Λ_c ⟂ gap_c >= 0,   0 <= Λ_c ⟂ gap_c/τ + J_nᵀ(v⁺ + e v⁻) >= 0
//!
//! with the impulses y = (Λ, α⁺) of [`crate::lowering::dcs::Impact`]. At gap = 0 the last pair is Newton's law of impacts, which
//! a contact cannot refuse: Λ = 0 needs J_nᵀ(v⁺ + e v⁻) >= 0. The published block, 0 <= Λ_n ⟂ gap + P + N >= 0 with
//! P - N = J_nᵀ(v⁺ + e v⁻), can always be met by Λ = 0, and leaves it to the next element to exclude that. At gap > 0
//! the price is that elements do not meet within τ (1 + e) before an impact; τ is a small share of their mean length.
//!
//! What is continuous along solutions but for jumps, as λᵖ and λⁿ of a slip velocity, starts anew in every element. Of
//! two slip velocities that is γ; α⁺ and β⁺ are in the equations of the disc there.
//!
//! Nurkanović, Frey, Pozharskiy & Diehl 2024.

use super::Grid;
use super::formals::block::{Builder, variable};
use super::formals::{Formals, sources};
use super::layout::ends::jumping_with_states;
use crate::expr::{Expr, Substitution};
use crate::lowering::dcs::{Dcs, Friction, Impact, SlipLaw};
use crate::lowering::mpcc::{Kind, Mpcc, Source};

/// τ as a share of the mean length of elements.
pub const WINDOW: f64 = 1e-3;

/// Jumps, what jumps with states, and the laws of impulses.
pub(crate) fn state<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    if formals.layout.boundaries.is_none() {
        return;
    }
    let h = mpcc.exprs.variable("h");
    let left = LeftEnds {
        formals,
        h,
        before: mpcc.exprs.variables("before", formals.states.len()),
    };
    left.jumps(mpcc);
    left.equations(mpcc);
    left.directions(mpcc);
    left.contacts(mpcc);
    left.slips(mpcc);
}

/// Where the pair of a contact comes from.
pub(crate) fn origin(dcs: &Dcs, impact: &Impact) -> Source {
    let gap = dcs.algebraics[impact.gap].var;
    let mut pairs = dcs.rows.pairs.iter();
    let place = pairs.position(|pair| pair.left == gap || pair.right == gap);
    Source::Dcs(dcs.rows.origins.pairs[place.expect("a contact has a pair")])
}

/// Where elements begin, with formal arguments for h and x⁻; x is x⁺.
struct LeftEnds<'s, 'e> {
    formals: &'s Formals<'s, 'e>,
    h: Expr<'e>,
    before: Vec<Expr<'e>>,
}

impl<'s, 'e> LeftEnds<'s, 'e> {
    /// Adds a block of rows, if there are any.
    fn push(
        &self,
        mpcc: &mut Mpcc<'e>,
        (name, kind): (&'static str, Kind),
        rows: &[Expr<'e>],
        origins: Vec<Source>,
        text: &str,
    ) {
        if rows.is_empty() {
            return;
        }
        let Formals { dcs, layout, .. } = *self.formals;
        let block = Builder::new(name, [layout.each_step(), layout.each_element()])
            .vector(&self.before, |[k, j]| layout.before(k, j))
            .vector(&dcs.boundary(), |[k, j]| layout.impulses(k, j).unwrap_or(0));
        let block = self.formals.at(block, self.h, |[k, j]| [k, j, 0]);
        let rows = self.formals.timed(rows, self.h);
        block.state(mpcc, kind, rows, origins, text);
    }

    /// x⁺ - x⁻ = r y
    fn jumps(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, exprs) = (self.formals.dcs, mpcc.exprs);
        let jumps = dcs.jumps();
        let row = |(i, (&after, &before)): (usize, (&Expr<'e>, &Expr<'e>))| {
            let jump = jumps.iter().find(|(state, _)| *state == i);
            let by = jump.map_or(exprs.constant(0.0), |&(_, by)| by);
            after - before - by
        };
        let sides = self.formals.states.iter().zip(&self.before).enumerate();
        let rows: Vec<Expr> = sides.map(row).collect();
        let text = "0 = x[k,j,0] - before(x)[k,j] - r(x[k,j,0], y[k,j])";
        let origins = sources(dcs.rows.origins.rates.iter().copied());
        self.push(mpcc, ("jump", Kind::Equation), &rows, origins, text);
    }

    /// The equations of what jumps with states.
    fn equations(&self, mpcc: &mut Mpcc<'e>) {
        let dcs = self.formals.dcs;
        let (_, equations) = jumping_with_states(dcs);
        let rows: Vec<Expr> = equations
            .iter()
            .map(|&row| dcs.rows.equations[row])
            .collect();
        let origins = sources(equations.iter().map(|&row| dcs.rows.origins.equations[row]));
        let g = self.formals.arguments("t[k,j]", "x[k,j,0]", "z[k,j,0]");
        let text = format!("0 = g{g}, where states jump");
        self.push(mpcc, ("left", Kind::Equation), &rows, origins, &text);
    }

    /// Friction, with where it comes from.
    fn frictions(&self) -> impl Iterator<Item = (&'s Friction<'e>, Source)> {
        let dcs = self.formals.dcs;
        let friction =
            |impact: &'s Impact<'e>| Some((impact.friction.as_ref()?, origin(dcs, impact)));
        dcs.impacts.iter().filter_map(friction)
    }

    /// Friction in discs with γ⁺ and β⁺, and where it comes from.
    fn discs(&self) -> impl Iterator<Item = (&'s Friction<'e>, [Expr<'e>; 2], Source)> {
        let dcs = self.formals.dcs;
        self.frictions()
            .filter_map(|(friction, origin)| match friction.law {
                SlipLaw::Interval(_) => None,
                SlipLaw::Disc { disc, stick } => {
                    Some((friction, [dcs.algebraics[disc.slip].var, stick], origin))
                }
            })
    }

    /// 0 = w⁺ - γ⁺ u⁺,  0 = 1 - |u⁺|² - β⁺
    fn directions(&self, mpcc: &mut Mpcc<'e>) {
        let rows = self.discs().flat_map(|(friction, [slip, stick], origin)| {
            let tangents = friction.tangents.iter();
            let tangents = tangents.map(move |t| t.velocity - slip * (2.0 * t.side - 1.0));
            let rows = tangents.chain([friction.edge() - stick]);
            rows.map(move |row| (row, origin))
        });
        let (rows, origins): (Vec<Expr>, Vec<Source>) = rows.unzip();
        let text = "0 = after(w) - slip[k,j,0]*u[k,j], 0 = 1 - |u[k,j]|^2 - side_stick[k,j]";
        self.push(mpcc, ("disc", Kind::Equation), &rows, origins, text);
    }

    /// 0 <= Λ ⟂ gap >= 0, and Newton's law.
    fn contacts(&self, mpcc: &mut Mpcc<'e>) {
        let Formals { dcs, layout, .. } = *self.formals;
        let gap = |impact: &Impact<'e>| dcs.algebraics[impact.gap].var;
        let impulses = dcs.impacts.iter().map(|impact| impact.impulse);
        let origins: Vec<Source> = dcs.impacts.iter().map(|i| origin(dcs, i)).collect();
        let gaps = dcs.impacts.iter().map(gap);
        let rows: Vec<Expr> = impulses.clone().chain(gaps).collect();
        let text = "0 <= impulse[k,j] perp gap[k,j,0] >= 0";
        self.push(mpcc, ("impulse", Kind::Pair), &rows, origins.clone(), text);

        let sides = self.formals.states.iter().zip(&self.before);
        let sides: Substitution = sides.map(|(&x, &before)| (variable(x), before)).collect();
        let Grid { horizon, steps, .. } = self.formals.grid;
        let n_elements = (steps * layout.elements) as f64;
        let known = WINDOW * horizon / n_elements;
        let window = match dcs.task.as_ref().and_then(|task| task.length) {
            Some(length) => WINDOW / n_elements * length,
            None => dcs.exprs.constant(known),
        };
        let laws = dcs.impacts.iter().map(|impact| {
            let before = impact.speed.substitute(&sides);
            gap(impact) / window + impact.speed + impact.restitution * before
        });
        let rows: Vec<Expr> = impulses.chain(laws).collect();
        let text = format!(
            "0 <= impulse[k,j] perp gap[k,j,0]/{known} + after(speed) + e*before(speed) >= 0"
        );
        self.push(mpcc, ("restitution", Kind::Pair), &rows, origins, &text);
    }

    /// 0 <= λⁿ ⟂ α⁺ >= 0, 0 <= λᵖ ⟂ 1 - α⁺ >= 0; of discs 0 <= γ⁺ ⟂ β⁺ >= 0.
    fn slips(&self, mpcc: &mut Mpcc<'e>) {
        let dcs = self.formals.dcs;
        let intervals = self
            .frictions()
            .filter_map(|(friction, origin)| match friction.law {
                SlipLaw::Interval(places) => Some((places, friction.tangents[0].side, origin)),
                SlipLaw::Disc { .. } => None,
            });
        let intervals: Vec<([usize; 2], Expr<'e>, Source)> = intervals.collect();
        let multiplier = |which: usize| {
            let places = intervals.iter().map(move |slip| slip.0[which]);
            places.map(|place| dcs.algebraics[place].var)
        };
        let sides = intervals.iter().map(|slip| slip.1);
        let others = sides.clone().map(|side| 1.0 - side);
        let multipliers = multiplier(1).chain(multiplier(0));
        let rows: Vec<Expr> = multipliers.chain(sides).chain(others).collect();
        let origins: Vec<Source> = intervals.iter().map(|slip| slip.2).collect();
        let (name, origins) = (("impulse_friction", Kind::Pair), origins.repeat(2));
        let text = "0 <= lambda_n[k,j,0] perp side[k,j] >= 0, 0 <= lambda_p[k,j,0] perp 1 - side[k,j] >= 0";
        self.push(mpcc, name, &rows, origins, text);

        let member = |which: usize| self.discs().map(move |(_, pair, _)| pair[which]);
        let rows: Vec<Expr> = member(0).chain(member(1)).collect();
        let origins = self.discs().map(|(_, _, origin)| origin).collect();
        let text = "0 <= slip[k,j,0] perp side_stick[k,j] >= 0";
        self.push(mpcc, ("impulse_disc", Kind::Pair), &rows, origins, text);
    }
}
