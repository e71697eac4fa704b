#include "importers/read_apart.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <new>
#include <thread>
#include <vector>

#include "geometry/base/parallel.h"
#include "importers/mesh/import_mesh.h"
#include "importers/terrain/import_dem.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::string told(const ReadLimits& limits, const std::function<std::string()>& read) {
  return refusal([&] { read_apart("thing.xyz", limits, read); });
}

TEST(ReadApart, HandsBackWhatWasReadToTheBit) {
  std::string bytes(20'000'000, '\0');
  for (std::size_t k = 0; k < bytes.size(); ++k) bytes[k] = static_cast<char>(k * 2654435761u >> 13);
  EXPECT_EQ(read_apart("a", {true, 20, 0}, [&] { return bytes; }), bytes);
  EXPECT_EQ(read_apart("a", {true, 20, 0}, [] { return std::string(); }), "");
}

TEST(ReadApart, WhatTheChildDoesStaysThere) {
  int changed = 0;
  read_apart("a", {true, 20, 0}, [&] {
    changed = 1;
    return std::string();
  });
  EXPECT_EQ(changed, 0);
}

TEST(ReadApart, ItsRefusalsAreThrownHere) {
  try {
    read_apart("a", {true, 20, 0}, []() -> std::string {
      std::vector<Fault> faults(2);
      faults[0].place = Place{"b.obj", 3, 7};
      faults[0].message = "is wrong";
      faults[1].place = Place{"b.obj", 9};
      faults[1].message = "too";
      throw InputError(faults);
    });
    ADD_FAILURE();
  } catch (const InputError& error) {
    ASSERT_EQ(error.faults().size(), 2u);
    EXPECT_STREQ(error.what(), "b.obj:3:7: is wrong\nb.obj:9: too");
  }
  EXPECT_THROW(read_apart("a", {true, 20, 0}, []() -> std::string { throw ResourceError("disk full"); }), ResourceError);
  EXPECT_EQ(told({true, 20, 0}, []() -> std::string { throw std::runtime_error("odd\nbytes"); }), "thing.xyz: cannot be read: odd bytes");
}

TEST(ReadApart, ACrashIsASentence) {
  EXPECT_TRUE(contains(told({true, 20, 0}, []() -> std::string { std::abort(); }), "thing.xyz: its reader crashed (Aborted)"));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_TRUE(contains(told({true, 20, 0}, []() -> std::string {
                         std::raise(SIGSEGV);
                         return "";
                       }),
                       "its reader crashed (Segmentation fault)"));
#endif
}

TEST(ReadApart, AHangEndsInTime) {
  const auto start = Clock::now();
  const std::string text = told({true, 0.3, 0}, []() -> std::string {
    for (;;) ::usleep(1000);
  });
  EXPECT_TRUE(contains(text, "is not read after 0.3 s")) << text;
  EXPECT_TRUE(contains(text, "--read-limit")) << text;
  EXPECT_LT(seconds_since(start), 5);
}

TEST(ReadApart, EndlessMemoryEnds) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers map all memory there is";
#endif
  const std::string text = told({true, 60, std::uint64_t{200} << 20}, [] {
    std::vector<std::string> hoard;
    for (;;) hoard.emplace_back(std::size_t{1} << 20, 'x');
    return std::string();
  });
  EXPECT_TRUE(contains(text, "takes more than 200 MiB of memory")) << text;
  EXPECT_TRUE(contains(text, "--read-limit")) << text;
}

TEST(ReadApart, WorksAfterAndBesideParallelLoops) {
  std::vector<double> values(100000);
  parallel_for(values.size(), [&](std::size_t i) { values[i] = static_cast<double>(i); });
  // In the child the loop runs on one thread.
  const auto sum = [&] { return std::to_string(parallel_sum(values.size(), 0.0, [&](std::size_t i) { return values[i]; })); };
  const std::string here = sum();
  EXPECT_EQ(read_apart("a", {true, 20, 0}, sum), here);
  std::vector<std::string> results(8);
  {
    std::vector<std::jthread> threads;
    for (std::string& result : results)
      threads.emplace_back([&result] { result = read_apart("a", {true, 20, 0}, [] { return std::string(3'000'000, 'a'); }); });
  }
  for (const std::string& result : results) EXPECT_EQ(result.size(), 3'000'000u);
}

TEST(ReadApart, MeshesAndGridsAreTheSameApart) {
  const TestFolder folder;
  const std::string box = "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 0 0 3\nv 1 0 3\nv 1 2 3\nv 0 2 3\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
  const std::filesystem::path file = folder.write("box.obj", box);
  MeshOptions apart;
  apart.limits.apart = true;
  const MeshImport here = import_mesh(file), there = import_mesh(file, apart);
  EXPECT_EQ(here.mesh.positions, there.mesh.positions);
  EXPECT_EQ(here.mesh.triangles, there.mesh.triangles);
  EXPECT_EQ(here.notes, there.notes);
  EXPECT_EQ(refusal([&] { import_mesh(folder.write("bad.obj", "v 0 0 0\nf 1 2 3\n"), apart); }), refusal([&] { import_mesh(folder.write("bad.obj", "v 0 0 0\nf 1 2 3\n")); }));

  DemOptions dem;
  const std::filesystem::path whau = EFFUSE_SOURCE_DIR "/samples/scenes/maunga-whau.asc";
  const DemGrid grid = import_dem({whau}, dem);
  dem.limits.apart = true;
  const DemGrid grid_apart = import_dem({whau}, dem);
  EXPECT_EQ(grid.z, grid_apart.z);
  EXPECT_EQ(grid.crs, grid_apart.crs);
  EXPECT_EQ(grid.notes, grid_apart.notes);
}

TEST(ReadApart, LimitsAreReadAsPeopleWriteThem) {
  const ReadLimits limits = parse_read_limits("5 min, 4GB", {true, 0, 0});
  EXPECT_TRUE(limits.apart);
  EXPECT_EQ(limits.seconds, 300);
  EXPECT_EQ(limits.bytes, 4'000'000'000u);
  EXPECT_EQ(parse_read_limits("512MiB").bytes, std::uint64_t{512} << 20);
  EXPECT_EQ(parse_read_limits("2.5s").seconds, 2.5);
  for (const char* wrong : {"", "4", "GB", "-1s", "0s", "4 TB", "1s,", "nan s", "1e30GB"}) EXPECT_TRUE(contains(refusal([&] { parse_read_limits(wrong); }), "--read-limit: found")) << wrong;
}

}  // namespace
}  // namespace effuse::importers
