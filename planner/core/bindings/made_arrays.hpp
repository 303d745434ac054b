// Arrays that Python will own.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstddef>
#include <new>

namespace slopewise {

namespace nb = nanobind;

template <class T>
using Made = nb::ndarray<nb::numpy, T, nb::c_contig>;

// An array of numbers that are whatever was there before: the caller writes all of them.
template <class T = double, class... Sizes>
Made<T> make_rows(Sizes... sizes) {
  const std::size_t count = (std::size_t{1} * ... * static_cast<std::size_t>(sizes));
  constexpr std::align_val_t line{64};  // arrays begin with a cache line
  auto* numbers = static_cast<T*>(::operator new(count * sizeof(T), line));
  const nb::capsule owner(numbers, [](void* of) noexcept { ::operator delete(of, line); });
  return Made<T>(numbers, {static_cast<std::size_t>(sizes)...}, owner);
}

// An array of zeros.
template <class T = double, class... Sizes>
Made<T> make_array(Sizes... sizes) {
  Made<T> made = make_rows<T>(sizes...);
  std::fill_n(made.data(), made.size(), T{});
  return made;
}

}  // namespace slopewise
