# sh headers_alone_can_fail.sh SCRATCH_DIR COMPILER EIGEN_DIR
# headers_alone.sh on three made-up folders: a good header passes, one that leans on its includer and one that shows
# a package do not.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
scratch=$1 compiler=$2 eigen=$3
rm -rf "$scratch"
mkdir -p "$scratch/good" "$scratch/leans" "$scratch/shows"
printf '#pragma once\n#include <Eigen/Core>\n#include <vector>\ninline std::vector<Eigen::Vector3d> none() { return {}; }\n' > "$scratch/good/a.h"
printf '#pragma once\ninline std::vector<int> none() { return {}; }\n' > "$scratch/leans/a.h"
printf '#pragma once\n#include <fmt/core.h>\ninline int none() { return 0; }\n' > "$scratch/shows/a.h"

check() { sh "$here/headers_alone.sh" "$scratch/$1" "$scratch/build_$1" "$compiler" "$eigen"; }
check good || { echo "a good header was refused"; exit 1; }
if check leans; then echo "a header that does not compile alone was let through"; exit 1; fi
if check shows; then echo "a header that shows a package was let through"; exit 1; fi
