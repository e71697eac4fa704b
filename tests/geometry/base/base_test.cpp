#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <thread>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/hash.h"
#include "geometry/base/random.h"
#include "geometry/base/state_io.h"
#include "geometry/base/zones.h"

namespace effuse {
namespace {

namespace fs = std::filesystem;

/// A folder of its own for each test, gone afterwards.
class Files : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("effuse-files-" + std::to_string(::getpid()) + "-" + testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::size_t entries() const { return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator())); }
  fs::path folder_;
};

TEST_F(Files, WhatIsWrittenIsReadBackWhole) {
  std::string bytes(200000, '\0');
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(random_bits(1, 2, i));
  write_file(folder_ / "a" / "b" / "data.bin", bytes);
  EXPECT_EQ(read_file(folder_ / "a" / "b" / "data.bin"), bytes);
  write_file(folder_ / "a" / "b" / "data.bin", "shorter");
  EXPECT_EQ(read_file(folder_ / "a" / "b" / "data.bin"), "shorter");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "a" / "b"), fs::directory_iterator()), 1) << "a temporary file was left";
}

TEST_F(Files, WithoutCommitNothingAppears) {
  {
    AtomicFile file(folder_ / "frame.ply");
    EXPECT_EQ(file.temporary().extension(), ".ply");
    EXPECT_NE(file.temporary(), folder_ / "frame.ply");
    std::ofstream(file.temporary()) << "half";
  }
  EXPECT_EQ(entries(), 0u);
}

TEST_F(Files, CommitWithoutAFileThrows) {
  AtomicFile file(folder_ / "frame.ply");
  EXPECT_THROW(file.commit(), std::runtime_error);
  EXPECT_EQ(entries(), 0u);
}

TEST_F(Files, AFileBeyondTheLimitIsAResourceErrorAndLeavesTheOldOneWhole) {
  write_file(folder_ / "state", "old");
  // A file size limit fails as a full disk does, with an error from write.
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 1 << 16;
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(write_file(folder_ / "state", std::string(1 << 20, 'x')), ResourceError);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(read_file(folder_ / "state"), "old");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, SeveralWhoWriteOnePathAtOnceEachWriteAWholeFile) {
  const fs::path path = folder_ / "frame.ply";
  constexpr std::size_t kWriters = 6, kTimes = 8, kBytes = 1 << 18;
  std::vector<pid_t> children;
  for (std::size_t w = 0; w < kWriters; ++w) {
    const pid_t pid = ::fork();
    if (pid == 0) {
      try {
        for (std::size_t k = 0; k < kTimes; ++k) {
          write_file(path, std::string(kBytes, static_cast<char>('a' + w)));
          AtomicFile file(path);
          std::ofstream(file.temporary()) << std::string(kBytes, static_cast<char>('A' + w));
          file.commit();
        }
      } catch (...) {
        ::_exit(1);
      }
      ::_exit(0);
    }
    children.push_back(pid);
  }
  for (int look = 0; look < 200; ++look) {
    if (!fs::exists(path)) continue;
    const std::string bytes = read_file(path);
    ASSERT_EQ(bytes, std::string(kBytes, bytes.empty() ? '?' : bytes.front())) << "half of one, half of another";
  }
  for (const pid_t pid : children) {
    int status = -1;
    ::waitpid(pid, &status, 0);
    EXPECT_EQ(status, 0) << "one was in another's way";
  }
  EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, NothingIsLeftOfAWriteThatIsKilled) {
#ifdef O_TMPFILE
  const int unnamed = ::open(folder_.c_str(), O_TMPFILE | O_WRONLY, 0600);
#else
  const int unnamed = -1;
#endif
  if (unnamed < 0) GTEST_SKIP() << "this file system has no files without a name";
  ::close(unnamed);
  const std::string bytes(1 << 21, 'x');
  std::size_t whole = 0;
  for (int k = 0; k < 20; ++k) {
    const pid_t pid = ::fork();
    if (pid == 0) {
      for (int n = 0;; ++n) write_file(folder_ / fmt::format("{}.{}.state", k, n), bytes);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(2000 + 700 * k));
    ::kill(pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
      EXPECT_EQ(entry.file_size(), bytes.size()) << entry.path();
      EXPECT_EQ(entry.path().string().find(".part"), std::string::npos) << entry.path();
      ++whole;
      fs::remove(entry.path());
    }
  }
  EXPECT_GT(whole, 0u);
}

TEST_F(Files, TheLongestNamesAreWritten) {
  const std::string name = std::string(251, 'n') + ".ply";
  for (int k = 0; k < 2; ++k) write_file(folder_ / name, "x");
  EXPECT_TRUE(fs::exists(folder_ / name));
  AtomicFile file(folder_ / name);
  std::ofstream(file.temporary()) << "y";
  file.commit();
  EXPECT_EQ(read_file(folder_ / name), "y");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, ATargetThatIsAFolderThrowsAndLeavesNothing) {
  fs::create_directories(folder_ / "taken" / "inside");
  EXPECT_THROW(write_file(folder_ / "taken", "x"), std::runtime_error);
  EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, AMissingFileOrAFolderIsNamed) {
  for (const fs::path& path : {folder_ / "none", folder_}) {
    try {
      read_file(path);
      FAIL() << path;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos) << error.what();
    }
  }
}

TEST(Error, FaultsAreOneALineWithTheirPlaces) {
  std::vector<Fault> faults;
  faults.push_back({Place{"a.toml", 3, 7}, "first"});
  faults.push_back({Place{"a.toml", 9, 0}, "second"});
  faults.push_back({Place{}, "third"});
  const InputError error(faults);
  EXPECT_STREQ(error.what(), "a.toml:3:7: first\na.toml:9: second\nthird");
}

TEST(Error, TheNearestNameIsTheOneATypingErrorAway) {
  const std::vector<std::string> names{"viscosity", "density", "temperature"};
  EXPECT_EQ(nearest_name("viscosty", names), "viscosity");
  EXPECT_EQ(nearest_name("tempreature", names), "temperature");
  EXPECT_EQ(nearest_name("wind", names), "");
  EXPECT_EQ(nearest_name("Z", {"x", "y", "z"}), "z") << "as near as the others, but for the letter";
}

TEST(CheckDeathTest, ABrokenPromisePrintsBothValues) { EXPECT_DEATH(CHECK_EQ(2 + 2, 5), "CHECK failed: 2 \\+ 2 == 5: 4 against 5"); }

TEST(Random, UniformHasMeanVarianceAndFlatBins) {
  constexpr int n = 200000;
  Real sum = 0, sum2 = 0;
  std::vector<int> bins(50, 0);
  for (int i = 0; i < n; ++i) {
    const Real u = random_uniform(11, 4, static_cast<std::uint64_t>(i));
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    sum += u;
    sum2 += u * u;
    ++bins[static_cast<std::size_t>(u * 50)];
  }
  // Five standard deviations of the mean of n draws.
  EXPECT_NEAR(sum / n, 0.5, 5 * std::sqrt(1 / 12.0 / n));
  EXPECT_NEAR(sum2 / n - 0.25, 1 / 12.0, 5 * 0.08 / std::sqrt(Real(n)));
  Real chi2 = 0;
  for (int count : bins) chi2 += (count - n / 50.0) * (count - n / 50.0) / (n / 50.0);
  EXPECT_LT(chi2, 49 + 5 * std::sqrt(2 * 49.0)) << "chi squared of 49 degrees of freedom";
}

TEST(Random, NormalHasTheMomentsOfABellCurve) {
  constexpr int n = 200000;
  Real m1 = 0, m2 = 0, m4 = 0;
  for (int i = 0; i < n; ++i) {
    const Real x = random_normal(5, 1, static_cast<std::uint64_t>(i));
    m1 += x, m2 += x * x, m4 += x * x * x * x;
  }
  EXPECT_NEAR(m1 / n, 0, 5 / std::sqrt(Real(n)));
  EXPECT_NEAR(m2 / n, 1, 5 * std::sqrt(2.0 / n));
  EXPECT_NEAR(m4 / n, 3, 5 * std::sqrt(96.0 / n));
}

TEST(Random, NeighbouringSeedsStreamsAndIndicesAreUncorrelated) {
  constexpr int n = 100000;
  Real seed = 0, stream = 0, index = 0;
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::uint64_t>(i);
    const Real u = random_uniform(1, 1, k) - 0.5;
    seed += u * (random_uniform(2, 1, k) - 0.5);
    stream += u * (random_uniform(1, 2, k) - 0.5);
    index += u * (random_uniform(1, 1, k + 1) - 0.5);
  }
  const Real bound = 5 * (1 / 12.0) / std::sqrt(Real(n));
  EXPECT_LT(std::abs(seed / n), bound);
  EXPECT_LT(std::abs(stream / n), bound);
  EXPECT_LT(std::abs(index / n), bound);
}

TEST(Random, EveryInputBitFlipsEachOutputBitHalfTheTime) {
  constexpr int n = 4000;
  for (int bit = 0; bit < 64; bit += 7) {
    for (int word = 0; word < 3; ++word) {
      Real flipped = 0;
      for (std::uint64_t i = 0; i < n; ++i) {
        std::uint64_t in[3] = {i, i * 3, i * 7};
        const std::uint64_t before = random_bits(in[0], in[1], in[2]);
        in[word] ^= 1ULL << bit;
        flipped += __builtin_popcountll(before ^ random_bits(in[0], in[1], in[2]));
      }
      EXPECT_NEAR(flipped / (64.0 * n), 0.5, 0.01) << "word " << word << " bit " << bit;
    }
  }
}

TEST(Hash, OneFlippedBitOrAMovedElementChangesIt) {
  std::vector<Vec3> x(100, Vec3(1, 2, 3));
  const auto hash = [&](std::size_t cut) {
    StateHash h;
    h.add(std::span<const Vec3>(x).first(cut));
    h.add(std::span<const Vec3>(x).subspan(cut));
    h.add(1.5);
    return h.value();
  };
  const std::uint64_t before = hash(50);
  EXPECT_EQ(before, hash(50));
  EXPECT_NE(before, hash(49)) << "arrays traded an element unseen";
  std::set<std::uint64_t> seen{before};
  for (std::size_t i = 0; i < x.size(); ++i) {
    auto* bits = reinterpret_cast<unsigned char*>(x[i].data());
    for (std::size_t byte = 0; byte < 24; ++byte) {
      bits[byte] ^= 1;
      EXPECT_TRUE(seen.insert(hash(50)).second) << i << " " << byte;
      bits[byte] ^= 1;
    }
  }
}

TEST(Hash, HexIsSixteenDigits) { EXPECT_EQ(StateHash().hex().size(), 16u); }

struct Saved {
  std::vector<Vec3> x{{1, 2, 3}, {4, 5, 6}};
  std::vector<std::uint64_t> id{7, 8, 9};
  Real time = 0.25;
  std::string name = "lava";
  std::vector<Real> none;
};

std::string save(const Saved& s) {
  StateWriter out;
  out.array("x", s.x);
  out.array("id", s.id);
  out.value("time", s.time);
  out.text("name", s.name);
  out.array("none", s.none);
  return out.bytes();
}

TEST(StateIo, WhatIsWrittenIsReadBack) {
  const std::string bytes = save({});
  Saved back{{}, {}, 0, "", {1, 2}};
  StateReader in(bytes, "checkpoint");
  in.array("x", back.x);
  in.array("id", back.id);
  in.value("time", back.time);
  in.text("name", back.name);
  in.array("none", back.none);
  EXPECT_TRUE(in.done());
  EXPECT_EQ(back.x, Saved().x);
  EXPECT_EQ(back.id, Saved().id);
  EXPECT_EQ(back.time, 0.25);
  EXPECT_EQ(back.name, "lava");
  EXPECT_TRUE(back.none.empty());
}

TEST(StateIo, EveryTruncationIsRefused) {
  const std::string bytes = save({});
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const std::string cut = bytes.substr(0, size);
    StateReader in(cut, "checkpoint");
    Saved back;
    EXPECT_THROW(
        {
          in.array("x", back.x);
          in.array("id", back.id);
          in.value("time", back.time);
          in.text("name", back.name);
          in.array("none", back.none);
        },
        InputError)
        << size;
  }
}

TEST(StateIo, AnotherNameSizeOrTypeIsRefused) {
  const std::string bytes = save({});
  {
    StateReader in(bytes, "checkpoint");
    std::vector<Vec3> v;
    try {
      in.array("v", v);
      FAIL();
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("checkpoint: found 'x', wanted 'v'"), std::string::npos) << error.what();
    }
  }
  {
    StateReader in(bytes, "checkpoint");
    std::vector<float> x;
    EXPECT_THROW(in.array("x", x), InputError);
  }
  {
    StateReader in(bytes, "checkpoint");
    Real x = 0;
    EXPECT_THROW(in.value("x", x), InputError);
  }
}

TEST(StateIo, AFlippedCountDoesNotAllocateTheWorld) {
  std::string bytes = save({});
  for (std::size_t byte = 0; byte < 40; ++byte) {
    std::string broken = bytes;
    broken[byte] = static_cast<char>(broken[byte] ^ 0x80);
    StateReader in(broken, "checkpoint");
    std::vector<Vec3> x;
    std::vector<std::uint64_t> id;
    try {
      in.array("x", x);
      in.array("id", id);
    } catch (const InputError&) {
    }
    EXPECT_LT(x.size(), 100u);
  }
}

void spin(double seconds) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < until) {
  }
}

TEST(Zones, SelfTimeExcludesInnerZonesAndTotalIncludesThem) {
  Profile profile;
  {
    const ProfileScope scope(profile);
    for (int k = 0; k < 3; ++k) {
      ZONE("outer");
      spin(0.002);
      {
        ZONE("inner");
        spin(0.004);
      }
    }
    COUNT("pairs", 5);
    COUNT("pairs", 7);
  }
  std::map<std::string, ZoneRow> rows;
  for (const ZoneRow& row : profile.zones()) rows[row.name] = row;
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows["outer"].calls, 3u);
  EXPECT_NEAR(rows["outer"].total_s, rows["outer"].self_s + rows["inner"].total_s, 1e-9);
  EXPECT_GE(rows["inner"].self_s, 0.012);
  EXPECT_GE(rows["outer"].self_s, 0.006);
  ASSERT_EQ(profile.counters().size(), 1u);
  EXPECT_EQ(profile.counters()[0].value, 12u);
  EXPECT_LE(rows["outer"].total_s, profile.elapsed_s());
  EXPECT_NE(profile.table().find("inner"), std::string::npos);
}

TEST(Zones, AZoneInsideItselfCountsItsTotalOnce) {
  Profile profile;
  {
    const ProfileScope scope(profile);
    ZONE("zone");
    {
      ZONE("zone");
      spin(0.003);
    }
  }
  const ZoneRow row = profile.zones().at(0);
  EXPECT_EQ(row.calls, 2u);
  EXPECT_NEAR(row.total_s, row.self_s, 1e-6);
}

TEST(Zones, WithoutAProfileOrOnAnotherThreadNothingIsRecorded) {
  Profile profile;
  {
    ZONE("before");
    COUNT("before", 1);
  }
  {
    const ProfileScope scope(profile);
    std::thread([] { ZONE("elsewhere"); }).join();
  }
  EXPECT_TRUE(profile.zones().empty());
  EXPECT_TRUE(profile.counters().empty());
}

}  // namespace
}  // namespace effuse
