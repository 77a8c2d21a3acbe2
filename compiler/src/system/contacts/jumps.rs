//! Laws by which states jump, and the contacts that some of them are.
//!
//! A law x⁺ = x + Δ(x) whose guard is c < 0, or c < 0 and ċ < 0, is a *contact* where it changes nothing that c
//! depends on and Δ = -ċ d: it bounces off the surface c = 0 with ċ⁺ = -e ċ, e = ∇ċ·d - 1 ≥ 0. Where its jumps
//! accumulate, c = ċ = 0, and the limit of small bounces is a force in the direction of d that keeps it there,
//!
//! x' = f(x) + d (1 - α),   α ≤ 1,   c ≥ 0,   α < 1 ⇒ c = 0,
//!
//! for a jump by Δ takes the place of the time -Δ/(d c̈). Any other law is a guard and a reset, no more.

use nsd_solver::hybrid::LEAST_SHARE;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{Jump, Periodic, When};
use crate::system::lower::instance::Instance;
use crate::system::lower::translation::Translation;
use crate::system::regions::conjunction::literals;
use crate::system::switches::Switches;
use crate::system::{Law, SystemError};

/// A law in entry variables of the switches that have been collected.
pub(crate) struct Lowered<'e> {
    /// Index into the jumps of the model.
    pub jump: usize,
    pub when: When<'e>,
    /// The switch of c, where the law is a contact.
    pub strikes: Option<usize>,
    /// New values by place of the state.
    pub resets: Vec<(usize, Expr<'e>)>,
}

impl<'e> Lowered<'e> {
    /// What it depends on; a contact looks at the surface that it strikes and at nothing else.
    pub fn reads(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let guard = self.when.guard().filter(|_| self.strikes.is_none());
        let resets = self.resets.iter().map(|reset| reset.1);
        resets.chain(guard)
    }

    /// The law in other variables.
    fn read(&self, f: impl Fn(Expr<'e>) -> Expr<'e>) -> Self {
        let resets = self.resets.iter().map(|&(place, value)| (place, f(value)));
        Lowered {
            resets: resets.collect(),
            when: self.when.map_guard(&f),
            ..*self
        }
    }
}

/// c and d of a law that is a contact.
struct Contact<'e> {
    switch: usize,
    gap: Expr<'e>,
    direction: Vec<(usize, Expr<'e>)>,
}

/// All laws that set a state that is kept.
pub(crate) fn laws<'e>(
    translation: &mut Translation<'_, 'e>,
    diags: &mut Diagnostics,
) -> Vec<Lowered<'e>> {
    let instance = translation.instance;
    let mut laws = Vec::new();
    for (j, jump) in instance.model.statements.jumps.iter().enumerate() {
        let resets = jump.resets.iter().filter_map(|reset| {
            let place = instance.place(reset.entry)?;
            Some((place, translation.replace_in_law(reset.value, reset.span)))
        });
        let resets: Vec<(usize, Expr<'e>)> = resets.collect();
        if resets.is_empty() && !jump.resets.is_empty() {
            continue;
        }
        let when = match jump.when {
            When::Guard(guard) => When::Guard(translation.replace_in_law(guard, jump.when_span)),
            When::Every(Periodic { period, offset }) => {
                // Only their numbers matter, whatever function of parameters they are.
                let [period, offset] = [period, offset].map(|e| e.substitute(&translation.given));
                let instants = Periodic { period, offset };
                check_instants(instance, jump, instants, diags);
                When::Every(instants)
            }
        };
        laws.push(Lowered {
            jump: j,
            when,
            strikes: None,
            resets,
        });
    }
    laws
}

/// Looks at the period and the offset of known instants.
fn check_instants<'e>(
    instance: &Instance<'_, 'e>,
    jump: &Jump<'e>,
    Periodic { period, offset }: Periodic<'e>,
    diags: &mut Diagnostics,
) {
    let horizon = instance.settings.horizon;
    let least = LEAST_SHARE * horizon;
    let is_param = |var: &Var| instance.params.numbers.contains_key(var);
    let number = |e: Expr<'e>| match variables_of(&[e]).iter().all(is_param) {
        true => instance.number(e),
        false => f64::NAN,
    };
    let [number, first] = [period, offset].map(number);
    let (what, found, expected) = if !(number > 0.0 && number.is_finite()) {
        ("period", number, "a positive number")
    } else if number < least {
        (
            "period",
            number,
            "long enough to be told from rounding of the horizon",
        )
    } else if !(first >= 0.0 && first.is_finite()) {
        ("offset", first, "a number that is not negative")
    } else {
        return;
    };
    diags.push(SystemError::Instants {
        what,
        found: match found.is_nan() {
            true => "no number".to_owned(),
            false => found.to_string(),
        },
        expected,
        span: jump.when_span,
    });
}

/// Finds the laws that are contacts, and lets these push; `used` is what else reads α.
pub(crate) fn find_contacts<'e>(
    translation: &mut Translation<'_, 'e>,
    laws: &mut [Lowered<'e>],
    rates: &mut [Expr<'e>],
    used: &[Expr<'e>],
    diags: &mut Diagnostics,
) {
    let (instance, switches) = (translation.instance, &mut translation.switches);
    let in_alphas = |law: &Lowered<'e>| law.read(|e| switches.entries.merged(e));
    let in_alphas: Vec<Lowered<'e>> = laws.iter().map(in_alphas).collect();
    for (at, law) in laws.iter_mut().enumerate() {
        let jump = &instance.model.statements.jumps[law.jump];
        let guards = in_alphas.iter().enumerate();
        let guards = guards.filter(|(other, _)| *other != at);
        let resets = in_alphas.iter().flat_map(|law| &law.resets);
        let elsewhere: Vec<Expr<'e>> = (used.iter().chain(&*rates).copied())
            .chain(guards.filter_map(|(_, law)| law.when.guard()))
            .chain(resets.map(|reset| reset.1))
            .collect();
        let flow = Flow {
            instance,
            switches,
            rates,
        };
        if flow.stays(&in_alphas[at], law) {
            diags.push(stays_in_guard(jump));
            continue;
        }
        let Some(contact) = flow.contact(&in_alphas[at], &elsewhere) else {
            continue;
        };
        let collected = &mut switches.list[contact.switch];
        collected.unilateral = true;
        collected.name = Some(jump.name.clone());
        let open = instance.model.exprs.expr(collected.alpha);
        switches.orient(contact.switch, contact.gap);
        for (place, d) in contact.direction {
            rates[place] = rates[place] + d * (1.0 - open);
        }
        law.strikes = Some(contact.switch);
    }
}

/// The motion between jumps.
struct Flow<'s, 'm, 'e> {
    instance: &'s Instance<'m, 'e>,
    switches: &'s Switches<'e>,
    rates: &'s [Expr<'e>],
}

impl<'e> Flow<'_, '_, 'e> {
    /// The variable of a state.
    fn state(&self, place: usize) -> Var {
        self.instance.state(place)
    }

    /// The contact that a law is.
    fn contact(&self, law: &Lowered<'e>, elsewhere: &[Expr<'e>]) -> Option<Contact<'e>> {
        let (switch, gap) = self.struck(law.when.guard()?)?;
        let alpha = self.switches.list[switch].alpha;
        let shared = |e: &Expr<'e>| variables_of(&[*e]).contains(&alpha);
        let relay = self.switches.list[switch].relay.is_some();
        if relay || elsewhere.iter().any(shared) {
            return None;
        }
        let speed = self.instance.rate_of(gap, self.rates);
        if !self.switches.entries.alphas_of(speed).is_empty()
            || !self.switches.entries.alphas_of(gap).is_empty()
        {
            return None;
        }
        let direction = self.direction(law, (gap, speed))?;
        // 1 + e
        let gain = direction
            .iter()
            .map(|&(place, d)| speed.diff(self.state(place)) * d);
        let gain = self.instance.model.exprs.sum(gain);
        if !self
            .instance
            .params
            .at_samples(gain, |gain| gain >= 1.0 - 1e-9)
        {
            return None;
        }
        Some(Contact {
            switch,
            gap,
            direction,
        })
    }

    /// c with its switch, where a guard is c < 0, or c < 0 and ċ < 0.
    fn struck(&self, guard: Expr<'e>) -> Option<(usize, Expr<'e>)> {
        let literals = literals(guard, self.switches)?;
        // The guard says that these are negative.
        let negative: Vec<(usize, Expr<'e>)> = (literals.iter())
            .map(|&(k, on)| {
                let psi = self.switches.list[k].psi;
                (k, if on { -1.0 * psi } else { psi })
            })
            .collect();
        let params = &self.instance.params;
        let is_multiple = |e: Expr<'e>, of: Expr<'e>| {
            let [(a, e), (b, of)] = [e, of].map(|e| params.in_numbers(e).split_scale());
            e == of && a * b > 0.0
        };
        match negative[..] {
            [only] => Some(only),
            [a, b] if is_multiple(b.1, self.instance.rate_of(a.1, self.rates)) => Some(a),
            [a, b] if is_multiple(a.1, self.instance.rate_of(b.1, self.rates)) => Some(b),
            _ => None,
        }
    }

    /// d = -∂Δ/∂ċ, along the gradient of ċ by what the law sets.
    fn direction(
        &self,
        law: &Lowered<'e>,
        (gap, speed): (Expr<'e>, Expr<'e>),
    ) -> Option<Vec<(usize, Expr<'e>)>> {
        let slopes: Vec<Expr<'e>> = law
            .resets
            .iter()
            .map(|&(place, _)| speed.diff(self.state(place)))
            .collect();
        let square = self.instance.model.exprs.sum(slopes.iter().map(|&s| s * s));
        if square.is_zero() {
            return None;
        }
        let mut direction = Vec::new();
        for &(place, value) in &law.resets {
            let state = self.state(place);
            if !gap.diff(state).is_zero() || !self.switches.entries.alphas_of(value).is_empty() {
                return None;
            }
            let change = value - value.exprs().expr(state);
            let along = law.resets.iter().zip(&slopes);
            let along = along.map(|(&(other, _), &slope)| change.diff(self.state(other)) * slope);
            let d = -1.0 * self.instance.model.exprs.sum(along) / square;
            if !self.instance.params.cancel(&[change, speed * d]) {
                return None;
            }
            direction.push((place, d));
        }
        Some(direction)
    }

    /// Whether every comparison of a guard and its rate are the same after the jump, up to positive factors; `written` has
    /// the law in entry variables.
    fn stays(&self, law: &Lowered<'e>, written: &Lowered<'e>) -> bool {
        let guard = law.when.guard();
        let Some(literals) = guard.and_then(|guard| literals(guard, self.switches)) else {
            return false;
        };
        // What holds everywhere but on a surface does not hold there.
        let compared = |guard| self.switches.entries.in_law(guard).as_constant();
        if guard.and_then(Expr::as_constant) != written.when.guard().and_then(compared) {
            return false;
        }
        let after = law.resets.iter();
        let after = after.map(|&(place, value)| (self.state(place), value));
        let after: Substitution<'e> = after.collect();
        let params = &self.instance.params;
        let is_kept = |e: Expr<'e>| {
            let both = [e, e.substitute(&after)];
            let [(a, before), (b, after)] = both.map(|e| params.in_numbers(e).split_scale());
            self.switches.entries.alphas_of(e).is_empty() && before == after && a * b > 0.0
        };
        literals.iter().all(|&(k, _)| {
            let switch = &self.switches.list[k];
            let rate = self.instance.rate_of(switch.psi, self.rates);
            switch.relay.is_none() && is_kept(switch.psi) && (rate.is_zero() || is_kept(rate))
        })
    }
}

fn stays_in_guard(jump: &Jump) -> SystemError {
    SystemError::StaysInGuard {
        name: jump.name.clone(),
        guard: jump.when_span,
        span: jump.resets.first().map_or(jump.span, |reset| reset.span),
    }
}

/// The laws, once only the switches `kept` are left.
pub(crate) fn finished_laws<'e>(
    instance: &Instance<'_, 'e>,
    switches: &Switches<'e>,
    laws: Vec<Lowered<'e>>,
    kept: &[usize],
) -> impl Iterator<Item = Law<'e>> {
    let exprs = instance.model.exprs;
    let finish = |law: Lowered<'e>| {
        let jump = &instance.model.statements.jumps[law.jump];
        let closed = |k: usize| 1.0 - exprs.expr(switches.list[k].alpha);
        let Lowered { when, resets, .. } = law.read(|e| switches.entries.in_law(e));
        Law {
            name: jump.name.clone(),
            when: law.strikes.map_or(when, |k| When::Guard(closed(k))),
            strikes: law.strikes.and_then(|k| kept.binary_search(&k).ok()),
            resets,
            stops: false,
            span: jump.span,
        }
    };
    laws.into_iter().map(finish)
}
