//! Functions with gradient and Hessian, for problems that are written down by hand.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// The most variables of a problem.
pub const MOST: usize = 16;

/// A value with its first and second derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Jet {
    pub value: f64,
    pub gradient: [f64; MOST],
    pub hessian: [[f64; MOST]; MOST],
}

impl Jet {
    pub fn constant(value: f64) -> Self {
        Jet {
            value,
            gradient: [0.0; MOST],
            hessian: [[0.0; MOST]; MOST],
        }
    }

    pub fn variable(value: f64, i: usize) -> Self {
        let mut jet = Jet::constant(value);
        jet.gradient[i] = 1.0;
        jet
    }

    /// φ(self) by the values of φ, φ', φ''.
    fn chain(self, [value, first, second]: [f64; 3]) -> Self {
        let mut jet = Jet::constant(value);
        for i in 0..MOST {
            jet.gradient[i] = first * self.gradient[i];
            for j in 0..MOST {
                jet.hessian[i][j] =
                    first * self.hessian[i][j] + second * self.gradient[i] * self.gradient[j];
            }
        }
        jet
    }

    pub fn powi(self, n: i32) -> Self {
        let (x, k) = (self.value, f64::from(n));
        let second = if n == 1 {
            0.0
        } else {
            k * (k - 1.0) * x.powi(n - 2)
        };
        self.chain([x.powi(n), k * x.powi(n - 1), second])
    }

    pub fn powf(self, k: f64) -> Self {
        let x = self.value;
        self.chain([
            x.powf(k),
            k * x.powf(k - 1.0),
            k * (k - 1.0) * x.powf(k - 2.0),
        ])
    }

    pub fn sqrt(self) -> Self {
        self.powf(0.5)
    }

    pub fn exp(self) -> Self {
        self.chain([self.value.exp(); 3])
    }

    pub fn ln(self) -> Self {
        let x = self.value;
        self.chain([x.ln(), 1.0 / x, -1.0 / (x * x)])
    }

    pub fn sin(self) -> Self {
        let (sin, cos) = self.value.sin_cos();
        self.chain([sin, cos, -sin])
    }

    pub fn cos(self) -> Self {
        let (sin, cos) = self.value.sin_cos();
        self.chain([cos, -sin, -cos])
    }
}

impl Add for Jet {
    type Output = Jet;
    fn add(mut self, other: Jet) -> Jet {
        self.value += other.value;
        for i in 0..MOST {
            self.gradient[i] += other.gradient[i];
            for j in 0..MOST {
                self.hessian[i][j] += other.hessian[i][j];
            }
        }
        self
    }
}

impl Mul for Jet {
    type Output = Jet;
    fn mul(self, other: Jet) -> Jet {
        let (a, b) = (self, other);
        let mut jet = Jet::constant(a.value * b.value);
        for i in 0..MOST {
            jet.gradient[i] = a.value * b.gradient[i] + b.value * a.gradient[i];
            for j in 0..MOST {
                jet.hessian[i][j] = a.value * b.hessian[i][j]
                    + b.value * a.hessian[i][j]
                    + a.gradient[i] * b.gradient[j]
                    + a.gradient[j] * b.gradient[i];
            }
        }
        jet
    }
}

impl Neg for Jet {
    type Output = Jet;
    fn neg(self) -> Jet {
        self * Jet::constant(-1.0)
    }
}

impl Sub for Jet {
    type Output = Jet;
    fn sub(self, other: Jet) -> Jet {
        self + -other
    }
}

impl Div for Jet {
    type Output = Jet;
    fn div(self, other: Jet) -> Jet {
        self * other.powi(-1)
    }
}

macro_rules! with_numbers {
    ($($operator:ident $method:ident),*) => {$(
        impl $operator<f64> for Jet {
            type Output = Jet;
            fn $method(self, other: f64) -> Jet {
                $operator::$method(self, Jet::constant(other))
            }
        }
        impl $operator<Jet> for f64 {
            type Output = Jet;
            fn $method(self, other: Jet) -> Jet {
                $operator::$method(Jet::constant(self), other)
            }
        }
    )*};
}

with_numbers!(Add add, Sub sub, Mul mul, Div div);
