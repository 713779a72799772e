#include "config.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <set>

#include "xcalib/error.hpp"
#include "yaml_keys.hpp"

namespace xcalib::cli {
namespace {

const std::string kConfig = "--config";

// The file that --config names, taken out of the arguments.
std::string taken_out(std::vector<std::string>& arguments) {
    for (auto at = arguments.begin(); at != arguments.end(); ++at) {
        if (at->rfind(kConfig + "=", 0) == 0) {
            const std::string file = at->substr(kConfig.size() + 1);
            arguments.erase(at);
            return file;
        }
        if (*at == kConfig && at + 1 != arguments.end()) {
            const std::string file = *(at + 1);
            arguments.erase(at, at + 2);
            return file;
        }
    }
    return "";
}

std::string text_of(const std::string& file, const std::string& key, const YAML::Node& value) {
    if (value.IsScalar()) return value.as<std::string>();
    std::string text;
    bool plain = value.IsSequence();
    for (std::size_t i = 0; plain && i < value.size(); ++i) {
        plain = value[i].IsScalar();
        if (plain) text += (i ? "," : "") + value[i].as<std::string>();
    }
    if (!plain) throw InputError(file + ": " + key + " expects a text or a number");
    return text;
}

}  // namespace

std::vector<std::string> with_config(const CLI::App& command, std::vector<std::string> arguments) {
    const std::string file = taken_out(arguments);
    if (file.empty()) return arguments;
    std::map<std::string, YAML::Node> given = read_keys(file, "reference, source, depth, ...");

    // What was typed: options with their values, and words.
    std::vector<std::string> typed, words;
    std::set<std::string> typed_options;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        const std::string& argument = arguments[i];
        if (argument.size() < 2 || argument[0] != '-') {
            words.push_back(argument);
            continue;
        }
        typed.push_back(argument);
        const CLI::Option* option =
            command.get_option_no_throw(argument.substr(0, argument.find('=')));
        if (!option) continue;
        typed_options.insert(option->get_single_name());
        if (option->get_expected_min() > 0 && argument.find('=') == std::string::npos &&
            i + 1 < arguments.size())
            typed.push_back(arguments[++i]);
    }

    std::vector<std::string> all, names;
    for (const CLI::Option* option : command.get_options()) {
        std::string key = option->get_single_name();
        if (option->get_positional())
            std::transform(key.begin(), key.end(), key.begin(),
                           [](unsigned char c) { return std::tolower(c); });
        if (key == "help" || key == "config") continue;
        names.push_back(key);
        const auto value = given.find(key);
        if (option->get_positional()) {
            if (value != given.end()) {
                all.push_back(text_of(file, key, value->second));
            } else if (!words.empty()) {
                all.push_back(words.front());
                words.erase(words.begin());
            }
        } else if (value != given.end() && !typed_options.count(option->get_single_name())) {
            if (option->get_expected_max() > 0) {
                typed.push_back("--" + key + "=" + text_of(file, key, value->second));
            } else {
                const std::string word = text_of(file, key, value->second);
                if (word != "true" && word != "false")
                    throw InputError(file + ": " + key + " is '" + word +
                                     "', expected true or false");
                if (word == "true") typed.push_back("--" + key);
            }
        }
        if (value != given.end()) given.erase(value);
    }
    if (!given.empty()) {
        std::string known;
        for (const std::string& name : names) known += (known.empty() ? "" : ", ") + name;
        throw InputError(file + ": unknown key '" + given.begin()->first + "', expected " + known);
    }
    if (!words.empty())
        throw InputError(words[0] + ": one argument too many, beside those of --config " + file);
    typed.insert(typed.end(), all.begin(), all.end());
    return typed;
}

}  // namespace xcalib::cli
