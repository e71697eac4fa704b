#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

/// Where the time went: ZONE("sph.rates") times its scope, COUNT("sph.pairs", n) adds to a counter.
///
/// Both record into the Profile that a ProfileScope has installed on this thread, and cost one
/// thread-local load when there is none: a library user who installs none pays nothing. Worker
/// threads of a parallel loop record nothing; the zone around the loop holds their wall time.
namespace effuse {

struct ZoneRow {
  std::string name;
  double total_s = 0;  ///< wall time in the zone, zones inside it included
  double self_s = 0;   ///< without the zones inside it
  std::uint64_t calls = 0;
};

struct CounterRow {
  std::string name;
  std::uint64_t value = 0;
};

class Profile {
 public:
  Profile() : start_(std::chrono::steady_clock::now()) {}

  std::vector<ZoneRow> zones() const;        ///< by falling self_s
  std::vector<CounterRow> counters() const;  ///< by name
  double elapsed_s() const;                  ///< since construction
  /// Both as an aligned table for people, shares against elapsed_s().
  std::string table() const;

  void enter(const char* name);
  void leave();
  void count(const char* name, std::uint64_t n);

 private:
  struct Zone {
    const char* name;
    double total_s, self_s;
    std::uint64_t calls;
    int open;  // a zone entered again inside itself counts its total once
  };
  struct Open {
    std::size_t zone;
    std::chrono::steady_clock::time_point since;
    double inner_s;
  };
  std::chrono::steady_clock::time_point start_;
  std::vector<Zone> zones_;
  std::vector<Open> open_;
  std::vector<CounterRow> counters_;
};

/// Zones of this thread go to profile until the scope ends; scopes nest.
class ProfileScope {
 public:
  explicit ProfileScope(Profile& profile);
  ~ProfileScope();
  ProfileScope(const ProfileScope&) = delete;
  ProfileScope& operator=(const ProfileScope&) = delete;

 private:
  Profile* outer_;
};

namespace detail {
Profile* current_profile();

class ZoneTimer {
 public:
  explicit ZoneTimer(const char* name) : profile_(current_profile()) {
    if (profile_) profile_->enter(name);
  }
  ~ZoneTimer() {
    if (profile_) profile_->leave();
  }
  ZoneTimer(const ZoneTimer&) = delete;
  ZoneTimer& operator=(const ZoneTimer&) = delete;

 private:
  Profile* profile_;
};
}  // namespace detail
}  // namespace effuse

#define EFFUSE_JOIN2(a, b) a##b
#define EFFUSE_JOIN(a, b) EFFUSE_JOIN2(a, b)
#define ZONE(name) const ::effuse::detail::ZoneTimer EFFUSE_JOIN(zone_timer_, __LINE__)(name)
#define COUNT(name, n)                                                                       \
  do {                                                                                       \
    if (::effuse::Profile* profile_to_count = ::effuse::detail::current_profile())            \
      profile_to_count->count(name, static_cast<std::uint64_t>(n));                          \
  } while (false)
