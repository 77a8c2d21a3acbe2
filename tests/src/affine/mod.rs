//! Random piecewise affine systems, as text and with their solution by matrix exponentials.
//!
//! x' = F z + Σ_i s_i J_i z,   s_i ∈ sign(ψ_i),   ψ_i = c_i z,   z = (x, 1, t)
//!
//! The fields add, so that on surfaces K Filippov's convex combination is one number s_i ∈ [-1, 1]
//! for each i ∈ K. A jump J_i z = d_i + g_i ψ_i is constant on its own surface: then s_K is
//! affine in z, and every mode of sliding is as linear in z as the others.

pub mod exact;
mod generate;
mod text;

use nalgebra::{DMatrix, DVector};

/// How a surface meets the field.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// J z = d + g ψ: may slide.
    Jump,
    /// J z = g ψ: continuous, never slides.
    Kink,
    /// Any J: sliding on it would not be affine.
    Cross,
}

/// One surface, with what its sign adds to the field.
#[derive(Clone, Debug)]
pub struct Surface {
    /// c in ψ = c z, n + 2 numbers.
    pub normal: DVector<f64>,
    /// J, n by n + 2.
    pub jump: DMatrix<f64>,
    /// What J is.
    pub kind: Kind,
}

/// How a system is written down.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Form {
    /// One region for each combination of sides, where all of them occur.
    Regions,
    /// `sign(psi)`, `step(psi)`, `abs(psi)` and `if` in one equation.
    Terms,
    /// The first surface as a partition of two regions, the others as terms and adding regions.
    Mixed,
}

/// A system, its start and how far it goes.
#[derive(Clone, Debug)]
pub struct Affine {
    /// Number of states.
    pub n: usize,
    /// F, n by n + 2.
    pub field: DMatrix<f64>,
    /// The surfaces.
    pub surfaces: Vec<Surface>,
    /// x at t = 0.
    pub start: DVector<f64>,
    /// Last instant.
    pub horizon: f64,
    /// How it is written down.
    pub form: Form,
}

impl Affine {
    /// The same system with each state and time in another unit: x_i becomes S_i x_i, t becomes T t.
    pub fn in_units(&self, states: &[f64], time: f64) -> Self {
        let n = self.n;
        // z in the old units is this times z in the new ones.
        let units = states
            .iter()
            .map(|state| 1.0 / state)
            .chain([1.0, 1.0 / time]);
        let units = DMatrix::from_diagonal(&DVector::from_iterator(n + 2, units));
        let rates = DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| states[i] / time));
        let surface = |surface: &Surface| Surface {
            normal: &units * &surface.normal,
            jump: &rates * &surface.jump * &units,
            kind: surface.kind,
        };
        Affine {
            field: &rates * &self.field * &units,
            surfaces: self.surfaces.iter().map(surface).collect(),
            start: DVector::from_fn(n, |i, _| states[i] * self.start[i]),
            horizon: time * self.horizon,
            ..self.clone()
        }
    }
}

impl Surface {
    /// An entry of J z at a z on the surface: d of J z = d + g ψ, which is the same at all of them.
    fn jump_on_it(&self, row: usize, z: &DVector<f64>) -> f64 {
        match self.kind {
            Kind::Kink => 0.0,
            Kind::Cross => self.jump.row(row).transpose().dot(z),
            Kind::Jump => {
                let n = self.jump.nrows();
                let column = self.normal.rows(0, n).iamax();
                let slope = self.jump[(row, column)] / self.normal[column];
                self.jump[(row, n)] - slope * self.normal[n]
            }
        }
    }
}
