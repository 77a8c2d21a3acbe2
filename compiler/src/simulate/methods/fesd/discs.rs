//! Slip velocities with two entries that belong to no contact, as in frozen time: their directional form, and where they
//! mean nothing.

use nsd_solver::fesd::Disc;

use super::complementarity::Complementarity;
use super::reduce::eliminate;
use crate::expr::{Expr, Substitution, Var, variables_of};

/// Below this the square of a slip velocity has no direction.
const NO_DIRECTION: f64 = 1e-300;

/// Where no rate reads u, w' = 0 leaves it open: w' = ε u, with ε relative to the rate of friction, makes it zero.
const OPEN: f64 = 1e-11;

/// A rate that changes with u by less than this share of friction does not.
const ROUNDING: f64 = 1e-12;

impl<'e> Complementarity<'e> {
    /// The directional rows of a disc: with D = w' - s' u,
    ///
    /// - s > 0:  0 = w - s u + u (u·D),  so that u = w/|w| and s' = u·w'
    /// - s = 0:  0 = D, and with that s' and the direction in which w sets off, or u that lets it rest
    ///
    /// `jumps` are what stands for z that jumps.
    pub(super) fn direct(&self, disc: &Disc, jumps: &Substitution<'e>, rows: &mut [Expr<'e>]) {
        let exprs = self.exprs;
        let slip = self.exprs.expr(self.algebraics[disc.slip]);
        let at_rest = exprs.constant(NO_DIRECTION) / (NO_DIRECTION + slip.powi(2));
        let u = disc.alphas.map(|z| {
            let alpha = jumps.get(self.algebraics[z]).expect("α of a disc jumps");
            2.0 * alpha - 1.0
        });
        let open = OPEN * disc.friction;
        let rates = [0, 1].map(|k| rows[disc.rows[k]] - open * u[k]);
        let along = u[0] * rates[0] + u[1] * rates[1];
        for k in 0..2 {
            let row = self.equations[disc.rows[k]].substitute(jumps);
            let along = u[k] * along;
            let across = rates[k] - along;
            rows[disc.rows[k]] = exprs.sum([row, along, at_rest * across]);
        }
    }

    /// How fast friction moves w, while contacts act.
    pub(super) fn friction(&self, disc: &Disc) -> f64 {
        let zero = |var: Var| match self.algebraics.contains(&var) {
            true => 0.0,
            false => 1.0,
        };
        let speed = |(row, z): (usize, usize)| {
            let row = self.equations[row];
            let rate = self.along(row, &variables_of(&[row]), &self.rates);
            0.5 * rate.diff(self.algebraics[z]).eval(&zero).abs()
        };
        let speeds = disc.rows.into_iter().zip(disc.alphas).map(speed);
        let speed = speeds.filter(|speed| speed.is_finite()).fold(0.0, f64::max);
        if speed > 0.0 { speed } else { 1.0 }
    }

    /// The discs whose u no rate reads while these members are zero.
    pub(super) fn idle(&self, fixed: &Substitution<'e>) -> Vec<Disc> {
        if self.discs.is_empty() {
            return Vec::new();
        }
        let own: Vec<usize> = self.discs.iter().flat_map(|disc| self.rows(disc)).collect();
        let equations = self.equations.iter().enumerate();
        let equations = equations.filter(|(at, _)| !own.contains(at));
        let equations: Vec<Expr<'e>> = equations.map(|(_, &row)| row).collect();
        let inside: Vec<Var> = own_variables(self, &self.discs);
        let others = self.algebraics.iter().copied();
        let others: Vec<Var> = others.filter(|var| !inside.contains(var)).collect();
        let Some(remainder) = eliminate(&equations, &others, fixed) else {
            return Vec::new();
        };
        let mut read = remainder.given.apply(&self.rates);
        read.extend(remainder.residuals);
        // Products of what cancels leave rounding.
        let is_read = |disc: &Disc, alpha: Var| {
            let rounding = ROUNDING * disc.friction;
            read.iter().any(|row| {
                let slope = row.depends_on(alpha).then(|| row.diff(alpha));
                slope.is_some_and(|slope| {
                    slope
                        .as_constant()
                        .is_none_or(|slope| slope.abs() > rounding)
                })
            })
        };
        let is_idle = |disc: &&Disc| {
            let mut alphas = disc.alphas.iter();
            !alphas.any(|&z| is_read(disc, self.algebraics[z]))
        };
        self.discs.iter().filter(is_idle).copied().collect()
    }

    /// The equations without those of idle discs.
    pub(super) fn without(&self, idle: &[Disc]) -> Vec<Expr<'e>> {
        let left_out: Vec<usize> = idle.iter().flat_map(|disc| self.rows(disc)).collect();
        let equations = self.equations.iter().enumerate();
        let equations = equations.filter(|(at, _)| !left_out.contains(at));
        equations.map(|(_, &row)| row).collect()
    }

    /// What is fixed where discs are idle, with u = 0, which nothing reads, or as it is shown, with u = w/|w|.
    pub(super) fn at_rest(
        &self,
        idle: &[Disc],
        mut fixed: Substitution<'e>,
        is_shown: bool,
    ) -> Substitution<'e> {
        let zero = self.exprs.constant(0.0);
        for disc in idle {
            let slip = Substitution::one(self.algebraics[disc.slip], zero);
            let w = disc.rows.map(|row| self.equations[row].substitute(&slip));
            let speed = (w[0].powi(2) + w[1].powi(2) + NO_DIRECTION).sqrt();
            fixed.insert(self.algebraics[disc.slip], speed);
            for (&alpha, w) in disc.alphas.iter().zip(w) {
                let u = if is_shown { w / speed } else { zero };
                fixed.insert(self.algebraics[alpha], 0.5 + 0.5 * u);
            }
            fixed.insert(self.stick(disc), zero);
        }
        fixed
    }

    /// The variable r of a disc.
    fn stick(&self, disc: &Disc) -> Var {
        self.algebraics[self.pairs[disc.pair].right.variable]
    }

    /// All equations of a disc.
    fn rows(&self, disc: &Disc) -> [usize; 3] {
        let stick = self.stick(disc);
        let inside = self.equations.iter().position(|row| row.depends_on(stick));
        let inside = inside.expect("a disc states that u is in it");
        [disc.rows[0], disc.rows[1], inside]
    }
}

/// α, s and r of discs.
fn own_variables(system: &Complementarity, discs: &[Disc]) -> Vec<Var> {
    let of_disc = |disc: &Disc| {
        let [first, second] = disc.alphas;
        let places = [first, second, disc.slip].map(|z| system.algebraics[z]);
        places
            .into_iter()
            .chain([system.stick(disc)])
            .collect::<Vec<_>>()
    };
    discs.iter().flat_map(of_disc).collect()
}
