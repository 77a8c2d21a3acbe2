//! A sheet with a fine grid: plotters knows whole units only, so a point has many of them.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Units per point.
pub const UNITS: f64 = 16.0;
/// The SVG backend divides sizes of fonts by this.
const FONT_SCALE: f64 = 1.24;
/// The fonts of scientific journals, or what comes closest.
const FONT: &str = "Helvetica, Arial, 'DejaVu Sans', sans-serif";

/// A place on the sheet, in points from the upper left corner.
pub type Point = (f64, f64);

/// Width of a line in points, and its colour.
#[derive(Clone, Copy)]
pub struct Stroke(pub f64, pub RGBColor);

/// How a text stands at its point.
#[derive(Clone, Copy)]
pub enum Align {
    /// Starts there.
    Left,
    /// Centred there.
    Centre,
    /// Ends there.
    Right,
    /// Centred there and read from below.
    Upwards,
}

/// Size of text in points.
pub const TEXT_SIZE: f64 = 10.0;
/// Dark grey: frames, ticks and text.
pub const INK: RGBColor = RGBColor(40, 40, 40);

/// Draws into a string; all lengths are in points.
pub struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, plotters::coord::Shift>,
}

impl Canvas<'_> {
    /// The SVG text of what `draw` puts on a sheet.
    pub fn svg(width: f64, height: f64, draw: impl FnOnce(&Canvas<'_>)) -> String {
        Self::svg_of_width(None, (width, height), draw)
    }

    /// The same for a sheet that is scaled to a width, where one is asked for.
    pub fn svg_of_width(
        asked: Option<f64>,
        (width, height): Point,
        draw: impl FnOnce(&Canvas<'_>),
    ) -> String {
        let units = |length: f64| (length * UNITS).round() as u32;
        let mut text = String::new();
        {
            let backend = SVGBackend::with_string(&mut text, (units(width), units(height)));
            let canvas = Canvas {
                area: backend.into_drawing_area(),
            };
            canvas.rect((0.0, 0.0), (width, height), WHITE);
            draw(&canvas);
            // Nothing that draws into a string fails, here and below.
            let _ = canvas.area.present();
        }
        let fine = format!(r#"width="{}" height="{}""#, units(width), units(height));
        let scale = asked.map_or(1.0, |asked| asked / width);
        let [width, height] = [width, height].map(|length| scale * length);
        text.replacen(&fine, &format!(r#"width="{width}" height="{height}""#), 1)
    }

    /// A line through all points that are finite; others interrupt it.
    pub fn line(&self, points: &[Point], Stroke(width, color): Stroke) {
        let style = color.stroke_width((width * UNITS).round().max(1.0) as u32);
        let finite = |p: &Point| p.0.is_finite() && p.1.is_finite();
        for run in points.split(|p| !finite(p)).filter(|run| run.len() > 1) {
            let run: Vec<_> = visible(run).map(grid).collect();
            let _ = self.area.draw(&PathElement::new(run, style));
        }
    }

    /// A line with the dash pattern `on`, `off` in points.
    pub fn dashed(&self, points: &[Point], (on, off): (f64, f64), stroke: Stroke) {
        let mut dash: Vec<Point> = points.first().copied().into_iter().collect();
        let mut left = on;
        let mut is_on = true;
        for pair in points.windows(2) {
            let (mut from, to) = (pair[0], pair[1]);
            loop {
                let length = (to.0 - from.0).hypot(to.1 - from.1);
                if length <= left || !length.is_finite() {
                    left -= if length.is_finite() { length } else { 0.0 };
                    dash.push(to);
                    break;
                }
                let share = left / length;
                from = (
                    from.0 + share * (to.0 - from.0),
                    from.1 + share * (to.1 - from.1),
                );
                dash.push(from);
                if is_on {
                    self.line(&dash, stroke);
                }
                dash = vec![from];
                is_on = !is_on;
                left = if is_on { on } else { off };
            }
        }
        if is_on {
            self.line(&dash, stroke);
        }
    }

    /// A filled rectangle.
    pub fn rect(&self, from: Point, to: Point, color: RGBColor) {
        let _ = self
            .area
            .draw(&Rectangle::new([grid(from), grid(to)], color.filled()));
    }

    /// A filled polygon.
    pub fn polygon(&self, points: &[Point], color: RGBColor) {
        let points: Vec<_> = points.iter().map(|&p| grid(p)).collect();
        let _ = self.area.draw(&Polygon::new(points, color));
    }

    /// A filled disc.
    pub fn disc(&self, centre: Point, radius: f64, color: RGBColor) {
        let radius = (radius * UNITS).round() as i32;
        let _ = self
            .area
            .draw(&Circle::new(grid(centre), radius, color.filled()));
    }

    /// A line of text.
    pub fn text(&self, at: Point, text: &str, align: Align, color: RGBColor) {
        self.sized_text(at, text, align, color, TEXT_SIZE);
    }

    /// A line of text of another size.
    pub fn sized_text(&self, at: Point, text: &str, align: Align, color: RGBColor, size: f64) {
        let h_pos = match align {
            Align::Left => HPos::Left,
            Align::Centre | Align::Upwards => HPos::Center,
            Align::Right => HPos::Right,
        };
        let font = FontDesc::new(
            FontFamily::Name(FONT),
            size * UNITS * FONT_SCALE,
            FontStyle::Normal,
        );
        let font = match align {
            Align::Upwards => font.transform(FontTransform::Rotate270),
            _ => font,
        };
        let style = TextStyle::from(font)
            .color(&color)
            .pos(Pos::new(h_pos, VPos::Center));
        let _ = self.area.draw_text(text, &style, grid(at));
    }
}

/// An estimate of the width of a text, for the font is chosen by the viewer.
pub fn text_width(text: &str, size: f64) -> f64 {
    let width = |c: char| match c {
        'i' | 'j' | 'l' | '.' | ',' | '[' | ']' | '(' | ')' | ' ' | '\'' | '|' => 0.32,
        'm' | 'w' | 'M' | 'W' => 0.9,
        c if c.is_uppercase() => 0.74,
        _ => 0.62,
    };
    size * text.chars().map(width).sum::<f64>()
}

/// The width of the widest of some texts.
pub fn widest<'t>(texts: impl IntoIterator<Item = &'t str>) -> f64 {
    let widths = texts.into_iter().map(|text| text_width(text, TEXT_SIZE));
    widths.fold(0.0, f64::max)
}

/// A share of the way from one colour to another.
pub fn mixed(from: RGBColor, to: RGBColor, share: f64) -> RGBColor {
    let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
    RGBColor(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

/// The colour at a share of the way through these.
pub fn shade(colors: &[RGBColor], share: f64) -> RGBColor {
    let place = share.clamp(0.0, 1.0) * (colors.len() - 1) as f64;
    let k = (place as usize).min(colors.len() - 2);
    mixed(colors[k], colors[k + 1], place - k as f64)
}

/// The points of a line without those too close to their predecessor to be seen.
fn visible(line: &[Point]) -> impl Iterator<Item = Point> {
    let mut kept = (f64::INFINITY, f64::INFINITY);
    line.iter().enumerate().filter_map(move |(k, &point)| {
        let is_end = k + 1 == line.len();
        if !is_end && (point.0 - kept.0).hypot(point.1 - kept.1) < 0.35 {
            return None;
        }
        kept = point;
        Some(point)
    })
}

fn grid((x, y): Point) -> (i32, i32) {
    ((x * UNITS).round() as i32, (y * UNITS).round() as i32)
}
