#include "skin/page/page.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"
#include "skin/color/lava_color.h"
#include "skin/page/page_bytes.h"
#include "tests/skin/page/unpack.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;
using nlohmann::json;

TriMesh lava() {
  TriMesh mesh = testing_meshes::tube(30, 2, 30, 16);
  color_lava(mesh);
  return mesh;
}

TriMesh ground() { return geometry::make_grid(Vec3(-10, -10, -1), Vec2(5, 5), 12, 4); }

/// The text of the element with that id.
std::string element(const std::string& html, const std::string& id) {
  const std::size_t at = html.find("id=\"" + id + "\"");
  if (at == std::string::npos) return "";
  const std::size_t begin = html.find('>', at) + 1;
  return html.substr(begin, html.find("</script>", begin) - begin);
}

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + what.size())) ++n;
  return n;
}

PageFrame frame_of(int number, TriMesh mesh, TriMesh others = {}) { return {number, number / 24.0, std::move(mesh), std::move(others)}; }

TEST(Page, HoldsTheMeshesItWasGiven) {
  PageAbout about;
  about.title = "Lava";
  Page page(about, ground());
  const TriMesh mesh = lava();
  page.add(frame_of(1, {}));
  page.add(frame_of(2, mesh));
  PageReport report;
  const std::string html = page.html(&report);
  EXPECT_EQ(report.frames, 2u);
  EXPECT_EQ(report.triangles, mesh.triangles.size());
  EXPECT_EQ(report.bytes, html.size());

  const json info = json::parse(element(html, "about")), meshes = json::parse(element(html, "meshes"));
  EXPECT_TRUE(info.at("frames").at(0).at("lava").is_null());
  const std::size_t id = info.at("frames").at(1).at("lava");
  const json& entry = meshes.at(id);
  PackedMesh packed;
  packed.vertices = entry.at("vertices");
  packed.triangles = entry.at("triangles");
  packed.box = entry.at("box").get<std::array<float, 6>>();
  packed.planes = entry.at("planes").get<std::vector<std::string>>();
  packed.bytes = testing_page::inflate_raw(testing_page::bytes_of_text85(element(html, "mesh" + std::to_string(id)), entry.at("bytes")));
  const testing_page::Unpacked back = testing_page::unpack(packed);
  EXPECT_EQ(back.positions.size(), mesh.positions.size());

  // The temperature of each vertex, found again by its place, is right to half a 255th of the range.
  ASSERT_EQ(packed.planes, (std::vector<std::string>{"red", "green", "blue", "glow", "temperature", "speed", "crust"}));
  const double low = entry.at("ranges").at("temperature").at(0), high = entry.at("ranges").at("temperature").at(1);
  EXPECT_NEAR(low, 900, 0.01);
  EXPECT_NEAR(high, 1470, 0.01);
  for (std::size_t v = 0; v < back.positions.size(); ++v) {
    const double truth = 1470 - 570 * back.positions[v].x() / 30;  // as testing_meshes::tube has it
    ASSERT_NEAR(low + back.planes[v][4] / 255.0 * (high - low), truth, 0.51 * (high - low) / 255 + 0.02);
    ASSERT_NEAR(back.planes[v][6] / 255.0, back.positions[v].x() / 30, 0.51 / 255 + 1e-4);
  }
}

TEST(Page, GlowComesBackAsBrightAsItWas) {
  const TriMesh mesh = lava();
  const PageBytes bytes = lava_bytes(mesh);
  const std::vector<float>& glow = mesh.attributes.at("glow").values;
  ASSERT_EQ(bytes.planes[3].name, "glow");
  const Vec3 eye(0.2126, 0.7152, 0.0722);
  double brightest = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const double truth = eye.dot(Vec3(glow[3 * v], glow[3 * v + 1], glow[3 * v + 2])), seen = eye.dot(glow_of_byte(bytes.planes[3].values[v]));
    brightest = std::max(brightest, truth);
    // A byte is 3.9 K: by T^9 to T^17 or so 4 % of the light; half of it either way, and what is too dark to see.
    ASSERT_NEAR(seen, truth, 0.04 * truth + 2e-3);
  }
  EXPECT_GT(brightest, 1);
}

TEST(Page, WhatStandsStillIsThereOnce) {
  PageAbout about;
  Page page(about, {});
  const TriMesh house = geometry::make_box(Vec3(0, 0, 0), Vec3(1, 1, 1)), gone = geometry::make_box(Vec3(5, 0, 0), Vec3(6, 1, 1));
  page.add(frame_of(1, lava(), house));
  page.add(frame_of(2, lava(), house));
  page.add(frame_of(3, lava(), gone));
  const json frames = json::parse(element(page.html(), "about")).at("frames");
  EXPECT_EQ(frames.at(0).at("others"), frames.at(1).at("others"));
  EXPECT_NE(frames.at(0).at("others"), frames.at(2).at("others"));
}

TEST(Page, NamesCannotBreakOutOfIt) {
  PageAbout about;
  about.title = "</script><script>alert(1)</script> & \"Etna\" \xff\n\xc3\xa9";
  about.crs = "</script>";
  about.facts = {{"<b>", "</script>"}};
  about.series_times = {0, 1};
  about.series = {{"</script>", "<", "m", {0, std::numeric_limits<Real>::quiet_NaN()}}};
  Page page(about, ground());
  page.add(frame_of(1, lava()));
  const std::string html = page.html();
  EXPECT_EQ(html.find("alert(1)</script>"), std::string::npos);
  EXPECT_EQ(html.find("<b>"), html.find("<b></b>"));  // the program's own
  EXPECT_EQ(count(html, "<script"), count(html, "</script>"));
  const json info = json::parse(element(html, "about"));
  EXPECT_NE(info.at("title").get<std::string>().find("</script>"), std::string::npos);
  EXPECT_TRUE(info.at("series").at(0).at("values").at(1).is_null());
}

TEST(Page, AsksTheNetworkForNothing) {
  Page page({}, ground());
  page.add(frame_of(1, lava()));
  const std::string html = page.html();
  EXPECT_NE(html.find("default-src 'none'"), std::string::npos);
  for (const char* remote : {"http://", "https://", "src=\"", "@import", "url("}) EXPECT_EQ(html.find(remote), std::string::npos) << remote;
}

TEST(Page, RefusesMeshesThatAreNotWellFormed) {
  Page page({}, {});
  TriMesh bad = lava();
  bad.positions[3].x() = std::numeric_limits<Real>::quiet_NaN();
  try {
    page.add(frame_of(7, bad));
    FAIL() << "took it";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("frame 7"), std::string::npos) << error.what();
  }
}

TEST(Page, SamePageFromTheSameRun) {
  const auto make = [] {
    Page page({}, ground());
    page.add(frame_of(1, lava()));
    return page.html();
  };
  EXPECT_EQ(make(), make());
}

TEST(BlockBelow, HasAWallUnderEachBorderEdgeThatFacesOut) {
  const TriMesh block = block_below(ground());
  ASSERT_EQ(block.triangles.size(), 2u * 2 * (12 + 4));
  const Vec3 middle = geometry::bounds(block).center();
  for (std::size_t t = 0; t < block.triangles.size(); ++t) {
    const auto& c = block.triangles[t];
    const Vec3 a = block.positions[c[0]], normal = (block.positions[c[1]] - a).cross(block.positions[c[2]] - a).normalized();
    EXPECT_GT(normal.dot(block.normals[c[0]]), 0.99);
    EXPECT_GT(normal.dot(a - middle), 0);
    EXPECT_NEAR(normal.z(), 0, 1e-9);
  }
  EXPECT_TRUE(block_below(geometry::make_sphere(Vec3::Zero(), 1, 2)).triangles.empty());
}

}  // namespace
}  // namespace effuse::skin
