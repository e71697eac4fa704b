#include "importers/mesh/mesh_frame.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "geometry/mesh/measure.h"
#include "importers/input_file.h"

namespace effuse::importers {

namespace {

/// Three numbers with blanks between; false when text is anything else.
bool read_origin(std::string_view text, Vec3& origin) {
  for (int k = 0; k < 3; ++k) {
    const std::size_t start = text.find_first_not_of(' ');
    if (start == std::string_view::npos) return false;
    text.remove_prefix(start);
    const std::size_t end = std::min(text.find(' '), text.size());
    if (!parse_number(text.substr(0, end), origin[k]) || !std::isfinite(origin[k])) return false;
    text.remove_prefix(end);
  }
  return true;
}

/// A file of ours: metres, z up, and where its local frame lies.
MeshFrame own_frame(std::string_view origin, std::string_view crs, UpAxis up, const char* source) {
  MeshFrame frame;
  frame.up = up;
  frame.metres_per_unit = 1;
  frame.source = source;
  Vec3 at;
  if (read_origin(origin, at)) frame.origin = at;
  frame.crs = utf8(crs);
  return frame;
}

/// What follows key in text, up to the line's end; "" when key is not there.
std::string_view after(std::string_view text, std::string_view key) {
  const std::size_t at = text.find(key);
  if (at == std::string_view::npos) return {};
  text.remove_prefix(at + key.size());
  text = text.substr(0, text.find_first_of("\r\n"));
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

MeshFrame frame_of_glb(std::string_view bytes) {
  if (bytes.size() < 20) return {};
  std::size_t length = 0;
  for (std::size_t b = 4; b-- > 0;) length = (length << 8) | static_cast<unsigned char>(bytes[12 + b]);
  const auto json = nlohmann::json::parse(bytes.substr(20, std::min(length, bytes.size() - 20)), nullptr, false);
  if (!json.is_object() || !json.contains("asset") || !json["asset"].is_object()) return {};
  const auto& asset = json["asset"];
  const auto text = [](const auto& object, const char* key) { return object.is_object() && object.contains(key) && object[key].is_string() ? object[key].template get<std::string>() : std::string(); };
  if (text(asset, "generator") != "effuse" || !asset.contains("extras")) return {};
  return own_frame(text(asset["extras"], "origin"), text(asset["extras"], "crs"), UpAxis::kY, "its asset.extras");
}

}  // namespace

MeshFrame frame_of_own_file(std::string_view bytes, const std::string& extension) {
  const std::string_view head = bytes.substr(0, 16384);
  if (extension == ".ply") {
    const std::string_view header = head.substr(0, head.find("end_header"));
    if (header.find("\ncomment effuse, metres, z up") == std::string_view::npos) return {};
    return own_frame(after(header, "\ncomment origin: "), after(header, "\ncomment crs: "), UpAxis::kZ, "its comments");
  }
  if (extension == ".obj" || extension == ".off") {
    // OFF's first line is its own name.
    if (head.substr(0, 40).find("# effuse, metres, z up") == std::string_view::npos) return {};
    return own_frame(after(head, "\n# origin: "), after(head, "\n# crs: "), UpAxis::kZ, "its comments");
  }
  if (extension == ".stl") {
    const std::string_view header = head.substr(0, 80);
    if (!header.starts_with("effuse, metres, z up")) return {};
    // Its 80 bytes cut a long text short: an origin counts with its end only, a system as a code.
    const std::size_t start = header.find("; origin ");
    const std::string_view origin = start == std::string_view::npos ? std::string_view() : header.substr(start + 9);
    const std::size_t end = std::min(origin.find(';'), origin.find("  "));
    const std::string_view crs = after(header, "; crs ");
    return own_frame(end == std::string_view::npos ? "" : origin.substr(0, end), crs.starts_with("EPSG:") ? crs : "", UpAxis::kZ, "its header");
  }
  if (extension == ".glb") return frame_of_glb(bytes);
  return {};
}

UpAxis guess_up(const geometry::TriMesh& mesh) {
  Vec3 sum = Vec3::Zero();
  Real area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 each = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    sum += each;
    area += each.norm();
  }
  // Of ground as steep as 45 degrees everywhere the share is 0.7; a third is left of a cliff with caves.
  constexpr Real kLooksOneWay = 0.3;
  Eigen::Index axis = 0;
  if (!(sum.cwiseAbs().maxCoeff(&axis) > kLooksOneWay * area)) return UpAxis::kUnknown;
  return axis == 0 ? UpAxis::kX : axis == 1 ? UpAxis::kY : UpAxis::kZ;
}

void turn_up(geometry::TriMesh& mesh, UpAxis up) {
  if (up != UpAxis::kX && up != UpAxis::kY) return;
  for (std::vector<Vec3>* vectors : {&mesh.positions, &mesh.normals})
    for (Vec3& v : *vectors) v = up == UpAxis::kY ? Vec3(v.x(), -v.z(), v.y()) : Vec3(-v.z(), v.y(), v.x());
  for (auto& [name, attribute] : mesh.attributes) {
    if (attribute.width != 3 || name == "color" || name == "glow") continue;
    for (std::size_t k = 0; k + 2 < attribute.values.size(); k += 3) {
      float* v = &attribute.values[k];
      const float x = v[0], y = v[1], z = v[2];
      if (up == UpAxis::kY) v[0] = x, v[1] = -z, v[2] = y;
      else v[0] = -z, v[1] = y, v[2] = x;
    }
  }
}

const char* name_of(UpAxis up) {
  constexpr std::array kNames{"", "x", "y", "z"};
  return kNames[static_cast<std::size_t>(up)];
}

}  // namespace effuse::importers
