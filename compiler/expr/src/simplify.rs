//! The canonical form: constructors that fold as they build.
//!
//! - A sum is `constant + Σ coefficient * term`, its terms in order of their numbers.
//! - A product is `Π factor ^ power` with integer powers; a numeric factor is the coefficient of a one-term sum.
//! - A number times a sum is distributed; a product of sums is not expanded.
//! - Numbers that would lose digits in their sum stay apart, as terms and as coefficients of one term: 1e9 + 0.3 α - 1e9 α is
//!   0.3 where α is 1.
//! - `x - x` is 0, `0*x` is 0, `x/x` is 1: the value is kept wherever the original has one.
//! - Folding never makes an infinity, a NaN or a zero out of nonzero numbers: `1/0` stays as it is written.

use nsd_solver::tape::{absorbs, is_moderate};

use super::arena::Arena;
use super::nodes::{Data, Id};
use super::{BinaryFunction, Function};

/// Powers of products up to this one are products of powers: no number of common size overflows in them.
const DISTRIBUTED: i32 = 8;

/// Longer sums and products are opaque to the larger ones around them.
/// Without a limit, adding term by term would cost quadratic memory.
const FLATTEN_LIMIT: u32 = 128;

/// `result` if it has neither overflowed nor vanished on the way from `operand`.
fn as_good(result: f64, operand: f64) -> Option<f64> {
    (result.is_finite() && (result != 0.0 || operand == 0.0)).then_some(result)
}

/// A number of at most 12 digits that differs by no more than the rounding of `size`, else the value itself.
pub(super) fn nearby_decimal(value: f64, size: f64) -> f64 {
    let short = format!("{value:.11e}").parse().unwrap_or(value);
    let near: f64 = value - short;
    if near.abs() <= 2.0 * f64::EPSILON * size.abs() {
        short
    } else {
        value
    }
}

/// Constants of a sum, of which none takes the digits of another: beside 1e20, 1 stays by itself, since a term that comes to
/// -1e20 leaves it.
#[derive(Default)]
struct Constants(Vec<f64>);

impl Constants {
    /// Adds one; false where the sum with another would be no number.
    fn add(&mut self, value: f64) -> bool {
        if let Some(opposite) = self.0.iter().position(|&known| known == -value) {
            self.0.swap_remove(opposite);
            return true;
        }
        let sums = self.0.iter().enumerate();
        let mut sums = sums.filter_map(|(at, &known)| Some((at, add_constants(known, value)?)));
        let (found, sum) = match sums.next() {
            Some(found) => found,
            None => {
                let overflows = self.0.iter().any(|known| !(known + value).is_finite());
                if value != 0.0 && !overflows {
                    self.0.push(value);
                }
                return !overflows;
            }
        };
        self.0.swap_remove(found);
        self.add(sum)
    }
}

impl Constants {
    /// Them, in order of their sizes.
    fn sorted(mut self) -> Vec<f64> {
        let size = |a: &f64, b: &f64| a.abs().total_cmp(&b.abs()).then(a.total_cmp(b));
        self.0.sort_by(size);
        self.0
    }
}

/// Adds up coefficients of one term, in a list in order of terms, as far as they keep their digits: beside a coefficient of
/// 1e9, one of 0.3 stays by itself, since the term may be an α whose other part comes to -1e9.
fn gather(flat: &mut Vec<(Id, f64)>) {
    let (mut from, mut to) = (0, 0);
    while from < flat.len() {
        let id = flat[from].0;
        let count = flat[from..].iter().take_while(|term| term.0 == id).count();
        if count == 1 {
            flat[to] = flat[from];
            to += 1;
        } else {
            let mut sums = Constants::default();
            for at in from..from + count {
                // What would be no number stays by itself.
                if !sums.add(flat[at].1) {
                    flat[to] = flat[at];
                    to += 1;
                }
            }
            for sum in sums.sorted() {
                flat[to] = (id, sum);
                to += 1;
            }
        }
        from += count;
    }
    flat.truncate(to);
    flat.retain(|&(_, coefficient)| coefficient != 0.0);
}

/// The sum of two constants, where both keep their digits in it.
fn add_constants(a: f64, b: f64) -> Option<f64> {
    let total = add(a, b);
    (total.is_finite() && !absorbs(a, b, total)).then_some(total)
}

/// The sum as it is in decimals: 2 - 1.8 is 0.2.
fn add(a: f64, b: f64) -> f64 {
    let total = a + b;
    if total.fract() == 0.0 || a == 0.0 || b == 0.0 || !total.is_finite() {
        total
    } else {
        nearby_decimal(total, a.abs().max(b.abs()))
    }
}

fn multiply(a: f64, b: f64) -> Option<f64> {
    as_good(a * b, if b == 0.0 { b } else { a })
}

impl Arena {
    /// `constant + Σ coefficient * term`, canonical.
    pub fn sum(&mut self, constant: f64, terms: impl IntoIterator<Item = (Id, f64)>) -> Id {
        let mut constants = Constants::default();
        constants.add(constant);
        let mut flat = Vec::new();
        for (id, coefficient) in terms {
            self.add_term(&mut constants, &mut flat, id, coefficient);
        }
        let mut constants = constants.sorted().into_iter();
        let constant = constants.next().unwrap_or(0.0);
        for apart in constants {
            let apart = self.constant(apart);
            flat.push((apart, 1.0));
        }
        flat.sort_by_key(|&(id, _)| id);
        gather(&mut flat);
        match flat[..] {
            [] => self.constant(constant),
            [(id, coefficient)] if constant == 0.0 => self.scale(id, coefficient),
            _ => self.canonical_sum(constant, &flat),
        }
    }

    fn add_term(
        &self,
        constants: &mut Constants,
        flat: &mut Vec<(Id, f64)>,
        id: Id,
        coefficient: f64,
    ) {
        if coefficient == 0.0 {
            return;
        }
        match self.nodes.data(id) {
            Data::Constant(value) => {
                let term = multiply(coefficient, value);
                if term.is_some_and(|term| constants.add(term)) {
                    return;
                }
            }
            Data::Sum {
                constant: inner,
                start,
                len,
            } if len <= FLATTEN_LIMIT => {
                let inner = multiply(coefficient, inner);
                let terms = self.nodes.terms(start, len).iter();
                let scaled = terms.map(|&(term, c)| Some((term, multiply(coefficient, c)?)));
                let scaled: Option<Vec<(Id, f64)>> = scaled.collect();
                if let (Some(inner), Some(scaled)) = (inner, scaled)
                    && constants.add(inner)
                {
                    for (term, c) in scaled {
                        match self.nodes.data(term) {
                            Data::Constant(_) => self.add_term(constants, flat, term, c),
                            _ => flat.push((term, c)),
                        }
                    }
                    return;
                }
            }
            _ => {}
        }
        flat.push((id, coefficient));
    }

    /// `factor * id`; a sum is distributed over.
    pub fn scale(&mut self, id: Id, factor: f64) -> Id {
        if factor == 1.0 {
            return id;
        }
        if factor == 0.0 {
            return self.constant(0.0);
        }
        match self.nodes.data(id) {
            Data::Constant(value) => {
                if let Some(product) = multiply(factor, value) {
                    return self.constant(product);
                }
            }
            Data::Sum {
                constant,
                start,
                len,
            } => {
                let constant = multiply(factor, constant);
                let terms: Vec<_> = (self.nodes.terms(start, len).iter())
                    .map_while(|&(term, c)| multiply(factor, c).map(|product| (term, product)))
                    .collect();
                if let Some(constant) = constant
                    && terms.len() == len as usize
                {
                    return match terms[..] {
                        [(term, 1.0)] if constant == 0.0 => term,
                        _ => self.canonical_sum(constant, &terms),
                    };
                }
            }
            _ => {}
        }
        self.canonical_sum(0.0, &[(id, factor)])
    }

    /// A sum divided by a number, `None` if a coefficient would overflow or vanish.
    pub fn divide(&mut self, id: Id, number: f64) -> Option<Id> {
        self.map_coefficients(id, |c| as_good(c / number, c))
    }

    /// [`Self::divide`], where a quotient within rounding of a short decimal number is that number: `3*x - 3*0.1`
    /// by 3 is `x - 0.1`, although `3*0.1/3` is not the number nearest to 0.1.
    pub fn divide_to_decimals(&mut self, id: Id, number: f64) -> Option<Id> {
        self.map_coefficients(id, |c| {
            let quotient = c / number;
            as_good(nearby_decimal(quotient, quotient), c)
        })
    }

    fn map_coefficients(&mut self, id: Id, f: impl Fn(f64) -> Option<f64>) -> Option<Id> {
        let Data::Sum {
            constant,
            start,
            len,
        } = self.nodes.data(id)
        else {
            return None;
        };
        let constant = f(constant)?;
        let terms = self.nodes.terms(start, len).iter();
        let terms = terms.map(|&(term, c)| Some((term, f(c)?)));
        let terms = terms.collect::<Option<Vec<_>>>()?;
        Some(match terms[..] {
            [(term, 1.0)] if constant == 0.0 => term,
            _ => self.canonical_sum(constant, &terms),
        })
    }

    /// `a / b`; numbers divide coefficients, so that `2*x/3` has the number nearest to 2/3.
    pub fn quotient(&mut self, a: Id, b: Id) -> Id {
        if let Data::Constant(number) = self.nodes.data(b) {
            if let Some(quotient) = self.divide(a, number) {
                return quotient;
            }
            if let Data::Constant(value) = self.nodes.data(a)
                && let Some(quotient) = as_good(value / number, value)
            {
                return self.constant(quotient);
            }
        }
        self.product(1.0, [(a, 1), (b, -1)])
    }

    /// `coefficient * Π factor ^ power`, canonical.
    pub fn product(
        &mut self,
        coefficient: f64,
        factors: impl IntoIterator<Item = (Id, i32)>,
    ) -> Id {
        let mut coefficient = coefficient;
        let mut flat = Vec::new();
        let mut apart = None;
        for (id, power) in factors {
            if power == 1 && apart.is_none() && self.nodes.numbers_of(id).is_some() {
                apart = self.nodes.numbers_of(id).map(Iterator::collect::<Vec<f64>>);
            } else {
                self.multiply_factor(&mut coefficient, &mut flat, id, power);
            }
        }
        let product = self.multiplied(coefficient, flat);
        match apart {
            // A sum of numbers that keep their digits is distributed over.
            Some(numbers) => self.sum(0.0, numbers.into_iter().map(|number| (product, number))),
            None => product,
        }
    }

    /// `coefficient * Π factor ^ power` of factors in any order.
    fn multiplied(&mut self, coefficient: f64, mut flat: Vec<(Id, i32)>) -> Id {
        if coefficient == 0.0 {
            return self.constant(0.0);
        }
        flat.sort_by_key(|&(id, _)| id);
        flat.dedup_by(|next, kept| {
            let total = kept.1.checked_add(next.1).filter(|_| kept.0 == next.0);
            if let Some(total) = total {
                kept.1 = total;
            }
            total.is_some()
        });
        flat.retain(|&(_, power)| power != 0);
        match flat[..] {
            [] => self.constant(coefficient),
            [(id, 1)] => self.scale(id, coefficient),
            _ => {
                let product = self.canonical_product(&flat);
                self.scale(product, coefficient)
            }
        }
    }

    fn multiply_factor(
        &self,
        coefficient: &mut f64,
        flat: &mut Vec<(Id, i32)>,
        id: Id,
        power: i32,
    ) {
        if power == 0 {
            return;
        }
        // The number in front of a one-term sum joins the coefficient.
        let whole = id;
        let (number, id) = match self.nodes.data(id) {
            _ if self.nodes.number(id).is_some() => (self.nodes.number(id).unwrap_or(0.0), None),
            Data::Sum {
                constant: 0.0,
                start,
                len: 1,
            } => {
                let (term, c) = self.nodes.terms(start, 1)[0];
                (c, Some(term))
            }
            _ => (1.0, Some(id)),
        };
        let folded = fold_power(number, power)
            .filter(|value| id.is_none() || power.abs() == 1 || is_moderate(*value))
            .and_then(|value| multiply(*coefficient, value));
        let Some(folded) = folded else {
            return flat.push((whole, power));
        };
        *coefficient = folded;
        let Some(id) = id else { return };
        if let Data::Product { start, len } = self.nodes.data(id)
            && len <= FLATTEN_LIMIT
            && (len == 1 || power.abs() <= DISTRIBUTED)
        {
            let kept = flat.len();
            let scaled = (self.nodes.factors(start, len).iter())
                .map_while(|&(factor, p)| p.checked_mul(power).map(|p| (factor, p)));
            flat.extend(scaled);
            if flat.len() - kept == len as usize {
                return;
            }
            flat.truncate(kept);
        }
        // √s² = s for all values of the variables, where s cannot be negative; derivatives of s have no 0/0.
        if let Data::Unary(Function::Sqrt, square) = self.nodes.data(id)
            && power > 0
            && power % 2 == 0
            && self.nodes.is_sum_of_squares(square)
        {
            return self.multiply_factor(coefficient, flat, square, power / 2);
        }
        flat.push((id, power));
    }

    /// `function(a)`, folded if the value is a finite number.
    pub fn apply(&mut self, function: Function, a: Id) -> Id {
        if let Some(value) = self.nodes.number(a) {
            let value = function.value(value);
            if value.is_finite() {
                return self.constant(value);
            }
        }
        self.unary(function, a)
    }

    /// `function(a, b)`, folded if the value is a finite number.
    pub fn apply_binary(&mut self, function: BinaryFunction, a: Id, b: Id) -> Id {
        if let (Some(x), Some(y)) = (self.nodes.number(a), self.nodes.number(b)) {
            let value = function.value(x, y);
            if value.is_finite() {
                return self.constant(value);
            }
        }
        match (function, self.nodes.number(b)) {
            (BinaryFunction::Pow, Some(power)) if is_power(power) => {
                self.product(1.0, [(a, power as i32)])
            }
            (BinaryFunction::Min | BinaryFunction::Max, _) if a == b => a,
            _ => self.binary(function, a, b),
        }
    }
}

/// Whether `power` is an integer that a product can hold.
fn is_power(power: f64) -> bool {
    power.fract() == 0.0 && power.abs() <= f64::from(i32::MAX)
}

fn fold_power(number: f64, power: i32) -> Option<f64> {
    as_good(number.powi(power), number)
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::super::{Expr, Exprs, Substitution};

    #[test]
    fn sums_and_products_fold() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        assert!((x - x).is_zero());
        assert!((0.0 * x).is_zero());
        assert_eq!(x / x, e.constant(1.0));
        assert_eq!(x + y - 2.0 * x, y - x);
        assert_eq!(x * y * x, y * x.powi(2));
        assert_eq!((x * y).powi(-2) * y, 1.0 / (x * x * y));
        assert_eq!(3.0 * (x + 2.0), 3.0 * x + 6.0);
        assert_eq!((2.0 * x) * (3.0 * y), 6.0 * (x * y));
        assert_eq!(x.powf(e.constant(2.0)), x * x);
        assert_eq!(e.constant(-0.0), e.constant(0.0));
    }

    #[test]
    fn constants_keep_their_digits_in_sums() {
        let e = Exprs::new();
        let (x, a) = (e.variable("x"), e.variable("a"));
        let either = a * x + (1.0 - a) * 1e20;
        let one = e.constant(1.0);
        for (value, right) in [(one, x + 1.0), (e.constant(0.0), 1e20 + one)] {
            let there = a.as_variable().unwrap();
            let there = (either + 1.0).substitute(&[(there, value)].into_iter().collect());
            assert_eq!(there, right);
        }
        assert_eq!((x + 1e20) + 1.0 - 1e20, x + 1.0);
        // Coefficients, too, those that are sums of numbers among them.
        let limit = e.variable("L");
        let number = |of: Expr, value| -> Substitution {
            let var = of.as_variable().unwrap();
            [(var, e.constant(value))].into_iter().collect()
        };
        let with_number = 0.3 * a + (1.0 - a) * 1e9;
        let with_name = (0.3 - limit) * a + limit;
        for either in [with_number, with_name.substitute(&number(limit, 1e9))] {
            assert_eq!(either.substitute(&number(a, 1.0)), e.constant(0.3));
            assert_eq!(either.substitute(&number(a, 0.0)), e.constant(1e9));
            let slope = either.diff(a.as_variable().unwrap());
            assert_eq!(slope.as_constant(), Some(-999_999_999.7));
            assert_eq!(either - 0.3 * a + 1e9 * a, e.constant(1e9));
            assert_eq!(either.to_string(), "0.3*a - 1000000000*a + 1000000000");
        }
        let both = (0.3 - limit) * (a + x);
        assert_eq!(
            both.substitute(&number(limit, 1e9)) + 1e9 * (a + x),
            0.3 * (a + x)
        );
        assert_eq!(
            (0.3 - limit)
                .substitute(&number(limit, 1e9))
                .sin()
                .as_constant(),
            Some((-999_999_999.7_f64).sin())
        );
        assert_eq!(x - 1.5 + 1e300 - 1e300, x - 1.5);
        assert_eq!(3.0 * (x - 1.5 + 1e20) - 3e20, 3.0 * x - 4.5);
        assert_eq!((e.constant(1e9) - 0.3).as_constant(), Some(999_999_999.7));
        assert_eq!((e.constant(1e20) + 1.0).as_constant(), Some(1e20));
    }

    #[test]
    fn products_of_sums_stay() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        assert_snapshot!((x + 1.0) * (y - 1.0) * (x + 1.0), @"(x + 1)^2*(y - 1)");
        assert_snapshot!(x.sqrt().powi(2) - x.exp().log(), @"sqrt(x)^2 - log(exp(x))");
        assert_snapshot!(x.powf(e.constant(0.5)).powi(2), @"(x^0.5)^2");
    }

    /// √(x² + y²) has no derivative at the origin, its square has.
    #[test]
    fn squares_of_norms_are_sums_of_squares() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        let norm = (x.powi(2) + 3.0 * y.powi(4) + 1.0).sqrt();
        assert_eq!(norm.powi(2), x.powi(2) + 3.0 * y.powi(4) + 1.0);
        assert_eq!(norm.powi(4), (x.powi(2) + 3.0 * y.powi(4) + 1.0).powi(2));
        assert_eq!((2.0 * x.powi(2).sqrt()).powi(2), 4.0 * x.powi(2));
        // What may be negative has no root there.
        for square in [
            x,
            x.powi(3),
            x.powi(2) - y.powi(2),
            x.powi(2) - 1.0,
            x.powi(2) + y,
        ] {
            assert_ne!(square.sqrt().powi(2), square);
        }
    }

    #[test]
    fn folding_makes_no_infinity_and_no_nan() {
        let e = Exprs::new();
        let x = e.variable("x");
        let constant = |value| e.constant(value);
        assert_snapshot!(1.0 / constant(0.0), @"1/0");
        assert_snapshot!(x / 0.0, @"x/0");
        assert_snapshot!(constant(0.0).log() + constant(2.0).asin(), @"log(0) + asin(2)");
        assert_snapshot!(constant(1e200) * constant(1e200), @"1e200*1e200");
        assert_snapshot!(constant(1e308) + constant(1e308), @"1e308 + 1e308");
        assert_snapshot!((1e200 * x) * (1e200 * x), @"1e200*x*(1e200*x)");
        assert_snapshot!((1e-200 * x).powi(2), @"(1e-200*x)^2");
        assert_snapshot!(1e200 * (1e200 * x + 1.0), @"1e200*(1e200*x + 1)");
    }

    /// 5000^-100 is no number, and neither is x^100 where x is 5000.
    #[test]
    fn powers_of_quotients_are_powers() {
        let e = Exprs::new();
        let (x, k) = (e.variable("x"), e.variable("k"));
        assert_snapshot!((x / 5000.0).powi(100), @"(0.0002*x)^100");
        assert_snapshot!((x / k).powi(60) / (x / k).powi(20), @"(x/k)^40");
        assert_snapshot!((x / k).powi(-60), @"1/(x/k)^60");
        assert_snapshot!((x / 2.0).powi(4) + (x / k).powi(8), @"0.0625*x^4 + x^8/k^8");
        for (value, power) in [(4900.0, 100), (5100.0, 88), (2.0, 12)] {
            let whole = (x / 5000.0).powi(power) + (x / k).powi(power);
            let value = |var| {
                if Some(var) == k.as_variable() {
                    5000.0
                } else {
                    value
                }
            };
            let right = 2.0 * (value(x.as_variable().unwrap()) / 5000.0_f64).powi(power);
            assert!((whole.eval(&value) / right - 1.0).abs() < 1e-12, "{power}");
        }
    }

    #[test]
    fn equal_and_opposite_switching_functions_have_one_normal_form() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        let split = |expr: Expr| {
            let (scale, normal) = expr.split_scale();
            format!("{scale} * ({normal})")
        };
        assert_snapshot!(split(2.0 - x), @"-1 * (x - 2)");
        assert_snapshot!(split(3.0 * x - 6.0), @"3 * (x - 2)");
        assert_snapshot!(split((1.0 - x) * (2.0 * y - 4.0)), @"-2 * ((x - 1)*(y - 2))");
        assert_eq!(
            (0.7 * (x - 0.1 * y) + 0.21).split_scale().1,
            x - 0.1 * y + 0.3
        );
        assert_snapshot!(split(-x.sin()), @"-1 * (sin(x))");
        assert_snapshot!(split(e.constant(-2.0)), @"-2 * (1)");
        assert_snapshot!(split(e.constant(0.0)), @"1 * (0)");
    }
}
