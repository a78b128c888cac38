// A live stream from C++: frames are submitted without waiting, and a listener hears what becomes of them. Objects end
// by themselves; statuses become exceptions.
#include <phasefront.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

namespace {

void ok(PfStatus status) {
    if (status != PF_STATUS_OK) throw std::runtime_error(pf_last_error());
}

template <auto End> struct Ends {
    template <typename T> void operator()(T *object) const { End(object); }
};
using Target = std::unique_ptr<PfTarget, Ends<pf_target_free>>;
using Options = std::unique_ptr<PfOptions, Ends<pf_options_free>>;
using Session = std::unique_ptr<PfSession, Ends<pf_session_free>>;
using Hologram = std::unique_ptr<PfHologram, Ends<pf_hologram_free>>;

// What `make` writes to its last argument.
template <typename Owner, typename Make> Owner made(Make make) {
    typename Owner::pointer object = nullptr;
    ok(make(&object));
    return Owner(object);
}

// Called on the session's thread, one call after another.
struct Listener {
    int holograms = 0, dropped = 0, failed = 0;

    PfListener calls() {
        PfListener listener{};
        listener.context = this;
        listener.on_processed = [](void *self, PfHologram *given) {
            const Hologram hologram(given);
            PfHologramInfo info;
            if (pf_hologram_info(hologram.get(), &info) == PF_STATUS_OK)
                std::printf("%llu ms: %u x %u in %.1f ms\n", (unsigned long long)(info.timestamp_ns / 1000000), info.width,
                            info.height, info.times.total_ms);
            static_cast<Listener *>(self)->holograms++;
        };
        listener.on_dropped = [](void *self, uint64_t, PfDropReason) { static_cast<Listener *>(self)->dropped++; };
        listener.on_failed = [](void *self, uint64_t, const char *message) {
            std::fprintf(stderr, "%s\n", message);
            static_cast<Listener *>(self)->failed++;
        };
        return listener;
    }
};

} // namespace

int main() try {
    const uint32_t width = 320, height = 240;
    const auto target = made<Target>([](auto to) { return pf_target_from_toml("width = 320\nheight = 240", to); });
    const auto options =
        made<Options>([&](auto to) { return pf_options_new(target.get(), PF_METHOD_DEFAULT, nullptr, to); });
    ok(pf_options_set_target_rate_hz(options.get(), 15));

    Listener listener;
    {
        const PfListener calls = listener.calls();
        const auto session = made<Session>(
            [&](auto to) { return pf_session_new(options.get(), PF_RUNNING_MODE_LIVE, &calls, to); });
        ok(pf_session_warm_up(session.get()));
        std::vector<uint8_t> colour(width * height * 3), depth(width * height);
        for (uint64_t i = 0; i < 10; i++) {
            for (uint32_t p = 0; p < width * height; p++) {
                depth[p] = uint8_t((p % width + 8 * i) % 256);
                colour[3 * p] = colour[3 * p + 1] = colour[3 * p + 2] = uint8_t(p / width);
            }
            PfFrame frame{};
            frame.timestamp_ns = (i + 1) * 66666667;
            frame.colour = {PF_COLOUR_FORMAT_RGB, width, height, PF_YUV_MATRIX_BT601, false, {}};
            frame.colour.planes[0] = {colour.data(), colour.size(), width * 3, 3};
            frame.depth = {PF_DEPTH_FORMAT_NORMALIZED_U8, width, height, {depth.data(), depth.size(), width, 1}};
            PfDropReason dropped;
            ok(pf_session_submit(session.get(), &frame, &dropped));
            std::this_thread::sleep_for(std::chrono::milliseconds(67));
        }
    } // The session ends, and the listener has heard everything.
    std::printf("%d made, %d dropped, %d failed\n", listener.holograms, listener.dropped, listener.failed);
    return listener.holograms + listener.dropped == 10 && listener.holograms > 0 ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
