// The hologram of an RGB-D image: `hologram COLOUR.png DEPTH.png HOLOGRAM.png`; depth is normalized, 0 nearest.
#include <phasefront.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void ok(PfStatus status) {
    if (status == PF_STATUS_OK) return;
    fprintf(stderr, "%s\n", pf_last_error());
    exit(1);
}

static uint8_t *read_png(const char *path, png_uint_32 format, png_image *image) {
    memset(image, 0, sizeof *image);
    image->version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(image, path)) {
        fprintf(stderr, "%s: %s\n", path, image->message);
        exit(1);
    }
    image->format = format;
    uint8_t *pixels = malloc(PNG_IMAGE_SIZE(*image));
    if (!png_image_finish_read(image, NULL, pixels, 0, NULL)) {
        fprintf(stderr, "%s: %s\n", path, image->message);
        exit(1);
    }
    return pixels;
}

int main(int count, char **arguments) {
    if (count != 4) {
        fprintf(stderr, "usage: hologram COLOUR.png DEPTH.png HOLOGRAM.png\n");
        return 2;
    }
    png_image colour, depth;
    uint8_t *colours = read_png(arguments[1], PNG_FORMAT_RGB, &colour);
    uint8_t *depths = read_png(arguments[2], PNG_FORMAT_GRAY, &depth);

    char display[64];
    snprintf(display, sizeof display, "width = %u\nheight = %u", colour.width, colour.height);
    PfTarget *target = NULL;
    PfOptions *options = NULL;
    PfSession *session = NULL;
    ok(pf_target_from_toml(display, &target));
    ok(pf_options_new(target, PF_METHOD_AUTO, NULL, &options));
    ok(pf_session_new(options, PF_RUNNING_MODE_IMAGE, NULL, &session));

    PfFrame frame = {.size = sizeof frame,
                     .colour = {.format = PF_COLOUR_FORMAT_RGB,
                                .width = colour.width,
                                .height = colour.height,
                                .planes = {{colours, PNG_IMAGE_SIZE(colour), colour.width * 3, 3}}},
                     .depth = {.format = PF_DEPTH_FORMAT_NORMALIZED_U8,
                               .width = depth.width,
                               .height = depth.height,
                               .plane = {depths, PNG_IMAGE_SIZE(depth), depth.width, 1}}};
    PfHologram *hologram = NULL;
    ok(pf_session_process(session, &frame, &hologram));
    // The image of the levels has the size of the colour image, whose memory is free now.
    PfMemory memory = {colours, PNG_IMAGE_SIZE(colour), colour.width * 3};
    ok(pf_hologram_write_output(hologram, &(PfPlacement){.layout = PF_LAYOUT_RGB}, 0, memory));
    png_image image = {.version = PNG_IMAGE_VERSION, .width = colour.width, .height = colour.height, .format = PNG_FORMAT_RGB};
    if (!png_image_write_to_file(&image, arguments[3], 0, colours, 0, NULL)) {
        fprintf(stderr, "%s: %s\n", arguments[3], image.message);
        return 1;
    }

    pf_hologram_free(hologram);
    pf_session_free(session);
    pf_options_free(options);
    pf_target_free(target);
    free(colours);
    free(depths);
    return 0;
}
