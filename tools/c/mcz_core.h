/* mcz_core: a decoder of MCZ files of the class "core" (SPEC.md, Classes of conformance).
   Everything is read from memory that the caller keeps until mcz_close. No global state: readers of different
   threads do not meet. The numerals in this library are read and printed without a decimal point, so a locale
   that the program has set does no harm. */
#ifndef MCZ_CORE_H
#define MCZ_CORE_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

enum { MCZ_OK = 0, MCZ_INVALID = 1, MCZ_NO_MEMORY = 2, MCZ_UNSUPPORTED = 3, MCZ_NO_SUCH = 4 };

typedef struct {
    int code;            /* one of the above */
    uint64_t offset;     /* of the chunk, packet or segment in the file that shows it */
    const char *message; /* with the id of a rule of SPEC.md; a constant string */
} mcz_error;

typedef struct mcz mcz;           /* an open file */
typedef struct mcz_rows mcz_rows; /* the rows of a signal, being read */

typedef struct { const char *bytes; size_t size; } mcz_text; /* UTF-8, may hold zeros, no zero at its end */

typedef struct {
    mcz_text name;
    uint64_t n_frames, rate_numerator, rate_denominator; /* numerator 0: unknown */
    size_t n_signals;
    size_t skeleton;   /* for mcz_joint */
    int readable;      /* 0: the clip needs another version of the format; nothing else of it is known */
} mcz_clip;

typedef struct {
    mcz_text name;
    int role;                   /* 1 motion, 2 times, ... (SPEC.md, Registry) */
    int readable;               /* 0: a codec, or a version of one, that is not of the class core */
    int integers;               /* rows are int64_t instead of double */
    int own_channels;           /* 0: its channels are those of the skeleton */
    size_t n_channels;
    uint64_t rows_per_frame;
    uint64_t codec, codec_version;
} mcz_signal;

typedef struct {
    mcz_text name;
    size_t parent;              /* index of the parent + 1, or 0 */
    double offset[3];
    size_t n_channels;          /* columns of this joint */
} mcz_joint;

typedef struct {
    uint64_t first_row;         /* row of the clip, counted from its frame 0 */
    size_t n_rows, n_channels;
    const double *values;       /* n_rows x n_channels, row after row; NULL where the signal has integers */
    const int64_t *integers;    /* or these */
    const uint8_t *mask;        /* of the same shape, 1 valid, 0 invalid; NULL: all are valid */
} mcz_block;

/* Walks the whole file and checks all of it but the codecs' streams. `words`: the annex words.bin, which deflate
   after words needs, or NULL. Returns NULL and an error where the file is invalid or unsupported as a whole. */
mcz *mcz_open(const void *data, size_t size, const void *words, size_t n_words, mcz_error *error);
void mcz_close(mcz *file);

size_t mcz_n_clips(const mcz *file);
int mcz_get_clip(const mcz *file, size_t clip, mcz_clip *out);                   /* MCZ_OK or MCZ_NO_SUCH */
int mcz_get_signal(const mcz *file, size_t clip, size_t signal, mcz_signal *out);
int mcz_get_joint(const mcz *file, size_t skeleton, size_t joint, mcz_joint *out); /* slow: reads from joint 0 */

/* Rows of the frames begin <= f < end. mcz_rows_next gives 1 and a block (of one segment), 0 after the last one,
   -1 and an error. After the last block of a whole signal its value hash has been compared (CEND-05). */
mcz_rows *mcz_rows_open(const mcz *file, size_t clip, size_t signal, uint64_t begin, uint64_t end, mcz_error *error);
int mcz_rows_next(mcz_rows *rows, mcz_block *out, mcz_error *error);
void mcz_rows_check(mcz_rows *rows, int hash); /* 0: do not compare the hash; before the first block */
void mcz_rows_close(mcz_rows *rows);
#ifdef __cplusplus
}
#endif
#endif
