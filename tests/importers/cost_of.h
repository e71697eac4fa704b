#pragma once

#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>

namespace effuse::importers {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kMemoryIsCounted = false;  // shadow memory is not the reader's
#else
inline constexpr bool kMemoryIsCounted = true;
#endif

/// What a call took that had a process of its own.
struct Cost {
  double seconds = 0;  ///< by the clock
  double peak = 0;     ///< most memory at one time [bytes], what the test program has among it
  double grown = 0;    ///< of that, beyond what it had at the start
  int exit = -1;       ///< what call returned, 0 to 99; 100 and more: the signal that ended it
};

/// Memory in use by this process [bytes].
inline double resident_bytes() {
  long pages = 0, resident = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%ld %ld", &pages, &resident) != 2) resident = 0;
    std::fclose(file);
  }
  return static_cast<double>(resident) * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

/// Calls call() in a child of this process; it returns an int and must not throw.
template <class Call>
Cost cost_of(const Call& call) {
  ::malloc_trim(0);  // or the child would take what this process has free
  auto* at_start = static_cast<double*>(::mmap(nullptr, sizeof(double), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  const auto start = std::chrono::steady_clock::now();
  const pid_t pid = ::fork();
  if (pid == 0) {
    *at_start = resident_bytes();
    ::_exit(call());
  }
  int status = 0;
  rusage use{};
  EXPECT_EQ(::wait4(pid, &status, 0, &use), pid);
  Cost cost;
  cost.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  cost.peak = 1024.0 * static_cast<double>(use.ru_maxrss);
  cost.grown = cost.peak - *at_start;
  cost.exit = WIFEXITED(status) ? WEXITSTATUS(status) : 100 + WTERMSIG(status);
  ::munmap(at_start, sizeof(double));
  return cost;
}

}  // namespace effuse::importers
