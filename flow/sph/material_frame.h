#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "flow/sph/particle_arrays.h"
#include "geometry/base/types.h"

/// What particles carry with them whatever moves them: who they are (Census), where they were (MaterialFrames).
///
/// Both keep their arrays in step with a solver's own: born() adds at the end, keep() reorders and drops. arrays()
/// and values() hand what is saved and hashed to an archive (StateWriter, StateReader, HashArchive).
namespace effuse::flow::sph {

/// Ids, times of birth, and how many came and went.
class Census {
 public:
  std::size_t size() const { return id_.size(); }
  std::span<const std::uint64_t> ids() const { return id_; }
  std::span<const Real> births() const { return birth_; }  ///< [s]
  std::uint64_t emitted() const { return emitted_; }
  std::uint64_t left() const { return left_; }

  /// One more particle at time t [s]; ids count up from 0 and are never used again.
  void born(Real t) {
    id_.push_back(next_id_++);
    birth_.push_back(t);
    ++emitted_;
  }
  void keep(std::span<const Index> which) {
    gather(id_, which);
    gather(birth_, which);
  }
  /// Counts particles that went over the edge of the ground.
  void count_left(std::size_t n) { left_ += n; }

  std::size_t memory() const { return id_.capacity() * sizeof(id_[0]) + birth_.capacity() * sizeof(birth_[0]); }
  void check_loaded(std::size_t n) const { check_loaded_sizes(n, {id_.size(), birth_.size()}); }
  template <class Self, class Archive>
  static void arrays(Self& self, Archive& io) {
    io.array("id", self.id_);
    io.array("birth", self.birth_);
  }
  template <class Self, class Archive>
  static void values(Self& self, Archive& io) {
    io.value("next_id", self.next_id_);
    io.value("emitted", self.emitted_);
    io.value("left", self.left_);
  }

 private:
  std::vector<std::uint64_t> id_;
  std::vector<Real> birth_;
  std::uint64_t next_id_ = 0, emitted_ = 0, left_ = 0;
};

/// Two sets of material coordinates: where each particle was when the set was last born, so that texture can be
/// blended from the one to the other while each is renewed in turn, half a period apart, and never stretches far.
class MaterialFrames {
 public:
  /// period [s] between two births of one set; 0: never, the first set stays as at the particles' birth.
  explicit MaterialFrames(Real period) : period_(period), rest2_born_(-period / 2) {}

  std::size_t size() const { return rest_.size(); }
  std::span<const Vec3> rest() const { return rest_; }    ///< [m]
  std::span<const Vec3> rest2() const { return rest2_; }  ///< [m]
  Real rest_born() const { return rest_born_; }           ///< [s]
  Real rest2_born() const { return rest2_born_; }         ///< [s]

  /// One more particle, which was at these places when the sets were born.
  void born(const Vec3& rest, const Vec3& rest2) {
    rest_.push_back(rest);
    rest2_.push_back(rest2);
  }
  void keep(std::span<const Index> which) {
    gather(rest_, which);
    gather(rest2_, which);
  }
  /// At time t [s]: a set whose period is over is born again at the particles' positions x. Births stand at whole
  /// multiples of the period after the first, whatever the steps are.
  void renew(Real t, std::span<const Vec3> x) {
    if (period_ <= 0) return;
    const auto renew_one = [&](std::vector<Vec3>& rest, Real& born) {
      if (t - born < period_) return;
      rest.assign(x.begin(), x.end());
      born += period_ * std::floor((t - born) / period_);
    };
    renew_one(rest_, rest_born_);
    renew_one(rest2_, rest2_born_);
  }
  /// Weight of the second set, that of the first is 1 - ratio: each weighs nothing at its birth and just before
  /// its next one. 0 without a period.
  Real ratio(Real t) const { return period_ > 0 ? std::abs(2 * (t - rest_born_) / period_ - 1) : 0; }

  std::size_t memory() const { return (rest_.capacity() + rest2_.capacity()) * sizeof(Vec3); }
  void check_loaded(std::size_t n) const { check_loaded_sizes(n, {rest_.size(), rest2_.size()}); }
  template <class Self, class Archive>
  static void arrays(Self& self, Archive& io) {
    io.array("rest", self.rest_);
    io.array("rest2", self.rest2_);
  }
  template <class Self, class Archive>
  static void values(Self& self, Archive& io) {
    io.value("rest_born", self.rest_born_);
    io.value("rest2_born", self.rest2_born_);
  }

 private:
  Real period_;
  std::vector<Vec3> rest_, rest2_;
  Real rest_born_ = 0, rest2_born_;
};

}  // namespace effuse::flow::sph
