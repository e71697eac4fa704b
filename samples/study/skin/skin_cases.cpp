#include "samples/study/skin/cases.h"

namespace effuse::study {

std::vector<Case> skin_cases() {
  std::vector<Case> cases;
  add_surface_cases(cases);
  add_tessellation_cases(cases);
  add_volume_cases(cases);
  add_coherence_cases(cases);
  add_relief_cases(cases);
  add_temperature_cases(cases);
  add_picture_cases(cases);
  return cases;
}

}  // namespace effuse::study
