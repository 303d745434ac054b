// Arrays that Python hands to the core, and what each file of bindings adds to the module. No call
// keeps an array; only grids keep their map.
#pragma once

#include <nanobind/stl/tuple.h>

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <tuple>

#include "batch.hpp"
#include "bindings/made_arrays.hpp"

namespace slopewise {

using Input1 = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Input2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

using Counts1 = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Compiled once, not for each type of array.
void expect_sizes(const char* name, const std::int64_t* found, std::initializer_list<Index> shape);

template <class Array>
void expect_shape(const char* name, const Array& array, std::initializer_list<Index> shape) {
  expect_sizes(name, array.shape_ptr(), shape);
}

void bind_profile(nb::module_& m);
void bind_ground(nb::module_& m);
void bind_bounds(nb::module_& m);
void bind_forces(nb::module_& m);
void bind_swept(nb::module_& m);
void bind_verify(nb::module_& m);
void bind_horizon(nb::module_& m);
void bind_path(nb::module_& m);

}  // namespace slopewise
