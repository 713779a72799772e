#include "wrong_words.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <numeric>
#include <utility>

namespace xcalib::cli {
namespace {

std::string name_of(const std::string& word) { return word.substr(0, word.find('=')); }

// Letters to be put in, left out or replaced.
std::size_t distance(const std::string& one, const std::string& other) {
    std::vector<std::size_t> row(other.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < one.size(); ++i) {
        std::size_t corner = row[0];
        row[0] = i + 1;
        for (std::size_t j = 0; j < other.size(); ++j) {
            const std::size_t replaced = corner + (one[i] != other[j]);
            corner = row[j + 1];
            row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, replaced});
        }
    }
    return row.back();
}

bool is_number(const std::string& word) {
    return word.size() > 1 && (std::isdigit(static_cast<unsigned char>(word[1])) || word[1] == '.');
}

}  // namespace

std::string unknown_option(const CLI::App& app, const CLI::App& command,
                           const std::vector<std::string>& arguments) {
    bool is_value = false;
    for (const std::string& word : arguments) {
        if (word.size() < 2 || word[0] != '-') {
            is_value = false;
            continue;
        }
        const CLI::Option* option = command.get_option_no_throw(name_of(word));
        if (!option) option = app.get_option_no_throw(name_of(word));
        const bool skipped = std::exchange(
            is_value, option && option->get_expected_max() > 0 && name_of(word) == word);
        if (skipped || option || is_number(word)) continue;
        // A letter with its value behind it.
        if (word[1] != '-' && command.get_option_no_throw(word.substr(0, 2))) continue;
        return name_of(word);
    }
    return "";
}

std::string no_such_option(const CLI::App& command, const std::string& option) {
    std::string near;
    for (const CLI::Option* known : command.get_options()) {
        if (known->get_positional() || known->get_group().empty()) continue;
        const std::string name = "--" + known->get_single_name();
        if (distance(name, option) > 2 && name.rfind(option, 0) != 0) continue;
        near += (near.empty() ? "" : " or ") + name;
    }
    return "No such option '" + option + "'" +
           (near.empty() ? "; --help lists them" : ", did you mean " + near + "?");
}

std::string usage_of(const CLI::App& command) {
    std::string text = command.get_name();
    for (const CLI::Option* option : command.get_options())
        if (option->get_positional()) text += " " + option->get_single_name();
    return text;
}

}  // namespace xcalib::cli
