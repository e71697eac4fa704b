#include "flow/bodies/brittle_bodies.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/zones.h"

namespace effuse::flow::bodies {

using geometry::FracturedBody;
using geometry::RigidPose;

namespace {
constexpr std::string_view kModel = "brittle bodies 1";
}

BrittleBodies::BrittleBodies(RigidBodies& bodies, const BrittleOptions& options) : bodies_(bodies), options_(options) {
  CHECK(options.blow_time > 0 && std::isfinite(options.blow_time));
  CHECK_GE(options.rounds, 0);
}

std::shared_ptr<const Shape> BrittleBodies::shape_of(const Source& source, std::span<const Index> cells) const {
  const FracturedBody& body = *source.material.cells;
  const geometry::MassProperties mass = geometry::mass_of(body, cells);
  geometry::TriMesh surface = geometry::surface_of(body, cells);
  const bool convex = std::all_of(cells.begin(), cells.end(), [&](Index c) { return body.cells[c].convex; });
  if (!convex) return Shape::mesh(surface, mass);
  std::vector<geometry::ConvexHull> hulls;
  for (const Index c : cells) hulls.push_back(source.hulls[c]);
  return Shape::parts(std::move(hulls), mass, std::move(surface));
}

BodyId BrittleBodies::add(const BrittleMaterial& material, Real density, const RigidPose& pose, const Surface& surface, const Vec3& velocity, const Vec3& spin) {
  CHECK(material.cells != nullptr);
  CHECK(!material.cells->cells.empty());
  CHECK(material.strength > 0);
  CHECK(material.smallest >= 0);
  const FracturedBody& body = *material.cells;
  Source source;
  source.material = material;
  source.density = density;
  source.surface = surface;
  source.broken.assign(body.interfaces.size(), 0);
  source.felt.resize(body.cells.size());
  for (const geometry::FractureCell& cell : body.cells) {
    source.hulls.emplace_back();
    if (!cell.convex) continue;
    std::vector<Vec3> corners;
    for (const geometry::CellFace& face : cell.faces)
      for (const Index i : face.loop) corners.push_back(body.vertices[i]);
    source.hulls.back() = geometry::make_convex_hull(corners);
  }
  std::vector<Index> all(body.cells.size());
  std::iota(all.begin(), all.end(), Index{0});
  // A body in several parts from the start is so many pieces; they go on as one until something breaks.
  sources_.push_back(std::move(source));
  const auto number = static_cast<Index>(sources_.size() - 1);
  sources_.back().first = add_piece(number, std::move(all), pose, velocity, spin);
  return sources_.back().first;
}

BodyId BrittleBodies::add_piece(Index number, std::vector<Index> cells, const RigidPose& pose, const Vec3& velocity, const Vec3& spin) {
  const Source& source = sources_[number];
  const BodyId id = bodies_.add(shape_of(source, cells), source.density, pose, source.surface, velocity, spin);
  if (std::isfinite(source.material.strength) && cells.size() > 1) bodies_.record_loads(id, true);
  pieces_.insert_or_assign(id, Piece{number, std::move(cells)});
  return id;
}

void BrittleBodies::add_force(BodyId id, const Vec3& f, const Vec3& at) {
  bodies_.add_force(id, f, at);
  const auto piece = pieces_.find(id);
  if (piece == pieces_.end() || f.isZero(0)) return;
  const FracturedBody& body = *sources_[piece->second.source].material.cells;
  const Vec3 place = bodies_.pose(id).body(at);
  // The nearest of the piece's own cells.
  Index best = piece->second.cells[0];
  if (const Index c = body.cell_at(place); std::binary_search(piece->second.cells.begin(), piece->second.cells.end(), c)) {
    best = c;
  } else {
    for (const Index other : piece->second.cells)
      if ((body.cells[other].mass.centre - place).squaredNorm() < (body.cells[best].mass.centre - place).squaredNorm()) best = other;
  }
  given_.push_back({id, best, f, at, place});
}

/// Follows the forces through the step's substeps; what broke.
std::vector<BrittleBodies::Split> BrittleBodies::overloaded(Real dt, int substeps) {
  ZONE("bodies.brittle");
  const Real h = dt / substeps, keep = std::exp(-h / options_.blow_time);
  std::vector<Split> splits;
  // Loads by body and substep, in the order they came.
  std::vector<ContactLoad> loads(bodies_.contact_loads().begin(), bodies_.contact_loads().end());
  std::stable_sort(loads.begin(), loads.end(), [](const ContactLoad& a, const ContactLoad& b) { return std::pair(a.body, a.substep) < std::pair(b.body, b.substep); });
  for (auto& [id, piece] : pieces_) {
    Source& source = sources_[piece.source];
    if (!std::isfinite(source.material.strength) || piece.cells.size() < 2 || bodies_.asleep(id)) continue;
    const FracturedBody& body = *source.material.cells;
    const RigidPose pose = bodies_.pose(id);
    const RigidPose given_from_body = [&] {
      const RigidPose& p = bodies_.shape(id).body_from_given();
      return RigidPose{p.body(Vec3::Zero()), p.orientation.conjugate()};
    }();
    // Forces that last the whole step.
    std::vector<Wrench> steady(body.cells.size());
    for (const Given& g : given_) {
      if (g.body != id) continue;
      const Vec3 f = pose.orientation.conjugate() * g.force, at = g.local;
      steady[g.cell].force += f;
      steady[g.cell].moment += (at - body.cells[g.cell].mass.centre).cross(f);
    }
    const Vec3 spin = pose.orientation.conjugate() * bodies_.spin(id);
    auto load = std::lower_bound(loads.begin(), loads.end(), id, [](const ContactLoad& l, BodyId wanted) { return l.body < wanted; });
    std::vector<Wrench> on_cells(piece.cells.size());
    for (int s = 0; s < substeps; ++s) {
      std::vector<Wrench> now = steady;
      for (; load != loads.end() && load->body == id && load->substep == s; ++load) {
        const Vec3 at = given_from_body.world(load->at), f = given_from_body.orientation * load->impulse / h;
        Index cell = body.cell_at(at);
        if (!std::binary_search(piece.cells.begin(), piece.cells.end(), cell)) {
          cell = piece.cells[0];
          for (const Index c : piece.cells)
            if ((body.cells[c].mass.centre - at).squaredNorm() < (body.cells[cell].mass.centre - at).squaredNorm()) cell = c;
        }
        now[cell].force += f;
        now[cell].moment += (at - body.cells[cell].mass.centre).cross(f);
      }
      bool loaded = false;
      for (std::size_t k = 0; k < piece.cells.size(); ++k) {
        Wrench& felt = source.felt[piece.cells[k]];
        felt.force = keep * felt.force + (1 - keep) * now[piece.cells[k]].force;
        felt.moment = keep * felt.moment + (1 - keep) * now[piece.cells[k]].moment;
        on_cells[k] = felt;
        loaded = loaded || !felt.force.isZero(0);
      }
      if (!loaded && spin.isZero(0)) continue;
      std::vector<std::vector<Index>> groups = break_bonds(body, piece.cells, source.density, spin, on_cells, source.material.strength, source.material.smallest, source.broken, piece.solver);
      if (groups.size() > 1) {
        splits.push_back({id, std::move(groups)});
        break;
      }
    }
  }
  return splits;
}

/// The body as its pieces, each going on as its part of the body did.
void BrittleBodies::part(const Split& split) {
  const BodyId old = split.body;
  const Piece& parent = pieces_.at(old);
  const Source& source = sources_[parent.source];
  const FracturedBody& body = *source.material.cells;
  const RigidPose pose = bodies_.pose(old);
  const Vec3 centre = bodies_.centres()[old], v = bodies_.momenta()[old] / bodies_.mass(old), w = bodies_.spin(old);
  const geometry::MassProperties whole = geometry::mass_of(body, parent.cells);

  // Forces of the step in hand: those told by place stay with their cell, the rest is shared out as to one rigid body.
  Vec3 rest = bodies_.force(old), twist = bodies_.torque(old);
  for (const Given& g : given_)
    if (g.body == old) {
      rest -= g.force;
      twist -= (g.at - centre).cross(g.force);
    }
  const Mat3 R = pose.orientation.toRotationMatrix();
  const Vec3 a = rest / whole.volume, alpha = R * whole.inertia.inverse() * R.transpose() * twist;

  std::vector<BodyId> of_cell(body.cells.size(), old);
  for (const std::vector<Index>& cells : split.groups) {
    const geometry::MassProperties mass = geometry::mass_of(body, cells);
    const Vec3 r = pose.world(mass.centre) - pose.world(whole.centre);
    const BodyId id = add_piece(parent.source, cells, pose, v + w.cross(r), w);
    births_[id] = {old, parent.source, cells};
    for (const Index c : cells) of_cell[c] = id;
    bodies_.add_force(id, mass.volume * (a + alpha.cross(r)), bodies_.centres()[id]);
    bodies_.add_torque(id, R * mass.inertia * R.transpose() * alpha);
  }
  for (Given& g : given_) {
    if (g.body != old) continue;
    g.body = of_cell[g.cell];
    bodies_.add_force(g.body, g.force, g.at);
  }
  bodies_.hand_joints(old, [&](const Vec3& at) { return of_cell[body.cell_at(pose.body(at))] == old ? of_cell[parent.cells[0]] : of_cell[body.cell_at(pose.body(at))]; });
  pieces_.erase(old);
  bodies_.retire(old);
}

BrittleReport BrittleBodies::step(Real dt) {
  BrittleReport report;
  const bool may_break = std::any_of(pieces_.begin(), pieces_.end(), [&](const auto& p) {
    return p.second.cells.size() > 1 && std::isfinite(sources_[p.second.source].material.strength);
  });
  for (int round = 0;; ++round) {
    const auto before = may_break ? bodies_.moment() : nullptr;
    std::vector<std::vector<Wrench>> felt;
    for (const Source& source : sources_) felt.push_back(source.felt);
    report.bodies = bodies_.step(dt);
    if (!may_break) break;
    const std::vector<Split> splits = overloaded(dt, report.bodies.substeps);
    if (splits.empty()) break;
    const bool again = round < options_.rounds;
    if (again) {
      bodies_.go_back(*before);
      for (std::size_t s = 0; s < sources_.size(); ++s) sources_[s].felt = felt[s];
      ++report.redone;
    } else {
      given_.clear();  // has acted
    }
    for (const Split& split : splits) {
      part(split);
      ++report.broken_bodies;
      report.new_pieces += split.groups.size();
    }
    if (!again) break;
  }
  given_.clear();
  return report;
}

std::size_t BrittleBodies::broken_bonds() const {
  std::size_t count = 0;
  for (const Source& source : sources_) count += static_cast<std::size_t>(std::count(source.broken.begin(), source.broken.end(), std::uint8_t{1}));
  return count;
}

void BrittleBodies::add_to(StateHash& hash) const {
  for (const Source& source : sources_) {
    hash.add(std::span<const std::uint8_t>(source.broken));
    for (const Wrench& w : source.felt) {
      hash.add(std::span<const Vec3>(&w.force, 1));
      hash.add(std::span<const Vec3>(&w.moment, 1));
    }
  }
}

void BrittleBodies::save(StateWriter& out) const {
  out.text("model", kModel);
  std::vector<Index> numbers, cells, counts;
  for (const auto& [id, birth] : births_) {
    numbers.insert(numbers.end(), {id, birth.parent, birth.source});
    counts.push_back(static_cast<Index>(birth.cells.size()));
    cells.insert(cells.end(), birth.cells.begin(), birth.cells.end());
  }
  out.value("brittle_bodies", static_cast<std::uint64_t>(bodies_.size()));
  out.array("brittle_births", numbers);
  out.array("brittle_counts", counts);
  out.array("brittle_cells", cells);
  std::vector<std::uint8_t> broken;
  std::vector<Vec3> felt;
  for (const Source& source : sources_) {
    broken.insert(broken.end(), source.broken.begin(), source.broken.end());
    for (const Wrench& w : source.felt) felt.insert(felt.end(), {w.force, w.moment});
  }
  out.array("brittle_broken", broken);
  out.array("brittle_felt", felt);
}

void BrittleBodies::load(StateReader& in, const std::function<void(BodyId)>& other) {
  const auto refuse = [](const std::string& why) { throw InputError(Place{}, "the checkpoint of the brittle bodies " + why); };
  std::string model;
  in.text("model", model);
  if (model != kModel) refuse(fmt::format("holds '{:.40}', wanted '{}'", model, kModel));
  std::uint64_t count = 0;
  std::vector<Index> numbers, counts, cells;
  std::vector<std::uint8_t> broken;
  std::vector<Vec3> felt;
  in.value("brittle_bodies", count);
  in.array("brittle_births", numbers);
  in.array("brittle_counts", counts);
  in.array("brittle_cells", cells);
  in.array("brittle_broken", broken);
  in.array("brittle_felt", felt);

  // All of it is looked at before anything is changed.
  if (numbers.size() != 3 * counts.size()) refuse("has lists of different lengths");
  std::size_t bonds = 0, of_felt = 0;
  for (const Source& source : sources_) bonds += source.broken.size(), of_felt += 2 * source.felt.size();
  if (broken.size() != bonds || felt.size() != of_felt) refuse("is of bodies cut in other cells");
  std::map<BodyId, Birth> births;
  std::size_t at = 0;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    Birth birth{numbers[3 * k + 1], numbers[3 * k + 2], {}};
    if (birth.source >= sources_.size() || counts[k] == 0 || at + counts[k] > cells.size()) refuse("has a piece of a body that is not there");
    birth.cells.assign(cells.begin() + static_cast<std::ptrdiff_t>(at), cells.begin() + static_cast<std::ptrdiff_t>(at + counts[k]));
    at += counts[k];
    const std::size_t most = sources_[birth.source].felt.size();
    if (!std::is_sorted(birth.cells.begin(), birth.cells.end()) || birth.cells.back() >= most) refuse("has a piece of cells that are not there");
    const BodyId id = numbers[3 * k];
    if (id < bodies_.size() || id >= count || birth.parent >= id) refuse("has pieces out of their order");
    births[id] = std::move(birth);
  }
  if (at != cells.size()) refuse("has cells of no piece");

  for (auto id = static_cast<BodyId>(bodies_.size()); id < count; ++id) {
    const auto birth = births.find(id);
    if (birth == births.end()) {
      if (!other) refuse("holds bodies that nobody here makes");
      other(id);
    } else {
      if (add_piece(birth->second.source, birth->second.cells, {}, Vec3::Zero(), Vec3::Zero()) != id) refuse("has pieces out of their order");
    }
  }
  for (const auto& [id, birth] : births) {
    if (!pieces_.count(birth.parent)) continue;  // its other pieces have seen to that
    bodies_.retire(birth.parent);
    pieces_.erase(birth.parent);
  }
  births_ = std::move(births);
  std::size_t b = 0, f = 0;
  for (Source& source : sources_) {
    for (std::uint8_t& flag : source.broken) flag = broken[b++];
    for (Wrench& w : source.felt) {
      w.force = felt[f++];
      w.moment = felt[f++];
    }
  }
  given_.clear();
}

}  // namespace effuse::flow::bodies
