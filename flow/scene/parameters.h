#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "flow/scene/node.h"
#include "geometry/base/types.h"
#include "geometry/motion/curve.h"

namespace effuse::flow {

/// What a table of a scene may hold, as found out by reading it: for `effuse effects` and the schema.
struct ParameterDoc {
  enum class Kind { kNumber, kCurve, kInteger, kFlag, kText, kTexts, kTextOrTexts, kChoice, kChoices, kNumbers, kNumberLists, kTable, kTables };

  std::string path;           ///< "lava.vents[].rate"
  std::string unit;           ///< SI unit, "" for plain numbers, "text", "flag", "choice: a | b", ...
  std::string default_value;  ///< "" : required
  std::string what;
  Kind kind = Kind::kText;
  std::string si_unit = {};               ///< of numbers, lone or in arrays; "": plain
  Real low = -std::numeric_limits<Real>::infinity(), high = std::numeric_limits<Real>::infinity();  ///< of numbers and integers
  bool open_low = false;                  ///< low itself is not allowed
  std::vector<std::string> names = {};    ///< of choices
  std::size_t count = 0;                  ///< of an array's entries, of a list's in each array; 0: any number
};

/// "> 0", ">= 0 K", "from 1 to 5 m"; "" where every number will do.
std::string range_of(const ParameterDoc& doc);

/// Reads one table of a scene: value by value, each with its unit, range and default. Faults are
/// gathered, not thrown, so that all of a scene are told at once; keys nobody read are faults, too,
/// with the nearest name. What was read is kept as the resolved scene.
///
/// After a fault a reader returns the default (or 0), so reading goes on; finish() tells the truth.
class Parameters {
 public:
  /// The root table. root must outlive this and every table read from it.
  explicit Parameters(const Node& root);

  static constexpr Real kAny = std::numeric_limits<Real>::infinity();
  struct Range {
    Real low = -kAny, high = kAny;
    bool open_low = false;  ///< low itself is not allowed
  };
  static constexpr Range positive() { return {0, kAny, true}; }
  static constexpr Range not_negative() { return {0, kAny, false}; }

  /// A number with a dimension: a bare number is SI, text carries its unit. No default: required.
  Real number(const std::string& key, std::string_view unit, std::optional<Real> fallback, Range range, std::string_view what);
  /// A number that may change: one number, or keys [["0 s", "1 m3/s"], ["10 s", "5 m3/s"]], the time first. How it goes on to the next key
  /// says the key, third, or else the table's `motion`: "linear" (the default), "hold", "smooth" (no value beyond its two keys'),
  /// "catmull_rom", or "bezier" with two more numbers, the slopes [unit/s] leaving this key and arriving at the next. Values between keys
  /// must be in range, too.
  geometry::Curve<Real> curve(const std::string& key, std::string_view unit, std::optional<Real> fallback, Range range, std::string_view what);
  std::int64_t integer(const std::string& key, std::optional<std::int64_t> fallback, std::int64_t low, std::int64_t high, std::string_view what);
  bool flag(const std::string& key, bool fallback, std::string_view what);
  std::string text(const std::string& key, std::optional<std::string> fallback, std::string_view what);
  /// ["a", "b", ...], so many, required; empty after a fault.
  std::vector<std::string> texts(const std::string& key, std::size_t count, std::string_view what);
  /// One text, or an array of them; required, and none is empty.
  std::vector<std::string> texts(const std::string& key, std::string_view what);
  /// Index into names of the one given.
  std::size_t choice(const std::string& key, const std::vector<std::string>& names, std::size_t fallback, std::string_view what);
  /// Several of names: indices, in the order given; fallback when the key is absent.
  std::vector<std::size_t> choices(const std::string& key, const std::vector<std::string>& names, std::vector<std::size_t> fallback, std::string_view what);
  /// [a, b, ...] of numbers with one unit; empty when absent and not required.
  std::vector<Real> numbers(const std::string& key, std::string_view unit, std::size_t count, bool required, std::string_view what);
  /// [[x, y], [x, y], ...]
  std::vector<std::vector<Real>> number_lists(const std::string& key, std::string_view unit, std::size_t width, bool required, std::string_view what);

  bool has(const std::string& key) const;
  /// A table inside this one; an empty one when absent.
  Parameters table(const std::string& key, std::string_view what);
  /// [[key]] tables; none when absent.
  std::vector<Parameters> tables(const std::string& key, std::string_view what);

  /// A fault at the value of key (or at the table when absent).
  void fault(const std::string& key, const std::string& message);
  /// A fault that was found later, of something whose place and name are known.
  void fault_at(const Place& place, const std::string& message);
  Place place(const std::string& key) const;
  const std::string& path() const { return path_; }

  /// Throws InputError with every fault of the whole scene, unread keys among them. Call on the root.
  void finish();
  /// Every fault so far; unread keys not among them.
  std::vector<Fault> faults() const;
  /// All that was read, defaults filled in, in the order of reading.
  Node resolved() const;
  std::vector<ParameterDoc> docs() const;
  /// Paths, as docs() has them, of the keys that has() was asked for.
  std::vector<std::string> asked() const;

 private:
  struct Shared;
  struct Table;
  Parameters(std::shared_ptr<Shared> shared, Table* table, std::string path);
  std::shared_ptr<Shared> shared_;
  Table* table_ = nullptr;
  std::string path_;
};

}  // namespace effuse::flow
