//! A [`System`] as the simulator sees it: blocks of rates and surfaces, for local sides.
//!
//! Functions are compiled once, with numbers for parameters and α as inputs. α of a switch that does not slide is 0 or 1:
//! tapes are specialized to that, so that a function holds what its sides need and nothing else, and differentiated as
//! tapes. What was made is kept: it serves every simulator of the system, and all blocks and surfaces of one form.

use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;

use nsd_solver::simulate::{
    Block, Input, Law, Partials, Rates, Role, Side, Smooth, Surface, SwitchedSystem,
};
use rustc_hash::{FxHashMap, FxHashSet};

use super::blocks;
use super::data::Pieces;
use super::forms::{self, Copy};
use super::functions::{Argument, FormRates, FormSurface, Generic, Known, kept};
use super::instants::Pulses;
use super::laws;
use super::structure::{self, Structure};
use super::substituted::{numbers, variable, with_directions, with_numbers, with_roots};
use crate::expr::{Expr, Var};
use crate::system::{self, System};
use crate::table::Table;

/// x' = f(t, x, α) with the parameters of one experiment.
pub struct Switched {
    /// What every variable stands for.
    inputs: FxHashMap<Var, Input>,
    continuous: Vec<bool>,
    unilateral: Vec<bool>,
    slip_of: Vec<Option<usize>>,
    across: Vec<Option<usize>>,
    /// Switches on whose upper side slip velocities with two entries are in no rate.
    idle_above: Vec<Vec<usize>>,
    /// Whether rates contain roots of ψ.
    roots: Vec<bool>,
    roles: Vec<Role>,
    nonlinear: Vec<bool>,
    algebraics: Vec<usize>,
    laws: Vec<Law>,
    blocks: Vec<Block>,
    /// Switches whose α is in ψ_i.
    inside: Vec<Vec<usize>>,
    /// Where relays start; none for other switches.
    relays: Vec<Option<Side>>,
    /// Switches whose ψ depends on time only.
    timed: Vec<bool>,
    /// Switches whose α the rate φ_i may contain, or that of its last derivative.
    couplings: Vec<Vec<usize>>,
    data: Pieces,
    /// Where functions of time are narrow.
    pulses: Pulses,
    with_data: [Vec<bool>; 2],
    /// Where the derivatives of ψ_i along the solution stand in `switching`, up to the one whose rate
    /// contains an α.
    derivatives: Vec<Range<usize>>,
    rates: Shared,
    /// All ψ, and behind them their derivatives.
    switching: Shared,
    known_rates: Known<FormRates>,
    known_surfaces: Known<FormSurface>,
    known_jacobians: Known<Arc<Partials>>,
}

/// Functions by their forms.
struct Shared {
    forms: Vec<Generic>,
    copies: Vec<Copy>,
}

impl Switched {
    /// Substitutes the parameters and the polynomials of data, and compiles what is left.
    pub fn new(system: &System) -> Self {
        let exprs = system.exprs;
        let [folded, switching] = with_numbers(system);
        let idle_above = structure::idle_above(system, &folded);
        let (folded, mut sticking) = with_directions(system, folded, &switching);
        let (folded, rooted) = with_roots(system, folded, &switching);
        let mut roots = vec![false; system.switches.len()];
        rooted.iter().for_each(|&(i, _)| roots[i] = true);
        sticking.extend(&rooted);
        let (data, coefficients, polynomials) = Pieces::new(system);
        let rates = polynomials.apply(&folded);
        let switching = polynomials.apply(&switching);
        let alphas = system.switches.iter().map(|switch| variable(switch.alpha));
        let alphas: Vec<Var> = alphas.collect();
        let mut inputs = FxHashMap::default();
        inputs.insert(variable(system.time), Input::Time);
        for (i, state) in system.states.iter().enumerate() {
            inputs.insert(variable(state.var), Input::State(i));
        }
        for (i, &alpha) in alphas.iter().enumerate() {
            inputs.insert(alpha, Input::Alpha(i));
        }
        inputs.extend(sticking.iter().map(|&(i, sigma)| (sigma, Input::Alpha(i))));
        for (i, &coefficient) in coefficients.iter().enumerate() {
            inputs.insert(coefficient, Input::Coefficient(i));
        }
        let Structure {
            in_rates,
            inside,
            timed,
            couplings,
            chains,
            with_data,
        } = Structure::of(system, &inputs, &rates, &switching, &rooted);
        let start = |switch: &system::Switch| match switch.relay?.start {
            true => Some(Side::Plus),
            false => Some(Side::Minus),
        };
        let continuous = system.switches.iter();
        let continuous: Vec<bool> = continuous
            .map(|switch| switch.continuity.is_continuous())
            .collect();
        // To have data in common is no reason to be in one block.
        let blocks = blocks::cut(&folded, &in_rates, &alphas);
        let resting = rooted.iter().filter(|(i, _)| continuous[*i]);
        let resting: FxHashSet<Var> = resting.map(|&(i, _)| alphas[i]).collect();
        let sticks: FxHashSet<Var> = sticking.iter().map(|&(_, sigma)| sigma).collect();
        let argument = |var: Var| match inputs[&var] {
            Input::Time => Argument::Time,
            Input::Coefficient(_) => Argument::Coefficient,
            Input::Alpha(_) if sticks.contains(&var) => Argument::Sticking,
            Input::Alpha(_) if resting.contains(&var) => Argument::Resting,
            Input::Alpha(_) => Argument::Alpha,
            _ => Argument::State,
        };
        // Only continuous switches stay inputs of ψ.
        let kind = |var: Var| match inputs[&var] {
            Input::Alpha(switch) => 8 * u64::from(continuous[switch]) + argument(var) as u64,
            _ => argument(var) as u64,
        };
        let share = |groups: &[Vec<Expr>]| {
            let (forms, copies) = forms::share(exprs, groups, kind);
            let forms = forms.iter().map(|form| Generic::new(form, argument));
            Shared {
                forms: forms.collect(),
                copies,
            }
        };
        let groups = blocks.iter().map(|block| {
            let states = block.states.iter();
            states.map(|&state| rates[state]).collect()
        });
        let groups: Vec<Vec<_>> = groups.collect();
        let mut surfaces: Vec<_> = switching.iter().map(|&psi| vec![psi]).collect();
        let mut derivatives = Vec::new();
        for chain in chains {
            let first = surfaces.len();
            surfaces.extend(chain.into_iter().map(|e| vec![e]));
            derivatives.push(first..surfaces.len());
        }
        Switched {
            relays: system.switches.iter().map(start).collect(),
            timed,
            data,
            pulses: Pulses::default(),
            with_data,
            rates: share(&groups),
            switching: share(&surfaces),
            derivatives,
            couplings,
            blocks,
            continuous,
            unilateral: (system.switches.iter())
                .map(|switch| switch.unilateral)
                .collect(),
            slip_of: system
                .switches
                .iter()
                .map(|switch| switch.slip_of)
                .collect(),
            across: (system.switches.iter())
                .map(|switch| switch.across)
                .collect(),
            idle_above,
            roots,
            roles: (system.switches.iter())
                .map(|switch| match switch.role {
                    system::Role::Step => Role::Step,
                    system::Role::Equation => Role::Equation,
                    system::Role::Member(other) => Role::Member(other),
                })
                .collect(),
            nonlinear: (system.switches.iter())
                .map(|switch| switch.is_nonlinear)
                .collect(),
            algebraics: system.algebraic_states(),
            laws: laws::compile(system, &inputs, &[&numbers(system), &polynomials]),
            inputs,
            inside,
            known_rates: RefCell::default(),
            known_surfaces: RefCell::default(),
            known_jacobians: RefCell::default(),
        }
    }

    /// Lets no step pass over where functions of time are narrow, in a run from 0 to the horizon.
    pub fn over(mut self, system: &System, horizon: f64) -> Self {
        self.pulses = Pulses::of(system, horizon);
        self
    }

    /// Gives the data from number `first` on other values, of the same fits, in the runs to come.
    pub(super) fn replace_data(&self, first: usize, tables: &[Arc<Table>]) {
        self.data.replace(first, tables);
    }

    /// The number of functions compiled so far, which blocks and surfaces of one form share.
    pub fn n_compiled(&self) -> usize {
        self.known_rates.borrow().len() + self.known_surfaces.borrow().len()
    }

    /// The key of what is compiled for a copy whose `switches` are on these sides: its form, and the
    /// sides in the order of the form.
    fn key(&self, copy: &Copy, switches: &[usize], sides: &[Side]) -> (usize, Box<[Side]>) {
        let side = |&var: &Var| match self.inputs[&var] {
            Input::Alpha(switch) => Some(sides[switches.binary_search(&switch).ok()?]),
            _ => None,
        };
        (copy.form, copy.vars.iter().filter_map(side).collect())
    }

    /// What inputs of a form stand for in a copy.
    fn resolve(&self, copy: &Copy, places: impl IntoIterator<Item = usize>) -> Vec<Input> {
        let resolve = |place: usize| match copy.vars.get(place) {
            Some(var) => self.inputs[var],
            None => Input::Number(copy.numbers[place - copy.vars.len()]),
        };
        places.into_iter().map(resolve).collect()
    }

    /// A ψ, or a derivative of one, with the switches in it on these sides.
    fn function(&self, at: usize, switches: &[usize], sides: &[Side]) -> Surface {
        let copy = &self.switching.copies[at];
        let key = self.key(copy, switches, sides);
        let form = &self.switching.forms[copy.form];
        let inputs = self.resolve(copy, 0..copy.vars.len() + copy.numbers.len());
        if let Some(affine) = form.affine(&key.1, &inputs) {
            return Surface::Affine(affine);
        }
        let mut known = self.known_surfaces.borrow_mut();
        let surface = kept(&mut known, key, |sides| form.surface(sides));
        Surface::Smooth(Smooth {
            inputs: self.resolve(copy, surface.inputs.iter().copied()),
            psi: surface.psi.clone(),
            gradient: surface.gradient.clone(),
            mixed: surface.mixed.clone(),
        })
    }
}

impl SwitchedSystem for Switched {
    fn n_states(&self) -> usize {
        self.blocks.iter().map(|block| block.states.len()).sum()
    }

    fn n_switches(&self) -> usize {
        self.continuous.len()
    }

    fn is_continuous(&self, switch: usize) -> bool {
        self.continuous[switch]
    }

    fn couplings(&self, switch: usize) -> &[usize] {
        &self.couplings[switch]
    }

    fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    fn n_derivatives(&self, switch: usize) -> usize {
        self.derivatives[switch].len()
    }

    fn is_unilateral(&self, switch: usize) -> bool {
        self.unilateral[switch]
    }

    fn slip_of(&self, switch: usize) -> Option<usize> {
        self.slip_of[switch]
    }

    fn across(&self, switch: usize) -> Option<usize> {
        self.across[switch]
    }

    fn idle_above(&self, switch: usize) -> &[usize] {
        &self.idle_above[switch]
    }

    fn role(&self, switch: usize) -> Role {
        self.roles[switch]
    }

    fn is_nonlinear(&self, switch: usize) -> bool {
        self.nonlinear[switch]
    }

    fn has_root(&self, switch: usize) -> bool {
        self.roots[switch]
    }

    fn algebraics(&self) -> &[usize] {
        &self.algebraics
    }

    fn laws(&self) -> &[Law] {
        &self.laws
    }

    fn is_timed(&self, switch: usize) -> bool {
        self.timed[switch]
    }

    fn relay(&self, switch: usize) -> Option<Side> {
        self.relays[switch]
    }

    fn inside(&self, switch: usize) -> &[usize] {
        &self.inside[switch]
    }

    fn n_coefficients(&self) -> usize {
        self.data.n_coefficients()
    }

    fn coefficients(&self, t: f64, coefficients: &mut [f64]) -> f64 {
        let breakpoint = self.data.write(t, coefficients);
        breakpoint.min(self.pulses.next(t))
    }

    fn is_piecewise(&self, switch: usize) -> bool {
        self.with_data[0][switch]
    }

    fn has_piecewise_rate(&self, switch: usize) -> bool {
        self.with_data[1][switch]
    }

    fn rates(&self, block: usize, sides: &[Side]) -> Rates {
        let copy = &self.rates.copies[block];
        let key = self.key(copy, &self.blocks[block].switches, sides);
        let mut known = self.known_rates.borrow_mut();
        let form = &self.rates.forms[copy.form];
        let rates = kept(&mut known, key, |sides| form.rates(sides));
        Rates {
            inputs: self.resolve(copy, rates.inputs.iter().copied()),
            field: rates.field.clone(),
            by_alpha: rates.by_alpha.clone(),
        }
    }

    fn surface(&self, switch: usize, sides: &[Side]) -> Surface {
        let inside = &self.inside[switch];
        // ψ is continuous where another switch slides, so either branch of it will do.
        let sides = inside.iter().zip(sides).map(|(&inner, side)| match side {
            Side::Slide if !self.continuous[inner] => Side::Plus,
            side => *side,
        });
        self.function(switch, inside, &sides.collect::<Vec<_>>())
    }

    fn derivative(&self, switch: usize, order: usize) -> Surface {
        self.function(self.derivatives[switch].start + order - 1, &[], &[])
    }

    fn jacobian(&self, block: usize, sides: &[Side]) -> Arc<Partials> {
        let copy = &self.rates.copies[block];
        let key = self.key(copy, &self.blocks[block].switches, sides);
        let form = &self.rates.forms[copy.form];
        let mut rates = self.known_rates.borrow_mut();
        let rates = kept(&mut rates, key.clone(), |sides| form.rates(sides));
        let mut known = self.known_jacobians.borrow_mut();
        kept(&mut known, key, |_| Arc::new(form.jacobian(rates))).clone()
    }
}
