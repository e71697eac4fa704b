#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

/// The command line told to shells and readers, from the one description that parses it.
namespace effuse {

std::vector<std::string> verb_names(const CLI::App& app);

/// A completion script for "bash", "zsh" or "fish": verbs, their flags, files.
std::string completions(const CLI::App& app, const std::string& shell);

/// effuse(1), in roff with man macros.
std::string man_page(const CLI::App& app, const std::string& version);

}  // namespace effuse
