# sh headers_alone.sh INCLUDE_DIR SCRATCH_DIR COMPILER EIGEN_DIR
# Compiles each header below INCLUDE_DIR as the only include of a file, with nothing but INCLUDE_DIR and Eigen on the
# include path, and looks at everything that came in: the standard library, the system, Eigen and our own, no package.
set -eu
include=$1 scratch=$2 compiler=$3 eigen=$4
rm -rf "$scratch"
mkdir -p "$scratch"

cat > "$scratch/one.sh" <<'END'
set -eu
include=$1 scratch=$2 compiler=$3 eigen=$4 header=$5
name=$scratch/$(printf %s "$header" | tr / _)
printf '#include "%s"\n#include "%s"\n' "$header" "$header" > "$name.cpp"
if ! "$compiler" -std=c++20 -Wall -Wextra -Wpedantic -Werror -fsyntax-only -I "$include" -isystem "$eigen" \
     -MD -MF "$name.d" "$name.cpp" > "$name.log" 2>&1; then
  echo "$header does not compile alone:"
  head -5 "$name.log"
  exit 1
fi
# Folders of /usr/include that are the compiler's, the C library's or the kernel's; packages have others.
strangers=$(tr -s ' \\' '\n\n' < "$name.d" | grep '^/usr/include/' |
  grep -Fv "$eigen/" |
  grep -Ev '^/usr/include/(c\+\+|linux|asm|asm-generic)/' |
  grep -Ev '^/usr/include/[a-z0-9_]+-linux-gnu[a-z0-9]*/(c\+\+|bits|sys|gnu|asm)/' |
  grep -Ev '^/usr/include/[a-z0-9_]+-linux-gnu[a-z0-9]*/[^/]+\.h$' |
  grep -Ev '^/usr/include/[^/]+\.h$' || true)
strangers="$strangers$(tr -s ' \\' '\n\n' < "$name.d" | grep -E '^/usr/include/(png|pnglibconf|zlib|zconf|gmp|mpfr|gdal[a-z_]*|ogr[a-z_]*|cpl_[a-z]*)\.h$' || true)"
if [ -n "$strangers" ]; then
  echo "$header brings in a package's headers:"
  echo "$strangers" | head -3
  exit 1
fi
END

cd "$include"
find . -name '*.h' | sed 's,^\./,,' | sort > "$scratch/headers"
count=$(wc -l < "$scratch/headers")
if [ "$count" -eq 0 ]; then
  echo "no headers under $include"
  exit 1
fi
xargs -P "$(nproc)" -n 1 sh "$scratch/one.sh" "$include" "$scratch" "$compiler" "$eigen" < "$scratch/headers"
echo "$count headers compile alone"
