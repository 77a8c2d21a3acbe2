//! What is asked of a run that is differentiated.

/// By what a run is differentiated: for each direction, what it does to the start and to the parameters.
#[derive(Clone, Debug, Default)]
pub struct Directions {
    /// dx(0)/dp, as many entries as states, by direction.
    pub initial: Vec<Vec<f64>>,
    /// The derivatives of the parameters of the system, by direction.
    pub parameters: Vec<Vec<f64>>,
}

impl Directions {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.initial.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.initial.is_empty()
    }
}

/// An instant of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// When.
    pub time: f64,
    /// Whether behind what happens there.
    pub is_behind: bool,
}
