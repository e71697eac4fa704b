#include "geometry/procedural/formula.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::geometry {

/// Recursive descent, one function a level of binding: or, and, comparison, sum, product, sign, power, value.
class FormulaReader {
 public:
  using Op = Formula::Op;
  FormulaReader(std::string_view text, std::span<const std::string> names, std::span<const std::pair<std::string, Real>> constants)
      : text_(text), names_(names), constants_(constants) {}

  std::vector<Formula::Item> read() {
    either();
    skip();
    if (at_ < text_.size()) wrong("an operator or the end");
    return std::move(items_);
  }

 private:
  static constexpr int kDeepest = 200;  // brackets and signs within one another: the stack's own limit lies far beyond

  [[noreturn]] void wrong(const std::string& wanted) const {
    const std::string found = at_ < text_.size() ? fmt::format("'{:.20}'", text_.substr(at_)) : "the end";
    throw InputError(Place{"formula"}, fmt::format("'{}', column {}: found {}, wanted {}", text_, at_ + 1, found, wanted));
  }
  void skip() {
    while (at_ < text_.size() && text_[at_] == ' ') ++at_;
  }
  bool take(std::string_view word) {
    skip();
    if (!text_.substr(at_).starts_with(word)) return false;
    at_ += word.size();
    return true;
  }
  void add(Op op) { items_.push_back({op}); }

  void either() {
    both();
    while (take("||")) both(), add(Op::kOr);
  }
  void both() {
    comparison();
    while (take("&&")) comparison(), add(Op::kAnd);
  }
  void comparison() {
    sum();
    static constexpr std::pair<std::string_view, Op> kSigns[] = {{"<=", Op::kAtMost}, {">=", Op::kAtLeast}, {"==", Op::kEqual}, {"!=", Op::kUnequal}, {"<", Op::kLess}, {">", Op::kGreater}};
    for (const auto& [sign, op] : kSigns)
      if (take(sign)) {
        sum();
        add(op);
        return;
      }
  }
  void sum() {
    product();
    for (;;) {
      if (take("+")) product(), add(Op::kAdd);
      else if (take("-")) product(), add(Op::kSubtract);
      else return;
    }
  }
  void product() {
    sign();
    for (;;) {
      if (take("*")) sign(), add(Op::kMultiply);
      else if (take("/")) sign(), add(Op::kDivide);
      else return;
    }
  }
  void sign() {
    if (++depth_ > kDeepest) wrong("fewer brackets and signs within one another");
    if (take("-")) sign(), add(Op::kNegate);
    else if (text_.substr(std::min(at_, text_.size())).find_first_not_of(' ') != std::string_view::npos && !next_is("!=") && take("!")) sign(), add(Op::kNot);
    else power();
    --depth_;
  }
  bool next_is(std::string_view word) {
    skip();
    return text_.substr(at_).starts_with(word);
  }
  void power() {
    value();
    if (take("^")) sign(), add(Op::kPower);  // to the right: 2^3^2 is 2^9
  }
  void value() {
    skip();
    if (take("(")) {
      either();
      if (!take(")")) wrong("')'");
      return;
    }
    const char c = at_ < text_.size() ? text_[at_] : ' ';
    if ((c >= '0' && c <= '9') || c == '.') {
      Real number = 0;
      const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), number);
      if (error != std::errc()) wrong("a number");
      at_ = static_cast<std::size_t>(end - text_.data());
      items_.push_back({Op::kNumber, number});
      return;
    }
    const auto letter = [](char k) { return (k >= 'a' && k <= 'z') || (k >= 'A' && k <= 'Z') || k == '_'; };
    std::size_t end = at_;
    while (end < text_.size() && (letter(text_[end]) || (end > at_ && text_[end] >= '0' && text_[end] <= '9'))) ++end;
    const std::string name(text_.substr(at_, end - at_));
    if (const auto found = std::find(names_.begin(), names_.end(), name); !name.empty() && found != names_.end()) {
      items_.push_back({Op::kValue, 0, static_cast<std::size_t>(found - names_.begin())});
    } else if (const auto constant = std::find_if(constants_.begin(), constants_.end(), [&](const auto& each) { return each.first == name; }); constant != constants_.end()) {
      items_.push_back({Op::kNumber, constant->second});
    } else {
      std::vector<std::string> known(names_.begin(), names_.end());
      for (const auto& each : constants_) known.push_back(each.first);
      const std::string near = name.empty() ? "" : nearest_name(name, known);
      wrong(near.empty() ? "a number, a name or '('" : fmt::format("a name that is known (did you mean {}?)", near));
    }
    at_ = end;
  }

  std::string_view text_;
  std::span<const std::string> names_;
  std::span<const std::pair<std::string, Real>> constants_;
  std::size_t at_ = 0;
  int depth_ = 0;
  std::vector<Formula::Item> items_;
};

Formula::Formula(std::string_view text, std::span<const std::string> names, std::span<const std::pair<std::string, Real>> constants)
    : items_(FormulaReader(text, names, constants).read()) {}

Real Formula::evaluate(std::span<const Real> values) const {
  std::vector<Real> stack;
  for (const Item& item : items_) {
    if (item.op == Op::kNumber || item.op == Op::kValue) {
      stack.push_back(item.op == Op::kNumber ? item.number : values[item.value]);
      continue;
    }
    Real& top = stack.back();
    if (item.op == Op::kNegate || item.op == Op::kNot) {
      top = item.op == Op::kNegate ? -top : top == 0 ? 1 : 0;
      continue;
    }
    const Real b = top;
    stack.pop_back();
    Real& a = stack.back();
    switch (item.op) {
      case Op::kAdd: a += b; break;
      case Op::kSubtract: a -= b; break;
      case Op::kMultiply: a *= b; break;
      case Op::kDivide: a /= b; break;
      case Op::kPower: a = std::pow(a, b); break;
      case Op::kLess: a = a < b; break;
      case Op::kGreater: a = a > b; break;
      case Op::kAtMost: a = a <= b; break;
      case Op::kAtLeast: a = a >= b; break;
      case Op::kEqual: a = a == b; break;
      case Op::kUnequal: a = a != b; break;
      case Op::kAnd: a = a != 0 && b != 0; break;
      default: a = a != 0 || b != 0; break;
    }
  }
  CHECK_EQ(stack.size(), std::size_t{1});
  return stack.back();
}

}  // namespace effuse::geometry
