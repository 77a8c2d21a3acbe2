//! The functions of a complementarity system in one active set.

use super::full::{Functions, NO_DIRECTION};
use super::reduce::{Remainder, eliminate};
use crate::fesd::system::{ComplementaritySystem, Disc, Reduced, Watched, Zero};
use crate::hybrid::Side;
use crate::tape::{Sum, Sums, Tape};

/// Derivatives that are looked at for one that contains an unknown.
const MAX_DERIVATIVES: usize = 6;

/// A rate that changes with u by less than this share of friction does not.
const ROUNDING: f64 = 1e-12;

/// By how much parameters are moved at most, as a share of them, and multiples of what modulo 1 says by how much of it.
const NEARBY: f64 = 0.1;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Inputs behind those of the full functions that branches have.
const BRANCH: usize = 2;

/// Residuals as a finite element takes them.
pub(crate) struct Differentiated {
    pub at_nodes: Vec<Sum>,
    pub hidden: Vec<Sum>,
    /// Whether none was differentiated.
    pub is_direct: bool,
}

/// The functions while some members are zero, in the making.
pub(crate) struct Active<'s> {
    pub system: &'s ComplementaritySystem,
    pub sums: Sums,
    /// t, x, every z by what gives it, and the numbers.
    pub inputs: Vec<Sum>,
    /// The inputs z that nothing gives.
    pub unknowns: Vec<usize>,
    pub residuals: Vec<Sum>,
    /// f.
    pub rates: Vec<Sum>,
}

/// Where inputs of the full functions stand.
impl ComplementaritySystem {
    /// That of a z.
    pub(crate) fn input_of(&self, z: usize) -> usize {
        1 + self.n_states() + z
    }

    /// Those of all numbers.
    fn inputs_of_numbers(&self) -> std::ops::Range<usize> {
        let first = self.input_of(self.n_algebraics());
        first..first + self.n_numbers()
    }

    /// The first one behind all of them.
    pub(crate) fn behind(&self) -> usize {
        self.inputs_of_numbers().end
    }

    /// Time, states, some z and the numbers.
    fn inputs_with(&self, z: &[usize]) -> Vec<usize> {
        let before = 0..=self.n_states();
        let behind = self.inputs_of_numbers();
        before.chain(z.iter().copied()).chain(behind).collect()
    }

    /// The members that are zero, with their values by z; none where two contradict each other.
    pub(crate) fn fixed(&self, zeros: &[Zero]) -> Option<Vec<Option<f64>>> {
        let mut fixed: Vec<Option<f64>> = vec![None; self.n_algebraics()];
        for (pair, &zero) in self.pairs.iter().zip(zeros) {
            let (member, _) = pair.split(zero);
            let value = if member.complement { 1.0 } else { 0.0 };
            let known = &mut fixed[member.variable];
            if known.is_some_and(|other| other != value) {
                return None;
            }
            *known = Some(value);
        }
        Some(fixed)
    }

    /// The functions while these members are zero; none where that contradicts the equations, or
    /// leaves a z undetermined whatever x is.
    pub(crate) fn reduced(&self, zeros: &[Zero]) -> Option<Reduced> {
        let fixed = self.fixed(zeros)?;
        let idle = Active::idle(self, &fixed);
        let mut active = Active::of(self, &fixed, &idle, false)?;
        let Differentiated {
            at_nodes,
            hidden,
            is_direct,
        } = active.differentiate();
        let inputs = self.inputs_with(&active.unknowns);
        let functions = [&active.rates[..], &at_nodes].concat();
        let equations = active.sums.tape(&functions, &inputs);
        let hidden = active.sums.tape(&hidden, &inputs);
        let unknowns = active.unknowns.clone();
        // What nothing reads is shown otherwise than it is computed with.
        let mut shown = match idle.is_empty() {
            true => active,
            false => Active::of(self, &fixed, &idle, true)?,
        };
        let z = self.input_of(0)..self.input_of(self.n_algebraics());
        let algebraics = shown.inputs[z].to_vec();
        let (watched, members) = shown.members(zeros, &idle)?;
        let alphas = shown.sums.take(&self.full.alphas, &shown.inputs);
        let sides = self.sides(&alphas, zeros, &idle);
        let kept = self.kept_on(&sides);
        // Followers stay what they were at the start.
        let is_kept = |pair: usize| kept.iter().any(|&(i, _)| self.switches_of[pair] == [i]);
        let both = watched.into_iter().zip(members);
        let both = both.filter(|(watched, _)| !is_kept(watched.pair));
        let (watched, members): (Vec<Watched>, Vec<Sum>) = both.unzip();
        let sliding = sliding(&alphas, &sides);
        let members = shown.sums.tape(&members, &inputs);
        // Time and numbers may have any part.
        let n = 1 + self.n_states() + unknowns.len();
        let differentiated = |tape| Functions::new(tape, |input| input < n);
        let equations = differentiated(equations);
        let slopes = &equations.slopes;
        let is_constant = |(at, &(_, input)): (usize, &(usize, usize))| {
            input == 0 || slopes.tape.number(at).is_some()
        };
        Some(Reduced {
            is_linear: slopes.entries.iter().enumerate().all(is_constant),
            hidden: differentiated(hidden),
            algebraics: shown.sums.tape(&algebraics, &inputs),
            kept: self.kept(&kept),
            members: differentiated(members),
            watched,
            has_branches: (sides.iter().zip(&self.switches))
                .any(|(side, switch)| switch.is_nonlinear && *side == Side::Slide),
            alphas: shown.sums.tape(&sliding, &inputs),
            sides,
            is_direct,
            unknowns: unknowns.iter().map(|z| z - self.input_of(0)).collect(),
            equations,
        })
    }

    /// Where switches stand whose α are these.
    fn sides(&self, alphas: &[Sum], zeros: &[Zero], idle: &[Disc]) -> Box<[Side]> {
        let mut sides = sides(alphas);
        for (side, switch) in sides.iter_mut().zip(&self.switches) {
            if let Some((pair, zero)) = switch.member {
                *side = match zeros[pair] == zero {
                    true => Side::Slide,
                    false => Side::Minus,
                };
            }
        }
        for disc in &self.discs {
            for switch in disc.switches {
                sides[switch] = match zeros[disc.pair] {
                    Zero::Left if !idle.contains(disc) => Side::Slide,
                    _ => Side::Plus,
                };
            }
        }
        sides
    }

    /// The followers of what slides.
    fn kept_on(&self, sides: &[Side]) -> Vec<(usize, usize)> {
        let slides = |k: usize| sides[k] == Side::Slide;
        let followers = self.followers.iter().copied();
        followers
            .filter(|&(i, j)| slides(j) && !slides(i))
            .collect()
    }

    /// The followers and what they follow.
    fn kept(&self, kept: &[(usize, usize)]) -> Option<Functions> {
        let mut switches: Vec<usize> = kept.iter().flat_map(|&(i, j)| [i, j]).collect();
        switches.sort_unstable();
        switches.dedup();
        if switches.is_empty() {
            return None;
        }
        let n = self.n_states();
        let mut sums = Sums::new(self.surfaces.psi.n_inputs(), |_| false);
        let inputs: Vec<Sum> = (0..self.surfaces.psi.n_inputs())
            .map(|input| sums.input(input))
            .collect();
        let psi = sums.take(&self.surfaces.psi, &inputs);
        let psi: Vec<Sum> = switches.iter().map(|&k| psi[k].clone()).collect();
        let numbers = 1 + n + self.n_switches()..inputs.len();
        let values = sums.tape(&psi, &(0..=n).chain(numbers).collect::<Vec<_>>());
        Some(Functions::new(values, |input| (1..=n).contains(&input)))
    }
}

impl<'s> Active<'s> {
    /// The functions with these z fixed, and without the equations of discs that are idle: in these u is zero, which
    /// nothing reads, or as it is shown, w/|w|.
    pub fn of(
        system: &'s ComplementaritySystem,
        fixed: &[Option<f64>],
        idle: &[Disc],
        is_shown: bool,
    ) -> Option<Self> {
        let mut active = Self::start(system, fixed);
        let mut is_free: Vec<bool> = active.is_free(fixed);
        for disc in idle {
            active.rest(disc, is_shown);
            for z in disc.own() {
                is_free[system.input_of(z)] = false;
            }
        }
        active.eliminate(idle, &is_free)?;
        Some(active)
    }

    /// The discs whose u no rate reads while these z are fixed.
    fn idle(system: &'s ComplementaritySystem, fixed: &[Option<f64>]) -> Vec<Disc> {
        if system.discs.is_empty() {
            return Vec::new();
        }
        let mut active = Self::start(system, fixed);
        // What cancels does so for all parameters: with others near those of a run it shows as a number.
        let first = active.inputs.len() - system.parameters.len();
        let parameters = active.inputs[first..].iter_mut().zip(&system.parameters);
        for (i, (input, value)) in parameters.enumerate() {
            let share = (GOLDEN * (1 + i) as f64).fract();
            *input = Sum::number(value * (1.0 + NEARBY * share));
        }
        let mut is_free = active.is_free(fixed);
        for z in system.discs.iter().flat_map(Disc::own) {
            is_free[system.input_of(z)] = false;
        }
        if active.eliminate(&system.discs, &is_free).is_none() {
            return Vec::new();
        }
        let read = active.rates.iter().chain(&active.residuals);
        let read: Vec<&Sum> = read.collect();
        // Products of what cancels leave rounding.
        let is_read = |disc: &Disc, z: usize| {
            let factor = |sum: &&Sum| active.sums.factor(sum, system.input_of(z));
            let mut factors = read.iter().map(factor);
            // Where the others have no value, nobody knows.
            factors.any(|factor| {
                factor.is_none_or(|c| c.is_nan() || c.abs() > ROUNDING * disc.friction)
            })
        };
        let is_idle = |disc: &&Disc| !disc.alphas.iter().any(|&z| is_read(disc, z));
        system.discs.iter().filter(is_idle).copied().collect()
    }

    /// All inputs by themselves, but those that are fixed.
    fn start(system: &'s ComplementaritySystem, fixed: &[Option<f64>]) -> Self {
        let z = system.input_of(0)..system.input_of(fixed.len());
        let sums = Sums::new(system.behind() + BRANCH, |input| z.contains(&input));
        let mut inputs: Vec<Sum> = (0..system.behind()).map(|i| sums.input(i)).collect();
        for (input, fixed) in inputs[z].iter_mut().zip(fixed) {
            if let Some(value) = fixed {
                *input = Sum::number(*value);
            }
        }
        Active {
            system,
            sums,
            inputs,
            unknowns: Vec::new(),
            residuals: Vec::new(),
            rates: Vec::new(),
        }
    }

    fn is_free(&self, fixed: &[Option<f64>]) -> Vec<bool> {
        let mut is_free = vec![false; self.system.behind()];
        let z = is_free[self.system.input_of(0)..].iter_mut();
        z.zip(fixed)
            .for_each(|(is_free, fixed)| *is_free = fixed.is_none());
        is_free
    }

    /// Lets u of a disc be zero, or w/|w|.
    fn rest(&mut self, disc: &Disc, is_shown: bool) {
        let n = self.system.n_states();
        let at = |z: usize| self.system.input_of(z);
        let mut inputs = self.inputs.clone();
        inputs[at(disc.slip)] = Sum::number(0.0);
        let all = self.sums.take(&self.system.full.equations, &inputs);
        let w = disc.rows.map(|row| all[n + row].clone());
        let shown = self.sums.take(&direction(), &w);
        self.inputs[at(disc.slip)] = shown[0].clone();
        for (&alpha, shown) in disc.alphas.iter().zip(&shown[1..]) {
            self.inputs[at(alpha)] = match is_shown {
                true => shown.clone(),
                false => Sum::number(0.5),
            };
        }
        self.inputs[at(disc.stick)] = Sum::number(0.0);
    }

    /// Solves the equations, without those of some discs, for what is free.
    fn eliminate(&mut self, without: &[Disc], is_free: &[bool]) -> Option<()> {
        let n = self.system.n_states();
        let all = self.sums.take(&self.system.full.equations, &self.inputs);
        let is_own = |row: usize| without.iter().any(|disc| disc.all_rows().contains(&row));
        let rows = all[n..].iter().enumerate();
        let rows = rows.filter(|(row, _)| !is_own(*row));
        let rows = rows.map(|(_, sum)| sum.clone()).collect();
        let Remainder {
            unknowns,
            residuals,
            given,
        } = eliminate(&mut self.sums, rows, is_free)?;
        let all = self.with_numbers(all, &given);
        let by = |input: usize| given.get(input)?.as_ref();
        let rates = all[..n].iter();
        self.rates = rates.map(|rate| self.sums.replace(rate, &by)).collect();
        for (input, value) in given.iter().enumerate() {
            if let Some(value) = value {
                self.inputs[input] = value.clone();
            }
        }
        (self.unknowns, self.residuals) = (unknowns, residuals);
        Some(())
    }

    /// The equations once more where they give numbers, as products of α are in a region: a factor that is 0 or 1 is to be
    /// one before anything is multiplied with it, so that of a branch that is not taken nothing is left, however large it is.
    fn with_numbers(&mut self, all: Vec<Sum>, given: &[Option<Sum>]) -> Vec<Sum> {
        let number = |given: &Option<Sum>| given.as_ref().and_then(Sum::as_number);
        let (mut inputs, mut is_new) = (self.inputs.clone(), false);
        for (input, given) in inputs.iter_mut().zip(given) {
            if let Some(value) = number(given) {
                (*input, is_new) = (Sum::number(value), true);
            }
        }
        match is_new {
            true => self.sums.take(&self.system.full.equations, &inputs),
            false => all,
        }
    }

    /// The last derivatives of the residuals before an unknown appears in one, and those in which it does.
    pub fn differentiate(&mut self) -> Differentiated {
        let (mut at_nodes, mut hidden) = (Vec::new(), Vec::new());
        let mut is_direct = true;
        for mut residual in self.residuals.clone() {
            let mut next = residual.clone();
            for order in 0..MAX_DERIVATIVES {
                if !self.sums.reads(&next).is_empty() {
                    break;
                }
                is_direct &= order == 0;
                residual = next;
                next = self.along(&residual);
            }
            at_nodes.push(residual);
            hidden.push(next);
        }
        Differentiated {
            at_nodes,
            hidden,
            is_direct,
        }
    }

    /// ∂e/∂t + Σ ∂e/∂x_i f_i
    pub fn along(&mut self, e: &Sum) -> Sum {
        let slopes = self.slopes(e, 0..=self.system.n_states());
        slopes
            .into_iter()
            .fold(Sum::number(0.0), |sum, (input, slope)| {
                let term = match input {
                    0 => slope,
                    _ => self.sums.product(&slope, &self.rates[input - 1]),
                };
                sum.plus(1.0, &term)
            })
    }

    /// ∂e by some of the inputs, where it is not zero.
    pub fn slopes(&mut self, e: &Sum, by: std::ops::RangeInclusive<usize>) -> Vec<(usize, Sum)> {
        let all: Vec<usize> = (0..self.system.behind()).collect();
        let tape = self.sums.tape(std::slice::from_ref(e), &all);
        let (entries, tape) = tape.partials(|input| by.contains(&input));
        let inputs: Vec<Sum> = all.iter().map(|&input| self.sums.input(input)).collect();
        let slopes = self.sums.take(&tape, &inputs);
        let inputs = entries.into_iter().map(|(_, input)| input);
        inputs.zip(slopes).collect()
    }

    /// What must not be negative; none where a member is. Discs that are idle bound nothing.
    pub fn members(&self, zeros: &[Zero], idle: &[Disc]) -> Option<(Vec<Watched>, Vec<Sum>)> {
        let system = self.system;
        let (mut watched, mut members) = (Vec::new(), Vec::new());
        for (at, (pair, &zero)) in system.pairs.iter().zip(zeros).enumerate() {
            let (_, member) = pair.split(zero);
            let disc = system.discs.iter().find(|disc| disc.pair == at);
            if disc.is_some_and(|disc| idle.contains(disc)) {
                continue;
            }
            let z = &self.inputs[system.input_of(member.variable)];
            let value = match member.complement {
                true => Sum::number(1.0).plus(-1.0, z),
                false => z.clone(),
            };
            match value.as_number() {
                Some(constant) if constant < 0.0 => return None,
                Some(_) => {}
                None => {
                    watched.push(Watched {
                        pair: at,
                        stops: disc.is_some_and(|disc| disc.slip == member.variable),
                    });
                    members.push(value);
                }
            }
        }
        Some((watched, members))
    }
}

/// (w₁, w₂) to s = |w| and α = ½ + ½ w/s.
fn direction() -> Tape {
    let mut b = Tape::builder(2);
    let w = [b.input(0), b.input(1)];
    let squares = w.map(|w| b.mul(w, w));
    let sum = b.add(squares[0], squares[1]);
    let sum = b.offset(NO_DIRECTION, sum);
    let speed = b.sqrt(sum);
    let alphas = w.map(|w| {
        let u = b.div(w, speed);
        let half = b.scale(0.5, u);
        b.offset(0.5, half)
    });
    b.finish(&[speed, alphas[0], alphas[1]])
}

/// Sides of switches whose α are these; one that is no number slides.
pub(crate) fn sides(alphas: &[Sum]) -> Box<[Side]> {
    let side = |alpha: &Sum| match alpha.as_number() {
        Some(alpha) if alpha > 0.5 => Side::Plus,
        Some(_) => Side::Minus,
        None => Side::Slide,
    };
    alphas.iter().map(side).collect()
}

/// α of those that slide.
pub(crate) fn sliding(alphas: &[Sum], sides: &[Side]) -> Vec<Sum> {
    let all = alphas.iter().zip(sides);
    let slide = all.filter(|(_, side)| **side == Side::Slide);
    slide.map(|(alpha, _)| alpha.clone()).collect()
}
