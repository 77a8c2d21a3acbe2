//! The grid of a horizon, and how its steps become rows.

use nsd_solver::integrate::tableau::Family;

use crate::system::experiment::{
    Cross, Equilibration, FesdOptions, Form, Optimize, SteppingOptions,
};

/// The steps of a horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// When it starts.
    pub start: f64,
    /// T.
    pub horizon: f64,
    /// N.
    pub steps: usize,
}

impl Grid {
    /// N steps from t = 0 on.
    pub const fn new(horizon: f64, steps: usize) -> Self {
        Grid {
            start: 0.0,
            horizon,
            steps,
        }
    }

    /// t_k = (k - 1) T/N from the start, where step k begins.
    pub fn start_of(&self, k: usize) -> f64 {
        self.start + self.horizon * (k - 1) as f64 / self.steps as f64
    }

    /// An instant inside of step k: data have their pieces there at both of its ends.
    pub fn middle_of(&self, k: usize) -> f64 {
        self.start_of(k) + 0.5 * self.horizon / self.steps as f64
    }
}

/// How a step becomes rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Family of Runge-Kutta methods, and number of nodes.
    pub scheme: (Family, usize),
    /// How the method is written; `None` for the integral form where there is one.
    pub form: Option<Form>,
    /// What a step consists of.
    pub elements: Elements,
}

/// The elements of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Elements {
    /// Switches get to their ends.
    Detected(Detection),
    /// So many of equal lengths, whatever switches within them: time stepping.
    Plain(usize),
}

impl Elements {
    /// How many there are.
    pub fn count(self) -> usize {
        match self {
            Elements::Detected(detection) => detection.elements,
            Elements::Plain(count) => count,
        }
    }

    /// How switches are detected, where they are.
    pub fn detection(self) -> Option<Detection> {
        match self {
            Elements::Detected(detection) => Some(detection),
            Elements::Plain(_) => None,
        }
    }
}

/// How switches get to the ends of elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Elements per step; r switches inside a step need r + 1.
    pub elements: usize,
    /// How pairs across the nodes are added up.
    pub cross: Cross,
    /// What makes lengths equal where there is no switch.
    pub equilibration: Equilibration,
    /// γ: lengths are between (1 - γ) and (1 + γ) times their mean, and not negative.
    pub spread: f64,
}

impl Default for Detection {
    fn default() -> Self {
        let FesdOptions {
            elements,
            cross,
            equilibration,
            ..
        } = FesdOptions::default();
        Detection {
            elements,
            cross,
            equilibration,
            spread: 1.0,
        }
    }
}

impl Options {
    /// Those of `method fesd`.
    pub fn fesd(options: &FesdOptions) -> Self {
        Options {
            scheme: options.scheme,
            form: options.form,
            elements: Elements::Detected(Detection {
                elements: options.elements,
                cross: options.cross,
                equilibration: options.equilibration,
                ..Detection::default()
            }),
        }
    }

    /// Those of an `optimize`.
    pub fn optimize(task: &Optimize) -> Self {
        let grid = &task.discretization;
        Options {
            scheme: grid.scheme,
            form: None,
            elements: match grid.detects {
                true => Elements::Detected(Detection {
                    elements: grid.elements,
                    cross: task.options.cross,
                    equilibration: task.options.equilibration,
                    // An element may be as long as its interval: which of them a switch is between is the solver's choice.
                    spread: grid.elements as f64 - 1.0,
                }),
                false => Elements::Plain(grid.elements),
            },
        }
    }

    /// Those of `method timestepping`.
    pub fn stepping(options: &SteppingOptions) -> Self {
        Options {
            scheme: options.scheme(),
            form: None,
            elements: Elements::Plain(1),
        }
    }
}
