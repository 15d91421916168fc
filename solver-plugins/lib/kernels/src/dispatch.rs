//! Entries of kernels: one for each instruction set, and one that is written down.

/// `dispatch!(fn name(arg: Type, ..) -> Ret = kernel);` defines `name`, which runs
/// `kernel::<V>(arg, ..)` (generic over [`Lanes`](crate::Lanes), `#[inline(always)]`) with the widest lanes of
/// the machine.
///
/// `= kernel, lanes n` does the same for a kernel whose argument `n` is the number of lanes: when it is
/// [`USUAL`](crate::USUAL), code runs in which it, and with it the distance between rows, is a constant.
macro_rules! dispatch {
    ($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? = $kernel:ident $(, lanes $n:ident)?) => {
        $(#[$meta])*
        $vis fn $name($($arg: $ty),*) $(-> $ret)? {
            // Lanes past the last would be those of the next row.
            $(debug_assert!($n.is_multiple_of($crate::lanes::WIDTH), "{} lanes", $n);)?
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512dq")]
                fn wide($($arg: $ty),*) $(-> $ret)? {
                    $crate::dispatch::dispatch!(@run $kernel::<$crate::lanes::Avx512> ($($arg),*) $($n)?)
                }
                #[target_feature(enable = "avx2")]
                fn half($($arg: $ty),*) $(-> $ret)? {
                    $crate::dispatch::dispatch!(@run $kernel::<$crate::lanes::Avx2> ($($arg),*) $($n)?)
                }
                match $crate::lanes::way() {
                    // SAFETY: `way` has found the instruction set on this machine.
                    $crate::lanes::Way::Run($crate::lanes::Level::Avx512) => return unsafe { wide($($arg),*) },
                    // SAFETY: as above.
                    $crate::lanes::Way::Run($crate::lanes::Level::Avx2) => return unsafe { half($($arg),*) },
                    _ => {}
                }
            }
            if let $crate::lanes::Way::Record = $crate::lanes::way() {
                return $kernel::<$crate::record::Recorded>($($arg),*);
            }
            $kernel::<$crate::lanes::Portable>($($arg),*)
        }
    };
    (@run $kernel:ident::<$lanes:ty> $args:tt) => { $kernel::<$lanes> $args };
    (@run $kernel:ident::<$lanes:ty> $args:tt $n:ident) => {{
        if $n == $crate::lanes::USUAL {
            let $n = $crate::lanes::USUAL;
            return $kernel::<$lanes> $args;
        }
        $kernel::<$lanes> $args
    }};
}
pub(crate) use dispatch;
