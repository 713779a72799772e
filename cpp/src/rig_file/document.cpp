#include "rig_file/document.hpp"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "base/read_file.hpp"

namespace xcalib {
namespace {

constexpr std::size_t kMaxDepth = 16;
constexpr std::size_t kMaxNodes = 10000;
constexpr std::size_t kMaxQuoted = 60;

[[noreturn]] void reject(const std::string& path, const std::string& what) {
    throw std::invalid_argument(path + ": " + what);
}

// Goes through a document without building it: before aliases could make a small one large.
class Inspector : public YAML::EventHandler {
   public:
    explicit Inspector(const std::string& path) : path_(path) {}

    void OnDocumentStart(const YAML::Mark&) override {}
    void OnDocumentEnd() override {}
    void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { node(mark, "null"); }
    void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
        reject(path_, "an alias (*) in line " + line(mark) + ", expected values only");
    }
    void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  const std::string& value) override {
        node(mark, value);
    }
    void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                         YAML::EmitterStyle::value) override {
        begin(mark, false);
    }
    void OnSequenceEnd() override { levels_.pop_back(); }
    void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                    YAML::EmitterStyle::value) override {
        begin(mark, true);
    }
    void OnMapEnd() override { levels_.pop_back(); }

   private:
    struct Level {
        bool map, key_is_next;
        std::set<std::string> keys;
    };

    static std::string line(const YAML::Mark& mark) { return std::to_string(mark.line + 1); }

    void node(const YAML::Mark& mark, const std::string& value) {
        if (++nodes_ > kMaxNodes)
            reject(path_, "more than " + std::to_string(kMaxNodes) + " values in it");
        if (levels_.empty() || !levels_.back().map) return;
        Level& level = levels_.back();
        if (level.key_is_next && !level.keys.insert(value).second)
            reject(path_, "'" + quoted(value) + "' is given again in line " + line(mark) +
                              ", expected once");
        level.key_is_next = !level.key_is_next;
    }
    void begin(const YAML::Mark& mark, bool map) {
        // A key that is a list or a mapping is none that we know; each is one of its own.
        node(mark, std::to_string(nodes_) + "\n");
        if (levels_.size() == kMaxDepth)
            reject(path_,
                   "nested more than " + std::to_string(kMaxDepth) + " deep in line " + line(mark));
        levels_.push_back({map, true, {}});
    }

    const std::string& path_;
    std::vector<Level> levels_;
    std::size_t nodes_ = 0;
};

}  // namespace

YAML::Node parse_document(const std::string& text, const std::string& path) {
    try {
        std::istringstream in(text);
        YAML::Parser parser(in);
        Inspector inspector(path);
        parser.HandleNextDocument(inspector);
        if (parser.HandleNextDocument(inspector))
            reject(path, "a second document (---) in it, expected one");
        return YAML::Load(text);
    } catch (const YAML::Exception& error) {
        reject(path, "not a YAML rig file: " + quoted(error.what()));
    }
}

YAML::Node load_document(const std::string& path) {
    return parse_document(read_whole(path, kMaxTextBytes), path);
}

std::string quoted(const std::string& value) {
    std::string text = value.substr(0, kMaxQuoted);
    for (char& c : text)
        if (static_cast<unsigned char>(c) < ' ') c = ' ';
    if (value.size() <= kMaxQuoted) return text;
    // Not within a character of several bytes.
    while (!text.empty() && (static_cast<unsigned char>(value[text.size()]) & 0xc0) == 0x80)
        text.pop_back();
    return text + "... (" + std::to_string(value.size()) + " characters)";
}

}  // namespace xcalib
