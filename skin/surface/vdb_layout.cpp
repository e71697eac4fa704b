#include "skin/surface/vdb_layout.h"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>

#include "geometry/base/error.h"

namespace effuse::skin {

namespace fs = std::filesystem;

namespace {

class Walker {
 public:
  explicit Walker(const fs::path& file) : place_{file.string()}, size_(fs::file_size(file)), in_(file, std::ios::binary) {
    if (!in_) throw InputError(place_, "cannot read");
  }
  std::uint64_t size() const { return size_; }
  std::uint64_t at() const { return at_; }

  template <class T>
  T number(const char* what) {
    need(sizeof(T), what);
    T value;
    in_.read(reinterpret_cast<char*>(&value), sizeof value);
    at_ += sizeof value;
    if (!in_) fail(what);
    return value;
  }
  std::string text(const char* what) {
    const auto length = number<std::uint32_t>(what);
    need(length, what);
    std::string value(length, ' ');
    in_.read(value.data(), length);
    at_ += length;
    if (!in_) fail(what);
    return value;
  }
  void skip(std::uint64_t bytes, const char* what) {
    need(bytes, what);
    go_to(at_ + bytes);
  }
  /// A map of metadata: count, then name, type, value with its length.
  void metadata() {
    const auto count = number<std::uint32_t>("metadata");
    for (std::uint32_t i = 0; i < count; ++i) {
      text("a metadata name");
      text("a metadata type");
      skip(number<std::uint32_t>("a metadata value"), "a metadata value");
    }
  }
  void go_to(std::uint64_t position) {
    at_ = position;
    in_.seekg(static_cast<std::streamoff>(position));
  }
  [[noreturn]] void fail(const char* what) const {
    throw InputError(place_, fmt::format("truncated or damaged OpenVDB file: {} at byte {} of {}", what, at_, size_));
  }
  [[noreturn]] void refuse(const std::string& why) const { throw InputError(place_, why); }

 private:
  void need(std::uint64_t bytes, const char* what) const {
    if (bytes > size_ - at_) fail(what);
  }
  Place place_;
  std::uint64_t size_, at_ = 0;
  std::ifstream in_;
};

}  // namespace

std::vector<std::string> check_vdb_layout(const fs::path& file) {
  if (!fs::exists(file)) throw InputError(Place{file.string()}, "no such file");
  if (fs::is_directory(file)) throw InputError(Place{file.string()}, "is a folder, wanted a file");
  Walker walk(file);
  constexpr std::uint64_t kMagic = 0x56444220;
  if (walk.size() < 8 || walk.number<std::uint64_t>("the first word") != kMagic)
    walk.refuse("not an OpenVDB file: it does not begin with ' BDV'");

  constexpr std::uint32_t kFirstVersion = 222;
  const auto version = walk.number<std::uint32_t>("the version");
  walk.skip(8, "the library's version");
  const auto offsets = walk.number<std::uint8_t>("the offsets' mark");
  walk.skip(36, "the identity");
  std::vector<std::string> names;
  if (version < kFirstVersion || offsets == 0) return names;

  walk.metadata();
  const auto grids = walk.number<std::uint32_t>("the number of grids");
  for (std::uint32_t g = 0; g < grids; ++g) {
    names.push_back(walk.text("a grid's name"));
    walk.text("a grid's type");
    walk.text("a grid's parent");
    const auto begin = walk.number<std::uint64_t>("a grid's beginning");
    walk.number<std::uint64_t>("a grid's blocks");
    const auto end = walk.number<std::uint64_t>("a grid's end");
    if (begin != walk.at() || end < begin || end > walk.size()) walk.fail("a grid's end");
    walk.skip(4, "a grid's compression");
    walk.metadata();
    if (walk.at() > end) walk.fail("a grid's metadata");
    walk.go_to(end);
  }
  if (walk.at() != walk.size()) walk.fail("the end");
  return names;
}

}  // namespace effuse::skin
