#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "geometry/base/types.h"

/// State as bytes, for checkpoints: named values and arrays in the order they were written.
/// Same machine kind (little-endian); a reader that meets another name, size or type than the
/// writer wrote throws InputError, so that a checkpoint of another version is refused, not misread.
namespace effuse {

class StateWriter {
 public:
  template <class T>
  void array(std::string_view name, const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T> || std::is_same_v<T, Vec3>);
    entry(name, sizeof(T), values.size(), values.data());
  }
  template <class T>
    requires std::is_arithmetic_v<T>
  void value(std::string_view name, T v) {
    entry(name, sizeof(T), 1, &v);
  }
  void text(std::string_view name, std::string_view v) { entry(name, 1, v.size(), v.data()); }

  const std::string& bytes() const { return bytes_; }

 private:
  void entry(std::string_view name, std::uint64_t element, std::uint64_t count, const void* data);
  std::string bytes_;
};

class StateReader {
 public:
  /// file: for error messages.
  StateReader(std::string_view bytes, std::string file) : rest_(bytes), file_(std::move(file)) {}

  template <class T>
  void array(std::string_view name, std::vector<T>& values) {
    const std::string_view data = entry(name, sizeof(T), nullptr);
    values.resize(data.size() / sizeof(T));
    if (!data.empty()) std::memcpy(static_cast<void*>(values.data()), data.data(), data.size());
  }
  template <class T>
    requires std::is_arithmetic_v<T>
  void value(std::string_view name, T& v) {
    const std::uint64_t one = 1;
    std::memcpy(&v, entry(name, sizeof(T), &one).data(), sizeof(T));
  }
  void text(std::string_view name, std::string& v) { v = entry(name, 1, nullptr); }
  bool done() const { return rest_.empty(); }

 private:
  std::string_view entry(std::string_view name, std::uint64_t element, const std::uint64_t* count);
  std::string_view take(std::size_t n);
  std::string_view rest_;
  std::string file_;
};

}  // namespace effuse
