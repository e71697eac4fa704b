#include <fmt/format.h>

#include <algorithm>

#include "importers/mesh/ply_reader.h"
#include "importers/points/columns_internal.h"

namespace effuse::importers {

PointCloud parse_ply_points(std::string_view bytes, const std::string& name, const PointImportOptions& options) {
  PlyMesh ply = parse_ply(bytes, name);
  std::vector<Column> columns;
  for (auto& [attribute, data] : ply.attributes) columns.push_back({attribute, data.width, true, {}});
  const std::vector<bool> is_wanted = wanted(columns);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    std::vector<float>& values = ply.attributes[columns[c].name].values;
    if (is_wanted[c]) columns[c].values.assign(values.begin(), values.end());
    std::vector<float>().swap(values);
  }
  PointCloud cloud = assemble(name, std::move(ply.positions), columns, options);
  cloud.notes.insert(cloud.notes.begin(), ply.notes.begin(), ply.notes.end());
  if (ply.face_start.size() > 1)
    cloud.notes.push_back(fmt::format("this is a mesh: its vertices are taken for particles, its {} faces left out", ply.face_start.size() - 1));
  return cloud;
}

}  // namespace effuse::importers
