#pragma once

#include <cstdint>
#include <map>
#include <string>

/// What of the heap a program takes: malloc and its kin are this program's own, and count. Of all threads.
namespace effuse::counted {

struct Heap {
  std::uint64_t calls = 0;   ///< allocations
  std::uint64_t bytes = 0;   ///< of them, as the heap rounds them
  std::int64_t held = 0;     ///< bytes allocated less bytes freed
  std::int64_t largest = 0;  ///< largest `held` there has been; of the whole only
};

/// Whatever is allocated or freed while one lives counts for its label, too. They do not nest; there is room for 64 labels.
class Account {
 public:
  explicit Account(const std::string& label);
  ~Account();
  Account(const Account&) = delete;
  Account& operator=(const Account&) = delete;
};

Heap heap();
std::map<std::string, Heap> heap_by_label();

}  // namespace effuse::counted
