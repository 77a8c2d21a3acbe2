//! A complementarity system in the units of its runs.

use std::ops::ControlFlow;

use super::ComplementaritySystem;
use super::library::Library;
use super::pointwise::{Point, eval};
use super::units::Units;
use crate::event::{Event, Observer, Segment};

/// Instants at which a system is looked at before a run, as parts of the horizon.
const INSTANTS: [f64; 3] = [0.0, 0.34, 0.71];

/// Points of a run at which terms are looked at, at most.
const MOST_POINTS: usize = 64;

/// A system as it is stated, and in the units that its last run had. Most systems need no others. Units depend on the start
/// of a run alone, and on no run before it.
#[derive(Clone, Debug)]
pub struct Balanced {
    stated: Version,
    scaled: Option<(Units, Version)>,
    /// What the units were chosen for.
    start: Vec<f64>,
}

/// A system, and what runs have made of its functions.
#[derive(Clone, Debug)]
pub struct Version {
    /// The system.
    pub system: ComplementaritySystem,
    /// Its functions.
    pub library: Library,
}

impl From<ComplementaritySystem> for Version {
    fn from(system: ComplementaritySystem) -> Self {
        let library = Library::default();
        Version { system, library }
    }
}

impl Balanced {
    /// A system in the units that it is stated in.
    pub fn new(system: ComplementaritySystem) -> Self {
        Balanced {
            stated: system.into(),
            scaled: None,
            start: Vec::new(),
        }
    }

    /// The system as it is stated, to have other parameters or data.
    pub fn stated(&mut self) -> &mut ComplementaritySystem {
        &mut self.stated.system
    }

    /// The system in the units of its last run.
    pub fn present(&self) -> &Version {
        self.scaled
            .as_ref()
            .map_or(&self.stated, |(_, scaled)| scaled)
    }

    /// The same for a run from x₀ over some time. `run` follows the motion roughly, where sizes at the start say that
    /// units may have to be others.
    pub fn over(
        &mut self,
        horizon: f64,
        x0: &[f64],
        run: impl FnOnce(&mut Version, &mut dyn Observer),
    ) -> &mut Version {
        let system = &self.stated.system;
        let start = [&[horizon], x0, &system.parameters].concat();
        if start != self.start {
            self.start = start;
            let expected = self.expected(horizon, x0);
            self.change(&expected);
            if self.scaled.is_some() {
                let mut sizes = Sizes::new(x0);
                run(self.version(), &mut sizes);
                let measured = self.measured(horizon, &sizes);
                if !expected.suit(&measured) {
                    self.change(&measured);
                }
            }
        }
        self.version()
    }

    /// The present version, with parameters and data as they are stated.
    fn version(&mut self) -> &mut Version {
        let Balanced { stated, scaled, .. } = self;
        let Some((_, scaled)) = scaled else {
            return stated;
        };
        (scaled.system.parameters).clone_from(&stated.system.parameters);
        scaled.system.data.clone_from(&stated.system.data);
        scaled
    }

    /// Takes these units, or the stated ones where they serve.
    fn change(&mut self, units: &Units) {
        let system = &self.stated.system;
        let is_stated = Units::stated(system).suit(units);
        let is_present = (self.scaled.as_ref()).is_some_and(|(present, _)| present == units);
        if is_stated || !is_present {
            self.scaled = (!is_stated).then(|| (units.clone(), units.scale(system).into()));
        }
    }

    /// The units by the start of a run.
    fn expected(&self, horizon: f64, x0: &[f64]) -> Units {
        let system = &self.stated.system;
        let mut numbers = vec![0.0; system.n_numbers()];
        system.numbers(0.0, &mut numbers);
        let start = Point {
            t: 0.0,
            x: x0,
            numbers: &numbers,
        };
        let rates = eval(&system.full.equations, &start.with(&start.start(system)));
        let size = |(x, rate): (&f64, &f64)| match x.abs() {
            0.0 if rate.is_finite() => rate.abs() * horizon,
            size => size,
        };
        let sizes: Vec<f64> = x0.iter().zip(&rates).map(size).collect();
        let instants = INSTANTS.map(|part| (part * horizon, x0));
        Units::at(system, &sizes, horizon, instants.into_iter())
    }

    /// The units by a run.
    fn measured(&self, horizon: f64, sizes: &Sizes) -> Units {
        let points = sizes.points.iter().map(|(t, x)| (*t, &x[..]));
        Units::at(&self.stated.system, &sizes.largest, horizon, points)
    }
}

/// The sizes of states in a run, and points of it.
struct Sizes {
    largest: Vec<f64>,
    points: Vec<(f64, Vec<f64>)>,
    /// One of so many steps is taken, of which as many are left out before the next.
    every: usize,
    left_out: usize,
}

impl Sizes {
    fn new(x0: &[f64]) -> Self {
        Sizes {
            largest: x0.iter().map(|x| x.abs()).collect(),
            points: vec![(0.0, x0.to_vec())],
            every: 1,
            left_out: 0,
        }
    }
}

impl Observer for Sizes {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        for (largest, x) in self.largest.iter_mut().zip(segment.end) {
            *largest = largest.max(x.abs());
        }
        self.left_out += 1;
        if self.left_out >= self.every {
            self.left_out = 0;
            self.points.push((segment.until, segment.end.to_vec()));
        }
        if self.points.len() > MOST_POINTS {
            let mut keeps = [false, true].into_iter().cycle();
            self.points.retain(|_| keeps.next() == Some(true));
            self.every *= 2;
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}
