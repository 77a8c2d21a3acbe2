//! Functions with their derivatives: at a point, and along a part as series.

use std::sync::{Arc, Mutex, OnceLock};

use super::{Point, Slots, locked};
use crate::expansion::field::run_balls;
use crate::hybrid::Input;
use crate::hybrid::form::Surface;
use crate::sensitivity::taylor::{ORDER, Series};
use crate::tape::{Ball, Jet, Tame, Tape};

/// Functions with their first derivatives.
pub(in crate::sensitivity) struct Group {
    pub(super) inputs: Vec<Input>,
    pub(super) values: Arc<Tape>,
    slopes: Tape,
    /// (function, slot) of every slope.
    pub(super) entries: Vec<(usize, usize)>,
    /// The slopes as series, and of each the first one that is the same, once somebody has asked for them.
    jet: Mutex<Option<(Jet, Vec<usize>)>>,
    /// The slopes as functions of their own, once somebody has asked for them.
    second: OnceLock<Box<Group>>,
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
            jet: Mutex::new(None),
            second: OnceLock::new(),
        }
    }

    /// Hands on (function, slot) and their derivative as a series, which has been handed on before where it is the same as that
    /// of an earlier place; `write` writes the series of inputs.
    pub fn series(
        &self,
        write: impl Fn(Input, &mut [f64]),
        mut take: impl FnMut((usize, usize), usize, &Series),
    ) {
        let mut jet = locked(&self.jet);
        let (jet, same) = jet.get_or_insert_with(|| {
            let mut jet = Jet::new(&self.slopes, ORDER);
            let degrees = self.inputs.iter().enumerate();
            jet.bound_degrees(degrees.filter_map(|(place, input)| match input {
                Input::Time => Some((place, 1)),
                Input::State(_) | Input::Alpha(_) => None,
                Input::Coefficient(_) | Input::Parameter(_) | Input::Number(_) => Some((place, 0)),
            }));
            let same = jet.same_outputs();
            (jet, same)
        });
        for (place, &of) in self.inputs.iter().enumerate() {
            write(of, jet.input_row_mut(place));
        }
        jet.fill();
        for (at, (&entry, &same)) in self.entries.iter().zip(&*same).enumerate() {
            if let Ok(row) = jet.output_row(at).try_into() {
                take(entry, same, row);
            }
        }
    }

    /// The values at a point.
    pub fn values<'r>(
        &'r self,
        point: &Point,
        registers: &'r mut Vec<f64>,
    ) -> impl Iterator<Item = f64> + 'r {
        point.run(&self.values, &self.inputs, registers)
    }

    /// (function, slot, derivative) at a point.
    pub fn slopes<'r>(
        &'r self,
        point: &Point,
        registers: &'r mut Vec<f64>,
    ) -> impl Iterator<Item = (usize, usize, f64)> + 'r {
        let slopes = point.run(&self.slopes, &self.inputs, registers);
        let entries = self.entries.iter().zip(slopes);
        entries.map(|(&(f, slot), slope)| (f, slot, slope))
    }

    /// Whether the middle of a part speaks for all of it, for every slope.
    pub(super) fn is_tame(
        &self,
        input: &impl Fn(Input) -> Ball,
        registers: &mut Vec<Tame>,
    ) -> bool {
        run_balls(&self.slopes, &self.inputs, input, registers);
        self.slopes.results(registers).all(|slope| slope.is_tame)
    }

    /// The slopes as functions of their own.
    pub(super) fn differentiated(&self, slots: Slots) -> &Group {
        let make = || Group::new(Arc::new(self.slopes.clone()), self.inputs.clone(), slots);
        self.second.get_or_init(|| Box::new(make()))
    }
}

/// ψ, or a derivative of it, with two derivatives.
pub(in crate::sensitivity) enum Psi {
    /// Value at zero and slopes of what is affine.
    Affine(f64, Vec<(usize, f64)>),
    Smooth(Box<Group>),
}

impl Psi {
    pub(super) fn new(surface: Surface, slots: Slots) -> Self {
        match surface {
            Surface::Affine(affine) => {
                let terms = affine.terms.iter();
                let terms = terms.map(|&(j, c)| (slots.state(j), c));
                Psi::Affine(affine.constant, terms.chain([(0, affine.time)]).collect())
            }
            Surface::Parametric(smooth) | Surface::Smooth(smooth) => {
                Psi::Smooth(Box::new(Group::new(smooth.psi, smooth.inputs, slots)))
            }
        }
    }

    /// What is not affine, with its slopes as functions.
    pub(super) fn groups(&self, slots: Slots) -> Vec<&Group> {
        match self {
            Psi::Affine(..) => Vec::new(),
            Psi::Smooth(group) => vec![group, group.differentiated(slots)],
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
            Psi::Smooth(group) => group.values(point, registers).sum(),
        }
    }

    /// (slot, derivative).
    pub fn slopes(&self, point: &Point, registers: &mut Vec<f64>) -> Vec<(usize, f64)> {
        match self {
            Psi::Affine(_, terms) => terms.clone(),
            Psi::Smooth(group) => {
                let slopes = group.slopes(point, registers);
                slopes.map(|(_, slot, slope)| (slot, slope)).collect()
            }
        }
    }

    /// Hands on (slot, derivative) as series; `write` writes those of inputs.
    pub fn series(&self, write: impl Fn(Input, &mut [f64]), mut take: impl FnMut(usize, &Series)) {
        match self {
            Psi::Affine(_, terms) => {
                for &(slot, c) in terms {
                    let mut series = [0.0; ORDER + 1];
                    series[0] = c;
                    take(slot, &series);
                }
            }
            Psi::Smooth(group) => group.series(write, |(_, slot), _, row| take(slot, row)),
        }
    }

    /// The same of ((slot, slot), second derivative).
    pub fn bent_series(
        &self,
        slots: Slots,
        write: impl Fn(Input, &mut [f64]),
        mut take: impl FnMut([usize; 2], &Series),
    ) {
        if let Psi::Smooth(group) = self {
            let second = group.differentiated(slots);
            second.series(write, |(at, slot), _, row| {
                take([group.entries[at].1, slot], row)
            });
        }
    }

    /// (slot, slot, second derivative).
    pub(super) fn bends(
        &self,
        slots: Slots,
        point: &Point,
        registers: &mut Vec<f64>,
    ) -> Vec<(usize, usize, f64)> {
        match self {
            Psi::Affine(..) => Vec::new(),
            Psi::Smooth(group) => {
                let bends = group.differentiated(slots).slopes(point, registers);
                bends
                    .map(|(at, slot, bend)| (group.entries[at].1, slot, bend))
                    .collect()
            }
        }
    }
}
