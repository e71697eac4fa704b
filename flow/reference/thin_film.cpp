#include "flow/reference/thin_film.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow::reference {
namespace {

// Where the fluid ends, in cells: depths h(0), h(1), ... outwards, cell k centred at k, the last one with fluid in it partly filled. At a
// moving front h^3 falls linearly to 0, so the line through the two cells behind the last one finds it to second order; never more than
// half a cell beyond the last one's borders, since the line means nothing where the depth is level.
template <class Depth>
Real edge(std::ptrdiff_t cells, Real wet, const Depth& h) {
  std::ptrdiff_t last = cells - 1;
  while (last >= 0 && h(last) < wet) --last;
  if (last < 0) return 0;
  const auto at = static_cast<Real>(last);
  if (last < 2) return at + 0.5;
  const Real a = std::pow(h(last - 2), 3), b = std::pow(h(last - 1), 3);
  return a > b ? std::clamp(at - 1 + b / (a - b), at - 1, at + 1) : at + 0.5;
}

// A dam break in progress: cell i is h[i] deep, centre (i + 1/2) dx.
class DamBreakSolver {
 public:
  DamBreakSolver(const DamBreak& dam, const DamBreakOptions& options) : dx_(options.cell), rate_(kGravity / (3 * dam.nu) / (4 * dx_ * dx_)) {
    const auto n = static_cast<std::size_t>(std::lround(options.domain / dx_));
    h_.assign(n, 0);
    for (std::size_t i = 0; i < n; ++i) {
      const Real covered = std::clamp<Real>(dam.length / dx_ - static_cast<Real>(i), 0, 1);
      h_[i] = dam.depth * covered;
    }
  }

  // Backward Euler:  h - h_old = dt rate (h_(i-1)^4 - 2 h_i^4 + h_(i+1)^4), mirrored at both ends; Newton's iteration.
  void step(Real dt) {
    const std::size_t n = h_.size();
    const std::vector<Real> old = h_;
    const Real c = dt * rate_;
    lower_.resize(n), diagonal_.resize(n), upper_.resize(n), right_.resize(n);
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
      Real change = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const Real h = h_[i], h3 = h * h * h;
        const Real left = i > 0 ? h_[i - 1] : h, right = i + 1 < n ? h_[i + 1] : h;
        const Real left3 = left * left * left, right3 = right * right * right;
        right_[i] = old[i] - h + c * (left3 * left - 2 * h3 * h + right3 * right);
        lower_[i] = i > 0 ? -4 * c * left3 : 0;
        upper_[i] = i + 1 < n ? -4 * c * right3 : 0;
        diagonal_[i] = 1 + 4 * c * h3 * ((i > 0) + (i + 1 < n));
      }
      solve_tridiagonal();
      for (std::size_t i = 0; i < n; ++i) {
        h_[i] += right_[i];
        change = std::max(change, std::abs(right_[i]));
      }
      if (change < kConverged * h_[0]) return;
    }
    CHECK(!"Newton's iteration converges for the steps the options choose");
  }

  DamBreakState state(Real time, Real wet) const {
    DamBreakState s;
    s.time = time;
    s.h = h_;
    s.x.resize(h_.size());
    for (std::size_t i = 0; i < h_.size(); ++i) s.x[i] = (static_cast<Real>(i) + 0.5) * dx_;
    s.wall_depth = h_[0];
    CHECK_LT(h_.back(), wet);
    s.front = (0.5 + edge(static_cast<std::ptrdiff_t>(h_.size()), wet, [this](std::ptrdiff_t i) { return h_[static_cast<std::size_t>(i)]; })) * dx_;
    return s;
  }

 private:
  static constexpr int kMostIterations = 60;
  static constexpr Real kConverged = 1e-11;  // of the largest depth

  // Thomas's algorithm; the matrix is diagonally dominant by columns. The solution replaces right_.
  void solve_tridiagonal() {
    const std::size_t n = right_.size();
    for (std::size_t i = 1; i < n; ++i) {
      const Real w = lower_[i] / diagonal_[i - 1];
      diagonal_[i] -= w * upper_[i - 1];
      right_[i] -= w * right_[i - 1];
    }
    right_[n - 1] /= diagonal_[n - 1];
    for (std::size_t i = n - 1; i-- > 0;) right_[i] = (right_[i] - upper_[i] * right_[i + 1]) / diagonal_[i];
  }

  Real dx_, rate_;
  std::vector<Real> h_, lower_, diagonal_, upper_, right_;
};

// A source on a slope in progress. Cells of the half-plane y > 0, row by row along x; those outside are dry.
class InclineSolver {
 public:
  InclineSolver(const InclineSource& source, const InclineOptions& options)
      : source_(source), dx_(options.cell), wet_(options.wet), b_(kGravity * std::cos(source.slope) / (3 * source.nu)), tan_(std::tan(source.slope)) {
    grow();
  }

  Real stable_step() const {
    // Explicit diffusion with diffusivity B h^3 in two dimensions, below its limit of a quarter; advection is slower wherever cells are
    // wider than 3 h tan(theta). The source's own filling of dry ground counts.
    const Real filling = source_.source_radius / 20, rate = source_.flux / (kPi * source_.source_radius * source_.source_radius);
    const Real h = *std::max_element(h_.begin(), h_.end()) + filling, diffusivity = b_ * h * h * h;
    return std::min({0.2 * dx_ * dx_ / diffusivity, 0.2 * dx_ / (3 * b_ * tan_ * h * h), filling / rate});
  }

  void step(Real dt) {
    const auto n = static_cast<std::size_t>(columns_);
    std::copy(inflow_.begin(), inflow_.end(), change_.begin());
    for (std::size_t row = 0; row < h_.size(); row += n) {
      downhill_.back() = 0;
      for (std::size_t i = 0; i + 1 < n; ++i) downhill_[i] = exchange(h_[row + i], h_[row + i + 1], tan_);
      change_[row] -= downhill_[0];
      for (std::size_t i = 1; i < n; ++i) change_[row + i] += downhill_[i - 1] - downhill_[i];
      if (row + n == h_.size()) break;
      for (std::size_t i = 0; i < n; ++i) {
        const Real q = exchange(h_[row + i], h_[row + n + i], 0);
        change_[row + i] -= q;
        change_[row + n + i] += q;
      }
    }
    for (std::size_t c = 0; c < h_.size(); ++c) h_[c] += dt * change_[c];
    if (near_the_border()) grow();
  }

  InclineState state(Real time) const {
    InclineState s;
    s.time = time;
    for (Real h : h_) s.volume += 2 * h * dx_ * dx_;
    std::vector<Vec2> upper;
    for (std::ptrdiff_t i = 0; i < columns_; ++i) {
      const Real y = border_of_column(i);
      if (y > 0) upper.push_back(Vec2(x_of(i), y));
      s.half_width = std::max(s.half_width, y);
    }
    s.front = border_of_row(1);
    s.back = border_of_row(-1);
    s.outline.push_back(Vec2(s.back, 0));
    s.outline.insert(s.outline.end(), upper.begin(), upper.end());
    s.outline.push_back(Vec2(s.front, 0));
    return s;
  }

 private:
  std::size_t at(std::ptrdiff_t i, std::ptrdiff_t j) const { return static_cast<std::size_t>(j * columns_ + i); }
  Real x_of(std::ptrdiff_t i) const { return static_cast<Real>(i + first_) * dx_; }
  Real y_of(std::ptrdiff_t j) const { return (static_cast<Real>(j) + 0.5) * dx_; }

  // What flows from a cell to its neighbour, as a change of depth a second:  B m (tan - (h_r - h_l) / dx) / dx,
  // m = (h_l^4 - h_r^4) / (4 (h_l - h_r)), held back where the fluid comes from a cell much shallower than the other.
  Real exchange(Real hl, Real hr, Real tan) const {
    const Real slope = tan - (hr - hl) / dx_;
    const Real from = slope > 0 ? hl : hr;
    const Real mobility = std::min((hl * hl + hr * hr) * (hl + hr) / 4, 4 * from * from * from);
    return b_ * mobility * slope / dx_;
  }

  // Room of at least a quarter of the flow's length around it.
  void grow() {
    const std::ptrdiff_t pad = std::max<std::ptrdiff_t>(8, std::max(columns_, rows_) / 4);
    const std::ptrdiff_t back = columns_ ? kMargin : pad, columns = columns_ + pad + back, rows = rows_ + pad, first = columns_ ? first_ - back : -pad;
    std::vector<Real> h(static_cast<std::size_t>(columns * rows), 0);
    for (std::ptrdiff_t j = 0; j < rows_; ++j)
      for (std::ptrdiff_t i = 0; i < columns_; ++i) h[static_cast<std::size_t>(j * columns + i + back)] = h_[at(i, j)];
    h_ = std::move(h);
    columns_ = columns;
    rows_ = rows;
    first_ = first;
    change_.resize(h_.size());
    downhill_.resize(static_cast<std::size_t>(columns));
    place_source();
  }

  void place_source() {
    // The disc's share of each cell by 16 x 16 points, scaled so that the half-plane receives Q / 2.
    inflow_.assign(h_.size(), 0);
    Real sum = 0;
    for (std::ptrdiff_t j = 0; j < rows_; ++j)
      for (std::ptrdiff_t i = 0; i < columns_; ++i)
        for (int a = 0; a < 256; ++a) {
          const Real x = x_of(i) + ((a % 16 + 0.5) / 16 - 0.5) * dx_, y = y_of(j) + ((a / 16 + 0.5) / 16 - 0.5) * dx_;
          if (x * x + y * y > source_.source_radius * source_.source_radius) continue;
          inflow_[at(i, j)] += 1;
          sum += 1;
        }
    CHECK_GT(sum, 0);
    for (Real& q : inflow_) q *= source_.flux / 2 / (sum * dx_ * dx_);
  }

  bool near_the_border() const {
    for (std::ptrdiff_t j = 0; j < rows_; ++j)
      for (std::ptrdiff_t k = 0; k < kMargin / 2; ++k)
        if (h_[at(k, j)] > 0 || h_[at(columns_ - 1 - k, j)] > 0) return true;
    for (std::ptrdiff_t i = 0; i < columns_; ++i)
      if (h_[at(i, rows_ - 2)] > 0) return true;
    return false;
  }

  Real border_of_column(std::ptrdiff_t i) const {
    if (h_[at(i, 0)] < wet_) return 0;
    return y_of(0) + dx_ * edge(rows_, wet_, [&](std::ptrdiff_t j) { return h_[at(i, j)]; });
  }
  // On the line of symmetry, away from the source.
  Real border_of_row(int direction) const {
    return direction * dx_ * edge((direction > 0 ? columns_ + first_ : 1 - first_), wet_, [&](std::ptrdiff_t k) { return h_[at(direction * k - first_, 0)]; });
  }

  static constexpr std::ptrdiff_t kMargin = 8;

  InclineSource source_;
  Real dx_, wet_, b_, tan_;
  std::ptrdiff_t columns_ = 0, rows_ = 0, first_ = 0;
  std::vector<Real> h_, change_, inflow_, downhill_;
};

}  // namespace

std::vector<DamBreakState> solve_dam_break(const DamBreak& dam, std::span<const Real> times, const DamBreakOptions& options) {
  CHECK_GT(dam.length, 0);
  CHECK_GT(dam.depth, 0);
  CHECK_GT(dam.nu, 0);
  CHECK_GT(options.cell, 0);
  CHECK_GT(options.domain, dam.length);
  CHECK_GT(options.step_growth, 0);
  CHECK_GT(options.first_step, 0);
  DamBreakSolver solver(dam, options);
  std::vector<DamBreakState> states;
  Real t = 0;
  for (Real until : times) {
    CHECK_GE(until, t);
    while (t < until) {
      const Real dt = std::min(std::max(options.first_step, options.step_growth * t), until - t);
      solver.step(dt);
      t += dt;
      if (until - t < 1e-12 * until) t = until;
    }
    states.push_back(solver.state(t, options.wet));
  }
  return states;
}

std::vector<InclineState> solve_incline_source(const InclineSource& source, std::span<const Real> times, const InclineOptions& options) {
  CHECK_GT(source.flux, 0);
  CHECK_GT(source.slope, 0);
  CHECK_GT(source.nu, 0);
  CHECK_GT(source.source_radius, 0);
  CHECK_GT(options.cell, 0);
  InclineSolver solver(source, options);
  std::vector<InclineState> states;
  Real t = 0;
  for (Real until : times) {
    CHECK_GE(until, t);
    while (t < until) {
      const Real dt = std::min(solver.stable_step(), until - t);
      solver.step(dt);
      t += dt;
      if (until - t < 1e-12 * until) t = until;
    }
    states.push_back(solver.state(t));
  }
  return states;
}

}  // namespace effuse::flow::reference
