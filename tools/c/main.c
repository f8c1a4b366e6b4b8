/* A decoder under test: the contract of conformance/README.md, spoken by mcz_core.

   mcz_core [--words FILE] [--capabilities | --serve | [--clip NAME] [--frames A:B] [--joints I,J]] < FILE.mcz */
#include "mcz_core.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    char *p;
    size_t n, room;
    int failed;
} buffer;

static void put(buffer *b, const void *p, size_t n) {
    if (b->n + n > b->room && !b->failed) {
        size_t room = 2 * (b->n + n) + 4096;
        char *q = realloc(b->p, room);
        if (!q) {
            b->failed = 1;
            return;
        }
        b->p = q;
        b->room = room;
    }
    if (b->failed || !n) return;
    memcpy(b->p + b->n, p, n);
    b->n += n;
}

static void put_string(buffer *b, const char *s) { put(b, s, strlen(s)); }

static void put_number(buffer *b, uint64_t v) { /* an integer above 2^53 is a string */
    char s[40];
    snprintf(s, sizeof s, v >> 53 ? "\"%llu\"" : "%llu", (unsigned long long)v);
    put_string(b, s);
}

static void put_json(buffer *b, mcz_text t) {
    char s[8];
    put_string(b, "\"");
    for (size_t i = 0; i < t.size; i++) {
        unsigned char a = (unsigned char)t.bytes[i];
        if (a == '"' || a == '\\') put_string(b, "\\");
        if (a >= 32 && a != 127) {
            put(b, &t.bytes[i], 1);
            continue;
        }
        snprintf(s, sizeof s, "\\u%04x", a);
        put_string(b, s);
    }
    put_string(b, "\"");
}

typedef struct {
    const char *clip, *joints;
    size_t clip_size;
    int has_frames;
    uint64_t begin, end;
} request;

typedef struct {
    buffer listing, arrays, mask;
    const mcz *file;
    const request *q;
    size_t *columns, n_columns; /* of --joints */
    mcz_error error;
} answer;

static void list_array(answer *a, const mcz_clip *k, const mcz_signal *s, const char *array, const char *type,
                       size_t size) {
    uint64_t begin = 0, end = k->n_frames;
    size_t n = a->columns ? a->n_columns : s->n_channels;
    if (a->q->has_frames) begin = a->q->begin, end = a->q->end < end ? a->q->end : end;
    if (begin > end) begin = end;
    put_string(&a->listing, a->listing.n > 12 ? ", {\"clip\": " : "{\"clip\": ");
    put_json(&a->listing, k->name);
    put_string(&a->listing, ", \"signal\": ");
    put_json(&a->listing, s->name);
    put_string(&a->listing, ", \"array\": \"");
    put_string(&a->listing, array);
    put_string(&a->listing, "\", \"dtype\": \"");
    put_string(&a->listing, type);
    put_string(&a->listing, "\", \"shape\": [");
    put_number(&a->listing, (end - begin) * s->rows_per_frame);
    put_string(&a->listing, ", ");
    put_number(&a->listing, n);
    put_string(&a->listing, "], \"bytes\": ");
    put_number(&a->listing, (end - begin) * s->rows_per_frame * n * size);
    put_string(&a->listing, "}");
}

static void put_values(answer *a, const mcz_block *b) { /* little-endian */
    const char *p = b->integers ? (const char *)b->integers : (const char *)b->values;
    size_t n = a->columns ? a->n_columns : b->n_channels;
    for (size_t i = 0; i < b->n_rows; i++)
        for (size_t j = 0; j < n; j++) {
            size_t at = i * b->n_channels + (a->columns ? a->columns[j] : j);
            uint64_t v;
            unsigned char bytes[8], valid = b->mask ? b->mask[at] : 1;
            memcpy(&v, p + 8 * at, 8);
            for (int k = 0; k < 8; k++) bytes[k] = (unsigned char)(v >> 8 * k);
            put(&a->arrays, bytes, 8);
            put(&a->mask, &valid, 1);
        }
}

static int read_signal(answer *a, const mcz_clip *k, size_t i, size_t j, const mcz_signal *s) {
    uint64_t begin = 0, end = k->n_frames;
    mcz_block block;
    if (a->q->has_frames) begin = a->q->begin, end = a->q->end < end ? a->q->end : end;
    if (begin > end) begin = end;
    mcz_rows *rows = mcz_rows_open(a->file, i, j, begin, end, &a->error);
    if (!rows) return a->error.code;
    int more;
    a->mask.n = 0;
    while ((more = mcz_rows_next(rows, &block, &a->error)) == 1) put_values(a, &block);
    mcz_rows_close(rows);
    if (more < 0) return a->error.code;
    list_array(a, k, s, "values", s->integers ? "<i8" : "<f8", 8);
    if (!a->mask.n || !memchr(a->mask.p, 0, a->mask.n)) return MCZ_OK;
    list_array(a, k, s, "mask", "u1", 1);
    put(&a->arrays, a->mask.p, a->mask.n);
    return MCZ_OK;
}

/* The columns of the joints that are asked for. */
static int find_columns(answer *a, size_t skeleton) {
    free(a->columns);
    a->columns = NULL;
    a->n_columns = 0;
    for (const char *p = a->q->joints; p && *p; p += strcspn(p, ","), p += *p == ',') {
        size_t joint = strtoull(p, NULL, 10), first = 0;
        mcz_joint x;
        for (size_t i = 0; i < joint; i++)
            if (mcz_get_joint(a->file, skeleton, i, &x) == MCZ_OK) first += x.n_channels;
        if (mcz_get_joint(a->file, skeleton, joint, &x) != MCZ_OK) return MCZ_INVALID;
        size_t *more = realloc(a->columns, (a->n_columns + x.n_channels + 1) * sizeof *more);
        if (!more) return MCZ_NO_MEMORY;
        a->columns = more;
        for (size_t i = 0; i < x.n_channels; i++) a->columns[a->n_columns++] = first + i;
    }
    return MCZ_OK;
}

static int read_clip(answer *a, size_t i) {
    mcz_clip k;
    int result = MCZ_OK;
    mcz_get_clip(a->file, i, &k);
    if (a->q->clip && (a->q->clip_size != k.name.size || memcmp(a->q->clip, k.name.bytes, k.name.size))) return MCZ_OK;
    if (!k.readable) return MCZ_UNSUPPORTED;
    if (a->q->joints && find_columns(a, k.skeleton)) return MCZ_INVALID;
    for (size_t j = 0; j < k.n_signals; j++) {
        mcz_signal s;
        mcz_get_signal(a->file, i, j, &s);
        if (a->q->joints && s.own_channels) continue;
        int code = read_signal(a, &k, i, j, &s);
        if (code == MCZ_UNSUPPORTED) result = code;
        else if (code) return code;
    }
    return result;
}

static int decode(const void *data, size_t size, buffer *words, const request *q, buffer *out) {
    answer a = {.q = q};
    int result = MCZ_OK;
    mcz *file = mcz_open(data, size, words->p, words->n, &a.error);
    if (!file) result = a.error.code;
    a.file = file;
    put_string(&a.listing, "{\"arrays\": [");
    for (size_t i = 0; file && i < mcz_n_clips(file); i++) {
        int code = read_clip(&a, i);
        if (code == MCZ_UNSUPPORTED && !result) result = code;
        if (code == MCZ_UNSUPPORTED || !code) continue;
        result = code;
        break;
    }
    put_string(&a.listing, "]}\n");
    if (a.error.code && result) {
        fprintf(stderr, "mcz_core: offset %llu: %s\n", (unsigned long long)a.error.offset, a.error.message);
        fflush(stderr);
    }
    if (!result) {
        put(out, a.listing.p, a.listing.n);
        put(out, a.arrays.p, a.arrays.n);
    }
    if (a.listing.failed || a.arrays.failed || a.mask.failed || out->failed) result = MCZ_NO_MEMORY;
    mcz_close(file);
    free(a.listing.p);
    free(a.arrays.p);
    free(a.mask.p);
    free(a.columns);
    return result == MCZ_UNSUPPORTED ? 3 : result ? 1 : 0;
}

static int get_option(request *q, char **arguments, int n) { /* how many it takes, 0: unknown */
    if (n < 2) return 0;
    if (!strcmp(arguments[0], "--clip")) {
        q->clip = arguments[1], q->clip_size = strlen(arguments[1]);
    } else if (!strcmp(arguments[0], "--joints")) {
        q->joints = arguments[1];
    } else if (!strcmp(arguments[0], "--frames")) {
        char *colon;
        q->has_frames = 1;
        q->begin = strtoull(arguments[1], &colon, 10);
        q->end = *colon == ':' ? strtoull(colon + 1, NULL, 10) : 0;
    } else {
        return 0;
    }
    return 2;
}

static size_t read_some(buffer *b, FILE *f, size_t n) { /* up to n bytes */
    char block[65536];
    size_t got, sum = 0;
    while (n && (got = fread(block, 1, n < sizeof block ? n : sizeof block, f)) > 0) {
        put(b, block, got);
        n -= got;
        sum += got;
    }
    return sum;
}

/* One string of JSON at p, its escapes undone in place; what comes after it goes to *end. */
static char *json_string(char *p, char **end) {
    char *out = p, *begin = p;
    for (; *p && *p != '"'; p++) {
        if (*p != '\\') {
            *out++ = *p;
            continue;
        }
        p++;
        if (*p != 'u') {
            *out++ = *p == 'n' ? '\n' : *p == 't' ? '\t' : *p == 'r' ? '\r' : *p == 'b' ? '\b' : *p == 'f' ? '\f' : *p;
            continue;
        }
        unsigned code = 0, low = 0;
        sscanf(p + 1, "%4x", &code);
        p += 4;
        if (code >= 0xD800 && code < 0xDC00 && sscanf(p + 1, "\\u%4x", &low) == 1) {
            code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
            p += 6;
        }
        if (code < 0x80) *out++ = (char)code;
        else if (code < 0x800) *out++ = (char)(0xC0 | code >> 6);
        else if (code < 0x10000) *out++ = (char)(0xE0 | code >> 12);
        else *out++ = (char)(0xF0 | code >> 18), *out++ = (char)(0x80 | (code >> 12 & 63));
        if (code >= 0x800) *out++ = (char)(0x80 | (code >> 6 & 63));
        if (code >= 0x80) *out++ = (char)(0x80 | (code & 63));
    }
    *end = *p ? p + 1 : p;
    *out = 0;
    return begin;
}

static int serve(buffer *words) {
    static char line[1 << 20];
    buffer data = {0}, out = {0};
    while (fgets(line, sizeof line, stdin)) {
        char *arguments[16], *p = strstr(line, "\"arguments\""), *size = strstr(line, "\"bytes\"");
        int n = 0;
        request q = {0};
        if (!p || !size) return 1;
        size_t n_bytes = strtoull(size + 8, NULL, 10);
        if (p < size) size[0] = 0;
        for (p += 11; n < 16 && (p = strchr(p, '"'));) arguments[n++] = json_string(p + 1, &p);
        for (int i = 0, used; i < n; i += used)
            if (!(used = get_option(&q, arguments + i, n - i))) return 1;
        data.n = out.n = 0;
        if (read_some(&data, stdin, n_bytes) != n_bytes || data.failed) return 1;
        int code = decode(data.p, data.n, words, &q, &out);
        printf("{\"exit\": %d, \"bytes\": %zu}\n", code, out.n);
        fwrite(out.p, 1, out.n, stdout);
        fflush(stdout);
    }
    free(data.p);
    free(out.p);
    free(words->p);
    return 0;
}

int main(int argc, char **argv) {
    buffer words = {0}, data = {0}, out = {0};
    request q = {0};
    int serving = 0;
    for (int i = 1, used; i < argc; i += used) {
        used = 1;
        if (!strcmp(argv[i], "--words") && i + 1 < argc) {
            FILE *f = fopen(argv[i + 1], "rb");
            used = 2;
            if (!f) return fprintf(stderr, "mcz_core: cannot read %s\n", argv[i + 1]), 2;
            read_some(&words, f, SIZE_MAX);
            fclose(f);
        } else if (!strcmp(argv[i], "--capabilities")) {
            puts("{\"class\": \"core\", \"codecs\": [\"raw\", \"fast\"], \"sources\": [], \"format\": \"1.0\","
                 " \"options\": [\"--clip\", \"--frames\", \"--joints\", \"--serve\"]}");
            free(words.p);
            return 0;
        } else if (!strcmp(argv[i], "--serve")) {
            serving = 1;
        } else if (!(used = get_option(&q, argv + i, argc - i))) {
            return fprintf(stderr, "mcz_core: unknown option %s\n", argv[i]), 2;
        }
    }
    if (serving) return serve(&words);
    read_some(&data, stdin, SIZE_MAX);
    int code = decode(data.p ? data.p : "", data.n, &words, &q, &out);
    fwrite(out.p ? out.p : "", 1, out.n, stdout);
    free(data.p);
    free(out.p);
    free(words.p);
    return code;
}
