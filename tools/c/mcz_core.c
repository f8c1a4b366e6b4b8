/* mcz_core: see mcz_core.h. Written from SPEC.md; the ids in brackets are rules of that document.

   The sections of this file: cursors over bytes; CRC-32 and SHA-256; raw deflate; numbers; lists and the map of
   names; what is known of a file; SKEL; CLIP and CEND; segments and packets; shared chunks, META, COPY and QUAL;
   INDX; the walk; the interface; raw; fast; notes, masks and values; rows. */
#include "mcz_core.h"
#include <float.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if FLT_EVAL_METHOD != 0
#error "CODEC-02 needs binary64 that is rounded after each operation; also compile with -ffp-contract=off"
#endif

#define MAX_COUNT ((UINT64_C(1) << 53) - 1) /* [CONV-01] */
#define MAX_OF(a, b) ((a) > (b) ? (a) : (b))
#define MIN_OF(a, b) ((a) < (b) ? (a) : (b))
enum { MAJOR = 0, MINOR = 99 };             /* the version of SPEC.md */

/* ---- Cursors ------------------------------------------------------------------------------------------------ */

/* Bytes to read. The first fault stays in `bad`, and the cursor then jumps to its end: a caller looks once, after
   a structure. `counted` bounds the loops. */
typedef struct {
    const uint8_t *p, *end;
    const char *bad;
    int code;
} cursor;

static cursor over(const uint8_t *p, uint64_t n) { return (cursor){p, p + n, NULL, MCZ_OK}; }

static uint64_t left(const cursor *c) { return (uint64_t)(c->end - c->p); }

static void refuse_as(cursor *c, int code, const char *why) {
    if (!c->bad) {
        c->bad = why;
        c->code = code;
    }
    c->p = c->end;
}

static void check(cursor *c, bool right, const char *why) {
    if (!right) refuse_as(c, MCZ_INVALID, why);
}

static const uint8_t *bytes(cursor *c, uint64_t n) {
    static const uint8_t zeros[64]; /* fields of fixed size are at most 32 bytes long */
    if (n > left(c)) {
        refuse_as(c, MCZ_INVALID, "a structure ends within a field [CONV-13]");
        return zeros;
    }
    c->p += n;
    return c->p - n;
}

static uint64_t load(const uint8_t *p, int n) { /* little-endian */
    uint64_t v = 0;
    for (int i = 0; i < n; i++) v |= (uint64_t)p[i] << 8 * i;
    return v;
}

static unsigned get8(cursor *c) { return *bytes(c, 1); }

static double double_of(uint64_t b) {
    double x;
    memcpy(&x, &b, 8);
    return x;
}

static uint64_t bits_of(double x) {
    uint64_t b;
    memcpy(&b, &x, 8);
    return b;
}

static double get_double(cursor *c) { return double_of(load(bytes(c, 8), 8)); }

static bool is_finite(double x) { return (bits_of(x) >> 52 & 0x7FF) != 0x7FF; }

static uint64_t varint(cursor *c) { /* [CONV-02] [CONV-03] [CONV-04] */
    uint64_t v = 0;
    for (int shift = 0;; shift += 7) {
        unsigned b = get8(c);
        if (shift > 49) check(c, false, "a varint beyond 2^53 - 1 [CONV-03]");
        if (c->bad) return 0;
        v |= (uint64_t)(b & 127) << shift;
        check(c, v <= MAX_COUNT, "a varint beyond 2^53 - 1 [CONV-03]");
        check(c, b != 0 || shift == 0, "a varint that is not the shortest [CONV-02]");
        if (b < 128) return c->bad ? 0 : v;
    }
}

static int64_t unzigzag(uint64_t u) { return u & 1 ? -1 - (int64_t)(u >> 1) : (int64_t)(u >> 1); }

static int64_t zigzag_varint(cursor *c) { return unzigzag(varint(c)); }

/* A count of items that have `least` bytes or more each, so that a loop or an allocation by it is bounded. */
static uint64_t counted(cursor *c, unsigned least) {
    uint64_t n = varint(c);
    check(c, n <= left(c) / least, "a structure ends within a field [CONV-13]");
    return c->bad ? 0 : n;
}

static bool optional(cursor *c) {
    uint64_t n = varint(c);
    check(c, n <= 1, "an optional field that is there more than once [CONV-07]");
    return !c->bad && n;
}

static mcz_text sized(cursor *c) {
    uint64_t n = varint(c);
    const uint8_t *p = bytes(c, n);
    return (mcz_text){(const char *)p, c->bad ? 0 : (size_t)n};
}

/* The bytes of the well-formed UTF-8 sequence at p, 0 where there is none. */
static size_t utf8_step(const uint8_t *p, size_t n) {
    unsigned a = p[0], low = 0x80, high = 0xBF;
    size_t size = a < 0x80 ? 1 : a < 0xC2 ? 0 : a < 0xE0 ? 2 : a < 0xF0 ? 3 : a < 0xF5 ? 4 : 0;
    if (size > n) return 0;
    if (a == 0xE0) low = 0xA0; /* overlong */
    if (a == 0xED) high = 0x9F; /* surrogates */
    if (a == 0xF0) low = 0x90;
    if (a == 0xF4) high = 0x8F; /* beyond U+10FFFF */
    for (size_t i = 1; i < size; i++, low = 0x80, high = 0xBF)
        if (p[i] < low || p[i] > high) return 0;
    return size;
}

static mcz_text text(cursor *c) { /* [CONV-05] [CONV-06] */
    mcz_text t = sized(c);
    for (size_t i = 0, step; i < t.size; i += step) {
        step = utf8_step((const uint8_t *)t.bytes + i, t.size - i);
        if (!step) {
            check(c, false, "text that is not well-formed UTF-8 [CONV-06]");
            return (mcz_text){"", 0};
        }
    }
    return t;
}

static bool same_text(mcz_text a, const char *b) {
    return a.size == strlen(b) && !memcmp(a.bytes, b, a.size);
}

/* flags of a structure; the names that it has are the bits of `known` */
static unsigned get_flags(cursor *c, unsigned known) {
    unsigned f = get8(c);
    check(c, !(f & ~known), "a reserved flag is set [CONV-14]");
    return f;
}

static void extension(cursor *c, unsigned flags) { /* [CONV-10] */
    if (flags & 128) sized(c);
}

static void closed(cursor *c) { check(c, c->p == c->end, "bytes after the last field [CONV-12]"); }

/* ---- CRC-32, SHA-256 ---------------------------------------------------------------------------------------- */

typedef struct { uint32_t t[8][256]; } crc_tables;

static void crc_make(crc_tables *k) {
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t c = i;
        for (int bit = 0; bit < 8; bit++) c = c & 1 ? c >> 1 ^ 0xEDB88320 : c >> 1;
        k->t[0][i] = c;
    }
    for (int j = 1; j < 8; j++)
        for (int i = 0; i < 256; i++) k->t[j][i] = k->t[j - 1][i] >> 8 ^ k->t[0][k->t[j - 1][i] & 255];
}

/* The CRC-32 of bytes that follow others, whose CRC-32 is crc. */
static uint32_t crc32(const crc_tables *k, uint32_t crc, const uint8_t *p, uint64_t n) {
    uint64_t c = ~crc;
    for (; n >= 8; n -= 8, p += 8) {
        uint64_t w = load(p, 8) ^ (c & 0xFFFFFFFF);
        c = 0;
        for (int j = 0; j < 8; j++) c ^= k->t[7 - j][w >> 8 * j & 255];
    }
    for (; n; n--, p++) c = c >> 8 ^ k->t[0][(c ^ *p) & 255];
    return ~(uint32_t)c;
}

static bool crc_is(uint32_t crc, uint64_t stated) {
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION /* a fuzzer is not to guess checksums */
    (void)crc, (void)stated;
    return true;
#else
    return crc == stated;
#endif
}

typedef struct {
    uint32_t h[8];
    uint64_t n;
    uint8_t block[64];
} sha256;

static const uint32_t SHA_K[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

static void sha_start(sha256 *s) {
    static const uint32_t h[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                  0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    memcpy(s->h, h, sizeof h);
    s->n = 0;
}

static uint32_t ror(uint32_t x, int n) { return x >> n | x << (32 - n); }

static void sha_block(uint32_t h[8], const uint8_t *p) {
    uint32_t w[64], v[8];
    for (int i = 0; i < 16; i++, p += 4) w[i] = (uint32_t)p[0] << 24 | p[1] << 16 | p[2] << 8 | p[3];
    for (int i = 16; i < 64; i++) {
        uint32_t a = w[i - 15], b = w[i - 2];
        w[i] = w[i - 16] + (ror(a, 7) ^ ror(a, 18) ^ a >> 3) + w[i - 7] + (ror(b, 17) ^ ror(b, 19) ^ b >> 10);
    }
    memcpy(v, h, 32);
    for (int i = 0; i < 64; i++) {
        uint32_t e = v[4], a = v[0], b = v[1], c = v[2];
        uint32_t x = v[7] + (ror(e, 6) ^ ror(e, 11) ^ ror(e, 25)) + ((e & v[5]) ^ (~e & v[6])) + SHA_K[i] + w[i];
        uint32_t y = (ror(a, 2) ^ ror(a, 13) ^ ror(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
        v[7] = v[6], v[6] = v[5], v[5] = e, v[4] = v[3] + x;
        v[3] = c, v[2] = b, v[1] = a, v[0] = x + y;
    }
    for (int i = 0; i < 8; i++) h[i] += v[i];
}

static void sha_add(sha256 *s, const void *bytes, uint64_t n) {
    const uint8_t *p = bytes;
    while (n) {
        uint64_t at = s->n & 63, m = MIN_OF(n, 64 - at);
        if (m == 64) {
            sha_block(s->h, p);
        } else {
            memcpy(s->block + at, p, (size_t)m);
            if (at + m == 64) sha_block(s->h, s->block);
        }
        s->n += m, p += m, n -= m;
    }
}

static void sha_end(sha256 *s, uint8_t out[32]) {
    uint64_t n_bits = 8 * s->n;
    uint8_t last[72] = {0x80};
    size_t pad = (size_t)(119 - (s->n & 63)) % 64 + 1;
    for (int i = 0; i < 8; i++) last[pad + (size_t)i] = (uint8_t)(n_bits >> (56 - 8 * i));
    sha_add(s, last, pad + 8);
    for (int i = 0; i < 32; i++) out[i] = (uint8_t)(s->h[i / 4] >> (24 - 8 * (i % 4)));
}

/* ---- Raw deflate -------------------------------------------------------------------------------------------- */

enum { WINDOW = 32768 };

typedef struct {
    cursor in;
    uint32_t hold; /* bits that were taken from `in` and not used */
    int n_hold;
    uint8_t *out;  /* all of the output or, where there is a sink, its last bytes */
    uint64_t at, total, size;
    sha256 *sink;
    const uint8_t *words; /* what lies before the output; its end is the nearest */
    uint64_t n_words;
    bool after_words;
} inflater;

typedef struct {
    uint16_t count[16], symbol[288];
} huffman;

static unsigned deflate_bits(inflater *f, int n) {
    while (f->n_hold < n) {
        f->hold |= (uint32_t)get8(&f->in) << f->n_hold;
        f->n_hold += 8;
    }
    unsigned v = f->hold & ((1u << n) - 1);
    f->hold >>= n;
    f->n_hold -= n;
    return v;
}

static void deflate_put(inflater *f, const uint8_t *p, uint64_t n) {
    check(&f->in, n <= f->size - f->total, "deflate makes more than the stated size [CONV-09]");
    if (f->in.bad) return;
    for (uint64_t i = 0; i < n; i++) {
        if (f->sink && f->at == 2 * WINDOW) {
            sha_add(f->sink, f->out, WINDOW);
            memcpy(f->out, f->out + WINDOW, WINDOW);
            f->at = WINDOW;
        }
        f->out[f->at++] = p[i];
    }
    f->total += n;
}

static void deflate_copy(inflater *f, uint64_t distance, unsigned length) {
    for (unsigned i = 0; i < length && !f->in.bad; i++) {
        uint8_t b = 0;
        if (distance <= f->total)
            b = f->out[f->at - distance];
        else if (distance - f->total <= f->n_words)
            b = f->words[f->n_words - (distance - f->total)];
        else if (f->after_words && !f->words)
            refuse_as(&f->in, MCZ_UNSUPPORTED, "deflate after words needs the annex");
        else
            check(&f->in, false, "a distance of deflate beyond the beginning [CONV-19]");
        deflate_put(f, &b, 1);
    }
}

/* Returns whether the code of these lengths is complete or, where `odd` allows it, one of the legal others. */
static bool huffman_make(huffman *h, const uint8_t *lengths, int n, bool odd) {
    uint16_t start[16] = {0};
    int space = 1, used;
    memset(h->count, 0, sizeof h->count);
    for (int i = 0; i < n; i++) h->count[lengths[i]]++;
    used = n - h->count[0];
    h->count[0] = 0;
    for (int l = 1; l < 16; l++) {
        space = 2 * space - h->count[l];
        if (space < 0) return false;
        if (l < 15) start[l + 1] = (uint16_t)(start[l] + h->count[l]);
    }
    for (int i = 0; i < n; i++)
        if (lengths[i]) h->symbol[start[lengths[i]]++] = (uint16_t)i;
    return space == 0 || (odd && (used == 0 || (used == 1 && h->count[1] == 1)));
}

static unsigned huffman_take(inflater *f, const huffman *h) {
    int code = 0, first = 0, at = 0;
    for (int l = 1; l < 16; l++) {
        code |= (int)deflate_bits(f, 1);
        if (code - first < h->count[l]) return h->symbol[at + code - first];
        at += h->count[l];
        first = (first + h->count[l]) << 1;
        code <<= 1;
    }
    check(&f->in, false, "deflate has bits that are no code");
    return 256;
}

static void deflate_lengths(inflater *f, huffman *literals, huffman *distances) {
    static const uint8_t order[19] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};
    uint8_t lengths[320] = {0}, small[19] = {0};
    int n_literals = 257 + (int)deflate_bits(f, 5), n_distances = 1 + (int)deflate_bits(f, 5);
    int n_small = 4 + (int)deflate_bits(f, 4), n = 0;
    check(&f->in, n_literals <= 286 && n_distances <= 30, "deflate has too many codes");
    for (int i = 0; i < n_small; i++) small[order[i]] = (uint8_t)deflate_bits(f, 3);
    check(&f->in, huffman_make(literals, small, 19, false), "a code of deflate is not complete");
    while (n < n_literals + n_distances && !f->in.bad) {
        unsigned s = huffman_take(f, literals), repeat = 1;
        uint8_t l = (uint8_t)(s < 16 ? s : 0);
        if (s == 16) {
            check(&f->in, n > 0, "deflate repeats no length");
            l = n > 0 ? lengths[n - 1] : 0;
        }
        if (s >= 16) repeat = s < 18 ? 3 + deflate_bits(f, s == 16 ? 2 : 3) : 11 + deflate_bits(f, 7);
        check(&f->in, n + (int)repeat <= n_literals + n_distances, "deflate has too many lengths");
        if (f->in.bad) return;
        for (; repeat; repeat--) lengths[n++] = l;
    }
    check(&f->in, lengths[256] != 0, "a code of deflate has no end");
    check(&f->in, huffman_make(literals, lengths, n_literals, true), "a code of deflate is not complete");
    bool complete = huffman_make(distances, lengths + n_literals, n_distances, true);
    check(&f->in, complete, "a code of deflate is not complete");
}

static void deflate_codes(inflater *f, const huffman *literals, const huffman *distances) {
    static const uint16_t length_base[29] = {3,  4,  5,  6,  7,  8,  9,  10, 11,  13,  15,  17,  19,  23, 27,
                                             31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258};
    while (!f->in.bad) {
        unsigned s = huffman_take(f, literals);
        if (s == 256) return;
        if (s < 256) {
            deflate_put(f, &(uint8_t){(uint8_t)s}, 1);
            continue;
        }
        check(&f->in, s < 286, "deflate has a length that is none");
        if (f->in.bad) return;
        s -= 257;
        unsigned length = length_base[s] + (s < 8 || s == 28 ? 0 : deflate_bits(f, (int)(s - 4) / 4));
        unsigned d = huffman_take(f, distances);
        check(&f->in, d < 30, "deflate has a distance that is none");
        if (f->in.bad) return;
        uint64_t distance = 1 + (uint64_t)d;
        if (d >= 4) distance = 1 + ((2 + (uint64_t)(d & 1)) << (d / 2 - 1)) + deflate_bits(f, (int)d / 2 - 1);
        deflate_copy(f, distance, length);
    }
}

static void deflate_stored(inflater *f) {
    f->hold = 0;
    f->n_hold = 0;
    unsigned n = (unsigned)load(bytes(&f->in, 2), 2), inverse = (unsigned)load(bytes(&f->in, 2), 2);
    check(&f->in, n == (inverse ^ 0xFFFF), "a stored block of deflate is damaged");
    if (f->in.bad) return;
    const uint8_t *p = bytes(&f->in, n);
    if (!f->in.bad) deflate_put(f, p, n);
}

static void deflate_fixed(huffman *literals, huffman *distances) {
    uint8_t l[288];
    for (int i = 0; i < 288; i++) l[i] = i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8;
    huffman_make(literals, l, 288, false);
    memset(l, 5, 32);
    huffman_make(distances, l, 32, false);
}

/* Inflates all of f->in to exactly f->size bytes: into f->out or, through a window in f->out, into f->sink. */
static void inflate(inflater *f) {
    huffman literals, distances;
    bool last = false;
    while (!last && !f->in.bad) {
        last = deflate_bits(f, 1);
        unsigned kind = deflate_bits(f, 2);
        check(&f->in, kind < 3, "deflate has a block of no kind");
        if (kind == 0) deflate_stored(f);
        if (kind == 1) deflate_fixed(&literals, &distances);
        if (kind == 2) deflate_lengths(f, &literals, &distances);
        if (kind) deflate_codes(f, &literals, &distances);
    }
    check(&f->in, f->in.p == f->in.end, "deflate ends before its bytes do [CONV-08]");
    check(&f->in, f->total == f->size, "deflate makes less than the stated size [CONV-09]");
    if (f->sink) sha_add(f->sink, f->out, f->at);
}

/* ---- Numbers ------------------------------------------------------------------------------------------------ */

enum { FIXED = 1, TRIMMED, GENERAL, TEXT64, TEXT32, INTEGER, SCALED, BINARY32, BINARY64, VAX_F, PRINTED };
enum { POINT_ZERO = 1, POINT = 2, NO_ZERO = 4, PLUS = 8, EXPONENT3 = 16, EXPONENT1 = 32, UPPER = 64 };

typedef struct {
    uint8_t kind, digits, style;
    double scale;
    int64_t most; /* the largest magnitude M */
} grid;

#define CANONICAL_NAN UINT64_C(0x7FF8000000000000)

static bool within(unsigned v, unsigned a, unsigned b) { return a <= v && v <= b; }

static bool printed_is_legal(unsigned digits, unsigned style) { /* [GRID-12] */
    if (within(digits, 129, 143)) return style == digits + 63;
    return style <= 40 || within(style, 64, 104) || within(style, 129, 145) || within(style, 192, 232);
}

static bool digits_are_legal(unsigned kind, unsigned d) { /* [GRID-02] */
    switch (kind) {
    case FIXED: return d <= 22;
    case TRIMMED: return within(d, 1, 22);
    case GENERAL: return within(d, 1, 15);
    case TEXT64: return d <= 1 || d == 16 || d == 17 || within(d, 74, 104);
    case PRINTED: return d <= 22 || d == 32 || d == 64 || within(d, 129, 143);
    default: return d == 0;
    }
}

static unsigned flags_of_grid(const grid *g) { /* those that are legal [GRID-03] */
    switch (g->kind) {
    case FIXED: return PLUS | (g->digits ? NO_ZERO : POINT);
    case TRIMMED: return POINT_ZERO | POINT | NO_ZERO | PLUS;
    case TEXT64: return g->digits >= 74 ? 0 : 127;
    case GENERAL:
    case TEXT32: return 127;
    case PRINTED:
        if (g->style >= 192) return PLUS | EXPONENT3 | EXPONENT1 | UPPER;
        return within(g->style, 129, 145) ? 127 : 0;
    default: return 0;
    }
}

static const int64_t TENS[16] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000, 1000000000,
                                 10000000000, 100000000000, 1000000000000, 10000000000000, 100000000000000, 1000000000000000};

static bool grid_has_text(const grid *g) { return g->kind <= TEXT32 || g->kind == PRINTED; }

static int64_t greatest(const grid *g) { /* the largest magnitude M */
    bool wide = g->style >= 128;
    switch (g->kind) {
    case GENERAL: return 5535 * TENS[g->digits - 1];
    case TEXT64: return g->digits >= 74 ? 0x444B1AE4D6E2EF4F : 0x7FEFFFFFFFFFFFFF;
    case TEXT32: return 0x7F7FFFFF;
    case INTEGER: return INT64_C(1) << 53;
    case BINARY32:
    case VAX_F: return 0x7FFFFFFF;
    case BINARY64: return INT64_MAX;
    case PRINTED:
        if (g->digits == 32) return wide ? 0x7F7FFFFF : 0x6258D726;
        if (g->digits == 64) return wide ? 0x7FEFFFFFFFFFFFFF : 0x444B1AE4D6E2EF4F;
        if (g->digits > 128) return 5535 * TENS[g->digits - 129];
        break;
    default: break;
    }
    return (INT64_C(1) << 51) - 1;
}

static grid get_grid(cursor *c) {
    grid g = {0};
    unsigned flags;
    g.kind = (uint8_t)get8(c);
    g.digits = (uint8_t)get8(c);
    flags = get8(c);
    check(c, within(g.kind, FIXED, PRINTED), "a grid of no kind [GRID-01]");
    check(c, digits_are_legal(g.kind, g.digits), "a grid with other digits [GRID-02]");
    if (g.kind == SCALED) {
        g.scale = get_double(c);
        check(c, g.scale >= 0x1p-200 && g.scale <= 0x1p200, "a scale out of range [GRID-04]");
    }
    if (g.kind == PRINTED) {
        g.style = (uint8_t)get8(c);
        check(c, printed_is_legal(g.digits, g.style), "a style of no numbers [GRID-12]");
    }
    check(c, !(flags & ~flags_of_grid(&g)), "a grid with other flags [GRID-03]");
    check(c, (flags & 3) != 3 && (flags & 48) != 48, "flags of a grid that exclude each other [GRID-06]");
    g.most = c->bad ? 0 : greatest(&g);
    return g;
}

static bool grid_has(const grid *g, int64_t o) { /* [GRID-05] */
    if (g->kind == INTEGER || g->kind == SCALED) return -g->most <= o && o <= g->most;
    return (o < 0 ? -1 - o : o) <= g->most;
}

/* The binary64 nearest to decimal text: digits, perhaps with a point, perhaps with an exponent. strtod gets at most
   801 digits (of the others only whether one is not 0 matters) and no point, which differs between locales. */
static double nearest_text(const char *s, size_t n) {
    char out[840];
    size_t used = 0;
    bool point = false, more = false;
    int64_t k = 0, e = 0;
    size_t i = 0;
    for (; i < n && s[i] != 'e' && s[i] != 'E'; i++) {
        if (s[i] < '0' || s[i] > '9') {
            point = true;
            continue;
        }
        k -= point;
        if (used == 0 && s[i] == '0') continue;
        if (used < 800) {
            out[used++] = s[i];
        } else {
            more |= s[i] != '0';
            k++;
        }
    }
    bool minus = i + 1 < n && s[i + 1] == '-';
    for (; i < n; i++)
        if (s[i] >= '0' && s[i] <= '9' && e < INT64_C(1) << 56) e = 10 * e + s[i] - '0';
    if (!used) return 0;
    if (more) out[used++] = '1', k--;
    k += minus ? -e : e;
    k = k > 9999 ? 9999 : k < -9999 ? -9999 : k;
    snprintf(out + used, sizeof out - used, "e%d", (int)k);
    return strtod(out, NULL);
}

static const double POWERS[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                  1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static double nearest(int64_t d, int k) { /* of d * 10^k, 0 <= d <= 2^53 [GRID-08] */
    char s[48];
    if (0 <= k && k <= 22) return (double)d * POWERS[k];
    if (-22 <= k && k < 0) return (double)d / POWERS[-k];
    return nearest_text(s, (size_t)snprintf(s, sizeof s, "%llde%d", (long long)d, k));
}

/* x > 0 rounded to n significant digits, up to 41, ties to even. Returns the exponent of the first digit. */
static int rounded(double x, int n, char *digits) {
    char s[80];
    int size = snprintf(s, sizeof s, "%.*e", n - 1, x), used = 0, i = 0, e = 0;
    for (; s[i] != 'e'; i++)
        if (s[i] >= '0' && s[i] <= '9') digits[used++] = s[i];
    digits[used] = 0;
    for (int j = i + 2; j < size; j++) e = 10 * e + s[j] - '0';
    return s[i + 1] == '-' ? -e : e;
}

static double of_digits(const char *digits, int exponent) {
    char s[80];
    return nearest_text(s, (size_t)snprintf(s, sizeof s, "%se%d", digits, exponent + 1 - (int)strlen(digits)));
}

static float float_of(uint32_t b) {
    float y;
    memcpy(&y, &b, 4);
    return y;
}

static uint32_t bits_of_float(float y) {
    uint32_t b;
    memcpy(&b, &y, 4);
    return b;
}

static bool reads_back(const char *digits, int exponent, float y) {
    char s[80];
    snprintf(s, sizeof s, "%se%d", digits, exponent + 1 - (int)strlen(digits));
    return strtof(s, NULL) == y;
}

/* nearest(shortest(y)) for y > 0. Of the decimals of n digits only the neighbors of y can be the shortest, the one
   below and the one above; printf gives the nearer. */
static double shortest32(float y) {
    char d[48];
    int e;
    for (int n = 1; n < 9; n++) {
        e = rounded(y, n, d);
        if (reads_back(d, e, y)) return of_digits(d, e);
        int64_t v = strtoll(d, NULL, 10), low = TENS[n - 1];
        bool up = of_digits(d, e) < (double)y;
        if (!up && v == low) v = 10 * low, e--; /* below 1000 is 999.9 */
        snprintf(d, sizeof d, "%lld", (long long)(up ? v + 1 : v - 1));
        e += (int)strlen(d) - n;
        if (reads_back(d, e, y)) return of_digits(d, e);
    }
    e = rounded(y, 9, d);
    return of_digits(d, e);
}

static double general(int64_t m, int digits) {
    if (m == 0) return 0;
    int64_t low = TENS[digits - 1], block = 9 * low;
    int first = (int)((m - 1) / block) - 307;
    return nearest((m - 1) % block + low, first - digits + 1);
}

static double printed(const grid *g, int64_t m) {
    char s[400 + 48];
    double x = g->digits > 128  ? general(m, g->digits - 128)
               : g->digits == 64 ? double_of((uint64_t)m)
               : g->digits == 32 ? (double)float_of((uint32_t)m)
                                 : nearest(m, -g->digits);
    int n = g->style % 64, e;
    if (x == 0) return 0;
    if (g->style >= 192) return e = rounded(x, n + 1, s), of_digits(s, e);
    if (g->style >= 128) return e = rounded(x, n, s), of_digits(s, e);
    if (g->style >= 64) {
        e = rounded(x, 17, s);
        if (e - 16 >= -n) return of_digits(s, e);
    }
    return nearest_text(s, (size_t)snprintf(s, sizeof s, "%.*f", n, x));
}

static double vax_f(int64_t m, bool minus) {
    int e = (int)(m >> 23);
    if (e == 0) return minus ? double_of(CANONICAL_NAN) : 0;
    return (double)((1 << 23) + (m & 0x7FFFFF)) * double_of((uint64_t)(e - 152 + 1023) << 52);
}

static double value_of(const grid *g, int64_t o) { /* [GRID-09] */
    bool minus = o < 0;
    int64_t m = minus ? -1 - o : o;
    double x;
    switch (g->kind) {
    case INTEGER: return (double)o;
    case SCALED: return (double)o * g->scale;
    case FIXED:
    case TRIMMED: x = (double)m / POWERS[g->digits]; break;
    case GENERAL: x = general(m, g->digits); break;
    case TEXT32: x = m ? shortest32(float_of((uint32_t)m)) : 0; break;
    case BINARY32: x = float_of((uint32_t)m); break;
    case VAX_F: x = vax_f(m, minus); break;
    case PRINTED: x = printed(g, m); break;
    default: x = double_of((uint64_t)m); /* TEXT64, BINARY64 */
    }
    if (x != x) return double_of(CANONICAL_NAN);
    return minus ? -x : x;
}

/* floor(log10(v)), exactly: 41 digits tell every binary64 from every power of 10 */
static int floor_log10(double v) {
    char s[48];
    if (v >= 1 && v < 1e22) {
        int x = 0;
        while (POWERS[x + 1] <= v) x++;
        return x;
    }
    return rounded(v, 41, s);
}

static int64_t general_ordinal(double x, int digits) { /* Value to ordinal of GENERAL, x finite */
    double v = x < 0 ? -x : x;
    int64_t low = TENS[digits - 1], d = 0, m = 0;
    if (v > 0) {
        char s[48];
        int e = floor_log10(v), shift = digits - 1 - e;
        if (-22 <= shift && shift <= 22) {
            double y = shift < 0 ? v / POWERS[-shift] : v * POWERS[shift];
            d = (int64_t)((y + 0x1p52) - 0x1p52); /* rint, as y < 2^52 */
        }
        if (d < low || d >= 10 * low) {
            e = rounded(v, digits, s);
            d = strtoll(s, NULL, 10);
        }
        m = e < -307 ? 0 : (e + 307) * 9 * low + d - low + 1;
        m = MIN_OF(m, 5535 * low);
    }
    return bits_of(x) >> 63 ? -1 - m : m;
}

static int64_t binary32_ordinal(double x) {
    uint32_t b = bits_of_float((float)x);
    return b >> 31 ? -1 - (int64_t)(b & 0x7FFFFFFF) : (int64_t)b;
}

/* Tokens of exceptions: `word` in any case at s, of n bytes. */
static bool begins(const char *s, size_t n, const char *word) {
    size_t i = 0;
    for (; word[i]; i++)
        if (i >= n || (s[i] >= 'A' && s[i] <= 'Z' ? s[i] + 32 : s[i]) != word[i]) return false;
    return true;
}

static size_t digits_at(const char *s, size_t n) {
    size_t i = 0;
    while (i < n && s[i] >= '0' && s[i] <= '9') i++;
    return i;
}

static bool is_number(const char *s, size_t n) {
    size_t whole = digits_at(s, n), i = whole, fraction = 0;
    if (i < n && s[i] == '.') {
        fraction = digits_at(s + i + 1, n - i - 1);
        i += 1 + fraction;
    }
    if (whole + fraction == 0) return false;
    if (i < n && (s[i] == 'e' || s[i] == 'E')) {
        i++;
        if (i < n && (s[i] == '+' || s[i] == '-')) i++;
        if (!digits_at(s + i, n - i)) return false;
        i += digits_at(s + i, n - i);
    }
    return i == n;
}

static bool is_nan_word(const char *s, size_t n) {
    if (!begins(s, n, "nan")) return false;
    if (n == 3) return true;
    if (n < 5 || s[3] != '(' || s[n - 1] != ')') return false;
    for (size_t i = 4; i < n - 1; i++) {
        char a = s[i];
        if (!((a >= '0' && a <= '9') || (a >= 'A' && a <= 'Z') || (a >= 'a' && a <= 'z') || a == '_')) return false;
    }
    return true;
}

/* D ".#" word *D: gives 2 for an infinity, 1 for a NaN, 0 for none of these */
static int hash_word(const char *s, size_t n) {
    static const char *const words[5] = {"qnan", "nan", "snan", "ind", "inf"};
    if (n < 6 || s[0] < '0' || s[0] > '9' || s[1] != '.' || s[2] != '#') return 0;
    for (int i = 0; i < 5; i++) {
        size_t l = strlen(words[i]);
        if (begins(s + 3, n - 3, words[i]) && digits_at(s + 3 + l, n - 3 - l) == n - 3 - l) return i == 4 ? 2 : 1;
    }
    return 0;
}

static double token_value(cursor *c, mcz_text t) { /* [TEXT-03] [TEXT-04] [TEXT-05] */
    const char *s = t.bytes;
    size_t n = t.size;
    bool minus = n && s[0] == '-', infinite;
    if (n && (s[0] == '-' || s[0] == '+')) s++, n--;
    if (is_number(s, n)) return minus ? -nearest_text(s, n) : nearest_text(s, n);
    infinite = (begins(s, n, "inf") && n == 3) || (begins(s, n, "infinity") && n == 8) || hash_word(s, n) == 2;
    if (infinite) return double_of(UINT64_C(0x7FF0000000000000) | (uint64_t)minus << 63);
    check(c, is_nan_word(s, n) || hash_word(s, n), "an exception that is no token [TEXT-05]");
    return double_of(CANONICAL_NAN);
}

/* ---- Lists, the map of ids and names ------------------------------------------------------------------------ */

typedef struct {
    void *items;
    size_t n, room;
} list;

/* A new item of zeros at the end, or NULL where memory is short. */
static void *push(list *l, size_t size) {
    if (l->n == l->room) {
        size_t room = l->room ? 2 * l->room : 8;
        void *p = room > SIZE_MAX / size ? NULL : realloc(l->items, room * size);
        if (!p) return NULL;
        l->items = p;
        l->room = room;
    }
    return memset((char *)l->items + size * l->n++, 0, size);
}

typedef struct { uint8_t bytes[16]; } key; /* the first bytes of a SHA-256: nobody makes two of them alike */

typedef struct {
    key key;
    size_t value; /* + 1; 0: free */
} map_slot;

typedef struct {
    map_slot *slots;
    size_t n, room; /* a power of 2 */
} map;

static map_slot *map_at(const map *t, const key *k) {
    size_t i = (size_t)load(k->bytes, 8) & (t->room - 1);
    while (t->slots[i].value && memcmp(&t->slots[i].key, k, 16)) i = (i + 1) & (t->room - 1);
    return t->slots + i;
}

static bool map_get(const map *t, const key *k, size_t *value) {
    map_slot *s = t->room ? map_at(t, k) : NULL;
    if (!s || !s->value) return false;
    *value = s->value - 1;
    return true;
}

/* Adds a key that is new. */
static bool map_add(map *t, const key *k, size_t value) {
    if (2 * t->n >= t->room) {
        map old = *t;
        map_slot *slots = calloc(old.room ? 2 * old.room : 16, sizeof *slots);
        if (!slots) return false;
        *t = (map){slots, old.n, old.room ? 2 * old.room : 16};
        for (size_t i = 0; i < old.room; i++)
            if (old.slots[i].value) *map_at(t, &old.slots[i].key) = old.slots[i];
        free(old.slots);
    }
    *map_at(t, k) = (map_slot){*k, value + 1};
    t->n++;
    return true;
}

static key key_end(sha256 *s) {
    uint8_t h[32];
    key k;
    sha_end(s, h);
    memcpy(k.bytes, h, 16);
    return k;
}

static key key_of(const char type[4], const void *p, uint64_t n) {
    sha256 s;
    sha_start(&s);
    sha_add(&s, type, 4);
    sha_add(&s, p, n);
    return key_end(&s);
}

/* ---- What is known of a file -------------------------------------------------------------------------------- */

typedef struct { /* the limits of a profile (Limits and profiles) */
    uint64_t channels, joints, segment, models, payload, template, signals, rows;
} limits;

static const limits LIMITS[3] = {
    {16384, 4096, UINT64_C(64) << 20, UINT64_C(64) << 20, UINT64_C(1) << 31, UINT64_C(64) << 20, 65536, 1 << 23},
    {1 << 20, 1 << 18, UINT64_C(1) << 34, UINT64_C(1) << 31, UINT64_C(1) << 40, UINT64_C(1) << 31, 1 << 20,
     UINT64_C(1) << 31},
    {256, 256, 2 << 20, 0, 65536, 65536, 16, 1024}};
enum { LARGE = 1, SMALL = 2, MAX_BODY = 65536 };

typedef struct {
    uint64_t offset; /* of the chunk; the first field also of what follows, see INDX */
    key id;
    size_t index;    /* of a SKEL in skeletons */
    uint8_t format;  /* of a SRCE */
} shared;

typedef struct {
    key id;
    uint8_t *unpacked; /* where the fields were packed */
    cursor joints;     /* the fields from the first joint on */
    size_t n_joints, n_channels;
    size_t n_groups;   /* joints that have channels */
    bool has_source;
} skeleton;

typedef struct {
    mcz_text name;
    size_t n_channels, n_groups;
    uint64_t rows_per_frame, skip, spare, codec, version;
    uint8_t role, preset, n_resolutions, group_kind;
    bool own, integers;
    cursor grids, sizes;   /* runs of grids, sizes of listed groups; checked */
    uint64_t n_runs, due;  /* due: the next stored frame */
    size_t first, last;    /* its first and its last segment so far, + 1 */
    size_t masked;         /* its last segment in a packet of kind 1, + 1 */
    mcz_text frame_mask;   /* and the mask of that */
} signal;

typedef struct {
    uint64_t offset, length; /* of the chunk, and of its payload */
    mcz_text name;
    size_t skeleton, signals, n_signals, segments, n_segments, n_ancillary;
    uint64_t n_frames, rate[2], first_number;
    uint64_t n_missing, missing_frames, missing_length; /* runs of missing frames, and what they add up to */
    bool open, has_source, readable;
    uint64_t cend, cend_length;
    const uint8_t *hashes;
} clip;

typedef struct {
    uint64_t offset, size;   /* of the payload */
    uint64_t first, n_frames, lead, tail;
    size_t signal;           /* among those of the clip */
    size_t next, masked;     /* next of the same signal; segment whose mask a frame has; both + 1 */
    uint8_t flags, packet;   /* packet: 0, 64 of kind 1, 32 of kind 2 */
} segment;

typedef struct {
    uint64_t offset;         /* of the chunk, or of the first part */
    mcz_text name, target;
    uint64_t size, n_parts;
    uint8_t of;
} named; /* an alias, an attachment */

typedef struct {
    uint64_t offset;
    size_t clip;
} ancillary;

typedef struct {
    uint64_t offset, length; /* of the whole chunk */
    unsigned depth;
} index_chunk;

struct mcz {
    const uint8_t *data, *words;
    uint64_t size, n_words, at; /* at: offset of what is being read */
    mcz_error error;
    crc_tables crc;
    limits limit;
    unsigned profile;
    cursor head;                /* payload of HEAD */
    uint64_t model_bytes;
    map names;                  /* of ids (shareds), clips, attachments, aliases */
    list chunks, shareds, skeletons, clips, signals, segments, attachments, parts, aliases, ancillaries, indexes;
    bool unread;                /* there is a clip of another version */
    uint64_t parts_due, part_bytes; /* of the attachment at hand */
    uint8_t attachment_hash[32];
    sha256 attachment_sha;
};

#define ITEM(type, l, i) ((type *)(l).items + (i))

static void *push_in(cursor *c, list *l, size_t size) {
    static union { shared a; skeleton b; signal c; clip d; segment e; named f; ancillary g; index_chunk h; } nowhere;
    void *p = push(l, size);
    if (!p) refuse_as(c, MCZ_NO_MEMORY, "not enough memory");
    return p ? p : memset(&nowhere, 0, sizeof nowhere);
}

static void add_name(mcz *m, cursor *c, const key *k, size_t value) {
    if (!c->bad && !map_add(&m->names, k, value)) refuse_as(c, MCZ_NO_MEMORY, "not enough memory");
}

static void *allocate(cursor *c, uint64_t n) {
    void *p = n < SIZE_MAX ? malloc(n ? (size_t)n : 1) : NULL;
    if (!p) refuse_as(c, MCZ_NO_MEMORY, "not enough memory");
    return p;
}

/* max(64 MiB, 4096 x the bytes of the file) [LIMIT-10] [LIMIT-11] */
static uint64_t bytes_limit(const mcz *m) {
    uint64_t by_size = m->size < MAX_COUNT >> 12 ? m->size << 12 : MAX_COUNT;
    return MAX_OF(UINT64_C(64) << 20, by_size);
}

enum { STORED, DEFLATED, AFTER_WORDS };

static inflater inflater_of(const mcz *m, const cursor *c, unsigned encoding, uint64_t size) {
    inflater f = {.in = *c, .size = size, .after_words = encoding == AFTER_WORDS};
    if (f.after_words) f.words = m->words, f.n_words = m->n_words;
    return f;
}

static void check_encoding(mcz *m, cursor *c, unsigned encoding, uint64_t size) {
    check(c, encoding <= AFTER_WORDS, "an encoding of no meaning [CONV-15]");
    check(c, encoding == STORED || m->profile != SMALL, "an encoding but 0 in the small profile [LIMIT-22]");
    if (encoding == STORED) check(c, size == left(c), "stored bytes of another size than stated");
    check(c, size / 1032 <= left(c), "more than deflate can inflate to [LIMIT-14]");
}

/* What is left of c, decoded: in c itself where it is stored, else in *owned, which the caller frees. */
static cursor decoded(mcz *m, cursor *c, unsigned encoding, uint64_t size, uint8_t **owned) {
    *owned = NULL;
    check_encoding(m, c, encoding, size);
    if (c->bad || encoding == STORED) return over(c->p, c->bad ? 0 : size);
    inflater f = inflater_of(m, c, encoding, size);
    f.out = *owned = allocate(c, size);
    if (c->bad) return over(c->p, 0);
    inflate(&f);
    *c = f.in;
    return over(*owned, c->bad ? 0 : size);
}

/* The same, into a hash. */
static void hash_decoded(mcz *m, cursor *c, unsigned encoding, uint64_t size, sha256 *sha) {
    check_encoding(m, c, encoding, size);
    if (c->bad) return;
    if (encoding == STORED) {
        sha_add(sha, bytes(c, size), size);
        return;
    }
    inflater f = inflater_of(m, c, encoding, size);
    f.sink = sha;
    f.out = allocate(c, 2 * WINDOW);
    if (c->bad) return;
    inflate(&f);
    free(f.out);
    *c = f.in;
}

/* Versions: [HEAD-01], and of drafts [HEAD-03]. */
static bool version_is_ours(unsigned major, unsigned minor) { return major == MAJOR && minor == MINOR; }

static void read_head(mcz *m, cursor *c) {
    m->head = *c;
    bytes(c, 2); /* [HEAD-04] */
    unsigned major = get8(c), minor = get8(c), profile = get8(c);
    if (c->bad) return;
    bool ours = version_is_ours(major, minor);
    if (!ours) refuse_as(c, MCZ_UNSUPPORTED, "a file of another version [HEAD-01] [HEAD-03]");
    if (profile > SMALL) refuse_as(c, MCZ_UNSUPPORTED, "an unknown profile [CONV-16]");
    if (c->bad) return;
    m->profile = profile;
    m->limit = LIMITS[profile];
}

/* ---- Shared structures of SKEL and CLIP --------------------------------------------------------------------- */

typedef struct {
    unsigned kind;
    mcz_text name, unit;
} channel;

static channel get_channel(cursor *c) {
    channel ch = {0};
    unsigned flags = get_flags(c, 1 | 2 | 128);
    ch.kind = get8(c); /* [SKEL-07] */
    if (flags & 1) ch.name = text(c);
    if (flags & 2) ch.unit = text(c);
    extension(c, flags);
    return ch;
}

static const shared *find_shared(const mcz *m, const uint8_t *id) {
    key k;
    size_t i;
    memcpy(k.bytes, id, 16);
    return map_get(&m->names, &k, &i) ? ITEM(shared, m->shareds, i) : NULL;
}

static bool is_type(const mcz *m, const shared *s, const char *type) {
    return s && !memcmp(m->data + s->offset, type, 4);
}

enum { ASF = 1 };
static bool of_clips(unsigned format) { return within(format, 2, 14) || format == 16; }

static void check_path(cursor *c, mcz_text t, bool may_be_empty) {
    size_t begin = 0;
    if (c->bad || (t.size == 0 && may_be_empty)) return;
    for (size_t i = 0; i <= t.size; i++) {
        char a = i < t.size ? t.bytes[i] : '/';
        check(c, a != '\\', "a path with a backslash [PATH-03]");
        check(c, a != 0, "a path with a code point 0 [PATH-04]");
        check(c, a != ':' || memchr(t.bytes, '/', i), "a path with a colon in its first part [PATH-05]");
        if (a != '/') continue;
        check(c, i > begin, "a path with an empty part [PATH-01]");
        check(c, !(i == begin + 1 && t.bytes[begin] == '.'), "a path with a part that is . [PATH-02]");
        check(c, !(i == begin + 2 && !memcmp(t.bytes + begin, "..", 2)), "a path with a part that is .. [PATH-02]");
        begin = i + 1;
    }
}

static bool is_known(mcz *m, const char tag[4], mcz_text name, size_t *index) {
    key k = key_of(tag, name.bytes, name.size);
    return map_get(&m->names, &k, index);
}

static void unique_name(mcz *m, cursor *c, const char tag[4], mcz_text name, size_t index, const char *why) {
    key k = key_of(tag, name.bytes, name.size);
    size_t i;
    check(c, !map_get(&m->names, &k, &i), why);
    add_name(m, c, &k, index);
}

/* Pairs of key and value, or keys alone, each once. */
static void get_keys(cursor *c, bool pairs, bool once, const char *why, const char *const *forbidden) {
    map seen = {0};
    for (uint64_t n = counted(c, 1 + pairs); n && !c->bad; n--) {
        mcz_text name = text(c);
        if (pairs) text(c);
        for (int i = 0; forbidden && i < 3; i++)
            check(c, !same_text(name, forbidden[i]), "a META sets what CLIP says [META-03]");
        if (!once || c->bad) continue;
        key k = key_of("key ", name.bytes, name.size);
        size_t i;
        check(c, !map_get(&seen, &k, &i), why);
        if (!c->bad && !map_add(&seen, &k, 0)) refuse_as(c, MCZ_NO_MEMORY, "not enough memory");
    }
    free(seen.slots);
}

static uint64_t add(cursor *c, uint64_t a, uint64_t b) { /* [CONV-18] */
    check(c, a <= MAX_COUNT && b <= MAX_COUNT - a, "a sum beyond 2^53 - 1 [CONV-18]");
    return c->bad ? 0 : a + b;
}

static uint64_t multiply(cursor *c, uint64_t a, uint64_t b) {
    check(c, b == 0 || a <= MAX_COUNT / b, "a product beyond 2^53 - 1 [CONV-18]");
    return c->bad ? 0 : a * b;
}

/* ---- SKEL --------------------------------------------------------------------------------------------------- */

static void finite(cursor *c, int n) {
    while (n--) check(c, is_finite(get_double(c)), "an offset, tail or axis that is not finite [SKEL-08]");
}

static size_t get_joint(cursor *c, size_t i, mcz_joint *out) { /* its number of channels */
    out->name = text(c);
    uint64_t parent = varint(c), n;
    check(c, parent <= i, "a parent behind its child [SKEL-05]");
    out->parent = (size_t)parent;
    unsigned flags = get_flags(c, 1 | 2 | 4 | 128);
    for (int j = 0; j < 3; j++) out->offset[j] = flags & 2 ? get_double(c) : 0;
    for (int j = 0; j < 3; j++) check(c, is_finite(out->offset[j]), "an offset that is not finite [SKEL-08]");
    if (flags & 4) {
        finite(c, 3);
        check(c, get8(c) <= 5, "an axis order of no meaning [CONV-15]");
    }
    for (n = counted(c, 24); n && !c->bad; n--) finite(c, 3);
    n = counted(c, 2);
    out->n_channels = (size_t)n;
    for (uint64_t j = 0; j < n && !c->bad; j++) get_channel(c);
    extension(c, flags);
    return out->n_channels;
}

static void skeleton_source(mcz *m, cursor *c) {
    const shared *s = find_shared(m, bytes(c, 16));
    unsigned format = get8(c);
    varint(c);
    bytes(c, 32);
    if (c->bad) return;
    check(c, is_type(m, s, "SRCE"), "a SKEL names a SRCE that no chunk before it has [GRAM-03]");
    check(c, !of_clips(format), "a skeleton's source of a format of clips [SKEL-03]");
    check(c, c->bad || s->format == format, "a skeleton's source of another format than its SRCE [SKEL-04]");
}

/* The fields from unit_cm on. */
static void skeleton_fields(mcz *m, cursor *c, skeleton *k) {
    if (optional(c)) {
        double cm = get_double(c);
        check(c, is_finite(cm) && cm > 0, "unit_cm that is not positive and finite [SKEL-01]");
    }
    check(c, get8(c) <= 2, "an angle unit of no meaning [CONV-15]");
    unsigned up = get8(c), forward = get8(c);
    check(c, up <= 6 && forward <= 6, "an axis of no meaning [CONV-15]");
    check(c, !up || !forward || up % 3 != forward % 3, "a figure that faces along its up axis [SKEL-10]");
    check(c, get8(c) <= 2, "a handedness of no meaning [CONV-15]");
    if (optional(c)) {
        const shared *base = find_shared(m, bytes(c, 16));
        check(c, is_type(m, base, "SKEL"), "a base that no chunk before has [SKEL-02]");
    }
    k->has_source = optional(c);
    if (k->has_source) skeleton_source(m, c);
    k->n_joints = (size_t)counted(c, 5);
    check(c, k->n_joints <= m->limit.joints, "too many joints [LIMIT-04]");
    k->joints = *c;
    for (size_t i = 0; i < k->n_joints && !c->bad; i++) {
        mcz_joint joint;
        size_t n = get_joint(c, i, &joint);
        k->n_channels += n;
        k->n_groups += n > 0;
        check(c, k->n_channels <= m->limit.channels, "too many channels of a skeleton [LIMIT-03]");
    }
}

static void add_shared(mcz *m, cursor *c, const key *id, unsigned format, size_t index) {
    size_t i;
    if (c->bad || map_get(&m->names, id, &i)) return; /* the first counts [GRAM-05] */
    add_name(m, c, id, m->shareds.n);
    *(shared *)push_in(c, &m->shareds, sizeof(shared)) = (shared){m->at, *id, index, (uint8_t)format};
}

static void read_skel(mcz *m, cursor *c) {
    const uint8_t *begin = c->p;
    skeleton k = {0};
    uint8_t *owned = NULL;
    sha256 sha;
    text(c);
    uint8_t flags = (uint8_t)get_flags(c, 3), plain = flags & 1;
    if (c->bad) return;
    sha_start(&sha);
    sha_add(&sha, "SKEL", 4);
    sha_add(&sha, begin, (uint64_t)(c->p - begin) - 1);
    sha_add(&sha, &plain, 1);
    cursor fields = over(c->p, left(c));
    if (flags & 2) {
        uint64_t size = varint(c);
        check(c, size <= m->limit.template, "a packed SKEL larger than a template may be [SKEL-09]");
        fields = decoded(m, c, AFTER_WORDS, size, &owned);
    }
    sha_add(&sha, fields.p, left(&fields));
    k.id = key_end(&sha);
    if (!c->bad) {
        skeleton_fields(m, &fields, &k);
        if (fields.bad) refuse_as(c, fields.code, fields.bad);
    }
    k.unpacked = owned;
    if (c->bad || find_shared(m, k.id.bytes)) { /* the first counts [GRAM-05] */
        free(owned);
        return;
    }
    add_shared(m, c, &k.id, 0, m->skeletons.n);
    *(skeleton *)push_in(c, &m->skeletons, sizeof k) = k;
    if (c->bad) free(owned);
}

/* ---- CLIP, CEND --------------------------------------------------------------------------------------------- */

static void get_missing(cursor *c, clip *k) { /* [TIME-01] */
    uint64_t n = counted(c, 2);
    k->n_missing = n;
    k->missing_frames = k->missing_length = 0;
    for (; n && !c->bad; n--) {
        uint64_t frames = varint(c), length = varint(c);
        check(c, frames >= 1 && length >= 1, "a run of missing frames that is empty [TIME-01]");
        k->missing_frames = add(c, k->missing_frames, frames);
        k->missing_length = add(c, k->missing_length, length);
    }
}

static void check_numbers(cursor *c, const clip *k, int64_t number) { /* of the frames [TIME-02] [TIME-03] */
    const int64_t most = (INT64_C(1) << 52) - 1;
    check(c, k->n_missing == 0 || k->missing_frames < k->n_frames, "a missing run behind the last frame [TIME-02]");
    if (c->bad || k->n_frames == 0) return;
    number += (int64_t)(k->n_frames - 1) + (int64_t)k->missing_length;
    check(c, number <= most, "a frame number beyond 2^52 - 1 [TIME-03]");
}

static bool time_base(cursor *c, clip *k) { /* whether it has a first time */
    k->first_number = (uint64_t)zigzag_varint(c);
    bool timed = optional(c);
    if (timed) check(c, is_finite(get_double(c)), "a first time that is not finite [TIME-06]");
    get_missing(c, k);
    check(c, !k->open || k->n_missing == 0, "CLIP has missing frames that CEND tells [TIME-04]");
    return timed;
}

static void clip_source(mcz *m, cursor *c) {
    unsigned flags = get_flags(c, 128);
    const shared *s = find_shared(m, bytes(c, 16));
    unsigned format = get8(c);
    sized(c);
    check_path(c, text(c), true);
    varint(c);
    extension(c, flags);
    if (c->bad) return;
    check(c, is_type(m, s, "SRCE"), "a CLIP names a SRCE that no chunk before it has [GRAM-03]");
    check(c, c->bad || s->format == format, "a source of another format than its SRCE [CLIP-03]");
    check(c, format != ASF, "a clip's source of a format of skeletons [CLIP-04]");
}

static bool is_second(mcz_text unit) {
    return same_text(unit, "s") || same_text(unit, "ms") || same_text(unit, "us") || same_text(unit, "ns");
}

enum { RAW, FAST, BEST, MOTION = 1, TIMES = 2, RESIDUALS = 3 };
static bool codec_of_values(uint64_t codec) { return codec == 3 || (codec >= 16 && codec <= 21); }

static void get_grids(mcz *m, cursor *c, signal *s) {
    uint64_t n = 0;
    s->n_runs = counted(c, 4);
    s->grids = *c;
    s->integers = s->n_channels > 0;
    for (uint64_t i = 0; i < s->n_runs && !c->bad; i++) {
        uint64_t channels = varint(c);
        grid g = get_grid(c);
        check(c, channels >= 1, "a run of grids without a channel [CLIP-06]");
        check(c, g.kind != PRINTED || m->profile != SMALL, "a grid PRINTED in the small profile [LIMIT-21]");
        n = add(c, n, channels);
        s->integers &= g.kind == INTEGER;
    }
    check(c, n == s->n_channels, "grids of more or fewer channels than there are [CLIP-07]");
}

static void get_groups(cursor *c, signal *s, const skeleton *k) { /* [CLIP-08] */
    s->group_kind = (uint8_t)get8(c);
    check(c, s->group_kind <= 3, "groups of no kind [CONV-15]");
    check(c, s->group_kind != 1 || !s->own, "groups per joint without the skeleton's channels [CLIP-09]");
    if (s->group_kind == 0) s->n_groups = s->n_channels > 0;
    if (s->group_kind == 1) s->n_groups = k->n_groups;
    if (s->group_kind == 2) s->n_groups = s->n_channels;
    if (s->group_kind != 3) return;
    uint64_t sum = 0;
    s->n_groups = (size_t)counted(c, 1);
    s->sizes = *c;
    for (size_t i = 0; i < s->n_groups && !c->bad; i++) {
        uint64_t n = varint(c);
        check(c, n > 0, "a group without channels [CLIP-10]");
        sum = add(c, sum, n);
    }
    check(c, sum == s->n_channels, "groups of more or fewer channels than there are [CLIP-11]");
}

static void check_codec(mcz *m, cursor *c, const signal *s, uint64_t header) {
    bool core = s->codec <= FAST && s->version == 0;
    check(c, m->profile != SMALL || s->codec <= FAST, "a codec that the small profile has not [LIMIT-20]");
    check(c, !core || header == 0, "a header of raw or fast that is not empty [RAW-01] [FAST-01]");
    check(c, s->n_resolutions >= 1, "no resolution [CLIP-13]");
    check(c, !core || s->n_resolutions == 1, "more resolutions than the codec has [CLIP-15]");
    check(c, !s->integers || !codec_of_values(s->codec), "integers in a codec of values [CODEC-01]");
}

static void get_signal(mcz *m, cursor *c, const clip *k, size_t index, signal *s) {
    const skeleton *skel = ITEM(skeleton, m->skeletons, k->skeleton);
    channel last = {0};
    s->name = text(c);
    unsigned flags = get_flags(c, 1 | 128);
    s->own = flags & 1;
    s->role = (uint8_t)get8(c);
    if (s->role == RESIDUALS) {
        uint64_t of = varint(c);
        check(c, of < k->n_signals && of != index, "residuals of no other signal [ROLE-05]");
    }
    check(c, s->role != MOTION || index == 0, "a motion that is not the first signal [ROLE-01]");
    s->n_channels = s->own ? (size_t)counted(c, 2) : skel->n_channels;
    check(c, s->n_channels <= m->limit.channels, "too many channels of a signal [LIMIT-03]");
    for (size_t i = 0; s->own && i < s->n_channels && !c->bad; i++) last = get_channel(c);
    s->rows_per_frame = varint(c);
    check(c, s->rows_per_frame >= 1, "no row a frame [CLIP-12]");
    s->skip = varint(c);
    s->spare = varint(c);
    check(c, !k->open || (s->skip == 0 && s->spare == 0), "frames that are not shown in an open clip [CLIP-19]");
    get_grids(m, c, s);
    s->codec = varint(c);
    s->preset = (uint8_t)get8(c); /* [CODEC-07] */
    s->version = varint(c);
    mcz_text header = sized(c);
    get_groups(c, s, skel);
    s->n_resolutions = (uint8_t)get8(c);
    extension(c, flags);
    check_codec(m, c, s, header.size);
    if (s->role != TIMES || c->bad) return;
    check(c, s->rows_per_frame == 1 && s->own && s->n_channels == 1, "times of other rows or channels [ROLE-03]");
    check(c, last.kind == 0 || last.kind > 17, "times that are no plain scalar [ROLE-03]");
    check(c, is_second(last.unit), "times of another unit [ROLE-03]");
    check(c, !codec_of_values(s->codec), "times of a codec of values [ROLE-03]");
}

static void clip_signals(mcz *m, cursor *c, clip *k, bool first_time) {
    size_t times = 0;
    k->signals = m->signals.n;
    k->n_signals = (size_t)counted(c, 13);
    check(c, k->n_signals >= 1, "a clip without a signal [CLIP-05]");
    check(c, k->n_signals <= m->limit.signals, "too many signals [LIMIT-18]");
    for (size_t i = 0; i < k->n_signals && !c->bad; i++) {
        signal s = {0};
        get_signal(m, c, k, i, &s);
        times += s.role == TIMES;
        *(signal *)push_in(c, &m->signals, sizeof s) = s;
    }
    check(c, times <= 1, "two signals of times [ROLE-02]");
    check(c, !times || !first_time, "a first time beside a signal of times [TIME-07]");
}

static void clip_fields(mcz *m, cursor *c, clip *k) {
    bool first_time = false;
    k->name = text(c);
    check(c, k->name.size > 0, "a clip without a name [CLIP-01]");
    unsigned flags = get_flags(c, 7);
    const shared *s = find_shared(m, bytes(c, 16));
    check(c, is_type(m, s, "SKEL"), "a CLIP names a SKEL that no chunk before it has [GRAM-02]");
    if (c->bad) return;
    unique_name(m, c, "clip", k->name, m->clips.n, "two clips of one name [GRAM-06]");
    k->skeleton = s->index;
    k->open = flags & 1;
    k->n_frames = varint(c);
    check(c, !k->open || k->n_frames == 0, "frames of an open clip in CLIP [CLIP-16]");
    k->rate[0] = varint(c);
    k->rate[1] = varint(c);
    check(c, k->rate[1] >= 1, "a rate with the denominator 0 [CLIP-14]");
    k->first_number = 1;
    if (flags & 4) first_time = time_base(c, k);
    get_keys(c, true, true, "a key of the metadata twice [CLIP-02]", NULL);
    k->has_source = optional(c);
    if (k->has_source) clip_source(m, c);
    clip_signals(m, c, k, first_time);
}

static void read_clip(mcz *m, cursor *c) {
    clip k = {.offset = m->at, .length = left(c), .segments = m->segments.n};
    unsigned major = get8(c), minor = get8(c), head = 256 * m->head.p[2] + m->head.p[3];
    check(c, c->bad || 256 * major + minor <= head, "a clip that needs more than HEAD says [CLIP-22]");
    k.readable = version_is_ours(major, minor); /* [CLIP-23] */
    if (k.readable) clip_fields(m, c, &k);
    m->unread |= !k.readable;
    *(clip *)push_in(c, &m->clips, sizeof k) = k;
}

static clip *last_clip(mcz *m) { return ITEM(clip, m->clips, m->clips.n - 1); }

/* Every signal has its stored frames: skip + n_frames + spare [DATA-08] [CLIP-20]. */
static void check_stored(mcz *m, cursor *c, const clip *k) {
    for (size_t i = 0; i < k->n_signals && !c->bad; i++) {
        const signal *s = ITEM(signal, m->signals, k->signals + i);
        uint64_t stored = add(c, add(c, s->skip, k->n_frames), s->spare);
        multiply(c, stored, s->rows_per_frame);
        check(c, s->due == stored, "segments that do not cover the stored frames [DATA-08]");
    }
}

static void read_cend(mcz *m, cursor *c) {
    clip *k = last_clip(m), runs = {0};
    k->cend = m->at;
    k->cend_length = left(c);
    k->n_segments = m->segments.n - k->segments;
    if (!k->readable) return;
    uint64_t n = varint(c);
    check(c, k->open || n == k->n_frames, "CLIP and CEND have other numbers of frames [CLIP-17]");
    k->n_frames = n;
    get_missing(c, &runs);
    check(c, k->open || runs.n_missing == 0, "CEND has missing frames of a clip that is not open [TIME-05]");
    if (k->open) {
        k->n_missing = runs.n_missing;
        k->missing_frames = runs.missing_frames;
        k->missing_length = runs.missing_length;
    }
    check_numbers(c, k, (int64_t)k->first_number);
    bool source = optional(c);
    if (source) bytes(c, 32);
    check(c, source == k->has_source, "the hash of a source without the source, or the other way round [CEND-01]");
    n = counted(c, 32);
    check(c, n == k->n_signals, "value hashes of more or fewer signals than there are [CEND-02]");
    k->hashes = bytes(c, 32 * n);
    check_stored(m, c, k);
}

/* ---- Segments and packets ----------------------------------------------------------------------------------- */

enum { FRESH = 1, FRAME_NOTES = 2, GROUP_NOTES = 4, MASKS = 8, KIND1 = 64, KIND2 = 32 };

/* The streams of a segment, one after the other. */
typedef struct {
    const uint8_t *present;
    cursor lengths, streams;
    uint64_t i, n;
} stream_table;

static mcz_text next_stream(stream_table *t) {
    uint64_t i = t->i++;
    if (i >= t->n || !(t->present[i / 8] >> i % 8 & 1)) return (mcz_text){"", 0};
    uint64_t n = varint(&t->lengths);
    return (mcz_text){(const char *)bytes(&t->streams, n), (size_t)n};
}

static void get_lengths(cursor *c, stream_table *t) { /* and `present` */
    t->present = bytes(c, (t->n + 7) / 8);
    if (c->bad) return;
    check(c, t->n % 8 == 0 || !(t->present[t->n / 8] >> t->n % 8), "bits after the last stream [DATA-05]");
    t->lengths = *c;
    t->streams.p = t->streams.end = NULL;
    uint64_t sum = 0;
    for (uint64_t i = 0; i < t->n && !c->bad; i++) {
        if (!(t->present[i / 8] >> i % 8 & 1)) continue;
        uint64_t n = varint(c);
        check(c, n >= 1, "a stream that is marked and empty [DATA-04]");
        sum = add(c, sum, n);
    }
    t->i = sum; /* until the streams are known */
}

static void check_size(const mcz *m, cursor *c, const signal *s, const segment *g) {
    uint64_t rows = multiply(c, g->n_frames, s->rows_per_frame), columns = MAX_OF(1, s->n_channels);
    check(c, rows <= m->limit.rows, "too many rows in a segment [LIMIT-19]");
    check(c, rows <= m->limit.segment / 8 / columns, "too many bytes in a segment [LIMIT-05]");
    if (s->codec != FAST || s->version != 0) return;
    check(c, rows * s->n_channels <= 1 << 23, "too many values in a segment of fast [FAST-18]");
    check(c, rows <= 4096 || g->n_frames == 1, "too many rows in a segment of fast [FAST-18]");
}

/* The table of the segment that c holds. Its fields go to g, its streams to t. */
static void get_segment(const mcz *m, cursor *c, const clip *k, segment *g, stream_table *t) {
    const uint8_t *begin = c->p;
    *g = (segment){.offset = (uint64_t)(c->p - m->data), .size = left(c)};
    uint64_t index = varint(c);
    check(c, index < k->n_signals, "a segment of no signal [DATA-06]");
    if (c->bad) return;
    g->signal = (size_t)index;
    const signal *s = ITEM(signal, m->signals, k->signals + index);
    g->first = varint(c);
    g->n_frames = varint(c);
    check(c, g->n_frames >= 1, "a segment without frames [DATA-07]");
    g->lead = varint(c);
    check(c, g->lead <= g->first, "a lead beyond the first frame [DATA-10]");
    g->tail = varint(c);
    add(c, add(c, g->first, g->n_frames), g->tail);
    g->flags = (uint8_t)get_flags(c, FRESH | FRAME_NOTES | GROUP_NOTES | MASKS | 128);
    check(c, !(g->flags & FRAME_NOTES) || (index == 0 && k->has_source), "frame notes without a source [NOTES-01]");
    check(c, !(g->flags & GROUP_NOTES) || m->profile != SMALL, "group notes in the small profile [LIMIT-21]");
    check_size(m, c, s, g);
    uint64_t per_group = s->n_resolutions + !!(g->flags & GROUP_NOTES) + !!(g->flags & MASKS);
    *t = (stream_table){.n = !!(g->flags & FRAME_NOTES) + per_group * s->n_groups};
    get_lengths(c, t);
    extension(c, g->flags);
    uint32_t crc = c->bad ? 0 : crc32(&m->crc, 0, begin, (uint64_t)(c->p - begin));
    check(c, crc_is(crc, load(bytes(c, 4), 4)), "the checksum of a stream table is wrong [DATA-02]");
    check(c, t->i == left(c), "a segment that does not end with its last stream [DATA-01]");
    t->i = 0;
    t->streams = *c;
    t->lengths.end = c->end;
}

/* A segment takes its place among those of its signal. */
static void place_segment(mcz *m, cursor *c, clip *k, segment *g) {
    signal *s = ITEM(signal, m->signals, k->signals + g->signal);
    check(c, g->first == s->due, "a gap or an overlap between segments [DATA-08]");
    check(c, s->first || g->flags & FRESH, "the first segment of a signal does not start fresh [DATA-12]");
    if (c->bad) return;
    s->due = add(c, s->due, g->n_frames);
    *(segment *)push_in(c, &m->segments, sizeof *g) = *g;
    if (c->bad) return;
    if (s->first) ITEM(segment, m->segments, s->last - 1)->next = m->segments.n;
    else s->first = m->segments.n;
    s->last = m->segments.n;
}

static void read_data(mcz *m, cursor *c) {
    segment g;
    stream_table t;
    clip *k = last_clip(m);
    if (!k->readable) return;
    get_segment(m, c, k, &g, &t);
    if (!c->bad) place_segment(m, c, k, &g);
}

/* The streams of a segment that was checked. */
static stream_table streams_of(const mcz *m, const clip *k, const segment *g) {
    segment again;
    stream_table t;
    cursor c = over(m->data + g->offset, g->size);
    get_segment(m, &c, k, &again, &t);
    return t;
}

/* The mask of its first group; that of a frame is that of the segment before. */
static mcz_text first_mask(const mcz *m, const clip *k, const segment *g) {
    stream_table t = streams_of(m, k, g);
    if (!(g->flags & MASKS)) return (mcz_text){"", 0};
    if (g->flags & FRAME_NOTES) next_stream(&t);
    if (g->flags & GROUP_NOTES) next_stream(&t);
    return next_stream(&t);
}

static void packet_segment(mcz *m, cursor *body, clip *k, unsigned kind) { /* kind 1 */
    segment g;
    stream_table t;
    get_segment(m, body, k, &g, &t);
    if (body->bad) return;
    check(body, (g.flags & FRESH) == kind >> 7, "a packet and its segment disagree on fresh [PACK-11]");
    g.packet = KIND1;
    place_segment(m, body, k, &g);
    signal *s = ITEM(signal, m->signals, k->signals);
    if (body->bad || g.signal != 0) return;
    s->masked = m->segments.n;
    s->frame_mask = s->n_groups == 1 ? first_mask(m, k, &g) : (mcz_text){"", 0};
}

static void packet_frame(mcz *m, cursor *body, clip *k, unsigned kind, size_t opened) { /* kind 2 */
    const signal *s = ITEM(signal, m->signals, k->signals);
    check(body, s->n_groups == 1 && s->n_resolutions == 1, "a frame of several groups or resolutions [PACK-13]");
    check(body, s->masked > opened, "a frame before any segment of its DATA [PACK-14]");
    if (body->bad) return;
    segment g = {.offset = (uint64_t)(body->p - m->data), .size = left(body), .first = s->due, .n_frames = 1};
    g.flags = kind >> 7;
    g.packet = KIND2;
    g.masked = s->masked;
    const segment *masked = ITEM(segment, m->segments, s->masked - 1);
    check(body, !(masked->flags & MASKS) || masked->n_frames == 1, "a frame with the mask of several [PACK-21]");
    check_size(m, body, s, &g);
    place_segment(m, body, k, &g);
}

static uint32_t frame_crc(const mcz *m, const signal *s, uint32_t crc) { /* what a frame implies [PACK-15] */
    uint8_t due[8];
    for (int i = 0; i < 8; i++) due[i] = (uint8_t)(s->due >> 8 * i);
    crc = crc32(&m->crc, crc, due, 8);
    return crc32(&m->crc, crc, (const uint8_t *)s->frame_mask.bytes, s->frame_mask.size);
}

/* One packet; returns its kind. */
static unsigned read_packet(mcz *m, cursor *c, clip *k, uint64_t sequence, size_t opened) {
    const uint8_t *begin = c->p;
    unsigned kind = get8(c);
    check(c, !(kind & 0x70), "reserved bits of a packet [PACK-08]");
    check(c, (kind & 15) <= 2, "a packet of no kind [PACK-09]");
    check(c, varint(c) == sequence, "packets that do not count from 0 [PACK-02]");
    uint64_t n = varint(c);
    check(c, n <= MAX_BODY, "the body of a packet is too long [LIMIT-08]");
    check(c, (kind & 15) != 0 || n == 0, "an end packet with a body [PACK-05]");
    if (c->bad) return 0;
    uint32_t crc = crc32(&m->crc, 0, begin, (uint64_t)(c->p - begin));
    cursor body = over(bytes(c, n), c->bad ? 0 : n);
    uint32_t stated = (uint32_t)load(bytes(c, 4), 4);
    if (c->bad) return 0;
    const signal *s = k->readable ? ITEM(signal, m->signals, k->signals) : NULL;
    if ((kind & 15) == 2 && s) crc = frame_crc(m, s, crc);
    crc = crc32(&m->crc, crc, body.p, n);
    check(c, crc_is(crc, stated) || ((kind & 15) == 2 && !s), "the checksum of a packet is wrong [PACK-04] [PACK-15]");
    if (c->bad || !s) return kind & 15;
    if ((kind & 15) == 1) packet_segment(m, &body, k, kind);
    if ((kind & 15) == 2) packet_frame(m, &body, k, kind, opened);
    if (body.bad) refuse_as(c, body.code, body.bad);
    return kind & 15;
}

static void read_packets(mcz *m, cursor *c) { /* of an open DATA [PACK-01] */
    size_t opened = m->segments.n;
    unsigned kind = 1;
    for (uint64_t sequence = 0; kind && !c->bad; sequence++) {
        m->at = (uint64_t)(c->p - m->data);
        kind = read_packet(m, c, last_clip(m), sequence, opened);
    }
}

/* ---- Shared chunks, META, COPY, QUAL ------------------------------------------------------------------------ */

static void read_srce(mcz *m, cursor *c) {
    sha256 sha;
    uint8_t head[2] = {(uint8_t)get8(c)};
    unsigned flags = get_flags(c, 3 | 128);
    head[1] = flags & 128;
    const uint8_t *fields = c->p;
    uint64_t size = varint(c);
    extension(c, flags);
    check(c, size <= m->limit.template, "a template that is too large [LIMIT-09]");
    check(c, size <= bytes_limit(m), "a template that is too large [LIMIT-11]");
    if (c->bad) return;
    sha_start(&sha);
    sha_add(&sha, "SRCE", 4);
    sha_add(&sha, head, 2);
    sha_add(&sha, fields, (uint64_t)(c->p - fields));
    hash_decoded(m, c, flags & 3, size, &sha); /* [SRCE-01] */
    key id = key_end(&sha);
    add_shared(m, c, &id, head[0], 0);
}

static void read_modl(mcz *m, cursor *c) {
    key id = key_of("MODL", c->p, left(c));
    check(c, m->profile != SMALL, "a MODL in the small profile [LIMIT-23]");
    m->model_bytes += left(c); /* fewer than those of the file */
    check(c, m->model_bytes <= m->limit.models, "models that are too large [LIMIT-06]");
    unsigned flags = get_flags(c, 128);
    varint(c);
    extension(c, flags);
    add_shared(m, c, &id, 0, 0);
}

static void first_part(mcz *m, cursor *c, named *a) {
    check(c, a->n_parts >= 1, "an attachment of no parts [ATTA-01]");
    check(c, a->size <= bytes_limit(m), "an attachment that is too large [LIMIT-11]");
    check_path(c, a->name, false);
    if (c->bad) return;
    unique_name(m, c, "atta", a->name, m->attachments.n, "two attachments of one name [GRAM-07]");
    *(named *)push_in(c, &m->attachments, sizeof *a) = *a;
    m->parts_due = a->n_parts;
    m->part_bytes = 0;
    sha_start(&m->attachment_sha);
}

static void read_atta(mcz *m, cursor *c) {
    named a = {.name = text(c), .offset = m->at};
    uint64_t part = varint(c);
    uint8_t hash[32];
    a.n_parts = varint(c);
    a.size = varint(c);
    memcpy(hash, bytes(c, 32), 32);
    unsigned flags = get_flags(c, 3 | 128);
    uint64_t size = varint(c);
    extension(c, flags);
    if (!m->parts_due) {
        check(c, part == 0, "an attachment that does not begin with part 0 [ATTA-01]");
        first_part(m, c, &a);
        memcpy(m->attachment_hash, hash, 32);
    }
    if (c->bad) return;
    const named *first = ITEM(named, m->attachments, m->attachments.n - 1);
    bool same = a.name.size == first->name.size && !memcmp(a.name.bytes, first->name.bytes, a.name.size);
    same &= a.n_parts == first->n_parts && a.size == first->size && !memcmp(hash, m->attachment_hash, 32);
    check(c, same, "parts of an attachment that disagree [ATTA-02]");
    check(c, part == first->n_parts - m->parts_due, "parts of an attachment out of order [ATTA-01]");
    check(c, size <= first->size - m->part_bytes, "parts of an attachment that are too long [ATTA-04]");
    hash_decoded(m, c, flags & 3, size, &m->attachment_sha); /* [ATTA-03] */
    *(ancillary *)push_in(c, &m->parts, sizeof(ancillary)) = (ancillary){m->at, 0};
    m->part_bytes += size;
    if (c->bad || --m->parts_due) return;
    check(c, m->part_bytes == first->size, "parts of an attachment that are too short [ATTA-04]");
    sha_end(&m->attachment_sha, hash);
    check(c, !memcmp(hash, m->attachment_hash, 32), "the hash of an attachment is wrong [ATTA-05]");
}

static void read_alia(mcz *m, cursor *c) {
    named a = {.name = text(c), .offset = m->at, .of = (uint8_t)get8(c)};
    size_t i;
    const shared *s;
    a.target = sized(c);
    check(c, a.of <= 2, "an alias of no kind [CONV-15]");
    check_path(c, a.name, false);
    if (c->bad) return;
    unique_name(m, c, "alia", a.name, m->aliases.n, "two aliases of one name [GRAM-08]");
    if (a.of == 0) {
        bool known = is_known(m, "clip", a.target, &i);
        check(c, known || m->unread, "an alias of a clip that is not before it [GRAM-04]");
        check(c, !known || ITEM(clip, m->clips, i)->has_source, "an alias of a clip without a source [ALIA-02]");
    } else if (a.of == 1) {
        s = a.target.size == 16 ? find_shared(m, (const uint8_t *)a.target.bytes) : NULL;
        check(c, is_type(m, s, "SKEL"), "an alias of a SKEL that is not before it [GRAM-04]");
        bool source = !c->bad && ITEM(skeleton, m->skeletons, s->index)->has_source;
        check(c, source, "an alias of a SKEL without a source [ALIA-01]");
    } else {
        check(c, is_known(m, "atta", a.target, &i), "an alias of an attachment that is not before it [GRAM-04]");
    }
    *(named *)push_in(c, &m->aliases, sizeof a) = a;
}

static uint64_t index_limit(const mcz *m) { return MAX_OF(65536, 2 * m->size); } /* [LIMIT-13] [LIMIT-17] */

static void read_meta(mcz *m, cursor *c) {
    static const char *const forbidden[3] = {"name-encoding", "skeleton-note", "source-note"};
    uint8_t *owned;
    check(c, m->clips.n > 0, "a META before any clip [META-01]");
    unsigned flags = get_flags(c, 3 | 128);
    uint64_t size = varint(c);
    extension(c, flags);
    check(c, size <= index_limit(m), "a META that is too large [LIMIT-17]");
    cursor r = decoded(m, c, flags & 3, size, &owned);
    while (!c->bad && !r.bad && r.p < r.end) {
        text(&r);
        get_keys(&r, false, true, "a key twice in a META [META-04]", forbidden);
        get_keys(&r, true, true, "a key twice in a META [META-04]", forbidden);
    }
    if (r.bad) refuse_as(c, r.code, r.bad);
    free(owned);
}

/* Whether a chunk of the file begins at this offset. */
static bool is_chunk(const mcz *m, uint64_t offset) {
    size_t a = 0, b = m->chunks.n;
    while (a < b) {
        size_t half = a + (b - a) / 2;
        if (*ITEM(uint64_t, m->chunks, half) < offset) a = half + 1;
        else b = half;
    }
    return a < m->chunks.n && *ITEM(uint64_t, m->chunks, a) == offset;
}

static bool may_be_copied(const uint8_t *type) { /* [COPY-01] */
    static const char types[] = "HEADSKELMODLSRCEALIACLIPCEND";
    for (int i = 0; i < 28; i += 4)
        if (!memcmp(types + i, type, 4)) return true;
    return false;
}

static void read_copy(mcz *m, cursor *c) {
    uint8_t *owned;
    uint64_t end = 0;
    check(c, m->profile != SMALL, "a COPY in the small profile [LIMIT-23]");
    unsigned flags = get_flags(c, 3 | 128);
    uint64_t size = varint(c);
    extension(c, flags);
    check(c, size <= m->size, "copies that are larger than the file [LIMIT-16]");
    cursor r = decoded(m, c, flags & 3, size, &owned);
    while (!c->bad && !r.bad && r.p < r.end) {
        uint64_t distance = varint(&r), at = distance <= m->at ? m->at - distance : 0;
        const uint8_t *type = bytes(&r, 4);
        mcz_text payload = sized(&r);
        check(&r, may_be_copied(type), "a copy of a chunk of another type [COPY-01]");
        check(&r, distance && is_chunk(m, at), "a copy of no chunk [COPY-02]");
        if (r.bad) break;
        const uint8_t *p = m->data + at;
        check(&r, !memcmp(p, type, 4) && load(p + 8, 8) == payload.size, "a copy of another chunk [COPY-02]");
        check(&r, r.bad || !memcmp(p + 16, payload.bytes, payload.size), "a copy of other bytes [COPY-02]");
        check(&r, at >= end, "copies that are not in the order of the file [COPY-03]");
        end = at + 20 + payload.size;
    }
    if (r.bad) refuse_as(c, r.code, r.bad);
    free(owned);
}

static void read_qual(mcz *m, cursor *c) { /* [QUAL-02] */
    (void)m;
    get_keys(c, true, false, "", NULL);
}

static void read_nothing(mcz *m, cursor *c) { (void)m, (void)c; } /* REPT [REPT-03], RECV */

/* ---- INDX --------------------------------------------------------------------------------------------------- */

/* An INDX has one right form alone, so each of its fields is compared with the field that the walk gives. */
static const char DISAGREE[] = "INDX and file disagree [STRICT-04] [INDX-05]";

static void want(cursor *x, uint64_t v) { check(x, varint(x) == v, DISAGREE); }

static void want_bytes(cursor *x, const void *p, uint64_t n) {
    const uint8_t *q = bytes(x, n);
    check(x, x->bad || !memcmp(p, q, n), DISAGREE);
}

static uint64_t length_at(const mcz *m, uint64_t offset) { return load(m->data + offset + 8, 8); }

/* The columns gap and length of chunks whose offsets are the first fields of the items a to b - 1. */
static void want_places(const mcz *m, cursor *x, const list *l, size_t size, size_t a, size_t b, uint64_t at) {
    uint64_t offset;
    for (size_t i = a; i < b; i++, at = offset + 20 + length_at(m, offset)) {
        memcpy(&offset, (char *)l->items + i * size, 8);
        want(x, offset - at);
    }
    for (size_t i = a; i < b; i++) {
        memcpy(&offset, (char *)l->items + i * size, 8);
        want(x, length_at(m, offset));
    }
}

static void want_types(const mcz *m, cursor *x, const list *l, size_t size, size_t a, size_t b) {
    uint64_t offset;
    for (size_t i = a; i < b; i++) {
        memcpy(&offset, (char *)l->items + i * size, 8);
        want_bytes(x, m->data + offset, 4);
    }
}

/* The first item whose offset, its first field, is not before `start`. */
static size_t from(const list *l, size_t size, uint64_t start) {
    size_t a = 0, b = l->n;
    while (a < b) {
        size_t half = a + (b - a) / 2;
        uint64_t offset;
        memcpy(&offset, (char *)l->items + half * size, 8);
        if (offset < start) a = half + 1;
        else b = half;
    }
    return a;
}

/* A column of texts: those at `first`, one every `size` bytes. */
static void want_texts(cursor *x, const void *first, size_t size, size_t n) {
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < n; i++) {
            mcz_text t;
            memcpy(&t, (const char *)first + i * size, sizeof t);
            if (pass == 0) want(x, t.size);
            else want_bytes(x, t.bytes, t.size);
        }
}

static void want_shared(const mcz *m, cursor *x, uint64_t start) {
    size_t a = from(&m->shareds, sizeof(shared), start), n = m->shareds.n;
    want(x, n - a);
    want_types(m, x, &m->shareds, sizeof(shared), a, n);
    for (size_t i = a; i < n; i++) want_bytes(x, ITEM(shared, m->shareds, i)->id.bytes, 16);
    want_places(m, x, &m->shareds, sizeof(shared), a, n, start);
}

static void want_attachments(const mcz *m, cursor *x, uint64_t start) {
    const named *all = m->attachments.items;
    size_t a = from(&m->attachments, sizeof(named), start), n = m->attachments.n;
    want(x, n - a);
    if (n > a) want_texts(x, &all[a].name, sizeof(named), n - a);
    for (size_t i = a; i < n; i++) want(x, all[i].size);
    for (size_t i = a; i < n; i++) want(x, all[i].n_parts);
    a = from(&m->parts, sizeof(ancillary), start), n = m->parts.n;
    want(x, n - a);
    want_types(m, x, &m->parts, sizeof(ancillary), a, n);
    want_places(m, x, &m->parts, sizeof(ancillary), a, n, start);
}

static void want_aliases(const mcz *m, cursor *x, uint64_t start) {
    const named *all = m->aliases.items;
    size_t a = from(&m->aliases, sizeof(named), start), n = m->aliases.n;
    want(x, n - a);
    if (n > a) want_texts(x, &all[a].name, sizeof(named), n - a);
    for (size_t i = a; i < n; i++) want(x, all[i].of);
    if (n > a) want_texts(x, &all[a].target, sizeof(named), n - a);
}

static uint64_t clip_end(const clip *k) { return k->offset + 20 + k->length; }

static uint64_t cend_end(const clip *k) { return k->cend + 20 + k->cend_length; }

static uint64_t cend_gap(const mcz *m, const clip *k) {
    if (!k->n_segments) return k->cend - clip_end(k);
    const segment *g = ITEM(segment, m->segments, k->segments + k->n_segments - 1);
    return k->cend - (g->offset + g->size);
}

/* The table of skeletons, in the order of their first use, and the clips. */
static void want_clips(const mcz *m, cursor *x, size_t a, uint64_t start) {
    const clip *all = m->clips.items;
    size_t n = m->clips.n, used = 0, *order = calloc(m->skeletons.n + 1, sizeof *order);
    if (!order) {
        refuse_as(x, MCZ_NO_MEMORY, "not enough memory");
        return;
    }
    for (size_t i = a; i < n; i++)
        if (!order[all[i].skeleton]) order[all[i].skeleton] = ++used;
    want(x, used);
    for (size_t i = a, seen = 0; i < n; i++)
        if (order[all[i].skeleton] == seen + 1) {
            want_bytes(x, ITEM(skeleton, m->skeletons, all[i].skeleton)->id.bytes, 16);
            seen++;
        }
    want(x, n - a);
    if (n > a) want_texts(x, &all[a].name, sizeof(clip), n - a);
    for (size_t i = a; i < n; i++) want(x, order[all[i].skeleton] - 1);
    free(order);
    for (size_t i = a; i < n; i++) want(x, all[i].n_frames);
    for (size_t i = a; i < n; i++) want(x, all[i].rate[0]);
    for (size_t i = a; i < n; i++) want(x, all[i].rate[1]);
    for (size_t i = a; i < n; i++) want(x, all[i].n_signals);
    for (size_t i = a; i < n; i++) want(x, all[i].offset - (i > a ? cend_end(all + i - 1) : start));
    for (size_t i = a; i < n; i++) want(x, all[i].length);
    for (size_t i = a; i < n; i++) want(x, all[i].n_segments);
    for (size_t i = a; i < n; i++) want(x, cend_gap(m, all + i));
    for (size_t i = a; i < n; i++) want(x, all[i].cend_length);
    for (size_t i = a; i < n; i++) want(x, all[i].n_ancillary);
}

static void want_signals(const mcz *m, cursor *x, size_t a) {
    const signal *all = m->signals.items;
    size_t n = m->signals.n;
    want(x, n - a);
    for (size_t i = a; i < n; i++) want(x, all[i].n_channels);
    for (size_t i = a; i < n; i++) want(x, all[i].rows_per_frame);
    for (size_t i = a; i < n; i++) want(x, all[i].skip);
    for (size_t i = a; i < n; i++) want(x, all[i].spare);
    for (size_t i = a; i < n; i++) want(x, all[i].codec);
    for (size_t i = a; i < n; i++) want(x, all[i].preset);
    for (size_t i = a; i < n; i++) want(x, all[i].version);
}

static void want_segments(const mcz *m, cursor *x, size_t first_clip, size_t a) {
    const segment *all = m->segments.items;
    size_t n = m->segments.n;
    want(x, n - a);
    for (size_t j = first_clip; j < m->clips.n; j++) {
        const clip *k = ITEM(clip, m->clips, j);
        uint64_t at = clip_end(k);
        for (size_t i = k->segments; i < k->segments + k->n_segments; at = all[i].offset + all[i].size, i++)
            want(x, all[i].offset - at);
    }
    for (size_t i = a; i < n; i++) want(x, all[i].size);
    for (size_t i = a; i < n; i++) want(x, all[i].signal);
    for (size_t i = a; i < n; i++) want(x, all[i].n_frames);
    for (size_t i = a; i < n; i++) want(x, all[i].lead);
    for (size_t i = a; i < n; i++) want(x, all[i].tail);
    for (size_t i = a; i < n; i++) want(x, all[i].flags | all[i].packet);
}

static void want_ancillaries(const mcz *m, cursor *x, size_t first_clip, uint64_t start) {
    const ancillary *all = m->ancillaries.items;
    size_t a = from(&m->ancillaries, sizeof *all, start), n = m->ancillaries.n, behind = 0;
    while (a + behind < n && all[a + behind].clip < first_clip) behind++;
    want(x, behind);
    want(x, n - a);
    want_types(m, x, &m->ancillaries, sizeof *all, a, n);
    uint64_t at = start;
    for (size_t i = a; i < n; i++) {
        bool new_clip = all[i].clip >= first_clip && (i == a || all[i].clip != all[i - 1].clip);
        if (new_clip) at = cend_end(ITEM(clip, m->clips, all[i].clip));
        want(x, all[i].offset - at);
        at = all[i].offset + 20 + length_at(m, all[i].offset);
    }
    for (size_t i = a; i < n; i++) want(x, length_at(m, all[i].offset));
}

static void want_index(const mcz *m, cursor *x, uint64_t start) {
    size_t first = from(&m->clips, sizeof(clip), start), more = first < m->clips.n;
    const clip *k = ITEM(clip, m->clips, first);
    want(x, left(&m->head));
    want_bytes(x, m->head.p, left(&m->head));
    want_shared(m, x, start);
    want_attachments(m, x, start);
    want_aliases(m, x, start);
    want_clips(m, x, first, start);
    want_signals(m, x, more ? k->signals : m->signals.n);
    want_segments(m, x, first, more ? k->segments : m->segments.n);
    want_ancillaries(m, x, first, start);
}

enum { MAX_CHAIN = 8 };

/* The INDX that this one continues [INDX-06]: its end; *depth: the length of the chain with this one. */
static uint64_t previous_index(const mcz *m, cursor *c, unsigned *depth) {
    uint64_t offset = varint(c), length = varint(c), crc = load(bytes(c, 4), 4);
    size_t i = from(&m->indexes, sizeof(index_chunk), offset);
    const index_chunk *p = ITEM(index_chunk, m->indexes, i);
    bool found = i < m->indexes.n && p->offset == offset && p->length == length;
    check(c, found && load(m->data + offset + length - 4, 4) == crc, "INDX continues what is no INDX [INDX-06]");
    if (c->bad) return 0;
    *depth = p->depth + 1;
    check(c, *depth <= MAX_CHAIN, "a chain of INDX that is too long [INDX-07]");
    return offset + length;
}

static void read_indx(mcz *m, cursor *c) {
    index_chunk self = {m->at, 20 + left(c), 1};
    uint64_t start = 0;
    uint8_t *owned = NULL;
    check(c, m->profile != SMALL, "an INDX in the small profile [LIMIT-23]");
    if (get_flags(c, 1)) start = previous_index(m, c, &self.depth);
    uint64_t size = varint(c);
    check(c, size <= index_limit(m), "an INDX that is too large [LIMIT-13]");
    cursor x = decoded(m, c, DEFLATED, size, &owned);
    if (!c->bad && !m->unread) want_index(m, &x, start);
    if (x.bad) refuse_as(c, x.code, x.bad);
    free(owned);
    *(index_chunk *)push_in(c, &m->indexes, sizeof self) = self;
}

/* ---- The walk ----------------------------------------------------------------------------------------------- */

typedef enum { START = 1, BODY = 2, IN_CLIP = 4, IN_INDEX = 8, AFTER_FOOT = 16 } state; /* (Grammar) */

typedef struct {
    const char *type;
    uint8_t flags, states;
    state next; /* 0: body or clip, as before */
    void (*read)(mcz *, cursor *);
} chunk_type;

static const chunk_type TYPES[] = { /* [CHUNK-15] to [CHUNK-21] */
    {"HEAD", 0, START, BODY, read_head},
    {"SKEL", 0, BODY | AFTER_FOOT, BODY, read_skel},
    {"MODL", 0, BODY | AFTER_FOOT, BODY, read_modl},
    {"SRCE", 0, BODY | AFTER_FOOT, BODY, read_srce},
    {"ATTA", 0, BODY | AFTER_FOOT, BODY, read_atta},
    {"ALIA", 0, BODY | AFTER_FOOT, BODY, read_alia},
    {"CLIP", 0, BODY | AFTER_FOOT, IN_CLIP, read_clip},
    {"DATA", 0, IN_CLIP, IN_CLIP, read_data},
    {"CEND", 0, IN_CLIP, BODY, read_cend},
    {"INDX", 1, BODY | AFTER_FOOT, IN_INDEX, read_indx},
    {"META", 3, BODY | AFTER_FOOT, BODY, read_meta}, /* [META-02] */
    {"QUAL", 3, BODY | IN_CLIP | AFTER_FOOT, 0, read_qual},
    {"COPY", 1, BODY | IN_CLIP | AFTER_FOOT, 0, read_copy},
    {"REPT", 1, BODY | IN_CLIP | AFTER_FOOT, 0, read_nothing},
    {"RECV", 1, BODY | IN_CLIP | AFTER_FOOT, 0, read_nothing},
    {NULL, 1, BODY | IN_CLIP | AFTER_FOOT, 0, read_nothing}, /* unknown and ancillary [CHUNK-12] */
};

static const chunk_type *find_type(const uint8_t *p) {
    const chunk_type *t = TYPES;
    while (t->type && memcmp(t->type, p, 4)) t++;
    return t;
}

static bool is_letter(uint8_t b) { return (b >= 'A' && b <= 'Z') || (b >= 'a' && b <= 'z'); }

static bool is_open(const uint8_t *p) { return load(p + 8, 8) == UINT64_MAX; }

/* The header at p, and what it says of the payload. */
static void check_header(const mcz *m, cursor *c, const uint8_t *p, uint64_t rest) {
    uint32_t crc = crc32(&m->crc, crc32(&m->crc, 0, p, 6), p + 8, 8);
    uint64_t length = load(p + 8, 8);
    for (int i = 0; i < 4; i++) check(c, is_letter(p[i]), "a chunk type that is not four letters [CHUNK-08]");
    check(c, crc_is(crc & 0xFFFF, load(p + 6, 2)), "the checksum of a chunk's header is wrong [CHUNK-02]");
    check(c, !(p[4] & ~3), "a reserved flag of a chunk is set [CONV-14]");
    check(c, p[5] == 0, "the reserved byte of a chunk is not 0 [CHUNK-09]");
    if (is_open(p)) {
        check(c, !memcmp(p, "DATA", 4), "a length of all ones of no DATA [CHUNK-10]");
        return;
    }
    check(c, length <= m->limit.payload, "a chunk that is too long [LIMIT-07] [CHUNK-04]");
    check(c, rest >= 4 && length <= rest - 4, "a chunk that the file cuts off [CHUNK-05]");
    if (c->bad) return;
    crc = crc32(&m->crc, 0, p, 16 + length);
    check(c, crc_is(crc, load(p + 16 + length, 4)), "the checksum of a chunk is wrong [CHUNK-03]");
}

static state check_place(mcz *m, cursor *c, const uint8_t *p, const chunk_type *t, state now) {
    check(c, now != START || t->flags + t->states == START, "a file that does not begin with HEAD [GRAM-01]");
    if (!t->type && !(p[4] & 1)) refuse_as(c, MCZ_UNSUPPORTED, "a critical chunk of unknown type [CHUNK-11]");
    check(c, !t->type || p[4] == t->flags, "a chunk with other flags than its type has [CHUNK-15]");
    check(c, t->states & now, "a chunk where none of its type may be [GRAM-01]");
    check(c, !m->parts_due || !memcmp(p, "ATTA", 4), "something between the parts of an attachment [ATTA-01]");
    if (t->next) return t->next;
    return now == IN_CLIP ? IN_CLIP : BODY;
}

/* An ancillary chunk belongs to the clip before it. */
static void note_ancillary(mcz *m, cursor *c, state now) {
    if (c->bad || now == IN_CLIP || !m->clips.n) return;
    *(ancillary *)push_in(c, &m->ancillaries, sizeof(ancillary)) = (ancillary){m->at, m->clips.n - 1};
    last_clip(m)->n_ancillary++;
}

static state read_chunk(mcz *m, cursor *c, state now) {
    const uint8_t *p = bytes(c, 16);
    check_header(m, c, p, left(c));
    if (c->bad) return now;
    const chunk_type *t = find_type(p);
    state next = check_place(m, c, p, t, now);
    *(uint64_t *)push_in(c, &m->chunks, sizeof(uint64_t)) = m->at;
    if (c->bad) return now;
    if (is_open(p)) {
        read_packets(m, c);
        return next;
    }
    cursor payload = over(c->p, load(p + 8, 8));
    bytes(c, left(&payload) + 4);
    t->read(m, &payload);
    if (payload.bad) refuse_as(c, payload.code, payload.bad);
    if (p[4] & 1 && t->read != read_indx) note_ancillary(m, c, now);
    return next;
}

static state read_foot(mcz *m, cursor *c, state now) {
    const uint8_t *p = bytes(c, 32);
    uint64_t offset = 0, length = 0;
    if (c->bad) return now;
    check(c, load(p, 4) == 0, "neither a chunk nor a FOOT, or one with flags [FOOT-01] [CHUNK-08]");
    uint32_t crc = crc32(&m->crc, crc32(&m->crc, 0, p, 4), p + 8, 24);
    check(c, crc_is(crc, load(p + 4, 4)), "the checksum of a FOOT is wrong [FOOT-02]");
    check(c, !memcmp(p + 24, "\x89ZCM\r\n\x1a\n", 8), "a FOOT without its end [FOOT-03]");
    if (now == IN_INDEX) {
        const index_chunk *x = ITEM(index_chunk, m->indexes, m->indexes.n - 1);
        offset = x->offset, length = x->length;
    }
    check(c, load(p + 8, 8) == offset && load(p + 16, 8) == length, "a FOOT of another INDX [FOOT-04]");
    check(c, now & (BODY | IN_INDEX | AFTER_FOOT), "a FOOT where none may be [GRAM-01]");
    check(c, !m->parts_due, "an attachment without its last part [ATTA-01]");
    return AFTER_FOOT;
}

static bool walk(mcz *m) {
    cursor c = over(m->data, m->size);
    state now = START;
    check(&c, !memcmp(bytes(&c, 8), "\x89MCZ\r\n\x1a\n", 8), "not the signature of MCZ [CHUNK-01]");
    while (c.p < c.end) {
        m->at = (uint64_t)(c.p - m->data);
        now = is_letter(*c.p) ? read_chunk(m, &c, now) : read_foot(m, &c, now);
    }
    check(&c, now == AFTER_FOOT, "a file that does not end in a FOOT [STRICT-01]");
    m->error = (mcz_error){c.code, m->at, c.bad};
    return !c.bad;
}

mcz *mcz_open(const void *data, size_t size, const void *words, size_t n_words, mcz_error *error) {
    mcz *m = calloc(1, sizeof *m);
    *error = (mcz_error){MCZ_NO_MEMORY, 0, "not enough memory"};
    if (!m) return NULL;
    m->data = data;
    m->size = size;
    m->words = words;
    m->n_words = words ? n_words : 0;
    m->limit = LIMITS[0];
    crc_make(&m->crc);
    if (walk(m)) {
        *error = (mcz_error){MCZ_OK, 0, NULL};
        return m;
    }
    *error = m->error;
    mcz_close(m);
    return NULL;
}

void mcz_close(mcz *m) {
    if (!m) return;
    for (size_t i = 0; i < m->skeletons.n; i++) free(ITEM(skeleton, m->skeletons, i)->unpacked);
    list *all[] = {&m->chunks, &m->shareds, &m->skeletons, &m->clips, &m->signals, &m->segments,
                   &m->attachments, &m->parts, &m->aliases, &m->ancillaries, &m->indexes};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]->items);
    free(m->names.slots);
    free(m);
}

size_t mcz_n_clips(const mcz *m) { return m->clips.n; }

int mcz_get_clip(const mcz *m, size_t i, mcz_clip *out) {
    if (i >= m->clips.n) return MCZ_NO_SUCH;
    const clip *k = ITEM(clip, m->clips, i);
    *out = (mcz_clip){k->name, k->n_frames, k->rate[0], k->rate[1], k->n_signals, k->skeleton, k->readable};
    return MCZ_OK;
}

static bool can_decode(const signal *s) { return s->codec <= FAST && s->version == 0; }

static const signal *find_signal(const mcz *m, size_t i, size_t j) {
    const clip *k = i < m->clips.n ? ITEM(clip, m->clips, i) : NULL;
    return k && j < k->n_signals ? ITEM(signal, m->signals, k->signals + j) : NULL;
}

int mcz_get_signal(const mcz *m, size_t i, size_t j, mcz_signal *out) {
    const signal *s = find_signal(m, i, j);
    if (!s) return MCZ_NO_SUCH;
    *out = (mcz_signal){s->name, s->role, can_decode(s), s->integers, s->own, s->n_channels, s->rows_per_frame,
                        s->codec, s->version};
    return MCZ_OK;
}

int mcz_get_joint(const mcz *m, size_t i, size_t joint, mcz_joint *out) {
    if (i >= m->skeletons.n || joint >= ITEM(skeleton, m->skeletons, i)->n_joints) return MCZ_NO_SUCH;
    cursor c = ITEM(skeleton, m->skeletons, i)->joints;
    for (size_t j = 0; j <= joint; j++) get_joint(&c, j, out);
    return MCZ_OK;
}

/* ---- Rows --------------------------------------------------------------------------------------------------- */

/* A channel of a segment of fast, and its state from row to row. */
typedef struct {
    unsigned kind, form, drop, shifts, parts; /* kind: bits 0-1 of the field */
    bool tiny;
    int base, digits, most;  /* B, P, D of classes */
    double unit, offset, shift;
    int64_t top, first, scale, rest, weight, taps[4];
    int64_t last, e, d[4];
    size_t source, parent, n_exceptions; /* source of a copy; parent + 1: columns of the signal */
    cursor exceptions;
} head;

typedef struct { /* bits, the lowest of each byte first; zeros come after the end, which bits_end notes */
    const uint8_t *p;
    uint64_t n, at;
} bits;

typedef struct {
    size_t begin; /* its first column */
    mcz_text notes, mask, stream;
    bits residuals, tails;
} group;

struct mcz_rows {
    const mcz *m;
    const clip *k;
    const signal *s;
    uint64_t begin, end; /* stored frames that are wanted */
    size_t at;           /* the segment to come, + 1 */
    bool whole, hash, invalid, failed;
    double last_time;
    int64_t last_tick;
    bool timed;
    sha256 sha;
    grid *grids, *now;   /* of each channel, in CLIP and in the segment */
    group *groups;       /* n_groups + 1 */
    head *heads;
    int64_t *values;     /* of a segment: ordinals that become values in place */
    uint8_t *mask;
};

static uint64_t bits_peek(const bits *b) { /* 57 or more */
    uint64_t byte = b->at / 8, n = (b->n + 7) / 8;
    if (byte >= n) return 0;
    return (n - byte >= 8 ? load(b->p + byte, 8) : load(b->p + byte, (int)(n - byte))) >> b->at % 8;
}

static uint64_t bits_take(bits *b, int n) { /* take(n), up to 56 */
    uint64_t v = bits_peek(b) & ((UINT64_C(1) << n) - 1);
    b->at += (uint64_t)n;
    return v;
}

static void bits_end(cursor *c, const bits *b) { /* [FAST-20] */
    check(c, b->at <= b->n, "codes that end after their bytes [FAST-20]");
    check(c, c->bad || (b->n - b->at < 8 && bits_peek(b) == 0), "bits that no code takes [FAST-20]");
}

/* ---- Codec 0: raw */

static void raw_decode(mcz_rows *r, cursor *c, size_t rows) {
    size_t n = r->s->n_channels;
    for (size_t j = 0; j < r->s->n_groups; j++) {
        const group *g = r->groups + j;
        cursor x = over((const uint8_t *)g->stream.bytes, g->stream.size);
        for (size_t ch = g->begin; ch < g[1].begin; ch++) {
            uint64_t least = load(bytes(&x, 8), 8);
            unsigned width = get8(&x);
            check(&x, width <= 8, "a width of more than 8 bytes [RAW-02]");
            const uint8_t *p = bytes(&x, rows * width);
            for (size_t i = 0; i < rows && !x.bad; i++, p += width) /* [RAW-03] */
                r->values[i * n + ch] = (int64_t)(least + load(p, (int)width));
        }
        check(&x, x.p == x.end, "a stream of raw with more bytes [RAW-04]");
        if (x.bad) refuse_as(c, x.code, x.bad);
    }
}

/* ---- Codec 1: fast */

static int64_t wrap(int64_t x) { return (int32_t)(uint32_t)(uint64_t)x; }

static int64_t shift_right(int64_t x, int n) { return x >= 0 ? x >> n : ~(~x >> n); } /* rounds down */

static int bit_length(uint64_t v) {
#ifdef __GNUC__
    return v ? 64 - __builtin_clzll(v) : 0;
#else
    int n = 0;
    for (; v; v >>= 1) n++;
    return n;
#endif
}

static int low_zeros(uint64_t v) { /* of v > 0 */ return bit_length(v & (~v + 1)) - 1; }

static int64_t short_ordinal(cursor *c, unsigned size) { /* [FAST-21] */
    check(c, size <= 8, "an ordinal of more than 8 bytes [FAST-21]");
    if (c->bad) return 0;
    uint64_t u = load(bytes(c, size), (int)size);
    check(c, size == 0 || u >> 8 * (size - 1), "an ordinal that is not the shortest [FAST-21]");
    return unzigzag(u);
}

static int64_t get_scale(cursor *c) { /* [FAST-33] */
    unsigned q = get8(c);
    check(c, q <= 120, "a scale beyond 120 [FAST-33]");
    return c->bad ? 0 : ((4 + (int64_t)(q % 4)) << q / 4) / 4;
}

static size_t get_column(const mcz_rows *r, cursor *c, const char *why) { /* a group and a channel of it */
    uint64_t g = varint(c), ch = varint(c);
    check(c, g < r->s->n_groups && ch < r->groups[g + (g < r->s->n_groups)].begin - r->groups[g].begin, why);
    return c->bad ? 0 : r->groups[g].begin + (size_t)ch;
}

static void get_steps(mcz_rows *r, cursor *c, size_t column, size_t rows) { /* [FAST-24] [FAST-25] */
    size_t row = 0, n = r->s->n_channels;
    for (uint64_t runs = counted(c, 2); runs && !c->bad; runs--) {
        uint64_t length = varint(c);
        unsigned size = get8(c);
        int64_t o = short_ordinal(c, size);
        check(c, length >= 1 && length <= rows - row, "steps of other rows than the segment's [FAST-25]");
        for (; length && !c->bad; length--) r->values[row++ * n + column] = o;
    }
    check(c, row == rows, "steps of other rows than the segment's [FAST-25]");
}

static unsigned form_of_grid(const grid *g) { /* [FAST-28] */
    unsigned kind = g->kind, digits = g->digits;
    if (kind == PRINTED) {
        kind = digits > 128 ? GENERAL : digits == 64 ? TEXT64 : digits == 32 ? TEXT32 : FIXED;
        digits &= 127;
    }
    if (kind == GENERAL) return digits;
    if (kind == TEXT64 || kind == BINARY64) return 117;
    return kind == TEXT32 || kind == BINARY32 || kind == VAX_F ? 88 : 0;
}

static bool in_range(double x, double low, double high) { return low <= x && x <= high; }

static void get_unit(const grid *g, cursor *c, head *h) {
    h->unit = get_double(c);
    check(c, in_range(h->unit, 0x1p-200, 0x1p80), "a unit out of range [FAST-47]");
    if (h->form == 33) {
        h->shifts = get8(c);
        check(c, within(h->shifts, 1, 63), "shifts out of range [FAST-50]");
        check(c, g->kind == GENERAL, "products of a grid that is not GENERAL [FAST-49]");
    }
    if (h->form != 34) return;
    h->parts = get8(c);
    check(c, h->parts <= 7, "parts of counts that are none [FAST-52]");
    if (h->parts & 1) h->offset = get_double(c);
    if (h->parts & 2) h->shift = get_double(c);
    check(c, in_range(h->offset, -0x1p80, 0x1p80), "an offset out of range [FAST-53]");
    check(c, in_range(h->shift, -0x1p80, 0x1p80), "a shift out of range [FAST-53]");
    if (h->parts & 4) h->rest = get_scale(c);
}

static void get_form(const grid *g, cursor *c, head *h, unsigned kind) {
    h->form = kind & 128 ? get8(c) : form_of_grid(g);
    h->drop = kind & 128 ? get8(c) : 0;
    bool ten = within(h->form, 1, 15), classes = ten || h->form == 88 || h->form == 117;
    check(c, classes || h->form == 0 || within(h->form, 32, 34), "a form that is none [FAST-29]");
    unsigned most = h->form == 0 ? 32 : h->form == 88 ? 22 : h->form == 117 ? 51 : 0;
    check(c, h->drop <= most, "more bits dropped than the form may [FAST-30]");
    check(c, classes || !(kind & 16), "tiny outside of classes [FAST-22]");
    if (within(h->form, 32, 34)) get_unit(g, c, h);
    if (!classes || c->bad) return;
    h->tiny = kind & 16;
    h->base = ten ? 10 : 2;
    h->digits = ten ? (int)h->form : (int)(h->form - 64 - h->drop);
    h->most = MIN_OF(h->digits, ten ? 9 : 30);
    h->top = (int64_t)varint(c);
    check(c, h->top <= (ten ? 614 : h->form == 88 ? 255 : 2047), "a top class beyond the last [FAST-31]");
}

static void get_exceptions(cursor *c, head *h, size_t rows) { /* [FAST-37] */
    uint64_t row = 0;
    h->n_exceptions = (size_t)counted(c, 2);
    h->exceptions = *c;
    for (size_t i = 0; i < h->n_exceptions && !c->bad; i++, row++) {
        row = add(c, row, varint(c));
        check(c, row < rows, "an exception after the segment [FAST-37]");
        unsigned size = get8(c);
        short_ordinal(c, size);
    }
}

static void get_coded(mcz_rows *r, cursor *c, head *h, size_t column, unsigned kind, size_t rows) {
    static const int8_t taps[3][4] = {{0, 0, 0, 0}, {32, 0, 0, 0}, {64, -32, 0, 0}};
    unsigned which = kind >> 2 & 3;
    get_form(r->grids + column, c, h, kind);
    h->first = zigzag_varint(c);
    check(c, h->first >= INT32_MIN && h->first <= INT32_MAX, "a first lead beyond 32 bits [FAST-32]");
    h->scale = get_scale(c);
    for (int i = 0; i < 4; i++) h->taps[i] = which == 3 ? (int8_t)get8(c) : taps[which][i];
    if (kind & 32) {
        h->parent = 1 + get_column(r, c, "a parent that is no channel [FAST-34]");
        check(c, h->parent != 1 + column, "a channel that is its own parent [FAST-34]");
        h->weight = zigzag_varint(c);
        check(c, h->weight >= INT16_MIN && h->weight <= INT16_MAX, "a weight beyond 16 bits [FAST-35]");
    }
    if (kind & 64) get_exceptions(c, h, rows);
}

enum { CODED, CONSTANT, COPY, STEPS };

static void get_head(mcz_rows *r, cursor *c, size_t column, size_t rows) {
    head *h = r->heads + column;
    unsigned kind = get8(c);
    *h = (head){.kind = kind & 3};
    if (h->kind == CODED) {
        get_coded(r, c, h, column, kind, rows);
        return;
    }
    check(c, kind <= 3 || (h->kind == CONSTANT && kind < 64), "bits of a head that mean nothing [FAST-22]");
    if (h->kind == COPY) h->source = get_column(r, c, "a copy of no channel [FAST-27]");
    if (h->kind == STEPS) get_steps(r, c, column, rows);
    if (h->kind != CONSTANT) return;
    int64_t o = short_ordinal(c, kind >> 2 & 15);
    for (size_t i = 0; i < rows && !c->bad; i++) r->values[i * r->s->n_channels + column] = o; /* [FAST-23] */
}

static size_t group_of(const mcz_rows *r, size_t column) {
    size_t a = 0, b = r->s->n_groups;
    while (b - a > 1) {
        size_t half = a + (b - a) / 2;
        if (r->groups[half].begin <= column) a = half;
        else b = half;
    }
    return a;
}

static void get_stream(mcz_rows *r, cursor *c, group *g, size_t rows) {
    cursor x = over((const uint8_t *)g->stream.bytes, g->stream.size);
    size_t coded = 0;
    for (size_t ch = g->begin; ch < g[1].begin && !x.bad; ch++) {
        get_head(r, &x, ch, rows);
        coded += r->heads[ch].kind == CODED;
    }
    g->residuals = g->tails = (bits){x.p, 0, 0};
    if (!coded) check(&x, x.p == x.end, "bytes after the heads of a group without a code [FAST-19]");
    if (coded && !x.bad) {
        mcz_text residuals = sized(&x);
        g->residuals = (bits){(const uint8_t *)residuals.bytes, 8 * residuals.size, 0};
        g->tails = (bits){x.p, 8 * left(&x), 0};
    }
    if (x.bad) refuse_as(c, x.code, x.bad);
}

static void check_links(const mcz_rows *r, cursor *c) { /* sources [FAST-27], parents [FAST-34] [FAST-36] */
    for (size_t j = 0; j < r->s->n_groups; j++) {
        size_t others[2] = {j, j};
        for (size_t ch = r->groups[j].begin; ch < r->groups[j + 1].begin; ch++) {
            const head *h = r->heads + ch;
            check(c, h->kind != COPY || r->heads[h->source].kind != COPY, "a copy of a copy [FAST-27]");
            if (h->kind != CODED || !h->parent) continue;
            check(c, r->heads[h->parent - 1].kind == CODED, "a parent that is not coded [FAST-34]");
            size_t g = group_of(r, h->parent - 1);
            if (g == j || g == others[0] || g == others[1]) continue;
            check(c, others[1] == j, "parents of more than two other groups [FAST-36]");
            others[others[0] != j] = g;
        }
    }
}

static int64_t code(cursor *c, bits *b, int64_t *scale) {
    uint64_t w = bits_peek(b);
    int k = bit_length((uint64_t)*scale >> 4), q = low_zeros(w | UINT64_C(1) << 40);
    int j = MAX_OF(0, q - 7);
    check(c, k + j <= 31, "a code that is too long [FAST-40]");
    if (c->bad) return 0;
    b->at += (uint64_t)q + 1;
    uint64_t u = ((j ? 6 + (UINT64_C(1) << j) : (uint64_t)q) << k) + bits_take(b, k + j);
    check(c, u >> 32 == 0, "a residual beyond 32 bits [FAST-41]");
    int64_t e = unzigzag(u), size = e < 0 ? -e : e;
    *scale += shift_right(16 * MIN_OF(size, 1 << 26) - *scale, 2);
    return e;
}

static void lead(head *h, const head *heads) { /* [FAST-39] */
    const int64_t *t = h->taps, *d = h->d;
    int64_t p = shift_right(wrap(16 + t[0] * d[0] + t[1] * d[1] + t[2] * d[2] + t[3] * d[3]), 5);
    int64_t x = h->parent ? shift_right(wrap(128 + h->weight * heads[h->parent - 1].e), 8) : 0;
    int64_t next = wrap(h->last + p + x + h->e);
    h->d[3] = d[2], h->d[2] = d[1], h->d[1] = d[0];
    h->d[0] = wrap(next - h->last);
    h->last = next;
}

/* The leads of all channels, into the places of their ordinals. */
static void get_leads(mcz_rows *r, cursor *c, size_t rows) {
    size_t n = r->s->n_channels;
    for (size_t ch = 0; ch < n; ch++)
        if (r->heads[ch].kind == CODED) r->values[ch] = r->heads[ch].last = r->heads[ch].first;
    for (size_t i = 1; i < rows && !c->bad; i++) {
        for (group *g = r->groups; g < r->groups + r->s->n_groups; g++)
            for (head *h = r->heads + g->begin; h < r->heads + g[1].begin; h++)
                if (h->kind == CODED) h->e = code(c, &g->residuals, &h->scale);
        for (size_t ch = 0; ch < n; ch++) {
            if (r->heads[ch].kind != CODED) continue;
            lead(r->heads + ch, r->heads);
            r->values[i * n + ch] = r->heads[ch].last;
        }
    }
}

static int64_t decimal(bits *b, int n) { /* a number below 10^n */
    if (n > 9) {
        int64_t a = decimal(b, n - 9);
        return a * 1000000000 + decimal(b, 9);
    }
    int64_t all = TENS[n];
    int k = bit_length((uint64_t)all) - 1;
    int64_t v = (int64_t)bits_take(b, k);
    if (v >= (INT64_C(2) << k) - all && bits_take(b, 1)) v += all - (INT64_C(1) << k);
    return v;
}

static int64_t power(int base, int n) { return base == 2 ? INT64_C(1) << n : TENS[n]; }

static int64_t tail(bits *b, int base, int n) { return base == 2 ? (int64_t)bits_take(b, n) : decimal(b, n); }

static int64_t of_class(const head *h, cursor *c, bits *b, int64_t lead) {
    int64_t s = lead < 0 ? -1 - lead : lead, k, m, low = power(h->base, h->digits - 1), z = 0;
    if (s > 0) {
        int n = 0;
        for (int64_t v = s; v; v /= h->base) n++;
        check(c, n <= h->most, "a lead of too many digits [FAST-43]");
        if (c->bad) return 0;
        k = h->top - h->most + n;
        check(c, k >= 0, "a class below 0 [FAST-44]");
        m = s * power(h->base, h->digits - n) + tail(b, h->base, h->digits - n);
    } else {
        if (h->tiny) z = decimal(b, 1);
        if (z == 9) z += decimal(b, 4);
        if (z == 0) return lead < 0 ? -1 : 0;
        k = h->top - h->most + 1 - z;
        check(c, k >= 0, "a class below 0 [FAST-45]");
        m = h->base == 10 ? decimal(b, h->digits) : low + (int64_t)bits_take(b, h->digits - 1);
        check(c, m >= low, "a mantissa that is too small [FAST-46]");
    }
    if (c->bad) return 0;
    m = (k * (h->base - 1) * low + (h->base == 10) + (m - low)) * (INT64_C(1) << h->drop);
    return lead < 0 ? -1 - m : m;
}

static int64_t of_unit(const head *h, const grid *g, int64_t c) { /* [FAST-48] [FAST-51] [FAST-54] */
    double x = (double)c * h->unit;
    if (h->form == 33) {
        int64_t a = (c < 0 ? -c : c) - 1, q = a / h->shifts, z = a % h->shifts;
        x = c == 0 ? 0 : (double)(2 * q + 1) * (double)(UINT64_C(1) << z) * h->unit;
        return general_ordinal(c < 0 ? -x : x, g->digits);
    }
    if (h->form == 34 && h->parts & 1) x += h->offset;
    x = (float)x;
    if (h->form == 34 && h->parts & 2) x = (float)(x + h->shift);
    return g->kind == GENERAL ? general_ordinal(x, g->digits) : binary32_ordinal(x);
}

static int64_t ordinal(head *h, const grid *g, cursor *c, bits *b, int64_t lead) { /* [FAST-42] */
    if (h->form == 0) return lead * (INT64_C(1) << h->drop) + (int64_t)bits_take(b, (int)h->drop);
    if (h->base) return of_class(h, c, b, lead);
    int64_t o = of_unit(h, g, lead);
    return h->form == 34 && h->parts & 4 ? o + code(c, b, &h->rest) : o;
}

static void get_tails(mcz_rows *r, cursor *c, size_t rows) {
    size_t n = r->s->n_channels;
    for (size_t j = 0; j < r->s->n_groups; j++)
        for (size_t i = 0; i < rows && !c->bad; i++)
            for (size_t ch = r->groups[j].begin; ch < r->groups[j + 1].begin; ch++)
                if (r->heads[ch].kind == CODED) {
                    int64_t *v = r->values + i * n + ch;
                    *v = ordinal(r->heads + ch, r->grids + ch, c, &r->groups[j].tails, *v);
                }
}

static void put_exceptions(mcz_rows *r, const head *h, size_t column) { /* [FAST-38] */
    cursor c = h->exceptions;
    size_t row = 0;
    for (size_t i = 0; i < h->n_exceptions; i++, row++) {
        row += (size_t)varint(&c);
        unsigned size = get8(&c);
        r->values[row * r->s->n_channels + column] = short_ordinal(&c, size);
    }
}

static void fast_decode(mcz_rows *r, cursor *c, size_t rows) {
    size_t n = r->s->n_channels;
    for (size_t j = 0; j < r->s->n_groups; j++) get_stream(r, c, r->groups + j, rows);
    if (c->bad) return;
    check_links(r, c);
    get_leads(r, c, rows);
    get_tails(r, c, rows);
    for (size_t j = 0; j < r->s->n_groups && !c->bad; j++) {
        bits_end(c, &r->groups[j].residuals);
        bits_end(c, &r->groups[j].tails);
    }
    if (c->bad) return;
    for (size_t ch = 0; ch < n; ch++) put_exceptions(r, r->heads + ch, ch);
    for (size_t ch = 0; ch < n; ch++)
        for (size_t i = 0; i < rows && r->heads[ch].kind == COPY; i++) /* [FAST-26] */
            r->values[i * n + ch] = r->values[i * n + r->heads[ch].source];
}

/* ---- Notes and masks, values */

static void get_changes(mcz_rows *r, cursor *c, const group *g) { /* of grids [NOTES-06] */
    uint64_t next = 0, width = g[1].begin - g->begin;
    for (uint64_t n = counted(c, 4); n && !c->bad; n--) {
        uint64_t ch = varint(c);
        grid changed = get_grid(c);
        check(c, ch >= next, "changes of grids that do not ascend [NOTES-02]");
        check(c, ch < width, "notes on a channel that the group has not [NOTES-03]");
        check(c, !r->s->integers || changed.kind == INTEGER, "another grid among integers [NOTES-07]");
        if (c->bad) return;
        r->now[g->begin + ch] = changed;
        next = ch + 1;
    }
}

/* The notes of a group; its exceptions go to values, where these are given. */
static void get_notes(mcz_rows *r, cursor *c, const group *g, size_t rows, double *values) {
    cursor x = over((const uint8_t *)g->notes.bytes, g->notes.size);
    uint64_t row = 0, next = 0, width = g[1].begin - g->begin;
    if (!g->notes.size) return;
    get_changes(r, &x, g);
    for (uint64_t n = counted(&x, 3); n && !x.bad; n--) {
        uint64_t gap = varint(&x), ch = varint(&x);
        mcz_text token = sized(&x);
        row = add(&x, row, gap);
        check(&x, row < rows, "an exception after the segment [NOTES-05]");
        check(&x, ch < width, "notes on a channel that the group has not [NOTES-03]");
        check(&x, gap || ch >= next, "exceptions that do not ascend [NOTES-04]");
        if (x.bad) break;
        check(&x, grid_has_text(r->now + g->begin + ch), "an exception on a grid without text [NOTES-08]");
        double v = token_value(&x, token);
        if (values) values[row * r->s->n_channels + g->begin + ch] = v; /* [NOTES-10] */
        next = ch + 1;
    }
    closed(&x);
    if (x.bad) refuse_as(c, x.code, x.bad);
}

static void get_mask(mcz_rows *r, cursor *c, const group *g, size_t rows, bool *any) {
    cursor x = over((const uint8_t *)g->mask.bytes, g->mask.size);
    uint64_t width = g[1].begin - g->begin, n = rows * width, at = 0;
    bool valid = true;
    if (!g->mask.size) return;
    if (!*any) memset(r->mask, 1, rows * r->s->n_channels);
    *any = true;
    while (x.p < x.end) {
        uint64_t run = varint(&x);
        check(&x, run > 0 || (valid && at == 0), "a run of a mask that is empty [MASK-02]");
        check(&x, run <= n - at, "a mask of more values than there are [MASK-03]");
        for (; run && !x.bad; run--, at++) /* [MASK-01] */
            r->mask[at % rows * r->s->n_channels + g->begin + at / rows] = valid;
        valid = !valid;
    }
    check(&x, at == n, "a mask of fewer values than there are [MASK-03]");
    if (x.bad) refuse_as(c, x.code, x.bad);
}

/* The streams of a segment, to the groups. */
static void get_streams(mcz_rows *r, const segment *g) {
    size_t n = r->s->n_groups;
    for (size_t j = 0; j < n; j++) r->groups[j].notes = r->groups[j].mask = (mcz_text){"", 0};
    if (g->packet == KIND2) {
        r->groups[0].stream = (mcz_text){(const char *)r->m->data + g->offset, (size_t)g->size};
        r->groups[0].mask = first_mask(r->m, r->k, ITEM(segment, r->m->segments, g->masked - 1));
        return;
    }
    stream_table t = streams_of(r->m, r->k, g);
    if (g->flags & FRAME_NOTES) next_stream(&t);
    for (size_t j = 0; j < n && g->flags & GROUP_NOTES; j++) r->groups[j].notes = next_stream(&t);
    for (size_t j = 0; j < n && g->flags & MASKS; j++) r->groups[j].mask = next_stream(&t);
    for (size_t j = 0; j < n; j++) r->groups[j].stream = next_stream(&t);
}

static void to_values(mcz_rows *r, cursor *c, size_t rows) {
    size_t n = r->s->n_channels;
    int64_t *p = r->values;
    for (size_t i = 0; i < rows && !c->bad; i++)
        for (const grid *g = r->now; g < r->now + n; g++, p++) {
            check(c, grid_has(g, *p), "an ordinal that its grid has not [GRID-05] [NOTES-09]");
            if (c->bad || r->s->integers) continue; /* [GRID-10] */
            double v = value_of(g, *p);
            memcpy(p, &v, 8);
        }
}

static void check_times(mcz_rows *r, cursor *c, const mcz_block *b) { /* [ROLE-04] */
    for (size_t i = 0; i < b->n_rows; i++) {
        check(c, !b->mask || b->mask[i], "a time that is invalid [ROLE-04]");
        if (b->values) {
            check(c, is_finite(b->values[i]), "a time that is not finite [ROLE-04]");
            check(c, !r->timed || b->values[i] >= r->last_time, "times that fall [ROLE-04]");
            r->last_time = b->values[i];
        } else {
            check(c, !r->timed || b->integers[i] >= r->last_tick, "times that fall [ROLE-04]");
            r->last_tick = b->integers[i];
        }
        r->timed = true;
    }
}

static void hash_values(sha256 *sha, const void *p, size_t n) { /* little-endian [CEND-03] */
    uint8_t block[512];
    for (size_t i = 0, m; i < n; i += m) {
        m = MIN_OF(n - i, 64);
        for (size_t j = 0; j < m; j++) {
            uint64_t v;
            memcpy(&v, (const uint8_t *)p + 8 * (i + j), 8);
            for (size_t k = 0; k < 8; k++) block[8 * j + k] = (uint8_t)(v >> 8 * k);
        }
        sha_add(sha, block, 8 * m);
    }
}

/* The rows of segment g that are wanted. */
static void trim(const mcz_rows *r, const segment *g, mcz_block *b, bool masked) {
    uint64_t a = MAX_OF(g->first, r->begin), e = MIN_OF(g->first + g->n_frames, r->end), n = r->s->rows_per_frame;
    size_t skip = (size_t)((a - g->first) * n) * r->s->n_channels;
    *b = (mcz_block){(a - r->s->skip) * n, (size_t)((e - a) * n), r->s->n_channels, NULL, NULL, NULL};
    if (r->s->integers) b->integers = r->values + skip;
    else b->values = (const double *)(const void *)(r->values + skip);
    if (masked) b->mask = r->mask + skip;
}

static void read_segment(mcz_rows *r, cursor *c, const segment *g, mcz_block *b) {
    size_t rows = (size_t)(g->n_frames * r->s->rows_per_frame);
    bool masked = false;
    get_streams(r, g);
    if (g->flags & GROUP_NOTES && r->s->n_channels) memcpy(r->now, r->grids, r->s->n_channels * sizeof(grid));
    for (size_t j = 0; j < r->s->n_groups; j++) {
        get_notes(r, c, r->groups + j, rows, NULL);
        if (!c->bad) get_mask(r, c, r->groups + j, rows, &masked);
    }
    if (c->bad) return;
    if (r->s->codec == RAW) raw_decode(r, c, rows);
    else fast_decode(r, c, rows);
    to_values(r, c, rows);
    for (size_t j = 0; j < r->s->n_groups && !c->bad && !r->s->integers; j++)
        get_notes(r, c, r->groups + j, rows, (double *)(void *)r->values);
    if (g->flags & GROUP_NOTES && r->s->n_channels) memcpy(r->now, r->grids, r->s->n_channels * sizeof(grid));
    trim(r, g, b, masked);
    if (r->s->role == TIMES && !c->bad) check_times(r, c, b);
}

/* The masks of all segments once more, behind the values [CEND-04]. */
static void hash_masks(mcz_rows *r, cursor *c) {
    for (size_t i = r->s->first; i && !c->bad; i = ITEM(segment, r->m->segments, i - 1)->next) {
        const segment *g = ITEM(segment, r->m->segments, i - 1);
        size_t rows = (size_t)(g->n_frames * r->s->rows_per_frame);
        mcz_block b;
        bool masked = false;
        if (g->first + g->n_frames <= r->begin || g->first >= r->end) continue;
        get_streams(r, g);
        for (size_t j = 0; j < r->s->n_groups; j++) get_mask(r, c, r->groups + j, rows, &masked);
        if (!masked) memset(r->mask, 1, rows * r->s->n_channels);
        trim(r, g, &b, true);
        sha_add(&r->sha, b.mask, b.n_rows * b.n_channels);
    }
}

static void check_hash(mcz_rows *r, cursor *c) { /* [CEND-05] */
    uint8_t h[32];
    size_t index = (size_t)(r->s - ITEM(signal, r->m->signals, r->k->signals));
    if (!r->whole || !r->hash) return;
    if (r->invalid) hash_masks(r, c);
    sha_end(&r->sha, h);
    check(c, !memcmp(h, r->k->hashes + 32 * index, 32), "the hash of a signal is wrong [CEND-05]");
}

static void expand_grids(mcz_rows *r) {
    cursor c = r->s->grids;
    for (size_t i = 0, ch = 0; i < r->s->n_runs; i++) {
        uint64_t n = varint(&c);
        for (grid g = get_grid(&c); n; n--) r->now[ch] = r->grids[ch] = g, ch++;
    }
}

static void expand_groups(mcz_rows *r) {
    const signal *s = r->s;
    const skeleton *k = ITEM(skeleton, r->m->skeletons, r->k->skeleton);
    cursor joints = k->joints, sizes = s->sizes;
    mcz_joint joint;
    size_t at = 0, n = 0;
    for (size_t j = 0; n < s->n_groups; j++) {
        size_t size = s->group_kind == 0 ? s->n_channels : 1;
        if (s->group_kind == 1) size = get_joint(&joints, j, &joint);
        if (s->group_kind == 3) size = (size_t)varint(&sizes);
        if (!size) continue;
        r->groups[n++].begin = at;
        at += size;
    }
    r->groups[n].begin = at;
}

/* The most rows of a segment that is wanted, and the first of these. */
static uint64_t survey(mcz_rows *r) {
    uint64_t most = 0;
    for (size_t i = r->s->first; i; i = ITEM(segment, r->m->segments, i - 1)->next) {
        const segment *g = ITEM(segment, r->m->segments, i - 1);
        if (g->first + g->n_frames <= r->begin || g->first >= r->end) continue;
        if (!r->at) r->at = i;
        most = MAX_OF(most, g->n_frames * r->s->rows_per_frame);
    }
    return most;
}

static void prepare(mcz_rows *r, cursor *c) {
    uint64_t n = r->s->n_channels, rows = survey(r);
    uint64_t wanted = multiply(c, r->end - r->begin, r->s->rows_per_frame);
    check(c, wanted <= bytes_limit(r->m) / 8 / MAX_OF(1, n), "a signal of too many bytes [LIMIT-10]");
    if (c->bad) return;
    r->grids = allocate(c, n * sizeof(grid));
    r->now = allocate(c, n * sizeof(grid));
    r->groups = allocate(c, (r->s->n_groups + 1) * sizeof(group));
    r->values = allocate(c, 8 * rows * n);
    r->mask = allocate(c, rows * n);
    if (r->s->codec == FAST) r->heads = allocate(c, n * sizeof(head));
    if (c->bad) return;
    expand_grids(r);
    expand_groups(r);
    sha_start(&r->sha);
}

mcz_rows *mcz_rows_open(const mcz *m, size_t i, size_t j, uint64_t begin, uint64_t end, mcz_error *error) {
    const signal *s = find_signal(m, i, j);
    *error = (mcz_error){MCZ_NO_SUCH, 0, "no such clip, signal or frames"};
    if (!s || begin > end || end > ITEM(clip, m->clips, i)->n_frames) return NULL;
    const clip *k = ITEM(clip, m->clips, i);
    *error = (mcz_error){MCZ_UNSUPPORTED, k->offset, "a codec that is not of the class core [CODEC-03] [CODEC-04]"};
    if (!can_decode(s)) return NULL;
    *error = (mcz_error){MCZ_NO_MEMORY, k->offset, "not enough memory"};
    mcz_rows *r = calloc(1, sizeof *r);
    if (!r) return NULL;
    *r = (mcz_rows){.m = m, .k = k, .s = s, .begin = s->skip + begin, .end = s->skip + end, .hash = true};
    r->whole = begin == 0 && end == k->n_frames;
    cursor c = over(m->data, 0);
    prepare(r, &c);
    *error = (mcz_error){c.code, k->offset, c.bad};
    if (!c.bad) return r;
    mcz_rows_close(r);
    return NULL;
}

void mcz_rows_check(mcz_rows *r, int hash) { r->hash = hash; }

static int rows_fail(mcz_rows *r, const cursor *c, uint64_t offset, mcz_error *error) {
    r->failed = true;
    *error = (mcz_error){c->code, offset, c->bad};
    return -1;
}

int mcz_rows_next(mcz_rows *r, mcz_block *out, mcz_error *error) {
    cursor c = over(r->m->data, 0);
    *error = (mcz_error){MCZ_OK, 0, NULL};
    const segment *g = r->at ? ITEM(segment, r->m->segments, r->at - 1) : NULL;
    if (r->failed || !g || g->first >= r->end) {
        if (!r->failed) check_hash(r, &c);
        r->hash = false;
        return c.bad ? rows_fail(r, &c, r->k->cend, error) : 0;
    }
    read_segment(r, &c, g, out);
    if (c.bad) return rows_fail(r, &c, g->offset, error);
    const void *values = out->integers ? (const void *)out->integers : out->values;
    size_t n = out->n_rows * out->n_channels;
    if (out->mask) r->invalid |= memchr(out->mask, 0, n) != NULL;
    if (r->whole && r->hash) hash_values(&r->sha, values, n);
    r->at = g->next;
    return 1;
}

void mcz_rows_close(mcz_rows *r) {
    if (!r) return;
    free(r->grids);
    free(r->now);
    free(r->groups);
    free(r->heads);
    free(r->values);
    free(r->mask);
    free(r);
}
