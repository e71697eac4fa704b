// `effuse skin --terrain`: ground counts in the particles' coordinates, wherever the file says that it lies on the map.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "geometry/base/files.h"
#include "samples/effuse/commands.h"

namespace effuse {
namespace {

namespace fs = std::filesystem;

TEST(SkinGround, AnOriginInTheGroundsFileDoesNotMoveIt) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("effuse.ground.{}", ::getpid());
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::string particles;
  for (int k = 0; k < 500; ++k) particles += fmt::format("{} {} {}\n", 10 + k % 10, 10 + k / 10 % 10, 0.5 + k / 100);
  write_file(folder / "block.xyz", particles);
  const std::string square = "v 0 0 0\nv 30 0 0\nv 30 30 0\nv 0 30 0\nf 1 2 3 4\n";
  write_file(folder / "plain.obj", square);
  write_file(folder / "placed.obj", "# effuse, metres, z up\n# origin: 2667400 6478700 0\n" + square);
  std::string skins[2];
  for (const auto& [k, ground] : {std::pair(0, "plain.obj"), {1, "placed.obj"}}) {
    SkinCommand c;
    c.particles = {folder / "block.xyz"};
    c.meshes = {folder / fmt::format("{}.obj", k)};
    c.particle_radius = 0.5;
    c.terrain = folder / ground;
    CommonOptions quiet;
    quiet.quiet = true;
    EXPECT_EQ(skin_particles(c, quiet), ExitCode::kDone);
    skins[k] = read_file(c.meshes.front());
  }
  EXPECT_GT(skins[0].size(), 10000u);
  EXPECT_EQ(skins[0], skins[1]);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace effuse
