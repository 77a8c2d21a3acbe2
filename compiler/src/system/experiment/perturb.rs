//! `perturb every 0.16 by sphere(1e-4) seed 1;`

use nsd_solver::event::{KickSize, Kicks};

use super::capabilities::Feature;
use super::error::ExperimentError;
use super::optimize::{LARGEST_SEED, one_argument};
use super::reader::Reader;
use super::settings::Settings;
use crate::source::Span;
use crate::syntax;
use crate::system::{Role, System};

/// Random vectors that are added to the state of a model. Their entries belong to the names of states, so that they are
/// the same whichever states a run keeps, and in whatever order these are declared.
#[derive(Clone, Debug, PartialEq)]
pub struct Perturbation {
    /// The period.
    pub every: f64,
    /// How large the vectors are.
    pub size: KickSize,
    /// What they depend on, besides names.
    pub seed: u64,
    /// The entries of all states of the model, `a.x[2]`.
    pub states: Vec<String>,
}

impl Perturbation {
    /// The vectors as a run of a system adds them.
    pub fn kicks(&self, system: &System) -> Kicks {
        let is_kept = |name: &&String| system.states.iter().any(|state| state.name == **name);
        let others = self.states.iter().filter(|name| !is_kept(name));
        Kicks {
            every: self.every,
            size: self.size,
            seed: self.seed,
            streams: (system.states.iter())
                .map(|state| stream(&state.name))
                .collect(),
            others: others.map(|name| stream(name)).collect(),
        }
    }
}

/// The hash of a name (Fowler, Noll and Vo's FNV-1a).
fn stream(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

impl Reader<'_, '_> {
    /// Random vectors that are added to the state.
    pub(crate) fn kicks(
        &mut self,
        every: &syntax::Expr,
        by: Option<&syntax::Expr>,
        seed: Option<&syntax::Expr>,
        statement: Span,
    ) -> Option<Perturbation> {
        let every = self.positive("the period", every);
        let size = match by.map(|by| (one_argument(by), by)) {
            Some((Some(("sphere", norm)), _)) => {
                self.positive("the norm", norm).map(KickSize::Norm)
            }
            Some((Some(("gauss", deviation)), _)) => {
                let deviation = self.positive("the deviation", deviation);
                deviation.map(KickSize::Deviation)
            }
            other => {
                let span = other.map_or(statement, |(_, by)| by.span);
                self.error(ExperimentError::UnknownChoice {
                    what: "distribution".into(),
                    found: "..".into(),
                    span,
                    choices: "`sphere(norm)`, `gauss(deviation)`".into(),
                    help: Some(
                        "write for example `perturb every 0.1 by sphere(1e-4) seed 1;`".into(),
                    ),
                });
                None
            }
        };
        let expected = "a whole number from 0 on";
        let whole = |x: f64| (0.0..=LARGEST_SEED).contains(&x) && x.fract() == 0.0;
        let seed = match seed {
            None => Some(1.0),
            Some(seed) => self.within("the seed", seed, expected, whole),
        };
        let entries = 0..self.model.state_vars().count();
        Some(Perturbation {
            every: every?,
            size: size?,
            seed: seed? as u64,
            states: entries.map(|k| self.model.entry_name(k)).collect(),
        })
    }
}

impl Settings<'_> {
    /// Why an experiment whose state is disturbed cannot be run.
    pub fn kicks_too_much(&self, system: &System) -> Option<ExperimentError> {
        self.kicks.as_ref()?;
        let mut switches = system.switches.iter();
        // A state on the wrong side of a constraint is none that the model has.
        let is_kept = switches.any(|switch| switch.unilateral || switch.role != Role::Step);
        let what = if !self.numerics.method.kind().takes(Feature::Perturbations) {
            format!("`method {}`", self.numerics.method.kind().word())
        } else if self.freezes() {
            "`lower timefreezing`".to_owned()
        } else if is_kept {
            "contacts, projections and algebraic states".to_owned()
        } else {
            return None;
        };
        Some(ExperimentError::Repetition {
            setting: format!("`perturb` with {what}"),
            span: self.span,
        })
    }
}
