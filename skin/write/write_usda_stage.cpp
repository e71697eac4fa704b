#include <fmt/format.h>

#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/usda_text_internal.h"

namespace effuse::skin {

std::string usda_identifier(const std::string& name) {
  std::string out;
  for (const char c : name) out += (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ? c : '_';
  return out.empty() || (out[0] >= '0' && out[0] <= '9') ? "_" + out : out;
}

std::string usda_string(const std::string& text) {
  std::string out = "\"";
  for (const char c : one_line(text)) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

std::string usda_header(const std::string& default_prim, Real fps, int first_frame, int last_frame, const Metadata& metadata) {
  std::string out = fmt::format("#usda 1.0\n(\n    defaultPrim = \"{}\"\n    metersPerUnit = 1\n    upAxis = \"Z\"\n", default_prim);
  if (fps > 0) out += fmt::format("    timeCodesPerSecond = {}\n    framesPerSecond = {}\n    startTimeCode = {}\n    endTimeCode = {}\n", fps, fps, first_frame, last_frame);
  if (!metadata.empty()) {
    out += "    customLayerData = {\n";
    for (const auto& [key, value] : metadata) out += fmt::format("        string {} = {}\n", usda_identifier(key), usda_string(value));
    out += "    }\n";
  }
  return out + ")\n";
}

std::string usda_interpolation(const UsdaAttribute& attribute) {
  return attribute.interpolation.empty() ? "" : fmt::format(" (interpolation = \"{}\")", attribute.interpolation);
}

std::string usda_declaration(const UsdaAttribute& attribute) { return fmt::format("    {} {}{}\n", attribute.type, attribute.name, usda_interpolation(attribute)); }

namespace {

/// Text between @ signs: a file's name as USD takes it.
std::string asset(const std::string& name) { return "@" + (name.starts_with("/") ? name : "./" + name) + "@"; }

std::string matrix(const Vec3& x, const Vec3& y, const Vec3& z, const Vec3& at) {
  // USD's vectors are rows.
  return fmt::format("( ({}, {}, {}, 0), ({}, {}, {}, 0), ({}, {}, {}, 0), ({}, {}, {}, 1) )", x.x(), x.y(), x.z(), y.x(), y.y(), y.z(), z.x(), z.y(), z.z(), at.x(), at.y(), at.z());
}

std::string color(const Vec3& c) { return fmt::format("({:.9g}, {:.9g}, {:.9g})", c.x(), c.y(), c.z()); }

/// A frame of axes whose third is `back`.
std::string looking(const Vec3& eye, const Vec3& back) {
  const Vec3 aside = Vec3::UnitZ().cross(back);
  const Vec3 right = aside.norm() > 1e-9 ? aside.normalized() : Vec3::UnitX();
  return matrix(right, back.cross(right), back, eye);
}

/// An attribute's values at the views: one default, or time samples where it changes.
template <class Text>
std::string over_time(const std::string& declaration, const std::vector<UsdaView>& views, Text&& text) {
  bool still = true;
  for (const UsdaView& view : views) still &= text(view) == text(views.front());
  if (still) return fmt::format("        {} = {}\n", declaration, text(views.front()));
  std::string out = fmt::format("        {}.timeSamples = {{\n", declaration);
  for (const UsdaView& view : views) out += fmt::format("            {}: {},\n", view.frame, text(view));
  return out + "        }\n";
}

std::string camera_and_light(const UsdaStage& stage) {
  const std::vector<UsdaView>& views = stage.views;
  // Only the ratio of the two counts: a sensor 24 high.
  constexpr Real kAperture = 24;
  std::string out = "\n    def Camera \"camera\"\n    {\n";
  out += over_time("matrix4d xformOp:transform", views, [](const UsdaView& v) { return looking(v.camera.eye, (v.camera.eye - v.camera.target).normalized()); });
  out += "        uniform token[] xformOpOrder = [\"xformOp:transform\"]\n";
  out += over_time("float focalLength", views, [](const UsdaView& v) { return fmt::format("{:.9g}", kAperture / (2 * std::tan(v.camera.field_of_view / 2))); });
  out += fmt::format("        float verticalAperture = {}\n        float horizontalAperture = {:.9g}\n        float2 clippingRange = (0.1, 1000000)\n    }}\n", kAperture, kAperture * stage.aspect);
  out += "\n    def DistantLight \"sun\"\n    {\n";
  out += over_time("matrix4d xformOp:transform", views, [](const UsdaView& v) { return looking(Vec3::Zero(), v.sun_direction.normalized()); });
  out += "        uniform token[] xformOpOrder = [\"xformOp:transform\"]\n        bool inputs:normalize = 1\n        float inputs:angle = 0.53\n";
  // Normalised, its colour is the irradiance.
  out += "        float inputs:intensity = 1\n";
  out += over_time("color3f inputs:color", views, [](const UsdaView& v) { return color(v.light.sun); });
  out += "    }\n\n    def DomeLight \"sky\"\n    {\n";
  out += over_time("color3f inputs:color", views, [](const UsdaView& v) { return color(v.light.sky); });
  return out + "    }\n";
}

/// A material that reflects displayColor and gives off glow.
constexpr const char* kMaterial = R"(
    def Material "lava"
    {
        token outputs:surface.connect = </film/lava/surface.outputs:surface>

        def Shader "surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </film/lava/color.outputs:result>
            color3f inputs:emissiveColor.connect = </film/lava/glow.outputs:result>
            float inputs:roughness = 0.85
            token outputs:surface
        }

        def Shader "color"
        {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "displayColor"
            float3 inputs:fallback = (0.05, 0.045, 0.04)
            float3 outputs:result
        }

        def Shader "glow"
        {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "glow"
            float3 inputs:fallback = (0, 0, 0)
            float3 outputs:result
        }
    }
)";

std::string clip_file(const UsdaSequence& sequence) {
  const std::string& first = sequence.files.front().name;
  const std::size_t slash = first.rfind('/');
  return (slash == std::string::npos ? "" : first.substr(0, slash + 1)) + sequence.prim + ".clips.usda";
}

/// What varies, by name and type: USD asks the clips for that only.
void write_clip_manifest(const std::filesystem::path& folder, const UsdaSequence& sequence) {
  const std::string name = usda_identifier(sequence.prim);
  std::string out = fmt::format("#usda 1.0\n(\n    defaultPrim = \"{}\"\n)\n\nover \"{}\"\n{{\n", name, name);
  for (const UsdaAttribute& each : sequence.attributes) out += fmt::format("    {} {}\n", each.type, each.name);
  write_file(folder / clip_file(sequence), out + "}\n");
}

std::string prim_with_clips(const UsdaSequence& sequence) {
  const std::string name = usda_identifier(sequence.prim);
  std::string out = fmt::format("\n    def {} \"{}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n        clips = {{\n            dictionary default = {{\n", sequence.points ? "Points" : "Mesh", name);
  std::string files, active, times;
  for (std::size_t k = 0; k < sequence.files.size(); ++k) {
    const auto& [frame, file] = sequence.files[k];
    const char* comma = k > 0 ? ", " : "";
    files += comma + asset(file);
    active += fmt::format("{}({}, {})", comma, frame, k);
    times += fmt::format("{}({}, {})", comma, frame, frame);
  }
  out += fmt::format("                asset[] assetPaths = [{}]\n                double2[] active = [{}]\n                double2[] times = [{}]\n", files, active, times);
  out += fmt::format("                asset manifestAssetPath = {}\n                string primPath = \"/{}\"\n            }}\n        }}\n    )\n    {{\n", asset(clip_file(sequence)), name);
  if (!sequence.points) out += "        uniform token subdivisionScheme = \"none\"\n";
  for (const UsdaAttribute& each : sequence.attributes) out += "    " + usda_declaration(each);
  return out + "        rel material:binding = </film/lava>\n    }\n";
}

}  // namespace

void write_usda_stage(const std::filesystem::path& file, const UsdaStage& stage, const Metadata& metadata) {
  ZONE("write.usda");
  std::string out = usda_header("film", stage.fps, stage.first_frame, stage.last_frame, metadata);
  out += "\ndef Xform \"film\"\n{\n";
  for (const UsdaStage::Still& still : stage.stills)
    out += fmt::format("    def \"{}\" (\n        prepend references = {}\n    )\n    {{\n    }}\n", usda_identifier(still.prim), asset(still.file));
  for (const UsdaSequence& sequence : stage.sequences) {
    CHECK(!sequence.files.empty());
    write_clip_manifest(file.parent_path(), sequence);
    out += prim_with_clips(sequence);
  }
  out += kMaterial;
  if (!stage.views.empty()) out += camera_and_light(stage);
  write_file(file, out + "}\n");
}

}  // namespace effuse::skin
