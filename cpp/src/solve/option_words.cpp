#include "xcalib/option_words.hpp"

#include <stdexcept>

namespace xcalib {

template <>
const Words<SearchMode>& words<SearchMode>() {
    static const Words<SearchMode> list = {{SearchMode::automatic, "auto"},
                                           {SearchMode::full, "full"},
                                           {SearchMode::local, "local"},
                                           {SearchMode::off, "off"}};
    return list;
}

template <>
const Words<FlowMode>& words<FlowMode>() {
    static const Words<FlowMode> list = {
        {FlowMode::automatic, "auto"}, {FlowMode::on, "on"}, {FlowMode::off, "off"}};
    return list;
}

template <>
const Words<Solver>& words<Solver>() {
    static const Words<Solver> list = {{Solver::ceres, "ceres"}, {Solver::adam, "adam"}};
    return list;
}

template <>
const Words<Occlusion>& words<Occlusion>() {
    static const Words<Occlusion> list = {
        {Occlusion::ignore, "ignore"}, {Occlusion::mark, "mark"}, {Occlusion::hide, "hide"}};
    return list;
}

template <>
const Words<NecFloor>& words<NecFloor>() {
    static const Words<NecFloor> list = {{NecFloor::none, "none"}, {NecFloor::printed, "printed"}};
    return list;
}

const Words<FlowMode>& flow_arguments() {
    static const Words<FlowMode> list = {
        {FlowMode::automatic, "auto"}, {FlowMode::off, "off"}, {FlowMode::on, "patch"}};
    return list;
}

void refuse_word(const std::string& field, const std::string& given,
                 const std::vector<std::string>& known) {
    std::string expected;
    for (std::size_t i = 0; i < known.size(); ++i)
        expected += (i == 0 ? "" : i + 1 < known.size() ? ", " : " or ") + known[i];
    throw std::invalid_argument(field + " is '" + given + "', expected " + expected);
}

}  // namespace xcalib
