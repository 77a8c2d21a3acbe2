//! Narrow functions of states that the steps of a run have passed over, whichever method made them.
//!
//! A step is divided, the widest part first, until every function is tame over each part (`tape/enclosures/tame.rs`). What a rate
//! differs by there from the polynomials of the step, times the part, adds up to what the method has not seen of it;
//! unless it differs as much at a few other points, as it does where a step is long beside smooth functions. A ψ has
//! been passed over where its side in the middle of a part is that of neither end.

use crate::event::Segment;
use crate::expansion::series;
use crate::hybrid::{Function, Note, Side};
use crate::tape::{Ball, Tame, Tape};

/// Parts of a step that are enclosed at most.
const MAX_PARTS: usize = 1000;

/// Parts narrower than this share of a step are not divided.
const NARROWEST: f64 = 1e-13;

/// Where a rate shows what it differs by from the polynomials of any step. One of these may be in what is narrow.
const SAMPLES: [f64; 5] = [0.07, 0.29, 0.51, 0.73, 0.95];

/// A part in which a rate differs by this many times what samples show has been passed over.
const UNLIKE: f64 = 10.0;

/// What is known of one of the functions in a step.
#[derive(Clone, Copy, Default)]
struct Look {
    /// The two largest differences of the samples, the larger one first.
    usual: [f64; 2],
    /// ∫ of larger differences.
    missed: f64,
    /// The sides of a ψ at the ends of the step; none where it is not finite.
    ends: [Option<Side>; 2],
    /// Whether it was on another side than at both of these.
    changes: bool,
}

/// Looks at the steps of a run.
pub struct Overlooked {
    functions: Vec<Function>,
    /// (t, x, α, data) to the functions.
    tape: Tape,
    n: usize,
    m: usize,
    tolerance: f64,
    inputs: Vec<f64>,
    scalars: Vec<f64>,
    balls: Vec<Tame>,
    looks: Vec<Look>,
    parts: Vec<(f64, f64)>,
    /// Largest magnitude of each state.
    scale: Vec<f64>,
    notes: Vec<Note>,
}

impl Overlooked {
    /// Looks at functions, which a tape has of t, n states, m α and data.
    pub fn new(functions: Vec<Function>, tape: Tape, [n, m]: [usize; 2], tolerance: f64) -> Self {
        Overlooked {
            inputs: vec![0.0; tape.n_inputs()],
            scalars: vec![0.0; tape.n_registers().max(tape.n_inputs())],
            balls: vec![Tame::from(Ball::new(0.0, 0.0)); tape.n_registers().max(tape.n_inputs())],
            looks: vec![Look::default(); functions.len()],
            parts: Vec::with_capacity(MAX_PARTS + 2),
            scale: vec![0.0; n],
            notes: Vec::new(),
            functions,
            tape,
            n,
            m,
            tolerance,
        }
    }

    /// What has been passed over.
    pub fn notes(self) -> Vec<Note> {
        self.notes
    }

    /// Looks at a step, with the values of data at an instant.
    pub fn look(&mut self, segment: &Segment, data: impl Fn(f64, &mut [f64])) {
        if self.notes.len() == self.functions.len() {
            return;
        }
        let h = segment.length;
        for (i, scale) in self.scale.iter_mut().enumerate() {
            let start = segment.state_series(i)[0].abs();
            *scale = scale.max(start).max(segment.end[i].abs());
        }
        self.parts.clear();
        self.parts.push((0.0, h));
        if self.are_known(segment, 0.5 * h, 0.5 * h, &data) {
            return;
        }
        self.sample(segment, &data);
        let mut at = 0;
        while let Some(&(from, to)) = self.parts.get(at) {
            let (middle, radius) = (0.5 * (from + to), 0.5 * (to - from));
            at += 1;
            let is_narrow = to - from <= NARROWEST * h;
            if is_narrow || self.are_known(segment, middle, radius, &data) {
                self.compare(segment, middle, to - from, &data);
            } else if self.parts.len() < MAX_PARTS {
                self.parts.extend([(from, middle), (middle, to)]);
            } else {
                self.tell_untamed(segment);
                break;
            }
        }
        for k in 0..self.functions.len() {
            let look = &self.looks[k];
            let has_passed = match self.functions[k] {
                Function::Rate(i) => look.missed > self.tolerance * self.scale[i],
                Function::Surface(_) => look.changes,
            };
            if has_passed {
                self.tell(segment, k);
            }
        }
    }

    /// Takes note of a function, once.
    fn tell(&mut self, segment: &Segment, k: usize) {
        let note = Note::Unseen {
            time: segment.start,
            function: self.functions[k],
        };
        if !self.notes.iter().any(|other| other.is_like(&note)) {
            self.notes.push(note);
        }
    }

    /// Takes note of the first function that was not tame over the last part that was enclosed.
    fn tell_untamed(&mut self, segment: &Segment) {
        let untamed = self
            .tape
            .results(&self.balls)
            .position(|ball| !ball.is_tame);
        if let Some(k) = untamed {
            self.tell(segment, k);
        }
    }

    /// Whether the middle of a part speaks for all of it: all functions are tame, move by less than the tolerance, or,
    /// as ψ, keep their side.
    fn are_known(
        &mut self,
        segment: &Segment,
        tau: f64,
        radius: f64,
        data: &impl Fn(f64, &mut [f64]),
    ) -> bool {
        self.set(segment, tau, data);
        let (n, inputs) = (self.n, &self.inputs);
        let slides = |switch: usize| segment.sides.get(switch) == Some(&Side::Slide);
        let moving =
            |row: &[f64]| Ball::new(series::value(row, tau), series::motion(row, tau, radius));
        for (slot, (ball, value)) in self.balls.iter_mut().zip(inputs).enumerate() {
            *ball = Tame::from(match slot {
                0 => Ball::new(*value, radius),
                _ if slot <= n => moving(segment.state_series(slot - 1)),
                _ if slides(slot - 1 - n) => moving(segment.polynomials().alpha(slot - 1 - n)),
                _ => Ball::new(*value, 0.0),
            });
        }
        self.tape.run(&mut self.balls);
        let mut all = self.tape.results(&self.balls).zip(&self.functions);
        all.all(|(value, function)| {
            value.is_tame
                || match function {
                    Function::Rate(i) => {
                        value.ball.radius * segment.length <= self.tolerance * self.scale[*i]
                    }
                    Function::Surface(_) => value.ball.excludes_zero(),
                }
        })
    }

    /// What the rates differ by from the polynomials anywhere in a step, and the sides of every ψ at its ends.
    fn sample(&mut self, segment: &Segment, data: &impl Fn(f64, &mut [f64])) {
        self.looks.fill(Look::default());
        for share in SAMPLES {
            let tau = share * segment.length;
            self.evaluate(segment, tau, data);
            for (k, value) in self.tape.results(&self.scalars).enumerate() {
                let difference = difference(segment, self.functions[k], tau, value);
                let [first, second] = self.looks[k].usual;
                self.looks[k].usual = match difference > first {
                    true => [difference, first],
                    false => [first, second.max(difference)],
                };
            }
        }
        for (end, tau) in [0.0, segment.length].into_iter().enumerate() {
            self.evaluate(segment, tau, data);
            let values = self.tape.results(&self.scalars);
            for (look, value) in self.looks.iter_mut().zip(values) {
                look.ends[end] = side(value);
            }
        }
    }

    /// Compares the functions with the step in the middle of a part.
    fn compare(
        &mut self,
        segment: &Segment,
        tau: f64,
        width: f64,
        data: &impl Fn(f64, &mut [f64]),
    ) {
        self.evaluate(segment, tau, data);
        let values = self.tape.results(&self.scalars).zip(&self.functions);
        for (look, (value, function)) in self.looks.iter_mut().zip(values) {
            match function {
                Function::Rate(_) => {
                    let difference = difference(segment, *function, tau, value);
                    if difference > UNLIKE * look.usual[1] {
                        look.missed += width * difference;
                    }
                }
                Function::Surface(_) => {
                    let differs = |end: Option<Side>| {
                        end.zip(side(value)).is_some_and(|(end, side)| end != side)
                    };
                    look.changes |= look.ends.into_iter().all(differs);
                }
            }
        }
    }

    /// Evaluates all functions at an instant of a step.
    fn evaluate(&mut self, segment: &Segment, tau: f64, data: &impl Fn(f64, &mut [f64])) {
        self.set(segment, tau, data);
        self.scalars[..self.inputs.len()].copy_from_slice(&self.inputs);
        self.tape.run(&mut self.scalars);
    }

    /// Puts an instant of a step into the inputs.
    fn set(&mut self, segment: &Segment, tau: f64, data: &impl Fn(f64, &mut [f64])) {
        let n = self.n;
        self.inputs[0] = segment.start + tau;
        for i in 0..n {
            self.inputs[1 + i] = series::value(segment.state_series(i), tau);
        }
        for (switch, side) in segment.sides.iter().enumerate() {
            self.inputs[1 + n + switch] = match side {
                Side::Minus => 0.0,
                Side::Plus => 1.0,
                Side::Slide => series::value(segment.polynomials().alpha(switch), tau),
            };
        }
        let first = 1 + n + self.m;
        data(self.inputs[0], &mut self.inputs[first..]);
    }
}

/// |x' - f| of a rate with this value, zero for other functions, and where it is not finite.
fn difference(segment: &Segment, function: Function, tau: f64, value: f64) -> f64 {
    match function {
        Function::Rate(i) if value.is_finite() => {
            (series::slope(segment.state_series(i), tau) - value).abs()
        }
        _ => 0.0,
    }
}

/// The side of a ψ with this value.
fn side(value: f64) -> Option<Side> {
    value.is_finite().then(|| Side::of(value))
}
