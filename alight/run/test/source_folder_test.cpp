#include "alight/run/source_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "alight/io/files.h"

namespace alight {
namespace {

namespace fs = std::filesystem;

TEST(SourceFolder, NothingOfAnEarlierRecordingIsLeftAndNothingElseTouched) {
  const fs::path folder =
      fs::temp_directory_path() / ("alight_source_" + std::to_string(getpid()));
  const char* ours[] = {"frames.csv",      "sequence.json",    "truth.tum",
                        "rig.yaml",        "color_000012.png", "depth_000012.png",
                        "frame_00003.jpg", "rig_true.yaml"};
  const char* others[] = {"color_of_it.png", "notes.txt", "frame_.png", "IMG_0001.jpg",
                          "color_000012.tif"};
  for (const char* name : ours) ASSERT_TRUE(write_file((folder / name).string(), "x"));
  for (const char* name : others) {
    ASSERT_TRUE(write_file((folder / name).string(), "x"));
  }
  ASSERT_TRUE(begin_source(folder.string()));
  for (const char* name : ours) EXPECT_FALSE(fs::exists(folder / name)) << name;
  for (const char* name : others) EXPECT_TRUE(fs::exists(folder / name)) << name;
  fs::remove_all(folder);
}

TEST(SourceFolder, APersonsOwnPicturesAreLeftAlone) {
  const fs::path folder =
      fs::temp_directory_path() / ("alight_own_" + std::to_string(getpid()));
  const char* own[] = {"frame_00003.png", "color_000012.png", "drive.csv"};
  for (const char* name : own) ASSERT_TRUE(write_file((folder / name).string(), "x"));
  ASSERT_TRUE(begin_source(folder.string()));
  for (const char* name : own) EXPECT_TRUE(fs::exists(folder / name)) << name;
  fs::remove_all(folder);
}

TEST(SourceFolder, IsMade) {
  const fs::path folder =
      fs::temp_directory_path() / ("alight_made_" + std::to_string(getpid())) / "below";
  ASSERT_TRUE(begin_source(folder.string()));
  EXPECT_TRUE(fs::is_directory(folder));
  fs::remove_all(folder.parent_path());
}

TEST(SourceFolder, AFileInItsPlaceIsTold) {
  const fs::path file =
      fs::temp_directory_path() / ("alight_taken_" + std::to_string(getpid()));
  ASSERT_TRUE(write_file(file.string(), "x"));
  const auto begun = begin_source(file.string());
  ASSERT_FALSE(begun);
  EXPECT_NE(begun.error().detail.find(file.string()), std::string::npos);
  fs::remove(file);
}

}  // namespace
}  // namespace alight
