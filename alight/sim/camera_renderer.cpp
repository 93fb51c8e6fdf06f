#include "alight/sim/camera_renderer.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>

#include "alight/geometry/stored_light.h"
#include "alight/sim/camera_background.h"
#include "alight/sim/camera_depth.h"
#include "alight/sim/camera_faults.h"
#include "alight/sim/camera_lights.h"
#include "alight/sim/camera_sight.h"
#include "alight/sim/camera_spot.h"
#include "alight/sim/tag_painter.h"

namespace alight {
namespace {

constexpr int kSmallestSide = 16;   // px
constexpr int kLargestSide = 4096;  // px
constexpr double kNominalExposureMs = 2;

bool finite(const SceneAt& scene) {
  return scene.X_IN.matrix().allFinite() && scene.X_NB.matrix().allFinite();
}

Result<void> check_size(const Intrinsics& picture) {
  for (const int side : {picture.width, picture.height}) {
    if (side < kSmallestSide || side > kLargestSide) {
      return fail(Fault::invalid_config, "camera picture is " +
                                             std::to_string(picture.width) + " x " +
                                             std::to_string(picture.height) +
                                             " px, sides must be in [16, 4096]");
    }
  }
  return {};
}

}  // namespace

struct CameraRenderer::Parts {
  Parts(const CameraSimConfig& c, const Rig& true_rig, const Rng& rng)
      : config(c),
        camera(true_rig.camera),
        lens(true_rig.camera.intrinsics),
        mosaic(true_rig.mosaic),
        timing(true_rig.timing),
        exposure_scale(
            (c.exposure_ms > 0 ? c.exposure_ms : true_rig.timing.exposure_ms) /
            kNominalExposureMs),
        frames(rng.fork("frames")),
        background(c, camera.intrinsics.width, camera.intrinsics.height,
                   rng.fork("background")),
        leds(c, true_rig, rng.fork("leds")),
        lights(make_room_lights(c, rng.fork("lights"))),
        painter(c, rng.fork("shot")),
        depth(c, true_rig, rng.fork("depth")),
        spoiler(rng.fork("spoiler")) {
    if (true_rig.gamma > 0) stored = stored_of_light(true_rig.gamma);
  }

  void interpolate(ColorBuffer& color);
  void store(ColorBuffer& color) const;
  void compress(ColorBuffer& color);

  CameraSimConfig config;
  Camera camera;
  Lens lens;
  Mosaic mosaic;
  std::optional<GreyTable> stored;
  CameraTiming timing;
  double exposure_scale;
  Rng frames;
  Background background;
  LedView leds;
  std::vector<RoomLight> lights;
  SpotPainter painter;
  std::optional<TagPainter> tag;
  DepthPainter depth;
  PictureSpoiler spoiler;
  std::vector<Spot> spots;
  std::vector<std::uint8_t> bytes;
};

void CameraRenderer::Parts::interpolate(ColorBuffer& color) {
  const std::span<std::uint8_t> pixels = color.write_all();
  bytes.resize(pixels.size() / 3);
  take_own_colors(pixels.data(), color.width, color.height, mosaic, bytes.data());
  interpolate_colors(bytes.data(), color.width, color.height, mosaic, pixels.data());
}

void CameraRenderer::Parts::store(ColorBuffer& color) const {
  for (std::uint8_t& pixel : color.write_all()) pixel = (*stored)[pixel];
}

void CameraRenderer::Parts::compress(ColorBuffer& color) {
  const std::span<std::uint8_t> pixels = color.write_all();
  const cv::Mat picture(color.height, color.width, CV_8UC3, pixels.data());
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, config.jpeg});
  const cv::Mat decoded = cv::imdecode(bytes, cv::IMREAD_COLOR);
  std::copy(decoded.datastart, decoded.dataend, pixels.begin());
}

CameraRenderer::CameraRenderer(std::unique_ptr<Parts> parts)
    : parts_(std::move(parts)) {}
CameraRenderer::~CameraRenderer() = default;
CameraRenderer::CameraRenderer(CameraRenderer&&) noexcept = default;
CameraRenderer& CameraRenderer::operator=(CameraRenderer&&) noexcept = default;

Result<CameraRenderer> CameraRenderer::create(const CameraSimConfig& config,
                                              const Rig& true_rig, std::uint64_t seed) {
  if (auto ok = config.validate(); !ok) return fail(ok.error());
  if (auto ok = true_rig.validate(); !ok) return fail(ok.error());
  if (auto ok = check_size(true_rig.camera.intrinsics); !ok) return fail(ok.error());
  auto parts = std::make_unique<Parts>(config, true_rig, Rng(seed).fork("camera"));
  if (true_rig.tag) {
    auto pattern = tag_pattern(*true_rig.tag);
    if (!pattern) return fail(pattern.error());
    parts->tag.emplace(config, true_rig, std::move(*pattern));
  }
  return CameraRenderer(std::move(parts));
}

void CameraRenderer::add_light(const RoomLight& light) {
  parts_->lights.push_back(light);
}

Result<void> CameraRenderer::render(std::uint64_t frame_index,
                                    std::span<const SceneAt> exposure,
                                    ColorBuffer& color, DepthBuffer* depth,
                                    const SceneAt* depth_scene,
                                    const PictureTrouble* trouble) {
  if (exposure.empty() || exposure.size() > kMaxInstants) {
    return fail(Fault::invalid_input, "an exposure needs 1 to 8 instants");
  }
  if (!std::all_of(exposure.begin(), exposure.end(), finite) ||
      (depth_scene != nullptr && !finite(*depth_scene))) {
    return fail(Fault::invalid_input, "a pose to render is not finite");
  }
  Parts& p = *parts_;
  // Each frame has streams of its own, whatever was rendered before.
  const char* const index = reinterpret_cast<const char*>(&frame_index);
  const Rng frame = p.frames.fork({index, sizeof(frame_index)});

  p.background.fill(frame.fork("dark"), color);
  p.spots.clear();
  if (trouble != nullptr && !trouble->any) trouble = nullptr;
  const double factor = trouble == nullptr ? 1 : trouble->exposure_factor;
  const RowScenes scenes(exposure,
                         1e-3 * p.timing.readout_ms / span_of(p.timing, factor),
                         p.camera.intrinsics.height);
  append_light_spots(p.lights, p.camera, p.lens, p.config.psf_sd_px, p.exposure_scale,
                     scenes, p.spots);
  const std::size_t of_leds = p.spots.size();
  if (trouble == nullptr) {
    p.leds.append_spots(scenes, p.spots);
  } else {
    p.leds.append_spots(scenes, p.spots, trouble->led_gain);
    if (trouble->X_NB_other) {
      FixedVector<SceneAt, kMaxInstants> other;
      for (const SceneAt& scene : exposure) {
        other.push_back({scene.X_IN, *trouble->X_NB_other});
      }
      p.leds.append_spots(scenes.of({other.data(), other.size()}), p.spots);
    }
    for (Spot& spot : p.spots) spot.flux *= trouble->exposure_factor;
    PictureSpoiler::expose(*trouble, color);
  }
  Rng shot = frame.fork("shot");
  for (std::size_t i = 0; i < of_leds; ++i) p.painter.paint(p.spots[i], shot, color);
  if (p.tag) {
    p.tag->paint(scenes, factor, frame.fork("tag"), color);
  }
  for (std::size_t i = of_leds; i < p.spots.size(); ++i) {
    p.painter.paint(p.spots[i], shot, color);
  }
  if (trouble != nullptr) p.spoiler.spoil(*trouble, frame.fork("trouble"), color);
  if (p.mosaic != Mosaic::none) p.interpolate(color);
  if (p.stored) p.store(color);
  if (p.config.jpeg > 0) p.compress(color);

  if (depth != nullptr) {
    const SceneAt& scene =
        depth_scene != nullptr ? *depth_scene : exposure[exposure.size() / 2];
    p.background.fill(frame.fork("room"), *depth);
    p.depth.paint(scene.X_NB, p.leds, frame.fork("depth"), *depth);
    if (trouble != nullptr) p.spoiler.spoil(*trouble, *depth);
  }
  return {};
}

}  // namespace alight
