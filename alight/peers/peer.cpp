#include "alight/peers/peer.h"

#include <string>

#include "alight/peers/kf_less.h"
#include "alight/peers/tag_pose.h"

namespace alight {
namespace {

Result<std::unique_ptr<Peer>> create_tag_peer(PeerMethod method, const Rig& rig) {
  const std::string name = to_string(method);
  const bool aruco = method == PeerMethod::aruco;
  const TagFamily family = aruco ? TagFamily::dict_4x4_50 : TagFamily::tag36h11;
  if (!rig.tag) {
    return fail(Fault::invalid_config,
                "the method " + name +
                    " looks for a tag on the drone and the rig has none: add tag: "
                    "{family: " +
                    to_string(family) +
                    ", id: 0, size_m: .., xyz_m: .., rpy_deg: ..} to the rig file");
  }
  if (rig.tag->family != family) {
    return fail(Fault::invalid_config, "the rig's tag is of family " +
                                           std::string(to_string(rig.tag->family)) +
                                           ", the method " + name + " looks for " +
                                           to_string(family));
  }
  auto peer = aruco ? make_aruco(rig) : make_apriltag(rig);
  if (!peer) {
    return fail(Fault::invalid_config,
                "this build lacks the method " + name + ": install " +
                    (aruco ? "libopencv-contrib-dev" : "libapriltag-dev") +
                    " (script/bootstrap does) and build again");
  }
  return peer;
}

}  // namespace

const char* to_string(PeerMethod method) {
  switch (method) {
    case PeerMethod::kf_less:
      return "kf-less";
    case PeerMethod::aruco:
      return "aruco";
    case PeerMethod::apriltag:
      return "apriltag";
  }
  return "kf-less";
}

Result<std::unique_ptr<Peer>> create_peer(PeerMethod method, const Rig& rig) {
  if (auto good = rig.validate(); !good) return fail(good.error());
  if (method == PeerMethod::kf_less) return KfLess::create({}, rig);
  return create_tag_peer(method, rig);
}

}  // namespace alight
