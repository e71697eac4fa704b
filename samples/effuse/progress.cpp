#include "samples/effuse/progress.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace effuse {

namespace {
bool can_overwrite() {
  const char* term = std::getenv("TERM");
  return ::isatty(STDERR_FILENO) == 1 && term && std::string_view(term) != "dumb";
}

/// A terminal that is gone or a full disk under the log must not end the run.
void say(const std::string& text) { std::fwrite(text.data(), 1, text.size(), stderr); }

std::string duration(double s) {
  if (s < 90) return fmt::format("{:.0f} s", s);
  return s < 5400 ? fmt::format("{:.0f} min", s / 60) : fmt::format("{:.1f} h", s / 3600);
}
}  // namespace

Progress::Progress(int first_frame, int frames, bool quiet)
    : first_(first_frame), frames_(frames), frame_(first_frame), quiet_(quiet), terminal_(can_overwrite()), start_(std::chrono::steady_clock::now()), shown_(start_) {}
Progress::~Progress() { end(); }

std::string Progress::line(int frame, const std::string& status) const {
  const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const int done = frame - first_, left = frames_ - frame;
  // Frames grow dearer as the lava does: the estimate is a floor, and says so.
  const std::string eta = done > 0 && left > 0 ? fmt::format(", {} left or more", duration(elapsed / done * left)) : "";
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return fmt::format("frame {:4} of {}: {}, {:.0f} MB, {} so far{}", frame, frames_, status, static_cast<double>(usage.ru_maxrss) / 1000, duration(elapsed), eta);
}

void Progress::tick(const std::string& status) {
  if (quiet_ || !terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - shown_ < std::chrono::milliseconds(100)) return;
  shown_ = now;
  open_ = true;
  say("\r\033[K" + line(frame_, status));
  std::fflush(stderr);
}

void Progress::frame_done(int frame, const std::string& status) {
  frame_ = frame;
  if (quiet_) return;
  open_ = terminal_;
  say((terminal_ ? "\r\033[K" : "") + line(frame, status) + (terminal_ ? "" : "\n"));
  std::fflush(stderr);
}

void Progress::end() {
  if (open_) say("\n");
  open_ = false;
}

}  // namespace effuse
