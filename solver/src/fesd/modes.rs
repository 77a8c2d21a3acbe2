//! The active sets that runs of a system have met: what has been compiled and factored for each.

use rustc_hash::FxHashMap;

use super::run::Run;
use super::run::place::Place;
use super::system::{ComplementaritySystem, Zero};
use crate::fesd::element::Element;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::system::hidden::{Hidden, Unsolved};
use crate::fesd::system::library::Library;
use crate::hybrid::{Side, Stats};

/// What has been compiled and factored for an active set.
pub(crate) struct Mode {
    pub element: Element,
    pub hidden: Hidden,
}

impl Mode {
    /// Takes the numbers that hold from here on.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        self.element.set_numbers(numbers);
        self.hidden.set_numbers(numbers);
    }

    /// Ends the element just solved where a member vanishes, about at the fraction σ of it; `end` is that member, with
    /// the value that counts as zero. Returns its length.
    pub fn cut(
        &mut self,
        scheme: &Scheme,
        sigma: f64,
        end: (usize, f64),
        scale: &[f64],
        stats: &mut Stats,
    ) -> Result<f64, Unsolved> {
        let Mode { element, hidden } = self;
        let longest = element.stages.h * (1.0 + 1e-9);
        element.shorten(scheme, sigma);
        let length = element.solve_to(scheme, hidden, end, scale, stats)?;
        let is_part = length > 0.0 && length <= longest;
        is_part.then_some(length).ok_or(Unsolved::Diverged)
    }

    /// Moves to a place, and solves for the unknowns w there unless they are known; false where nothing solves for them.
    fn enter(&mut self, place: &Place, is_solved: bool) -> bool {
        let Mode { element, hidden } = self;
        let w = place.z_of(&element.reduced.unknowns);
        hidden.set(place.t, place.x.iter().copied(), &w);
        is_solved || hidden.solve(&element.reduced).is_ok()
    }
}

/// Modes by active set.
pub(crate) struct Modes<'s> {
    pub system: &'s ComplementaritySystem,
    pub scheme: Scheme,
    pub library: Library,
    /// Places in `all`; none for sets without functions.
    known: FxHashMap<Vec<Zero>, Option<usize>>,
    pub all: Vec<Mode>,
    /// What changes at breakpoints, as it is now.
    pub numbers: Vec<f64>,
}

impl<'s> Modes<'s> {
    /// No mode yet.
    pub fn new(system: &'s ComplementaritySystem, scheme: Scheme) -> Self {
        Modes {
            system,
            scheme,
            library: Library::default(),
            known: FxHashMap::default(),
            all: Vec::new(),
            numbers: vec![0.0; system.n_numbers()],
        }
    }

    /// Takes the numbers that hold from an instant on. Returns the next breakpoint.
    pub fn load(&mut self, from: f64) -> f64 {
        let until = self.system.numbers(from, &mut self.numbers);
        for mode in &mut self.all {
            mode.set_numbers(&self.numbers);
        }
        until
    }

    /// The place of the functions of an active set.
    pub fn of(&mut self, zeros: &[Zero]) -> Option<usize> {
        if let Some(&known) = self.known.get(zeros) {
            return known;
        }
        let n = self.system.n_states();
        let reduced = self.library.reduced(self.system, zeros);
        let place = reduced.map(|reduced| {
            let n_numbers = self.numbers.len();
            let mut mode = Mode {
                hidden: Hidden::new(n, n_numbers, &reduced),
                element: Element::new(&self.scheme, n, n_numbers, reduced),
            };
            mode.element.follow(&self.system.algebraic_states);
            mode.set_numbers(&self.numbers);
            self.all.push(mode);
            self.all.len() - 1
        });
        self.known.insert(zeros.to_vec(), place);
        place
    }

    /// Where the switches stand in a mode.
    pub fn sides(&self, mode: usize) -> &[Side] {
        &self.all[mode].element.reduced.sides
    }

    /// Takes z of the hidden equations where a run is; false where nothing solves these. At a fold w is known, and no
    /// solution by itself.
    pub fn take_z(&mut self, run: &mut Run) -> bool {
        let mode = &mut self.all[run.place.mode];
        if !mode.enter(&run.place, run.fold.is_some()) {
            return false;
        }
        let values = mode.hidden.eval(&mode.element.reduced.algebraics);
        for (z, value) in run.place.z.iter_mut().zip(values) {
            *z = value;
        }
        true
    }

    /// Sides and α of all switches where a run is.
    pub fn switches(&mut self, run: &Run) -> (Box<[Side]>, Vec<f64>) {
        let mode = &mut self.all[run.place.mode];
        let sides = mode.element.reduced.sides.clone();
        let mut alpha: Vec<f64> = sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect();
        if mode.enter(&run.place, run.fold.is_some()) {
            let sliding = (0..alpha.len()).filter(|i| sides[*i] == Side::Slide);
            for (switch, value) in sliding.zip(mode.hidden.eval(&mode.element.reduced.alphas)) {
                alpha[switch] = value;
            }
        }
        (sides, alpha)
    }
}
