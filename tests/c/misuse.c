/* Every call of mba_tracker.h that must be refused, from C, to be run under a memory checker: buffers are exactly as long
 * as they have to be, and the tracker's memory is uninitialised when it is handed over. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mba_tracker.h"

enum { WIDTH = 64, HEIGHT = 48, PIXELS = WIDTH * HEIGHT };

static int failures = 0;

static void expect(int32_t expected, int32_t code, const char *call) {
    if (code == expected) return;
    failures++;
    fprintf(stderr, "%s\n    is \"%s\", not \"%s\"\n", call, mba_error_string(code), mba_error_string(expected));
}

#define EXPECT(code, call) expect(code, call, #call)

/* One byte further. */
#define SHIFTED(pointer) ((void *)((char *)(pointer) + 1))

static MbaConfig calibration(void) {
    MbaConfig config;
    EXPECT(MBA_OK, mba_config_compact(&config, WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5, 0.001f));
    return config;
}

static void configurations(void) {
    size_t bytes = 0;
    float *response = malloc(256 * sizeof *response);
    for (int i = 0; i < 256; i++) response[i] = (float)i;
    MbaConfig good = calibration(), config = good;
    EXPECT(MBA_ERROR_NULL_POINTER, mba_config_default(NULL, WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5, 0.001f));
    EXPECT(MBA_ERROR_NULL_POINTER, mba_config_compact(NULL, WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5, 0.001f));
    EXPECT(MBA_ERROR_MISALIGNED, mba_config_default(SHIFTED(&config), WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5, 0.001f));
    EXPECT(MBA_ERROR_NULL_POINTER, mba_memory_size(NULL, &bytes));
    EXPECT(MBA_ERROR_NULL_POINTER, mba_memory_size(&good, NULL));
    EXPECT(MBA_ERROR_MISALIGNED, mba_memory_size(SHIFTED(&good), &bytes));
    EXPECT(MBA_ERROR_MISALIGNED, mba_memory_size(&good, SHIFTED(&bytes)));
#define REFUSED(field, value)                                      \
    do {                                                           \
        config = good;                                             \
        config.field = value;                                      \
        EXPECT(MBA_ERROR_CONFIG, mba_memory_size(&config, &bytes)); \
    } while (0)
    REFUSED(fx, NAN);
    REFUSED(fy, -INFINITY);
    REFUSED(cx, NAN);
    REFUSED(cy, INFINITY);
    REFUSED(metres_per_unit, NAN);
    REFUSED(width, 0);
    REFUSED(height, UINT32_MAX);
    REFUSED(levels, UINT32_MAX);
    REFUSED(surface_level, good.levels);
    REFUSED(recent_keyframes, UINT32_MAX);
    REFUSED(reference, -1);
    REFUSED(effort, 3);
    response[255] = NAN;
    REFUSED(response, response);
    response[255] = 255.0f;
    config.response = response;
    EXPECT(MBA_OK, mba_memory_size(&config, &bytes));
    config.response = SHIFTED(response);
    EXPECT(MBA_ERROR_MISALIGNED, mba_memory_size(&config, &bytes));
    free(response);
}

static MbaTracker *construction(unsigned char *memory, size_t bytes) {
    MbaTracker *tracker = NULL;
    MbaConfig config = calibration(), nan = config;
    nan.fx = NAN;
    EXPECT(MBA_ERROR_NULL_POINTER, mba_tracker_init(NULL, bytes, &config, &tracker));
    EXPECT(MBA_ERROR_NULL_POINTER, mba_tracker_init(memory, bytes, NULL, &tracker));
    EXPECT(MBA_ERROR_NULL_POINTER, mba_tracker_init(memory, bytes, &config, NULL));
    EXPECT(MBA_ERROR_MISALIGNED, mba_tracker_init(memory + 16, bytes, &config, &tracker));
    EXPECT(MBA_ERROR_MISALIGNED, mba_tracker_init(memory, bytes, SHIFTED(&config), &tracker));
    EXPECT(MBA_ERROR_MISALIGNED, mba_tracker_init(memory, bytes, &config, SHIFTED(&tracker)));
    EXPECT(MBA_ERROR_CONFIG, mba_tracker_init(memory, bytes, &nan, &tracker));
    EXPECT(MBA_ERROR_SHORT_BUFFER, mba_tracker_init(memory, 0, &config, &tracker));
    EXPECT(MBA_ERROR_SHORT_BUFFER, mba_tracker_init(memory, bytes - 1, &config, &tracker));
    if (tracker != NULL) failures++;
    EXPECT(MBA_OK, mba_tracker_init(memory, bytes, &config, &tracker));
    return tracker;
}

static void handles(const MbaFrame *frame) {
    MbaResult result;
    MbaPose pose = {{0.0, 0.0, 0.0, 1.0}, {0.0, 0.0, 0.0}};
    void *no_tracker = aligned_alloc(MBA_MEMORY_ALIGNMENT, 64);
    if (no_tracker == NULL) abort();
    memset(no_tracker, 0xa5, 64);
    struct {
        MbaTracker *tracker;
        int32_t code;
    } cases[] = {{NULL, MBA_ERROR_NULL_POINTER},
                 {SHIFTED(no_tracker), MBA_ERROR_MISALIGNED},
                 {no_tracker, MBA_ERROR_NOT_INITIALISED}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        MbaTracker *tracker = cases[i].tracker;
        EXPECT(cases[i].code, mba_track(tracker, frame, &result));
        EXPECT(cases[i].code, mba_set_reference(tracker, &frame->image, &frame->depth, &pose));
        EXPECT(cases[i].code, mba_relocate(tracker, &frame->image, &frame->depth, &pose, &pose));
        EXPECT(cases[i].code, mba_move_world(tracker, &pose));
        EXPECT(cases[i].code, mba_reset(tracker));
    }
    free(no_tracker);
}

static void frames(MbaTracker *tracker, const MbaFrame *good) {
    MbaResult result;
    MbaFrame frame;
    double rate[3] = {0.0, NAN, 0.0};
    EXPECT(MBA_ERROR_NULL_POINTER, mba_track(tracker, NULL, &result));
    EXPECT(MBA_ERROR_NULL_POINTER, mba_track(tracker, good, NULL));
    EXPECT(MBA_ERROR_MISALIGNED, mba_track(tracker, SHIFTED(good), &result));
    EXPECT(MBA_ERROR_MISALIGNED, mba_track(tracker, good, SHIFTED(&result)));
#define REFUSED_FRAME(code, field, value)                  \
    do {                                                   \
        frame = *good;                                     \
        frame.field = value;                               \
        EXPECT(code, mba_track(tracker, &frame, &result)); \
    } while (0)
    REFUSED_FRAME(MBA_ERROR_TIMESTAMP, timestamp, NAN);
    REFUSED_FRAME(MBA_ERROR_EXPOSURE, exposure, -1.0);
    REFUSED_FRAME(MBA_ERROR_EXPOSURE, exposure, INFINITY);
    REFUSED_FRAME(MBA_ERROR_ANGULAR_VELOCITY, angular_velocity, rate);
    REFUSED_FRAME(MBA_ERROR_MISALIGNED, angular_velocity, SHIFTED(rate));
    REFUSED_FRAME(MBA_ERROR_NULL_POINTER, image.data, NULL);
    REFUSED_FRAME(MBA_ERROR_SHORT_BUFFER, image.size_bytes, PIXELS - 1);
    REFUSED_FRAME(MBA_ERROR_SHORT_BUFFER, image.size_bytes, SIZE_MAX);
    REFUSED_FRAME(MBA_ERROR_SHORT_BUFFER, image.height, UINT32_MAX);
    REFUSED_FRAME(MBA_ERROR_IMAGE_SIZE, image.width, WIDTH - 1);
    REFUSED_FRAME(MBA_ERROR_IMAGE_SIZE, image.height, 0);
    REFUSED_FRAME(MBA_ERROR_STRIDE, image.stride_bytes, WIDTH - 1);
    REFUSED_FRAME(MBA_ERROR_STRIDE, image.format, MBA_PIXEL_RGB8);
    REFUSED_FRAME(MBA_ERROR_PIXEL_FORMAT, image.format, 3);
    REFUSED_FRAME(MBA_ERROR_NULL_POINTER, depth.data, NULL);
    REFUSED_FRAME(MBA_ERROR_MISALIGNED, depth.data, SHIFTED(good->depth.data));
    REFUSED_FRAME(MBA_ERROR_SHORT_BUFFER, depth.size_bytes, 2 * PIXELS - 1);
    REFUSED_FRAME(MBA_ERROR_IMAGE_SIZE, depth.height, HEIGHT - 1);
    REFUSED_FRAME(MBA_ERROR_STRIDE, depth.stride_bytes, 2 * WIDTH + 1);
    EXPECT(MBA_OK, mba_track(tracker, good, &result));
    if (result.index != 0) failures++;
    EXPECT(MBA_ERROR_TIMESTAMP, mba_track(tracker, good, &result));
}

static void views_and_poses(MbaTracker *tracker, const MbaFrame *frame) {
    const MbaImage *image = &frame->image;
    const MbaDepth *depth = &frame->depth;
    MbaImage small = *image;
    small.height--;
    MbaPose good = {{0.0, 0.0, 0.0, 1.0}, {0.0, 0.0, 0.0}}, nan = good, zero = good;
    nan.translation[1] = NAN;
    zero.rotation[3] = 0.0;
    struct {
        const MbaPose *pose;
        int32_t code;
    } cases[] = {{NULL, MBA_ERROR_NULL_POINTER},
                 {SHIFTED(&good), MBA_ERROR_MISALIGNED},
                 {&nan, MBA_ERROR_POSE},
                 {&zero, MBA_ERROR_POSE}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        EXPECT(cases[i].code, mba_set_reference(tracker, image, depth, cases[i].pose));
        EXPECT(cases[i].code, mba_relocate(tracker, image, depth, cases[i].pose, &good));
        EXPECT(cases[i].code, mba_relocate(tracker, image, depth, &good, cases[i].pose));
        EXPECT(cases[i].code, mba_move_world(tracker, cases[i].pose));
    }
    EXPECT(MBA_ERROR_NULL_POINTER, mba_set_reference(tracker, NULL, depth, &good));
    EXPECT(MBA_ERROR_NULL_POINTER, mba_relocate(tracker, image, NULL, &good, &good));
    EXPECT(MBA_ERROR_IMAGE_SIZE, mba_set_reference(tracker, &small, depth, &good));
    EXPECT(MBA_ERROR_IMAGE_SIZE, mba_relocate(tracker, &small, depth, &good, &good));
    EXPECT(MBA_OK, mba_set_reference(tracker, image, depth, &good));
    EXPECT(MBA_OK, mba_relocate(tracker, image, depth, &good, &good));
    EXPECT(MBA_OK, mba_move_world(tracker, &good));
    EXPECT(MBA_OK, mba_reset(tracker));
}

int main(void) {
    MbaConfig config = calibration();
    size_t bytes = 0;
    EXPECT(MBA_OK, mba_memory_size(&config, &bytes));
    unsigned char *memory = NULL;
    uint8_t *grey = malloc(PIXELS);
    uint16_t *depth = malloc(2 * PIXELS);
    /* aligned_alloc would round the size up. */
    if (posix_memalign((void **)&memory, MBA_MEMORY_ALIGNMENT, bytes) != 0 || grey == NULL || depth == NULL) return 1;
    for (int i = 0; i < PIXELS; i++) {
        grey[i] = (uint8_t)(128.0 + 60.0 * sin(0.9 * (i % WIDTH)) * cos(0.7 * (i / WIDTH)));
        depth[i] = 2000;
    }
    MbaFrame frame = {
        .exposure = 0.01,
        .image = {grey, PIXELS, WIDTH, HEIGHT, WIDTH, MBA_PIXEL_GREY8},
        .depth = {depth, 2 * PIXELS, WIDTH, HEIGHT, 2 * WIDTH},
    };
    configurations();
    MbaTracker *tracker = construction(memory, bytes);
    handles(&frame);
    if (tracker != NULL) {
        frames(tracker, &frame);
        views_and_poses(tracker, &frame);
    }
    free(memory);
    free(grey);
    free(depth);
    if (failures == 0) puts("every misuse is refused");
    return failures != 0;
}
