#pragma once
#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "alight/base/result.h"

namespace alight {

/// Memory for pictures that are held, in all threads together.
inline constexpr std::size_t kBytesHeld = std::size_t{1} << 29;

/// Pictures decoded or rendered many at a time and then handed out one after the other.
/// Either fills the caches of its core with its own code and tables; an update timed
/// between two would mostly wait for its own to come back.
template <class Picture>
class MadeInBulk {
 public:
  using Make = std::function<Result<bool>(Picture&)>;

  /// @param make  Fills a picture; false when there is none left. After that, and after
  ///              a failure, it is not called again.
  /// @param picture_bytes  Of one picture; as many are held as `bytes` has room for.
  MadeInBulk(Make make, std::size_t picture_bytes, std::size_t bytes = kBytesHeld)
      : make_(std::move(make)),
        held_(std::clamp<std::size_t>(bytes / std::max<std::size_t>(picture_bytes, 1),
                                      1, kMost)) {}

  /// Copies the next picture to where the last one was, as a camera's driver does;
  /// false at the end. What `make` failed of comes in its turn, and stays.
  Result<bool> next(Picture& picture) {
    if (taken_ == made_ && status_ && *status_) make_some();
    if (taken_ == made_) return status_;
    picture = held_[taken_++];
    return true;
  }

 private:
  static constexpr std::size_t kMost = 1000;

  void make_some() {
    for (made_ = taken_ = 0; made_ < held_.size(); ++made_) {
      status_ = make_(held_[made_]);
      if (!status_ || !*status_) return;
    }
  }

  Make make_;
  std::vector<Picture> held_;
  std::size_t made_ = 0, taken_ = 0;
  Result<bool> status_ = true;
};

}  // namespace alight
