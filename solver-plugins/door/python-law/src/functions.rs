//! What compiled code may call: the functions of the C library that the compiler makes of `math.exp` and the like, with the same bits on
//! every machine (`docs/decisions/0037`), and moves of memory.

use std::ffi::c_void;

// SAFETY: the functions of the C library, with its own signatures. Nothing here calls them: compiled code does.
unsafe extern "C" {
    fn memcpy(to: *mut c_void, from: *const c_void, n: usize) -> *mut c_void;
    fn memmove(to: *mut c_void, from: *const c_void, n: usize) -> *mut c_void;
    fn memset(to: *mut c_void, value: i32, n: usize) -> *mut c_void;
}

/// `x` to a whole power, by the multiplications of the compilers' own runtime, in its order.
extern "C" fn powi(mut x: f64, power: i32) -> f64 {
    let (mut left, mut product) = (power, 1.0);
    loop {
        if left & 1 != 0 {
            product *= x;
        }
        left /= 2;
        if left == 0 {
            break;
        }
        x *= x;
    }
    if power < 0 { 1.0 / product } else { product }
}

/// Sine and cosine in one: a compiler makes this of two calls with the same angle.
///
/// # Safety
/// Both pointers are to a double that may be written.
unsafe extern "C" fn sincos(x: f64, sine: *mut f64, cosine: *mut f64) {
    // SAFETY: the caller's promise.
    unsafe { (*sine, *cosine) = (libm::sin(x), libm::cos(x)) };
}

/// Called by numba where the last reference to something that it has allocated is gone. A law allocates nothing: its lists of parameters are
/// the sheet's, and count no references. So this is there for the code that would call it, and is never called.
extern "C" fn nothing_to_free(_: *mut c_void) {}

extern "C" fn ldexp(x: f64, power: i32) -> f64 {
    libm::ldexp(x, power)
}

extern "C" fn lgamma(x: f64) -> f64 {
    libm::lgamma(x)
}

macro_rules! table {
    ($name:ident: one $($one:ident)*; two $($two:ident)*; three $($three:ident)*; also $($symbol:literal => $function:expr),* $(,)?) => {
        match $name {
            $(stringify!($one) => {
                extern "C" fn $one(x: f64) -> f64 { libm::$one(x) }
                Some($one as extern "C" fn(f64) -> f64 as usize)
            })*
            $(stringify!($two) => {
                extern "C" fn $two(x: f64, y: f64) -> f64 { libm::$two(x, y) }
                Some($two as extern "C" fn(f64, f64) -> f64 as usize)
            })*
            $(stringify!($three) => {
                extern "C" fn $three(x: f64, y: f64, z: f64) -> f64 { libm::$three(x, y, z) }
                Some($three as extern "C" fn(f64, f64, f64) -> f64 as usize)
            })*
            $($symbol => Some($function),)*
            _ => None,
        }
    };
}

/// The address of a function by its symbol; `None`: compiled code may not call it.
pub fn address(symbol: &str) -> Option<usize> {
    // numba has some of them in a library of its own, under names of its own. What it calls `numba_round` rounds otherwise.
    match symbol.strip_prefix("numba_") {
        Some("gamma") => of_mathematics("tgamma"),
        Some("fixed_fmod") => of_mathematics("fmod"),
        Some("round") => None,
        Some(name) => of_mathematics(name),
        None => of_mathematics(symbol),
    }
}

fn of_mathematics(symbol: &str) -> Option<usize> {
    table!(symbol:
        one sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp exp2 exp10 expm1 log log2 log10 log1p cbrt erf erfc tgamma
            floor ceil trunc rint round roundeven fabs sqrt;
        two atan2 pow hypot fmod copysign fmax fmin nextafter;
        three fma;
        also
            "lgamma" => lgamma as extern "C" fn(f64) -> f64 as usize,
            "ldexp" => ldexp as extern "C" fn(f64, i32) -> f64 as usize,
            "nearbyint" => of_mathematics("rint")?,
            "__powidf2" => powi as extern "C" fn(f64, i32) -> f64 as usize,
            "NRT_MemInfo_call_dtor" => nothing_to_free as extern "C" fn(*mut c_void) as usize,
            "sincos" => sincos as unsafe extern "C" fn(f64, *mut f64, *mut f64) as usize,
            "memcpy" => memcpy as unsafe extern "C" fn(*mut c_void, *const c_void, usize) -> *mut c_void as usize,
            "memmove" => memmove as unsafe extern "C" fn(*mut c_void, *const c_void, usize) -> *mut c_void as usize,
            "memset" => memset as unsafe extern "C" fn(*mut c_void, i32, usize) -> *mut c_void as usize,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(symbol: &str) -> extern "C" fn(f64) -> f64 {
        // SAFETY: these symbols are functions of a double, of which the table has the address.
        unsafe { std::mem::transmute(address(symbol).unwrap()) }
    }

    #[test]
    fn functions_are_those_of_their_names() {
        let x = 0.73f64;
        for (symbol, want) in [
            ("sin", x.sin()),
            ("cos", x.cos()),
            ("tan", x.tan()),
            ("asin", x.asin()),
            ("acos", x.acos()),
            ("atan", x.atan()),
            ("sinh", x.sinh()),
            ("cosh", x.cosh()),
            ("tanh", x.tanh()),
            ("asinh", x.asinh()),
            ("atanh", x.atanh()),
            ("exp", x.exp()),
            ("exp2", x.exp2()),
            ("exp10", 10f64.powf(x)),
            ("expm1", x.exp_m1()),
            ("log", x.ln()),
            ("log2", x.log2()),
            ("log10", x.log10()),
            ("log1p", x.ln_1p()),
            ("cbrt", x.cbrt()),
            ("floor", 0.0),
            ("ceil", 1.0),
            ("trunc", 0.0),
            ("rint", 1.0),
            ("nearbyint", 1.0),
            ("round", 1.0),
            ("roundeven", 1.0),
            ("fabs", x),
            ("sqrt", x.sqrt()),
        ] {
            let got = one(symbol)(x);
            assert!(
                (got - want).abs() <= 4.0 * f64::EPSILON,
                "{symbol}: {got} {want}"
            );
        }
        assert!((one("erf")(x) + one("erfc")(x) - 1.0).abs() < 1e-15);
        assert!((one("numba_gamma")(5.0) - 24.0).abs() < 1e-12);
        assert_eq!(one("numba_cbrt")(27.0), 3.0);
        assert_eq!(ldexp(3.0, -2), 0.75);
        assert!((one("tgamma")(5.0) - 24.0).abs() < 1e-12);
        assert!((one("lgamma")(5.0) - 24f64.ln()).abs() < 1e-14);
        assert!((one("acosh")(1.5) - 1.5f64.acosh()).abs() < 1e-15);
    }

    #[test]
    fn whole_powers_are_products() {
        assert_eq!(powi(3.0, 5), 243.0);
        assert_eq!(powi(2.0, -3), 0.125);
        assert_eq!(powi(7.0, 0), 1.0);
        assert_eq!(powi(1.0, i32::MIN), 1.0);
    }

    #[test]
    fn what_is_no_arithmetic_cannot_be_called() {
        for symbol in [
            "malloc",
            "printf",
            "numba_gil_ensure",
            "numba_round",
            "PyErr_SetNone",
            "dlopen",
            "sinf",
        ] {
            assert_eq!(address(symbol), None, "{symbol}");
        }
    }
}
