//! Quantiles of many runs.

/// What many runs of an experiment say together.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Ensemble {
    /// How many.
    pub runs: usize,
    /// The seed of the first one; the others follow it.
    pub first_seed: u64,
    /// Seeds of runs that have failed, which the quantiles leave out.
    pub failed_seeds: Vec<u64>,
    /// Shares of the runs below the quantiles, ascending.
    pub levels: [f64; 5],
    /// Instants of the quantiles.
    pub time: Vec<f64>,
    /// One for every entry of states and outputs.
    #[serde(
        rename = "quantiles",
        serialize_with = "crate::report::forms::json::quantiles"
    )]
    pub bands: Vec<Bands>,
}

/// Quantiles of one scalar quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    /// `x[2]`
    pub name: String,
    /// By level, then by instant.
    pub values: Vec<Vec<f64>>,
}

impl Ensemble {
    /// The quantiles of an entry.
    pub fn of(&self, name: &str) -> Option<&Bands> {
        self.bands.iter().find(|bands| bands.name == name)
    }
}
