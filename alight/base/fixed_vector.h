#pragma once
#include <cassert>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <type_traits>

namespace alight {

/// A list of at most `N` elements that never allocates. Full is an expected state:
/// `push_back` then refuses and says so. Room that is not taken is not copied, nor
/// initialized but for numbers: most lists of the control loop are nearly empty.
template <class T, std::size_t N>
class FixedVector {
 public:
  using value_type = T;

  FixedVector() {
    // Compilers cannot follow how many numbers there are, and warn of reading others.
    if constexpr (std::is_arithmetic_v<T>)
      std::uninitialized_value_construct_n(items_, N);
  }
  FixedVector(std::initializer_list<T> items) : FixedVector() {
    for (const T& item : items) push_back(item);
  }
  FixedVector(const FixedVector& other) : FixedVector() { append(other); }
  FixedVector& operator=(const FixedVector& other) {
    if (this != &other) {
      clear();
      append(other);
    }
    return *this;
  }
  ~FixedVector() requires std::is_trivially_destructible_v<T>
  = default;
  ~FixedVector() { clear(); }

  /// False, and unchanged, when full.
  bool push_back(const T& item) {
    if (size_ == N) return false;
    std::construct_at(items_ + size_, item);
    ++size_;
    return true;
  }
  void clear() { truncate(0); }
  /// As many of the items as there is room for. @pre none of them is its own.
  template <class It>
  void assign(It first, It last) {
    clear();
    while (first != last && push_back(*first)) ++first;
  }
  /// @pre count <= size().
  void truncate(std::size_t count) {
    assert(count <= size_);
    std::destroy(items_ + count, items_ + size_);
    size_ = count;
  }
  void erase(std::size_t i) {
    assert(i < size_);
    for (std::size_t k = i + 1; k < size_; ++k) items_[k - 1] = items_[k];
    truncate(size_ - 1);
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
  T* data() { return items_; }
  const T* data() const { return items_; }
  T* begin() { return items_; }
  T* end() { return items_ + size_; }
  const T* begin() const { return items_; }
  const T* end() const { return items_ + size_; }

 private:
  void append(const FixedVector& other) {
    for (const T& item : other) push_back(item);
  }

  union {
    T items_[N];
  };
  std::size_t size_ = 0;
};

}  // namespace alight
