/* A fuzz target for mcz_core: any bytes are read or refused. Built with FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION,
   which leaves checksums unchecked. libFuzzer calls LLVMFuzzerTestOneInput; without clang, MCZ_FUZZ_LOOP makes a
   program that alters files:   fuzz SECONDS SEED WORDS.BIN FILE.mcz... */
#include "mcz_core.c" /* for the ids of altered skeletons, which the loop makes anew */

enum { MOST_VALUES = 1 << 20 };

static uint8_t *words;
static size_t n_words;

static bool read_bytes(const uint8_t *data, size_t size) { /* whether they open as a file */
    mcz_error error;
    mcz_clip k;
    mcz_signal s;
    mcz_joint joint;
    mcz_block block;
    mcz *file = mcz_open(data, size, words, n_words, &error);
    for (size_t i = 0; file && mcz_get_clip(file, i, &k) == MCZ_OK; i++) {
        for (size_t j = 0; mcz_get_joint(file, k.skeleton, j, &joint) == MCZ_OK && j < 64; j++) {}
        for (size_t j = 0; mcz_get_signal(file, i, j, &s) == MCZ_OK; j++) {
            uint64_t most_rows = MOST_VALUES / MAX_OF(1, s.n_channels);
            if (k.n_frames > MOST_VALUES || k.n_frames * s.rows_per_frame > most_rows) continue;
            uint64_t begin = size % 3 ? 0 : k.n_frames / 3;
            mcz_rows *rows = mcz_rows_open(file, i, j, begin, k.n_frames, &error);
            while (rows && mcz_rows_next(rows, &block, &error) == 1) {}
            mcz_rows_close(rows);
        }
    }
    bool opened = file != NULL;
    mcz_close(file);
    return opened;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) { return read_bytes(data, size), 0; }

#ifdef MCZ_FUZZ_LOOP
#include <time.h>

static uint64_t state_of_random;

static uint64_t random_below(uint64_t n) { /* xorshift64* */
    state_of_random ^= state_of_random >> 12, state_of_random ^= state_of_random << 25;
    state_of_random ^= state_of_random >> 27;
    return n ? (state_of_random * UINT64_C(2685821657736338717) >> 20) % n : 0;
}

typedef struct { uint8_t *p; size_t n; } blob;

static blob read_file(const char *path) {
    FILE *f = fopen(path, "rb");
    blob b = {malloc(1 << 20), 0};
    if (f) b.n = fread(b.p, 1, 1 << 20, f);
    if (f) fclose(f);
    return b;
}

/* One edit of n bytes at p, which have room for 64 more; returns how many there are then. */
static size_t edit(uint8_t *p, size_t n) {
    static const uint8_t odd[10] = {0, 1, 2, 127, 128, 129, 254, 255, 64, 63};
    size_t at = random_below(n ? n : 1), size = 1 + random_below(random_below(4) ? 4 : 32);
    switch (n ? random_below(7) : 0) {
    case 0: /* insert */
        memmove(p + at + size, p + at, n - (n ? at : 0));
        for (size_t i = 0; i < size; i++)
            p[at + i] = random_below(2) ? odd[random_below(10)] : (uint8_t)random_below(256);
        return n + size;
    case 1: /* delete */
        size = MIN_OF(size, n - at);
        memmove(p + at, p + at + size, n - at - size);
        return n - size;
    case 2: p[at] = odd[random_below(10)]; break;
    case 3: p[at] = (uint8_t)random_below(256); break;
    case 4: p[at] = (uint8_t)(p[at] + random_below(5) - 2); break;
    case 5: memmove(p + at, p + random_below(at + 1), MIN_OF(size, n - at)); break;
    default: p[at] ^= (uint8_t)(1 << random_below(8));
    }
    return n;
}

static void replace_ids(uint8_t *p, size_t n, const key *old, const key *new) {
    for (size_t i = 0; n >= 16 && i <= n - 16; i++)
        if (!memcmp(p + i, old->bytes, 16)) memcpy(p + i, new->bytes, 16);
}

/* Alters the payload of one chunk, or any bytes, of a file with room for 4 KiB more. */
static size_t alter(uint8_t *p, size_t n) {
    size_t begins[256], n_chunks = 0, at = 8;
    while (at + 20 <= n && is_letter(p[at]) && n_chunks < 256) {
        uint64_t length = load(p + at + 8, 8);
        if (length > n - at - 20) break;
        begins[n_chunks++] = at;
        at += 20 + (size_t)length;
    }
    unsigned edits = 1 + (unsigned)random_below(random_below(3) ? 2 : 8);
    if (!n_chunks || !random_below(8)) {
        for (; edits; edits--) n = edit(p, n);
        return n;
    }
    uint8_t *chunk = p + begins[random_below(n_chunks)], type[4];
    size_t length = (size_t)load(chunk + 8, 8), rest = n - (size_t)(chunk + 16 - p) - length, now = length;
    static uint8_t tail[1 << 21], payload[(1 << 20) + 4096];
    memcpy(type, chunk, 4);
    memcpy(tail, chunk + 16 + length, rest);
    memcpy(payload, chunk + 16, length);
    key old = key_of((const char *)type, payload, length);
    for (; edits; edits--) now = edit(payload, now);
    key new = key_of((const char *)type, payload, now);
    memcpy(chunk + 16, payload, now);
    memcpy(chunk + 16 + now, tail, rest);
    for (int i = 0; i < 8; i++) chunk[8 + i] = (uint8_t)((uint64_t)now >> 8 * i);
    replace_ids(chunk + 16 + now, rest, &old, &new);
    return n + now - length;
}

int main(int argc, char **argv) {
    if (argc < 5) return fprintf(stderr, "fuzz SECONDS SEED WORDS.BIN FILE.mcz...\n"), 2;
    double seconds = strtod(argv[1], NULL);
    state_of_random = strtoull(argv[2], NULL, 10) | 1;
    blob annex = read_file(argv[3]), *files = calloc((size_t)argc, sizeof *files);
    words = annex.p, n_words = annex.n;
    size_t n_files = (size_t)argc - 4;
    for (size_t i = 0; i < n_files; i++) files[i] = read_file(argv[i + 4]);
    uint64_t runs = 0, opened = 0;
    time_t start = time(NULL);
    while (difftime(time(NULL), start) < seconds) {
        blob f = files[random_below(n_files)];
        uint8_t *p = malloc(f.n + 8192), *exact;
        memcpy(p, f.p, f.n);
        size_t n = alter(p, f.n);
        exact = malloc(n ? n : 1); /* so that a sanitizer sees a byte too many */
        memcpy(exact, p, n);
        FILE *last = fopen("fuzz-last.mcz", "wb"); /* the finding, where there is one */
        if (last) fwrite(p, 1, n, last);
        if (last) fclose(last);
        opened += read_bytes(exact, n);
        free(exact);
        free(p);
        runs++;
    }
    printf("%llu executions, of which %llu opened\n", (unsigned long long)runs, (unsigned long long)opened);
    for (size_t i = 0; i < n_files; i++) free(files[i].p);
    free(files);
    free(annex.p);
    return 0;
}
#endif
