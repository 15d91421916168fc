//! Which units there are, and which words people write for them.

use crate::units::dimension::Exponents;

/// SI prefixes and their powers of ten.
pub(super) const PREFIXES: [(&str, i32); 12] = [
    ("p", -12),
    ("n", -9),
    ("u", -6),
    ("µ", -6), // micro sign
    ("μ", -6), // Greek mu
    ("m", -3),
    ("c", -2),
    ("d", -1),
    ("h", 2),
    ("k", 3),
    ("M", 6),
    ("G", 9),
];

/// A named unit: symbol, whether it takes SI prefixes, power of ten, integer factor, degrees, exponents.
pub(super) struct Symbol(
    pub(super) &'static str,
    pub(super) bool,
    pub(super) i32,
    pub(super) u64,
    pub(super) i32,
    pub(super) Exponents,
);

pub(super) const SYMBOLS: [Symbol; 36] = [
    Symbol("m", true, 0, 1, 0, [1, 0, 0, 0, 0]),
    Symbol("g", true, -3, 1, 0, [0, 1, 0, 0, 0]),
    Symbol("s", true, 0, 1, 0, [0, 0, 1, 0, 0]),
    Symbol("N", true, 0, 1, 0, [1, 1, -2, 0, 0]),
    Symbol("Pa", true, 0, 1, 0, [-1, 1, -2, 0, 0]),
    Symbol("J", true, 0, 1, 0, [2, 1, -2, 0, 0]),
    Symbol("W", true, 0, 1, 0, [2, 1, -3, 0, 0]),
    Symbol("Hz", true, 0, 1, 0, [0, 0, -1, 0, 0]),
    Symbol("bar", true, 5, 1, 0, [-1, 1, -2, 0, 0]),
    Symbol("rad", true, 0, 1, 0, [0, 0, 0, 0, 1]),
    Symbol("K", true, 0, 1, 0, [0, 0, 0, 1, 0]),
    Symbol("t", false, 3, 1, 0, [0, 1, 0, 0, 0]),
    Symbol("l", true, -3, 1, 0, [3, 0, 0, 0, 0]),
    Symbol("min", false, 0, 60, 0, [0, 0, 1, 0, 0]),
    Symbol("h", false, 0, 3600, 0, [0, 0, 1, 0, 0]),
    Symbol("deg", false, 0, 1, 1, [0, 0, 0, 0, 1]),
    Symbol("°", false, 0, 1, 1, [0, 0, 0, 0, 1]),
    Symbol("%", false, -2, 1, 0, [0, 0, 0, 0, 0]),
    Symbol("1", false, 0, 1, 0, [0, 0, 0, 0, 0]),
    // Of another system, exact by definition: the yard and the pound of 1959, standard gravity.
    Symbol("in", false, -4, 254, 0, [1, 0, 0, 0, 0]),
    Symbol("inch", false, -4, 254, 0, [1, 0, 0, 0, 0]),
    Symbol("mil", false, -7, 254, 0, [1, 0, 0, 0, 0]),
    Symbol("thou", false, -7, 254, 0, [1, 0, 0, 0, 0]),
    Symbol("ft", false, -4, 3048, 0, [1, 0, 0, 0, 0]),
    Symbol("yd", false, -4, 9144, 0, [1, 0, 0, 0, 0]),
    Symbol("lb", false, -8, 45_359_237, 0, [0, 1, 0, 0, 0]),
    Symbol("oz", false, -12, 28_349_523_125, 0, [0, 1, 0, 0, 0]),
    Symbol("lbf", false, -13, 44_482_216_152_605, 0, [1, 1, -2, 0, 0]),
    Symbol(
        "ozf",
        false,
        -17,
        27_801_385_095_378_125,
        0,
        [1, 1, -2, 0, 0],
    ),
    Symbol("kgf", false, -5, 980_665, 0, [1, 1, -2, 0, 0]),
    Symbol("gf", false, -8, 980_665, 0, [1, 1, -2, 0, 0]),
    Symbol("atm", false, 0, 101_325, 0, [-1, 1, -2, 0, 0]),
    Symbol("mmHg", false, -9, 133_322_387_415, 0, [-1, 1, -2, 0, 0]),
    Symbol("inHg", false, -9, 3_386_388_640_341, 0, [-1, 1, -2, 0, 0]),
    // These two by their parts: see `COMPOUND`.
    Symbol("psi", false, -5, 44_482_216_152_605, 0, [-1, 1, -2, 0, 0]),
    Symbol("ksi", false, -2, 44_482_216_152_605, 0, [-1, 1, -2, 0, 0]),
];

/// Units whose factor is no decimal number: symbol, and by what it is divided.
pub(super) const COMPOUND: [(&str, u64); 2] = [("psi", 254 * 254), ("ksi", 254 * 254)];

/// Units that are not taken, and what to write instead.
pub(super) const FOREIGN: [(&str, &str, Exponents); 9] = [
    (
        "degF",
        "degC: 32 degF = 0 degC, and 1.8 degF more are 1 degC more",
        [0, 0, 0, 1, 0],
    ),
    (
        "\u{b0}F",
        "degC: 32 degF = 0 degC, and 1.8 degF more are 1 degC more",
        [0, 0, 0, 1, 0],
    ),
    ("mi", "km: 1 mi = 1.609344 km", [1, 0, 0, 0, 0]),
    ("dyn", "N: 1 dyn = 1e-5 N", [1, 1, -2, 0, 0]),
    ("kp", "N: 1 kp = 9.80665 N", [1, 1, -2, 0, 0]),
    ("kip", "N: 1 kip = 4448.2216152605 N", [1, 1, -2, 0, 0]),
    ("torr", "Pa: 1 torr = 133.322 Pa", [-1, 1, -2, 0, 0]),
    ("\u{c5}", "nm: 1 \u{c5} = 0.1 nm", [1, 0, 0, 0, 0]),
    ("rpm", "1/s or rad/s", [0, 0, -1, 0, 0]),
];

/// Words people write for units.
pub(super) const ALIASES: [(&str, &str); 44] = [
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("minute", "min"),
    ("minutes", "min"),
    ("mins", "min"),
    ("hour", "h"),
    ("hours", "h"),
    ("hr", "h"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("meter", "m"),
    ("metre", "m"),
    ("meters", "m"),
    ("metres", "m"),
    ("millimeter", "mm"),
    ("millimetre", "mm"),
    ("gram", "g"),
    ("newton", "N"),
    ("pascal", "Pa"),
    ("celsius", "degC"),
    ("percent", "%"),
    ("gsm", "g/m2"),
    ("inches", "in"),
    ("\"", "in"),
    ("\u{2033}", "in"),
    ("''", "in"),
    ("foot", "ft"),
    ("feet", "ft"),
    ("'", "ft"),
    ("\u{2032}", "ft"),
    ("mils", "mil"),
    ("yard", "yd"),
    ("yards", "yd"),
    ("lbs", "lb"),
    ("pound", "lb"),
    ("pounds", "lb"),
    ("ounce", "oz"),
    ("ounces", "oz"),
    ("gram-force", "gf"),
    ("pond", "gf"),
];
