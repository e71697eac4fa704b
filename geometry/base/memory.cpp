#include "geometry/base/memory.h"

#include <algorithm>
#include <fstream>
#include <string>

namespace effuse {

namespace {

/// The number in a file of one word; 0: there is none ("max").
std::uint64_t number_in(const std::string& file) {
  std::ifstream in(file);
  std::uint64_t number = 0;
  return in >> number ? number : 0;
}

}  // namespace

std::uint64_t available_memory() {
  std::uint64_t available = 0;
  std::ifstream info("/proc/meminfo");
  for (std::string word; info >> word;)
    if (std::uint64_t kilobytes = 0; word == "MemAvailable:" && info >> kilobytes) {
      available = 1024 * kilobytes;
      break;
    }
  // Version 2 of control groups; a process that sees its own as the root finds it here.
  const std::uint64_t limit = number_in("/sys/fs/cgroup/memory.max"), used = number_in("/sys/fs/cgroup/memory.current");
  if (limit > 0) {
    const std::uint64_t left = limit - std::min(limit, used);
    available = available > 0 ? std::min(available, left) : left;
  }
  return available;
}

}  // namespace effuse
