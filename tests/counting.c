// The allocator of glibc with a counter, for tests of what a frame allocates. A program links it, or LD_PRELOAD puts it
// before the libraries of any program.
#include <errno.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

static atomic_uint_least64_t allocated;

static size_t counted(size_t size) {
    atomic_fetch_add_explicit(&allocated, size, memory_order_relaxed);
    return size;
}

// Returns the bytes that all threads of the process have asked for so far, freed ones too.
uint64_t allocated_bytes(void) {
    return atomic_load_explicit(&allocated, memory_order_relaxed);
}

void *malloc(size_t size) {
    return __libc_malloc(counted(size));
}

void *calloc(size_t count, size_t size) {
    // What overflows is refused below.
    counted(count * size);
    return __libc_calloc(count, size);
}

void *realloc(void *block, size_t size) {
    return __libc_realloc(block, counted(size));
}

void *memalign(size_t alignment, size_t size) {
    return __libc_memalign(alignment, counted(size));
}

void *aligned_alloc(size_t alignment, size_t size) {
    return __libc_memalign(alignment, counted(size));
}

int posix_memalign(void **to, size_t alignment, size_t size) {
    if (alignment % sizeof(void *) != 0 || alignment == 0 || (alignment & (alignment - 1)) != 0) return EINVAL;
    void *block = __libc_memalign(alignment, counted(size));
    if (block == NULL) return ENOMEM;
    *to = block;
    return 0;
}
