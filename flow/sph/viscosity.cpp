#include "flow/sph/viscosity.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "flow/sph/pair_kernels.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {

constexpr std::size_t kGrain = 256;    // particles a thread takes at a time
constexpr Real kNearest = 0.25;        // of the spacing: nearer walls drag no harder

/// Drag of one wall on v - wall.velocity, divided by -nu: (t, n) coefficients along the wall and across it.
struct WallDrag {
  Real along, across;
};
WallDrag wall_drag(const BoundaryTable& table, const Wall& wall, Real slip_length, Real spacing) {
  const Real d = std::max(wall.distance, kNearest * spacing);
  const BoundaryTable::Row row = table.at(d);
  return {wall.share * wall.friction * row.drag_t / (d + slip_length), wall.share * row.drag_n / d};
}

/// The walls' drag on i at velocity v [N/m^3].
Vec3 walls_drag(const ParticleSystem& s, Real mu, Real slip_length, const Vec3& v, std::size_t i) {
  Vec3 sum = Vec3::Zero();
  for (const Wall& wall : (*s.walls)[i]) {
    const WallDrag drag = wall_drag(*s.boundary, wall, slip_length, s.spacing);
    const Vec3 dv = v - s.velocity_of(wall);
    const Vec3 across = dv.dot(wall.normal) * wall.normal;
    sum += mu * (drag.along * (dv - across) + drag.across * across);
  }
  return sum;
}

}  // namespace

Real wall_dissipation(const ParticleSystem& s, Real mu, Real slip_length, const Vec3& v, std::size_t i) {
  Real sum = 0;
  for (const Wall& wall : (*s.walls)[i]) {
    const WallDrag drag = wall_drag(*s.boundary, wall, slip_length, s.spacing);
    const Vec3 dv = v - s.velocity_of(wall);
    const Real across = dv.dot(wall.normal);
    sum += mu * (drag.along * (dv.squaredNorm() - across * across) + drag.across * across * across);
  }
  return sum;
}

void viscous_acceleration(const ParticleSystem& s, Real density, std::span<const Real> mu, Real slip_length, std::span<const Vec3> v, std::span<Vec3> out) {
  CHECK_EQ(mu.size(), s.size());
  CHECK_EQ(v.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  pairs->set_viscosity(mu);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs->viscous(begin, end, v, out);
    for (std::size_t i = begin; i < end; ++i) out[i] = -(out[i] + walls_drag(s, mu[i], slip_length, v[i], i)) / density;
  });
}

namespace {
/// cross_matrix(a) b = a x b.
Mat3 cross_matrix(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}
}  // namespace

ViscositySolver::Factor::Factor(const Mat3& m) {
  // m = L L^T, inverted on the way: L^-1 = [a 0 0; b c 0; d e f].
  const Real l00 = std::sqrt(m(0, 0)), l10 = m(1, 0) / l00, l20 = m(2, 0) / l00;
  const Real l11 = std::sqrt(m(1, 1) - l10 * l10), l21 = (m(2, 1) - l20 * l10) / l11;
  const Real l22 = std::sqrt(m(2, 2) - l20 * l20 - l21 * l21);
  const Real b_ = -l10 / (l00 * l11), e_ = -l21 / (l11 * l22);
  a = static_cast<float>(1 / l00);
  b = static_cast<float>(b_);
  c = static_cast<float>(1 / l11);
  d = static_cast<float>(-(l20 / l00 + l21 * b_) / l22);
  e = static_cast<float>(e_);
  f = static_cast<float>(1 / l22);
}

Vec3 ViscositySolver::Factor::solve(const Vec3& r) const {
  const Real y0 = a * r.x(), y1 = b * r.x() + c * r.y(), y2 = d * r.x() + e * r.y() + f * r.z();
  return {a * y0 + b * y1 + d * y2, c * y1 + e * y2, f * y2};
}

ViscosityResult ViscositySolver::solve(const ParticleSystem& s, Real density, std::span<const Real> mu, Real slip_length, Real dt, std::span<const Vec3> v0, Real tolerance,
                                       int max_iterations, std::span<Vec3> v, Real scale) {
  ZONE("sph.viscosity");
  const std::size_t n = s.size();
  CHECK_EQ(mu.size(), n);
  CHECK_EQ(v0.size(), n);
  CHECK_EQ(v.size(), n);
  r_.resize(n);
  p_.resize(n);
  Ap_.resize(n);
  inverse_.resize(n);
  drag_.resize(s.walls->walls.size());
  const PairsOf pairs(s);
  pairs->set_viscosity(mu);
  const Real factor = dt / density;
  ViscosityResult result;

  // Bodies: six velocities each, after the particles'. Their rows, divided by a particle's mass:
  //   B V + sum_walls J^T D (J V - v_i) = B V0,   B their mass and inertia, J V the velocity of a wall's place.
  const std::size_t bodies = s.movable.size();
  const Real per_mass = s.any_gives_way() ? 1 / (s.density * s.volume()) : 0;
  body_.resize(bodies);
  for (std::size_t b = 0; b < bodies; ++b) {
    const Movable& m = s.movable[b];
    Body& body = body_[b];
    body.matrix.setZero();
    body.matrix.topLeftCorner<3, 3>() = per_mass / m.inverse_mass * Mat3::Identity();
    body.matrix.bottomRightCorner<3, 3>() = per_mass * m.inverse_inertia.inverse();
    body.v << m.velocity, m.spin;
    body.r = body.matrix * body.v;
    body.block = body.matrix;
  }
  grips_.clear();
  soft_grips_.clear();
  for (Index i = 0; i < n && s.any_gives_way(); ++i)
    for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k)
      if (gives_way(s.walls->walls[k])) (deforms(s.walls->walls[k]) ? soft_grips_ : grips_).push_back({i, k});
  // f(matrix of the wall's drag, its arm, body, particle) for all walls of bodies.
  const auto for_each_grip = [&](auto&& f) {
    for (const Grip& grip : grips_) {
      const Wall& wall = s.walls->walls[grip.wall];
      const Mat3 across = wall.normal * wall.normal.transpose();
      f(Mat3(drag_[grip.wall].along * (Mat3::Identity() - across) + drag_[grip.wall].across * across), wall.arm, body_[wall.movable], grip.particle);
    }
  };

  // Solids that deform: their points' velocities, with the matrix of their own step over a particle's mass in place of B.
  soft_.resize(s.pressed.size());
  const auto drag_of = [&](const Grip& grip) {
    const Vec3& normal = s.walls->walls[grip.wall].normal;
    const Mat3 across = normal * normal.transpose();
    return Mat3(drag_[grip.wall].along * (Mat3::Identity() - across) + drag_[grip.wall].across * across);
  };
  const auto for_each_soft = [&](auto&& f) {
    for (std::size_t b = 0; b < soft_.size(); ++b)
      if (s.pressed[b].near) f(soft_[b], s.pressed[b]);
  };
  const auto leave_held = [](const Pressed& solid, std::span<Vec3> of_points) {
    const std::span<const std::uint8_t> held = solid.solid->held();
    for (std::size_t i = 0; i < held.size(); ++i)
      if (held[i]) of_points[i].setZero();
  };
  const auto dot = [](std::span<const Vec3> a, std::span<const Vec3> b) {
    Real sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
    return sum;
  };
  // Points that are held drag by what they go, which is known: in v and the first residual only.
  for_each_soft([&](Soft& soft, const Pressed& solid) {
    soft.matrix.assign(solid.answer, per_mass);
    soft.v = solid.velocity;
    soft.p = soft.v;
    leave_held(solid, soft.p);
    soft.r.resize(soft.v.size());
    soft.matrix.multiply(soft.p, soft.r);
    leave_held(solid, soft.r);
    soft.Ap.resize(soft.v.size());
    soft.z.resize(soft.v.size());
  });

  // f(begin, end) returns a range's share of two sums.
  partial_.resize((n + kGrain - 1) / kGrain);
  const auto sum_of = [&](auto&& f) {
    parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) { partial_[begin / kGrain] = f(begin, end); });
    Sums sum;
    for (const Sums& part : partial_) sum += part;
    return sum;
  };

  // Diagonal blocks, and the right-hand side: what moving walls drag along is known. The norm of the right-hand side
  // counts; of fixed particles nothing is asked.
  Sums b2 = sum_of([&](std::size_t begin, std::size_t end) {
    std::array<Mat3, kGrain> block;
    pairs->viscous_block(begin, end, std::span(block).first(end - begin));
    Sums sum;
    for (std::size_t i = begin; i < end; ++i) {
      Mat3 m = Mat3::Identity() + factor * block[i - begin];
      Vec3 b = v0[i];
      for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) {
        const Wall& wall = s.walls->walls[k];
        const WallDrag drag = wall_drag(*s.boundary, wall, slip_length, s.spacing);
        drag_[k] = {factor * mu[i] * drag.along, factor * mu[i] * drag.across};
        const Mat3 across = wall.normal * wall.normal.transpose();
        const Mat3 matrix = drag_[k].along * (Mat3::Identity() - across) + drag_[k].across * across;
        m += matrix;
        if (!gives_way(wall)) b += matrix * wall.velocity;
      }
      inverse_[i] = Factor(m);
      r_[i] = b;
      if (!s.is_fixed(i)) sum += {b.dot(inverse_[i].solve(b)), b.squaredNorm()};
    }
    return sum;
  });

  for_each_grip([&](const Mat3& D, const Vec3& arm, Body& body, Index) {
    const Mat3 turn = cross_matrix(arm);  // J = [1, -turn]
    body.block.topLeftCorner<3, 3>() += D;
    body.block.topRightCorner<3, 3>() -= D * turn;
    body.block.bottomLeftCorner<3, 3>() += turn * D;
    body.block.bottomRightCorner<3, 3>() -= turn * D * turn;
  });
  for (Body& body : body_) {
    body.inverse = body.block.inverse();
    b2 += {body.r.dot(body.inverse * body.r), body.r.head<3>().squaredNorm()};
  }

  for_each_soft([&](Soft& soft, const Pressed& solid) {
    soft.block.assign(soft.matrix, 1);
    const HungSurface& surface = solid.solid->surface();
    std::vector<Mat3> lumped(surface.size(), Mat3::Zero());
    for (const Grip& grip : soft_grips_) {
      const Wall& wall = s.walls->walls[grip.wall];
      if (&s.pressed[wall.movable] != &solid) continue;
      for (std::size_t k = 0; k < 3; ++k) lumped[solid.triangles[wall.triangle][k]] += std::abs(wall.arm[static_cast<int>(k)]) * drag_of(grip);
    }
    for (std::size_t q = 0; q < lumped.size(); ++q) {
      if (lumped[q].isZero(0)) continue;
      for (Index k = surface.first[q]; k < surface.first[q + 1]; ++k) soft.block.add_diagonal(surface.point[k], std::abs(surface.weight[k]) * lumped[q]);
    }
    soft.block.factor();
    soft.block.solve(soft.r, soft.z);
    b2 += {dot(soft.r, soft.z), dot(soft.r, soft.r)};
  });

  // out = A in; returns in . out. Of bodies: from Body::*from to Body::Ap, of solids likewise.
  const auto multiply = [&](std::span<const Vec3> in, std::span<Vec3> out, Vec6 Body::*from, std::vector<Vec3> Soft::*of_soft) {
    Sums of_bodies;
    for_each_soft([&](Soft& soft, const Pressed& solid) {
      solid.solid->surface().gather(soft.*of_soft, soft.vertices);
      soft.pulls.assign(soft.vertices.size(), Vec3::Zero());
      soft.z = soft.*of_soft;
      leave_held(solid, soft.z);
      soft.matrix.multiply(soft.z, soft.Ap);
    });
    for (const Grip& grip : soft_grips_) {
      const Wall& wall = s.walls->walls[grip.wall];
      const Pressed& solid = s.pressed[wall.movable];
      Soft& soft = soft_[wall.movable];
      solid.share(wall, drag_of(grip) * (solid.at(wall, soft.vertices) - in[grip.particle]), soft.pulls);
    }
    for_each_soft([&](Soft& soft, const Pressed& solid) {
      solid.solid->surface().scatter(soft.pulls, soft.Ap);
      leave_held(solid, soft.Ap);
      of_bodies.preconditioned += dot(soft.*of_soft, soft.Ap);
    });
    for (Body& body : body_) body.Ap = body.matrix * (body.*from);
    for_each_grip([&](const Mat3& D, const Vec3& arm, Body& body, Index i) {
      const Vec6& V = body.*from;
      const Vec3 pull = D * (V.head<3>() + V.tail<3>().cross(arm) - in[i]);
      body.Ap.head<3>() += pull;
      body.Ap.tail<3>() += arm.cross(pull);
    });
    for (const Body& body : body_) of_bodies.preconditioned += (body.*from).dot(body.Ap);
    Sums all = sum_of([&](std::size_t begin, std::size_t end) {
      pairs->viscous(begin, end, in, out);
      Sums sum;
      for (std::size_t i = begin; i < end; ++i) {
        if (s.is_fixed(i)) {
          out[i].setZero();
          continue;
        }
        Vec3 a = in[i] + factor * out[i];
        for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) {
          const Wall& wall = s.walls->walls[k];
          Vec3 slip = in[i];
          if (deforms(wall)) {
            slip -= s.pressed[wall.movable].at(wall, soft_[wall.movable].vertices);
          } else if (gives_way(wall)) {
            const Vec6& V = body_[wall.movable].*from;
            slip -= V.head<3>() + V.tail<3>().cross(wall.arm);
          }
          const Vec3 across = slip.dot(wall.normal) * wall.normal;
          a += drag_[k].along * (slip - across) + drag_[k].across * across;
        }
        out[i] = a;
        sum += {in[i].dot(a), 0};
      }
      return sum;
    });
    return all += of_bodies;
  };

  multiply(v, Ap_, &Body::v, &Soft::v);
  Sums rr = sum_of([&](std::size_t begin, std::size_t end) {
    Sums sum;
    for (std::size_t i = begin; i < end; ++i) {
      r_[i] = s.is_fixed(i) ? Vec3(Vec3::Zero()) : Vec3(r_[i] - Ap_[i]);
      p_[i] = inverse_[i].solve(r_[i]);
      sum += {r_[i].dot(p_[i]), r_[i].squaredNorm()};
    }
    return sum;
  });
  for (Body& body : body_) {
    body.r -= body.Ap;
    body.p = body.inverse * body.r;
    rr += {body.r.dot(body.p), body.r.head<3>().squaredNorm()};
  }
  for_each_soft([&](Soft& soft, const Pressed&) {
    for (std::size_t i = 0; i < soft.r.size(); ++i) soft.r[i] -= soft.Ap[i];
    soft.block.solve(soft.r, soft.p);
    rr += {dot(soft.r, soft.p), dot(soft.r, soft.r)};
  });
  // Where fixed particles alone drive the others, they are in the first residual only.
  if (b2.plain == 0) b2 = rr;
  const Real most = scale * scale * static_cast<Real>(n);
  if (b2.plain > most) b2 = {b2.preconditioned * most / b2.plain, most};
  const Real goal = tolerance * tolerance;
  const auto reached = [&] { return rr.preconditioned <= goal * b2.preconditioned && rr.plain <= goal * b2.plain; };
  while (!reached() && result.iterations < max_iterations) {
    const Real pAp = multiply(p_, Ap_, &Body::p, &Soft::p).preconditioned;
    if (!(pAp > 0)) break;  // not a number, or rounding has the last word
    const Real alpha = rr.preconditioned / pAp;
    Sums next = sum_of([&](std::size_t begin, std::size_t end) {
      Sums sum;
      for (std::size_t i = begin; i < end; ++i) {
        v[i] += alpha * p_[i];
        r_[i] -= alpha * Ap_[i];
        Ap_[i] = inverse_[i].solve(r_[i]);  // kept where A p is no longer needed
        sum += {r_[i].dot(Ap_[i]), r_[i].squaredNorm()};
      }
      return sum;
    });
    for (Body& body : body_) {
      body.v += alpha * body.p;
      body.r -= alpha * body.Ap;
      next += {body.r.dot(body.inverse * body.r), body.r.head<3>().squaredNorm()};
    }
    for_each_soft([&](Soft& soft, const Pressed&) {
      for (std::size_t i = 0; i < soft.r.size(); ++i) {
        soft.v[i] += alpha * soft.p[i];
        soft.r[i] -= alpha * soft.Ap[i];
      }
      soft.block.solve(soft.r, soft.z);
      next += {dot(soft.r, soft.z), dot(soft.r, soft.r)};
    });
    const Real beta = next.preconditioned / rr.preconditioned;
    rr = next;
    parallel_for(n, [&](std::size_t i) { p_[i] = Ap_[i] + beta * p_[i]; }, 2048);
    for (Body& body : body_) body.p = body.inverse * body.r + beta * body.p;
    for_each_soft([&](Soft& soft, const Pressed&) {
      for (std::size_t i = 0; i < soft.p.size(); ++i) soft.p[i] = soft.z[i] + beta * soft.p[i];
    });
    ++result.iterations;
  }
  // Beside what gives way, the momentum that went astray, the sum of r, is given back by a step along that direction, the same for all:
  // where nothing is held, A leaves such a step as it is, and the sum is then zero to rounding.
  bool beside = bodies > 0;
  for_each_soft([&](Soft&, const Pressed&) { beside = true; });
  Vec3 astray = Vec3::Zero();
  for (Index i = 0; i < n && beside; ++i) astray += r_[i];
  for (const Body& body : body_) astray += body.r.head<3>();
  for_each_soft([&](Soft& soft, const Pressed&) {
    for (const Vec3& r : soft.r) astray += r;
  });
  if (astray.squaredNorm() > 0) {
    parallel_for(n, [&](std::size_t i) { p_[i] = s.is_fixed(i) ? Vec3(Vec3::Zero()) : astray; }, 2048);
    for (Body& body : body_) body.p << astray, Vec3::Zero();
    for_each_soft([&](Soft& soft, const Pressed& solid) {
      std::fill(soft.p.begin(), soft.p.end(), astray);
      leave_held(solid, soft.p);
    });
    if (const Real pAp = multiply(p_, Ap_, &Body::p, &Soft::p).preconditioned; pAp > 0) {
      const Real alpha = astray.squaredNorm() / pAp;
      parallel_for(n, [&](std::size_t i) { v[i] += alpha * p_[i]; }, 2048);
      for (Body& body : body_) body.v += alpha * body.p;
      for_each_soft([&](Soft& soft, const Pressed&) {
        for (std::size_t i = 0; i < soft.v.size(); ++i) soft.v[i] += alpha * soft.p[i];
      });
    }
  }
  for (std::size_t b = 0; b < bodies; ++b) {
    s.movable[b].velocity = body_[b].v.head<3>();
    s.movable[b].spin = body_[b].v.tail<3>();
  }
  for (std::size_t b = 0; b < soft_.size(); ++b) {
    Pressed& solid = s.pressed[b];
    if (!solid.near) continue;
    solid.velocity = soft_[b].v;
    solid.solid->surface().gather(solid.velocity, solid.vertices);
  }
  result.residual = b2.plain > 0 ? std::sqrt(std::max(rr.preconditioned / b2.preconditioned, rr.plain / b2.plain)) : 0;
  result.converged = reached();
  COUNT("sph.viscosity iterations", result.iterations);
  return result;
}

std::size_t ViscositySolver::memory() const {
  return (r_.capacity() + p_.capacity() + Ap_.capacity()) * sizeof(Vec3) + inverse_.capacity() * sizeof(Factor) + drag_.capacity() * sizeof(Drag) +
         partial_.capacity() * sizeof(Sums);
}

}  // namespace effuse::flow::sph
