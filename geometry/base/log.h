#pragma once

#include <string_view>

/// Messages for people, on stderr; stdout is for data. One line each, whole even from several threads.
namespace effuse {

enum class LogLevel { kQuiet, kWarnings, kInfo, kDebug };

/// What is printed from now on, for the whole process (the one setting a process has one of).
void set_log_level(LogLevel level);
LogLevel log_level();

void log_warning(std::string_view message);
void log_info(std::string_view message);
void log_debug(std::string_view message);

}  // namespace effuse
