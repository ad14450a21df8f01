//! Run-time choice of instruction set for loops that the compiler vectorizes.

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

/// Runs `work`, compiled for AVX-512 or AVX2 where this processor has it; write `widest(#[inline(always)] || ...)`.
///
/// Fused multiply-add is disabled on purpose: without it the result is bit-identical on every processor.
#[inline(always)]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
        fn wider<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        #[target_feature(enable = "avx2")]
        fn wide<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        if has_avx512() {
            // SAFETY: `wider` is safe code that only needs these parts of AVX-512, and this processor was found to have them.
            #[allow(
                unsafe_code,
                reason = "a function compiled for an instruction set is called where the processor has it"
            )]
            return unsafe { wider(work) };
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: `wide` is safe code that only needs AVX2, and this processor was found to have it.
            #[allow(
                unsafe_code,
                reason = "a function compiled for an instruction set is called where the processor has it"
            )]
            return unsafe { wide(work) };
        }
    }
    work()
}

/// Whether this processor has the parts of AVX-512 that are used (all processors with AVX-512 do, except Xeon Phi). The detection
/// is cached by the standard library.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx512() -> bool {
    std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512bw")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512vl")
}
