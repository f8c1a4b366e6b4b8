/* Numbers of MCZ: grids, their ordinals and values, decimal text, tokens. A part of mcz_core.c. */
#ifndef MCZ_NUMBERS_H
#define MCZ_NUMBERS_H
#include "bytes.h"
#include <float.h>
#include <stdio.h>

#if FLT_EVAL_METHOD != 0
#error "CODEC-02 needs binary64 that is rounded after each operation; also compile with -ffp-contract=off"
#endif

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
                                 10000000000, 100000000000, 1000000000000, 10000000000000, 100000000000000,
                                 1000000000000000};

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
    check(c, within(g.kind, FIXED, PRINTED), "a grid of an unknown kind [GRID-01]");
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

#endif
