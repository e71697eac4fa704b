// The loops of PairKernels over lanes, without #pragma once on purpose: pair_kernels.cpp includes them once for each
// instruction set, inside a namespace that holds D8 (eight doubles), its arithmetic and
//
//   fill(double), root(D8), above_zero(D8) = max(., 0), where_positive(D8 test, D8 yes, D8 no)
//   load_packed(packed, j, x, y, z, stiffness)   of the eight particles j[0..7]
//   load_vectors(v, j, x, y, z)                  of an array of three doubles each
//   load_scalars(q, j)
//   sum(D8) = ((0+4)+(2+6))+((1+5)+(3+7))
//
// Nothing here may call a template: its instantiation could be kept for a processor that lacks the instructions.

/// Particle i, and eight others seen from it: separations over the support and their square.
struct One {
  D8 x, y, z, stiffness;
};
struct Eight {
  D8 dx, dy, dz, r2, stiffness;
};

INLINE One one(const View& s, std::size_t i) {
  const Packed& p = s.packed[i];
  return {fill(p.x), fill(p.y), fill(p.z), fill(p.stiffness)};
}

/// d of the nearest image: to add and take off 1.5 * 2^52 rounds to whole numbers.
INLINE D8 nearest(D8 d, double period) {
  const D8 big = fill(0x1.8p52);
  return d - fill(period) * ((d * fill(1 / period) + big) - big);
}

INLINE Eight apart(const View& s, const One& i, const Index* j) {
  __builtin_prefetch(j + 192);  // the lists are the one thing too long for the cache, and are met in pages: 20 % at 100 neighbours
  D8 x, y, z;
  Eight e;
  load_packed(s.packed, j, x, y, z, e.stiffness);
  e.dx = i.x - x;
  e.dy = i.y - y;
  e.dz = i.z - z;
  if (s.period_x > 0) e.dx = nearest(e.dx, s.period_x);
  if (s.period_y > 0) e.dy = nearest(e.dy, s.period_y);
  e.r2 = e.dx * e.dx + e.dy * e.dy + e.dz * e.dz;
  return e;
}

/// (dW/dr)/r in units of PairKernels::slope_, q = r / support.
INLINE D8 slope_over_r(KernelKind kind, D8 q) {
  const D8 p = above_zero(fill(1) - q);
  if (kind == KernelKind::kWendlandC2) return p * p * p;
  if (kind == KernelKind::kCubicSpline) return where_positive(q - fill(0.5), fill(-6) * p * p / q, fill(18) * q - fill(12));
  return where_positive(q, p * p / q, fill(0));
}

/// W / W(0).
INLINE D8 height(KernelKind kind, D8 q) {
  const D8 p = above_zero(fill(1) - q), p2 = p * p;
  if (kind == KernelKind::kWendlandC2) return p2 * p2 * (fill(1) + fill(4) * q);
  if (kind == KernelKind::kCubicSpline) return where_positive(q - fill(0.5), fill(2) * p2 * p, fill(1) - fill(6) * q * q * p);
  return p2 * p;
}

/// mu_ij w in units of PairKernels::stiffness_.
INLINE D8 stiffness_of(const Eight& e, const One& i) {
  const D8 p = fill(1) - e.r2;
  return p * p / (i.stiffness + e.stiffness);
}

INLINE void store_symmetric(double* m, double factor, D8 xx, D8 yy, D8 zz, D8 xy, D8 yz, D8 zx) {
  m[0] = factor * sum(xx);
  m[4] = factor * sum(yy);
  m[8] = factor * sum(zz);
  m[1] = m[3] = factor * sum(xy);
  m[5] = m[7] = factor * sum(yz);
  m[2] = m[6] = factor * sum(zx);
}

void density(const View& s, double factor, double slope_factor, std::size_t begin, std::size_t end, double* sum_out, double* slope_out, std::size_t origin) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    D8 W = fill(0), x = W, y = W, z = W;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      const D8 q = root(e.r2), f = slope_over_r(s.kernel, q);
      W = W + height(s.kernel, q);
      x = x + f * e.dx;
      y = y + f * e.dy;
      z = z + f * e.dz;
    }
    // Those that fill up the last group are i itself: each has added 1.
    sum_out[i] = factor * (sum(W) - (static_cast<double>(list.end - list.begin) - list.count));
    slope_out[3 * (i - origin)] = slope_factor * sum(x);
    slope_out[3 * (i - origin) + 1] = slope_factor * sum(y);
    slope_out[3 * (i - origin) + 2] = slope_factor * sum(z);
  }
}

void viscous(const View& s, double factor, std::size_t begin, std::size_t end, const double* v, double* out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    const D8 vx = fill(v[3 * i]), vy = fill(v[3 * i + 1]), vz = fill(v[3 * i + 2]);
    D8 x = fill(0), y = x, z = x;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      D8 ux, uy, uz;
      load_vectors(v, j, ux, uy, uz);
      const D8 pull = stiffness_of(e, me) * ((vx - ux) * e.dx + (vy - uy) * e.dy + (vz - uz) * e.dz);
      x = x + pull * e.dx;
      y = y + pull * e.dy;
      z = z + pull * e.dz;
    }
    out[3 * i] = factor * sum(x);
    out[3 * i + 1] = factor * sum(y);
    out[3 * i + 2] = factor * sum(z);
  }
}

void viscous_block(const View& s, double factor, std::size_t begin, std::size_t end, double* out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    D8 xx = fill(0), yy = xx, zz = xx, xy = xx, yz = xx, zx = xx;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      const D8 c = stiffness_of(e, me);
      const D8 cx = c * e.dx, cy = c * e.dy, cz = c * e.dz;
      xx = xx + cx * e.dx;
      yy = yy + cy * e.dy;
      zz = zz + cz * e.dz;
      xy = xy + cx * e.dy;
      yz = yz + cy * e.dz;
      zx = zx + cz * e.dx;
    }
    store_symmetric(out + 9 * (i - begin), factor, xx, yy, zz, xy, yz, zx);
  }
}

void divergence(const View& s, double factor, std::size_t begin, std::size_t end, const double* v, double* out, std::size_t origin) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    const D8 vx = fill(v[3 * i]), vy = fill(v[3 * i + 1]), vz = fill(v[3 * i + 2]);
    D8 total = fill(0);
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      D8 ux, uy, uz;
      load_vectors(v, j, ux, uy, uz);
      total = total + slope_over_r(s.kernel, root(e.r2)) * ((vx - ux) * e.dx + (vy - uy) * e.dy + (vz - uz) * e.dz);
    }
    out[i - origin] = factor * sum(total);
  }
}

void gradient(const View& s, double factor, std::size_t begin, std::size_t end, const double* q, double* out, std::size_t origin) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    const D8 own = fill(q[i]);
    D8 x = fill(0), y = x, z = x;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      const D8 f = slope_over_r(s.kernel, root(e.r2)) * (own + load_scalars(q, j));
      x = x + f * e.dx;
      y = y + f * e.dy;
      z = z + f * e.dz;
    }
    out[3 * (i - origin)] = factor * sum(x);
    out[3 * (i - origin) + 1] = factor * sum(y);
    out[3 * (i - origin) + 2] = factor * sum(z);
  }
}

void compliance(const View& s, double factor, std::size_t begin, std::size_t end, const double* weight, double* slope_out, double* squares_out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    D8 x = fill(0), y = x, z = x, squares = x;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      const D8 f = slope_over_r(s.kernel, root(e.r2));
      x = x + f * e.dx;
      y = y + f * e.dy;
      z = z + f * e.dz;
      squares = squares + load_scalars(weight, j) * (f * f * e.r2);
    }
    slope_out[3 * i] = factor * sum(x);
    slope_out[3 * i + 1] = factor * sum(y);
    slope_out[3 * i + 2] = factor * sum(z);
    squares_out[i] = factor * factor * sum(squares);
  }
}

void velocity_gradient(const View& s, double factor, double moment_factor, std::size_t begin, std::size_t end, const double* v, double* out, double* moment_out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    const D8 vx = fill(v[3 * i]), vy = fill(v[3 * i + 1]), vz = fill(v[3 * i + 2]);
    D8 g0 = fill(0), g1 = g0, g2 = g0, g3 = g0, g4 = g0, g5 = g0, g6 = g0, g7 = g0, g8 = g0;  // by columns
    D8 xx = g0, yy = g0, zz = g0, xy = g0, yz = g0, zx = g0;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      D8 ux, uy, uz;
      load_vectors(v, j, ux, uy, uz);
      ux = ux - vx;
      uy = uy - vy;
      uz = uz - vz;
      const D8 f = slope_over_r(s.kernel, root(e.r2)), fx = f * e.dx, fy = f * e.dy, fz = f * e.dz;
      g0 = g0 + ux * fx;
      g1 = g1 + uy * fx;
      g2 = g2 + uz * fx;
      g3 = g3 + ux * fy;
      g4 = g4 + uy * fy;
      g5 = g5 + uz * fy;
      g6 = g6 + ux * fz;
      g7 = g7 + uy * fz;
      g8 = g8 + uz * fz;
      xx = xx + fx * e.dx;
      yy = yy + fy * e.dy;
      zz = zz + fz * e.dz;
      xy = xy + fx * e.dy;
      yz = yz + fy * e.dz;
      zx = zx + fz * e.dx;
    }
    double* g = out + 9 * (i - begin);
    g[0] = factor * sum(g0);
    g[1] = factor * sum(g1);
    g[2] = factor * sum(g2);
    g[3] = factor * sum(g3);
    g[4] = factor * sum(g4);
    g[5] = factor * sum(g5);
    g[6] = factor * sum(g6);
    g[7] = factor * sum(g7);
    g[8] = factor * sum(g8);
    store_symmetric(moment_out + 9 * (i - begin), moment_factor, xx, yy, zz, xy, yz, zx);
  }
}

void friction_power(const View& s, double factor, std::size_t begin, std::size_t end, const double* v, double* out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const One me = one(s, i);
    const D8 vx = fill(v[3 * i]), vy = fill(v[3 * i + 1]), vz = fill(v[3 * i + 2]);
    D8 total = fill(0);
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      D8 ux, uy, uz;
      load_vectors(v, j, ux, uy, uz);
      const D8 pull = (vx - ux) * e.dx + (vy - uy) * e.dy + (vz - uz) * e.dz;
      total = total + stiffness_of(e, me) * (pull * pull);
    }
    out[i] = factor * sum(total);
  }
}

const PairKernels::Lanes kTable{density, viscous, viscous_block, friction_power, velocity_gradient, divergence, gradient, compliance};
