//! Eight f64 lanes: one trait, one type per instruction set.
//!
//! A kernel is written once, generic over [`Lanes`], and instantiated by `dispatch!` for
//! AVX-512, for AVX2 and for any machine. Only IEEE operations with one rounding are offered (no
//! fused multiply-add), so all three give the same bits.

use core::cell::Cell;
use core::marker::PhantomData;
use core::ops::{Add, Div, Mul, Neg, Sub};
use core::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError};

/// Lanes in one value; batches are a multiple of it.
pub const WIDTH: usize = 8;

/// 1.5 * 2^52: adding it rounds to a whole number.
pub(crate) const SHIFT: f64 = 6_755_399_441_055_744.0;

/// Eight f64 values treated alike.
///
/// Other crates have [`Portable`] alone. What the wide types do may run only on a machine with their instructions, which the
/// kernels' entries look for:
///
/// ```
/// use plyflow_kernels::{Lanes, Portable};
/// assert!(Portable::all(Portable::splat(1.0).lt(Portable::splat(2.0))));
/// ```
///
/// ```compile_fail
/// use plyflow_kernels::{Avx512, Lanes};
/// let _ = Avx512::splat(1.0);
/// ```
pub trait Lanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// One truth value per lane.
    type Mask: Copy;
    /// The same value in every lane.
    fn splat(x: f64) -> Self;
    /// `from[at..at + 8]`.
    fn load(from: &[f64], at: usize) -> Self;
    /// Writes `to[at..at + 8]`.
    fn store(self, to: &mut [f64], at: usize);
    /// Square root.
    fn sqrt(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// `if self < other { self } else { other }`.
    fn min(self, other: Self) -> Self;
    /// `if self > other { self } else { other }`.
    fn max(self, other: Self) -> Self;
    /// `self < other`, lane by lane.
    fn lt(self, other: Self) -> Self::Mask;
    /// Whether the mask is true in every lane. Only to save work: what comes out must be the same, to the bit, when this is false though all lanes
    /// are true, as it is where lanes are written down ([`crate::record`]).
    fn all(mask: Self::Mask) -> bool;
    /// A promise of the caller that the mask is true in every lane; looked at with debug assertions.
    #[inline(always)]
    fn expect(mask: Self::Mask) {
        debug_assert!(Self::all(mask));
    }
    /// `if mask { yes } else { no }`, lane by lane.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Magnitude of `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// 2^n for `self` = 1.5 * 2^52 + n, n whole and from -1022 to 1023.
    fn power_of_two(self) -> Self;
    /// Lane by lane the first `R` columns of the last row of `table` whose first column is not above `self`, of row 0 where there is none:
    /// the same number of steps for every lane, of strides `stride`, `stride / 2`, .. 1. So `2 stride` rows are within reach (one, with 0); there
    /// are that many.
    #[inline(always)]
    fn lookup<const R: usize, const N: usize>(
        self,
        table: &[[f64; 8]; N],
        first: usize,
    ) -> [Self; R] {
        let mut at = [0.0; WIDTH];
        self.store(&mut at, 0);
        let mut rows = [[0.0; WIDTH]; R];
        for l in 0..WIDTH {
            let (mut i, mut stride) = (0, first);
            while stride > 0 {
                let next = i + stride;
                i = if table[next % N][0] <= at[l] { next } else { i };
                stride /= 2;
            }
            let row = &table[i % N];
            for r in 0..R {
                rows[r][l] = row[r];
            }
        }
        // Not by `array::from_fn`, which is not compiled for the instruction set of the kernel.
        let mut out = [self; R];
        for r in 0..R {
            out[r] = Self::load(&rows[r], 0);
        }
        out
    }
}

/// Any machine.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Portable([f64; WIDTH]);

macro_rules! portable_operator {
    ($trait:ident, $name:ident, $op:tt) => {
        impl $trait for Portable {
            type Output = Self;
            #[inline(always)]
            fn $name(mut self, other: Self) -> Self {
                for l in 0..WIDTH {
                    self.0[l] $op other.0[l];
                }
                self
            }
        }
    };
}
portable_operator!(Add, add, +=);
portable_operator!(Sub, sub, -=);
portable_operator!(Mul, mul, *=);
portable_operator!(Div, div, /=);

impl Portable {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self(self.0.map(f))
    }

    #[inline(always)]
    fn zip(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for l in 0..WIDTH {
            self.0[l] = f(self.0[l], other.0[l]);
        }
        self
    }
}

impl Neg for Portable {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|x| -x)
    }
}

impl Lanes for Portable {
    type Mask = [bool; WIDTH];
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; WIDTH])
    }
    #[inline(always)]
    fn load(from: &[f64], at: usize) -> Self {
        let mut v = [0.0; WIDTH];
        v.copy_from_slice(&from[at..at + WIDTH]);
        Self(v)
    }
    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        to[at..at + WIDTH].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        core::array::from_fn(|l| self.0[l] < other.0[l])
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        mask.iter().all(|m| *m)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(core::array::from_fn(|l| {
            if mask[l] { yes.0[l] } else { no.0[l] }
        }))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.zip(sign, f64::copysign)
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        self.map(|x| {
            debug_assert!(
                (-1022.0..=1023.0).contains(&(x - SHIFT)),
                "2^({x} - {SHIFT})"
            );
            f64::from_bits((x.to_bits() << 52).wrapping_add(1023 << 52))
        })
    }
}

// Not for other crates: their operations are safe functions that only a machine with the instruction set may run.
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Add, Div, Lanes, Mul, Neg, Sub, WIDTH};
    use core::arch::x86_64::*;

    /// An intrinsic of arithmetic: on values alone, without an address.
    macro_rules! arithmetic {
        ($($operation:tt)*) => {{
            // SAFETY: all that such an intrinsic asks for is that the machine has its instruction set. Kernels of these types are entered
            // through `dispatch!` alone, which looks for that first; other crates cannot name the types, and so cannot call this.
            unsafe { $($operation)* }
        }};
    }

    /// AVX-512 (F and DQ).
    #[derive(Clone, Copy)]
    pub struct Avx512(__m512d);

    /// AVX2: two registers.
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256d, __m256d);

    macro_rules! operator {
        ($trait:ident, $name:ident, $wide:ident, $half:ident) => {
            impl $trait for Avx512 {
                type Output = Self;
                #[inline(always)]
                fn $name(self, o: Self) -> Self {
                    arithmetic! { Self($wide(self.0, o.0)) }
                }
            }
            impl $trait for Avx2 {
                type Output = Self;
                #[inline(always)]
                fn $name(self, o: Self) -> Self {
                    arithmetic! { Self($half(self.0, o.0), $half(self.1, o.1)) }
                }
            }
        };
    }
    operator!(Add, add, _mm512_add_pd, _mm256_add_pd);
    operator!(Sub, sub, _mm512_sub_pd, _mm256_sub_pd);
    operator!(Mul, mul, _mm512_mul_pd, _mm256_mul_pd);
    operator!(Div, div, _mm512_div_pd, _mm256_div_pd);

    impl Neg for Avx512 {
        type Output = Self;
        #[inline(always)]
        fn neg(self) -> Self {
            arithmetic! { Self(_mm512_xor_pd(self.0, _mm512_set1_pd(-0.0))) }
        }
    }

    impl Neg for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn neg(self) -> Self {
            arithmetic! {
                let s = _mm256_set1_pd(-0.0);
                Self(_mm256_xor_pd(self.0, s), _mm256_xor_pd(self.1, s))
            }
        }
    }

    impl Lanes for Avx512 {
        type Mask = __mmask8;
        #[inline(always)]
        fn splat(x: f64) -> Self {
            arithmetic! { Self(_mm512_set1_pd(x)) }
        }
        #[inline(always)]
        fn load(from: &[f64], at: usize) -> Self {
            let p = from[at..at + WIDTH].as_ptr();
            // SAFETY: the slice has eight places; the instruction set as in `arithmetic`.
            unsafe { Self(_mm512_loadu_pd(p)) }
        }
        #[inline(always)]
        fn store(self, to: &mut [f64], at: usize) {
            let p = to[at..at + WIDTH].as_mut_ptr();
            // SAFETY: the slice has eight places, borrowed alone; the instruction set as in `arithmetic`.
            unsafe { _mm512_storeu_pd(p, self.0) }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            arithmetic! { Self(_mm512_sqrt_pd(self.0)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            arithmetic! { Self(_mm512_andnot_pd(_mm512_set1_pd(-0.0), self.0)) }
        }
        #[inline(always)]
        fn min(self, o: Self) -> Self {
            arithmetic! { Self(_mm512_min_pd(self.0, o.0)) }
        }
        #[inline(always)]
        fn max(self, o: Self) -> Self {
            arithmetic! { Self(_mm512_max_pd(self.0, o.0)) }
        }
        #[inline(always)]
        fn lt(self, o: Self) -> Self::Mask {
            arithmetic! { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, o.0) }
        }
        #[inline(always)]
        fn all(mask: Self::Mask) -> bool {
            mask == 0xff
        }
        #[inline(always)]
        fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
            arithmetic! { Self(_mm512_mask_blend_pd(mask, no.0, yes.0)) }
        }
        #[inline(always)]
        fn copysign(self, sign: Self) -> Self {
            arithmetic! {
                let s = _mm512_set1_pd(-0.0);
                Self(_mm512_or_pd(
                    _mm512_and_pd(s, sign.0),
                    _mm512_andnot_pd(s, self.0),
                ))
            }
        }
        #[inline(always)]
        fn power_of_two(self) -> Self {
            arithmetic! {
                let n = _mm512_slli_epi64::<52>(_mm512_castpd_si512(self.0));
                let one = _mm512_castpd_si512(_mm512_set1_pd(1.0));
                Self(_mm512_castsi512_pd(_mm512_add_epi64(n, one)))
            }
        }
    }

    impl Lanes for Avx2 {
        type Mask = (__m256d, __m256d);
        #[inline(always)]
        fn splat(x: f64) -> Self {
            arithmetic! { Self(_mm256_set1_pd(x), _mm256_set1_pd(x)) }
        }
        #[inline(always)]
        fn load(from: &[f64], at: usize) -> Self {
            let p = from[at..at + WIDTH].as_ptr();
            // SAFETY: the slice has eight places, twice four; the instruction set as in `arithmetic`.
            unsafe { Self(_mm256_loadu_pd(p), _mm256_loadu_pd(p.add(4))) }
        }
        #[inline(always)]
        fn store(self, to: &mut [f64], at: usize) {
            let p = to[at..at + WIDTH].as_mut_ptr();
            // SAFETY: the slice has eight places, twice four, borrowed alone; the instruction set as in `arithmetic`.
            unsafe {
                _mm256_storeu_pd(p, self.0);
                _mm256_storeu_pd(p.add(4), self.1);
            }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            arithmetic! { Self(_mm256_sqrt_pd(self.0), _mm256_sqrt_pd(self.1)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            arithmetic! {
                let s = _mm256_set1_pd(-0.0);
                Self(_mm256_andnot_pd(s, self.0), _mm256_andnot_pd(s, self.1))
            }
        }
        #[inline(always)]
        fn min(self, o: Self) -> Self {
            arithmetic! { Self(_mm256_min_pd(self.0, o.0), _mm256_min_pd(self.1, o.1)) }
        }
        #[inline(always)]
        fn max(self, o: Self) -> Self {
            arithmetic! { Self(_mm256_max_pd(self.0, o.0), _mm256_max_pd(self.1, o.1)) }
        }
        #[inline(always)]
        fn lt(self, o: Self) -> Self::Mask {
            arithmetic! {
                (
                    _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, o.0),
                    _mm256_cmp_pd::<_CMP_LT_OQ>(self.1, o.1),
                )
            }
        }
        #[inline(always)]
        fn all(mask: Self::Mask) -> bool {
            arithmetic! { _mm256_movemask_pd(_mm256_and_pd(mask.0, mask.1)) == 0xf }
        }
        #[inline(always)]
        fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
            arithmetic! {
                Self(
                    _mm256_blendv_pd(no.0, yes.0, mask.0),
                    _mm256_blendv_pd(no.1, yes.1, mask.1),
                )
            }
        }
        #[inline(always)]
        fn copysign(self, sign: Self) -> Self {
            arithmetic! {
                let s = _mm256_set1_pd(-0.0);
                Self(
                    _mm256_or_pd(_mm256_and_pd(s, sign.0), _mm256_andnot_pd(s, self.0)),
                    _mm256_or_pd(_mm256_and_pd(s, sign.1), _mm256_andnot_pd(s, self.1)),
                )
            }
        }
        #[inline(always)]
        fn power_of_two(self) -> Self {
            arithmetic! {
                let one = _mm256_castpd_si256(_mm256_set1_pd(1.0));
                let a = _mm256_slli_epi64::<52>(_mm256_castpd_si256(self.0));
                let b = _mm256_slli_epi64::<52>(_mm256_castpd_si256(self.1));
                Self(
                    _mm256_castsi256_pd(_mm256_add_epi64(a, one)),
                    _mm256_castsi256_pd(_mm256_add_epi64(b, one)),
                )
            }
        }
    }
}

/// Instruction set that kernels run with, the widest last.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Level {
    /// Any machine.
    Portable,
    /// AVX2.
    Avx2,
    /// AVX-512 F and DQ.
    Avx512,
}

const LEVELS: [Level; 3] = [Level::Portable, Level::Avx2, Level::Avx512];
/// Index into `LEVELS`, with [`RECORDING`] while a thread records; [`UNKNOWN`] until the machine was asked.
static LEVEL: AtomicU8 = AtomicU8::new(UNKNOWN);
const UNKNOWN: u8 = 3;
const RECORDING: u8 = 4;

/// The instruction set in use: the best of this machine, unless [`limit_level`] said less.
#[inline]
pub fn level() -> Level {
    match LEVELS.get((LEVEL.load(Ordering::Relaxed) & !RECORDING) as usize) {
        Some(level) => *level,
        None => limit_level(Level::Avx512),
    }
}

/// Uses no wider instruction set than `most` in this process, and returns what is used: for
/// benches, and for tests that compare the sets.
#[cold]
pub fn limit_level(most: Level) -> Level {
    let level = best_level().min(most);
    let with = |old: u8| Some(level as u8 | old & RECORDING);
    let _ = LEVEL.fetch_update(Ordering::Relaxed, Ordering::Relaxed, with);
    level
}

/// How a kernel runs on this thread: with the widest instruction set, or written down.
#[derive(Clone, Copy)]
pub(crate) enum Way {
    Run(Level),
    Record,
}

/// As [`level`]; whether this thread records is asked only while one does.
#[inline]
pub(crate) fn way() -> Way {
    match LEVELS.get(LEVEL.load(Ordering::Relaxed) as usize) {
        Some(level) => Way::Run(*level),
        None => seldom(),
    }
}

#[cold]
fn seldom() -> Way {
    if RECORDS.get() {
        Way::Record
    } else {
        Way::Run(level())
    }
}

thread_local!(static RECORDS: Cell<bool> = const { Cell::new(false) });

/// How many threads record.
static RECORDERS: Mutex<usize> = Mutex::new(0);

/// While it lives, kernels on its thread are written down.
pub(crate) struct ThisRecords {
    /// It belongs to the thread that began it.
    _here: PhantomData<*const ()>,
}

impl ThisRecords {
    pub(crate) fn begin() -> Self {
        level();
        let mut threads = RECORDERS.lock().unwrap_or_else(PoisonError::into_inner);
        *threads += 1;
        LEVEL.fetch_or(RECORDING, Ordering::Relaxed);
        RECORDS.set(true);
        Self { _here: PhantomData }
    }
}

impl Drop for ThisRecords {
    fn drop(&mut self) {
        RECORDS.set(false);
        let mut threads = RECORDERS.lock().unwrap_or_else(PoisonError::into_inner);
        *threads -= 1;
        if *threads == 0 {
            LEVEL.fetch_and(!RECORDING, Ordering::Relaxed);
        }
    }
}

fn best_level() -> Level {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            return Level::Avx512;
        }
        if is_x86_feature_detected!("avx2") {
            return Level::Avx2;
        }
    }
    Level::Portable
}

/// Lanes of the batches that forming runs are made of: kernels are compiled for this number too.
pub const USUAL: usize = 32;
