#include <dlfcn.h>
#include <fmt/format.h>

#include <stdexcept>

#include "importers/terrain/gdal_internal.h"

namespace effuse::importers {

const Gdal& gdal() {
  static const Gdal functions = [] {
    void* library = ::dlopen(EFFUSE_GDAL_LIBRARY, RTLD_NOW | RTLD_LOCAL);
    if (!library) throw std::runtime_error(fmt::format("GDAL, which reads rasters and knows coordinate systems, cannot be loaded: {}", ::dlerror()));
    Gdal loaded;
#define EFFUSE_GDAL_LOAD(function)                                                                        \
  loaded.function = reinterpret_cast<decltype(loaded.function)>(::dlsym(library, #function));            \
  if (!loaded.function) throw std::runtime_error(fmt::format("{} lacks {}", EFFUSE_GDAL_LIBRARY, #function));
    EFFUSE_GDAL_FUNCTIONS(EFFUSE_GDAL_LOAD)
#undef EFFUSE_GDAL_LOAD
    loaded.OSRSetPROJEnableNetwork(0);
    return loaded;
  }();
  return functions;
}

void prepare_gdal() {
  static const bool done = [] {
    gdal().GDALAllRegister();
    gdal().GDALSetCacheMax64(GIntBig{64} << 20);
    return true;
  }();
  static_cast<void>(done);
}

}  // namespace effuse::importers
