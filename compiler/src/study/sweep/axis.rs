//! The values that a sweep goes through: `mu=0.1:0.5:41` and `k=[1,2,4]`.

/// Most runs of one sweep, whose rows are kept in memory.
const MOST: usize = 10_000_000;

/// A quantity and its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// As it stands on the left of `=` in `with`.
    pub name: String,
    /// At least one, and all finite.
    pub values: Vec<f64>,
}

/// Axes, and how their values are combined.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    axes: Vec<Axis>,
    is_zipped: bool,
    count: usize,
}

/// What is wrong with the axes of a sweep.
#[derive(Clone, Debug, PartialEq, thiserror::Error, miette::Diagnostic)]
pub enum SweepError {
    /// No axis.
    #[error("`{text}` is no axis: {reason}")]
    #[diagnostic(
        code(E0811),
        help(
            "`--over mu=0.1:0.5:41` takes 41 values from 0.1 to 0.5, `--over k=[1,2,4]` these three"
        )
    )]
    Axis {
        /// What was written.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// One quantity on two axes.
    #[error("`{name}` stands on two axes")]
    #[diagnostic(code(E0811), help("give all of its values on one"))]
    Twice {
        /// The quantity.
        name: String,
    },
    /// More runs than can be kept.
    #[error("a sweep of {count:e} runs is too large")]
    #[diagnostic(
        code(E0812),
        help(
            "take fewer values, `--zip` to take those of all axes side by side, or several sweeps"
        )
    )]
    Large {
        /// How many.
        count: f64,
    },
    /// Axes that cannot be taken side by side.
    #[error(
        "`--zip` takes axes of one length, but `{first}` has {left} values and `{second}` {right}"
    )]
    #[diagnostic(
        code(E0813),
        help("leave `--zip` out to combine each value with all others")
    )]
    Lengths {
        /// An axis.
        first: String,
        /// Its length.
        left: usize,
        /// Another one.
        second: String,
        /// Its length.
        right: usize,
    },
}

impl crate::diagnostics::Fixable for SweepError {}

impl Axis {
    /// Reads `name=from:to:count` or `name=[a,b,..]`.
    ///
    /// # Errors
    ///
    /// Where there are no values, or some are no finite numbers.
    pub fn parse(text: &str) -> Result<Self, SweepError> {
        let wrong = |reason: &str| SweepError::Axis {
            text: text.to_owned(),
            reason: reason.to_owned(),
        };
        let (name, values) = text.split_once('=').ok_or_else(|| wrong("it has no `=`"))?;
        let (name, values) = (name.trim(), values.trim());
        if name.is_empty() {
            return Err(wrong("it names no quantity"));
        }
        let number = |word: &str| {
            let word = word.trim();
            let found = word.parse::<f64>().ok().filter(|number| number.is_finite());
            found.ok_or_else(|| wrong(&format!("`{word}` is no finite number")))
        };
        let listed = values
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'));
        let values = match listed {
            Some(list) if list.trim().is_empty() => return Err(wrong("it has no values")),
            Some(list) => list
                .split(',')
                .map(number)
                .collect::<Result<Vec<f64>, _>>()?,
            None => {
                let parts: Vec<&str> = values.split(':').collect();
                let [from, to, count] = parts[..] else {
                    return Err(wrong("its values are neither FROM:TO:COUNT nor [A,B,..]"));
                };
                let (from, to) = (number(from)?, number(to)?);
                let count = number(count)?;
                if count < 1.0 || count.fract() != 0.0 {
                    return Err(wrong(
                        "the number of its values is no whole number from 1 on",
                    ));
                }
                if count > MOST as f64 {
                    return Err(SweepError::Large { count });
                }
                spaced(from, to, count as usize)
            }
        };
        let name = name.to_owned();
        Ok(Axis { name, values })
    }
}

/// Equally spaced values, the ends as they are.
fn spaced(from: f64, to: f64, count: usize) -> Vec<f64> {
    let last = (count - 1).max(1) as f64;
    let value = |k: usize| match k {
        0 => from,
        k if k + 1 == count => to,
        // Round values stay round more often than with a step that is added.
        k => from * ((last - k as f64) / last) + to * (k as f64 / last),
    };
    (0..count).map(value).collect()
}

impl Grid {
    /// All combinations of the values, the last axis fastest; or the values side by side.
    ///
    /// # Errors
    ///
    /// Where there are too many runs, a quantity stands on two axes, or lengths differ side by side.
    pub fn new(axes: Vec<Axis>, is_zipped: bool) -> Result<Self, SweepError> {
        for (k, axis) in axes.iter().enumerate() {
            if axes[..k].iter().any(|other| other.name == axis.name) {
                let name = axis.name.clone();
                return Err(SweepError::Twice { name });
            }
        }
        let lengths = || axes.iter().map(|axis| axis.values.len());
        let count = match is_zipped {
            true => lengths().next().unwrap_or(0) as f64,
            false => lengths().map(|length| length as f64).product(),
        };
        if count > MOST as f64 {
            return Err(SweepError::Large { count });
        }
        if let Some(other) = axes
            .iter()
            .find(|axis| is_zipped && axis.values.len() as f64 != count)
        {
            return Err(SweepError::Lengths {
                first: axes[0].name.clone(),
                left: axes[0].values.len(),
                second: other.name.clone(),
                right: other.values.len(),
            });
        }
        Ok(Grid {
            axes,
            is_zipped,
            count: count as usize,
        })
    }

    /// The axes.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The axes of a figure: all, or the first one of those whose values are taken side by side.
    pub fn drawn(&self) -> &[Axis] {
        match self.is_zipped {
            true => &self.axes[..1],
            false => &self.axes,
        }
    }

    /// How many points there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The values of a point, axis by axis.
    pub fn point(&self, k: usize) -> Vec<f64> {
        if self.is_zipped {
            return self.axes.iter().map(|axis| axis.values[k]).collect();
        }
        let mut left = k;
        let mut values: Vec<f64> = (self.axes.iter().rev())
            .map(|axis| {
                let n = axis.values.len();
                let value = axis.values[left % n];
                left /= n;
                value
            })
            .collect();
        values.reverse();
        values
    }
}

#[cfg(test)]
mod tests {
    use super::{Axis, Grid, SweepError};

    fn grid(axes: &[&str], is_zipped: bool) -> Result<Grid, SweepError> {
        let axes: Result<Vec<Axis>, _> = axes.iter().map(|text| Axis::parse(text)).collect();
        Grid::new(axes?, is_zipped)
    }

    #[test]
    fn values_are_spaced_or_listed() {
        let axis = |text: &str| Axis::parse(text).expect("it is one").values;
        assert_eq!(axis("mu=0.1:0.5:3"), [0.1, 0.3, 0.5]);
        assert_eq!(axis("x[2] = 4:-1:1"), [4.0]);
        assert_eq!(axis("k=[1, 2e3,-4]"), [1.0, 2000.0, -4.0]);
        let many = axis("x=0:0.3:4");
        assert_eq!((many[0], many[3]), (0.0, 0.3));
    }

    #[test]
    fn the_last_axis_goes_fastest() {
        let all = grid(&["a=[1,2]", "b=[10,20,30]"], false).expect("it is one");
        let points: Vec<Vec<f64>> = (0..all.len()).map(|k| all.point(k)).collect();
        assert_eq!(points[1], [1.0, 20.0]);
        assert_eq!(points[3], [2.0, 10.0]);
        assert_eq!(points.len(), 6);
        let zipped = grid(&["a=[1,2]", "b=[10,20]"], true).expect("it is one");
        assert_eq!(
            [zipped.point(0), zipped.point(1)],
            [[1.0, 10.0], [2.0, 20.0]]
        );
    }

    #[test]
    fn what_is_no_axis_is_refused() {
        let wrong = [
            "mu",
            "=1:2:3",
            "mu=",
            "mu=[]",
            "mu=[1,nan]",
            "mu=[1,]",
            "mu=1:2",
            "mu=1:2:0",
            "mu=1:2:2.5",
            "mu=1:inf:3",
            "mu=a:b:c",
            "mu=1:2:-3",
            "mu=1:2:3:4",
        ];
        for text in wrong {
            let error = Axis::parse(text).expect_err(text);
            assert!(matches!(error, SweepError::Axis { .. }), "{text}: {error}");
        }
        let large = [&["a=0:1:1e12"][..], &["a=0:1:1e5", "b=0:1:1e5"]];
        for axes in large {
            let error = grid(axes, false).expect_err("it is large");
            assert!(matches!(error, SweepError::Large { .. }), "{error}");
        }
        let lengths = grid(&["a=[1,2]", "b=[1]"], true).expect_err("lengths differ");
        assert!(matches!(lengths, SweepError::Lengths { .. }));
        let twice = grid(&["a=[1,2]", "a=[3]"], false).expect_err("a stands twice");
        assert!(matches!(twice, SweepError::Twice { .. }));
    }
}
