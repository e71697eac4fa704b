#pragma once

#include "skin/detail/displace.h"

namespace effuse::skin {

/// PreviewOptions::gloss of a kind of skin: rubble and broken plates are matt, ropes have a skin of glass, obsidian is glass.
Real gloss_of(SkinKind kind);

}  // namespace effuse::skin
