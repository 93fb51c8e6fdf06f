#include "alight/io/pose_log.h"

#include "alight/base/rng.h"
#include "alight/io/files.h"
#include "alight/io/text.h"
#include "scratch.h"

namespace alight {
namespace {

class PoseLogFiles : public Scratch {
 protected:
  std::string why(const std::string& text) {
    const auto log = load_pose_log(file("log", text));
    return log ? "" : log.error().detail.substr(path("log").size());
  }
};

TEST_F(PoseLogFiles, TumReadsBackToTheNanosecond) {
  Rng rng(2);
  PoseLog log;
  Time t = 1700000000123456789;
  for (int i = 0; i < 200; ++i) {
    const Vector3 w(rng.normal(), rng.normal(), rng.normal());
    log.emplace_back(t, make_pose(so3_exp(w), {rng.normal(), rng.normal(), 2}));
    t += static_cast<Time>(rng.uniform(1, 1e8));
  }
  ASSERT_TRUE(save_tum(path("a.tum"), log));
  const auto read = load_tum(path("a.tum"));
  ASSERT_TRUE(read) << read.error().detail;
  ASSERT_EQ(read->size(), log.size());
  for (std::size_t i = 0; i < log.size(); ++i) {
    EXPECT_EQ((*read)[i].first, log[i].first);
    EXPECT_TRUE((*read)[i].second.isApprox(log[i].second, 1e-8));
  }
}

TEST_F(PoseLogFiles, TumTakesCommentsNegativeTimesAndScaledQuaternions) {
  const auto log = load_tum(file("c.tum",
                                 "# t x\n\n-0.5 1 2 3 0 0 0 2  # here\r\n"
                                 "1e-1\t1 2 3 0 0 1 0\n"));
  ASSERT_TRUE(log) << log.error().detail;
  ASSERT_EQ(log->size(), 2u);
  EXPECT_EQ((*log)[0].first, -500000000);
  EXPECT_EQ((*log)[1].first, 100000000);
  EXPECT_TRUE((*log)[0].second.linear().isIdentity(1e-15));
}

TEST_F(PoseLogFiles, BadTumIsNamedByLine) {
  EXPECT_EQ(why("0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n"), ":2: time does not advance");
  EXPECT_EQ(why("0 0 0 0 0 0 0\n").substr(0, 17), ":1: found 7 field");
  EXPECT_EQ(why("0 0 nan 0 0 0 0 1\n"), ":1: 'nan' is not a finite number");
  EXPECT_EQ(why("0 0 0 0 0 0 0 0\n"), ":1: the quaternion is zero");
  EXPECT_EQ(why("0 0 0 0 0 0 0 1\n9999999999 0 0 0 0 0 0 1\n"),
            ":2: '9999999999' is not a time in seconds");
  EXPECT_EQ(why("0 0 1e200 0 0 0 0 1\n"), ":1: the position is more than 1e9 m away");
  EXPECT_EQ(why("0 0 0 0 1e200 0 0 1\n"),
            ":1: the quaternion is far from one of norm 1");
  EXPECT_EQ(why("# nothing\n"), ": holds no poses");
  EXPECT_EQ(why(""), ": holds no poses");
}

const std::string kHeader = "x.csv\nx,y,z,r,p,y,ori,ms,dpth,t,\n";

TEST_F(PoseLogFiles, AuthorsLogIsReadByPlace) {
  const auto log =
      load_pose_log(file("a.csv", kHeader + "1,2,3,0.1,0.2,0.3,0,0.0125,1,7.5,\n"));
  ASSERT_TRUE(log) << log.error().detail;
  ASSERT_EQ(log->poses.size(), 1u);
  EXPECT_TRUE(log->rows_match);
  EXPECT_EQ(log->poses[0].first, 7500000000);
  EXPECT_TRUE(log->poses[0].second.isApprox(
      make_pose(from_rpy(0.1, 0.2, 0.3), {1, 2, 3}), 1e-15));
  EXPECT_DOUBLE_EQ(log->frame_ms[0], 12.5);
}

TEST_F(PoseLogFiles, BadAuthorsLogIsNamedByLine) {
  EXPECT_EQ(why(kHeader + "1,2,3,\n").substr(0, 10), ":3: found ");
  EXPECT_EQ(why(kHeader + "1,2,3,4,5,6,7,8,x,1,\n"), ":3: 'x' is not a finite number");
  EXPECT_EQ(why(kHeader + "1,2,3,4,5,6,7,8,9,2,\n1,2,3,4,5,6,7,8,9,1,\n"),
            ":4: time runs backwards");
  EXPECT_EQ(why(kHeader + "1,2,3,4,5,6,7,8,9,1e300,\n"),
            ":3: '1e300' is not a time in seconds");
  EXPECT_EQ(why("x.csv\nx,y\n").substr(0, 12), ":2: expected");
  EXPECT_EQ(why(kHeader), ": holds no poses");
}

TEST_F(PoseLogFiles, WritingLeavesNoPartBehind) {
  ASSERT_TRUE(write_file(path("deep/er/f.txt"), "one"));
  ASSERT_TRUE(write_file(path("f.txt"), "one"));
  ASSERT_TRUE(write_file(path("f.txt"), "two"));
  EXPECT_EQ(*read_file(path("f.txt")), "two");
  EXPECT_EQ(entries(), 2);
  EXPECT_FALSE(write_file(path("deep"), "a folder stands here"));
  EXPECT_FALSE(write_file(path("f.txt/x"), "a file stands there"));
  EXPECT_EQ(entries(), 2);
  EXPECT_FALSE(read_file(path("deep")));
}

}  // namespace
}  // namespace alight
