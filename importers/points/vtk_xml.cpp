#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "geometry/base/error.h"
#include "importers/input_file.h"
#include "importers/points/columns_internal.h"
#include "importers/points/vtk_data_internal.h"

// Source: "VTK File Formats" (Kitware), XML formats; the layout of zipped and appended data from the VTK wiki, "VTK XML
// Formats".
namespace effuse::importers {

namespace {

/// A start or end tag: what stands between < and >.
struct Tag {
  std::string_view name;
  bool closing = false, alone = false;  // </name>, <name/>
  std::vector<std::pair<std::string_view, std::string_view>> attributes;
  std::size_t begin = 0, end = 0;  // of its bytes

  std::string_view operator[](std::string_view attribute) const {
    for (const auto& [key, value] : attributes)
      if (key == attribute) return value;
    return {};
  }
};

/// Where an array's numbers are.
struct Array {
  Column column;
  VtkType type = VtkType::kNone;
  bool is_position = false, appended = false, ascii = false;
  std::string_view inline_data;
  std::size_t offset = 0;  // in the appended data
  std::size_t at = 0;      // of its tag
};

struct Piece {
  std::size_t points = 0, at = 0;
  std::vector<Array> arrays;
};

/// Of numbers in one file, unzipped.
constexpr std::size_t kMostBytes = std::size_t{4} << 30;

class XmlVtk {
 public:
  XmlVtk(std::string_view bytes, const std::string& name, const PointImportOptions& options) : bytes_(bytes), name_(name), options_(options) {}

  PointCloud read() {
    read_tags();
    std::vector<Vec3> position;
    std::vector<Column> columns;
    for (std::size_t p = 0; p < pieces_.size(); ++p) add_piece(pieces_[p], p == 0, position, columns);
    return assemble(name_, std::move(position), columns, options_);
  }

 private:
  [[noreturn]] void fail(std::size_t at, const std::string& message) const {
    const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes_.size()));
    throw InputError({name_, 1 + static_cast<int>(std::count(bytes_.begin(), end, '\n'))}, message);
  }

  // Tags.

  static bool blank(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

  /// The next tag from at_ on; false at the end of the file. Comments and declarations are passed over.
  bool next(Tag& tag) {
    for (;;) {
      const std::size_t open = bytes_.find('<', at_);
      if (open == std::string_view::npos) return false;
      const std::string_view rest = bytes_.substr(open);
      const std::string_view close = rest.starts_with("<!--") ? "-->" : rest.starts_with("<?") ? "?>" : rest.starts_with("<!") ? ">" : "";
      if (close.empty()) {
        parse_tag(open, tag);
        at_ = tag.end;
        return true;
      }
      const std::size_t end = bytes_.find(close, open);
      if (end == std::string_view::npos) fail(open, "a comment or declaration that does not end");
      at_ = end + close.size();
    }
  }

  void parse_tag(std::size_t open, Tag& tag) {
    tag = {};
    tag.begin = open;
    std::size_t i = open + 1;
    const auto ends = [&] { fail(open, fmt::format("the file ends within the tag {}: truncated", quote(bytes_.substr(open, 30)))); };
    const auto skip_blanks = [&] {
      while (i < bytes_.size() && blank(bytes_[i])) ++i;
      if (i == bytes_.size()) ends();
    };
    const auto word = [&] {
      const std::size_t start = i;
      while (i < bytes_.size() && !blank(bytes_[i]) && bytes_[i] != '>' && bytes_[i] != '/' && bytes_[i] != '=' && bytes_[i] != '<') ++i;
      if (i == bytes_.size()) ends();
      return bytes_.substr(start, i - start);
    };
    if (i < bytes_.size() && bytes_[i] == '/') {
      tag.closing = true;
      ++i;
    }
    tag.name = word();
    for (;;) {
      skip_blanks();
      if (bytes_[i] == '/') {
        tag.alone = true;
        ++i;
        skip_blanks();
      }
      if (bytes_[i] == '>') break;
      const std::string_view key = word();
      skip_blanks();
      if (key.empty() || bytes_[i] != '=') fail(i, fmt::format("found {}, wanted an attribute of the tag {}", quote(bytes_.substr(i, 20)), quote(tag.name)));
      ++i;
      skip_blanks();
      const char mark = bytes_[i];
      if (mark != '"' && mark != '\'') fail(i, fmt::format("found {}, wanted a value in quotes", quote(bytes_.substr(i, 20))));
      const std::size_t end = bytes_.find(mark, i + 1);
      if (end == std::string_view::npos) ends();
      tag.attributes.emplace_back(key, bytes_.substr(i + 1, end - i - 1));
      i = end + 1;
    }
    tag.end = i + 1;
  }

  std::size_t count(const Tag& tag, std::string_view attribute) const {
    const std::string_view text = tag[attribute];
    std::size_t value = 0;
    const auto [stopped, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc{} || stopped != text.data() + text.size())
      fail(tag.begin, fmt::format("found {}=\"{}\" in the tag {}, wanted a number", attribute, printable(text, 40), quote(tag.name)));
    return value;
  }

  void read_tags() {
    Tag tag;
    if (!next(tag) || tag.name != "VTKFile" || tag.closing) throw InputError({name_, 1}, "has no tag 'VTKFile': not a VTK XML file");
    const std::string_view kind = tag["type"];
    if (kind != "PolyData" && kind != "UnstructuredGrid")
      fail(tag.begin, fmt::format("is a VTK file of type {}, particles are read from PolyData and UnstructuredGrid", quote(kind)));
    big_endian_ = tag["byte_order"] == "BigEndian";
    wide_ = tag["header_type"] == "UInt64";
    const std::string_view compressor = tag["compressor"];
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
      fail(tag.begin, fmt::format("is compressed with {}, which is not read; wanted vtkZLibDataCompressor or none", quote(compressor)));
    zipped_ = !compressor.empty();

    bool ended = false;
    std::string_view section;  // Points, PointData, ...: what a DataArray belongs to
    while (!ended && next(tag)) {
      if (tag.closing) {
        ended = tag.name == "VTKFile";
        if (tag.name == section) section = {};
      } else if (tag.name == "Piece") {
        pieces_.push_back({count(tag, "NumberOfPoints"), tag.begin, {}});
      } else if (tag.name == "AppendedData") {
        base64_ = tag["encoding"] != "raw";
        const std::size_t mark = bytes_.find('_', tag.end);
        if (mark == std::string_view::npos) fail(tag.begin, "the appended data do not begin with '_': truncated?");
        appended_ = bytes_.substr(mark + 1);
        ended = true;  // nothing of ours comes after, and raw data may look like tags
      } else if (tag.name == "DataArray") {
        data_array(tag, section);
      } else if (!tag.alone) {
        section = tag.name;
      }
    }
    if (!ended) fail(bytes_.size(), "the file ends before </VTKFile>: truncated");
  }

  void data_array(const Tag& tag, std::string_view section) {
    static constexpr std::array<std::pair<std::string_view, VtkType>, 10> kTypes = {{{"Int8", VtkType::kInt8},
                                                                                     {"UInt8", VtkType::kUint8},
                                                                                     {"Int16", VtkType::kInt16},
                                                                                     {"UInt16", VtkType::kUint16},
                                                                                     {"Int32", VtkType::kInt32},
                                                                                     {"UInt32", VtkType::kUint32},
                                                                                     {"Int64", VtkType::kInt64},
                                                                                     {"UInt64", VtkType::kUint64},
                                                                                     {"Float32", VtkType::kFloat},
                                                                                     {"Float64", VtkType::kDouble}}};
    Array array;
    array.at = tag.begin;
    array.is_position = section == "Points";
    array.column.name = std::string(tag["Name"]);
    const std::size_t width = tag["NumberOfComponents"].empty() ? 1 : count(tag, "NumberOfComponents");
    if (width > 1'000'000) fail(tag.begin, fmt::format("found a width of {}", width));
    array.column.width = static_cast<int>(width);
    for (const auto& [name, type] : kTypes)
      if (name == tag["type"]) array.type = type;
    array.column.coarse = array.type == VtkType::kFloat;
    array.ascii = tag["format"] == "ascii";
    array.appended = tag["format"] == "appended";

    // The text right inside; tags in it (InformationKey) have text of their own.
    Tag inner;
    std::size_t depth = 0, from = tag.end;
    while (!tag.alone) {
      if (!next(inner)) fail(tag.begin, "a DataArray that does not end: truncated");
      if (depth == 0 && array.inline_data.empty()) {
        const std::string_view text = bytes_.substr(from, inner.begin - from);
        if (!std::all_of(text.begin(), text.end(), blank)) array.inline_data = text;
      }
      if (inner.closing && depth == 0) break;
      if (inner.closing) --depth;
      else if (!inner.alone) ++depth;
      from = inner.end;
    }
    if (section != "Points" && section != "PointData") return;
    if (pieces_.empty()) fail(tag.begin, "a DataArray outside any Piece");
    if (array.appended) array.offset = count(tag, "offset");
    const bool usable = array.is_position || (array.type != VtkType::kNone && may_be_wanted(array.column));
    if (!usable) array.column.width = 0;
    if (usable && array.type == VtkType::kNone) fail(tag.begin, fmt::format("found an array of type {}, wanted Float32, Float64, Int32, ...", quote(tag["type"])));
    if (usable && !array.ascii && !array.appended && tag["format"] != "binary")
      fail(tag.begin, fmt::format("found the format {}, wanted ascii, binary or appended", quote(tag["format"])));
    pieces_.back().arrays.push_back(std::move(array));
  }

  // Numbers.

  void add_piece(const Piece& piece, bool first, std::vector<Vec3>& position, std::vector<Column>& columns) {
    const Array* points = nullptr;
    std::size_t c = 0;
    for (const Array& array : piece.arrays) {
      if (array.is_position) {
        points = &array;
        continue;
      }
      // Every piece has the same arrays.
      if (first) columns.push_back(array.column);
      if (c >= columns.size() || columns[c].name != array.column.name || columns[c].width != array.column.width)
        fail(array.at, fmt::format("array {} is not what the first piece has there", quote(array.column.name)));
      if (array.column.width > 0) {
        const std::vector<double> values = numbers(array, piece.points);
        columns[c].values.insert(columns[c].values.end(), values.begin(), values.end());
      }
      ++c;
    }
    if (c != columns.size()) fail(piece.at, fmt::format("a piece with {} arrays, the first has {}", c, columns.size()));
    if (piece.points == 0) return;
    if (!points) fail(piece.at, "a piece without Points");
    if (points->column.width != 3) fail(points->at, fmt::format("points with {} components, wanted 3", points->column.width));
    const std::vector<double> xyz = numbers(*points, piece.points);
    require_countable(name_, static_cast<double>(position.size() + piece.points));
    for (std::size_t i = 0; i < piece.points; ++i) position.emplace_back(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
  }

  std::vector<double> numbers(const Array& array, std::size_t tuples) {
    const std::size_t width = static_cast<std::size_t>(array.column.width), size = size_of(array.type);
    if (tuples == 0) return {};
    std::string_view source = array.inline_data;
    if (array.appended) {
      if (array.offset > appended_.size()) fail(array.at, fmt::format("the data should begin at byte {} of the appended ones, there are {}: truncated", array.offset, appended_.size()));
      source = appended_.substr(array.offset);
    }
    // What could stand there, before memory is asked for: deflate makes at most 1032 bytes of one.
    const std::size_t most = array.ascii ? (source.size() + 1) / 2 : (zipped_ ? 1032 : 1) * source.size() / size;
    if (width > 0 && tuples > most / width)
      fail(array.at, fmt::format("{} x {} numbers are promised, there is room for {} at most: truncated, or a wrong count", tuples, width, most));
    // Arrays may share appended data; together they still are no more than the file could hold.
    if (!array.ascii) taken_ += tuples * width * size;
    if (taken_ > std::min<std::size_t>(kMostBytes, (zipped_ ? 1032 : 1) * bytes_.size())) fail(array.at, "the arrays promise more than the file can hold: a wrong count");
    std::vector<double> values;
    if (array.ascii) {
      values.reserve(tuples * width);
      for (std::size_t i = 0; i < source.size();) {
        while (i < source.size() && blank(source[i])) ++i;
        const std::size_t start = i;
        while (i < source.size() && !blank(source[i])) ++i;
        if (i == start) break;
        double value = 0;
        if (!parse_number(source.substr(start, i - start), value))
          fail(static_cast<std::size_t>(source.data() - bytes_.data()) + start, fmt::format("found {}, wanted a number", quote(source.substr(start, i - start))));
        values.push_back(value);
      }
      if (values.size() != tuples * width) fail(array.at, fmt::format("found {} numbers, wanted {} x {}", values.size(), tuples, width));
      return values;
    }
    const std::string data = block(array, source, tuples * width * size);
    values.resize(tuples * width);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = load_number(data.data() + i * size, array.type, big_endian_);
    return values;
  }

  /// The bytes of an array: behind their length, or zipped behind the lengths of their blocks.
  std::string block(const Array& array, std::string_view source, std::size_t wanted_bytes) {
    const bool coded = array.appended ? base64_ : true;
    const std::size_t word = wide_ ? 8 : 4;
    const auto length = [&](const std::string& header, std::size_t k) {
      return static_cast<std::size_t>(load_number(header.data() + k * word, wide_ ? VtkType::kUint64 : VtkType::kUint32, big_endian_));
    };
    const auto mismatch = [&](std::size_t found) { fail(array.at, fmt::format("array {} has {} bytes of data, wanted {}", quote(array.column.name), found, wanted_bytes)); };
    if (!zipped_) {
      const std::size_t has = length(take(array, source, 0, word, coded), 0);
      if (has != wanted_bytes) mismatch(has);
      return take(array, source, 0, word + wanted_bytes, coded).substr(word);
    }
    // blocks, bytes of each but the last, bytes of the last or 0, zipped bytes of each
    const std::string head = take(array, source, 0, 3 * word, coded);
    const std::size_t blocks = length(head, 0), full = length(head, 1), partial = length(head, 2);
    if (blocks > source.size() / word) fail(array.at, fmt::format("{} zipped blocks are promised, the file has no room for them", blocks));
    const std::string header = take(array, source, 0, (3 + blocks) * word, coded);
    const std::size_t begin = coded ? coded_size((3 + blocks) * word) : (3 + blocks) * word;
    std::size_t zipped = 0;
    for (std::size_t b = 0; b < blocks; ++b) {
      const std::size_t size = length(header, 3 + b);
      if (size > source.size() || zipped > source.size()) fail(array.at, "zipped blocks that are longer than the file: truncated");
      zipped += size;
    }
    const std::string data = take(array, source, begin, zipped, coded);
    std::string out;
    std::size_t at = 0;
    for (std::size_t b = 0; b < blocks; ++b) {
      const std::size_t size = length(header, 3 + b), expected = b + 1 == blocks && partial > 0 ? partial : full;
      const std::string piece = inflate_bytes(std::string_view(data).substr(at, size), name_, wanted_bytes);
      if (piece.size() != expected) fail(array.at, fmt::format("a zipped block holds {} bytes, wanted {}", piece.size(), expected));
      out += piece;
      at += size;
      if (out.size() > wanted_bytes) break;
    }
    if (out.size() != wanted_bytes) mismatch(out.size());
    return out;
  }

  static std::size_t coded_size(std::size_t bytes) { return (bytes + 2) / 3 * 4; }

  /// size bytes from the (coded) place at on: plain, or out of base64 that begins there. Blanks in it do not count.
  std::string take(const Array& array, std::string_view source, std::size_t at, std::size_t size, bool coded) const {
    const auto truncated = [&] { fail(array.at, fmt::format("the data of array {} end too early: truncated, or a wrong count", quote(array.column.name))); };
    if (!coded) {
      if (at > source.size() || size > source.size() - at) truncated();
      return std::string(source.substr(at, size));
    }
    if (size > source.size()) truncated();
    std::string out;
    out.reserve(size);
    std::uint32_t bits = 0;
    int held = 0;
    std::size_t seen = 0;
    for (std::size_t i = 0; i < source.size() && out.size() < size; ++i) {
      const char c = source[i];
      if (blank(c) || seen++ < at) continue;
      const int digit = c >= 'A' && c <= 'Z' ? c - 'A' : c >= 'a' && c <= 'z' ? c - 'a' + 26 : c >= '0' && c <= '9' ? c - '0' + 52 : c == '+' ? 62 : c == '/' ? 63 : -1;
      if (digit < 0) fail(array.at, fmt::format("found {} in the data of array {}, wanted base64", quote(source.substr(i, 1)), quote(array.column.name)));
      bits = bits << 6 | static_cast<std::uint32_t>(digit);
      held += 6;
      if (held < 8) continue;
      held -= 8;
      out += static_cast<char>(bits >> held & 0xff);
    }
    if (out.size() < size) truncated();
    return out;
  }

  std::string_view bytes_;
  const std::string& name_;
  const PointImportOptions& options_;
  std::size_t at_ = 0;
  bool big_endian_ = false, wide_ = false, zipped_ = false, base64_ = false;
  std::vector<Piece> pieces_;
  std::string_view appended_;
  std::size_t taken_ = 0;  // bytes of numbers so far
};

}  // namespace

PointCloud parse_xml_vtk(std::string_view bytes, const std::string& name, const PointImportOptions& options) {
  return XmlVtk(bytes, name, options).read();
}

}  // namespace effuse::importers
