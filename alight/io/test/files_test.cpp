#include "alight/io/files.h"

#include <nlohmann/json.hpp>

#include "alight/io/json_text.h"
#include "scratch.h"

namespace alight {
namespace {

class Files : public Scratch {
 protected:
  /// What is said of a path, without the scratch folder.
  template <class T>
  std::string said(const Result<T>& result) const {
    if (result) return "";
    const std::string& detail = result.error().detail;
    EXPECT_EQ(detail.find(path("")), 0u) << detail;
    return detail.substr(std::min(detail.size(), path("").size()));
  }
  const std::string long_name_ = std::string(300, 'n');
};

TEST_F(Files, ReadBackAsWritten) {
  const std::string bytes("a\0\n\xff", 4);
  ASSERT_TRUE(write_file(path("below/f"), bytes));
  EXPECT_EQ(read_file(path("below/f")).value_or("not read"), bytes);
  EXPECT_EQ(said(find_file(path("below/f"))), "");
}

TEST_F(Files, WhatIsNoFileIsNamed) {
  file("f", "");
  EXPECT_EQ(said(read_file(path("none"))), "none: no such file");
  EXPECT_EQ(said(find_file(path("f/x"))), "f/x: no such file");
  EXPECT_EQ(said(find_file(path("."))), ".: is a folder, a file is needed");
  EXPECT_EQ(said(read_file(path(long_name_))), long_name_ + ": File name too long");
}

/// Told before the work, not after it.
TEST_F(Files, PlacesThatCannotBeWrittenAreRefused) {
  file("f", "");
  EXPECT_EQ(said(check_folder(path("a/b"))), "");
  EXPECT_EQ(said(check_file(path("a/b"))), "");
  EXPECT_EQ(said(check_folder(path("f/a"))), "f: is a file, a folder is needed");
  for (const std::string& name : {long_name_, long_name_ + "/below"}) {
    EXPECT_EQ(said(check_folder(path(name))), name + ": File name too long");
    EXPECT_EQ(said(check_file(path(name))), name + ": File name too long");
    EXPECT_EQ(said(make_folder(path(name))).substr(0, name.size() + 2), name + ": ");
    EXPECT_NE(said(write_file(path(name), "text")), "");
  }
  std::filesystem::create_symlink(path("circle"), path("circle"));
  EXPECT_EQ(said(check_folder(path("circle"))).substr(0, 8), "circle: ");
  EXPECT_EQ(said(check_file(path("circle"))).substr(0, 8), "circle: ");
  EXPECT_EQ(said(make_folder(path("circle"))).substr(0, 8), "circle: ");
}

TEST(JsonText, StandsNamesThatAreNotUtf8) {
  const nlohmann::json named{{"file", "a\xff.png"}};
  EXPECT_EQ(json_text(named), "{\"file\":\"a\xef\xbf\xbd.png\"}");
}

}  // namespace
}  // namespace alight
