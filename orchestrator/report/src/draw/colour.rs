//! Colour scales whose steps look equal, and the mapping of values onto them.

/// A colour, sRGB 0..255.
pub(crate) type Rgb = [f32; 3];

/// Stops of a colour scale, equally spaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Palette {
    /// Dark blue over green to yellow, lightness growing evenly (matplotlib's viridis).
    Viridis,
    /// Blue over white to red (ColorBrewer RdBu, reversed).
    BlueRed,
    /// Purple over white to orange (ColorBrewer PuOr, reversed).
    PurpleOrange,
}

const VIRIDIS: [u32; 10] = [
    0x440154, 0x482878, 0x3e4a89, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b,
    0xfde725,
];
const BLUE_RED: [u32; 11] = [
    0x053061, 0x2166ac, 0x4393c3, 0x92c5de, 0xd1e5f0, 0xf7f7f7, 0xfddbc7, 0xf4a582, 0xd6604d,
    0xb2182b, 0x67001f,
];
const PURPLE_ORANGE: [u32; 11] = [
    0x2d004b, 0x542788, 0x8073ac, 0xb2abd2, 0xd8daeb, 0xf7f7f7, 0xfee0b6, 0xfdb863, 0xe08214,
    0xb35806, 0x7f3b08,
];

impl Palette {
    fn stops(self) -> &'static [u32] {
        match self {
            Self::Viridis => &VIRIDIS,
            Self::BlueRed => &BLUE_RED,
            Self::PurpleOrange => &PURPLE_ORANGE,
        }
    }

    /// Colour at `t` in 0..1; values outside take the end's colour.
    pub(crate) fn at(self, t: f32) -> Rgb {
        let stops = self.stops();
        let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) } * (stops.len() - 1) as f32;
        let i = (t as usize).min(stops.len() - 2);
        let (a, b, w) = (rgb(stops[i]), rgb(stops[i + 1]), t - i as f32);
        let mix = |c: usize| a[c] + (b[c] - a[c]) * w;
        [mix(0), mix(1), mix(2)]
    }

    /// The stops as CSS colours with their place in 0..1.
    pub(crate) fn css(self) -> Vec<(f64, String)> {
        let stops = self.stops();
        let last = (stops.len() - 1) as f64;
        (stops.iter())
            .enumerate()
            .map(|(i, c)| (i as f64 / last, format!("#{c:06x}")))
            .collect()
    }
}

fn rgb(hex: u32) -> Rgb {
    let part = |shift: u32| ((hex >> shift) & 255) as f32;
    [part(16), part(8), part(0)]
}

/// A range of SI values on a palette.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    /// Colours.
    pub(crate) palette: Palette,
    /// Value at the lower end.
    pub(crate) low: f64,
    /// Value at the upper end.
    pub(crate) high: f64,
}

impl Scale {
    /// From 0 to `high`.
    pub(crate) fn from_zero(high: f64) -> Self {
        let (palette, low) = (Palette::Viridis, 0.0);
        Self { palette, low, high }
    }

    /// From `-high` to `high`.
    pub(crate) fn about_zero(palette: Palette, high: f64) -> Self {
        let low = -high;
        Self { palette, low, high }
    }

    /// From the smallest to the largest value, each rounded outwards to a round number of the unit `per` (a factor from SI).
    pub(crate) fn fitted([low, high]: [f64; 2], per: f64) -> Self {
        let [low, high] = [low * per, high * per];
        let span = (high - low)
            .max(1e-3 * low.abs().max(high.abs()))
            .max(1e-12);
        let power = 10f64.powf((span / 8.0).log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * power);
        let step = steps.into_iter().find(|s| *s >= span / 8.0);
        let step = step.unwrap_or(10.0 * power);
        let [first, last] = [(low / step + 1e-6).floor(), (high / step - 1e-6).ceil()];
        Self {
            palette: Palette::Viridis,
            low: first * step / per,
            high: last.max(first + 1.0) * step / per,
        }
    }

    /// Place of a value in 0..1, not clamped.
    pub(crate) fn place(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }
}

/// The end of a scale that shows the part `quantile` of the sizes in `values`, at least `least`, rounded up to
/// 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times a power of ten of the unit `per` (a factor from SI).
pub(crate) fn end_of_scale(
    values: impl Iterator<Item = f64>,
    quantile: f64,
    least: f64,
    per: f64,
) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).filter(|v| v.is_finite()).collect();
    let at = ((sizes.len() as f64 * quantile) as usize).min(sizes.len().saturating_sub(1));
    let size = if sizes.is_empty() {
        0.0
    } else {
        *sizes.select_nth_unstable_by(at, f64::total_cmp).1
    };
    let value = size.max(least).max(1e-12) * per;
    let power = 10f64.powf(value.log10().floor());
    let steps = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let step = (steps.into_iter())
        .find(|s| s * power >= value * (1.0 - 1e-9))
        .unwrap_or(10.0);
    step * power / per
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lightness(c: Rgb) -> f32 {
        let linear = c.map(|v| (v / 255.0).powf(2.2));
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    #[test]
    fn viridis_grows_lighter_all_the_way() {
        let all: Vec<f32> = (0..=100)
            .map(|i| lightness(Palette::Viridis.at(i as f32 / 100.0)))
            .collect();
        assert!(all.windows(2).all(|w| w[1] > w[0]));
    }

    #[test]
    fn diverging_scales_are_lightest_in_the_middle_and_darken_to_both_ends() {
        for palette in [Palette::BlueRed, Palette::PurpleOrange] {
            let l = |t| lightness(palette.at(t));
            for i in 0..50 {
                let (a, b) = (i as f32 / 100.0, (i + 1) as f32 / 100.0);
                assert!(l(a) < l(b) && l(1.0 - a) < l(1.0 - b), "{palette:?} at {a}");
            }
        }
    }

    #[test]
    fn values_beyond_a_scale_take_its_end() {
        assert_eq!(Palette::Viridis.at(7.0), Palette::Viridis.at(1.0));
        assert_eq!(Palette::Viridis.at(-1.0), rgb(0x440154));
        assert_eq!(Palette::Viridis.at(f32::NAN), rgb(0x440154));
    }

    #[test]
    fn a_fitted_scale_begins_and_ends_at_round_numbers_about_its_values() {
        let of = |range, per| {
            let Scale { low, high, .. } = Scale::fitted(range, per);
            [low, high].map(|v| (v * per * 1e6).round() / 1e6)
        };
        assert_eq!(of([0.000_391, 0.000_462], 1e3), [0.39, 0.47]);
        assert_eq!(of([0.0, 1.0], 1.0), [0.0, 1.0]);
        // The same everywhere: still a scale.
        let [low, high] = of([0.0004, 0.0004], 1e3);
        assert!(low <= 0.4 && high >= 0.4 && high > low, "{low} {high}");
    }

    #[test]
    fn scales_end_at_round_numbers_and_ignore_a_few_outliers() {
        let values = (0..1000).map(|i| if i == 7 { 1.0 } else { 0.0023 });
        assert_eq!(end_of_scale(values, 0.995, 0.0, 1e3), 0.0025);
        assert_eq!(end_of_scale(std::iter::empty(), 0.995, 0.002, 1e3), 0.002);
    }
}
