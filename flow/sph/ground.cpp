#include "flow/sph/ground.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "flow/sph/boundary.h"

namespace effuse::flow::sph {

using geometry::Contact;

Ground::Ground(const GroundOptions& options, std::vector<ContactSource> sources, std::function<bool(const Vec3&)> inside)
    : options_(options), sources_(std::move(sources)), inside_(std::move(inside)) {
  CHECK_GT(options_.reach, 0.0);
  if (options_.look == 0) options_.look = 2 * options_.reach;
  CHECK_GE(options_.look, options_.reach);
  CHECK_GT(options_.clearance, 0.0);
  CHECK_LE(options_.clearance, options_.reach);
  CHECK_GE(options_.rounds, 1);
}

void Ground::born(std::size_t count) {
  bound_.resize(bound_.size() + count, -std::numeric_limits<Real>::infinity());
  place_.resize(bound_.size(), kNone);
}

void Ground::keep(std::span<const Index> which) {
  gather(bound_, which);
  forget_contacts();
}

void Ground::find_asked(std::span<const Vec3> x) {
  const std::size_t n = asked_.size();
  place_.assign(x.size(), kNone);
  if (query_.capacity() > 4 * n + 4096) {  // the first question is about all, later ones are not
    std::vector<Vec3>().swap(query_);
    std::vector<Contact>().swap(contacts_);
    asked_.shrink_to_fit();
  }
  query_.resize(n);
  contacts_.resize(n * sources_.size());
  parallel_for(n, [&](std::size_t q) {
    place_[asked_[q]] = static_cast<Index>(q);
    query_[q] = x[asked_[q]];
  }, 4096);
  for (std::size_t s = 0; s < sources_.size(); ++s) sources_[s](query_, options_.look, std::span(contacts_).subspan(s * n, n));

  parallel_for(n, [&](std::size_t q) {
    Real nearest = std::numeric_limits<Real>::infinity();
    for (std::size_t s = 0; s < sources_.size(); ++s) nearest = std::min(nearest, contacts_[s * n + q].distance);
    // Nothing within the look: at least that far away. Beyond the edge no distance says when it is near again.
    const bool beyond = options_.look > options_.reach && inside_ && nearest >= options_.look && !inside_(query_[q]);
    bound_[asked_[q]] = std::min(nearest, beyond ? options_.reach : options_.look);
  }, 4096);
  COUNT("sph.contact queries", n * sources_.size());
}

void Ground::list_walls(std::span<const Vec3> x, Walls& walls) const {
  CHECK_EQ(x.size(), size());
  CHECK_EQ(place_.size(), size());
  // Lengths, places, then the walls themselves.
  walls.first.assign(x.size() + 1, 0);
  parallel_for(asked_.size(), [&](std::size_t q) {
    const Index i = asked_[q];
    for_each_contact(i, x[i], [&](const Contact&, Real) { ++walls.first[i + 1]; });
  }, 4096);
  for (std::size_t i = 0; i < x.size(); ++i) walls.first[i + 1] += walls.first[i];
  walls.walls.resize(walls.first.back());
  parallel_for(asked_.size(), [&](std::size_t q) {
    const Index i = asked_[q];
    Index place = walls.first[i];
    for_each_contact(i, x[i], [&](const Contact& c, Real d) {
      walls.walls[place++] = Wall{
          .normal = c.normal, .distance = d, .reach = d, .surface = c.surface, .velocity = c.surface_velocity, .temperature = c.surface_temperature};
    });
  }, 4096);
}

void Ground::moved(std::span<const Vec3> before, std::span<const Vec3> after, Real ground_path) {
  CHECK_EQ(before.size(), size());
  CHECK_EQ(after.size(), size());
  CHECK_GE(ground_path, 0.0);
  parallel_for(size(), [&](std::size_t i) { bound_[i] -= (after[i] - before[i]).norm() + ground_path; }, 4096);
}

Ground::Projection Ground::project_suspects(std::span<Vec3> x, std::span<Vec3> v) {
  Projection result;
  std::vector<Vec3> at;
  std::vector<Contact> contact;
  std::vector<std::uint8_t> pushed;
  std::vector<Index> places, next;
  for (int round = 0; round < options_.rounds && !suspects_.empty(); ++round) {
    const std::size_t n = suspects_.size();
    // Between two walls each push undoes some of the last: half the clearance will do.
    const Real least = round == 0 ? options_.clearance : options_.clearance / 2;
    at.resize(n);
    contact.resize(n);
    pushed.assign(n, 0);
    parallel_for(n, [&](std::size_t q) { bound_[suspects_[q]] = options_.reach; }, 4096);
    for (const ContactSource& source : sources_) {
      parallel_for(n, [&](std::size_t q) { at[q] = x[suspects_[q]]; }, 4096);
      source(at, options_.reach, contact);
      parallel_for(n, [&](std::size_t q) {
        const Contact& c = contact[q];
        if (!c.any()) return;
        const Index i = suspects_[q];
        bound_[i] = std::min(bound_[i], c.distance);
        if (c.distance >= least) return;
        x[i] += (options_.clearance - c.distance) * c.normal;
        const Real into = (v[i] - c.surface_velocity).dot(c.normal);
        if (into < 0) v[i] -= into * c.normal;
        bound_[i] = options_.clearance;
        pushed[q] = 1;
      }, 4096);
    }
    COUNT("sph.contact queries", n * sources_.size());
    // Who was pushed is measured anew: another wall may be there.
    select(n, [&](std::size_t q) { return pushed[q] != 0; }, places);
    next.resize(places.size());
    for (std::size_t q = 0; q < places.size(); ++q) next[q] = suspects_[places[q]];
    suspects_.swap(next);
    if (round == 0) result.pushed = suspects_.size();
  }
  if (options_.rounds > 1) {
    result.unsettled = suspects_.size();
    for (const Index i : suspects_) bound_[i] = -std::numeric_limits<Real>::infinity();
  }
  return result;
}

std::vector<Index> Ground::who_stays(std::span<const Vec3> x, std::span<const std::uint8_t> surface, Real off) const {
  CHECK_EQ(x.size(), size());
  CHECK_EQ(surface.size(), size());
  std::vector<Index> stay;
  select(size(), [&](std::size_t i) { return !(surface[i] && bound_[i] > off && inside_ && !inside_(x[i])); }, stay);
  return stay;
}

std::size_t Ground::memory() const {
  const auto bytes = [](const auto&... vectors) { return ((vectors.capacity() * sizeof(vectors[0])) + ...); };
  return bytes(bound_, asked_, place_, query_, contacts_, suspects_);
}

}  // namespace effuse::flow::sph
