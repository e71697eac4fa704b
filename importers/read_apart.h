#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

namespace effuse::importers {

/// What reading one file may cost. Parsers of other people's formats hang, crash and ask for endless memory on broken
/// files, and on some that are sound.
struct ReadLimits {
  /// Read in a child process, whose end is not the caller's: see read_apart. false: in this one, without limits.
  bool apart = false;
  double seconds = 0;       ///< by the clock; 0: 10 and one more for each 2 MB of the file
  std::uint64_t bytes = 0;  ///< of memory, beyond what the caller has; 0: 768 MiB and 64 times the file
};

/// read(), called in a child process that ends when it takes longer or more memory than the limits allow, or crashes: what it
/// returns comes back through a pipe, and the InputErrors and ResourceErrors it throws are thrown here. Otherwise throws an
/// InputError naming the file and what happened; std::bad_alloc counts as too much memory.
///
/// The child is a fork of the calling program without exec: it needs no program of its own, and read() sees the caller's
/// memory as it is. Changes that it makes there are lost: all that matters must be in the returned bytes.
///
/// Threads: the child has the calling thread alone. Its parallel loops run on one thread (parallel.h). It may hang, until the
/// limit ends it, on a lock that another thread held while this one forked: read() must not wait for other threads of
/// the program nor for their locks. malloc is safe (glibc), as are assimp and GDAL when no other thread is inside them.
/// Several threads may call this at once. SIGINT is ignored in the child, which dies with its parent (Linux).
/// Builds with the address or thread sanitizer hold the time limit only: their shadow takes all memory there is.
///
/// file: for messages, and its size for the defaults. Costs about a millisecond, and a copy of the bytes.
std::string read_apart(const std::filesystem::path& file, const ReadLimits& limits, const std::function<std::string()>& read);

/// "30s", "4GB", "30s,4GB": seconds and bytes (kB, MB, GB, or KiB, MiB, GiB); apart stays as in base. Throws InputError.
ReadLimits parse_read_limits(const std::string& text, ReadLimits base = {});

}  // namespace effuse::importers
