#include "alight/sim/picture_buffer.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

using Line = ColorBuffer::Line;
constexpr int kWidth = 7, kHeight = 5;
constexpr std::size_t kWindows = 40;

std::shared_ptr<const Line> line_of(std::uint64_t seed) {
  Rng rng(seed);
  auto line = std::make_shared<Line>((kWidth * kHeight + kWindows) * 3);
  for (std::uint8_t& value : *line) value = static_cast<std::uint8_t>(rng.bits());
  return line;
}

void draw_somewhere(Rng& rng, ColorBuffer& out) {
  const int u = static_cast<int>(rng.uniform(0, kWidth));
  const int v = static_cast<int>(rng.uniform(0, kHeight));
  const int count = static_cast<int>(rng.uniform(0, kWidth - u + 1));
  std::uint8_t* const values = out.write(u, v, count);
  for (int i = 0; i < 3 * count; ++i) values[i] = static_cast<std::uint8_t>(rng.bits());
}

class PictureBuffer : public testing::TestWithParam<std::uint64_t> {};

TEST_P(PictureBuffer, IsTheLinesWindowWhateverWasDrawnBefore) {
  Rng rng(GetParam());
  const std::shared_ptr<const Line> lines[] = {line_of(1), line_of(2)};
  ColorBuffer buffer;
  for (int picture = 0; picture < 50; ++picture) {
    const auto& line = lines[rng.chance(0.2)];
    const std::size_t first = rng.bits() % (kWindows + 1);
    buffer.lay(line, first, kWidth, kHeight);
    const auto begin = line->begin() + static_cast<std::ptrdiff_t>(3 * first);
    ASSERT_TRUE(std::equal(buffer.pixels().begin(), buffer.pixels().end(), begin));
    ASSERT_EQ(buffer.view().row(0), buffer.pixels().data());
    for (int k = 0; k < 5; ++k) draw_somewhere(rng, buffer);
    if (rng.chance(0.2)) {
      for (std::uint8_t& value : buffer.write_all()) value = 3;
      draw_somewhere(rng, buffer);
    }
    if (rng.chance(0.2)) buffer = ColorBuffer(buffer);
    if (rng.chance(0.1)) buffer.clear(kWidth, kHeight);
  }
}
INSTANTIATE_TEST_SUITE_P(Seeds, PictureBuffer, testing::Range<std::uint64_t>(0, 20));

TEST(PictureBufferWrite, ReachesThePixelsAsked) {
  ColorBuffer buffer;
  buffer.clear(kWidth, kHeight);
  buffer.lay(line_of(1), 4, kWidth, kHeight);
  buffer.write(2, 3, 1)[1] = 77;
  EXPECT_EQ(buffer.view().row(3)[3 * 2 + 1], 77);
}

}  // namespace
}  // namespace alight
