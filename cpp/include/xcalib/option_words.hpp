// The words that options go by on command lines, in Python and in messages.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "xcalib/calibration_options.hpp"
#include "xcalib/export.hpp"
#include "xcalib/nec.hpp"
#include "xcalib/register.hpp"

namespace XCALIB_EXPORT xcalib {

template <class Value>
using Words = std::vector<std::pair<Value, const char*>>;

// Every value of an enumeration with its word.
template <class Value>
const Words<Value>& words();
template <>
const Words<SearchMode>& words<SearchMode>();
template <>
const Words<FlowMode>& words<FlowMode>();
template <>
const Words<Solver>& words<Solver>();
template <>
const Words<Occlusion>& words<Occlusion>();
template <>
const Words<NecFloor>& words<NecFloor>();

// What `--flow` of the commands takes besides networks: `on` goes by the name of the built-in
// estimator, `patch`.
const Words<FlowMode>& flow_arguments();

// A field that holds none of the words: "flow is 'x', expected auto, on or off".
[[noreturn]] void refuse_word(const std::string& field, const std::string& given,
                              const std::vector<std::string>& known);

template <class Value>
std::vector<std::string> names_of(const Words<Value>& words) {
    std::vector<std::string> list;
    for (const auto& [value, word] : words) list.emplace_back(word);
    return list;
}

template <class Value>
const char* word_of(Value value) {
    for (const auto& [known, word] : words<Value>())
        if (known == value) return word;
    return "";
}

// Throws std::invalid_argument naming `field`, the word and those known.
template <class Value>
Value value_of(const std::string& field, const std::string& given,
               const Words<Value>& known = words<Value>()) {
    for (const auto& [value, word] : known)
        if (given == word) return value;
    refuse_word(field, given, names_of(known));
}

}  // namespace xcalib
