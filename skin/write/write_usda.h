#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "skin/preview/preview.h"
#include "skin/write/write_mesh.h"

/// Universal Scene Description as text (.usda), for Houdini's Solaris, Blender, usdview, Omniverse. z up, metres, time in frames.
///
/// A film is one file a frame, whose topology changes freely, and a stage that shows them one after the other by value clips:
/// a reader has in memory what it shows. Names: points, normals, faceVertexCounts and -Indices, velocities; "color" is
/// primvars:displayColor (linear), every other attribute primvars:NAME, float; of particles "radius" is widths (2 r), "id" ids. No
/// subdivision. Numbers have the digits that give the same float again.
/// Source: OpenUSD's documentation of the schemas UsdGeom, UsdLux, UsdShade and of value clips.
namespace effuse::skin {

/// What a frame's file says of its time.
struct UsdaTime {
  int frame = 1;            ///< its time code
  Real fps = 24;            ///< time codes a second
  Real velocity_scale = 1;  ///< from the mesh's "velocity" to metres a second of film, as renderers take `velocities` for motion blur
};

/// An attribute of a prim as it is declared: "point3f[] points", and how it lies on the surface ("vertex" or "").
struct UsdaAttribute {
  std::string type, name, interpolation;
};
/// Those that a frame's file of this mesh has.
std::vector<UsdaAttribute> usda_attributes(const geometry::TriMesh& mesh);

/// One frame: a Mesh, or Points where the mesh has vertices and no triangles, by the name of prim (letters, digits and _: others become _), its
/// values time samples at the frame. The file is whole or absent; what cannot be written is an InputError.
void write_usda_frame(const std::filesystem::path& file, const geometry::TriMesh& mesh, const std::string& prim, const UsdaTime& time, const Metadata& metadata = {});

/// Something that stands still, its values defaults. Without "color" it is shown in that of dull ground.
void write_usda_still(const std::filesystem::path& file, const geometry::TriMesh& mesh, const std::string& prim, const Metadata& metadata = {});

/// The frames of one thing.
struct UsdaSequence {
  std::string prim;
  bool points = false;
  std::vector<UsdaAttribute> attributes;  ///< of all its frames
  struct File {
    int frame = 1;
    std::string name;  ///< as seen from the stage
  };
  std::vector<File> files;  ///< rising; a frame without one shows the one before it
};

/// Camera and sun of a frame.
struct UsdaView {
  int frame = 1;
  Camera camera;
  Vec3 sun_direction = Vec3::UnitZ();  ///< towards it
  Daylight light;
  Real exposure = 1;  ///< of the picture's; light is before it
};

struct UsdaStage {
  Real fps = 24;
  int first_frame = 1, last_frame = 1;
  struct Still {
    std::string prim, file;  ///< as seen from the stage
  };
  std::vector<Still> stills;
  std::vector<UsdaSequence> sequences;
  std::vector<UsdaView> views;  ///< rising; one holds until the next
  Real aspect = 16.0 / 9;
};

/// The stage: /film with stills, sequences (with a material whose emission is primvars:glow), /film/camera, /film/sun, /film/sky; and beside each
/// sequence's files NAME.clips.usda, which says what varies. All of them are whole or absent, the stage last.
void write_usda_stage(const std::filesystem::path& file, const UsdaStage& stage, const Metadata& metadata = {});

}  // namespace effuse::skin
