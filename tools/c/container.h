/* The container of MCZ: what is known of a file, each of its chunks, its index, the walk through it.
   A part of mcz_core.c. */
#ifndef MCZ_CONTAINER_H
#define MCZ_CONTAINER_H
#include "numbers.h"

enum { MAJOR = 1, MINOR = 0 }; /* the version of SPEC.md */

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
    check(c, encoding <= AFTER_WORDS, "an unknown encoding [CONV-15]");
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
static bool version_is_ours(unsigned major, unsigned minor) { return major == MAJOR && minor <= MINOR; }

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
static bool of_clips(unsigned format) { return within(format, 2, 14) || format == 16 || format == 17; }

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
            check(c, !same_text(name, forbidden[i]), "a META sets a fact of CLIP [META-03]");
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

static void check_finite(cursor *c, int n) {
    while (n--) check(c, is_finite(get_double(c)), "an offset, tail or axis that is not finite [SKEL-08]");
}

static size_t get_joint(cursor *c, size_t i, mcz_joint *out) { /* its number of channels */
    out->name = text(c);
    uint64_t parent = varint(c), n;
    check(c, parent <= i, "a parent after its child [SKEL-05]");
    out->parent = (size_t)parent;
    unsigned flags = get_flags(c, 1 | 2 | 4 | 128);
    for (int j = 0; j < 3; j++) out->offset[j] = flags & 2 ? get_double(c) : 0;
    for (int j = 0; j < 3; j++) check(c, is_finite(out->offset[j]), "an offset that is not finite [SKEL-08]");
    if (flags & 4) {
        check_finite(c, 3);
        check(c, get8(c) <= 5, "an unknown axis order [CONV-15]");
    }
    for (n = counted(c, 24); n && !c->bad; n--) check_finite(c, 3);
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
    check(c, get8(c) <= 2, "an unknown angle unit [CONV-15]");
    unsigned up = get8(c), forward = get8(c);
    check(c, up <= 6 && forward <= 6, "an unknown axis [CONV-15]");
    check(c, !up || !forward || up % 3 != forward % 3, "a figure that faces along its up axis [SKEL-10]");
    check(c, get8(c) <= 2, "an unknown handedness [CONV-15]");
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
    check(c, !k->open || k->n_missing == 0, "CLIP has missing frames that belong in CEND [TIME-04]");
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
    check(c, s->group_kind <= 3, "groups of an unknown kind [CONV-15]");
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
        check(c, of < k->n_signals && of != index, "residuals of a signal that does not exist [ROLE-05]");
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
    check(c, c->bad || 256 * major + minor <= head, "a clip that needs more than HEAD states [CLIP-22]");
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
    check(c, index < k->n_signals, "a segment of a signal that does not exist [DATA-06]");
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
    check(c, (kind & 15) <= 2, "a packet of an unknown kind [PACK-09]");
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
    check(c, a->n_parts >= 1, "an attachment without parts [ATTA-01]");
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
    check(c, a.of <= 2, "an alias of an unknown kind [CONV-15]");
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
        check(&r, distance && is_chunk(m, at), "a copy of a chunk that does not exist [COPY-02]");
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

#endif
