#include "samples/effuse/misspelt.h"

#include <algorithm>
#include <optional>
#include <string_view>

namespace effuse {

namespace {

// As flow::Parameters and flow::read_scene word them.
constexpr std::string_view kUnknown = ": unknown key; ", kMeant = "did you mean '", kMissing = ": is missing (", kNone = "wanted at least one", kNoEffect = "the scene names no effect";

/// The name of a key that was meant, from the fault of the one that was written: "lava.spacing" from "lava.spacng: unknown key; did you mean 'spacing'?".
std::optional<std::string> meant(const std::string& message) {
  const std::size_t unknown = message.find(kUnknown);
  if (unknown == std::string::npos) return std::nullopt;
  const std::size_t from = unknown + kUnknown.size();
  if (message.compare(from, kMeant.size(), kMeant) != 0) return std::nullopt;
  const std::size_t begin = from + kMeant.size(), end = message.find('\'', begin), dot = message.rfind('.', unknown);
  if (end == std::string::npos) return std::nullopt;
  return (dot == std::string::npos ? "" : message.substr(0, dot + 1)) + message.substr(begin, end - begin);
}

/// Whether a fault says that this key, or something in the table of this name, is missing.
bool misses(const std::string& message, const std::string& name) {
  if (!message.starts_with(name)) return false;
  const std::string_view rest = std::string_view(message).substr(name.size());
  if (rest.starts_with(kMissing)) return true;
  if (rest.starts_with(": ")) return rest.find(kNone) != std::string_view::npos;
  return rest.starts_with(".") && rest.find(kMissing) != std::string_view::npos;
}

}  // namespace

std::vector<Fault> told_once(std::vector<Fault> faults, std::span<const std::string> effects) {
  // Effects are read only where a scene has them, so that a key like one of them found no name near it.
  std::vector<std::string> names(effects.begin(), effects.end());
  bool effect_meant = false;
  for (Fault& fault : faults) {
    const std::size_t unknown = fault.message.find(kUnknown);
    if (unknown == std::string::npos || fault.message.find('.') < unknown || meant(fault.message)) continue;
    const std::string nearest = nearest_name(fault.message.substr(0, unknown), names);
    if (nearest.empty()) continue;
    fault.message = fault.message.substr(0, unknown) + std::string(kUnknown) + std::string(kMeant) + nearest + "'?";
    effect_meant = true;
  }
  std::vector<std::string> written_otherwise;
  for (const Fault& fault : faults)
    if (const std::optional<std::string> name = meant(fault.message)) written_otherwise.push_back(*name);
  std::erase_if(faults, [&](const Fault& fault) {
    if (effect_meant && fault.message.starts_with(kNoEffect)) return true;
    return std::any_of(written_otherwise.begin(), written_otherwise.end(), [&](const std::string& name) { return misses(fault.message, name); });
  });
  return faults;
}

}  // namespace effuse
