#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "importers/input_file.h"
#include "importers/points/columns_internal.h"

namespace effuse::importers {

namespace {

/// What a particle can have, besides its position.
enum Field : std::size_t { kRadius, kVelocity, kTemperature, kCrust, kAge, kOpacity, kId, kRest, kRest2, kFields };

struct FieldNames {
  const char* title;
  int width;
  std::array<std::string_view, 5> names;
};

constexpr std::array<FieldNames, kFields> kNames = {{{"radius", 1, {"radius", "pscale", "particle_radius"}},
                                                     {"velocity", 3, {"velocity", "velocities", "vel", "v"}},
                                                     {"temperature", 1, {"temperature", "temp"}},
                                                     {"crust", 1, {"crust"}},
                                                     {"age", 1, {"age"}},
                                                     {"opacity", 1, {"opacity", "alpha"}},
                                                     {"id", 1, {"id", "ids", "idp", "particle_id", "globalids"}},
                                                     {"rest", 3, {"rest"}},
                                                     {"rest2", 3, {"rest2"}}}};

/// Where a field's numbers come from: one column of its width, or one a component.
struct Source {
  std::array<std::ptrdiff_t, 3> column{-1, -1, -1};
  bool split = false;
  bool any() const { return column[0] >= 0; }
};

std::ptrdiff_t find(std::span<const Column> columns, std::string_view name, int width) {
  for (std::size_t c = 0; c < columns.size(); ++c)
    if (columns[c].width == width && lower(columns[c].name) == name) return static_cast<std::ptrdiff_t>(c);
  return -1;
}

/// What is put after a vector's name to name its components.
constexpr std::array<std::array<std::string_view, 3>, 5> kEndings = {
    {{"_x", "_y", "_z"}, {"x", "y", "z"}, {".x", ".y", ".z"}, {":0", ":1", ":2"}, {"_0", "_1", "_2"}}};

std::array<Source, kFields> resolve(std::span<const Column> columns) {
  std::array<Source, kFields> sources;
  for (std::size_t f = 0; f < kFields; ++f) {
    Source& source = sources[f];
    for (const std::string_view name : kNames[f].names) {
      if (name.empty() || source.any()) break;
      source.column[0] = find(columns, name, kNames[f].width);
      if (source.any() || kNames[f].width == 1) continue;
      for (const auto& endings : kEndings) {
        for (std::size_t k = 0; k < 3; ++k) source.column[k] = find(columns, std::string(name) + std::string(endings[k]), 1);
        source.split = source.column[0] >= 0 && source.column[1] >= 0 && source.column[2] >= 0;
        if (source.split) break;
        source.column = {-1, -1, -1};
      }
    }
  }
  return sources;
}

/// The numbers of a field, with the check that each can be used.
class Values {
 public:
  Values(const std::string& name, std::span<const Column> columns, Field field, const Source& source)
      : name_(name), title_(kNames[field].title), width_(static_cast<std::size_t>(kNames[field].width)), source_(source), columns_(columns) {}

  double operator()(std::size_t particle, std::size_t component) const {
    const std::size_t c = static_cast<std::size_t>(source_.column[source_.split ? component : 0]);
    const double value = source_.split ? columns_[c].values[particle] : columns_[c].values[particle * width_ + component];
    if (!std::isfinite(value)) throw InputError({name_}, fmt::format("the {} of particle {} (from 0) is {}, wanted a finite number", title_, particle, value));
    return value;
  }

 private:
  const std::string& name_;
  const char* title_;
  std::size_t width_;
  const Source& source_;
  std::span<const Column> columns_;
};

/// The ids as whole numbers; empty, with a note, when they cannot be told apart.
std::vector<std::uint64_t> whole_ids(const Values& values, std::size_t n, bool coarse, std::vector<std::string>& notes) {
  const double most = coarse ? 16777216.0 : 9007199254740992.0;  // 2^24, 2^53
  std::vector<std::uint64_t> ids(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double id = values(i, 0);
    if (id < 0 || id > most || std::trunc(id) != id) {
      notes.push_back(fmt::format("ids are left out: that of particle {} (from 0) is {}, wanted whole numbers from 0 to {:.0f}", i, id, most));
      return {};
    }
    ids[i] = static_cast<std::uint64_t>(id);
  }
  return ids;
}

}  // namespace

void fail_at_byte(const std::string& name, std::size_t byte, const std::string& message) {
  throw InputError({name}, fmt::format("at byte {}: {}", byte, message));
}

void require_countable(const std::string& name, double count) {
  if (!(count < std::numeric_limits<Index>::max())) throw InputError({name}, fmt::format("{:.0f} particles are too many", count));
}

std::vector<bool> wanted(std::span<const Column> columns) {
  std::vector<bool> wanted(columns.size(), false);
  for (const Source& source : resolve(columns))
    for (const std::ptrdiff_t c : source.column)
      if (c >= 0) wanted[static_cast<std::size_t>(c)] = true;
  return wanted;
}

bool may_be_wanted(const Column& column) {
  const std::string name = lower(column.name);
  for (const FieldNames& field : kNames)
    for (const std::string_view known : field.names) {
      if (known.empty()) break;
      if (column.width == field.width && name == known) return true;
      if (column.width != 1 || field.width == 1 || !name.starts_with(known)) continue;
      const std::string_view rest = std::string_view(name).substr(known.size());
      for (const auto& endings : kEndings)
        if (std::find(endings.begin(), endings.end(), rest) != endings.end()) return true;
    }
  return false;
}

PointCloud assemble(const std::string& name, std::vector<Vec3> position, std::span<const Column> columns, const PointImportOptions& options) {
  const std::size_t n = position.size();
  for (std::size_t i = 0; i < n; ++i)
    if (!position[i].allFinite())
      throw InputError({name}, fmt::format("particle {} (from 0) is at {} {} {}, wanted finite numbers", i, position[i].x(), position[i].y(), position[i].z()));
  PointCloud cloud;
  cloud.position = std::move(position);
  std::array<Source, kFields> sources = resolve(columns);
  if (!options.radius) sources[kRadius] = {};
  for (const Source& source : sources)
    for (const std::ptrdiff_t c : source.column)
      if (c >= 0) CHECK_EQ(columns[static_cast<std::size_t>(c)].values.size(), n * static_cast<std::size_t>(columns[static_cast<std::size_t>(c)].width));

  const auto scalars = [&](Field field, std::vector<Real>& out) {
    if (!sources[field].any()) return;
    const Values values(name, columns, field, sources[field]);
    out.resize(n);
    for (std::size_t i = 0; i < n; ++i) out[i] = values(i, 0);
  };
  const auto vectors = [&](Field field, std::vector<Vec3>& out) {
    if (!sources[field].any()) return;
    const Values values(name, columns, field, sources[field]);
    out.resize(n);
    for (std::size_t i = 0; i < n; ++i) out[i] = Vec3(values(i, 0), values(i, 1), values(i, 2));
  };
  scalars(kRadius, cloud.radius);
  for (std::size_t i = 0; i < cloud.radius.size(); ++i)
    if (!(cloud.radius[i] > 0)) throw InputError({name}, fmt::format("the radius of particle {} (from 0) is {}, wanted > 0", i, cloud.radius[i]));
  vectors(kVelocity, cloud.velocity);
  scalars(kTemperature, cloud.temperature);
  scalars(kCrust, cloud.crust);
  scalars(kAge, cloud.age);
  scalars(kOpacity, cloud.opacity);
  vectors(kRest, cloud.rest);
  vectors(kRest2, cloud.rest2);
  if (const Source& source = sources[kId]; source.any()) {
    const Column& column = columns[static_cast<std::size_t>(source.column[0])];
    cloud.id = whole_ids(Values(name, columns, kId, source), n, column.coarse, cloud.notes);
  }

  std::string skipped;
  std::vector<bool> used(columns.size(), false);
  for (const Source& source : sources)
    for (const std::ptrdiff_t c : source.column)
      if (c >= 0) used[static_cast<std::size_t>(c)] = true;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (used[c]) continue;
    if (skipped.size() > 200) {
      skipped += ", ...";
      break;
    }
    skipped += (skipped.empty() ? "" : ", ") + printable(columns[c].name, 40);
  }
  if (!skipped.empty()) cloud.notes.push_back("not used: " + skipped);
  return cloud;
}

}  // namespace effuse::importers
