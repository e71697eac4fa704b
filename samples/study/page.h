#pragma once

#include <string>
#include <vector>

#include "samples/study/outcome.h"

namespace effuse::study {

/// A study on a page.
struct Chapter {
  std::string name, what;  ///< "integrators", "schemes of integration beside exact solutions"
  std::vector<Outcome> outcomes;
  std::vector<std::string> not_run;
};

/// One page of HTML that needs nothing else: of each study the table of all figures, then each case with its plots as inline SVG, source,
/// note, and what its runs cost. Light and dark as the reader's system says; no script, no font, nothing from the network.
std::string page_of(const std::string& title, const std::string& version, const std::vector<Chapter>& chapters);

}  // namespace effuse::study
