// Phasefront for C++17: objects of phasefront.h that free themselves, and exceptions in place of statuses. Header only.
// Every object has get(), which gives the pointer that the other calls of phasefront.h take; check() throws what such a
// call returns.
#ifndef PHASEFRONT_HPP
#define PHASEFRONT_HPP

#include "phasefront.h"

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace phasefront {

// The error of a call: what() is one line that says what is wrong and what would be right.
class Error : public std::runtime_error {
  public:
    explicit Error(PfStatus status) : std::runtime_error(pf_last_error()), status_(status) {}
    // The kind of the error.
    PfStatus status() const noexcept { return status_; }

  private:
    PfStatus status_;
};

// Throws an Error unless a call succeeded.
inline void check(PfStatus status) {
    if (status != PF_STATUS_OK) throw Error(status);
}

namespace detail {

template <auto Free> struct Freed {
    template <typename T> void operator()(T *object) const noexcept { Free(object); }
};

// An object of phasefront.h. It can be moved, and frees what it owns.
template <typename T, auto Free> class Object {
  public:
    // Owns an object that a call created, such as a listener's hologram.
    explicit Object(T *owned) noexcept : owned_(owned) {}
    // The pointer that the calls of phasefront.h take. It stays owned.
    T *get() const noexcept { return owned_.get(); }

  protected:
    // Owns what `create` writes to the pointer that it is given.
    template <typename Create> static T *created(Create create) {
        T *object = nullptr;
        check(create(&object));
        return object;
    }

  private:
    std::unique_ptr<T, Freed<Free>> owned_;
};

} // namespace detail

// What holograms are made for: a display, calibrated or not.
class Target : public detail::Object<PfTarget, pf_target_free> {
  public:
    using Object::Object;
    // A display in TOML, such as "width = 1920\npitch_um = 8.0". An empty text is the default display.
    static Target from_toml(const std::string &toml) {
        return Target(created([&](PfTarget **to) { return pf_target_from_toml(toml.c_str(), to); }));
    }
    // A calibration file, as `phasefront calibrate pack` writes it.
    static Target from_file(const std::string &path) {
        return Target(created([&](PfTarget **to) { return pf_target_from_file(path.c_str(), to); }));
    }
};

// A hologram network.
class Network : public detail::Object<PfNetwork, pf_network_free> {
  public:
    using Object::Object;
    // The bundled network of a name, such as "rgbd-8".
    static Network built_in(const std::string &name) {
        return Network(created([&](PfNetwork **to) { return pf_network_built_in(name.c_str(), to); }));
    }
    // A network of an ONNX file.
    static Network from_file(const std::string &path) {
        return Network(created([&](PfNetwork **to) { return pf_network_from_file(path.c_str(), to); }));
    }
    // A network of an ONNX file's bytes.
    static Network from_bytes(const std::uint8_t *onnx, std::size_t length) {
        return Network(created([&](PfNetwork **to) { return pf_network_from_bytes(onnx, length, to); }));
    }
};

// A network that estimates depth from colour.
class DepthNetwork : public detail::Object<PfDepthNetwork, pf_depth_network_free> {
  public:
    using Object::Object;
    // A network of an ONNX file's bytes.
    static DepthNetwork from_bytes(const std::uint8_t *onnx, std::size_t length,
                                   PfColourScale colours = PF_COLOUR_SCALE_IMAGENET, bool gives_distance = false) {
        return DepthNetwork(created([&](PfDepthNetwork **to) {
            return pf_depth_network_from_bytes(onnx, length, static_cast<std::uint32_t>(colours), gives_distance, to);
        }));
    }
};

// The options of a session. The calls pf_options_… set them: check(pf_options_set_local_steps(options.get(), 2)).
class Options : public detail::Object<PfOptions, pf_options_free> {
  public:
    using Object::Object;
    // The defaults for a target, with PF_METHOD_AUTO.
    explicit Options(const Target &target) : Options(target, PF_METHOD_AUTO, nullptr) {}
    // The defaults for a target and a method, which may need a network.
    Options(const Target &target, PfMethod method, const Network *network)
        : Object(created([&](PfOptions **to) {
              return pf_options_new(target.get(), static_cast<std::uint32_t>(method), network ? network->get() : nullptr, to);
          })) {}
};

// Numbers of each pixel and colour, which are read in place.
class Planes : public detail::Object<PfPlanes, pf_planes_free> {
  public:
    using Object::Object;
    // The memory and the size.
    PfPlanesInfo info() const {
        PfPlanesInfo info{};
        check(pf_planes_info(get(), &info));
        return info;
    }
};

// The levels that a modulator displays, and what it would show.
class Hologram : public detail::Object<PfHologram, pf_hologram_free> {
  public:
    using Object::Object;
    // Levels of one colour, read in place: height rows of width bytes. They live as long as the hologram.
    struct Levels {
        const std::uint8_t *data;
        std::size_t size;
        const std::uint8_t *begin() const noexcept { return data; }
        const std::uint8_t *end() const noexcept { return data + size; }
    };
    // The size, the timestamp and the times of the stages.
    PfHologramInfo info() const {
        PfHologramInfo info{};
        info.size = sizeof info;
        check(pf_hologram_info(get(), &info));
        return info;
    }
    // The levels of a colour: 0 red, 1 green, 2 blue, or 0 for one laser.
    Levels levels(std::uint32_t colour) const {
        Levels levels{};
        check(pf_hologram_levels(get(), colour, &levels.data, &levels.size));
        return levels;
    }
    // Writes the view of an eye focused at z into memory: width × height pixels in RGB, RGBA or BGRA.
    void write_preview(double z_mm, std::uint32_t width, std::uint32_t height, PfLayout layout, PfMemory to) const {
        check(pf_hologram_write_preview(get(), z_mm, width, height, static_cast<std::uint32_t>(layout), to));
    }
    // The size of the images of a layout for the modulator.
    PfOutputSize output_size(PfLayout layout) const {
        PfOutputSize size{};
        check(pf_hologram_output_size(get(), static_cast<std::uint32_t>(layout), &size));
        return size;
    }
    // Writes image `number` of those that the modulator's driver takes into memory.
    void write_output(const PfPlacement &placement, PfMemory to, std::uint32_t number = 0) const {
        check(pf_hologram_write_output(get(), &placement, number, to));
    }
    // The amplitudes of each colour that an eye focused at z sees.
    Planes refocus(double z_mm) const {
        return Planes(created_planes([&](PfPlanes **to) { return pf_hologram_refocus(get(), z_mm, to); }));
    }
    // The complex field behind the aperture at z.
    Planes field(double z_mm = 0) const {
        return Planes(created_planes([&](PfPlanes **to) { return pf_hologram_field(get(), z_mm, to); }));
    }

  private:
    template <typename Create> static PfPlanes *created_planes(Create create) {
        PfPlanes *planes = nullptr;
        check(create(&planes));
        return planes;
    }
};

// A modulator of the catalogue, or of a file.
class Modulator : public detail::Object<PfModulator, pf_modulator_free> {
  public:
    using Object::Object;
    // A modulator that the command `phasefront devices` lists, such as "holoeye-pluto".
    static Modulator named(const std::string &name) {
        return Modulator(created([&](PfModulator **to) { return pf_modulator_named(name.c_str(), to); }));
    }
    // A modulator of the text of its file.
    static Modulator from_toml(const std::string &toml) {
        return Modulator(created([&](PfModulator **to) { return pf_modulator_from_toml(toml.c_str(), to); }));
    }
    // The target of holograms for the modulator.
    Target target() const {
        PfTarget *target = nullptr;
        check(pf_modulator_target(get(), &target));
        return Target(target);
    }
    // The size of the images that its input takes.
    PfOutputSize output_size() const {
        PfOutputSize size{};
        check(pf_modulator_output_size(get(), &size));
        return size;
    }
    // Writes image `number` of those that its input takes of a hologram into memory.
    void write_output(const Hologram &hologram, PfMemory to, std::uint32_t number = 0) const {
        check(pf_modulator_write_output(get(), hologram.get(), number, to));
    }
    // Writes the same image in the pixels of a screen that drives the modulator, RGBA or BGRA.
    void write_pixels(const Hologram &hologram, PfLayout layout, PfMemory to, std::uint32_t number = 0) const {
        check(pf_modulator_write_pixels(get(), hologram.get(), number, static_cast<std::uint32_t>(layout), to));
    }
};

// What a live session reports, on its own thread, one call after another. An empty function hears nothing. An exception
// of one of them ends the program.
struct Listener {
    std::function<void(Hologram)> on_processed;
    std::function<void(std::uint64_t timestamp_ns, PfDropReason)> on_dropped;
    std::function<void(std::uint64_t timestamp_ns, const char *message)> on_failed;
    std::function<void(std::uint64_t timestamp_ns, PfQualityChange)> on_quality_changed;
};

// Turns frames into holograms. It waits until its listener has heard everything when it is destroyed.
class Session : public detail::Object<PfSession, pf_session_free> {
  public:
    using Object::Object;
    // A session that answers each frame: PF_RUNNING_MODE_IMAGE or PF_RUNNING_MODE_VIDEO.
    explicit Session(const Options &options, PfRunningMode mode = PF_RUNNING_MODE_IMAGE)
        : Object(created([&](PfSession **to) {
              return pf_session_new(options.get(), static_cast<std::uint32_t>(mode), nullptr, to);
          })) {}
    // A live session, which reports to a listener.
    Session(const Options &options, Listener listener)
        : Object(live(options, std::make_unique<Listener>(std::move(listener)))) {}
    // Makes the hologram of a frame.
    Hologram process(const PfFrame &frame) const {
        PfHologram *hologram = nullptr;
        check(pf_session_process(get(), &frame, &hologram));
        return Hologram(hologram);
    }
    // Hands a frame to a live session, which copies it and reports what becomes of it.
    void submit(const PfFrame &frame) const {
        PfDropReason dropped;
        check(pf_session_submit(get(), &frame, &dropped));
    }
    // Runs an empty frame, so that the first real frame is as fast as later ones.
    void warm_up() const { check(pf_session_warm_up(get())); }
    // The rates, drops and times.
    PfStatistics statistics() const {
        PfStatistics statistics{};
        statistics.size = sizeof statistics;
        check(pf_session_statistics(get(), &statistics));
        return statistics;
    }

  private:
    static PfSession *live(const Options &options, std::unique_ptr<Listener> listener) {
        PfListener calls{};
        calls.size = sizeof calls;
        calls.context = listener.get();
        // No exception may leave a function that C calls, so these end the program.
        calls.on_processed = [](void *context, PfHologram *given) noexcept {
            Hologram hologram(given);
            if (auto &on = static_cast<Listener *>(context)->on_processed) on(std::move(hologram));
        };
        calls.on_dropped = [](void *context, std::uint64_t timestamp_ns, PfDropReason reason) noexcept {
            if (auto &on = static_cast<Listener *>(context)->on_dropped) on(timestamp_ns, reason);
        };
        calls.on_failed = [](void *context, std::uint64_t timestamp_ns, const char *message) noexcept {
            if (auto &on = static_cast<Listener *>(context)->on_failed) on(timestamp_ns, message);
        };
        calls.on_quality_changed = [](void *context, std::uint64_t timestamp_ns, PfQualityChange change) noexcept {
            if (auto &on = static_cast<Listener *>(context)->on_quality_changed) on(timestamp_ns, change);
        };
        calls.on_closed = [](void *context) noexcept { delete static_cast<Listener *>(context); };
        PfSession *session = created([&](PfSession **to) {
            return pf_session_new(options.get(), PF_RUNNING_MODE_LIVE, &calls, to);
        });
        listener.release(); // on_closed frees it.
        return session;
    }
};

} // namespace phasefront

#endif // PHASEFRONT_HPP
