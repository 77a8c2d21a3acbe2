//! Numbers that carry their first and second derivatives with respect to a, b and σ.

use std::ops::{Add, Mul, Neg, Sub};

/// A value with its gradient and the lower triangle of its Hessian: aa, ba, bb, σa, σb, σσ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// Derivatives by a, b, σ.
    pub gradient: [f64; 3],
    /// Second derivatives, row by row.
    pub hessian: [f64; 6],
}

/// The two variables of every entry of the Hessian.
pub const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

impl Dual {
    /// A constant.
    pub fn constant(value: f64) -> Self {
        Dual {
            value,
            gradient: [0.0; 3],
            hessian: [0.0; 6],
        }
    }

    /// The variable number `index` of a, b, σ.
    pub fn variable(index: usize, value: f64) -> Self {
        let mut variable = Self::constant(value);
        variable.gradient[index] = 1.0;
        variable
    }

    /// A function of this number, given its value and its first two derivatives there.
    pub fn chain(self, value: f64, first: f64, second: f64) -> Self {
        let mut result = Self::constant(value);
        result.gradient = self.gradient.map(|g| first * g);
        for (entry, (i, j)) in ENTRIES.into_iter().enumerate() {
            let product = self.gradient[i] * self.gradient[j];
            result.hessian[entry] = first * self.hessian[entry] + second * product;
        }
        result
    }

    /// The square root; its derivatives at zero are taken as zero.
    pub fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        if root == 0.0 {
            return Self::constant(0.0);
        }
        self.chain(root, 0.5 / root, -0.25 / (root * self.value))
    }

    /// The square.
    pub fn square(self) -> Self {
        self.chain(self.value * self.value, 2.0 * self.value, 2.0)
    }

    /// The reciprocal.
    pub fn recip(self) -> Self {
        let r = 1.0 / self.value;
        self.chain(r, -r * r, 2.0 * r * r * r)
    }

    /// The sine.
    pub fn sin(self) -> Self {
        let (sin, cos) = self.value.sin_cos();
        self.chain(sin, cos, -sin)
    }

    /// The absolute value; a zero counts as positive.
    pub fn abs(self) -> Self {
        if self.value < 0.0 { -self } else { self }
    }
}

impl Add for Dual {
    type Output = Dual;

    fn add(self, other: Dual) -> Dual {
        let mut sum = Dual::constant(self.value + other.value);
        for i in 0..3 {
            sum.gradient[i] = self.gradient[i] + other.gradient[i];
        }
        for i in 0..6 {
            sum.hessian[i] = self.hessian[i] + other.hessian[i];
        }
        sum
    }
}

impl Mul for Dual {
    type Output = Dual;

    fn mul(self, other: Dual) -> Dual {
        let mut product = Dual::constant(self.value * other.value);
        for i in 0..3 {
            product.gradient[i] = self.gradient[i] * other.value + self.value * other.gradient[i];
        }
        for (entry, (i, j)) in ENTRIES.into_iter().enumerate() {
            product.hessian[entry] = self.hessian[entry] * other.value
                + self.value * other.hessian[entry]
                + self.gradient[i] * other.gradient[j]
                + self.gradient[j] * other.gradient[i];
        }
        product
    }
}

impl Mul<Dual> for f64 {
    type Output = Dual;

    fn mul(self, dual: Dual) -> Dual {
        Dual {
            value: self * dual.value,
            gradient: dual.gradient.map(|g| self * g),
            hessian: dual.hessian.map(|h| self * h),
        }
    }
}

impl Neg for Dual {
    type Output = Dual;

    fn neg(self) -> Dual {
        -1.0 * self
    }
}

impl Sub for Dual {
    type Output = Dual;

    fn sub(self, other: Dual) -> Dual {
        self + -other
    }
}
