#pragma once

#include <sstream>
#include <string>

/// Promises between caller and callee. A broken one is a bug of ours: both values are printed and
/// the program stops. Bad files and scenes are not bugs: they throw InputError (error.h).
namespace effuse::detail {

[[noreturn]] void check_failed(const char* expression, const std::string& values, const char* file, int line);

template <class A, class B>
std::string both_values(const A& a, const B& b) {
  std::ostringstream out;
  out << a << " against " << b;
  return out.str();
}

}  // namespace effuse::detail

#define CHECK(condition)                                                                   \
  do {                                                                                     \
    if (!(condition)) [[unlikely]]                                                         \
      ::effuse::detail::check_failed(#condition, "", __FILE__, __LINE__);                  \
  } while (false)

#define EFFUSE_CHECK_OP(a, op, b)                                                          \
  do {                                                                                     \
    if (!((a)op(b))) [[unlikely]]                                                          \
      ::effuse::detail::check_failed(#a " " #op " " #b,                                    \
                                     ::effuse::detail::both_values((a), (b)), __FILE__, __LINE__); \
  } while (false)

#define CHECK_EQ(a, b) EFFUSE_CHECK_OP(a, ==, b)
#define CHECK_NE(a, b) EFFUSE_CHECK_OP(a, !=, b)
#define CHECK_LT(a, b) EFFUSE_CHECK_OP(a, <, b)
#define CHECK_LE(a, b) EFFUSE_CHECK_OP(a, <=, b)
#define CHECK_GT(a, b) EFFUSE_CHECK_OP(a, >, b)
#define CHECK_GE(a, b) EFFUSE_CHECK_OP(a, >=, b)

#ifdef NDEBUG
#define DCHECK(condition) \
  do {                    \
  } while (false)
#else
#define DCHECK(condition) CHECK(condition)
#endif
