// A live stream from C++: frames are submitted without waiting, and a listener hears what becomes of them.
#include <phasefront.hpp>

#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

int main() try {
    constexpr std::uint32_t width = 320, height = 240;
    const phasefront::Options options(phasefront::Target::from_toml("width = 320\nheight = 240"));
    phasefront::check(pf_options_set_target_rate_hz(options.get(), 15));

    int holograms = 0, dropped = 0, failed = 0;
    phasefront::Listener listener; // Called on the session's thread, one call after another.
    listener.on_processed = [&](phasefront::Hologram hologram) {
        const PfHologramInfo info = hologram.info();
        std::printf("%llu ms: %u x %u in %.1f ms\n", static_cast<unsigned long long>(info.timestamp_ns / 1000000), info.width,
                    info.height, info.times.total_ms);
        holograms++;
    };
    listener.on_dropped = [&](std::uint64_t, PfDropReason) { dropped++; };
    listener.on_failed = [&](std::uint64_t, const char *message) {
        std::fprintf(stderr, "%s\n", message);
        failed++;
    };
    {
        const phasefront::Session session(options, listener);
        session.warm_up();
        std::vector<std::uint8_t> colour(width * height * 3), depth(width * height);
        for (std::uint64_t i = 0; i < 10; i++) {
            for (std::uint32_t p = 0; p < width * height; p++) {
                depth[p] = static_cast<std::uint8_t>((p % width + 8 * i) % 256);
                colour[3 * p] = colour[3 * p + 1] = colour[3 * p + 2] = static_cast<std::uint8_t>(p / width);
            }
            PfFrame frame{};
            frame.size = sizeof frame;
            frame.timestamp_ns = (i + 1) * 66666667;
            frame.colour = {PF_COLOUR_FORMAT_RGB, width, height, PF_YUV_MATRIX_BT601, false, {}};
            frame.colour.planes[0] = {colour.data(), colour.size(), width * 3, 3};
            frame.depth = {PF_DEPTH_FORMAT_NORMALIZED_U8, width, height, {depth.data(), depth.size(), width, 1}};
            session.submit(frame);
            std::this_thread::sleep_for(std::chrono::milliseconds(67));
        }
    } // The session ends, and the listener has heard everything.
    std::printf("%d made, %d dropped, %d failed\n", holograms, dropped, failed);
    return holograms + dropped == 10 && holograms > 0 ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
