#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/image.h"
#include "alight/geometry/pose.h"
#include "alight/geometry/rig.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/picture_buffer.h"
#include "alight/sim/scene_at.h"

namespace alight {

struct PictureTrouble;
struct RoomLight;

/// A platform camera that sees LEDs, ceiling lights and mirror images in the pad as a
/// real sensor does: point spread, motion blur, saturation with coloured halo, shot and
/// read noise, JPEG; and a stereo depth picture aligned with it.
///
/// The pixels depend on the seed, the frame index and the scene alone, never on what
/// was rendered before.
class CameraRenderer {
 public:
  /// @param true_rig Lens, mount and LEDs as they are, not as the rig file says.
  /// @returns invalid_config, naming the field.
  static Result<CameraRenderer> create(const CameraSimConfig& config,
                                       const Rig& true_rig, std::uint64_t seed);
  ~CameraRenderer();
  CameraRenderer(CameraRenderer&&) noexcept;
  CameraRenderer& operator=(CameraRenderer&&) noexcept;

  /// One light more in the room, beside those that the configuration asks for.
  void add_light(const RoomLight& light);

  /// Renders one frame; buffers that this renderer drew into before cost least.
  ///
  /// @param exposure    Instants at an even pace from the begin to the end of the
  ///                    exposure, of a rolling shutter's first row to its last
  ///                    (span_of), at least 1, at most 8; 2 blur along a straight line.
  /// @param depth       May be null.
  /// @param depth_scene When depth is captured; null: with the middle of the colour.
  /// @param trouble     What is wrong with the picture (camera_faults.h); null:
  /// nothing.
  /// @returns invalid_input when a pose is not finite or the number of instants is off;
  ///          the buffers are then untouched.
  Result<void> render(std::uint64_t frame_index, std::span<const SceneAt> exposure,
                      ColorBuffer& color, DepthBuffer* depth = nullptr,
                      const SceneAt* depth_scene = nullptr,
                      const PictureTrouble* trouble = nullptr);

 private:
  struct Parts;
  explicit CameraRenderer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace alight
