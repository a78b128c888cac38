// Uses phasefront.hpp as a program would: a hologram, an error, a live stream.
#include <phasefront.hpp>

#include <atomic>
#include <cstdio>
#include <cstring>

using namespace phasefront;

namespace {

constexpr std::uint32_t width = 64, height = 48;

struct Images {
    std::vector<std::uint8_t> colour = std::vector<std::uint8_t>(width * height * 3, 180);
    std::vector<std::uint8_t> depth = std::vector<std::uint8_t>(width * height, 90);

    PfFrame frame(std::uint64_t timestamp_ns) const {
        PfFrame frame{};
        frame.size = sizeof frame;
        frame.timestamp_ns = timestamp_ns;
        frame.colour = {PF_COLOUR_FORMAT_RGB, width, height, PF_YUV_MATRIX_BT601, false, {}};
        frame.colour.planes[0] = {colour.data(), colour.size(), width * 3, 3};
        frame.depth = {PF_DEPTH_FORMAT_NORMALIZED_U8, width, height, {depth.data(), depth.size(), width, 1}};
        return frame;
    }
};

void expect(bool holds, const char *what) {
    if (!holds) throw std::logic_error(what);
}

void image(const Target &target, const Images &images) {
    Session session{Options(target)};
    Hologram first = session.process(images.frame(1));
    const Hologram hologram = std::move(first);
    const PfHologramInfo info = hologram.info();
    expect(info.width == width && info.height == height, "a hologram of another size");
    const Hologram::Levels red = hologram.levels(0);
    expect(red.size == width * height, "a plane of another size");
    const std::vector<std::uint8_t> output = hologram.output();
    expect(output.size() == 3 * red.size, "an output of another size");
    for (std::size_t i = 0; i < red.size; i++) expect(output[3 * i] == red.data[i], "an output of other levels");
    expect(hologram.preview(0, 32, 24).size() == 32 * 24 * 3, "a preview of another size");
    expect(hologram.refocus(0).info().numbers == 1 && hologram.field().info().numbers == 2, "planes of other numbers");
}

void errors(const Target &target) {
    try {
        Network::built_in("none-such");
        expect(false, "a network that does not exist");
    } catch (const Error &error) {
        expect(error.status() == PF_STATUS_NETWORK && std::strstr(error.what(), "none-such"), error.what());
    }
    const Network network = Network::built_in("rgbd-8");
    const Options options(target, PF_METHOD_TRAINED, &network);
    check(pf_options_set_local_steps(options.get(), 0));
    const Session session(options, PF_RUNNING_MODE_VIDEO);
    try {
        session.process(PfFrame{});
        expect(false, "a hologram of a struct without a size");
    } catch (const Error &error) {
        expect(error.status() == PF_STATUS_SETTING && std::strstr(error.what(), "sizeof(PfFrame)"), error.what());
    }
    try {
        PfFrame nothing{};
        nothing.size = sizeof nothing;
        session.process(nothing);
        expect(false, "a hologram of nothing");
    } catch (const Error &error) {
        expect(error.status() == PF_STATUS_FRAME, error.what());
    }
}

void live(const Target &target, const Images &images) {
    std::atomic<int> heard{0};
    {
        Listener listener;
        listener.on_processed = [&](Hologram hologram) { heard += hologram.info().width == width; };
        listener.on_dropped = [&](std::uint64_t, PfDropReason) { heard++; };
        const Session session(Options(target), std::move(listener));
        session.warm_up();
        for (std::uint64_t i = 1; i <= 5; i++) session.submit(images.frame(i * 1000000));
    } // The listener has heard everything.
    expect(heard == 5, "a frame of which nothing was heard");
}

} // namespace

int main() try {
    const Target target = Target::from_toml("width = 64\nheight = 48");
    const Images images;
    image(target, images);
    errors(target);
    live(target, images);
    expect(Modulator::named("holoeye-pluto").target().get() != nullptr, "a modulator without a target");
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
