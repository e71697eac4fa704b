#pragma once

#include <filesystem>
#include <string>

#include "flow/scene/node.h"

namespace effuse::importers {

/// A TOML scene as a tree with places (toml++). Throws InputError: missing, a folder, a device, empty, over 16 MiB;
/// with line and column: a syntax error, not UTF-8, a date or time, nested deeper than 64 brackets or 32 dots.
flow::Node read_scene_file(const std::filesystem::path& file);
/// The same from memory; name stands for the file in messages.
flow::Node read_scene_text(const std::string& text, const std::string& name);

/// --set key=value: dotted path into tables ("lava.viscosity.hot"), [n] into arrays, value in TOML or,
/// failing that, text as it stands. Creates missing tables. Throws InputError (place "--set").
void apply_override(flow::Node& scene, const std::string& assignment);

/// The tree as TOML that read_scene_text turns back into an equal tree: every value bit for bit. In a table
/// plain values come before tables; places are those of the new text.
std::string to_toml(const flow::Node& scene);

}  // namespace effuse::importers
