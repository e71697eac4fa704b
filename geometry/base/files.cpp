#include "geometry/base/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "geometry/base/error.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {
[[noreturn]] void fail(const fs::path& path, const char* what, int error) {
  const std::string message = fmt::format("{}: cannot {}: {}", path.string(), what, std::strerror(error));
  if (error == ENOSPC || error == EDQUOT || error == EFBIG || error == ENOMEM) throw ResourceError(message);
  // A place that was asked for and cannot be written to.
  if (error == EACCES || error == EPERM || error == EROFS || error == ENOTDIR || error == ENOENT || error == EISDIR || error == ENAMETOOLONG || error == ELOOP || error == EEXIST)
    throw InputError(Place{path.string()}, fmt::format("cannot {}: {}", what, std::strerror(error)));
  throw std::runtime_error(message);
}

/// A file descriptor that closes itself.
struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};
}  // namespace

AtomicFile::AtomicFile(fs::path path) : path_(std::move(path)) {
  std::error_code error;
  if (path_.has_parent_path()) fs::create_directories(path_.parent_path(), error);
  if (error) fail(path_, "create the folder of", error.value());
  if (::access(path_.has_parent_path() ? path_.parent_path().c_str() : ".", W_OK) != 0) fail(path_, "write", errno);
  temporary_ = path_.parent_path() / (path_.stem().string() + ".part" + path_.extension().string());
}

AtomicFile::~AtomicFile() {
  std::error_code ignored;
  if (!committed_) fs::remove(temporary_, ignored);
}

void AtomicFile::commit() {
  const Descriptor file{::open(temporary_.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.fd < 0) fail(path_, "write", errno);
  if (::fsync(file.fd) != 0) fail(path_, "write", errno);
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail(path_, "rename to", errno);
  committed_ = true;
}

void write_file(const fs::path& path, std::string_view bytes) {
  AtomicFile file(path);
  {
    const Descriptor out{::open(file.temporary().c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)};
    if (out.fd < 0) fail(path, "write", errno);
    while (!bytes.empty()) {
      const ssize_t written = ::write(out.fd, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(path, "write", errno);
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
  }
  file.commit();
}

std::string read_file(const fs::path& path) {
  const Place place{path.string()};
  if (!fs::exists(path)) throw InputError(place, "no such file");
  if (fs::is_directory(path)) throw InputError(place, "is a folder, wanted a file");
  const Descriptor in{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (in.fd < 0) throw InputError(place, fmt::format("cannot read: {}", std::strerror(errno)));
  std::string bytes;
  char buffer[1 << 16];
  for (;;) {
    const ssize_t got = ::read(in.fd, buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw InputError(place, fmt::format("cannot read: {}", std::strerror(errno)));
    if (got == 0) return bytes;
    bytes.append(buffer, static_cast<std::size_t>(got));
  }
}

}  // namespace effuse
