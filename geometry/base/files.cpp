#include "geometry/base/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
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

/// The folder of path, made if it is not there.
fs::path make_folder_of(const fs::path& path) {
  std::error_code error;
  if (path.has_parent_path()) fs::create_directories(path.parent_path(), error);
  if (error) fail(path, "create its folder", error.value());
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (::access(folder.c_str(), W_OK) != 0) fail(path, "write", errno);
  return folder;
}

/// A name beside path that nobody else uses: two that write one path must not write one file. `what`: any address of the caller's.
fs::path name_beside(const fs::path& path, const void* what) {
  const auto now = std::chrono::steady_clock::now().time_since_epoch().count();
  std::string stem = path.stem().string();
  stem.resize(std::min<std::size_t>(stem.size(), 180));  // a name of 255 bytes is the longest there is
  return path.parent_path() / fmt::format("{}.{:x}{:x}{:x}.part{}", stem, ::getpid(), static_cast<std::uint64_t>(now), reinterpret_cast<std::uintptr_t>(what) >> 4 & 0xffff, path.extension().string());
}

void write_all(const fs::path& path, int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(path, "write", errno);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

/// Without a name until it is whole, so that nothing is left of it whatever ends the process. false: this file system, or this
/// kernel, has no such files.
bool write_unnamed(const fs::path& path, const fs::path& folder, std::string_view bytes) {
#ifdef O_TMPFILE
  const Descriptor out{::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0644)};
  if (out.fd < 0) return false;
  write_all(path, out.fd, bytes);
  if (::fsync(out.fd) != 0) fail(path, "write", errno);
  const std::string self = fmt::format("/proc/self/fd/{}", out.fd);
  if (::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, path.c_str(), AT_SYMLINK_FOLLOW) == 0) return true;
  if (errno != EEXIST) return false;
  // A link does not replace what is there, a rename does.
  const fs::path beside = name_beside(path, &out);
  if (::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, beside.c_str(), AT_SYMLINK_FOLLOW) != 0) return false;
  if (::rename(beside.c_str(), path.c_str()) == 0) return true;
  const int error = errno;
  ::unlink(beside.c_str());
  fail(path, "rename to", error);
#else
  return false;
#endif
}
}  // namespace

AtomicFile::AtomicFile(fs::path path) : path_(std::move(path)) {
  make_folder_of(path_);
  temporary_ = name_beside(path_, this);
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
  if (write_unnamed(path, make_folder_of(path), bytes)) return;
  AtomicFile file(path);
  {
    const Descriptor out{::open(file.temporary().c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)};
    if (out.fd < 0) fail(path, "write", errno);
    write_all(path, out.fd, bytes);
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
