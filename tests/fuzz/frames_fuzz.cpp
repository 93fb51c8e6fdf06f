/// Bytes as the frames.csv of a folder with two pictures and a depth picture in it.
#include "alight/io/image_source.h"
#include "tests/fuzz/input_file.h"

using namespace alight;

namespace {

Rig small_rig() {
  Rig rig = alan_rig();
  rig.camera.intrinsics.width = 16;
  rig.camera.intrinsics.height = 16;
  const std::string folder = scratch_folder();
  require(save_png(folder + "/a.png", Image(16, 16, 3, 7).view()).has_value(), "a.png");
  require(save_png(folder + "/b.png", Image(24, 16, 3, 7).view()).has_value(), "b.png");
  DepthImage depth;
  depth.width = depth.height = 16;
  depth.data.assign(256, 900);
  require(save_png(folder + "/d.png", depth.view()).has_value(), "d.png");
  return rig;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Rig rig = small_rig();
  const std::string path = input_file("frames.csv", data, size);
  auto source = ImageSource::open(scratch_folder(), rig);
  if (!source) {
    require_told(source.error(), path);
    return 0;
  }
  require(source->count() > 0, "a source without pictures is taken");
  SourceFrame frame;
  Time last = 0;
  for (int i = 0; i < 20; ++i) {
    const auto more = source->next(frame);
    if (!more) {
      require(!more.error().detail.empty(), "refused without a reason");
      return 0;
    }
    if (!*more) return 0;
    require(i == 0 || frame.t > last, "time runs backwards");
    require(frame.color.width == 16 && frame.color.height == 16,
            "a wrong size is taken");
    last = frame.t;
  }
  return 0;
}
