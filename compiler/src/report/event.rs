//! What happens at instants.

use crate::source::Span;

/// Something that happened at an instant.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Event {
    /// When.
    pub time: f64,
    /// What.
    pub kind: EventKind,
    /// On which surface, contact or jump.
    pub surface: String,
    /// The mode before.
    pub from: String,
    /// The mode after.
    pub to: String,
    /// Where the surface is written.
    #[serde(skip)]
    pub span: Option<Span>,
    /// The sliding modes there, where a nonlinear switch had to choose.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sliding: Vec<SlidingMode>,
}

/// A value of a nonlinear switch that keeps the state on its surface.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SlidingMode {
    /// The value of the switch, as its statement reads it.
    pub value: f64,
    /// S = ∂φ/∂s, φ being the rate of the switching function: attracting where it is negative.
    pub stability: f64,
    /// Whether the state slides on in it.
    pub taken: bool,
}

/// The kinds of [`Event`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum EventKind {
    /// From one side of a surface to the other.
    Crossing,
    /// Onto a surface, to stay on it.
    EnterSliding,
    /// Off a surface.
    LeaveSliding,
    /// A state jumps.
    Jump,
    /// A gap opens.
    ContactOpen,
    /// A gap closes.
    ContactClose,
    /// A contact stops slipping.
    Stick,
    /// A contact starts to slip.
    Slip,
    /// A constraint of a projection becomes active.
    Activate,
    /// A constraint of a projection becomes inactive.
    Deactivate,
    /// A relay switches.
    Relay,
    /// A sliding mode ends in a fold.
    Fold,
    /// Infinitely many events end in a limit.
    Zeno,
    /// Several solutions go on from here and one was chosen.
    Branch,
    /// A state jumps at an instant that is known before the run.
    Sample,
    /// A condition ends the run.
    Stop,
}

impl EventKind {
    /// All of them.
    pub const ALL: [EventKind; 16] = [
        EventKind::Crossing,
        EventKind::EnterSliding,
        EventKind::LeaveSliding,
        EventKind::Jump,
        EventKind::ContactOpen,
        EventKind::ContactClose,
        EventKind::Stick,
        EventKind::Slip,
        EventKind::Activate,
        EventKind::Deactivate,
        EventKind::Relay,
        EventKind::Fold,
        EventKind::Zeno,
        EventKind::Branch,
        EventKind::Sample,
        EventKind::Stop,
    ];

    /// The word of the language.
    pub fn as_str(self) -> &'static str {
        match self {
            EventKind::Crossing => "crossing",
            EventKind::EnterSliding => "enter_sliding",
            EventKind::LeaveSliding => "leave_sliding",
            EventKind::Jump => "jump",
            EventKind::ContactOpen => "contact_open",
            EventKind::ContactClose => "contact_close",
            EventKind::Stick => "stick",
            EventKind::Slip => "slip",
            EventKind::Activate => "activate",
            EventKind::Deactivate => "deactivate",
            EventKind::Relay => "relay",
            EventKind::Fold => "fold",
            EventKind::Zeno => "zeno",
            EventKind::Branch => "branch",
            EventKind::Sample => "sample",
            EventKind::Stop => "stop",
        }
    }
}
