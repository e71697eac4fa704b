#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/base/random.h"

/// Small changes to good files, the same on every run.
namespace effuse::importers {

/// Random numbers of one mutation: (seed, number) say it all.
class Dice {
 public:
  Dice(std::uint64_t seed, std::uint64_t number) : seed_(seed), number_(number) {}
  std::uint64_t operator()(std::uint64_t below) { return random_bits(seed_, number_, index_++) % below; }

 private:
  std::uint64_t seed_, number_, index_ = 0;
};

/// One to four changes: a bit, a byte, a cut, a hole, a copy, a word that parsers dislike.
inline std::string mutated(std::string bytes, Dice dice) {
  static const std::vector<std::string> kWords = {
      "nan", "-1", "inf", "4294967296", "99999999999999999999", "1e999", "0", "\"", "[[", "{", "\\", "#", "\n\n", "-", ".", ",", "//"};
  for (std::uint64_t n = 1 + dice(4); n > 0 && !bytes.empty(); --n) {
    const std::size_t at = dice(bytes.size());
    const std::size_t length = 1 + dice(std::min<std::size_t>(bytes.size() - at, 40));
    switch (dice(7)) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << dice(8)));
        break;
      case 1:
        bytes[at] = static_cast<char>(dice(256));
        break;
      case 2:
        bytes.resize(at);
        break;
      case 3:
        bytes.erase(at, length);
        break;
      case 4:
        bytes.insert(dice(bytes.size()), bytes.substr(at, length));
        break;
      case 5:
        bytes.insert(at, kWords[dice(kWords.size())]);
        break;
      default:
        bytes.replace(at, std::min<std::size_t>(length, 4), kWords[dice(kWords.size())]);
    }
  }
  return bytes;
}

}  // namespace effuse::importers
