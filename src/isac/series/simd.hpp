/// @file
/// One portable build, the fastest instructions at run time: `ISAC_SIMD` before a function compiles it for
/// plain x86-64, AVX2 and AVX-512 and lets the loader choose.
///
/// The loops under it keep eight or sixteen running sums in a fixed order and the build forbids fused
/// multiply-add
/// (-ffp-contract=off), so that all versions give the same bits. Sanitizers and other compilers get the plain
/// version.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define ISAC_SIMD __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define ISAC_SIMD
#endif
