// Checks that a frame allocates nothing of an image's size, in C and C++: linked with tests/counting.c, which counts.
#include <phasefront.hpp>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <thread>
#include <vector>

extern "C" std::uint64_t allocated_bytes();

using namespace phasefront;

namespace {

constexpr std::uint32_t width = 640, height = 480;
// The smallest image of a frame: the levels of one colour.
constexpr std::uint64_t plane = width * height;

struct Images {
    std::vector<std::uint8_t> colour = std::vector<std::uint8_t>(plane * 4), depth = std::vector<std::uint8_t>(plane);

    Images() {
        for (std::size_t i = 0; i < colour.size(); i++) colour[i] = static_cast<std::uint8_t>(i * 37 % 251);
        for (std::size_t i = 0; i < depth.size(); i++) depth[i] = static_cast<std::uint8_t>(i / 700 % 256);
    }

    PfFrame frame(std::uint64_t timestamp_ns) const {
        PfFrame frame{};
        frame.size = sizeof frame;
        frame.timestamp_ns = timestamp_ns;
        frame.colour = {PF_COLOUR_FORMAT_RGBA, width, height, PF_YUV_MATRIX_BT601, false, {}};
        frame.colour.planes[0] = {colour.data(), colour.size(), width * 4, 4};
        frame.depth = {PF_DEPTH_FORMAT_NORMALIZED_U8, width, height, {depth.data(), depth.size(), width, 1}};
        return frame;
    }
};

// Prints the bytes that a call allocates, and throws from an image's size on. Later calls find what the first ones made.
template <typename Call> void count(const char *what, Call call) {
    for (int i = 0; i < 3; i++) call();
    std::uint64_t least = UINT64_MAX;
    for (int i = 0; i < 5; i++) {
        const std::uint64_t before = allocated_bytes();
        call();
        least = std::min(least, allocated_bytes() - before);
    }
    std::printf("%s: %llu bytes\n", what, static_cast<unsigned long long>(least));
    if (least >= plane) throw std::logic_error("a frame allocates an image");
}

} // namespace

int main() try {
    const std::uint64_t before = allocated_bytes();
    const Images images;
    if (allocated_bytes() - before < 5 * plane) throw std::logic_error("allocations are not counted");
    const Modulator modulator = Modulator::from_toml("width = 640\nheight = 480");
    const Options options(modulator.target(), PF_METHOD_SWEEP, nullptr);
    std::uint64_t time = 0;
    {
        const Session session(options, PF_RUNNING_MODE_VIDEO);
        const auto process = [&] { return session.process(images.frame(time += 33000000)); };
        count("process, levels", [&] { process().levels(2); });
        const Hologram hologram = process();
        std::vector<std::uint8_t> pixels(plane * 4);
        const PfMemory memory{pixels.data(), pixels.size(), width * 4};
        PfPlacement placement{};
        placement.layout = PF_LAYOUT_RGBA;
        count("write_output", [&] { hologram.write_output(placement, memory); });
        count("write_preview", [&] { hologram.write_preview(0, width, height, PF_LAYOUT_RGBA, memory); });
        count("a modulator's write_output", [&] { modulator.write_output(hologram, {pixels.data(), pixels.size(), width * 3}); });
        count("a modulator's write_pixels", [&] { modulator.write_pixels(hologram, PF_LAYOUT_RGBA, memory); });
    }
    std::atomic<int> heard{0};
    Listener listener;
    listener.on_processed = [&](Hologram) { heard++; };
    const Session live(options, std::move(listener));
    count("submit, until it is a hologram", [&] {
        const int until = heard + 1;
        live.submit(images.frame(time += 33000000));
        while (heard < until) std::this_thread::yield();
    });
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
