#include "yaml_keys.hpp"

#include "xcalib/error.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib::cli {

std::map<std::string, YAML::Node> read_keys(const std::string& file, const std::string& names) {
    const std::string text = read_file(file);
    check_text(text, file);
    std::map<std::string, YAML::Node> keys;
    try {
        const YAML::Node root = YAML::Load(text);
        if (!root.IsMap())
            throw InputError(file + ": expected keys and values, one a line: " + names);
        for (const auto& item : root) keys[item.first.as<std::string>()] = item.second;
    } catch (const YAML::Exception& error) {
        throw InputError(file + ": not YAML: " + error.what());
    }
    return keys;
}

}  // namespace xcalib::cli
