#include "samples/effuse/flipbook_export.h"

namespace effuse {

void FlipbookExport::add(const std::string& name, int frame, const geometry::TriMesh& mesh) {
  book_.add_frame(name, (frame - first_) / run_.fps, mesh);
}

void FlipbookExport::finish(int last) { book_.finish(file_, (last + 1 - first_) / run_.fps, run_.metadata(0)); }

void write_film_glb(const std::filesystem::path& folder) {
  const FilmFolder run = read_film_folder(folder);
  FlipbookExport film(run, folder / "film.glb", 1);
  for (const auto& [name, file] : run.stills) film.add_still(name, read_frame(run, file));
  for (int frame = 1; frame <= run.last_frame; ++frame)
    for (const FilmFolder::Sequence& sequence : run.sequences)
      if (const auto file = sequence.files.find(frame); file != sequence.files.end()) {
        const geometry::TriMesh mesh = read_frame(run, file->second);
        if (!is_particles(mesh)) film.add(sequence.name, frame, mesh);
      }
  film.finish(run.last_frame);
}

}  // namespace effuse
