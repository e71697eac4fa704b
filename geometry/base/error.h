#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace effuse {

/// Exit codes of the program (DESIGN: the command line).
enum class ExitCode : int {
  kDone = 0,
  kFailed = 1,
  kBadInput = 2,
  kUnstable = 4,
  kOutOfResources = 5,
  kInterrupted = 130,
};

/// Where something stands in a file. line and column count from 1; 0 = unknown.
struct Place {
  std::string file;
  int line = 0;
  int column = 0;
};

/// "file:12:3", "file:12" or "file".
std::string to_string(const Place& place);

/// One thing wrong with an input: where, and what was found and what would do.
struct Fault {
  Place place;
  std::string message;
};

/// "file:12:3: message"
std::string to_string(const Fault& fault);

/// A file, scene or argument is wrong. Holds every fault found, what() prints one a line.
/// Exit code 2. Thrown before anything is written.
class InputError : public std::runtime_error {
 public:
  InputError(Place place, const std::string& message) : InputError(std::vector<Fault>{{std::move(place), message}}) {}
  explicit InputError(std::vector<Fault> faults);
  const std::vector<Fault>& faults() const { return faults_; }

 private:
  std::vector<Fault> faults_;
};

/// The numbers went bad and smaller steps did not help. Exit code 4.
class UnstableError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Disk or memory is used up. Exit code 5.
class ResourceError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The member of candidates nearest to word by Damerau-Levenshtein distance, or "" when none is
/// within max(2, a third of its length): the name meant by a typing error.
std::string nearest_name(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace effuse
