/* What every model's file begins with: arrays that know their length, and Python's min, max and %. */
#include <complex.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#pragma STDC FP_CONTRACT OFF
typedef struct { double *p; int64_t n; } Vec;
typedef struct { const int64_t *p; int64_t n; } IVec;
typedef struct { const int32_t *p; int64_t n; } BVec;
typedef struct { double *p; int64_t n, m; } Mat;
static inline double min_f(double a, double b) { return b < a ? b : a; }
static inline double max_f(double a, double b) { return b > a ? b : a; }
static inline int64_t min_i(int64_t a, int64_t b) { return b < a ? b : a; }
static inline int64_t max_i(int64_t a, int64_t b) { return b > a ? b : a; }
static inline int64_t mod_i(int64_t a, int64_t b)
{
    int64_t r = a % b;
    return r != 0 && (r < 0) != (b < 0) ? r + b : r;
}
static inline double mod_f(double a, double b)
{
    double r = fmod(a, b);
    return r != 0.0 && (r < 0.0) != (b < 0.0) ? r + b : r;
}
static inline double square(double a) { return a * a; }
