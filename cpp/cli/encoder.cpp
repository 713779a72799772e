#include "encoder.hpp"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "files.hpp"
#include "pictures.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;

// Container, codec and the pixels it stores; none: as they are.
struct Kind {
    const char* container;
    const char* codec;
    AVPixelFormat stored;
    std::vector<std::pair<const char*, const char*>> options;
};

const Kind& kind_of(const Path& target) {
    // The quantizer of the lossy ones is fixed, so that a frame's quality does not depend on where
    // a part began. Slices are coded by threads of their own, and must be as many in all parts.
    static const std::map<std::string, Kind> kinds = {
        {".mp4",
         {"mp4", "mpeg4", AV_PIX_FMT_YUV420P, {{"flags", "+qscale"}, {"global_quality", "236"}}}},
        {".avi",
         {"avi", "mjpeg", AV_PIX_FMT_YUVJ420P, {{"flags", "+qscale"}, {"global_quality", "236"}}}},
        {".mkv", {"matroska", "ffv1", AV_PIX_FMT_NONE, {{"level", "3"}, {"slices", "4"}}}}};
    return kinds.at(lower_suffix(target));
}

AVPixelFormat pixels_of(const ImageView& image) {
    if (image.channels == 3) return AV_PIX_FMT_BGR24;
    return image.type == PixelType::u16 ? AV_PIX_FMT_GRAY16LE : AV_PIX_FMT_GRAY8;
}

// FFmpeg's errors with the file the user knows.
int checked(int code, const Path& target) {
    if (code >= 0) return code;
    const int error = AVUNERROR(code);
    if (error > 0 && error < 200)
        throw std::system_error(error, std::generic_category(), target.string());
    char text[AV_ERROR_MAX_STRING_SIZE] = "";
    av_strerror(code, text, sizeof text);
    throw InputError(target.string() + ": " + text);
}

// `a:b.mkv` alone would be of a protocol `a`.
std::string name_of(const Path& file) { return "file:" + fs::absolute(file).string(); }

// A rate whose time base MPEG-4 can hold: both terms fit 16 bits.
AVRational rational(double rate) {
    rate = std::clamp(rate, 0.01, 65535.0);
    AVRational best{0, 1};
    double error = INFINITY;
    for (int below = 1; below <= std::min(1001, static_cast<int>(65535 / rate)); ++below) {
        const int above = static_cast<int>(std::lround(rate * below));
        const double off = std::abs(rate - static_cast<double>(above) / below);
        if (above > 0 && off < error) {
            error = off;
            best = {above, below};
        }
    }
    if (best.num == 0) best = {1, std::min(1001, static_cast<int>(1 / rate))};
    return best;
}

struct Delete {
    void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
    void operator()(AVFrame* frame) const { av_frame_free(&frame); }
    void operator()(AVPacket* packet) const { av_packet_free(&packet); }
    void operator()(SwsContext* context) const { sws_freeContext(context); }
};
using Codec = std::unique_ptr<AVCodecContext, Delete>;
using RawFrame = std::unique_ptr<AVFrame, Delete>;
using Packet = std::unique_ptr<AVPacket, Delete>;
using Scaler = std::unique_ptr<SwsContext, Delete>;

// A container that is written.
class Output {
   public:
    Output(const Path& file, const char* container, const Path& target) : target_(target) {
        checked(avformat_alloc_output_context2(&format_, nullptr, container, nullptr), target_);
        const int code = avio_open(&format_->pb, name_of(file).c_str(), AVIO_FLAG_WRITE);
        if (code < 0) {
            avformat_free_context(format_);
            checked(code, target_);
        }
    }
    ~Output() {
        if (format_->pb) avio_closep(&format_->pb);
        avformat_free_context(format_);
    }
    Output(const Output&) = delete;
    Output& operator=(const Output&) = delete;

    AVFormatContext* operator->() const { return format_; }
    AVStream* add(AVRational rate) {
        stream_ = avformat_new_stream(format_, nullptr);
        if (!stream_) throw std::bad_alloc();
        stream_->time_base = av_inv_q(rate);
        stream_->avg_frame_rate = stream_->r_frame_rate = rate;
        step_ = av_inv_q(rate);
        return stream_;
    }
    void begin() { checked(avformat_write_header(format_, nullptr), target_); }
    // Frame `number`.
    void put(AVPacket* packet, std::int64_t number) {
        packet->stream_index = stream_->index;
        packet->pts = packet->dts = number;
        packet->duration = 1;
        packet->pos = -1;
        av_packet_rescale_ts(packet, step_, stream_->time_base);
        checked(av_interleaved_write_frame(format_, packet), target_);
    }
    void end() {
        checked(av_write_trailer(format_), target_);
        checked(format_->pb->error, target_);
        checked(avio_closep(&format_->pb), target_);
    }

   private:
    const Path& target_;
    AVFormatContext* format_ = nullptr;
    AVStream* stream_ = nullptr;
    AVRational step_{0, 1};
};

// The compressed frames of a file.
class Input {
   public:
    Input(const Path& file, const Path& target) {
        checked(avformat_open_input(&format_, name_of(file).c_str(), nullptr, nullptr), target);
        if (format_->nb_streams == 0) {
            avformat_close_input(&format_);
            throw InputError(file.string() + ": holds no video");
        }
    }
    ~Input() { avformat_close_input(&format_); }
    Input(const Input&) = delete;
    Input& operator=(const Input&) = delete;

    const AVCodecParameters& codec() const { return *format_->streams[0]->codecpar; }
    bool next(AVPacket* packet) {
        while (av_read_frame(format_, packet) >= 0) {
            if (packet->stream_index == 0 && packet->size > 0) return true;
            av_packet_unref(packet);
        }
        return false;
    }

   private:
    AVFormatContext* format_ = nullptr;
};

std::string_view header_of(const AVCodecParameters& codec) {
    return {reinterpret_cast<const char*>(codec.extradata),
            static_cast<std::size_t>(codec.extradata_size)};
}

// Throws if fewer frames arrived on the disk.
void check_count(const Path& file, int frames, const Path& target) {
    int found = 0;
    {
        Input input(file, target);
        const Packet packet(av_packet_alloc());
        while (found < frames && input.next(packet.get())) {
            av_packet_unref(packet.get());
            ++found;
        }
    }
    if (found < frames)
        throw std::runtime_error(target.string() + ": " + std::to_string(found) + " of " +
                                 std::to_string(frames) +
                                 " frames could be written; is there space on the disk?");
}

class Encoder : public PartWriter {
   public:
    Encoder(Path file, Path target, const ImageView& first, double rate);
    void write(const Picture& image) override;
    void close(int frames) override;

   private:
    struct State;
    void mux(const ImageView* image);  // none: what is still to come

    Path file_, target_;
    std::unique_ptr<State> state_;
};

struct Encoder::State {
    Output output;
    Codec codec;
    RawFrame given, stored;  // frames as they come, and as the codec takes them
    Packet packet;
    Scaler scaler;
    std::int64_t written = 0, muxed = 0;
};

Encoder::Encoder(Path file, Path target, const ImageView& first, double rate)
    : file_(std::move(file)), target_(std::move(target)) {
    av_log_set_level(AV_LOG_QUIET);
    const Kind& kind = kind_of(target_);
    const AVCodec* encoder = avcodec_find_encoder_by_name(kind.codec);
    if (!encoder)
        throw InputError(target_.string() + ": this FFmpeg cannot write " + kind.codec +
                         " video, expected another suffix, or a folder");
    try {
        state_.reset(new State{{file_, "matroska", target_},
                               Codec(avcodec_alloc_context3(encoder)),
                               RawFrame(av_frame_alloc()),
                               RawFrame(av_frame_alloc()),
                               Packet(av_packet_alloc()),
                               nullptr});
        State& s = *state_;
        const AVRational frames = rational(rate);
        AVCodecContext* codec = s.codec.get();
        const AVPixelFormat given = pixels_of(first);
        codec->width = first.width;
        codec->height = first.height;
        codec->time_base = av_inv_q(frames);
        codec->framerate = frames;
        codec->pix_fmt = kind.stored != AV_PIX_FMT_NONE ? kind.stored
                         : given == AV_PIX_FMT_BGR24    ? AV_PIX_FMT_BGR0
                                                        : given;
        codec->thread_count = 0;
        codec->thread_type = FF_THREAD_SLICE;
        AVDictionary* options = nullptr;
        for (const auto& [name, value] : kind.options) av_dict_set(&options, name, value, 0);
        // After `flags`, which the options set.
        av_dict_set(&options, "flags", "+global_header", AV_DICT_APPEND);
        const int opened = avcodec_open2(codec, encoder, &options);
        av_dict_free(&options);
        checked(opened, target_);
        AVStream* stream = s.output.add(frames);
        checked(avcodec_parameters_from_context(stream->codecpar, codec), target_);
        s.output.begin();
        s.stored->format = codec->pix_fmt;
        s.stored->width = first.width;
        s.stored->height = first.height;
        checked(av_frame_get_buffer(s.stored.get(), 0), target_);
        s.scaler.reset(sws_getContext(first.width, first.height, given, first.width, first.height,
                                      codec->pix_fmt, SWS_BILINEAR, nullptr, nullptr, nullptr));
        if (!s.scaler) throw std::bad_alloc();
    } catch (...) {
        state_.reset();
        throw;
    }
}

void Encoder::mux(const ImageView* image) {
    State& s = *state_;
    if (image) {
        checked(av_frame_make_writable(s.stored.get()), target_);
        const std::uint8_t* rows[] = {image->row<std::uint8_t>(0)};
        const int strides[] = {static_cast<int>(image->row_bytes)};
        sws_scale(s.scaler.get(), rows, strides, 0, image->height, s.stored->data,
                  s.stored->linesize);
        s.stored->pts = s.written++;
        s.stored->quality = s.codec->global_quality;
    }
    checked(avcodec_send_frame(s.codec.get(), image ? s.stored.get() : nullptr), target_);
    while (true) {
        const int code = avcodec_receive_packet(s.codec.get(), s.packet.get());
        if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return;
        checked(code, target_);
        s.output.put(s.packet.get(), s.muxed++);
    }
}

void Encoder::write(const Picture& image) { mux(&image.view); }

void Encoder::close(int frames) {
    mux(nullptr);
    state_->output.end();
    check_count(file_, frames, target_);
    state_.reset();
}

}  // namespace

std::string FfmpegCodecs::encode_image(const Path& file, const Picture& image) {
    return cli::encode_image(file, image.view);
}

std::string FfmpegCodecs::encoder_name() {
    const unsigned version = avcodec_version();
    return "libavcodec " + std::to_string(version >> 16) + "." +
           std::to_string(version >> 8 & 255) + "." + std::to_string(version & 255);
}

std::unique_ptr<PartWriter> FfmpegCodecs::open_part(const Path& file, const Path& target,
                                                    const Picture& first, double rate) {
    return std::make_unique<Encoder>(file, target, first.view, rate);
}

void FfmpegCodecs::join(const std::vector<std::pair<Path, int>>& parts, const Path& file,
                        const Path& target, double rate, const std::function<void()>& check) {
    int wanted = 0;
    {
        Output output(file, kind_of(target).container, target);
        AVStream* stream = output.add(rational(rate));
        const Packet packet(av_packet_alloc());
        std::int64_t frames = 0;
        for (const auto& [path, count] : parts) {
            Input part(path, target);
            const AVCodecParameters& codec = part.codec();
            if (wanted == 0) {
                checked(avcodec_parameters_copy(stream->codecpar, &codec), target);
                stream->codecpar->codec_tag = 0;
                output.begin();
            } else if (header_of(codec) != header_of(*stream->codecpar)) {
                throw InputError(path.string() + ": coded otherwise than " +
                                 parts[0].first.string());
            }
            for (int i = 0; i < count && part.next(packet.get()); ++i) {
                check();
                output.put(packet.get(), frames++);
            }
            wanted += count;
        }
        output.end();
    }
    check_count(file, wanted, target);
}

}  // namespace xcalib::cli
