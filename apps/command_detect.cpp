#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>

#include "alight/io/files.h"
#include "alight/io/json_text.h"
#include "alight/io/plot.h"
#include "alight/vision/led_finder.h"
#include "checks.h"
#include "command.h"
#include "json.h"
#include "rig_option.h"

using namespace alight;

namespace {

struct Options {
  std::vector<std::string> images;
  std::string rig;
  std::string out;
  bool json = false;
};

/// An LED and where it was seen; merged ones share a place.
struct SeenLed {
  int index = 0;
  Vector2 uv = Vector2::Zero();
  LedColor color = LedColor::none;  ///< Of the blob, not of the rig.
};

std::vector<SeenLed> seen_leds(const DetectResult& result) {
  std::vector<SeenLed> leds;
  if (!result.found) return leds;
  for (const LedObservation& seen : result.found->frame.seen) {
    const Blob* nearest = nullptr;
    for (const Blob& blob : result.blobs) {
      if (!nearest || (blob.uv - seen.uv).norm() < (nearest->uv - seen.uv).norm()) {
        nearest = &blob;
      }
    }
    for (int i = 0; i < kMaxLeds; ++i) {
      if (!(seen.leds >> i & 1)) continue;
      leds.push_back({i, seen.uv, nearest ? nearest->color : LedColor::none});
    }
  }
  return leds;
}

Json document(const std::string& file, const DetectResult& result) {
  Json json;
  json["file"] = file;
  json["blobs"] = Json::array();
  for (const Blob& blob : result.blobs) {
    json["blobs"].push_back({{"u", blob.uv.x()},
                             {"v", blob.uv.y()},
                             {"area_px", blob.area_px},
                             {"color", to_string(blob.color)}});
  }
  json["leds"] = Json::array();
  for (const SeenLed& led : seen_leds(result)) {
    json["leds"].push_back({{"index", led.index},
                            {"u", led.uv.x()},
                            {"v", led.uv.y()},
                            {"color", to_string(led.color)}});
  }
  json["pose"] = result.found ? as_json(result.found->fit.X_NB) : Json(nullptr);
  json["reprojection_px"] =
      result.found ? number_or_null(result.found->fit.rms_px) : Json(nullptr);
  return json;
}

void print(const std::string& file, const DetectResult& result) {
  std::printf("%s: %zu blobs", file.c_str(), result.blobs.size());
  if (!result.found) {
    std::printf(", no pose: %s\n", result.found.error().fault == Fault::ambiguous
                                       ? "two explain the picture about equally well"
                                       : "none explains enough LEDs");
    return;
  }
  const std::vector<SeenLed> leds = seen_leds(result);
  const Vector3 p = result.found->fit.X_NB.translation();
  std::printf(", %zu LEDs, pose (%.3f, %.3f, %.3f) m in N, fits within %.2f px rms\n",
              leds.size(), p.x(), p.y(), p.z(), result.found->fit.rms_px);
  for (const SeenLed& led : leds) {
    std::printf("  LED %d  %8.2f %8.2f  %s\n", led.index, led.uv.x(), led.uv.y(),
                to_string(led.color));
  }
}

Rgb paint(LedColor color) {
  switch (color) {
    case LedColor::red:
      return {255, 90, 90};
    case LedColor::green:
      return {90, 255, 120};
    case LedColor::blue:
      return palette::sky;
    default:
      return palette::white;
  }
}

/// Blobs grey, LEDs in their colour and numbered.
Image annotated(const Image& image, const DetectResult& result) {
  Image picture = copy_of(image.view(), Channels::color);
  for (const Blob& blob : result.blobs) {
    draw_circle(picture, blob.uv.x(), blob.uv.y(), 5, palette::grey, 1);
  }
  for (const SeenLed& led : seen_leds(result)) {
    draw_circle(picture, led.uv.x(), led.uv.y(), 6, paint(led.color), 1);
    draw_text(picture, led.uv.x() - 4, led.uv.y() - 9, std::to_string(led.index),
              paint(led.color), 10);
  }
  return picture;
}

struct Seen {
  std::string file;
  DetectResult result;
  Image picture;  ///< Annotated, if wanted.
};

Result<std::vector<Seen>> detect_all(const Options& options) {
  const auto rig = load_seen_rig(options.rig, "detect");
  if (!rig) return fail(rig.error());
  const Intrinsics& lens = rig->camera.intrinsics;
  std::vector<Seen> all;
  for (const std::string& file : options.images) {
    const auto image = load_image(file, Channels::as_stored);
    if (!image) return fail(image.error());
    if (image->width != lens.width || image->height != lens.height) {
      return fail(Fault::invalid_input, file + ": is " + std::to_string(image->width) +
                                            "x" + std::to_string(image->height) +
                                            ", the camera of " + options.rig +
                                            " gives " + std::to_string(lens.width) +
                                            "x" + std::to_string(lens.height));
    }
    auto result = detect_once(*rig, image->view());
    if (!result) return fail(result.error().fault, file + ": " + result.error().detail);
    all.push_back({file, std::move(*result), {}});
    if (!options.out.empty()) all.back().picture = annotated(*image, all.back().result);
  }
  return all;
}

/// "NAME_leds.png", numbered where another image has the same name.
std::string picture_name(const std::string& file,
                         const std::vector<std::string>& taken) {
  const std::string stem = std::filesystem::path(file).stem().string();
  const auto is_taken = [&](const std::string& name) {
    return std::any_of(taken.begin(), taken.end(), [&](const std::string& path) {
      return std::filesystem::path(path).filename() == name;
    });
  };
  std::string name = stem + "_leds.png";
  for (int n = 2; is_taken(name); ++n) {
    name = stem + "_" + std::to_string(n) + "_leds.png";
  }
  return name;
}

/// Nothing is said or written before every picture has been read.
Result<void> run(const Options& options) {
  if (!options.out.empty()) {
    if (auto good = check_folder(options.out); !good) return good;
  }
  const auto all = detect_all(options);
  if (!all) return fail(all.error());
  Json images = Json::array();
  std::vector<std::string> pictures;
  for (const Seen& seen : *all) {
    images.push_back(document(seen.file, seen.result));
    if (seen.picture.empty()) continue;
    pictures.push_back(options.out + "/" + picture_name(seen.file, pictures));
    if (auto good = save_png(pictures.back(), seen.picture.view()); !good) return good;
  }
  if (options.json) {
    std::cout << json_text(Json{{"images", images}}, 2) << '\n';
    return {};
  }
  for (const Seen& seen : *all) print(seen.file, seen.result);
  for (const std::string& picture : pictures) {
    std::printf("  picture %s\n", picture.c_str());
  }
  return {};
}

}  // namespace

void add_detect(CLI::App& app, Job& job) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("detect", "Finds the LEDs in single images, and the pose");
  command->add_option("IMAGE", options->images)->required();
  command->add_option("--rig", options->rig, "Rig file")->required();
  command->add_option("--out", options->out, "Folder for annotated pictures")
      ->check(named());
  command->add_flag("--json", options->json, "One JSON document");
  command->callback([options, &job] { job = [options] { return run(*options); }; });
}
