#!/bin/sh
# sh tests/fuzz.sh [SECONDS] [CORPUS...]: feeds the parsers of our own (PLY, OBJ, STL, OFF, ESRI ASCII, XYZ) with what libFuzzer
# thinks of, under the address and undefined-behaviour sanitizers, for a minute or SECONDS. Needs clang and its run-time library
# (Debian: clang libclang-rt-14-dev). CORPUS: folders of real files to start from. What breaks a parser is left in
# build/fuzz/, and `build/fuzz/fuzz FILE` runs it again.
set -eu
cd "$(dirname "$0")/.."
seconds=${1:-60}
[ $# -eq 0 ] || shift
command -v clang++ > /dev/null || {
  echo "clang++ is missing: apt-get install clang libclang-rt-14-dev" >&2
  exit 2
}
mkdir -p build/fuzz/corpus
sources="tests/importers/fuzz_target.cpp importers/input_file.cpp importers/mesh/mesh_frame.cpp importers/mesh/ply_reader.cpp
  importers/mesh/text_meshes.cpp importers/terrain/esri_ascii.cpp importers/terrain/xyz_grid.cpp importers/terrain/raster.cpp
  geometry/base/error.cpp geometry/base/files.cpp"
existing=""
for source in $sources; do [ ! -f "$source" ] || existing="$existing $source"; done
eigen=/usr/include/eigen3
# shellcheck disable=SC2086
clang++ -std=c++20 -O1 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -I. -isystem "$eigen" $existing \
  -lfmt -o build/fuzz/fuzz

# Real files, and the smallest of each kind, with the byte before them that picks their parser.
number=0
add() {
  number=$((number + 1))
  { printf "\\$1"; cat "$2"; } > "build/fuzz/corpus/seed.$number"
}
for folder in samples/scenes "$@"; do
  for file in $(find "$folder" -type f -size -64k); do
    case "$file" in
      *.ply) add 000 "$file" ;;
      *.obj) add 001 "$file" ;;
      *.stl | *.STL) add 002 "$file" ;;
      *.off) add 003 "$file" ;;
      *.asc) add 004 "$file" ;;
      *.xyz) add 005 "$file" ;;
    esac
  done
done
cd build/fuzz
exec ./fuzz -max_total_time="$seconds" -timeout=10 -rss_limit_mb=1024 -max_len=65536 -print_final_stats=1 corpus
