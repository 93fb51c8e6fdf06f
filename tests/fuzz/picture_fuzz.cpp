/// Bytes as a picture file, and what detects in whatever it decodes to.
#include <cmath>

#include "alight/io/image_io.h"
#include "alight/vision/led_finder.h"
#include "tests/fuzz/input_file.h"

using namespace alight;

namespace {

/// Made once: its tables take a hundred times as long as a picture does.
LedFinder& finder() {
  static LedFinder one = [] {
    Rig rig = alan_rig();
    // Pictures are small here: what is in them is seen straight ahead.
    rig.camera.intrinsics.cx = 16;
    rig.camera.intrinsics.cy = 12;
    LedFinderConfig config;
    config.work_max = 2000;  // Noise would use all of it up, slowed down by checks.
    auto made = LedFinder::create(config, rig.camera, rig.leds, rig.pad.size_m);
    require(made.has_value(), "no finder");
    return std::move(*made);
  }();
  return one;
}

void detect_in(const Image& image) {
  auto detector = BlobDetector::create({}, image.width, image.height);
  if (!detector) {
    require(!detector.error().detail.empty(), "refused without a reason");
    return;
  }
  const auto blobs = detector->detect(image.view());
  if (!blobs) return;
  for (const Blob& blob : *blobs) require(blob.uv.allFinite(), "a blob is not finite");
  const auto found = finder().find(*blobs);
  if (found) {
    require(found->fit.X_NB.matrix().allFinite(), "a pose is not finite");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string path = input_file("picture", data, size);
  for (const Channels channels : {Channels::as_stored, Channels::grey}) {
    const auto image = load_image(path, channels);
    if (!image) {
      require_told(image.error(), path);
      break;
    }
    require(image->width > 0 && image->height > 0, "a picture without pixels is taken");
    require(image->channels == 1 || image->channels == 3, "odd channels are taken");
    if (channels == Channels::as_stored) detect_in(*image);
  }
  const auto depth = load_depth(path);
  if (!depth) require_told(depth.error(), path);
  return 0;
}
