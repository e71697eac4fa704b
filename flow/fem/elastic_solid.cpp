#include "flow/fem/elastic_solid.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::fem {

namespace {

constexpr std::size_t kGrain = 64;  // tetrahedra
constexpr std::array<std::array<std::size_t, 2>, 6> kPairs = {{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
/// Faces, counter-clockwise from outside, each opposite the corner of its number.
constexpr std::array<std::array<std::size_t, 3>, 4> kFaces = {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// The rotation nearest to F: of F = U S V^T it is U V^T, the least singular value's sign turned where that were a mirror.
Mat3 rotation_of(const Mat3& F) {
  const Eigen::JacobiSVD<Mat3> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 U = svd.matrixU();
  if (U.determinant() * svd.matrixV().determinant() < 0) U.col(2) = -U.col(2);
  return U * svd.matrixV().transpose();
}

}  // namespace

TetMesh box_of_tets(const Vec3& low, const Vec3& high, int nx, int ny, int nz) {
  CHECK_GE(nx, 1);
  CHECK_GE(ny, 1);
  CHECK_GE(nz, 1);
  TetMesh mesh;
  const auto node = [&](int i, int j, int k) { return static_cast<Index>((i * (ny + 1) + j) * (nz + 1) + k); };
  for (int i = 0; i <= nx; ++i)
    for (int j = 0; j <= ny; ++j)
      for (int k = 0; k <= nz; ++k)
        mesh.nodes.push_back(low + (high - low).cwiseProduct(Vec3(static_cast<Real>(i) / nx, static_cast<Real>(j) / ny, static_cast<Real>(k) / nz)));
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) {
        Index c[8];
        for (int q = 0; q < 8; ++q) c[q] = node(i + (q >> 2), j + (q >> 1 & 1), k + (q & 1));
        // One tetrahedron on every other corner, four on its faces; the other four corners in the cubes between.
        if ((i + j + k) % 2 == 0)
          mesh.tets.insert(mesh.tets.end(), {{c[0], c[4], c[2], c[1]}, {c[6], c[2], c[4], c[7]}, {c[5], c[7], c[4], c[1]}, {c[3], c[1], c[2], c[7]}, {c[1], c[4], c[2], c[7]}});
        else
          mesh.tets.insert(mesh.tets.end(), {{c[4], c[6], c[5], c[0]}, {c[2], c[3], c[6], c[0]}, {c[1], c[5], c[3], c[0]}, {c[7], c[5], c[6], c[3]}, {c[0], c[5], c[6], c[3]}});
      }
  // Orientation once and for all.
  for (std::array<Index, 4>& t : mesh.tets) {
    const Vec3& o = mesh.nodes[t[0]];
    if ((mesh.nodes[t[1]] - o).cross(mesh.nodes[t[2]] - o).dot(mesh.nodes[t[3]] - o) < 0) std::swap(t[2], t[3]);
  }
  return mesh;
}

ElasticSolid::ElasticSolid(const TetMesh& mesh, const ElasticMaterial& material) : material_(material), tets_(mesh.tets), rest_(mesh.nodes) {
  const auto wrong = [](const std::string& what) { throw InputError(Place{"solid"}, what); };
  if (!(material.youngs_modulus > 0)) wrong(fmt::format("Young's modulus {:g} Pa, wanted more than 0", material.youngs_modulus));
  if (!(material.poisson_ratio > -1 && material.poisson_ratio < 0.5)) wrong(fmt::format("Poisson's ratio {:g}, wanted between -1 and 0.5", material.poisson_ratio));
  if (!(material.density > 0)) wrong(fmt::format("a density of {:g} kg/m3, wanted more than 0", material.density));
  if (!(material.damping >= 0) || !(material.strength >= 0)) wrong("a damping or strength below 0");
  mu_ = material.youngs_modulus / (2 * (1 + material.poisson_ratio));
  lambda_ = material.youngs_modulus * material.poisson_ratio / ((1 + material.poisson_ratio) * (1 - 2 * material.poisson_ratio));
  for (std::size_t e = 0; e < tets_.size(); ++e) {
    for (const Index i : tets_[e])
      if (i >= rest_.size()) wrong(fmt::format("tetrahedron {} names node {}, there are {}", e, i, rest_.size()));
    Mat3 edges;
    for (std::size_t k = 0; k < 3; ++k) edges.col(static_cast<int>(k)) = rest_[tets_[e][k + 1]] - rest_[tets_[e][0]];
    Element element{edges.inverse(), edges.determinant() / 6, {}};
    if (!(element.volume > 0)) wrong(fmt::format("tetrahedron {} has the volume {:g} m3, wanted more than 0", e, element.volume));
    element.slope[0] = Vec3::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      element.slope[k + 1] = element.inverse.row(static_cast<int>(k)).transpose();
      element.slope[0] -= element.slope[k + 1];
    }
    elements_.push_back(element);
  }
  held_.assign(rest_.size(), 0);
  state_ = {rest_, std::vector<Vec3>(rest_.size(), Vec3::Zero())};
  measure();
}

ElasticSolid::~ElasticSolid() = default;
ElasticSolid::ElasticSolid(ElasticSolid&&) noexcept = default;

/// Masses; the pattern of the solve is made anew at the next step.
void ElasticSolid::measure() {
  mass_.assign(rest_.size(), 0);
  for (std::size_t e = 0; e < tets_.size(); ++e)
    for (const Index i : tets_[e]) mass_[i] += material_.density * elements_[e].volume / 4;
  for (std::size_t i = 0; i < mass_.size(); ++i)
    if (mass_[i] == 0) held_[i] = 1;  // a node without a tetrahedron stays where it is
  newton_.reset();
}

Mat3 ElasticSolid::gradient(std::size_t e, std::span<const Vec3> x) const {
  const std::array<Index, 4>& t = tets_[e];
  Mat3 edges;
  for (std::size_t k = 0; k < 3; ++k) edges.col(static_cast<int>(k)) = x[t[k + 1]] - x[t[0]];
  return edges * elements_[e].inverse;
}

Real ElasticSolid::elastic_energy(std::span<const Vec3> x) const {
  return parallel_sum(tets_.size(), 0.0, [&](std::size_t e) {
    const Mat3 F = gradient(e, x), R = rotation_of(F);
    const Real swelling = (R.transpose() * F).trace() - 3;
    return elements_[e].volume * (mu_ * (F - R).squaredNorm() + lambda_ / 2 * swelling * swelling);
  }, kGrain);
}

std::vector<Vec3> ElasticSolid::elastic_forces(std::span<const Vec3> x) const {
  std::vector<std::array<Vec3, 4>> parts(tets_.size());
  parallel_for(tets_.size(), [&](std::size_t e) {
    const Mat3 F = gradient(e, x), R = rotation_of(F), P = 2 * mu_ * (F - R) + lambda_ * ((R.transpose() * F).trace() - 3) * R;
    for (std::size_t a = 0; a < 4; ++a) parts[e][a] = -elements_[e].volume * P * elements_[e].slope[a];
  }, kGrain);
  std::vector<Vec3> forces(x.size(), Vec3::Zero());
  for (std::size_t e = 0; e < tets_.size(); ++e)
    for (std::size_t a = 0; a < 4; ++a) forces[tets_[e][a]] += parts[e][a];
  return forces;
}

/// The energy whose minimum is a step's end, with its derivatives.
class ElasticSolid::StepEnergy {
 public:
  StepEnergy(const ElasticSolid& solid, Real dt)
      : s_(solid), dt_(dt), start_(solid.state_.x), target_(solid.nodes()), turned_(solid.material_.damping > 0 ? solid.tets_.size() : 0), parts_(solid.tets_.size()), touch_(solid.contacts, solid.response, start_, solid.state_.v, dt) {
    for (std::size_t i = 0; i < target_.size(); ++i) {
      target_[i] = start_[i] + dt * s_.state_.v[i];
      if (!s_.held_[i]) target_[i] += dt * dt * (s_.load.empty() ? s_.gravity : Vec3(s_.gravity + s_.load[i] / s_.mass_[i]));
    }
    // The damping's stiffness is that of the elements as they are turned at the step's start.
    parallel_for(turned_.size(), [&](std::size_t e) { turned_[e] = rotation_of(s_.gradient(e, start_)); }, kGrain);
  }

  const std::vector<Vec3>& start() const { return start_; }
  /// Held nodes where they go, others where they are.
  std::vector<Vec3> first_guess() const {
    std::vector<Vec3> x(start_);
    for (std::size_t i = 0; i < x.size(); ++i)
      if (s_.held_[i]) x[i] = target_[i];
    return x;
  }

  Real value(const std::vector<Vec3>& at) const {
    Real sum = s_.elastic_energy(at) + touch_.value(at);
    sum += parallel_sum(at.size(), 0.0, [&](std::size_t i) { return s_.held_[i] ? 0.0 : s_.mass_[i] * (at[i] - target_[i]).squaredNorm() / (2 * dt_ * dt_); });
    if (!turned_.empty())
      sum += parallel_sum(turned_.size(), 0.0, [&](std::size_t e) {
        const Mat3 strain = turned_[e].transpose() * moved(e, at), s = (strain + strain.transpose()) / 2;
        return s_.material_.damping / dt_ * s_.elements_[e].volume * (s_.mu_ * s.squaredNorm() + s_.lambda_ / 2 * s.trace() * s.trace());
      }, kGrain);
    return sum;
  }

  void derivatives(const std::vector<Vec3>& at, BlockNewton::Sink& sink) {
    const auto& tets = s_.tets_;
    parallel_for(tets.size(), [&](std::size_t e) {
      const Mat3 F = s_.gradient(e, at), R = rotation_of(F), P = 2 * s_.mu_ * (F - R) + s_.lambda_ * ((R.transpose() * F).trace() - 3) * R;
      const Element& element = s_.elements_[e];
      for (std::size_t a = 0; a < 4; ++a) {
        parts_[e].gradient[a] = element.volume * P * element.slope[a];
        parts_[e].diagonal[a] = block(e, R, a, a);
      }
      for (std::size_t p = 0; p < 6; ++p) parts_[e].coupling[p] = block(e, R, kPairs[p][0], kPairs[p][1]);
      if (turned_.empty()) return;
      const Real c = s_.material_.damping / dt_;
      const Mat3 strain = turned_[e].transpose() * moved(e, at), stress = turned_[e] * (s_.mu_ * (strain + strain.transpose()) + s_.lambda_ * strain.trace() * Mat3::Identity());
      for (std::size_t a = 0; a < 4; ++a) {
        parts_[e].gradient[a] += c * element.volume * stress * element.slope[a];
        parts_[e].diagonal[a] += c * block(e, turned_[e], a, a);
      }
      for (std::size_t p = 0; p < 6; ++p) parts_[e].coupling[p] += c * block(e, turned_[e], kPairs[p][0], kPairs[p][1]);
    }, kGrain);
    const std::vector<std::uint8_t>& held = s_.held_;
    for (Index i = 0; i < at.size(); ++i) {
      if (held[i]) {
        sink.diagonal(i, Mat3::Identity());
        continue;
      }
      sink.gradient(i, s_.mass_[i] / (dt_ * dt_) * (at[i] - target_[i]));
      sink.diagonal(i, s_.mass_[i] / (dt_ * dt_) * Mat3::Identity());
    }
    for (std::size_t e = 0; e < tets.size(); ++e) {
      for (std::size_t a = 0; a < 4; ++a) {
        if (held[tets[e][a]]) continue;
        sink.gradient(tets[e][a], parts_[e].gradient[a]);
        sink.diagonal(tets[e][a], parts_[e].diagonal[a]);
      }
      for (std::size_t p = 0; p < 6; ++p)
        if (!held[tets[e][kPairs[p][0]]] && !held[tets[e][kPairs[p][1]]]) sink.coupling(6 * e + p, parts_[e].coupling[p]);
    }
    touch_.derivatives(at, held, sink);
  }

 private:
  struct Parts {
    std::array<Vec3, 4> gradient;
    std::array<Mat3, 4> diagonal;
    std::array<Mat3, 6> coupling;
  };
  /// Gradient of what has moved since the start: R^T times it, its symmetric part is what the turned element calls strain.
  Mat3 moved(std::size_t e, const std::vector<Vec3>& at) const {
    Mat3 H = Mat3::Zero();
    for (std::size_t a = 0; a < 4; ++a) H += (at[s_.tets_[e][a]] - start_[s_.tets_[e][a]]) * s_.elements_[e].slope[a].transpose();
    return H;
  }
  /// Of an element about its turned rest: block (a, b) = volume R (mu (g_a . g_b) I + mu g_b g_a^T + lambda g_a g_b^T) R^T.
  Mat3 block(std::size_t e, const Mat3& R, std::size_t a, std::size_t b) const {
    const Vec3 ga = R * s_.elements_[e].slope[a], gb = R * s_.elements_[e].slope[b];
    return s_.elements_[e].volume * (s_.mu_ * ga.dot(gb) * Mat3::Identity() + s_.mu_ * gb * ga.transpose() + s_.lambda_ * ga * gb.transpose());
  }

  const ElasticSolid& s_;
  Real dt_;
  std::vector<Vec3> start_, target_;
  std::vector<Mat3> turned_;
  std::vector<Parts> parts_;
  ContactEnergy touch_;
};

BlockNewton& ElasticSolid::newton() {
  if (!newton_) {
    std::vector<std::pair<Index, Index>> couplings;
    for (const std::array<Index, 4>& t : tets_)
      for (const auto& [a, b] : kPairs) couplings.emplace_back(t[a], t[b]);
    newton_ = std::make_unique<BlockNewton>(nodes(), couplings);
  }
  return *newton_;
}

StepReport ElasticSolid::step(Real dt) {
  ZONE("fem.step");
  CHECK_GT(dt, 0);
  if (!load.empty()) CHECK_EQ(load.size(), nodes());
  StepEnergy energy(*this, dt);
  std::vector<Vec3> x = energy.first_guess();
  const Real size = elements_.empty() ? 1 : std::cbrt(6 * rest_volume() / static_cast<Real>(elements_.size()));
  const BlockNewton::Report report = newton().minimise(
      x, [&](const std::vector<Vec3>& at) { return energy.value(at); }, [&](const std::vector<Vec3>& at, BlockNewton::Sink& sink) { energy.derivatives(at, sink); }, {100, 1e-8 * size});
  for (std::size_t i = 0; i < x.size(); ++i)
    if (!held_[i]) state_.v[i] = (x[i] - state_.x[i]) / dt;
  state_.x = std::move(x);
  StepReport outcome{report.iterations, report.converged, 0};
  if (material_.strength > 0) outcome.split = split();
  return outcome;
}

void ElasticSolid::predict(Real dt, std::vector<Vec3>& velocity, BlockMatrix& answer) {
  ZONE("fem.predict");
  CHECK_GT(dt, 0);
  StepEnergy energy(*this, dt);
  const std::vector<Vec3> from = energy.first_guess();
  const std::vector<Vec3> gradient = newton().linearise(from, [&](const std::vector<Vec3>& at, BlockNewton::Sink& sink) { energy.derivatives(at, sink); }, dt * dt, answer);
  // One move of Newton's method: -H^-1 g, with A = dt^2 H.
  velocity.resize(nodes());
  answer.solve(gradient, velocity);
  for (std::size_t i = 0; i < velocity.size(); ++i) velocity[i] = held_[i] ? state_.v[i] : Vec3((from[i] - energy.start()[i]) / dt - dt * velocity[i]);
}

std::vector<Mat3> ElasticSolid::stresses() const {
  std::vector<Mat3> sigma(tets_.size());
  parallel_for(tets_.size(), [&](std::size_t e) {
    const Mat3 F = gradient(e, state_.x), R = rotation_of(F), P = 2 * mu_ * (F - R) + lambda_ * ((R.transpose() * F).trace() - 3) * R;
    const Mat3 cauchy = P * F.transpose() / std::max(F.determinant(), 1e-3);
    sigma[e] = (cauchy + cauchy.transpose()) / 2;
  }, kGrain);
  return sigma;
}

std::size_t ElasticSolid::split() {
  const std::vector<Mat3> sigma = stresses();
  std::vector<Mat3> sum(nodes(), Mat3::Zero());
  std::vector<Real> volume(nodes(), 0);
  std::vector<std::vector<Index>> around(nodes());
  for (std::size_t e = 0; e < tets_.size(); ++e)
    for (const Index i : tets_[e]) {
      sum[i] += elements_[e].volume * sigma[e];
      volume[i] += elements_[e].volume;
      around[i].push_back(static_cast<Index>(e));
    }
  struct Crack {
    Real stress;
    Index node;
    Vec3 direction;
  };
  std::vector<Crack> cracks;
  for (Index i = 0; i < nodes(); ++i) {
    if (volume[i] == 0 || held_[i]) continue;
    const Eigen::SelfAdjointEigenSolver<Mat3> principal(sum[i] / volume[i]);
    if (principal.eigenvalues()[2] > material_.strength) cracks.push_back({principal.eigenvalues()[2], i, principal.eigenvectors().col(2)});
  }
  std::sort(cracks.begin(), cracks.end(), [](const Crack& a, const Crack& b) { return a.stress != b.stress ? a.stress > b.stress : a.node < b.node; });
  std::vector<std::uint8_t> touched(tets_.size(), 0);
  std::size_t count = 0;
  for (const Crack& crack : cracks) {
    if (std::any_of(around[crack.node].begin(), around[crack.node].end(), [&](Index e) { return touched[e] != 0; })) continue;
    std::vector<Index> beyond;
    for (const Index e : around[crack.node]) {
      Vec3 middle = Vec3::Zero();
      for (const Index i : tets_[e]) middle += state_.x[i] / 4;
      if (crack.direction.dot(middle - state_.x[crack.node]) > 0) beyond.push_back(e);
    }
    if (beyond.empty() || beyond.size() == around[crack.node].size()) continue;
    const auto born = static_cast<Index>(nodes());
    state_.x.push_back(Vec3(state_.x[crack.node]));
    state_.v.push_back(Vec3(state_.v[crack.node]));
    rest_.push_back(Vec3(rest_[crack.node]));
    held_.push_back(0);
    if (!load.empty()) load.push_back(Vec3::Zero());
    for (const Index e : beyond) std::replace(tets_[e].begin(), tets_[e].end(), crack.node, born);
    for (const Index e : around[crack.node]) touched[e] = 1;
    ++count;
  }
  if (count > 0) measure();
  return count;
}

Real ElasticSolid::volume() const {
  Real sum = 0;
  for (std::size_t e = 0; e < tets_.size(); ++e) sum += elements_[e].volume * gradient(e, state_.x).determinant();
  return sum;
}

Real ElasticSolid::rest_volume() const {
  Real sum = 0;
  for (const Element& e : elements_) sum += e.volume;
  return sum;
}

geometry::TriMesh ElasticSolid::surface() const {
  std::map<std::array<Index, 3>, std::pair<geometry::Triangle, int>> faces;
  for (const std::array<Index, 4>& t : tets_)
    for (const auto& f : kFaces) {
      const geometry::Triangle triangle = {t[f[0]], t[f[1]], t[f[2]]};
      std::array<Index, 3> key = triangle;
      std::sort(key.begin(), key.end());
      ++faces.try_emplace(key, triangle, 0).first->second.second;
    }
  geometry::TriMesh mesh;
  mesh.positions = state_.x;
  for (const auto& [key, face] : faces)
    if (face.second == 1) mesh.triangles.push_back(face.first);
  return mesh;
}

std::size_t ElasticSolid::memory() const {
  return tets_.capacity() * sizeof(tets_[0]) + elements_.capacity() * sizeof(Element) + nodes() * (3 * sizeof(Vec3) + sizeof(Real) + 1) + (newton_ ? newton_->memory() : 0);
}

void ElasticSolid::add_to(StateHash& hash) const {
  hash.add(std::span<const Vec3>(state_.x));
  hash.add(std::span<const Vec3>(state_.v));
  for (const std::array<Index, 4>& t : tets_) hash.add(std::span<const Index>(t));
}

void ElasticSolid::save(StateWriter& out) const {
  out.array("x", state_.x);
  out.array("v", state_.v);
  out.array("rest", rest_);
  out.array("held", held_);
  out.array("tets", tets_);
}

void ElasticSolid::load_state(StateReader& in) {
  std::vector<std::array<Index, 4>> tets;
  in.array("x", state_.x);
  in.array("v", state_.v);
  in.array("rest", rest_);
  in.array("held", held_);
  in.array("tets", tets);
  bool agree = tets.size() == tets_.size() && state_.v.size() == state_.x.size() && rest_.size() == state_.x.size() && held_.size() == state_.x.size();
  for (const std::array<Index, 4>& t : tets)
    for (const Index i : t) agree = agree && i < state_.x.size();
  if (!agree) throw InputError(Place{"solid"}, "the checkpoint's nodes and tetrahedra are not those of this solid");
  tets_ = std::move(tets);
  measure();
}

}  // namespace effuse::flow::fem
