/// Bytes as a picture file, and what detects in whatever it decodes to.
#include <cmath>

#include "alight/io/image_io.h"
#include "alight/vision/led_finder.h"
#include "tests/fuzz/input_file.h"

using namespace alight;

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
    Rig rig = alan_rig();
    rig.camera.intrinsics.width = image->width;
    rig.camera.intrinsics.height = image->height;
    const auto seen = detect_once(rig, image->view());
    if (!seen) {
      require(!seen.error().detail.empty(), "refused without a reason");
    } else if (seen->found) {
      require(seen->found->fit.X_NB.matrix().allFinite(), "a pose is not finite");
    }
  }
  const auto depth = load_depth(path);
  if (!depth) require_told(depth.error(), path);
  return 0;
}
