#pragma once
#include <array>
#include <cassert>
#include <cstddef>
#include <initializer_list>

namespace alight {

/// A list of at most `N` elements that never allocates. Full is an expected state:
/// `push_back` then refuses and says so.
template <class T, std::size_t N>
class FixedVector {
 public:
  using value_type = T;

  FixedVector() = default;
  FixedVector(std::initializer_list<T> items) {
    for (const T& item : items) push_back(item);
  }

  /// False, and unchanged, when full.
  bool push_back(const T& item) {
    if (size_ == N) return false;
    items_[size_++] = item;
    return true;
  }
  void clear() { size_ = 0; }
  /// As many of the items as there is room for. @pre none of them is its own.
  template <class It>
  void assign(It first, It last) {
    clear();
    while (first != last && push_back(*first)) ++first;
  }
  /// @pre count <= size().
  void truncate(std::size_t count) {
    assert(count <= size_);
    size_ = count;
  }
  void erase(std::size_t i) {
    assert(i < size_);
    for (std::size_t k = i + 1; k < size_; ++k) items_[k - 1] = items_[k];
    --size_;
  }

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  bool full() const { return size_ == N; }
  static constexpr std::size_t capacity() { return N; }

  T& operator[](std::size_t i) {
    assert(i < size_);
    return items_[i];
  }
  const T& operator[](std::size_t i) const {
    assert(i < size_);
    return items_[i];
  }
  T& back() { return (*this)[size_ - 1]; }
  const T& back() const { return (*this)[size_ - 1]; }
  const T& front() const { return (*this)[0]; }
  T* data() { return items_.data(); }
  const T* data() const { return items_.data(); }
  T* begin() { return items_.data(); }
  T* end() { return items_.data() + size_; }
  const T* begin() const { return items_.data(); }
  const T* end() const { return items_.data() + size_; }

 private:
  std::array<T, N> items_{};
  std::size_t size_ = 0;
};

}  // namespace alight
