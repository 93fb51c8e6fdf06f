#include <algorithm>
#include <vector>

#include "alight/peers/tag_pose.h"

#ifdef ALIGHT_WITH_APRILTAG
extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}
#endif

namespace alight {

#ifdef ALIGHT_WITH_APRILTAG
namespace {

constexpr double kCornerSdPx = 0.3;

/// The AprilTag 3 library with its own settings but one: the picture is searched at its
/// full size, for a tag a few dozen pixels wide.
class AprilTag final : public Peer {
 public:
  explicit AprilTag(const Rig& rig)
      : rig_(rig),
        family_(tag36h11_create(), tag36h11_destroy),
        detector_(apriltag_detector_create(), apriltag_detector_destroy) {
    apriltag_detector_add_family(detector_.get(), family_.get());
    detector_->nthreads = 1;
    detector_->quad_decimate = 1;
  }

  PeerReport fuse(Time, const ImageView& color, const DepthView&) override {
    PeerReport out;
    grey_.resize(static_cast<std::size_t>(color.width) *
                 static_cast<std::size_t>(color.height));
    auto to = grey_.begin();
    for (int v = 0; v < color.height; ++v) {
      const std::uint8_t* p = color.row(v);
      for (int u = 0; u < color.width; ++u, p += color.channels, ++to) {
        // Rec. 601, in 1024ths.
        *to = color.channels == 1 ? p[0]
                                  : static_cast<std::uint8_t>(
                                        (117 * p[0] + 601 * p[1] + 306 * p[2]) >> 10);
      }
    }
    image_u8_t image{color.width, color.height, color.width, grey_.data()};
    zarray_t* const found = apriltag_detector_detect(detector_.get(), &image);
    out.why_not = "the tag was not found";
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* detection = nullptr;
      zarray_get(found, i, &detection);
      if (detection->id != rig_.tag->id || out.tracked) continue;
      // Theirs go against the clock from the bottom left, and count from the first
      // pixel's corner.
      TagCorners corners;
      for (std::size_t k = 0; k < 4; ++k) {
        corners[3 - k] = Vector2(detection->p[k][0] - 0.5, detection->p[k][1] - 0.5);
      }
      pose_from_tag(rig_, corners, kCornerSdPx, out);
    }
    apriltag_detections_destroy(found);
    if (out.tracked) out.why_not = "";
    return out;
  }

 private:
  Rig rig_;
  std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)> family_;
  // Goes first: it refers to the family.
  std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector_;
  std::vector<std::uint8_t> grey_;
};

}  // namespace

std::unique_ptr<Peer> make_apriltag(const Rig& rig) {
  return std::make_unique<AprilTag>(rig);
}
#else
std::unique_ptr<Peer> make_apriltag(const Rig&) { return nullptr; }
#endif

}  // namespace alight
