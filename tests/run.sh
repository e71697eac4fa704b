#!/bin/sh
# sh tests/run.sh [quick|asan|tsan]: installs the packages that are missing, builds, and runs the tests.
#   (nothing)  every test; the benchmarks run once before, for a moment each, to see that they run
#   quick      the tests that take under a minute together
#   asan tsan  the quick ones, built to find memory faults and undefined behaviour, or data races
set -eu
cd "$(dirname "$0")/.."

what=${1:-all}
case "$what" in
  all) preset=release select="" ;;
  quick) preset=release select="-L quick" ;;
  asan | tsan) preset=$what select="-L quick" ;;
  *)
    echo "usage: sh tests/run.sh [quick|asan|tsan]" >&2
    exit 2
    ;;
esac

sh samples/packages.sh test
jobs=$(sh samples/jobs.sh)
cmake --preset "$preset" -DEFFUSE_TESTS=ON -DEFFUSE_BENCHMARKS=ON
cmake --build --preset "$preset" -j "$jobs"

if [ "$what" = all ]; then
  ctest --test-dir "build/$preset" -L bench --no-tests=ignore || echo "some benchmarks do not run: see above. They do not count below."
fi

[ ! -f tests/tsan.supp ] || export TSAN_OPTIONS="suppressions=$PWD/tests/tsan.supp ${TSAN_OPTIONS:-}"
[ ! -f tests/lsan.supp ] || export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0 ${LSAN_OPTIONS:-}"
# The last lines are ctest's own.
exec ctest --test-dir "build/$preset" --output-on-failure --no-tests=error -j "$jobs" -LE bench $select
