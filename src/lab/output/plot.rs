//! Plots as SVG: closed forms as lines, measurements as dots over them.

use std::fmt::Write;

/// One curve: a line or a set of dots.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend.
    pub label: String,
    /// Places on both axes.
    pub points: Vec<[f64; 2]>,
    /// True for a line: closed forms; false for dots: measurements.
    pub line: bool,
}

/// Curves over two axes.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Title of the plot.
    pub title: String,
    /// Quantities on the axes, with units.
    pub axes: [String; 2],
    /// True for decades instead of a linear scale, per axis.
    pub logarithmic: [bool; 2],
    /// The curves, in the order of the legend.
    pub curves: Vec<Curve>,
}

impl Curve {
    /// A curve of measurements.
    pub fn dots(label: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { label: label.into(), points, line: false }
    }

    /// A curve of a closed form.
    pub fn line(label: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { line: true, ..Self::dots(label, points) }
    }
}

impl Plot {
    /// A plot on linear axes.
    pub fn linear(title: impl Into<String>, axes: [&str; 2], curves: Vec<Curve>) -> Self {
        Self { title: title.into(), axes: axes.map(String::from), logarithmic: [false; 2], curves }
    }

    /// Returns whether the plot has names, something to draw, and only points that its axes can show.
    pub fn is_drawable(&self) -> bool {
        let shows = |p: &[f64; 2]| {
            let on = |i: usize| p[i].is_finite() && (!self.logarithmic[i] || p[i] > 0.0);
            on(0) && on(1)
        };
        let named = !self.title.is_empty() && self.axes.iter().all(|a| !a.is_empty());
        let drawn =
            |c: &Curve| !c.label.is_empty() && !c.points.is_empty() && c.points.iter().all(shows);
        named
            && self.curves.iter().all(drawn)
            && self.curves.iter().any(|c| c.line)
            && self.curves.iter().any(|c| !c.line)
    }
}

/// Size of a plot and of the frame inside it, px.
const SIZE: [f64; 2] = [560.0, 340.0];
const LEFT: f64 = 70.0;
const TOP: f64 = 28.0;
const FRAME: [f64; 2] = [SIZE[0] - LEFT - 12.0, SIZE[1] - TOP - 60.0];

/// Colours that people with colour blindness can tell apart (Okabe and Ito 2008), without the yellow.
const COLOURS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#555555"];

/// One axis: the range that it shows, in decades if logarithmic, and its ticks.
struct Axis {
    logarithmic: bool,
    low: f64,
    high: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, logarithmic: bool) -> Self {
        let scaled = values.map(|v| if logarithmic { v.log10() } else { v });
        let (low, high) =
            scaled.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let margin = if high > low { 0.03 * (high - low) } else { 0.5 * high.abs().max(1.0) };
        Self { logarithmic, low: low - margin, high: high + margin }
    }

    /// Position on the axis: 0 at the low end, 1 at the high one.
    fn place(&self, v: f64) -> f64 {
        let v = if self.logarithmic { v.log10() } else { v };
        (v - self.low) / (self.high - self.low)
    }

    /// Returns about seven round values.
    fn ticks(&self) -> Vec<f64> {
        let rough = (self.high - self.low) / 7.0;
        let decade = 10f64.powf(rough.log10().floor());
        let steps = if self.logarithmic && rough < 1.0 {
            return self.within_decades();
        } else {
            [1.0, 2.0, 5.0, 10.0]
        };
        let step =
            steps.into_iter().map(|s| s * decade).find(|s| *s >= rough).unwrap_or(10.0 * decade);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step) as i64);
        let values = (first..=last).map(|i| i as f64 * step);
        values.map(|v| if self.logarithmic { 10f64.powf(v) } else { v }).collect()
    }

    /// 1, 2 and 5 of every decade shown, or only 1 where that would be many.
    fn within_decades(&self) -> Vec<f64> {
        let many = self.high - self.low > 2.5;
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        let all = (first..=last).flat_map(|d| [1.0, 2.0, 5.0].map(|m| (m, m * 10f64.powi(d))));
        let shown = |&(m, v): &(f64, f64)| {
            (!many || m == 1.0) && (self.low..=self.high).contains(&v.log10())
        };
        all.filter(shown).map(|(_, v)| v).collect()
    }
}

/// Label of a tick.
fn label(v: f64) -> String {
    let size = v.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{v:.0e}");
    }
    let text = format!("{v:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// Text with the characters that HTML and SVG read as markup replaced.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '\'' => out.push_str("&#39;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// The plot as an `<svg>` element, its legend included.
pub fn svg(plot: &Plot) -> String {
    let axis = |i: usize| {
        let values = plot.curves.iter().flat_map(|c| &c.points).map(move |p| p[i]);
        Axis::new(values, plot.logarithmic[i])
    };
    let axes = [axis(0), axis(1)];
    let height = SIZE[1] + 16.0 * plot.curves.len() as f64;
    let mut out = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {} {height}' width='{}' height='{height}' \
         font-family='sans-serif' font-size='12' role='img' aria-label='{}'>\n",
        SIZE[0],
        SIZE[0],
        escape(&plot.title)
    );
    grid(&mut out, plot, &axes);
    for (i, curve) in plot.curves.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let before = plot.curves[..i].iter().filter(|c| !c.line).count();
        drawn(&mut out, curve, &dot(colour, before), colour, &axes);
        legend(&mut out, curve, &dot(colour, before), colour, SIZE[1] + 16.0 * i as f64);
    }
    out.push_str("</svg>\n");
    out
}

fn position(axes: &[Axis; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    [LEFT + axes[0].place(x) * FRAME[0], TOP + (1.0 - axes[1].place(y)) * FRAME[1]]
}

fn grid(out: &mut String, plot: &Plot, axes: &[Axis; 2]) {
    let [right, bottom] = [LEFT + FRAME[0], TOP + FRAME[1]];
    let mut text = |x: f64, y: f64, anchor: &str, style: &str, what: &str| {
        let what = escape(what);
        let _ = writeln!(
            out,
            "<text x='{x:.1}' y='{y:.1}' text-anchor='{anchor}' {style}>{what}</text>"
        );
    };
    let middle = LEFT + FRAME[0] / 2.0;
    text(middle, 18.0, "middle", "font-weight='bold'", &plot.title);
    text(middle, bottom + 38.0, "middle", "", &plot.axes[0]);
    let y = TOP + FRAME[1] / 2.0;
    let turned = format!("transform='rotate(-90 14 {y})'");
    text(14.0, y, "middle", &turned, &plot.axes[1]);
    let mut lines = String::new();
    for v in axes[0].ticks() {
        let x = LEFT + axes[0].place(v) * FRAME[0];
        text(x, bottom + 18.0, "middle", "", &label(v));
        let _ = write!(lines, "M{x:.1} {TOP}V{bottom}");
    }
    for v in axes[1].ticks() {
        let y = TOP + (1.0 - axes[1].place(v)) * FRAME[1];
        text(LEFT - 6.0, y + 4.0, "end", "", &label(v));
        let _ = write!(lines, "M{LEFT} {y:.1}H{right}");
    }
    let _ = writeln!(
        out,
        "<path d='{lines}' stroke='#ddd' fill='none'/>\n\
         <rect x='{LEFT}' y='{TOP}' width='{}' height='{}' fill='none' stroke='#666'/>",
        FRAME[0], FRAME[1]
    );
}

/// Radius and look of dots that follow `before` others: rings around those, so that all are visible
/// where measurements agree.
fn dot(colour: &str, before: usize) -> String {
    match before {
        0 => format!("r='2.4' fill='{colour}'"),
        n => format!(
            "r='{:.1}' fill='none' stroke='{colour}' stroke-width='1.2'",
            2.4 + 1.7 * n as f64
        ),
    }
}

fn drawn(out: &mut String, curve: &Curve, dot: &str, colour: &str, axes: &[Axis; 2]) {
    let places = curve.points.iter().map(|&p| position(axes, p));
    if curve.line {
        let points: String = places.map(|[x, y]| format!("{x:.1},{y:.1} ")).collect();
        let _ = writeln!(
            out,
            "<polyline points='{}' fill='none' stroke='{colour}' stroke-width='1.5'/>",
            points.trim_end()
        );
        return;
    }
    for [x, y] in places {
        let _ = writeln!(out, "<circle cx='{x:.1}' cy='{y:.1}' {dot}/>");
    }
}

fn legend(out: &mut String, curve: &Curve, dot: &str, colour: &str, y: f64) {
    let mark = if curve.line {
        format!("<path d='M{LEFT} {y}h22' stroke='{colour}' stroke-width='2'/>")
    } else {
        format!("<circle cx='{}' cy='{y}' {dot}/>", LEFT + 11.0)
    };
    let _ = writeln!(
        out,
        "{mark}<text x='{}' y='{}'>{}</text>",
        LEFT + 30.0,
        y + 4.0,
        escape(&curve.label)
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = |low: f64, high: f64, log| Axis::new([low, high].into_iter(), log);
        let labels = |a: Axis| a.ticks().into_iter().map(label).collect::<Vec<_>>();
        assert_eq!(labels(axis(0.0, 1.0, false)), ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
        assert_eq!(labels(axis(-3.0, 3.0, false)).len(), 7);
        assert_eq!(labels(axis(1.0, 1000.0, true)), ["1", "10", "100", "1000"]);
        assert_eq!(labels(axis(1.0, 12.0, true)), ["1", "2", "5", "10"]);
        assert!(!labels(axis(7.0, 7.0, false)).is_empty());
    }

    #[test]
    fn dots_lie_where_their_values_are() {
        let plot = Plot::linear(
            "a < b",
            ["x", "y"],
            vec![
                Curve::line("law", vec![[0.0, 0.0], [100.0, 10.0]]),
                Curve::dots("measured", vec![[50.0, 5.0]]),
            ],
        );
        let svg = svg(&plot);
        let middle =
            format!("<circle cx='{:.1}' cy='{:.1}'", LEFT + FRAME[0] / 2.0, TOP + FRAME[1] / 2.0);
        assert!(svg.contains(&middle), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.contains("<polyline"));
    }
}
