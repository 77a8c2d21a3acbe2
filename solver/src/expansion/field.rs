//! The rates f of all blocks, each compiled for the local sides that a run meets.

use std::sync::Arc;

use rustc_hash::FxHashMap;
use wide::f64x4;

use super::layout::{Memory, Registers};
use crate::hybrid::form::Library;
use crate::hybrid::{Block, Few, HybridSystem, Input, Partials, Side};
use crate::tape::{Ball, Lane, Recurrences, Step, Tape, UNBOUNDED};

pub(crate) struct Field {
    blocks: Vec<Local>,
    /// The block of every state and its place there.
    place: Vec<(usize, usize)>,
    /// Blocks whose α is that of a switch.
    of_switch: Vec<Vec<usize>>,
    /// f at the point evaluated last.
    pub f: Vec<f64>,
    /// Where the series of every rate is.
    pub rows: Vec<usize>,
    lists: Lists,
    registers: Registers,
    /// f at the lanes evaluated last.
    pub wide: Vec<f64x4>,
    wide_registers: Vec<f64x4>,
    /// The local sides that are looked up.
    local_sides: Vec<Side>,
    /// Functions taken up so far.
    pub n_functions: usize,
}

/// The recurrences of all blocks, one after another.
#[derive(Default)]
pub(crate) struct Lists {
    /// Those of time alone, all others, and of these what depends on a sliding α.
    pub timed: Vec<Step>,
    pub steps: Vec<Step>,
    pub by_alpha: Vec<Step>,
    /// States whose rates contain a sliding α.
    pub sliding_states: Vec<usize>,
    /// Steps that may hide what they do within a step, each with its block.
    pub hiding: Vec<(usize, Step)>,
    /// Whether these are those of the present sides.
    are_present: bool,
}

/// A block with its functions by local sides.
struct Local {
    block: Block,
    known: Vec<Compiled>,
    index: FxHashMap<Box<[Side]>, usize>,
    now: usize,
}

/// The functions of a block on certain local sides.
struct Compiled {
    sides: Box<[Side]>,
    inputs: Vec<Input>,
    /// Places of the inputs among the values of a point.
    gather: Vec<usize>,
    field: Arc<Tape>,
    series: Recurrences,
    by_alpha: Arc<Partials>,
    /// The values of `by_alpha` where it was last evaluated.
    slopes: Vec<f64>,
    /// Degrees of inputs as polynomials in time, with those of the rates.
    degrees: Vec<[Vec<u32>; 2]>,
    /// ∂f/∂x with its values, once somebody has asked for it.
    jacobian: Option<(Arc<Partials>, Vec<f64>)>,
}

impl Compiled {
    fn slides(&self) -> bool {
        self.sides.contains(&Side::Slide)
    }

    /// The degrees of the rates as polynomials in time, where states have these.
    fn degrees(&mut self, states: &[u32]) -> &[u32] {
        let of_inputs = self.inputs.iter();
        let of_inputs = of_inputs.map(|&input| Memory::degree(input, states));
        let asked = |[asked, _]: &[Vec<u32>; 2]| of_inputs.clone().eq(asked.iter().copied());
        let known = self.degrees.iter().position(asked).unwrap_or_else(|| {
            let asked: Vec<u32> = of_inputs.collect();
            let rates = Recurrences::degrees(&self.field, &asked);
            self.degrees.push([asked, rates]);
            self.degrees.len() - 1
        });
        &self.degrees[known][1]
    }
}

impl Field {
    /// All blocks, without functions yet.
    pub(crate) fn new(system: &HybridSystem) -> Self {
        let n = system.n_states();
        let mut place = vec![(0, 0); n];
        let mut of_switch = vec![Vec::new(); system.n_switches()];
        for (b, block) in system.blocks.iter().enumerate() {
            for (at, &state) in block.states.iter().enumerate() {
                place[state] = (b, at);
            }
            for &switch in &block.switches {
                of_switch[switch].push(b);
            }
        }
        let local = |block: &Block| Local {
            block: block.clone(),
            known: Vec::new(),
            index: FxHashMap::default(),
            now: 0,
        };
        Field {
            blocks: system.blocks.iter().map(local).collect(),
            place,
            of_switch,
            f: vec![0.0; n],
            rows: vec![0; n],
            lists: Lists::default(),
            registers: Registers::default(),
            wide: vec![f64x4::splat(0.0); n],
            wide_registers: Vec::new(),
            local_sides: Vec::new(),
            n_functions: 0,
        }
    }

    /// Instructions of all rates.
    pub(crate) fn operations(&self) -> usize {
        let lengths = self.blocks.iter().map(|local| local.now().field.len());
        lengths.sum()
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// The blocks whose rates contain the α of a switch.
    pub(crate) fn of_switch(&self, switch: usize) -> &[usize] {
        &self.of_switch[switch]
    }

    /// The states of a block.
    pub(crate) fn states_of(&self, block: usize) -> &[usize] {
        &self.blocks[block].block.states
    }

    /// The block of a state.
    pub(crate) fn block_of(&self, state: usize) -> usize {
        self.place[state].0
    }

    /// Takes the function of a block on the present sides, compiling it at its first use.
    pub(crate) fn enter(
        &mut self,
        library: &mut Library,
        memory: &mut Memory,
        block: usize,
        sides: &[Side],
    ) {
        let local = &mut self.blocks[block];
        let switches = local.block.switches.iter();
        self.local_sides.clear();
        (self.local_sides).extend(switches.map(|&switch| sides[switch]));
        local.now = match local.index.get(&self.local_sides[..]) {
            Some(&known) => known,
            None => {
                let sides: Box<[Side]> = self.local_sides[..].into();
                let rates = library.rates(block, &sides);
                self.n_functions += 1;
                let inputs: Vec<_> = rates.inputs.iter().map(|&i| memory.row(i)).collect();
                let base = memory.rows.len();
                let series = Recurrences::new(&rates.field, &inputs, base, memory.stride);
                memory.grow((series.end - base) / memory.stride);
                let wanted = rates
                    .field
                    .n_registers()
                    .max(rates.by_alpha.tape.n_registers());
                self.registers.reserve(wanted);
                // A Jacobian may have taken more of the others.
                if self.wide_registers.len() < wanted {
                    self.wide_registers.resize(wanted, f64x4::splat(0.0));
                }
                local.known.push(Compiled {
                    sides: sides.clone(),
                    gather: rates.inputs.iter().map(|&i| memory.slot(i)).collect(),
                    inputs: rates.inputs,
                    field: rates.field,
                    series,
                    slopes: vec![0.0; rates.by_alpha.entries.len()],
                    by_alpha: rates.by_alpha,
                    degrees: Vec::new(),
                    jacobian: None,
                });
                local.index.insert(sides, local.known.len() - 1);
                local.known.len() - 1
            }
        };
        let outputs = &local.known[local.now].series.outputs;
        for (&state, &row) in local.block.states.iter().zip(outputs) {
            self.rows[state] = row;
        }
        self.lists.are_present = false;
    }

    /// Evaluates f where `values` say.
    pub(crate) fn eval(&mut self, values: &[f64]) {
        for block in 0..self.blocks.len() {
            self.eval_block(block, values);
        }
    }

    /// Evaluates f at all lanes of `values`.
    pub(crate) fn eval_lanes(&mut self, values: &[f64x4]) {
        for local in &self.blocks {
            let compiled = local.now();
            for (register, &slot) in self.wide_registers.iter_mut().zip(&compiled.gather) {
                *register = values[slot];
            }
            compiled.field.run(&mut self.wide_registers);
            let results = compiled.field.results(&self.wide_registers);
            for (&state, result) in local.block.states.iter().zip(results) {
                self.wide[state] = result;
            }
        }
    }

    /// Evaluates the rates that contain a sliding α.
    pub(crate) fn eval_sliding(&mut self, values: &[f64]) {
        for block in 0..self.blocks.len() {
            if self.blocks[block].now().slides() {
                self.eval_block(block, values);
            }
        }
    }

    /// Evaluates the rates of one block.
    pub(crate) fn eval_block(&mut self, block: usize, values: &[f64]) {
        let local = &self.blocks[block];
        let compiled = local.now();
        gather(&compiled.gather, values, &mut self.registers.numbers);
        compiled.field.run(&mut self.registers.numbers);
        let results = compiled.field.results(&self.registers.numbers);
        for (&state, result) in local.block.states.iter().zip(results) {
            self.f[state] = result;
        }
    }

    /// Evaluates ∂f/∂α where `values` say, for the rate of a state and all of its block.
    pub(crate) fn linearize(&mut self, state: usize, values: &[f64]) {
        self.linearize_block(self.place[state].0, values);
    }

    /// The same for all rates.
    pub(crate) fn linearize_sliding(&mut self, values: &[f64]) {
        for block in 0..self.blocks.len() {
            self.linearize_block(block, values);
        }
    }

    /// The same for all rates of a block.
    pub(crate) fn linearize_block(&mut self, block: usize, values: &[f64]) {
        let local = &mut self.blocks[block];
        let compiled = &mut local.known[local.now];
        if compiled.slopes.is_empty() {
            return;
        }
        let tape = &compiled.by_alpha.tape;
        gather(&compiled.gather, values, &mut self.registers.numbers);
        tape.run(&mut self.registers.numbers);
        for (slope, result) in compiled
            .slopes
            .iter_mut()
            .zip(tape.results(&self.registers.numbers))
        {
            *slope = result;
        }
    }

    /// ∂f_state/∂α of sliding switches where `linearize` was last called: (switch, value).
    pub(crate) fn slopes(&self, state: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (block, at) = self.place[state];
        let compiled = self.blocks[block].now();
        let entries = &compiled.by_alpha.entries;
        let first = entries.partition_point(|&(function, _)| function < at);
        let of_state = entries[first..].iter().zip(&compiled.slopes[first..]);
        of_state
            .take_while(move |((function, _), _)| *function == at)
            .filter_map(|(&(_, input), &value)| match compiled.inputs[input] {
                Input::Alpha(switch) => Some((switch, value)),
                _ => None,
            })
    }

    /// Enclosures of the rate of a state and of its derivative by α of a sliding switch, which is at `slot` of
    /// the values, while that is in a ball.
    pub(crate) fn enclose(
        &mut self,
        state: usize,
        switch: usize,
        values: &[f64],
        slot: usize,
        inside: Ball,
    ) -> [Ball; 2] {
        let (block, at) = self.place[state];
        let compiled = self.blocks[block].now();
        self.registers
            .balls
            .resize(self.registers.numbers.len(), Ball::new(0.0, 0.0));
        let mut run = |tape: &Tape, output: usize| {
            for (ball, &from) in self.registers.balls.iter_mut().zip(&compiled.gather) {
                *ball = match from == slot {
                    true => inside,
                    false => Ball::new(values[from], 0.0),
                };
            }
            tape.run(&mut self.registers.balls);
            let found = tape.results(&self.registers.balls).nth(output);
            found.expect("a tape has its outputs")
        };
        let partials = &compiled.by_alpha;
        let is_slope = |&(function, input): &(usize, usize)| {
            function == at && compiled.inputs[input] == Input::Alpha(switch)
        };
        let slope = match partials.entries.iter().position(is_slope) {
            Some(output) => run(&partials.tape, output),
            None => Ball::new(0.0, 0.0),
        };
        [run(&compiled.field, at), slope]
    }

    /// Calls `entry(state, input, value)` for every ∂f/∂x that is not structurally zero where
    /// `values` say; compiles what is missing.
    pub(crate) fn jacobian(
        &mut self,
        library: &mut Library,
        values: &[f64],
        mut entry: impl FnMut(usize, usize, f64),
    ) {
        for block in 0..self.blocks.len() {
            self.jacobian_of(library, block, values, &mut entry);
        }
    }

    /// The same for the rates of one block.
    pub(crate) fn jacobian_of(
        &mut self,
        library: &mut Library,
        block: usize,
        values: &[f64],
        mut entry: impl FnMut(usize, usize, f64),
    ) {
        let local = &mut self.blocks[block];
        let compiled = &mut local.known[local.now];
        let sides = &compiled.sides;
        let registers = &mut self.registers.numbers;
        let (partials, numbers) = compiled.jacobian.get_or_insert_with(|| {
            let partials = library.jacobian(block, sides);
            if registers.len() < partials.tape.n_registers() {
                registers.resize(partials.tape.n_registers(), 0.0);
            }
            let numbers = vec![0.0; partials.entries.len()];
            (partials, numbers)
        });
        gather(&compiled.gather, values, registers);
        partials.tape.run(registers);
        for (number, result) in numbers.iter_mut().zip(partials.tape.results(registers)) {
            *number = result;
        }
        for (&(function, input), &number) in partials.entries.iter().zip(&*numbers) {
            if let Input::State(state) = compiled.inputs[input] {
                entry(local.block.states[function], state, number);
            }
        }
    }

    /// Lists the recurrences of all blocks on the present sides.
    pub(crate) fn list(&mut self) -> &Lists {
        let lists = &mut self.lists;
        if lists.are_present {
            return lists;
        }
        lists.are_present = true;
        lists.timed.clear();
        lists.steps.clear();
        lists.by_alpha.clear();
        lists.sliding_states.clear();
        lists.hiding.clear();
        for (block, local) in self.blocks.iter().enumerate() {
            let compiled = local.now();
            let hiding = compiled.series.hiding.iter();
            lists.hiding.extend(hiding.map(|step| (block, *step)));
            lists.timed.extend_from_slice(&compiled.series.timed);
            lists.steps.extend_from_slice(&compiled.series.moving);
            if compiled.slides() {
                lists.by_alpha.extend_from_slice(&compiled.series.by_alpha);
                lists.sliding_states.extend_from_slice(&local.block.states);
            }
        }
        lists
    }

    /// The degrees of all states as polynomials in time, where each is one and nothing slides: where rates are polynomials
    /// of states that do not depend on each other in a circle.
    pub(crate) fn degrees(&mut self) -> Option<Few<u32>> {
        let mut degrees = Few::from_elem(UNBOUNDED, self.f.len());
        let mut open = degrees.len();
        while open > 0 {
            let before = open;
            for local in &mut self.blocks {
                let rates = local.known[local.now].degrees(&degrees);
                for (&state, rate) in local.block.states.iter().zip(rates) {
                    if degrees[state] == UNBOUNDED && *rate < UNBOUNDED {
                        degrees[state] = rate.saturating_add(1);
                        open -= 1;
                    }
                }
            }
            if open == before {
                return None;
            }
        }
        Some(degrees)
    }

    /// What was listed last.
    pub(crate) fn listed(&self) -> &Lists {
        &self.lists
    }

    /// Encloses the rates of a block where its inputs are in balls, by their places among the values: calls `see` with
    /// the state and the enclosure of each.
    pub(crate) fn examine<L: Lane + From<Ball>>(
        &self,
        block: usize,
        input: impl Fn(usize) -> Ball,
        registers: &mut Vec<L>,
        mut see: impl FnMut(usize, L),
    ) {
        let local = &self.blocks[block];
        let compiled = local.now();
        run_balls(&compiled.field, &compiled.gather, input, registers);
        let results = compiled.field.results(registers);
        for (&state, result) in local.block.states.iter().zip(results) {
            see(state, result);
        }
    }
}

impl Local {
    fn now(&self) -> &Compiled {
        &self.known[self.now]
    }
}

/// Runs a tape on enclosures of its inputs.
pub(crate) fn run_balls<P: Copy, L: Lane + From<Ball>>(
    tape: &Tape,
    from: &[P],
    input: impl Fn(P) -> Ball,
    registers: &mut Vec<L>,
) {
    let wanted = tape.n_registers().max(from.len());
    if registers.len() < wanted {
        registers.resize(wanted, L::splat(0.0));
    }
    for (register, &slot) in registers.iter_mut().zip(from) {
        *register = L::from(input(slot));
    }
    tape.run(registers);
}

/// Copies the inputs of a function to the first registers.
pub(crate) fn gather(from: &[usize], values: &[f64], registers: &mut [f64]) {
    for (register, &slot) in registers.iter_mut().zip(from) {
        *register = values[slot];
    }
}
