//! The bits of the functions are the stored ones, wherever the test runs; and they are those of the functions that they stand for.

use plyflow_fixed::FixedBits;

type One = (&'static str, fn(f64) -> f64, fn(f64) -> f64, [f64; 2], u64);
type Two = (
    &'static str,
    fn(f64, f64) -> f64,
    fn(f64, f64) -> f64,
    [f64; 4],
    u64,
);

/// Name, function, that of the C library, range of arguments, and the digest of the bits over it.
const ONE: [One; 17] = [
    (
        "sin",
        f64::fixed_sin,
        f64::sin,
        [-1000.0, 1000.0],
        0xb965_321f_f504_3975,
    ),
    (
        "cos",
        f64::fixed_cos,
        f64::cos,
        [-1000.0, 1000.0],
        0x603a_a1da_633d_b421,
    ),
    (
        "tan",
        f64::fixed_tan,
        f64::tan,
        [-1000.0, 1000.0],
        0x55ef_40e5_49cd_eadd,
    ),
    (
        "asin",
        f64::fixed_asin,
        f64::asin,
        [-1.0, 1.0],
        0x724e_5dbe_d3a5_5137,
    ),
    (
        "acos",
        f64::fixed_acos,
        f64::acos,
        [-1.0, 1.0],
        0xbd01_8f7c_3dde_15a9,
    ),
    (
        "atan",
        f64::fixed_atan,
        f64::atan,
        [-100.0, 100.0],
        0xc5d1_34fc_aad0_f732,
    ),
    (
        "sinh",
        f64::fixed_sinh,
        f64::sinh,
        [-30.0, 30.0],
        0xae05_3b65_1e47_15e5,
    ),
    (
        "cosh",
        f64::fixed_cosh,
        f64::cosh,
        [-30.0, 30.0],
        0x37b9_f0c0_e70e_cb7a,
    ),
    (
        "tanh",
        f64::fixed_tanh,
        f64::tanh,
        [-5.0, 5.0],
        0x4d3e_aefc_afd5_724b,
    ),
    (
        "exp",
        f64::fixed_exp,
        f64::exp,
        [-700.0, 700.0],
        0x561b_8637_5ca9_a40b,
    ),
    (
        "exp2",
        f64::fixed_exp2,
        f64::exp2,
        [-1000.0, 1000.0],
        0xfe42_e65e_f7c7_1a35,
    ),
    (
        "exp_m1",
        f64::fixed_exp_m1,
        f64::exp_m1,
        [-40.0, 40.0],
        0x9f36_2b08_79bb_4c79,
    ),
    (
        "ln",
        f64::fixed_ln,
        f64::ln,
        [0.0, 1000000.0],
        0x0cc6_0e22_db05_0f01,
    ),
    (
        "ln_1p",
        f64::fixed_ln_1p,
        f64::ln_1p,
        [-1.0, 50.0],
        0x0646_760f_0bc5_deaa,
    ),
    (
        "log2",
        f64::fixed_log2,
        f64::log2,
        [0.0, 1000000.0],
        0x667c_8950_684b_9827,
    ),
    (
        "log10",
        f64::fixed_log10,
        f64::log10,
        [0.0, 1000000.0],
        0xe1a8_dff9_c9e2_686a,
    ),
    (
        "cbrt",
        f64::fixed_cbrt,
        f64::cbrt,
        [-1000000.0, 1000000.0],
        0xe6fb_9ed6_763c_4464,
    ),
];

/// The same of two arguments: range of the first, of the second.
const TWO: [Two; 3] = [
    (
        "atan2",
        f64::fixed_atan2,
        f64::atan2,
        [-10.0, 10.0, -10.0, 10.0],
        0x47b0_f66a_9cae_3c1e,
    ),
    (
        "powf",
        f64::fixed_powf,
        f64::powf,
        [0.0, 100.0, -20.0, 20.0],
        0x6100_df9a_73a4_3851,
    ),
    (
        "hypot",
        f64::fixed_hypot,
        f64::hypot,
        [-1000.0, 1000.0, -1000.0, 1000.0],
        0xf510_1009_5c09_1d5b,
    ),
];

/// Arguments for each function.
const COUNT: usize = 20_000;

/// Numbers from 0 to 1.
struct Sequence(u64);

impl Sequence {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// FNV-1a over words.
fn digest(words: impl Iterator<Item = u64>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |sum, w| {
        (sum ^ w)
            .wrapping_mul(0x0000_0100_0000_01b3)
            .rotate_left(17)
    })
}

fn close(name: &str, got: f64, want: f64, at: &str) {
    let off = (got - want).abs();
    assert!(
        off <= 1e-15 * want.abs() + 1e-300 || (got.is_nan() && want.is_nan()),
        "{name}({at}) = {got:e}, not {want:e}"
    );
}

#[test]
fn bits_are_the_stored_ones_and_values_those_of_the_functions() {
    let mut wrong = Vec::new();
    for (name, fixed, usual, [low, high], stored) in ONE {
        let mut s = Sequence(1);
        let x: Vec<f64> = (0..COUNT).map(|_| s.between(low, high)).collect();
        for x in &x {
            close(name, fixed(*x), usual(*x), &x.to_string());
        }
        let found = digest(x.iter().map(|x| fixed(*x).to_bits()));
        if found != stored {
            wrong.push(format!("{name} {found:#018x}"));
        }
    }
    for (name, fixed, usual, [a, b, c, d], stored) in TWO {
        let mut s = Sequence(2);
        let x: Vec<(f64, f64)> = (0..COUNT)
            .map(|_| (s.between(a, b), s.between(c, d)))
            .collect();
        for (x, y) in &x {
            close(name, fixed(*x, *y), usual(*x, *y), &format!("{x}, {y}"));
        }
        let found = digest(x.iter().map(|(x, y)| fixed(*x, *y).to_bits()));
        if found != stored {
            wrong.push(format!("{name} {found:#018x}"));
        }
    }
    assert!(
        wrong.is_empty(),
        "other bits than the stored ones: {wrong:#?}"
    );
}

#[test]
fn sine_and_cosine_together_are_those_alone() {
    for i in 0..1000 {
        let x = 0.01 * f64::from(i);
        assert_eq!(x.fixed_sin_cos(), (x.fixed_sin(), x.fixed_cos()));
    }
}
