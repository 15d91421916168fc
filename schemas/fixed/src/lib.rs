//! Elementary functions whose bits are the same on every machine.
//!
//! The C library's `sin`, `pow`, `atan2` and the like choose their code by the processor that they run on (with or without fused
//! multiply-add), and change from version to version: their last bits differ, and a run of a hundred thousand steps makes every digit of
//! them. What reaches an artifact takes these instead (`docs/decisions/0037`): plain Rust of the `libm` crate, which adds, multiplies,
//! divides and takes roots one after the other, each rounded once, as IEEE 754 has it. Errors are within a unit in the last place or so.
//!
//! `+ - * /`, `sqrt`, `floor`, `round`, `rem_euclid`, `mul_add` (one rounding wherever it runs) and `powi` (multiplications that the compiler
//! lays down) are the same everywhere already.
//!
//! ```
//! use plyflow_fixed::FixedBits;
//! assert_eq!(0.5f64.fixed_sin().to_bits(), 0x3fde_aee8_744b_05f0);
//! ```

/// The functions of `f64` whose bits the C library does not fix, under names that tell them apart.
pub trait FixedBits: Sized {
    /// Sine of an angle (rad).
    #[must_use]
    fn fixed_sin(self) -> Self;
    /// Cosine of an angle (rad).
    #[must_use]
    fn fixed_cos(self) -> Self;
    /// Tangent of an angle (rad).
    #[must_use]
    fn fixed_tan(self) -> Self;
    /// Arc sine (rad); NaN outside of -1 .. 1.
    #[must_use]
    fn fixed_asin(self) -> Self;
    /// Arc cosine (rad); NaN outside of -1 .. 1.
    #[must_use]
    fn fixed_acos(self) -> Self;
    /// Arc tangent (rad).
    #[must_use]
    fn fixed_atan(self) -> Self;
    /// Hyperbolic sine.
    #[must_use]
    fn fixed_sinh(self) -> Self;
    /// Hyperbolic cosine.
    #[must_use]
    fn fixed_cosh(self) -> Self;
    /// Hyperbolic tangent.
    #[must_use]
    fn fixed_tanh(self) -> Self;
    /// e to this power.
    #[must_use]
    fn fixed_exp(self) -> Self;
    /// 2 to this power.
    #[must_use]
    fn fixed_exp2(self) -> Self;
    /// e to this power, less 1, without cancellation.
    #[must_use]
    fn fixed_exp_m1(self) -> Self;
    /// Natural logarithm; NaN below 0.
    #[must_use]
    fn fixed_ln(self) -> Self;
    /// Natural logarithm of 1 and this, without cancellation.
    #[must_use]
    fn fixed_ln_1p(self) -> Self;
    /// Logarithm to base 2; NaN below 0.
    #[must_use]
    fn fixed_log2(self) -> Self;
    /// Logarithm to base 10; NaN below 0.
    #[must_use]
    fn fixed_log10(self) -> Self;
    /// Cubic root, with the sign.
    #[must_use]
    fn fixed_cbrt(self) -> Self;
    /// Angle (rad, -pi to pi) of the point with this as its second coordinate and `other` as its first.
    #[must_use]
    fn fixed_atan2(self, other: Self) -> Self;
    /// This to the power `other`.
    #[must_use]
    fn fixed_powf(self, other: Self) -> Self;
    /// Root of the sum of both squares, without overflow between.
    #[must_use]
    fn fixed_hypot(self, other: Self) -> Self;
    /// Sine and cosine of an angle (rad).
    #[must_use]
    fn fixed_sin_cos(self) -> (Self, Self);
}

impl FixedBits for f64 {
    #[inline]
    fn fixed_sin(self) -> Self {
        libm::sin(self)
    }
    #[inline]
    fn fixed_cos(self) -> Self {
        libm::cos(self)
    }
    #[inline]
    fn fixed_tan(self) -> Self {
        libm::tan(self)
    }
    #[inline]
    fn fixed_asin(self) -> Self {
        libm::asin(self)
    }
    #[inline]
    fn fixed_acos(self) -> Self {
        libm::acos(self)
    }
    #[inline]
    fn fixed_atan(self) -> Self {
        libm::atan(self)
    }
    #[inline]
    fn fixed_sinh(self) -> Self {
        libm::sinh(self)
    }
    #[inline]
    fn fixed_cosh(self) -> Self {
        libm::cosh(self)
    }
    #[inline]
    fn fixed_tanh(self) -> Self {
        libm::tanh(self)
    }
    #[inline]
    fn fixed_exp(self) -> Self {
        libm::exp(self)
    }
    #[inline]
    fn fixed_exp2(self) -> Self {
        libm::exp2(self)
    }
    #[inline]
    fn fixed_exp_m1(self) -> Self {
        libm::expm1(self)
    }
    #[inline]
    fn fixed_ln(self) -> Self {
        libm::log(self)
    }
    #[inline]
    fn fixed_ln_1p(self) -> Self {
        libm::log1p(self)
    }
    #[inline]
    fn fixed_log2(self) -> Self {
        libm::log2(self)
    }
    #[inline]
    fn fixed_log10(self) -> Self {
        libm::log10(self)
    }
    #[inline]
    fn fixed_cbrt(self) -> Self {
        libm::cbrt(self)
    }
    #[inline]
    fn fixed_atan2(self, other: Self) -> Self {
        libm::atan2(self, other)
    }
    #[inline]
    fn fixed_powf(self, other: Self) -> Self {
        libm::pow(self, other)
    }
    #[inline]
    fn fixed_hypot(self, other: Self) -> Self {
        libm::hypot(self, other)
    }
    #[inline]
    fn fixed_sin_cos(self) -> (Self, Self) {
        (libm::sin(self), libm::cos(self))
    }
}
