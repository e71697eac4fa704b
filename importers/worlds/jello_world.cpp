#include "importers/worlds/jello_world.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>

#include "geometry/base/error.h"
#include "geometry/base/files.h"

namespace effuse::importers {

namespace {

constexpr int kMostCorners = 512;  // a side of the force field: 4 GB of it

/// The file's words, one after the other, each with its line.
class Words {
 public:
  Words(const std::filesystem::path& file, std::string_view text) : file_(file.string()), rest_(text) {}

  /// Empty at the end.
  std::string_view next() {
    while (!rest_.empty() && static_cast<unsigned char>(rest_.front()) <= ' ') {
      if (rest_.front() == '\n') ++line_;
      rest_.remove_prefix(1);
    }
    std::size_t n = 0;
    while (n < rest_.size() && static_cast<unsigned char>(rest_[n]) > ' ') ++n;
    const std::string_view word = rest_.substr(0, n);
    rest_.remove_prefix(n);
    return word;
  }

  double number(const std::string& what) {
    const std::string_view word = next();
    if (word.empty()) wrong(fmt::format("the file ends where {} was wanted", what));
    double value = 0;
    const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value)) wrong(fmt::format("found '{:.40}', wanted {}, a number", word, what));
    return value;
  }
  double number(const std::string& what, double least, bool least_itself) {
    const double value = number(what);
    if (!(value > least) && !(least_itself && value == least)) wrong(fmt::format("found {} {:g}, wanted {} {:g}", what, value, least_itself ? "at least" : "more than", least));
    return value;
  }
  int whole(const std::string& what, int least, int most) {
    const double value = number(what);
    if (value != std::floor(value) || value < least || value > most) wrong(fmt::format("found {} {:g}, wanted a whole number from {} to {}", what, value, least, most));
    return static_cast<int>(value);
  }
  Vec3 vector(const std::string& what) {
    const double x = number(what), y = number(what), z = number(what);
    return {x, y, z};
  }
  [[noreturn]] void wrong(const std::string& message) const { throw InputError(Place{file_, line_}, message); }

 private:
  std::string file_;
  std::string_view rest_;
  int line_ = 1;
};

}  // namespace

JelloWorld read_jello_world(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  Words words(file, text);
  JelloWorld world;
  world.integrator = words.next();
  if (world.integrator != "Euler" && world.integrator != "RK4") words.wrong(fmt::format("found the integrator '{:.40}', wanted Euler or RK4", world.integrator));
  world.dt = words.number("the time step", 0, false);
  world.steps_a_frame = words.whole("the steps between frames", 1, 1000000);
  world.elastic = words.number("kElastic", 0, true);
  world.elastic_damping = words.number("dElastic", 0, true);
  world.collision = words.number("kCollision", 0, true);
  world.collision_damping = words.number("dCollision", 0, true);
  world.mass = words.number("the mass of a point", 0, false);
  if (words.whole("whether there is a plane (0 or 1)", 0, 1) == 1) {
    Eigen::Vector4d& plane = world.plane.emplace();
    for (int k = 0; k < 4; ++k) plane[k] = words.number("the plane's a b c d");
    if (!(plane.head<3>().norm() > 0)) words.wrong("the plane's a, b and c are all zero, so it has no normal");
  }
  world.field.resolution = words.whole("the force field's resolution", 0, kMostCorners);
  if (world.field.resolution == 1) words.wrong("found the force field's resolution 1, wanted 0 or at least 2");
  world.field.low = Vec3::Constant(-JelloWorld::kRoom);
  world.field.high = Vec3::Constant(JelloWorld::kRoom);
  const auto r = static_cast<std::size_t>(world.field.resolution);
  // Not reserved before it is read: a damaged resolution must not take gigabytes.
  for (std::size_t k = 0; k < r * r * r; ++k) world.field.values.push_back(words.vector("a force of the field"));
  constexpr int kPoints = JelloWorld::kSide * JelloWorld::kSide * JelloWorld::kSide;
  for (int k = 0; k < kPoints; ++k) world.positions.push_back(words.vector("a position"));
  for (int k = 0; k < kPoints; ++k) world.velocities.push_back(words.vector("a velocity"));
  if (const std::string_view more = words.next(); !more.empty()) words.wrong(fmt::format("found '{:.40}' after the last velocity, wanted the end of the file", more));
  return world;
}

}  // namespace effuse::importers
