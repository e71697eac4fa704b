#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::skin {

/// No entry.
inline constexpr Index kNone = ~Index{0};

/// Whole coordinates within +-2^20 as one word.
inline std::uint64_t pack(int x, int y, int z) {
  const auto bits = [](int v) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(v + (1 << 20))); };
  return bits(x) << 42 | bits(y) << 21 | bits(z);
}

/// Numbers the distinct keys 0, 1, 2, ... in the order they come. Open addressing.
class KeyTable {
 public:
  KeyTable() { grow(64); }
  std::size_t size() const { return size_; }

  /// The key's number; kNone when it has none.
  Index find(std::uint64_t key) const {
    for (std::size_t s = slot(key);; s = (s + 1) & (keys_.size() - 1)) {
      if (keys_[s] == key) return values_[s];
      if (keys_[s] == kFree) return kNone;
    }
  }
  /// The key's number; a new key gets the next.
  Index number(std::uint64_t key) {
    if (2 * (size_ + 1) > keys_.size()) grow(2 * keys_.size());
    std::size_t s = slot(key);
    for (; keys_[s] != kFree; s = (s + 1) & (keys_.size() - 1))
      if (keys_[s] == key) return values_[s];
    keys_[s] = key;
    return values_[s] = static_cast<Index>(size_++);
  }

 private:
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};
  std::size_t slot(std::uint64_t key) const { return (key * 0x9e3779b97f4a7c15ULL >> 32) & (keys_.size() - 1); }
  void grow(std::size_t capacity) {
    std::vector<std::uint64_t> keys(capacity, kFree);
    std::vector<Index> values(capacity);
    keys.swap(keys_);
    values.swap(values_);
    for (std::size_t old = 0; old < keys.size(); ++old) {
      if (keys[old] == kFree) continue;
      std::size_t s = slot(keys[old]);
      while (keys_[s] != kFree) s = (s + 1) & (capacity - 1);
      keys_[s] = keys[old];
      values_[s] = values[old];
    }
  }
  std::vector<std::uint64_t> keys_;
  std::vector<Index> values_;
  std::size_t size_ = 0;
};

}  // namespace effuse::skin
