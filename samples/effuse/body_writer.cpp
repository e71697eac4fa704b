#include "samples/effuse/body_writer.h"

#include <fmt/format.h>

#include <charconv>

#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/write_animation.h"

namespace effuse {

namespace fs = std::filesystem;
using geometry::RigidPose;

namespace {

constexpr std::string_view kHeader = "frame,time_s,name,x,y,z,qw,qx,qy,qz\n";
constexpr std::size_t kNumbers = 7;

/// A name as a field: in quotes where it has what a field may not.
std::string field(const std::string& name) {
  if (name.find_first_of(",\"\r\n") == std::string::npos) return name;
  std::string out = "\"";
  for (const char c : name) out += c == '"' ? std::string("\"\"") : c == '\n' || c == '\r' ? std::string(" ") : std::string(1, c);
  return out + "\"";
}

/// The last seven fields of a line.
bool read_pose(std::string_view line, RigidPose& pose) {
  double v[kNumbers];
  for (std::size_t k = kNumbers; k-- > 0;) {
    const std::size_t comma = line.rfind(',');
    if (comma == std::string_view::npos) return false;
    const char* end = line.data() + line.size();
    const auto [stopped, error] = std::from_chars(line.data() + comma + 1, end, v[k]);
    if (error != std::errc{} || stopped != end) return false;
    line = line.substr(0, comma);
  }
  pose = {Vec3(v[0], v[1], v[2]), Quat(v[3], v[4], v[5], v[6])};
  return true;
}

}  // namespace

BodyWriter::BodyWriter(const LoadedScene& loaded, fs::path folder) : loaded_(loaded), folder_(std::move(folder)) {
  if (!loaded.solids.any_moves()) return;
  const SolidThings& solids = loaded.solids;
  for (std::size_t i = 0; i < solids.obstacles.size(); ++i) {
    names_.push_back(solids.obstacles[i].name);
    things_.push_back(i);
  }
  for (std::size_t b = 0; b < solids.bodies.size(); ++b) {
    if (solids.bodies[b].cells) continue;
    names_.push_back(solids.bodies[b].name);
    things_.push_back(solids.obstacles.size() + b);
  }
  poses_.resize(names_.size());
}

void BodyWriter::add_frame() {
  if (!active()) return;
  const SolidThings& solids = loaded_.solids;
  std::vector<RigidPose> bodies;
  for (const auto& effect : loaded_.simulation->effects())
    if (bodies.empty()) bodies = effect->body_poses();
  for (std::size_t k = 0; k < things_.size(); ++k) {
    const std::size_t obstacles = solids.obstacles.size(), b = things_[k] - obstacles;
    if (things_[k] < obstacles) poses_[k].push_back(solids.obstacles[things_[k]].track.at(loaded_.simulation->time()));
    else poses_[k].push_back(b < bodies.size() ? bodies[b] : solids.bodies[b].pose);
  }
}

void BodyWriter::write_series() const {
  if (!active()) return;
  ZONE("write.bodies_csv");
  std::string text(kHeader);
  for (std::size_t f = 0; f < poses_[0].size(); ++f)
    for (std::size_t k = 0; k < names_.size(); ++k) {
      const RigidPose& at = poses_[k][f];
      const Quat& q = at.orientation;
      text += fmt::format("{},{},{},{},{},{},{},{},{},{}\n", f + 1, loaded_.scene.frame_time(static_cast<int>(f) + 1), field(names_[k]), at.position.x(), at.position.y(), at.position.z(), q.w(), q.x(), q.y(), q.z());
    }
  write_file(folder_ / "bodies.csv", text);
}

void BodyWriter::write_animation() const {
  if (!active() || !loaded_.skin.glb || poses_[0].empty()) return;
  std::vector<skin::MovingMesh> things;
  for (std::size_t k = 0; k < names_.size(); ++k) things.push_back({names_[k], &loaded_.solids.looks[things_[k]], poses_[k]});
  std::vector<Real> times;
  for (std::size_t f = 0; f < poses_[0].size(); ++f) times.push_back(static_cast<Real>(f) / loaded_.scene.fps);
  skin::write_animated_glb(folder_ / "bodies.glb", things, times, {{"scene", loaded_.scene.name}, {"units", "metres, seconds"}});
}

bool BodyWriter::restore() {
  if (!active()) return true;
  const auto frames = static_cast<std::size_t>(loaded_.simulation->frame());
  std::error_code ignored;
  if (!fs::is_regular_file(folder_ / "bodies.csv", ignored)) return frames == 0;
  const std::string text = read_file(folder_ / "bodies.csv");
  std::vector<std::vector<RigidPose>> poses(names_.size());
  std::size_t at = text.find('\n') + 1;
  for (std::size_t f = 0; f < frames; ++f)
    for (std::size_t k = 0; k < names_.size(); ++k) {
      const std::size_t end = text.find('\n', at);
      RigidPose pose;
      if (end == std::string::npos || !read_pose(std::string_view(text).substr(at, end - at), pose)) return false;
      poses[k].push_back(pose);
      at = end + 1;
    }
  poses_ = std::move(poses);
  return true;
}

std::vector<std::pair<std::string, std::string>> BodyWriter::files() const {
  std::vector<std::pair<std::string, std::string>> found;
  std::error_code ignored;
  for (const auto& [name, file] : {std::pair{"bodies", "bodies.csv"}, {"bodies_animation", "bodies.glb"}})
    if (active() && fs::exists(folder_ / file, ignored)) found.emplace_back(name, file);
  return found;
}

}  // namespace effuse
