/* Runs the C example on a stack of its own that was painted before, and says how much of it was used. */
#include <pthread.h>

#define main example
#include "../../tracker/examples/c/track.c"
#undef main

enum { STACK = 1 << 20, PAINT = 0xa5 };

/* Of what the C library keeps at the top of a thread's stack this is more than enough; the example's own needs are part
 * of what is measured. */
enum { LIMIT = 160 * 1024 };

static void *run_example(void *failed) {
    *(int *)failed = example();
    return NULL;
}

int main(void) {
    void *memory = NULL;
    int failed = 1;
    pthread_attr_t attributes;
    pthread_t thread;
    if (posix_memalign(&memory, 65536, STACK) != 0) return 1;
    unsigned char *stack = memory;
    for (size_t i = 0; i < STACK; i++) stack[i] = PAINT;
    if (pthread_attr_init(&attributes) != 0 || pthread_attr_setstack(&attributes, stack, STACK) != 0 ||
        pthread_create(&thread, &attributes, run_example, &failed) != 0 || pthread_join(thread, NULL) != 0) return 1;
    size_t untouched = 0;
    while (untouched < STACK && stack[untouched] == PAINT) untouched++;
    printf("stack high-water %zu bytes\n", (size_t)STACK - untouched);
    free(memory);
    return failed || STACK - untouched > LIMIT;
}
