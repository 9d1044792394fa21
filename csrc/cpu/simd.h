// A fixed-width vector of scalars built on the compiler's vector extension (GCC, Clang).
//
// `Vec<T>` has the arithmetic of a scalar, so the templates of csrc/math compute a register of
// points at once. The translation unit sets the instruction set: kernels.cpp is compiled once for
// each one, each in a namespace of its own, and dispatch.cpp selects one at run time.
//
//   instruction set   kVectorBytes   lanes, float / double   kMicroRows
//   AVX-512           64             16 / 8                  14
//   AVX2              32              8 / 4                   6
//   generic           16              4 / 2                   6
#pragma once

#include <cstdint>

#if !defined(__GNUC__)
#error "granpinn's CPU kernels need GCC or Clang (vector extensions); use one of them as CXX"
#endif

#define GRANPINN_INLINE inline __attribute__((always_inline))

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

#if defined(__AVX512F__)
constexpr int kVectorBytes = 64;
constexpr int kMicroRows = 14;  // 14 x 2 accumulators + 2 operands of 32 registers
#elif defined(__AVX2__)
constexpr int kVectorBytes = 32;
constexpr int kMicroRows = 6;  // 6 x 2 accumulators + 2 operands of 16 registers
#else
constexpr int kVectorBytes = 16;
constexpr int kMicroRows = 6;
#endif

template <class T>
constexpr int kLanes = kVectorBytes / static_cast<int>(sizeof(T));

// The compiler's vector types (an attribute cannot depend on a template parameter).
template <class T>
struct Register;
template <>
struct Register<float> {
  typedef float Native __attribute__((vector_size(kVectorBytes)));
  typedef float Unaligned __attribute__((vector_size(kVectorBytes), aligned(4), may_alias));
  typedef std::int32_t Mask __attribute__((vector_size(kVectorBytes)));
};
template <>
struct Register<double> {
  typedef double Native __attribute__((vector_size(kVectorBytes)));
  typedef double Unaligned __attribute__((vector_size(kVectorBytes), aligned(8), may_alias));
  typedef std::int64_t Mask __attribute__((vector_size(kVectorBytes)));
};

// A register of kLanes<T> values.
template <class T>
struct Vec {
  using Scalar = T;
  using Native = typename Register<T>::Native;
  using Unaligned = typename Register<T>::Unaligned;
  using Mask = typename Register<T>::Mask;
  static constexpr int N = kLanes<T>;

  Native v;

  GRANPINN_INLINE Vec() = default;
  GRANPINN_INLINE Vec(T s) : v(s - Native{}) {}  // s in all lanes
  GRANPINN_INLINE explicit Vec(Native n) : v(n) {}

  static GRANPINN_INLINE Vec load(const T* p) {
    return Vec(Native(*reinterpret_cast<const Unaligned*>(p)));
  }
  GRANPINN_INLINE void store(T* p) const { *reinterpret_cast<Unaligned*>(p) = v; }

  GRANPINN_INLINE T sum() const {
    T s = v[0];
    for (int i = 1; i < N; ++i) s += v[i];
    return s;
  }

  friend GRANPINN_INLINE Vec operator+(Vec a, Vec b) { return Vec(a.v + b.v); }
  friend GRANPINN_INLINE Vec operator-(Vec a, Vec b) { return Vec(a.v - b.v); }
  friend GRANPINN_INLINE Vec operator*(Vec a, Vec b) { return Vec(a.v * b.v); }
  friend GRANPINN_INLINE Vec operator/(Vec a, Vec b) { return Vec(a.v / b.v); }
  friend GRANPINN_INLINE Vec operator-(Vec a) { return Vec(-a.v); }
  GRANPINN_INLINE Vec& operator+=(Vec b) {
    v += b.v;
    return *this;
  }
  friend GRANPINN_INLINE Mask less(Vec a, Vec b) { return Mask(a.v < b.v); }
  friend GRANPINN_INLINE Vec select(Mask which, Vec yes, Vec no) {
    return Vec(which ? yes.v : no.v);
  }

  friend GRANPINN_INLINE Vec square_root(Vec a) {
    for (int i = 0; i < N; ++i) a.v[i] = __builtin_sqrt(a.v[i]);
    return a;
  }

  // exp: x = n log 2 + r, |r| <= log(2)/2, Taylor's series of exp(r), times 2^n through the
  // exponent bits. Below 1 ulp; beyond the range of T it saturates instead of overflowing.
  friend GRANPINN_INLINE Vec exponential(Vec x) {
    constexpr bool single = sizeof(T) == 4;
    constexpr T limit = single ? T(87) : T(708);
    constexpr T magic = single ? T(12582912.0) : T(6755399441055744.0);  // 1.5 * 2^mantissa bits
    constexpr T log2_hi = single ? T(0.693359375) : T(6.93147180369123816490e-01);
    constexpr T log2_lo = single ? T(-2.12194440e-4) : T(1.90821492927058770002e-10);
    constexpr int terms = single ? 7 : 13;
    x = select(less(x, Vec(-limit)), Vec(-limit), select(less(Vec(limit), x), Vec(limit), x));
    const Vec shifted = x * Vec(T(1.4426950408889634)) + Vec(magic);
    const Vec n = shifted - Vec(magic);
    const Vec r = (x - n * Vec(log2_hi)) - n * Vec(log2_lo);
    constexpr double inverse_factorial[] = {1.0,
                                            1.0,
                                            1.0 / 2,
                                            1.0 / 6,
                                            1.0 / 24,
                                            1.0 / 120,
                                            1.0 / 720,
                                            1.0 / 5040,
                                            1.0 / 40320,
                                            1.0 / 362880,
                                            1.0 / 3628800,
                                            1.0 / 39916800,
                                            1.0 / 479001600,
                                            1.0 / 6227020800};
    Vec sum = T(inverse_factorial[terms]);
    for (int k = terms - 1; k >= 0; --k) sum = sum * r + Vec(T(inverse_factorial[k]));
    constexpr int mantissa_bits = single ? 23 : 52;
    const Mask exponent = __builtin_convertvector(n.v, Mask) << mantissa_bits;
    return Vec(Native(Mask(sum.v) + exponent));
  }

  // log of a normal positive number (NaN: NaN): x = 2^n m with m in [sqrt(1/2), sqrt(2)), and
  // log m = 2 artanh(s) with s = (m - 1) / (m + 1), |s| < 0.172
  friend GRANPINN_INLINE Vec logarithm(Vec x) {
    constexpr bool single = sizeof(T) == 4;
    constexpr int mantissa_bits = single ? 23 : 52;
    constexpr auto root_half = single ? 0x3f3504f3 : 0x3fe6a09e667f3bcd;
    constexpr auto of_one = single ? 0x3f800000 : 0x3ff0000000000000;
    constexpr auto mantissa = single ? 0x7fffff : 0xfffffffffffff;
    constexpr T log2_hi = single ? T(0.693359375) : T(6.93147180369123816490e-01);
    constexpr T log2_lo = single ? T(-2.12194440e-4) : T(1.90821492927058770002e-10);
    using Lane = decltype(Mask{}[0] + 0);
    const Mask above = Mask(x.v) - static_cast<Lane>(root_half) + static_cast<Lane>(of_one);
    const Mask power = (above >> mantissa_bits) - static_cast<Lane>(of_one >> mantissa_bits);
    const Vec n(__builtin_convertvector(power, Native));
    const Vec m(Native((above & static_cast<Lane>(mantissa)) + static_cast<Lane>(root_half)));
    const Vec s = (m - Vec(T(1))) / (m + Vec(T(1))), s2 = s * s;
    constexpr int terms = single ? 5 : 11;
    Vec sum = T(1) / T(2 * terms + 1);
    for (int k = terms - 1; k >= 1; --k) sum = sum * s2 + Vec(T(1) / T(2 * k + 1));
    const Vec two_s = s + s, nan = x - x;
    return n * Vec(log2_hi) + (two_s + (two_s * s2 * sum + n * Vec(log2_lo))) + nan;
  }

  // log(1 + x) for 0 <= x <= 1: 2 artanh(s) with s = x / (2 + x) <= 1/3
  friend GRANPINN_INLINE Vec log_one_plus(Vec x) {
    const Vec s = x / (Vec(T(2)) + x);
    const Vec s2 = s * s;
    constexpr int terms = sizeof(T) == 4 ? 8 : 17;
    Vec sum = T(1) / T(2 * terms + 1);
    for (int k = terms - 1; k >= 0; --k) sum = sum * s2 + Vec(T(1) / T(2 * k + 1));
    return (s + s) * sum;
  }
};

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
