/* mcz_core: see mcz_core.h. Written from SPEC.md; the ids in brackets are rules of that document.

   One unit of compilation in four parts, each of which stands on the one before: bytes.h, numbers.h, container.h,
   and here the interface, the codecs raw and fast, the rows of a signal. */
#include "container.h"

/* ---- The interface ------------------------------------------------------------------------------------------ */

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
    check(c, classes || h->form == 0 || within(h->form, 32, 34), "an unknown form [FAST-29]");
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
    if (h->kind == COPY) h->source = get_column(r, c, "a copy of a channel that does not exist [FAST-27]");
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
