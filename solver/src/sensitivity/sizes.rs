//! How large states, their rates and their tangents are: what tells terms that cancel from those that vanish.

/// What is left of a tangent by rounding.
const ROUNDED: f64 = 1e-8;

/// The largest magnitudes between the last two events and since.
#[derive(Clone, Debug)]
pub(crate) struct Recent {
    now: Vec<f64>,
    before: Vec<f64>,
}

impl Recent {
    fn new(n: usize) -> Self {
        Recent {
            now: vec![0.0; n],
            before: vec![0.0; n],
        }
    }

    /// That of an entry.
    pub fn of(&self, i: usize) -> f64 {
        self.now[i].max(self.before[i])
    }

    /// All of them.
    pub fn all(&self) -> Vec<f64> {
        (0..self.now.len()).map(|i| self.of(i)).collect()
    }

    fn see(&mut self, values: &[f64]) {
        enlarge(&mut self.now, values);
    }

    fn turn(&mut self) {
        std::mem::swap(&mut self.now, &mut self.before);
        self.now.fill(0.0);
    }
}

fn enlarge(sizes: &mut [f64], values: &[f64]) {
    for (size, value) in sizes.iter_mut().zip(values) {
        *size = size.max(value.abs());
    }
}

/// Sizes along a run.
#[derive(Clone, Debug)]
pub(crate) struct Sizes {
    /// How large states and their rates have been in the run.
    pub largest: Vec<f64>,
    pub fastest: Vec<f64>,
    /// The same of late.
    pub states: Recent,
    pub speeds: Recent,
    /// By direction, how large tangents have been of late, and the terms of their rates, over time.
    tangents: Vec<Recent>,
    terms: Vec<Recent>,
}

impl Sizes {
    pub fn new(n_states: usize, n_directions: usize) -> Self {
        let recent = || vec![Recent::new(n_states); n_directions];
        Sizes {
            largest: vec![0.0; n_states],
            fastest: vec![0.0; n_states],
            states: Recent::new(n_states),
            speeds: Recent::new(n_states),
            tangents: recent(),
            terms: recent(),
        }
    }

    /// A state with its rate.
    pub fn see(&mut self, x: &[f64], slope: &[f64]) {
        enlarge(&mut self.largest, x);
        enlarge(&mut self.fastest, slope);
        self.states.see(x);
        self.speeds.see(slope);
    }

    /// A tangent of a direction.
    pub fn see_tangent(&mut self, direction: usize, tangent: &[f64]) {
        self.tangents[direction].see(tangent);
    }

    /// What has been added to a tangent and may cancel.
    pub fn add_terms(&mut self, direction: usize, terms: impl Iterator<Item = f64>) {
        for (sum, term) in self.terms[direction].now.iter_mut().zip(terms) {
            *sum += term.abs();
        }
    }

    /// How large the tangents of a direction have been of late.
    pub fn tangents(&self, direction: usize) -> impl Fn(usize) -> f64 + '_ {
        move |i| self.tangents[direction].of(i)
    }

    /// How large the terms were that the tangents of a direction are made of.
    pub fn terms(&self, direction: usize) -> impl Fn(usize) -> f64 + '_ {
        move |i| self.terms[direction].of(i)
    }

    /// How large the terms are that the motion of a state, S + f dt/dp, is made of: where they cancel, errors are a part of
    /// how large they have been, of which this share is known at least.
    pub fn moved(
        &self,
        (tangent, time): (&[f64], f64),
        f: &[f64],
        direction: usize,
        faded: f64,
    ) -> Vec<f64> {
        let (largest, terms) = (self.tangents(direction), self.terms(direction));
        let size = |i: usize| {
            let now = tangent[i].abs() + (f[i] * time).abs();
            let was = largest(i) + self.speeds.of(i) * time.abs();
            now + faded * was + ROUNDED * terms(i)
        };
        (0..tangent.len()).map(size).collect()
    }

    /// An event lies behind.
    pub fn turn(&mut self) {
        let all = self.tangents.iter_mut().chain(&mut self.terms);
        all.chain([&mut self.states, &mut self.speeds])
            .for_each(Recent::turn);
    }
}
