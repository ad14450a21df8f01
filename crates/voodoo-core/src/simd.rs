//! Run-time choice of instruction set for loops that the compiler vectorises.

/// Runs `work`, compiled for AVX2 where this processor has it; write `widest(#[inline(always)] || ...)`.
///
/// Fused multiply-add is left out on purpose: without it the result is the same, bit by bit, on every processor.
#[inline(always)]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        #[target_feature(enable = "avx2")]
        fn wide<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        // SAFETY: `wide` is safe code that only needs AVX2, and this processor was found to have it.
        #[allow(unsafe_code)]
        return unsafe { wide(work) };
    }
    work()
}
