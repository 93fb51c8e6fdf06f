#include "alight/io/text.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

const std::vector<std::string> kKeys{"speed_m_s", "radius_m", "kind", "side_m",
                                     "latency_ms"};

TEST(NearestKey, FindsSlipsOfTheKeyboard) {
  EXPECT_EQ(nearest_key("speed_ms", kKeys), "speed_m_s");
  EXPECT_EQ(nearest_key("speed", kKeys), "speed_m_s");
  EXPECT_EQ(nearest_key("raduis_m", kKeys), "radius_m");
  EXPECT_EQ(nearest_key("kin", kKeys), "kind");
  EXPECT_EQ(nearest_key("latency_s", kKeys), "latency_ms");
}

TEST(NearestKey, IsSilentWhenNothingIsNear) {
  EXPECT_EQ(nearest_key("wallpaper", kKeys), "");
  EXPECT_EQ(nearest_key("ab", {"cd"}), "");
  EXPECT_EQ(nearest_key("x", {}), "");
}

TEST(Numbers, ReadBackToTheBit) {
  Rng rng(5);
  for (int i = 0; i < 2000; ++i) {
    const double value = rng.normal() * std::pow(10, rng.uniform(-20, 20));
    double read = 0;
    ASSERT_TRUE(parse_number(number_text(value), read));
    EXPECT_EQ(read, value);
  }
  EXPECT_EQ(number_text(415.872), "415.872");
  EXPECT_EQ(number_text(60), "60");
}

TEST(Numbers, RefuseWhatIsNone) {
  double value = 7;
  for (const char* text :
       {"", "1.2x", "nan", ".nan", "inf", "-", "+", "1 2", "0x10", "1e999", "+-1"}) {
    EXPECT_FALSE(parse_number(text, value)) << text;
  }
  EXPECT_EQ(value, 7);
  EXPECT_TRUE(parse_number("+1e-3", value));
  EXPECT_EQ(value, 1e-3);
}

TEST(Times, ReadBackToTheNanosecond) {
  Rng rng(6);
  for (int i = 0; i < 2000; ++i) {
    const auto t =
        static_cast<Time>(rng.uniform() * std::pow(10, rng.uniform(0, 18.6)));
    const std::string digits = std::to_string(1'000'000'000 + t % 1'000'000'000);
    const std::string text = std::to_string(t / 1'000'000'000) + "." + digits.substr(1);
    Time read = 0;
    ASSERT_TRUE(parse_time(text, read)) << text;
    EXPECT_EQ(read, t) << text;
  }
}

TEST(Times, RoundTakeSignsAndExponentsAndRefuseTheRest) {
  Time t = 7;
  for (const char* text : {"", "x", "1.2.3", "nan", "4000000001", "9999999999",
                           "9223372036854775807", "-4.1e9", "1e300", "-1e300"}) {
    EXPECT_FALSE(parse_time(text, t)) << text;
  }
  EXPECT_EQ(t, 7);
  EXPECT_TRUE(parse_time("4000000000", t));
  EXPECT_EQ(t, 4'000'000'000'000'000'000);
  EXPECT_TRUE(parse_time("0.9999999996", t));
  EXPECT_EQ(t, 1'000'000'000);
  EXPECT_TRUE(parse_time("-1.5e-3", t));
  EXPECT_EQ(t, -1'500'000);
  EXPECT_TRUE(parse_time("000000000001.5", t));
  EXPECT_EQ(t, 1'500'000'000);
}

TEST(Split, KeepsEmptyFields) {
  EXPECT_EQ(split("a,b,", ',').size(), 3u);
  EXPECT_EQ(split("", ',').size(), 1u);
  EXPECT_EQ(trimmed(" \ta b\r\n"), "a b");
  EXPECT_EQ(trimmed("  "), "");
}

}  // namespace
}  // namespace alight
