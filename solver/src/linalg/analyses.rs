//! Symbolic factorizations, which are made once for all matrices of a pattern.
//!
//! Programs that differ in their numbers only have the same ones, and so have those of one branch. They are kept as far
//! as they fit into a bounded memory, those that were used last before others.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::ldl::{self, SparseLdl};
use super::paired_ldl::{self, PairedLdl};
use crate::optimization::problem::Pattern;

/// How much is kept of either kind, in numbers of 4 bytes.
const MOST_NUMBERS: usize = 1 << 24;

/// Symbolic factorizations that all who hold this share.
#[derive(Clone, Debug, Default)]
pub struct Analyses {
    sparse: Arc<Mutex<List<ldl::Analysis>>>,
    paired: Arc<Mutex<List<paired_ldl::Analysis>>>,
}

impl Analyses {
    /// Memory for matrices of a pattern, with pivots of one unknown.
    pub fn sparse(&self, pattern: &Pattern) -> SparseLdl {
        let mut list = locked(&self.sparse);
        SparseLdl::of(list.find(pattern, &[], || {
            let analysis = ldl::Analysis::new(pattern);
            (analysis.size(), analysis)
        }))
    }

    /// The same where these pairs of unknowns are eliminated together.
    pub fn paired(&self, pattern: &Pattern, pairs: &[[u32; 2]]) -> PairedLdl {
        let mut list = locked(&self.paired);
        PairedLdl::of(list.find(pattern, pairs, || {
            let analysis = paired_ldl::Analysis::new(pattern, pairs);
            (analysis.size(), analysis)
        }))
    }

    /// How many have been made.
    pub fn made(&self) -> usize {
        locked(&self.sparse).made + locked(&self.paired).made
    }
}

fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Those of one kind; what was used last comes last.
#[derive(Debug)]
struct List<A> {
    kept: Vec<Kept<A>>,
    made: usize,
}

#[derive(Debug)]
struct Kept<A> {
    pattern: Pattern,
    pairs: Vec<[u32; 2]>,
    analysis: Arc<A>,
    size: usize,
}

impl<A> Default for List<A> {
    fn default() -> Self {
        List {
            kept: Vec::new(),
            made: 0,
        }
    }
}

impl<A> List<A> {
    /// The one of a pattern and its pairs, which is made with its size where there is none.
    fn find(
        &mut self,
        pattern: &Pattern,
        pairs: &[[u32; 2]],
        make: impl FnOnce() -> (usize, A),
    ) -> Arc<A> {
        let same = |kept: &Kept<A>| kept.pattern == *pattern && kept.pairs == pairs;
        let known = self.kept.iter().position(same);
        let last = match known {
            Some(place) => self.kept.remove(place),
            None => {
                self.made += 1;
                let (size, analysis) = make();
                self.forget(MOST_NUMBERS.saturating_sub(size));
                Kept {
                    pattern: pattern.clone(),
                    pairs: pairs.to_vec(),
                    analysis: Arc::new(analysis),
                    size,
                }
            }
        };
        let analysis = last.analysis.clone();
        self.kept.push(last);
        analysis
    }

    /// Drops those that were not used for longest, until the others fit.
    fn forget(&mut self, most: usize) {
        let mut left = most;
        let fits = |kept: &&Kept<A>| {
            let fits = kept.size <= left;
            left = left.saturating_sub(kept.size);
            fits
        };
        let count = self.kept.iter().rev().take_while(fits).count();
        self.kept.drain(..self.kept.len() - count);
    }
}

#[cfg(test)]
mod tests {
    use super::{Analyses, List};
    use crate::linalg::symmetric::KktSolver;
    use crate::optimization::problem::Pattern;

    #[test]
    fn a_pattern_is_analyzed_once() {
        let analyses = Analyses::default();
        // ( 2 1 ) (1)   (3)
        // ( 1 -1) (1) = (0)
        let full = Pattern::new(2, vec![(0, 0), (1, 0), (1, 1)]);
        for scale in [1.0, -3.0] {
            let mut ldl = analyses.clone().sparse(&full);
            let matrix = [2.0, 1.0, -1.0].map(|a| scale * a);
            ldl.factor(&matrix).expect("it has pivots");
            let mut x = [3.0 * scale, 0.0];
            ldl.solve(&mut x);
            assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-15), "{x:?}");
        }
        assert_eq!(analyses.made(), 1);
        analyses.paired(&full, &[[0, 1]]);
        analyses.paired(&full, &[]);
        analyses.paired(&full, &[[0, 1]]);
        assert_eq!(analyses.made(), 3);
        analyses.sparse(&Pattern::new(2, vec![(0, 0), (1, 1)]));
        assert_eq!(analyses.made(), 4);
    }

    #[test]
    fn what_was_not_used_for_longest_is_forgotten() {
        let mut list: List<u32> = List::default();
        let pattern = |n: usize| Pattern::new(n, Vec::new());
        let mut ask = |n: usize| *list.find(&pattern(n), &[], || (super::MOST_NUMBERS / 2, 0));
        for n in [1, 2, 1, 3, 1] {
            ask(n);
        }
        assert_eq!(list.made, 3);
        assert_eq!(list.kept.len(), 2);
        list.find(&pattern(2), &[], || (1, 0));
        assert_eq!(list.made, 4);
    }
}
