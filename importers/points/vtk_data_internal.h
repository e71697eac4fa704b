#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

/// Numbers of VTK files, legacy and XML.
namespace effuse::importers {

enum class VtkType { kNone, kBit, kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kInt64, kUint64, kFloat, kDouble };

/// Bytes of one; 0 for kBit (eight a byte) and kNone.
inline std::size_t size_of(VtkType type) {
  switch (type) {
    case VtkType::kInt8:
    case VtkType::kUint8:
      return 1;
    case VtkType::kInt16:
    case VtkType::kUint16:
      return 2;
    case VtkType::kInt32:
    case VtkType::kUint32:
    case VtkType::kFloat:
      return 4;
    case VtkType::kInt64:
    case VtkType::kUint64:
    case VtkType::kDouble:
      return 8;
    default:
      return 0;
  }
}

/// The number of that type in the bytes at b.
inline double load_number(const char* b, VtkType type, bool big_endian) {
  const std::size_t size = size_of(type);
  std::uint64_t bits = 0;
  for (std::size_t k = 0; k < size; ++k) {
    const std::size_t from_low = big_endian ? size - 1 - k : k;
    bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(b[k])) << (8 * from_low);
  }
  switch (type) {
    case VtkType::kInt8:
      return static_cast<std::int8_t>(bits);
    case VtkType::kInt16:
      return static_cast<std::int16_t>(bits);
    case VtkType::kInt32:
      return static_cast<std::int32_t>(bits);
    case VtkType::kInt64:
      return static_cast<double>(static_cast<std::int64_t>(bits));
    case VtkType::kFloat:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    case VtkType::kDouble:
      return std::bit_cast<double>(bits);
    default:
      return static_cast<double>(bits);
  }
}

}  // namespace effuse::importers
