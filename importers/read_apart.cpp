#include "importers/read_apart.h"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fcntl.h>
#include <new>
#include <system_error>
#include <vector>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/state_io.h"
#include "geometry/base/zones.h"
#include "importers/input_file.h"

namespace effuse::importers {

namespace {

using Clock = std::chrono::steady_clock;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kShadowMemory = true;
#else
constexpr bool kShadowMemory = false;
#endif

enum Outcome : char { kRead = 'R', kRefused = 'I', kNoResources = 'N', kNoMemory = 'M', kOther = 'O' };

/// Bytes of address space that this process has mapped.
std::uint64_t mapped_bytes() {
  unsigned long long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%llu", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

bool write_all(int to, const char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t n = ::write(to, data, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    data += n;
    size -= static_cast<std::size_t>(n);
  }
  return true;
}

std::string pack_faults(const std::vector<Fault>& faults) {
  StateWriter out;
  out.value("faults", std::uint64_t{faults.size()});
  for (const Fault& fault : faults) {
    out.text("file", fault.place.file);
    out.value("line", fault.place.line);
    out.value("column", fault.place.column);
    out.text("message", fault.message);
  }
  return out.bytes();
}

std::vector<Fault> unpack_faults(const std::string& bytes, const std::string& name) {
  StateReader in(bytes, name);
  std::uint64_t count = 0;
  in.value("faults", count);
  std::vector<Fault> faults;
  for (; faults.size() < count;) {
    Fault fault;
    in.text("file", fault.place.file);
    in.value("line", fault.place.line);
    in.value("column", fault.place.column);
    in.text("message", fault.message);
    faults.push_back(std::move(fault));
  }
  return faults;
}

/// What the child does from its first to its last moment.
[[noreturn]] void be_child(int out, pid_t parent, std::uint64_t bytes, const std::function<std::string()>& read) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  for (const int signal : {SIGINT, SIGPIPE}) ::signal(signal, SIG_IGN);
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTERM}) ::signal(signal, SIG_DFL);
  const rlimit none{0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
  if (!kShadowMemory) {
    const rlimit memory{mapped_bytes() + bytes, mapped_bytes() + bytes};
    ::setrlimit(RLIMIT_AS, &memory);
  }
  char outcome = kOther;
  std::string result;
  try {
    const ThreadLimit alone(1);
    try {
      result = read();
      outcome = kRead;
    } catch (const InputError& error) {
      result = pack_faults(error.faults());
      outcome = kRefused;
    } catch (const ResourceError& error) {
      result = error.what();
      outcome = kNoResources;
    } catch (const std::bad_alloc&) {
      outcome = kNoMemory;
    } catch (const std::length_error&) {
      outcome = kNoMemory;
    } catch (const std::exception& error) {
      result = printable(error.what());
    }
  } catch (...) {
    outcome = kNoMemory;  // no room for the words of another error
    result.clear();
  }
  const std::uint64_t size = result.size();
  char head[1 + sizeof size];
  head[0] = outcome;
  std::memcpy(head + 1, &size, sizeof size);
  const bool sent = write_all(out, head, sizeof head) && write_all(out, result.data(), result.size());
  ::_exit(sent ? 0 : 1);
}

struct Answer {
  bool whole = false, late = false;
  char outcome = 0;
  std::string bytes;
  int status = 0;
};

/// Reads until the answer is whole, the child is gone, or the time is up; then the child is gone in any case.
Answer hear(pid_t child, int in, double seconds, std::uint64_t most) {
  Answer answer;
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  std::string heard;
  std::uint64_t wanted = 0;
  bool gone = false;
  std::vector<char> buffer(1 << 20);
  constexpr std::size_t kHead = 1 + sizeof wanted;
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    if (left <= 0) {
      answer.late = true;
      break;
    }
    // Another thread's child may hold the pipe open, too: so the child itself is looked after.
    pollfd look{in, POLLIN, 0};
    const int ready = ::poll(&look, 1, static_cast<int>(std::min<long long>(left, 50)));
    if (ready > 0) {
      const ssize_t n = ::read(in, buffer.data(), buffer.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) break;
      heard.append(buffer.data(), static_cast<std::size_t>(n));
      if (heard.size() >= kHead) {
        if (wanted == 0) {
          std::memcpy(&wanted, heard.data() + 1, sizeof wanted);
          if (wanted > most) break;
          heard.reserve(kHead + wanted);
        }
        answer.whole = heard.size() >= kHead + wanted;
        if (answer.whole) break;
      }
    } else if (gone) {
      break;
    } else if (ready == 0) {
      gone = ::waitpid(child, &answer.status, WNOHANG) != 0;
    }
  }
  if (!gone) {
    if (answer.late || wanted > most) ::kill(child, SIGKILL);
    while (::waitpid(child, &answer.status, 0) < 0 && errno == EINTR) {
    }
  }
  if (answer.whole) {
    answer.outcome = heard[0];
    heard.erase(0, kHead);
    heard.resize(wanted);
    answer.bytes = std::move(heard);
  }
  return answer;
}

std::string size_text(std::uint64_t bytes) {
  return bytes >= (1ull << 30) ? fmt::format("{:.3g} GiB", static_cast<double>(bytes) / (1ull << 30)) : fmt::format("{:.3g} MiB", static_cast<double>(bytes) / (1ull << 20));
}

}  // namespace

std::string read_apart(const std::filesystem::path& file, const ReadLimits& limits, const std::function<std::string()>& read) {
  ZONE("import.apart");
  const Place place{file.string()};
  std::error_code ignored;
  const std::uintmax_t on_disk = std::filesystem::file_size(file, ignored);
  const std::uint64_t size = ignored ? 0 : on_disk;
  const double seconds = limits.seconds > 0 ? limits.seconds : 10 + static_cast<double>(size) / 2e6;
  const std::uint64_t bytes = limits.bytes > 0 ? limits.bytes : (std::uint64_t{768} << 20) + 64 * size;

  int pipe[2];
  if (::pipe2(pipe, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "cannot open a pipe");
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0) {
    const int error = errno;
    ::close(pipe[0]);
    ::close(pipe[1]);
    throw std::system_error(error, std::generic_category(), "cannot start a process to read " + file.string() + " in");
  }
  if (child == 0) {
    ::close(pipe[0]);
    be_child(pipe[1], parent, bytes, read);
  }
  ::close(pipe[1]);
  Answer answer;
  try {
    answer = hear(child, pipe[0], seconds, bytes);
  } catch (...) {
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    ::close(pipe[0]);
    throw;
  }
  ::close(pipe[0]);

  const std::string more_memory = fmt::format("takes more than {} of memory to read: it is broken, or the limit is to be raised (--read-limit)", size_text(bytes));
  if (answer.late) throw InputError(place, fmt::format("is not read after {:.3g} s: it is broken, or the limit is to be raised (--read-limit)", seconds));
  if (!answer.whole) {
    if (!WIFSIGNALED(answer.status)) throw InputError(place, more_memory);
    const int signal = WTERMSIG(answer.status);
    if (signal == SIGKILL) throw InputError(place, more_memory);
    throw InputError(place, fmt::format("its reader crashed ({}): the file is broken, or holds what the reader does not know", printable(strsignal(signal))));
  }
  switch (answer.outcome) {
    case kRead: return std::move(answer.bytes);
    case kRefused: throw InputError(unpack_faults(answer.bytes, file.string()));
    case kNoResources: throw ResourceError(answer.bytes);
    case kNoMemory: throw InputError(place, more_memory);
    default: throw InputError(place, "cannot be read: " + answer.bytes);
  }
}

ReadLimits parse_read_limits(const std::string& text, ReadLimits base) {
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    std::string part = text.substr(at, end - at);
    at = end + 1;
    std::erase(part, ' ');
    const std::size_t digits = part.find_first_not_of("0123456789.");
    double value = 0;
    const std::string unit = digits == std::string::npos ? "" : lower(part.substr(digits));
    const bool number = parse_number(part.substr(0, digits), value) && std::isfinite(value) && value > 0;
    const std::pair<const char*, double> sizes[] = {{"kb", 1e3}, {"mb", 1e6}, {"gb", 1e9}, {"kib", 1024.0}, {"mib", 1048576.0}, {"gib", 1073741824.0}};
    const auto found = std::find_if(std::begin(sizes), std::end(sizes), [&](const auto& s) { return unit == s.first; });
    if (number && (unit == "s" || unit == "min")) base.seconds = value * (unit == "s" ? 1 : 60);
    else if (number && found != std::end(sizes) && value * found->second < 1e18) base.bytes = static_cast<std::uint64_t>(value * found->second);
    else throw InputError(Place{}, fmt::format("--read-limit: found {}, wanted a time (60s, 5min), a size (4GB, 500MB), or both with a comma", quote(part)));
  }
  return base;
}

}  // namespace effuse::importers
