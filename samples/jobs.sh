#!/bin/sh
# Prints how many compilers may run at once: one a core, but 3 GB of memory each (OpenVDB's templates take up to 2).
cores=$(nproc 2> /dev/null || echo 1)
memory=$(awk '/^MemAvailable:/ { print int($2 / 3000000) }' /proc/meminfo 2> /dev/null || echo 1)
jobs=$cores
[ "${memory:-1}" -ge "$jobs" ] || jobs=$memory
[ "$jobs" -ge 1 ] || jobs=1
echo "$jobs"
