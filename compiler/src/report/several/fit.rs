//! What measurements say of parameters.

use crate::report::forms::json::as_map;

/// A fit.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Fit {
    /// Free parameters and initial values, by their names with index.
    #[serde(serialize_with = "as_map")]
    pub free: Vec<(String, f64)>,
    /// What is known of each.
    pub estimates: Vec<Estimate>,
    /// The covariance of them; none of what the data do not determine, or a bound holds.
    pub covariance: Vec<Vec<Option<f64>>>,
    /// The same with standard deviations of one.
    pub correlation: Vec<Vec<Option<f64>>>,
    /// What changes together, in the order in which the data determine it.
    pub directions: Vec<Direction>,
    /// √Σ r².
    pub residual_norm: f64,
    /// The standard deviation of weighted measurements; none where there are no more of them than parameters.
    pub deviation: Option<f64>,
    /// Measurements less parameters that they determine.
    pub degrees_of_freedom: usize,
    /// How it was looked for.
    #[serde(flatten)]
    pub search: Search,
    /// Measurements.
    pub data: Vec<Measurements>,
}

/// A free parameter or initial value.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// `mu`, `x[1] at 0`
    pub name: String,
    /// What was found.
    pub value: f64,
    /// None where the data do not determine it, or a bound holds it.
    pub standard_error: Option<f64>,
    /// In which it is with a probability of 95 %, as far as the model is linear there.
    pub interval: Option<[f64; 2]>,
    /// Where it is at a bound.
    pub at_bound: Option<Bound>,
    /// Whether the data determine it; none where a bound holds it.
    pub is_determined: Option<bool>,
}

/// A bound of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Bound {
    /// The lower one.
    Lower,
    /// The upper one.
    Upper,
}

/// A direction in the space of parameters that no bound holds.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Direction {
    /// How much residuals change along it where they change by a length of one with each parameter alone.
    pub singular_value: f64,
    /// Relative changes of the parameters along it, a vector of length one: exponents of a product of powers that changes alone.
    #[serde(serialize_with = "as_map")]
    pub combination: Vec<(String, f64)>,
    /// Whether the data determine it.
    pub is_determined: bool,
}

/// How a fit was looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Search {
    /// Steps of the best start.
    pub iterations: usize,
    /// Steps of it that were rejected because their runs failed.
    pub failed_steps: usize,
    /// Runs of all starts.
    pub runs: usize,
    /// The relative offset: how far the parameters are at most from the minimum of the linear model, in units of their
    /// standard errors.
    pub offset: f64,
    /// From how many points it was looked for.
    pub starts: usize,
    /// From how many of them there was no run.
    pub failed_starts: usize,
    /// How many led to the least sum of squares.
    pub best_starts: usize,
}

/// A column of measurements against the run.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Measurements {
    /// What is measured.
    pub quantity: String,
    /// The name of the column.
    pub column: String,
    /// The file.
    pub file: String,
    /// What is given to the run that it is compared with alone, as it is written; none where that is the run of the experiment.
    pub with: Option<String>,
    /// What differences are multiplied by.
    pub weight: f64,
    /// Instants.
    pub time: Vec<f64>,
    /// What was measured.
    pub measured: Vec<f64>,
    /// The run less the measurement, without the weight.
    pub residuals: Vec<f64>,
    /// Rows without a value.
    pub missing: usize,
    /// Rows before the start or behind the horizon.
    pub outside: usize,
}

impl Fit {
    /// Leaves out what holds at a minimum only.
    pub(crate) fn withholds_errors(&mut self) {
        for estimate in &mut self.estimates {
            (estimate.standard_error, estimate.interval) = (None, None);
        }
        for rows in [&mut self.covariance, &mut self.correlation] {
            rows.iter_mut().for_each(|row| row.fill(None));
        }
    }
}

impl Measurements {
    /// ", x = 2": which run is compared.
    pub(crate) fn run(&self) -> String {
        self.with
            .as_ref()
            .map_or_else(String::new, |with| format!(", {with}"))
    }
}

impl Direction {
    /// That the data do not determine it.
    pub(crate) fn not_determined(&self) -> String {
        let names: Vec<String> = (self.combination.iter())
            .map(|(name, _)| format!("`{name}`"))
            .collect();
        match &names[..] {
            [only] => format!("the data do not determine {only}: no measurement changes with it"),
            _ => format!(
                "the data do not determine {}: no measurement changes where they change together as {}",
                names.join(", "),
                self.powers()
            ),
        }
    }

    /// `m^0.58 k^0.58`
    pub fn powers(&self) -> String {
        let powers = self.combination.iter();
        let powers = powers.map(|(name, part)| format!("{name}^{part:.2}"));
        powers.collect::<Vec<_>>().join(" ")
    }
}
