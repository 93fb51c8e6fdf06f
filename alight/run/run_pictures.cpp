#include "alight/run/run_pictures.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/io/plot.h"
#include "alight/sim/camera_config.h"

namespace alight {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Rgb color_of(LedColor color) {
  switch (color) {
    case LedColor::red:
      return {255, 90, 80};
    case LedColor::green:
      return {90, 240, 110};
    case LedColor::blue:
      return {110, 160, 255};
    default:
      return {255, 255, 255};
  }
}

bool in_landing(MissionState state) {
  return state == MissionState::rendezvous || state == MissionState::land ||
         state == MissionState::shut_down || state == MissionState::complete;
}

Panel side_view(const RunTracks& tracks, const Rig& rig) {
  Panel panel;
  panel.title = "From the side, seen from the platform (N)";
  // In the plane of pad and lens, from whichever side that looks.
  const Vector3 across = leds_face(rig);
  const bool ahead = across.isApprox(Vector3::UnitX());
  panel.x_label = ahead ? "x, m (forward)" : "m towards the lens";
  panel.y_label = "z, m above the pad";
  panel.equal_aspect = true;
  const double half = 0.5 * rig.pad.size_m;
  panel.series.push_back({.x = {-half, half, half, -half},
                          .y = {0, 0, -0.03, -0.03},
                          .label = "pad",
                          .color = palette::black,
                          .mark = Mark::filled});
  // The picture's upper and lower edge in the plane of symmetry.
  const Vector3 eye = rig.camera.X_NC.translation();
  for (const double v : {0.0, rig.camera.intrinsics.height - 1.0}) {
    const Vector3 ray = rig.camera.X_NC.linear() *
                        rig.camera.intrinsics.unproject({rig.camera.intrinsics.cx, v});
    const Vector3 end = eye + 10 * ray.normalized();  // cut off by the axes
    panel.series.push_back({.x = {across.dot(eye), across.dot(end)},
                            .y = {eye.z(), end.z()},
                            .label = v == 0 ? "edge of the picture" : "",
                            .color = palette::grey,
                            .mark = Mark::dashed,
                            .width_px = 1.5,
                            .in_range = false});
  }
  Series reference{
      .label = "reference", .color = palette::orange, .mark = Mark::dashed};
  Series estimate{.label = "estimate", .color = palette::sky};
  Series truth{.label = "truth", .color = palette::blue, .width_px = 2.5};
  for (std::size_t i = 0; i < tracks.t.size(); ++i) {
    truth.x.push_back(across.dot(tracks.X_NB_true[i].translation()));
    truth.y.push_back(tracks.X_NB_true[i].translation().z());
    const bool known = tracks.predicted_valid[i];
    estimate.x.push_back(known ? across.dot(tracks.X_NB_predicted[i].translation())
                               : kNaN);
    estimate.y.push_back(known ? tracks.X_NB_predicted[i].translation().z() : kNaN);
    const bool wanted = tracks.reference_valid[i];
    reference.x.push_back(wanted ? across.dot(tracks.reference[i].p_NB) : kNaN);
    reference.y.push_back(wanted ? tracks.reference[i].p_NB.z() : kNaN);
  }
  panel.series.push_back(estimate);
  panel.series.push_back(truth);
  panel.series.push_back(reference);
  panel.notes.push_back({across.dot(eye), eye.z(), "camera", palette::black});
  return panel;
}

Panel top_view(const RunTracks& tracks) {
  Panel panel;
  panel.title = "From above, seen from the ground (I)";
  panel.x_label = "x, m";
  panel.y_label = "y, m";
  panel.equal_aspect = true;
  Series platform{.label = "platform", .color = palette::black, .mark = Mark::dashed};
  Series drone{.label = "drone", .color = palette::blue};
  for (std::size_t i = 0; i < tracks.t.size(); ++i) {
    const Vector3 p = tracks.X_IN[i].translation();
    const Vector3 q = tracks.X_IN[i] * tracks.X_NB_true[i].translation();
    platform.x.push_back(p.x());
    platform.y.push_back(p.y());
    drone.x.push_back(q.x());
    drone.y.push_back(q.y());
  }
  panel.series = {platform, drone};
  if (!drone.x.empty()) {
    panel.notes.push_back({drone.x.back(), drone.y.back(), "landed", palette::black});
  }
  return panel;
}

Panel error_panel(const RunTracks& tracks) {
  Panel panel;
  panel.title = "Errors from rendezvous on";
  panel.x_label = "t, s";
  panel.y_label = "m";
  panel.y_from_zero = true;
  Series tracking{.label = "truth to reference", .color = palette::orange};
  Series estimate{.label = "truth to estimate", .color = palette::sky};
  for (std::size_t i = 0; i < tracks.t.size(); ++i) {
    if (!in_landing(tracks.state[i])) continue;
    const Vector3 p = tracks.X_NB_true[i].translation();
    tracking.x.push_back(tracks.t[i]);
    tracking.y.push_back(
        tracks.reference_valid[i] ? (p - tracks.reference[i].p_NB).norm() : kNaN);
    estimate.x.push_back(tracks.t[i]);
    estimate.y.push_back(tracks.predicted_valid[i]
                             ? (p - tracks.X_NB_predicted[i].translation()).norm()
                             : kNaN);
  }
  panel.series = {tracking, estimate};
  return panel;
}

}  // namespace

Image draw_detections(const ShownFrame& shown, const Rig& rig) {
  Image image = copy_of(shown.image.view(), Channels::color);
  // Read noise would make the file three times as large; frame.png has it.
  for (std::uint8_t& value : image.data) value &= 0xF0;
  double u0 = 1e9, v0 = 1e9, u1 = -1e9, v1 = -1e9;
  for (const LedUse& use : shown.report.leds) {
    const Vector2& uv = use.observation.uv;
    u0 = std::min(u0, uv.x());
    v0 = std::min(v0, uv.y());
    u1 = std::max(u1, uv.x());
    v1 = std::max(v1, uv.y());
  }
  Image zoom;
  if (u1 >= u0) {
    const int margin = 14;
    Roi part{static_cast<int>(u0) - margin, static_cast<int>(v0) - margin,
             static_cast<int>(u1) + margin, static_cast<int>(v1) + margin};
    part.u0 = std::clamp(part.u0, 0, image.width - 2);
    part.v0 = std::clamp(part.v0, 0, image.height - 2);
    part.u1 = std::clamp(part.u1, part.u0 + 1, image.width);
    part.v1 = std::clamp(part.v1, part.v0 + 1, image.height);
    const int factor = std::clamp(
        std::min(360 / (part.u1 - part.u0), 200 / (part.v1 - part.v0)), 1, 6);
    if (factor > 1) {
      zoom = enlarged(shown.image.view(), part, factor);
      for (const LedUse& use : shown.report.leds) {
        const double u = (use.observation.uv.x() - part.u0 + 0.5) * factor - 0.5;
        const double v = (use.observation.uv.y() - part.v0 + 0.5) * factor - 0.5;
        std::string label;
        LedColor color = LedColor::none;
        for (int i = 0; i < rig.leds.size(); ++i) {
          if (((use.observation.leds >> i) & 1) == 0) continue;
          label += (label.empty() ? "" : "+") + std::to_string(i);
          color = rig.leds.color(i);
        }
        draw_circle(zoom, u, v, 4.0 * factor, color_of(color));
        draw_text(zoom, u + 4.5 * factor, v + 4, label, color_of(color), 13);
      }
    }
  }
  for (const LedUse& use : shown.report.leds) {
    LedColor color = LedColor::none;
    for (int i = 0; i < rig.leds.size(); ++i) {
      if (((use.observation.leds >> i) & 1) != 0) color = rig.leds.color(i);
    }
    draw_circle(image, use.observation.uv.x(), use.observation.uv.y(), 6,
                color_of(color));
  }
  for (const RefusedBlob& blob : shown.report.refused) {
    draw_cross(image, blob.uv.x(), blob.uv.y(), 5, palette::amber);
  }
  if (!zoom.empty()) {
    // Where the LEDs are not.
    const int top = v0 > image.height / 2.0 ? 10 : image.height - zoom.height - 10;
    const int left = 10;
    for (int v = 0; v < zoom.height; ++v) {
      std::copy_n(zoom.row(v), zoom.width * 3, image.row(top + v) + left * 3);
    }
    const double l = left, t = top, r = left + zoom.width, b = top + zoom.height;
    draw_segment(image, l, t, r, t, palette::grey);
    draw_segment(image, l, b, r, b, palette::grey);
    draw_segment(image, l, t, l, b, palette::grey);
    draw_segment(image, r, t, r, b, palette::grey);
  }
  return image;
}

Result<std::vector<std::string>> save_run_pictures(const std::string& folder,
                                                   const RunTracks& tracks,
                                                   const ShownFrame& shown,
                                                   const Rig& rig) {
  std::vector<std::string> names;
  if (!shown.image.empty()) {
    names.emplace_back("detections.png");
    const Image image = draw_detections(shown, rig);
    if (auto good = save_png(folder + "/" + names.back(), image.view()); !good) {
      return fail(good.error());
    }
    names.emplace_back("frame.png");
    if (auto good = save_png(folder + "/" + names.back(), shown.image.view()); !good) {
      return fail(good.error());
    }
  }
  names.emplace_back("landing.png");
  FigureOptions options;
  options.columns = 1;
  if (auto good = save_figure(folder + "/" + names.back(),
                              {side_view(tracks, rig), top_view(tracks)}, options);
      !good) {
    return fail(good.error());
  }
  names.emplace_back("errors.png");
  if (auto good = save_figure(folder + "/" + names.back(), {error_panel(tracks)});
      !good) {
    return fail(good.error());
  }
  return names;
}

}  // namespace alight
