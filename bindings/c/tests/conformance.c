// The conformance suite, run from C: `conformance SUITE MODELS LEVELS` compares the levels of all frames with the file
// that Rust left, bit for bit.
#include "phasefront.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void ok(PfStatus status, const char *what) {
    if (status != PF_STATUS_OK) {
        fprintf(stderr, "%s: %s\n", what, pf_last_error());
        exit(1);
    }
}

static uint8_t *read_file(const char *folder, const char *name, size_t *length) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        perror(path);
        exit(1);
    }
    fseek(file, 0, SEEK_END);
    *length = (size_t)ftell(file);
    rewind(file);
    uint8_t *bytes = malloc(*length + 1);
    if (fread(bytes, 1, *length, file) != *length) {
        perror(path);
        exit(1);
    }
    bytes[*length] = 0;
    fclose(file);
    return bytes;
}

static const cJSON *of(const cJSON *object, const char *key) { return cJSON_GetObjectItemCaseSensitive(object, key); }
static const char *text(const cJSON *object, const char *key) { return cJSON_GetStringValue(of(object, key)); }
static double number(const cJSON *object, const char *key) { return cJSON_GetNumberValue(of(object, key)); }
static bool is_null(const cJSON *object, const char *key) { return cJSON_IsNull(of(object, key)); }

// The place of `name` among `count` names.
static uint32_t pick(const char *name, const char *const *names, uint32_t count) {
    for (uint32_t i = 0; i < count; i++)
        if (strcmp(name, names[i]) == 0) return i;
    fprintf(stderr, "%s is not known\n", name);
    exit(1);
}

static const char *const COLOURS[] = {"rgba", "bgra", "rgb", "nv12", "yuv420"};
static const char *const MATRICES[] = {"bt601", "bt709"};
static const char *const ENCODINGS[] = {"srgb", "display-p3", "bt2020", "bt2020-hlg", "bt2020-pq", "amplitude"};
static const char *const DEPTHS[] = {"metres-f32",      "metres-f16",      "disparity-f32", "disparity-f16",
                                     "millimetres-u16", "android-depth16", "normalized-u8", "normalized-u16",
                                     "relative-f32",    "relative-f16"};
static const char *const CONFIDENCES[] = {"low-medium-high", "u8"};
static const char *const MODES[] = {"image", "video"};

static PfPlane plane(const cJSON *json, const uint8_t *memory) {
    return (PfPlane){.data = memory + (size_t)number(json, "offset"),
                     .length = (size_t)number(json, "length"),
                     .row_stride = (uint32_t)number(json, "row_stride"),
                     .pixel_stride = (uint32_t)number(json, "pixel_stride")};
}

static PfFrame frame_of(const cJSON *json, const uint8_t *memory) {
    const cJSON *colour = of(json, "colour");
    PfFrame frame = {.size = sizeof frame,
                     .timestamp_ns = (uint64_t)number(json, "timestamp_ns"),
                     .colour = {.format = pick(text(colour, "format"), COLOURS, 5),
                                .width = (uint32_t)number(colour, "width"),
                                .height = (uint32_t)number(colour, "height"),
                                .matrix = pick(text(colour, "matrix"), MATRICES, 2),
                                .video_range = cJSON_IsTrue(of(colour, "video_range"))},
                     .rotation = (uint32_t)number(json, "rotation") / 90,
                     .mirrored = cJSON_IsTrue(of(json, "mirrored")),
                     .rgb_encoding = pick(text(colour, "encoding"), ENCODINGS, 6)};
    int planes = cJSON_GetArraySize(of(colour, "planes"));
    for (int i = 0; i < planes; i++) frame.colour.planes[i] = plane(cJSON_GetArrayItem(of(colour, "planes"), i), memory);
    if (!is_null(json, "depth")) {
        const cJSON *depth = of(json, "depth");
        frame.depth = (PfDepth){.format = pick(text(depth, "format"), DEPTHS, 10),
                                .width = (uint32_t)number(depth, "width"),
                                .height = (uint32_t)number(depth, "height"),
                                .plane = plane(of(depth, "plane"), memory)};
    }
    if (!is_null(json, "confidence")) {
        const cJSON *confidence = of(json, "confidence");
        frame.confidence = (PfConfidence){.format = pick(text(confidence, "format"), CONFIDENCES, 2),
                                          .width = (uint32_t)number(confidence, "width"),
                                          .height = (uint32_t)number(confidence, "height"),
                                          .plane = plane(of(confidence, "plane"), memory)};
    }
    return frame;
}

static PfNetwork *network(const char *models, const char *file) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", models, file);
    PfNetwork *network = NULL;
    ok(pf_network_from_file(path, &network), path);
    return network;
}

static PfTarget *target_of(const cJSON *json, const char *suite) {
    PfTarget *target = NULL;
    if (!is_null(json, "calibration")) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", suite, text(json, "calibration"));
        ok(pf_target_from_file(path, &target), path);
    } else if (!is_null(json, "lut")) {
        uint8_t levels[256];
        for (int i = 0; i < 256; i++) levels[i] = (uint8_t)cJSON_GetNumberValue(cJSON_GetArrayItem(of(json, "lut"), i));
        ok(pf_target_with_look_up_table(text(json, "display"), levels, sizeof levels, &target), "look-up table");
    } else {
        ok(pf_target_from_toml(text(json, "display"), &target), "display");
    }
    return target;
}

static void encode(PfOptions *options, const char *encoding, const char *models) {
    if (strcmp(encoding, "double-phase") == 0) {
        ok(pf_options_set_double_phase(options), encoding);
    } else if (strcmp(encoding, "anti-alias") == 0) {
        ok(pf_options_set_anti_alias(options, 0.7f, 3), encoding);
    } else if (strcmp(encoding, "band-limit") == 0) {
        ok(pf_options_set_band_limit(options, 1.0f), encoding);
    } else {
        PfNetwork *prefilter = network(models, encoding);
        ok(pf_options_set_deep(options, prefilter), encoding);
        pf_network_free(prefilter);
    }
}

static PfOptions *options_of(const cJSON *json, const char *suite, const char *models) {
    PfTarget *target = target_of(json, suite);
    const char *method = text(json, "method");
    PfNetwork *trained = NULL;
    uint32_t number_of_method = PF_METHOD_TRAINED;
    if (strcmp(method, "default") == 0) {
        number_of_method = PF_METHOD_AUTO;
    } else if (strcmp(method, "sweep") == 0) {
        number_of_method = PF_METHOD_SWEEP;
    } else if (strcmp(method, "network") == 0 || strcmp(method, "auto") == 0) {
        ok(pf_network_built_in("rgbd-8", &trained), "rgbd-8");
        if (strcmp(method, "network") != 0) number_of_method = PF_METHOD_AUTO;
    } else {
        trained = network(models, method);
    }
    PfOptions *options = NULL;
    ok(pf_options_new(target, number_of_method, trained, &options), "options");
    pf_network_free(trained);
    pf_target_free(target);
    encode(options, text(json, "encoding"), models);
    if (!is_null(json, "brightness"))
        ok(pf_options_set_brightness_fixed(options, (float)number(json, "brightness")), "brightness");
    if (!is_null(json, "range")) {
        float near_m = (float)cJSON_GetNumberValue(cJSON_GetArrayItem(of(json, "range"), 0));
        float far_m = (float)cJSON_GetNumberValue(cJSON_GetArrayItem(of(json, "range"), 1));
        ok(pf_options_set_depth_range(options, near_m, far_m), "range");
    }
    if (!is_null(json, "focus_steps"))
        ok(pf_options_set_natural_focus(options, (uint32_t)number(json, "focus_steps")), "focus");
    if (!is_null(json, "depth_network")) {
        size_t length = 0;
        uint8_t *onnx = read_file(suite, text(json, "depth_network"), &length);
        PfDepthNetwork *depth_network = NULL;
        ok(pf_depth_network_from_bytes(onnx, length, PF_COLOUR_SCALE_UNIT, false, &depth_network), "depth network");
        ok(pf_options_set_depth_network(options, depth_network), "depth network");
        pf_depth_network_free(depth_network);
        free(onnx);
    }
    return options;
}

// A part of what Rust left, read from its beginning to its end.
typedef struct {
    const uint8_t *next;
    size_t left;
} Expected;

static void compare(const char *name, const void *got, size_t length, Expected *expected) {
    if (expected->left < length || memcmp(got, expected->next, length) != 0) {
        fprintf(stderr, "%s: not the bits that Rust has\n", name);
        exit(1);
    }
    expected->next += length;
    expected->left -= length;
}

static void compare_planes(const char *name, PfPlanes *planes, Expected *expected) {
    PfPlanesInfo info;
    ok(pf_planes_info(planes, &info), name);
    compare(name, info.data, sizeof(float) * info.length, expected);
    pf_planes_free(planes);
}

// Runs a case and compares its levels, and what is seen of them, with what is expected.
static void run(const cJSON *json, const char *suite, const char *models, const uint8_t *memory, Expected *expected,
                Expected *seen) {
    const char *name = text(json, "name");
    PfOptions *options = options_of(json, suite, models);
    PfSession *session = NULL;
    ok(pf_session_new(options, pick(text(json, "mode"), MODES, 2), NULL, &session), name);
    pf_options_free(options);
    const cJSON *one = NULL;
    cJSON_ArrayForEach(one, of(json, "frames")) {
        PfFrame frame = frame_of(one, memory);
        PfHologram *hologram = NULL;
        ok(pf_session_process(session, &frame, &hologram), name);
        PfHologramInfo info = {.size = sizeof info};
        ok(pf_hologram_info(hologram, &info), "info");
        if (info.rgb_encoding != frame.rgb_encoding) {
            fprintf(stderr, "%s: the encoding of the colours is %u\n", name, info.rgb_encoding);
            exit(1);
        }
        for (uint32_t colour = 0; colour < info.colours; colour++) {
            const uint8_t *levels = NULL;
            size_t length = 0;
            ok(pf_hologram_levels(hologram, colour, &levels, &length), "levels");
            compare(name, levels, length, expected);
        }
        PfPlanes *planes = NULL;
        ok(pf_hologram_refocus(hologram, 1.5, &planes), name);
        compare_planes(name, planes, seen);
        ok(pf_hologram_field(hologram, -1.0, &planes), name);
        compare_planes(name, planes, seen);
        pf_hologram_free(hologram);
    }
    pf_session_free(session);
}

int main(int count, char **arguments) {
    if (count != 4) {
        fprintf(stderr, "usage: conformance SUITE MODELS LEVELS\n");
        return 2;
    }
    const char *suite = arguments[1];
    size_t length = 0, memory_length = 0;
    Expected expected = {0}, seen = {0};
    uint8_t *cases = read_file(suite, "cases.json", &length);
    uint8_t *memory = read_file(suite, "frames.bin", &memory_length);
    uint8_t *levels = read_file(arguments[3], "levels.bin", &expected.left);
    uint8_t *views = read_file(arguments[3], "seen.bin", &seen.left);
    expected.next = levels;
    seen.next = views;
    size_t all = expected.left;
    cJSON *json = cJSON_Parse((const char *)cases);
    int ran = 0;
    const cJSON *one = NULL;
    cJSON_ArrayForEach(one, of(json, "cases")) {
        run(one, suite, arguments[2], memory, &expected, &seen);
        ran++;
    }
    if (ran == 0 || expected.left > 0 || seen.left > 0) {
        fprintf(stderr, "%d cases leave %zu levels and %zu bytes of views\n", ran, expected.left, seen.left);
        return 1;
    }
    printf("%d cases, %zu levels: the bits that Rust has\n", ran, all);
    cJSON_Delete(json);
    free(cases);
    free(memory);
    free(levels);
    free(views);
    return 0;
}
