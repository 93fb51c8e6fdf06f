#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/vision/blob.h"

namespace alight {

/// Where dim pixels count, too, lights a few pixels apart run together that stand out
/// one by one among bright ones. All of `dim`, and instead of a small one that is
/// several of `bright` these, with its light shared out among them.
///
/// @param bright  Replaced by the answer.
void take_apart(BlobSpan dim, FixedVector<Blob, kMaxBlobs>& bright);

}  // namespace alight
