// Phasefront: RGB-D frames to phase-only holograms. Made by cbindgen: bindings/c/header writes it anew.
//
// Every call gives a PfStatus; where it is not PF_STATUS_OK, pf_last_error has one line that says what is wrong and what
// would be right, and nothing was written to what the call gives. Objects are opaque: what a call gives is yours until
// its free function, which takes NULL too. Text is UTF-8. Any call may come from any thread; one PfOptions is for one
// thread at a time. No panic leaves a call.

#ifndef PHASEFRONT_H
#define PHASEFRONT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Whether a call did what it says, and else why not.
typedef enum PfStatus {
  // It did.
  PF_STATUS_OK = 0,
  // A display whose physics is impossible or out of range.
  PF_STATUS_DISPLAY = 1,
  // A frame, plane or image of the wrong shape or with unusable values.
  PF_STATUS_FRAME = 2,
  // A frame that is not later than the last one. It is refused; what follows is not harmed.
  PF_STATUS_TIMESTAMP = 3,
  // A setting or an argument that cannot be meant or planned for.
  PF_STATUS_SETTING = 4,
  // What is not a hologram network, or one for another display.
  PF_STATUS_NETWORK = 5,
  // A file that cannot be read.
  PF_STATUS_FILE = 6,
  // A call that a session cannot answer in its mode or state.
  PF_STATUS_SESSION = 7,
  // A fault of Phasefront. The call had no effect, or the frame is lost; please report it.
  PF_STATUS_INTERNAL = 8,
} PfStatus;

// How much a message matters.
typedef enum PfLogLevel {
  // What went wrong.
  PF_LOG_LEVEL_ERROR = 0,
  // What looks wrong.
  PF_LOG_LEVEL_WARNING = 1,
  // What is done.
  PF_LOG_LEVEL_INFO = 2,
  // Details.
  PF_LOG_LEVEL_DEBUG = 3,
} PfLogLevel;

// Why a frame was not made into a hologram, without fault.
typedef enum PfDropReason {
  // It was not dropped.
  PF_DROP_REASON_NOT = 0,
  // A newer frame came while it waited.
  PF_DROP_REASON_SUPERSEDED = 1,
  // It came sooner than the target rate asks for.
  PF_DROP_REASON_ABOVE_TARGET_RATE = 2,
  // The session was paused.
  PF_DROP_REASON_PAUSED = 3,
  // The session was reset before it was done.
  PF_DROP_REASON_RESET = 4,
  // The session was closed before it was done.
  PF_DROP_REASON_CLOSED = 5,
  // For a reason that this version does not know.
  PF_DROP_REASON_OTHER = 6,
} PfDropReason;

// Why a session changed its quality.
typedef enum PfQualityReason {
  // Frames took longer than the target rate allows.
  PF_QUALITY_REASON_TOO_SLOW = 0,
  // There was room for more.
  PF_QUALITY_REASON_ROOM = 1,
  // The device is hot.
  PF_QUALITY_REASON_THERMAL = 2,
  // The caller said so.
  PF_QUALITY_REASON_ASKED = 3,
  // The quality level that was to be taken cannot be planned: the session stays where it was, and does not try it
  // again.
  PF_QUALITY_REASON_REFUSED = 4,
  // For a reason that this version does not know.
  PF_QUALITY_REASON_OTHER = 5,
} PfQualityReason;

// How a colour image lies in memory.
typedef enum PfColourFormat {
  // One plane; bytes red, green, blue, alpha (which is not looked at).
  PF_COLOUR_FORMAT_RGBA = 0,
  // One plane; bytes blue, green, red, alpha (which is not looked at).
  PF_COLOUR_FORMAT_BGRA = 1,
  // One plane; bytes red, green, blue.
  PF_COLOUR_FORMAT_RGB = 2,
  // Two planes: luma; and at half the resolution blue and red chroma side by side.
  PF_COLOUR_FORMAT_NV12 = 3,
  // Three planes: luma, and at half the resolution blue chroma (U) and red chroma (V). Android's YUV_420_888.
  PF_COLOUR_FORMAT_YUV420 = 4,
} PfColourFormat;

// The matrix between luma, chroma and colour.
typedef enum PfYuvMatrix {
  // ITU-R BT.601: standard definition, JPEG, most Android cameras.
  PF_YUV_MATRIX_BT601 = 0,
  // ITU-R BT.709: high definition.
  PF_YUV_MATRIX_BT709 = 1,
} PfYuvMatrix;

// How a depth image lies in memory. But for the normalized ones, 0, negative numbers and what is not finite mean no
// reading.
typedef enum PfDepthFormat {
  // Metres, 32-bit floats.
  PF_DEPTH_FORMAT_METRES_F32 = 0,
  // Metres, 16-bit floats.
  PF_DEPTH_FORMAT_METRES_F16 = 1,
  // Inverse metres, 32-bit floats.
  PF_DEPTH_FORMAT_DISPARITY_F32 = 2,
  // Inverse metres, 16-bit floats.
  PF_DEPTH_FORMAT_DISPARITY_F16 = 3,
  // Millimetres, all 16 bits.
  PF_DEPTH_FORMAT_MILLIMETRES_U16 = 4,
  // Android's DEPTH16: millimetres in the lower 13 bits, a confidence in the upper 3.
  PF_DEPTH_FORMAT_ANDROID_DEPTH16 = 5,
  // 0 nearest to 255 farthest; every pixel is a reading.
  PF_DEPTH_FORMAT_NORMALIZED_U8 = 6,
  // 0 nearest to 65535 farthest; every pixel is a reading.
  PF_DEPTH_FORMAT_NORMALIZED_U16 = 7,
} PfDepthFormat;

// How a confidence map lies in memory.
typedef enum PfConfidenceFormat {
  // 0 low, 1 medium, 2 high: ARKit's ARConfidenceLevel.
  PF_CONFIDENCE_FORMAT_LOW_MEDIUM_HIGH = 0,
  // 0 none to 255 full: ARCore's acquireRawDepthConfidenceImage.
  PF_CONFIDENCE_FORMAT_U8 = 1,
} PfConfidenceFormat;

// How far a sensor's picture must be turned clockwise to stand upright.
typedef enum PfRotation {
  // Not at all.
  PF_ROTATION_UPRIGHT = 0,
  // A quarter turn.
  PF_ROTATION_CLOCKWISE90 = 1,
  // Half a turn.
  PF_ROTATION_HALF = 2,
  // Three quarters.
  PF_ROTATION_CLOCKWISE270 = 3,
} PfRotation;

// What makes holograms.
typedef enum PfMethod {
  // The network that is built in, or the plane sweep where it was not trained for the display.
  PF_METHOD_DEFAULT = 0,
  // A trained network.
  PF_METHOD_TRAINED = 1,
  // The plane sweep, for any display: slower, and nothing needs to be trained.
  PF_METHOD_SWEEP = 2,
  // For each frame what suits its depth: the plane sweep where it is clean, the network where it is noisy.
  PF_METHOD_AUTO = 3,
} PfMethod;

// How a session runs; fixed when it is made.
typedef enum PfRunningMode {
  // Each frame is answered by itself.
  PF_RUNNING_MODE_IMAGE = 0,
  // Each frame is answered; depth and brightness are smoothed over time. Timestamps must rise.
  PF_RUNNING_MODE_VIDEO = 1,
  // Frames are submitted without waiting, and the listener hears what becomes of them. Timestamps must rise.
  PF_RUNNING_MODE_LIVE = 2,
} PfRunningMode;

// Where frames are computed.
typedef enum PfBackend {
  // On the CPU.
  PF_BACKEND_CPU = 0,
  // On the GPU, where this library was built for it, there is one and it answers as the CPU does; else on the CPU.
  PF_BACKEND_GPU = 1,
} PfBackend;

// How hot the device is, as its system says.
typedef enum PfThermal {
  // Not warm: nothing is limited.
  PF_THERMAL_NOMINAL = 0,
  // Warm: frames may take a little less time.
  PF_THERMAL_FAIR = 1,
  // Hot: half the time.
  PF_THERMAL_SERIOUS = 2,
  // Too hot: the lowest quality level.
  PF_THERMAL_CRITICAL = 3,
} PfThermal;

// How the levels of the colours lie in images for a modulator's driver.
typedef enum PfLayout {
  // One image, bytes red, green, blue.
  PF_LAYOUT_RGB = 0,
  // One image, bytes red, green, blue, alpha 255.
  PF_LAYOUT_RGBA = 1,
  // One image, bytes blue, green, red, alpha 255.
  PF_LAYOUT_BGRA = 2,
  // An image for each colour, one after another: red, green, blue; a byte a pixel.
  PF_LAYOUT_GREY = 3,
} PfLayout;

// The hologram of one frame: modulator levels of its colours.
typedef struct PfHologram PfHologram;

// An image, row by row without gaps.
typedef struct PfImage PfImage;

// A hologram network or a pre-filter. Immutable; one serves many sessions.
typedef struct PfNetwork PfNetwork;

// What a session makes, and how.
typedef struct PfOptions PfOptions;

// Numbers at each pixel of each colour of a hologram: amplitudes, or a field.
typedef struct PfPlanes PfPlanes;

// A session. Every call may come from any thread, at any moment, but for pf_session_free, which is the last.
typedef struct PfSession PfSession;

// What holograms are made for: a display and, where it is calibrated, what its modulator answers to a phase, its
// lasers' light, what corrects its optics. Immutable; one serves many sessions.
typedef struct PfTarget PfTarget;

// How long each stage of a frame took, milliseconds.
typedef struct PfFrameTimes {
  // Colour to amplitudes of the display's resolution.
  double colour_ms;
  // Depth to normalized depth of the display's resolution.
  double depth_ms;
  // The midpoint hologram.
  double method_ms;
  // From the midpoint to the modulator.
  double propagate_ms;
  // From the field to levels.
  double encode_ms;
  // All together.
  double total_ms;
} PfFrameTimes;

// What is known of a hologram.
typedef struct PfHologramInfo {
  // The frame's timestamp.
  uint64_t timestamp_ns;
  // Pixels along x.
  uint32_t width;
  // Pixels along y.
  uint32_t height;
  // How many colours its levels have: 3, or 1 for a display of one laser.
  uint32_t colours;
  // The quality level that it was made at, 0 the best.
  uint32_t quality_level;
  // The amplitude that full light stands for.
  float scale;
  // Metres at the near end of the volume; NaN for normalized depth.
  float near_m;
  // Metres at the far end of the volume; NaN for normalized depth.
  float far_m;
  // The share of the depth sensor's pixels that had a usable reading.
  float valid_depth;
  // How long each stage took.
  struct PfFrameTimes times;
} PfHologramInfo;

// What planes are.
typedef struct PfPlanesInfo {
  // The first plane's first number, row by row without gaps; the planes of the other colours follow it. Valid until
  // pf_planes_free.
  const float *data;
  // How many numbers lie there.
  size_t length;
  // Pixels along x.
  uint32_t width;
  // Pixels along y.
  uint32_t height;
  // How many planes there are: 3, or 1 of a display of one laser.
  uint32_t colours;
  // Numbers of a pixel: 1, an amplitude, or 2, a real and an imaginary part.
  uint32_t numbers;
} PfPlanesInfo;

// How a hologram is put on its modulator.
typedef struct PfPlacement {
  // How colours lie in images: a PfLayout.
  uint32_t layout;
  // Whether left and right are exchanged, of the whole image.
  bool flip_x;
  // Whether top and bottom are exchanged, of the whole image.
  bool flip_y;
  // How many pixels to the right of the middle the hologram stands, before flips.
  int32_t shift_x;
  // How many pixels below the middle it stands, before flips.
  int32_t shift_y;
} PfPlacement;

// What an image is.
typedef struct PfImageInfo {
  // Its first byte. Valid until pf_image_free.
  const uint8_t *data;
  // How many bytes lie there.
  size_t length;
  // Pixels along x.
  uint32_t width;
  // Pixels along y.
  uint32_t height;
  // Bytes of a pixel.
  uint32_t pixel_bytes;
} PfImageInfo;

// Hears log messages, on any thread. The message ends with the call. It may call the library, but where a session
// computes on its thread it cannot wait for a frame: pf_session_process, pf_session_warm_up and pf_hologram_preview
// are refused there.
typedef void (*PfOnLog)(void *context, enum PfLogLevel level, const char *message);

// One quality: a method, a resolution, and how the displayed image is corrected.
typedef struct PfQualityLevel {
  // A PfMethod but for PF_METHOD_DEFAULT.
  uint32_t method;
  // Of PF_METHOD_TRAINED and PF_METHOD_AUTO; else NULL.
  const struct PfNetwork *network;
  // Width of the hologram, pixels.
  uint32_t width;
  // Height of the hologram, pixels.
  uint32_t height;
  // Local steps of this quality level; below 0 the session's.
  int32_t local_steps;
  // Steps at the midpoint of this quality level; below 0 the session's.
  int32_t midpoint_steps;
} PfQualityLevel;

// A change of the quality level.
typedef struct PfQualityChange {
  // The quality level before.
  uint32_t from_quality_level;
  // The quality level now; the one before where the step was refused.
  uint32_t to_quality_level;
  // Why.
  enum PfQualityReason reason;
} PfQualityChange;

// Hears what becomes of the frames of a live session: one call after another, on the session's own thread, in the
// order in which things happened. While it is busy no frame is processed. A call that is NULL is not made. No
// exception may leave a call.
//
// `context` must live until on_closed was called; that call may free it. Where pf_session_new fails, no call is made,
// and the context is the caller's.
typedef struct PfListener {
  // Given to each call.
  void *context;
  // A frame became a hologram, which is the listener's until pf_hologram_free.
  void (*on_processed)(void *context, struct PfHologram *hologram);
  // A frame was dropped.
  void (*on_dropped)(void *context, uint64_t timestamp_ns, enum PfDropReason reason);
  // A frame could not be processed. The session goes on. The message ends with the call.
  void (*on_failed)(void *context, uint64_t timestamp_ns, const char *message);
  // The frames after this one are made at another quality level.
  void (*on_quality_changed)(void *context, uint64_t timestamp_ns, struct PfQualityChange change);
  // The session has ended. This is the last call, made exactly once: before pf_session_free returns, or after it
  // where that does not wait.
  void (*on_closed)(void *context);
} PfListener;

// One plane of an image.
typedef struct PfPlane {
  // Its first byte; NULL where there is no such plane.
  const uint8_t *data;
  // Bytes from there to its end.
  size_t length;
  // Bytes from one row to the next.
  uint32_t row_stride;
  // Bytes from one pixel to the next in a row.
  uint32_t pixel_stride;
} PfPlane;

// A colour image.
typedef struct PfColour {
  // How it lies in memory: a PfColourFormat.
  uint32_t format;
  // Pixels along x, as the sensor gives them.
  uint32_t width;
  // Pixels along y.
  uint32_t height;
  // A PfYuvMatrix; only formats of luma and chroma look at it.
  uint32_t matrix;
  // Whether luma runs over 16 to 235 and chroma over 16 to 240, not both over 0 to 255; the same.
  bool video_range;
  // Its planes, in the format's order.
  struct PfPlane planes[3];
} PfColour;

// A depth image.
typedef struct PfDepth {
  // How it lies in memory: a PfDepthFormat.
  uint32_t format;
  // Pixels along x, as the sensor gives them.
  uint32_t width;
  // Pixels along y.
  uint32_t height;
  // Its plane.
  struct PfPlane plane;
} PfDepth;

// The confidence map of a depth image.
typedef struct PfConfidence {
  // How it lies in memory: a PfConfidenceFormat.
  uint32_t format;
  // Pixels along x: as many as the depth has.
  uint32_t width;
  // Pixels along y: as many as the depth has.
  uint32_t height;
  // Its plane; without data there is no map.
  struct PfPlane plane;
} PfConfidence;

// The pinhole model of a camera, in pixels of its image before it is turned upright. The middle of the first pixel is
// (0, 0).
typedef struct PfIntrinsics {
  // Focal length along x.
  double fx;
  // Focal length along y.
  double fy;
  // x of the principal point.
  double cx;
  // y of the principal point.
  double cy;
} PfIntrinsics;

// How the depth camera and the colour camera stand to each other: a point p of the depth camera (x right, y down, z
// forward) is at R*p + t for the colour camera.
typedef struct PfCameras {
  // Of the colour image.
  struct PfIntrinsics colour;
  // Of the depth image.
  struct PfIntrinsics depth;
  // R, row by row; 1, 0, 0, 0, 1, 0, 0, 0, 1 for cameras that look one way.
  double rotation[9];
  // t, metres.
  double translation_m[3];
} PfCameras;

// A frame: colour, depth, and how they belong together. Start from zeros.
typedef struct PfFrame {
  // When it was taken, in nanoseconds of any clock that runs forward.
  uint64_t timestamp_ns;
  // The colour image.
  struct PfColour colour;
  // The depth image.
  struct PfDepth depth;
  // The confidence map of the depth.
  struct PfConfidence confidence;
  // How all must be turned to stand upright: a PfRotation.
  uint32_t rotation;
  // Whether left and right are exchanged after the turn, as front cameras need.
  bool mirrored;
  // NULL where depth and colour show the same field of view.
  const struct PfCameras *cameras;
} PfFrame;

// What a session has done so far. Submitted frames are processed, failed, refused, dropped or pending.
typedef struct PfStatistics {
  // Frames that were given to the session.
  uint64_t submitted;
  // Frames that became holograms.
  uint64_t processed;
  // Frames that could not be processed.
  uint64_t failed;
  // Frames that came late.
  uint64_t refused;
  // Frames that were dropped.
  uint64_t dropped;
  // Frames that wait or are in flight.
  uint64_t pending;
  // The quality level, 0 the best.
  uint32_t quality_level;
  // Holograms a second, of late.
  double rate_hz;
  // Mean times, of late.
  struct PfFrameTimes times;
  // What computes, as text; cut where it is longer.
  char backend[64];
  // Why that.
  char backend_why[256];
} PfStatistics;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// What is known of a hologram.
enum PfStatus pf_hologram_info(const struct PfHologram *hologram, struct PfHologramInfo *info);

// Where the levels of one colour lie, a byte each, row by row without gaps: 0 red, 1 green, 2 blue, or 0 of one laser.
// The colours follow one another without gaps, too. Valid until pf_hologram_free.
enum PfStatus pf_hologram_levels(const struct PfHologram *hologram,
                                 uint32_t colour,
                                 const uint8_t **levels,
                                 size_t *length);

// z of what is seen at (x, y) of the picture, each 0 to 1 from its upper left corner, mm: where to focus when it is
// tapped on.
enum PfStatus pf_hologram_z_at(const struct PfHologram *hologram, double x, double y, double *z_mm);

// What an eye focused at z sees, 4 bytes a pixel: red, green, blue, 255.
enum PfStatus pf_hologram_preview(const struct PfHologram *hologram,
                                  double z_mm,
                                  uint32_t width,
                                  uint32_t height,
                                  struct PfImage **image);

// What an eye focused at z sees of the whole hologram: amplitudes, of which 1 is white. It transforms all of it: not
// for every frame. A z too far away is refused.
enum PfStatus pf_hologram_refocus(const struct PfHologram *hologram, double z_mm, struct PfPlanes **planes);

// The complex field that the levels make behind the aperture at z, 0 the midpoint, without the carrier: real and
// imaginary part of each pixel. It transforms all of the hologram: not for every frame. A z too far away is refused.
enum PfStatus pf_hologram_field(const struct PfHologram *hologram, double z_mm, struct PfPlanes **planes);

// What planes are, and where they lie.
enum PfStatus pf_planes_info(const struct PfPlanes *planes, struct PfPlanesInfo *info);

// Ends planes.
void pf_planes_free(struct PfPlanes *planes);

// Image `number` of those that the modulator's driver takes, of the modulator's resolution: levels as they are, in the
// upper bits of a byte, the hologram where `placement` says.
enum PfStatus pf_hologram_output(const struct PfHologram *hologram,
                                 const struct PfPlacement *placement,
                                 uint32_t number,
                                 struct PfImage **image);

// Ends a hologram; its memory goes back to its session.
void pf_hologram_free(struct PfHologram *hologram);

// What an image is, and where it lies.
enum PfStatus pf_image_info(const struct PfImage *image, struct PfImageInfo *info);

// Ends an image.
void pf_image_free(struct PfImage *image);

// Sends messages of `level`, a PfLogLevel, and above to `on_log`; NULL for silence. A call on another thread that is
// under way when this returns still has the `context` of before, so let each context live as long as the process.
enum PfStatus pf_set_log_listener(uint32_t level, PfOnLog on_log, void *context);

// A network in int8 that is bundled, by name, as "rgbd-8".
enum PfStatus pf_network_built_in(const char *name, struct PfNetwork **network);

// The bytes of an ONNX file.
enum PfStatus pf_network_from_bytes(const uint8_t *onnx, size_t length, struct PfNetwork **network);

// An ONNX file.
enum PfStatus pf_network_from_file(const char *path, struct PfNetwork **network);

// Ends a network. Sessions and options that take it go on.
void pf_network_free(struct PfNetwork *network);

// The default options for `target`: holograms of its modulator's resolution by `method`, a PfMethod; `network` is for
// those that take one, else NULL.
enum PfStatus pf_options_new(const struct PfTarget *target,
                             uint32_t method,
                             const struct PfNetwork *network,
                             struct PfOptions **options);

// Ends options. Sessions that were made by them go on.
void pf_options_free(struct PfOptions *options);

// Removes all quality levels; push at least one afterwards.
enum PfStatus pf_options_clear_quality_levels(struct PfOptions *options);

// Adds a quality level, below those that are there; a session takes 16 at most.
enum PfStatus pf_options_push_quality_level(struct PfOptions *options, const struct PfQualityLevel *quality_level);

// Frames a second that are aimed at; 0 takes every frame and never changes the quality level.
enum PfStatus pf_options_set_target_rate_hz(struct PfOptions *options, double rate_hz);

// Encodes by double phase on the field as it is.
enum PfStatus pf_options_set_double_phase(struct PfOptions *options);

// Encodes behind a small Gaussian blur of `sigma` pixels, `width` taps (AA-DPM); 0.7 and 3 as published.
enum PfStatus pf_options_set_anti_alias(struct PfOptions *options, float sigma, uint32_t width);

// Encodes with high diagonal frequencies cut (BL-DPM): the bound of |tan(pi*fx)*tan(pi*fy)|; 1 as published.
enum PfStatus pf_options_set_band_limit(struct PfOptions *options, float k);

// Encodes behind a pre-filter network (DDPM), trained for the display's offset together with the hologram network.
enum PfStatus pf_options_set_deep(struct PfOptions *options, const struct PfNetwork *prefilter);

// Full light stands near the frame's largest amplitude, moving smoothly from frame to frame. The default.
enum PfStatus pf_options_set_brightness_smoothed(struct PfOptions *options);

// Full light stands for the amplitude `scale`; what is brighter is clipped.
enum PfStatus pf_options_set_brightness_fixed(struct PfOptions *options, float scale);

// Full light stands for the frame's largest amplitude.
enum PfStatus pf_options_set_brightness_frame_max(struct PfOptions *options);

// Where the amplitude is below this share of full light, 0 to 1, phases are drawn to 0, against coloured speckle in
// the dark. Not set, it suits the encoding: 0.4, and 0 with a pre-filter.
enum PfStatus pf_options_set_dark_threshold(struct PfOptions *options, float threshold);

// Steps of correction, 0 to 8, each of which draws the displayed image toward the field that is wanted. Not set, they
// suit the encoding: 1, and 0 with a pre-filter.
enum PfStatus pf_options_set_local_steps(struct PfOptions *options, uint32_t steps);

// Steps of correction at the midpoint, 0 to 100, each of which costs four transforms a colour: 3 for stills, 1 for
// video, where it goes on from the frame before.
enum PfStatus pf_options_set_midpoint_steps(struct PfOptions *options, uint32_t steps);

// Shows these metres at the ends of the volume. Not set, they are the 1st and 99th percentile of the readings.
enum PfStatus pf_options_set_depth_range(struct PfOptions *options, float near_m, float far_m);

// Readings less sure than this, in 0 to 1, are none. ARKit's "low" is 0, "medium" 0.5, "high" 1.
enum PfStatus pf_options_set_least_confidence(struct PfOptions *options, float confidence);

// Threads to compute with, 1 to 256. Not set, as many as the device has.
enum PfStatus pf_options_set_threads(struct PfOptions *options, uint32_t threads);

// Most pixels of a quality level and of the modulator, 8192x4096 unless it is set: what a session allocates is a
// multiple.
enum PfStatus pf_options_set_most_pixels(struct PfOptions *options, uint64_t pixels);

// Where frames are computed: a PfBackend.
enum PfStatus pf_options_set_backend(struct PfOptions *options, uint32_t backend);

// A session that runs in `mode`, a PfRunningMode. A live one needs a `listener`, which is copied; for the others it is
// NULL.
enum PfStatus pf_session_new(const struct PfOptions *options,
                             uint32_t mode,
                             const struct PfListener *listener,
                             struct PfSession **session);

// Takes no more frames, waits until the listener has heard everything, and ends the session. Called by a listener, of
// this session or another, or by a log handler while a session computes, it does not wait: on_closed says when the
// listener has heard everything. Its holograms live on. It is the last call with this session, and never made during
// another one with it.
void pf_session_free(struct PfSession *session);

// The hologram of a frame, in an image or a video session.
enum PfStatus pf_session_process(const struct PfSession *session,
                                 const struct PfFrame *frame,
                                 struct PfHologram **hologram);

// Hands a frame to a live session, which copies it and goes on by itself. `dropped` says whether it was dropped at
// once, and why; the listener hears of it too.
enum PfStatus pf_session_submit(const struct PfSession *session,
                                const struct PfFrame *frame,
                                enum PfDropReason *dropped);

// Runs an empty frame through the stages, so that the first real one is as fast as the others. Waits for it.
enum PfStatus pf_session_warm_up(const struct PfSession *session);

// Forgets all frames so far, one in the making too; the next, of any timestamp, is the first again.
enum PfStatus pf_session_reset(const struct PfSession *session);

// Takes no frames until pf_session_resume.
enum PfStatus pf_session_pause(const struct PfSession *session);

// Takes frames again.
enum PfStatus pf_session_resume(const struct PfSession *session);

// Says how hot the device is: a PfThermal.
enum PfStatus pf_session_set_thermal(const struct PfSession *session, uint32_t thermal);

// Stays at this quality level, 0 the best.
enum PfStatus pf_session_fix_quality_level(const struct PfSession *session, uint32_t quality_level);

// Changes the quality level by itself: down where frames take longer than the target rate allows or the device is hot,
// up where there is room.
enum PfStatus pf_session_step_by_itself(const struct PfSession *session);

// What the session has done so far. Never waits for a frame.
enum PfStatus pf_session_statistics(const struct PfSession *session, struct PfStatistics *statistics);

// What was wrong with the last call of this thread that was not PF_STATUS_OK, one line; empty before the first. Valid
// until the next such call of this thread.
const char *pf_last_error(void);

// The version of the library, as "0.1.0". Valid for ever.
const char *pf_version(void);

// A display with levels in equal steps of phase, in TOML, as "width = 1920\npitch_um = 8.0"; what is left out has the
// default value, so "" is the default display.
enum PfStatus pf_target_from_toml(const char *toml, struct PfTarget **target);

// A display, as in pf_target_from_toml, whose modulator was calibrated as a whole: of 256 levels the one at i shows
// the phase 2*pi*i/256.
enum PfStatus pf_target_with_look_up_table(const char *toml,
                                           const uint8_t *levels,
                                           size_t count,
                                           struct PfTarget **target);

// The bytes of a calibration's file, as `phasefront calibrate pack` writes it.
enum PfStatus pf_target_from_bytes(const uint8_t *file, size_t length, struct PfTarget **target);

// A calibration's file.
enum PfStatus pf_target_from_file(const char *path, struct PfTarget **target);

// Pixels of its modulator.
enum PfStatus pf_target_size(const struct PfTarget *target, uint32_t *width, uint32_t *height);

// Ends a target. Sessions and options that were made for it go on.
void pf_target_free(struct PfTarget *target);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PHASEFRONT_H */
