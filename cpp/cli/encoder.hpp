// Videos written through FFmpeg's libraries: encoded, checked, and joined without decoding.
//
// OpenCV writes videos too, but reports no error (a full disk leaves half a video behind), cannot
// copy compressed frames from one file to another, and before 4.8 knows no gray of 16 bits.
#pragma once

#include "xcalib/stream/sink.hpp"

namespace xcalib::cli {

// FFmpeg for videos, OpenCV for images. .mp4 is MPEG-4, .avi Motion JPEG, .mkv FFV1.
class FfmpegCodecs : public Codecs {
   public:
    std::string encode_image(const std::filesystem::path& file, const Picture& image) override;
    std::string encoder_name() override;
    std::unique_ptr<PartWriter> open_part(const std::filesystem::path& file,
                                          const std::filesystem::path& target, const Picture& first,
                                          double rate) override;
    void join(const std::vector<std::pair<std::filesystem::path, int>>& parts,
              const std::filesystem::path& file, const std::filesystem::path& target, double rate,
              const std::function<void()>& check) override;
};

}  // namespace xcalib::cli
