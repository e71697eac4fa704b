#include "flow/bodies/bonds.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::flow::bodies {

using geometry::CellInterface;
using geometry::FracturedBody;

namespace {

using Vec6 = Eigen::Matrix<Real, 6, 1>;
using Mat6 = Eigen::Matrix<Real, 6, 6>;

// Bonds as near to the worst stress break with it. A body that is just overloaded breaks at one place; one loaded far beyond has no
// time to see what the first crack relieves.
constexpr Real kTogether = 0.99, kTogetherFast = 0.9;
constexpr Real kFast = 2;          ///< strengths
constexpr Real kFar = 5;           ///< strengths: of a body loaded beyond that breaks at once what is; bond by bond thousands of cells would take hours
constexpr Real kLeastGap = 0.05;   ///< of the root of an interface's area: centres are no nearer than that

Mat3 cross(const Vec3& r) {
  Mat3 m;
  m << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return m;
}

Real gap(const FracturedBody& body, const CellInterface& bond) {
  return std::max((body.cells[bond.b].mass.centre - body.cells[bond.a].mass.centre).dot(bond.normal), kLeastGap * std::sqrt(bond.area));
}

/// Displacement of a cell's material at r from its centre: [1, -[r]x].
Eigen::Matrix<Real, 6, 6> at_arm(const Vec3& r) {
  Mat6 m = Mat6::Identity();
  m.topRightCorner<3, 3>() = -cross(r);
  return m;
}

}  // namespace

void take_rigid_part(const FracturedBody& body, std::span<const Index> which, Real density, const Vec3& spin, std::span<Wrench> loads) {
  CHECK_EQ(which.size(), loads.size());
  const geometry::MassProperties all = geometry::mass_of(body, which);
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  for (std::size_t k = 0; k < which.size(); ++k) {
    force += loads[k].force;
    moment += loads[k].moment + (body.cells[which[k]].mass.centre - all.centre).cross(loads[k].force);
  }
  const Mat3 I = density * all.inertia;
  const Vec3 a = force / (density * all.volume), alpha = I.inverse() * (moment - spin.cross(I * spin));
  for (std::size_t k = 0; k < which.size(); ++k) {
    const geometry::MassProperties& m = body.cells[which[k]].mass;
    const Vec3 r = m.centre - all.centre;
    loads[k].force -= density * m.volume * (a + alpha.cross(r) + spin.cross(spin.cross(r)));
    loads[k].moment -= density * (m.inertia * alpha + spin.cross(m.inertia * spin));
  }
}

std::vector<std::vector<Index>> bonded_groups(const FracturedBody& body, std::span<const Index> which, std::span<const std::uint8_t> broken) {
  constexpr Index kNone = ~Index{0};
  std::vector<Index> parent(body.cells.size(), kNone);
  for (const Index c : which) parent[c] = c;
  const auto root = [&](Index c) {
    while (parent[c] != c) c = parent[c] = parent[parent[c]];
    return c;
  };
  for (std::size_t k = 0; k < body.interfaces.size(); ++k) {
    const CellInterface& bond = body.interfaces[k];
    if (broken[k] || parent[bond.a] == kNone || parent[bond.b] == kNone) continue;
    const Index a = root(bond.a), b = root(bond.b);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::map<Index, std::vector<Index>> groups;
  for (const Index c : which) groups[root(c)].push_back(c);
  std::vector<std::vector<Index>> out;
  for (auto& [r, cells] : groups) out.push_back(std::move(cells));
  return out;
}

struct BondSolver::Impl {
  explicit Impl(const FracturedBody& b) : body(b) {}
  const FracturedBody& body;
  std::vector<Index> which, place, bonds;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<Real>, Eigen::Lower> solver;
};

BondSolver::BondSolver(const FracturedBody& body, std::span<const Index> which, std::span<const std::uint8_t> broken)
    : impl_(std::make_unique<Impl>(body)) {
  ZONE("bodies.bonds.factor");
  impl_->which.assign(which.begin(), which.end());
  const std::size_t n = which.size();
  constexpr Index kNone = ~Index{0};
  std::vector<Index>& place = impl_->place;
  place.assign(body.cells.size(), kNone);
  for (std::size_t k = 0; k < n; ++k) place[which[k]] = static_cast<Index>(k);
  for (Index k = 0; k < body.interfaces.size(); ++k)
    if (!broken[k] && place[body.interfaces[k].a] != kNone && place[body.interfaces[k].b] != kNone) impl_->bonds.push_back(k);

  // K u = f over cells' shifts and turns.
  std::vector<Mat6> diagonal(n, Mat6::Zero());
  std::vector<Eigen::Triplet<Real>> entries;
  entries.reserve(36 * impl_->bonds.size() + 21 * n);
  for (const Index k : impl_->bonds) {
    const CellInterface& bond = body.interfaces[k];
    const Index i = place[bond.a], j = place[bond.b];
    Mat6 D = Mat6::Zero();
    D.topLeftCorner<3, 3>() = bond.area * Mat3::Identity();
    D.bottomRightCorner<3, 3>() = bond.second.trace() * Mat3::Identity() - bond.second;
    D /= gap(body, bond);
    const Mat6 Bi = at_arm(bond.centre - body.cells[bond.a].mass.centre), Bj = at_arm(bond.centre - body.cells[bond.b].mass.centre);
    diagonal[i] += Bi.transpose() * D * Bi;
    diagonal[j] += Bj.transpose() * D * Bj;
    const Mat6 off = -(Bi.transpose() * D * Bj);  // row i, column j
    for (int r = 0; r < 6; ++r)
      for (int c = 0; c < 6; ++c) {
        if (i > j) entries.emplace_back(6 * i + r, 6 * j + c, off(r, c));
        else entries.emplace_back(6 * j + c, 6 * i + r, off(r, c));
      }
  }
  // Loads in equilibrium leave six ways to float: the first cell is held, and nothing pulls at what holds it.
  diagonal[0] += Mat6(diagonal[0].diagonal().asDiagonal());
  for (std::size_t i = 0; i < n; ++i)
    for (int r = 0; r < 6; ++r)
      for (int c = 0; c <= r; ++c) entries.emplace_back(static_cast<int>(6 * i) + r, static_cast<int>(6 * i) + c, diagonal[i](r, c));
  const auto unknowns = static_cast<Eigen::Index>(6 * n);
  Eigen::SparseMatrix<Real> K(unknowns, unknowns);
  K.setFromTriplets(entries.begin(), entries.end());
  impl_->solver.compute(K);
}
BondSolver::~BondSolver() = default;
BondSolver::BondSolver(BondSolver&&) noexcept = default;
BondSolver& BondSolver::operator=(BondSolver&&) noexcept = default;

std::vector<BondStress> BondSolver::stresses(std::span<const Wrench> loads) const {
  ZONE("bodies.bonds.solve");
  const FracturedBody& body = impl_->body;
  CHECK_EQ(loads.size(), impl_->which.size());
  if (impl_->solver.info() != Eigen::Success) return {};
  Eigen::VectorXd f(static_cast<Eigen::Index>(6 * loads.size()));
  for (std::size_t i = 0; i < loads.size(); ++i) {
    f.segment<3>(static_cast<Eigen::Index>(6 * i)) = loads[i].force;
    f.segment<3>(static_cast<Eigen::Index>(6 * i + 3)) = loads[i].moment;
  }
  const Eigen::VectorXd u = impl_->solver.solve(f);
  if (!u.allFinite()) return {};

  std::vector<BondStress> out;
  for (const Index k : impl_->bonds) {
    const CellInterface& bond = body.interfaces[k];
    const Vec6 at_a = at_arm(bond.centre - body.cells[bond.a].mass.centre) * u.segment<6>(6 * impl_->place[bond.a]);
    const Vec6 at_b = at_arm(bond.centre - body.cells[bond.b].mass.centre) * u.segment<6>(6 * impl_->place[bond.b]);
    const Vec6 d = (at_b - at_a) / gap(body, bond);
    BondStress worst{k, -std::numeric_limits<Real>::infinity()};
    for (const Vec3& p : bond.rim) {
      const Vec3 t = d.head<3>() + Vec3(d.tail<3>()).cross(p - bond.centre);
      const Real s = t.dot(bond.normal), shear = (t - s * bond.normal).norm();
      worst.stress = std::max(worst.stress, s / 2 + std::sqrt(s * s / 4 + shear * shear));
    }
    out.push_back(worst);
  }
  return out;
}

std::vector<std::vector<Index>> break_bonds(const FracturedBody& body, std::span<const Index> which, Real density, const Vec3& spin, std::span<const Wrench> loads, Real strength, Real smallest,
                                            std::span<std::uint8_t> broken, std::optional<BondSolver>& whole) {
  CHECK_EQ(loads.size(), which.size());
  std::vector<Wrench> load_of(body.cells.size());
  for (std::size_t k = 0; k < which.size(); ++k) load_of[which[k]] = loads[k];
  std::vector<std::vector<Index>> open = {{which.begin(), which.end()}}, done;
  while (!open.empty()) {
    std::vector<Index> group = std::move(open.back());
    open.pop_back();
    Real volume = 0;
    for (const Index c : group) volume += body.cells[c].mass.volume;
    Real worst = 0;
    std::vector<BondStress> stresses;
    if (group.size() > 1 && volume >= smallest) {
      std::vector<Wrench> own;
      for (const Index c : group) own.push_back(load_of[c]);
      take_rigid_part(body, group, density, spin, own);
      if (group.size() == which.size()) {  // not yet apart
        if (!whole) whole.emplace(body, group, broken);
        stresses = whole->stresses(own);
      } else {
        stresses = BondSolver(body, group, broken).stresses(own);
      }
      for (const BondStress& s : stresses) worst = std::max(worst, s.stress);
    }
    if (!(worst > strength)) {
      done.push_back(std::move(group));
      continue;
    }
    whole.reset();
    const Real together = worst > kFast * strength ? std::min(kTogetherFast * worst, kFar * strength) : kTogether * worst;
    for (const BondStress& s : stresses)
      if (s.stress > strength && s.stress >= together) broken[s.bond] = 1;
    for (std::vector<Index>& part : bonded_groups(body, group, broken)) open.push_back(std::move(part));
  }
  std::sort(done.begin(), done.end(), [](const auto& a, const auto& b) { return a[0] < b[0]; });
  return done;
}

}  // namespace effuse::flow::bodies
