#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/base/types.h"

/// The same five particles as files of every kind, written from the formats' specifications, byte by byte: nothing of our
/// writers or readers is in them.
namespace effuse::importers::hand_written {

struct Particle {
  Vec3 position, velocity;
  Real radius, temperature;
  std::uint64_t id;
};

inline std::vector<Particle> particles() {
  return {{{0, 0, 0}, {1, 0, 0}, 0.5, 1000, 7},
          {{1, 0, 0}, {1, 0, 0}, 0.5, 1100, 8},
          {{0, 1, 0}, {1, 0, 0}, 0.5, 1200, 9},
          {{0, 0, 1}, {1, 0, -2}, 0.5, 1300, 10},
          {{0.5, 0.5, -1.5}, {1, 0, 0}, 0.5, 1400, 300}};
}

/// "3f 80 | 00 00" as bytes; blanks and bars are for the eye.
inline std::string hex(std::string_view text) {
  std::string bytes;
  int high = -1;
  for (const char c : text) {
    const int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
    if (digit < 0) continue;
    if (high < 0) {
      high = digit;
    } else {
      bytes += static_cast<char>(16 * high + digit);
      high = -1;
    }
  }
  return bytes;
}

// IEEE 754 single precision, most significant byte first:
//   0 = 00000000   0.5 = 3f000000   1 = 3f800000   -1.5 = bfc00000   -2 = c0000000
//   1000 = 447a0000   1100 = 44898000   1200 = 44960000   1300 = 44a28000   1400 = 44af0000

/// x y z of all, big-endian.
inline std::string positions_big() {
  return hex(
      "00000000 00000000 00000000"
      "3f800000 00000000 00000000"
      "00000000 3f800000 00000000"
      "00000000 00000000 3f800000"
      "3f000000 3f000000 bfc00000");
}
inline std::string velocities_big() {
  return hex(
      "3f800000 00000000 00000000"
      "3f800000 00000000 00000000"
      "3f800000 00000000 00000000"
      "3f800000 00000000 c0000000"
      "3f800000 00000000 00000000");
}
inline std::string radii_big() { return hex("3f000000 3f000000 3f000000 3f000000 3f000000"); }
inline std::string temperatures_big() { return hex("447a0000 44898000 44960000 44a28000 44af0000"); }
inline std::string ids_big() { return hex("00000007 00000008 00000009 0000000a 0000012c"); }

/// BGEO, version 5, as Houdini's documentation and Partio have it.
inline std::string bgeo() {
  return "Bgeo" + hex("56 | 00000005") +  // 'V', version
         hex("00000005 | 00000000 | 00000000 | 00000000") +  // points, primitives, point groups, primitive groups
         hex("00000004 | 00000000 | 00000000 | 00000000") +  // point, vertex, primitive, detail attributes
         hex("0001") + "v" + hex("0003 | 00000005 | 00000000 00000000 00000000") +   // three of type vector, default
         hex("0006") + "pscale" + hex("0001 | 00000000 | 3f800000") +                // a float
         hex("0002") + "id" + hex("0001 | 00000001 | ffffffff") +                    // an integer
         hex("000b") + "temperature" + hex("0001 | 00000000 | 00000000") +
         // x y z w, v, pscale, id, temperature
         hex("00000000 00000000 00000000 3f800000 | 3f800000 00000000 00000000 | 3f000000 | 00000007 | 447a0000"
             "3f800000 00000000 00000000 3f800000 | 3f800000 00000000 00000000 | 3f000000 | 00000008 | 44898000"
             "00000000 3f800000 00000000 3f800000 | 3f800000 00000000 00000000 | 3f000000 | 00000009 | 44960000"
             "00000000 00000000 3f800000 3f800000 | 3f800000 00000000 c0000000 | 3f000000 | 0000000a | 44a28000"
             "3f000000 3f000000 bfc00000 3f800000 | 3f800000 00000000 00000000 | 3f000000 | 0000012c | 44af0000") +
         hex("00 ff");  // beginning and end of what Houdini may add
}

/// Legacy VTK, binary, as simulation programs write it.
inline std::string vtk_binary() {
  return "# vtk DataFile Version 3.0\nby hand\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n" + positions_big() +
         "\nCELLS 5 10\n" + hex("00000001 00000000 | 00000001 00000001 | 00000001 00000002 | 00000001 00000003 | 00000001 00000004") +
         "\nCELL_TYPES 5\n" + hex("00000001 00000001 00000001 00000001 00000001") +
         "\nPOINT_DATA 5\nSCALARS radius float 1\nLOOKUP_TABLE default\n" + radii_big() +
         "\nVECTORS velocity float\n" + velocities_big() +
         "\nFIELD FieldData 2\nid 1 5 unsigned_int\n" + ids_big() + "\ntemperature 1 5 float\n" + temperatures_big() + "\n";
}

/// The same in text, as POLYDATA, in doubles, with what newer writers put in between.
inline std::string vtk_ascii() {
  return "# vtk DataFile Version 5.1\nby hand\nASCII\nDATASET POLYDATA\n"
         "FIELD FieldData 1\nTimeValue 1 1 double\n0.25\n"
         "POINTS 5 double\n0 0 0 1 0 0 0 1 0\n0 0 1 0.5 0.5 -1.5\n"
         "METADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1.6\n\n"
         "VERTICES 6 5\nOFFSETS vtktypeint64\n0 1 2 3 4 5\nCONNECTIVITY vtktypeint64\n0 1 2 3 4\n"
         "CELL_DATA 5\nSCALARS id int\nLOOKUP_TABLE default\n5 4 3 2 1\n"
         "POINT_DATA 5\nVECTORS Velocity double\n1 0 0  1 0 0  1 0 0  1 0 -2  1 0 0\n"
         "SCALARS pressure float\nLOOKUP_TABLE default\n1 2 3 4 5\n"
         "FIELD FieldData 3\nid 1 5 vtkIdType\n7 8 9 10 300\nRadius 1 5 float\n.5 .5 .5 .5 .5\ntemperature 1 5 float\n1000 1100 1200 1300 1400\n";
}

inline std::string ply_ascii() {
  return "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 5\n"
         "property double x\nproperty double y\nproperty double z\nproperty float vx\nproperty float vy\nproperty float vz\n"
         "property float pscale\nproperty int id\nproperty float temperature\nproperty uchar flag\nend_header\n"
         "0 0 0 1 0 0 .5 7 1000 1\n1 0 0 1 0 0 .5 8 1100 1\n0 1 0 1 0 0 .5 9 1200 0\n0 0 1 1 0 -2 .5 10 1300 0\n0.5 0.5 -1.5 1 0 0 .5 300 1400 0\n";
}

inline std::string ply_binary(bool big) {
  // x y z radius velocity_x velocity_y velocity_z (float), temperature (ushort), id (uint)
  const std::array<const char*, 5> big_rows = {"00000000 00000000 00000000 | 3f000000 | 3f800000 00000000 00000000 | 03e8 | 00000007",
                                               "3f800000 00000000 00000000 | 3f000000 | 3f800000 00000000 00000000 | 044c | 00000008",
                                               "00000000 3f800000 00000000 | 3f000000 | 3f800000 00000000 00000000 | 04b0 | 00000009",
                                               "00000000 00000000 3f800000 | 3f000000 | 3f800000 00000000 c0000000 | 0514 | 0000000a",
                                               "3f000000 3f000000 bfc00000 | 3f000000 | 3f800000 00000000 00000000 | 0578 | 0000012c"};
  const std::array<const char*, 5> little_rows = {"00000000 00000000 00000000 | 0000003f | 0000803f 00000000 00000000 | e803 | 07000000",
                                                  "0000803f 00000000 00000000 | 0000003f | 0000803f 00000000 00000000 | 4c04 | 08000000",
                                                  "00000000 0000803f 00000000 | 0000003f | 0000803f 00000000 00000000 | b004 | 09000000",
                                                  "00000000 00000000 0000803f | 0000003f | 0000803f 00000000 000000c0 | 1405 | 0a000000",
                                                  "0000003f 0000003f 0000c0bf | 0000003f | 0000803f 00000000 00000000 | 7805 | 2c010000"};
  std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                      "_endian 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\nproperty float radius\n"
                      "property float velocity_x\nproperty float velocity_y\nproperty float velocity_z\nproperty ushort temperature\nproperty uint id\nend_header\n";
  for (const char* row : big ? big_rows : little_rows) bytes += hex(row);
  return bytes;
}

inline std::string xyz_text() {
  return "# id x y z radius temperature vx vy vz\n"
         "7 0 0 0 0.5 1000 1 0 0\n8 1 0 0 0.5 1100 1 0 0\n9 0 1 0 0.5 1200 1 0 0\n\n"
         "10\t0 0 1 0.5 1.3e3 1 0 -2  # the fast one\r\n300 0.5 0.5 -1.5 5e-1 1400 1 0 0";
}
inline std::string csv() {
  return "\"Temperature\",\"Velocity:0\",\"Velocity:1\",\"Velocity:2\",\"Points:0\",\"Points:1\",\"Points:2\",\"id\",\"pscale\"\n"
         "1000,1,0,0,0,0,0,7,0.5\n1100,1,0,0,1,0,0,8,0.5\n1200,1,0,0,0,1,0,9,0.5\n1300,1,0,-2,0,0,1,10,0.5\n1400,1,0,0,0.5,0.5,-1.5,300,0.5\n";
}

/// Two pieces; text, and base64 of a length (UInt32) and the numbers in one: made with Python's struct and base64.
inline std::string vtp_inline() {
  return R"(<?xml version="1.0"?>
<!-- by hand -->
<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian">
 <PolyData>
  <Piece NumberOfPoints="3" NumberOfVerts='0' NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="0">
   <PointData Scalars="id">
    <DataArray type="Int64" Name="id" format="ascii"> 7 8
 9 </DataArray>
    <DataArray type="Float32" Name="velocity" NumberOfComponents="3" format="ascii">1 0 0 1 0 0 1 0 0</DataArray>
    <DataArray type="Float32" Name="radius" format="binary">DAAAAAAAAD8AAAA/AAAAPw==</DataArray>
    <DataArray type="Float32" Name="pressure" format="binary">DAAAAAAAAD8AAAA/AAAAPw==</DataArray>
    <DataArray type="UInt16" Name="temperature" format="binary">
     BgAAAOgD
     TASwBA==
    </DataArray>
   </PointData>
   <CellData></CellData>
   <Points>
    <DataArray type="Float64" Name="Points" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0
     <InformationKey name="L2_NORM_RANGE" location="vtkDataArray" length="2"><Value index="0">0</Value><Value index="1">1</Value></InformationKey>
    </DataArray>
   </Points>
  </Piece>
  <Piece NumberOfPoints="2">
   <Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 1 .5 .5 -1.5</DataArray></Points>
   <PointData>
    <DataArray type="Int32" Name="id" format="ascii">10 300</DataArray>
    <DataArray type="Float32" Name="velocity" NumberOfComponents="3" format="ascii">1 0 -2 1 0 0</DataArray>
    <DataArray type="Float32" Name="radius" format="ascii">0.5 0.5</DataArray>
    <DataArray type="Float32" Name="pressure" format="ascii">0.5 0.5</DataArray>
    <DataArray type="Float32" Name="temperature" format="ascii">1300 1400</DataArray>
   </PointData>
  </Piece>
 </PolyData>
</VTKFile>
)";
}

/// Unzipped appended data, big-endian, lengths in UInt64, raw behind '_'.
inline std::string vtu_appended() {
  return R"(<VTKFile type="UnstructuredGrid" version="1.0" byte_order="BigEndian" header_type="UInt64"><UnstructuredGrid>
<Piece NumberOfPoints="5" NumberOfCells="0"><PointData>
<DataArray type="Float32" Name="velocity" NumberOfComponents="3" format="appended" offset="68"/>
<DataArray type="Float32" Name="radius" format="appended" offset="136"/>
<DataArray type="UInt32" Name="id" format="appended" offset="164"/>
<DataArray type="Float32" Name="temperature" format="appended" offset="192"/>
</PointData><Points><DataArray type="Float32" Name="Points" NumberOfComponents="3" format="appended" offset="0"/></Points></Piece></UnstructuredGrid>
<AppendedData encoding="raw">
 _)" + hex("00000000 0000003c") + positions_big() + hex("00000000 0000003c") + velocities_big() + hex("00000000 00000014") + radii_big() +
         hex("00000000 00000014") + ids_big() + hex("00000000 00000014") + temperatures_big() + "\n</AppendedData></VTKFile>\n";
}

struct File {
  std::string name, bytes;
};

/// All of them.
inline std::vector<File> files() {
  return {{"hand.bgeo", bgeo()},
          {"hand.vtk", vtk_binary()},
          {"hand_text.vtk", vtk_ascii()},
          {"hand.ply", ply_ascii()},
          {"hand_little.ply", ply_binary(false)},
          {"hand_big.ply", ply_binary(true)},
          {"hand.xyz", xyz_text()},
          {"hand.csv", csv()},
          {"hand.vtp", vtp_inline()},
          {"hand.vtu", vtu_appended()}};
}

}  // namespace effuse::importers::hand_written
