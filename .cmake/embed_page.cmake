# cmake -DFROM=skin/page -DTO=page_files.cpp -DNAMES=page.html,page.css,... -P embed_page.cmake
# Writes skin/page/page_files.h's function with the files' bytes in it.
string(REPLACE "," ";" names "${NAMES}")
set(text "#include \"skin/page/page_files.h\"\n\n#include \"geometry/base/check.h\"\n\nnamespace effuse::skin {\n\nnamespace {\n")
set(cases "")
set(number 0)
foreach(name IN LISTS names)
  file(READ ${FROM}/${name} hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  # Lines of at most 40 bytes, for whoever opens it.
  string(REGEX REPLACE "((0x[0-9a-f][0-9a-f],)(0x[0-9a-f][0-9a-f],)(0x[0-9a-f][0-9a-f],)(0x[0-9a-f][0-9a-f],)(0x[0-9a-f][0-9a-f],)(0x[0-9a-f][0-9a-f],)(0x[0-9a-f][0-9a-f],)(0x[0-9a-f][0-9a-f],))" "\\1\n" bytes "${bytes}")
  string(APPEND text "constexpr unsigned char kFile${number}[] = {\n${bytes}0};\n")
  string(APPEND cases "  if (name == \"${name}\") return {reinterpret_cast<const char*>(kFile${number}), sizeof kFile${number} - 1};\n")
  math(EXPR number "${number} + 1")
endforeach()
string(APPEND text "}  // namespace\n\nstd::string_view page_file(std::string_view name) {\n${cases}  CHECK(false);\n  return {};\n}\n\n}  // namespace effuse::skin\n")
file(WRITE ${TO} "${text}")
