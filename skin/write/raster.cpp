#include "skin/write/raster.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace fs = std::filesystem;

namespace {

void check(const Raster& r) {
  CHECK(r.nx >= 1 && r.ny >= 1);
  CHECK_EQ(r.values.size(), static_cast<std::size_t>(r.nx) * static_cast<std::size_t>(r.ny));
  CHECK(r.cell.minCoeff() > 0 && r.cell.allFinite());
  CHECK(r.corner.allFinite());
  CHECK(std::none_of(r.values.begin(), r.values.end(), [](float v) { return std::isinf(v); }));
}

const float* north_row(const Raster& r, int k) { return r.values.data() + static_cast<std::size_t>(r.ny - 1 - k) * static_cast<std::size_t>(r.nx); }
float written(float value) { return std::isnan(value) ? kNoData : value; }

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }
bool same_word(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) { return lower(x) == lower(y); });
}
bool blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f'; }

/// The text without blanks outside quotes.
std::string compact(std::string_view wkt) {
  std::string out;
  bool in_quotes = false;
  for (const char c : wkt) {
    if (c == '"') in_quotes = !in_quotes;
    if (in_quotes || !blank(c)) out += c;
  }
  return out;
}

std::optional<int> whole_number(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value <= 0) return std::nullopt;
  return value;
}

/// The keyword a compact WKT begins with: letters up to a bracket; empty when it is no WKT.
std::string_view root_keyword(std::string_view wkt) {
  const std::size_t end = wkt.find_first_of("[(");
  if (end == std::string_view::npos || (wkt.back() != ']' && wkt.back() != ')')) return {};
  const std::string_view word = wkt.substr(0, end);
  const bool letters = std::all_of(word.begin(), word.end(), [](char c) { return (lower(c) >= 'a' && lower(c) <= 'z') || c == '_'; });
  return letters ? word : std::string_view();
}

/// What stands between the brackets of the root's own member of that name: of AUTHORITY["EPSG","27200"] the rest of
/// PROJCS is not, its datum's is not either.
std::string_view member(std::string_view wkt, std::string_view name) {
  int depth = 0;
  bool in_quotes = false;
  for (std::size_t i = 0; i < wkt.size(); ++i) {
    const char c = wkt[i];
    if (c == '"') in_quotes = !in_quotes;
    if (in_quotes) continue;
    if (c == ',' && depth == 1 && same_word(wkt.substr(i + 1, name.size()), name)) {
      const std::size_t open = i + 1 + name.size(), close = wkt.find_first_of("])", open);
      if (open < wkt.size() && (wkt[open] == '[' || wkt[open] == '(') && close != std::string_view::npos) return wkt.substr(open + 1, close - open - 1);
    }
    if (c == '[' || c == '(') ++depth;
    if (c == ']' || c == ')') --depth;
  }
  return {};
}

/// Little-endian numbers, one after the other.
class Bytes {
 public:
  void u16(std::uint32_t v) { number(v, 2); }
  void u32(std::uint32_t v) { number(v, 4); }
  void f32(float v) { number(std::bit_cast<std::uint32_t>(v), 4); }
  void f64(double v) { number(std::bit_cast<std::uint64_t>(v), 8); }
  void raw(std::string_view bytes) { bytes_ += bytes; }
  std::string take() { return std::move(bytes_); }

 private:
  void number(std::uint64_t v, int bytes) {
    for (int k = 0; k < bytes; ++k) bytes_ += static_cast<char>(v >> (8 * k) & 0xff);
  }
  std::string bytes_;
};

/// An entry of TIFF's directory.
struct Tag {
  enum Type : std::uint16_t { kAscii = 2, kShort = 3, kLong = 4, kRational = 5, kDouble = 12 };
  std::uint16_t tag;
  Type type;
  std::uint32_t count;
  std::string data;
};

Tag ascii(std::uint16_t tag, std::string text) {
  text += '\0';
  return {tag, Tag::kAscii, static_cast<std::uint32_t>(text.size()), text};
}
Tag shorts(std::uint16_t tag, const std::vector<std::uint32_t>& values) {
  Bytes bytes;
  for (const std::uint32_t v : values) bytes.u16(v);
  return {tag, Tag::kShort, static_cast<std::uint32_t>(values.size()), bytes.take()};
}
Tag longs(std::uint16_t tag, const std::vector<std::uint32_t>& values) {
  Bytes bytes;
  for (const std::uint32_t v : values) bytes.u32(v);
  return {tag, Tag::kLong, static_cast<std::uint32_t>(values.size()), bytes.take()};
}
Tag doubles(std::uint16_t tag, const std::vector<double>& values) {
  Bytes bytes;
  for (const double v : values) bytes.f64(v);
  return {tag, Tag::kDouble, static_cast<std::uint32_t>(values.size()), bytes.take()};
}
Tag one(std::uint16_t tag) { return {tag, Tag::kRational, 1, longs(0, {1, 1}).data}; }

// GeoTIFF's keys and the values used here.
constexpr std::uint32_t kModelType = 1024, kRasterType = 1025, kCitation = 1026, kProjectedSystem = 3072, kProjectedCitation = 3073, kLinearUnits = 3076;
constexpr std::uint32_t kProjected = 1, kPixelIsArea = 1, kUserDefined = 32767, kMetre = 9001;
constexpr std::uint32_t kKeyDirectory = 34735, kAsciiParameters = 34737;

/// The tags that hold the coordinate system. Without one, none: of a key directory that says no more than "values
/// are of whole cells", which is so anyway, GDAL makes a nameless system of unknown units.
std::vector<Tag> geo_keys(const std::string& crs) {
  if (crs.empty()) return {};
  std::vector<std::array<std::uint32_t, 4>> keys;  // id, tag that holds the value or 0, count, value or offset
  std::string texts;
  const auto key = [&](std::uint32_t id, std::uint32_t value) { keys.push_back({id, 0, 1, value}); };
  const auto text_key = [&](std::uint32_t id, std::string text) {
    std::replace(text.begin(), text.end(), '|', '/');  // what ends a text here
    std::replace(text.begin(), text.end(), '\0', ' ');
    if (text.size() > 60000) return;  // counts are 16 bits
    text += '|';
    keys.push_back({id, kAsciiParameters, static_cast<std::uint32_t>(text.size()), static_cast<std::uint32_t>(texts.size())});
    texts += text;
  };
  const std::string wkt = compact(crs);
  const std::optional<int> code = epsg_code(crs);
  const bool known = code && *code < static_cast<int>(kUserDefined);  // the numbers a key can hold
  const bool described = !root_keyword(wkt).empty();
  // User-defined: of a projected model GDAL wants the parameters in keys, and does not look at the citation.
  key(kModelType, known ? kProjected : kUserDefined);
  key(kRasterType, kPixelIsArea);
  if (known) {
    key(kProjectedSystem, static_cast<std::uint32_t>(*code));
    key(kLinearUnits, kMetre);
  } else if (described) {
    key(kProjectedSystem, kUserDefined);
    text_key(kProjectedCitation, "ESRI PE String = " + wkt);
    key(kLinearUnits, kMetre);
  } else {
    text_key(kCitation, crs);
  }
  std::vector<std::uint32_t> directory = {1, 1, 0, static_cast<std::uint32_t>(keys.size())};
  for (const auto& k : keys) directory.insert(directory.end(), k.begin(), k.end());
  std::vector<Tag> tags = {shorts(kKeyDirectory, directory)};
  if (!texts.empty()) tags.push_back(ascii(kAsciiParameters, texts));
  return tags;
}

std::string xml(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') out += "&amp;";
    else if (c == '<') out += "&lt;";
    else if (c == '>') out += "&gt;";
    else out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out;
}

/// The WKT of a UTM zone by its EPSG code, as .prj files have it; empty for any other code.
std::string utm_wkt(int code) {
  struct Family {
    int first, zones;  // codes first + zone, zone 1..zones
    bool south;
    const char *name, *system, *datum, *ellipsoid;
  };
  constexpr const char *kWgs84 = "WGS_1984\",6378137.0,298.257223563", *kGrs80 = "GRS_1980\",6378137.0,298.257222101";
  constexpr Family kFamilies[] = {{32600, 60, false, "WGS_1984", "GCS_WGS_1984", "D_WGS_1984", kWgs84},
                                  {32700, 60, true, "WGS_1984", "GCS_WGS_1984", "D_WGS_1984", kWgs84},
                                  {25800, 38, false, "ETRS_1989", "GCS_ETRS_1989", "D_ETRS_1989", kGrs80},
                                  {26900, 23, false, "NAD_1983", "GCS_North_American_1983", "D_North_American_1983", kGrs80}};
  for (const Family& f : kFamilies) {
    const int zone = code - f.first;
    if (zone < 1 || zone > f.zones || (f.first == 25800 && zone < 28)) continue;
    return fmt::format("PROJCS[\"{}_UTM_Zone_{}{}\",GEOGCS[\"{}\",DATUM[\"{}\",SPHEROID[\"{}]],PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]],"
                       "PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"False_Easting\",500000.0],PARAMETER[\"False_Northing\",{}],PARAMETER[\"Central_Meridian\",{}.0],"
                       "PARAMETER[\"Scale_Factor\",0.9996],PARAMETER[\"Latitude_Of_Origin\",0.0],UNIT[\"Meter\",1.0]]",
                       f.name, zone, f.south ? 'S' : 'N', f.system, f.datum, f.ellipsoid, f.south ? "10000000.0" : "0.0", 6 * zone - 183);
  }
  return "";
}

/// Texts are escaped twice, as GDAL does in writing and undoes in reading.
std::string gdal_metadata(const Raster& r) {
  std::string items;
  if (!r.description.empty()) items += fmt::format("  <Item name=\"DESCRIPTION\" sample=\"0\" role=\"description\">{}</Item>\n", xml(xml(r.description)));
  if (!r.unit.empty()) items += fmt::format("  <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">{}</Item>\n", xml(xml(r.unit)));
  return items.empty() ? "" : "<GDALMetadata>\n" + items + "</GDALMetadata>\n";
}

/// Writes a file, its place's faults told as bad input.
void write_output(const fs::path& file, std::string_view bytes) {
  const Place place{file.string()};
  std::error_code ignored;
  if (fs::is_directory(file, ignored)) throw InputError(place, "is a folder, wanted a file to write a map to");
  try {
    write_file(file, bytes);
  } catch (const ResourceError&) {
    throw;
  } catch (const InputError& error) {
    throw InputError(place, fmt::format("cannot write a map here: {}", error.faults().front().message));
  } catch (const std::runtime_error& error) {
    throw InputError(place, fmt::format("cannot write a map here: {}", error.what()));
  }
}

}  // namespace

std::optional<int> epsg_code(std::string_view crs) {
  const std::string text = compact(crs);
  constexpr std::string_view kPrefix = "epsg:";
  if (same_word(std::string_view(text).substr(0, kPrefix.size()), kPrefix)) return whole_number(std::string_view(text).substr(kPrefix.size()));
  const std::string_view root = root_keyword(text);
  if (!same_word(root, "projcs") && !same_word(root, "projcrs") && !same_word(root, "projectedcrs")) return std::nullopt;
  for (const char* name : {"AUTHORITY", "ID"}) {
    std::string code(member(text, name));  // "EPSG","27200" or "EPSG",27200
    std::erase(code, '"');
    constexpr std::string_view kEpsg = "epsg,";
    if (same_word(std::string_view(code).substr(0, kEpsg.size()), kEpsg)) return whole_number(std::string_view(code).substr(kEpsg.size(), code.find(',', kEpsg.size()) - kEpsg.size()));
  }
  return std::nullopt;
}

std::string encode_geotiff(const Raster& r) {
  check(r);
  constexpr std::uint64_t kStripBytes = 1 << 16, kLargest = 0xffffffffu - (1 << 20);
  const std::uint64_t row_bytes = static_cast<std::uint64_t>(r.nx) * sizeof(float), image_bytes = row_bytes * static_cast<std::uint64_t>(r.ny);
  CHECK_LT(image_bytes + 8 * static_cast<std::uint64_t>(r.ny), kLargest);  // offsets are 32 bits
  const std::uint64_t rows = std::clamp<std::uint64_t>(kStripBytes / row_bytes, 1, static_cast<std::uint64_t>(r.ny));
  const std::uint64_t strips = (static_cast<std::uint64_t>(r.ny) + rows - 1) / rows;
  const double north = r.corner.y() + r.ny * r.cell.y();

  const auto u32 = [](std::uint64_t v) { return static_cast<std::uint32_t>(v); };
  std::vector<std::uint32_t> offsets(strips), counts(strips);
  for (std::uint64_t s = 0; s < strips; ++s) counts[s] = u32(std::min(rows, static_cast<std::uint64_t>(r.ny) - s * rows) * row_bytes);
  std::vector<Tag> tags = {
      longs(256, {u32(static_cast<std::uint64_t>(r.nx))}),  // ImageWidth
      longs(257, {u32(static_cast<std::uint64_t>(r.ny))}),  // ImageLength
      shorts(258, {32}),                                    // BitsPerSample
      shorts(259, {1}),                                     // Compression: none
      shorts(262, {1}),                                     // PhotometricInterpretation: 0 is black
  };
  if (!r.description.empty()) tags.push_back(ascii(270, r.description));  // ImageDescription
  const std::size_t offsets_at = tags.size();
  tags.insert(tags.end(), {
                              longs(273, offsets),      // StripOffsets, known below
                              shorts(277, {1}),         // SamplesPerPixel
                              longs(278, {u32(rows)}),  // RowsPerStrip
                              longs(279, counts),       // StripByteCounts
                              one(282), one(283),       // XResolution, YResolution: baseline wants them
                              shorts(296, {1}),         // ResolutionUnit: none
                              ascii(305, "effuse"),     // Software
                              shorts(339, {3}),         // SampleFormat: floating point
                              doubles(33550, {r.cell.x(), r.cell.y(), 0}),        // ModelPixelScale
                              doubles(33922, {0, 0, 0, r.corner.x(), north, 0}),  // ModelTiepoint: the north-west corner
                          });
  for (Tag& tag : geo_keys(r.crs)) tags.push_back(std::move(tag));
  if (const std::string metadata = gdal_metadata(r); !metadata.empty()) tags.push_back(ascii(42112, metadata));
  tags.push_back(ascii(42113, fmt::format("{}", kNoData)));

  // Header, directory, the values that do not fit into it, the image: each begins on an even byte.
  const auto even = [](std::uint64_t n) { return n + (n & 1); };
  const std::uint64_t directory_end = 8 + 2 + 12 * tags.size() + 4;
  std::uint64_t image_at = directory_end;
  for (const Tag& tag : tags)
    if (tag.data.size() > 4) image_at = even(image_at + tag.data.size());
  for (std::uint64_t s = 0; s < strips; ++s) offsets[s] = u32(image_at + s * rows * row_bytes);
  tags[offsets_at] = longs(273, offsets);

  Bytes head;
  head.u16(0x4949);  // "II": little-endian
  head.u16(42);
  head.u32(8);
  head.u16(u32(tags.size()));
  std::string values;
  for (const Tag& tag : tags) {
    head.u16(tag.tag);
    head.u16(tag.type);
    head.u32(tag.count);
    if (tag.data.size() > 4) {
      head.u32(u32(directory_end + values.size()));
      values += tag.data;
      if (values.size() % 2 == 1) values += '\0';
    } else {
      std::string padded = tag.data;
      padded.resize(4, '\0');
      head.raw(padded);
    }
  }
  head.u32(0);  // no further directory
  std::string out = head.take() + values;
  CHECK_EQ(out.size(), image_at);
  out.reserve(image_at + image_bytes);
  for (int k = 0; k < r.ny; ++k) {
    Bytes line;
    for (int i = 0; i < r.nx; ++i) line.f32(written(north_row(r, k)[i]));
    out += line.take();
  }
  return out;
}

std::string encode_esri_ascii(const Raster& r) {
  check(r);
  std::string out = fmt::format("ncols {}\nnrows {}\nxllcorner {}\nyllcorner {}\n", r.nx, r.ny, r.corner.x(), r.corner.y());
  out += r.cell.x() == r.cell.y() ? fmt::format("cellsize {}\n", r.cell.x()) : fmt::format("dx {}\ndy {}\n", r.cell.x(), r.cell.y());
  out += fmt::format("NODATA_value {}\n", kNoData);
  for (int k = 0; k < r.ny; ++k)
    for (int i = 0; i < r.nx; ++i) fmt::format_to(std::back_inserter(out), "{}{}", written(north_row(r, k)[i]), i + 1 < r.nx ? ' ' : '\n');
  return out;
}

void write_geotiff(const fs::path& file, const Raster& raster) {
  ZONE("write.geotiff");
  write_output(file, encode_geotiff(raster));
}

void write_esri_ascii(const fs::path& file, const Raster& raster) {
  ZONE("write.esri_ascii");
  const std::string text = encode_esri_ascii(raster);
  const bool is_wkt = !root_keyword(compact(raster.crs)).empty();
  const std::string wkt = is_wkt ? raster.crs : utm_wkt(epsg_code(raster.crs).value_or(0));
  const fs::path prj = fs::path(file).replace_extension(".prj");
  std::error_code ignored;
  if (wkt.empty()) {
    write_output(file, text);
    fs::remove(prj, ignored);
    return;
  }
  // Both or none: the heights come last, and if there is no room for them the old system comes back.
  const std::string before = fs::is_regular_file(prj, ignored) ? read_file(prj) : "";
  write_output(prj, wkt + "\n");
  try {
    write_output(file, text);
  } catch (...) {
    if (before.empty()) fs::remove(prj, ignored);
    else write_output(prj, before);
    throw;
  }
}

}  // namespace effuse::skin
