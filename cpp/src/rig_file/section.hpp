// A part of a rig file: fields that are all known, each with one way to be read.
#pragma once

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "rig_file/document.hpp"

namespace xcalib {

[[noreturn]] inline void reject(const std::string& path, const std::string& what) {
    throw std::invalid_argument(path + ": " + what);
}

// The shortest text that reads back as the same double, whatever the locale.
inline std::string text_of(double value) {
    char buffer[32];
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
    return std::string(buffer, end);
}

// A mapping of which every key is known, and present but for those that may be left out.
class Section {
   public:
    Section(const std::string& path, std::string name, const YAML::Node& node,
            std::initializer_list<const char*> keys,
            std::initializer_list<const char*> optional = {})
        : path_(path), name_(std::move(name)), node_(node) {
        if (!node.IsMap()) reject(path, "expected a mapping of fields in " + name_);
        for (const auto& item : node) {
            const std::string key = item.first.as<std::string>();
            bool known = false;
            for (const auto& list : {keys, optional})
                for (const char* expected : list) known = known || key == expected;
            if (!known)
                reject(path, "unknown field '" + quoted(key) + "' in " + name_ + ", expected " +
                                 joined(keys) + (optional.size() ? ", and if needed " : "") +
                                 joined(optional) + "; notes go behind a #");
        }
        for (const char* key : keys)
            if (!node[key])
                reject(path, std::string("missing field '") + key + "' in " + name_ +
                                 ", expected " + joined(keys) +
                                 (key == std::string("skew") ? "; write skew: 0 for none" : ""));
    }

    YAML::Node node(const char* key) const { return node_[key]; }

    std::string text(const char* key) const {
        if (!node_[key].IsScalar()) fail(key, "(not a single value)", "text");
        return node_[key].Scalar();
    }

    int size(const char* key) const {
        return whole(key, "a whole number of px, at least 1, as in 640");
    }
    int count(const char* key) const { return whole(key, "a whole number, at least 1"); }

    double number(const char* key) const { return number(key, node_[key]); }

    // A depth [m], .inf for what is far.
    double depth(const char* key) const {
        const double value = length(key, node_[key]);
        if (!(value > 0)) fail(key, scalar(node_[key]), "a depth > 0 or .inf");
        return value;
    }

    bool flag(const char* key) const {
        const std::string word = text(key);
        if (word != "true" && word != "false") fail(key, word, "true or false");
        return word == "true";
    }

    std::vector<double> numbers(const char* key, std::size_t count) const {
        const YAML::Node list = node_[key];
        if (!list.IsSequence() || list.size() != count)
            fail(key, list.IsSequence() ? std::to_string(list.size()) + " values" : scalar(list),
                 "a list of " + std::to_string(count) + " numbers");
        return numbers(key);
    }

    std::vector<double> numbers(const char* key) const {
        const YAML::Node list = node_[key];
        if (!list.IsSequence()) fail(key, scalar(list), "a list of numbers");
        std::vector<double> out;
        for (const YAML::Node& item : list) out.push_back(number(key, item));
        return out;
    }

    [[noreturn]] void fail(const char* key, const std::string& value,
                           const std::string& expected) const {
        reject(path_, name_ + "." + key + " = " + quoted(value) + ", expected " + expected);
    }

    // Lengths, each of which may be .inf.
    std::vector<double> lengths(const char* key, std::size_t count) const {
        const YAML::Node list = node_[key];
        if (!list.IsSequence() || list.size() != count)
            fail(key, scalar(list), "a list of " + std::to_string(count) + " lengths");
        std::vector<double> out;
        for (const YAML::Node& item : list) out.push_back(length(key, item));
        return out;
    }

   private:
    double length(const char* key, const YAML::Node& node) const {
        const bool infinite = node.IsScalar() && node.Scalar() == ".inf";
        const double value = infinite ? std::numeric_limits<double>::infinity() : number(key, node);
        if (!(value >= 0)) fail(key, scalar(node), "a length >= 0 or .inf");
        return value;
    }
    int whole(const char* key, const char* expected) const {
        int value = 0;
        const std::string text = node_[key].IsScalar() ? node_[key].Scalar() : "";
        const char* const end = text.data() + text.size();
        const auto [stopped, error] = std::from_chars(text.data(), end, value);
        if (stopped != end || error != std::errc() || value < 1)
            fail(key, scalar(node_[key]), expected);
        return value;
    }
    static std::string scalar(const YAML::Node& node) {
        return node.IsScalar() ? node.Scalar() : "(not a single value)";
    }
    static std::string joined(const std::initializer_list<const char*>& names) {
        std::string text;
        for (const char* name : names) text += (text.empty() ? "" : ", ") + std::string(name);
        return text;
    }
    double number(const char* key, const YAML::Node& node) const {
        double value = 0;
        const std::string text = node.IsScalar() ? node.Scalar() : "";
        const char* const end = text.data() + text.size();
        const auto [stopped, error] = std::from_chars(text.data(), end, value);
        // Of a number that is too large or too small there is an error, and no value.
        if (stopped != end || error != std::errc() || !std::isfinite(value))
            fail(key, scalar(node), "a finite number");
        return value;
    }

    const std::string& path_;
    std::string name_;
    YAML::Node node_;
};

}  // namespace xcalib
