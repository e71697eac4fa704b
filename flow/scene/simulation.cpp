#include "flow/scene/simulation.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/hash.h"
#include "geometry/base/zones.h"

namespace effuse::flow {

namespace fs = std::filesystem;

namespace {
constexpr std::string_view kMagic = "effuse checkpoint 2";
constexpr std::size_t kHashDigits = 16;  // at the end of a checkpoint, of all before it

std::string hash_of(std::string_view bytes) {
  StateHash hash;
  hash.add(bytes);
  return hash.hex();
}
}  // namespace

std::vector<fs::path> checkpoints(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / "checkpoints", ignored)) {
    const std::string name = entry.path().filename().string();
    constexpr std::string_view kHead = "checkpoint.", kTail = ".state";
    const bool numbered = name.starts_with(kHead) && name.ends_with(kTail) && name.size() > kHead.size() + kTail.size() &&
                          name.find_first_not_of("0123456789", kHead.size()) == name.size() - kTail.size();
    if (numbered && entry.is_regular_file(ignored)) found.push_back(entry.path());
  }
  std::sort(found.rbegin(), found.rend());
  return found;
}

bool undamaged(std::string_view checkpoint) {
  return checkpoint.size() > kHashDigits && checkpoint.substr(checkpoint.size() - kHashDigits) == hash_of(checkpoint.substr(0, checkpoint.size() - kHashDigits));
}

Simulation::Simulation(const Scene& scene, const World& world) : scene_(&scene) {
  for (const EffectPlan& plan : scene.effects) effects_.push_back(plan.build(world));
  for (const auto& effect : effects_) {
    std::vector<Effect*> others;
    for (const auto& other : effects_)
      if (other != effect) others.push_back(other.get());
    effect->meet(others);
  }
}

bool Simulation::advance(const std::function<bool()>& keep_going) {
  const Real end = scene_->frame_time(frame_ + 1);
  for (const auto& effect : effects_) {
    while (effect->time() < end) {
      if (!keep_going()) return false;
      effect->step(end);
    }
  }
  ++frame_;
  return true;
}

std::string Simulation::state_hash() const {
  StateHash hash;
  hash.add(frame_);
  for (const auto& effect : effects_) {
    hash.add(effect->name());
    effect->add_to(hash);
  }
  return hash.hex();
}

std::size_t Simulation::memory() const {
  std::size_t bytes = 0;
  for (const auto& effect : effects_) bytes += effect->memory();
  return bytes;
}

std::string Simulation::checkpoint(const std::string& scene_key) const {
  StateWriter out;
  out.text("magic", kMagic);
  out.text("scene", scene_key);
  out.value("frame", frame_);
  out.value("effects", effects_.size());
  for (const auto& effect : effects_) {
    out.text("effect", effect->name());
    effect->save(out);
  }
  out.text("end", "end");
  return out.bytes() + hash_of(out.bytes());
}

void Simulation::restore(std::string_view bytes, const std::string& scene_key, const std::string& file) { load(bytes, &scene_key, file); }

std::string Simulation::branch(std::string_view bytes, const std::string& file) { return load(bytes, nullptr, file); }

std::string Simulation::load(std::string_view bytes, const std::string* scene_key, const std::string& file) {
  StateReader in(bytes, file);
  std::string text;
  in.text("magic", text);
  if (text != kMagic) throw InputError(Place{file}, fmt::format("found '{:.40}', wanted '{}'", text, kMagic));
  if (!undamaged(bytes)) throw InputError(Place{file}, "the checkpoint is damaged: its bytes are not those that were written");
  in.text("scene", text);
  const std::string found_key = text;
  if (scene_key && text != *scene_key) throw InputError(Place{file}, "the scene has changed since this checkpoint was written; start anew in another folder, or put the scene back");
  int frame = 0;
  std::size_t count = 0;
  in.value("frame", frame);
  in.value("effects", count);
  if (count != effects_.size()) throw InputError(Place{file}, fmt::format("holds {} effects, the scene has {}", count, effects_.size()));
  for (const auto& effect : effects_) {
    in.text("effect", text);
    if (text != effect->name()) throw InputError(Place{file}, fmt::format("holds effect '{:.40}', wanted '{}'", text, effect->name()));
    effect->load(in);
  }
  in.text("end", text);
  frame_ = frame;
  return found_key;
}

void write_checkpoint(const fs::path& folder, const Simulation& simulation, const std::string& scene_key, std::size_t keep) {
  ZONE("checkpoint");
  write_file(folder / "checkpoints" / fmt::format("checkpoint.{:04}.state", simulation.frame()), simulation.checkpoint(scene_key));
  const std::vector<fs::path> all = checkpoints(folder);
  for (std::size_t i = keep; keep > 0 && i < all.size(); ++i) {
    std::error_code ignored;
    fs::remove(all[i], ignored);
  }
}

}  // namespace effuse::flow
