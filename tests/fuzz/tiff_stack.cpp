#include <opencv2/core/utils/logger.hpp>

#include "footage.hpp"
#include "fuzzed.hpp"

extern "C" int LLVMFuzzerInitialize(int*, char***) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = xcalib::fuzz::file_of(xcalib::fuzz::text_of(data, size), "stack.tiff");
    return xcalib::fuzz::refused_or_read([&] {
        const xcalib::StreamPointer stream = xcalib::cli::open_stream(file.string());
        for (int i = 0; i < std::min(stream->size(), 3); ++i) (*stream)[i];
    });
}
