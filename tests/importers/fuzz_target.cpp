// libFuzzer's way in: sh tests/fuzz.sh builds and runs it. The first byte picks the parser.

#include <cstddef>
#include <cstdint>

#include "tests/importers/fuzz_parsers.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const char* parser = effuse::importers::kParsers[data[0] % effuse::importers::kParsers.size()];
  effuse::importers::parse_with(parser, {reinterpret_cast<const char*>(data) + 1, size - 1});
  return 0;
}
