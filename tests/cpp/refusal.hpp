// What a call refuses, in its own words.
#pragma once

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace xcalib::testing {

// Message of the std::invalid_argument that `call` throws; empty where it throws none.
template <class Call>
std::string refusal(const Call& call) {
    try {
        call();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

inline ::testing::AssertionResult has(const std::string& text, const std::string& part) {
    if (text.find(part) != std::string::npos) return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << "'" << part << "' is not in '" << text << "'";
}

}  // namespace xcalib::testing
