#include "samples/study/study.h"

namespace effuse::study {

std::vector<Case> validation_cases() {
  std::vector<Case> cases;
  add_operator_cases(cases);
  add_channel_cases(cases);
  add_spreading_cases(cases);
  add_heat_cases(cases);
  add_cooling_cases(cases);
  add_rheology_cases(cases);
  add_terrain_cases(cases);
  add_work_cases(cases);
  return cases;
}

}  // namespace effuse::study
