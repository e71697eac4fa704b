#include "geometry/fracture/fractured_body.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/collide/convex_hull.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/mesh/weld.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

struct Sample {
  const char* name;
  TriMesh mesh;
  CellOptions options;
};

std::vector<Sample> samples() {
  const TriMesh box = make_box(Vec3(100, -3, 2), Vec3(104, -2.5, 4));
  TriMesh turned = make_sphere(Vec3(0, 0, 0), 1.5, 2);
  for (Vec3& p : turned.positions) p = Quat(0.8, 0.1, -0.3, 0.5).normalized() * p + Vec3(1000, 2000, 30);
  return {
      {"box", box, {.cells = 30}},
      {"box near", box, {.layout = CellLayout::kNear, .cells = 30, .centre = Vec3(102, -3, 3), .reach = 0.5}},
      {"box slabs", box, {.layout = CellLayout::kSlabs, .cells = 30}},
      {"box bricks", box, {.layout = CellLayout::kBricks, .cells = 30}},
      {"sphere", turned, {.cells = 25, .seed = 7}},
      {"torus", make_torus(Vec3(5, 5, 5), 2, 0.6, 24, 12), {.cells = 12, .seed = 3}},
      {"one cell", box, {.cells = 1}},
  };
}

TriMesh welded(TriMesh mesh) {
  weld(mesh);
  return mesh;
}

TEST(FracturedBody, CellsFillTheBodyAndEachIsClosed) {
  for (const Sample& s : samples()) {
    const FracturedBody body = fracture(s.mesh, cell_regions(s.mesh, s.options));
    const Real volume = signed_volume(s.mesh);
    Real sum = 0;
    for (Index c = 0; c < body.cells.size(); ++c) {
      const Index one[] = {c};
      const TriMesh cell = welded(surface_of(body, one));
      const MeshReport report = validate(cell);
      EXPECT_TRUE(report.closed() && report.oriented()) << s.name << " cell " << c << ": " << to_string(report);
      EXPECT_NEAR(signed_volume(cell), body.cells[c].mass.volume, 1e-9 * volume) << s.name;
      EXPECT_GT(body.cells[c].mass.volume, 0) << s.name;
      sum += body.cells[c].mass.volume;
    }
    EXPECT_NEAR(sum, volume, 1e-9 * volume) << s.name;
    EXPECT_GE(body.cells.size(), s.options.cells * 4 / 5) << s.name;
  }
}

// What two cells share is the same from either side, and all of a cell's surface is the body's own or shared.
TEST(FracturedBody, NeighboursAgreeOnWhatTheyShare) {
  for (const Sample& s : samples()) {
    const FracturedBody body = fracture(s.mesh, cell_regions(s.mesh, s.options));
    std::vector<Index> all(body.cells.size());
    std::iota(all.begin(), all.end(), Index{0});
    Real outer = 0;
    std::map<std::pair<Index, Index>, Real> area;
    for (Index c = 0; c < body.cells.size(); ++c)
      for (const CellFace& face : body.cells[c].faces) {
        Vec3 n = Vec3::Zero();
        for (std::size_t k = 1; k + 1 < face.loop.size(); ++k)
          n += (body.vertices[face.loop[k]] - body.vertices[face.loop[0]]).cross(body.vertices[face.loop[k + 1]] - body.vertices[face.loop[0]]) / 2;
        if (face.beyond == kOuterFace) outer += n.norm();
        else area[{c, face.beyond}] += n.norm();
      }
    const Real whole = surface_area(s.mesh);
    EXPECT_NEAR(outer, whole, 1e-8 * whole) << s.name;
    for (const auto& [pair, a] : area) {
      const Real back = area[{pair.second, pair.first}];
      EXPECT_NEAR(a, back, 1e-7 * whole) << s.name << " " << pair.first << " " << pair.second;
    }
    for (const CellInterface& i : body.interfaces) {
      const Real here = area[{i.a, i.b}];
      EXPECT_NEAR(i.area, here, 1e-7 * whole) << s.name;
      EXPECT_GT(i.normal.dot(body.cells[i.b].mass.centre - body.cells[i.a].mass.centre), 0) << s.name;
    }
    const MeshReport report = validate(welded(surface_of(body, all)));
    EXPECT_TRUE(report.closed()) << s.name << ": " << to_string(report);
    const MassProperties mass = mass_of(body, all), exact = mass_properties(s.mesh);
    EXPECT_LT((mass.centre - exact.centre).norm(), 1e-9 * (1 + exact.centre.norm()));
    EXPECT_LT((mass.inertia - exact.inertia).norm(), 1e-8 * exact.inertia.norm()) << s.name;
  }
}

TEST(FracturedBody, PartsOfItAreClosedToo) {
  for (const Sample& s : samples()) {
    const FracturedBody body = fracture(s.mesh, cell_regions(s.mesh, s.options));
    std::vector<Index> half;
    for (Index c = 0; c < body.cells.size(); c += 2) half.push_back(c);
    Real sum = 0;
    for (const Index c : half) sum += body.cells[c].mass.volume;
    const TriMesh part = welded(surface_of(body, half));
    EXPECT_TRUE(validate(part).closed()) << s.name << ": " << to_string(validate(part));
    EXPECT_NEAR(signed_volume(part), sum, 1e-9 * body.volume) << s.name;
    EXPECT_TRUE(CollisionMesh(part).solid()) << s.name << ": " << to_string(CollisionMesh(part).report());
  }
}

TEST(FracturedBody, APointLiesInTheCellThatHoldsIt) {
  for (const Sample& s : samples()) {
    const FracturedBody body = fracture(s.mesh, cell_regions(s.mesh, s.options));
    for (Index c = 0; c < body.cells.size(); ++c) {
      if (!body.cells[c].convex) continue;
      EXPECT_EQ(body.cell_at(body.cells[c].mass.centre), c) << s.name;
    }
  }
}

TEST(FracturedBody, TheSameBitsOnAnyNumberOfThreads) {
  const TriMesh torus = make_torus(Vec3(5, 5, 5), 2, 0.6, 16, 8), box = make_box(Vec3::Zero(), Vec3(1, 2, 3));
  for (const TriMesh& mesh : {torus, box}) {
    std::vector<Vec3> first;
    for (const int threads : {1, 4}) {
      const ThreadLimit limit(threads);
      const FracturedBody body = fracture(mesh, cell_regions(mesh, {.cells = 10}));
      if (first.empty()) first = body.vertices;
      EXPECT_TRUE(first == body.vertices);
    }
  }
}

TEST(FracturedBody, BricksLieInRunningBond) {
  const TriMesh wall = make_box(Vec3(0, 0, 0), Vec3(4, 0.3, 2));
  const CellOptions options{.layout = CellLayout::kBricks, .cells = 40, .axis = 2, .flatness = 2};
  const FracturedBody body = fracture(wall, cell_regions(wall, options));
  EXPECT_NEAR(static_cast<Real>(body.cells.size()), 40, 8);
  // An inner brick rests on two and carries two; beside it lies one on either side.
  std::vector<int> above(body.cells.size(), 0);
  for (const CellInterface& i : body.interfaces)
    if (i.normal.z() > 0.9) ++above[i.a];
  EXPECT_GT(std::count(above.begin(), above.end(), 2), 15);
}

TEST(FracturedBody, NearSeedsLieNearAndSlabsAreFlat) {
  const TriMesh box = make_box(Vec3::Zero(), Vec3(4, 4, 4));
  const auto share_near = [&](CellLayout layout) {
    const FracturedBody body = fracture(box, cell_regions(box, {.layout = layout, .cells = 100, .centre = Vec3(0, 2, 2), .reach = 1}));
    return static_cast<Real>(std::count_if(body.cells.begin(), body.cells.end(), [](const FractureCell& c) { return (c.mass.centre - Vec3(0, 2, 2)).norm() < 1.5; })) / 100;
  };
  EXPECT_GT(share_near(CellLayout::kNear), 0.4);
  EXPECT_LT(share_near(CellLayout::kUniform), 0.25);
  const FracturedBody slabs = fracture(box, cell_regions(box, {.layout = CellLayout::kSlabs, .cells = 100, .axis = 2, .flatness = 3}));
  Real thick = 0, wide = 0;
  for (const FractureCell& cell : slabs.cells) {
    Box3 b;
    for (const CellFace& face : cell.faces)
      for (const Index i : face.loop) b.extend(slabs.vertices[i]);
    thick += b.sizes().z();
    wide += (b.sizes().x() + b.sizes().y()) / 2;
  }
  EXPECT_NEAR(wide / thick, 3, 0.8);
}

TEST(FracturedBody, ABrokenMeshGetsOneClearSentence) {
  TriMesh open = make_box(Vec3::Zero(), Vec3(1, 1, 1));
  open.triangles.pop_back();
  const std::vector<CellRegion> two = voronoi_regions(std::vector<Vec3>{Vec3(0.2, 0.5, 0.5), Vec3(0.8, 0.5, 0.5)}, Box3(Vec3::Zero(), Vec3::Ones()));
  TriMesh crossing = make_box(Vec3::Zero(), Vec3(1, 1, 1));
  append(crossing, make_box(Vec3(0.5, 0.5, 0.5), Vec3(1.5, 1.5, 1.5)));
  TriMesh nested = make_box(Vec3::Zero(), Vec3(1, 1, 1));
  append(nested, make_box(Vec3(0.4, 0.4, 0.4), Vec3(0.6, 0.6, 0.6)));
  for (const auto& [mesh, word] : {std::pair(open, "open"), {crossing, "cuts through itself"}, {nested, "in one another"}}) {
    try {
      fracture(mesh, two);
      FAIL() << word;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace effuse::geometry
