// The module that Python imports.
#include "bindings/bindings.hpp"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace slopewise {
namespace {

// A module for a newer processor would end the process without a message. The processor is asked
// directly, because compiler-rt of zig knows no processor.
void expect_processor() {
#if defined(__x86_64__)
  unsigned needed = 0, a = 0, features = 0, c = 0, d = 0;
#ifdef __AVX2__
  needed |= bit_AVX2;
#endif
#ifdef __AVX512F__
  needed |= bit_AVX512F;
#endif
  __get_cpuid_count(7, 0, &a, &features, &c, &d);
  if ((features & needed) != needed) {
    throw nb::import_error("it was compiled for another processor: install slopewise again here");
  }
#endif
}

}  // namespace

void expect_sizes(const char* name, const std::int64_t* found, std::initializer_list<Index> shape) {
  std::size_t axis = 0;
  for (const Index size : shape) {
    const std::int64_t has = found[axis++];
    if (has == size) continue;
    std::string text = name;
    text.append(": expected ").append(std::to_string(size)).append(" along axis ");
    text.append(std::to_string(axis - 1)).append(", got ").append(std::to_string(has));
    throw nb::value_error(text.c_str());
  }
}

}  // namespace slopewise

NB_MODULE(_core, m) {
  slopewise::expect_processor();
  nanobind::set_leak_warnings(false);  // grids of the last maps live until the process ends
  m.attr("DIGEST") = SLOPEWISE_DIGEST;
  slopewise::bind_profile(m);
  slopewise::bind_ground(m);
  slopewise::bind_bounds(m);
  slopewise::bind_forces(m);
  slopewise::bind_swept(m);
  slopewise::bind_verify(m);
  slopewise::bind_horizon(m);
  slopewise::bind_path(m);
}
