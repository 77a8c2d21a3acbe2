//! Conditions that define the methods, and closed forms of the smallest.

use proptest::prelude::*;

use super::*;

/// All methods.
fn all() -> impl Iterator<Item = Tableau> {
    let method = |family: Family| move |s| Tableau::new(family, s).unwrap();
    let families = Family::ALL.into_iter();
    families.flat_map(move |family| family.nodes().map(method(family)))
}

/// B(p), C(q) and D(r) hold for p = order, q and r (Hairer & Wanner 1996, section IV.5).
fn assumptions(family: Family, s: usize) -> [usize; 3] {
    match family {
        Family::RadauIia => [2 * s - 1, s, s - 1],
        Family::RadauIa => [2 * s - 1, s - 1, s],
        Family::GaussLegendre => [2 * s, s, s],
        Family::LobattoIiia => [2 * s - 2, s, s - 2],
        Family::LobattoIiic => [2 * s - 2, s - 1, s - 1],
        Family::Explicit => [s, 1, usize::from(s > 1)],
    }
}

/// The residuals of B(p), C(q) and D(r), in numbers of this type.
macro_rules! residuals {
    ($number:ty, $c:expr, $a:expr, $b:expr, $assumptions:expr) => {{
        let (c, a, b, [p, q, r]): (&[$number], &[$number], &[$number], _) =
            ($c, $a, $b, $assumptions);
        let s = c.len();
        let one = <$number>::from(1.0);
        let number = |k: usize| <$number>::from(k as f64);
        let power = |c: $number, k: usize| (0..k).fold(one, |product, _| product * c);
        let mut residuals = Vec::new();
        for k in 1..=p {
            let sum: $number = (0..s).map(|i| b[i] * power(c[i], k - 1)).sum();
            residuals.push(sum - one / number(k));
        }
        for (k, i) in (1..=q).flat_map(|k| (0..s).map(move |i| (k, i))) {
            let sum: $number = (0..s).map(|j| a[i * s + j] * power(c[j], k - 1)).sum();
            residuals.push(sum - power(c[i], k) / number(k));
        }
        for (k, j) in (1..=r).flat_map(|k| (0..s).map(move |j| (k, j))) {
            let terms = (0..s).map(|i| b[i] * power(c[i], k - 1) * a[i * s + j]);
            let sum: $number = terms.sum();
            residuals.push(sum - b[j] * (one - power(c[j], k)) / number(k));
        }
        residuals
    }};
}

fn largest(residuals: impl IntoIterator<Item = f64>) -> f64 {
    let sizes = residuals.into_iter().map(f64::abs);
    sizes.fold(
        0.0,
        |largest, size| if size <= largest { largest } else { size },
    )
}

#[test]
fn the_simplifying_assumptions_hold() {
    for method in all() {
        let (c, a, b) = (&method.nodes, &method.a, &method.weights);
        let assumptions = assumptions(method.family, method.n_nodes());
        assert_eq!(assumptions[0], method.order);
        let residual = largest(residuals!(f64, c, a, b, assumptions));
        assert!(residual < 2e-15, "{method:?}: {residual:e}");
    }
}

#[test]
fn extended_numbers_have_twice_the_digits() {
    let [two, three] = [2.0, 3.0].map(Extended::from);
    let third = Extended::ONE / three;
    let tiny = Extended::from(1e-25);
    for zero in [
        third * three - Extended::ONE,
        (third + two) * three - Extended::from(7.0),
        (Extended::ONE + tiny) * (Extended::ONE - tiny) - Extended::ONE,
        (third + tiny) - third - tiny,
    ] {
        assert!(zero.rounded().abs() < 1e-31, "{zero:?}");
    }
}

/// What is rounded is right to many more digits than rounding leaves.
#[test]
fn the_simplifying_assumptions_hold_before_rounding() {
    for method in all() {
        let s = method.n_nodes();
        let Exact { nodes, a, weights } = Exact::new(method.family, s);
        let assumptions = assumptions(method.family, s);
        let residuals = residuals!(Extended, &nodes, &a, &weights, assumptions);
        let residual = largest(residuals.into_iter().map(Extended::rounded));
        assert!(residual < 1e-24, "{:?} {s}: {residual:e}", method.family);
    }
}

/// a + b √r.
fn surd(a: f64, b: f64, r: f64) -> f64 {
    a + b * r.sqrt()
}

#[track_caller]
fn assert_table(family: Family, nodes: &[f64], a: &[f64], weights: &[f64]) {
    let method = Tableau::new(family, nodes.len()).unwrap();
    let pairs = [
        (&method.nodes, nodes),
        (&method.a, a),
        (&method.weights, weights),
    ];
    for (found, exact) in pairs {
        assert_eq!(found.len(), exact.len());
        for (found, exact) in found.iter().zip(exact) {
            // The closed forms are rounded three times, in sums below 1.
            assert!(
                (found - exact).abs() <= f64::EPSILON,
                "{found} is not {exact}"
            );
        }
    }
}

/// Hairer & Wanner 1996, section IV.5; implicit Euler, implicit midpoint and trapezoid among them.
#[test]
fn small_methods_are_those_of_the_literature() {
    use Family::*;
    assert_table(RadauIia, &[1.0], &[1.0], &[1.0]);
    assert_table(RadauIa, &[0.0], &[1.0], &[1.0]);
    assert_table(GaussLegendre, &[0.5], &[0.5], &[1.0]);
    assert_table(LobattoIiia, &[0.0, 1.0], &[0.0, 0.0, 0.5, 0.5], &[0.5, 0.5]);
    assert_table(
        LobattoIiic,
        &[0.0, 1.0],
        &[0.5, -0.5, 0.5, 0.5],
        &[0.5, 0.5],
    );
    let third = 1.0 / 3.0;
    assert_table(
        RadauIia,
        &[third, 1.0],
        &[5.0 / 12.0, -1.0 / 12.0, 0.75, 0.25],
        &[0.75, 0.25],
    );
    assert_table(
        RadauIa,
        &[0.0, 2.0 / 3.0],
        &[0.25, -0.25, 0.25, 5.0 / 12.0],
        &[0.25, 0.75],
    );
    let gauss = |sign: f64| surd(0.25, sign / 6.0, 3.0);
    assert_table(
        GaussLegendre,
        &[surd(0.5, -1.0 / 6.0, 3.0), surd(0.5, 1.0 / 6.0, 3.0)],
        &[0.25, gauss(-1.0), gauss(1.0), 0.25],
        &[0.5, 0.5],
    );
    let simpson = [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0];
    #[rustfmt::skip]
    assert_table(
        LobattoIiia,
        &[0.0, 0.5, 1.0],
        &[
            0.0, 0.0, 0.0,
            5.0 / 24.0, third, -1.0 / 24.0,
            1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0,
        ],
        &simpson,
    );
    #[rustfmt::skip]
    assert_table(
        LobattoIiic,
        &[0.0, 0.5, 1.0],
        &[
            1.0 / 6.0, -third, 1.0 / 6.0,
            1.0 / 6.0, 5.0 / 12.0, -1.0 / 12.0,
            1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0,
        ],
        &simpson,
    );
    let root = |a: f64, b: f64, denominator: f64| surd(a / denominator, b / denominator, 6.0);
    #[rustfmt::skip]
    assert_table(
        RadauIia,
        &[root(4.0, -1.0, 10.0), root(4.0, 1.0, 10.0), 1.0],
        &[
            root(88.0, -7.0, 360.0), root(296.0, -169.0, 1800.0), root(-2.0, 3.0, 225.0),
            root(296.0, 169.0, 1800.0), root(88.0, 7.0, 360.0), root(-2.0, -3.0, 225.0),
            root(16.0, -1.0, 36.0), root(16.0, 1.0, 36.0), 1.0 / 9.0,
        ],
        &[root(16.0, -1.0, 36.0), root(16.0, 1.0, 36.0), 1.0 / 9.0],
    );
    #[rustfmt::skip]
    assert_table(
        RadauIa,
        &[0.0, root(6.0, -1.0, 10.0), root(6.0, 1.0, 10.0)],
        &[
            1.0 / 9.0, root(-1.0, -1.0, 18.0), root(-1.0, 1.0, 18.0),
            1.0 / 9.0, root(88.0, 7.0, 360.0), root(88.0, -43.0, 360.0),
            1.0 / 9.0, root(88.0, 43.0, 360.0), root(88.0, -7.0, 360.0),
        ],
        &[1.0 / 9.0, root(16.0, 1.0, 36.0), root(16.0, -1.0, 36.0)],
    );
}

/// The products of A and c that belong to the rooted trees with up to four nodes, with their density
/// (Hairer, Nørsett & Wanner 1993, section II.2).
#[test]
fn methods_satisfy_the_conditions_of_all_trees() {
    for method in all() {
        let s = method.n_nodes();
        let (a, b, c) = (&method.a, &method.weights, &method.nodes);
        let times =
            |x: &[f64], y: &[f64]| -> Vec<f64> { x.iter().zip(y).map(|(x, y)| x * y).collect() };
        let apply = |x: &[f64]| -> Vec<f64> {
            (0..s)
                .map(|i| times(&a[i * s..][..s], x).iter().sum())
                .collect()
        };
        let squares = times(c, c);
        let trees = [
            (1, 1.0, vec![1.0; s]),
            (2, 2.0, c.clone()),
            (3, 3.0, squares.clone()),
            (3, 6.0, apply(c)),
            (4, 4.0, times(&squares, c)),
            (4, 8.0, times(c, &apply(c))),
            (4, 12.0, apply(&squares)),
            (4, 24.0, apply(&apply(c))),
        ];
        for (order, density, products) in trees {
            let residual: f64 = times(b, &products).iter().sum::<f64>() - 1.0 / density;
            if order <= method.order {
                assert!(residual.abs() < 1e-15, "{method:?}: {density} {residual:e}");
            }
        }
    }
}

#[test]
fn properties_hold_of_the_numbers() {
    for method in all() {
        let s = method.n_nodes();
        let name = format!("{} {s}", method.family.word());
        assert!(method.nodes.is_sorted(), "{name}");
        assert!(
            method.nodes.iter().all(|c| (0.0..=1.0).contains(c)),
            "{name}"
        );
        assert!(method.weights.iter().all(|b| *b > 0.0), "{name}");

        let last = &method.a[s * (s - 1)..];
        let ends = method.nodes[s - 1] == 1.0 && last == method.weights;
        assert_eq!(method.ends_at_node(), ends, "{name}");

        let distinct = method.nodes.windows(2).all(|pair| pair[0] < pair[1]);
        let residuals = residuals!(f64, &method.nodes, &method.a, &method.weights, [0, s, 0]);
        let collocates = distinct && largest(residuals) < 1e-14;
        assert_eq!(method.is_collocation(), collocates, "{name}");

        let stability = stability_at_infinity(&method);
        assert_eq!(method.is_invertible(), stability.is_some(), "{name}");
        assert_eq!(
            method.sliding_order().is_some(),
            stability.is_some(),
            "{name}"
        );
        let exact = match method.family {
            Family::RadauIia | Family::RadauIa | Family::LobattoIiic => Some(0.0),
            Family::GaussLegendre => Some((-1.0_f64).powi(s as i32)),
            Family::LobattoIiia | Family::Explicit => None,
        };
        if let (Some(found), Some(exact)) = (stability, exact) {
            assert!((found - exact).abs() < 1e-11, "{name}: R(∞) = {found}");
        }
    }
}

/// R(∞) = 1 - bᵀ A⁻¹ 1, where A is invertible (Hairer & Wanner 1996, section IV.3).
fn stability_at_infinity(method: &Tableau) -> Option<f64> {
    let s = method.n_nodes();
    let mut lu = crate::linalg::DenseLu::new(s);
    lu.factor(&method.a).ok()?;
    let mut solution = vec![1.0; s];
    lu.solve(&mut solution);
    let terms = method.weights.iter().zip(&solution);
    Some(1.0 - terms.map(|(b, x)| b * x).sum::<f64>())
}

#[test]
fn gauss_and_lobatto_are_symmetric() {
    for method in all() {
        let s = method.n_nodes();
        if matches!(method.family, Family::GaussLegendre | Family::LobattoIiia) {
            for i in 0..s.div_ceil(2) {
                assert_eq!(method.weights[i], method.weights[s - 1 - i]);
                // Half a unit in the last place of the upper c, and of the lower one.
                let mirrored = 1.0 - method.nodes[s - 1 - i];
                assert!((method.nodes[i] - mirrored).abs() <= 0.375 * f64::EPSILON);
            }
        }
    }
}

#[test]
fn other_numbers_of_nodes_are_refused() {
    for family in Family::ALL {
        for found in [0, family.nodes().start() - 1, family.nodes().end() + 1] {
            let refused = Tableau::new(family, found).unwrap_err();
            assert_eq!(refused, TableauError::NodeCount { family, found });
        }
    }
    let error = Tableau::new(Family::LobattoIiic, 7).unwrap_err();
    assert_eq!(error.to_string(), "`lobatto_iiic` has 2 to 6 nodes, not 7");
}

/// Σ q_k τᵏ, and its integral from 0.
fn polynomial(q: &[f64], tau: f64) -> [f64; 2] {
    let terms = q.iter().enumerate().rev();
    terms.fold([0.0; 2], |[value, integral], (k, q)| {
        [value * tau + q, (integral + q / (k + 1) as f64) * tau]
    })
}

proptest! {
    #[test]
    fn polynomials_are_integrated(q in proptest::collection::vec(-1.0..1.0, 18)) {
        for method in all() {
            let s = method.n_nodes();
            let [degree, inner, _] = assumptions(method.family, s);
            let values = |degree: usize| -> Vec<f64> {
                method.nodes.iter().map(|&c| polynomial(&q[..degree], c)[0]).collect()
            };
            let sum = |row: &[f64], values: &[f64]| -> f64 {
                row.iter().zip(values).map(|(a, value)| a * value).sum()
            };
            let end = sum(&method.weights, &values(degree));
            prop_assert!((end - polynomial(&q[..degree], 1.0)[1]).abs() < 1e-14);
            let inside = values(inner);
            for (row, &c) in method.a.chunks(s).zip(&method.nodes) {
                let exact = polynomial(&q[..inner], c)[1];
                prop_assert!((sum(row, &inside) - exact).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn polynomials_are_reproduced(
        q in proptest::collection::vec(-1.0..1.0, 9),
        points in proptest::collection::vec(-1.0..2.0, 3),
    ) {
        for method in all().filter(Tableau::is_collocation) {
            let (s, nodes) = (method.n_nodes(), &method.nodes);
            let q = &q[..s];
            let values: Vec<f64> = nodes.iter().map(|&c| polynomial(q, c)[0]).collect();
            let product = |matrix: &[f64]| -> Vec<f64> {
                matrix.chunks(s).map(|row| row.iter().zip(&values).map(|(a, v)| a * v).sum()).collect()
            };
            // The values are known to rounding, which the sums of the entries enlarge.
            let noise = |row: &[f64]| 20.0 * f64::EPSILON * row.iter().map(|a| a.abs()).sum::<f64>();
            let matrix = lagrange(nodes, &points);
            for (i, found) in product(&matrix).iter().enumerate() {
                let exact = polynomial(q, points[i])[0];
                let terms = q.iter().map(|q| q.abs()).collect::<Vec<f64>>();
                let evaluated = 20.0 * f64::EPSILON * polynomial(&terms, points[i].abs())[0];
                prop_assert!((found - exact).abs() <= noise(&matrix[i * s..][..s]) + evaluated);
            }
            let matrix = differentiation(nodes);
            let slopes: Vec<f64> = (1..s).map(|k| k as f64 * q[k]).collect();
            for (i, found) in product(&matrix).iter().enumerate() {
                let exact = polynomial(&slopes, nodes[i])[0];
                prop_assert!((found - exact).abs() <= noise(&matrix[i * s..][..s]));
            }
            let matrix = monomials(nodes);
            for (k, found) in product(&matrix).iter().enumerate() {
                prop_assert!((found - q[k]).abs() <= noise(&matrix[k * s..][..s]));
            }
        }
    }
}

/// Through the nodes 0, 1/2, 1/2 and 1 of the classical method go parabolas.
#[test]
fn nodes_that_are_there_twice_count_once() {
    let values = lagrange(&[0.0, 0.5, 0.5, 1.0], &[0.25, 0.5]);
    assert_eq!(values, [0.375, 0.75, 0.0, -0.125, 0.0, 1.0, 0.0, 0.0]);
}
