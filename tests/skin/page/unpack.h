#pragma once

#include <zlib.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "skin/page/pack_mesh.h"

/// The page's formats read once more, from their descriptions: what skin/page/*.js must find, too.
namespace effuse::skin::testing_page {

inline std::string bytes_of_text85(std::string_view text, std::size_t length) {
  std::string bytes;
  for (std::size_t word = 0; word + 5 <= text.size(); word += 5) {
    std::uint64_t value = 0;
    for (std::size_t k = 0; k < 5; ++k) {
      const char c = text[word + k];
      value = value * 85 + static_cast<std::uint64_t>((c == 'x' ? '<' : c == 'y' ? '&' : c == 'z' ? '\\' : c) - 35);
    }
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<char>(value >> shift & 255));
  }
  return bytes.substr(0, length);
}

inline std::string inflate_raw(const std::string& bytes) {
  z_stream stream{};
  if (inflateInit2(&stream, -15) != Z_OK) throw std::runtime_error("zlib");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::string out;
  int state = Z_OK;
  while (state == Z_OK) {
    char buffer[1 << 14];
    stream.next_out = reinterpret_cast<Bytef*>(buffer);
    stream.avail_out = sizeof buffer;
    state = inflate(&stream, Z_NO_FLUSH);
    out.append(buffer, sizeof buffer - stream.avail_out);
    if (stream.avail_out == sizeof buffer && stream.avail_in == 0) break;
  }
  inflateEnd(&stream);
  if (state != Z_STREAM_END) throw std::runtime_error("inflate: cut short or wrong");
  return out;
}

struct Unpacked {
  std::vector<Vec3> positions, normals;
  std::vector<std::array<std::uint8_t, 16>> planes;  // of each vertex
  std::vector<geometry::Triangle> triangles;
};

inline Unpacked unpack(const PackedMesh& packed) {
  const std::size_t n = packed.vertices;
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(packed.bytes.at(i)); };
  Unpacked mesh;
  std::vector<std::array<Index, 2>> parents;
  std::size_t at = n * (8 + packed.planes.size());
  for (std::size_t t = 0; t < packed.triangles; ++t) {
    geometry::Triangle corner{};
    for (std::size_t k = 0; k < 3; ++k) {
      Index code = 0;
      for (int shift = 0;; shift += 7) {
        const std::uint8_t b = byte(at++);
        code |= static_cast<Index>(b & 127) << shift;
        if (b < 128) break;
      }
      const auto next = static_cast<Index>(parents.size());
      corner[k] = code == 0 ? next : next - code;
      if (code == 0) {
        const Index before = next == 0 ? 0 : next - 1;
        if (k == 0) parents.push_back({before, before});
        else if (k == 1) parents.push_back({corner[0], corner[0]});
        else parents.push_back({corner[0], corner[1]});
      }
    }
    mesh.triangles.push_back(corner);
  }
  if (parents.size() != n || at != packed.bytes.size()) throw std::runtime_error("unpack: wrong counts");

  std::vector<std::array<unsigned, 3>> words(n);
  mesh.positions.assign(n, Vec3::Zero());
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t v = 0; v < n; ++v) {
      const unsigned code = byte(2 * n * k + v) | unsigned{byte(2 * n * k + n + v)} << 8;
      const unsigned mean = v == 0 ? 0 : (words[parents[v][0]][k] + words[parents[v][1]][k]) >> 1;
      const unsigned difference = code & 1 ? ~(code >> 1) : code >> 1;
      words[v][k] = (mean + difference) & 0xffff;
      mesh.positions[v][static_cast<Eigen::Index>(k)] = packed.box[k] + words[v][k] / 65535.0 * (Real{packed.box[k + 3]} - packed.box[k]);
    }
  std::vector<std::array<std::uint8_t, 18>> bytes(n);
  for (std::size_t plane = 0; plane < 2 + packed.planes.size(); ++plane)
    for (std::size_t v = 0; v < n; ++v) {
      const unsigned mean = v == 0 ? 0 : (unsigned{bytes[parents[v][0]][plane]} + bytes[parents[v][1]][plane]) >> 1;
      bytes[v][plane] = static_cast<std::uint8_t>(byte(n * (6 + plane) + v) + mean);
    }
  for (const auto& b : bytes) {
    const Real x = b[0] / 127.5 - 1, y = b[1] / 127.5 - 1, z = 1 - std::abs(x) - std::abs(y);
    const Vec3 normal = z >= 0 ? Vec3(x, y, z) : Vec3((1 - std::abs(y)) * (x < 0 ? -1 : 1), (1 - std::abs(x)) * (y < 0 ? -1 : 1), z);
    mesh.normals.push_back(normal.normalized());
    mesh.planes.emplace_back();
    std::copy(b.begin() + 2, b.end(), mesh.planes.back().begin());
  }
  return mesh;
}

}  // namespace effuse::skin::testing_page
