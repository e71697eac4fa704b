#include "flow/effects/bodies_effect.h"

#include <fmt/format.h>

#include <cmath>

#include "flow/effects/solid_world.h"

namespace effuse::flow {

namespace {

class BodiesEffect final : public Effect {
 public:
  explicit BodiesEffect(const World& world) : solids_(make_solid_world(world)), longest_(world.body_settings.step) {}

  std::string_view name() const override { return "bodies"; }
  Real time() const override { return time_; }

  /// As long as a look for contacts: what is driven goes straight in a step.
  void step(Real t_end) override {
    const Real left = t_end - time_, count = std::max(1.0, std::ceil(left / longest_ * (1 - 1e-9)));
    const Real dt = left / count;
    solids_->step(time_, dt);
    time_ = count > 1 ? time_ + dt : t_end;
  }

  std::vector<geometry::RigidPose> body_poses() const override { return solids_->poses(); }
  std::vector<SolidPiece> pieces() const override { return solids_->pieces(); }
  std::size_t memory() const override { return solids_->has_bodies() ? solids_->bodies().memory() : 0; }
  void add_to(StateHash& hash) const override {
    hash.add(time_);
    solids_->add_to(hash);
  }
  void save(StateWriter& out) const override {
    out.value("time", time_);
    solids_->save(out);
  }
  void load(StateReader& in) override {
    in.value("time", time_);
    solids_->load(in);
  }
  std::vector<std::pair<std::string, double>> figures() const override { return solids_->figures(); }
  std::string status() const override {
    if (!solids_->has_bodies()) return "no bodies";
    return fmt::format("{} of {} bodies awake, {} contacts", solids_->last().awake, solids_->count(), solids_->last().contacts);
  }

 private:
  std::unique_ptr<SolidWorld> solids_;
  Real longest_, time_ = 0;
};

}  // namespace

EffectPlan read_bodies_effect(Parameters& parameters, Real) {
  read_body_settings(parameters);
  EffectPlan plan;
  plan.name = "bodies";
  plan.misfits = [](const World&) { return std::vector<Fault>{}; };
  plan.build = [](const World& world) -> std::unique_ptr<Effect> { return std::make_unique<BodiesEffect>(world); };
  return plan;
}

}  // namespace effuse::flow
