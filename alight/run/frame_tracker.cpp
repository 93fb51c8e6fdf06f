#include "alight/run/frame_tracker.h"

#include "alight/mission/relative_estimator.h"
#include "alight/peers/peer.h"

namespace alight {
namespace {

constexpr double kUnknownSpeed = 5;    // m/s, sd where nothing tells it
constexpr double kMotionOverS = 0.25;  // a longer gap tells no velocity

struct Named {
  TrackMethod method;
  const char* name;
};
constexpr Named kMethods[] = {{TrackMethod::iekf, "iekf"},
                              {TrackMethod::kf_less, "kf-less"},
                              {TrackMethod::aruco, "aruco"},
                              {TrackMethod::apriltag, "apriltag"}};

PeerMethod peer_of(TrackMethod method) {
  switch (method) {
    case TrackMethod::aruco:
      return PeerMethod::aruco;
    case TrackMethod::apriltag:
      return PeerMethod::apriltag;
    default:
      return PeerMethod::kf_less;
  }
}

}  // namespace

const char* to_string(TrackMethod method) {
  for (const Named& named : kMethods) {
    if (named.method == method) return named.name;
  }
  return "iekf";
}

std::optional<TrackMethod> track_method(std::string_view name) {
  for (const Named& named : kMethods) {
    if (name == named.name) return named.method;
  }
  return std::nullopt;
}

struct FrameTracker::Parts {
  void fuse_own(const CameraFrame& frame, FrameReport& out);
  void fuse_peer(const CameraFrame& frame, FrameReport& out);

  FrameTrackerOptions options;
  std::optional<RelativeEstimator> own;
  std::unique_ptr<Peer> peer;
  NoMotion motion;
  Time first = 0;
  bool begun = false;
  bool parked = false;  // and the rig not measured yet
  bool measured = false;
  // Of the peer's last pose.
  Time last = 0;
  Vector3 p_NB_last = Vector3::Zero();
  Matrix3 cov_last = Matrix3::Zero();
  bool any = false;
};

FrameTracker::FrameTracker(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
FrameTracker::FrameTracker(FrameTracker&&) noexcept = default;
FrameTracker& FrameTracker::operator=(FrameTracker&&) noexcept = default;
FrameTracker::~FrameTracker() = default;

Result<FrameTracker> FrameTracker::create(const FrameTrackerOptions& options,
                                          const Rig& rig) {
  auto parts = std::make_unique<Parts>();
  parts->options = options;
  if (options.method != TrackMethod::iekf) {
    if (options.profile != Profile::standard) {
      return fail(Fault::invalid_config, std::string("the method ") +
                                             to_string(options.method) +
                                             " has no profiles: leave out --profile");
    }
    if (options.parked_s > 0) {
      return fail(Fault::invalid_config,
                  std::string("the method ") + to_string(options.method) +
                      " does not measure the rig: leave out --parked");
    }
    auto peer = create_peer(peer_of(options.method), rig);
    if (!peer) return fail(peer.error());
    parts->peer = std::move(*peer);
    return FrameTracker(std::move(parts));
  }
  const bool paper = options.profile == Profile::paper;
  if (paper && options.parked_s > 0) {
    return fail(Fault::invalid_config,
                "the profile paper does not measure the rig: leave out --parked");
  }
  auto own = RelativeEstimator::create(
      paper ? RelativeEstimatorConfig::paper() : RelativeEstimatorConfig::camera_only(),
      rig);
  if (!own) return fail(own.error());
  parts->own.emplace(std::move(*own));
  if (options.parked_s > 0) {
    parts->parked = true;
    // As before a landing: where it stands is known to some centimetres.
    Vector6 sd;
    sd << Vector3(0.06, 0.06, 0.02), Vector3(6, 6, 10) * kDegree;
    const Vector6 variance = sd.array().square();
    parts->own->expect(
        make_pose(Matrix3::Identity(), Vector3(0, 0, rig.drone.gear_height_m)),
        variance.asDiagonal());
  }
  return FrameTracker(std::move(parts));
}

bool FrameTracker::measured_rig() const { return parts_->measured; }

double FrameTracker::gamma() const { return parts_->own ? parts_->own->gamma() : 1; }

void FrameTracker::fuse(const CameraFrame& frame, FrameReport& out) {
  if (parts_->own) {
    parts_->fuse_own(frame, out);
  } else {
    parts_->fuse_peer(frame, out);
  }
}

void FrameTracker::Parts::fuse_own(const CameraFrame& frame, FrameReport& out) {
  if (!begun) first = frame.captured;
  begun = true;
  if (parked && to_seconds(frame.captured - first) >= options.parked_s) {
    parked = false;
    // Refused (too few pictures, LEDs that contradict the place): the rig stays as
    // written.
    measured = own->calibrate_at_rest().has_value();
    own->expect_nothing();
  }
  own->fuse(frame, motion, out);
}

void FrameTracker::Parts::fuse_peer(const CameraFrame& frame, FrameReport& out) {
  const PeerReport report = peer->fuse(frame.captured, frame.color, frame.depth);
  out = FrameReport{};
  out.t = frame.captured;
  out.tracked = report.tracked;
  out.initialized = report.initialized;
  out.reprojection_px = report.reprojection_px;
  out.blobs = report.blobs;
  out.why_not = report.why_not;
  out.refused = report.refused;
  for (const LedObservation& observation : report.seen) {
    out.leds.push_back({observation, 0});
  }
  if (!report.tracked) return;
  out.x.p_NB = report.X_NB.translation();
  out.x.R_NB = report.X_NB.linear();
  out.cov.setZero();
  out.cov.topLeftCorner<6, 6>() = report.cov;
  out.cov.bottomRightCorner<3, 3>().diagonal().setConstant(kUnknownSpeed *
                                                           kUnknownSpeed);
  const Matrix3 cov = report.cov.topLeftCorner<3, 3>();
  const double dt = to_seconds(frame.captured - last);
  if (any && dt > 0 && dt < kMotionOverS) {
    out.x.v_NB = (out.x.p_NB - p_NB_last) / dt;
    out.cov.bottomRightCorner<3, 3>() = (cov + cov_last) / (dt * dt);
    out.cov.block<3, 3>(0, 6) = cov / dt;
    out.cov.block<3, 3>(6, 0) = cov / dt;
  } else {
    out.x.v_NB.setZero();
  }
  last = frame.captured;
  p_NB_last = out.x.p_NB;
  cov_last = cov;
  any = true;
}

}  // namespace alight
