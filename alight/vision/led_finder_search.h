#pragma once
#include <array>
#include <vector>

#include "alight/vision/blob_pose.h"
#include "alight/vision/led_finder.h"
#include "alight/vision/led_matcher.h"
#include "alight/vision/pad_mirror.h"
#include "alight/vision/shape_table.h"

namespace alight {

/// The state behind LedFinder: what is computed once, and room to work in.
struct LedFinder::Search {
  static constexpr int kNeighbours = 24;
  static constexpr std::size_t kKept = 24;
  static constexpr std::size_t kTried = 64;
  static constexpr std::size_t kTwins = 256;

  Search(const LedFinderConfig& config_in, const Camera& camera_in,
         const Constellation& leds_in, double pad_size_in);

  Result<FoundLeds> find_standard(BlobSpan blobs, Time t);
  Result<FoundLeds> find_paper(BlobSpan blobs, Time t);

  struct Candidate {
    double score = 0;
    Assignment assignment;
    Pose X_NB = Pose::Identity();
  };
  struct Settled {
    Candidate candidate;
    BlobFit fit;
  };

  // led_finder.cpp
  bool plausible(const Pose& X_NB) const;
  double tilt_sd() const { return config.tilt_sd_deg * kDegree; }
  /// sd in px of where an LED's image lies, for a drone at X_NB.
  double image_sd(const Pose& X_NB) const;

  // led_finder_search.cpp: from blobs to poses worth a closer look, in `kept`.
  /// The blobs, and after them the halves of those that look like two LEDs.
  void split_long(BlobSpan blobs);
  void prepare(BlobSpan blobs, bool white_is_any);
  void search_triples(BlobSpan blobs, bool white_is_any);
  /// `near`: blobs and parts that may tell a right pose, `whole`: blobs to be matched.
  void try_pose(BlobSpan blobs, const Pose& X_NB, std::span<const int> near,
                std::span<const int> whole, bool white_is_any);
  void keep(const Candidate& candidate);

  // led_finder_decide.cpp: from those to an answer.
  /// Refines and scores; false if it falls below what can be accepted.
  bool settle(BlobSpan blobs, bool white_is_any, double best_score, Settled& s);
  /// For each blob that the pad may show, the brighter ones whose image it may be.
  void find_twins(BlobSpan blobs);
  double score_of(const Candidate& candidate, BlobSpan blobs,
                  std::span<const BlobTerm> terms, const BlobFit& fit) const;
  /// -2 log likelihood of how unequally bright the LEDs then are.
  double brightness_cost(const Assignment& assignment, BlobSpan blobs) const;
  /// Whether both tell the same story: near each other, or one leaves out LEDs that the
  /// other sees and moves over to it once they are put in.
  bool same_answer(BlobSpan blobs, const Candidate& best, const Candidate& other) const;
  /// Expected number of answers as good from lights that have nothing to do with the
  /// drone, as its logarithm.
  double log_false_alarms(BlobSpan blobs, const Settled& best) const;
  /// Whether the blobs in use decide the pose to what a filter can start from.
  bool decided(const BlobFit& fit) const;
  void polish(FoundLeds& found) const;
  Result<FoundLeds> decide(BlobSpan blobs, bool white_is_any, Time t);

  LedFinderConfig config;
  Camera camera;
  Constellation leds;
  double pad_size_m;
  Vector3 centre_B;
  double radius_m;  // from centre_B to the farthest LED
  ShapeTable shapes;
  // Triples whose first, second, third LED a blob of a color may be.
  using TripleSet = std::vector<std::uint64_t>;
  std::array<std::array<TripleSet, 5>, 3> of_color;

  std::vector<Blob> split;
  int whole_blobs = 0;                       // of those in `split`; the rest are parts
  std::vector<int> usable;                   // blobs some LED may have made
  std::vector<std::vector<int>> neighbours;  // by index into `usable`
  std::vector<std::pair<double, int>> by_distance;
  std::vector<Vector2> pinhole;          // of blobs, distortion removed, px
  FixedVector<Candidate, kTried> rough;  // looked at already
  std::size_t rough_next = 0;
  FixedVector<Candidate, kKept> kept;
  FixedVector<Settled, kKept> settled;
  std::vector<std::pair<int, int>> twins;  // (blob, brighter blob it may mirror)
  GroupScratch scratch;
  double light_density = 0;  // of usable blobs in the picture, per px^2
  std::int64_t work = 0;
};

/// Rivals are poses that a filter started on one would not turn into the other.
bool rivals(const Pose& a, const Pose& b);

}  // namespace alight
