#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>

#include "geometry/base/error.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/collide/slide.h"
#include "importers/mesh/import_mesh.h"
#include "tests/geometry/collide/truth.h"

/// Real meshes as obstacles: closed ones against every triangle asked, messy ones for what must not happen. The files
/// are not part of the repository; without them these are skipped.
namespace effuse::geometry {
namespace {

std::filesystem::path meshes(const char* kind) {
  const char* given = std::getenv("EFFUSE_SHARED_DATA");
  const std::filesystem::path folder = (given ? std::filesystem::path(given) : std::filesystem::path(EFFUSE_SOURCE_DIR "/../shared/data")) / "meshes" / kind;
  std::error_code error;
  return std::filesystem::is_directory(folder, error) ? folder : std::filesystem::path();
}

std::vector<std::filesystem::path> files_of(const char* kind) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(meshes(kind))) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// Which solid parts of the mesh hold p, by solid angles.
std::vector<TriMesh> parts_of(const CollisionMesh& shape) {
  // Joined through shared vertices would be too much: the parts are the shape's own, told apart by their triangles' neighbours.
  const TriMesh& mesh = shape.mesh();
  std::map<std::pair<Index, Index>, std::vector<Index>> edges;
  for (Index t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) edges[std::minmax(mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3])].push_back(t);
  std::vector<Index> part(mesh.triangles.size());
  for (Index t = 0; t < part.size(); ++t) part[t] = t;
  const std::function<Index(Index)> root = [&](Index t) { return part[t] == t ? t : part[t] = root(part[t]); };
  for (const auto& [ends, around] : edges)
    if (around.size() == 2) part[root(around[0])] = root(around[1]);
  std::map<Index, TriMesh> parts;
  for (Index t = 0; t < part.size(); ++t) {
    TriMesh& mine = parts[root(t)];
    mine.positions = mesh.positions;
    mine.triangles.push_back(mesh.triangles[t]);
  }
  std::vector<TriMesh> closed;
  for (auto& [first, mine] : parts) {
    std::map<std::pair<Index, Index>, int> count;
    for (const auto& t : mine.triangles)
      for (int k = 0; k < 3; ++k) ++count[std::minmax(t[k], t[(k + 1) % 3])];
    if (std::all_of(count.begin(), count.end(), [](const auto& e) { return e.second == 2; })) closed.push_back(std::move(mine));
  }
  return closed;
}

TEST(CleanFilesSlow, TwoThousandPosesOfEachAgreeWithEveryTriangleAsked) {
  if (meshes("clean").empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  for (const auto& file : files_of("clean")) {
    SCOPED_TRACE(file.filename().string());
    const CollisionMesh shape(importers::import_mesh(file).mesh);
    const bool solid = shape.solid();
    Real worst = 0, worst_angle = 0;
    std::size_t inside_count = 0;
    for (std::uint64_t k = 0; k < 2000; ++k) {
      const Real size = shape.bounds().sizes().norm();
      const RigidPose pose = truth::random_pose(171, k, size);
      const Vec3 local = truth::random_point(shape.mesh(), 172, k), p = pose.world(local);
      Obstacles obstacles;
      obstacles.add({shape, RigidMotion(pose), 0, 1});
      obstacles.update();
      Contact contact;
      ASSERT_EQ(obstacles.contacts(p, std::numeric_limits<Real>::infinity(), std::span(&contact, 1)), 1);
      // In the frame of the mesh, where its coordinates are exact.
      const truth::Nearest expected = truth::nearest(shape.mesh(), local);
      const auto distance = static_cast<Real>(expected.distance);
      const Real rounding = 1e-14 * (p.cwiseAbs().maxCoeff() + shape.bounds().center().norm() + size);
      const Real error = std::max(Real{0}, std::abs(std::abs(contact.distance) - distance) - rounding);
      ASSERT_LE(error, 1e-6 * distance) << k;
      worst = std::max(worst, error / distance);
      if (distance < 1e3 * rounding) continue;  // too near for a direction of 0.1 degrees in these coordinates
      const bool inside = solid && truth::winding(shape.mesh(), local) > 0.5;
      inside_count += inside;
      ASSERT_EQ(contact.distance < 0, inside) << k << " at " << distance;
      Real angle = kPi;
      for (const Vec3& towards : expected.towards) {
        const Vec3 normal = pose.orientation * (inside ? towards : Vec3(-towards));
        angle = std::min(angle, std::atan2(normal.cross(contact.normal).norm(), normal.dot(contact.normal)));
      }
      ASSERT_LE(angle, 0.1 * kPi / 180) << k << " at " << distance;
      worst_angle = std::max(worst_angle, angle);
      if (!inside) continue;
      // Pushed out by its depth along the normal it is on the surface, and no shorter way leads there.
      const Vec3 out = pose.body(p - contact.distance * contact.normal);
      ASSERT_LE(std::abs(shape.signed_distance(out)), 1e-6 * distance + rounding) << k;
    }
    if (solid) {
      EXPECT_GT(inside_count, 100u);
    }
    RecordProperty(file.stem().string() + "_distance", fmt::format("{:.1e}", worst));
    RecordProperty(file.stem().string() + "_angle_deg", fmt::format("{:.1e}", worst_angle * 180 / kPi));
  }
}

TEST(MessyFilesSlow, NothingIsInsideAClosedPartAfterSettling) {
  if (meshes("messy").empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  std::size_t used = 0;
  for (const auto& file : files_of("messy")) {
    SCOPED_TRACE(file.filename().string());
    TriMesh mesh;
    try {
      mesh = importers::import_mesh(file).mesh;
    } catch (const InputError& error) {
      EXPECT_GT(std::string(error.what()).size(), file.string().size() + 10) << "a refusal says why";
      continue;
    }
    const CollisionMesh shape(mesh);
    ++used;
    const std::vector<TriMesh> solids = parts_of(shape);
    EXPECT_GE(solids.size(), shape.report().solids) << to_string(shape.report());
    Obstacles obstacles;
    obstacles.add({shape, RigidMotion(), 0, 1});
    obstacles.update();
    const Real size = shape.bounds().sizes().norm();
    const std::uint64_t points = shape.report().triangles > 10000 ? 200 : 1000;
    std::size_t were_inside = 0, most_rounds = 0;
    for (std::uint64_t k = 0; k < points; ++k) {
      Vec3 x = truth::random_point(shape.mesh(), 181, k);
      const Vec3 start = x;
      // Settling: out of the surface by the contacts, as a flow's projection does; in a cleft too narrow for it with
      // less and less clearance.
      Real clearance = 1e-4 * size;
      int round = 0;
      for (; round < 64; ++round) {
        if (round % 8 == 7) clearance /= 4;
        Contact contact;
        if (obstacles.contacts(x, clearance, std::span(&contact, 1)) == 0) {
          // Deeper than the reach: the whole depth is asked.
          if (!shape.inside(x)) break;
          ASSERT_EQ(obstacles.contacts(x, size, std::span(&contact, 1)), 1);
        }
        if (contact.distance >= clearance / 2) break;
        x += (clearance - contact.distance) * contact.normal;
      }
      most_rounds = std::max(most_rounds, static_cast<std::size_t>(round));
      for (const TriMesh& solid : solids) {
        if (!truth::bounds(solid).contains(x) && !truth::bounds(solid).contains(start)) continue;
        were_inside += std::abs(truth::winding(solid, start)) > 0.5;
        ASSERT_LT(std::abs(truth::winding(solid, x)), 0.5) << k << " after " << round << " rounds, from " << start.transpose();
      }
      // And a particle's step there ends outside as well.
      const Slid slid = slide(obstacles, start, 0.1 * size * truth::unit(182, k), {0, 0, 0}, 1e-4 * size);
      ASSERT_TRUE(slid.x.allFinite());
      for (const TriMesh& solid : solids)
        if (truth::bounds(solid).contains(slid.x)) {
          ASSERT_LT(std::abs(truth::winding(solid, slid.x)), 0.5) << k << " slid from " << start.transpose();
        }
    }
    RecordProperty(file.stem().string() + "_inside", std::to_string(were_inside));
    RecordProperty(file.stem().string() + "_rounds", std::to_string(most_rounds));
  }
  EXPECT_GT(used, 25u);
}

TEST(InvalidFiles, AreRefusedWithAReasonOrMakeAnObstacle) {
  if (meshes("invalid").empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  std::size_t refused = 0;
  for (const auto& file : files_of("invalid")) {
    try {
      const CollisionMesh shape(importers::import_mesh(file).mesh);
      EXPECT_TRUE(shape.nearest(shape.bounds().center()));
    } catch (const InputError& error) {
      ++refused;
      EXPECT_GT(std::string(error.what()).size(), file.string().size() + 10) << error.what();
    }
  }
  EXPECT_GT(refused, 8u);
}

}  // namespace
}  // namespace effuse::geometry
