#include "skin/surface/vdb_file.h"

#include <fmt/format.h>
#include <openvdb/io/File.h>

#include <fstream>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/hash.h"
#include "skin/surface/vdb_layout.h"

namespace effuse::skin {

namespace fs = std::filesystem;

std::string brief_words(const char* words) {
  std::string text;
  for (const char* c = words; *c != 0 && text.size() < 200; ++c) text += *c >= ' ' && *c <= '~' ? *c : '?';
  return text;
}

namespace {

/// OpenVDB gives every file a random name of its own (a UUID). Ours is the hash of what the file holds, so that the same
/// frame is the same bytes. It stands after the magic number, the version of the format, two of the library and a flag.
void name_by_content(const fs::path& file) {
  constexpr std::streamoff kAt = 8 + 3 * 4 + 1;
  constexpr std::size_t kLength = 36;
  std::string bytes = read_file(file);
  // A layout we do not know: better a random name than a damaged file.
  if (bytes.size() < kAt + kLength || bytes[kAt + 8] != '-' || bytes[kAt + 13] != '-' || bytes[kAt + 18] != '-' || bytes[kAt + 23] != '-')
    return;
  bytes.replace(kAt, kLength, kLength, '0');
  StateHash first, second;
  first.add(std::string_view(bytes));
  second.add(first.value());
  const std::string hex = first.hex() + second.hex();
  const std::string uuid =
      fmt::format("{}-{}-4{}-8{}-{}", hex.substr(0, 8), hex.substr(8, 4), hex.substr(12, 3), hex.substr(15, 3), hex.substr(18, 12));
  std::fstream out(file, std::ios::in | std::ios::out | std::ios::binary);
  out.seekp(kAt);
  out.write(uuid.data(), kLength);
}

}  // namespace

void write_vdb_file(const fs::path& file, const openvdb::GridPtrVec& grids, const std::vector<std::pair<std::string, std::string>>& metadata) {
  openvdb::MetaMap meta;
  for (const auto& [key, value] : metadata) meta.insertMeta(key, openvdb::StringMetadata(value));

  AtomicFile out(file);
  try {
    openvdb::io::File vdb(out.temporary().string());
    vdb.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
    vdb.write(grids, meta);
    vdb.close();
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("{}: cannot write: {}", file.string(), brief_words(e.what())));
  }

  // OpenVDB does not look whether its bytes arrived. After the first that did not its stream is closed to all others, the
  // table of contents included, so that a file with a sound table is whole.
  std::vector<std::string> names;
  try {
    names = check_vdb_layout(out.temporary());
  } catch (const InputError&) {
  }
  if (names.size() != grids.size())
    throw ResourceError(fmt::format("{}: what was written does not read back: is the disk full?", file.string()));
  name_by_content(out.temporary());
  out.commit();
}

}  // namespace effuse::skin
