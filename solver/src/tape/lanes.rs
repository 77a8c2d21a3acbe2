//! Evaluation at several points at once.
//!
//! Every lane has the bits of the scalar evaluation. The functions go through the scalar ones for that reason: the
//! vector functions of `wide` fuse operations where the processor can, and lose all digits of a sine far from zero.

use std::ops::{Add, Div, Mul, Neg, Sub};

use wide::{f64x4, f64x8};

use super::{Elementary, Tape};

/// A number, or several numbers that are computed with at once.
pub trait Lane:
    Copy
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// How many numbers there are.
    const WIDTH: usize;

    /// The same number everywhere.
    fn splat(value: f64) -> Self;
    /// The first [`Self::WIDTH`] numbers of a slice.
    fn load(from: &[f64]) -> Self;
    /// Writes the numbers to the front of a slice.
    fn store(self, to: &mut [f64]);
    /// Applies a scalar function to every number.
    fn map(self, f: impl Fn(f64) -> f64) -> Self;
    /// Applies a scalar function to every pair of numbers.
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self;

    /// The square root.
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    /// An elementary function.
    fn apply(self, f: Elementary) -> Self {
        self.map(f.value())
    }
    /// The sine and the cosine.
    fn sin_cos(self) -> (Self, Self) {
        (self.map(f64::sin), self.map(f64::cos))
    }
    /// The hyperbolic sine and cosine.
    fn sinh_cosh(self) -> (Self, Self) {
        (self.map(f64::sinh), self.map(f64::cosh))
    }
    /// The angle of the point `(x, self)`.
    fn atan2(self, x: Self) -> Self {
        self.zip(x, f64::atan2)
    }
    /// `self ^ power`.
    fn pow(self, power: Self) -> Self {
        self.zip(power, f64::powf)
    }
}

impl Lane for f64 {
    const WIDTH: usize = 1;

    fn splat(value: f64) -> Self {
        value
    }

    fn load(from: &[f64]) -> Self {
        from[0]
    }

    fn store(self, to: &mut [f64]) {
        to[0] = self;
    }

    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        f(self)
    }

    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        f(self, other)
    }
}

macro_rules! lane {
    ($Wide:ident, $width:literal) => {
        impl Lane for $Wide {
            const WIDTH: usize = $width;

            fn splat(value: f64) -> Self {
                Self::splat(value)
            }

            fn load(from: &[f64]) -> Self {
                let mut numbers = [0.0; $width];
                numbers.copy_from_slice(&from[..$width]);
                Self::from(numbers)
            }

            fn store(self, to: &mut [f64]) {
                to[..$width].copy_from_slice(&self.to_array());
            }

            fn map(self, f: impl Fn(f64) -> f64) -> Self {
                Self::from(self.to_array().map(f))
            }

            fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
                let (a, b) = (self.to_array(), other.to_array());
                Self::from(std::array::from_fn(|i| f(a[i], b[i])))
            }

            fn sqrt(self) -> Self {
                Self::sqrt(self)
            }
        }
    };
}

lane!(f64x4, 4);
lane!(f64x8, 8);

/// Memory for [`Tape::eval_many`].
#[derive(Clone, Debug)]
pub struct LaneScratch {
    inputs: Vec<f64x8>,
    outputs: Vec<f64x8>,
    registers: Vec<f64x8>,
    /// For points that would leave most of a lane empty.
    single: Vec<f64>,
}

impl Tape {
    /// Memory for [`Tape::eval_many`].
    pub fn lane_scratch(&self) -> LaneScratch {
        let zeros = |n| vec![f64x8::splat(0.0); n];
        LaneScratch {
            inputs: zeros(self.n_inputs()),
            outputs: zeros(self.n_outputs()),
            registers: zeros(self.n_registers()),
            single: vec![0.0; self.n_registers()],
        }
    }

    /// Evaluates at `n_points` points, eight at a time, without allocation.
    ///
    /// Input `i` of point `p` is `inputs[i * n_points + p]`; outputs are laid out in the same way.
    pub fn eval_many(
        &self,
        inputs: &[f64],
        outputs: &mut [f64],
        n_points: usize,
        scratch: &mut LaneScratch,
    ) {
        const WIDTH: usize = f64x8::WIDTH;
        /// As many points cost less one by one than together.
        const FEW: usize = 2;
        assert_eq!(
            inputs.len(),
            self.n_inputs() * n_points,
            "one number per input and point"
        );
        assert_eq!(
            outputs.len(),
            self.n_outputs() * n_points,
            "one place per output and point"
        );
        for start in (0..n_points).step_by(WIDTH) {
            // The last group is filled up with its first point.
            let n = WIDTH.min(n_points - start);
            if n <= FEW {
                (start..n_points).for_each(|point| {
                    self.eval_point(inputs, outputs, (point, n_points), &mut scratch.single);
                });
                return;
            }
            for (lane, row) in scratch.inputs.iter_mut().zip(inputs.chunks_exact(n_points)) {
                let mut numbers = [row[start]; WIDTH];
                numbers[..n].copy_from_slice(&row[start..start + n]);
                *lane = f64x8::from(numbers);
            }
            self.eval_lanes(
                &scratch.inputs,
                &mut scratch.outputs,
                &mut scratch.registers,
            );
            for (lane, row) in scratch
                .outputs
                .iter()
                .zip(outputs.chunks_exact_mut(n_points))
            {
                row[start..start + n].copy_from_slice(&lane.to_array()[..n]);
            }
        }
    }

    /// Evaluates at one of several points.
    fn eval_point(
        &self,
        inputs: &[f64],
        outputs: &mut [f64],
        (point, n_points): (usize, usize),
        registers: &mut [f64],
    ) {
        for (register, row) in registers.iter_mut().zip(inputs.chunks_exact(n_points)) {
            *register = row[point];
        }
        self.run(registers);
        let results = self.results(registers);
        for (row, value) in outputs.chunks_exact_mut(n_points).zip(results) {
            row[point] = value;
        }
    }
}
