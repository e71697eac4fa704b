#include "flow/sph/heat.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/sph/particle_arrays.h"
#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
constexpr std::string_view kModel = "heat 2";  // of a checkpoint: changes with what is saved
constexpr Real kFinestShare = 1.0 / 200;       // of a column's depth: its first cell
constexpr Real kFinestCell = 2e-3;             // [m], at most
constexpr Real kColumnStep = 0.1;              // of a column's age: its implicit step, the flux then errs by 1 %
constexpr Real kPendingShare = 0.02;           // of its age: how far a column may lag behind
constexpr Real kLongestPending = 10;           // [s]
constexpr Real kPairInterval = 0.02;           // of dx^2 / kappa: between two exchanges
constexpr Real kTurn = 0.05;                    // of dx^2 / kappa: a longer step is done in parts,
constexpr Real kMostTurns = 8;                 // at most so many for accuracy's sake
constexpr Real kMonotone = 0.9;                // of the step at which a particle would take its neighbours' mean
constexpr int kMostStages = 51;                // of one super-step, 1326 times as long as a plain one
constexpr Real kLumpStep = 0.004;              // of a lumped particle's own cooling time
constexpr int kMaxLumpSteps = 256;
constexpr Real kSettled = 5;                   // [K]: a buried column with less contrast is one value
constexpr Real kLeastMeltingRange = 0.1;       // [K]: below, a column's equations have no slope to follow
constexpr Real kColumnReach = 1.5;             // distances to a particle with a column count so much
constexpr Real kBuriedShare = 0.5;             // of its age: how long a buried column lasts

template <class F>
auto with_kernel(KernelKind kind, Real support, F&& f) {
  switch (kind) {
    case KernelKind::kCubicSpline: return f(CubicSpline(support));
    case KernelKind::kSpiky: return f(SpikyKernel(support));
    default: return f(WendlandC2(support));
  }
}

/// -W'(r) / r; finite where particles meet.
template <class Kernel>
Real stiffness(const Kernel& W, Real r) {
  const Real apart = std::max(r, 1e-3 * W.support);
  return -W.dW(apart) / apart;
}

/// alpha of the class's docstring.
template <class Kernel>
Real column_factor(const Kernel& W, Real spacing, Real last_share) {
  const int reach = static_cast<int>(W.support / spacing) + 1;
  const Real e = last_share / 2, first = 1.0 / 3 + e + e * e / 2;
  Real through = 0, found = 0;
  for (int m = 1; m <= reach; ++m) {
    Real c = 0, mixed = 0;
    for (int i = -reach; i <= reach; ++i)
      for (int j = -reach; j <= reach; ++j) {
        const Real r = spacing * std::sqrt(Real(i * i + j * j + m * m));
        c += stiffness(W, r);
        mixed += stiffness(W, kColumnReach * r);
      }
    through += m * m * c;
    found += (m - 1 + first) * mixed;
  }
  return found > 0 ? through / found : 1;
}

HeatBudget operator+(HeatBudget a, const HeatBudget& b) {
  a.radiated += b.radiated;
  a.convected += b.convected;
  a.quenched += b.quenched;
  a.ground += b.ground;
  a.dissipated += b.dissipated;
  return a;
}

Real at(std::span<const Real> values, std::size_t i) { return values.empty() ? 0 : values[i]; }
}  // namespace

Heat::Heat(const HeatOptions& options, Real spacing, Real density)
    : options_(options), spacing_(spacing), density_(density), mass_(density * spacing * spacing * spacing), interval_(0), diffusion_time_(0),
      shape_(std::min(kFinestShare, kFinestCell / spacing), options.crust_cells) {
  CHECK_GT(spacing, 0.0);
  CHECK_GT(density, 0.0);
  CHECK_GT(options.conductivity, 0.0);
  CHECK_GE(options.solid_conductivity, 0.0);
  CHECK_GT(options.curve.heat_capacity, 0.0);
  CHECK_GE(options.curve.latent_heat, 0.0);
  CHECK_GT(options.curve.solidus, 0.0);
  CHECK_GE(options.curve.liquidus, options.curve.solidus);
  CHECK_GE(options.air.emissivity, 0.0);
  CHECK_LE(options.air.emissivity, 1.0);
  CHECK_GE(options.air.convection, 0.0);
  CHECK_GE(options.air.air_temperature, 0.0);
  CHECK_GE(options.ground_effusivity, 0.0);
  CHECK_GE(options.ground_conductance, 0.0);
  CHECK_GE(options.longest_interval, 0.0);
  const Real narrow = kLeastMeltingRange - (options_.curve.liquidus - options_.curve.solidus);
  if (narrow > 0) {
    options_.curve.solidus -= narrow / 2;
    options_.curve.liquidus += narrow / 2;
  }
  if (options_.solid_conductivity == 0) options_.solid_conductivity = options_.conductivity;
  const Real kappa = std::max(options_.conductivity, options_.solid_conductivity) / (density * options_.curve.heat_capacity);
  diffusion_time_ = spacing * spacing / kappa;
  interval_ = std::min(options_.longest_interval, kPairInterval * diffusion_time_);
}

Real Heat::conductivity(Real enthalpy) const {
  const Real melt = options_.conductivity, solid = options_.solid_conductivity;
  return melt == solid ? melt : melt + (solid - melt) * options_.curve.solid_fraction(enthalpy);
}

void Heat::born(Real temperature) {
  CHECK(std::isfinite(temperature) && temperature > 0);
  enthalpy_.push_back(options_.curve.enthalpy(temperature));
  contact_time_.push_back(0);
  column_of_.push_back(kNone);
  temperature_.push_back(temperature);
  surface_temperature_.push_back(temperature);
  crust_thickness_.push_back(0);
  crust_share_.push_back(0);
  solid_fraction_.push_back(options_.curve.solid_fraction(enthalpy_.back()));
}

void Heat::keep(std::span<const Index> which) {
  for (auto* values : {&enthalpy_, &contact_time_, &temperature_, &surface_temperature_, &crust_thickness_, &crust_share_, &solid_fraction_}) gather(*values, which);
  gather(column_of_, which);
  std::vector<CrustColumn> columns;
  columns.reserve(columns_.size());
  owner_.clear();
  for (std::size_t i = 0; i < column_of_.size(); ++i) {
    if (column_of_[i] == kNone) continue;
    columns.push_back(columns_[column_of_[i]]);
    owner_.push_back(static_cast<Index>(i));
    column_of_[i] = static_cast<Index>(columns.size() - 1);
  }
  columns_.swap(columns);
}

HeatBudget Heat::step(Real dt, const Surroundings& s) {
  ZONE("sph.heat");
  HeatBudget budget;
  const std::size_t n = size();
  CHECK(std::isfinite(dt) && dt >= 0);
  given_.assign(n, 0);
  touched_temperature_.assign(n, 0);
  if (!options_.on || n == 0 || dt == 0) return budget;
  CHECK(s.sky_area.empty() || s.sky_area.size() == n);
  CHECK(s.ground_area.empty() || s.ground_area.size() == n);
  CHECK(s.ground_area.empty() || s.ground_temperature.size() == n);
  CHECK(s.ground_effusivity.empty() || s.ground_effusivity.size() == n);
  CHECK(s.dissipation.empty() || s.dissipation.size() == n);
  CHECK(s.wet.empty() || s.wet.size() == n);

  raise_columns(s);

  const bool heated = options_.viscous_heating && !s.dissipation.empty();
  if (heated) {
    const Real volume = mass_ / density_;
    parallel_for(n, [&](std::size_t i) {
      const Real gained = dt * s.dissipation[i] / density_;
      enthalpy_[i] += gained;
      if (column_of_[i] != kNone)
        for (Real& H : columns_[column_of_[i]].H) H += gained;
    }, 4096);
    budget.dissipated = dt * volume * parallel_sum(n, 0.0, [&](std::size_t i) { return s.dissipation[i]; });
  }

  const bool pairs = conducts(dt);
  pair_time_ += dt;
  if (!pairs) {
    lose(dt, s, false, budget);
  } else {
    CHECK_EQ(s.x.size(), n);
    CHECK_GE(s.neighbors.size(), n);
    CHECK_GT(s.support, 0.0);
    // The longest monotone step is kMonotone / rate; s stages are as good as (s^2 + s) / 2 of those.
    load_nodes();
    const Real rate = exchange(s), wanted = options_.guards.monotone_conduction ? pair_time_ * rate / kMonotone : 0;
    // Surfaces and pairs take turns: in a long step, more often.
    const Real turns = std::min(kMostTurns, pair_time_ / (kTurn * diffusion_time_));
    const Real super_steps = std::max(1.0, std::ceil(std::max(turns, wanted / (kMostStages * (kMostStages + 1) / 2))));
    CHECK_LT(super_steps, 1e6);
    int stages = 1;
    while (stages * (stages + 1) / 2 < wanted / super_steps) stages += 2;
    for (int k = 0; k < static_cast<int>(super_steps); ++k) {
      if (k > 0) {
        load_nodes();
        exchange(s);
      }
      run_stages(pair_time_ / super_steps, stages, s);
      store_nodes();
      lose(dt / super_steps, s, k + 1 == static_cast<int>(super_steps) && super_steps > 1, budget);
    }
    budget.conduction_passes = static_cast<int>(super_steps) * stages;
    pair_time_ = 0;
  }

  drop_columns();
  if (pairs || heated) refresh();
  return budget;
}

void Heat::raise_columns(const Surroundings& s) {
  if (s.sky_area.empty() || !options_.crust) return;
  for (std::size_t i = 0; i < s.sky_area.size(); ++i) {
    if (s.sky_area[i] <= 0 || column_of_[i] != kNone) continue;
    CrustColumn column;
    column.H.fill(enthalpy_[i]);
    column.surface_temperature = temperature_[i];
    column.depth = spacing_;
    column_of_[i] = static_cast<Index>(columns_.size());
    columns_.push_back(column);
    owner_.push_back(static_cast<Index>(i));
  }
}

void Heat::drop_columns() {
  std::size_t kept = 0;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const CrustColumn& column = columns_[c];
    const Index i = owner_[c];
    if (column.buried > 0 && column.pending == 0) {
      Real low = column.H[0], high = column.H[0];
      for (const Real H : column.H) {
        low = std::min(low, H);
        high = std::max(high, H);
      }
      if (column.buried > kBuriedShare * column.age || options_.curve.temperature(high) - options_.curve.temperature(low) < kSettled) {
        column_of_[i] = kNone;
        refresh_particle(i);
        continue;
      }
    }
    if (kept != c) {
      columns_[kept] = column;
      owner_[kept] = i;
      column_of_[i] = static_cast<Index>(kept);
    }
    ++kept;
  }
  columns_.resize(kept);
  owner_.resize(kept);
}

void Heat::load_nodes() {
  node_.resize(size());
  parallel_for(size(), [&](std::size_t i) { node_[i] = column_of_[i] == kNone ? enthalpy_[i] : columns_[column_of_[i]].H[last_cell()]; }, 4096);
}

void Heat::store_nodes() {
  parallel_for(size(), [&](std::size_t i) {
    const Index c = column_of_[i];
    if (c == kNone) {
      enthalpy_[i] = node_[i];
      return;
    }
    enthalpy_[i] += (node_[i] - columns_[c].H[last_cell()]) * shape_.share[last_cell()];
    columns_[c].H[last_cell()] = node_[i];
  }, 4096);
}

/// The nodes dt [s] later; gain_ is that of the nodes as they are.
void Heat::run_stages(Real dt, int stages, const Surroundings& s) {
  // Y_1 = Y_0 + w dt M(Y_0),  Y_j = mu Y_(j-1) + (1 - mu) Y_(j-2) + mu w dt M(Y_(j-1)),  mu = (2j - 1)/j,  w = 2/(s^2 + s);
  // written as a difference, so that rounding mu does not make heat.
  const Real w = 2.0 / (stages * (stages + 1)) * dt;
  node_before_ = node_;
  for (int j = 1; j <= stages; ++j) {
    const Real mu = (2.0 * j - 1) / j;
    if (j > 1) exchange(s);
    parallel_for(size(), [&](std::size_t i) {
      const Real now = node_[i];
      node_[i] = now + (mu - 1) * (now - node_before_[i]) + mu * w * gain_[i];
      node_before_[i] = now;
    }, 4096);
  }
}

/// Fills gain_ for the nodes; returns the largest of the rates [1/s] at which a node would follow its neighbours.
Real Heat::exchange(const Surroundings& s) {
  ZONE("sph.heat.pairs");
  return with_kernel(s.kernel, s.support, [&](const auto& W) { return exchange(s, W); });
}

template <class Kernel>
Real Heat::exchange(const Surroundings& s, const Kernel& W) {
  const std::size_t n = size();
  packed_.resize(n);
  gain_.resize(n);
  rate_.resize(n);
  parallel_for(n, [&](std::size_t i) {
    packed_[i] = {s.x[i].x(), s.x[i].y(), s.x[i].z(), options_.curve.temperature(node_[i]), conductivity(node_[i]), column_of_[i] == kNone ? 0.0 : 1.0};
  }, 4096);

  const Real alpha = column_factor(W, spacing_, shape_.share[last_cell()]);
  const Real volume = mass_ / density_, scale = volume * volume / mass_;
  const Vec2 L = s.period;
  const auto nearest = [](Real d, Real period) { return d > period / 2 ? d - period : d < -period / 2 ? d + period : d; };
  const auto loop = [&](auto periodic, auto one_conductivity) {
    const Real k2 = 2 * options_.conductivity;
    parallel_for(n, [&](std::size_t i) {
      const Packed p = packed_[i];
      Real gain = 0, conductance = 0;
      for (const Index j : s.neighbors[i]) {
        const Packed& o = packed_[j];
        Real dx = p.x - o.x, dy = p.y - o.y;
        const Real dz = p.z - o.z;
        if constexpr (decltype(periodic)::value) {
          if (L.x() > 0) dx = nearest(dx, L.x());
          if (L.y() > 0) dy = nearest(dy, L.y());
        }
        const Real mixed = (p.column - o.column) * (p.column - o.column);  // 1: one of the two has a column
        Real w = stiffness(W, (1 + (kColumnReach - 1) * mixed) * std::sqrt(dx * dx + dy * dy + dz * dz)) * (1 + (alpha - 1) * mixed);
        if constexpr (decltype(one_conductivity)::value) w *= k2;
        else w *= 4 * (p.k * o.k) / (p.k + o.k);
        gain += w * (o.T - p.T);
        conductance += w;
      }
      // The last cell of a column takes it all.
      const Real per_mass = scale / (p.column > 0 ? shape_.share[last_cell()] : 1);
      gain_[i] = per_mass * gain;
      rate_[i] = per_mass * conductance / options_.curve.heat_capacity;
    });
  };
  const bool one = options_.conductivity == options_.solid_conductivity;
  if (s.period.isZero()) one ? loop(std::false_type{}, std::true_type{}) : loop(std::false_type{}, std::false_type{});
  else one ? loop(std::true_type{}, std::true_type{}) : loop(std::true_type{}, std::false_type{});
  return parallel_max(n, 0.0, [&](std::size_t i) { return rate_[i]; });
}

void Heat::lose(Real dt, const Surroundings& s, bool flush, HeatBudget& budget) {
  ZONE("sph.heat.surface");
  const int passes = budget.conduction_passes;
  budget = budget + parallel_reduce(
      columns_.size(), HeatBudget{}, [&](std::size_t c) { return lose_column(c, dt, s, flush); },
      [](const HeatBudget& a, const HeatBudget& b) { return a + b; }, 64);
  if (!s.sky_area.empty() || !s.ground_area.empty())
    budget = budget + parallel_reduce(
        size(), HeatBudget{},
        [&](std::size_t i) { return column_of_[i] == kNone && (at(s.sky_area, i) > 0 || at(s.ground_area, i) > 0 || contact_time_[i] > 0) ? lose_lump(i, dt, s) : HeatBudget{}; },
        [](const HeatBudget& a, const HeatBudget& b) { return a + b; });
  budget.conduction_passes = passes;
}

/// Conductance [W/K] between what is next to the ground, a layer of `thickness` [m] of one temperature, and the ground;
/// mean over the coming dt of contact. Advances the clock. 0 without contact.
Real Heat::ground_conductance(std::size_t i, Real dt, Real area, Real thickness, Real layer_enthalpy, Real ground_temperature, Real effusivity) {
  Real& t = contact_time_[i];
  if (area <= 0) {
    t = std::max(0.0, t - dt);
    return 0;
  }
  // The mean of 1/sqrt(t) over the step is 1/root.
  const Real root = (std::sqrt(t) + std::sqrt(t + dt)) / 2, k = conductivity(layer_enthalpy);
  t += dt;
  const Real tau = std::min(root * root * k / (density_ * options_.curve.heat_capacity * thickness * thickness), kPi / 16);
  Real resistance = thickness / k * (std::sqrt(kPi * tau) - 2 * tau);
  const Real inside = resistance;
  if (effusivity > 0) resistance += std::sqrt(kPi) * root / effusivity;
  else if (options_.ground_conductance > 0) resistance += 1 / options_.ground_conductance;
  else if (options_.ground_effusivity > 0) resistance += std::sqrt(kPi) * root / options_.ground_effusivity;
  else return 0;
  // What is next to the ground has come so much nearer to its own temperature than the ground was.
  touched_temperature_[i] = ground_temperature + (1 - inside / resistance) * (options_.curve.temperature(layer_enthalpy) - ground_temperature);
  return area / resistance;
}

HeatBudget Heat::lose_column(std::size_t c, Real dt, const Surroundings& s, bool flush) {
  const std::size_t i = owner_[c];
  CrustColumn& column = columns_[c];
  const Real sky = std::max(0.0, at(s.sky_area, i)), volume = mass_ / density_;
  column.pending += dt;
  column.pending_sky += sky * dt;
  const bool turned = (sky > 0) == (column.buried > 0);
  column.buried = sky > 0 ? 0 : column.buried + dt;
  const Real area = at(s.ground_area, i);
  column.pending_ground += dt * ground_conductance(i, dt, area, shape_.share[last_cell()] * column.depth, column.H[last_cell()], at(s.ground_temperature, i), at(s.ground_effusivity, i));
  if (area > 0) column.ground_temperature = s.ground_temperature[i];

  const Real k = std::max(options_.conductivity, options_.solid_conductivity);
  const Real finest = shape_.share[0] * column.depth;
  const Real beginning = finest * finest * density_ * options_.curve.heat_capacity / k;
  if (!flush && !turned && column.buried <= kBuriedShare * column.age && column.pending < std::min(kLongestPending, kPendingShare * (column.age + beginning)))
    return {};

  // More exposed than a square: a shallower column of that area. Less: a square, exposed in part.
  const Real exposed = column.pending_sky / column.pending;
  const Real cross = std::clamp(exposed, spacing_ * spacing_, 6 * spacing_ * spacing_);
  column.depth = volume / cross;
  const ColumnEnds ends{std::min(1.0, exposed / cross), column.pending_ground / column.pending / cross, column.ground_temperature};
  HeatBudget budget;
  for (Real left = column.pending; left > 0;) {
    Real h = exposed > 0 ? kColumnStep * (column.age + beginning) : left;
    if (h > 0.999 * left) h = left;
    const ColumnLoss loss = step_column(column.H, h, column.depth, density_, shape_, options_.curve, options_.conductivity, options_.solid_conductivity,
                                        law_of(i, s), ends, column.surface_temperature);
    budget.radiated += cross * loss.radiated;
    budget.convected += cross * loss.convected;
    budget.ground += cross * loss.ground;
    if (exposed > 0) column.age += h;
    left -= h;
  }
  if (!s.wet.empty() && s.wet[i]) budget.quenched = budget.radiated + budget.convected;
  given_[i] += budget.ground;
  column.pending = column.pending_sky = column.pending_ground = 0;
  Real mean = 0;
  for (int j = 0; j < shape_.cells; ++j) mean += shape_.share[j] * column.H[j];
  enthalpy_[i] = mean;
  refresh_particle(i);
  return budget;
}

HeatBudget Heat::lose_lump(std::size_t i, Real dt, const Surroundings& s) {
  const Real sky = std::max(0.0, at(s.sky_area, i)), area = at(s.ground_area, i);
  const Real G = ground_conductance(i, dt, area, spacing_, enthalpy_[i], at(s.ground_temperature, i), at(s.ground_effusivity, i));
  const Real ground_T = area > 0 ? s.ground_temperature[i] : 0;
  if (sky <= 0 && G <= 0) return {};
  const EnthalpyCurve& curve = options_.curve;
  const SurfaceLaw& air = law_of(i, s);

  const Real fastest = (sky * air.slope(curve.temperature(enthalpy_[i])) + G) / (mass_ * curve.heat_capacity);
  const int steps = static_cast<int>(std::clamp(std::ceil(dt * fastest / kLumpStep), 1.0, Real(kMaxLumpSteps)));
  const Real h = dt / steps;
  HeatBudget budget;
  for (int k = 0; k < steps; ++k) {
    // m (H - start) + h (sky flux(T) + G (T - T_ground)) = 0 rises with H: Newton's method between two bounds.
    const Real start = enthalpy_[i], T0 = curve.temperature(start);
    Real low = start, high = start;
    if (sky > 0) {
      low = std::min(low, curve.enthalpy(std::min(T0, air.air_temperature)));
      high = std::max(high, curve.enthalpy(std::max(T0, air.air_temperature)));
    }
    if (G > 0) {
      low = std::min(low, curve.enthalpy(std::min(T0, ground_T)));
      high = std::max(high, curve.enthalpy(std::max(T0, ground_T)));
    }
    Real H = start;
    for (int iteration = 0; iteration < 100; ++iteration) {
      const Real T = curve.temperature(H);
      const Real f = mass_ * (H - start) + h * (sky * air.flux(T) + G * (T - ground_T));
      (f > 0 ? high : low) = H;
      const Real slope = mass_ + h * (sky * air.slope(T) + G) * curve.slope(H);
      Real next = H - f / slope;
      if (!(next > low && next < high)) next = (low + high) / 2;
      const Real moved = std::abs(next - H);
      H = next;
      if (moved <= 1e-14 * std::abs(H)) break;
    }
    const Real T = curve.temperature(H);
    const Real radiated = sky * air.radiated(T), convected = sky * air.convected(T), ground = G * (T - ground_T);
    // What Newton's method left goes to the sky, or where there is none to the ground: the budget closes.
    const Real rest = mass_ * (start - H) - h * (radiated + convected + ground);
    budget.radiated += h * radiated + (sky > 0 ? rest : 0);
    budget.convected += h * convected;
    budget.ground += h * ground + (sky > 0 ? 0 : rest);
    enthalpy_[i] = H;
  }
  if (!s.wet.empty() && s.wet[i]) budget.quenched = budget.radiated + budget.convected;
  given_[i] += budget.ground;
  refresh_particle(i);
  return budget;
}

void Heat::refresh() {
  parallel_for(size(), [&](std::size_t i) { refresh_particle(i); }, 1024);
}

void Heat::refresh_particle(std::size_t i) {
  const EnthalpyCurve& curve = options_.curve;
  temperature_[i] = curve.temperature(enthalpy_[i]);
  const Index c = column_of_[i];
  if (c == kNone) {
    surface_temperature_[i] = temperature_[i];
    crust_thickness_[i] = crust_share_[i] = 0;
    solid_fraction_[i] = curve.solid_fraction(enthalpy_[i]);
    return;
  }
  const CrustColumn& column = columns_[c];
  Real solid = 0;
  for (int j = 0; j < shape_.cells; ++j) solid += shape_.share[j] * curve.solid_fraction(column.H[j]);
  solid_fraction_[i] = solid;
  surface_temperature_[i] = column.buried > 0 ? temperature_[i] : column.surface_temperature;
  const Real depth = crust_depth(column, shape_, curve, options_.crust_temperature);
  crust_thickness_[i] = column.buried > 0 ? 0 : depth;
  crust_share_[i] = std::clamp(depth / column.depth, 0.0, 1.0);
}

Real Heat::total_enthalpy() const {
  return mass_ * parallel_sum(size(), 0.0, [&](std::size_t i) { return enthalpy_[i]; });
}

std::vector<Heat::Level> Heat::profile(std::size_t i) const {
  CHECK_LT(i, size());
  std::vector<Level> levels;
  if (column_of_[i] == kNone) return levels;
  const CrustColumn& column = columns_[column_of_[i]];
  levels.push_back({0, column.surface_temperature});
  for (int j = 0; j < shape_.cells; ++j) levels.push_back({shape_.centre[j] * column.depth, options_.curve.temperature(column.H[j])});
  return levels;
}

std::size_t Heat::memory() const {
  std::size_t bytes = columns_.capacity() * sizeof(CrustColumn) + packed_.capacity() * sizeof(Packed);
  for (const auto* values : {&enthalpy_, &contact_time_, &temperature_, &surface_temperature_, &crust_thickness_, &crust_share_, &solid_fraction_, &node_, &node_before_, &gain_, &rate_})
    bytes += values->capacity() * sizeof(Real);
  for (const auto* values : {&column_of_, &owner_}) bytes += values->capacity() * sizeof(Index);
  return bytes;
}

template <class Self, class Archive>
void Heat::archive(Self& self, Archive& io) {
  io.array("enthalpy", self.enthalpy_);
  io.array("contact_time", self.contact_time_);
  io.array("column_of", self.column_of_);
  io.array("columns", self.columns_);
  io.array("owner", self.owner_);
  io.value("pair_time", self.pair_time_);
  io.array("temperature", self.temperature_);
  io.array("surface_temperature", self.surface_temperature_);
  io.array("crust_thickness", self.crust_thickness_);
  io.array("crust_share", self.crust_share_);
  io.array("solid_fraction", self.solid_fraction_);
}

void Heat::add_to(StateHash& hash) const {
  HashArchive io{hash};
  archive(*this, io);
}

void Heat::save(StateWriter& out) const {
  out.text("model", kModel);
  archive(*this, out);
}

void Heat::load(StateReader& in) {
  std::string model;
  in.text("model", model);
  if (model != kModel) throw InputError(Place{}, fmt::format("the checkpoint holds a '{:.40}', wanted '{}'", model, kModel));
  Heat loaded(*this);
  archive(loaded, in);
  const std::size_t n = loaded.enthalpy_.size();
  check_loaded_sizes(n, {loaded.contact_time_.size(), loaded.column_of_.size(), loaded.temperature_.size(), loaded.surface_temperature_.size(),
                         loaded.crust_thickness_.size(), loaded.crust_share_.size(), loaded.solid_fraction_.size()});
  std::size_t owned = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Index c = loaded.column_of_[i];
    if (c == kNone) continue;
    ++owned;
    if (c >= loaded.columns_.size() || c >= loaded.owner_.size() || loaded.owner_[c] != i)
      throw InputError(Place{}, fmt::format("the checkpoint gives particle {} crust {} of {}, not its own", i, c, loaded.columns_.size()));
  }
  if (owned != loaded.columns_.size() || owned != loaded.owner_.size())
    throw InputError(Place{}, fmt::format("the checkpoint holds {} crusts for {} particles", loaded.columns_.size(), owned));
  *this = std::move(loaded);
}

}  // namespace effuse::flow::sph
