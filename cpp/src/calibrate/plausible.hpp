// Is a rig one that somebody could have built? What is wrong with the footage (a late source, a
// shutter that rolls, depth in another unit) bends it into one that nobody could.
#pragma once

#include <optional>
#include <string>

#include "solve/plan.hpp"
#include "xcalib/error_field.hpp"

namespace xcalib {

// Why a rig is not to be trusted, and the next step.
struct Objection {
    std::string reason, advice;
};

// `near`: the depth that 5 % of the pixels are nearer than [m].
std::optional<Objection> implausible_in(const Rig& rig, double near, const Plan& plan,
                                        const ErrorField& errors);

}  // namespace xcalib
