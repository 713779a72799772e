// How many threads may be asked for.
#pragma once

namespace xcalib {

// More are a slip, or an attack: each costs memory, and no machine here has so many cores.
inline constexpr int kMaxThreads = 1024;

}  // namespace xcalib
