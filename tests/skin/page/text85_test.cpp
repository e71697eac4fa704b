#include "skin/page/text85.h"

#include <gtest/gtest.h>

#include <cctype>
#include <string>

#include "geometry/base/random.h"
#include "tests/skin/page/unpack.h"

namespace effuse::skin {
namespace {

std::string noise(std::size_t length) {
  std::string bytes;
  for (std::size_t k = 0; k < length; ++k) bytes.push_back(static_cast<char>(256 * random_uniform(5, 0, k)));
  return bytes;
}

TEST(Text85, GivesBackBytesOfAnyLength) {
  for (std::size_t length = 0; length < 40; ++length) {
    const std::string bytes = noise(length), text = text85(bytes);
    EXPECT_EQ(text.size(), (length + 3) / 4 * 5);
    EXPECT_EQ(testing_page::bytes_of_text85(text, length), bytes);
  }
  const std::string highest(8, '\xff');
  EXPECT_EQ(testing_page::bytes_of_text85(text85(highest), 8), highest);
}

TEST(Text85, HasNoCharacterThatHtmlOrAStringWouldRead) {
  for (const char c : text85(noise(100000))) ASSERT_TRUE(std::isgraph(static_cast<unsigned char>(c)) && c != '<' && c != '&' && c != '\\' && c != '"') << c;
}

TEST(Text85, DeflatesToWhatZlibInflates) {
  for (const std::string& bytes : {std::string(), std::string("a"), std::string(1'000'000, 'x'), noise(70000)}) EXPECT_EQ(testing_page::inflate_raw(deflate_raw(bytes)), bytes);
  EXPECT_LT(deflate_raw(std::string(1'000'000, 'x')).size(), 2000u);
}

}  // namespace
}  // namespace effuse::skin
