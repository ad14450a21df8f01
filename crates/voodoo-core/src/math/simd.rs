//! Run-time choice of instruction set for loops that the compiler vectorizes.
#![allow(unsafe_code, reason = "a function compiled for an instruction set is called where the processor has it")]

/// Number of single-precision values in one AVX2 register.
pub const LANES: usize = 8;

/// Copies into the first values of an array. Mostly it is filled, and its size is then known to the compiler.
#[inline(always)]
pub fn load<T: Copy, const N: usize>(to: &mut [T; N], from: &[T]) {
    match from.first_chunk() {
        Some(from) => *to = *from,
        None => to[..from.len()].copy_from_slice(from),
    }
}

/// Copies the first values of an array. Mostly they are all copied, and their number is then known to the compiler.
#[inline(always)]
pub fn store<T: Copy, const N: usize>(to: &mut [T], from: &[T; N]) {
    match to.first_chunk_mut() {
        Some(to) => *to = *from,
        None => to.copy_from_slice(&from[..to.len()]),
    }
}

/// The value of an expression that is compiled for an instruction set, which the processor must have.
#[cfg(target_arch = "x86_64")]
macro_rules! compiled {
    ($features:tt, $work:expr) => {{
        #[target_feature(enable = $features)]
        fn compiled<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        // SAFETY: `compiled` is safe code that only needs these features, and this processor was found to have them.
        unsafe {
            compiled(
                #[inline(always)]
                || $work,
            )
        }
    }};
}

/// Runs `work`, compiled for AVX-512 or AVX2 where this processor has it; write `widest(#[inline(always)] || ...)`, which is
/// `vectorized!(...)` in this crate.
///
/// Fused multiply-add is disabled on purpose: without it the result is bit-identical on every processor.
#[inline(always)]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if has_avx512() {
        return compiled!("avx512f,avx512bw,avx512dq,avx512vl", work());
    } else if std::arch::is_x86_feature_detected!("avx2") {
        return compiled!("avx2", work());
    }
    work()
}

/// Whether the target that the crates are compiled for has fused multiply-add: every aarch64 processor does.
pub const FMA: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

/// `a * b + c`, rounded once if `FMA`.
#[inline(always)]
pub fn multiply_add<const FMA: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// Runs `fused` as [`widest`] does, with fused multiply-add; `plain` where this processor has none, or no such registers. Their
/// roundings differ.
#[inline(always)]
pub fn widest_fused<A>(argument: A, plain: impl FnOnce(A), fused: impl FnOnce(A)) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("fma") {
        if has_avx512() {
            return compiled!("avx512f,avx512bw,avx512dq,avx512vl,fma", fused(argument));
        } else if std::arch::is_x86_feature_detected!("avx2") {
            return compiled!("avx2,fma", fused(argument));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    drop(fused);
    plain(argument);
}

/// Whether this processor has the parts of AVX-512 that are used (all processors with AVX-512 do, except Xeon Phi). The detection
/// is cached by the standard library.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(crate) fn has_avx512() -> bool {
    std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512bw")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512vl")
}

/// The value of an expression, computed by [`widest`].
macro_rules! vectorized {
    ($work:expr) => {
        $crate::math::widest(
            #[inline(always)]
            || $work,
        )
    };
}
#[cfg(all(test, target_arch = "x86_64"))]
pub(crate) use compiled;
pub(crate) use vectorized;
