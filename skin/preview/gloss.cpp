#include "skin/preview/gloss.h"

namespace effuse::skin {

Real gloss_of(SkinKind kind) {
  switch (kind) {
    case SkinKind::kNoise: return 0.15;
    case SkinKind::kAa: return 0.05;
    case SkinKind::kPahoehoe: return 0.35;
    case SkinKind::kBlock: return 0.05;
    case SkinKind::kObsidian: return 1;
  }
  return 0;
}

}  // namespace effuse::skin
