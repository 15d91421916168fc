//! Rectangles along x and y.

/// `[x0, y0, x1, y1]` (m): lowest and highest x and y.
pub type Rectangle = [f64; 4];

/// Holds no place: the smallest rectangle around nothing, from infinity to minus infinity.
pub const NOTHING: Rectangle = [
    f64::INFINITY,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NEG_INFINITY,
];

/// The smallest rectangle around places in the plane, in their unit; [`NOTHING`] when there is none.
pub fn around(places: impl IntoIterator<Item = [f64; 2]>) -> Rectangle {
    (places.into_iter()).fold(NOTHING, |b, [x, y]| hull(b, [x, y, x, y]))
}

/// The smallest rectangle around both.
pub fn hull(a: Rectangle, b: Rectangle) -> Rectangle {
    [
        a[0].min(b[0]),
        a[1].min(b[1]),
        a[2].max(b[2]),
        a[3].max(b[3]),
    ]
}

/// What both cover; its ends are in the wrong order when they share nothing.
pub fn intersection(a: Rectangle, b: Rectangle) -> Rectangle {
    [
        a[0].max(b[0]),
        a[1].max(b[1]),
        a[2].min(b[2]),
        a[3].min(b[3]),
    ]
}

/// With a margin (m) on all sides.
pub fn grown(b: Rectangle, by: f64) -> Rectangle {
    [b[0] - by, b[1] - by, b[2] + by, b[3] + by]
}

/// Whether two lie less than `gap` (m) apart; with a `gap` of zero, whether they share an area.
pub fn near(a: Rectangle, b: Rectangle, gap: f64) -> bool {
    a[0] < b[2] + gap && b[0] < a[2] + gap && a[1] < b[3] + gap && b[1] < a[3] + gap
}

/// Whether a place lies inside, not on a side.
pub fn holds_inside(b: Rectangle, x: f64, y: f64) -> bool {
    x > b[0] && x < b[2] && y > b[1] && y < b[3]
}
