#include <gtest/gtest.h>

#include <optional>
#include <thread>

#include "refusal.hpp"
#include "scratch.hpp"
#include "xcalib/stream/journal.hpp"

namespace xcalib {
namespace {

using namespace testing;
namespace fs = std::filesystem;

const MadeWith kMade = {{"command", "one"}, {"far", "60"}, {"rig", "abc"}};

TEST(Journal, NotesUnitsAndReadsThemAgain) {
    const Scratch scratch;
    const fs::path path = scratch / "out/register.jsonl";
    write_text(scratch / "out/a.png", "four");
    write_text(scratch / "out/masks/a.png", "1");
    {
        Journal journal(path, kMade);
        EXPECT_TRUE(journal.units().empty());
        journal.append({{"key", 7}}, {"a.png", "masks/a.png"});
    }
    const Journal journal(path, kMade);
    ASSERT_EQ(journal.units().size(), 1u);
    const Unit& unit = journal.units()[0];
    EXPECT_EQ(unit.frames, (std::vector<std::pair<std::string, long>>{{"key", 7}}));
    EXPECT_EQ(unit.files, (std::vector<std::pair<std::string, std::uintmax_t>>{
                              {"a.png", 4}, {"masks/a.png", 1}}));
    EXPECT_TRUE(has(text_of(path), "\"command\":\"one\""));
}

TEST(Journal, IsALineForEachUnitWhichPeopleCanRead) {
    const Scratch scratch;
    write_text(scratch / "a.png", "four");
    Journal journal(scratch / "j", {{"command", "one"}});
    journal.append({{"k1", 1}, {"k0", 2}}, {"a.png"});
    EXPECT_EQ(text_of(scratch / "j"),
              "{\"format\":\"xcalib-register\",\"version\":1,\"made_with\":{\"command\":\"one\"}}\n"
              "{\"frames\":{\"k1\":1,\"k0\":2},\"files\":{\"a.png\":4}}\n");
}

TEST(Journal, IsGoneAgainWithItsFolderWhereNothingWasNoted) {
    const Scratch scratch;
    { const Journal journal(scratch / "new/deep/j", kMade); }
    EXPECT_FALSE(fs::exists(scratch / "new"));
}

TEST(Journal, IsOneProcessAtATimes) {
    const Scratch scratch;
    std::optional<Journal> held(std::in_place, scratch / "j", kMade);
    EXPECT_TRUE(has(refusal([&] { Journal(scratch / "j", kMade); }), "another run is writing"));
    // Not even to be overwritten.
    EXPECT_TRUE(
        has(refusal([&] { Journal(scratch / "j", kMade, true); }), "another run is writing"));
    held.reset();
    EXPECT_EQ(refusal([&] { Journal(scratch / "j", kMade); }), "");
}

class JournalOfARun : public ::testing::Test {
   protected:
    JournalOfARun() {
        Journal journal(path, kMade);
        for (const char* name : {"a.png", "b.png"}) {
            write_text(scratch / name, name);
            journal.append({{std::string("key of ") + name, 1}}, {name});
        }
    }
    std::string refused(const MadeWith& now) {
        return refusal([&] { Journal(path, now); });
    }

    Scratch scratch;
    const fs::path path = scratch / "j";
};

TEST_F(JournalOfARun, OfWhatWasMadeOtherwiseIsRefusedAndKept) {
    const std::string before = text_of(path);
    MadeWith now = kMade;
    now[1].second = "40";
    EXPECT_EQ(refused(now), path.string() +
                                ": this output was made otherwise (far 60, now 40); expected the"
                                " same, another output, or --overwrite");
    now = {kMade[0], kMade[1], kMade[2], {"new", "1"}};
    EXPECT_TRUE(has(refused(now), "(new none, now 1)"));
    EXPECT_TRUE(has(refused({kMade[0], kMade[1]}), "(rig abc, now none)"));
    EXPECT_EQ(text_of(path), before);
    EXPECT_EQ(refused(kMade), "");
}

TEST_F(JournalOfARun, OfAnotherCommandIsRefusedForThatAlone) {
    EXPECT_TRUE(has(refused({{"command", "two"}, {"distance", "60.0"}, {"rig", "abc"}}),
                    "(command one, now two); expected the same, another output, or --overwrite"));
    // As journals were before they named it.
    write_text(path,
               "{\"format\":\"xcalib-register\",\"version\":1,\"made_with\":{\"far\":\"6\"}}\n");
    EXPECT_TRUE(has(refused(kMade), "(command none, now one)"));
}

TEST_F(JournalOfARun, OverwrittenRemovesWhatItNoted) {
    write_text(scratch / "mine.png", "");
    {
        const Journal journal(path, {{"command", "two"}}, true);
        EXPECT_TRUE(journal.units().empty());
    }
    EXPECT_EQ(files_below(scratch / ""), (std::map<std::string, std::string>{{"mine.png", ""}}));
}

TEST_F(JournalOfARun, HoldsOnlyWhatIsStillWhole) {
    write_text(scratch / "a.png", "cut");
    EXPECT_EQ(Journal(path, kMade).units().size(), 1u);
    fs::remove(scratch / "b.png");
    EXPECT_TRUE(Journal(path, kMade).units().empty());
}

TEST_F(JournalOfARun, LosesHalfALine) {
    const std::string whole = text_of(path);
    write_text(path, whole + "{\"frames\": {\"12");
    EXPECT_EQ(Journal(path, kMade).units().size(), 2u);
    EXPECT_EQ(text_of(path), whole);
}

TEST_F(JournalOfARun, RemovesNothingElsewhere) {
    const Scratch& s = scratch;
    const std::string whole = text_of(path);
    for (const std::string name : {"../mine", "/tmp/mine", "masks/../../mine"}) {
        write_text(path, whole + "{\"frames\":{\"a\":1},\"files\":{\"" + name + "\":0}}\n");
        EXPECT_TRUE(has(refusal([&] { Journal(path, kMade, true); }), "not a journal")) << name;
        EXPECT_TRUE(fs::exists(s / "a.png"));
    }
    // Two dots within a name are no way out.
    write_text(s / "cam..1.png", "x");
    write_text(path, whole + "{\"frames\":{\"a\":1},\"files\":{\"cam..1.png\":1}}\n");
    EXPECT_EQ(Journal(path, kMade).units().size(), 3u);
}

TEST(Journal, RefusesWhatIsNone) {
    const Scratch scratch;
    const std::string first =
        "{\"format\":\"xcalib-register\",\"version\":1,\"made_with\":{\"command\":\"one\"}}\n";
    for (const std::string& text :
         {std::string("{}\n"), std::string("no\n"), std::string("{\"format\": \"x\"}\n"),
          std::string("{\"format\":\"xcalib-register\",\"version\":2,\"made_with\":{}}\n"),
          std::string("{\"format\":\"xcalib-register\",\"version\":1,\"made_with\":[]}\n"),
          first + "{\"frames\":{}}\n", first + "{\"frames\":{\"a\":1},\"files\":{}}\n",
          first + "{\"frames\":{\"a\":\"b\"},\"files\":{\"c\":1}}\n", first + "7\n",
          first + "{\"frames\":{\"a\":1},\"files\":{\"c\":[1]}}\n"}) {
        write_text(scratch / "j", text);
        for (const bool overwrite : {false, true})
            EXPECT_TRUE(has(refusal([&] { Journal(scratch / "j", kMade, overwrite); }),
                            "expected another output, or this file removed"))
                << text;
        EXPECT_EQ(text_of(scratch / "j"), text);
    }
}

TEST(Journal, TakesUnitsFromManyThreads) {
    const Scratch scratch;
    write_text(scratch / "a", "");
    {
        Journal journal(scratch / "j", kMade);
        std::vector<std::thread> threads;
        for (int t = 0; t < 4; ++t)
            threads.emplace_back([&, t] {
                for (int i = 0; i < 50; ++i)
                    journal.append({{std::to_string(100 * t + i), i}}, {"a"});
            });
        for (std::thread& thread : threads) thread.join();
        EXPECT_TRUE(journal.units().empty());  // memory does not grow with what is noted
    }
    EXPECT_EQ(Journal(scratch / "j", kMade).units().size(), 200u);
}

TEST(Journal, NamesAreBytes) {
    const Scratch scratch;
    const std::string name = "w\xc3\xa4rme \"1\".png";
    write_text(scratch / name, "x");
    {
        Journal journal(scratch / "j", kMade);
        journal.append({{"k", 1}}, {name});
    }
    const Journal journal(scratch / "j", kMade);
    ASSERT_EQ(journal.units().size(), 1u);
    EXPECT_EQ(journal.units()[0].files[0].first, name);
}

}  // namespace
}  // namespace xcalib
