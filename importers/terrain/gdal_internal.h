#pragma once

#include <cpl_error.h>
#include <gdal.h>

#include <string>

#include "importers/input_file.h"

namespace effuse::importers {

/// GDAL with its drivers registered and a cache of 64 MB instead of a twentieth of the machine's memory.
void prepare_gdal();

/// While it lives, what GDAL complains of on this thread is kept instead of printed.
class GdalComplaints {
 public:
  GdalComplaints() {
    CPLPushErrorHandler(CPLQuietErrorHandler);
    CPLErrorReset();
  }
  ~GdalComplaints() { CPLPopErrorHandler(); }
  GdalComplaints(const GdalComplaints&) = delete;
  GdalComplaints& operator=(const GdalComplaints&) = delete;

  /// The last one, fit to print; what it says without one.
  std::string last(const std::string& otherwise) const {
    const std::string words = CPLGetLastErrorMsg();
    return words.empty() ? otherwise : printable(words);
  }
};

}  // namespace effuse::importers
