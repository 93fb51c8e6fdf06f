#include "alight/vision/led_finder.h"

#include <algorithm>
#include <cmath>

#include "alight/vision/constellation_check.h"
#include "alight/vision/led_finder_search.h"
#include "alight/vision/linear_picture.h"

namespace alight {
namespace {

constexpr double kSurelyPad = 0.9;  // of its side: the mount may be off
// A single picture may take so many times longer: there is no next one.
constexpr int kNobodyWaits = 20, kPatient = 50'000'000;

double radius_of(const Constellation& leds) {
  double radius = 0;
  for (const Led& led : leds.leds) {
    radius = std::max(radius, (led.p_BL - leds.middle_B()).norm());
  }
  return radius;
}

}  // namespace

LedFinder::LedFinder(std::unique_ptr<Search> search) : search_(std::move(search)) {}
LedFinder::LedFinder(LedFinder&&) noexcept = default;
LedFinder& LedFinder::operator=(LedFinder&&) noexcept = default;
LedFinder::~LedFinder() = default;

Result<LedFinder> LedFinder::create(const LedFinderConfig& config, const Camera& camera,
                                    const Constellation& leds, double pad_size_m) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  ConstellationUse use;
  use.led_sd_m = config.led_sd_m;
  use.one_sided = config.facing_max_deg < 180;
  use.use_color = config.use_color;
  if (const auto report = check_constellation(leds, camera.intrinsics, use);
      !report.refusal.empty()) {
    return fail(Fault::invalid_config, report.refusal);
  }
  auto search = std::make_unique<Search>(config, camera, leds, pad_size_m);
  if (search->shapes.triples().empty()) {
    return fail(Fault::invalid_config,
                "the LEDs stand in a line, or no pose that is allowed is in view");
  }
  return LedFinder(std::move(search));
}

void LedFinder::set_rig(const Camera& camera, const Constellation& leds,
                        double led_sd_m) {
  search_->camera = camera;
  search_->leds = leds;
  search_->centre_B = leds.middle_B();
  search_->radius_m = radius_of(leds);
  search_->config.led_sd_m = led_sd_m;
  search_->prepare_corners();
}

Result<FoundLeds> LedFinder::find(BlobSpan blobs, Time t, Look look) {
  search_->open.clear();
  return search_->config.profile == LedFinderConfig::Profile::paper
             ? search_->find_paper(blobs, t)
             : search_->find_standard(blobs, t, look);
}

bool LedFinder::plausible(const Pose& X_NB) const { return search_->plausible(X_NB); }

std::span<const LedRival> LedFinder::left_open() const {
  return {search_->open.data(), search_->open.size()};
}

LedFinder::Search::Search(const LedFinderConfig& config_in, const Camera& camera_in,
                          const Constellation& leds_in, double pad_size_in)
    : config(config_in),
      camera(camera_in),
      leds(leds_in),
      pad_size_m(pad_size_in),
      centre_B(leds_in.middle_B()),
      radius_m(radius_of(leds_in)),
      shapes(camera, leds, config.range_min_m, config.range_max_m,
             config.tilt_max_deg * kDegree,
             [this](const Pose& X_NB) { return plausible(X_NB); }),
      neighbours(2 * kMaxBlobs) {
  split.reserve(2 * kMaxBlobs);
  whole.reserve(2 * kMaxBlobs);
  usable.reserve(kMaxBlobs);
  seeds.reserve(2 * kMaxBlobs);
  by_distance.reserve(2 * kMaxBlobs);
  pinhole.reserve(2 * kMaxBlobs);
  twins.reserve(kTwins);
  corners.reserve(shapes.triples().size());
  prepare_corners();
  // A rough pose is some degrees off.
  cos_tilt_most = std::cos(std::min(config.tilt_max_deg + 15, 180.0) * kDegree);
  for (auto& list : neighbours) list.reserve(kNeighbours);
  for (auto& corner : of_color) {
    for (TripleSet& set : corner) set.assign(shapes.words(), 0);
  }
}

bool LedFinder::Search::plausible(const Pose& X_NB) const {
  const Vector3 lens_from_drone = camera.X_NC.translation() - X_NB * centre_B;
  const double range = lens_from_drone.norm();
  if (!(range >= config.range_min_m && range <= config.range_max_m)) return false;
  if (X_NB.linear()(2, 2) < std::cos(config.tilt_max_deg * kDegree)) return false;
  if (config.pad_hides && behind_pad(X_NB * centre_B)) return false;
  if (config.facing_max_deg >= 180) return true;
  const Vector2 side =
      (X_NB.linear() * Vector3(centre_B.x(), centre_B.y(), 0)).head<2>();
  const double level = lens_from_drone.head<2>().norm();
  // LEDs around the middle face nowhere; from below or above the side does not matter.
  if (side.norm() < 0.25 * radius_m || level < 0.3 * range) return true;
  return side.dot(lens_from_drone.head<2>()) >
         std::cos(config.facing_max_deg * kDegree) * side.norm() * level;
}

bool LedFinder::Search::behind_pad(const Vector3& p_N) const {
  const Vector3 p_NC = camera.X_NC.translation();
  if (p_NC.z() <= 0 || p_N.z() >= 0) return false;
  const Vector3 through = p_NC + p_NC.z() / (p_NC.z() - p_N.z()) * (p_N - p_NC);
  return through.head<2>().cwiseAbs().maxCoeff() < kSurelyPad * pad_size_m / 2;
}

double LedFinder::Search::image_sd(const Pose& X_NB) const {
  const double range = (X_NB * centre_B - camera.X_NC.translation()).norm();
  return std::hypot(config.centroid_sd_px,
                    config.led_sd_m * camera.intrinsics.fx / range);
}

Result<FoundLeds> LedFinder::Search::find_standard(BlobSpan blobs, Time t, Look look) {
  Result<FoundLeds> found = fail(Fault::too_few_points);
  split_long(blobs);
  const BlobSpan parts(split);
  // Washed-out LEDs look white, and so do lamps: they are let in only when the lights
  // of a true colour do not do.
  const bool any_white =
      config.use_color && std::any_of(blobs.begin(), blobs.end(), [](const Blob& b) {
        return b.color == LedColor::white;
      });
  for (const bool white_is_any : {false, true}) {
    if (white_is_any && (!any_white || look == Look::glance)) break;
    work = 0;
    prepare(parts, white_is_any);
    if (usable.size() < (look == Look::glance ? 5 : 4)) continue;
    // A rival that explains five LEDs would be met by the first few triples, too.
    const std::size_t all = shapes.triples().size(), few = shapes.few();
    const bool five = usable.size() >= 5;
    for (const auto& [first, last] : {std::pair{0ul, few}, std::pair{few, all}}) {
      search_triples(parts, white_is_any, first, last);
      try_guesses(parts, white_is_any);
      if (!five && last != all) continue;
      found = decide(blobs, white_is_any, t);
      if (most_blobs >= 5) break;
      // Rivals of four lights may be met by the other triples only.
      if (look == Look::glance) return fail(Fault::too_few_points);
    }
    if (found || found.error().fault == Fault::ambiguous) break;
  }
  return found;
}

Result<DetectResult> detect_once(const Rig& rig, const ImageView& image,
                                 const DepthView& depth,
                                 const BlobDetectorConfig& blob_config,
                                 const LedFinderConfig& finder_config) {
  auto detector = BlobDetector::create(blob_config, rig.camera.intrinsics.width,
                                       rig.camera.intrinsics.height);
  if (!detector) return fail(detector.error());
  LedFinderConfig patient = finder_config;
  patient.work_max = std::min(patient.work_max, kPatient) * kNobodyWaits;
  auto finder = LedFinder::create(patient, rig.camera, rig.leds, rig.pad.size_m);
  if (!finder) return fail(finder.error());
  if (!detector->takes(image, depth)) return fail(Fault::invalid_input);
  LinearPicture linear(image.width, image.height, rig.gamma > 0 ? rig.gamma : 1);
  detector->set_noise(linear.of(picture_noise(image)));
  const auto blobs = detector->detect(linear.of(image), depth);
  if (!blobs) return fail(blobs.error());
  DetectResult result;
  result.blobs.assign(blobs->begin(), blobs->end());
  result.found = finder->find(*blobs);
  if (result.found && result.found->another) result.found = fail(Fault::ambiguous);
  return result;
}

}  // namespace alight
