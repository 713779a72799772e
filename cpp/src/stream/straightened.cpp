#include "xcalib/stream/straightened.hpp"

#include <algorithm>
#include <list>
#include <mutex>

#include "base/median.hpp"
#include "xcalib/error.hpp"
#include "xcalib/gray.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib {
namespace {

constexpr int kMotionWidth = 640;  // [px] that motion is looked for at, at most

// Two frames in gray of one range, 8 bits, reduced.
struct GrayPair {
    int width, height;
    std::vector<std::uint8_t> first, second;

    GrayPair(const ImageView& a, const ImageView& b) {
        Image gray[] = {known_gray(a), known_gray(b)};
        const int factor = (a.width + kMotionWidth - 1) / kMotionWidth;
        width = std::max(1, a.width / factor);
        height = std::max(1, a.height / factor);
        std::vector<float> values;
        for (Image& image : gray) {
            image = resize_area(image, width, height);
            values.insert(values.end(), image.pixels.begin(), image.pixels.end());
        }
        const double low = quantile(values, 0.01);
        const double range = std::max(quantile(std::move(values), 0.99) - low, 1e-6);
        for (const auto& [image, bytes] : {std::pair(&gray[0], &first), {&gray[1], &second}})
            for (const float value : image->pixels)
                bytes->push_back(
                    static_cast<std::uint8_t>(255 * std::clamp((value - low) / range, 0.0, 1.0)));
    }
    ImageView view(const std::vector<std::uint8_t>& bytes) const {
        return {bytes.data(), width, height, 1, PixelType::u8, width};
    }
};

// From one frame to another, `periods` later, in pixels of the frames and per period.
Motion motion_between(const ImageView& from, const ImageView& to, double periods,
                      const EstimateMotion& estimate) {
    const GrayPair gray(from, to);
    Motion motion = estimate(gray.view(gray.first), gray.view(gray.second));
    const double scale_x = static_cast<double>(from.width) / gray.width / periods;
    const double scale_y = static_cast<double>(from.height) / gray.height / periods;
    for (float& value : motion.x.pixels) value *= static_cast<float>(scale_x);
    for (float& value : motion.y.pixels) value *= static_cast<float>(scale_y);
    return motion;
}

// Where a frame's motion is looked for.
struct Beside {
    int index = -1;  // of the frame after it, or before; -1: none
    double periods = 1.0;
};

Beside beside(const FrameClock& clock, int index) {
    for (const int lag : {1, -1}) {
        const int other = frames_later(clock, {index}, lag)[0];
        if (other < 0) continue;
        const double ticks = clock.ticks[static_cast<std::size_t>(other)] -
                             clock.ticks[static_cast<std::size_t>(index)];
        return {other, ticks / clock.period};
    }
    return {};
}

Picture straightened(const Picture& picture, const Motion& motion, const RowDelay& delay,
                     bool nearest) {
    const ImageView& image = picture.view;
    MutableImageView pixels;
    Picture out = new_picture(image.width, image.height, image.channels, image.type, pixels);
    straighten(image, motion, delay, nearest, pixels);
    return out;
}

class Straightened : public Wrapped {
   public:
    Straightened(StreamPointer stream, FrameClock clock, const RowDelay& delay,
                 EstimateMotion motion, bool nearest)
        : Wrapped(std::move(stream)), clock_(std::move(clock)), delay_(delay),
          motion_(std::move(motion)), nearest_(nearest) {}
    std::vector<std::filesystem::path> paths() const override { return stream_->paths(); }
    std::optional<HeaderSize> size_in_header(int index) override {
        return stream_->size_in_header(index);
    }

   private:
    Picture read(int index) override {
        const Picture image = frame(index);
        const Beside other = beside(clock_, index);
        if (other.index < 0) return image;
        Picture next;
        try {
            next = frame(other.index);
        } catch (const DecodeError&) {
            return image;  // named when its own turn comes
        }
        try {
            return straightened(image,
                                motion_between(image.view, next.view, other.periods, motion_),
                                delay_, nearest_);
        } catch (const std::invalid_argument&) {
            return image;  // mostly unknown
        }
    }

    // Each frame is asked for twice, for itself and for the one before it.
    Picture frame(int index) {
        constexpr std::size_t kKept = 4;
        {
            const std::lock_guard lock(mutex_);
            for (const auto& [kept, picture] : last_)
                if (kept == index) return picture;
        }
        Picture picture = (*stream_)[index];
        const std::lock_guard lock(mutex_);
        last_.emplace_back(index, picture);
        if (last_.size() > kKept) last_.pop_front();
        return picture;
    }

    FrameClock clock_;
    RowDelay delay_;
    EstimateMotion motion_;
    bool nearest_;
    std::mutex mutex_;
    std::list<std::pair<int, Picture>> last_;
};

}  // namespace

StreamPointer straightened(const StreamPointer& sources, const Readout& readout,
                           const std::optional<Rig>& rig, const EstimateMotion& motion,
                           bool nearest) {
    if (!readout.any()) return sources;
    std::optional<FrameClock> clock = clock_of(sources->frames());
    if (!clock)
        throw InputError((readout.source != 0 ? "--source-readout: " : "--reference-readout: ") +
                         sources->where(0) +
                         " and the frames after it do not follow each other; expected a video, or "
                         "names that are times or consecutive numbers, since motion is seen from "
                         "frame to frame");
    const Picture first = sources->outline(0);
    return std::make_shared<Straightened>(
        sources, std::move(*clock), row_delay(readout, rig, first.view.width, first.view.height),
        motion, nearest);
}

ReadoutFit fit_readout(const FittedFrames& frames, const StreamPointer& all_sources, const Rig& rig,
                       const CalibrationOptions& options, const Readout& known, bool of_reference,
                       const EstimateMotion& motion, const std::function<void(double)>& progress) {
    constexpr int kSteps = 4;  // either way, of a quarter each
    const std::optional<FrameClock> clock = clock_of(all_sources->frames());
    if (!clock) return {};
    std::vector<Picture> kept;
    std::vector<ImageView> references, depths;
    std::vector<SourcesAtShare> at(2 * kSteps + 1);
    const std::size_t count = frames.partners.size();
    const std::size_t wanted = std::min<std::size_t>(count, kMaxLagFrames);
    for (std::size_t k = 0; k < wanted; ++k) {
        check_interrupts();
        const std::size_t i = k * count / wanted;
        progress(static_cast<double>(k) / static_cast<double>(wanted));
        const Beside other = beside(*clock, frames.partners[i]);
        if (other.index < 0) continue;
        Picture here, next;
        try {
            here = (*all_sources)[frames.partners[i]];
            next = (*all_sources)[other.index];
        } catch (const DecodeError&) {
            continue;
        }
        const ImageView& source = here.view;
        const Motion moved = motion_between(source, next.view, other.periods, motion);
        references.push_back(frames.references[i]);
        depths.push_back(frames.depths[i]);
        for (int step = -kSteps; step <= kSteps; ++step) {
            SourcesAtShare& trial = at[static_cast<std::size_t>(step + kSteps)];
            trial.share = static_cast<double>(step) / kSteps;
            Readout readout = known;
            (of_reference ? readout.reference : readout.source) += trial.share;
            const RowDelay delay = row_delay(readout, rig, source.width, source.height);
            kept.push_back(readout.any() ? straightened(here, moved, delay, false) : here);
            trial.sources.push_back(kept.back().view);
        }
    }
    if (static_cast<int>(references.size()) < kMinLagFrames) return {};
    return fit_readout(references, depths, at, rig, options);
}

}  // namespace xcalib
