// The loop of a device: a thread that captures thermal frames, a thread that has depth, and the one
// that registers. Every stage has two buffers and takes turns with the next; nothing is allocated
// once the loop runs, and a stage that is late makes the others wait, never lose a frame's partner.
//
//     embedded_loop [frames] [frames per second, 0: as many as go]
//
// The cameras are rendered: a warm board that crosses a cool wall, 30 cm a frame.
#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <thread>
#include <vector>
#include <xcalib/register.hpp>

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;
using xcalib::Image;
using xcalib::PixelType;

constexpr int kWidth = 640, kHeight = 480, kSourceWidth = 320, kSourceHeight = 256;
constexpr float kWall = 8.0f, kBoard = 3.0f;  // [m]
constexpr std::uint16_t kCool = 7000, kWarm = 9000;

// Hands buffers from one thread to another and back: the writer fills one while the reader has the
// other.
template <class T>
class Exchange {
   public:
    explicit Exchange(const T& value) : buffers_{value, value} {}

    template <class Work>
    void write(const Work& work) {
        turn(
            written_, [this] { return written_ - read_ < 2; }, work);
    }
    template <class Work>
    void read(const Work& work) {
        turn(
            read_, [this] { return read_ < written_; }, work);
    }

   private:
    template <class Ready, class Work>
    void turn(long& count, const Ready& ready, const Work& work) {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, ready);
        lock.unlock();
        work(buffers_[count % 2]);
        lock.lock();
        ++count;
        changed_.notify_one();
    }

    std::mutex mutex_;
    std::condition_variable changed_;
    std::array<T, 2> buffers_;
    long written_ = 0, read_ = 0;
};

// Columns of a camera's image that the board covers in a frame.
struct Span {
    int begin, end;
};
Span board(const xcalib::Pinhole& camera, double camera_x, long frame) {
    const double left = -2.0 + 0.3 * (frame % 12) - camera_x;  // [m]
    const auto column = [&](double x) {
        const double u = camera.fx * x / kBoard + camera.cx;
        return std::clamp(static_cast<int>(u + 0.5), 0, camera.width);
    };
    return {column(left), column(left + 0.8)};
}

using Thermal = std::vector<std::uint16_t>;

void capture(const xcalib::Rig& rig, long frame, Thermal& image) {
    const Span span = board(rig.source, -rig.t().x(), frame);
    for (int y = 0; y < kSourceHeight; ++y) {
        std::uint16_t* row = image.data() + y * kSourceWidth;
        std::fill_n(row, kSourceWidth, kCool);
        std::fill(row + span.begin, row + span.end, kWarm);
    }
}

void sense_depth(const xcalib::Rig& rig, long frame, Image& depth) {
    const Span span = board(rig.reference, 0, frame);
    for (int y = 0; y < kHeight; ++y) {
        std::fill_n(depth.row(y), kWidth, kWall);
        std::fill(depth.row(y) + span.begin, depth.row(y) + span.end, kBoard);
    }
}

int main(int argc, char** argv) {
    const long frames = argc > 1 ? std::atol(argv[1]) : 300;
    const double rate = argc > 2 ? std::atof(argv[2]) : 0;
    xcalib::Rig rig{xcalib::Pinhole::from_hfov(kWidth, kHeight, 0.9),
                    xcalib::Pinhole::from_hfov(kSourceWidth, kSourceHeight, 0.9),
                    {}};
    rig.source_from_reference.translation = {-0.2, 0, 0};
    const xcalib::Registrar registrar(rig, {1});  // one thread: the others have their own work
    Exchange<Thermal> thermal{Thermal(kSourceWidth * kSourceHeight)};
    Exchange<Image> depth{Image(kWidth, kHeight)};
    const auto start = Clock::now();
    std::thread camera([&] {
        for (long i = 0; i < frames; ++i) {
            if (rate > 0) std::this_thread::sleep_until(start + Seconds(i / rate));
            thermal.write([&](Thermal& image) { capture(rig, i, image); });
        }
    });
    std::thread sensor([&] {
        for (long i = 0; i < frames; ++i)
            depth.write([&](Image& image) { sense_depth(rig, i, image); });
    });

    std::vector<std::uint16_t> registered(kWidth * kHeight);
    std::vector<std::uint8_t> mask(registered.size());
    std::vector<double> milliseconds;
    milliseconds.reserve(frames);
    long on_board = 0, warm = 0;  // pixels of the board, and those of them that came out warm
    for (long i = 0; i < frames; ++i)
        thermal.read([&](const Thermal& image) {
            depth.read([&](const Image& metres) {
                const auto before = Clock::now();
                registrar.register_frame(
                    {image.data(), kSourceWidth, kSourceHeight, 1, PixelType::u16,
                     2 * kSourceWidth},
                    metres.view(),
                    {registered.data(), kWidth, kHeight, 1, PixelType::u16, 2 * kWidth},
                    mask.data());
                milliseconds.push_back(1e3 * Seconds(Clock::now() - before).count());
                for (std::size_t k = 0; k < mask.size(); ++k)
                    if (metres.pixels[k] == kBoard && mask[k] == 0) {
                        ++on_board;
                        warm += registered[k] > (kCool + kWarm) / 2;
                    }
            });
        });
    camera.join();
    sensor.join();
    if (frames < 1 || on_board == 0) return EXIT_FAILURE;
    std::sort(milliseconds.begin(), milliseconds.end());
    std::printf("%ld frames: median %.2f ms, worst %.2f ms; %.1f %% of the board is warm\n", frames,
                milliseconds[milliseconds.size() / 2], milliseconds.back(),
                100.0 * warm / on_board);
    return warm > 0.98 * on_board ? EXIT_SUCCESS : EXIT_FAILURE;
}
