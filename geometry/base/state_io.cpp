#include "geometry/base/state_io.h"

#include <fmt/format.h>

#include "geometry/base/error.h"

namespace effuse {

namespace {
void put(std::string& bytes, std::uint64_t word) { bytes.append(reinterpret_cast<const char*>(&word), sizeof word); }
}  // namespace

void StateWriter::entry(std::string_view name, std::uint64_t element, std::uint64_t count, const void* data) {
  put(bytes_, name.size());
  bytes_.append(name);
  put(bytes_, element);
  put(bytes_, count);
  if (count > 0) bytes_.append(static_cast<const char*>(data), element * count);
}

std::string_view StateReader::take(std::size_t n) {
  if (n > rest_.size()) throw InputError(Place{file_}, "the file is cut short");
  const std::string_view head = rest_.substr(0, n);
  rest_.remove_prefix(n);
  return head;
}

std::string_view StateReader::entry(std::string_view name, std::uint64_t element, const std::uint64_t* count) {
  const auto word = [&] {
    std::uint64_t w;
    std::memcpy(&w, take(sizeof w).data(), sizeof w);
    return w;
  };
  const std::string_view found = take(word());
  if (found != name) throw InputError(Place{file_}, fmt::format("found '{:.40}', wanted '{}': written by another version?", found, name));
  const std::uint64_t found_element = word(), found_count = word();
  if (found_element != element || (count && found_count != *count))
    throw InputError(Place{file_}, fmt::format("'{}' holds {} elements of {} bytes, wanted elements of {} bytes", name, found_count, found_element, element));
  if (found_count > rest_.size() / element) throw InputError(Place{file_}, "the file is cut short");
  return take(found_element * found_count);
}

}  // namespace effuse
