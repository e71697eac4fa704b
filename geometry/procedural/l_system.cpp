#include "geometry/procedural/l_system.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/base/error.h"
#include "geometry/base/random.h"
#include "geometry/procedural/formula.h"

namespace effuse::geometry {

namespace {

[[noreturn]] void wrong(const std::string& text, const std::string& what) { throw InputError(Place{"L-system"}, fmt::format("'{}': {}", text, what)); }

/// A letter and the texts of its values.
struct Letter {
  char symbol;
  std::vector<std::string> values;
};

std::string trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(' '), last = text.find_last_not_of(' ');
  return first == std::string_view::npos ? "" : std::string(text.substr(first, last - first + 1));
}

/// "F(l, 2)[+A]" letter by letter; brackets must match.
std::vector<Letter> letters(const std::string& text) {
  std::vector<Letter> found;
  int open = 0;
  for (std::size_t at = 0; at < text.size();) {
    const char symbol = text[at++];
    if (symbol == ' ') continue;
    if (symbol == '(' || symbol == ')' || symbol == ',') wrong(text, fmt::format("found '{}' where a letter was wanted", symbol));
    if (static_cast<unsigned char>(symbol) < ' ' || static_cast<unsigned char>(symbol) > '~') wrong(text, "a letter that is not ASCII");
    open += symbol == '[' ? 1 : symbol == ']' ? -1 : 0;
    if (open < 0) wrong(text, "a ']' without its '['");
    Letter letter{symbol, {}};
    if (at < text.size() && text[at] == '(') {
      int depth = 0;
      std::size_t start = ++at;
      for (;; ++at) {
        if (at == text.size()) wrong(text, fmt::format("the '(' after {} is never closed", symbol));
        if (depth == 0 && (text[at] == ',' || text[at] == ')')) {
          letter.values.push_back(trimmed(std::string_view(text).substr(start, at - start)));
          start = at + 1;
          if (text[at] == ')') break;
        } else {
          depth += text[at] == '(' ? 1 : text[at] == ')' ? -1 : 0;
        }
      }
      ++at;
    }
    found.push_back(std::move(letter));
  }
  if (open > 0) wrong(text, "a '[' without its ']'");
  return found;
}

/// A rule, read.
struct Production {
  char symbol;
  std::size_t values;
  std::optional<Formula> when;
  std::vector<std::pair<char, std::vector<Formula>>> to;
  Real weight;
};

Production read(const LRule& rule, const LSystem& system) {
  const std::vector<Letter> from = letters(rule.from);
  if (from.size() != 1) wrong(rule.from, "wanted one letter to replace");
  if (!(rule.weight >= 0) || !std::isfinite(rule.weight)) wrong(rule.from, fmt::format("a weight of {}, wanted one not below 0", rule.weight));
  const std::vector<std::string>& names = from[0].values;
  Production p{from[0].symbol, names.size(), {}, {}, rule.weight};
  if (!trimmed(rule.when).empty()) p.when.emplace(rule.when, names, system.constants);
  for (const Letter& letter : letters(rule.to)) {
    std::vector<Formula> values;
    for (const std::string& value : letter.values) values.emplace_back(value, names, system.constants);
    p.to.emplace_back(letter.symbol, std::move(values));
  }
  return p;
}

}  // namespace

std::vector<LModule> derive(const LSystem& system, int generations, std::uint64_t seed, std::size_t max_modules) {
  std::vector<Production> productions;
  for (const LRule& rule : system.rules) productions.push_back(read(rule, system));
  std::vector<LModule> word;
  for (const Letter& letter : letters(system.axiom)) {
    LModule module{letter.symbol, {}};
    for (const std::string& value : letter.values) module.values.push_back(Formula(value, {}, system.constants).evaluate({}));
    word.push_back(std::move(module));
  }
  std::vector<LModule> next;
  std::vector<const Production*> fitting;
  for (int g = 0; g < generations; ++g) {
    next.clear();
    for (std::size_t k = 0; k < word.size(); ++k) {
      const LModule& module = word[k];
      fitting.clear();
      Real weight = 0;
      for (const Production& p : productions)
        if (p.symbol == module.symbol && p.values == module.values.size() && (!p.when || p.when->evaluate(module.values) != 0)) {
          fitting.push_back(&p);
          weight += p.weight;
        }
      if (fitting.empty() || weight == 0) {
        next.push_back(module);
      } else {
        Real draw = weight * random_uniform(seed, static_cast<std::uint64_t>(g), k);
        std::size_t which = 0;
        while (which + 1 < fitting.size() && draw >= fitting[which]->weight) draw -= fitting[which++]->weight;
        for (const auto& [symbol, values] : fitting[which]->to) {
          LModule& born = next.emplace_back(LModule{symbol, {}});
          for (const Formula& value : values) {
            born.values.push_back(value.evaluate(module.values));
            if (!std::isfinite(born.values.back())) wrong(system.axiom, fmt::format("in generation {} a value of {} is not finite", g + 1, symbol));
          }
        }
      }
      if (next.size() > max_modules) wrong(system.axiom, fmt::format("more than {} letters in generation {}; take fewer generations", max_modules, g + 1));
    }
    word.swap(next);
  }
  return word;
}

std::string to_string(const std::vector<LModule>& word) {
  std::string text;
  for (const LModule& module : word) {
    text += module.symbol;
    for (std::size_t k = 0; k < module.values.size(); ++k) text += fmt::format("{}{:g}", k == 0 ? "(" : ",", module.values[k]);
    if (!module.values.empty()) text += ')';
  }
  return text;
}

}  // namespace effuse::geometry
