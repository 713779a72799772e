// A kernel on every instruction set that this machine has.
#pragma once

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <cstdint>

namespace xcalib::testing {

// Calls `work` once for each instruction set, and leaves the choice as it was.
template <class Work>
void on_every_target(const Work& work) {
#ifdef HWY_COMPILE_ONLY_STATIC  // where there is but one, without Highway's library
    SCOPED_TRACE(hwy::TargetName(HWY_STATIC_TARGET));
    work();
#else
    int count = 0;
    for (std::int64_t targets = hwy::SupportedTargets() & HWY_TARGETS; targets != 0;
         targets &= targets - 1) {
        const std::int64_t target = targets & -targets;
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        SCOPED_TRACE(hwy::TargetName(target));
        work();
        ++count;
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    EXPECT_GE(count, 2) << "the baseline and at least one more";
#endif
}

}  // namespace xcalib::testing
