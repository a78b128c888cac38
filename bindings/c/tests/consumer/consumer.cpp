// Uses phasefront.hpp as a program would: a hologram, an error, a live stream.
#include <phasefront.hpp>

#include <atomic>
#include <cstdio>
#include <cstring>
#include <vector>

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
    const PfOutputSize size = hologram.output_size(PF_LAYOUT_RGB);
    expect(size.width == width && size.height == height && size.pixel_bytes == 3, "an output of another size");
    std::vector<std::uint8_t> output(3 * red.size);
    PfPlacement placement{};
    hologram.write_output(placement, {output.data(), output.size(), 3 * width});
    for (std::size_t i = 0; i < red.size; i++) expect(output[3 * i] == red.data[i], "an output of other levels");
    std::vector<std::uint8_t> view(4 * 32 * 24);
    hologram.write_preview(0, 32, 24, PF_LAYOUT_RGBA, {view.data(), view.size(), 4 * 32});
    expect(view[3] == 255, "a preview without alpha");
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

// A grey modulator that a screen drives: each pixel has the level three times.
void screen(const Images &images) {
    const Modulator modulator = Modulator::from_toml("width = 64\nheight = 48\nwavelengths_nm = [532]\npacking = \"grey\"");
    const Session session(Options(modulator.target(), PF_METHOD_SWEEP, nullptr));
    const Hologram hologram = session.process(images.frame(1));
    const PfOutputSize size = modulator.output_size();
    expect(size.width == width && size.height == height && size.pixel_bytes == 1, "an input of another size");
    std::vector<std::uint8_t> grey(width * height), pixels(4 * grey.size());
    modulator.write_output(hologram, {grey.data(), grey.size(), width});
    modulator.write_pixels(hologram, PF_LAYOUT_BGRA, {pixels.data(), pixels.size(), 4 * width});
    for (std::size_t i = 0; i < pixels.size(); i++) expect(pixels[i] == (i % 4 < 3 ? grey[i / 4] : 255), "pixels of other levels");
    expect(Modulator::named("holoeye-pluto").target().get() != nullptr, "a modulator without a target");
}

} // namespace

int main() try {
    const Target target = Target::from_toml("width = 64\nheight = 48");
    const Images images;
    image(target, images);
    errors(target);
    live(target, images);
    screen(images);
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
