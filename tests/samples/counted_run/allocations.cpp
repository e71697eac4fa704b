#include "tests/samples/counted_run/allocations.h"

#include <errno.h>
#include <malloc.h>

#include <atomic>
#include <cstddef>
#include <cstdlib>

// glibc's own, under the names that stay when a program brings a malloc.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
}

namespace {

struct Counter {
  std::atomic<std::uint64_t> calls{0}, bytes{0};
  std::atomic<std::int64_t> held{0}, largest{0};
};

constexpr int kLabels = 65;
Counter g_counters[kLabels];        // [0]: of all
std::atomic<int> g_label{0};        // whose account is open; 0: nobody's
std::string* g_names[kLabels] = {};
int g_named = 0;

void add(Counter& c, std::int64_t n) {
  c.calls.fetch_add(1, std::memory_order_relaxed);
  c.bytes.fetch_add(static_cast<std::uint64_t>(n), std::memory_order_relaxed);
  const std::int64_t held = c.held.fetch_add(n, std::memory_order_relaxed) + n;
  std::int64_t largest = c.largest.load(std::memory_order_relaxed);
  while (held > largest && !c.largest.compare_exchange_weak(largest, held, std::memory_order_relaxed)) {
  }
}

void took(void* p) {
  if (!p) return;
  const auto n = static_cast<std::int64_t>(::malloc_usable_size(p));
  const int label = g_label.load(std::memory_order_relaxed);
  add(g_counters[0], n);
  if (label > 0) add(g_counters[label], n);
}

void gave(void* p) {
  if (!p) return;
  const auto n = static_cast<std::int64_t>(::malloc_usable_size(p));
  const int label = g_label.load(std::memory_order_relaxed);
  g_counters[0].held.fetch_sub(n, std::memory_order_relaxed);
  if (label > 0) g_counters[label].held.fetch_sub(n, std::memory_order_relaxed);
}

effuse::counted::Heap value(const Counter& c) { return {c.calls, c.bytes, c.held, c.largest}; }

}  // namespace

extern "C" {
void* malloc(std::size_t n) {
  void* p = __libc_malloc(n);
  took(p);
  return p;
}
void* calloc(std::size_t n, std::size_t size) {
  void* p = __libc_calloc(n, size);
  took(p);
  return p;
}
void* realloc(void* old, std::size_t n) {
  gave(old);
  void* p = __libc_realloc(old, n);
  took(p ? p : n > 0 ? old : nullptr);
  return p;
}
void* memalign(std::size_t alignment, std::size_t n) {
  void* p = __libc_memalign(alignment, n);
  took(p);
  return p;
}
void* aligned_alloc(std::size_t alignment, std::size_t n) { return memalign(alignment, n); }
int posix_memalign(void** out, std::size_t alignment, std::size_t n) {
  void* p = memalign(alignment, n);
  if (!p) return ENOMEM;
  *out = p;
  return 0;
}
void free(void* p) {
  gave(p);
  __libc_free(p);
}
}

namespace effuse::counted {

Account::Account(const std::string& label) {
  int k = 1;
  while (k <= g_named && *g_names[k] != label) ++k;
  if (k >= kLabels) std::abort();
  if (k > g_named) g_names[++g_named] = new std::string(label);
  g_label = k;
}

Account::~Account() { g_label = 0; }

Heap heap() { return value(g_counters[0]); }

std::map<std::string, Heap> heap_by_label() {
  std::map<std::string, Heap> all;
  for (int k = 1; k <= g_named; ++k) all[*g_names[k]] = value(g_counters[k]);
  return all;
}

}  // namespace effuse::counted
