//! The functions of a mode with their derivatives by time, states, α and parameters.
//!
//! Derivatives are rows over *slots*: t, the states, all α, the parameters.

use std::rc::Rc;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::hybrid::form::{Library, Surface};
use crate::hybrid::{HybridSystem, Input, Side};
use crate::linalg::{DenseLu, Singular};
use crate::tape::Tape;

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
    fn value(&self, input: Input) -> f64 {
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
    blocks: Vec<(Vec<usize>, Rc<Group>)>,
    /// h of each that slides, of which dh/dt = φ.
    kept: Vec<Rc<Psi>>,
}

/// f with its derivatives at a point of a mode, those of α in it.
pub(super) struct Linearized {
    pub f: Vec<f64>,
    /// Rows of states, and behind them of all α: columns are t, the states and the directions.
    pub rows: Vec<Vec<f64>>,
    /// Of the rows of states, how large the terms of each entry are.
    sizes: Vec<Vec<f64>>,
}

impl Linearized {
    /// How large the terms of that product are for a state, those that cancel in its row with them.
    pub fn terms(&self, state: usize, tangent: &[f64], direction: usize) -> f64 {
        let row = &self.sizes[state];
        let products = row[1..].iter().zip(tangent).map(|(a, b)| a * b.abs());
        products.sum::<f64>() + row[1 + tangent.len() + direction]
    }

    /// The product of a row with a tangent of a direction, at a fixed time.
    pub fn along(&self, row: usize, tangent: &[f64], direction: usize) -> f64 {
        let row = &self.rows[row];
        let products = row[1..].iter().zip(tangent).map(|(a, b)| a * b);
        products.sum::<f64>() + row[1 + tangent.len() + direction]
    }
}

/// φ_K with its derivatives by t, states, all α and the directions, and A factored.
struct Equations {
    lu: DenseLu,
    values: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

/// Key of what is compiled for the sides inside it.
type Key = (usize, Box<[Side]>);

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

    /// How many directions there are.
    pub fn n_directions(&self) -> usize {
        self.directions.len()
    }

    /// -∂f/∂α of switches that slide, with its derivatives by t, states and directions, state by state.
    pub fn kicks(
        &mut self,
        sides: &[Side],
        point: &Point,
        switches: &[usize],
    ) -> Vec<(Vec<f64>, Vec<Vec<f64>>)> {
        let mode = self.mode(sides);
        let (n, first) = (self.slots.n_states, self.slots.parameter(0));
        let width = first + self.directions.len();
        let empty = || (vec![0.0; n], vec![vec![0.0; width]; n]);
        let mut kicks: Vec<_> = switches.iter().map(|_| empty()).collect();
        for (states, group) in &mode.blocks {
            let second = group.differentiated(self.slots);
            let slopes = group.slopes(point, &mut self.registers);
            let bends = second.slopes(point, &mut self.registers);
            for (kick, &switch) in kicks.iter_mut().zip(switches) {
                let alpha = self.slots.alpha(switch);
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

    /// The product of slopes with a tangent of states and time, in a direction.
    pub fn along(&self, slopes: &[(usize, f64)], moved: Moved, direction: usize) -> [f64; 2] {
        let first = self.slots.parameter(0);
        let parameters = &self.directions[direction];
        let mut sum = [0.0, 0.0];
        for &(slot, slope) in slopes {
            let [by, size] = match slot {
                0 => [moved.time; 2],
                slot if slot <= self.slots.n_states => [moved.x[slot - 1], moved.size[slot - 1]],
                slot if slot < first => [0.0; 2],
                slot => [parameters[slot - first]; 2],
            };
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

    /// φ of what slides, with its derivative by all columns of [`Functions::columns`].
    fn phi(&mut self, of: &Psi, point: &Point, f: &[f64], columns: &[Vec<f64>]) -> (f64, Vec<f64>) {
        let n = self.slots.n_states;
        let width = columns.first().map_or(0, Vec::len);
        let (mut value, mut row) = (0.0, vec![0.0; width]);
        for (slot, slope) in of.slopes(point, &mut self.registers) {
            match slot {
                0 => value += slope,
                slot if slot <= n => {
                    value += slope * f[slot - 1];
                    for (entry, column) in row.iter_mut().zip(&columns[slot - 1]) {
                        *entry += slope * column;
                    }
                }
                _ => {}
            }
        }
        for (a, b, bend) in of.bends(point, &mut self.registers) {
            let moves = match a {
                0 => 1.0,
                a if a <= n => f[a - 1],
                _ => continue,
            };
            self.spread(b, bend * moves, &mut row);
        }
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

    /// f with its derivatives by t, states, all α and the directions.
    fn columns(&mut self, mode: &ModeFunctions, point: &Point) -> (Vec<f64>, Vec<Vec<f64>>) {
        let width = self.slots.parameter(0) + self.directions.len();
        let f = self.rates(mode, point);
        let mut rows = vec![vec![0.0; width]; f.len()];
        for (states, group) in &mode.blocks {
            for (at, slot, slope) in group.slopes(point, &mut self.registers) {
                self.spread(slot, slope, &mut rows[states[at]]);
            }
        }
        (f, rows)
    }

    /// A and the rows of φ where α_K is given, factored.
    fn equations(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
        (f, columns): (&[f64], &[Vec<f64>]),
    ) -> Result<Equations, Singular> {
        let k = mode.sliding.len();
        let kept = mode.kept.iter();
        let rows: Vec<_> = kept.map(|h| self.phi(h, point, f, columns)).collect();
        let (values, rows): (Vec<f64>, Vec<Vec<f64>>) = rows.into_iter().unzip();
        let alpha = |i: &usize| self.slots.alpha(*i);
        let entries = rows
            .iter()
            .flat_map(|row| mode.sliding.iter().map(|i| row[alpha(i)]));
        let matrix: Vec<f64> = entries.collect();
        let mut lu = DenseLu::new(k);
        lu.factor(&matrix)?;
        Ok(Equations { lu, values, rows })
    }

    /// f and α with their derivatives by t, states and directions, at a point of a mode where α_K is known.
    pub fn linearize(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
    ) -> Result<Linearized, Singular> {
        let (f, mut columns) = self.columns(mode, point);
        let (n, m) = (self.slots.n_states, self.slots.n_switches);
        let first = self.slots.parameter(0);
        let width = 1 + n + self.directions.len();
        let kept = |row: &[f64]| [&row[..=n], &row[first..]].concat();
        let mut of_alpha = vec![vec![0.0; width]; m];
        if !mode.sliding.is_empty() {
            let Equations { lu, rows, .. } = self.equations(mode, point, (&f, &columns))?;
            let rows: Vec<Vec<f64>> = rows.iter().map(|row| kept(row)).collect();
            for column in 0..width {
                let mut rhs: Vec<f64> = rows.iter().map(|row| -row[column]).collect();
                lu.solve(&mut rhs);
                for (&i, value) in mode.sliding.iter().zip(rhs) {
                    of_alpha[i][column] = value;
                }
            }
        }
        let mut sizes = Vec::with_capacity(n);
        for row in &mut columns {
            let mut whole = kept(row);
            let mut size: Vec<f64> = whole.iter().map(|entry| entry.abs()).collect();
            for &i in &mode.sliding {
                let slope = row[self.slots.alpha(i)];
                if slope != 0.0 {
                    let entries = whole.iter_mut().zip(&mut size);
                    for ((entry, size), by) in entries.zip(&of_alpha[i]) {
                        *entry += slope * by;
                        *size += (slope * by).abs();
                    }
                }
            }
            sizes.push(size);
            *row = whole;
        }
        columns.extend(of_alpha);
        Ok(Linearized {
            f,
            rows: columns,
            sizes,
        })
    }

    /// Solves φ_K = 0 for α_K by Newton's method from those that are given.
    pub fn solve_alpha(
        &mut self,
        mode: &ModeFunctions,
        point: &Point,
        alpha: &mut Vec<f64>,
    ) -> Result<(), Singular> {
        const MOST: usize = 30;
        if mode.sliding.is_empty() {
            return Ok(());
        }
        for _ in 0..MOST {
            let here = Point { alpha, ..*point };
            let (f, columns) = self.columns(mode, &here);
            let found = self.equations(mode, &here, (&f, &columns))?;
            let (lu, mut phi) = (found.lu, found.values);
            lu.solve(&mut phi);
            let mut change = 0.0_f64;
            for (&i, delta) in mode.sliding.iter().zip(&phi) {
                alpha[i] -= delta;
                change = change.max(delta.abs() / (1.0 + alpha[i].abs()));
            }
            if change <= 1e-11 {
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
