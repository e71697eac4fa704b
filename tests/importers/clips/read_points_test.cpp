#include "importers/clips/read_points.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
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

/// As motion capture programs write a C3D file out as text.
const std::string kTracked =
    "NO_OF_FRAMES\t3\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nNO_OF_ANALOG\t0\nANALOG_FREQUENCY\t0\nDESCRIPTION\t--\n"
    "TIME_STAMP\t2014-06-17, 08:53:44\nDATA_INCLUDED\t3D\nMARKER_NAMES\tknee\tankle\n";
const std::string kSections =
    "Devices\n1000\n\tForce\nFrame\tSub Frame\tFx\n\t\tN\n1\t0\t5\n\n"
    "Trajectories\n200\n\t\tAnna:LKNE\t\t\tAnna:LANK\t\t\nFrame\tSub Frame\tX\tY\tZ\tX\tY\tZ\n\t\tmm\tmm\tmm\tmm\tmm\tmm\n"
    "101\t0\t1501.1\t2073.9\t102.8\t1440\t2052\t474\n102\t0\t1502.1\t2073.9\t102.8\t\t\t\n\nModel Outputs\n200\n";

TEST_F(ReadPoints, TheTextThatProgramsMakeOfC3dIsReadInMetres) {
  const Vec3 knee(1.5011, 2.0739, 0.1028), ankle(1.44, 2.052, 0.474);
  const auto near = [](const geometry::PointClip& clip, std::size_t frame, std::size_t marker, const Vec3& p) { return (clip.frames.at(frame).at(marker) - p).norm() < 1e-12; };
  for (const std::string rows : {"1501.1\t2073.9\t102.8\t1440\t2052\t474\n1502.1\t2073.9\t102.8\t0.000\t0.000\t0.000\n1503.1\t2073.9\t102.8\tNULL\tNULL\tNULL\n",
                                 "Frame\tTime\tknee X\tknee Y\tknee Z\tankle X\tankle Y\tankle Z\n1\t0.00\t1501.1\t2073.9\t102.8\t1440\t2052\t474\t\n2\t0.01\t1502.1\t2073.9\t102.8\t\t\t\n3\t0.02\t1503.1\t2073.9\t102.8\t\t\t\n"}) {
    const geometry::PointClip clip = read_points(write("a.tsv", kTracked + rows));
    EXPECT_EQ(clip.names, (std::vector<std::string>{"knee", "ankle"}));
    EXPECT_NEAR(clip.frame_time, 0.01, 1e-15);
    ASSERT_EQ(clip.frames.size(), 3u);
    EXPECT_TRUE(near(clip, 0, 0, knee) && near(clip, 0, 1, ankle) && near(clip, 2, 0, knee + Vec3(0.002, 0, 0)));
    EXPECT_FALSE(clip.frames[1][1].allFinite() || clip.frames[2][1].allFinite()) << "were not seen";
  }
  std::string commas = kSections;
  std::replace(commas.begin(), commas.end(), '\t', ',');
  for (const auto& [name, text] : {std::pair{"b.txt", kSections}, {"b.csv", commas}}) {
    const geometry::PointClip clip = read_points(write(name, text));
    EXPECT_EQ(clip.names, (std::vector<std::string>{"Anna:LKNE", "Anna:LANK"}));
    EXPECT_NEAR(clip.frame_time, 0.005, 1e-15);
    ASSERT_EQ(clip.frames.size(), 2u);
    EXPECT_TRUE(near(clip, 0, 0, knee) && near(clip, 0, 1, ankle) && near(clip, 1, 0, knee + Vec3(0.001, 0, 0)));
    EXPECT_FALSE(clip.frames[1][1].allFinite());
  }
  EXPECT_EQ(read_points(write("c.txt", "time\ta.x\ta.y\ta.z\n0\t1\t2\t3\n0.1\t1\t2\t3\n")).frames[1][0], Vec3(1, 2, 3));
}

TEST_F(ReadPoints, SaysWhatIsWrongAndInWhichLine) {
  const auto tells = [&](const std::string& name, const std::string& text, const char* part) {
    const std::string faults = fault(name, text);
    EXPECT_NE(faults.find(part), std::string::npos) << faults;
  };
  tells("b.c3d", "x", "wanted trajectories");
  tells("b.txt", "x", "shorter");
  tells("a.tsv", kTracked + "1\t2\t3\n", "3 fields, wanted 6");
  tells("b.tsv", kTracked, "no frame");
  const auto changed = [](std::string text, const std::string& from, const std::string& to) { return text.replace(text.find(from), from.size(), to); };
  tells("c.tsv", changed(kTracked, "RS\t2", "RS\t3") + "1\t2\t3\n", "wanted 3 as NO_OF_MARKERS");
  tells("d.tsv", changed(kTracked, "3D", "6D") + "1\t2\t3\n", "'6D'");
  tells("d.txt", changed(kSections, "200", "0"), "more than 0");
  tells("e.txt", changed(kSections, "\tmm", "\tdeg"), "'deg'");
  tells("f.txt", changed(kSections, "Z\tX", "Z\tX'"), "field 6");
  tells("g.txt", changed(kSections, "102\t", "104\t"), "equal distance");
  tells("h.txt", changed(kSections, "Sub Frame\tX", "Sub Frame\tY"), "field 3 is 'Y'");
  tells("i.txt", kSections.substr(0, kSections.find("200")), "ends in the header");
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
