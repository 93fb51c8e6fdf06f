#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <vector>

#include "alight/geometry/rig.h"
#include "alight/io/files.h"
#include "alight/io/image_io.h"
#include "alight/io/rig_yaml.h"
#include "alight/io/text.h"
#include "alight/run/scenario_yaml.h"
#include "apps/program.h"

namespace alight {
namespace {

namespace fs = std::filesystem;

struct Ran {
  int status = -1;
  std::string out, err;
};

/// Words between blanks; 'one word' between quotes.
std::vector<std::string> words_of(const std::string& line) {
  std::vector<std::string> words;
  bool inside = false, quotes = false;
  for (const char c : line) {
    if (c == '\'') quotes = !quotes;
    if (c == ' ' && !quotes) {
      inside = false;
      continue;
    }
    if (!inside) words.emplace_back();
    inside = true;
    if (c != '\'') words.back() += c;
  }
  return words;
}

/// The program from outside, in a process of its own: whatever is wrong, it says so in
/// one line and leaves nothing behind.
class BadInput : public testing::Test {
 protected:
  BadInput()
      : folder_(fs::temp_directory_path() /
                ("alight_bad_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
    good_rig_ = file("good_rig.yaml", rig_text(alan_rig()));
    EXPECT_TRUE(save_png(at("good.png"), Image(848, 480, 3, 4).view()));
    good_tum_ = file("good.tum", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 1 1 0 0 0 0 1\n");
  }
  ~BadInput() override { fs::remove_all(folder_); }

  std::string at(const std::string& name) const { return (folder_ / name).string(); }
  std::string file(const std::string& name, const std::string& text) const {
    EXPECT_TRUE(write_file(at(name), text));
    return at(name);
  }

  /// Forked, not started: the loader needs longer for the libraries than the program
  /// to refuse.
  Ran run(const std::string& arguments) const {
    std::vector<std::string> words = words_of("alight " + arguments);
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    std::cout.flush();
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child == 0) {
      const int flags = O_WRONLY | O_CREAT | O_TRUNC;
      dup2(open(at("stdout").c_str(), flags, 0600), STDOUT_FILENO);
      dup2(open(at("stderr").c_str(), flags, 0600), STDERR_FILENO);
      const int status = run_program(static_cast<int>(words.size()), argv.data());
      std::cout.flush();
      std::fflush(nullptr);
      _exit(status);
    }
    Ran ran;
    int code = 0;
    waitpid(child, &code, 0);
    if (WIFEXITED(code)) ran.status = WEXITSTATUS(code);
    ran.out = read_file(at("stdout")).value_or("?");
    ran.err = read_file(at("stderr")).value_or("?");
    return ran;
  }

  /// Exit `status`, one line on standard error with each of `words`, nothing else
  /// anywhere; every other call with --json.
  void expect_refused(const std::string& arguments, int status,
                      const std::vector<std::string>& words) const {
    const std::string more = next_variant();
    const std::string out = at("out");
    const Ran ran = run(arguments + more + " --out '" + out + "'");
    check(arguments + more, ran, status, words);
    EXPECT_FALSE(fs::exists(out)) << arguments << " left a folder behind";
  }
  /// For commands without --out.
  void expect_refused_bare(const std::string& arguments, int status,
                           const std::vector<std::string>& words) const {
    const std::string more = next_variant();
    check(arguments + more, run(arguments + more), status, words);
  }
  static void check(const std::string& arguments, const Ran& ran, int status,
                    const std::vector<std::string>& words) {
    EXPECT_EQ(ran.status, status) << arguments << "\n" << ran.err;
    EXPECT_EQ(ran.out, "") << arguments;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << arguments << "\n"
                                                                   << ran.err;
    EXPECT_EQ(ran.err.rfind("alight ", 0), 0u) << arguments << "\n" << ran.err;
    for (const std::string& word : words) {
      EXPECT_NE(ran.err.find(word), std::string::npos)
          << arguments << ": no '" << word << "' in: " << ran.err;
    }
  }

  std::string rig_with(const std::string& from, const std::string& to) const {
    std::string text = rig_text(alan_rig());
    const std::size_t place = text.find(from);
    EXPECT_NE(place, std::string::npos) << from;
    if (place != std::string::npos) text.replace(place, from.size(), to);
    return file("rig.yaml", text);
  }

  std::string next_variant() const { return calls_++ % 2 == 0 ? "" : " --json"; }

  fs::path folder_;
  mutable int calls_ = 0;
  std::string good_rig_, good_tum_;
};

TEST_F(BadInput, IsRefusedByTheProgramItself) {
  const std::string line =
      std::string("'") + ALIGHT_PROGRAM + "' land --seed abc 2>'" + at("stderr") + "'";
  const int code = std::system(line.c_str());
  ASSERT_TRUE(WIFEXITED(code));
  EXPECT_EQ(WEXITSTATUS(code), 2);
  EXPECT_EQ(read_file(at("stderr")).value_or("").find("alight land: --seed"), 0u);
}

TEST_F(BadInput, Rigs) {
  const std::string none = at("absent.yaml");
  const std::string text = rig_text(alan_rig());
  struct Case {
    std::string path;
    std::vector<std::string> words;
  };
  const auto each = [&](const Case& wrong) {
    const std::string rig = " --rig '" + wrong.path + "'";
    expect_refused("detect '" + at("good.png") + "'" + rig, 1, wrong.words);
    expect_refused("track '" + folder_.string() + "'" + rig, 1, wrong.words);
    expect_refused("land" + rig, 1, wrong.words);
    expect_refused_bare("plan --from=-1,0,0.5" + rig, 1, wrong.words);
  };
  each({none, {"absent.yaml", "no such file"}});
  each({folder_.string(), {"folder"}});
  each({file("rig.yaml", "camera: [1, 2"), {"rig.yaml:"}});
  each({file("rig.yaml", std::string("\x00\xff\xfe", 3)), {"rig.yaml"}});
  each({file("rig.yaml", ""), {"rig.yaml", "camera"}});
  each({file("rig.yaml", text.substr(0, text.size() / 3)), {"rig.yaml"}});
  each({rig_with("readout_ms:", "raedout_ms:"),
        {"rig.yaml:", "raedout_ms", "readout_ms"}});
  each({rig_with("fx: 415.872", "fx: .nan"), {"rig.yaml:", "fx"}});
  each({rig_with("fx: 415.872", "fx: -1"), {"rig.yaml", "fx"}});
  each(
      {rig_with("inertia_kg_m2: [0.0018, 0.0018, 0.003]", "inertia_kg_m2: [1, 1, 100]"),
       {"rig.yaml", "inertia_kg_m2", "other two"}});
  each({file("rig.yaml", text + "safety: {battery_low: 2}\n"),
        {"rig.yaml", "battery_low"}});
}

/// The LEDs moved to these places, colours left out.
std::string rig_with_leds(const std::vector<Vector3>& places) {
  Rig rig = alan_rig();
  rig.leds.leds.clear();
  for (const Vector3& p : places) rig.leds.leds.push_back({p, LedColor::none});
  return rig_text(rig);
}

TEST_F(BadInput, LedsThatNoPictureTellsApart) {
  fs::create_directories(at("flight"));
  fs::copy_file(at("good.png"), at("flight/1.png"));
  const std::string commands[] = {"detect '" + at("good.png") + "'",
                                  "track '" + at("flight") + "'", "land --timeout 1",
                                  "campaign --timeout 1 --seeds 1 "
                                  "--scenario '" +
                                      file("calm.yaml", "") + "'"};
  struct Case {
    std::vector<Vector3> leds;
    std::vector<std::string> words;
  };
  const Case refused[] = {
      {{{0.05, -0.09, 0}, {0.05, -0.04, 0}, {0.05, 0.01, 0}, {0.05, 0.08, 0}},
       {"of a line", "move LED"}},
      {{{0.09, 0, 0}, {0, 0.09, 0}, {-0.09, 0, 0}, {0, -0.09, 0}},
       {"look the same", "move LED"}},
      {{{0.05, -0.003, 0}, {0.05, 0.003, 0}, {0.052, 0, 0.004}, {0.05, 0.001, -0.005}},
       {"too little", "spread them"}},
      {{{0.05, -0.09, 0}, {0.05, 0.09, 0}, {0.05, 0, 0.05}}, {"leds: at least 4"}}};
  for (const Case& bad : refused) {
    std::vector<std::string> words = bad.words;
    words.insert(words.end(), {"odd.yaml: leds: "});
    const std::string rig =
        " --rig '" + file("odd.yaml", rig_with_leds(bad.leds)) + "'";
    for (const std::string& command : commands) {
      expect_refused(command + rig, 1, words);
    }
  }
  // What only costs is told once, and done.
  const std::string flat = file("flat.yaml", rig_with_leds({{0.05, -0.09, -0.04},
                                                            {0.05, -0.02, 0.03},
                                                            {0.05, 0.05, -0.01},
                                                            {0.05, 0.09, 0.04},
                                                            {0.05, 0.03, -0.05}}));
  for (const std::string& command : commands) {
    if (command.rfind("campaign", 0) == 0) continue;
    const Ran ran = run(command + " --rig '" + flat + "'");
    EXPECT_EQ(ran.status, 0) << command << ran.err;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1)
        << command << ran.err;
    EXPECT_NE(ran.err.find("warning: " + flat + ": leds: all stand within"),
              std::string::npos)
        << command << ran.err;
  }
}

TEST_F(BadInput, RigsThatCannotBeLandedOn) {
  const auto pitched = [&](double deg) {
    Rig rig = alan_rig();
    rig.camera.X_NC = optical_from_housing(
        make_pose(from_rpy(0, deg * kDegree, kPi), rig.camera.X_NC.translation()));
    return file("turned.yaml", rig_text(rig));
  };
  const std::string campaign = "campaign --scenario '" +
                               std::string(ALIGHT_SOURCE_DIR) +
                               "/config/scenarios/still.yaml' --seeds 1";
  for (const std::string& command : {std::string("land"), campaign}) {
    expect_refused(command + " --rig '" + pitched(-30) + "'", 1,
                   {"turned.yaml: camera: ", "lower edge", "turn the camera down"});
    expect_refused(command + " --rig '" + pitched(25) + "'", 1,
                   {"turned.yaml: camera: ", "turn the camera up"});
    expect_refused(command + " --rig '" +
                       rig_with("frame_to_use_ms: 30", "frame_to_use_ms: 140") + "'",
                   1,
                   {"rig.yaml: camera: ", "157 ms old", "frame_to_use_ms", "150 ms"});
  }
  const Ran ran = run("land --rig '" + pitched(-24) + "'");
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_NE(ran.err.find("warning: "), std::string::npos) << ran.err;
  EXPECT_NE(ran.err.find("leaning by more than"), std::string::npos) << ran.err;
  EXPECT_NE(ran.out.find("landed"), std::string::npos) << ran.out;
}

TEST_F(BadInput, Scenarios) {
  const auto each = [&](const std::string& text,
                        const std::vector<std::string>& words) {
    expect_refused("land --scenario '" + file("s.yaml", text) + "'", 1, words);
  };
  expect_refused("land --scenario '" + at("absent.yaml") + "'", 1, {"no such file"});
  each("platform: {kind: circle", {"s.yaml:"});
  each("wind: {meen_m_s: 1}", {"s.yaml:1", "meen_m_s", "mean_m_s"});
  each("wind:\n  mean_m_s: .nan\n", {"s.yaml:2", "mean_m_s"});
  each("radio: {loss: 2}", {"s.yaml", "loss"});
  each("platform: {kind: spiral}", {"s.yaml:1", "spiral"});
  each("faults: [{at_s: 1}]", {"s.yaml:1", "kind", "is missing"});
  each("wind: {mean_m_s: 1}\n---\nwind: {mean_m_s: 2}\n", {"s.yaml:3", "second"});
}

/// `text` with the value of each of its lines "key: value" in turn made each of
/// `values`.
std::vector<std::string> spoilt(const std::string& text,
                                const std::vector<std::string>& values) {
  std::vector<std::string> all;
  std::size_t begin = 0;
  for (const std::string_view line : split(text, '\n')) {
    const std::size_t colon = line.find(": ");
    if (colon != std::string_view::npos) {
      for (const std::string& value : values) {
        all.push_back(text);
        all.back().replace(begin + colon + 2, line.size() - colon - 2, value);
      }
    }
    begin += line.size() + 1;
  }
  return all;
}

TEST_F(BadInput, NoKeyOfScenarioOrRigTakesWhatItCannotMean) {
  const std::vector<std::string> values = {"[1]", ".nan", "1e300", "a word"};
  const auto scenarios = spoilt(scenario_text(Scenario{}), values);
  ASSERT_GE(scenarios.size(), 40 * values.size());
  for (const std::string& text : scenarios) {
    expect_refused("land --timeout 1 --scenario '" + file("s.yaml", text) + "'", 1,
                   {"s.yaml"});
  }
  for (const std::string& text : spoilt(rig_text(alan_rig()), values)) {
    expect_refused_bare("plan --from=-1,0,0.5 --rig '" + file("r.yaml", text) + "'", 1,
                        {"r.yaml"});
  }
}

TEST_F(BadInput, RecordedDrives) {
  const std::string scenario =
      "land --scenario '" + file("s.yaml", "platform: {kind: recorded, file: d.csv}") +
      "'";
  expect_refused(scenario, 1, {"s.yaml:1", "d.csv", "no such file"});
  file("d.csv", "t,x,y,z,yaw_deg\n0,0,0,0.26,0\n1,0,0,0.26,west\n");
  expect_refused(scenario, 1, {"d.csv:3", "west"});
  file("d.csv", "t,x,y,z,yaw_deg\n1,0,0,0.26,0\n0,0,0,0.26,0\n");
  expect_refused(scenario, 1, {"d.csv:3", "time"});
}

TEST_F(BadInput, Campaigns) {
  const std::string good = file("good.yaml", scenario_text(Scenario{}));
  const std::string command =
      "campaign --timeout 1 --seeds 1 --scenario '" + good + "'";
  expect_refused("campaign --scenario '" + at("absent.yaml") + "'", 1,
                 {"absent.yaml", "no such file"});
  expect_refused(command + " --scenario '" + good + "'", 1, {"good.yaml", "twice"});
  expect_refused(command + " --rig '" + at("absent.yaml") + "'", 1, {"absent.yaml"});
  const std::string other = file("other.sqlite", std::string(5000, 'x'));
  const std::string taken = file("taken", "a file");
  check(command, run(command + " --out '" + other + "'"), 1, {"other.sqlite", "store"});
  check(command, run(command + " --out '" + taken + "/in'"), 1, {"taken"});
  check(command, run(command + " --plots '" + taken + "'"), 1, {"taken", "folder"});
  EXPECT_EQ(read_file(other).value_or(""), std::string(5000, 'x'));
}

/// What did not land is flown again as it was, whatever the files are called.
TEST_F(BadInput, ScenariosOfOneNameAreReplayedEachByItself) {
  const std::string one = file("a/calm.yaml", "platform: {kind: still}\n");
  const std::string two = file("b/calm.yaml", "platform: {kind: straight}\n");
  std::string command = "campaign --timeout 1 --seeds 1 --no-depth --perfect-rig";
  command += " --scenario '" + one + "' --out '" + at("kept") + "'";
  const Ran single = run(command);
  EXPECT_EQ(single.status, 0) << single.err;
  EXPECT_NE(single.out.find(at("kept") + "/calm_perfect_rig.yaml"), std::string::npos)
      << single.out;
  const Ran both = run(command + " --scenario '" + two + "'");
  EXPECT_EQ(both.status, 0) << both.err;
  std::vector<std::string> kept;
  for (const auto& entry : fs::directory_iterator(at("kept"))) {
    const std::string name = entry.path().filename().string();
    if (name.find("calm_perfect_rig.yaml") == std::string::npos) continue;
    if (name == "calm_perfect_rig.yaml") continue;  // of the first
    kept.push_back(read_file(entry.path().string()).value());
    EXPECT_NE(both.out.find(entry.path().string()), std::string::npos) << both.out;
  }
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_NE(kept[0], kept[1]);
}

TEST_F(BadInput, Pictures) {
  const std::string rig = " --rig '" + good_rig_ + "'";
  const auto both = [&](const std::string& name,
                        const std::vector<std::string>& words) {
    expect_refused("detect '" + at(name) + "'" + rig, 1, words);
    // The good one before the bad: nothing may be left of it.
    expect_refused("detect '" + at("good.png") + "' '" + at(name) + "'" + rig, 1,
                   words);
    const fs::path own = folder_ / ("of_" + name);
    fs::create_directories(own);
    if (fs::exists(at(name))) fs::copy_file(at(name), own / name);
    file("of_" + name + "/frames.csv",
         "t,file\n0," + at("good.png") + "\n1," + at(name) + "\n");
    expect_refused("track '" + own.string() + "'" + rig, 1, words);
  };
  both("absent.png", {"absent.png", "no such file"});
  file("empty.png", "");
  both("empty.png", {"empty.png", "not a picture"});
  file("words.jpg", "not a picture at all");
  both("words.jpg", {"words.jpg", "not a picture"});
  const std::string png = read_file(at("good.png")).value();
  file("cut.png", png.substr(0, png.size() / 2));
  both("cut.png", {"cut.png", "not a picture"});
  std::string flipped = png;
  for (std::size_t i = 60; i < 90; ++i) flipped[i] = static_cast<char>(~flipped[i]);
  file("flipped.png", flipped);
  both("flipped.png", {"flipped.png", "not a picture"});
  file("cut.jpg", std::string("\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01\x01\x00", 14));
  both("cut.jpg", {"cut.jpg", "not a picture"});
  ASSERT_TRUE(save_jpeg(at("whole.jpg"), Image(848, 480, 3, 90).view(), 80));
  EXPECT_EQ(run("detect '" + at("whole.jpg") + "'" + rig).status, 0);
  const std::string jpeg = read_file(at("whole.jpg")).value();
  file("half.jpg", jpeg.substr(0, jpeg.size() / 2));
  both("half.jpg", {"half.jpg", "not a picture"});
  ASSERT_TRUE(save_png(at("small.png"), Image(640, 480, 3).view()));
  both("small.png", {"small.png", "640x480", "848x480"});
}

/// A file's name may hold any bytes, JSON may not.
TEST_F(BadInput, NamesThatAreNotUtf8AreStood) {
  const std::string name = at("good\xff");
  fs::copy_file(at("good.png"), name + ".png");
  fs::copy_file(good_tum_, name + ".tum");
  for (const std::string& line :
       {"detect --json '" + name + ".png' --rig '" + good_rig_ + "'",
        "eval --json '" + name + ".tum' '" + good_tum_ + "'"}) {
    const Ran ran = run(line);
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_NE(ran.out.find("good\xef\xbf\xbd"), std::string::npos) << ran.out;
  }
}

TEST_F(BadInput, Sequences) {
  const std::string rig = " --rig '" + good_rig_ + "'";
  const std::string picture = at("good.png");
  const auto list = [&](const std::string& text,
                        const std::vector<std::string>& words) {
    file("list/frames.csv", text);
    expect_refused("track '" + at("list") + "'" + rig, 1, words);
  };
  list("", {"frames.csv"});
  list("t,file\n", {"frames.csv", "no pictures"});
  list("time,file\n0,a.png\n", {"frames.csv:1", "column t"});
  list("t,file\n0," + picture + "\n0.1\n", {"frames.csv:3", "fields"});
  list("t,file\nnan," + picture + "\n", {"frames.csv:2", "finite"});
  list("t,file\n1," + picture + "\n0.5," + picture + "\n", {"frames.csv:3", "grow"});
  list("t,file\n1,gone.png\n", {"frames.csv:2", "gone.png"});
  list("t,file\n1," + std::string(300, 'n') + "\n", {"frames.csv:2", "too long"});
  list("t,t,file\n0,1," + picture + "\n", {"frames.csv:1", "t twice"});
  list("t,file\n1e30," + picture + "\n", {"frames.csv:2", "seconds"});
  fs::create_directories(at("empty"));
  expect_refused("track '" + at("empty") + "'" + rig, 1, {"empty", "frames.csv"});
  expect_refused("track '" + at("absent") + "'" + rig, 1, {"absent", "no such"});
  expect_refused("track '" + at(std::string(300, 'n')) + "'" + rig, 1, {"too long"});
  expect_refused("track '" + picture + "'" + rig, 1, {"one picture"});
  expect_refused("track '" + good_rig_ + "'" + rig, 1, {"good_rig.yaml", "video"});
  expect_refused("track '" + file("text.mp4", "no video") + "'" + rig, 1,
                 {"text.mp4", "video"});
}

TEST_F(BadInput, Logs) {
  const std::string good = "'" + good_tum_ + "'";
  const auto each = [&](const std::string& text,
                        const std::vector<std::string>& words) {
    const std::string bad = "'" + file("bad.tum", text) + "'";
    expect_refused("eval " + bad + " " + good, 1, words);
    expect_refused("eval " + good + " " + bad, 1, words);
  };
  each("", {"bad.tum", "no poses"});
  each("0 1 2 3\n", {"bad.tum:1", "8"});
  each("0 0 0 nan 0 0 0 1\n", {"bad.tum:1", "nan"});
  each("0 0 0 0 0 0 0 0\n", {"bad.tum:1", "quaternion"});
  each("1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", {"bad.tum:2", "time"});
  each("name\nx,y,z,r,p,y,ori,ms,dpth,t,\n1,2,3,\n", {"bad.tum:3", "fields"});
  each("name\nx,y,z\n", {"bad.tum:2", "header"});
  each("90 0 0 0 0 0 0 1\n", {"--max-dt"});
  expect_refused("eval '" + at("absent") + "' " + good, 1, {"absent", "no such file"});
}

TEST_F(BadInput, Arguments) {
  const std::string rig = " --rig '" + good_rig_ + "'";
  const std::string picture = " '" + at("good.png") + "'";
  for (const std::string& wrong :
       {std::string(),
        std::string("fly"),
        std::string("land --seed x"),
        std::string("land --seed -1"),
        std::string("land --seed 99999999999999999999999"),
        std::string("land --seed 0x10"),
        std::string("land --seed 1 --seed 2"),
        std::string("land --seed"),
        std::string("land --out ''"),
        std::string("land --rig ''"),
        std::string("land --scenario ''"),
        std::string("campaign --scenario x --rig ''"),
        std::string("measure --rig ''"),
        std::string("measure --frames 0"),
        std::string("measure --seeds 0"),
        std::string("measure --jobs -1"),
        std::string("render --out x --lights -1"),
        std::string("render --out x --stray 100000"),
        std::string("render --out x --range-m 0"),
        std::string("render --out x --dead 99"),
        std::string("campaign"),
        std::string("campaign --scenario x --seeds 0"),
        std::string("campaign --scenario x --seeds many"),
        std::string("campaign --scenario x --first-seed -1"),
        std::string("campaign --scenario x --timeout nan"),
        std::string("campaign --scenario x --jobs -1"),
        std::string("land --profile other"),
        std::string("land --timeout nan"),
        std::string("land --scenario"),
        std::string("land extra"),
        "detect" + rig,
        "detect" + picture,
        "detect --picture" + picture + rig,
        "plan" + rig,
        "plan --from 1,2" + rig,
        "plan --from 1,2,x" + rig,
        "plan --from 1,2,3,4" + rig,
        "plan --from=nan,0,1" + rig,
        "plan --from=-1,0,1 --platform-speed=inf" + rig,
        "track" + rig,
        "track x --method other" + rig,
        "track x --method nonsense" + rig,
        "eval '" + good_tum_ + "'",
        "eval '" + good_tum_ + "' '" + good_tum_ + "' --align sim3",
        "eval '" + good_tum_ + "' '" + good_tum_ + "' --max-dt -1",
        "eval '" + good_tum_ + "' '" + good_tum_ + "' --max-dt nan"}) {
    const Ran ran = run(wrong);
    EXPECT_EQ(ran.status, 2) << wrong << "\n" << ran.err;
    EXPECT_EQ(ran.out, "") << wrong;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << wrong << ran.err;
    EXPECT_NE(ran.err.find("--help"), std::string::npos) << wrong << ran.err;
  }
}

TEST_F(BadInput, DistancesBetweenLedsThereAreNot) {
  const std::string command = "calibrate constellation '" + at("absent") + "' --rig '" +
                              good_rig_ + "' --distance ";
  expect_refused(command + "0,9=0.1", 1, {"distance 0,9", "0 to 5"});
  expect_refused(command + "1,1=0.1", 1, {"distance 1,1", "two different ones"});
  expect_refused(command + "0,5=165", 1, {"distance 0,5", "metres?"});
}

TEST_F(BadInput, ALostStandardOutputIsNoSuccess) {
  for (const char* command :
       {"plan --from=-1.2,0,0.8 --json", "plan --from=-1.2,0,0.8"}) {
    const std::string line = std::string("'") + ALIGHT_PROGRAM + "' " + command +
                             " --rig '" + good_rig_ + "' >/dev/full 2>'" +
                             at("stderr") + "'";
    const int code = std::system(line.c_str());
    ASSERT_TRUE(WIFEXITED(code));
    EXPECT_EQ(WEXITSTATUS(code), 1) << line;
    EXPECT_NE(read_file(at("stderr")).value_or("").find("standard output"),
              std::string::npos)
        << line;
  }
}

TEST_F(BadInput, UnknownCommandsAreNamed) {
  const Ran ran = run("lamd --seed 3");
  EXPECT_EQ(ran.status, 2);
  EXPECT_EQ(ran.err.find("alight: 'lamd' is not one of land"), 0u) << ran.err;
  EXPECT_NE(ran.err.find("did you mean 'land'?"), std::string::npos) << ran.err;
}

/// Refused before the work, not after it.
TEST_F(BadInput, FilesThatCannotBeWritten) {
  const std::string taken = file("taken", "a file"), rig = " --rig '" + good_rig_ + "'";
  fs::create_directories(at("folder"));
  fs::create_directories(at("flight"));
  fs::copy_file(at("good.png"), at("flight/1.png"));
  for (const std::string& line :
       {"calibrate constellation '" + at("flight") + "'" + rig + " --out",
        "calibrate mount --parked '" + at("flight") + "'" + rig + " --out",
        "calibrate camera --board 9x6 --square-mm 25 '" + at("flight") + "'" + rig +
            " --out",
        std::string("measure --frames 36000 --seeds 1000000 --rows"),
        std::string("reproduce circle --out"),
        std::string("reproduce circle --figure")}) {
    check(line, run(line + " '" + at("folder") + "'"), 1,
          {"folder", "a file is needed"});
    check(line, run(line + " '" + at(std::string(300, 'n')) + "'"), 1, {"too long"});
    check(line, run(line + " '" + taken + "/x'"), 1, {"taken", "a folder is needed"});
  }
}

TEST_F(BadInput, FoldersThatCannotBeWritten) {
  const std::string in_the_way = file("taken", "a file where a folder should be");
  const std::string commands[] = {
      "detect '" + at("good.png") + "' --rig '" + good_rig_ + "'", "land",
      "track '" + at("") + "' --rig '" + good_rig_ + "'",
      "eval '" + good_tum_ + "' '" + good_tum_ + "'"};
  for (const std::string& command : commands) {
    for (const char* more : {"", " --json"}) {
      for (const char* below : {"", "/below"}) {
        const std::string line = command + more + " --out '" + in_the_way + below + "'";
        check(line, run(line), 1, {"taken"});
      }
      const std::string long_name = at(std::string(300, 'n'));
      const std::string line = command + more + " --out '" + long_name + "'";
      check(line, run(line), 1, {"too long"});
    }
  }
}

}  // namespace
}  // namespace alight
