//! What methods of simulation take of models and experiments: what each does not take is told here, by the table of methods
//! (`method.rs`).

use super::error::ExperimentError;
use super::method::{Lowering, MethodKind};
use super::settings::Settings;
use crate::model::Model;
use crate::source::Span;
use crate::system::{Role, System};

/// Something that not every method takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Contacts of bodies.
    Contacts,
    /// Contacts with Poisson's law of restitution.
    Poisson,
    /// Relays with hysteresis, which remember.
    Relays,
    /// State jumps that are no contacts.
    Jumps,
    /// States that are kept in sets.
    Projections,
    /// States that equations or complementarities determine.
    Algebraic,
    /// Switches that are read nonlinearly.
    Nonlinear,
    /// Random vectors that are added to the state.
    Perturbations,
    /// Chattering that goes on as sliding.
    Averages,
    /// Conditions that end a run.
    Stops,
    /// Jumps and relays while a clock stands still.
    TimeFreezing,
    /// Impulses where finite elements meet.
    Impulses,
    /// Derivatives of runs by parameters and initial values.
    Derivatives,
}

/// Whether a method takes something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// As it is.
    Yes,
    /// With one of these lowerings.
    Lowered(&'static [Lowering]),
    /// Not at all.
    No,
}

use Taken::{Lowered, No, Yes};

/// Where something of a feature stands.
enum Seen<'s, 'e> {
    Model(&'s Model<'e>),
    System(&'s System<'e>),
}

/// Instead of what does not take Poisson's law.
pub(crate) const POISSON: &str = "`method event`, which is the default, simulates Poisson's law; elsewhere write Newton's, `restitution = newton(e);`";

impl Feature {
    /// All of them, in the order in which they are told.
    pub const ALL: [Feature; 13] = [
        Feature::Poisson,
        Feature::Contacts,
        Feature::Relays,
        Feature::Jumps,
        Feature::Projections,
        Feature::Algebraic,
        Feature::Nonlinear,
        Feature::Perturbations,
        Feature::Averages,
        Feature::Stops,
        Feature::TimeFreezing,
        Feature::Impulses,
        Feature::Derivatives,
    ];

    /// As the head of a column.
    fn title(self) -> &'static str {
        match self {
            Feature::Contacts => "`contact`",
            Feature::Poisson => "`poisson(e)`",
            Feature::Relays => "`hysteresis`",
            Feature::Jumps => "`jump`, `every`",
            Feature::Projections => "`project`",
            Feature::Algebraic => "algebraic states",
            Feature::Nonlinear => "`sliding nonlinear`",
            Feature::Perturbations => "`perturb`",
            Feature::Averages => "`on chattering slide`",
            Feature::Stops => "`stop when`",
            Feature::TimeFreezing => "`lower timefreezing`",
            Feature::Impulses => "`lower impact`",
            Feature::Derivatives => "`sensitivity to`",
        }
    }

    /// The first place in a model that has it, that of the experiment where it is nowhere else, and what it is called.
    fn place(self, seen: &Seen<'_, '_>, experiment: Span) -> Option<(String, Span)> {
        match (self, seen) {
            (Feature::Contacts, Seen::Model(model)) => {
                let contact = model.statements.contacts.first()?;
                Some((contact.name.clone(), contact.span))
            }
            (Feature::Poisson, Seen::Model(model)) => {
                let mut contacts = model.statements.contacts.iter();
                let contact = contacts.find(|contact| contact.restitution.newton().is_none())?;
                Some((contact.name.clone(), contact.span))
            }
            (Feature::Jumps, Seen::System(system)) => {
                let (name, span) = match system.jumps.impulsive.is_empty() {
                    true => system.jumps.first_jump()?,
                    // Contacts are a matter of the method.
                    false => {
                        let mut laws = system.jumps.laws.iter();
                        let law = laws.find(|law| !law.stops)?;
                        (law.name.as_str(), law.span)
                    }
                };
                Some((name.to_owned(), span))
            }
            (Feature::Stops, Seen::System(system)) => {
                let mut laws = system.jumps.laws.iter();
                let stop = laws.find(|law| law.stops)?;
                Some((stop.name.clone(), stop.span))
            }
            (Feature::Relays | Feature::Projections | Feature::Algebraic, Seen::System(system)) => {
                let mut switches = system.switches.iter().enumerate();
                let (_, switch) = switches.find(|(k, switch)| match self {
                    Feature::Relays => switch.relay.is_some(),
                    Feature::Projections => system.is_projected(*k),
                    _ => switch.role != Role::Step,
                })?;
                let span = switch.spans.first().copied();
                Some((switch.name.clone(), span.unwrap_or(experiment)))
            }
            _ => None,
        }
    }

    /// That a method does not take it at a place; nothing where its form of the system says so.
    fn error(self, method: MethodKind, (name, span): (String, Span)) -> Option<ExperimentError> {
        let is_lowered = matches!(method.taken(self), Lowered(_));
        let word = method.word();
        Some(match self {
            Feature::Contacts => ExperimentError::Contact {
                method: word,
                help: match is_lowered {
                    true => {
                        "add `lower impact;` for impulses where elements meet, or `lower timefreezing;`; or use `method event`, which is the default"
                    }
                    false => "use `method event`, which is the default, or `method timestepping`",
                },
                name,
                span,
            },
            Feature::Poisson => ExperimentError::Contact {
                method: word,
                help: POISSON,
                name,
                span,
            },
            Feature::Relays if method.needs_dcs() => return None,
            Feature::Relays => ExperimentError::Relay {
                method: word,
                name,
                span,
            },
            Feature::Jumps => ExperimentError::Jump {
                method: word,
                help: match is_lowered {
                    true => {
                        "use `method event`, which is the default; `lower timefreezing;` makes motion of a jump that is a contact"
                    }
                    false => "use `method event`, which is the default",
                },
                name,
                span,
            },
            Feature::Projections => ExperimentError::Projection { method: word, span },
            Feature::Algebraic => ExperimentError::Algebraic { method: word, span },
            Feature::Stops => ExperimentError::NoStop {
                by: format!("method {word}"),
                span,
            },
            _ => return None,
        })
    }
}

impl<'e> Settings<'e> {
    /// What of a model the method does not take, before the model is lowered, which may be long.
    pub fn refused_of_model(&self, model: &Model<'e>) -> Option<ExperimentError> {
        self.refused(&Seen::Model(model))
    }

    /// What of a system the method does not take.
    pub fn refused_of_system(&self, system: &System<'e>) -> Option<ExperimentError> {
        self.refused(&Seen::System(system))
    }

    /// The first thing that the method does not take.
    fn refused(&self, seen: &Seen<'_, '_>) -> Option<ExperimentError> {
        let mut forms = [Lowering::TimeFreezing, Lowering::Impact].into_iter();
        if let Some(form) = forms.find(|form| self.numerics.lowerings.contains(form)) {
            // What else they do not take is refused with them.
            let (_, span) = Feature::Poisson.place(seen, self.span)?;
            return Some(ExperimentError::Lowering {
                name: form.word().to_owned(),
                with: "for Poisson's law of restitution ",
                help: POISSON,
                span,
            });
        }
        let method = self.numerics.method.kind();
        let all = Feature::ALL.into_iter();
        let mut open = all.filter(|feature| !method.takes(*feature));
        open.find_map(|feature| feature.error(method, feature.place(seen, self.span)?))
    }
}

/// Which method takes what, as a table of the language reference.
pub fn table() -> String {
    let heads = Feature::ALL.map(Feature::title).join(" | ");
    let mut table = format!(
        "| | {heads} |\n|{}\n",
        " --- |".repeat(1 + Feature::ALL.len())
    );
    for kind in MethodKind::ALL {
        let cells = Feature::ALL.map(|feature| match kind.taken(feature) {
            Yes => "yes".to_owned(),
            No => "no".to_owned(),
            Lowered(lowerings) => {
                let words = lowerings.iter().map(|l| format!("`lower {}`", l.word()));
                words.collect::<Vec<_>>().join(", ")
            }
        });
        table += &format!("| `{}` | {} |\n", kind.word(), cells.join(" | "));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::table;

    #[test]
    fn the_language_reference_has_the_table() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../grammar/README.md");
        let reference = std::fs::read_to_string(path).expect("the reference is there");
        let table = table();
        assert!(
            reference.contains(&table),
            "the reference should have\n{table}"
        );
    }
}
