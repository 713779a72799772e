// Streams, depth and codecs without files: pictures of one value, and text that says what was
// written.
#pragma once

#include <cstring>
#include <fstream>
#include <functional>
#include <stdexcept>

#include "scratch.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/frames.hpp"
#include "xcalib/stream/sink.hpp"

namespace xcalib::testing {

inline Picture plain(int width, int height, int value, int channels = 1) {
    MutableImageView pixels;
    Picture picture = new_picture(width, height, channels, PixelType::u8, pixels);
    std::memset(pixels.data, value, static_cast<std::size_t>(width) * height * channels);
    return picture;
}

// Frame i is plain, of value i modulo 256; before it is read, `meet` is called.
class PlainStream : public Stream {
   public:
    PlainStream(
        std::string named, int count, bool concurrent = true,
        std::function<void(int)> meet = [](int) {})
        : named_(std::move(named)), count_(count), concurrent_(concurrent), meet_(std::move(meet)) {
    }
    int size() const override { return count_; }
    std::string name(int index) const override { return six_digits(index); }
    std::string where(int index) const override {
        return named_ + " frame " + std::to_string(index);
    }
    std::filesystem::path file(int) const override { return named_; }
    bool concurrent() const override { return concurrent_; }

    int width = 16, height = 12;

   private:
    Picture read(int index) override {
        meet_(index);
        return plain(width, height, index % 256);
    }

    std::string named_;
    int count_;
    bool concurrent_;
    std::function<void(int)> meet_;
};

// 5 m everywhere; before a frame's is given, `meet` is called.
class PlainDepth : public Depth {
   public:
    explicit PlainDepth(
        bool steadied = false, std::function<void(int)> meet = [](int) {})
        : steadied_(steadied), meet_(std::move(meet)) {}
    Picture operator()(int index, const Picture& reference) override {
        meet_(index);
        return picture_of(Image(reference.view.width, reference.view.height, 5.0f));
    }
    bool concurrent() const override { return !steadied_; }
    bool steadied() const override { return steadied_; }

   private:
    bool steadied_;
    std::function<void(int)> meet_;
};

// An image is its first value; a video is that of each frame, a line each.
class TextCodecs : public Codecs {
   public:
    std::string encode_image(const std::filesystem::path& file, const Picture& image) override {
        meet(file.filename().string());
        return line_of(image);
    }
    std::string encoder_name() override { return "text"; }
    std::unique_ptr<PartWriter> open_part(const std::filesystem::path& file,
                                          const std::filesystem::path& target, const Picture&,
                                          double) override {
        return std::make_unique<Part>(file, target, *this);
    }
    void join(const std::vector<std::pair<std::filesystem::path, int>>& parts,
              const std::filesystem::path& file, const std::filesystem::path& target, double,
              const std::function<void()>& check) override {
        std::string all;
        for (const auto& [part, count] : parts) {
            std::istringstream lines(text_of(part));
            std::string line;
            for (int i = 0; i < count && std::getline(lines, line); ++i) {
                check();
                all += line + "\n";
            }
        }
        meet(target.filename().string());
        write_text(file, all);
    }

    // Called with the name of each file to be written, and of a part for each of its frames.
    std::function<void(const std::string&)> meet = [](const std::string&) {};

   private:
    static std::string line_of(const Picture& image) {
        return std::to_string(*image.view.row<std::uint8_t>(0)) + "\n";
    }

    class Part : public PartWriter {
       public:
        Part(const std::filesystem::path& file, const std::filesystem::path& target,
             const TextCodecs& codecs)
            : name_(target.filename().string()), codecs_(codecs), out_(file) {}
        void write(const Picture& image) override {
            codecs_.meet(name_);
            out_ << line_of(image);
        }
        void close(int) override { out_.close(); }

       private:
        std::string name_;
        const TextCodecs& codecs_;
        std::ofstream out_;
    };
};

}  // namespace xcalib::testing
