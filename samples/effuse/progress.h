#pragma once

#include <chrono>
#include <string>

namespace effuse {

/// Progress on stderr: one line that is overwritten on a terminal, one plain line a frame otherwise.
class Progress {
 public:
  Progress(int first_frame, int frames, bool quiet);
  ~Progress();
  /// Within a frame; on a terminal only, ten times a second at most.
  void tick(const std::string& status);
  void frame_done(int frame, const std::string& status);
  void end();

 private:
  std::string line(int frame, const std::string& status) const;
  int first_, frames_, frame_;
  bool quiet_, terminal_, open_ = false;
  std::chrono::steady_clock::time_point start_, shown_;
};

}  // namespace effuse
