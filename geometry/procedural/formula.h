#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// A formula of numbers and named values, read once, evaluated often: + - * / ^ ( ), < > <= >= == !=, && || !, unary -.
/// Truth is 1, falsehood 0, anything but 0 is true.
class Formula {
 public:
  /// names: of the values evaluate() will get, in their order; constants: replaced at once. Throws InputError with the text, the
  /// column, what was found and what was wanted.
  Formula(std::string_view text, std::span<const std::string> names, std::span<const std::pair<std::string, Real>> constants = {});

  /// values: as many as names. May be infinite or no number, as the formula's arithmetic is.
  Real evaluate(std::span<const Real> values) const;

 private:
  friend class FormulaReader;
  enum class Op : unsigned char { kNumber, kValue, kNegate, kNot, kAdd, kSubtract, kMultiply, kDivide, kPower, kLess, kGreater, kAtMost, kAtLeast, kEqual, kUnequal, kAnd, kOr };
  struct Item {
    Op op;
    Real number = 0;
    std::size_t value = 0;
  };
  std::vector<Item> items_;  // operands before their operator
};

}  // namespace effuse::geometry
