#pragma once

#include <csignal>
#include <iterator>

namespace effuse {

/// Signals while something long is written: the first that asks the program to end (Ctrl-C, SIGTERM, SIGHUP) is noted, so that what is in hand
/// is finished; a second one ends it at once, as ever. A log that nobody reads any more (| head, a terminal that closed) does not end it. One at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Whether one came since the newest of this class was made.
  static bool asked();

 private:
  static constexpr int kStops[] = {SIGINT, SIGTERM, SIGHUP};
  void (*old_[std::size(kStops)])(int);
  void (*old_pipe_)(int);
};

}  // namespace effuse
