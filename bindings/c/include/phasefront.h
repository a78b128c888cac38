// Phasefront turns RGB-D frames into phase-only holograms. bindings/c/header generates this file with cbindgen.
//
// Every function returns a PfStatus. If it is not PF_STATUS_OK, pf_last_error returns one line that says what is wrong
// and what would be right, and the function has written no results. Objects are opaque. An object that a function
// creates belongs to the caller until its free function, which also accepts NULL. Text is UTF-8. Functions can be called
// from any thread, but a PfOptions only from one thread at a time. No panic leaves a function.

#ifndef PHASEFRONT_H
#define PHASEFRONT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// The version of this header. pf_version returns that of the library.
#define PHASEFRONT_VERSION "0.1.0"
#define PHASEFRONT_VERSION_MAJOR 0
#define PHASEFRONT_VERSION_MINOR 1
#define PHASEFRONT_VERSION_PATCH 0

// The result of a call.
typedef enum PfStatus {
  // The call succeeded.
  PF_STATUS_OK = 0,
  // The physics of a display is impossible or out of range.
  PF_STATUS_DISPLAY = 1,
  // A frame, plane or image has the wrong shape or unusable values.
  PF_STATUS_FRAME = 2,
  // A frame is not later than the previous one. It is refused; later frames are not affected.
  PF_STATUS_TIMESTAMP = 3,
  // A setting or an argument is invalid or cannot be planned.
  PF_STATUS_SETTING = 4,
  // A file is not a hologram network, or the network is for another display.
  PF_STATUS_NETWORK = 5,
  // A file cannot be read.
  PF_STATUS_FILE = 6,
  // A session cannot answer the call in its mode or state.
  PF_STATUS_SESSION = 7,
  // Phasefront has a bug. The call had no effect, or the frame is lost. Please report it.
  PF_STATUS_INTERNAL = 8,
} PfStatus;

// The severity of a log message.
typedef enum PfLogLevel {
  // An error.
  PF_LOG_LEVEL_ERROR = 0,
  // Something that may be wrong.
  PF_LOG_LEVEL_WARNING = 1,
  // An action of the library.
  PF_LOG_LEVEL_INFO = 2,
  // Details.
  PF_LOG_LEVEL_DEBUG = 3,
} PfLogLevel;

// The reason why a session dropped a frame without an error.
typedef enum PfDropReason {
  // The frame was not dropped.
  PF_DROP_REASON_NOT = 0,
  // A newer frame arrived while this one waited.
  PF_DROP_REASON_SUPERSEDED = 1,
  // The frame arrived sooner than the target rate allows.
  PF_DROP_REASON_ABOVE_TARGET_RATE = 2,
  // The session was paused.
  PF_DROP_REASON_PAUSED = 3,
  // The session was reset before the frame was finished.
  PF_DROP_REASON_RESET = 4,
  // The session was closed before the frame was finished.
  PF_DROP_REASON_CLOSED = 5,
  // A reason that this version does not know.
  PF_DROP_REASON_OTHER = 6,
} PfDropReason;

// The reason why a session changed its quality level.
typedef enum PfQualityReason {
  // Frames took longer than the target rate allows.
  PF_QUALITY_REASON_TOO_SLOW = 0,
  // There was time left.
  PF_QUALITY_REASON_ROOM = 1,
  // The device is hot.
  PF_QUALITY_REASON_THERMAL = 2,
  // The app asked for it.
  PF_QUALITY_REASON_ASKED = 3,
  // The next quality level cannot be planned. The session keeps the previous one and does not try the next one
  // again.
  PF_QUALITY_REASON_REFUSED = 4,
  // A reason that this version does not know.
  PF_QUALITY_REASON_OTHER = 5,
} PfQualityReason;

// The memory layout of a colour image.
typedef enum PfColourFormat {
  // One plane with the bytes red, green, blue, alpha. Alpha is ignored.
  PF_COLOUR_FORMAT_RGBA = 0,
  // One plane with the bytes blue, green, red, alpha. Alpha is ignored.
  PF_COLOUR_FORMAT_BGRA = 1,
  // One plane with the bytes red, green, blue.
  PF_COLOUR_FORMAT_RGB = 2,
  // Two planes: luma, and interleaved blue and red chroma at half the resolution.
  PF_COLOUR_FORMAT_NV12 = 3,
  // Three planes: luma, and at half the resolution blue chroma (U) and red chroma (V). Android's YUV_420_888.
  PF_COLOUR_FORMAT_YUV420 = 4,
} PfColourFormat;

// The matrix that converts luma and chroma to colour.
typedef enum PfYuvMatrix {
  // ITU-R BT.601, for standard definition, JPEG and most Android cameras.
  PF_YUV_MATRIX_BT601 = 0,
  // ITU-R BT.709, for high definition.
  PF_YUV_MATRIX_BT709 = 1,
  // ITU-R BT.2020 with non-constant luminance, for films of high dynamic range.
  PF_YUV_MATRIX_BT2020 = 2,
} PfYuvMatrix;

// The meaning of a picture's red, green and blue.
typedef enum PfRgbEncoding {
  // sRGB, and BT.709 video, which screens show alike.
  PF_RGB_ENCODING_SRGB = 0,
  // Display P3, as phones take photographs and videos.
  PF_RGB_ENCODING_DISPLAY_P3 = 1,
  // BT.2020 of standard dynamic range, with the curve of sRGB.
  PF_RGB_ENCODING_BT2020 = 2,
  // BT.2020 with hybrid log-gamma.
  PF_RGB_ENCODING_BT2020_HLG = 3,
  // BT.2020 with perceptual quantization.
  PF_RGB_ENCODING_BT2020_PQ = 4,
  // Amplitudes of the lasers, as in the paper and its data sets.
  PF_RGB_ENCODING_AMPLITUDE = 5,
} PfRgbEncoding;

// The memory layout of a depth image. In all formats except the normalized and the relative ones, 0, negative numbers,
// NaN, numbers of 1e9 or more, the largest code of an integer format and the largest finite 16-bit float mean no
// reading.
typedef enum PfDepthFormat {
  // Metres as 32-bit floats.
  PF_DEPTH_FORMAT_METRES_F32 = 0,
  // Metres as 16-bit floats.
  PF_DEPTH_FORMAT_METRES_F16 = 1,
  // Inverse metres as 32-bit floats.
  PF_DEPTH_FORMAT_DISPARITY_F32 = 2,
  // Inverse metres as 16-bit floats.
  PF_DEPTH_FORMAT_DISPARITY_F16 = 3,
  // Millimetres in all 16 bits.
  PF_DEPTH_FORMAT_MILLIMETRES_U16 = 4,
  // Android's DEPTH16: millimetres in the lower 13 bits, and a confidence in the upper 3 bits.
  PF_DEPTH_FORMAT_ANDROID_DEPTH16 = 5,
  // Bytes from 0 nearest to 255 farthest. Every pixel is a reading.
  PF_DEPTH_FORMAT_NORMALIZED_U8 = 6,
  // 16-bit numbers from 0 nearest to 65535 farthest. Every pixel is a reading.
  PF_DEPTH_FORMAT_NORMALIZED_U16 = 7,
  // Relative inverse depth as 32-bit floats, as networks estimate it: larger where nearer, on any scale. NaN
  // and numbers beyond 1e9 in magnitude mean no reading.
  PF_DEPTH_FORMAT_RELATIVE_F32 = 8,
  // Relative inverse depth as 16-bit floats.
  PF_DEPTH_FORMAT_RELATIVE_F16 = 9,
} PfDepthFormat;

// The memory layout of a confidence map.
typedef enum PfConfidenceFormat {
  // 0 low, 1 medium, 2 high, as in ARKit's ARConfidenceLevel.
  PF_CONFIDENCE_FORMAT_LOW_MEDIUM_HIGH = 0,
  // 0 none to 255 full, as in ARCore's acquireRawDepthConfidenceImage.
  PF_CONFIDENCE_FORMAT_U8 = 1,
} PfConfidenceFormat;

// The clockwise rotation that turns a sensor's image upright.
typedef enum PfRotation {
  // No rotation.
  PF_ROTATION_UPRIGHT = 0,
  // A quarter turn.
  PF_ROTATION_CLOCKWISE90 = 1,
  // Half a turn.
  PF_ROTATION_HALF = 2,
  // Three quarters of a turn.
  PF_ROTATION_CLOCKWISE270 = 3,
} PfRotation;

// The method that computes holograms.
typedef enum PfMethod {
  // The network for frames whose depth has soft edges, and the plane sweep for all others. Without a network, the
  // built-in one, or the plane sweep alone if that network was not trained for the display. This is the default.
  PF_METHOD_AUTO = 0,
  // A trained network.
  PF_METHOD_TRAINED = 1,
  // The plane sweep, which suits any display and needs no training.
  PF_METHOD_SWEEP = 2,
} PfMethod;

// The running mode of a session. It is fixed when the session is created.
typedef enum PfRunningMode {
  // The session answers each frame independently of all others.
  PF_RUNNING_MODE_IMAGE = 0,
  // The session answers each frame, and smooths depth and brightness over time. Timestamps must increase.
  PF_RUNNING_MODE_VIDEO = 1,
  // The app submits frames without waiting, and the listener receives the outcome of each. Timestamps must increase.
  PF_RUNNING_MODE_LIVE = 2,
} PfRunningMode;

// The backend that computes frames.
typedef enum PfBackend {
  // Computes on the CPU.
  PF_BACKEND_CPU = 0,
  // Computes on the GPU if this library was built with GPU support, a GPU exists and its results agree with the
  // CPU's; otherwise on the CPU.
  PF_BACKEND_GPU = 1,
} PfBackend;

// The thermal state of the device as reported by its system.
typedef enum PfThermal {
  // The device is not warm; nothing is limited.
  PF_THERMAL_NOMINAL = 0,
  // The device is warm; frames may take a little less time.
  PF_THERMAL_FAIR = 1,
  // The device is hot; frames may take half the time.
  PF_THERMAL_SERIOUS = 2,
  // The device is too hot; the session uses the lowest quality level.
  PF_THERMAL_CRITICAL = 3,
} PfThermal;

// The arrangement of the colours' levels in images for a modulator's driver.
typedef enum PfLayout {
  // One image with bytes red, green, blue.
  PF_LAYOUT_RGB = 0,
  // One image with bytes red, green, blue, alpha 255.
  PF_LAYOUT_RGBA = 1,
  // One image with bytes blue, green, red, alpha 255.
  PF_LAYOUT_BGRA = 2,
  // One image for each colour in the order red, green, blue, with one byte for each pixel.
  PF_LAYOUT_GREY = 3,
  // One image with 32-bit little-endian words: red in the lowest 10 bits, then green, then blue, alpha 3.
  PF_LAYOUT_RGB10 = 4,
  // One image for each colour in the order red, green, blue, with one 16-bit little-endian word for each pixel.
  PF_LAYOUT_GREY16 = 5,
} PfLayout;

// The scaling that a depth network expects for colour values from 0 to 1.
typedef enum PfColourScale {
  // Normalized by the mean and the spread of ImageNet, as in the training of MiDaS, DPT and Depth Anything.
  PF_COLOUR_SCALE_IMAGENET = 0,
  // From 0 to 1.
  PF_COLOUR_SCALE_UNIT = 1,
  // From -1 to 1.
  PF_COLOUR_SCALE_SIGNED = 2,
} PfColourScale;

// A network that estimates relative inverse depth from colour alone. It is immutable and can be used by several
// sessions.
typedef struct PfDepthNetwork PfDepthNetwork;

// The hologram of one frame: modulator levels of its colours.
typedef struct PfHologram PfHologram;

// A modulator: its display, the phases of its levels, and the images that its input takes.
typedef struct PfModulator PfModulator;

// A hologram network or a pre-filter. It is immutable and can be used by several sessions.
typedef struct PfNetwork PfNetwork;

// The options of a session.
typedef struct PfOptions PfOptions;

// Numbers at each pixel of each colour of a hologram: amplitudes, or a field.
typedef struct PfPlanes PfPlanes;

// A session. All functions except pf_session_free can be called from any thread at any time.
typedef struct PfSession PfSession;

// The target of holograms: a display and its calibration, if there is one: the modulator's response to phases, the
// light of the lasers, and the correction of the optics. It is immutable and can be used by several sessions.
typedef struct PfTarget PfTarget;

// The time that each stage of a frame took, in milliseconds.
typedef struct PfFrameTimes {
  // Rotating, converting and resizing the colour image.
  double colour_ms;
  // Reading, aligning, temporally smoothing and refining the depth.
  double depth_ms;
  // Computing the midpoint hologram from the frame.
  double method_ms;
  // Propagating from the midpoint to the modulator.
  double propagate_ms;
  // Encoding the field into levels.
  double encode_ms;
  // The sum of all stages.
  double total_ms;
} PfFrameTimes;

// The properties of a hologram.
typedef struct PfHologramInfo {
  // The size of this struct, sizeof(PfHologramInfo). Set it before the call.
  size_t size;
  // The timestamp of the frame.
  uint64_t timestamp_ns;
  // The width in pixels.
  uint32_t width;
  // The height in pixels.
  uint32_t height;
  // The number of colours of the levels: 3, or 1 for a display with one laser.
  uint32_t colours;
  // The quality level of the hologram; 0 is the best.
  uint32_t quality_level;
  // The amplitude that maps to full light.
  float scale;
  // The distance of the near end of the volume in metres; NaN for normalized depth.
  float near_m;
  // The distance of the far end of the volume in metres; NaN for normalized depth.
  float far_m;
  // The share of the depth sensor's pixels that had a usable reading.
  float valid_depth;
  // The time that each stage took.
  struct PfFrameTimes times;
  // The meaning of the frame's colours, a PfRgbEncoding. Views are in sRGB unless these are amplitudes, as which
  // views show them.
  uint32_t rgb_encoding;
} PfHologramInfo;

// The caller's memory for an image.
typedef struct PfMemory {
  // The first byte.
  uint8_t *data;
  // The number of bytes.
  size_t length;
  // The number of bytes from one row to the next.
  uint32_t row_stride;
} PfMemory;

// The memory and size of planes.
typedef struct PfPlanesInfo {
  // The first number of the first plane. There are no gaps between rows, and the planes of the other colours follow.
  // It is valid until pf_planes_free.
  const float *data;
  // The number of numbers.
  size_t length;
  // The width in pixels.
  uint32_t width;
  // The height in pixels.
  uint32_t height;
  // The number of planes: 3, or 1 for a display with one laser.
  uint32_t colours;
  // The number of numbers of a pixel: 1 for an amplitude, 2 for a real and an imaginary part.
  uint32_t numbers;
} PfPlanesInfo;

// The images that a modulator's input takes of a hologram.
typedef struct PfOutputSize {
  // The width of an image in pixels.
  uint32_t width;
  // The height of an image in pixels.
  uint32_t height;
  // The number of bytes of a pixel.
  uint32_t pixel_bytes;
  // The number of images: one, or one for each colour.
  uint32_t images;
} PfOutputSize;

// The placement of a hologram on its modulator.
typedef struct PfPlacement {
  // The arrangement of colours in images, a PfLayout.
  uint32_t layout;
  // Whether the whole image is flipped left to right.
  bool flip_x;
  // Whether the whole image is flipped top to bottom.
  bool flip_y;
  // The hologram's shift to the right of the middle in pixels, before flips.
  int32_t shift_x;
  // The hologram's shift below the middle in pixels, before flips.
  int32_t shift_y;
} PfPlacement;

// A receiver of log messages, which is called on any thread. The message is valid during the call. The receiver may
// call the library. On a thread that computes for a session it cannot wait for a frame: pf_session_process,
// pf_session_warm_up and pf_hologram_refocus are refused.
typedef void (*PfOnLog)(void *context, enum PfLogLevel level, const char *message);

// A quality level: a method, a resolution and the number of correction steps.
typedef struct PfQualityLevel {
  // The size of this struct, sizeof(PfQualityLevel). Set it before the call.
  size_t size;
  // The method, a PfMethod.
  uint32_t method;
  // The network of PF_METHOD_TRAINED; of PF_METHOD_AUTO, or NULL for the built-in one; otherwise NULL.
  const struct PfNetwork *network;
  // The width of the hologram in pixels.
  uint32_t width;
  // The height of the hologram in pixels.
  uint32_t height;
  // The number of local steps; negative for the session's number.
  int32_t local_steps;
  // The number of steps at the midpoint; negative for the session's number.
  int32_t midpoint_steps;
  // The number of steps of natural focus, in a session with natural focus; negative for the session's number. 0 in
  // other sessions.
  int32_t focus_steps;
} PfQualityLevel;

// A change of the quality level.
typedef struct PfQualityChange {
  // The previous quality level.
  uint32_t from_quality_level;
  // The new quality level; the previous one if the reason is PF_QUALITY_REASON_REFUSED.
  uint32_t to_quality_level;
  // The reason.
  enum PfQualityReason reason;
} PfQualityChange;

// A receiver of the events of a live session. Calls arrive one after another, on the session's own thread, in the
// order of the events. No frame is processed while the listener is busy. A function that is NULL is not called.
// Functions must not throw exceptions.
//
// `context` must live until on_closed is called, which may free it. If pf_session_new fails, no function is called and
// the context still belongs to the caller.
typedef struct PfListener {
  // The size of this struct, sizeof(PfListener). Set it before the call.
  size_t size;
  // The first argument of each function.
  void *context;
  // Reports that a frame became a hologram. The listener must free it with pf_hologram_free.
  void (*on_processed)(void *context, struct PfHologram *hologram);
  // Reports that a frame was dropped.
  void (*on_dropped)(void *context, uint64_t timestamp_ns, enum PfDropReason reason);
  // Reports that a frame could not be processed. The session continues. The message is valid during the call.
  void (*on_failed)(void *context, uint64_t timestamp_ns, const char *message);
  // Reports that the session uses another quality level after the frame of `timestamp_ns`.
  void (*on_quality_changed)(void *context, uint64_t timestamp_ns, struct PfQualityChange change);
  // Reports that the session is closed. This is the last call. It is made exactly once, before pf_session_free
  // returns, or after it if pf_session_free does not wait.
  void (*on_closed)(void *context);
} PfListener;

// A plane of an image.
typedef struct PfPlane {
  // The first byte; NULL if there is no such plane.
  const uint8_t *data;
  // The number of bytes of the plane.
  size_t length;
  // The number of bytes from one row to the next.
  uint32_t row_stride;
  // The number of bytes from one pixel to the next in a row.
  uint32_t pixel_stride;
} PfPlane;

// A colour image.
typedef struct PfColour {
  // The memory layout, a PfColourFormat.
  uint32_t format;
  // The width of the sensor's image, in pixels.
  uint32_t width;
  // The height of the sensor's image, in pixels.
  uint32_t height;
  // The matrix of luma and chroma, a PfYuvMatrix. Other formats ignore it.
  uint32_t matrix;
  // Whether luma spans 16 to 235 and chroma 16 to 240 instead of 0 to 255 for both. Other formats ignore it.
  bool video_range;
  // The planes, in the format's order.
  struct PfPlane planes[3];
} PfColour;

// A depth image.
typedef struct PfDepth {
  // The memory layout, a PfDepthFormat.
  uint32_t format;
  // The width of the sensor's image, in pixels.
  uint32_t width;
  // The height of the sensor's image, in pixels.
  uint32_t height;
  // The plane. Without data there is no depth, and the session's depth network estimates it.
  struct PfPlane plane;
} PfDepth;

// The confidence map of a depth image.
typedef struct PfConfidence {
  // The memory layout, a PfConfidenceFormat.
  uint32_t format;
  // The width in pixels, equal to the depth image's.
  uint32_t width;
  // The height in pixels, equal to the depth image's.
  uint32_t height;
  // The plane. Without data there is no map.
  struct PfPlane plane;
} PfConfidence;

// The pinhole model of a camera, in pixels of its image before the image is turned upright. The middle of the first
// pixel is (0, 0).
typedef struct PfIntrinsics {
  // The focal length along x.
  double fx;
  // The focal length along y.
  double fy;
  // The x of the principal point.
  double cx;
  // The y of the principal point.
  double cy;
} PfIntrinsics;

// The intrinsics and the relative pose of the depth camera and the colour camera. A point p of the depth camera (x
// right, y down, z forward) is at R*p + t of the colour camera.
typedef struct PfCameras {
  // The intrinsics of the colour camera.
  struct PfIntrinsics colour;
  // The intrinsics of the depth camera.
  struct PfIntrinsics depth;
  // R, row by row; 1, 0, 0, 0, 1, 0, 0, 0, 1 for cameras with the same orientation.
  double rotation[9];
  // t, in metres.
  double translation_m[3];
} PfCameras;

// A frame: colour, depth, and their relation. Initialize it with its size and zeros:
// `PfFrame frame = {sizeof frame};`.
typedef struct PfFrame {
  // The size of this struct, sizeof(PfFrame). Set it before the call.
  size_t size;
  // The time at which the frame was taken, in nanoseconds of any clock that runs forward.
  uint64_t timestamp_ns;
  // The colour image.
  struct PfColour colour;
  // The depth image.
  struct PfDepth depth;
  // The confidence map of the depth image.
  struct PfConfidence confidence;
  // The clockwise rotation that turns all images upright, a PfRotation.
  uint32_t rotation;
  // Whether left and right are exchanged after the rotation, as front cameras need.
  bool mirrored;
  // The cameras; NULL if depth and colour have the same field of view.
  const struct PfCameras *cameras;
  // The meaning of the colours, a PfRgbEncoding.
  uint32_t rgb_encoding;
} PfFrame;

// The statistics of a session at one moment. Each submitted frame is either processed, failed, refused, dropped or
// pending.
typedef struct PfStatistics {
  // The size of this struct, sizeof(PfStatistics). Set it before the call.
  size_t size;
  // Frames that were submitted.
  uint64_t submitted;
  // Frames that became holograms.
  uint64_t processed;
  // Frames that could not be processed.
  uint64_t failed;
  // Frames that were refused because they were late or the session was closed.
  uint64_t refused;
  // Frames that were dropped.
  uint64_t dropped;
  // Frames that wait or are being processed.
  uint64_t pending;
  // The quality level; 0 is the best.
  uint32_t quality_level;
  // Holograms per second over the last 30.
  double rate_hz;
  // The mean times of the stages over the last 30 holograms.
  struct PfFrameTimes times;
  // The name of the backend that computes the frames, cut if it is longer.
  char backend[64];
  // The reason for using this backend, cut if it is longer.
  char backend_why[256];
} PfStatistics;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the properties of a hologram.
enum PfStatus pf_hologram_info(const struct PfHologram *hologram, struct PfHologramInfo *info);

// Returns the address of the levels of one colour: 0 red, 1 green, 2 blue, or 0 for one laser. Each level is a byte;
// there are no gaps between rows or between colours. The address is valid until pf_hologram_free.
enum PfStatus pf_hologram_levels(const struct PfHologram *hologram,
                                 uint32_t colour,
                                 const uint8_t **levels,
                                 size_t *length);

// Returns the z in mm of the scene point at (x, y) of the picture, for example to focus where the user taps.
// Coordinates run from 0 to 1 from the upper left corner.
enum PfStatus pf_hologram_z_at(const struct PfHologram *hologram, double x, double y, double *z_mm);

// Writes the view of an eye focused at z, in sRGB, into memory: an image of width x height pixels in `layout`,
// PF_LAYOUT_RGB, PF_LAYOUT_RGBA or PF_LAYOUT_BGRA.
enum PfStatus pf_hologram_write_preview(const struct PfHologram *hologram,
                                        double z_mm,
                                        uint32_t width,
                                        uint32_t height,
                                        uint32_t layout,
                                        struct PfMemory memory);

// Creates the view of an eye focused at z at full resolution, as amplitudes where 1 is white. This transforms the
// whole hologram; do not use it for every frame. A z too far away is refused.
enum PfStatus pf_hologram_refocus(const struct PfHologram *hologram, double z_mm, struct PfPlanes **planes);

// Creates the complex field that the levels produce behind the aperture at z, where 0 is the midpoint: the real and
// the imaginary part of each pixel. The carrier is left out. This transforms the whole hologram; do not use it for
// every frame. A z too far away is refused.
enum PfStatus pf_hologram_field(const struct PfHologram *hologram, double z_mm, struct PfPlanes **planes);

// Returns the memory and size of planes.
enum PfStatus pf_planes_info(const struct PfPlanes *planes, struct PfPlanesInfo *info);

// Frees planes.
void pf_planes_free(struct PfPlanes *planes);

// Returns the size of the images of `layout`, a PfLayout, for the modulator.
enum PfStatus pf_hologram_output_size(const struct PfHologram *hologram, uint32_t layout, struct PfOutputSize *size);

// Writes image `number` of those that the modulator's driver takes into memory, at the modulator's resolution. Levels
// with fewer bits than their place use its upper bits; `placement` positions the hologram.
enum PfStatus pf_hologram_write_output(const struct PfHologram *hologram,
                                       const struct PfPlacement *placement,
                                       uint32_t number,
                                       struct PfMemory memory);

// Frees a hologram. Its memory returns to its session.
void pf_hologram_free(struct PfHologram *hologram);

// Sends messages of `level`, a PfLogLevel, and above to `on_log`. With NULL, no messages are sent. A call on another
// thread that is in progress when this returns still uses the previous `context`, so each context must live as long as
// the process.
enum PfStatus pf_set_log_listener(uint32_t level, PfOnLog on_log, void *context);

// Creates a modulator that the command `phasefront devices` lists, such as "holoeye-pluto".
enum PfStatus pf_modulator_named(const char *name, struct PfModulator **modulator);

// Creates a modulator of the text of its file, with keys such as packing and levels_turns.
enum PfStatus pf_modulator_from_toml(const char *toml, struct PfModulator **modulator);

// Creates the target of holograms for a modulator.
enum PfStatus pf_modulator_target(const struct PfModulator *modulator, struct PfTarget **target);

// Returns the size of the images that a modulator's input takes.
enum PfStatus pf_modulator_output_size(const struct PfModulator *modulator, struct PfOutputSize *size);

// Writes image `number` of those that a modulator's input takes of a hologram into memory.
enum PfStatus pf_modulator_write_output(const struct PfModulator *modulator,
                                        const struct PfHologram *hologram,
                                        uint32_t number,
                                        struct PfMemory memory);

// Writes the same image in the pixels of a screen that drives the modulator, PF_LAYOUT_RGBA or PF_LAYOUT_BGRA. The
// red, green and blue of a grey image are its level; images of 16 bits are refused. A pixel has 4 bytes.
enum PfStatus pf_modulator_write_pixels(const struct PfModulator *modulator,
                                        const struct PfHologram *hologram,
                                        uint32_t number,
                                        uint32_t layout,
                                        struct PfMemory memory);

// Frees a modulator. Targets that it created are not affected.
void pf_modulator_free(struct PfModulator *modulator);

// Creates the bundled int8 network of a name, such as "rgbd-8".
enum PfStatus pf_network_built_in(const char *name, struct PfNetwork **network);

// Reads a network from the bytes of an ONNX file.
enum PfStatus pf_network_from_bytes(const uint8_t *onnx, size_t length, struct PfNetwork **network);

// Reads a network from an ONNX file.
enum PfStatus pf_network_from_file(const char *path, struct PfNetwork **network);

// Frees a network. Sessions and options that use it are not affected.
void pf_network_free(struct PfNetwork *network);

// Reads a depth network from the bytes of an ONNX file that holds its own weights. It takes one picture, (1, 3, H, W)
// or (1, H, W, 3), with colours of the scale `colours`, a PfColourScale, and gives one plane: inverse depth, or
// distance if `gives_distance`.
enum PfStatus pf_depth_network_from_bytes(const uint8_t *onnx,
                                          size_t length,
                                          uint32_t colours,
                                          bool gives_distance,
                                          struct PfDepthNetwork **network);

// Frees a depth network. Sessions and options that use it are not affected.
void pf_depth_network_free(struct PfDepthNetwork *network);

// Creates the default options for `target`: holograms at its modulator's resolution by `method`, a PfMethod. `network`
// is the method's network; NULL for the plane sweep, and for PF_METHOD_AUTO with the built-in one.
enum PfStatus pf_options_new(const struct PfTarget *target,
                             uint32_t method,
                             const struct PfNetwork *network,
                             struct PfOptions **options);

// Frees options. Sessions that were created from them are not affected.
void pf_options_free(struct PfOptions *options);

// Removes all quality levels. Push at least one afterwards.
enum PfStatus pf_options_clear_quality_levels(struct PfOptions *options);

// Adds a quality level below the existing ones. A session takes at most 16.
enum PfStatus pf_options_push_quality_level(struct PfOptions *options, const struct PfQualityLevel *quality_level);

// Sets the target rate in frames per second. With 0, a session takes every frame and does not adapt its quality level
// to frame times.
enum PfStatus pf_options_set_target_rate_hz(struct PfOptions *options, double rate_hz);

// Selects double phase of the unchanged field.
enum PfStatus pf_options_set_double_phase(struct PfOptions *options);

// Selects double phase after a small Gaussian blur of `sigma` pixels with `width` taps (AA-DPM); 0.7 and 3 in the
// paper.
enum PfStatus pf_options_set_anti_alias(struct PfOptions *options, float sigma, uint32_t width);

// Selects double phase after a filter that removes high diagonal frequencies (BL-DPM). `k` is the bound of
// |tan(pi*fx)*tan(pi*fy)|; 1 in the paper.
enum PfStatus pf_options_set_band_limit(struct PfOptions *options, float k);

// Selects double phase after a pre-filter network (DDPM), which was trained together with the hologram network for the
// offset of the display.
enum PfStatus pf_options_set_deep(struct PfOptions *options, const struct PfNetwork *prefilter);

// Sets the network that estimates the depth of frames without depth. A live session runs it on its own thread, at the
// network's own rate; other sessions run it for each frame.
enum PfStatus pf_options_set_depth_network(struct PfOptions *options, const struct PfDepthNetwork *network);

// Maps an amplitude near the frame's largest to full light. It changes smoothly from frame to frame. This is the
// default.
enum PfStatus pf_options_set_brightness_smoothed(struct PfOptions *options);

// Maps the amplitude `scale` to full light. Larger amplitudes are clipped.
enum PfStatus pf_options_set_brightness_fixed(struct PfOptions *options, float scale);

// Maps the frame's largest amplitude to full light.
enum PfStatus pf_options_set_brightness_frame_max(struct PfOptions *options);

// Sets the share of full light, 0 to 1, below which phases are drawn to 0, which reduces coloured speckle in dark
// areas. The encoding's default is 0.4, and 0 with a pre-filter.
enum PfStatus pf_options_set_dark_threshold(struct PfOptions *options, float threshold);

// Sets the number of correction steps, 0 to 8. Each step draws the displayed image toward the wanted field. The
// encoding's default is 1, and 0 with a pre-filter.
enum PfStatus pf_options_set_local_steps(struct PfOptions *options, uint32_t steps);

// Sets the number of correction steps at the midpoint, 0 to 100. Each step costs four transforms per colour: 3 suit
// stills; 1 suits video, where each frame continues from the previous one.
enum PfStatus pf_options_set_midpoint_steps(struct PfOptions *options, uint32_t steps);

// Sets natural focus: what is out of focus is soft, as in the world. `steps` follow the method, 0 to 1000, each of two
// transforms for each plane and colour; 30 bring most of the gain in stills. Without steps, as live frames need it,
// PF_METHOD_AUTO without a network takes the built-in network for natural focus. The default is coherent focus: what
// is out of focus has halos and rings, as a laser shows it.
enum PfStatus pf_options_set_natural_focus(struct PfOptions *options, uint32_t steps);

// Sets the distances, in metres, that map to the ends of the volume. The default is the 1st and 99th percentile of the
// readings.
enum PfStatus pf_options_set_depth_range(struct PfOptions *options, float near_m, float far_m);

// Sets the confidence, in 0 to 1, below which readings are ignored. ARKit's "low" is 0, "medium" 0.5, "high" 1.
enum PfStatus pf_options_set_least_confidence(struct PfOptions *options, float confidence);

// Sets whether what stands still in a video keeps its wave on the CPU: a frame computes only the parts where colour or
// depth have changed by more than a camera's noise. The default is true.
enum PfStatus pf_options_set_keep_standing(struct PfOptions *options, bool keep);

// Sets the number of threads to compute with, 1 to 256. The default is as many as the device has.
enum PfStatus pf_options_set_threads(struct PfOptions *options, uint32_t threads);

// Sets the maximum number of pixels of a quality level and of the modulator; 8192x4096 by default. The memory of a
// session is a multiple of it.
enum PfStatus pf_options_set_most_pixels(struct PfOptions *options, uint64_t pixels);

// Sets the backend that computes frames, a PfBackend.
enum PfStatus pf_options_set_backend(struct PfOptions *options, uint32_t backend);

// Creates a session that runs in `mode`, a PfRunningMode. A live session needs a `listener`, which is copied; for
// other sessions it is NULL.
enum PfStatus pf_session_new(const struct PfOptions *options,
                             uint32_t mode,
                             const struct PfListener *listener,
                             struct PfSession **session);

// Closes and frees a session: it accepts no more frames and waits until the listener has received all events. A call
// from a listener of any session, or from a log handler while a session computes, does not wait; on_closed then
// reports that the listener has received all events. The session's holograms stay valid. This must be the last call
// with the session, and no other call with it may be in progress.
void pf_session_free(struct PfSession *session);

// Creates the hologram of a frame, in an image or a video session.
enum PfStatus pf_session_process(const struct PfSession *session,
                                 const struct PfFrame *frame,
                                 struct PfHologram **hologram);

// Submits a frame to a live session, which copies it, without waiting for its hologram. `dropped` receives the reason
// if the frame is dropped at once, which the listener receives too.
enum PfStatus pf_session_submit(const struct PfSession *session,
                                const struct PfFrame *frame,
                                enum PfDropReason *dropped);

// Runs an empty frame through the stages and waits for it, so that the first real frame is as fast as later ones.
enum PfStatus pf_session_warm_up(const struct PfSession *session);

// Forgets all previous frames, including one that is being processed. The next frame may have any timestamp.
enum PfStatus pf_session_reset(const struct PfSession *session);

// Accepts no frames until pf_session_resume.
enum PfStatus pf_session_pause(const struct PfSession *session);

// Accepts frames again.
enum PfStatus pf_session_resume(const struct PfSession *session);

// Sets the thermal state of the device, a PfThermal.
enum PfStatus pf_session_set_thermal(const struct PfSession *session, uint32_t thermal);

// Keeps the session at a quality level; 0 is the best.
enum PfStatus pf_session_fix_quality_level(const struct PfSession *session, uint32_t quality_level);

// Lets the session change its quality level: it lowers the level if frames take longer than the target rate allows or
// the device is hot, and raises it if there is time left.
enum PfStatus pf_session_step_by_itself(const struct PfSession *session);

// Returns the statistics of a session. Never waits for a frame.
enum PfStatus pf_session_statistics(const struct PfSession *session, struct PfStatistics *statistics);

// Returns one line about the last call of this thread that did not return PF_STATUS_OK; an empty line if there was
// none. It is valid until the next such call of this thread.
const char *pf_last_error(void);

// Returns the version of the library, such as "0.1.0". It is always valid.
const char *pf_version(void);

// Returns the third-party notices of the library as Markdown in UTF-8. An app must show them with its own notices.
// They are always valid.
const char *pf_third_party_notices(void);

// Creates the target for a display in TOML, such as "width = 1920\npitch_um = 8.0", whose levels are equal steps of
// phase. Missing keys have default values, so "" is the default display.
enum PfStatus pf_target_from_toml(const char *toml, struct PfTarget **target);

// Creates the target for a display in TOML whose modulator was calibrated as a whole. There are 256 levels; the level
// at i displays the phase 2*pi*i/256.
enum PfStatus pf_target_with_look_up_table(const char *toml,
                                           const uint8_t *levels,
                                           size_t count,
                                           struct PfTarget **target);

// Reads a target from the bytes of a calibration file, as `phasefront calibrate pack` writes it.
enum PfStatus pf_target_from_bytes(const uint8_t *file, size_t length, struct PfTarget **target);

// Reads a target from a calibration file.
enum PfStatus pf_target_from_file(const char *path, struct PfTarget **target);

// Returns the number of pixels of the modulator along x and y.
enum PfStatus pf_target_size(const struct PfTarget *target, uint32_t *width, uint32_t *height);

// Frees a target. Sessions and options that were created for it are not affected.
void pf_target_free(struct PfTarget *target);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PHASEFRONT_H */
