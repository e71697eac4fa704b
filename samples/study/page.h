#pragma once

#include <string>
#include <vector>

#include "samples/study/outcome.h"

namespace effuse::study {

/// One page of HTML that needs nothing else: the table of all figures, then each case with its plots as inline SVG, source
/// and note. Light and dark as the reader's system says; no script, no font, nothing from the network.
std::string page_of(const std::string& study, const std::string& version, const std::vector<Outcome>& outcomes, const std::vector<std::string>& not_run);

}  // namespace effuse::study
