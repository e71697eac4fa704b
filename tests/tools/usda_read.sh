#!/bin/sh
# Reads .usda files by the npm package tinyusdz: usda_read.sh BUILD_FOLDER FILE... Installs it into BUILD_FOLDER/npm the first time.
# Output: usda_read.mjs says. Exit code 3: node, npm or the package cannot be had.
set -eu
build=$1
shift
here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
for tool in node npm; do
  command -v "$tool" > /dev/null 2>&1 || { echo "usda_read.sh: $tool is missing; tests/run.sh installs it" >&2; exit 3; }
done
mkdir -p "$build/npm"
(
  flock 9 # tests run side by side install once
  if [ ! -d "$build/npm/node_modules/tinyusdz" ]; then
    npm install --prefix "$build/npm" --no-audit --no-fund --loglevel=error tinyusdz@0.9.0-rc10 >&2
  fi
) 9> "$build/npm/lock" || {
  echo "usda_read.sh: npm cannot install tinyusdz (is the registry within reach?)" >&2
  exit 3
}
exec node "$here/usda_read.mjs" "$build/npm/node_modules" "$@"
