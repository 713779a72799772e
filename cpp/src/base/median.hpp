// Order statistics of a few numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace xcalib {

// The value below which the share `q` of the values lies, between two of them in proportion.
// `values`: at least one, none NaN.
template <class Value>
double quantile(std::vector<Value> values, double q) {
    const double place = q * static_cast<double>(values.size() - 1);
    const auto below = static_cast<std::ptrdiff_t>(std::floor(place));
    std::nth_element(values.begin(), values.begin() + below, values.end());
    const double low = values[static_cast<std::size_t>(below)];
    if (place == static_cast<double>(below)) return low;
    const double high = *std::min_element(values.begin() + below + 1, values.end());
    return low + (high - low) * (place - static_cast<double>(below));
}

template <class Value>
double median(std::vector<Value> values) {
    return quantile(std::move(values), 0.5);
}

}  // namespace xcalib
