#pragma once

#include <string_view>

namespace effuse::skin {

/// What lies beside this header for the page (page.html, page.css, *.js), taken into the program when it is built. The name must be one of
/// them (checked).
std::string_view page_file(std::string_view name);

}  // namespace effuse::skin
