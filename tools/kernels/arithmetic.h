/* Arithmetic of kernels as SPEC.md has it: integers of 64 bits that wrap around. */

#include <math.h>
#include <string.h>

/* Whether slices of arrays are counted. Functions that allocate nothing hide it by a variable of
   theirs, see translating.py; the other name is what Cython calls that. */
enum { __pyx_v_mcz_counts = 1 };

/* Rounded down, and 0 by a divisor of 0; by -1 without the one quotient that traps. */
static inline long long mcz_divide(long long a, long long b) {
  if (b == 0) return 0;
  if (b == -1) return (long long)(0 - (unsigned long long)a);
  long long quotient = a / b;
  return quotient - (a % b != 0 && (a ^ b) < 0);
}

static inline long long mcz_remainder(long long a, long long b) {
  if (b == 0 || b == -1) return 0;
  long long rest = a % b;
  return rest + (rest != 0 && (rest ^ b) < 0 ? b : 0);
}

static inline long long mcz_left(long long a, long long n) {
  return (long long)((unsigned long long)a << (n & 63));
}

static inline long long mcz_right(long long a, long long n) { return a >> (n & 63); }

static inline long long mcz_magnitude(long long a) {
  return a < 0 ? (long long)(0 - (unsigned long long)a) : a;
}

static inline long long mcz_index(long long at, long long size) {
  (void)size;
  return at;
}

static inline double mcz_square(double a) { return a * a; }

static inline long long mcz_bit_length(long long a) {
#if defined(__GNUC__)
  return a == 0 ? 0 : 64 - __builtin_clzll((unsigned long long)a);
#else
  long long n = 0;
  for (unsigned long long rest = (unsigned long long)a; rest; rest >>= 1) n++;
  return n;
#endif
}

/* The lowest 32 bits, with their sign. */
static inline long long mcz_wrapped(long long a) { return (int)a; }

/* Little-endian; ``last`` is the last of the bytes, so that checked builds know they are all there. */
static inline long long mcz_eight_bytes(const unsigned char *at, unsigned char last) {
  (void)last;
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
  long long value;
  memcpy(&value, at, 8);
  return value;
#else
  unsigned long long value = 0;
  for (int n = 7; n >= 0; n--) value = value << 8 | at[n];
  return (long long)value;
#endif
}

/* Little-endian; ``last`` as above. */
static inline long long mcz_put_eight_bytes(unsigned char *at, unsigned char last, long long value) {
  (void)last;
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
  memcpy(at, &value, 8);
#else
  for (int n = 0; n < 8; n++) at[n] = (unsigned char)((unsigned long long)value >> 8 * n);
#endif
  return 0;
}

/* Of 0: 64. */
static inline long long mcz_trailing_zeros(long long a) {
#if defined(__GNUC__)
  return a == 0 ? 64 : __builtin_ctzll((unsigned long long)a);
#else
  long long n = 0;
  while (n < 64 && !(a >> n & 1)) n++;
  return n;
#endif
}

/* The integer part; the nearest integer of 64 bits where there is none, 0 of NaN. */
static inline long long mcz_integer(double a) {
  if (a >= -9223372036854775808.0 && a < 9223372036854775808.0) return (long long)a;
  return a != a ? 0 : a < 0 ? -9223372036854775807LL - 1 : 9223372036854775807LL;
}

/* The same of numbers that are known to be in range. */
static inline long long mcz_truncated(double a) {
#if defined(MCZ_CHECKED)
  return mcz_integer(a);
#else
  return (long long)a;
#endif
}
