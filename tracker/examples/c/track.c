/* Tracks a camera that slides in front of a textured wall, and a reference view from outside.
 *
 * The frames are drawn here so that the program needs no files; a real one takes them from a camera. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "mba_tracker.h"

enum { WIDTH = 160, HEIGHT = 120, FRAMES = 8, VIEWS = 9 };

static const double FOCAL = 140.0, DISTANCE = 2.0, STEP = 0.012, EXPOSURE_SHARE = 0.5;

/* The wall: linear light at (x, y) metres, from a few waves. */
static double wall(double x, double y) {
    return 0.45 + 0.15 * sin(9.0 * x + 4.0 * sin(5.0 * y)) + 0.15 * sin(11.0 * y - 3.0 * sin(7.0 * x)) +
           0.1 * sin(23.0 * x + 17.0 * y);
}

/* The mean over the exposure of a camera that moves STEP metres to the right per frame. */
static void draw(int k, double share, uint8_t *grey, uint16_t *depth) {
    for (int v = 0; v < HEIGHT; v++) {
        for (int u = 0; u < WIDTH; u++) {
            double light = 0.0;
            for (int i = 0; i < VIEWS; i++) {
                double camera = STEP * (k + share * ((i + 0.5) / VIEWS - 0.5));
                double x = camera + (u - 0.5 * (WIDTH - 1)) / FOCAL * DISTANCE;
                light += wall(x, (v - 0.5 * (HEIGHT - 1)) / FOCAL * DISTANCE) / VIEWS;
            }
            grey[v * WIDTH + u] = (uint8_t)(255.0 * light + 0.5);
            depth[v * WIDTH + u] = (uint16_t)(1000.0 * DISTANCE);
        }
    }
}

static int check(int32_t code, const char *what) {
    if (code != MBA_OK) {
        fprintf(stderr, "%s: %s\n", what, mba_error_string(code));
        return 0;
    }
    return 1;
}

static int run(MbaTracker *tracker, uint8_t *grey, uint16_t *depth) {
    MbaFrame frame = {
        .exposure = EXPOSURE_SHARE / 30.0,
        .image = {grey, (size_t)WIDTH * HEIGHT, WIDTH, HEIGHT, WIDTH, MBA_PIXEL_GREY8},
        .depth = {depth, sizeof(uint16_t) * WIDTH * HEIGHT, WIDTH, HEIGHT, 2 * WIDTH},
    };
    double worst = 0.0;
    for (int k = 0; k < FRAMES; k++) {
        MbaResult result;
        if (k == FRAMES / 2) {
            /* A map would render this; here the wall is drawn sharp. */
            MbaPose pose = {{0.0, 0.0, 0.0, 1.0}, {STEP * k, 0.0, 0.0}};
            draw(k, 0.0, grey, depth);
            if (!check(mba_set_reference(tracker, &frame.image, &frame.depth, &pose), "mba_set_reference")) return 1;
        }
        draw(k, EXPOSURE_SHARE, grey, depth);
        frame.timestamp = k / 30.0;
        if (!check(mba_track(tracker, &frame, &result), "mba_track")) return 1;
        const double *a = result.world_from_camera_start.translation, *b = result.world_from_camera_end.translation;
        double error = hypot(hypot(0.5 * (a[0] + b[0]) - STEP * k, 0.5 * (a[1] + b[1])), 0.5 * (a[2] + b[2]));
        worst = fmax(worst, error);
        printf("%d %-4s opened %8.4f %8.4f %8.4f closed %8.4f %8.4f %8.4f blur %.2f px sigma %.1f mm\n", k,
               mba_status_string(result.status), a[0], a[1], a[2], b[0], b[1], b[2], (double)result.blur,
               1000.0 * sqrt(result.covariance[0]));
        if (result.status == MBA_STATUS_LOST) return 1;
    }
    printf("largest position error: %.2f mm\n", 1000.0 * worst);
    return worst < 0.003 ? 0 : 1;
}

int main(void) {
    MbaConfig config;
    MbaTracker *tracker = NULL;
    size_t bytes = 0;
    static uint8_t grey[WIDTH * HEIGHT];
    static uint16_t depth[WIDTH * HEIGHT];
    float linear[256];
    for (int i = 0; i < 256; i++) linear[i] = (float)i / 255.0f;

    if (!check(mba_config_compact(&config, WIDTH, HEIGHT, FOCAL, FOCAL, 0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1), 0.001f),
               "mba_config_compact")) return 1;
    config.response = linear;
    if (!check(mba_memory_size(&config, &bytes), "mba_memory_size")) return 1;
    bytes = (bytes + MBA_MEMORY_ALIGNMENT - 1) / MBA_MEMORY_ALIGNMENT * MBA_MEMORY_ALIGNMENT;
    void *memory = aligned_alloc(MBA_MEMORY_ALIGNMENT, bytes);
    if (memory == NULL) return 1;
    printf("mba_tracker %u.%u.%u, %zu bytes\n", (unsigned)(mba_version() >> 16), (unsigned)(mba_version() >> 8 & 255),
           (unsigned)(mba_version() & 255), bytes);
    int failed = !check(mba_tracker_init(memory, bytes, &config, &tracker), "mba_tracker_init");
    if (!failed) failed = run(tracker, grey, depth);
    free(memory);
    return failed;
}
