// Every room linked from the installation, with all the packages below them.

#include <cstdio>
#include <string>

#include "geometry/base/error.h"
#include "importers/terrain/import_terrain.h"
#include "skin/surface/level_set.h"

int answer();

int main() {
  using namespace effuse;
  std::string said;
  try {
    importers::import_terrain("no-such-mountain.asc");
  } catch (const InputError& error) {
    said = error.what();
  }
  std::printf("%s\n", said.c_str());

  const skin::LevelSet nothing = skin::build_level_set({}, 0, nullptr, {.spacing = 1});
  return said.find("no-such-mountain.asc") != std::string::npos && nothing.empty() && answer() == 42 ? 0 : 1;
}
