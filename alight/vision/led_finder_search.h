#pragma once
#include <array>
#include <vector>

#include "alight/vision/led_finder.h"
#include "alight/vision/led_matcher.h"
#include "alight/vision/shape_table.h"

namespace alight {

/// The state behind LedFinder: what is computed once, and room to work in.
struct LedFinder::Search {
  static constexpr int kNeighbours = 24;
  static constexpr std::size_t kKept = 48;

  Search(const LedFinderConfig& config_in, const Camera& camera_in,
         const Constellation& leds_in);

  Result<FoundLeds> find_standard(BlobSpan blobs, Time t);
  Result<FoundLeds> find_paper(BlobSpan blobs, Time t);

  struct Candidate {
    double score = 0;
    Assignment assignment;
    Pose X_NB = Pose::Identity();
  };

  struct Settled {
    Candidate candidate;
    PoseFit fit;
  };

  bool plausible(const Pose& X_NB) const;
  /// The blobs, and after them the halves of those that look like two LEDs.
  void split_long(BlobSpan blobs);
  void prepare(BlobSpan blobs, bool white_is_any);
  void search_triples(BlobSpan blobs, bool white_is_any);
  void try_pose(BlobSpan blobs, const Pose& X_NB, const std::vector<int>& near,
                bool white_is_any);
  void keep(const Candidate& candidate);
  double sigma2(const Pose& X_NB) const;
  /// Charged for blobs that look like two LEDs and are given one.
  double unexplained_cost(BlobSpan blobs, const Assignment& assignment) const;
  /// Refines and scores; false if it falls below what can be accepted.
  bool settle(BlobSpan blobs, bool white_is_any, Candidate& candidate,
              PoseFit& fit) const;
  /// Whether both tell the same story: near each other, or one leaves out LEDs that the
  /// other sees and moves over to it once they are put in.
  bool same_answer(BlobSpan blobs, const Candidate& best, const Candidate& other) const;
  Result<FoundLeds> decide(BlobSpan blobs, bool white_is_any, Time t);

  LedFinderConfig config;
  Camera camera;
  Constellation leds;
  Vector3 centre_B;
  double radius_m;  // from centre_B to the farthest LED
  ShapeTable shapes;

  std::vector<Blob> split;
  std::vector<int> usable;                   // blobs some LED may have made
  std::vector<std::vector<int>> neighbours;  // by index into `usable`
  std::vector<std::pair<double, int>> by_distance;
  std::vector<Vector2> pinhole;  // of blobs, distortion removed, px
  FixedVector<Candidate, kKept> kept;
  FixedVector<Settled, kKept> settled;
  std::int64_t tried = 0;
};

}  // namespace alight
