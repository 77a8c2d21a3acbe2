//! What `plot` and `animate` draw, in the variables of the model.

use super::animation::Animation;
use super::error::ExperimentError;
use super::reader::Reader;
use crate::expr::Expr;
use crate::model::ModelError;
use crate::syntax::{self, ExprKind, PlotItem, PlotKind};

/// How wide a figure is in pixels at least and at most.
const WIDTHS: std::ops::RangeInclusive<f64> = 1.0..=1e5;

/// The figures that an experiment asks for.
#[derive(Clone, Debug, Default)]
pub struct Figures<'e> {
    /// Over time and in phase portraits; `None` for everything that is recorded.
    pub plot: Option<Plot<'e>>,
    /// Shapes that move.
    pub animation: Option<Animation<'e>>,
}

impl<'e> Figures<'e> {
    /// All that they draw.
    pub fn entries(&self) -> impl Iterator<Item = Expr<'e>> {
        let drawn = self.plot.iter().flat_map(Plot::drawn);
        let drawn = drawn.flat_map(|drawn| &drawn.entries);
        let shapes = self.animation.iter().flat_map(|figure| &figure.shapes);
        drawn
            .chain(shapes.flat_map(|shape| &shape.entries))
            .copied()
    }
}

/// What the sheet of a figure is.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// What stands above.
    pub title: Option<String>,
    /// Its width in pixels, 96 to an inch; none for that of what is on it.
    pub width: Option<f64>,
}

impl Sheet {
    /// Takes a `title` or a `width`, each once under these words.
    pub(super) fn read(
        &mut self,
        reader: &mut Reader<'_, '_>,
        item: &PlotItem,
        [title, width]: [&'static str; 2],
    ) {
        match &item.kind {
            PlotKind::Title(text) => {
                reader.once(title, item.span);
                self.title = Some(text.clone());
            }
            PlotKind::Width(number, unit) => {
                reader.once(width, item.span);
                let pixels = number * unit.pixels();
                self.width = Some(pixels);
                if !WIDTHS.contains(&pixels) {
                    reader.error(ExperimentError::PlotWidth { span: item.span });
                }
            }
            _ => {}
        }
    }
}

/// A figure as an experiment asks for it.
#[derive(Clone, Debug, Default)]
pub struct Plot<'e> {
    /// Its sheet.
    pub sheet: Sheet,
    /// Curves over time, panel by panel.
    pub panels: Vec<Vec<Drawn<'e>>>,
    /// Phase portraits of two scalars each.
    pub phases: Vec<[Drawn<'e>; 2]>,
}

/// An expression of the model that is drawn.
#[derive(Clone, Debug)]
pub struct Drawn<'e> {
    /// Its text.
    pub name: String,
    /// The text of what it is an entry of: `b.x` where it is `b.x[2]`.
    pub whole: Option<String>,
    /// Empty for a scalar.
    pub shape: Vec<usize>,
    /// Its entries.
    pub entries: Vec<Expr<'e>>,
}

impl<'e> Plot<'e> {
    /// What the members of a `plot` say; what is wrong with them is reported.
    pub(crate) fn read(reader: &mut Reader<'_, 'e>, items: &[PlotItem]) -> Self {
        let mut plot = Plot::default();
        for item in items {
            match &item.kind {
                PlotKind::Panel(exprs) => {
                    let drawn = exprs.iter().filter_map(|expr| Drawn::read(reader, expr));
                    plot.panels.push(drawn.collect());
                }
                PlotKind::Phase(axes) => {
                    let [x, y] = axes.each_ref().map(|axis| Drawn::scalar(reader, axis));
                    plot.phases.extend(x.zip(y).map(|(x, y)| [x, y]));
                }
                _ => plot.sheet.read(reader, item, ["`title`", "`width`"]),
            }
        }
        plot
    }

    /// Whether it draws nothing of its own.
    pub fn is_empty(&self) -> bool {
        self.drawn().next().is_none()
    }

    /// All that it draws.
    pub fn drawn(&self) -> impl Iterator<Item = &Drawn<'e>> {
        let over_time = self.panels.iter().flatten();
        over_time.chain(self.phases.iter().flatten())
    }
}

impl<'e> Drawn<'e> {
    fn read(reader: &mut Reader<'_, 'e>, expr: &syntax::Expr) -> Option<Self> {
        let value = reader.model.scope.expr(expr, None, reader.diags);
        reader.failed |= value.is_none();
        let value = value?;
        Some(Drawn {
            name: expr.to_string(),
            whole: match &expr.kind {
                ExprKind::Index(whole, _) => Some(whole.to_string()),
                _ => None,
            },
            shape: value.shape.sizes(),
            entries: value.data,
        })
    }

    /// One number at each instant.
    fn scalar(reader: &mut Reader<'_, 'e>, expr: &syntax::Expr) -> Option<Self> {
        let drawn = Drawn::read(reader, expr)?;
        if drawn.shape.is_empty() {
            return Some(drawn);
        }
        reader.failed = true;
        reader.diags.push(ModelError::ScalarExpected {
            what: "an axis of a phase portrait".to_owned(),
            found: format!("{} numbers", drawn.entries.len()),
            span: expr.span,
            help: Some("name an entry, as in `phase q[1], q[2];`".to_owned()),
        });
        None
    }
}
