#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/vision/blob_detector.h"
#include "alight/vision/spot_fit.h"

namespace alight {

/// Puts in place of each small patch the lights that its pixels show: one, better
/// placed than by its centroid above a threshold, or two that run together, each with
/// its own place, brightness and colour. For pictures in which nothing has been found
/// yet; once there is a pose LedResolver does more.
///
/// Large patches stay as they are, LEDs near the lens stand apart; so do those that no
/// lights explain. Of many patches the first count. No allocation.
///
/// @param spread    As far as it is known.
/// @param detector  That found `blobs` in `image`; tells colours.
/// @returns how many lights there are more than before.
int fit_lights(const ImageView& image, const PointSpread& spread,
               const BlobDetector& detector, FixedVector<Blob, kMaxBlobs>& blobs);

}  // namespace alight
