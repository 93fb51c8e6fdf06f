#pragma once
#include <cstdint>
#include <vector>

#include "alight/geometry/image.h"
#include "alight/geometry/stored_light.h"
#include "alight/vision/picture_noise.h"

namespace alight {

/// Pictures of a camera that stores light by a power of it, value = 255 (light / 255) ^
/// (1 / gamma), as nearly all do whose pictures are made for people to look at
/// (IEC 61966-2-1: about 2.2), made what one would have stored that stores light
/// itself: there what lights give adds up, and a light is as wide as the lens makes it.
///
/// No allocation after construction.
class LinearPicture {
 public:
  /// @pre a gamma as Rig's
  LinearPicture(int width, int height, double gamma);

  double gamma() const { return gamma_; }
  void set_gamma(double gamma);

  /// The picture itself where gamma is 1. Else valid until the next call; black outside
  /// `box`, which is cut to the picture. @pre of the size told at the construction
  ImageView of(const ImageView& picture, const Roi& box);
  ImageView of(const ImageView& picture);  ///< All of it.

  /// What noise of the stored values is in pictures of light.
  PictureNoise of(const PictureNoise& noise) const;

 private:
  int width_, height_;
  double gamma_ = 1;
  GreyTable light_{};  // of a stored value
  std::vector<std::uint8_t> pixels_;
  Roi written_;  // all but this is black
};

}  // namespace alight
