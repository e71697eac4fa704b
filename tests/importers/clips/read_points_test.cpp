#include "importers/clips/read_points.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "geometry/base/error.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

class ReadPoints : public testing::Test {
 protected:
  ReadPoints() : folder_(fs::temp_directory_path() / ("effuse.points." + std::to_string(::getpid()))) { fs::create_directories(folder_); }
  ~ReadPoints() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::string fault(const std::string& name, const std::string& text) {
    try {
      read_points(write(name, text));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  fs::path folder_;
};

const std::string kTrc =
    "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\n50\t50\t3\t2\tmm\t50\nFrame#\tTime\tHip\t\t\tKnee\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    "1\t0.00\t1000\t2000\t3000\t10\t20\t30\n2\t0.02\t1100\t2000\t3000\t\t\t\n3\t0.04\t1200\t2000\t3000\t30\t20\t30\n";

TEST_F(ReadPoints, TrcIsTurnedUprightAndIntoMetres) {
  geometry::PointClip clip = read_points(write("a.trc", kTrc));
  ASSERT_EQ(clip.names, (std::vector<std::string>{"Hip", "Knee"}));
  ASSERT_EQ(clip.frames.size(), 3u);
  EXPECT_NEAR(clip.frame_time, 0.02, 1e-12);
  EXPECT_LT((clip.frames[0][0] - Vec3(1, -3, 2)).norm(), 1e-12);
  EXPECT_LT((clip.at(0.03)[0] - Vec3(1.15, -3, 2)).norm(), 1e-12);
  EXPECT_FALSE(clip.frames[1][1].allFinite()) << "was not seen";
  EXPECT_EQ(geometry::close_gaps(clip, 0), 0u);
  EXPECT_EQ(geometry::close_gaps(clip, 3), 1u);
  EXPECT_LT((clip.frames[1][1] - Vec3(0.02, -0.03, 0.02)).norm(), 1e-12);
}

TEST_F(ReadPoints, CsvIsReadAsItStands) {
  const geometry::PointClip clip = read_points(write("a.csv", "time,a.x,a.y,a.z\r\n1,0,0,1\r\n1.5,1,0,1\r\n2,,,\r\n"));
  EXPECT_EQ(clip.frame_time, 0.5);
  EXPECT_LT((clip.at(0.25)[0] - Vec3(0.5, 0, 1)).norm(), 1e-12);
  EXPECT_FALSE(clip.at(5)[0].allFinite());
}

TEST_F(ReadPoints, SaysWhatIsWrongAndInWhichLine) {
  const auto tells = [&](const std::string& name, const std::string& text, const char* part) {
    const std::string faults = fault(name, text);
    EXPECT_NE(faults.find(part), std::string::npos) << faults;
  };
  tells("b.txt", "x", "wanted trajectories");
  tells("b.csv", "a,b\n1,2\n2,3\n", "wanted time, name.x");
  tells("c.csv", "time,a.x,a.y,b.z\n0,1,1,1\n1,1,1,1\n", "'a.z'");
  tells("d.csv", "time,a.x,a.y,a.z\n0,1,1,1\n1,1,1\n", "3 fields");
  tells("e.csv", "time,a.x,a.y,a.z\n0,1,1,1\n1,1,1,1\n3,1,1,1\n", "equal distance");
  tells("f.csv", "time,a.x,a.y,a.z\n0,1,1,1\n1,1,x,1\n", "'x'");
  tells("b.trc", "PathFileType\n", "shorter");
  std::string inches = kTrc;
  inches.replace(inches.find("mm"), 2, "in");
  tells("c.trc", inches, "Units");
}

}  // namespace
}  // namespace effuse::importers
