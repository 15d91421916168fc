/* Operations of Plyflow's tapes, for C and for CUDA. Each rounds once to nearest, and none is fused with another one. */
#ifdef __CUDACC__
#define PF_KERNEL extern "C" __global__
#define PF_FUNCTION static __device__ __forceinline__
#define PF_TABLE static __device__ const
#define PF_EACH_LANE(lanes) \
  const long lane = (long)blockIdx.x * blockDim.x + threadIdx.x; \
  if (lane < lanes) {
#define PF_ADD(a, b) __dadd_rn(a, b)
#define PF_SUBTRACT(a, b) __dsub_rn(a, b)
#define PF_MULTIPLY(a, b) __dmul_rn(a, b)
#define PF_DIVIDE(a, b) __ddiv_rn(a, b)
#define PF_ROOT(a) __dsqrt_rn(a)
PF_FUNCTION double pf_from_bits(unsigned long long bits) { return __longlong_as_double((long long)bits); }
PF_FUNCTION unsigned long long pf_bits(double x) { return (unsigned long long)__double_as_longlong(x); }
#else
#include <math.h>
#include <string.h>
#define PF_KERNEL
#define PF_FUNCTION static inline
#define PF_TABLE static const
#define PF_EACH_LANE(lanes) for (long lane = 0; lane < lanes; ++lane) {
#define PF_ADD(a, b) ((a) + (b))
#define PF_SUBTRACT(a, b) ((a) - (b))
#define PF_MULTIPLY(a, b) ((a) * (b))
#define PF_DIVIDE(a, b) ((a) / (b))
#define PF_ROOT(a) sqrt(a)
PF_FUNCTION double pf_from_bits(unsigned long long bits) { double x; memcpy(&x, &bits, sizeof x); return x; }
PF_FUNCTION unsigned long long pf_bits(double x) { unsigned long long bits; memcpy(&bits, &x, sizeof bits); return bits; }
#endif
#define PF_END_LANE }

/* 2^n of x = 1.5 * 2^52 + n, n whole and from -1022 to 1023. */
PF_FUNCTION double pf_power_of_two(double x) { return pf_from_bits((pf_bits(x) << 52) + (1023ull << 52)); }

/* The last row of a table whose first column is not above x, else 0. */
PF_FUNCTION int pf_find(const double (*table)[8], int stride, double x) {
  int at = 0;
  for (; stride > 0; stride /= 2) at = table[at + stride][0] <= x ? at + stride : at;
  return at;
}

