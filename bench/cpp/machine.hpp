// What the machine can do at most, by one thread, and what the library makes of it.
#pragma once

#include <cstddef>

namespace xcalib::bench {

const char* highway_target();

// Copies `count` floats, by plain vector loads and stores.
void copy(const float* from, float* to, std::size_t count);

// Multiplies and adds, in as many independent chains as hide their latency; returns what they came
// to. `flops_per_round` is what one of `rounds` is worth.
float multiply_add(std::size_t rounds);
double flops_per_round();

}  // namespace xcalib::bench
