#include <cmath>

#include "alight/base/rng.h"
#include "alight/io/files.h"
#include "alight/io/rig_yaml.h"
#include "alight/io/yaml_reader.h"
#include "scratch.h"

namespace alight {
namespace {

/// The complaint about `text` read as a small file of settings; "" when there is none.
std::string complaint(const std::string& text) {
  auto file = YamlMap::parse(text, "f.yaml");
  if (!file) return file.error().detail;
  double number = 1;
  int whole = 1;
  bool flag = false;
  Vector3 vector = Vector3::Zero();
  enum class Kind { still, circle } kind = Kind::still;
  file->read("number", number);
  file->read("whole", whole);
  file->read("flag", flag);
  file->read("vector", vector);
  file->read_choice("kind", kind, {{"still", Kind::still}, {"circle", Kind::circle}});
  YamlMap inner = file->map("inner");
  inner.read("speed_m_s", number);
  for (YamlMap& item : file->list("items")) {
    item.require("at_s");
    item.read("at_s", number);
  }
  const auto good = file->finish();
  return good ? "" : good.error().detail;
}

TEST(YamlMap, NamesFileLineKeyAndRemedy) {
  const std::pair<const char*, const char*> cases[] = {
      {"number: 1\nnumbr: 2\n", "f.yaml:2: numbr: unknown key, did you mean number?"},
      {"inner:\n  speed: 2\n",
       "f.yaml:2: inner.speed: unknown key, did you mean speed_m_s?"},
      {"wallpaper: 2\n", "f.yaml:1: wallpaper: unknown key"},
      {"number: .nan\n", "f.yaml:1: number: must be a finite number, found '.nan'"},
      {"number: [1]\n", "f.yaml:1: number: must be a finite number, found a list"},
      {"number:\n", "f.yaml:1: number: must be a finite number, found nothing"},
      {"whole: 1.5\n", "f.yaml:1: whole: must be a whole number, found '1.5'"},
      {"flag: yes\n", "f.yaml:1: flag: must be true or false, found 'yes'"},
      {"\n\nvector: [1, 2]\n",
       "f.yaml:3: vector: must be a list of 3 numbers, found 2"},
      {"vector: [1, 2, x]\n", "f.yaml:1: vector: must hold finite numbers, found 'x'"},
      {"kind: circel\n",
       "f.yaml:1: kind: must be one of still, circle; found 'circel', did you mean "
       "circle?"},
      {"inner: 3\n", "f.yaml:1: inner: must be a map of keys and values, found '3'"},
      {"items:\n  - {at_s: 1}\n  - {}\n", "f.yaml:3: items[1].at_s: is missing"},
      {"items: 3\n", "f.yaml:1: items: must be a list, found '3'"},
      {"number: 1\nnumber: 2\n", "f.yaml:2: number: is there twice"},
      {"number: x\nwhole: x\n",
       "f.yaml:1: number: must be a finite number, found 'x' (and 1 more)"},
      {"- 1\n", "f.yaml:1: is not a map of keys and values"},
  };
  for (const auto& [text, expected] : cases) {
    EXPECT_EQ(complaint(text), expected);
  }
  EXPECT_EQ(complaint("a: [1\nb: }").substr(0, 7), "f.yaml:");
}

TEST(YamlMap, TakesWhatIsRight) {
  EXPECT_EQ(complaint(""), "");
  EXPECT_EQ(complaint("number: 1e-3\nwhole: -4\nflag: true\nvector: [1, 2, 3]\n"
                      "kind: circle\ninner: {speed_m_s: 2}\nitems: [{at_s: 3}]\n"),
            "");
}

bool same(const Rig& a, const Rig& b) {
  const std::string text = rig_text(a);
  return text == rig_text(b);
}

TEST(RigYaml, TheAuthorsRigIsTheFile) {
  const auto rig = load_rig(ALIGHT_SOURCE_DIR "/config/rigs/alan.yaml");
  ASSERT_TRUE(rig) << rig.error().detail;
  EXPECT_TRUE(rig->camera.X_NC.isApprox(alan_rig().camera.X_NC, 1e-15));
  EXPECT_TRUE(same(*rig, alan_rig())) << rig_text(*rig) << rig_text(alan_rig());
}

class RigYamlFiles : public Scratch {
 protected:
  std::string why(const std::string& text) {
    const auto rig = load_rig(file("rig.yaml", text));
    return rig ? "" : rig.error().detail.substr(path("").size());
  }
};

TEST_F(RigYamlFiles, AnyRigReadsBack) {
  Rng rng(1);
  for (int i = 0; i < 50; ++i) {
    Rig rig = alan_rig();
    const Vector3 turn(rng.normal(), rng.normal(), rng.normal());
    rig.camera.X_NC = make_pose(so3_exp(turn), {rng.normal(), rng.normal(), 0.1});
    for (Led& led : rig.leds.leds) led.p_BL *= rng.uniform(0.5, 2);
    rig.mosaic = static_cast<Mosaic>(i % 5);
    rig.gamma = i % 2 ? rng.uniform(Rig::kGammaLeast, Rig::kGammaMost) : 0;
    if (i % 3 > 0) {
      rig.led_frame = {rng.uniform(0, 0.003) * Vector3(1, 2, 3),
                       rng.uniform(0, 0.05) * Vector3(3, 1, 2), 0.01 * (i % 3 - 1)};
    }
    rig.leds.leds[2].color = i % 2 ? LedColor::blue : LedColor::none;
    rig.camera.intrinsics.distortion = {rng.uniform(-0.15, 0.15), 0.1, 1e-7, -0.003, 0};
    rig.drone.mass_kg = rng.uniform(0.1, 3);
    rig.drone.inertia_kg_m2 = Vector3(1, 2, 3) * rng.uniform(0.001, 0.1);
    rig.pad.size_m = rng.uniform(0.2, 3);
    if (i % 3 == 0) rig.pad.obstacles = {{{-1, 0, 0}, {-0.5, rng.uniform(0.1, 1), 1}}};
    rig.limits.speed_m_s = rng.uniform(1, 9);
    ASSERT_TRUE(save_rig(path("r.yaml"), rig));
    const auto read = load_rig(path("r.yaml"));
    ASSERT_TRUE(read) << read.error().detail;
    EXPECT_TRUE(read->camera.X_NC.isApprox(rig.camera.X_NC, 1e-10));
    Rig other = *read;
    other.camera.X_NC = rig.camera.X_NC;
    EXPECT_TRUE(same(other, rig));
  }
}

// Else a record of a record, flown again, is another flight.
TEST_F(RigYamlFiles, WhatWasWrittenIsWrittenAgainAsItWas) {
  Rng rng(5);
  for (int k = 0; k < 200; ++k) {
    Rig rig = alan_rig();
    const Vector3 place(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0, 1));
    rig.camera.X_NC = optical_from_housing(make_pose(
        from_rpy(rng.uniform(-0.2, 0.2), rng.uniform(-1, 1), rng.uniform(-3.1, 3.1)),
        place));
    const std::string text = rig_text(rig);
    const auto again = load_rig(file("rig.yaml", text));
    ASSERT_TRUE(again) << again.error().detail;
    EXPECT_EQ(rig_text(*again), text);
  }
}

TEST_F(RigYamlFiles, BadOnesAreNamed) {
  EXPECT_EQ(load_rig(path("none.yaml")).error().detail,
            path("none.yaml") + ": no such file");
  std::string text = *read_file(ALIGHT_SOURCE_DIR "/config/rigs/alan.yaml");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = text;
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return why(changed.replace(at, from.size(), to));
  };
  EXPECT_EQ(with("mass_kg: 0.55", "mass_kg: 0.55"), "");
  EXPECT_EQ(with("rate_hz: 60", "rate_hz: 60, mosaic: grbg"), "");
  EXPECT_NE(with("rate_hz: 60", "rate_hz: 60, mosaic: rgb").find("mosaic"),
            std::string::npos);
  EXPECT_EQ(with("rate_hz: 60", "rate_hz: 60, gamma: 2.2"), "");
  EXPECT_NE(with("rate_hz: 60", "rate_hz: 60, gamma: 22").find("camera.gamma is 22"),
            std::string::npos);
  EXPECT_NE(with("mass_kg", "mas_kg").find("did you mean mass_kg?"), std::string::npos);
  EXPECT_NE(with("fx: 415.872", "fx: .nan").find("camera.fx"), std::string::npos);
  EXPECT_NE(with("fx: 415.872, ", "").find("camera.fx"), std::string::npos);
  EXPECT_NE(with("mass_kg: 0.55", "mass_kg: -1").find("drone.mass_kg is -1"),
            std::string::npos);
  EXPECT_NE(with("color: green", "color: gren").find("did you mean green?"),
            std::string::npos);
  EXPECT_NE(with("[0, 0, 0, 0, 0]", "[0, 0, 0, 0]").find("5 numbers"),
            std::string::npos);
  EXPECT_NE(with("leds:", "lamps:").find("leds"), std::string::npos);
  EXPECT_NE(with("mount:", "mounts:").find("mount"), std::string::npos);
}

TEST_F(RigYamlFiles, SafetyReadsBackAndBadOnesAreNamed) {
  const std::string text = *read_file(ALIGHT_SOURCE_DIR "/config/rigs/alan.yaml");
  const Rig rig = alan_rig();
  ASSERT_EQ(why(text), "");
  const auto none = load_safety(path("rig.yaml"), rig);
  ASSERT_TRUE(none) << none.error().detail;
  EXPECT_EQ(safety_text(*none), safety_text(Safety{}));

  Safety told;
  told.battery_low = 0.25;
  told.battery_empty = 0.125;
  told.when_battery_low = WhenBatteryLow::leave;
  told.landings_max = 3;
  told.when_failed = WhenFailed::leave;
  told.leave_at_m = Vector3(-1.5, 0.25, 0.75);
  ASSERT_TRUE(save_rig(path("rig.yaml"), rig, told));
  ASSERT_TRUE(load_rig(path("rig.yaml")));
  const auto again = load_safety(path("rig.yaml"), rig);
  ASSERT_TRUE(again) << again.error().detail;
  EXPECT_EQ(again->battery_low, told.battery_low);
  EXPECT_EQ(again->battery_empty, told.battery_empty);
  EXPECT_EQ(again->when_battery_low, told.when_battery_low);
  EXPECT_EQ(again->landings_max, told.landings_max);
  EXPECT_EQ(again->when_failed, told.when_failed);
  EXPECT_EQ(again->leave_at_m, told.leave_at_m);

  EXPECT_NE(why(text + "safety: {batery_low: 0.2}\n").find("did you mean battery_low?"),
            std::string::npos);
  EXPECT_NE(why(text + "safety: {when_failed: leaves}\n").find("did you mean leave?"),
            std::string::npos);
  // Whoever reads the rig is told of it, and whoever reads what is safe.
  const std::string wrong = "rig.yaml: safety.battery_low is 2, must lie in [0, 1]";
  EXPECT_EQ(why(text + "safety: {battery_low: 2}\n"), wrong);
  const auto bad = load_safety(path("rig.yaml"), rig);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().detail.find(wrong), std::string::npos);
}

TEST_F(RigYamlFiles, ATagReadsBackAndBadOnesAreNamed) {
  const std::string text = *read_file(ALIGHT_SOURCE_DIR "/config/rigs/alan.yaml");
  EXPECT_FALSE(load_rig(ALIGHT_SOURCE_DIR "/config/rigs/alan.yaml")->tag);
  const std::string good =
      "tag: {family: tag36h11, id: 586, size_m: 0.07, xyz_m: [0.06, 0, 0.03], "
      "rpy_deg: [110, 0, 90]}\n";
  EXPECT_EQ(why(text + good), "");
  const auto rig = load_rig(path("rig.yaml"));
  ASSERT_TRUE(rig && rig->tag);
  // It looks forward and a little down; seen from there, y of B is to the right.
  EXPECT_TRUE(rig->tag->X_BT.linear().col(0).isApprox(Vector3::UnitY(), 1e-12));
  EXPECT_GT(rig->tag->X_BT.linear()(0, 2), 0.9);
  EXPECT_LT(rig->tag->X_BT.linear()(2, 2), -0.3);
  ASSERT_TRUE(save_rig(path("again.yaml"), *rig));
  const auto again = load_rig(path("again.yaml"));
  ASSERT_TRUE(again && again->tag) << again.error().detail;
  EXPECT_EQ(again->tag->family, TagFamily::tag36h11);
  EXPECT_EQ(again->tag->id, 586);
  EXPECT_EQ(again->tag->size_m, 0.07);
  EXPECT_TRUE(again->tag->X_BT.isApprox(rig->tag->X_BT, 1e-12));

  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = good;
    return why(text + changed.replace(changed.find(from), from.size(), to));
  };
  EXPECT_NE(with("586", "587").find("tag.id is 587"), std::string::npos);
  EXPECT_NE(with("tag36h11", "DICT_4X4_50").find("tag.id is 586"), std::string::npos);
  EXPECT_NE(with("tag36h11", "tag36h10").find("did you mean tag36h11?"),
            std::string::npos);
  EXPECT_NE(with("size_m: 0.07", "size_m: 0").find("tag.size_m"), std::string::npos);
  EXPECT_NE(with("size_m: 0.07, ", "").find("size_m"), std::string::npos);
}

TEST_F(RigYamlFiles, LayoutFilesAreRead) {
  const std::string layout =
      "marker_positions:\n  - {x: 0.1, y: 0, z: 0}\n  - {x: 0, y: 0.1, z: 0}\n"
      "  - {x: 0, y: 0, z: 0.1}\n  - {x: 0.1, y: 0.1, z: 0}\n";
  const auto rig = load_rig(file("layout.yaml", layout));
  ASSERT_TRUE(rig) << rig.error().detail;
  EXPECT_EQ(rig->leds.size(), 4);
  EXPECT_EQ(rig->leds.p_BL(1), Vector3(0, 0.1, 0));
  EXPECT_EQ(rig->leds.color(1), LedColor::none);
  EXPECT_NE(why(layout + "leds: []\n").find("keep one"), std::string::npos);
  EXPECT_NE(why("marker_positions:\n  - {x: 1, y: 2}\n").find("z"), std::string::npos);
  std::string many = "marker_positions:\n";
  for (int i = 0; i <= kMaxLeds; ++i) {
    many += "  - {x: 0." + std::to_string(i + 10) + ", y: 0, z: 0}\n";
  }
  EXPECT_NE(why(many).find("more than 16"), std::string::npos);
}

}  // namespace
}  // namespace alight
