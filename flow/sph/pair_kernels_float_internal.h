// The loops of FloatPairs over lanes, without #pragma once on purpose: pair_kernels_float.cpp includes them once for each
// instruction set, inside a namespace that holds F8 (eight floats), its arithmetic and
//
//   fill(float), root(F8), above_zero(F8) = max(., 0), where_positive(F8 test, F8 yes, F8 no)
//   load_apart(one, packed, j, dx, dy, dz, q)    separations in units from the eight particles j[0..7], and their q
//   load_vectors(v, j, x, y, z)
//   sum(F8) = ((0+4)+(2+6))+((1+5)+(3+7))
//
// Nothing here may call a template: its instantiation could be kept for a processor that lacks the instructions.

struct Eight {
  F8 dx, dy, dz, r2, q;
};

INLINE Eight apart(const View& s, const Packed& i, const Index* j) {
  __builtin_prefetch(j + 192);  // the lists are longer than the cache
  Eight e;
  load_apart(i, s.packed, j, e.dx, e.dy, e.dz, e.q);
  e.dx = e.dx * fill(s.scale_x);
  e.dy = e.dy * fill(s.scale_y);
  e.dz = e.dz * fill(s.scale_z);
  e.r2 = e.dx * e.dx + e.dy * e.dy + e.dz * e.dz;
  return e;
}

/// (dW/dr)/r in units of PairKernels::slope_, q = r / support.
INLINE F8 slope_over_r(KernelKind kind, F8 q) {
  const F8 p = above_zero(fill(1) - q);
  if (kind == KernelKind::kWendlandC2) return p * p * p;
  if (kind == KernelKind::kCubicSpline) return where_positive(q - fill(0.5f), fill(-6) * p * p / q, fill(18) * q - fill(12));
  return where_positive(q, p * p / q, fill(0));
}

void gradient(const View& s, std::size_t begin, std::size_t end, Vector* out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const Packed me = s.packed[i];
    const F8 own = fill(me.q);
    F8 x = fill(0), y = x, z = x;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      const F8 f = slope_over_r(s.kernel, root(e.r2)) * (own + e.q);
      x = x + f * e.dx;
      y = y + f * e.dy;
      z = z + f * e.dz;
    }
    out[i] = {s.factor * sum(x), s.factor * sum(y), s.factor * sum(z), 0};
  }
}

void divergence(const View& s, std::size_t begin, std::size_t end, const Vector* v, float* out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const Packed me = s.packed[i];
    const F8 vx = fill(v[i].x), vy = fill(v[i].y), vz = fill(v[i].z);
    F8 total = fill(0);
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      F8 ux, uy, uz;
      load_vectors(v, j, ux, uy, uz);
      total = total + slope_over_r(s.kernel, root(e.r2)) * ((vx - ux) * e.dx + (vy - uy) * e.dy + (vz - uz) * e.dz);
    }
    out[i] = s.factor * sum(total);
  }
}

void compliance(const View& s, std::size_t begin, std::size_t end, Vector* slope_out, float* squares_out) {
  for (std::size_t i = begin; i < end; ++i) {
    const List list = list_of(s, i);
    const Packed me = s.packed[i];
    F8 x = fill(0), y = x, z = x, squares = x;
    for (const Index* j = list.begin; j < list.end; j += kLanes) {
      const Eight e = apart(s, me, j);
      const F8 f = slope_over_r(s.kernel, root(e.r2));
      x = x + f * e.dx;
      y = y + f * e.dy;
      z = z + f * e.dz;
      squares = squares + e.q * (f * f * e.r2);
    }
    slope_out[i] = {s.factor * sum(x), s.factor * sum(y), s.factor * sum(z), 0};
    squares_out[i] = s.factor * s.factor * sum(squares);
  }
}

const FloatPairs::Lanes kTable{gradient, divergence, compliance};
