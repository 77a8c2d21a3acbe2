//! The law of one contact whose slip velocity has two entries.
//!
//! With b and s, the rates of the gap and of slip without the contact, and W = J D,
//!
//! b + W_nn Λ - W_nt β = r_n,   s + W_tn Λ - W_tt β = w,   0 ≤ Λ ⟂ r_n ≥ 0,   |β| ≤ μΛ,   |w| β = μΛ w.
//!
//! For a known bound r = μΛ friction is the solution of a convex problem on a disc: W_tt⁻¹(s + W_tn Λ) where that is
//! short enough, and else (W_tt + ρ)β = s + W_tn Λ, w = ρβ, with the ρ > 0 that makes |β| = r. It falls with ρ, and
//! so Newton's method for 1/|β| finds that (Conn, Gould & Toint 2000, *Trust-region methods*, section 7.3).
//!
//! So r_n is a continuous function of r alone, below zero at r = 0 where b is, and above it for large r: there
//! β is r times the friction e of b = 0 and s = 0 with Λ = 1/μ, and r_n/r is not less than μ times the quadratic form
//! of W for (1/μ, -e) and the work that e takes. So there is a root, for any μ, and it is bracketed.

use super::rows::{ContactRows, Rows};

/// An eigenvalue below this share of the other one is zero, and a velocity that nothing changes below this share of the
/// other one is.
const ROUNDING: f64 = 1e-13;
/// Steps to the ρ and to the r of a contact.
const MOST_SHIFTS: usize = 40;
const MOST_BOUNDS: usize = 80;

/// Up to two numbers, of the entries of a slip velocity; zero where there are less.
pub(crate) type Pair = [f64; 2];

/// W of a contact, in the axes in which W_tt is diagonal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    normal: f64,
    /// W_tn
    cross: Pair,
    /// The diagonal of W_tt, the larger one first.
    values: Pair,
    /// The axis of the first.
    axis: Pair,
}

impl Cone {
    /// W of a contact.
    pub fn of(rows: &Rows, contact: &ContactRows) -> Self {
        let [n, t, u] = [contact.normal, contact.normal + 1, contact.normal + 2];
        let tangential = [rows.diagonal(t), rows.coupling(t, u), rows.diagonal(u)];
        let cross = [rows.coupling(t, n), rows.coupling(u, n)];
        Cone::new(rows.diagonal(n), cross, tangential)
    }

    /// From W_nn, W_tn, and the three different entries of W_tt.
    fn new(normal: f64, cross: Pair, [a, b, c]: [f64; 3]) -> Self {
        let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
        let radius = half.hypot(b);
        let axis = match (radius > 0.0, half >= 0.0) {
            (false, _) => [1.0, 0.0],
            // Of both ways to write it the one without cancellation.
            (true, true) => unit([half + radius, b]),
            (true, false) => unit([b, radius - half]),
        };
        let most = mean + radius;
        let least = match (a * c - b * b) / most {
            least if least > ROUNDING * most => least,
            _ => 0.0,
        };
        let mut cone = Cone {
            normal,
            cross,
            values: [most.max(0.0), least],
            axis,
        };
        cone.cross = cone.turned(cross);
        if least == 0.0 {
            cone.cross[1] = 0.0;
        }
        cone
    }

    /// The largest of the values of W_tt.
    pub fn most(&self) -> f64 {
        self.values[0]
    }

    /// Λ and β, from those that are present and what rates and slip velocities are with them.
    pub fn law(
        &self,
        (normal, beta): (f64, Pair),
        (rate, slip): (f64, Pair),
        friction: f64,
    ) -> (f64, Pair) {
        let (beta, slip) = (self.turned(beta), self.turned(slip));
        let [along, across] = self.cross;
        let b = rate - self.normal * normal + along * beta[0] + across * beta[1];
        if b >= 0.0 {
            return (0.0, [0.0; 2]);
        }
        let free = |k: usize| slip[k] - self.cross[k] * normal + self.values[k] * beta[k];
        let s = [free(0), free(1)];
        let smooth = -b / self.normal;
        if friction == 0.0 || self.most() == 0.0 {
            return (smooth, [0.0; 2]);
        }
        let at = |r: f64| {
            let normal = r / friction;
            let beta = self.friction([s[0] + along * normal, s[1] + across * normal], r);
            let rest = b + self.normal * normal - along * beta[0] - across * beta[1];
            (rest, beta)
        };
        let (r, beta) = match self.cross {
            [0.0, 0.0] => (friction * smooth, at(friction * smooth).1),
            _ => root(-b, friction * smooth, at),
        };
        (r / friction, self.turned_back(beta))
    }

    /// β with |β| ≤ r for a velocity s that slips without it.
    fn friction(&self, s: Pair, r: f64) -> Pair {
        if r <= 0.0 {
            return [0.0; 2];
        }
        let values = self.values;
        let stop = |k: usize| match values[k] {
            0.0 if k == 1 && s[k].abs() <= ROUNDING * s[0].abs() => 0.0,
            value if s[k] != 0.0 => s[k] / value,
            _ => 0.0,
        };
        let stick = [stop(0), stop(1)];
        if stick[0].hypot(stick[1]) <= r {
            return stick;
        }
        // Each entry alone needs as much.
        let least = |k: usize| s[k].abs() / r - values[k];
        let mut shift = least(0).max(least(1)).max(0.0);
        let mut beta = [0.0; 2];
        for _ in 0..MOST_SHIFTS {
            beta = [s[0] / (values[0] + shift), s[1] / (values[1] + shift)];
            let length = beta[0].hypot(beta[1]);
            let slope = beta[0] / length * (beta[0] / (values[0] + shift))
                + beta[1] / length * (beta[1] / (values[1] + shift));
            let next = shift + (length / r - 1.0) * length / slope;
            if next.is_nan() || next <= shift * (1.0 + 2.0 * f64::EPSILON) {
                break;
            }
            shift = next;
        }
        bounded(beta, r)
    }

    fn turned(&self, [x, y]: Pair) -> Pair {
        let [c, s] = self.axis;
        [c * x + s * y, c * y - s * x]
    }

    fn turned_back(&self, [x, y]: Pair) -> Pair {
        let [c, s] = self.axis;
        [c * x - s * y, s * x + c * y]
    }
}

/// The nearest in the disc with this radius.
pub(crate) fn bounded([x, y]: Pair, most: f64) -> Pair {
    if y == 0.0 {
        return [x.clamp(-most, most), 0.0];
    }
    let length = x.hypot(y);
    match length > most {
        true => [x * (most / length), y * (most / length)],
        false => [x, y],
    }
}

/// |x|, without a root where there is one entry.
pub(crate) fn length([x, y]: Pair) -> f64 {
    if y == 0.0 { x.abs() } else { x.hypot(y) }
}

fn unit([x, y]: Pair) -> Pair {
    let length = x.hypot(y);
    [x / length, y / length]
}

/// The root of a function that is -`size` at zero, with what comes with it.
fn root(size: f64, guess: f64, at: impl Fn(f64) -> (f64, Pair)) -> (f64, Pair) {
    let enough = 4.0 * f64::EPSILON * size;
    let (mut low, mut high) = ((0.0, -size), (f64::INFINITY, f64::INFINITY));
    let mut next = guess;
    let mut found = (next, [0.0; 2]);
    for round in 0..MOST_BOUNDS {
        let (value, with) = at(next);
        found = (next, with);
        if value.is_nan() || value.abs() <= enough {
            break;
        }
        // An end that stays counts half, so that it does not stay (Illinois).
        if value < 0.0 {
            if low.0 > 0.0 && high.0.is_finite() {
                high.1 *= 0.5;
            }
            low = (next, value);
        } else {
            if high.0.is_finite() {
                low.1 *= 0.5;
            }
            high = (next, value);
        }
        if high.0.is_infinite() {
            next *= 2.0;
            continue;
        }
        if high.0 - low.0 <= 2.0 * f64::EPSILON * high.0 {
            break;
        }
        let between = low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1);
        let is_inside = between > low.0 && between < high.0;
        next = match is_inside && round % 8 != 7 {
            true => between,
            false => 0.5 * (low.0 + high.0),
        };
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::tests::Numbers;
    use super::*;

    /// Random W = A Aᵀ, with rows that depend on each other in every third, velocities and μ up to 4.
    #[test]
    fn the_law_holds_for_any_mass() {
        let mut numbers = Numbers(7);
        let (mut stuck, mut slipped) = (0, 0);
        for case in 0..3000 {
            let mut a: [[f64; 3]; 3] = Default::default();
            a.iter_mut().flatten().for_each(|a| *a = numbers.next());
            if case % 3 == 0 {
                a[2] = a[1].map(|a| 0.5 * a);
            }
            let w = |i: usize, j: usize| (0..3).map(|k| a[i][k] * a[j][k]).sum::<f64>();
            let cone = Cone::new(w(0, 0), [w(1, 0), w(2, 0)], [w(1, 1), w(1, 2), w(2, 2)]);
            let b = -numbers.next().abs();
            let mut s = [numbers.next(), numbers.next()];
            if case % 6 == 0 {
                s[1] = 0.5 * s[0];
            }
            let friction = 2.0 + 2.0 * numbers.next();
            let (normal, beta) = cone.law((0.0, [0.0; 2]), (b, s), friction);
            let size = 1.0 + normal;
            let rate = b + w(0, 0) * normal - w(0, 1) * beta[0] - w(0, 2) * beta[1];
            let slip =
                |k: usize| s[k - 1] + w(k, 0) * normal - w(k, 1) * beta[0] - w(k, 2) * beta[1];
            let (slip, most) = ([slip(1), slip(2)], friction * normal);
            assert!(normal > 0.0 && rate.abs() <= 1e-12 * size, "{case}: {rate}");
            let (speed, length) = (slip[0].hypot(slip[1]), beta[0].hypot(beta[1]));
            assert!(length <= most * (1.0 + 1e-14), "{case}");
            if speed <= 1e-11 * size {
                stuck += 1;
                continue;
            }
            slipped += 1;
            for k in 0..2 {
                let missing = speed * beta[k] - most * slip[k];
                assert!(missing.abs() <= 1e-11 * size * size, "{case}: {missing}");
            }
            // From the impulses that are right it comes to the same.
            let again = cone.law((normal, beta), (rate, slip), friction);
            assert!((again.0 - normal).abs() <= 1e-10 * size, "{case}");
        }
        assert!(stuck > 300 && slipped > 300, "{stuck}, {slipped}");
    }

    /// With W_tt = diag(4, 1) and ρ = 2 the velocity s = (3 (4 + ρ), 4 (1 + ρ)) has β = (3, 4), of length 5.
    #[test]
    fn slip_turns_towards_the_light_direction() {
        let cone = Cone::new(1.0, [0.0; 2], [4.0, 0.0, 1.0]);
        let (normal, beta) = cone.law((0.0, [0.0; 2]), (-10.0, [18.0, 12.0]), 0.5);
        assert_eq!(normal, 10.0);
        assert!((beta[0] - 3.0).abs() <= 1e-15 && (beta[1] - 4.0).abs() <= 1e-15);
    }
}
