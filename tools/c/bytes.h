/* Bytes of MCZ: cursors over them, CRC-32, SHA-256, raw deflate. A part of mcz_core.c. */
#ifndef MCZ_BYTES_H
#define MCZ_BYTES_H
#include "mcz_core.h"
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define MAX_COUNT ((UINT64_C(1) << 53) - 1) /* [CONV-01] */
#define MAX_OF(a, b) ((a) > (b) ? (a) : (b))
#define MIN_OF(a, b) ((a) < (b) ? (a) : (b))

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
        check(&f->in, s < 286, "deflate has an invalid length");
        if (f->in.bad) return;
        s -= 257;
        unsigned length = length_base[s] + (s < 8 || s == 28 ? 0 : deflate_bits(f, (int)(s - 4) / 4));
        unsigned d = huffman_take(f, distances);
        check(&f->in, d < 30, "deflate has an invalid distance");
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
        check(&f->in, kind < 3, "deflate has a block of an unknown kind");
        if (kind == 0) deflate_stored(f);
        if (kind == 1) deflate_fixed(&literals, &distances);
        if (kind == 2) deflate_lengths(f, &literals, &distances);
        if (kind) deflate_codes(f, &literals, &distances);
    }
    check(&f->in, f->in.p == f->in.end, "deflate ends before its bytes do [CONV-08]");
    check(&f->in, f->total == f->size, "deflate makes less than the stated size [CONV-09]");
    if (f->sink) sha_add(f->sink, f->out, f->at);
}

#endif
