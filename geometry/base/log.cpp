#include "geometry/base/log.h"

#include <atomic>
#include <cstdio>
#include <string>

namespace effuse {

namespace {
std::atomic<LogLevel> g_level{LogLevel::kInfo};

void print(LogLevel level, std::string_view prefix, std::string_view message) {
  if (level > g_level.load(std::memory_order_relaxed)) return;
  std::string line;
  line.reserve(prefix.size() + message.size() + 1);
  line.append(prefix).append(message).push_back('\n');
  std::fwrite(line.data(), 1, line.size(), stderr);  // one call: lines of two threads do not mix
}
}  // namespace

void set_log_level(LogLevel level) { g_level = level; }
LogLevel log_level() { return g_level; }
void log_warning(std::string_view message) { print(LogLevel::kWarnings, "warning: ", message); }
void log_info(std::string_view message) { print(LogLevel::kInfo, "", message); }
void log_debug(std::string_view message) { print(LogLevel::kDebug, "debug: ", message); }

}  // namespace effuse
