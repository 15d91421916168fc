//! Plots over two axes.

use std::borrow::Cow;

/// Colours there are; further series take them again and carry marks.
pub(crate) const COLOURS: usize = 8;
/// Larger values are taken for infinite: differences of them would be.
pub(crate) const LARGEST: f64 = 1e150;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Style {
    /// Joined by a line.
    Line,
    /// Joined by a dashed line.
    Dashed,
    /// A marker at each value.
    Points,
}

/// One series of a plot.
#[derive(Debug, Clone)]
pub(crate) struct Series<'a> {
    /// Name in the legend.
    pub(crate) name: Cow<'a, str>,
    /// Number of its colour; those from [`COLOURS`] on are told apart by marks on the line.
    pub(crate) colour: usize,
    pub(crate) style: Style,
    /// As many as `y`, in the unit of the axis. Where either is no number the series has a gap.
    pub(crate) x: Cow<'a, [f64]>,
    pub(crate) y: Cow<'a, [f64]>,
}

/// What is told of the values at one place, from the smallest to the largest: lower extreme, lower whisker, lower quartile, median,
/// upper quartile, upper whisker, upper extreme.
pub(crate) type Spread = [f64; 7];

/// Box plots of one colour.
#[derive(Debug, Clone)]
pub(crate) struct Boxes<'a> {
    /// Name in the legend.
    pub(crate) name: Cow<'a, str>,
    /// Number of its colour.
    pub(crate) colour: usize,
    /// As many as `spread`, in the unit of the axis.
    pub(crate) x: Vec<f64>,
    pub(crate) spread: Vec<Spread>,
}

/// A plot of series over two axes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Plot<'a> {
    pub(crate) title: Cow<'a, str>,
    /// Labels of the axes, with their units.
    pub(crate) x_label: Cow<'a, str>,
    pub(crate) y_label: Cow<'a, str>,
    pub(crate) series: Vec<Series<'a>>,
    /// Box plots, behind the series.
    pub(crate) boxes: Vec<Boxes<'a>>,
    /// Whether the vertical axis begins at zero whatever the values.
    pub(crate) from_zero: bool,
    /// A horizontal line with its name.
    pub(crate) bound: Option<(f64, &'a str)>,
    /// Values above this are cut off.
    pub(crate) ceiling: Option<f64>,
    /// Whether the series are named though there is one only.
    pub(crate) legend_of_one: bool,
    /// Width and height on the page (px).
    pub(crate) size: [f64; 2],
}

impl Boxes<'_> {
    /// All places and values.
    pub(crate) fn places(&self) -> impl Iterator<Item = (f64, f64)> {
        let pairs = self.x.iter().zip(&self.spread);
        pairs.flat_map(|(x, all)| all.map(|y| (*x, y)))
    }
}

impl Plot<'_> {
    /// All places that can be drawn; without one there is no plot.
    pub(crate) fn places(&self) -> impl Iterator<Item = (f64, f64)> {
        let all = self.series.iter().flat_map(|s| s.x.iter().zip(s.y.iter()));
        let all = all.map(|(x, y)| (*x, *y));
        let boxes = self.boxes.iter().flat_map(Boxes::places);
        all.chain(boxes)
            .filter(|(x, y)| x.abs() < LARGEST && y.abs() < LARGEST)
    }
}
