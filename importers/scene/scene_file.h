#pragma once

#include <filesystem>
#include <string>

#include "flow/scene/node.h"

namespace effuse::importers {

/// A TOML scene as a tree with places (toml++). Throws InputError with line and column on a syntax error.
flow::Node read_scene_file(const std::filesystem::path& file);
/// The same from memory; name stands for the file in messages.
flow::Node read_scene_text(const std::string& text, const std::string& name);

/// --set key=value: dotted path into tables ("lava.viscosity.hot"), [n] into arrays, value in TOML or,
/// failing that, text as it stands. Creates missing tables. Throws InputError (place "--set").
void apply_override(flow::Node& scene, const std::string& assignment);

/// The tree as TOML that read_scene_text turns back into an equal tree.
std::string to_toml(const flow::Node& scene);

}  // namespace effuse::importers
