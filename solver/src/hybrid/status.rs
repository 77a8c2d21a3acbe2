//! How a run ended, what it went on from, and what it cost.

use super::Side;
use crate::runtime::limit::Over;

/// One way to go on: the sides of the switches that meet.
pub type Candidate = Vec<(usize, Side)>;

/// How a run ended.
#[derive(Clone, PartialEq, Debug)]
pub enum Status {
    /// The end of the horizon was reached.
    Solved,
    /// The observer asked to stop.
    Stopped,
    /// `max_steps` was reached.
    StepLimit,
    /// `max_events` was reached.
    EventLimit,
    /// `limit` was reached.
    Over(Over),
    /// Events follow each other without time passing.
    Accumulation,
    /// A cycle of events goes on without end, ever faster: more events than `max_events` come before the end.
    Chattering {
        /// The switches that act in it.
        switches: Vec<usize>,
        /// The time from one event to the next, now.
        spacing: f64,
        /// How many there are until the end.
        events: f64,
    },
    /// Relays make each other switch without end, at one instant.
    Restless {
        /// The switches that do.
        switches: Vec<usize>,
    },
    /// A jump leads to where its own guard holds.
    StaysInGuard {
        /// The law.
        law: usize,
    },
    /// What is to end the run holds at its start.
    StopsAtStart {
        /// The law.
        law: usize,
    },
    /// Jumps follow each other without end, at one instant.
    EndlessJumps {
        /// Laws that jumped last.
        laws: Vec<usize>,
    },
    /// Two laws give one state different values at one instant.
    ConflictingJumps {
        /// The laws.
        laws: [usize; 2],
        /// The state.
        state: usize,
    },
    /// The state is below a surface that it cannot pass.
    Penetrates {
        /// The unilateral switch.
        switch: usize,
    },
    /// Friction pulls a body into its contact: the force of a closed contact does not push it open
    /// (Painlevé's paradox).
    Painleve {
        /// The unilateral switch.
        switch: usize,
    },
    /// More than one solution continues from here; there may be more than [`MAX_NAMED`](crate::selector::select::MAX_NAMED).
    NonUnique(Vec<Candidate>),
    /// No choice of sides is consistent with its own rates.
    NoSolution {
        /// The switches that meet here.
        switches: Vec<usize>,
    },
    /// No choice of sides is consistent, and sliding is not determined: rates do not depend on their
    /// own switches independently.
    Undetermined {
        /// The switches that meet here.
        switches: Vec<usize>,
    },
    /// No values of algebraic states satisfy the equations and complementarities, as far as Newton's method
    /// finds any near those they have.
    Inconsistent {
        /// The switches of those that are missed.
        switches: Vec<usize>,
    },
    /// Equations do not determine the algebraic states: their index is above one here.
    HighIndex {
        /// Their switches.
        switches: Vec<usize>,
    },
    /// A coefficient of a contact is one that no contact has.
    Coefficient {
        /// The switch of the contact.
        switch: usize,
        /// Which.
        coefficient: Coefficient,
        /// What it is here.
        value: f64,
    },
    /// While sliding, the equations for α became singular.
    SingularSliding {
        /// The sliding switches.
        switches: Vec<usize>,
    },
    /// The state was found on the wrong side of a surface.
    MissedSwitch {
        /// The switch.
        switch: usize,
    },
    /// The vector field is not finite, or no step is small enough.
    NotFinite,
    /// The equations of a finite element have no solution that Newton's method finds, or the
    /// element is too long to see what switches in it.
    Unsolved,
    /// Several weights of the regions that meet keep the state on their surfaces, with different
    /// rates: in Stewart's form they are not determined where switches do not just add up.
    Unweighted {
        /// The switches that meet here.
        switches: Vec<usize>,
    },
    /// The Runge-Kutta method cannot hold a state on a surface.
    CannotSlide {
        /// The switches that slide.
        switches: Vec<usize>,
    },
}

impl From<Over> for Status {
    fn from(over: Over) -> Self {
        Status::Over(over)
    }
}

impl Status {
    /// Whether two runs end in one way; where chattering is told differs as their events do.
    pub fn is_like(&self, other: &Status) -> bool {
        match (self, other) {
            (
                Status::Chattering { switches, .. },
                Status::Chattering {
                    switches: others, ..
                },
            ) => switches == others,
            _ => self == other,
        }
    }
}

/// The coefficients of a contact.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Coefficient {
    /// Of restitution, in [0, 1].
    Restitution,
    /// Of friction, not negative.
    Friction,
}

impl Coefficient {
    /// The coefficient among the restitution and the friction of a contact that is outside of its range, with its value.
    pub fn outside(restitution: f64, friction: f64) -> Option<(Coefficient, f64)> {
        if !(0.0..=1.0).contains(&restitution) {
            return Some((Coefficient::Restitution, restitution));
        }
        let is_one = friction >= 0.0;
        (!is_one).then_some((Coefficient::Friction, friction))
    }
}

/// What a run went on from although it could not be sure.
#[derive(Clone, PartialEq, Debug)]
pub enum Note {
    /// A solution was found and taken, and the search for others met the bound on its effort.
    Unsearched {
        /// When.
        time: f64,
        /// The switches that met there.
        switches: Vec<usize>,
    },
    /// An impact has added energy, as several contacts with restitutions that differ, or with friction, may do.
    EnergyGained {
        /// When.
        time: f64,
        /// The contacts.
        switches: Vec<usize>,
    },
    /// Forces are so small in their units that what rounding does to them may matter.
    Faint {
        /// When.
        time: f64,
        /// The contacts and constraints that they keep.
        switches: Vec<usize>,
    },
    /// Surfaces counted as met at once, where it matters whether one of them is met later.
    Together {
        /// When.
        time: f64,
        /// The switch of that one, and those of the others.
        switches: Vec<usize>,
    },
    /// Chattering that fades and never ends goes on as sliding.
    Averaged {
        /// When.
        time: f64,
        /// The switches that chattered.
        switches: Vec<usize>,
        /// The largest |ψ| of each in the last cycle.
        heights: Vec<f64>,
    },
    /// A function may be narrower within a step than could be looked at.
    Unseen {
        /// When the step starts.
        time: f64,
        /// Which.
        function: Function,
    },
}

/// A function of a system.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Function {
    /// The rate of a state.
    Rate(usize),
    /// ψ of a switch.
    Surface(usize),
}

impl Note {
    /// True when both say the same of the same switches.
    pub(crate) fn is_like(&self, other: &Note) -> bool {
        match (self, other) {
            (
                Note::Unsearched { switches, .. },
                Note::Unsearched {
                    switches: others, ..
                },
            )
            | (
                Note::EnergyGained { switches, .. },
                Note::EnergyGained {
                    switches: others, ..
                },
            )
            | (
                Note::Faint { switches, .. },
                Note::Faint {
                    switches: others, ..
                },
            )
            | (
                Note::Together { switches, .. },
                Note::Together {
                    switches: others, ..
                },
            ) => switches == others,
            (
                Note::Unseen { function, .. },
                Note::Unseen {
                    function: other, ..
                },
            ) => function == other,
            _ => false,
        }
    }
}

/// What a run has counted, and what has ended it.
#[derive(Clone, Copy, Default, Debug, PartialEq, Eq)]
pub struct Stats {
    /// Accepted steps.
    pub steps: usize,
    /// Steps cut because their series did not satisfy the equation.
    pub rejected: usize,
    /// Evaluations of f, a series of order p counting p.
    pub rhs_evaluations: usize,
    /// Steps of the implicit method among them.
    pub implicit_steps: usize,
    /// Its Newton iterations.
    pub newton_iterations: usize,
    /// Its factorizations, each of one real and several complex matrices.
    pub factorizations: usize,
    /// Changes of mode.
    pub events: usize,
    /// Those among them whose instant was known before the run.
    pub scheduled: usize,
    /// Functions of blocks and surfaces that were met for the first time.
    pub functions: usize,
    /// The law that has ended the run, before its horizon.
    pub stopped_by: Option<usize>,
}
