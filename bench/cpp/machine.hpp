// What one thread of this machine can do at most, and the instruction set that the library uses.
#pragma once

#include <cstddef>

namespace xcalib::bench {

const char* highway_target();

// Copies `count` floats, by plain vector loads and stores.
void copy(const float* from, float* to, std::size_t count);

// Multiplies and adds, in as many independent chains as hide their latency; returns the sum of
// their results. One of `rounds` is `flops_per_round` floating-point operations.
float multiply_add(std::size_t rounds);
double flops_per_round();

}  // namespace xcalib::bench
