//! What an experiment is about: its parameters and states with their values, units, ranges and documentation.

use serde::Serialize;

use crate::diagnostics::messages::Messages;
use crate::expr::Exprs;
use crate::model::{Named, Quantity};
use crate::project::Project;
use crate::project::clock::Clock;
use crate::source::{SourceMap, Span};
use crate::system::Allowed;
use crate::system::experiment::Settings;

/// What an experiment is about.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Description {
    /// Its name.
    pub name: String,
    /// `simulate`, `optimize`, `fit` or `mpc`.
    pub kind: &'static str,
    /// The model.
    pub model: String,
    /// What the doc comment in front of it says.
    pub doc: Option<String>,
    /// The end of the run; of a free horizon, its guess.
    pub horizon: f64,
    /// The method, `auto` where the experiment leaves the choice.
    pub method: &'static str,
    /// Parameters, in order of declaration, those of parts among them.
    pub parameters: Vec<Described>,
    /// States, algebraic ones behind the others.
    pub states: Vec<Described>,
    /// Controls.
    pub controls: Vec<Described>,
    /// Inputs.
    pub inputs: Vec<Described>,
    /// Outputs.
    pub outputs: Vec<Described>,
}

/// A quantity of a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Described {
    /// Its name.
    pub name: String,
    /// Sizes: none for a scalar, one for a vector, two for a matrix.
    pub shape: Vec<usize>,
    /// Its unit as it is declared.
    pub unit: Option<String>,
    /// What the doc comment in front of it says.
    pub doc: Option<String>,
    /// Its value in the experiment, of a state the initial one, entry by entry, a matrix row by row; empty where a run
    /// decides it.
    pub value: Vec<f64>,
    /// The least values that its entries may have; null where nothing bounds them.
    pub low: Vec<f64>,
    /// The largest ones.
    pub high: Vec<f64>,
}

impl Project {
    /// What an experiment is about.
    ///
    /// ```
    /// let project = nsdc::Project::from_text("fall.nsd", "
    ///     model fall {
    ///         /// On Earth.
    ///         param g : m/s^2 in [0, 30] = 9.81;
    ///         state v : m/s = 0; v' = -g;
    ///     }
    ///     simulate short of fall { horizon 1; with { g = 1.6; } }");
    /// let short = project.describe("short").expect("it compiles");
    /// let g = &short.parameters[0];
    /// assert_eq!((g.value[0], g.high[0], g.unit.as_deref()), (1.6, 30.0, Some("m/s^2")));
    /// assert_eq!(g.doc.as_deref(), Some("On Earth."));
    /// ```
    ///
    /// # Errors
    ///
    /// Where there is no such experiment, or it does not compile.
    pub fn describe(&self, experiment: &str) -> Result<Description, Messages> {
        let asked = self.ask(experiment, &[], &[])?;
        let exprs = Exprs::new();
        let (compiled, _) = asked.compiled(&exprs, &self.file, &mut Clock::default())?;
        let (settings, experiment) = (&compiled.settings, &asked.experiment);
        let quantities = &compiled.model.quantities;
        let of = |quantity: &Quantity<'_>| described(quantity, settings, &self.sources);
        let states = quantities.states.iter().chain(&quantities.algebraics);
        let output = |output: &Named<'_>| Described {
            value: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
            name: output.name.clone(),
            shape: output.value.shape.sizes(),
            unit: output.unit.clone(),
            doc: doc(output.span, &self.sources),
        };
        Ok(Description {
            name: experiment.name.name.clone(),
            kind: experiment.kind.word(),
            model: experiment.model.to_string(),
            doc: doc(experiment.span, &self.sources),
            horizon: settings.horizon,
            method: settings.numerics.method.kind().word(),
            parameters: quantities.params.iter().map(of).collect(),
            states: states.map(of).collect(),
            controls: quantities.controls.iter().map(of).collect(),
            inputs: quantities.inputs.iter().map(of).collect(),
            outputs: compiled
                .model
                .definitions
                .outputs
                .iter()
                .map(output)
                .collect(),
        })
    }
}

fn described<'e>(
    quantity: &Quantity<'e>,
    settings: &Settings<'e>,
    sources: &SourceMap,
) -> Described {
    let numbers = &settings.values.numbers;
    let number = |var| numbers.get(&var).copied();
    let value = quantity.vars.iter();
    let value: Option<Vec<f64>> = value.map(|var| number(var.as_variable()?)).collect();
    let eval = |e: crate::expr::Expr<'e>| {
        crate::system::switches::terms::value_on_sides(e, &|var| number(var).unwrap_or(f64::NAN))
    };
    let ranges = (0..quantity.vars.len()).map(|k| match Allowed::of(quantity, k, &eval) {
        Some(Allowed::Between(low, high)) => (low, high),
        Some(Allowed::OneOf(values)) => {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            (
                low,
                values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            )
        }
        None => (f64::NEG_INFINITY, f64::INFINITY),
    });
    let (low, high) = ranges.unzip();
    Described {
        name: quantity.name.clone(),
        shape: quantity.shape.sizes(),
        unit: quantity.unit.clone(),
        doc: doc(quantity.span, sources),
        value: value.unwrap_or_default(),
        low,
        high,
    }
}

/// The doc comment in front of what stands at a place: the lines directly above it that begin with `///`, where nothing else
/// begins in its own line before it.
pub(crate) fn doc(span: Span, sources: &SourceMap) -> Option<String> {
    let file = sources.file(span)?;
    let before = file
        .text
        .get(..(span.start as usize).checked_sub(file.start)?)?;
    let (above, own) = before.rsplit_once('\n')?;
    // Keywords may stand in front of it.
    if own.contains([';', '{', '}']) {
        return None;
    }
    let above = above.lines().rev();
    let lines = above.map_while(|line| line.trim().strip_prefix("///"));
    let mut lines: Vec<&str> = lines.map(str::trim).collect();
    lines.reverse();
    (!lines.is_empty()).then(|| lines.join("\n"))
}
