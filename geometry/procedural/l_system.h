#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// A letter of an L-system's word, with its numbers: F, A(1.5, 0.2), +(25).
struct LModule {
  char symbol = ' ';
  std::vector<Real> values;
  bool operator==(const LModule&) const = default;
};

/// What a letter becomes. Of the rules that fit a letter (its symbol, its number of values, the condition true) one is drawn by
/// weight; a letter that none fits stays.
///   from    "A" or "A(l, w)": a symbol and names for its values
///   when    "l > 0.1 && w < 2", or empty: always
///   to      "F(l)[+(a)A(l*0.7, w/2)]", or empty: the letter goes
/// Formulas know + - * / ^ ( ), < > <= >= == !=, && || !, numbers, the names of from and those of the system's constants.
struct LRule {
  std::string from, when, to;
  Real weight = 1;
};

/// Lindenmayer's rewriting: bracketed, stochastic, parametric, without context.
/// Source: Prusinkiewicz & Lindenmayer 1990, The Algorithmic Beauty of Plants, chapter 1.
struct LSystem {
  std::string axiom;
  std::vector<LRule> rules;
  std::vector<std::pair<std::string, Real>> constants;
};

/// The word after so many generations; the choice at letter k of generation g is a function of (seed, g, k).
/// Throws InputError where a rule or the axiom cannot be read (with the text and what was found), brackets do not match, a
/// formula divides by nothing or a word has more than max_modules letters.
std::vector<LModule> derive(const LSystem& system, int generations, std::uint64_t seed, std::size_t max_modules = 5000000);

/// The word as text: F(1)[+A]; numbers as %g.
std::string to_string(const std::vector<LModule>& word);

}  // namespace effuse::geometry
