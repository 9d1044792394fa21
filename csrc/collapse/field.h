// A quantity on the staggered grid, and small vectors of such quantities.
//
// Cell (i, j) spans [i h, (i+1) h] x [j h, (j+1) h]. u(i, j) lives on the left face of cell (i, j),
// v(i, j) on its lower face, corner quantities on its lower left corner; p and c at its center.
// All have the same storage: i = -2 .. nx + 2 and j = -2 .. ny + 2 can be addressed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <new>
#include <utility>

#include "isa.h"
#include "parameters.h"
#include "team.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

// Unknowns of one quantity: i0 <= i < i1 and j0 <= j < j1.
struct Range {
  int i0 = 0, i1 = 0, j0 = 0, j1 = 0;
};

template <class S>
class Field {
 public:
  Field() = default;
  Field(int nx, int ny) { resize(nx, ny); }

  void resize(int nx, int ny) {
    nx_ = nx;
    ny_ = ny;
    stride_ = (nx + 3 + kPad - 1) / kPad * kPad + kPad;
    size_ = static_cast<std::size_t>(stride_) * (ny + 5) + kPad;
    data_.reset(size_);
    clear();
  }
  void clear() { std::fill_n(data_.get(), size_, S(0)); }

  int nx() const { return nx_; }
  int ny() const { return ny_; }
  S* row(int j) { return data_.get() + kPad + static_cast<std::ptrdiff_t>(j + 2) * stride_; }
  const S* row(int j) const {
    return data_.get() + kPad + static_cast<std::ptrdiff_t>(j + 2) * stride_;
  }
  S& operator()(int i, int j) { return row(j)[i]; }
  const S& operator()(int i, int j) const { return row(j)[i]; }

  // Continues a field of period nx beyond its ends.
  void wrap() {
    for (int j = -2; j <= ny_ + 2; ++j) {
      S* a = row(j);
      for (int g = 1; g <= 2; ++g) a[-g] = a[nx_ - g];
      for (int g = 0; g <= 2; ++g) a[nx_ + g] = a[g];
    }
  }

 private:
  static constexpr int kPad = 16;

  // 64-byte aligned memory.
  class Memory {
   public:
    Memory() = default;
    Memory(const Memory& other) { *this = other; }
    Memory(Memory&& other) noexcept { swap(other); }
    Memory& operator=(const Memory& other) {
      if (this != &other) {
        reset(other.size_);
        std::copy_n(other.data_, size_, data_);
      }
      return *this;
    }
    Memory& operator=(Memory&& other) noexcept {
      swap(other);
      return *this;
    }
    ~Memory() { release(); }
    void reset(std::size_t size) {
      release();
      size_ = size;
      if (size) data_ = static_cast<S*>(::operator new(size * sizeof(S), std::align_val_t(64)));
    }
    S* get() const { return data_; }

   private:
    void swap(Memory& other) {
      std::swap(data_, other.data_);
      std::swap(size_, other.size_);
    }
    void release() {
      if (data_) ::operator delete(data_, std::align_val_t(64));
      data_ = nullptr;
    }
    S* data_ = nullptr;
    std::size_t size_ = 0;
  };

  int nx_ = 0, ny_ = 0, stride_ = 0;
  std::size_t size_ = 0;
  Memory data_;
};

// The K quantities of a linear system: p, or u and v.
template <class S, int K>
struct Vector {
  std::array<Field<S>, K> part;
  void resize(int nx, int ny) {
    for (auto& field : part) field.resize(nx, ny);
  }
  Field<S>& operator[](int k) { return part[k]; }
  const Field<S>& operator[](int k) const { return part[k]; }
};

// Size and sides of the grid on which something is solved. The bottom is a wall.
struct Grid {
  int nx = 0, ny = 0;
  Side left = Side::free_slip, right = Side::no_slip, bottom = Side::no_slip, top = Side::open;

  bool periodic() const { return left == Side::periodic; }
  Grid coarser() const {
    Grid coarse = *this;
    coarse.nx /= 2;
    coarse.ny /= 2;
    return coarse;
  }
  Range cells() const { return {0, nx, 0, ny}; }
  // Faces whose velocity is unknown: not those on walls, and periodic ones once.
  Range u_faces() const {
    const int first = left == Side::open || periodic() ? 0 : 1;
    return {first, right == Side::open ? nx + 1 : nx, 0, ny};
  }
  Range v_faces() const { return {0, nx, 1, top == Side::open ? ny + 1 : ny}; }
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
