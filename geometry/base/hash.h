#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "geometry/base/types.h"

namespace effuse {

/// 64-bit hash of a state: equal states, equal hashes; one flipped bit changes it. Not cryptographic.
/// Sizes are hashed with the arrays, so that two arrays cannot trade elements unseen.
class StateHash {
 public:
  template <class T>
    requires std::is_trivially_copyable_v<T>
  void add(std::span<const T> values) {
    add_bytes(values.data(), values.size_bytes());
  }
  template <class T>
    requires std::is_arithmetic_v<T>
  void add(T value) {
    add_bytes(&value, sizeof value);
  }
  void add(std::string_view text) { add_bytes(text.data(), text.size()); }
  void add(std::span<const Vec3> values) { add_bytes(values.data(), values.size_bytes()); }

  std::uint64_t value() const { return hash_; }
  /// 16 hexadecimal digits.
  std::string hex() const;

 private:
  void add_bytes(const void* data, std::size_t size) {
    const char* bytes = static_cast<const char*>(data);
    word(size);
    for (; size >= 8; bytes += 8, size -= 8) {
      std::uint64_t w;
      std::memcpy(&w, bytes, 8);
      word(w);
    }
    if (size > 0) {
      std::uint64_t w = 0;
      std::memcpy(&w, bytes, size);
      word(w);
    }
  }
  void word(std::uint64_t w) {
    hash_ = (hash_ ^ w) * 0x9fb21c651e98df25ULL;
    hash_ ^= hash_ >> 32;
  }
  std::uint64_t hash_ = 0x243f6a8885a308d3ULL;
};

}  // namespace effuse
