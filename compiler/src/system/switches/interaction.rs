//! Independent groups of switches.
//!
//! Two switches interact when ∂²f/∂α_i∂α_j ≠ 0 for some rate f; the subsystems are the connected
//! components of that graph. Σ 2^n_s regions then take the place of 2^n.

use petgraph::unionfind::UnionFind;

use crate::expr::{Expr, Var, variables_of};
use crate::system::Subsystem;

/// The connected components, in order of their first switch; `regions` is left open.
pub(crate) fn subsystems(rates: &[Expr<'_>], alphas: &[Var]) -> Vec<Subsystem> {
    let mut components = UnionFind::<usize>::new(alphas.len());
    for &rate in rates {
        let inside = positions(rate, alphas);
        if inside.len() < 2 {
            continue;
        }
        for i in inside {
            // f is multi-affine, so ∂f/∂α_i holds exactly those α_j that α_i is multiplied by.
            for j in positions(rate.diff(alphas[i]), alphas) {
                components.union(i, j);
            }
        }
    }
    let mut found: Vec<(usize, Subsystem)> = Vec::new();
    for (k, label) in components.into_labeling().into_iter().enumerate() {
        match found.iter_mut().find(|(known, _)| *known == label) {
            Some((_, subsystem)) => subsystem.switches.push(k),
            None => found.push((
                label,
                Subsystem {
                    switches: vec![k],
                    regions: None,
                },
            )),
        }
    }
    found.into_iter().map(|(_, subsystem)| subsystem).collect()
}

/// Which of the variables occur.
pub(crate) fn positions(e: Expr<'_>, vars: &[Var]) -> Vec<usize> {
    let below = variables_of(&[e]);
    if vars.is_sorted() {
        return (below.iter())
            .filter_map(|var| vars.binary_search(var).ok())
            .collect();
    }
    (0..vars.len())
        .filter(|&k| below.binary_search(&vars[k]).is_ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::subsystems;
    use crate::expr::{Exprs, Var};

    #[test]
    fn products_connect_and_sums_do_not() {
        let exprs = Exprs::new();
        let x = exprs.variable("x");
        let a = exprs.variables("a", 5);
        let vars: Vec<Var> = a.iter().map(|a| a.as_variable().unwrap()).collect();
        let rates = [
            a[0] + a[1] + a[2] * x,
            a[3] * (x + a[1]),
            (1.0 - a[4]) * a[3] * x,
        ];
        let found: Vec<Vec<usize>> = subsystems(&rates, &vars)
            .into_iter()
            .map(|s| s.switches)
            .collect();
        assert_eq!(found, [vec![0], vec![1, 3, 4], vec![2]]);
    }
}
