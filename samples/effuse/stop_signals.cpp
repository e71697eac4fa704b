#include "samples/effuse/stop_signals.h"

namespace effuse {

namespace {
volatile std::sig_atomic_t g_asked = 0;  // a signal handler may touch nothing else

void on_stop(int signal) {
  g_asked = 1;
  std::signal(signal, SIG_DFL);
}
}  // namespace

StopSignals::StopSignals() {
  g_asked = 0;
  for (std::size_t k = 0; k < std::size(kStops); ++k) {
    old_[k] = std::signal(kStops[k], on_stop);
    if (kStops[k] == SIGHUP && old_[k] == SIG_IGN) std::signal(SIGHUP, SIG_IGN);  // nohup
  }
  old_pipe_ = std::signal(SIGPIPE, SIG_IGN);
}

StopSignals::~StopSignals() {
  for (std::size_t k = 0; k < std::size(kStops); ++k) std::signal(kStops[k], old_[k]);
  std::signal(SIGPIPE, old_pipe_);
}

bool StopSignals::asked() { return g_asked != 0; }

}  // namespace effuse
