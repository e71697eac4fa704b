#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include "geometry/base/error.h"
#include "importers/input_file.h"
#include "importers/points/columns_internal.h"
#include "importers/points/vtk_data_internal.h"

// Source: "VTK File Formats" (Kitware), simple legacy formats, with the additions of version 5 (OFFSETS and CONNECTIVITY)
// and METADATA as vtkDataWriter 9 writes them.
namespace effuse::importers {

namespace {

VtkType type_named(std::string_view word) {
  static constexpr std::array<std::pair<std::string_view, VtkType>, 16> kTypes = {{{"bit", VtkType::kBit},
                                                                                   {"char", VtkType::kInt8},
                                                                                   {"signed_char", VtkType::kInt8},
                                                                                   {"unsigned_char", VtkType::kUint8},
                                                                                   {"short", VtkType::kInt16},
                                                                                   {"unsigned_short", VtkType::kUint16},
                                                                                   {"int", VtkType::kInt32},
                                                                                   {"unsigned_int", VtkType::kUint32},
                                                                                   {"vtkidtype", VtkType::kInt32},  // int in files, by convention
                                                                                   {"long", VtkType::kInt64},
                                                                                   {"unsigned_long", VtkType::kUint64},
                                                                                   {"vtktypeint64", VtkType::kInt64},
                                                                                   {"vtktypeuint64", VtkType::kUint64},
                                                                                   {"float", VtkType::kFloat},
                                                                                   {"double", VtkType::kDouble},
                                                                                   {"vtktypeint32", VtkType::kInt32}}};
  for (const auto& [name, type] : kTypes)
    if (name == word) return type;
  return VtkType::kNone;
}

class LegacyVtk {
 public:
  LegacyVtk(std::string_view bytes, const std::string& name, const PointImportOptions& options) : bytes_(bytes), name_(name), options_(options) {}

  PointCloud read() {
    read_header();
    for (;;) {
      const std::string_view keyword = word();
      if (keyword.empty()) break;
      section(lower(keyword));
    }
    if (!has_points_) fail("the file has no POINTS: truncated?");
    return assemble(name_, std::move(position_), columns_, options_);
  }

 private:
  [[noreturn]] void fail(const std::string& message) const { fail_from(start_, message); }
  [[noreturn]] void fail_from(std::size_t at, const std::string& message) const {
    if (binary_) fail_at_byte(name_, at, message);
    throw InputError({name_, 1 + static_cast<int>(std::count(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(at), '\n'))}, message);
  }

  std::string_view line() {
    start_ = at_;
    const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    std::string_view text = bytes_.substr(at_, end - at_);
    at_ = std::min(end + 1, bytes_.size());
    if (text.ends_with('\r')) text.remove_suffix(1);
    return text;
  }

  static bool blank(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

  /// The next word, on this line or a later one; empty at the end.
  std::string_view word() {
    while (at_ < bytes_.size() && blank(bytes_[at_])) ++at_;
    start_ = at_;
    while (at_ < bytes_.size() && !blank(bytes_[at_])) ++at_;
    return bytes_.substr(start_, at_ - start_);
  }

  std::string_view need_word(const char* what) {
    const std::string_view found = word();
    if (found.empty()) fail(fmt::format("the file ends, wanted {}", what));
    return found;
  }

  /// The next word if it is on this line.
  std::string_view word_on_line() {
    std::size_t i = at_;
    while (i < bytes_.size() && (bytes_[i] == ' ' || bytes_[i] == '\t')) ++i;
    if (i == bytes_.size() || bytes_[i] == '\n' || bytes_[i] == '\r') return {};
    return word();
  }

  std::size_t count(const char* what) {
    const std::string_view found = need_word(what);
    std::size_t value = 0;
    const auto [stopped, error] = std::from_chars(found.data(), found.data() + found.size(), value);
    if (error != std::errc{} || stopped != found.data() + found.size()) fail(fmt::format("found {}, wanted {}", quote(found), what));
    return value;
  }

  VtkType type() {
    const std::string_view found = need_word("a type");
    const VtkType type = type_named(lower(found));
    if (type == VtkType::kNone) fail(fmt::format("found {}, wanted a type (float, double, int, ...)", quote(found)));
    return type;
  }

  void read_header() {
    const std::string_view first = line();
    if (!lower(first).starts_with("# vtk datafile version")) {
      throw InputError({name_, 1}, fmt::format("found {}, wanted '# vtk DataFile Version ...': not a legacy VTK file", quote(first)));
    }
    line();  // the title
    const std::string_view format = word();
    if (lower(format) != "ascii" && lower(format) != "binary") fail(fmt::format("found {}, wanted ASCII or BINARY", quote(format)));
    binary_ = lower(format) == "binary";
    const std::string_view keyword = word();
    std::string what = lower(keyword);
    while (what == "field") {  // the time, before the data
      field(false);
      what = lower(word());
    }
    if (what != "dataset") fail(fmt::format("found {}, wanted DATASET", quote(keyword)));
    const std::string_view kind = need_word("POLYDATA or UNSTRUCTURED_GRID");
    if (lower(kind) != "polydata" && lower(kind) != "unstructured_grid")
      fail(fmt::format("found a DATASET {}, particles are read from POLYDATA and UNSTRUCTURED_GRID", quote(kind)));
  }

  void section(const std::string& keyword) {
    if (keyword == "points") return points();
    if (keyword == "vertices" || keyword == "lines" || keyword == "polygons" || keyword == "triangle_strips" || keyword == "cells") return cells();
    if (keyword == "cell_types") return skip(count("how many cells"), VtkType::kInt32);
    if (keyword == "field") return field(at_points_);
    if (keyword == "metadata") return metadata();
    if (keyword == "point_data" || keyword == "cell_data") {
      tuples_ = count("how many there are data of");
      at_points_ = keyword == "point_data";
      in_data_ = true;
      if (at_points_ && !has_points_) fail("POINT_DATA before POINTS");
      if (at_points_ && tuples_ != position_.size()) fail(fmt::format("found data of {} points, there are {}", tuples_, position_.size()));
      return;
    }
    if (in_data_ && attribute(keyword)) return;
    fail(fmt::format("found {}, wanted a section of a VTK file (POINTS, CELLS, POINT_DATA, SCALARS, ...)", quote(keyword)));
  }

  void points() {
    if (has_points_) fail("a second section POINTS");
    const std::size_t n = count("how many points there are");
    require_countable(name_, static_cast<double>(n));
    const VtkType of = type();
    if (of == VtkType::kBit) fail("points of type bit");
    numbers(n, 3, of, [&](std::size_t size) { position_.resize(size / 3); }, [&](std::size_t i, double v) { position_[i / 3][static_cast<Eigen::Index>(i % 3)] = v; });
    has_points_ = true;
  }

  /// n m, then m integers; from version 5 on n + 1 OFFSETS and m CONNECTIVITY.
  void cells() {
    const std::size_t n = count("how many cells there are"), m = count("how many integers follow");
    const std::size_t before = at_, announced = start_;
    if (lower(word()) != "offsets") {
      at_ = before;
      start_ = announced;
      return skip(m, VtkType::kInt32);
    }
    skip_typed(n);
    if (const std::string_view found = word(); lower(found) != "connectivity") fail(fmt::format("found {}, wanted CONNECTIVITY", quote(found)));
    skip_typed(m);
  }
  void skip_typed(std::size_t n) {
    const VtkType of = type();
    skip(n, of);
  }

  /// FIELD name count, then so many arrays "name width tuples type".
  void field(bool of_points) {
    need_word("a field's name");
    for (std::size_t arrays = count("how many arrays the field has"); arrays > 0; --arrays) {
      std::string_view title = need_word("an array's name");
      while (lower(title) == "metadata") {
        metadata();
        title = need_word("an array's name");
      }
      const std::size_t width = count("an array's width"), tuples = count("an array's length");
      const VtkType of = type();
      if (of_points && tuples != position_.size()) fail(fmt::format("array {} has {} tuples, there are {} points", quote(title), tuples, position_.size()));
      array(title, width, tuples, of, of_points);
    }
  }

  /// One of the attributes with a keyword of their own. False: it is none.
  bool attribute(const std::string& keyword) {
    if (keyword == "scalars") {
      const std::string_view title = need_word("a name");
      const VtkType of = type();
      std::size_t width = 1;
      if (std::string_view found = word_on_line(); !found.empty()) {
        at_ = start_;
        width = count("the number of components");
      }
      const std::size_t before = at_, announced = start_;
      if (lower(word()) == "lookup_table") {
        need_word("a table's name");
      } else {
        at_ = before;
        start_ = announced;
      }
      array(title, width, tuples_, of, at_points_);
    } else if (keyword == "vectors" || keyword == "normals") {
      const std::string_view title = need_word("a name");
      array(title, 3, tuples_, type(), at_points_);
    } else if (keyword == "tensors" || keyword == "tensors6") {
      const std::string_view title = need_word("a name");
      array(title, keyword == "tensors" ? 9 : 6, tuples_, type(), at_points_);
    } else if (keyword == "texture_coordinates") {
      const std::string_view title = need_word("a name");
      const std::size_t width = count("the number of components");
      array(title, width, tuples_, type(), at_points_);
    } else if (keyword == "global_ids" || keyword == "pedigree_ids") {
      const std::string_view title = need_word("a name");
      array(keyword == "global_ids" ? "globalids" : title, 1, tuples_, type(), at_points_);
    } else if (keyword == "color_scalars") {
      const std::string_view title = need_word("a name");
      array(title, count("the number of components"), tuples_, VtkType::kUint8, at_points_);
    } else if (keyword == "lookup_table") {
      need_word("a table's name");
      skip_numbers(count("the table's length"), 4, VtkType::kUint8);
    } else {
      return false;
    }
    return true;
  }

  /// Lines up to a blank one.
  void metadata() {
    line();
    while (at_ < bytes_.size()) {
      const std::string_view text = line();
      if (std::all_of(text.begin(), text.end(), blank)) return;
    }
    fail("the file ends within METADATA, wanted an empty line after it: truncated");
  }

  void array(std::string_view title, std::size_t width, std::size_t tuples, VtkType of, bool of_points) {
    if (width > 1'000'000) fail(fmt::format("found a width of {}", width));
    Column column{std::string(title), static_cast<int>(width), of == VtkType::kFloat, {}};
    if (!of_points || of == VtkType::kBit || !may_be_wanted(column)) {
      skip_numbers(tuples, width, of);
      // Its name is for the note on what was not used; no width of a field of ours.
      column.width = 0;
      if (of_points) columns_.push_back(std::move(column));
      return;
    }
    numbers(tuples, width, of, [&](std::size_t size) { column.values.resize(size); }, [&](std::size_t i, double v) { column.values[i] = v; });
    columns_.push_back(std::move(column));
  }

  void skip(std::size_t n, VtkType of) { skip_numbers(n, 1, of); }
  void skip_numbers(std::size_t tuples, std::size_t width, VtkType of) {
    numbers(tuples, width, of, [](std::size_t) {}, [](std::size_t, double) {});
  }

  /// begin(how many), then give(i, number i) for the numbers that follow the line's end.
  template <class Begin, class Give>
  void numbers(std::size_t tuples, std::size_t width, VtkType of, Begin&& begin, Give&& give) {
    const std::size_t announced = start_;
    const auto room = [&](std::size_t most, const char* what) {
      if (width > 0 && tuples > most / width)
        fail_from(announced, fmt::format("{} x {} {} are promised, the rest of the file has room for {} at most: truncated, or a wrong count", tuples, width, what, most));
    };
    if (!binary_) {
      room((bytes_.size() - at_ + 1) / 2, "numbers");
      begin(tuples * width);
      for (std::size_t i = 0; i < tuples * width; ++i) {
        const std::string_view found = word();
        double value = 0;
        if (found.empty()) fail("the file ends in the middle of its data: truncated");
        if (!parse_number(found, value)) fail(fmt::format("found {}, wanted a number", quote(found)));
        give(i, value);
      }
      return;
    }
    // Binary data begin on the line after, and no line's end has to follow.
    while (at_ < bytes_.size() && bytes_[at_] != '\n') {
      if (!blank(bytes_[at_])) fail_from(at_, fmt::format("found {}, wanted the end of the line", quote(bytes_.substr(at_, 20))));
      ++at_;
    }
    at_ = std::min(at_ + 1, bytes_.size());
    const std::size_t left = bytes_.size() - at_;
    if (of == VtkType::kBit) {
      room(left > bytes_.size() / 8 ? bytes_.size() : left * 8, "bits");
      begin(tuples * width);
      for (std::size_t i = 0; i < tuples * width; ++i) give(i, (static_cast<unsigned char>(bytes_[at_ + i / 8]) >> (7 - i % 8)) & 1);
      at_ += (tuples * width + 7) / 8;
      return;
    }
    const std::size_t size = size_of(of);
    room(left / size, "numbers");
    begin(tuples * width);
    for (std::size_t i = 0; i < tuples * width; ++i) give(i, load_number(bytes_.data() + at_ + i * size, of, true));
    at_ += tuples * width * size;
  }

  std::string_view bytes_;
  const std::string& name_;
  const PointImportOptions& options_;
  std::size_t at_ = 0, start_ = 0;  // start_: of the word or line last read
  bool binary_ = false, has_points_ = false, in_data_ = false, at_points_ = false;
  std::size_t tuples_ = 0;
  std::vector<Vec3> position_;
  std::vector<Column> columns_;
};

}  // namespace

PointCloud parse_legacy_vtk(std::string_view bytes, const std::string& name, const PointImportOptions& options) {
  return LegacyVtk(bytes, name, options).read();
}

}  // namespace effuse::importers
