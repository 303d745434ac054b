// What programs share that put random problems through the core, under sanitizers.
#pragma once

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "batch.hpp"

namespace slopewise::driver {

inline std::mt19937_64 generator;

inline double uniform(double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(generator);
}

inline Index whole(Index low, Index high) {
  return std::uniform_int_distribution<Index>(low, high)(generator);
}

inline bool sometimes(double share) { return uniform(0.0, 1.0) < share; }

inline void expect(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "violated: %s\n", what);
  std::exit(1);
}

// Memory of the exact size, so that a step beyond it is found.
inline std::vector<double> numbers(Index count, double low, double high) {
  std::vector<double> out(static_cast<std::size_t>(count));
  for (double& number : out) number = uniform(low, high);
  return out;
}

// Problem after problem, with its number as the seed, for as many seconds as the first argument.
template <class Problem>
int run(int count, char** arguments, Problem problem) {
  const double seconds = count > 1 ? std::atof(arguments[1]) : 1.0;
  const auto start = std::chrono::steady_clock::now();
  std::chrono::duration<double> taken{};
  Index problems = 0;
  for (; taken.count() < seconds; taken = std::chrono::steady_clock::now() - start) {
    generator.seed(static_cast<unsigned long>(problems));
    problem(problems++);
  }
  std::printf("%td problems\n", problems);
  return 0;
}

}  // namespace slopewise::driver
