#!/bin/sh
# Runs the Khronos glTF validator: gltf_validate.sh BUILD_FOLDER FILE...
# Installs the npm package gltf-validator into BUILD_FOLDER/npm the first time.
# Exit code 0: no errors and no warnings; 1: some; 3: node, npm or the package cannot be had.
set -eu
build=$1
shift
here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
for tool in node npm; do
  if ! command -v "$tool" > /dev/null 2>&1; then
    echo "gltf_validate.sh: $tool is missing; tests/run.sh installs it (apt-get install nodejs npm)" >&2
    exit 3
  fi
done
mkdir -p "$build/npm"
(
  flock 9 # tests run side by side install once
  if [ ! -d "$build/npm/node_modules/gltf-validator" ]; then
    npm install --prefix "$build/npm" --no-audit --no-fund --loglevel=error gltf-validator@2.0.0-dev.3.10 >&2
  fi
) 9> "$build/npm/lock" || {
  echo "gltf_validate.sh: npm cannot install gltf-validator (is the registry within reach?)" >&2
  exit 3
}
exec node "$here/gltf_validate.js" "$build/npm/node_modules" "$@"
