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
  static constexpr std::size_t kGuesses = 64;
  static constexpr std::size_t kChallengers = 16;

  Search(const LedFinderConfig& config_in, const Camera& camera_in,
         const Constellation& leds_in, double pad_size_in);

  Result<FoundLeds> find_standard(BlobSpan blobs, Time t, Look look);
  Result<FoundLeds> find_paper(BlobSpan blobs, Time t);

  /// A triple of LEDs as the search needs it: the others' places and B's z axis, in the
  /// triple's sides a, b and a x b.
  struct Corners {
    double aa, bb, ab, det;
    Vector3 up;
    std::array<Vector3, kMaxLeds> place;
    /// Every LED, the triple's own last: theirs are explained whatever the guess.
    std::array<std::uint8_t, kMaxLeds> order;
  };
  /// Three blobs taken for three LEDs, and where the other LEDs then are.
  struct Guess {
    double cost = 0;  // LEDs not explained
    int lights = 0;   // that explain the others
    int triple = 0;
    std::array<int, 3> corner{};
    bool flipped = false;  // The other of the two poses that three points leave.
    Vector3 up_C = Vector3::Zero();
    std::array<std::int16_t, kMaxLeds> blob{};
  };
  /// The blobs around one of them, seen from the lens along the ray to it.
  struct Around {
    static constexpr std::size_t kRoom = 28;  // what stands past `count` is far away
    using Row = std::array<float, kRoom>;
    std::array<int, kRoom> blob;
    Row x, y;                                // tangents off that ray
    std::array<Row, 5> wrong;                // by the LED's color: 0 or far
    std::array<std::uint32_t, kRoom> light;  // a bit, the same for parts of one blob
    std::size_t count = 0;
    Vector3 up_V = Vector3::Zero();  // of N
    Matrix3 R_CV = Matrix3::Identity();

    /// Which of them is nearest to a place that an LED of that color may have made, and
    /// the square of its distance.
    std::pair<std::size_t, double> nearest(float at_x, float at_y,
                                           std::size_t color) const;
  };
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
  /// Seen from the lens the pad lies before it.
  bool behind_pad(const Vector3& p_N) const;
  double tilt_sd() const { return config.tilt_sd_deg * kDegree; }
  /// sd in px of where an LED's image lies, for a drone at X_NB.
  double image_sd(const Pose& X_NB) const;

  // led_finder_search.cpp: from blobs to poses worth a closer look, in `kept`.
  /// The blobs, and after them the halves of those that look like two LEDs.
  void split_long(BlobSpan blobs);
  void prepare(BlobSpan blobs, bool white_is_any);
  /// Three blobs for three LEDs, by scaled orthographic projection; the best in
  /// `guesses`.
  /// By the triples from `first` up to `last`.
  void search_triples(BlobSpan blobs, bool white_is_any, std::size_t first,
                      std::size_t last);
  /// The same; kWords of a set of triples, 0: as many as there are.
  template <std::size_t kWords>
  void search_triples_in(BlobSpan blobs, bool white_is_any, std::size_t first,
                         std::size_t last);
  void look_around(BlobSpan blobs, std::size_t n, bool white_is_any);
  void guess(std::size_t triple, std::size_t j, std::size_t k);
  void guess_wide(std::size_t triple, std::size_t j, std::size_t k);
  void guess_by(std::size_t triple, std::size_t j, std::size_t k);
  void keep_guess(const Guess& guess);
  void narrow(const Guess& guess);
  bool looked_at(int blob) const;
  /// The more LEDs there are, the more a guess costs and a search finds.
  std::int64_t work_most() const;
  /// From guesses to candidates, in `kept`.
  void try_guesses(BlobSpan blobs, bool white_is_any);
  void prepare_corners();
  void try_pose(BlobSpan blobs, const Pose& X_NB, bool white_is_any);
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
  /// Settles what the search may not have met: the answer's mirror image, and one or
  /// two of its blobs taken for other LEDs near by.
  void challenge(BlobSpan blobs, bool white_is_any, const Settled& best);
  /// Expected number of answers as good from lights that have nothing to do with the
  /// drone, as its logarithm.
  double log_false_alarms(BlobSpan blobs, const Settled& best) const;
  bool fits(const Settled& s) const;
  /// Lights that have nothing to do with the drone may look so.
  bool by_chance(BlobSpan blobs, const Settled& s) const;
  /// Whether the blobs in use decide the pose to what a filter can start from.
  bool decided(const BlobFit& fit) const;
  /// Remembers what cannot be told apart.
  void leave_open(BlobSpan blobs, const Settled& best);
  /// The answer once more, as exact as its own residuals say that LEDs and centroids
  /// are, without a blob that is off by more.
  void polish(BlobSpan blobs, Settled& best) const;
  /// How much the answer's likelihood exceeds the other's, as -2 log, when how exact
  /// the rig is must be told from the residuals.
  double lead(const Settled& best, const Settled& other) const;
  /// Whether what has been settled holds a drone of other lights, as complete as the
  /// answer and no more by chance.
  bool holds_another(BlobSpan blobs, const Settled& best) const;
  Result<FoundLeds> decide(BlobSpan blobs, bool white_is_any, Time t);

  LedFinderConfig config;
  Camera camera;
  Constellation leds;
  double pad_size_m;
  Vector3 centre_B;
  double radius_m;  // from centre_B to the farthest LED
  ShapeTable shapes;
  std::vector<Corners> corners;  // of shapes.triples()
  // Triples whose first, second, third LED a blob of a color may be.
  using TripleSet = std::vector<std::uint64_t>;
  std::array<std::array<TripleSet, 5>, 3> of_color;

  std::vector<Blob> split;
  std::size_t whole_blobs = 0;               // of those in `split`; the rest are parts
  std::vector<int> whole;                    // which blob each of `split` is of
  std::vector<int> usable;                   // blobs some LED may have made
  std::vector<int> seeds;                    // and after them the parts
  std::vector<std::vector<int>> neighbours;  // by index into `seeds`
  std::vector<std::pair<double, int>> by_distance;
  std::vector<Vector2> pinhole;  // of blobs, distortion removed, px
  Around around;
  FixedVector<Guess, kGuesses> guesses;
  FixedVector<Candidate, kTried> rough;  // looked at already
  std::size_t rough_next = 0;
  FixedVector<Candidate, kKept> kept;
  FixedVector<Settled, kKept> settled;
  FixedVector<Settled, kChallengers> challengers;
  FixedVector<LedRival, 8> open;
  std::vector<std::pair<int, int>> twins;  // (blob, brighter blob it may mirror)
  GroupScratch scratch;
  double guess_worst = 0;  // cost in `guesses`, when full
  // Where a guess explains nearly all of many LEDs: nothing else is looked at. px,
  // distortion removed; a radius of 0: everything.
  Vector2 narrowed_px = Vector2::Zero();
  double narrowed_radius_px = 0;
  // Of the picture before, when the work ran out: without and with white as any colour.
  std::array<std::size_t, 2> next_seed{};
  double cos_tilt_most;      // of a guess
  int most_blobs = 0;        // of what decide() thought best
  double light_density = 0;  // of usable blobs in the picture, per px^2
  std::int64_t work = 0;
};

/// Rivals are poses that a filter started on one would not turn into the other.
bool rivals(const Pose& a, const Pose& b);

}  // namespace alight
