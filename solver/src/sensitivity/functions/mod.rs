//! The functions of a mode with their derivatives by time, states, α and parameters.
//!
//! Derivatives are rows over *slots*: t, the states, all α, the parameters.

mod group;
mod linearized;

use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::run::Run;
use super::taylor::{in_lanes, times};
use crate::expansion::field::run_balls;
use crate::hybrid::form::Library;
use crate::hybrid::{HybridSystem, Input, Side};
use crate::linalg::{DenseLu, Singular};
use crate::tape::{Ball, Lane, Rounded, Tape};
pub(super) use group::{Group, Psi};
use linearized::Equations;
pub(super) use linearized::Linearized;
use rustc_hash::FxHashMap;

/// Where inputs stand among the slots.
#[derive(Clone, Copy)]
pub(super) struct Slots {
    pub n_states: usize,
    pub n_switches: usize,
}

impl Slots {
    pub fn state(self, i: usize) -> usize {
        1 + i
    }

    pub fn alpha(self, switch: usize) -> usize {
        1 + self.n_states + switch
    }

    pub fn parameter(self, i: usize) -> usize {
        1 + self.n_states + self.n_switches + i
    }

    /// The switch whose α a slot is.
    pub fn switch(self, slot: usize) -> Option<usize> {
        let switch = slot.checked_sub(self.alpha(0))?;
        (switch < self.n_switches).then_some(switch)
    }

    fn of(self, input: Input) -> Option<usize> {
        match input {
            Input::Time => Some(0),
            Input::State(i) => Some(self.state(i)),
            Input::Alpha(switch) => Some(self.alpha(switch)),
            Input::Parameter(i) => Some(self.parameter(i)),
            Input::Coefficient(_) | Input::Number(_) => None,
        }
    }
}

/// A point with all that functions read.
#[derive(Clone, Copy)]
pub(super) struct Point<'a> {
    pub t: f64,
    pub x: &'a [f64],
    pub alpha: &'a [f64],
    pub coefficients: &'a [f64],
    pub parameters: &'a [f64],
}

impl Point<'_> {
    pub fn value(&self, input: Input) -> f64 {
        match input {
            Input::Time => self.t,
            Input::State(i) => self.x[i],
            Input::Alpha(switch) => self.alpha[switch],
            Input::Coefficient(i) => self.coefficients[i],
            Input::Parameter(i) => self.parameters[i],
            Input::Number(number) => number,
        }
    }

    fn run<'r>(
        &self,
        tape: &'r Tape,
        inputs: &[Input],
        registers: &'r mut Vec<f64>,
    ) -> impl Iterator<Item = f64> + 'r {
        registers.resize(tape.n_registers().max(inputs.len()), 0.0);
        for (register, &input) in registers.iter_mut().zip(inputs) {
            *register = self.value(input);
        }
        tape.run(registers);
        tape.results(registers)
    }
}

/// The functions on certain sides.
pub(super) struct ModeFunctions {
    /// The switches that slide by an equation for α.
    pub sliding: Vec<usize>,
    /// The rates, with the states that they are of.
    pub blocks: Vec<(Vec<usize>, Arc<Group>)>,
    /// h of each that slides, of which dh/dt = φ.
    pub kept: Vec<Arc<Psi>>,
}

impl ModeFunctions {
    /// How many derivatives rates have.
    pub fn n_slopes(&self) -> usize {
        self.blocks
            .iter()
            .map(|(_, group)| group.entries.len())
            .sum()
    }
}

/// Key of what is compiled for the sides inside it.
type Key = (usize, Box<[Side]>);

/// -∂f/∂α of a switch by states, and of each its derivatives by t, states and directions.
pub(super) type Kick = (Vec<f64>, Vec<Vec<f64>>);

/// What a simulator has compiled of the derivatives of its functions, where passes have met them first.
#[derive(Clone)]
pub(crate) struct Derivatives {
    library: Library,
    blocks: FxHashMap<Key, Arc<Group>>,
    surfaces: FxHashMap<(Key, usize), Arc<Psi>>,
}

impl Derivatives {
    /// None of a system yet.
    pub fn new(system: Arc<HybridSystem>) -> Self {
        Derivatives {
            library: Library::new(system),
            blocks: FxHashMap::default(),
            surfaces: FxHashMap::default(),
        }
    }

    /// How many functions there are.
    pub fn len(&self) -> usize {
        self.blocks.len() + self.surfaces.len()
    }
}

/// All functions of a system with their derivatives.
pub(super) struct Functions<'r> {
    pub system: Arc<HybridSystem>,
    pub slots: Slots,
    /// Derivatives of the parameters, by direction.
    directions: &'r [Vec<f64>],
    /// Whether a parameter moves in any of them.
    moving: Vec<bool>,
    known: MutexGuard<'r, Derivatives>,
    modes: FxHashMap<Box<[Side]>, Rc<ModeFunctions>>,
    pub registers: Vec<f64>,
}

/// What is inside, whatever has become of those who held it.
pub(crate) fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<'r> Functions<'r> {
    pub fn new(run: &'r Run<'r>, directions: &'r [Vec<f64>]) -> Self {
        let system = run.system.clone();
        Functions {
            known: locked(run.derivatives),
            moving: (0..run.parameters.len())
                .map(|at| directions.iter().any(|by| by[at] != 0.0))
                .collect(),
            slots: Slots {
                n_states: system.n_states(),
                n_switches: system.n_switches(),
            },
            directions,
            system,
            modes: FxHashMap::default(),
            registers: Vec::new(),
        }
    }

    /// ψ of a switch where order is 0, or a derivative of it.
    pub fn psi(&mut self, switch: usize, order: usize, sides: &[Side]) -> Arc<Psi> {
        let known = &mut *self.known;
        let inside = &self.system.switches[switch].inside;
        let local: Box<[Side]> = inside.iter().map(|&i| sides[i]).collect();
        let key = ((switch, local), order);
        if let Some(psi) = known.surfaces.get(&key) {
            return psi.clone();
        }
        let local = &key.0.1;
        let surface = match order {
            0 => known.library.surface(switch, local),
            _ => known.library.derivative(switch, order, local),
        };
        let made = Arc::new(Psi::new(surface, self.slots));
        known.surfaces.insert(key, made.clone());
        made
    }

    /// How many derivatives of ψ contain no α.
    pub fn n_derivatives(&self, switch: usize) -> usize {
        self.system.switches[switch].derivatives.len()
    }

    pub fn mode(&mut self, sides: &[Side]) -> Rc<ModeFunctions> {
        if let Some(known) = self.modes.get(sides) {
            return known.clone();
        }
        let system = self.system.clone();
        let slides = |&i: &usize| sides[i] == Side::Slide && !system.switches[i].rests();
        let sliding: Vec<usize> = (0..sides.len()).filter(slides).collect();
        let blocks = (0..system.blocks.len()).map(|at| {
            let block = &system.blocks[at];
            let local: Box<[Side]> = block.switches.iter().map(|&i| sides[i]).collect();
            let (known, slots) = (&mut *self.known, self.slots);
            let group = known.blocks.entry((at, local)).or_insert_with_key(|key| {
                let rates = known.library.rates(at, &key.1);
                Arc::new(Group::new(rates.field, rates.inputs, slots))
            });
            (block.states.clone(), group.clone())
        });
        let blocks = blocks.collect();
        let kept = sliding.iter();
        let kept = kept.map(|&i| self.psi(i, self.n_derivatives(i), sides));
        let mode = Rc::new(ModeFunctions {
            kept: kept.collect(),
            blocks,
            sliding,
        });
        self.modes.insert(sides.into(), mode.clone());
        mode
    }

    /// The derivatives of parameters in a direction.
    pub fn direction(&self, direction: usize) -> &'r [f64] {
        &self.directions[direction]
    }

    /// Whether a parameter moves in any direction.
    pub fn moves(&self, parameter: usize) -> bool {
        self.moving[parameter]
    }

    /// How many directions there are.
    pub fn n_directions(&self) -> usize {
        self.directions.len()
    }

    /// -∂f/∂α of switches that slide, with its derivatives by t, states and directions, state by state.
    pub fn kicks(&mut self, sides: &[Side], point: &Point, switches: &[usize]) -> Vec<Kick> {
        let mode = self.mode(sides);
        let (n, first) = (self.slots.n_states, self.slots.parameter(0));
        let width = first + self.directions.len();
        let empty = || (vec![0.0; n], vec![vec![0.0; width]; n]);
        let mut kicks: Vec<_> = switches.iter().map(|_| empty()).collect();
        let alphas: Vec<usize> = switches.iter().map(|&i| self.slots.alpha(i)).collect();
        for (states, group) in &mode.blocks {
            if !group.entries.iter().any(|(_, slot)| alphas.contains(slot)) {
                continue;
            }
            let second = group.differentiated(self.slots);
            let slopes: Vec<_> = group.slopes(point, &mut self.registers).collect();
            let bends: Vec<_> = second.slopes(point, &mut self.registers).collect();
            for (kick, &alpha) in kicks.iter_mut().zip(&alphas) {
                for &(at, slot, slope) in &slopes {
                    if slot == alpha {
                        kick.0[states[at]] -= slope;
                    }
                }
                for &(entry, slot, bend) in &bends {
                    let (at, by) = group.entries[entry];
                    if by == alpha {
                        self.spread(slot, -bend, &mut kick.1[states[at]]);
                    }
                }
            }
        }
        for row in kicks.iter_mut().flat_map(|kick| &mut kick.1) {
            *row = [&row[..=n], &row[first..]].concat();
        }
        kicks
    }

    /// Of the slopes of ψ by states, state by state, the derivatives by t, states and directions.
    pub fn bends(&mut self, of: &Psi, point: &Point) -> Vec<Vec<f64>> {
        let (n, first) = (self.slots.n_states, self.slots.parameter(0));
        let mut rows = vec![vec![0.0; first + self.directions.len()]; n];
        for (a, b, bend) in of.bends(self.slots, point, &mut self.registers) {
            if (1..=n).contains(&a) {
                self.spread(b, bend, &mut rows[a - 1]);
            }
        }
        let kept = |row: Vec<f64>| [&row[..=n], &row[first..]].concat();
        rows.into_iter().map(kept).collect()
    }

    /// How a slot moves in a direction, and how large the terms of that are; α does not.
    fn by(&self, slot: usize, moved: Moved, direction: usize) -> [f64; 2] {
        let first = self.slots.parameter(0);
        match slot {
            0 => [moved.time; 2],
            slot if slot <= self.slots.n_states => [moved.x[slot - 1], moved.size[slot - 1]],
            slot if slot < first => [0.0; 2],
            slot => [self.directions[direction][slot - first]; 2],
        }
    }

    /// A slope times how its slot moves; what does not depend on a parameter does not mind that its slope has no bound.
    fn term(&self, slot: usize, slope: f64, moved: Moved, direction: usize) -> f64 {
        match self.by(slot, moved, direction)[0] {
            by if by == 0.0 && slot >= self.slots.alpha(0) => 0.0,
            by => slope * by,
        }
    }

    /// The same in lanes of states and parameters, at an instant that does not move.
    pub fn term_lanes<L: Lane>(&self, slot: usize, slope: f64, [x, by]: [&[L]; 2]) -> L {
        let first = self.slots.parameter(0);
        match slot {
            0 => L::splat(0.0 * slope),
            slot if slot <= self.slots.n_states => x[slot - 1] * L::splat(slope),
            slot if slot < first => L::splat(0.0),
            slot => times(slope, by[slot - first]),
        }
    }

    /// How parameters move in directions, in lanes.
    pub fn lanes<L: Lane>(&self, directions: impl Iterator<Item = usize>) -> Vec<L> {
        let rows: Vec<&[f64]> = directions.map(|d| self.direction(d)).collect();
        in_lanes(&rows)
    }

    /// The product of slopes with a tangent of states and time, in a direction.
    pub fn along(&self, slopes: &[(usize, f64)], moved: Moved, direction: usize) -> [f64; 2] {
        let mut sum = [0.0, 0.0];
        for &(slot, slope) in slopes {
            let [by, size] = self.by(slot, moved, direction);
            if by == 0.0 && slot >= self.slots.alpha(0) {
                continue;
            }
            sum[0] += slope * by;
            sum[1] += (slope * size).abs();
        }
        sum
    }

    /// f at a point of a mode.
    pub fn rates(&mut self, mode: &ModeFunctions, point: &Point) -> Vec<f64> {
        let mut f = vec![0.0; self.slots.n_states];
        for (states, group) in &mode.blocks {
            let values = group.values(point, &mut self.registers);
            for (&state, value) in states.iter().zip(values) {
                f[state] = value;
            }
        }
        f
    }

    /// Whether all derivatives of rates, and those of what slides, are tame where inputs are in balls.
    pub fn are_tame(&self, mode: &ModeFunctions, input: impl Fn(Input) -> Ball) -> bool {
        let mut registers = Vec::new();
        let rates = mode.blocks.iter().map(|(_, group)| &**group);
        let kept = mode.kept.iter().flat_map(|psi| psi.groups(self.slots));
        let mut all = rates.chain(kept);
        all.all(|group| group.is_tame(&input, &mut registers))
    }

    /// How far rounding may take f from what exact arithmetic gives.
    pub fn rounded(&self, mode: &ModeFunctions, point: &Point) -> Vec<f64> {
        let mut errors = vec![0.0; self.slots.n_states];
        let mut registers: Vec<Rounded> = Vec::new();
        for (states, group) in &mode.blocks {
            let input = |input: Input| Ball::splat(point.value(input));
            run_balls(&group.values, &group.inputs, input, &mut registers);
            for (&state, result) in states.iter().zip(group.values.results(&registers)) {
                errors[state] = result.ball().radius;
            }
        }
        errors
    }

    /// φ of what slides with its derivatives by slots, from those of f.
    fn phi(
        &mut self,
        of: &Psi,
        point: &Point,
        (f, entries): (&[f64], &[(usize, usize, f64)]),
    ) -> (f64, Vec<(usize, f64)>) {
        let n = self.slots.n_states;
        let (mut value, mut row) = (0.0, Vec::new());
        for (slot, slope) in of.slopes(point, &mut self.registers) {
            match slot {
                0 => value += slope,
                slot if slot <= n => {
                    value += slope * f[slot - 1];
                    let first = entries.partition_point(|entry| entry.0 < slot - 1);
                    let own = entries[first..].iter();
                    let own = own.take_while(|entry| entry.0 == slot - 1);
                    row.extend(own.map(|&(_, by, entry)| (by, slope * entry)));
                }
                _ => {}
            }
        }
        for (a, b, bend) in of.bends(self.slots, point, &mut self.registers) {
            match a {
                0 => row.push((b, bend)),
                a if a <= n => row.push((b, bend * f[a - 1])),
                _ => {}
            }
        }
        row.sort_unstable_by_key(|&(slot, _)| slot);
        row.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            kept.1 += if is_same { next.1 } else { 0.0 };
            is_same
        });
        (value, row)
    }

    /// Adds a derivative by a slot to a row over t, states, all α and the directions.
    fn spread(&self, slot: usize, slope: f64, row: &mut [f64]) {
        let first = self.slots.parameter(0);
        match slot.checked_sub(first) {
            None => row[slot] += slope,
            Some(parameter) => {
                for (entry, direction) in row[first..].iter_mut().zip(self.directions) {
                    *entry += slope * direction[parameter];
                }
            }
        }
    }

    /// f with its derivatives by slots, state by state.
    fn entries(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
    ) -> (Vec<f64>, Vec<(usize, usize, f64)>) {
        let f = self.rates(mode, point);
        let mut entries = Vec::with_capacity(mode.n_slopes());
        for (states, group) in &mode.blocks {
            let slopes = group.slopes(point, &mut self.registers);
            entries.extend(slopes.map(|(at, slot, slope)| (states[at], slot, slope)));
        }
        entries.sort_by_key(|entry| entry.0);
        (f, entries)
    }

    /// A and the rows of φ where α_K is given, factored; none where nothing slides.
    fn equations(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
        of_f: (&[f64], &[(usize, usize, f64)]),
    ) -> Result<Option<Equations>, Singular> {
        let k = mode.sliding.len();
        if k == 0 {
            return Ok(None);
        }
        let rows: Vec<_> = (mode.kept.iter())
            .map(|h| self.phi(h, point, of_f))
            .collect();
        let (values, rows): (Vec<f64>, Vec<Vec<(usize, f64)>>) = rows.into_iter().unzip();
        let mut matrix = vec![0.0; k * k];
        for (at, row) in rows.iter().enumerate() {
            for &(slot, slope) in row {
                let switch = self.slots.switch(slot);
                if let Some(Ok(column)) = switch.map(|i| mode.sliding.binary_search(&i)) {
                    matrix[at * k + column] += slope;
                }
            }
        }
        let mut lu = DenseLu::new(k);
        lu.factor(&matrix)?;
        Ok(Some(Equations { lu, values, rows }))
    }

    /// f and α with their derivatives at a point of a mode where α_K is known.
    pub fn linearize(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
    ) -> Result<Linearized, Singular> {
        let (f, entries) = self.entries(mode, point);
        Ok(Linearized {
            equations: self.equations(mode, point, (&f, &entries))?,
            sliding: mode.sliding.clone(),
            f,
            entries,
        })
    }

    /// The same where α_K is near what is given, and then what it is there.
    pub fn solved(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
        alpha: &mut [f64],
    ) -> Result<Linearized, Singular> {
        // Newton's method for φ_K = 0.
        const MOST: usize = 30;
        const SOLVED: f64 = 1e-11;
        for _ in 0..MOST {
            let linear = self.linearize(mode, &Point { alpha, ..*point })?;
            let Some(equations) = &linear.equations else {
                return Ok(linear);
            };
            let mut phi = equations.values.clone();
            equations.lu.solve(&mut phi);
            let mut change = 0.0_f64;
            for (&i, delta) in mode.sliding.iter().zip(&phi) {
                alpha[i] -= delta;
                change = change.max(delta.abs() / (1.0 + alpha[i].abs()));
            }
            if change <= SOLVED {
                return self.linearize(mode, &Point { alpha, ..*point });
            }
        }
        Err(Singular { column: 0 })
    }
}

/// How a state and an instant move with a parameter, and how large the terms are that this is made of.
#[derive(Clone, Copy)]
pub(crate) struct Moved<'a> {
    pub x: &'a [f64],
    pub size: &'a [f64],
    pub time: f64,
}

impl<'a> Moved<'a> {
    /// A state that moves at an instant that does not.
    pub fn still(x: &'a [f64]) -> Self {
        Moved {
            x,
            size: x,
            time: 0.0,
        }
    }
}
