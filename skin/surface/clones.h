#pragma once

/// EFFUSE_CLONES before a function with a long loop of plain arithmetic: compiled for wider registers as well, chosen when the
/// program starts. The same bits either way (no fused operations: -ffp-contract=off). Not with sanitizers, whose start-up
/// does not survive the loader's choice.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define EFFUSE_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define EFFUSE_CLONES
#endif
