#include "alight/base/rng.h"
#include "alight/geometry/rig.h"
#include "alight/io/files.h"
#include "alight/io/image_io.h"
#include "alight/io/image_source.h"
#include "alight/io/plot.h"
#include "scratch.h"

namespace alight {
namespace {

class ImageFiles : public Scratch {
 protected:
  Rig rig = [] {
    Rig small = alan_rig();
    small.camera.intrinsics.width = 32;
    small.camera.intrinsics.height = 20;
    return small;
  }();
  Image noise(int width = 32, int height = 20, int channels = 3) {
    Image image(width, height, channels);
    for (auto& value : image.data) value = static_cast<std::uint8_t>(rng.bits());
    return image;
  }
  void picture(const std::string& name, int width = 32, int height = 20) {
    ASSERT_TRUE(save_png(path(name), noise(width, height).view()));
  }
  std::string why(const std::string& folder) {
    auto source = ImageSource::open(path(folder), rig);
    if (!source) return source.error().detail.substr(path(folder).size());
    SourceFrame frame;
    while (true) {
      const auto more = source->next(frame);
      if (!more) return more.error().detail.substr(path(folder).size());
      if (!*more) return "";
    }
  }
  Rng rng{4};
};

TEST_F(ImageFiles, PngReadsBack) {
  for (const int channels : {1, 3}) {
    const Image image = noise(33, 21, channels);
    ASSERT_TRUE(save_png(path("a.png"), image.view()));
    const auto read = load_image(path("a.png"), Channels::as_stored);
    ASSERT_TRUE(read) << read.error().detail;
    EXPECT_EQ(read->channels, channels);
    EXPECT_EQ(read->data, image.data);
  }
  EXPECT_EQ(load_image(path("a.png"), Channels::grey)->channels, 1);
  EXPECT_EQ(entries(), 1);
}

TEST_F(ImageFiles, DepthReadsBack) {
  DepthImage depth;
  depth.width = 7;
  depth.height = 5;
  for (int i = 0; i < 35; ++i)
    depth.data.push_back(static_cast<std::uint16_t>(1873 * i));
  ASSERT_TRUE(save_png(path("d.png"), depth.view()));
  const auto read = load_depth(path("d.png"));
  ASSERT_TRUE(read) << read.error().detail;
  EXPECT_EQ(read->data, depth.data);
  EXPECT_EQ(load_image(path("d.png")).error().fault, Fault::invalid_input);
  picture("c.png");
  EXPECT_EQ(load_depth(path("c.png")).error().fault, Fault::invalid_input);
}

TEST_F(ImageFiles, WhatIsNoPictureIsNamed) {
  EXPECT_EQ(load_image(path("no.png")).error().detail,
            path("no.png") + ": no such file");
  const auto text = load_image(file("t.png", "hello"));
  EXPECT_EQ(text.error().detail.substr(0, path("t.png").size() + 7),
            path("t.png") + ": is no");
  EXPECT_FALSE(load_image(file("empty.png", "")));
  picture("whole.png");
  const std::string bytes = *read_file(path("whole.png"));
  EXPECT_FALSE(load_image(file("head.png", bytes.substr(0, 20))));
}

TEST_F(ImageFiles, PlainFoldersCountAsPeopleDo) {
  for (const char* name : {"f/p10.png", "f/p2.png", "f/p1.png"}) picture(name);
  file("f/notes.txt", "not a picture");
  auto source = ImageSource::open(path("f"), rig);
  ASSERT_TRUE(source) << source.error().detail;
  EXPECT_EQ(source->count(), 3);
  SourceFrame frame;
  std::string names;
  Time last = -1;
  while (*source->next(frame)) {
    names += frame.name.substr(path("f").size());
    EXPECT_GT(frame.t, last);
    last = frame.t;
  }
  EXPECT_EQ(names, "/p1.png/p2.png/p10.png");
  EXPECT_EQ(last, from_seconds(2.0 / 60));
}

TEST_F(ImageFiles, ListedFoldersKeepTheirTimesAndDepth) {
  picture("f/a.png");
  picture("f/b.png");
  DepthImage depth;
  depth.width = 32;
  depth.height = 20;
  depth.data.assign(640, 900);
  ASSERT_TRUE(save_png(path("f/d.png"), depth.view()));
  file("f/frames.csv", "t,file,depth_file\n0.5,b.png,d.png\n0.75,a.png,\n");
  auto source = ImageSource::open(path("f"), rig);
  ASSERT_TRUE(source) << source.error().detail;
  SourceFrame frame;
  ASSERT_TRUE(*source->next(frame));
  EXPECT_EQ(frame.t, 500000000);
  EXPECT_EQ(frame.depth.data, depth.data);
  ASSERT_TRUE(*source->next(frame));
  EXPECT_TRUE(frame.depth.empty());
  EXPECT_FALSE(*source->next(frame));
}

TEST_F(ImageFiles, TheSensorsOwnPicturesBecomeColours) {
  const Image raw = noise(32, 20, 1), color = noise();
  ASSERT_TRUE(save_png(path("f/a.png"), raw.view()));
  ASSERT_TRUE(save_png(path("f/b.png"), color.view()));
  SourceFrame frame;
  {
    auto source = ImageSource::open(path("f"), rig);
    ASSERT_TRUE(*source->next(frame));
    EXPECT_EQ(frame.color.data, copy_of(raw.view(), Channels::color).data);
  }
  rig.mosaic = Mosaic::gbrg;
  auto source = ImageSource::open(path("f"), rig);
  ASSERT_TRUE(*source->next(frame));
  EXPECT_EQ(frame.color.data, demosaiced(raw, Mosaic::gbrg).data);
  std::vector<std::uint8_t> own(raw.data.size());
  take_own_colors(frame.color.data.data(), 32, 20, Mosaic::gbrg, own.data());
  EXPECT_EQ(own, raw.data);
  // Those that are colours already stay.
  ASSERT_TRUE(*source->next(frame));
  EXPECT_EQ(frame.color.data, color.data);
}

TEST_F(ImageFiles, BadSourcesAreNamed) {
  picture("f/a.png");
  picture("f/b.png");
  const auto listed = [&](const std::string& text) {
    file("f/frames.csv", text);
    return why("f");
  };
  EXPECT_EQ(listed("t,file\n0,a.png\n0.1,b.png\n"), "");
  EXPECT_EQ(listed("t,file\n0.1,a.png\n0,b.png\n").substr(0, 31),
            "/frames.csv:3: t must grow from");
  EXPECT_EQ(listed("t,file\n0,a.png\n0,b.png\n").substr(0, 20), "/frames.csv:3: t mus");
  EXPECT_EQ(listed("t,file\nnan,a.png\n").substr(0, 20), "/frames.csv:2: t mus");
  EXPECT_EQ(listed("time,file\n0,a.png\n").substr(0, 40),
            "/frames.csv:1: the header lacks the colu");
  EXPECT_EQ(listed("t,file\n0\n").substr(0, 22), "/frames.csv:2: found 1");
  EXPECT_NE(listed("t,file\n0,gone.png\n").find("gone.png: no such file"),
            std::string::npos);
  const std::string long_name(300, 'n');
  EXPECT_EQ(listed("t,file\n0," + long_name + "\n"),
            "/frames.csv:2: " + path("f/" + long_name) + ": File name too long");
  EXPECT_EQ(listed("t,file,depth_file\n0,a.png," + long_name + "\n"),
            "/frames.csv:2: " + path("f/" + long_name) + ": File name too long");
  EXPECT_EQ(listed("t,file\n0,.\n"),
            "/frames.csv:2: " + path("f/.") + ": is a folder, a file is needed");
  EXPECT_EQ(why(long_name), ": File name too long");
  const auto every = [&](double step) {
    std::string text = "t,file\n";
    for (int i = 0; i < 5; ++i) text += std::to_string(i * step) + ",a.png\n";
    return listed(text);
  };
  EXPECT_EQ(every(1 / rig.timing.rate_hz), "");
  EXPECT_EQ(every(1), "");  // one picture a second
  EXPECT_NE(every(1e3 / rig.timing.rate_hz).find("look like milliseconds"),
            std::string::npos);
  EXPECT_NE(every(1e6 / rig.timing.rate_hz).find("look like microseconds"),
            std::string::npos);
  std::filesystem::create_symlink(path("circle"), path("circle"));
  EXPECT_NE(why("circle").find("symbolic link"), std::string::npos) << why("circle");
  EXPECT_EQ(listed("t,file\n"), "/frames.csv: lists no pictures");
  EXPECT_EQ(listed(""),
            "/frames.csv:1: the header lacks the column t, it should be "
            "t,file[,depth_file]");
  EXPECT_EQ(why("nowhere"), ": no such file or folder");
  file("e/readme", "");
  EXPECT_EQ(why("e"), ": holds neither frames.csv nor pictures");
  picture("w/a.png", 31, 20);
  EXPECT_EQ(why("w"), "/a.png: is 31x20, the rig's camera gives 32x20");
  file("v.mp4", "not a video");
  EXPECT_EQ(why("v.mp4"), ": is not a video that can be read");
}

double dark_share(const Image& image) {
  int dark = 0;
  for (const auto value : image.data) dark += value < 128;
  return static_cast<double>(dark) / static_cast<double>(image.data.size());
}

TEST(Plot, HasTheSizeAskedForAndShowsTheData) {
  Panel panel{.title = "T", .x_label = "x", .y_label = "y"};
  const FigureOptions options{
      .columns = 2, .panel_width_px = 300, .panel_height_px = 200};
  const Image bare = draw_figure({panel, panel, panel}, options);
  EXPECT_EQ(bare.width, 600);
  EXPECT_EQ(bare.height, 400);
  panel.series.push_back(
      {.x = {0, 1, 2}, .y = {0, 1, 0}, .color = palette::black, .mark = Mark::filled});
  EXPECT_GT(dark_share(draw_figure({panel, panel, panel}, options)),
            dark_share(bare) + 0.05);
}

TEST(Plot, StandsBadAndEmptyData) {
  const double nan = std::nan("");
  const double inf = std::numeric_limits<double>::infinity();
  for (const Mark mark : {Mark::line, Mark::dashed, Mark::dots, Mark::filled}) {
    Panel panel{.equal_aspect = true};
    panel.series = {{.label = "a", .mark = mark},
                    {.x = {nan, inf, 1, 1}, .y = {0, 1, nan, 1}, .mark = mark},
                    {.x = {0, 1e300, 2}, .y = {5, -1e300, 5}, .mark = mark}};
    panel.notes = {{nan, 0, "n"}, {1, 1, "m"}};
    EXPECT_FALSE(draw_figure({panel}).empty());
  }
  EXPECT_FALSE(draw_figure({}).empty());
}

TEST(Annotations, StayInThePictureAndEnlargeExactly) {
  Image image(40, 30, 3);
  draw_circle(image, 20.5, 15.2, 6, palette::sky);
  draw_text(image, -100, 500, "outside", palette::white);
  draw_segment(image, -1e6, 15, 1e6, 15, palette::green);
  EXPECT_GT(*std::max_element(image.data.begin(), image.data.end()), 100);
  const Image big = enlarged(image.view(), {10, 5, 90, 20}, 3);
  EXPECT_EQ(big.width, 90);
  EXPECT_EQ(big.height, 45);
  EXPECT_EQ(big.data[(7 * 90 + 8) * 3 + 1],
            image.data[((5 + 7 / 3) * 40 + 10 + 8 / 3) * 3 + 1]);
  EXPECT_TRUE(enlarged(image.view(), {50, 0, 60, 5}, 2).empty());
}

}  // namespace
}  // namespace alight
