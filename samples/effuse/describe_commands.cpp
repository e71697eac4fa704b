#include "samples/effuse/describe_commands.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

namespace effuse {

namespace {

std::vector<const CLI::Option*> flags_of(const CLI::App& verb) {
  std::vector<const CLI::Option*> all;
  for (const CLI::Option* option : verb.get_options())
    if (option->nonpositional()) all.push_back(option);
  return all;
}

/// "-o --output"
std::string words_of(const CLI::Option& option) {
  std::string words;
  for (const std::string& name : option.get_snames()) words += (words.empty() ? "-" : " -") + name;
  for (const std::string& name : option.get_lnames()) words += (words.empty() ? "--" : " --") + name;
  return words;
}

/// A single quote ends a quoted word in shells.
std::string in_quotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string bash(const CLI::App& app) {
  std::string cases, verbs;
  for (const CLI::App* verb : app.get_subcommands({})) {
    verbs += (verbs.empty() ? "" : " ") + verb->get_name();
    std::string words;
    for (const CLI::Option* option : flags_of(*verb)) words += " " + words_of(*option);
    cases += fmt::format("    {}) words=\"{}\" ;;\n", verb->get_name(), words.substr(words.empty() ? 0 : 1));
  }
  return fmt::format(R"(_effuse() {{
  local words="" word="${{COMP_WORDS[COMP_CWORD]}}"
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{} --help --version" -- "$word"))
    return
  fi
  case "${{COMP_WORDS[1]}}" in
{}  esac
  case "$word" in
    -*) COMPREPLY=($(compgen -W "$words" -- "$word")) ;;
    *)
      local IFS=$'\n'
      COMPREPLY=($(compgen -f -- "$word"))
      compopt -o filenames 2> /dev/null
      ;;
  esac
}}
complete -F _effuse effuse
)",
                     verbs, cases);
}

std::string fish(const CLI::App& app) {
  std::string text = "complete -c effuse -n __fish_use_subcommand -f\n";
  for (const CLI::App* verb : app.get_subcommands({})) {
    text += fmt::format("complete -c effuse -n __fish_use_subcommand -a {} -d {}\n", verb->get_name(), in_quotes(verb->get_description()));
    for (const CLI::Option* option : flags_of(*verb)) {
      text += fmt::format("complete -c effuse -n '__fish_seen_subcommand_from {}'", verb->get_name());
      for (const std::string& name : option->get_snames()) text += " -s " + name;
      for (const std::string& name : option->get_lnames()) text += " -l " + name;
      text += fmt::format("{} -d {}\n", option->get_items_expected_max() > 0 ? " -r" : "", in_quotes(option->get_description()));
    }
  }
  return text;
}

/// roff takes a line's first point or quote for a request, and a minus for a hyphen.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\\' ? std::string("\\e") : c == '-' ? std::string("\\-") : std::string(1, c);
  if (!out.empty() && (out.front() == '.' || out.front() == '\'')) out.insert(0, "\\&");
  return out;
}

}  // namespace

std::vector<std::string> verb_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : app.get_subcommands({})) names.push_back(verb->get_name());
  return names;
}

std::string completions(const CLI::App& app, const std::string& shell) {
  if (shell == "fish") return fish(app);
  return shell == "zsh" ? "#compdef effuse\nautoload -U +X bashcompinit && bashcompinit\n" + bash(app) : bash(app);
}

std::string man_page(const CLI::App& app, const std::string& version) {
  std::string text = fmt::format(".TH EFFUSE 1 \"\" \"effuse {}\" \"User Commands\"\n.SH NAME\neffuse \\- lava over real terrain\n.SH SYNOPSIS\n.B effuse\n.I verb\n.RI [ options ]\n.SH DESCRIPTION\n"
                                 "A digital elevation model or any mesh goes in; particles that obey density, pressure, viscosity and heat run over it; a\n"
                                 "displaced, coloured skin comes out, frame by frame, as meshes, volumes and pictures.\n",
                                 version);
  for (const CLI::App* verb : app.get_subcommands({})) {
    text += fmt::format(".SH {}\n.B effuse {}\n", roff(verb->get_name()), roff(verb->get_name()));
    for (const CLI::Option* option : verb->get_options())
      if (option->get_positional()) text += fmt::format(".I {}\n", roff(option->get_name(true)));
    text += fmt::format(".PP\n{}\n", roff(verb->get_description()));
    for (const CLI::Option* option : flags_of(*verb)) text += fmt::format(".TP\n.B {}\n{}\n", roff(words_of(*option)), roff(option->get_description()));
  }
  return text + ".SH EXIT STATUS\n0 done, 1 failed, 2 wrong use or bad input, 4 unstable, 5 out of disk or memory, 130 interrupted.\n";
}

}  // namespace effuse
