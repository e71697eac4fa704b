#pragma once

#include <filesystem>
#include <string>

#include "samples/effuse/film_folder.h"
#include "skin/write/write_flipbook.h"

namespace effuse {

/// film.glb of a run: its terrain and the meshes of its frames, shown in turn (skin/write/write_flipbook.h).
class FlipbookExport {
 public:
  /// The film begins with frame `first`; run outlives this.
  FlipbookExport(const FilmFolder& run, std::filesystem::path file, int first) : run_(run), file_(std::move(file)), first_(first), book_(run.name.empty() ? "film" : run.name) {}
  void add_still(const std::string& name, const geometry::TriMesh& mesh) { book_.add_still(name, mesh); }
  void add(const std::string& name, int frame, const geometry::TriMesh& mesh);
  /// The film ends after frame `last`.
  void finish(int last);

 private:
  const FilmFolder& run_;
  std::filesystem::path file_;
  int first_;
  skin::Flipbook book_;
};

/// The same of all frames that the folder has.
void write_film_glb(const std::filesystem::path& folder);

}  // namespace effuse
