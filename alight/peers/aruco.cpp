#include "alight/peers/tag_pose.h"

#ifdef ALIGHT_WITH_ARUCO
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#endif

namespace alight {

#ifdef ALIGHT_WITH_ARUCO
namespace {

constexpr double kCornerSdPx = 0.3;  // of a refined corner

/// OpenCV's detector with its own settings, corners refined to fractions of a pixel.
class Aruco final : public Peer {
 public:
  explicit Aruco(const Rig& rig)
      : rig_(rig),
        dictionary_(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50)),
        parameters_(cv::aruco::DetectorParameters::create()) {
    parameters_->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  }

  PeerReport fuse(Time, const ImageView& color, const DepthView&) override {
    PeerReport out;
    const cv::Mat image(
        color.height, color.width, color.channels == 1 ? CV_8UC1 : CV_8UC3,
        const_cast<std::uint8_t*>(color.data), static_cast<std::size_t>(color.stride));
    cv::aruco::detectMarkers(image, dictionary_, corners_, ids_, parameters_);
    out.why_not = "the tag was not found";
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (ids_[i] != rig_.tag->id) continue;
      TagCorners corners;
      for (std::size_t k = 0; k < 4; ++k) {
        corners[k] = Vector2(corners_[i][k].x, corners_[i][k].y);
      }
      pose_from_tag(rig_, corners, kCornerSdPx, out);
      break;
    }
    if (out.tracked) out.why_not = "";
    return out;
  }

 private:
  Rig rig_;
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  cv::Ptr<cv::aruco::DetectorParameters> parameters_;
  std::vector<std::vector<cv::Point2f>> corners_;
  std::vector<int> ids_;
};

}  // namespace

std::unique_ptr<Peer> make_aruco(const Rig& rig) {
  return std::make_unique<Aruco>(rig);
}
#else
std::unique_ptr<Peer> make_aruco(const Rig&) { return nullptr; }
#endif

}  // namespace alight
