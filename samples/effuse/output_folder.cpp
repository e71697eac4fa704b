#include "samples/effuse/output_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "geometry/base/error.h"

namespace effuse {

namespace fs = std::filesystem;

OutputFolder::OutputFolder(const fs::path& folder) {
  const Place place{folder.string()};
  std::error_code error;
  if (fs::is_directory(folder, error)) {
    if (::access(folder.c_str(), W_OK | X_OK) != 0) throw InputError(place, fmt::format("cannot be written to: {}", std::strerror(errno)));
  } else {
    if (fs::exists(fs::symlink_status(folder, error))) throw InputError(place, "is not a folder, wanted one to write to");
    fs::create_directories(folder, error);
    if (error == std::errc::no_space_on_device) throw ResourceError(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
    if (error) throw InputError(place, "cannot make this folder: " + error.message());
  }
  fd_ = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  // Where locks are not to be had, it has to go without.
  if (fd_ >= 0 && ::flock(fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    ::close(fd_);
    throw InputError(place, "another effuse is writing to this folder; wait for it, or name another with -o");
  }
}

OutputFolder::~OutputFolder() {
  if (fd_ >= 0) ::close(fd_);
}

}  // namespace effuse
