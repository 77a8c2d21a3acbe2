//! What `animate` draws: shapes in the plane whose coordinates are expressions of the model.

use super::error::ExperimentError;
use super::plot::Sheet;
use super::reader::{Reader, unknown_choice};
use crate::expr::Expr;
use crate::model::Tensor;
use crate::model::expressions::rows::Loop;
use crate::source::Span;
use crate::syntax::{self, Ident, PlotItem, PlotKind};

/// The words of an animation, shapes first.
const WORDS: [&str; 7] = [
    "disc", "segment", "polygon", "trace", "speed", "title", "width",
];

/// Words of shapes.
const SHAPES: usize = 4;

/// Shapes that move as an experiment asks for it.
#[derive(Clone, Debug)]
pub struct Animation<'e> {
    /// Its sheet.
    pub sheet: Sheet,
    /// Seconds of the model that pass in one second.
    pub speed: f64,
    /// From the back to the front.
    pub shapes: Vec<Drawing<'e>>,
}

/// A shape, with its coordinates and lengths.
#[derive(Clone, Debug)]
pub struct Drawing<'e> {
    /// What its numbers mean.
    pub kind: DrawingKind,
    /// Its numbers at an instant.
    pub entries: Vec<Expr<'e>>,
    /// The texts of what they are written as.
    pub names: Vec<String>,
}

/// What the numbers of a shape mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawingKind {
    /// x, y, radius, and where it turns its angle
    Disc,
    /// Straight lines from point to point: x₁, y₁, x₂, y₂, ..
    Segment,
    /// The area between corners: x₁, y₁, x₂, y₂, x₃, y₃, ..
    Polygon,
    /// x, y, the way of a point until now
    Trace,
}

impl Drawing<'_> {
    /// The texts of its coordinates and lengths: all but the angle of a disc.
    pub fn lengths(&self) -> &[String] {
        let has_angle = self.kind == DrawingKind::Disc && self.entries.len() == 4;
        &self.names[..self.names.len() - usize::from(has_angle)]
    }
}

/// Shapes of one loop.
const MOST_SHAPES: usize = 2000;

impl DrawingKind {
    fn named(word: &str) -> Option<Self> {
        Some(match word {
            "disc" => DrawingKind::Disc,
            "segment" => DrawingKind::Segment,
            "polygon" => DrawingKind::Polygon,
            "trace" => DrawingKind::Trace,
            _ => return None,
        })
    }

    /// Whether a shape has so many numbers.
    fn takes(self, n: usize) -> bool {
        match self {
            DrawingKind::Disc => n == 3 || n == 4,
            DrawingKind::Segment => n >= 4 && n.is_multiple_of(2),
            DrawingKind::Polygon => n >= 6 && n.is_multiple_of(2),
            DrawingKind::Trace => n == 2,
        }
    }

    /// What it takes, in words.
    fn numbers(self) -> &'static str {
        match self {
            DrawingKind::Disc => "x, y, a radius, and an angle where it turns",
            DrawingKind::Segment => "x and y of two points or more",
            DrawingKind::Polygon => "x and y of three corners or more",
            DrawingKind::Trace => "x and y",
        }
    }
}

impl<'e> Animation<'e> {
    /// What the members of an `animate` say, where it has a shape; what is wrong with them is reported.
    pub(crate) fn read(reader: &mut Reader<'_, 'e>, items: &[PlotItem]) -> Option<Self> {
        let mut animation = Animation {
            sheet: Sheet::default(),
            speed: 1.0,
            shapes: Vec::new(),
        };
        let mut found = Vec::new();
        animation.add(reader, items, &mut Vec::new(), &mut found);
        found.sort_by(|(one, _), (other, _)| one.cmp(other));
        animation.shapes = found.into_iter().map(|(_, shape)| shape).collect();
        (!animation.shapes.is_empty()).then_some(animation)
    }

    /// Adds the members that stand in some loops, which have their places in these; a shape goes with its place, the turn
    /// of the loop around it, its place in that, and so on.
    fn add<'s>(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        items: &'s [PlotItem],
        loops: &mut Vec<(usize, Loop<'s>)>,
        found: &mut Vec<(Vec<usize>, Drawing<'e>)>,
    ) {
        for (place, item) in items.iter().enumerate() {
            match &item.kind {
                PlotKind::For(binders, items) => {
                    loops.push((place, (binders, item.span)));
                    if turns(reader, loops).is_some_and(|turns| turns > 0) {
                        self.add(reader, items, loops, found);
                    }
                    loops.pop();
                }
                PlotKind::Drawing(word, exprs) => match DrawingKind::named(&word.name) {
                    Some(kind) => {
                        let around: Vec<Loop<'_>> = loops.iter().map(|(_, one)| *one).collect();
                        let all = reader.model.scope.each(&around, exprs, reader.diags);
                        reader.failed |= all.is_none();
                        for one in all.into_iter().flatten() {
                            let outer = loops.iter().zip(&one.turns);
                            let outer = outer.flat_map(|((place, _), turn)| [*place, *turn]);
                            let path = outer.chain([place]).collect();
                            let shape = Drawing::read(reader, (kind, word), one.values, item.span);
                            let Some(shape) = shape else {
                                break;
                            };
                            found.push((path, shape));
                        }
                    }
                    None if word.name == "speed" && loops.is_empty() => {
                        reader.once("`speed`", item.span);
                        self.speed = speed(reader, exprs, item.span);
                    }
                    None => {
                        let known = if loops.is_empty() {
                            WORDS.len()
                        } else {
                            SHAPES
                        };
                        let words = &WORDS[..known];
                        reader.error(unknown_choice("member of an animation", word, words));
                    }
                },
                _ => {
                    let words = ["`title` of `animate`", "`width` of `animate`"];
                    self.sheet.read(reader, item, words);
                }
            }
        }
    }
}

/// How many turns loops have together; none where that cannot be told, or is more than a picture shows.
fn turns(reader: &mut Reader<'_, '_>, loops: &[(usize, Loop<'_>)]) -> Option<usize> {
    let around: Vec<Loop<'_>> = loops.iter().map(|(_, one)| *one).collect();
    let turns = reader.model.scope.each(&around, &[], reader.diags);
    reader.failed |= turns.is_none();
    let (count, span) = (turns?.len(), around.last()?.1);
    if count > MOST_SHAPES {
        reader.error(ExperimentError::ManyShapes { count, span });
        return None;
    }
    Some(count)
}

/// Seconds of the model in a second: one positive number.
fn speed(reader: &mut Reader<'_, '_>, exprs: &[syntax::Expr], span: Span) -> f64 {
    let [speed] = exprs else {
        reader.error(ExperimentError::ShapeNumbers {
            shape: "speed".to_owned(),
            takes: "one number",
            found: exprs.len(),
            span,
        });
        return 1.0;
    };
    let fits = |speed: f64| (1e-6..=1e6).contains(&speed);
    let found = reader.follows("the speed", speed, "from 1e-6 to 1e6", fits);
    found.map_or(1.0, |(speed, _)| speed)
}

impl<'e> Drawing<'e> {
    fn read(
        reader: &mut Reader<'_, 'e>,
        (kind, word): (DrawingKind, &Ident),
        values: Vec<(String, Tensor<'e>)>,
        span: Span,
    ) -> Option<Self> {
        let (names, values): (Vec<_>, Vec<_>) = values.into_iter().unzip();
        let entries = values.into_iter().flat_map(|value| value.data);
        let entries: Vec<Expr<'e>> = entries.collect();
        if !kind.takes(entries.len()) {
            reader.error(ExperimentError::ShapeNumbers {
                shape: word.name.clone(),
                takes: kind.numbers(),
                found: entries.len(),
                span,
            });
            return None;
        }
        Some(Drawing {
            kind,
            entries,
            names,
        })
    }
}
