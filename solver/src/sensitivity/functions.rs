//! The functions of a mode with their derivatives by time, states, α and parameters.
//!
//! Derivatives are rows over *slots*: t, the states, all α, the parameters.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::taylor::{ORDER, Series};
use crate::expansion::field::run_balls;
use crate::hybrid::form::{Library, Surface};
use crate::hybrid::{HybridSystem, Input, Side};
use crate::linalg::{DenseLu, Singular};
use crate::tape::{Ball, Jet, Lane, Rounded, Tame, Tape};

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

/// Functions with their first derivatives.
pub(super) struct Group {
    inputs: Vec<Input>,
    values: Arc<Tape>,
    slopes: Tape,
    /// (function, slot) of every slope.
    entries: Vec<(usize, usize)>,
    /// The slopes as series, once somebody has asked for them.
    jet: RefCell<Option<Jet>>,
}

impl Group {
    pub fn new(values: Arc<Tape>, inputs: Vec<Input>, slots: Slots) -> Self {
        let (entries, slopes) = values.partials(|input| slots.of(inputs[input]).is_some());
        let slot = |input: usize| slots.of(inputs[input]).unwrap_or(0);
        let entries = entries.into_iter();
        Group {
            entries: entries.map(|(function, i)| (function, slot(i))).collect(),
            inputs,
            values,
            slopes,
            jet: RefCell::new(None),
        }
    }

    /// Hands on (function, slot, derivative) as series, where inputs are series.
    pub fn series(
        &self,
        input: impl Fn(Input) -> Series,
        mut take: impl FnMut(usize, usize, &Series),
    ) {
        let mut jet = self.jet.borrow_mut();
        let jet = jet.get_or_insert_with(|| {
            let mut jet = Jet::new(&self.slopes, ORDER);
            let degrees = self.inputs.iter().enumerate();
            jet.bound_degrees(degrees.filter_map(|(place, input)| match input {
                Input::Time => Some((place, 1)),
                Input::State(_) | Input::Alpha(_) => None,
                Input::Coefficient(_) | Input::Parameter(_) | Input::Number(_) => Some((place, 0)),
            }));
            jet
        });
        for (place, &of) in self.inputs.iter().enumerate() {
            jet.set_input_row(place, &input(of));
        }
        jet.fill();
        for (at, &(function, slot)) in self.entries.iter().enumerate() {
            if let Ok(row) = jet.output_row(at).try_into() {
                take(function, slot, row);
            }
        }
    }

    /// The values at a point.
    pub fn values(&self, point: &Point, registers: &mut Vec<f64>) -> Vec<f64> {
        point.run(&self.values, &self.inputs, registers).collect()
    }

    /// (function, slot, derivative) at a point.
    pub fn slopes(&self, point: &Point, registers: &mut Vec<f64>) -> Vec<(usize, usize, f64)> {
        let slopes = point.run(&self.slopes, &self.inputs, registers);
        let entries = self.entries.iter().zip(slopes);
        entries
            .map(|(&(f, slot), slope)| (f, slot, slope))
            .collect()
    }

    /// Whether the middle of a part speaks for all of it, for every slope.
    fn is_tame(&self, input: &impl Fn(Input) -> Ball, registers: &mut Vec<Tame>) -> bool {
        run_balls(&self.slopes, &self.inputs, input, registers);
        self.slopes.results(registers).all(|slope| slope.is_tame)
    }

    /// The slopes as functions of their own.
    fn differentiated(&self, slots: Slots) -> Group {
        Group::new(Arc::new(self.slopes.clone()), self.inputs.clone(), slots)
    }
}

/// ψ, or a derivative of it, with two derivatives.
pub(super) enum Psi {
    /// Value at zero and slopes of what is affine.
    Affine(f64, Vec<(usize, f64)>),
    /// The function, and its slopes as functions.
    Smooth(Box<[Group; 2]>),
}

impl Psi {
    fn new(surface: Surface, slots: Slots) -> Self {
        match surface {
            Surface::Affine(affine) => {
                let terms = affine.terms.iter();
                let terms = terms.map(|&(j, c)| (slots.state(j), c));
                Psi::Affine(affine.constant, terms.chain([(0, affine.time)]).collect())
            }
            Surface::Parametric(smooth) | Surface::Smooth(smooth) => {
                let group = Group::new(smooth.psi, smooth.inputs, slots);
                let second = group.differentiated(slots);
                Psi::Smooth(Box::new([group, second]))
            }
        }
    }

    /// What is not affine.
    fn groups(&self) -> &[Group] {
        match self {
            Psi::Affine(..) => &[],
            Psi::Smooth(groups) => &**groups,
        }
    }

    pub fn value(&self, point: &Point, registers: &mut Vec<f64>) -> f64 {
        match self {
            Psi::Affine(constant, terms) => {
                let at = |slot: usize| {
                    if slot == 0 {
                        point.t
                    } else {
                        point.x[slot - 1]
                    }
                };
                terms.iter().map(|&(slot, c)| c * at(slot)).sum::<f64>() + constant
            }
            Psi::Smooth(groups) => groups[0].values(point, registers)[0],
        }
    }

    /// (slot, derivative).
    pub fn slopes(&self, point: &Point, registers: &mut Vec<f64>) -> Vec<(usize, f64)> {
        match self {
            Psi::Affine(_, terms) => terms.clone(),
            Psi::Smooth(groups) => {
                let slopes = groups[0].slopes(point, registers).into_iter();
                slopes.map(|(_, slot, slope)| (slot, slope)).collect()
            }
        }
    }

    /// Hands on (slot, derivative) as series, where inputs are series.
    pub fn series(&self, input: impl Fn(Input) -> Series, mut take: impl FnMut(usize, &Series)) {
        match self {
            Psi::Affine(_, terms) => {
                for &(slot, c) in terms {
                    let mut series = [0.0; ORDER + 1];
                    series[0] = c;
                    take(slot, &series);
                }
            }
            Psi::Smooth(groups) => groups[0].series(input, |_, slot, row| take(slot, row)),
        }
    }

    /// The same of ((slot, slot), second derivative).
    pub fn bent_series(
        &self,
        input: impl Fn(Input) -> Series,
        mut take: impl FnMut([usize; 2], &Series),
    ) {
        if let Psi::Smooth(groups) = self {
            let [group, second] = &**groups;
            second.series(input, |at, slot, row| {
                take([group.entries[at].1, slot], row)
            });
        }
    }

    /// (slot, slot, second derivative).
    fn bends(&self, point: &Point, registers: &mut Vec<f64>) -> Vec<(usize, usize, f64)> {
        match self {
            Psi::Affine(..) => Vec::new(),
            Psi::Smooth(groups) => {
                let [group, second] = &**groups;
                let bends = second.slopes(point, registers).into_iter();
                bends
                    .map(|(at, slot, bend)| (group.entries[at].1, slot, bend))
                    .collect()
            }
        }
    }
}

/// The functions on certain sides.
pub(super) struct ModeFunctions {
    /// The switches that slide by an equation for α.
    pub sliding: Vec<usize>,
    /// The rates, with the states that they are of.
    pub blocks: Vec<(Vec<usize>, Rc<Group>)>,
    /// h of each that slides, of which dh/dt = φ.
    pub kept: Vec<Rc<Psi>>,
}

/// f with its derivatives at a point of a mode, those of α_K in it.
pub(super) struct Linearized {
    pub f: Vec<f64>,
    /// (state, slot, ∂f/∂slot), state by state.
    entries: Vec<(usize, usize, f64)>,
    /// K, and its equations.
    pub sliding: Vec<usize>,
    equations: Option<Equations>,
}

impl Linearized {
    /// The derivatives of f and of α_K with a point that moves in a direction.
    pub fn along(&self, functions: &Functions, moved: Moved, direction: usize) -> [Vec<f64>; 2] {
        let term = |slot, slope| functions.term(slot, slope, moved, direction);
        let mut alpha = Vec::new();
        if let Some(equations) = &self.equations {
            alpha = equations.sums(|slot, slope| -term(slot, slope));
            equations.lu.solve(&mut alpha);
        }
        let f = self.rates(functions.slots, term, |at, slope| slope * alpha[at]);
        [f, alpha]
    }

    /// How large the terms of the derivatives of f are.
    pub fn terms(&self, functions: &Functions, moved: Moved, direction: usize) -> Vec<f64> {
        let size = |slot, slope: f64| (slope * functions.by(slot, moved, direction)[1]).abs();
        let mut alpha = Vec::new();
        if let Some(equations) = &self.equations {
            alpha = equations.sums(size);
            equations.lu.solve(&mut alpha);
        }
        self.rates(functions.slots, size, |at, slope| (slope * alpha[at]).abs())
    }

    /// Sums over the slopes of each rate, of those by slots and by the α of what slides.
    pub fn rates(
        &self,
        slots: Slots,
        term: impl Fn(usize, f64) -> f64,
        of_alpha: impl Fn(usize, f64) -> f64,
    ) -> Vec<f64> {
        let mut sums = vec![0.0; self.f.len()];
        for &(state, slot, slope) in &self.entries {
            sums[state] += match slots.switch(slot) {
                None => term(slot, slope),
                Some(switch) => {
                    let at = self.sliding.binary_search(&switch);
                    at.map_or(0.0, |at| of_alpha(at, slope))
                }
            };
        }
        sums
    }

    /// The derivatives of f and of φ_K with (x, α_K) in a direction.
    pub fn open(&self, functions: &Functions, y: &[f64], direction: usize, out: &mut [f64]) {
        let (tangent, alpha) = y.split_at(self.f.len());
        let term = |slot, slope| functions.term(slot, slope, Moved::still(tangent), direction);
        let (rates, residuals) = out.split_at_mut(tangent.len());
        rates.copy_from_slice(&self.rates(functions.slots, term, |at, slope| slope * alpha[at]));
        let Some(equations) = &self.equations else {
            return;
        };
        let of_alpha = |slot: usize| {
            let switch = functions.slots.switch(slot)?;
            Some(alpha[self.sliding.binary_search(&switch).ok()?])
        };
        let sums = equations.sums(|slot, slope| match of_alpha(slot) {
            Some(alpha) => slope * alpha,
            None => term(slot, slope),
        });
        residuals.copy_from_slice(&sums);
    }

    /// ∂(f, φ_K)/∂(x, α_K), row major.
    pub fn matrix(&self, slots: Slots, out: &mut [f64]) {
        let n = self.f.len();
        let width = n + self.sliding.len();
        out.fill(0.0);
        let column = |slot: usize| match slots.switch(slot) {
            Some(switch) => Some(n + self.sliding.binary_search(&switch).ok()?),
            None => slot.checked_sub(1).filter(|state| *state < n),
        };
        let rows = self.equations.iter().flat_map(|equations| &equations.rows);
        let rows = rows.enumerate();
        let phi = rows.flat_map(|(at, row)| row.iter().map(move |&(s, slope)| (n + at, s, slope)));
        for (row, slot, slope) in self.entries.iter().copied().chain(phi) {
            if let Some(column) = column(slot) {
                out[row * width + column] += slope;
            }
        }
    }

    /// The derivatives of α of a switch that slides, by slots.
    pub fn alpha(&self, switch: usize) -> Vec<(usize, f64)> {
        let (Some(equations), Ok(at)) = (&self.equations, self.sliding.binary_search(&switch))
        else {
            return Vec::new();
        };
        let mut weights = vec![0.0; self.sliding.len()];
        weights[at] = -1.0;
        equations.lu.solve_transposed(&mut weights);
        let rows = equations.rows.iter().zip(weights);
        rows.flat_map(|(row, weight)| row.iter().map(move |&(slot, slope)| (slot, weight * slope)))
            .collect()
    }
}

/// φ_K with its derivatives by slots, and A factored.
struct Equations {
    lu: DenseLu,
    values: Vec<f64>,
    rows: Vec<Vec<(usize, f64)>>,
}

impl Equations {
    /// Sums over the slopes of each φ.
    fn sums(&self, term: impl Fn(usize, f64) -> f64) -> Vec<f64> {
        let sum =
            |row: &Vec<(usize, f64)>| row.iter().map(|&(slot, slope)| term(slot, slope)).sum();
        self.rows.iter().map(sum).collect()
    }
}

/// Key of what is compiled for the sides inside it.
type Key = (usize, Box<[Side]>);

/// -∂f/∂α of a switch by states, and of each its derivatives by t, states and directions.
pub(super) type Kick = (Vec<f64>, Vec<Vec<f64>>);

/// All functions of a system with their derivatives, made where they are met first.
pub(super) struct Functions<'r> {
    pub system: Arc<HybridSystem>,
    pub slots: Slots,
    /// Derivatives of the parameters, by direction.
    directions: &'r [Vec<f64>],
    library: Library,
    blocks: FxHashMap<Key, Rc<Group>>,
    surfaces: FxHashMap<(Key, usize), Rc<Psi>>,
    modes: FxHashMap<Box<[Side]>, Rc<ModeFunctions>>,
    pub registers: Vec<f64>,
}

impl<'r> Functions<'r> {
    pub fn new(system: Arc<HybridSystem>, directions: &'r [Vec<f64>]) -> Self {
        Functions {
            slots: Slots {
                n_states: system.n_states(),
                n_switches: system.n_switches(),
            },
            directions,
            library: Library::new(system.clone()),
            system,
            blocks: FxHashMap::default(),
            surfaces: FxHashMap::default(),
            modes: FxHashMap::default(),
            registers: Vec::new(),
        }
    }

    /// ψ of a switch where order is 0, or a derivative of it.
    pub fn psi(&mut self, switch: usize, order: usize, sides: &[Side]) -> Rc<Psi> {
        let inside = &self.system.switches[switch].inside;
        let local: Box<[Side]> = inside.iter().map(|&i| sides[i]).collect();
        let key = ((switch, local), order);
        if let Some(known) = self.surfaces.get(&key) {
            return known.clone();
        }
        let local = &key.0.1;
        let surface = match order {
            0 => self.library.surface(switch, local),
            _ => self.library.derivative(switch, order, local),
        };
        let made = Rc::new(Psi::new(surface, self.slots));
        self.surfaces.insert(key, made.clone());
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
            let (library, slots) = (&mut self.library, self.slots);
            let group = self.blocks.entry((at, local)).or_insert_with_key(|key| {
                let rates = library.rates(at, &key.1);
                Rc::new(Group::new(rates.field, rates.inputs, slots))
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
            let slopes = group.slopes(point, &mut self.registers);
            let bends = second.slopes(point, &mut self.registers);
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
        for (a, b, bend) in of.bends(point, &mut self.registers) {
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
        let mut all = rates.chain(mode.kept.iter().flat_map(|psi| psi.groups()));
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
        for (a, b, bend) in of.bends(point, &mut self.registers) {
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
        let mut entries = Vec::new();
        for (states, group) in &mode.blocks {
            let slopes = group.slopes(point, &mut self.registers).into_iter();
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
        self.solve_alpha(mode, point, alpha)?;
        self.linearize(mode, &Point { alpha, ..*point })
    }

    /// Solves φ_K = 0 for α_K by Newton's method from those that are given.
    fn solve_alpha(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
        alpha: &mut [f64],
    ) -> Result<(), Singular> {
        const MOST: usize = 30;
        const SOLVED: f64 = 1e-11;
        for _ in 0..MOST {
            let here = Point { alpha, ..*point };
            let (f, entries) = self.entries(mode, &here);
            let Some(found) = self.equations(mode, &here, (&f, &entries))? else {
                return Ok(());
            };
            let (lu, mut phi) = (found.lu, found.values);
            lu.solve(&mut phi);
            let mut change = 0.0_f64;
            for (&i, delta) in mode.sliding.iter().zip(&phi) {
                alpha[i] -= delta;
                change = change.max(delta.abs() / (1.0 + alpha[i].abs()));
            }
            if change <= SOLVED {
                return Ok(());
            }
        }
        Err(Singular { column: 0 })
    }
}

/// How a state and an instant move with a parameter, and how large the terms are that this is made of.
#[derive(Clone, Copy)]
pub(super) struct Moved<'a> {
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
