#include "skin/write/write_vtp.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/color/srgb.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {

constexpr std::size_t kBlock = std::size_t{1} << 17;  // bytes: one a task, so that a frame's arrays keep several threads busy

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : one_line(text)) {
    if (c == '&') out += "&amp;";
    else if (c == '<') out += "&lt;";
    else if (c == '>') out += "&gt;";
    else if (c == '"') out += "&quot;";
    else out += c;
  }
  return out;
}

/// Blocks, a block's bytes, those of a last shorter one or 0, each block's compressed bytes; then the blocks.
std::string compressed(const std::string& bytes) {
  const std::size_t blocks = (bytes.size() + kBlock - 1) / kBlock;
  std::vector<std::string> packed(blocks);
  parallel_for(blocks, [&](std::size_t b) {
    const std::size_t begin = b * kBlock, size = std::min(kBlock, bytes.size() - begin);
    uLongf length = ::compressBound(static_cast<uLong>(size));
    packed[b].resize(length);
    const int result = ::compress2(reinterpret_cast<Bytef*>(packed[b].data()), &length, reinterpret_cast<const Bytef*>(bytes.data() + begin), static_cast<uLong>(size), Z_BEST_SPEED);
    CHECK_EQ(result, Z_OK);
    packed[b].resize(length);
  }, 1);
  std::string out;
  append_bytes(out, static_cast<std::uint64_t>(blocks));
  append_bytes(out, static_cast<std::uint64_t>(kBlock));
  append_bytes(out, static_cast<std::uint64_t>(bytes.size() % kBlock));
  for (const std::string& block : packed) append_bytes(out, static_cast<std::uint64_t>(block.size()));
  for (const std::string& block : packed) out += block;
  return out;
}

/// The XML and what is appended to it, growing together.
class Document {
 public:
  explicit Document(bool compress) : compress_(compress) {}
  std::string xml;

  template <class T>
  void add(const char* type, const std::string& name, int width, const std::vector<T>& values) {
    xml += fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n", type, escaped(name), width, data_.size());
    std::string bytes(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    if (compress_) {
      data_ += compressed(bytes);
    } else {
      append_bytes(data_, static_cast<std::uint64_t>(bytes.size()));
      data_ += bytes;
    }
  }
  std::string file() const { return xml + "<AppendedData encoding=\"raw\">\n_" + data_ + "\n</AppendedData>\n</VTKFile>\n"; }

 private:
  bool compress_;
  std::string data_;
};

std::vector<float> floats(const std::vector<Vec3>& vectors) {
  std::vector<float> out(3 * vectors.size());
  parallel_for(vectors.size(), [&](std::size_t i) {
    for (std::size_t c = 0; c < 3; ++c) out[3 * i + c] = static_cast<float>(vectors[i][static_cast<Eigen::Index>(c)]);
  });
  return out;
}

/// Cells of `corners` vertices each: all of them, and where each ends.
void add_cells(Document& d, const char* element, const std::vector<std::int32_t>& connectivity, std::size_t corners) {
  std::vector<std::int32_t> ends(connectivity.size() / corners);
  for (std::size_t k = 0; k < ends.size(); ++k) ends[k] = static_cast<std::int32_t>(corners * (k + 1));
  d.xml += fmt::format("<{}>\n", element);
  d.add("Int32", "connectivity", 1, connectivity);
  d.add("Int32", "offsets", 1, ends);
  d.xml += fmt::format("</{}>\n", element);
}

}  // namespace

void write_vtp(const std::filesystem::path& file, const TriMesh& mesh, Real time, const Metadata& metadata, bool compress) {
  ZONE("write.vtp");
  CHECK(std::isfinite(time));
  require_well_formed(file.string(), mesh);
  const std::size_t n = mesh.positions.size(), triangles = mesh.triangles.size(), particles = triangles == 0 ? n : 0;
  if (std::max(n, 3 * triangles) > 0x7fffffffULL) throw InputError({file.string()}, fmt::format("{} vertices and {} triangles are more than its 32 bit cells can name", n, triangles));

  Document d(compress);
  d.xml = fmt::format("<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"{}>\n<PolyData>\n<FieldData>\n",
                      compress ? " compressor=\"vtkZLibDataCompressor\"" : "");
  d.xml += fmt::format("<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{:.17g}</DataArray>\n", time);
  for (const auto& [key, value] : metadata) {
    // VTK writes strings as the codes of their bytes, ended by a zero.
    d.xml += fmt::format("<DataArray type=\"String\" Name=\"{}\" NumberOfTuples=\"1\" format=\"ascii\">", escaped(key));
    for (const char c : one_line(value)) d.xml += fmt::format("{} ", static_cast<int>(static_cast<unsigned char>(c)));
    d.xml += "0</DataArray>\n";
  }
  d.xml += fmt::format("</FieldData>\n<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"{}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n", n, particles, triangles);

  d.xml += triangles > 0 ? "<PointData Normals=\"Normals\">\n" : "<PointData>\n";
  if (triangles > 0) d.add("Float32", "Normals", 3, floats(unit_normals(mesh)));
  const VertexAttribute* color = find_color(mesh);
  for (const auto& [name, attribute] : mesh.attributes) {
    if (&attribute == color) {
      const SrgbEncoder encode;
      std::vector<std::uint8_t> bytes(attribute.values.size());
      std::transform(attribute.values.begin(), attribute.values.end(), bytes.begin(), encode);
      d.add("UInt8", "color", 3, bytes);
    }
    d.add("Float32", &attribute == color ? "color_linear" : name, attribute.width, attribute.values);
  }
  d.xml += "</PointData>\n<Points>\n";
  d.add("Float32", "Points", 3, floats(mesh.positions));
  d.xml += "</Points>\n";
  if (particles > 0) {
    std::vector<std::int32_t> each(n);
    for (std::size_t i = 0; i < n; ++i) each[i] = static_cast<std::int32_t>(i);
    add_cells(d, "Verts", each, 1);
  }
  std::vector<std::int32_t> corners;
  corners.reserve(3 * triangles);
  for (const geometry::Triangle& t : mesh.triangles)
    for (const Index corner : t) corners.push_back(static_cast<std::int32_t>(corner));
  add_cells(d, "Polys", corners, 3);
  d.xml += "</Piece>\n</PolyData>\n";
  write_file(file, d.file());
}

void write_pvd(const std::filesystem::path& file, std::span<const TimedFile> files) {
  std::string xml = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>\n";
  for (const TimedFile& each : files) xml += fmt::format("<DataSet timestep=\"{:.17g}\" part=\"{}\" file=\"{}\"/>\n", each.time, each.part, escaped(each.name));
  write_file(file, xml + "</Collection>\n</VTKFile>\n");
}

void write_series(const std::filesystem::path& file, std::span<const TimedFile> files) {
  nlohmann::ordered_json j{{"file-series-version", "1.0"}, {"files", nlohmann::ordered_json::array()}};
  for (const TimedFile& each : files) j["files"].push_back({{"name", each.name}, {"time", each.time}});
  write_file(file, j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace effuse::skin
