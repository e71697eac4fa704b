#include "importers/points/import_points.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "importers/input_file.h"
#include "importers/points/columns_internal.h"

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMostInflated = std::size_t{4} << 30;

/// ".vtk" of "a.VTK" and of "a.vtk.gz".
std::string inner_extension(const fs::path& file) {
  const std::string extension = lower_extension(file);
  return extension == ".gz" ? lower_extension(file.stem()) : extension;
}

/// zlib's stream, closed in the end.
struct Inflater {
  z_stream stream{};
  bool open = false;
  ~Inflater() {
    if (open) inflateEnd(&stream);
  }
};

}  // namespace

std::string inflate_bytes(std::string_view bytes, const std::string& name, std::size_t limit) {
  Inflater z;
  if (inflateInit2(&z.stream, 15 + 32) != Z_OK) throw ResourceError(name + ": no memory to unzip it");
  z.open = true;
  std::string out;
  std::array<char, 1 << 16> buffer;
  std::size_t at = 0;
  for (;;) {
    const std::size_t piece = std::min<std::size_t>(bytes.size() - at, std::numeric_limits<uInt>::max() / 2);
    z.stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + at));  // zlib does not write there
    z.stream.avail_in = static_cast<uInt>(piece);
    z.stream.next_out = reinterpret_cast<Bytef*>(buffer.data());
    z.stream.avail_out = static_cast<uInt>(buffer.size());
    const int result = inflate(&z.stream, Z_NO_FLUSH);
    at += piece - z.stream.avail_in;
    const std::size_t made = buffer.size() - z.stream.avail_out;
    out.append(buffer.data(), made);
    if (out.size() > limit) throw InputError({name}, fmt::format("unzips to more than {} bytes", limit));
    if (result == Z_STREAM_END) {
      // gzip files may be several, one after the other.
      if (bytes.size() - at < 2 || bytes.substr(at, 2) != "\x1f\x8b") return out;
      if (inflateReset(&z.stream) != Z_OK) throw InputError({name}, "the zipped data cannot be read on");
      continue;
    }
    if (result == Z_MEM_ERROR) throw ResourceError(name + ": no memory to unzip it");
    if (result != Z_OK && result != Z_BUF_ERROR)
      throw InputError({name}, fmt::format("the zipped data are damaged, {} bytes into them: {}", at, z.stream.msg ? printable(z.stream.msg) : "zlib cannot read them"));
    if (made == 0 && at == bytes.size()) throw InputError({name}, fmt::format("the zipped data end too early, after {} bytes: truncated", at));
  }
}

PointCloud parse_points(std::string_view bytes, const std::string& name, const PointImportOptions& options) {
  std::string inflated;
  if (bytes.starts_with("\x1f\x8b")) {
    inflated = inflate_bytes(bytes, name, kMostInflated);
    bytes = inflated;
    if (bytes.empty()) throw InputError({name}, "the file is empty, once unzipped");
  }
  const std::string extension = inner_extension(name);
  if (extension == ".ply") return parse_ply_points(bytes, name, options);
  if (extension == ".vtk") return parse_legacy_vtk(bytes, name, options);
  if (extension == ".vtp" || extension == ".vtu") return parse_xml_vtk(bytes, name, options);
  if (extension == ".bgeo" || extension == ".bhclassic") return parse_bgeo(bytes, name, options);
  if (extension == ".xyz" || extension == ".txt" || extension == ".csv") return parse_xyz(bytes, name, options);
  throw InputError({name}, fmt::format("particles are read from .ply, .vtk, .vtp, .vtu, .bgeo, .bhclassic, .xyz, .txt and .csv files (also .gz), not from {}",
                                       extension.empty() ? "one without an ending" : quote(extension)));
}

PointCloud import_points(const fs::path& file, const PointImportOptions& options) {
  ZONE("import.points");
  return parse_points(read_input(file, std::uint64_t{8} << 30, "a particle file"), file.string(), options);
}

bool has_point_ending(const fs::path& file) {
  static constexpr std::array<std::string_view, 6> kEndings = {".vtk", ".vtp", ".vtu", ".bgeo", ".bhclassic", ".xyz"};
  return std::find(kEndings.begin(), kEndings.end(), inner_extension(file)) != kEndings.end();
}

}  // namespace effuse::importers
