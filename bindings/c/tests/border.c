// What C gets wrong is an error of one line, never a crash; what a live session's listener hears.
#include "phasefront.h"

#include <assert.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// `status` is `wanted`, and the line about it has `word`.
static void refused(PfStatus status, PfStatus wanted, const char *word) {
    const char *line = pf_last_error();
    if (status != wanted || strstr(line, word) == NULL || strchr(line, '\n') != NULL) {
        fprintf(stderr, "%d, not %d: %s (not about %s)\n", status, wanted, line, word);
        exit(1);
    }
}

static void ok(PfStatus status) {
    if (status != PF_STATUS_OK) {
        fprintf(stderr, "%s\n", pf_last_error());
        exit(1);
    }
}

enum { WIDTH = 48, HEIGHT = 36 };
static uint8_t colour[WIDTH * HEIGHT * 3];
static uint8_t depth[WIDTH * HEIGHT];

static PfFrame frame_at(uint64_t timestamp_ns) {
    return (PfFrame){.size = sizeof(PfFrame),
                     .timestamp_ns = timestamp_ns,
                     .colour = {.format = PF_COLOUR_FORMAT_RGB,
                                .width = WIDTH,
                                .height = HEIGHT,
                                .planes = {{colour, sizeof colour, WIDTH * 3, 3}}},
                     .depth = {.format = PF_DEPTH_FORMAT_NORMALIZED_U8,
                               .width = WIDTH,
                               .height = HEIGHT,
                               .plane = {depth, sizeof depth, WIDTH, 1}}};
}

typedef struct Heard {
    int holograms, dropped, failed, closed;
} Heard;

static void on_processed(void *context, PfHologram *hologram) {
    PfHologramInfo info = {.size = sizeof info};
    ok(pf_hologram_info(hologram, &info));
    assert(info.width == WIDTH && info.height == HEIGHT);
    pf_hologram_free(hologram);
    ((Heard *)context)->holograms++;
}
static void on_dropped(void *context, uint64_t timestamp_ns, PfDropReason reason) {
    (void)timestamp_ns;
    assert(reason != PF_DROP_REASON_NOT);
    ((Heard *)context)->dropped++;
}
static void on_failed(void *context, uint64_t timestamp_ns, const char *message) {
    (void)timestamp_ns;
    fprintf(stderr, "%s\n", message);
    ((Heard *)context)->failed++;
}

static void on_closed(void *context) {
    ((Heard *)context)->closed++;
}

static int logged = 0;
static void on_log(void *context, PfLogLevel level, const char *message) {
    assert(context == &logged && level <= PF_LOG_LEVEL_DEBUG && message[0] != 0);
    logged++;
}

static void mistakes(PfTarget *target, PfOptions *options) {
    PfTarget *no_target = NULL;
    PfNetwork *no_network = NULL;
    PfSession *no_session = NULL;
    refused(pf_target_from_toml("width = 0", &no_target), PF_STATUS_DISPLAY, "width");
    refused(pf_target_from_toml(NULL, &no_target), PF_STATUS_SETTING, "toml is NULL");
    refused(pf_target_from_toml("\xff\xfe", &no_target), PF_STATUS_SETTING, "UTF-8");
    refused(pf_target_from_toml("", NULL), PF_STATUS_SETTING, "target is NULL");
    refused(pf_target_from_file("/none/such", &no_target), PF_STATUS_FILE, "/none/such");
    refused(pf_target_from_bytes((const uint8_t *)"no", 2, &no_target), PF_STATUS_SETTING, "PFCALIB1");
    refused(pf_target_with_look_up_table("", colour, 3, &no_target), PF_STATUS_SETTING, "256");
    refused(pf_network_built_in("rgbd-9", &no_network), PF_STATUS_NETWORK, "rgbd-9");
    refused(pf_network_from_bytes(NULL, 5, &no_network), PF_STATUS_SETTING, "onnx is NULL");
    refused(pf_options_new(target, 7, NULL, &options), PF_STATUS_SETTING, "method is 7");
    refused(pf_options_new(target, PF_METHOD_TRAINED, NULL, &options), PF_STATUS_SETTING, "network is NULL");
    refused(pf_options_set_backend(options, 2), PF_STATUS_SETTING, "backend is 2");
    PfQualityLevel quality_level = {.size = sizeof quality_level, .method = PF_METHOD_TRAINED, .width = 16, .height = 16, .local_steps = -1, .midpoint_steps = -1};
    refused(pf_options_push_quality_level(options, &quality_level), PF_STATUS_SETTING, "network is NULL");
    refused(pf_session_new(options, 3, NULL, &no_session), PF_STATUS_SETTING, "mode is 3");
    refused(pf_session_new(options, PF_RUNNING_MODE_LIVE, NULL, &no_session), PF_STATUS_SESSION, "listener");
    PfHologram *hologram = NULL;
    refused(pf_session_process(NULL, NULL, &hologram), PF_STATUS_SETTING, "NULL");
    refused(pf_hologram_z_at(NULL, 0, 0, &(double){0}), PF_STATUS_SETTING, "hologram is NULL");
    assert(no_target == NULL && no_network == NULL && no_session == NULL && hologram == NULL);
    pf_target_free(NULL);
    pf_network_free(NULL);
    pf_options_free(NULL);
    pf_session_free(NULL);
    pf_hologram_free(NULL);
    pf_modulator_free(NULL);
}

static void stills(const PfOptions *options) {
    PfSession *session = NULL;
    ok(pf_session_new(options, PF_RUNNING_MODE_IMAGE, NULL, &session));
    PfFrame frame = frame_at(1);
    PfHologram *hologram = NULL;
    frame.colour.planes[0].length = 10;
    refused(pf_session_process(session, &frame, &hologram), PF_STATUS_FRAME, "10 bytes");
    frame = frame_at(1);
    frame.depth.format = 99;
    refused(pf_session_process(session, &frame, &hologram), PF_STATUS_SETTING, "depth.format is 99");
    frame = frame_at(1);
    frame.colour.planes[1] = frame.colour.planes[0];
    refused(pf_session_process(session, &frame, &hologram), PF_STATUS_FRAME, "plane");
    frame = frame_at(1);
    ok(pf_session_process(session, &frame, &hologram));
    // The hologram outlives its session.
    pf_session_free(session);
    double z_mm = 0;
    ok(pf_hologram_z_at(hologram, 0.5, 0.5, &z_mm));
    static uint8_t bytes[2 * WIDTH * HEIGHT];
    // Rows of a preview with gaps, which stay as they are.
    memset(bytes, 7, sizeof bytes);
    PfMemory memory = {bytes, sizeof bytes, 24 * 4 + 5};
    ok(pf_hologram_write_preview(hologram, z_mm, 24, 18, PF_LAYOUT_BGRA, memory));
    assert(bytes[3] == 255 && bytes[24 * 4] == 7 && bytes[24 * 4 + 5 + 3] == 255);
    refused(pf_hologram_write_preview(hologram, z_mm, 24, 18, PF_LAYOUT_GREY, memory), PF_STATUS_SETTING, "Grey");
    memory.row_stride = 24 * 4 - 1;
    refused(pf_hologram_write_preview(hologram, z_mm, 24, 18, PF_LAYOUT_BGRA, memory), PF_STATUS_SETTING, "18 rows");
    PfOutputSize size;
    ok(pf_hologram_output_size(hologram, PF_LAYOUT_GREY16, &size));
    assert(size.width == WIDTH && size.height == HEIGHT && size.pixel_bytes == 2 && size.images == 3);
    PfPlacement placement = {.layout = PF_LAYOUT_GREY, .flip_x = true};
    memory.row_stride = WIDTH;
    ok(pf_hologram_write_output(hologram, &placement, 2, memory));
    const uint8_t *blue = NULL;
    size_t length = 0;
    ok(pf_hologram_levels(hologram, 2, &blue, &length));
    assert(length == WIDTH * HEIGHT);
    for (int x = 0; x < WIDTH; x++) assert(bytes[x] == blue[WIDTH - 1 - x]);
    refused(pf_hologram_write_output(hologram, &placement, 3, memory), PF_STATUS_SETTING, "no image 3");
    refused(pf_hologram_write_output(hologram, &placement, 2, (PfMemory){NULL, 9, 9}), PF_STATUS_SETTING, "no memory");
    placement.layout = PF_LAYOUT_GREY16;
    memory.row_stride = 2 * WIDTH;
    ok(pf_hologram_write_output(hologram, &placement, 2, memory));
    for (int x = 0; x < WIDTH; x++) assert(bytes[2 * x] == 0 && bytes[2 * x + 1] == blue[WIDTH - 1 - x]);
    refused(pf_hologram_levels(hologram, 3, &blue, &length), PF_STATUS_SETTING, "no plane 3");
    PfPlanes *planes = NULL;
    PfPlanesInfo numbers;
    refused(pf_hologram_refocus(hologram, 1e5, &planes), PF_STATUS_SETTING, "a shorter distance");
    refused(pf_hologram_field(NULL, 0, &planes), PF_STATUS_SETTING, "hologram");
    ok(pf_hologram_field(hologram, 0, &planes));
    ok(pf_planes_info(planes, &numbers));
    assert(numbers.width == WIDTH && numbers.height == HEIGHT && numbers.colours == 3 && numbers.numbers == 2);
    assert(numbers.length == 3 * 2 * WIDTH * HEIGHT && numbers.data[0] == numbers.data[0]);
    pf_planes_free(planes);
    pf_planes_free(NULL);
    pf_hologram_free(hologram);
}

static void modulators(void) {
    PfModulator *modulator = NULL;
    refused(pf_modulator_named("pluto", &modulator), PF_STATUS_DISPLAY, "holoeye-pluto");
    refused(pf_modulator_from_toml("width = ", &modulator), PF_STATUS_DISPLAY, "expected");
    assert(modulator == NULL);
    PfTarget *target = NULL;
    PfOptions *options = NULL;
    PfSession *session = NULL;
    PfHologram *hologram = NULL;
    ok(pf_modulator_named("ti-plm-p47", &modulator));
    ok(pf_modulator_target(modulator, &target));
    ok(pf_options_new(target, PF_METHOD_SWEEP, NULL, &options));
    ok(pf_session_new(options, PF_RUNNING_MODE_IMAGE, NULL, &session));
    PfFrame frame = frame_at(1);
    ok(pf_session_process(session, &frame, &hologram));
    PfOutputSize size;
    ok(pf_modulator_output_size(modulator, &size));
    assert(size.width == 1920 && size.height == 1080 && size.pixel_bytes == 3 && size.images == 1);
    PfMemory memory = {calloc(1920 * 1080, 3), 1920 * 1080 * 3, 1920 * 3};
    ok(pf_modulator_write_output(modulator, hologram, 0, memory));
    size_t set = 0;
    for (size_t at = 0; at < memory.length; at++) set += memory.data[at] != 0;
    assert(set > memory.length / 10);
    refused(pf_modulator_write_output(modulator, hologram, 1, memory), PF_STATUS_SETTING, "no image 1");
    PfMemory pixels = {calloc(1920 * 1080, 4), 1920 * 1080 * 4, 1920 * 4};
    ok(pf_modulator_write_pixels(modulator, hologram, 0, PF_LAYOUT_BGRA, pixels));
    for (size_t at = 0; at < 1920 * 1080; at++) {
        for (size_t c = 0; c < 3; c++) assert(pixels.data[4 * at + c] == memory.data[3 * at + 2 - c]);
        assert(pixels.data[4 * at + 3] == 255);
    }
    refused(pf_modulator_write_pixels(modulator, hologram, 0, PF_LAYOUT_BGRA, memory), PF_STATUS_SETTING, "1080 rows");
    refused(pf_modulator_write_pixels(modulator, hologram, 0, PF_LAYOUT_GREY, pixels), PF_STATUS_SETTING, "Rgba or Bgra");
    refused(pf_modulator_write_pixels(modulator, hologram, 0, 9, pixels), PF_STATUS_SETTING, "layout is 9");
    free(pixels.data);
    free(memory.data);
    pf_hologram_free(hologram);
    pf_session_free(session);
    pf_options_free(options);
    pf_target_free(target);
    pf_modulator_free(modulator);
}

static void live(const PfOptions *options) {
    Heard heard = {0};
    PfListener listener = {sizeof listener, &heard, on_processed, on_dropped, on_failed, NULL, on_closed};
    PfSession *session = NULL;
    // A struct of another version's size is refused.
    PfListener other = {.size = sizeof other + 8};
    refused(pf_session_new(options, PF_RUNNING_MODE_LIVE, &other, &session), PF_STATUS_SETTING, "sizeof(PfListener)");
    refused(pf_session_new(options, PF_RUNNING_MODE_IMAGE, &listener, &session), PF_STATUS_SESSION, "listener");
    assert(heard.closed == 0);
    ok(pf_session_new(options, PF_RUNNING_MODE_LIVE, &listener, &session));
    ok(pf_session_warm_up(session));
    for (uint64_t i = 1; i <= 20; i++) {
        PfFrame frame = frame_at(i * 1000000);
        PfDropReason dropped;
        ok(pf_session_submit(session, &frame, &dropped));
    }
    PfFrame late = frame_at(5);
    PfDropReason dropped;
    refused(pf_session_submit(session, &late, &dropped), PF_STATUS_TIMESTAMP, "5");
    ok(pf_session_set_thermal(session, PF_THERMAL_FAIR));
    refused(pf_session_set_thermal(session, 9), PF_STATUS_SETTING, "thermal is 9");
    refused(pf_session_fix_quality_level(session, 9), PF_STATUS_SETTING, "no quality level 9");
    PfStatistics statistics = {0};
    refused(pf_session_statistics(session, &statistics), PF_STATUS_SETTING, "statistics->size is 0");
    statistics.size = sizeof statistics;
    do ok(pf_session_statistics(session, &statistics));
    while (statistics.pending > 0);
    ok(pf_session_pause(session));
    ok(pf_session_resume(session));
    assert(statistics.submitted >= 20 && statistics.refused == 1 && statistics.backend[0] != 0);
    pf_session_free(session);
    assert(heard.holograms >= 1 && heard.holograms + heard.dropped == 20 && heard.failed == 0 && heard.closed == 1);
}

// A session that its listener ends: pf_session_free does not wait there, so the last call frees the context.
typedef struct {
    PfSession *session;
    atomic_int *stage; // 1: the first hologram is there; 2: the other frames are submitted; 3: freed; 4: closed
    int told;
} Ending;
static void end_processed(void *context, PfHologram *hologram) {
    Ending *ending = context;
    pf_hologram_free(hologram);
    atomic_store(ending->stage, 1);
    while (atomic_load(ending->stage) != 2) {}
    pf_session_free(ending->session);
    atomic_store(ending->stage, 3);
    ending->told++;
}
static void end_dropped(void *context, uint64_t timestamp_ns, PfDropReason reason) {
    Ending *ending = context;
    (void)timestamp_ns;
    assert(atomic_load(ending->stage) == 3 && reason != PF_DROP_REASON_NOT);
    ending->told++;
}
static void end_closed(void *context) {
    Ending *ending = context;
    atomic_int *stage = ending->stage;
    assert(atomic_load(stage) == 3 && ending->told == 5);
    free(ending);
    atomic_store(stage, 4);
}

static void ended_by_its_listener(const PfOptions *options) {
    atomic_int stage = 0;
    Ending *ending = calloc(1, sizeof *ending);
    assert(ending != NULL);
    ending->stage = &stage;
    PfListener listener = {.size = sizeof listener, .context = ending, .on_processed = end_processed, .on_dropped = end_dropped, .on_closed = end_closed};
    PfSession *session = NULL;
    ok(pf_session_new(options, PF_RUNNING_MODE_LIVE, &listener, &session));
    ending->session = session;
    for (uint64_t i = 1; i <= 5; i++) {
        PfFrame frame = frame_at(i);
        PfDropReason dropped;
        ok(pf_session_submit(session, &frame, &dropped));
        while (atomic_load(&stage) == 0) {}
    }
    atomic_store(&stage, 2);
    while (atomic_load(&stage) != 4) {}
}

int main(void) {
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        depth[i] = (uint8_t)(i % 251);
        for (int c = 0; c < 3; c++) colour[3 * i + c] = (uint8_t)(i * (c + 3) % 256);
    }
    assert(strcmp(pf_version(), PHASEFRONT_VERSION) == 0);
    assert(strncmp(pf_third_party_notices(), "# Third-party notices", 21) == 0);
    ok(pf_set_log_listener(PF_LOG_LEVEL_INFO, on_log, &logged));
    PfTarget *target = NULL;
    ok(pf_target_from_toml("width = 48\nheight = 36", &target));
    uint32_t width = 0, height = 0;
    ok(pf_target_size(target, &width, &height));
    assert(width == WIDTH && height == HEIGHT);
    PfOptions *options = NULL;
    ok(pf_options_new(target, PF_METHOD_AUTO, NULL, &options));
    mistakes(target, options);
    pf_target_free(target);
    stills(options);
    modulators();
    live(options);
    for (int i = 0; i < 4; i++) ended_by_its_listener(options);
    pf_options_free(options);
    assert(logged > 0);
    ok(pf_set_log_listener(PF_LOG_LEVEL_INFO, NULL, NULL));
    puts("mistakes are told, stills and live streams end");
    return 0;
}
